//! `render`: pictures of lots, drives, samples and noise.

use super::one_trial::TrialArgs;
use super::render_animation::{self, AnimationArgs};
use super::reproduce;
use crate::args::{LayerArgs, lot_name};
use crate::build_info;
use crate::console::{Console, counted_lots};
use crate::output::Output;
use crate::picture_folder::Folder;
use anyhow::{Context as _, ensure};
use clap::{ArgGroup, Args, Subcommand, ValueEnum};
use evaluation::shards;
use experiment::drive::Replay;
use experiment::drivers::{DriverSpec, NamedDriver};
use experiment::lots::Lot;
use experiment::manifest::{self, Manifest};
use experiment::progress::{Interrupted, Progress as _};
use experiment::replay_key::ReplayKey;
use experiment::run_dir::{self, RunDir};
use experiment::settings::{Layers, NoiseChoice, Settings};
use experiment::trained;
use experiment::training;
use experiment::trials::{Purpose, Trial};
use policy::checkpoint::Checkpoint;
use policy::dataset::store::Store;
use rayon::prelude::*;
use report::docs_page::{self, MadeBy};
use report::drawn_lots;
use report::other_run::OtherRun;
use report::pictures::file_name;
use report::pictures::trajectories::{self, ColourBy, Point, Trajectory};
use report::pictures::{contact_sheet, lot, noise, samples};
use report::reproduction;
use report::run_report::{self, Report};
use sim::episode::EpisodeSettings;
use sim::limits::{PIXELS_PER_METRE_MAX, RUN_TEXT_BYTES_MAX, TRIAL_MAX};
use sim::map::Map;
use sim::scenario::Direction;
use sim::seed::RootSeed;
use sim::sensing::Inspection;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;

pub(crate) const EXAMPLES: &str = "\
Examples:
  cargo xtask render lot --lots lot-a,test:2
  cargo xtask render contact-sheet --lots train:6:easy,train:6,train:6:hard
  cargo xtask render trajectories --driver expert trained:default --lots lot-b
  cargo xtask render trajectories --driver expert --lots lot-a --by speed
  cargo xtask render trajectories --run runs/NAME --round 1
  cargo xtask render animation --driver expert trained:default --lots lot-b
  cargo xtask render animation 'tentacle@lot-b@forward@0@paper@1@842'
  cargo xtask render samples runs/NAME/round-01 --count 8
  cargo xtask render noise --lots lot-a --noise paper,hard
  cargo xtask render report runs/NAME";

#[derive(Debug, Clone, Args)]
pub(crate) struct RenderArgs {
    /// What is drawn.
    #[command(subcommand)]
    what: RenderWhat,
    /// Folder to write into [default: pictures; of `report`, its run].
    #[arg(long, global = true, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Replaces files of the same name.
    #[arg(long, global = true)]
    overwrite: bool,
}

/// What is drawn.
#[derive(Debug, Clone, Subcommand)]
pub(crate) enum RenderWhat {
    /// Lots from above, PNG and SVG.
    #[command(after_help = "Example: cargo xtask render lot --lots lot-a,test:2")]
    Lot(RenderLotArgs),
    /// The lines drivers drove over a lot, PNG and SVG.
    #[command(
        after_help = "Examples:\n  cargo xtask render trajectories --driver expert trained:default --lots lot-b\n  cargo xtask render trajectories --run runs/NAME --round 1"
    )]
    Trajectories(TrajectoriesArgs),
    /// Drives that move: lot and grids side by side, GIF or APNG.
    #[command(
        after_help = "Examples:\n  cargo xtask render animation --driver expert trained:default --lots lot-b\n  cargo xtask render animation 'tentacle@lot-b@forward@0@paper@1@842'"
    )]
    Animation(AnimationArgs),
    /// Many lots on one page, PNG and SVG.
    #[command(after_help = "Example: cargo xtask render contact-sheet --lots train:6:easy,train:6,train:6:hard")]
    ContactSheet(RenderLotArgs),
    /// Samples of a round's data set with labels and predictions, PNG.
    #[command(after_help = "Example: cargo xtask render samples runs/NAME/round-01 --count 8")]
    Samples(SamplesArgs),
    /// What each noise layer makes wrong in one view, PNG.
    #[command(
        after_help = "Examples:\n  cargo xtask render noise --lots lot-a --noise paper,hard\n  cargo xtask render noise --lots lot-b --set episode.noise.shadow=0"
    )]
    Noise(RenderNoiseArgs),
    /// Writes the report of a run again, into its folder and that of `--out`.
    #[command(after_help = "Example: cargo xtask render report runs/NAME")]
    Report(RenderReportArgs),
    /// Writes a page of docs/ and its figures from a finished `reproduce`, `deviations`, `rules` or `scaling`.
    #[command(after_help = "Example: cargo xtask render results runs/NAME --to docs/results.md")]
    Results(RenderResultsArgs),
}

#[derive(Debug, Clone, Args)]
pub(crate) struct RenderReportArgs {
    /// Folder of a training or an evaluation.
    #[arg(value_name = "RUN")]
    run: PathBuf,
}

#[derive(Debug, Clone, Args)]
pub(crate) struct RenderResultsArgs {
    /// Folder of a finished `reproduce`, or of another run that has a table.
    #[arg(value_name = "RUN")]
    run: PathBuf,
    /// Finished runs whose tables are added at the end: of `deviations`, `rules`, `scaling`, `evaluate` or a training.
    #[arg(long, value_name = "[TITLE=]RUN", num_args = 1..)]
    with: Vec<OtherRun>,
    /// File to write; figures go to `pictures/NAME` beside it [default: docs/results.md; of another command
    /// docs/results-COMMAND.md, of another preset its name instead].
    #[arg(long, value_name = "FILE.md")]
    to: Option<PathBuf>,
    /// That of all `render`, hidden: whoever names it is told what to name instead.
    #[arg(long, hide = true)]
    out: Option<PathBuf>,
}

#[derive(Debug, Clone, Args)]
pub(crate) struct RenderLotArgs {
    /// Lots to draw; see `cargo xtask lots`.
    #[arg(long, alias = "lot", value_name = "SPEC", num_args = 1.., value_delimiter = ',', value_parser = lot_name, required = true)]
    lots: Vec<String>,
    /// Seed of the obstacles.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Pixels per metre of single lots [default: as fits 1600 pixels].
    #[arg(long, value_name = "PIXELS")]
    pixels_per_metre: Option<f32>,
}

/// What colours mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum ColourChoice {
    /// How fast.
    Speed,
    /// Which driver.
    Driver,
    /// Expert or network.
    Who,
}

#[derive(Debug, Clone, Args)]
#[command(group = ArgGroup::new("who").args(["drivers", "run"]).required(true))]
pub(crate) struct TrajectoriesArgs {
    /// Drivers, one or more, as in an evaluation; may be repeated. See `cargo xtask drivers`.
    #[arg(long = "driver", value_name = "SPEC", num_args = 1..)]
    drivers: Vec<String>,
    /// Draws a drive of a training run instead, network and expert in turn as the decision rule chose; `--trial` says
    /// which.
    #[arg(long, value_name = "RUN", conflicts_with_all = ["lot", "direction", "noise", "seed", "preset", "config", "overrides"])]
    run: Option<PathBuf>,
    /// Round of the training run; 0 = behaviour cloning.
    #[arg(
        long,
        default_value_t = 1,
        requires = "run",
        conflicts_with = "drivers",
        value_parser = clap::value_parser!(u32).range(..=i64::from(TRIAL_MAX))
    )]
    round: u32,
    #[command(flatten)]
    trial: TrialArgs,
    /// What the colours mean [default: driver; of a training run, who].
    #[arg(long)]
    by: Option<ColourChoice>,
    /// Pixels per metre [default: as fits 1600 pixels].
    #[arg(long, value_name = "PIXELS")]
    pixels_per_metre: Option<f32>,
    #[command(flatten)]
    layers: LayerArgs,
}

#[derive(Debug, Clone, Args)]
pub(crate) struct SamplesArgs {
    /// Folder of the round, e.g. runs/NAME/round-01.
    #[arg(value_name = "ROUND")]
    round: PathBuf,
    /// Samples to draw, evenly spaced over the round.
    #[arg(long, value_name = "N", default_value_t = 12)]
    count: usize,
    /// Folder of the network that predicts [default: the one trained after the round, if it is there].
    #[arg(long, value_name = "DIR")]
    net: Option<PathBuf>,
}

#[derive(Debug, Clone, Args)]
pub(crate) struct RenderNoiseArgs {
    /// Lot to look at, a single one; see `cargo xtask lots`.
    #[arg(long = "lots", alias = "lot", value_name = "SPEC", value_parser = lot_name, default_value = "lot-a")]
    lot: String,
    /// Noise levels: paper, hard or multiples of paper.
    #[arg(long, alias = "level", value_name = "LEVEL", num_args = 1.., value_delimiter = ',', default_value = "paper,hard")]
    noise: Vec<NoiseChoice>,
    /// Where the rear axle stands, metres along the route [default: where most layers of the last level show].
    #[arg(long, value_name = "METRES")]
    at: Option<f32>,
    /// Seed of obstacles and noise.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    #[command(flatten)]
    layers: LayerArgs,
}

pub(crate) fn run(args: &RenderArgs, output: &Output) -> anyhow::Result<()> {
    let path = args.out.as_deref().unwrap_or(Path::new("pictures"));
    let folder = Folder { path, overwrite: args.overwrite, output };
    match &args.what {
        RenderWhat::Lot(what) => render_lots(what, &folder),
        RenderWhat::ContactSheet(what) => contact_sheet(what, &folder),
        RenderWhat::Trajectories(what) => render_trajectories(what, &folder),
        RenderWhat::Animation(what) => render_animation::run(what, &folder),
        RenderWhat::Samples(what) => render_samples(what, &folder),
        RenderWhat::Noise(what) => render_noise(what, &folder),
        RenderWhat::Report(what) => {
            render_report(&what.run, args.overwrite, args.out.is_some().then_some(&folder), output)
        }
        RenderWhat::Results(what) => {
            ensure!(what.out.is_none(), "--out: a page of results is one file; name it with --to");
            render_results(what, args.overwrite, output)
        }
    }
}

/// `--pixels-per-metre`.
pub(super) fn check_scale(pixels_per_metre: Option<f32>) -> anyhow::Result<()> {
    let is_possible = |scale| scale > 0.0 && scale <= PIXELS_PER_METRE_MAX;
    ensure!(
        pixels_per_metre.is_none_or(is_possible),
        "--pixels-per-metre must be positive, and at most {PIXELS_PER_METRE_MAX}"
    );
    Ok(())
}

/// Lots whose maps are in memory at a time.
const LOTS_AT_A_TIME: usize = 32;

fn render_lots(args: &RenderLotArgs, folder: &Folder<'_>) -> anyhow::Result<()> {
    check_scale(args.pixels_per_metre)?;
    let episode = Settings::preset("default")?.episode;
    let lots = Lot::parse_all(&args.lots, &episode.vehicle)?;
    let made_of = drawn_lots::made_of(&lots)?;
    drawn_lots::ensure_files_differ(lots.iter().map(|lot| (file_name(lot.name()), lot.name())), "png")?;
    for lot in &lots {
        folder.check(lot.name(), true)?;
        drawn_lots::ensure_apart_from(&made_of, &folder.files(lot.name(), true))?;
    }
    let console = Console::new(folder.output);
    console.begin("lots", "drawing lots");
    let mut drawn = 0_usize;
    for some in lots.chunks(LOTS_AT_A_TIME) {
        for map in maps(some, args.seed, &episode)? {
            console.at(drawn as f64 / lots.len() as f64, &mut |_| format!("{drawn} of {} lots", lots.len()));
            if console.is_cancelled() {
                return Err(Interrupted { kept: format!("{drawn} lots were drawn") }.into());
            }
            let picture = lot::top_view(&map, &episode.vehicle, args.pixels_per_metre)?;
            folder.write(&map.scenario().name, &picture, true)?;
            drawn += 1;
        }
    }
    console.end(&counted_lots(drawn));
    Ok(())
}

fn contact_sheet(args: &RenderLotArgs, folder: &Folder<'_>) -> anyhow::Result<()> {
    const NAME: &str = "contact-sheet";
    ensure!(
        args.pixels_per_metre.is_none(),
        "--pixels-per-metre: a contact sheet has a scale of its own; leave it out"
    );
    folder.check(NAME, true)?;
    let episode = Settings::preset("default")?.episode;
    let lots = Lot::parse_all(&args.lots, &episode.vehicle)?;
    drawn_lots::ensure_apart_from(&drawn_lots::made_of(&lots)?, &folder.files(NAME, true))?;
    contact_sheet::check(lots.len())?;
    let console = Console::new(folder.output);
    console.begin("lots", "drawing lots");
    let maps = maps(&lots, args.seed, &episode)?;
    console.end(&counted_lots(maps.len()));
    folder.write(NAME, &contact_sheet::picture(&maps)?, true)
}

fn maps(lots: &[Lot], seed: u64, episode: &EpisodeSettings) -> anyhow::Result<Vec<Map>> {
    let trials = Trial::all(RootSeed(seed), Purpose::Pictures, lots, 1, &[Direction::Forward]);
    trials.collect::<Vec<_>>().par_iter().map(|trial| trial.map(episode)).collect()
}

fn render_trajectories(args: &TrajectoriesArgs, folder: &Folder<'_>) -> anyhow::Result<()> {
    check_scale(args.pixels_per_metre)?;
    let drives = match &args.run {
        Some(run) => driven_in_training(run, args, folder)?,
        None => driven_anew(args, folder)?,
    };
    let by = match args.by.unwrap_or(if args.run.is_some() { ColourChoice::Who } else { ColourChoice::Driver }) {
        ColourChoice::Speed => ColourBy::Speed,
        ColourChoice::Driver => ColourBy::Driver,
        ColourChoice::Who => ColourBy::Source,
    };
    let Drives { map, driven, title, file } = drives;
    folder.write(&file, &trajectories::picture(&map, &driven, by, &title, args.pixels_per_metre)?, true)
}

struct Drives {
    map: Arc<Map>,
    driven: Vec<Trajectory>,
    title: String,
    /// Name of the picture.
    file: String,
}

/// One drive per driver, all on the same obstacles and noise as in an evaluation.
fn driven_anew(args: &TrajectoriesArgs, folder: &Folder<'_>) -> anyhow::Result<Drives> {
    let specs = DriverSpec::parse_all(&args.drivers)?;
    let (settings, lot, keys) = args.trial.keys(&specs, &args.layers, folder.output)?;
    let ReplayKey { direction, trial, noise, .. } = keys[0];
    let replay = Replay::new(&keys[0], &settings.episode)?;
    let title = format!("{} {} trial {trial}", lot.name(), direction.name());
    let noise = if noise == NoiseChoice::Paper { String::new() } else { format!(" noise {noise}") };
    let names: Vec<String> = specs.iter().map(ToString::to_string).collect();
    let file = format!("drive {title}{noise} {}", names.join(" "));
    folder.check(&file, true)?;
    let drivers: Vec<NamedDriver> = specs
        .into_iter()
        .map(|spec| {
            let driver = spec.load(&settings)?;
            driver.check(&settings)?;
            Ok(driver)
        })
        .collect::<anyhow::Result<_>>()?;
    let console = Console::new(folder.output);
    console.plan(drivers.iter().map(|_| ("driving", 2.0)).collect());
    let mut driven = Vec::new();
    for driver in drivers {
        console.begin("driving", &driver.name);
        let length_m = replay.map.path().length_m();
        let mut points = Vec::new();
        let report = replay.drive(&settings.episode, &driver, |frame| {
            points.push(Point::of(frame));
            console.at(f64::from(frame.progress_m / length_m), &mut |_| format!("{} ticks", points.len()));
            ControlFlow::Continue(())
        })?;
        let near_collisions = report.map_or(0, |report| report.metrics.near_collisions);
        console.end(&format!("near-collisions: {near_collisions} in {length_m:.0} m"));
        driven.push(Trajectory { name: driver.name, points });
    }
    Ok(Drives { map: Arc::clone(&replay.map), driven, title, file })
}

/// A drive of a training round: the network of the round before and the expert, as in the training itself.
fn driven_in_training(run: &Path, args: &TrajectoriesArgs, folder: &Folder<'_>) -> anyhow::Result<Drives> {
    trained::policy_folder(run)?;
    let (map, rollouts) = training::drive_again(run, args.round, args.trial.trial)?;
    let title = format!("{} round {} drive {}", map.scenario().name, args.round, args.trial.trial);
    let name = run.file_name().unwrap_or_default().to_string_lossy();
    let file = format!("drive {title} {name}");
    folder.check(&file, true)?;
    let length_m = map.path().length_m();
    let console = Console::new(folder.output);
    console.begin("driving", "training");
    let mut points = Vec::new();
    let collected = rollouts.drive(&mut |_, frame| {
        points.push(Point::of(frame));
        console.at(f64::from(frame.progress_m / length_m), &mut |_| format!("{} ticks", points.len()));
    })?;
    let near_collisions = collected.reports[0].metrics.near_collisions;
    console.end(&format!("near-collisions: {near_collisions} in {length_m:.0} m"));
    let driven = vec![Trajectory { name: "training".to_owned(), points }];
    Ok(Drives { map, driven, title, file })
}

fn render_samples(args: &SamplesArgs, folder: &Folder<'_>) -> anyhow::Result<()> {
    ensure!(
        (1..=samples::COUNT_MAX).contains(&args.count),
        "--count {}: a picture has room for 1 to {} samples",
        args.count,
        samples::COUNT_MAX
    );
    let name = args.round.file_name().unwrap_or_default().to_string_lossy();
    let index = name.strip_prefix("round-").and_then(|index| index.parse().ok());
    // The run of `round-01`, named from within, is the present folder.
    let run = args.round.parent().map(|run| if run.as_os_str().is_empty() { Path::new(".") } else { run });
    let (Some(index), Some(run)) = (index, run) else {
        anyhow::bail!("{}: this is not a round; name one, as in runs/NAME/round-01", args.round.display());
    };
    // Opening a store creates its folder.
    ensure!(args.round.is_dir(), "{}: there is no such round", args.round.display());
    let kept = Store::open(run)?.read_samples(index)?;
    let settings = trained::settings_of(run)?;
    let net = args.net.as_deref().unwrap_or(&args.round);
    let checkpoint = (args.net.is_some() || Checkpoint::exists(net)?).then(|| Checkpoint::load(net)).transpose()?;
    let count = args.count.min(kept.len());
    let chosen: Vec<usize> = (0..count).map(|i| (2 * i + 1) * kept.len() / (2 * count)).collect();
    let grids: Vec<_> = chosen.iter().map(|&i| &kept[i].grid).collect();
    let answers = checkpoint.map(|checkpoint| checkpoint.predictor().predict(&grids));
    let samples: Vec<_> = chosen
        .iter()
        .enumerate()
        .map(|(place, &i)| (i, kept[i], answers.as_ref().map(|answers| answers[place])))
        .collect();
    let title = format!("{name}: {count} of {} samples", kept.len());
    folder.write(
        &format!("samples-{name}"),
        &samples::picture(&title, &samples, &settings.episode.sensing.geometry)?,
        false,
    )
}

fn render_noise(args: &RenderNoiseArgs, folder: &Folder<'_>) -> anyhow::Result<()> {
    let mut settings = Settings::resolve(&Layers::from(&args.layers), None)?;
    settings.evaluation.noise.clone_from(&args.noise);
    settings.check()?;
    let lot = Lot::parse_one(&args.lot, &settings.episode.vehicle).context("--lots")?;
    folder.output.notes(&experiment::notes::of(std::slice::from_ref(&lot), &args.noise));
    let trial = Trial::new(RootSeed(args.seed), Purpose::Pictures, &lot, Direction::Forward, 0);
    let map = trial.map(&settings.episode)?;
    let inspect = |level: NoiseChoice, at_m: f32| noise::inspect(&settings.episode, &trial, &map, level, at_m);
    // One is named at least.
    let last = args.noise[args.noise.len() - 1];
    let richest = || noise::richest_place(map.path().length_m(), |at_m| inspect(last, at_m));
    let at_m = args.at.unwrap_or_else(richest);
    ensure!(
        (0.0..=map.path().length_m()).contains(&at_m),
        "--at {at_m}: the route is {:.1} m long",
        map.path().length_m()
    );
    let levels: Vec<(String, Inspection)> =
        args.noise.iter().map(|&noise| (noise.name(), inspect(noise, at_m))).collect();
    let title = format!("{}, {at_m:.1} m along the route, seed {}", trial.lot.name(), args.seed);
    folder.write(&format!("noise-{}", trial.lot.name()), &noise::picture(&title, &levels)?, false)
}

fn render_results(args: &RenderResultsArgs, overwrite: bool, output: &Output) -> anyhow::Result<()> {
    ensure!(
        manifest::is_finished(&args.run)?,
        "{}: this is not a finished run of reproduce or of another command that ends in a table",
        args.run.display()
    );
    let Manifest { command, preset, .. } = Manifest::read(&args.run)?;
    let suffix = match (command.as_str(), preset.strip_prefix("full-").unwrap_or(&preset)) {
        (reproduce::COMMAND, "default") => String::new(),
        (reproduce::COMMAND, preset) => format!("-{preset}"),
        (command, _) => format!("-{command}"),
    };
    let to = args.to.clone().unwrap_or_else(|| format!("docs/results{suffix}.md").into());
    let made_by = MadeBy { build: build_info::get(), to: args.to.as_deref() };
    // What is wrong with a run is said before anything about the page: with another run it may be another page.
    let page = if command == reproduce::COMMAND {
        reproduction::docs_page(&reproduce::recipe_of(&args.run)?, &args.run, &args.with, made_by)?
    } else {
        OtherRun::from(args.run.clone()).docs_page(&args.with, made_by)?
    };
    run_dir::ensure_outside_of_runs(&to).context("--to")?;
    ensure!(
        overwrite || !to.exists() || docs_page::is_page_of_results(&to),
        "{}: exists already, and is not a page of results; choose another --to, or replace it with --overwrite",
        to.display()
    );
    page.write_markdown(&to)?;
    output.print(to.display());
    Ok(())
}

fn render_report(run: &Path, overwrite: bool, copy: Option<&Folder<'_>>, output: &Output) -> anyhow::Result<()> {
    ensure!(
        !shards::is_shard(run)?,
        "{}: this is a shard, which has no report; put all together with cargo xtask merge RUN...",
        run.display()
    );
    let owned = RunDir::reopen(run, "render report")?;
    // What else has a report wrote it itself, of its stages, and would lose it.
    let has_file = |name| manifest::has_file(run, name);
    ensure!(
        has_file("dagger.toml")? || has_file("runs.jsonl")?,
        "{}: this is neither a training nor an evaluation; name one of its folders, or see render results --help",
        run.display()
    );
    let report = owned.path().join(run_report::FILE);
    let copy = copy.map(|folder| (folder, folder.path.join(run_report::FILE)));
    if let Some((folder, path)) = &copy {
        folder.check_file(path)?;
    }
    let console = Console::new(output);
    let made = Report::of(&owned, &console)?;
    if let Some(reason) = made.not_replayed.first() {
        ensure!(
            overwrite,
            "{}: of the near-collisions that its report shows {} cannot be replayed from here ({reason}); run this in the folder in \
             which the run was made, or write the report without their pictures with --overwrite",
            run.display(),
            made.not_replayed.len()
        );
        // Whoever meant to replace the copy in `--out` alone should know.
        output.note(format_args!(
            "warning: {}: its report is written without the pictures of near-collisions that cannot be replayed from here \
             ({reason}); written again where the run was made, it has them again",
            run.display()
        ));
    }
    owned.list_without_report()?;
    let written = made.write(&owned, &console);
    // Its own list has changed, also where the report was cut short.
    owned.list_again()?;
    written?;
    output.print(report.display());
    if let Some((folder, path)) = copy {
        let content = storage::read::bytes(&report, RUN_TEXT_BYTES_MAX)
            .with_context(|| format!("{}: cannot be read", report.display()))?;
        folder.put(&path, &content)?;
    }
    Ok(())
}
