//! Files that exist under their name only when they are whole.

use crate::error::FileError;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write as _};
use std::path::Path;

/// What helps against most errors of writing.
pub const WRITE_REMEDY: &str = "check that the folder exists, is writable and has space";

/// Writes a file beside its place, then renames it.
///
/// # Errors
/// If it cannot be written.
pub fn write(path: &Path, content: &[u8]) -> Result<(), FileError> {
    write_with(path, |file| file.write_all(content).map_err(|error| error.to_string()))
}

/// Like [`write()`], with a function that writes.
///
/// # Errors
/// If it cannot be written, or the function fails.
pub fn write_with(
    path: &Path,
    content: impl FnOnce(&mut BufWriter<File>) -> Result<(), String>,
) -> Result<(), FileError> {
    let partial = path.with_added_extension("partial");
    let said = |error: io::Error| error.to_string();
    let write = || {
        // Never through a link that somebody put there.
        if fs::symlink_metadata(&partial).is_ok() {
            fs::remove_file(&partial).map_err(said)?;
        }
        let mut file = BufWriter::new(File::create_new(&partial).map_err(said)?);
        content(&mut file)?;
        let file = file.into_inner().map_err(|error| error.to_string())?;
        // The name must not be on disk before the content is.
        file.sync_all().map_err(said)?;
        fs::rename(&partial, path).map_err(said)
    };
    write().map_err(|problem| FileError::new(path, format_args!("cannot be written: {problem}"), WRITE_REMEDY))
}

/// Deletes a file, if it is there.
///
/// # Errors
/// If it cannot be deleted.
pub fn remove(path: &Path) -> Result<(), FileError> {
    match fs::remove_file(path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => {
            Err(FileError::new(path, format_args!("cannot be deleted: {error}"), WRITE_REMEDY))
        }
        _ => Ok(()),
    }
}
