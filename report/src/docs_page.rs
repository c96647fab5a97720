//! What the pages of the documentation that a command makes of runs have in common.

use crate::command_line::{command_line, quoted};
use experiment::manifest::Manifest;
use sim::limits::RUN_TEXT_BYTES_MAX;
use std::fmt::Write as _;
use std::path::Path;

/// How every page says what it is.
const WRITTEN: &str = "Written by a command from its runs; nothing here is typed by hand.";

/// Whether a file is such a page, which may be overwritten.
pub fn is_page_of_results(path: &Path) -> bool {
    storage::read::text(path, RUN_TEXT_BYTES_MAX).is_ok_and(|text| text.contains(WRITTEN))
}

/// The head of a page: which command made the run, and which one made the page, at which `revision` of the repository.
pub(crate) fn head(
    run: &str,
    others: &[String],
    manifest: &Manifest,
    revision: Option<&str>,
    more: &[(&str, String)],
) -> String {
    let unknown = || "unknown".to_owned();
    let changes = if manifest.git_dirty == Some(true) { ", with changes that are not committed" } else { "" };
    let rows = [
        ("command", format!("`{}`", command_line(manifest))),
        ("commit", format!("`{}`{changes}", manifest.git_revision.clone().unwrap_or_else(unknown))),
        ("judged and written by", format!("`{}`", written_by(run, others))),
        ("at commit", format!("`{}`", revision.unwrap_or("unknown"))),
        ("program", manifest.program.clone()),
        ("machine", format!("{}, {} threads", manifest.processor.clone().unwrap_or_else(unknown), manifest.threads)),
        ("system", manifest.target.clone()),
        ("compiler", manifest.rustc_version.clone()),
        ("preset", format!("`{}`", manifest.preset)),
        ("seed of the trials", manifest.evaluation_seed.to_string()),
    ];
    let mut head = format!("{WRITTEN}\n\n| | |\n|---|---|\n");
    for (name, value) in rows.iter().chain(more) {
        let _ = writeln!(head, "| {name} | {value} |");
    }
    head
}

fn written_by(run: &str, others: &[String]) -> String {
    let words = others.iter().map(|other| quoted(other));
    let with = (!others.is_empty()).then(|| "--with".to_owned());
    let command = ["cargo xtask render results".to_owned(), quoted(run)];
    command.into_iter().chain(with).chain(words).collect::<Vec<_>>().join(" ")
}
