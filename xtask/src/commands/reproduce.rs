//! `reproduce`: the paper in a box. Trains, drives and writes one report; every stage has a folder of its own and is
//! skipped where it is finished already.

use super::{evaluate, train};
use crate::args::{LayerArgs, OutArgs};
use crate::build_info;
use crate::console::Console;
use crate::interrupt;
use crate::output::Output;
use anyhow::{Context as _, ensure};
use clap::Args;
use evaluation::conclusions;
use evaluation::on_policy;
use evaluation::plan::Plan;
use evaluation::stages::{self, Extent, Stage, Step};
use experiment::drivers::{self, DriverSpec, NamedDriver};
use experiment::inputs::{self, Inputs};
use experiment::lots::Lot;
use experiment::progress::{Interrupted, Progress as _};
use experiment::run_dir::{self, Manifest, Outcome, Place, Request, RunDir};
use experiment::settings::{Layers, Settings};
use policy::dataset::store::Store;
use report::reproduction::{self, Recipe};
use std::path::{Path, PathBuf};
use storage::sums;

pub(crate) const EXAMPLES: &str = "\
Examples:
  cargo xtask reproduce                               an hour on two cores
  cargo xtask reproduce --preset smoke --out runs/try   every stage within a minute
  cargo xtask reproduce --full --unseen sealed:my-phrase:120:all
  cargo xtask reproduce --resume runs/reproduce-default-s1";

#[derive(Debug, Clone, Args)]
pub(crate) struct ReproduceArgs {
    #[command(flatten)]
    layers: LayerArgs,
    /// Root seed of the first training.
    #[arg(long)]
    seed: Option<u64>,
    /// Five training seeds, twice the trials, more unseen lots, longer ablations.
    #[arg(long)]
    full: bool,
    /// Lots that no driver has met; see `cargo xtask lots`. A phrase of your own draws lots that nobody has seen [default:
    /// sealed:reproduce:24:all; sealed:reproduce:120:all with --full].
    #[arg(long, value_name = "SPEC", num_args = 1.., value_delimiter = ',')]
    unseen: Vec<String>,
    /// Folder of `cargo xtask tune`: planners also drive with the parameters found there [default: those in planners/tuned].
    #[arg(long, value_name = "DIR")]
    tuned: Option<PathBuf>,
    #[command(flatten)]
    out: OutArgs,
    /// Continues an interrupted run with its own settings, to the same result; finished stages are skipped.
    #[arg(
        long,
        value_name = "DIR",
        conflicts_with_all = ["preset", "config", "overrides", "seed", "out", "full", "unseen", "tuned"]
    )]
    resume: Option<PathBuf>,
}

const COMMAND: &str = "reproduce";
/// Trainings of `--full`.
const SEEDS_FULL: u64 = 5;

pub(crate) fn run(args: &ReproduceArgs, output: &Output) -> anyhow::Result<()> {
    let (run, settings, extent) = if let Some(path) = &args.resume { resume(path)? } else { begin(args)? };
    let stages = stages::all(&settings, &extent, run.path());
    let recipe = Recipe { settings, extent, stages };
    let console = Console::new(output);
    perform_all(COMMAND, &recipe.stages, &run, &console, output)?;
    let conclusions = reproduction::write(&recipe, &run)?;
    output.table(|| format!("\nWhat holds here\n\n{conclusions}"), &())?;
    run.finish(Outcome::Reproduction { stages: recipe.stages.len() })?;
    output.note(format_args!("written: {}/report.html, report.md, conclusions.csv and figures/", run.path().display()));
    console.report_time();
    Ok(())
}

/// Does every stage of a run that is not done yet.
pub(crate) fn perform_all(
    command: &str,
    stages: &[Stage],
    run: &RunDir,
    console: &Console,
    output: &Output,
) -> anyhow::Result<()> {
    output.note(format_args!("run: {}", run.path().display()));
    interrupt::can_resume(command, run.path());
    announce(stages, run.path(), output)?;
    let mut tasks = Vec::new();
    for stage in stages {
        if !run_dir::is_finished(&run.path().join(&stage.folder))? {
            tasks.extend(stage.tasks());
        }
    }
    console.plan(tasks);
    for (index, stage) in stages.iter().enumerate() {
        let (place, of) = (index + 1, stages.len());
        output.note(format_args!("\n{place} of {of}: {} ({})", stage.about, stage.folder));
        let is_done = if console.is_cancelled() { Ok(false) } else { perform(command, stage, run, console, output) };
        match is_done {
            Ok(true) => {}
            Ok(false) => return Err(cut_short(run.path(), index)),
            Err(error) if error.is::<Interrupted>() => return Err(cut_short(run.path(), index)),
            Err(error) => return Err(error.context(format!("stage {}", stage.folder))),
        }
    }
    Ok(())
}

fn cut_short(root: &Path, finished: usize) -> anyhow::Error {
    Interrupted { kept: format!("{finished} finished stages are in {}", root.display()) }.into()
}

fn begin(args: &ReproduceArgs) -> anyhow::Result<(RunDir, Settings, Extent)> {
    let layers = Layers::from(&args.layers);
    let mut settings = Settings::resolve(&layers, args.seed)?;
    let is_smoke = layers.preset_name() == "smoke";
    if args.full {
        settings.evaluation.trials *= 2;
    }
    let unseen = match &args.unseen[..] {
        [] if args.full => vec!["sealed:reproduce:120:all".to_owned()],
        [] if is_smoke => vec!["test:1:easy".to_owned()],
        [] => vec!["sealed:reproduce:24:all".to_owned()],
        named => named.to_vec(),
    };
    let extent = Extent {
        seeds: if args.full { SEEDS_FULL } else { 1 },
        unseen,
        rule_iterations: if args.full { settings.dagger.iterations_max } else { 1 },
        tuned: tuned(args.tuned.as_deref())?,
    };
    // Before the folder is claimed: a misspelt lot should not leave one behind.
    for lots in [&settings.training.lots, &settings.evaluation.lots, &extent.unseen] {
        Lot::parse_all(lots, &settings.episode.vehicle)?;
    }
    let trained_on = Lot::parse_all(&settings.training.lots, &settings.episode.vehicle)?;
    for lot in Lot::parse_all(&extent.unseen, &settings.episode.vehicle)? {
        let is_unseen = !lot.is_for_training() && trained_on.iter().all(|known| known.name() != lot.name());
        ensure!(
            is_unseen,
            "--unseen {}: drivers are trained or tuned on it; name others, e.g. sealed:PHRASE:24:all",
            lot.name()
        );
    }
    ensure!(
        settings.seed.0.checked_add(extent.seeds).is_some_and(|last| i64::try_from(last).is_ok()),
        "seed {} leaves no room for {} trainings; choose a smaller one",
        settings.seed.0,
        extent.seeds
    );
    let preset = format!("{}{}", if args.full { "full-" } else { "" }, layers.preset_name());
    let place = args.out.place(COMMAND, &preset, settings.seed.0);
    let request = Request { arguments: toml::Table::try_from(&extent)?, inputs: inputs(&settings, &extent)? };
    let run = RunDir::create(&place, &settings, &request)?;
    Ok((run, settings, extent))
}

/// What a run did, by the files that it left.
pub(crate) fn recipe_of(path: &Path) -> anyhow::Result<Recipe> {
    let (settings, extent) = (run_dir::settings_of(path)?, extent_of(path, &Manifest::read(path)?)?);
    let stages = stages::all(&settings, &extent, path);
    Ok(Recipe { settings, extent, stages })
}

fn extent_of(path: &Path, manifest: &Manifest) -> anyhow::Result<Extent> {
    let arguments = manifest.arguments.clone();
    arguments.try_into().with_context(|| format!("{}: this is no folder of cargo xtask reproduce", path.display()))
}

fn resume(path: &Path) -> anyhow::Result<(RunDir, Settings, Extent)> {
    let (run, settings, manifest) = RunDir::resume(path, COMMAND)?;
    let extent = extent_of(path, &manifest)?;
    manifest.check_inputs(&inputs(&settings, &extent)?)?;
    Ok((run, settings, extent))
}

/// The lots and parameters from files that are read.
fn inputs(settings: &Settings, extent: &Extent) -> anyhow::Result<Inputs> {
    let mut found = train::inputs(settings)?;
    let unseen = Lot::parse_all(&extent.unseen, &settings.episode.vehicle)?;
    let tuned = NamedDriver::load_all(&extent.tuned, settings)?;
    found.extend(inputs::of(&unseen, &tuned));
    Ok(found)
}

/// Planners with tuned parameters: those of a folder that `tune` wrote, else those that ship with the program.
fn tuned(folder: Option<&Path>) -> anyhow::Result<Vec<String>> {
    let Some(folder) = folder else {
        return Ok(drivers::tuned_specs());
    };
    let specs: Vec<String> = planners::PlannerSpec::all()
        .iter()
        .map(|planner| (planner.name(), folder.join(format!("{}.toml", planner.name()))))
        .filter(|(_, file)| file.is_file())
        .map(|(name, file)| format!("{name}:{}", file.display()))
        .collect();
    ensure!(!specs.is_empty(), "--tuned {}: no parameters are there; cargo xtask tune writes them", folder.display());
    DriverSpec::parse_all(&specs)?;
    Ok(specs)
}

/// What will be done, with a guess at how long it takes.
fn announce(stages: &[Stage], root: &Path, output: &Output) -> anyhow::Result<()> {
    let mut left_s = 0.0;
    output.note("stages, with the minutes they take on two quiet cores:");
    for (index, stage) in stages.iter().enumerate() {
        let is_finished = run_dir::is_finished(&root.join(&stage.folder))?;
        let estimate_s = if is_finished { 0.0 } else { stage.estimate_s() };
        left_s += estimate_s;
        let minutes = if is_finished { "done".to_owned() } else { format!("{:.1}", estimate_s / 60.0) };
        output.note(format_args!("{:>3}. {minutes:>6}  {} ({})", index + 1, stage.about, stage.folder));
    }
    output.note(format_args!("about {:.0} minutes in all", (left_s / 60.0).ceil()));
    Ok(())
}

/// Does a stage unless it is done; `false` if cut short by Ctrl-C.
fn perform(command: &str, stage: &Stage, root: &RunDir, console: &Console, output: &Output) -> anyhow::Result<bool> {
    let settings = &stage.settings;
    let build = build_info::get();
    let place = Place { build, out: None, overwrite: false, command, preset: command, seed: settings.seed.0 };
    let Some(run) = root.stage(&stage.folder, &place, settings)? else {
        output.note("done before");
        return Ok(true);
    };
    match &stage.step {
        Step::Train { cloning_of } => {
            if let Some(chain) = cloning_of {
                take_over_cloning(&root.path().join(chain), &run)?;
            }
            let Ok((_, outcome)) = train::tabulated(settings, &run, console, output)? else { return Ok(false) };
            run.finish(outcome)?;
        }
        Step::Drive { drivers } => {
            let specs = drivers.iter().map(|(_, spec)| spec.clone()).collect();
            let (drivers, lots) = (
                stages::load(drivers, settings)?,
                Lot::parse_all(&settings.evaluation.lots, &settings.episode.vehicle)?,
            );
            let compare_with = conclusions::compare_with(&drivers);
            let plan = Plan { settings, drivers: &drivers, lots: &lots, compare_with, shard: None };
            evaluate::check(&plan)?;
            evaluate::measure(&plan, &run, console, output)?;
            run.finish(Outcome::Evaluation { drivers: specs })?;
        }
        Step::OnPolicy => {
            if !on_policy::run(settings, root.path(), &run, console)? {
                return Ok(false);
            }
            run.finish(Outcome::Evaluation { drivers: Vec::new() })?;
        }
    }
    Ok(true)
}

/// Copies behaviour cloning from a finished chain: complete or not at all.
fn take_over_cloning(from: &Path, run: &RunDir) -> anyhow::Result<()> {
    const ROUND: &str = "round-00";
    let (from, to) = (Store::open(from)?, Store::open(run.path())?);
    let source = from.round_folder(0);
    if to.is_finished(&to.round_folder(0))? {
        return Ok(());
    }
    ensure!(from.is_finished(&source)?, "{}: behaviour cloning is not finished there", source.display());
    let files = sums::names(&source)?.into_iter().map(|name| {
        // Its size was checked by nobody, its digest is.
        let content = sums::read_listed(&source, &name, u64::MAX)?;
        Ok::<_, anyhow::Error>((name, content))
    });
    Ok(sums::write_folder(run.path(), ROUND, files.collect::<anyhow::Result<Vec<_>>>()?)?)
}
