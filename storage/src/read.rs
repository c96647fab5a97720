//! Reading files of bounded size.

use std::fs::File;
use std::io::{self, Read as _};
use std::path::Path;

/// Opens a regular file of at most this many bytes.
///
/// # Errors
/// If it cannot be opened, is a device, a pipe or a folder, or is larger.
pub fn open(path: &Path, bytes_max: u64) -> io::Result<File> {
    open_with_length(path, bytes_max).map(|(file, _)| file)
}

/// [`open`], and how many bytes the system says that the file has.
fn open_with_length(path: &Path, bytes_max: u64) -> io::Result<(File, u64)> {
    // Asked first: to open a pipe is to wait for whoever writes into it.
    let about = std::fs::metadata(path)?;
    if about.is_dir() {
        return Err(io::Error::other("it is a folder"));
    }
    if !about.is_file() {
        return Err(io::Error::other("it is not a regular file"));
    }
    if about.len() > bytes_max {
        return Err(too_large(about.len(), bytes_max));
    }
    Ok((File::open(path)?, about.len()))
}

/// Whether a file is in a folder or in one below, links followed: a file that comes from elsewhere must not make this program
/// read whatever its author names.
///
/// # Errors
/// If one of them is not there.
pub fn is_below(folder: &Path, file: &Path) -> io::Result<bool> {
    Ok(file.canonicalize()?.starts_with(Path::new(".").join(folder).canonicalize()?))
}

/// The content of a regular file of at most this many bytes.
///
/// # Errors
/// See [`open`]; or if it cannot be read.
pub fn bytes(path: &Path, bytes_max: u64) -> io::Result<Vec<u8>> {
    let (file, length) = open_with_length(path, bytes_max)?;
    let mut content = Vec::new();
    content.try_reserve_exact(usize::try_from(length).map_err(io::Error::other)?)?;
    // A file can grow, and some of the system's say that they are empty.
    let read = file.take(bytes_max.saturating_add(1)).read_to_end(&mut content)? as u64;
    if read > bytes_max { Err(too_large(read, bytes_max)) } else { Ok(content) }
}

/// The text of a regular file of at most this many bytes.
///
/// # Errors
/// See [`bytes`]; or if it is not UTF-8.
pub fn text(path: &Path, bytes_max: u64) -> io::Result<String> {
    String::from_utf8(bytes(path, bytes_max)?).map_err(|error| {
        let at = error.utf8_error().valid_up_to();
        io::Error::new(io::ErrorKind::InvalidData, format!("it is not text: byte {at} is not UTF-8"))
    })
}

fn too_large(bytes: u64, bytes_max: u64) -> io::Error {
    let text = format!("it has {bytes} bytes or more; at most {bytes_max} are read");
    io::Error::new(io::ErrorKind::FileTooLarge, text)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(path: &str, bytes_max: u64) -> String {
        text(Path::new(path), bytes_max).unwrap_err().to_string()
    }

    #[test]
    fn files_are_read_up_to_their_limit() {
        let file = std::env::temp_dir().join(format!("storage-test-{}-read", std::process::id()));
        std::fs::write(&file, "seven\n\n").unwrap();
        assert_eq!(text(&file, 7).unwrap(), "seven\n\n");
        assert!(refused(file.to_str().unwrap(), 6).contains("7 bytes or more; at most 6"));
        std::fs::write(&file, b"bar\xe9").unwrap();
        assert!(refused(file.to_str().unwrap(), 7).contains("byte 3 is not UTF-8"));
        std::fs::remove_file(&file).unwrap();
        assert!(refused(std::env::temp_dir().to_str().unwrap(), 7).contains("it is a folder"));
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn devices_and_files_without_a_size_do_not_fill_the_memory() {
        assert!(refused("/dev/zero", 100).contains("not a regular file"));
        assert!(refused("/proc/self/maps", 100).contains("101 bytes or more"));
    }
}
