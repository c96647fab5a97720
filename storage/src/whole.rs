//! Files that exist under their name only when they are whole.

use crate::error::FileError;
use std::fmt::Display;
use std::fs::{self, File};
use std::io::{self, Cursor, Write as _};
use std::path::Path;

/// What helps against most errors of writing.
pub const WRITE_REMEDY: &str = "check that the folder exists, is writable and has space";

/// Writes a file beside its place, then renames it.
///
/// # Errors
/// If it cannot be written.
pub fn write(path: &Path, content: &[u8]) -> Result<(), FileError> {
    let partial = path.with_added_extension("partial");
    let write = || {
        // Never through a link that somebody put there.
        if fs::symlink_metadata(&partial).is_ok() {
            fs::remove_file(&partial)?;
        }
        let mut file = File::create_new(&partial)?;
        file.write_all(content)?;
        // The name must not be on disk before the content is.
        file.sync_all()?;
        fs::rename(&partial, path)
    };
    write().map_err(|error: io::Error| failed(path, &error))
}

/// Like [`write()`], with a function that writes, into memory at first.
///
/// # Errors
/// If it cannot be written, or the function fails.
pub fn write_with(
    path: &Path,
    content: impl FnOnce(&mut Cursor<Vec<u8>>) -> Result<(), String>,
) -> Result<(), FileError> {
    let mut buffer = Cursor::new(Vec::new());
    content(&mut buffer).map_err(|problem| failed(path, &problem))?;
    write(path, buffer.get_ref())
}

fn failed(path: &Path, problem: &dyn Display) -> FileError {
    FileError::new(path, format_args!("cannot be written: {problem}"), WRITE_REMEDY)
}

/// Deletes a file, and what a process that died was writing in its place, if they are there.
///
/// # Errors
/// If one cannot be deleted.
pub fn remove(path: &Path) -> Result<(), FileError> {
    remove_partial(path)?;
    remove_file(path)
}

/// Deletes what a process that died was writing in the place of a file, if it is there.
///
/// # Errors
/// If it cannot be deleted.
pub fn remove_partial(path: &Path) -> Result<(), FileError> {
    remove_file(&path.with_added_extension("partial"))
}

fn remove_file(path: &Path) -> Result<(), FileError> {
    match fs::remove_file(path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => {
            Err(FileError::new(path, format_args!("cannot be deleted: {error}"), WRITE_REMEDY))
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_dead_process_was_writing_goes_with_the_file() {
        let path = std::env::temp_dir().join(format!("storage-test-{}-whole", std::process::id()));
        write(&path, b"whole").unwrap();
        let partial = path.with_added_extension("partial");
        fs::write(&partial, "ha").unwrap();
        remove(&path).unwrap();
        remove(&path).unwrap();
        assert!(!path.exists() && !partial.exists());
    }
}
