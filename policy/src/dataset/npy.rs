//! Arrays from NPY files and archives of them. What a file says about its shape is compared with what is expected before
//! anything is allocated for it.

use crate::files::{self, FileError, RESTORE_REMEDY};
use ndarray::{Array, Dimension};
use ndarray_npy::{ReadNpyExt as _, ReadableElement};
use sim::limits::HEADER_BYTES_MAX;
use std::io::{Cursor, Read};
use std::path::{Path, PathBuf};
use zip::ZipArchive;

/// Bytes of an element at most, of all that are read here.
const ELEMENT_BYTES_MAX: u64 = 4;

/// The array of a file.
pub(crate) fn read<T: ReadableElement, D: Dimension>(
    path: &Path,
    expected: &[usize],
) -> Result<Array<T, D>, FileError> {
    let fail = |problem: String| FileError::new(path, problem, RESTORE_REMEDY);
    let mut file = files::open(path, bytes_max(expected))?;
    let header = checked_header(&mut file, expected).map_err(fail)?;
    let found = file.get_ref().len() as u64;
    if found < elements(expected).saturating_mul(size_of::<T>() as u64) {
        return Err(fail(format!("{found} bytes are too few for the shape {expected:?}")));
    }
    Array::read_npy(header.as_slice().chain(file)).map_err(|error| fail(error.to_string()))
}

/// An archive of arrays by name.
pub(crate) struct Archive {
    path: PathBuf,
    zip: ZipArchive<Cursor<Vec<u8>>>,
}

impl Archive {
    /// Opens an archive that is no larger than the arrays expected in it.
    pub(crate) fn open(path: &Path, expected: &[&[usize]]) -> Result<Self, FileError> {
        let file = files::open(path, expected.iter().map(|shape| bytes_max(shape)).sum())?;
        let zip = ZipArchive::new(file).map_err(|error| FileError::new(path, error, RESTORE_REMEDY))?;
        Ok(Self { path: path.to_owned(), zip })
    }

    /// One of its arrays.
    pub(crate) fn read<T: ReadableElement, D: Dimension>(
        &mut self,
        name: &str,
        expected: &[usize],
    ) -> Result<Array<T, D>, FileError> {
        let mut read = || {
            // As numpy names them.
            let member = self.zip.by_name(&format!("{name}.npy")).map_err(|error| error.to_string())?;
            unpack(member, expected)
        };
        read().map_err(|problem| FileError::new(&self.path, format!("{name}: {problem}"), RESTORE_REMEDY))
    }
}

/// The array of a source that may go on for much longer than it.
fn unpack<T: ReadableElement, D: Dimension>(mut source: impl Read, expected: &[usize]) -> Result<Array<T, D>, String> {
    let header = checked_header(&mut source, expected)?;
    // What reads the array would read all that follows it, to complain of it.
    let rest = source.take(bytes_max(expected));
    Array::read_npy(header.as_slice().chain(rest)).map_err(|error| error.to_string())
}

fn elements(shape: &[usize]) -> u64 {
    shape.iter().fold(1, |product, &length| product.saturating_mul(length as u64))
}

/// Size of a file with an array of this shape at most.
fn bytes_max(shape: &[usize]) -> u64 {
    elements(shape).saturating_mul(ELEMENT_BYTES_MAX).saturating_add(HEADER_BYTES_MAX)
}

/// The header of an array that has the shape that is expected.
fn checked_header(source: &mut impl Read, expected: &[usize]) -> Result<Vec<u8>, String> {
    let header = header(source)?;
    let found = shape(&header).ok_or("it is not an NPY array")?;
    if found == expected { Ok(header) } else { Err(format!("shape {found:?} instead of {expected:?}")) }
}

/// Everything before the data: 6 bytes of magic, 2 of version, the length of the text in 2 (version 1) or 4, the text.
fn header(source: &mut impl Read) -> Result<Vec<u8>, String> {
    let mut read = |bytes: usize, header: &mut Vec<u8>| {
        let start = header.len();
        header.resize(start + bytes, 0);
        source.read_exact(&mut header[start..]).map_err(|error| error.to_string())
    };
    let mut header = Vec::new();
    read(8, &mut header)?;
    let width = match (&header[..6], header[6]) {
        (b"\x93NUMPY", 1) => 2,
        (b"\x93NUMPY", 2 | 3) => 4,
        _ => return Err("it is not an NPY array".to_owned()),
    };
    read(width, &mut header)?;
    let length = header[8..].iter().rev().fold(0, |length, &byte| length << 8 | u64::from(byte));
    if length > HEADER_BYTES_MAX {
        return Err(format!("a header of {length} bytes; at most {HEADER_BYTES_MAX} are read"));
    }
    read(length as usize, &mut header)?;
    Ok(header)
}

/// The shape that a header names, as in `'shape': (5, 79), `.
fn shape(header: &[u8]) -> Option<Vec<usize>> {
    let text = String::from_utf8_lossy(header);
    let (_, rest) = text.split_once("'shape'")?;
    let (list, _) = rest.split_once('(')?.1.split_once(')')?;
    let numbers = list.split(',').map(str::trim).filter(|number| !number.is_empty());
    numbers.map(|number| number.parse().ok()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_data::scratch;
    use ndarray::{Array2, Array3, Ix2};
    use ndarray_npy::{NpzWriter, WriteNpyExt as _};

    fn refused(path: &Path, expected: &[usize]) -> String {
        read::<u8, Ix2>(path, expected).unwrap_err().to_string()
    }

    /// It allocated what the header asked for, and the process was aborted.
    #[test]
    fn a_forged_shape_is_refused_before_memory_is_taken_for_it() {
        let folder = scratch("forged");
        files::create_folder(&folder).unwrap();
        let path = folder.join("grids.npy");
        let listed = || storage::sums::list_all(&folder).unwrap();
        ndarray_npy::write_npy(&path, &Array2::<u8>::zeros([5, 79])).unwrap();
        listed();
        assert_eq!(read::<u8, Ix2>(&path, &[5, 79]).unwrap().dim(), (5, 79));
        assert!(refused(&path, &[4, 79]).contains("shape [5, 79] instead of [4, 79]"));
        let whole = std::fs::read(&path).unwrap();
        let at = whole.windows(7).position(|part| part == b"(5, 79)").unwrap();
        for (forged, part) in
            [("(5000000000000, 7)", "shape [5000000000000, 7]"), ("(-1, 79)", "not an NPY"), ("[", "not an NPY")]
        {
            let mut bytes = whole.clone();
            bytes[at..at + forged.len()].copy_from_slice(forged.as_bytes());
            std::fs::write(&path, bytes).unwrap();
            listed();
            assert!(refused(&path, &[5, 79]).contains(part), "{forged}: {}", refused(&path, &[5, 79]));
        }
        // The record of the round may be forged as well.
        let mut bytes = whole.clone();
        bytes[at..at + 17].copy_from_slice(b"(5000000000000,) ");
        std::fs::write(&path, bytes).unwrap();
        listed();
        assert!(refused(&path, &[5_000_000_000_000]).contains("too few"), "{}", refused(&path, &[5_000_000_000_000]));
        std::fs::write(&path, [&b"\x93NUMPY\x02\0"[..], &[0xff; 4]].concat()).unwrap();
        listed();
        assert!(refused(&path, &[5, 79]).contains("4294967295 bytes"), "{}", refused(&path, &[5, 79]));
        std::fs::write(&path, vec![0; 70_000]).unwrap();
        listed();
        assert!(refused(&path, &[5, 79]).contains("at most 67"), "{}", refused(&path, &[5, 79]));
        std::fs::remove_dir_all(folder).unwrap();
    }

    /// Gigabytes of zeros behind an array of the right shape, which pack well, were unpacked.
    #[test]
    fn what_follows_an_array_is_not_read_to_its_end() {
        /// Zeros, of which more are asked for than anybody needs.
        struct Endless(usize);
        impl Read for Endless {
            fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
                self.0 += buffer.len();
                assert!(self.0 < 1 << 20, "{} bytes were asked for", self.0);
                buffer.fill(0);
                Ok(buffer.len())
            }
        }
        let mut array = Vec::new();
        Array2::<u8>::ones([5, 79]).write_npy(&mut array).unwrap();
        assert_eq!(unpack::<u8, Ix2>(array.as_slice(), &[5, 79]).unwrap(), Array2::<u8>::ones([5, 79]));
        assert!(unpack::<u8, Ix2>(array.chain(Endless(0)), &[5, 79]).is_err());
    }

    /// 18 MB of them became 5 GB.
    #[test]
    fn an_archive_that_would_unpack_to_more_than_expected_is_refused() {
        let folder = scratch("bomb");
        files::create_folder(&folder).unwrap();
        let path = folder.join("noise_augmentations.npz");
        let mut archive = NpzWriter::new_compressed(std::fs::File::create(&path).unwrap());
        archive.add_array("noise_augmentations", &Array3::<u8>::zeros([1000, 20, 79])).unwrap();
        archive.finish().unwrap();
        storage::sums::list_all(&folder).unwrap();
        let read = |expected: [usize; 3]| {
            let mut archive = Archive::open(&path, &[&expected])?;
            archive.read::<u8, ndarray::Ix3>("noise_augmentations", &expected)
        };
        assert_eq!(read([1000, 20, 79]).unwrap().len(), 1_580_000);
        let error = read([1000, 2, 79]).unwrap_err().to_string();
        assert!(error.contains("shape [1000, 20, 79] instead of [1000, 2, 79]"), "{error}");
        std::fs::remove_dir_all(folder).unwrap();
    }
}
