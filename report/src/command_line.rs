//! The command that made a run, as text.

use experiment::manifest::Manifest;

/// A word of a command line.
pub(crate) fn quoted(word: &str) -> String {
    let is_plain = word.chars().all(|c| c.is_alphanumeric() || "-_./:=,@%+".contains(c));
    if is_plain { word.to_owned() } else { format!("'{}'", word.replace('\'', "'\\''")) }
}

/// The command line, quoted as a shell needs it.
pub(crate) fn command_line(manifest: &Manifest) -> String {
    let words = manifest.command_line.iter().map(|word| quoted(word));
    std::iter::once("cargo xtask".to_owned()).chain(words).collect::<Vec<_>>().join(" ")
}
