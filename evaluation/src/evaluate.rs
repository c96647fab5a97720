//! Drives a plan and writes one line per run and near-collision.
//!
//! Runs are driven batch by batch. In a batch every driver meets the same maps, obstacles, noise and starts, one driver
//! after the other at every noise level; then only a few numbers per run are kept. So memory does not depend on how
//! many lots there are. What one driver drove of a batch is written at once; an interrupted evaluation continues after
//! that.

use crate::incidents;
use crate::monitor::{Incident, IncidentMonitor};
use crate::plan::Plan;
use crate::read::Places;
use crate::records::{self, FailureRecord, RecordHeader, RunRecord, WallTimeRecord};
use crate::results::EvaluationResults;
use anyhow::{bail, ensure};
use experiment::drive::TrialBatch;
use experiment::drive_digest::DriveDigest;
use experiment::inputs;
use experiment::progress::Progress;
use experiment::replay_key;
use experiment::run_dir::RunDir;
use experiment::settings::Settings;
use experiment::trials::{self, Trial};
use serde::Serialize;
use sim::episode::EpisodeReport;
use sim::frame::Event;
use std::ops::ControlFlow;
use std::path::Path;
use std::time::Instant;
use storage::growing::{self, Growing};
use storage::sums;

/// Trials driven at a time, and so threads that one driver keeps busy. A constant: neither memory nor results depend on how
/// many runs or threads there are.
pub(crate) const BATCH: usize = 32;

/// Files that are written line by line.
pub(crate) const FILES: [&str; 3] = [records::RUNS, records::FAILURES, records::WALL_TIME];

/// What is done there, as named in the file that says how far it is.
pub(crate) const DRIVING: &str = "driving";

/// Drives the plan, and writes one line per run and near-collision as they come. Continues what an interrupted
/// evaluation left in the folder, to the same result; a finished one is read back. `None` if cancelled.
///
/// # Errors
/// If a lot cannot be built or a file cannot be read or written.
pub fn evaluate(plan: &Plan<'_>, run: &RunDir, progress: &dyn Progress) -> anyhow::Result<Option<EvaluationResults>> {
    if sums::is_listed(run.path(), records::RUNS)? {
        growing::clear(run.path(), DRIVING)?;
        return EvaluationResults::read(plan, run.path()).map(Some);
    }
    run.ensure_unchanged(&inputs::of(plan.lots, plan.drivers))?;
    let lines = Growing::open(run.path(), DRIVING, &run.identity()?, &FILES)?;
    let mut driving = Driving::open(plan, run.path(), lines, progress)?;
    let mut trials = plan.trials();
    loop {
        let batch: Vec<Trial<'_>> = trials.by_ref().take(BATCH).collect();
        run.ensure_held()?;
        if batch.is_empty() {
            return driving.finish().map(Some);
        }
        if !driving.drive(&batch)? {
            return Ok(None);
        }
    }
}

/// What its driver was called when a run was driven, and what it is called now, if that differs.
fn renamed(plan: &Plan<'_>, run: &RunRecord) -> Option<[String; 2]> {
    let then = replay_key::driver_of(&run.replay);
    let now = plan.drivers.iter().find(|driver| driver.name == run.header.driver)?.spec.to_string();
    (then != now).then_some([then, now])
}

/// Runs in the first parts of a plan.
fn runs_in(plan: &Plan<'_>, parts: usize) -> usize {
    let trials = plan.trials().count();
    let parts_of_batch = plan.drivers.len() * plan.settings.evaluation.noise.len();
    let batches = trials.div_ceil(BATCH);
    let parts = parts.min(batches * parts_of_batch);
    let (whole, begun) = (parts / parts_of_batch, parts % parts_of_batch);
    let trials_of = |batches: usize| trials.min(batches * BATCH);
    trials_of(whole) * parts_of_batch + (trials_of(whole + 1) - trials_of(whole)) * begun
}

/// An evaluation under way. Its parts are what one driver drives of a batch at one noise level.
struct Driving<'a> {
    plan: &'a Plan<'a>,
    lines: Growing,
    results: EvaluationResults,
    track: Track<'a>,
    /// Parts of the batches so far, those of an earlier command included.
    parts: usize,
    /// Trials of the batches so far.
    trials: usize,
}

impl<'a> Driving<'a> {
    fn open(plan: &'a Plan<'a>, folder: &Path, lines: Growing, progress: &'a dyn Progress) -> anyhow::Result<Self> {
        let mut results = EvaluationResults::new(plan);
        let (mut done, mut near_collisions, mut moved) = (0, 0, None);
        if lines.parts() > 0 {
            let places = Places::new(plan);
            records::each_line_of(&folder.join(records::RUNS), lines.reader(0)?, |run| {
                done += 1;
                moved = moved.take().or_else(|| renamed(plan, &run));
                results.take_run(&places, &run)
            })?;
            records::each_line_of(&folder.join(records::FAILURES), lines.reader(1)?, |failure| {
                near_collisions += 1;
                results.take_failure(&places, &failure)
            })?;
        }
        // Replay keys hold where a network lies, and one of two names would be wrong for ever.
        if let Some([then, now]) = moved {
            bail!(
                "{}: was driven by {then}, which is {now} from here: finish the run where it was begun, under the name that it \
                 had, and move it then",
                folder.join(records::RUNS).display()
            );
        }
        ensure!(
            done == runs_in(plan, lines.parts()),
            "{}: {done} runs in {} parts, which are not the parts of this version; finish it with the one that began it, \
             or begin again with another --out",
            folder.join(records::RUNS).display(),
            lines.parts()
        );
        progress.begin("evaluation", "driving");
        let all = runs_in(plan, usize::MAX);
        let track = Track { progress, runs: all, done, near_collisions };
        Ok(Self { plan, lines, results, track, parts: 0, trials: 0 })
    }

    /// Drives a batch, except for what was driven before; `false` if cancelled.
    fn drive(&mut self, trials: &[Trial<'_>]) -> anyhow::Result<bool> {
        let plan = self.plan;
        let Settings { evaluation, episode, .. } = plan.settings;
        let before = self.parts;
        self.parts += evaluation.noise.len() * plan.drivers.len();
        let first_trial = self.trials;
        self.trials += trials.len();
        if self.parts <= self.lines.parts() {
            return Ok(true);
        }
        let maps = trials::maps(trials, episode)?;
        let levels = evaluation.noise.iter().enumerate();
        let parts = levels.flat_map(|level| plan.drivers.iter().enumerate().map(move |driver| (level, driver)));
        let parts: Vec<_> = parts.skip(self.lines.parts() - before).collect();
        for ((level, &noise), (index, driver)) in parts {
            let batch = TrialBatch { episode, driver, trials, maps: &maps, noise, seed: evaluation.seed };
            let Some(driven) = drive(&batch, &mut self.track)? else { return Ok(false) };
            let failures = failures(&batch, &driven)?;
            // A driver that failed meanwhile has answered with anything.
            if self.track.progress.is_cancelled() {
                return Ok(false);
            }
            self.lines.add(&lines(&batch, &driven, &failures)?)?;
            for (i, (trial, report)) in trials.iter().zip(&driven.reports).enumerate() {
                self.results.add(level, index, first_trial + i, trial, report);
            }
            for (episode, failure) in &failures {
                let is_again = incidents::is_again(failure.findings.since_resume_m);
                self.results.add_cause(level, index, trials[*episode].lot, failure.cause, is_again);
            }
        }
        Ok(true)
    }

    fn finish(self) -> anyhow::Result<EvaluationResults> {
        self.lines.finish()?;
        let Track { progress, runs, done, near_collisions } = self.track;
        let near_collisions = match near_collisions {
            1 => "1 near-collision".to_owned(),
            count => format!("{count} near-collisions"),
        };
        progress.end(&format!("{done} of {runs} runs, {near_collisions}"));
        Ok(self.results)
    }
}

/// A part of an evaluation: what one driver drove of a batch at one noise level.
struct DrivenPart {
    reports: Vec<EpisodeReport>,
    /// The digest of each run, as in `runs.jsonl`.
    sha256: Vec<String>,
    incidents: Vec<Incident>,
    wall_s: f64,
}

fn header_of(batch: &TrialBatch<'_>, trial: &Trial<'_>) -> RecordHeader {
    RecordHeader {
        schema: records::SCHEMA,
        driver: batch.driver.name.clone(),
        lot: trial.lot.name().to_owned(),
        direction: trial.direction,
        trial: trial.index,
        noise: batch.noise,
    }
}

/// The near-collisions, each with the index of its run within the batch.
fn failures(batch: &TrialBatch<'_>, driven: &DrivenPart) -> anyhow::Result<Vec<(usize, FailureRecord)>> {
    let explained = incidents::explain(batch, &driven.incidents)?;
    let failure = |(incident, (cause, findings)): (&Incident, _)| {
        let trial = &batch.trials[incident.episode];
        let failure = FailureRecord {
            header: header_of(batch, trial),
            tick: incident.tick,
            route_m: incident.route_m,
            x_m: incident.at.x_m,
            y_m: incident.at.y_m,
            heading_deg: incident.at.heading_rad.to_degrees(),
            speed_mps: incident.speed_mps,
            cause,
            findings,
            replay: batch.replay_key(trial, incident.tick).to_string(),
        };
        (incident.episode, failure)
    };
    Ok(driven.incidents.iter().zip(explained).map(failure).collect())
}

/// Drives a batch by one driver and watches for near-collisions; `None` if cancelled.
#[expect(clippy::disallowed_methods, reason = "wall_time.jsonl is for people; nothing computed depends on it")]
fn drive(batch: &TrialBatch<'_>, track: &mut Track<'_>) -> anyhow::Result<Option<DrivenPart>> {
    let started = Instant::now();
    let mut monitor = IncidentMonitor::new(batch.trials.len(), batch.episode);
    let mut digests = vec![DriveDigest::default(); batch.trials.len()];
    let mut shares = vec![0.0_f32; batch.trials.len()];
    let mut frames = 0_u32;
    let reports = batch.drive(&mut |index, frame| {
        monitor.frame(index, frame);
        digests[index].frame(frame);
        track.near_collisions += u32::from(matches!(frame.event, Event::NearCollision { .. }));
        shares[index] = frame.progress_m / batch.maps[index].path().length_m();
        frames += 1;
        // Often enough for eyes and Ctrl-C.
        if frames.is_multiple_of(64) {
            track.show(shares.iter().sum(), &batch.driver.name);
            if track.progress.is_cancelled() {
                return ControlFlow::Break(());
            }
        }
        ControlFlow::Continue(())
    })?;
    let Some(reports) = reports.into_iter().collect::<Option<Vec<EpisodeReport>>>() else { return Ok(None) };
    // What a driver answered after it had failed is not a result.
    if track.progress.is_cancelled() {
        return Ok(None);
    }
    track.done += reports.len();
    Ok(Some(DrivenPart {
        reports,
        sha256: digests.iter().map(DriveDigest::hex).collect(),
        incidents: monitor.into_incidents(),
        wall_s: started.elapsed().as_secs_f64(),
    }))
}

/// Progress of the whole evaluation.
struct Track<'a> {
    progress: &'a dyn Progress,
    runs: usize,
    done: usize,
    near_collisions: u32,
}

impl Track<'_> {
    fn show(&self, under_way: f32, driver: &str) {
        let Self { progress, runs, done, near_collisions } = *self;
        progress.at((done as f64 + f64::from(under_way)) / runs as f64, &mut |_| {
            format!("{done} of {runs} runs, near-collisions: {near_collisions}, driver: {driver}")
        });
    }
}

/// The text of a part for each of the [`FILES`].
fn lines(
    batch: &TrialBatch<'_>,
    driven: &DrivenPart,
    failures: &[(usize, FailureRecord)],
) -> anyhow::Result<[Vec<u8>; 3]> {
    let [mut runs, mut failed, mut wall_time] = [const { Vec::new() }; 3];
    let ticks: u32 = driven.reports.iter().map(|report| report.metrics.ticks).sum();
    for ((trial, report), sha256) in batch.trials.iter().zip(&driven.reports).zip(&driven.sha256) {
        let key = batch.replay_key(trial, 0);
        line(&mut runs, &RunRecord::new(header_of(batch, trial), &key, sha256, report))?;
        // Runs of a batch are driven at once; each has its share by the number of its decisions.
        let wall_s = driven.wall_s * f64::from(report.metrics.ticks) / f64::from(ticks.max(1));
        line(&mut wall_time, &WallTimeRecord { header: header_of(batch, trial), wall_s })?;
    }
    failures.iter().try_for_each(|(_, failure)| line(&mut failed, failure))?;
    Ok([runs, failed, wall_time])
}

fn line(text: &mut Vec<u8>, value: &impl Serialize) -> anyhow::Result<()> {
    serde_json::to_writer(&mut *text, value)?;
    text.push(b'\n');
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use experiment::drivers::NamedDriver;
    use experiment::lots::Lot;
    use experiment::progress::Silent;
    use expert::ExpertSettings;

    /// Parts are skipped by their number: those of other batches would have been taken for ours, without a word.
    #[test]
    fn parts_of_other_batches_are_refused() {
        let mut settings = Settings::preset("default").unwrap();
        // Both ways: a whole batch, and one of ten.
        settings.evaluation.trials = BATCH as u32 / 2 + 5;
        let lots = Lot::parse_all(&["lot-a"], &settings.episode.vehicle).unwrap();
        let drivers = ["a", "b"].map(|name| NamedDriver::expert(&ExpertSettings::half_points()).renamed(name)).to_vec();
        let plan = Plan { settings: &settings, drivers: &drivers, lots: &lots, compare_with: 0, shard: None };
        let all = 2 * BATCH + 20;
        assert_eq!([0, 1, 2, 3, 4, 5].map(|parts| runs_in(&plan, parts)), [0, BATCH, 2 * BATCH, all - 10, all, all]);

        let folder = std::env::temp_dir().join(format!("evaluation-test-{}-parts", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let mut lines = Growing::open(&folder, DRIVING, "this", &FILES).unwrap();
        lines.add(&[const { Vec::new() }; 3]).unwrap();
        let error = Driving::open(&plan, &folder, lines, &Silent).err().unwrap().to_string();
        std::fs::remove_dir_all(&folder).unwrap();
        assert!(error.contains("runs.jsonl: 0 runs in 1 parts"), "{error}");
    }
}
