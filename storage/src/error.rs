//! The error of everything here.

use std::error::Error;
use std::fmt::Display;
use std::io;
use std::path::{Path, PathBuf};

/// What is wrong with a file or folder, and what to do about it.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{}: {problem}; {remedy}", path.display())]
pub struct FileError {
    /// Which file or folder.
    pub path: PathBuf,
    /// What is wrong.
    pub problem: String,
    /// What helps.
    pub remedy: &'static str,
    is_of_disk: bool,
}

impl FileError {
    /// An error of a file or folder.
    pub fn new(path: &Path, problem: impl Display, remedy: &'static str) -> Self {
        Self { path: path.to_path_buf(), problem: problem.to_string(), remedy, is_of_disk: false }
    }

    /// An error of a file or folder that the system could not read.
    pub fn unreadable(path: &Path, error: &io::Error, remedy: &'static str) -> Self {
        let is_of_disk = fails_by_disk(error);
        Self { is_of_disk, ..Self::new(path, format_args!("cannot be read: {error}"), remedy) }
    }
}

/// Whether an error, or one that caused it, comes from a failing disk: what was to be read may be whole, so it must not
/// be treated as missing.
pub fn is_of_disk(error: &(dyn Error + 'static)) -> bool {
    let is_itself = error.downcast_ref::<FileError>().is_some_and(|error| error.is_of_disk)
        || error.downcast_ref::<io::Error>().is_some_and(|error| {
            // What it wraps is not its source.
            fails_by_disk(error) || error.get_ref().is_some_and(|wrapped| is_of_disk(wrapped))
        });
    is_itself || error.source().is_some_and(is_of_disk)
}

/// Whether the system failed, other than because nothing is there or access is denied.
fn fails_by_disk(error: &io::Error) -> bool {
    use io::ErrorKind::{IsADirectory, NotADirectory, NotFound, PermissionDenied};
    let is_answer = matches!(error.kind(), NotFound | NotADirectory | IsADirectory | PermissionDenied);
    error.raw_os_error().is_some() && !is_answer
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    #[derive(Debug, thiserror::Error)]
    #[error("driver")]
    struct Caused(#[source] FileError);

    #[test]
    fn a_disk_that_fails_is_told_from_a_file_that_is_not_there() {
        let [eio, enoent] = [5, 2];
        let unreadable = |code| FileError::unreadable(Path::new("a"), &io::Error::from_raw_os_error(code), "try again");
        assert!(is_of_disk(&unreadable(eio)) && !is_of_disk(&unreadable(enoent)));
        assert!(is_of_disk(&Caused(unreadable(eio))) && !is_of_disk(&Caused(unreadable(enoent))));
        let wrapped = |code| io::Error::other(unreadable(code));
        assert!(is_of_disk(&wrapped(eio)) && !is_of_disk(&wrapped(enoent)));
        assert!(!is_of_disk(&io::Error::other("it is a folder")));
        assert!(!is_of_disk(&FileError::new(Path::new("a"), "is damaged", "restore it")));
    }
}
