//! Messages as bytes: each is its length (u32, little endian) and its postcard.

use crate::Message;
use std::io::{Error, ErrorKind, Read, Result, Write};

/// A longer message is a broken pipe, not a message.
pub const MESSAGE_BYTES_MAX: usize = 64 << 20;

/// Writes one message.
///
/// # Errors
/// If the pipe is broken.
pub fn write(pipe: &mut impl Write, message: &Message) -> Result<()> {
    let bytes = postcard::to_stdvec(message).map_err(Error::other)?;
    let length = u32::try_from(bytes.len()).map_err(Error::other)?;
    pipe.write_all(&length.to_le_bytes())?;
    pipe.write_all(&bytes)
}

/// Reads the next message; `None` at the end.
///
/// # Errors
/// If the pipe breaks within a message, or holds something else.
pub fn read(pipe: &mut impl Read) -> Result<Option<Message>> {
    let mut length = [0; 4];
    match pipe.read_exact(&mut length) {
        Err(error) if error.kind() == ErrorKind::UnexpectedEof => return Ok(None),
        result => result?,
    }
    let length = u32::from_le_bytes(length) as usize;
    if length > MESSAGE_BYTES_MAX {
        return Err(Error::new(ErrorKind::InvalidData, format!("a message of {length} bytes: not from this bench")));
    }
    let mut bytes = vec![0; length];
    pipe.read_exact(&mut bytes)?;
    postcard::from_bytes(&bytes).map(Some).map_err(|error| Error::new(ErrorKind::InvalidData, error))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Clock, Mark, Shape};

    #[test]
    fn messages_are_read_back_in_order() {
        let at = |tick| Message::At {
            recording: 3,
            clock: Clock::Episode { tick, time_s: 0.05 },
            marks: vec![
                Mark::new("car/speed", Shape::Value(1.25)),
                Mark::new("car", Shape::State("expert".to_owned())),
            ],
        };
        let messages = [at(0), at(1), Message::End { recording: 3 }];
        let mut pipe = Vec::new();
        for message in &messages {
            write(&mut pipe, message).unwrap();
        }
        let mut rest = pipe.as_slice();
        let read_back: Vec<Message> = std::iter::from_fn(|| read(&mut rest).unwrap()).collect();
        assert_eq!(read_back, messages);
    }

    #[test]
    fn what_is_no_message_is_refused() {
        let mut pipe = Vec::new();
        write(&mut pipe, &Message::End { recording: 1 }).unwrap();
        assert!(read(&mut &pipe[..5]).is_err(), "cut within a message");
        assert!(read(&mut &[0xFF; 8][..]).unwrap_err().to_string().contains("not from this bench"));
    }
}
