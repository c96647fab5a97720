//! What is wrong with a lot file, with its place and a remedy.

use std::io::ErrorKind;
use std::path::Path;
use storage::FileError;

/// Why a lot cannot be loaded.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum LoadError {
    /// The file cannot be read.
    #[error(transparent)]
    Unreadable(#[from] FileError),
    /// The file is not a scenario, or a scenario that cannot be driven.
    #[error("{file}:{line}: {problem}; {remedy}")]
    Faulty {
        /// As given.
        file: String,
        /// Counted from 1.
        line: usize,
        /// What is wrong there.
        problem: String,
        /// What would make it right.
        remedy: String,
    },
    /// A map of another program from which no lot can be made.
    #[error("{file}: {place}: {problem}; {remedy}")]
    Map {
        /// As given.
        file: String,
        /// The key, image or place at fault.
        place: String,
        /// What is wrong there.
        problem: String,
        /// What would make it right.
        remedy: String,
    },
    /// A lot that can be driven forward, but not in reverse. Driving it forward only is always a remedy, too.
    #[error("{location}: the lot cannot be driven in reverse: {problem}; {remedy}")]
    ForwardOnly {
        /// The file, and the line that says where a drive in reverse starts, or of the obstacle that stands there.
        location: Location,
        /// What is wrong there.
        problem: String,
        /// What would make the lot drivable in reverse.
        remedy: String,
    },
}

/// A file and, where it is known, a line of it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Location {
    /// As given.
    pub file: String,
    /// Counted from 1.
    pub line: Option<usize>,
}

impl std::fmt::Display for Location {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.line {
            Some(line) => write!(f, "{}:{line}", self.file),
            None => f.write_str(&self.file),
        }
    }
}

impl LoadError {
    /// A fault at a byte offset of a file's text.
    pub(crate) fn faulty(file: &str, text: &str, offset: usize, problem: &str, remedy: String) -> Self {
        Self::Faulty { file: file.to_owned(), line: line_at(text, offset), problem: shortened(problem), remedy }
    }
}

/// Characters that a message quotes of a file, at most.
const QUOTED_MAX: usize = 400;

/// As much of a text as an error needs.
pub(crate) fn shortened(text: &str) -> String {
    storage::shortened(text, QUOTED_MAX)
}

/// The line of a byte offset, counted from 1.
pub(crate) fn line_at(text: &str, offset: usize) -> usize {
    1 + text.get(..offset).unwrap_or(text).matches('\n').count()
}

/// The text of a file of at most this many bytes.
pub(crate) fn read_text(path: &Path, bytes_max: u64) -> Result<String, LoadError> {
    storage::read::text(path, bytes_max).map_err(|error| {
        let remedy = match error.kind() {
            ErrorKind::FileTooLarge => "name a smaller file",
            ErrorKind::InvalidData => "save it as UTF-8",
            _ => "check the path",
        };
        FileError::unreadable(path, &error, remedy).into()
    })
}
