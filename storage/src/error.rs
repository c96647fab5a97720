//! The error of everything here.

use std::fmt::Display;
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
}

impl FileError {
    /// Of a file or folder.
    pub fn new(path: &Path, problem: impl Display, remedy: &'static str) -> Self {
        Self { path: path.to_path_buf(), problem: problem.to_string(), remedy }
    }
}
