//! The command that made a run, as text.

use experiment::run_dir::Manifest;

/// The command line, quoted as a shell needs it.
pub(crate) fn command_line(manifest: &Manifest) -> String {
    let is_plain = |word: &str| word.chars().all(|c| c.is_alphanumeric() || "-_./:=,@%+".contains(c));
    let quoted =
        |word: &String| if is_plain(word) { word.clone() } else { format!("'{}'", word.replace('\'', "'\\''")) };
    let words = manifest.command_line.iter().map(quoted);
    std::iter::once("cargo xtask".to_owned()).chain(words).collect::<Vec<_>>().join(" ")
}
