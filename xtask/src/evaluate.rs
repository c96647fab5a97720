//! `evaluate`: drivers × lots × directions × trials × noise levels.
//!
//! Runs are driven group by group. In a group every driver meets the same maps, obstacles, noise and starts, one driver
//! after the other at every noise level; then the group is forgotten but for a few numbers per run. So memory does not
//! depend on how many lots there are, and what an interrupted evaluation leaves is paired.

use crate::cli::{Directions, EvaluateArgs};
use crate::drivers::DriverSpec;
use crate::failures::{Cause, Failure, Findings, Incident, IncidentMonitor, TrialBatch, is_again};
use crate::interrupt::{self, Interrupted};
use crate::lots::Lot;
use crate::progress::{Stopwatch, Work};
use crate::replay_key::ReplayKey;
use crate::report::{self, RunLine, Summary, WallTimeLine};
use crate::run_dir::{self, Place, RunDir};
use crate::run_report;
use crate::settings::{NoiseChoice, Settings};
use crate::summary::EvaluationResults;
use crate::trials::{self, Purpose, Trial};
use crate::visualise;
use crate::visualise::drive::Detail;
use crate::visualise::live::{Live, View};
use anyhow::{Context as _, ensure};
use serde::Serialize;
use sim::batch::run_lockstep_until;
use sim::episode::{Episode, EpisodeReport};
use sim::frame::Event;
use sim::map::Map;
use sim::scenario::Direction;
use sim::seed::RootSeed;
use std::fs::File;
use std::io::{BufWriter, Write as _};
use std::ops::ControlFlow;
use std::path::Path;
use std::time::Instant;

/// Runs driven at a time. A constant: neither memory nor results depend on how many runs or threads there are.
const GROUP: usize = 16;
/// What `--noise sweep` stands for, in multiples of the level `paper`: clean to hard.
const SWEEP: [f64; 5] = [0.0, 0.5, 1.0, 1.5, 2.0];

/// A driver that takes part.
#[derive(Debug, Clone)]
pub struct NamedDriver {
    /// Who.
    pub contestant: DriverSpec,
    /// As named on the command line, for replay keys.
    pub spec: String,
}

/// What is to be driven.
#[derive(Debug, Clone, Copy)]
pub struct Plan<'a> {
    /// With which settings.
    pub settings: &'a Settings,
    /// By whom.
    pub entries: &'a [NamedDriver],
    /// Where.
    pub lots: &'a [Lot],
    /// The driver the others are compared with, an index of `entries`.
    pub compare_with: usize,
}

impl Plan<'_> {
    /// What can be known to go wrong before the first step.
    ///
    /// # Errors
    /// If a driver was trained for another patch of ground, or a lot written by hand cannot be driven.
    pub fn check(&self) -> anyhow::Result<()> {
        self.entries.iter().try_for_each(|entry| entry.contestant.check(self.settings))?;
        let evaluation = &self.settings.evaluation;
        for lot in self.lots.iter().filter(|lot| lot.is_from_file()) {
            let lot = std::slice::from_ref(lot);
            let jobs = Trial::all(evaluation.seed, Purpose::Evaluation, lot, 1, &evaluation.directions);
            jobs.map(|job| job.map(&self.settings.episode)).collect::<anyhow::Result<Vec<Map>>>()?;
        }
        Ok(())
    }
}

/// The command.
///
/// # Errors
/// If something named does not exist or cannot be written, or by Ctrl-C.
pub fn run(args: &EvaluateArgs) -> anyhow::Result<()> {
    let entries: Vec<NamedDriver> = DriverSpec::parse_all(&args.drivers)?
        .into_iter()
        .map(|contestant| NamedDriver { spec: contestant.name.clone(), contestant })
        .collect();
    let compare_with = compare_with(args, &entries)?;
    let (settings, preset) = resolve(args)?;
    let lots = Lot::parse_all(&settings.evaluation.lots)?;
    let plan = Plan { settings: &settings, entries: &entries, lots: &lots, compare_with };
    plan.check()?;
    let place = Place {
        out: args.out.as_deref(),
        overwrite: args.overwrite,
        command: "evaluate",
        preset,
        seed: settings.evaluation.seed.0,
    };
    let run = RunDir::create(&place, &settings)?;
    let mut stopwatch = Stopwatch::default();
    let mut live = args.record.map(|runs| Live::start(run.path(), runs)).transpose()?;
    let measured = measure(&plan, &run, live.as_mut(), &mut stopwatch);
    if let Some(live) = live {
        live.finish();
    }
    measured?;
    run_report::write(run.path(), &mut stopwatch)?;
    run.finish(&Finished { drivers: &args.drivers })?;
    eprintln!(
        "written: {}/report.html, summary.md, .json, .csv, runs.jsonl and failures.md, .jsonl",
        run.path().display()
    );
    stopwatch.report();
    Ok(())
}

#[derive(Serialize)]
struct Finished<'a> {
    drivers: &'a [String],
}

/// `--compare-with`, else the last network, else the first driver.
fn compare_with(args: &EvaluateArgs, entries: &[NamedDriver]) -> anyhow::Result<usize> {
    let Some(spec) = &args.compare_with else {
        let is_network = |entry: &NamedDriver| entry.spec.starts_with("run:") || entry.spec.starts_with("net:");
        return Ok(entries.iter().rposition(is_network).unwrap_or(0));
    };
    let found = entries.iter().position(|entry| entry.spec == *spec);
    found.with_context(|| format!("--compare-with {spec}: name one of the drivers given with --driver"))
}

/// The settings, and the name of what they start from: `--preset` or `--config` if given, else the first run that is
/// named as a driver, else the default preset.
///
/// # Errors
/// If something named does not exist, or runs were trained with settings that differ.
pub fn resolve(args: &EvaluateArgs) -> anyhow::Result<(Settings, &str)> {
    let is_named = args.layers.preset.is_some() || args.layers.config.is_some();
    let mut runs = args.drivers.iter().filter_map(|spec| Some((spec, run_dir_of(spec)?)));
    let (mut settings, base) = match runs.next().filter(|_| !is_named) {
        Some((spec, path)) => {
            let of_run = run_dir::settings_of(path).with_context(|| format!("driver {spec:?}"))?;
            for (other, path) in runs {
                let of_other = run_dir::settings_of(path).with_context(|| format!("driver {other:?}"))?;
                ensure!(
                    of_other.episode == of_run.episode,
                    "drivers {spec:?} and {other:?} were trained with different settings of episode (car, sensor, \
                     metrics), so neither run's settings are fair to both; choose with --config or --preset"
                );
            }
            eprintln!("settings: those of {} (others: --config or --preset)", path.display());
            (Settings::resolve_over(&of_run, &args.layers, None)?, "run")
        }
        None => (Settings::resolve(&args.layers, None)?, args.layers.preset_name()),
    };
    let evaluation = &mut settings.evaluation;
    if let Some(seed) = args.seed {
        evaluation.seed = RootSeed(seed);
    }
    if !args.lots.is_empty() {
        evaluation.lots.clone_from(&args.lots);
    }
    evaluation.trials = args.trials.unwrap_or(evaluation.trials);
    if let Some(directions) = args.directions {
        evaluation.directions = match directions {
            Directions::Both => Direction::BOTH.to_vec(),
            Directions::Forward => vec![Direction::Forward],
            Directions::Reverse => vec![Direction::Reverse],
        };
    }
    if !args.noise.is_empty() {
        evaluation.noise = noise_levels(&args.noise)?;
    }
    settings.check()?;
    Ok((settings, base))
}

fn run_dir_of(spec: &str) -> Option<&Path> {
    spec.strip_prefix("run:").map(Path::new)
}

fn noise_levels(names: &[String]) -> anyhow::Result<Vec<NoiseChoice>> {
    let mut levels = Vec::new();
    for name in names {
        if name == "sweep" {
            levels.extend(SWEEP.map(NoiseChoice::Times));
        } else {
            levels.push(name.parse().map_err(|error| anyhow::anyhow!("--noise {name}: {error}"))?);
        }
    }
    Ok(levels)
}

/// Drives the plan, writes one line per run and near-collision as they come and the tables at the end, and prints the
/// tables.
///
/// # Errors
/// If a lot cannot be built or a file cannot be written, or by Ctrl-C; what was driven by then is written.
pub fn measure(
    plan: &Plan<'_>,
    run: &RunDir,
    mut live: Option<&mut Live>,
    stopwatch: &mut Stopwatch,
) -> anyhow::Result<()> {
    let evaluation = &plan.settings.evaluation;
    let mut results = EvaluationResults::new(plan);
    let mut lines = Lines::create(run)?;
    let mut jobs =
        Trial::all(evaluation.seed, Purpose::Evaluation, plan.lots, evaluation.trials, &evaluation.directions);
    let count = jobs.clone().count() * plan.entries.len() * evaluation.noise.len();
    let mut track = Track { work: Work::begin("driving"), runs: count, done: 0, near_collisions: 0 };
    let mut first_job = 0;
    let mut is_complete = true;
    while is_complete {
        let group: Vec<Trial<'_>> = jobs.by_ref().take(GROUP).collect();
        if group.is_empty() {
            break;
        }
        let maps = trials::maps(&group, plan.settings)?;
        'group: for (level, &noise) in evaluation.noise.iter().enumerate() {
            for (driver, entry) in plan.entries.iter().enumerate() {
                let contestant = &entry.contestant;
                let group = TrialBatch { settings: plan.settings, contestant, jobs: &group, maps: &maps, noise };
                let driven = drive(&group, live.as_deref_mut(), &mut track);
                let failures = failures(&group, entry, evaluation.seed, &driven);
                lines.add(&group, entry, evaluation.seed, &driven, &failures)?;
                for (i, (job, report)) in driven.finished(&group) {
                    results.add(level, driver, first_job + i, job, report);
                }
                for (episode, failure) in &failures {
                    results.add_cause(
                        level,
                        driver,
                        group.jobs[*episode].lot,
                        failure.cause,
                        is_again(failure.findings.since_resume_m),
                    );
                }
                is_complete = driven.reports.iter().all(Option::is_some);
                if !is_complete {
                    break 'group;
                }
            }
        }
        first_job += group.len();
    }
    lines.finish()?;
    stopwatch.add("evaluation", track.work.seconds());
    track.work.end(&format!("{} of {count} runs, {} near-collisions", track.done, track.near_collisions));

    let summary = Summary::new(plan, &results);
    println!("\n{}", summary.to_markdown());
    summary.write(run)?;
    if is_complete {
        return Ok(());
    }
    Err(Interrupted { kept: format!("the runs driven so far are in {}", run.path().display()) }.into())
}

/// One driver in one group at one noise level.
struct Driven {
    /// `None` for runs cut short by Ctrl-C.
    reports: Vec<Option<EpisodeReport>>,
    incidents: Vec<Incident>,
    wall_s: f64,
}

impl Driven {
    fn finished<'a>(
        &'a self,
        group: &TrialBatch<'a>,
    ) -> impl Iterator<Item = (usize, (&'a Trial<'a>, &'a EpisodeReport))> + use<'a> {
        let both = group.jobs.iter().zip(&self.reports).enumerate();
        both.filter_map(|(i, (job, report))| Some((i, (job, report.as_ref()?))))
    }
}

/// The near-collisions of the finished runs, each with the index of its run within the group.
fn failures(group: &TrialBatch<'_>, entry: &NamedDriver, seed: RootSeed, driven: &Driven) -> Vec<(usize, Failure)> {
    let is_kept = |incident: &&Incident| driven.reports[incident.episode].is_some();
    let incidents: Vec<Incident> = driven.incidents.iter().filter(is_kept).copied().collect();
    let explained = group.explain(&incidents, !interrupt::is_requested());
    let failure = |(incident, (cause, findings)): (&Incident, (Cause, Findings))| {
        let job = &group.jobs[incident.episode];
        let failure = Failure {
            driver: entry.contestant.name.clone(),
            lot: job.lot.name().to_owned(),
            direction: job.direction,
            trial: job.trial,
            noise: group.noise,
            tick: incident.tick,
            route_m: incident.route_m,
            x_m: incident.at.x_m,
            y_m: incident.at.y_m,
            heading_deg: incident.at.heading_rad.to_degrees(),
            speed_mps: incident.speed_mps,
            cause,
            findings,
            replay: replay_key(entry, job, group.noise, seed, incident.tick).to_string(),
        };
        (incident.episode, failure)
    };
    incidents.iter().zip(explained).map(failure).collect()
}

fn replay_key(entry: &NamedDriver, job: &Trial<'_>, noise: NoiseChoice, seed: RootSeed, tick: u32) -> ReplayKey {
    let (driver, lot) = (entry.spec.clone(), job.lot.spec());
    ReplayKey { driver, lot, direction: job.direction, trial: job.trial, noise, seed, tick }
}

fn drive(group: &TrialBatch<'_>, mut live: Option<&mut Live>, track: &mut Track) -> Driven {
    let started = Instant::now();
    let episodes = trials::start(group.jobs, group.maps, group.settings, group.noise);
    if let Some(live) = &mut live {
        record(group, &episodes, live);
    }
    let mut fleet = group.contestant.fleet(group.settings, episodes.len());
    let mut watch = IncidentMonitor::new(episodes.len(), &group.settings.episode);
    let mut shares = vec![0.0_f32; episodes.len()];
    let mut frames = 0_u32;
    let reports = run_lockstep_until(episodes, &mut *fleet, &mut |episode, frame| {
        watch.frame(episode, frame);
        if let Some(live) = &mut live {
            live.frame(episode, frame);
        }
        track.near_collisions += u32::from(matches!(frame.event, Event::NearCollision { .. }));
        shares[episode] = frame.progress_m / group.maps[episode].path().length_m();
        frames += 1;
        // Often enough for eyes and Ctrl-C.
        if frames.is_multiple_of(64) {
            track.show(shares.iter().sum(), &group.contestant.name);
            if interrupt::is_requested() {
                return ControlFlow::Break(());
            }
        }
        ControlFlow::Continue(())
    });
    track.done += reports.iter().flatten().count();
    Driven { reports, incidents: watch.into_incidents(), wall_s: started.elapsed().as_secs_f64() }
}

/// Records the first runs of this driver at this noise level.
fn record(group: &TrialBatch<'_>, episodes: &[Episode], live: &mut Live) {
    let TrialBatch { settings, contestant, jobs, noise, .. } = group;
    let name = |job: &Trial<'_>| format!("{}, {}, trial {}", job.lot.name(), report::name(job.direction), job.trial);
    let names: Vec<String> = jobs.iter().map(name).collect();
    let root = visualise::root_of(&contestant.name);
    let view = View { root: &root, detail: Detail::Frames, novice: None };
    live.begin(&format!("{}, {noise}", contestant.name), settings, episodes, &names, &view);
}

/// How far the whole evaluation is.
struct Track {
    work: Work,
    runs: usize,
    done: usize,
    near_collisions: u32,
}

impl Track {
    fn show(&mut self, under_way: f32, driver: &str) {
        let Self { runs, done, near_collisions, .. } = *self;
        self.work.at((done as f64 + f64::from(under_way)) / runs as f64, || {
            format!("{done} of {runs} runs, {near_collisions} near-collisions, at the wheel: {driver}")
        });
    }
}

/// The files that are written line by line.
struct Lines {
    runs: BufWriter<File>,
    failures: BufWriter<File>,
    failures_table: BufWriter<File>,
    wall_time: BufWriter<File>,
}

impl Lines {
    fn create(run: &RunDir) -> anyhow::Result<Self> {
        let create = |name: &str| {
            let path = run.path().join(name);
            let file = File::create(&path).with_context(|| format!("{}: cannot be written", path.display()))?;
            Ok::<_, anyhow::Error>(BufWriter::new(file))
        };
        let mut failures_table = create("failures.md")?;
        failures_table.write_all(Failure::TABLE_HEAD.as_bytes())?;
        Ok(Self {
            runs: create("runs.jsonl")?,
            failures: create("failures.jsonl")?,
            failures_table,
            wall_time: create("wall_time.jsonl")?,
        })
    }

    fn add(
        &mut self,
        group: &TrialBatch<'_>,
        entry: &NamedDriver,
        seed: RootSeed,
        driven: &Driven,
        failures: &[(usize, Failure)],
    ) -> anyhow::Result<()> {
        let driver = entry.contestant.name.as_str();
        let ticks: u32 = driven.finished(group).map(|(_, (_, report))| report.metrics.ticks).sum();
        for (_, (job, report)) in driven.finished(group) {
            let (lot, direction, trial, noise) = (job.lot.name(), job.direction, job.trial, group.noise);
            let replay = replay_key(entry, job, noise, seed, 0).to_string();
            line(&mut self.runs, &RunLine::new(driver, job, noise, replay, report))?;
            // Runs of a group are driven at once; each has its share by the number of its decisions.
            let wall_s = driven.wall_s * f64::from(report.metrics.ticks) / f64::from(ticks.max(1));
            line(&mut self.wall_time, &WallTimeLine { driver, lot, direction, trial, noise, wall_s })?;
        }
        for (_, failure) in failures {
            line(&mut self.failures, failure)?;
            writeln!(self.failures_table, "{}", failure.table_row())?;
        }
        self.flush()
    }

    /// What is finished is on disk, also if the process is ended.
    fn flush(&mut self) -> anyhow::Result<()> {
        for file in [&mut self.runs, &mut self.failures, &mut self.failures_table, &mut self.wall_time] {
            file.flush().context("a file of the run cannot be written; is the disk full?")?;
        }
        Ok(())
    }

    fn finish(mut self) -> anyhow::Result<()> {
        self.flush()
    }
}

fn line(file: &mut BufWriter<File>, value: &impl Serialize) -> anyhow::Result<()> {
    serde_json::to_writer(&mut *file, value)?;
    Ok(writeln!(file)?)
}
