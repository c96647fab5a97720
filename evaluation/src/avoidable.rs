//! How many near-collisions of an evaluation are avoided if one thing is replaced by the truth: its runs with a
//! near-collision are driven again, and from before each one the car is driven on with every [`Substitution`].

use crate::evaluate::BATCH;
use crate::monitor::{Incident, IncidentMonitor};
use crate::records::{self, FailureRecord, RecordHeader};
use crate::what_if::{Substitutes, Substitution};
use anyhow::{Context as _, bail, ensure};
use experiment::drive::TrialBatch;
use experiment::drivers::DriverSpec;
use experiment::inputs;
use experiment::lots::Lot;
use experiment::manifest::Manifest;
use experiment::progress::Progress;
use experiment::replay_key::ReplayKey;
use experiment::run_dir;
use experiment::settings::{NoiseChoice, Settings};
use experiment::trials::{self, Trial};
use serde::Serialize;
use sim::scenario::Direction;
use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::Path;

/// What became of the near-collisions of one driver in one group of lots.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Row {
    /// Who drove, as named in the evaluation.
    pub driver: String,
    /// Sensor noise.
    pub noise: String,
    /// Lots that share a row of tables: [`Lot::group`].
    pub group: String,
    /// What is replaced: [`Substitution::name`].
    pub replaced: String,
    /// Near-collisions that were tried.
    pub near_collisions: u32,
    /// How many of their places are passed then.
    pub passed: u32,
}

/// A run: the index of its lot, the way, the trial.
type RunOf = (usize, Direction, u32);

/// What failed of one driver at one level of noise.
struct Failing {
    driver: String,
    noise: NoiseChoice,
    /// A replay key that names the driver.
    replay: String,
    /// The ticks at which there is a near-collision.
    runs: BTreeMap<RunOf, Vec<u32>>,
}

impl Failing {
    /// # Errors
    /// If only Python can call the driver.
    fn spec(&self) -> anyhow::Result<DriverSpec> {
        let key: ReplayKey =
            self.replay.parse().with_context(|| format!("{}: cannot be driven from here", self.driver))?;
        Ok(key.driver)
    }
}

/// Drives again what failed in the evaluation in `folder`, and tries every substitution at each near-collision; of the
/// drivers named, or of all. Rows are in the order of the evaluation. `None` if cancelled.
///
/// # Errors
/// If the folder holds no finished evaluation, or no near-collision of a driver named; if a lot or a driver has changed
/// since, or a run is not what was recorded.
pub fn of_evaluation(
    folder: &Path,
    settings: &Settings,
    drivers: &[String],
    progress: &dyn Progress,
) -> anyhow::Result<Option<Vec<Row>>> {
    let failures = records::of_finished(folder, records::FAILURES)?;
    let lots = Lot::parse_all(&settings.evaluation.lots, &settings.episode.vehicle)
        .with_context(|| run_dir::paths_are_as_made(folder))?;
    let manifest = Manifest::read(folder)?;
    // First: a lot of another name would seem to be none of the evaluation's.
    manifest.check_some_inputs(&inputs::of(&lots, &[]))?;
    let failing = read(&failures, &lots, drivers)?;
    if let Some(driver) = drivers.iter().find(|&driver| failing.iter().all(|failing| failing.driver != *driver)) {
        bail!("{}: no near-collision of a driver {driver:?} is in it; its tables name them", folder.display());
    }
    // Only those of the drivers that were asked for: a row is no worse for naming one that only Python can call.
    let specs = failing.iter().map(Failing::spec).collect::<anyhow::Result<Vec<_>>>()?;
    let all: usize = failing.iter().map(|failing| failing.runs.len()).sum();
    progress.begin("what-if", "driving again");
    let mut rows = Vec::new();
    let mut done = 0;
    for (Failing { driver: name, noise, runs, .. }, spec) in failing.iter().zip(specs) {
        let driver = spec.load(settings).with_context(|| run_dir::paths_are_as_made(folder))?;
        driver.check(settings)?;
        manifest.check_some_inputs(&inputs::of(&[], std::slice::from_ref(&driver)))?;
        let substitutes = Substitutes::new(&driver, settings);
        let seed = settings.evaluation.seed;
        let runs: Vec<_> = runs.iter().collect();
        let mut tally = Tally::new(name, *noise);
        progress.at(done as f64 / all as f64, &mut |_| format!("{done} of {all} runs, driver: {name}"));
        for runs in runs.chunks(BATCH) {
            let trial =
                |&(&(lot, direction, trial), _): &(&RunOf, _)| Trial::of_evaluation(seed, &lots[lot], direction, trial);
            let trials: Vec<Trial<'_>> = runs.iter().map(trial).collect();
            let maps = trials::maps(&trials, &settings.episode)?;
            let batch = TrialBatch {
                episode: &settings.episode,
                driver: &driver,
                trials: &trials,
                maps: &maps,
                noise: *noise,
                seed,
            };
            let Some(incidents) = drive_again(&batch, progress)? else { return Ok(None) };
            let recorded: Vec<&[u32]> = runs.iter().map(|(_, ticks)| ticks.as_slice()).collect();
            ensure_recorded(&batch, &incidents, &recorded)?;
            for replaced in Substitution::all() {
                if progress.is_cancelled() {
                    return Ok(None);
                }
                let passed = substitutes.passes(&batch, &incidents, replaced)?;
                tally.add(&incidents, &passed, replaced, |incident| trials[incident.episode].lot.group());
            }
            done += runs.len();
            progress.at(done as f64 / all as f64, &mut |_| format!("{done} of {all} runs, driver: {name}"));
        }
        rows.extend(tally.rows);
    }
    progress.end(&format!("{done} runs"));
    Ok(Some(rows))
}

/// What failed, by driver and level of noise, in the order of the file.
fn read(file: &Path, lots: &[Lot], drivers: &[String]) -> anyhow::Result<Vec<Failing>> {
    let index: BTreeMap<&str, usize> = lots.iter().enumerate().map(|(index, lot)| (lot.name(), index)).collect();
    let mut all: Vec<Failing> = Vec::new();
    records::each_line(file, |failure: FailureRecord| {
        let RecordHeader { driver, lot, direction, trial, noise, .. } = failure.header;
        if !drivers.is_empty() && !drivers.contains(&driver) {
            return Ok(());
        }
        let &lot = index.get(lot.as_str()).with_context(|| format!("lot {lot:?} is not in evaluation.lots"))?;
        let known = all.iter().position(|failing| failing.driver == driver && failing.noise == noise);
        let at = known.unwrap_or_else(|| {
            all.push(Failing { driver, noise, replay: failure.replay, runs: BTreeMap::new() });
            all.len() - 1
        });
        all[at].runs.entry((lot, direction, trial)).or_default().push(failure.tick);
        Ok(())
    })?;
    Ok(all)
}

/// Whether the near-collisions of a batch are at the ticks that were recorded of each run.
fn ensure_recorded(batch: &TrialBatch<'_>, incidents: &[Incident], recorded: &[&[u32]]) -> anyhow::Result<()> {
    for (episode, (trial, recorded)) in batch.trials.iter().zip(recorded).enumerate() {
        let of_run = incidents.iter().filter(|incident| incident.episode == episode);
        let ticks: Vec<u32> = of_run.map(|incident| incident.tick).collect();
        ensure!(
            ticks == **recorded,
            "{}: near-collisions were recorded at the ticks {recorded:?}, and are at {ticks:?} now: this program, its machine or \
             a file that it read differs from those of manifest.toml",
            batch.replay_key(trial, 0)
        );
    }
    Ok(())
}

/// The near-collisions of a batch; `None` if cancelled.
fn drive_again(batch: &TrialBatch<'_>, progress: &dyn Progress) -> anyhow::Result<Option<Vec<Incident>>> {
    let mut monitor = IncidentMonitor::new(batch.trials.len(), batch.episode);
    let mut frames = 0_u32;
    batch.drive(&mut |episode, frame| {
        monitor.frame(episode, frame);
        frames += 1;
        // Often enough for Ctrl-C.
        let asks = frames.is_multiple_of(64);
        if asks && progress.is_cancelled() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    })?;
    Ok((!progress.is_cancelled()).then(|| monitor.into_incidents()))
}

/// Rows of one driver at one level of noise.
struct Tally {
    driver: String,
    noise: String,
    rows: Vec<Row>,
}

impl Tally {
    fn new(driver: &str, noise: NoiseChoice) -> Self {
        Self { driver: driver.to_owned(), noise: noise.to_string(), rows: Vec::new() }
    }

    fn add(
        &mut self,
        incidents: &[Incident],
        passed: &[bool],
        replaced: Substitution,
        group_of: impl Fn(&Incident) -> String,
    ) {
        let replaced = replaced.name();
        for (incident, &passed) in incidents.iter().zip(passed) {
            let group = group_of(incident);
            let row = self.rows.iter_mut().find(|row| row.group == group && row.replaced == replaced);
            let row = if let Some(row) = row {
                row
            } else {
                let Self { driver, noise, .. } = &*self;
                let (driver, noise, replaced) = (driver.clone(), noise.clone(), replaced.clone());
                self.rows.push(Row { driver, noise, group, replaced, near_collisions: 0, passed: 0 });
                self.rows.last_mut().expect("just added")
            };
            row.near_collisions += 1;
            row.passed += u32::from(passed);
        }
    }
}
