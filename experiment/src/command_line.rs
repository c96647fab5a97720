//! Commands as text that a shell can be given.

use crate::manifest::Manifest;
use std::path::Path;

/// A word of a command line, as a shell needs it.
pub fn quoted(word: &str) -> String {
    let is_plain = !word.is_empty() && word.chars().all(|c| c.is_alphanumeric() || "-_./:=,@%+".contains(c));
    if is_plain { word.to_owned() } else { format!("'{}'", word.replace('\'', "'\\''")) }
}

/// A path as a word of a command line.
pub fn quoted_path(path: &Path) -> String {
    quoted(&path.to_string_lossy())
}

/// The command that made a run.
pub fn command_line(manifest: &Manifest) -> String {
    let words = manifest.command_line.iter().map(|word| quoted(word));
    std::iter::once("cargo xtask".to_owned()).chain(words).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// It was left out: whoever ran the command of a manifest again ran another one.
    #[test]
    fn an_empty_word_of_a_command_line_is_a_word() {
        assert_eq!(quoted(""), "''");
        assert_eq!(quoted("--out=runs/a"), "--out=runs/a");
        assert_eq!(quoted("it's"), "'it'\\''s'");
    }
}
