//! Drives a plan and writes one line per run and near-collision.
//!
//! Runs are driven batch by batch. In a batch every driver meets the same maps, obstacles, noise and starts, one driver
//! after the other at every noise level; then only a few numbers per run are kept. So memory does not
//! depend on how many lots there are, and what an interrupted evaluation leaves is paired.

use crate::incidents::{self, Incident, IncidentMonitor};
use crate::plan::Plan;
use crate::records::{self, Driven, FailureRecord, RunRecord, WallTimeRecord};
use crate::results::EvaluationResults;
use anyhow::Context as _;
use experiment::drive::TrialBatch;
use experiment::progress::Progress;
use experiment::run_dir::RunDir;
use experiment::trials::{self, Trial};
use serde::Serialize;
use sim::episode::EpisodeReport;
use sim::frame::Event;
use sim::seed::RootSeed;
use std::fs::File;
use std::io::{BufWriter, Write as _};
use std::ops::ControlFlow;
use std::time::Instant;

/// Trials driven at a time. A constant: neither memory nor results depend on how many runs or threads there are.
const BATCH: usize = 16;

/// The outcome of a plan.
#[derive(Debug)]
pub struct Evaluated {
    /// Everything that is kept of the runs.
    pub results: EvaluationResults,
    /// `false` if it was cancelled: then the results are of what was driven by then.
    pub is_complete: bool,
}

/// Drives the plan, and writes one line per run and near-collision as they come.
///
/// # Errors
/// If a lot cannot be built or a file cannot be written.
pub fn evaluate(plan: &Plan<'_>, run: &RunDir, progress: &dyn Progress) -> anyhow::Result<Evaluated> {
    let evaluation = &plan.settings.evaluation;
    let episode = &plan.settings.episode;
    let mut results = EvaluationResults::new(plan);
    let mut lines = Lines::create(run)?;
    let mut trials = plan.trials();
    let runs = trials.clone().count() * plan.drivers.len() * evaluation.noise.len();
    progress.begin("evaluation", "driving");
    let mut track = Track { progress, runs, done: 0, near_collisions: 0 };
    let mut first_trial = 0;
    let mut is_complete = true;
    while is_complete {
        let batch: Vec<Trial<'_>> = trials.by_ref().take(BATCH).collect();
        if batch.is_empty() {
            break;
        }
        let maps = trials::maps(&batch, episode)?;
        'batch: for (level, &noise) in evaluation.noise.iter().enumerate() {
            for (index, driver) in plan.drivers.iter().enumerate() {
                let batch = TrialBatch { episode, driver, trials: &batch, maps: &maps, noise };
                let driven = drive(&batch, &mut track);
                let failures = failures(&batch, evaluation.seed, &driven, !progress.is_cancelled());
                lines.add(&batch, evaluation.seed, &driven, &failures)?;
                for (i, (trial, report)) in driven.finished(&batch) {
                    results.add(level, index, first_trial + i, trial, report);
                }
                for (episode, failure) in &failures {
                    let is_again = incidents::is_again(failure.findings.since_resume_m);
                    results.add_cause(level, index, batch.trials[*episode].lot, failure.cause, is_again);
                }
                is_complete = driven.reports.iter().all(Option::is_some);
                if !is_complete {
                    break 'batch;
                }
            }
        }
        first_trial += batch.len();
    }
    lines.flush()?;
    let near_collisions = match track.near_collisions {
        1 => "1 near-collision".to_owned(),
        count => format!("{count} near-collisions"),
    };
    progress.end(&format!("{} of {runs} runs, {near_collisions}", track.done));
    Ok(Evaluated { results, is_complete })
}

/// One driver in one batch at one noise level.
struct DrivenBatch {
    /// `None` for runs that were cut short.
    reports: Vec<Option<EpisodeReport>>,
    incidents: Vec<Incident>,
    wall_s: f64,
}

impl DrivenBatch {
    fn finished<'a>(
        &'a self,
        batch: &TrialBatch<'a>,
    ) -> impl Iterator<Item = (usize, (&'a Trial<'a>, &'a EpisodeReport))> + use<'a> {
        let both = batch.trials.iter().zip(&self.reports).enumerate();
        both.filter_map(|(i, (trial, report))| Some((i, (trial, report.as_ref()?))))
    }
}

fn driven_by(batch: &TrialBatch<'_>, trial: &Trial<'_>) -> Driven {
    Driven {
        schema: records::SCHEMA,
        driver: batch.driver.name.clone(),
        lot: trial.lot.name().to_owned(),
        direction: trial.direction,
        trial: trial.index,
        noise: batch.noise,
    }
}

/// The near-collisions of the finished runs, each with the index of its run within the batch.
fn failures(
    batch: &TrialBatch<'_>,
    seed: RootSeed,
    driven: &DrivenBatch,
    try_clean: bool,
) -> Vec<(usize, FailureRecord)> {
    let is_kept = |incident: &&Incident| driven.reports[incident.episode].is_some();
    let kept: Vec<Incident> = driven.incidents.iter().filter(is_kept).copied().collect();
    let explained = incidents::explain(batch, &kept, try_clean);
    let failure = |(incident, (cause, findings)): (&Incident, _)| {
        let trial = &batch.trials[incident.episode];
        let failure = FailureRecord {
            driven: driven_by(batch, trial),
            tick: incident.tick,
            route_m: incident.route_m,
            x_m: incident.at.x_m,
            y_m: incident.at.y_m,
            heading_deg: incident.at.heading_rad.to_degrees(),
            speed_mps: incident.speed_mps,
            cause,
            findings,
            replay: batch.replay_key(trial, seed, incident.tick).to_string(),
        };
        (incident.episode, failure)
    };
    kept.iter().zip(explained).map(failure).collect()
}

#[expect(clippy::disallowed_methods, reason = "wall_time.jsonl is for people; nothing computed depends on it")]
fn drive(batch: &TrialBatch<'_>, track: &mut Track<'_>) -> DrivenBatch {
    let started = Instant::now();
    let mut monitor = IncidentMonitor::new(batch.trials.len(), batch.episode);
    let mut shares = vec![0.0_f32; batch.trials.len()];
    let mut frames = 0_u32;
    let reports = batch.drive(&mut |index, frame| {
        monitor.frame(index, frame);
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
    });
    track.done += reports.iter().flatten().count();
    DrivenBatch { reports, incidents: monitor.into_incidents(), wall_s: started.elapsed().as_secs_f64() }
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

/// The files that are written line by line.
struct Lines {
    runs: BufWriter<File>,
    failures: BufWriter<File>,
    wall_time: BufWriter<File>,
}

impl Lines {
    fn create(run: &RunDir) -> anyhow::Result<Self> {
        let create = |name: &str| {
            let path = run.path().join(name);
            let file = File::create(&path).with_context(|| format!("{}: cannot be written", path.display()))?;
            Ok::<_, anyhow::Error>(BufWriter::new(file))
        };
        let [runs, failures, wall_time] = [records::RUNS, records::FAILURES, records::WALL_TIME].map(create);
        Ok(Self { runs: runs?, failures: failures?, wall_time: wall_time? })
    }

    fn add(
        &mut self,
        batch: &TrialBatch<'_>,
        seed: RootSeed,
        driven: &DrivenBatch,
        failures: &[(usize, FailureRecord)],
    ) -> anyhow::Result<()> {
        let ticks: u32 = driven.finished(batch).map(|(_, (_, report))| report.metrics.ticks).sum();
        for (_, (trial, report)) in driven.finished(batch) {
            let key = batch.replay_key(trial, seed, 0);
            line(&mut self.runs, &RunRecord::new(driven_by(batch, trial), &key, report))?;
            // Runs of a batch are driven at once; each has its share by the number of its decisions.
            let wall_s = driven.wall_s * f64::from(report.metrics.ticks) / f64::from(ticks.max(1));
            line(&mut self.wall_time, &WallTimeRecord { driven: driven_by(batch, trial), wall_s })?;
        }
        failures.iter().try_for_each(|(_, failure)| line(&mut self.failures, failure))?;
        self.flush()
    }

    /// Flushes, so that finished runs are on disk even if the process is killed.
    fn flush(&mut self) -> anyhow::Result<()> {
        for file in [&mut self.runs, &mut self.failures, &mut self.wall_time] {
            file.flush().context("a file of the run cannot be written; is the disk full?")?;
        }
        Ok(())
    }
}

fn line(file: &mut BufWriter<File>, value: &impl Serialize) -> anyhow::Result<()> {
    serde_json::to_writer(&mut *file, value)?;
    Ok(writeln!(file)?)
}
