//! What an ONNX file must be before the runtime reads it: protocol buffers whose parts lie within each other.
//!
//! The runtime trusts what it reads. At a length of 2⁶³ and more it skips backwards and reads the same bytes for ever, at a
//! number of more than ten bytes it does not move at all; nested deeply enough, graphs within graphs overflow its stack,
//! which nothing catches; and many empty parts take many times the memory of the file.

use sim::limits::{ONNX_FIELDS_MAX, ONNX_NESTING_MAX};

/// The messages of an ONNX file that hold others, by the names of its schema.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Message {
    Model,
    Graph,
    Node,
    Attribute,
    Tensor,
    ValueInfo,
    Type,
    SequenceType,
    TensorType,
    Shape,
    /// A message of numbers and texts only.
    Plain,
    /// Not a message, but whole numbers one after the other.
    Numbers,
}

impl Message {
    /// What a field of it holds, if that is a message.
    fn within(self, field: u64) -> Option<Self> {
        Some(match (self, field) {
            (Self::Model, 7) | (Self::Attribute, 6) => Self::Graph,
            (Self::Graph, 1) => Self::Node,
            (Self::Graph | Self::Attribute, 5) => Self::Tensor,
            (Self::Graph, 11..=13) => Self::ValueInfo,
            (Self::Node, 5) => Self::Attribute,
            (Self::ValueInfo, 2) | (Self::SequenceType, 1) => Self::Type,
            (Self::Type, 1) => Self::TensorType,
            (Self::Type, 4) => Self::SequenceType,
            (Self::TensorType, 2) => Self::Shape,
            (Self::Model, 8 | 14) | (Self::Tensor, 13) | (Self::Shape, 1) => Self::Plain,
            (Self::Tensor, 5 | 7) => Self::Numbers,
            _ => return None,
        })
    }
}

/// Checks that all parts lie within each other, and how many there are.
///
/// # Errors
/// Saying what is wrong.
pub(crate) fn check(file: &[u8]) -> Result<(), String> {
    let mut open = vec![(Message::Model, file)];
    let mut fields = 0;
    while let Some((message, rest)) = open.last_mut() {
        if rest.is_empty() {
            open.pop();
            continue;
        }
        fields += 1;
        if fields > ONNX_FIELDS_MAX {
            return Err(format!("has more than {ONNX_FIELDS_MAX} fields"));
        }
        let found = if *message == Message::Numbers { varint(rest).map(|_| (0, &[][..])) } else { next(rest) };
        let (field, content) = found.ok_or("is not a network that can be run: a part is longer than what holds it")?;
        if let Some(inner) = message.within(field) {
            if open.len() == ONNX_NESTING_MAX {
                return Err(format!("is nested more than {ONNX_NESTING_MAX} deep"));
            }
            open.push((inner, content));
        }
    }
    Ok(())
}

/// Number and content of the next field; numbers have none.
fn next<'a>(rest: &mut &'a [u8]) -> Option<(u64, &'a [u8])> {
    let tag = varint(rest)?;
    let mut content = &[][..];
    match tag & 7 {
        0 => drop(varint(rest)?),
        1 => drop(rest.split_off(..8)?),
        2 => {
            let length = usize::try_from(varint(rest)?).ok()?;
            content = rest.split_off(..length)?;
        }
        // Groups, which nothing makes: what they hold are fields as any others.
        3 | 4 => (),
        5 => drop(rest.split_off(..4)?),
        _ => return None,
    }
    Some((tag >> 3, content))
}

/// A number of up to 64 bits, seven in a byte, the lowest first; the highest bit of all bytes but the last is set.
fn varint(rest: &mut &[u8]) -> Option<u64> {
    let mut value = 0;
    for shift in (0..u64::BITS).step_by(7) {
        let byte = *rest.split_off_first()?;
        value |= u64::from(byte & 0x7F) << shift;
        if byte < 0x80 {
            // Of the tenth byte, one bit is left.
            return (shift < 63 || byte < 2).then_some(value);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use rten_onnx::protobuf::varint::{MAX_VARINT_LEN, encode_varint};

    fn encoded(value: u64) -> Vec<u8> {
        encode_varint(value, &mut [0; MAX_VARINT_LEN]).to_vec()
    }

    /// A field of content.
    fn field(number: u64, content: &[u8]) -> Vec<u8> {
        [encoded((number << 3) | 2), encoded(content.len() as u64), content.to_vec()].concat()
    }

    #[test]
    fn a_length_beyond_what_holds_it_is_refused() {
        let sound = field(7, &field(1, &field(3, b"name")));
        assert_eq!(check(&sound), Ok(()));
        for length in [5, 1 << 32, 1 << 63, u64::MAX - 11] {
            let forged = [encoded((3 << 3) | 2), encoded(length), b"name".to_vec()].concat();
            for file in [field(7, &field(1, &forged)), forged] {
                let error = check(&file).unwrap_err();
                assert!(error.contains("longer than what holds it"), "{length}: {error}");
            }
        }
        for cut in 1..sound.len() {
            assert!(check(&sound[..cut]).is_err(), "cut to {cut} bytes");
        }
    }

    #[test]
    fn numbers_have_up_to_64_bits() {
        for value in [0, 1, 127, 128, 300, u64::MAX - 1, u64::MAX] {
            let bytes = [encoded(value), vec![7]].concat();
            let mut rest = &bytes[..];
            assert_eq!((varint(&mut rest), rest), (Some(value), &[7][..]));
        }
        let too_long = [&[0xFF; 10][..], &[0x01]].concat();
        let too_large = [&[0xFF; 9][..], &[0x02]].concat();
        for forged in [&too_long[..], &too_large, &[0xFF; 4]] {
            assert_eq!(varint(&mut &*forged), None);
            assert!(check(forged).is_err(), "a tag");
            // Integers of a tensor, one after the other.
            for numbers in [5, 7] {
                assert!(check(&field(7, &field(5, &field(numbers, forged)))).is_err(), "{forged:?}");
            }
        }
        assert_eq!(check(&field(7, &field(5, &field(7, &[1, 0xFF, 0x01, 3])))), Ok(()));
    }

    #[test]
    fn graphs_within_graphs_have_an_end() {
        let nested =
            |times: u32| field(7, &(0..times).fold(Vec::new(), |graph, _| field(1, &field(5, &field(6, &graph)))));
        assert_eq!(check(&nested(30)), Ok(()));
        assert!(check(&nested(40)).unwrap_err().contains("nested more than"));
        assert!(check(&nested(3000)).unwrap_err().contains("nested more than"));
    }

    #[test]
    fn many_empty_parts_are_refused() {
        let empty = field(1, &[]).repeat(ONNX_FIELDS_MAX + 1);
        assert!(check(&field(7, &empty)).unwrap_err().contains("fields"));
    }
}
