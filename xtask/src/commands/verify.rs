//! `verify`: whether the files of a run are what was written, and one digest of them all.

use crate::args::JsonArgs;
use crate::output::{Output, note};
use anyhow::{bail, ensure};
use clap::Args;
use experiment::run_dir;
use std::path::PathBuf;
use storage::FileError;
use storage::sums::{self, Verified};

pub(crate) const EXAMPLES: &str = "\
Examples:
  cargo xtask verify runs/train-dagger-default-s1
  (cd runs/train-dagger-default-s1/round-00 && sha256sum -c sha256sums)     the same of one folder, without lotpilot";

#[derive(Debug, Clone, Args)]
pub(crate) struct VerifyArgs {
    /// Folder of a run, or of a round.
    #[arg(value_name = "RUN")]
    run: PathBuf,
    #[command(flatten)]
    pub(crate) json: JsonArgs,
}

pub(crate) fn run(args: &VerifyArgs, output: &Output) -> anyhow::Result<()> {
    ensure!(args.run.is_dir(), "{}: there is no such folder; list those in runs/", args.run.display());
    ensure!(
        sums::exists(&args.run)?,
        "{}: this is not a run, or its sha256sums are lost; list the folders in runs/",
        args.run.display()
    );
    let Verified { files, bytes, faults } = sums::verify(&args.run);
    // What cannot be read of the run itself is among the faults.
    let way_on = run_dir::way_on(&args.run).ok().flatten();
    for fault in &faults {
        note(advised(fault, way_on.is_some()));
    }
    if let Some(way_on) = way_on.filter(|_| !faults.is_empty() && faults.iter().all(sums::is_unfinished)) {
        bail!(
            "{}: this run is not finished: what it lists is as it was written, and {} files or folders are not listed yet; continue \
             with: {way_on}",
            args.run.display(),
            faults.len()
        );
    }
    ensure!(faults.is_empty(), "{}: {} of its files are not what was written", args.run.display(), faults.len());
    let sha256 = run_dir::digest(&args.run)?;
    let text = || {
        let (run, megabytes) = (args.run.display(), bytes as f64 / 1e6);
        format!(
            "{run}: {files} files, {megabytes:.1} MB, all as they were written\n\
             SHA-256 of what does not differ from one repetition to the next: {sha256}"
        )
    };
    output.table(text, &serde_json::json!({ "files": files, "bytes": bytes, "sha256": sha256 }))
}

/// A fault with what helps: nothing that a run goes on with may be deleted, and a report can be written again.
fn advised(fault: &FileError, is_unfinished: bool) -> String {
    if is_unfinished && sums::is_unfinished(fault) {
        // How it is continued is said once, below all of them.
        return format!("{}: {}; the run is not finished", fault.path.display(), fault.problem);
    }
    match run_dir::way_to_report(&fault.path).filter(|_| !is_unfinished) {
        Some(way) => format!("{}: {}; write it again with: {way}", fault.path.display(), fault.problem),
        None => fault.to_string(),
    }
}
