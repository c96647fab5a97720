//! `reproduce`: the paper in a box. Trains, drives and writes one report; every stage has a folder of its own and is
//! skipped where it is finished already.

pub mod conclusions;
mod report;
pub mod stages;
pub mod watched;

use crate::cli::ReproduceArgs;
use crate::drivers::{self, DriverSpec};
use crate::evaluate::{self, NamedDriver, Plan};
use crate::interrupt::{self, Interrupted};
use crate::lots::Lot;
use crate::progress::Stopwatch;
use crate::run_dir::{self, Place, RunDir};
use crate::settings::Settings;
use crate::train;
use anyhow::{Context as _, ensure};
use serde::Serialize;
use stages::{Extent, Stage, Step};
use std::fs;
use std::path::{Path, PathBuf};

const EXTENT: &str = "reproduce.toml";
/// Trainings of `--full`.
const SEEDS_FULL: u64 = 5;

/// Everything that decides what is done.
pub(crate) struct Recipe {
    pub(crate) settings: Settings,
    pub(crate) extent: Extent,
    pub(crate) stages: Vec<Stage>,
}

/// The command.
///
/// # Errors
/// If something named does not exist, a file cannot be read or written, or by Ctrl-C.
pub fn run(args: &ReproduceArgs) -> anyhow::Result<()> {
    let (run, settings, extent) = if let Some(path) = &args.resume { resume(path)? } else { begin(args)? };
    let stages = stages::all(&settings, &extent, run.path());
    let recipe = Recipe { settings, extent, stages };
    eprintln!("run: {}", run.path().display());
    announce(&recipe.stages, run.path());
    let mut stopwatch = Stopwatch::default();
    for (index, stage) in recipe.stages.iter().enumerate() {
        eprintln!("\n{} of {}: {} ({})", index + 1, recipe.stages.len(), stage.about, stage.folder);
        let is_done = if interrupt::is_requested() { Ok(false) } else { perform(stage, run.path(), &mut stopwatch) };
        match is_done {
            Ok(true) => {}
            Ok(false) => return Err(cut_short(run.path(), index)),
            Err(error) if error.is::<Interrupted>() => return Err(cut_short(run.path(), index)),
            Err(error) => return Err(error.context(format!("stage {}", stage.folder))),
        }
    }
    let conclusions = report::write(&recipe, &run)?;
    println!("\nWhat holds here\n\n{conclusions}");
    run.finish(&report::Finished { stages: recipe.stages.len() })?;
    eprintln!("written: {}/report.html, report.md, conclusions.csv and figures/", run.path().display());
    stopwatch.report();
    Ok(())
}

fn cut_short(root: &Path, finished: usize) -> anyhow::Error {
    let root = root.display();
    let kept = format!("{finished} finished stages are in {root}; go on with: cargo xtask reproduce --resume {root}");
    Interrupted { kept }.into()
}

fn begin(args: &ReproduceArgs) -> anyhow::Result<(RunDir, Settings, Extent)> {
    let mut settings = Settings::resolve(&args.settings.layers, args.settings.seed)?;
    let is_smoke = args.settings.layers.preset_name() == "smoke";
    if args.full {
        settings.evaluation.trials *= 2;
    }
    let unseen = match &args.unseen[..] {
        [] if args.full => vec!["test:100".to_owned()],
        [] if is_smoke => vec!["test:1:easy".to_owned()],
        [] => vec!["test:20".to_owned()],
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
        Lot::parse_all(lots)?;
    }
    let trained_on = Lot::parse_all(&settings.training.lots)?;
    for lot in Lot::parse_all(&extent.unseen)? {
        let is_unseen = !lot.is_for_training() && trained_on.iter().all(|known| known.name() != lot.name());
        ensure!(is_unseen, "--unseen {}: drivers are trained or tuned on it; name others, e.g. test:20", lot.name());
    }
    ensure!(
        settings.seed.0.checked_add(extent.seeds).is_some_and(|last| i64::try_from(last).is_ok()),
        "seed {} leaves no room for {} trainings; choose a smaller one",
        settings.seed.0,
        extent.seeds
    );
    let place = Place {
        out: args.out.as_deref(),
        overwrite: args.overwrite,
        command: if args.full { "reproduce-full" } else { "reproduce" },
        preset: args.settings.layers.preset_name(),
        seed: settings.seed.0,
    };
    let run = RunDir::create(&place, &settings)?;
    run.write(EXTENT, toml::to_string(&extent)?.as_bytes())?;
    Ok((run, settings, extent))
}

fn resume(path: &Path) -> anyhow::Result<(RunDir, Settings, Extent)> {
    let (run, settings) = RunDir::resume(path)?;
    let file = path.join(EXTENT);
    let text = fs::read_to_string(&file).with_context(|| {
        format!("{}: cannot be read; only a folder of cargo xtask reproduce can be resumed", file.display())
    })?;
    let extent = toml::from_str(&text).with_context(|| file.display().to_string())?;
    Ok((run, settings, extent))
}

/// Planners with tuned parameters: those of a folder that `tune` wrote, else those that ship with the program.
fn tuned(folder: Option<&Path>) -> anyhow::Result<Vec<String>> {
    let Some(folder) = folder else {
        let shipped = drivers::specs().into_iter().map(|(spec, _)| spec).filter(|spec| spec.starts_with("tuned:"));
        return Ok(shipped.map(str::to_owned).collect());
    };
    let specs: Vec<String> = planners::Baseline::all()
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
fn announce(stages: &[Stage], root: &Path) {
    let mut left_s = 0.0;
    eprintln!("stages, with the minutes they take on two quiet cores:");
    for (index, stage) in stages.iter().enumerate() {
        let is_finished = run_dir::is_finished(&root.join(&stage.folder));
        let estimate_s = if is_finished { 0.0 } else { stage.estimate_s() };
        left_s += estimate_s;
        let minutes = if is_finished { "done".to_owned() } else { format!("{:.1}", estimate_s / 60.0) };
        eprintln!("{:>3}. {minutes:>6}  {} ({})", index + 1, stage.about, stage.folder);
    }
    eprintln!("about {:.0} minutes in all", (left_s / 60.0).ceil());
}

/// Does a stage unless it is done; `false` if cut short by Ctrl-C.
fn perform(stage: &Stage, root: &Path, stopwatch: &mut Stopwatch) -> anyhow::Result<bool> {
    let path = root.join(&stage.folder);
    let settings = &stage.settings;
    let place = Place { out: None, overwrite: false, command: "reproduce", preset: "reproduce", seed: settings.seed.0 };
    let Some(run) = RunDir::stage(&path, &place, settings)? else {
        eprintln!("done before");
        return Ok(true);
    };
    match &stage.step {
        Step::Train { cloning_of } => {
            if let Some(chain) = cloning_of {
                take_over_cloning(&root.join(chain), &path)?;
            }
            let Ok((_, finished)) = train::tabulated(settings, &run, None, stopwatch)? else { return Ok(false) };
            run.finish(&finished)?;
        }
        Step::Drive { drivers } => {
            let (entries, lots) = (entries(drivers)?, Lot::parse_all(&settings.evaluation.lots)?);
            let plan = Plan { settings, entries: &entries, lots: &lots, compare_with: compare_with(&entries) };
            plan.check()?;
            evaluate::measure(&plan, &run, None, stopwatch)?;
            let drivers = entries.iter().map(|entry| entry.spec.as_str()).collect();
            run.finish(&Driven { drivers })?;
        }
        Step::IncidentMonitor => {
            let started = std::time::Instant::now();
            if !watched::watch(settings, root, &run)? {
                return Ok(false);
            }
            stopwatch.add("watching", started.elapsed().as_secs_f64());
            run.finish(&Driven { drivers: Vec::new() })?;
        }
    }
    Ok(true)
}

#[derive(Serialize)]
struct Driven<'a> {
    drivers: Vec<&'a str>,
}

/// Drivers by their names in tables.
pub(crate) fn entries(drivers: &[(String, String)]) -> anyhow::Result<Vec<NamedDriver>> {
    let entry = |(name, spec): &(String, String)| {
        let contestant = drivers::DriverSpec::parse_all(std::slice::from_ref(spec))?.remove(0).renamed(name);
        Ok(NamedDriver { contestant, spec: spec.clone() })
    };
    drivers.iter().map(entry).collect()
}

/// The paper's driver, where it takes part.
pub(crate) fn compare_with(entries: &[NamedDriver]) -> usize {
    entries.iter().position(|entry| entry.contestant.name == conclusions::DAGGER).unwrap_or(0)
}

/// Copies behaviour cloning from a finished chain: complete or not at all.
fn take_over_cloning(from: &Path, to: &Path) -> anyhow::Result<()> {
    const ROUND: &str = "round-00";
    let (source, target) = (from.join(ROUND), to.join(ROUND));
    if target.exists() {
        return Ok(());
    }
    let partial: PathBuf = to.join("round-00.partial");
    let copy = || {
        if partial.exists() {
            fs::remove_dir_all(&partial)?;
        }
        fs::create_dir_all(&partial)?;
        for entry in fs::read_dir(&source)? {
            let entry = entry?;
            fs::copy(entry.path(), partial.join(entry.file_name()))?;
        }
        fs::rename(&partial, &target)
    };
    copy().with_context(|| format!("{}: cannot be copied to {}", source.display(), target.display()))
}
