//! `visualise`: requests to the viewer program.

use super::evaluate;
use super::one_trial::TrialArgs;
use crate::args::{LayerArgs, lot_name};
use crate::output::Output;
use crate::record::recordings_of;
use crate::viewer;
use anyhow::{Context as _, ensure};
use clap::{Args, Subcommand};
use evaluation::records::{self, FailureRecord};
use experiment::drive::Replay;
use experiment::drivers::DriverSpec;
use experiment::lots::Lot;
use experiment::manifest::Manifest;
use experiment::replay_key::ReplayKey;
use experiment::run_dir;
use experiment::settings::{Layers, Settings};
use experiment::trained;
use experiment::view_request::{DriveRequest, Show, Sink, ViewRequest};
use report::pictures::file_name;
use sim::seed::RootSeed;
use sim::vehicle::VehicleSettings;
use std::path::{Path, PathBuf};

pub(crate) const EXAMPLES: &str = "\
Examples:
  cargo xtask visualise lot --lots lot-b
  cargo xtask visualise episode --driver expert trained:default --lots lot-b
  cargo xtask visualise replay run:runs/train-dagger-default-s1@lot-b@reverse@3@paper@1@842
  cargo xtask visualise run runs/train-dagger-default-s1
  cargo xtask visualise failures runs/evaluate-default-s1 --limit 5

The viewer that fits: pip install rerun-sdk==0.36.3, then: rerun recordings/*.rrd
The first time, the program that records is built (about 8 minutes on two cores).";

#[derive(Debug, Clone, Args)]
pub(crate) struct VisualiseArgs {
    /// What to look at.
    #[command(subcommand)]
    what: What,
    #[command(flatten)]
    sink: SinkArgs,
}

/// Where recordings go.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Recording")]
struct SinkArgs {
    /// File to write [default: recordings/NAME.rrd]. Near-collisions are a file each, in RUN/recordings.
    #[arg(long, global = true, value_name = "FILE.rrd", conflicts_with_all = ["spawn", "connect"])]
    out: Option<PathBuf>,
    /// Shows it in a viewer of this machine instead, started if none runs.
    #[arg(long, global = true, conflicts_with = "connect")]
    spawn: bool,
    /// Shows it in a viewer that runs already [default: on this machine].
    #[arg(long, global = true, value_name = "URL", num_args = 0..=1, default_missing_value = "")]
    connect: Option<String>,
}

#[derive(Debug, Clone, Subcommand)]
enum What {
    /// A lot.
    #[command(after_help = "Example: cargo xtask visualise lot --lots lot-b")]
    Lot(LotArgs),
    /// An episode of an evaluation, driven by one driver, or by several side by side.
    #[command(after_help = "Example: cargo xtask visualise episode --driver expert trained:default --lots lot-b")]
    Episode(EpisodeArgs),
    /// The run of a replay key, around its moment.
    #[command(after_help = "Example: cargo xtask visualise replay run:runs/NAME@lot-b@reverse@3@paper@1@842")]
    Replay(ReplayArgs),
    /// A training: loss, validation, learning rate, and what every round collected.
    #[command(after_help = "Example: cargo xtask visualise run runs/NAME")]
    Run(RunArgs),
    /// Near-collisions of an evaluation, a recording each.
    #[command(after_help = "Example: cargo xtask visualise failures runs/NAME --limit 5")]
    Failures(FailuresArgs),
}

#[derive(Debug, Clone, Args)]
struct LotArgs {
    /// The lot; see `cargo xtask lots`.
    #[arg(long = "lots", alias = "lot", value_name = "SPEC", value_parser = lot_name, default_value = "lot-a")]
    lot: String,
    /// Seed of the obstacles, as in `generate`.
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

/// Obstacles and noise are those of the same trial in `evaluate`.
#[derive(Debug, Clone, Args)]
struct EpisodeArgs {
    /// Drivers, one or more; may be repeated. See `cargo xtask drivers`.
    #[arg(long = "driver", value_name = "SPEC", required = true, num_args = 1..)]
    drivers: Vec<String>,
    #[command(flatten)]
    trial: TrialArgs,
    #[command(flatten)]
    layers: LayerArgs,
}

#[derive(Debug, Clone, Args)]
struct ReplayArgs {
    /// Replay key from `failures.md`, `failures.jsonl` or `runs.jsonl`. Unless a `run:` drives, name the settings it
    /// was driven with: `--config RUN/settings.toml`.
    #[arg(value_name = "KEY")]
    key: ReplayKey,
    #[command(flatten)]
    layers: LayerArgs,
}

#[derive(Debug, Clone, Args)]
struct RunArgs {
    /// Folder of a training.
    #[arg(value_name = "RUN")]
    run: PathBuf,
}

#[derive(Debug, Clone, Args)]
struct FailuresArgs {
    /// Folder of an evaluation, or of a training with one.
    #[arg(value_name = "RUN")]
    run: PathBuf,
    /// Near-collisions to record, from the top of the list.
    #[arg(long, value_name = "N", default_value_t = 12, value_parser = clap::value_parser!(u32).range(1..))]
    limit: u32,
}

pub(crate) fn run(args: &VisualiseArgs, output: &Output) -> anyhow::Result<()> {
    // clap holds flags before the name of what is looked at against each other, and those behind it, but not both.
    let SinkArgs { out, spawn, connect } = &args.sink;
    let places = [out.is_some(), *spawn, connect.is_some()].into_iter().filter(|&is_named| is_named).count();
    ensure!(places <= 1, "--out, --spawn, --connect: name one of them, as a recording goes to one place");
    if let Some(file) = &args.sink.out {
        run_dir::ensure_outside_of_runs(file).context("--out")?;
        ensure!(
            !file.exists() || file.extension().is_some_and(|extension| extension == "rrd"),
            "--out {}: exists already, and is not a recording; choose another",
            file.display()
        );
    }
    let (show, file) = match &args.what {
        What::Lot(lot) => {
            // Before the program that records is built.
            Lot::parse_one(&lot.lot, &VehicleSettings::hyundai_hg300()).context("--lots")?;
            let show = Show::Lot { lot: lot.lot.clone(), seed: RootSeed(lot.seed) };
            (show, format!("lot-{}-s{}", file_name(&lot.lot), lot.seed))
        }
        What::Episode(episode) => episode_of(episode, output)?,
        What::Replay(replay) => replay_of(&replay.key, &replay.layers, output)?,
        What::Run(run) => {
            trained::policy_folder(&run.run)?;
            let name = run.run.file_name().map_or_else(|| "training".into(), |name| name.to_string_lossy());
            (Show::Training { run: run.run.clone() }, format!("run-{}", file_name(&name)))
        }
        What::Failures(failures) => {
            let folder = recordings_of(&failures.run);
            let folder_name = folder.display().to_string();
            ensure!(args.sink.out.is_none(), "--out: every near-collision is a file of its own, in {folder_name}");
            let sink = sink_of(&args.sink, Sink::Folder(folder));
            return viewer::ask(&ViewRequest { sink, show: vec![failures_of(failures, output)?] }, output);
        }
    };
    let sink = sink_of(&args.sink, Sink::File(Path::new("recordings").join(format!("{file}.rrd"))));
    viewer::ask(&ViewRequest { sink, show: vec![show] }, output)
}

fn sink_of(args: &SinkArgs, otherwise: Sink) -> Sink {
    match (&args.out, args.spawn, &args.connect) {
        (Some(file), _, _) => Sink::File(file.clone()),
        (None, true, _) => Sink::Spawn,
        (None, false, Some(url)) => Sink::Connect((!url.is_empty()).then(|| url.clone())),
        (None, false, None) => otherwise,
    }
}

/// A run by several drivers, and the name of its file.
fn episode_of(args: &EpisodeArgs, output: &Output) -> anyhow::Result<(Show, String)> {
    let drivers = DriverSpec::parse_all(&args.drivers)?;
    let (settings, lot, keys) = args.trial.keys(&drivers, &args.layers, output)?;
    let ReplayKey { direction, trial, noise, seed, .. } = keys[0];
    check(&keys, &settings)?;
    let way = direction.name();
    let file = file_name(&format!("{}-{way}-t{trial}-{noise}-s{}-{}", lot.name(), seed.0, args.drivers.join("-")));
    let title = format!("{}, {way}, trial {trial}, {noise}: {}", lot.name(), args.drivers.join(", "));
    let drive = DriveRequest { file: file.clone(), title, keys };
    Ok((Show::Drives { settings: Box::new(settings), drives: vec![drive] }, file))
}

/// The run of a key, and the name of its file.
fn replay_of(key: &ReplayKey, layers: &LayerArgs, output: &Output) -> anyhow::Result<(Show, String)> {
    let (settings, _) = evaluate::settings_for(std::slice::from_ref(&key.driver), &Layers::from(layers), output)?;
    check(std::slice::from_ref(key), &settings)?;
    let file = file_name(&format!("replay-{key}"));
    let drive = DriveRequest { file: file.clone(), title: key.to_string(), keys: vec![key.clone()] };
    Ok((Show::Drives { settings: Box::new(settings), drives: vec![drive] }, file))
}

/// Refuses what cannot be driven, before the program that records is built.
fn check(keys: &[ReplayKey], settings: &Settings) -> anyhow::Result<()> {
    for key in keys {
        Replay::new(key, &settings.episode)?;
        key.driver.clone().load(settings)?.check(settings)?;
    }
    Ok(())
}

/// Near-collisions of an evaluation, a recording each, of the seconds around it.
fn failures_of(args: &FailuresArgs, output: &Output) -> anyhow::Result<Show> {
    let list = records::of_finished(&args.run, records::FAILURES)?;
    let (mut drives, mut all) = (Vec::new(), 0);
    records::each_line(&list, |failure: FailureRecord| {
        all += 1;
        if drives.len() < args.limit as usize {
            let key: ReplayKey = failure.replay.parse()?;
            let cause = failure.cause.name();
            let file = format!("failure-{all:03}-{}-{}", file_name(&key.lot), file_name(cause));
            drives.push(DriveRequest { file, title: format!("{cause}: {key}"), keys: vec![key] });
        }
        Ok(())
    })?;
    ensure!(all > 0, "{}: there is no near-collision in it, so there is nothing to see", list.display());
    if all > drives.len() {
        let (left, list) = (all - drives.len(), list.display());
        output.note(format_args!("{left} more near-collisions are in {list}; see them with --limit {all}"));
    }
    let (settings, manifest) = (trained::settings_of(&args.run)?, Manifest::read(&args.run)?);
    for key in drives.iter().flat_map(|drive| &drive.keys) {
        Replay::of_run(key, &settings, &manifest).with_context(|| key.to_string())?;
    }
    Ok(Show::Drives { settings: Box::new(settings), drives })
}
