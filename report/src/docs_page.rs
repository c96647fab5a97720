//! What the pages of the documentation that a command makes of runs have in common.

use experiment::command_line::{command_line, quoted, quoted_path};
use experiment::manifest::{Build, Manifest};
use sim::limits::RUN_TEXT_BYTES_MAX;
use std::fmt::Write as _;
use std::path::Path;

/// How every page says what it is.
const WRITTEN: &str = "Written by a command from its runs; nothing here is typed by hand.";

/// Whether a file is such a page, which may be overwritten.
pub fn is_page_of_results(path: &Path) -> bool {
    storage::read::text(path, RUN_TEXT_BYTES_MAX).is_ok_and(|text| text.contains(WRITTEN))
}

/// What a page is made with.
#[derive(Debug, Clone, Copy)]
pub struct MadeBy<'a> {
    /// The program that judges and writes.
    pub build: &'a Build,
    /// `--to`, where it was named.
    pub to: Option<&'a Path>,
}

/// The head of a page: which command made the run, and which one made the page.
pub(crate) fn head(
    run: &str,
    others: &[String],
    manifest: &Manifest,
    made_by: MadeBy<'_>,
    more: &[(&str, String)],
) -> String {
    let unknown = || "unknown".to_owned();
    let commit = |revision: &Option<String>, is_dirty: Option<bool>| {
        let changes = if is_dirty == Some(true) { ", with changes that are not committed" } else { "" };
        format!("`{}`{changes}", revision.clone().unwrap_or_else(unknown))
    };
    let MadeBy { build, to } = made_by;
    let rows = [
        ("command", format!("`{}`", command_line(manifest))),
        ("commit", commit(&manifest.git_revision, manifest.git_dirty)),
        ("judged and written by", format!("`{}`", written_by(run, others, to))),
        ("at commit", commit(&build.git_revision, build.git_dirty)),
        ("program", manifest.program.clone()),
        ("machine", format!("{}, {} threads", manifest.processor.clone().unwrap_or_else(unknown), manifest.threads)),
        ("system", manifest.target.clone()),
        ("compiler", manifest.rustc_version.clone()),
        ("preset", format!("`{}`", manifest.preset)),
        ("seed of the trials", manifest.evaluation_seed.to_string()),
    ];
    let mut head = format!("{WRITTEN}\n\n| | |\n|---|---|\n");
    for (name, value) in rows.iter().chain(more) {
        let _ = writeln!(head, "{}", row(name, value));
    }
    head
}

/// A row of the table: a `|` in a value, such as the name of a file, would end its column, in code as well.
fn row(name: &str, value: &str) -> String {
    format!("| {name} | {} |", value.replace('|', "\\|"))
}

fn written_by(run: &str, others: &[String], to: Option<&Path>) -> String {
    let mut words = vec!["cargo xtask render results".to_owned(), quoted(run)];
    if !others.is_empty() {
        words.push("--with".to_owned());
        words.extend(others.iter().map(|other| quoted(other)));
    }
    if let Some(to) = to {
        words.extend(["--to".to_owned(), quoted_path(to)]);
    }
    words.join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The rest of the command line was lost behind it.
    #[test]
    fn a_command_line_stays_in_its_column() {
        let command = "`cargo xtask evaluate --lots 'a|b.toml'`";
        assert_eq!(row("command", command), "| command | `cargo xtask evaluate --lots 'a\\|b.toml'` |");
    }
}
