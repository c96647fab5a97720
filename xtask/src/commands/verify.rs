//! `verify`: whether the files of a run are what was written, and one digest of them all.

use crate::args::JsonArgs;
use crate::output::{Output, note};
use anyhow::ensure;
use clap::Args;
use experiment::run_dir;
use std::path::PathBuf;
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
    for fault in &faults {
        note(fault);
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
