//! `export`: a trained network in a format of others.

use crate::output::Output;
use anyhow::{Context as _, ensure};
use clap::{Args, Subcommand};
use experiment::drivers;
use experiment::run_dir;
use experiment::trained;
use policy::checkpoint::Checkpoint;
use std::path::{Path, PathBuf};

pub(crate) const EXAMPLES: &str = "\
Examples:
  cargo xtask export onnx trained:default --out policy.onnx
  cargo xtask export onnx runs/train-dagger-default-s1 --out policy.onnx
  cargo xtask export onnx runs/train-dagger-default-s1/round-03 --out round-03.onnx
  cargo xtask evaluate --driver onnx:policy.onnx --lots lot-b";

#[derive(Debug, Clone, Args)]
pub(crate) struct ExportArgs {
    #[command(subcommand)]
    format: Format,
}

#[derive(Debug, Clone, Subcommand)]
enum Format {
    /// Writes an ONNX file, for any framework and for `--driver onnx:FILE` (docs/formats.md).
    #[command(after_help = EXAMPLES)]
    Onnx(OnnxArgs),
}

#[derive(Debug, Clone, Args)]
struct OnnxArgs {
    /// Folder of a training run (its final policy, of an ensemble the first network), `RUN/bc` (after behaviour cloning),
    /// or the folder of a network; `trained:default` is the network that ships.
    #[arg(value_name = "RUN")]
    run: PathBuf,
    /// File to write.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Replaces a file of the same name.
    #[arg(long)]
    overwrite: bool,
}

pub(crate) fn run(args: &ExportArgs, output: &Output) -> anyhow::Result<()> {
    let Format::Onnx(OnnxArgs { run, out, overwrite }) = &args.format;
    let shipped = run.to_str().map(drivers::shipped_network).transpose()?.flatten();
    let (checkpoint, folder) = if let Some(network) = shipped {
        (network, None)
    } else {
        let folder = folder_of(run)?;
        (Checkpoint::load(&folder)?, Some(folder))
    };
    run_dir::ensure_outside_of_runs(out).context("--out")?;
    if let Some(folder) = &folder {
        ensure!(
            !storage::place_of(out).context("--out")?.starts_with(storage::place_of(folder)?),
            "--out {}: the network is read from that folder; choose another --out",
            out.display()
        );
    }
    ensure!(
        *overwrite || !(out.exists() || out.is_symlink()),
        "{}: exists already; choose another --out, or replace it with --overwrite",
        out.display()
    );
    let bytes = onnx::export::export(&checkpoint);
    storage::whole::write(out, &bytes).with_context(|| format!("--out {}", out.display()))?;
    let from = folder.as_ref().unwrap_or(run);
    output.print(format_args!("{}: {}, {} bytes", out.display(), from.display(), bytes.len()));
    Ok(())
}

/// The folder of the network that the folder of a training, or of a network, stands for.
fn folder_of(run: &Path) -> anyhow::Result<PathBuf> {
    if Checkpoint::exists(run)? {
        return Ok(run.to_owned());
    }
    trained::ensure_whole(run)?;
    trained::policy_folder(run)
}
