//! Does the stages of a run, each in a folder of its own; one that is finished is left alone.

use super::{evaluate, train};
use crate::build_info;
use crate::console::Console;
use crate::interrupt;
use crate::output::Output;
use anyhow::{Context as _, bail, ensure};
use evaluation::drive_stage::DriveStage;
use evaluation::estimate::Task;
use evaluation::on_policy;
use evaluation::shards::ShardRecord;
use evaluation::stage::{Stage, Step};
use evaluation::stages;
use evaluation::table1::Table1;
use experiment::inputs::Inputs;
use experiment::manifest::{self, Outcome, Request};
use experiment::progress::{Interrupted, Progress as _};
use experiment::run_dir::{Place, RunDir};
use experiment::settings::Settings;
use policy::dataset::store::Store;
use std::path::Path;
use storage::sums;

/// Does every stage of a run that is not done yet.
pub(crate) fn all(
    command: &str,
    stages: &[Stage],
    run: &RunDir,
    console: &Console,
    output: &Output,
) -> anyhow::Result<()> {
    output.note(format_args!("run: {}", run.path().display()));
    interrupt::can_resume(command, run.path());
    console.plan(announce(stages, run.path(), output)?);
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

/// Says what will be done, with a guess at how long it takes; returns the tasks.
fn announce(stages: &[Stage], root: &Path, output: &Output) -> anyhow::Result<Vec<Task>> {
    let mut all = Vec::new();
    // The sum of nothing is -0.
    let minutes_of = |tasks: &[Task]| tasks.iter().map(|(_, seconds)| seconds / 60.0).sum::<f64>() + 0.0;
    output.note("stages, with the minutes they take on two quiet cores:");
    for (index, stage) in stages.iter().enumerate() {
        let left = stage.tasks_left(root)?;
        let minutes = left.as_ref().map_or_else(|| "done".to_owned(), |tasks| format!("{:.1}", minutes_of(tasks)));
        output.note(format_args!("{:>3}. {minutes:>6}  {} ({})", index + 1, stage.about, stage.folder));
        all.extend(left.into_iter().flatten());
    }
    output.note(format_args!("about {:.0} minutes in all", minutes_of(&all).ceil()));
    Ok(all)
}

/// Does a stage unless it is done; `false` if cut short by Ctrl-C.
fn perform(command: &str, stage: &Stage, root: &RunDir, console: &Console, output: &Output) -> anyhow::Result<bool> {
    let settings = &settings_of(stage, root)?;
    let request = || request_of(stage);
    let Some(run) = root.stage_for(&stage.folder, &place_of(command, settings), settings, request)? else {
        ensure_driven_by(stage, root)?;
        output.note("done before");
        return Ok(true);
    };
    match &stage.step {
        Step::Train { cloning_of, .. } => {
            if let Some(chain) = cloning_of {
                take_over_cloning(&root.path().join(chain), &run)?;
            }
            let Ok(outcome) = train::tabulated(settings, &run, console, output)? else { return Ok(false) };
            run.finish(outcome)?;
        }
        Step::Drive { drivers } => {
            let drive = DriveStage::load(stage)?;
            evaluate::check(&drive.plan())?;
            evaluate::measure(&drive.plan(), &run, console, output)?;
            run.finish(outcome_of(drivers))?;
        }
        Step::DriveShard { drivers, .. } => {
            let drive = DriveStage::load(stage)?;
            evaluate::check(&drive.plan())?;
            evaluate::drive(&drive.plan(), &run, console)?;
            run.finish(outcome_of(drivers))?;
        }
        Step::OnPolicy { seeds } => {
            if !on_policy::run(settings, seeds, root.path(), &run, console)? {
                return Ok(false);
            }
            run.finish(Outcome::Evaluation { drivers: Vec::new() })?;
        }
    }
    Ok(true)
}

/// Refuses a finished stage that others drove than this version has drive there: its report would lack them.
fn ensure_driven_by(stage: &Stage, root: &RunDir) -> anyhow::Result<()> {
    let Step::Drive { drivers } = &stage.step else { return Ok(()) };
    let found = manifest::finished(&root.path().join(&stage.folder))?.map(|finished| finished.outcome);
    let Some(Outcome::Evaluation { drivers: found }) = found else {
        bail!("{}: this is not an evaluation", stage.folder)
    };
    let is_same = |(found, (_, wanted)): (&String, &(String, String))| is_same_driver(found, wanted, root.path());
    ensure!(
        found.len() == drivers.len() && found.iter().zip(drivers).all(is_same),
        "{}: another version of lotpilot drove other drivers there; finish the run with the one that began it, or begin again \
         with another --out",
        stage.folder
    );
    Ok(())
}

/// The stages with those of their drivers alone that drove: an earlier version let others drive.
pub(crate) fn with_those_who_drove(mut stages: Vec<Stage>, root: &Path) -> anyhow::Result<Vec<Stage>> {
    for stage in &mut stages {
        let Step::Drive { drivers } = &mut stage.step else { continue };
        let finished = manifest::finished(&root.join(&stage.folder))?;
        if let Some(Outcome::Evaluation { drivers: found }) = finished.map(|finished| finished.outcome) {
            drivers.retain(|(_, wanted)| found.iter().any(|found| is_same_driver(found, wanted, root)));
        }
    }
    Ok(stages)
}

/// Whether a driver is the one that is wanted. The run may have been moved since: its own networks are known by where they
/// lie in it.
fn is_same_driver(found: &str, wanted: &str, root: &Path) -> bool {
    let lies_alike = |kind: &str| {
        let [found, wanted] = [found, wanted].map(|spec| spec.strip_prefix(kind).map(Path::new));
        let own = wanted.and_then(|wanted| wanted.strip_prefix(root).ok()).filter(|own| !own.as_os_str().is_empty());
        found.zip(own).is_some_and(|(found, own)| found.ends_with(own))
    };
    found == wanted || lies_alike("run:") || lies_alike("net:")
}

/// The settings of a stage, with what other stages decide of them.
fn settings_of(stage: &Stage, root: &RunDir) -> anyhow::Result<Settings> {
    let Step::Train { samples_of: Some(chain), .. } = &stage.step else { return Ok(stage.settings.clone()) };
    let table1 = Table1::read(&root.path().join(chain))?;
    let table1 = table1.with_context(|| format!("{chain}: is not trained yet"))?;
    Ok(stages::with_as_many_samples(&stage.settings, &table1.rows))
}

fn outcome_of(drivers: &[(String, String)]) -> Outcome {
    Outcome::Evaluation { drivers: drivers.iter().map(|(_, spec)| spec.clone()).collect() }
}

/// The place of a stage, except for its folder.
pub(crate) fn place_of<'a>(command: &'a str, settings: &Settings) -> Place<'a> {
    let build = build_info::get();
    Place { build, out: None, overwrite: false, command, preset: command, seed: settings.seed.0 }
}

/// What a stage is asked for besides its settings: its share, if it has one, and the lots from files that a training
/// reads.
fn request_of(stage: &Stage) -> anyhow::Result<Request> {
    let mut arguments = toml::Table::new();
    let is_training = matches!(stage.step, Step::Train { .. });
    let inputs = if is_training { train::inputs(&stage.settings)? } else { Inputs::default() };
    if matches!(stage.step, Step::DriveShard { .. })
        && let Some(record) = ShardRecord::of(&DriveStage::load(stage)?.plan())?
    {
        record.add_to(&mut arguments);
    }
    // It lies within its run, which was kept apart from what is read.
    Ok(Request { arguments, inputs, reads: Vec::new() })
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
    Ok(sums::copy_folder(&source, run.path(), ROUND)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Drivers that an earlier version had not let drive there took the intervals from those that it had.
    #[test]
    fn a_stage_has_the_drivers_that_drove_in_it() {
        let root = std::env::temp_dir().join(format!("lotpilot-who-drove-{}", std::process::id()));
        let settings = Settings::preset("smoke").unwrap();
        let run =
            RunDir::create(&Place { out: Some(&root), ..place_of("rules", &settings) }, &settings, &Request::default());
        let run = run.unwrap();
        let stage = run.stage("drives", &place_of("rules", &settings), &settings).unwrap().unwrap();
        stage.finish(Outcome::Evaluation { drivers: vec!["expert".to_owned()] }).unwrap();
        let drivers = ["expert", "vvf"].map(|name| (name.to_owned(), name.to_owned())).to_vec();
        let (folder, about) = ("drives".to_owned(), String::new());
        let planned = Stage { folder, about, settings, step: Step::Drive { drivers: drivers.clone() } };
        let found = with_those_who_drove(vec![planned], run.path()).unwrap();
        assert_eq!(found[0].step, Step::Drive { drivers: drivers[..1].to_vec() });
        std::fs::remove_dir_all(root).unwrap();
    }

    /// A network of a round of a run that was moved was taken for another driver.
    #[test]
    fn the_networks_of_a_run_that_was_moved_are_the_same_drivers() {
        let is_same = |found: &str, wanted: &str| is_same_driver(found, wanted, Path::new("runs/b"));
        assert!(is_same("run:runs/a/chains/s1", "run:runs/b/chains/s1"));
        assert!(is_same("net:/old/runs/a/chains/s1/round-01", "net:runs/b/chains/s1/round-01"));
        assert!(is_same("expert", "expert"));
        for (found, wanted) in [
            ("net:runs/a/chains/s1/round-02", "net:runs/b/chains/s1/round-01"),
            ("run:runs/a/chains/s1", "net:runs/b/chains/s1"),
            ("run:runs/a/chains/s2", "run:runs/b/chains/s1"),
            ("run:runs/a", "run:runs/b"),
            ("tentacle", "expert"),
        ] {
            assert!(!is_same(found, wanted), "{found} {wanted}");
        }
    }
}
