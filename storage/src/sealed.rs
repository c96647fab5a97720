//! Files of unfinished work: replaced again and again, each with its own SHA-256 in the first line.

use crate::error::FileError;
use crate::sums::digest;
use crate::whole;
use std::io::ErrorKind;
use std::path::Path;

/// The largest that is kept, bytes: the weights of the largest network with what the optimiser knows of them, four times
/// 256 MB, and the steps of the longest training.
const BYTES_MAX: u64 = 2_000_000_000;
const REMEDY: &str = "delete it to begin this piece of work again";

/// The first line: a comment in TOML.
fn header(content: &[u8]) -> String {
    format!("# sha256 {}\n", digest(content))
}

/// Writes a file whole, in place of what is there.
///
/// # Errors
/// If it cannot be written.
pub fn write(path: &Path, content: &[u8]) -> Result<(), FileError> {
    whole::write_parts(path, &[header(content).as_bytes(), content])
}

/// Reads a file that may be as large as a training under way, 2 GB; `None` if there is none.
///
/// # Errors
/// See [`read_up_to`].
pub fn read(path: &Path) -> Result<Option<Vec<u8>>, FileError> {
    read_up_to(path, BYTES_MAX)
}

/// Reads a file of at most this many bytes, its first line included; `None` if there is none.
///
/// # Errors
/// If it cannot be read, is not a regular file, is too large, or is not what was written.
pub fn read_up_to(path: &Path, bytes_max: u64) -> Result<Option<Vec<u8>>, FileError> {
    let mut bytes = match crate::read::bytes(path, bytes_max) {
        Ok(bytes) => bytes,
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
        Err(error) => return Err(FileError::unreadable(path, &error, REMEDY)),
    };
    let length = header(&[]).len();
    if bytes.len() < length || bytes[..length] != *header(&bytes[length..]).as_bytes() {
        return Err(FileError::new(path, "is damaged: its SHA-256 is not that in its first line", REMEDY));
    }
    bytes.drain(..length);
    Ok(Some(bytes))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn damage_is_noticed_and_absence_is_no_damage() {
        let path = std::env::temp_dir().join(format!("storage-test-{}-sealed", std::process::id()));
        assert_eq!(read(&path).unwrap(), None);
        write(&path, b"half of it").unwrap();
        assert_eq!(read(&path).unwrap().as_deref(), Some(&b"half of it"[..]));
        let whole = fs::read(&path).unwrap();
        for length in [0, 10, whole.len() - 1] {
            fs::write(&path, &whole[..length]).unwrap();
            assert!(read(&path).unwrap_err().to_string().contains("damaged"), "{length}");
        }
        whole::remove(&path).unwrap();
        whole::remove(&path).unwrap();
    }

    /// Three lines that said how far an evaluation was were read to 2 GB.
    #[test]
    fn a_small_file_is_not_read_as_far_as_the_largest() {
        let path = std::env::temp_dir().join(format!("storage-test-{}-sealed-small", std::process::id()));
        write(&path, b"how far it is").unwrap();
        let bytes = fs::metadata(&path).unwrap().len();
        assert_eq!(read_up_to(&path, bytes).unwrap().as_deref(), Some(&b"how far it is"[..]));
        let refused = read_up_to(&path, bytes - 1).unwrap_err().to_string();
        assert!(refused.contains(&format!("at most {} are read", bytes - 1)), "{refused}");
        whole::remove(&path).unwrap();
    }
}
