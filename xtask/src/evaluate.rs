//! `evaluate`: driver × lots × trials × directions.

use crate::cli::{Directions, EvaluateArgs, NoiseArg};
use crate::drivers::Contestant;
use crate::interrupt::{self, Interrupted};
use crate::lots::Lot;
use crate::progress::{Stopwatch, Work};
use crate::report::{Evaluation, RunLine};
use crate::run_dir::{Place, RunDir};
use crate::settings::{NoiseChoice, Settings};
use crate::summary::Cells;
use crate::trials::{self, Job, Purpose};
use anyhow::Context as _;
use serde::Serialize;
use sim::batch::run_lockstep;
use sim::episode::{EpisodeReport, Event};
use sim::scenario::Direction;
use sim::seed::RootSeed;
use std::io::Write as _;

/// Runs driven at a time. A constant: neither memory nor results depend on how many runs or threads there are.
const GROUP: usize = 16;

/// The command.
///
/// # Errors
/// If something named does not exist or cannot be written, or by Ctrl-C.
pub fn run(args: &EvaluateArgs) -> anyhow::Result<()> {
    let settings = resolve(args)?;
    let lots = Lot::parse_all(&settings.evaluation.lots)?;
    let contestants = Contestant::parse_all(&args.drivers)?;
    let run = RunDir::create(
        &Place {
            out: args.out.as_deref(),
            overwrite: args.overwrite,
            command: "evaluate",
            preset: &args.layers.preset,
            seed: settings.evaluation.seed.0,
        },
        &settings,
    )?;
    let mut stopwatch = Stopwatch::default();
    measure(&settings, &contestants, &lots, &run, &mut stopwatch)?;
    run.finish(&Finished { drivers: &args.drivers })?;
    eprintln!("written: {}/evaluation.md, .json, .csv and episodes.jsonl", run.path().display());
    stopwatch.report();
    Ok(())
}

#[derive(Serialize)]
struct Finished<'a> {
    drivers: &'a [String],
}

fn resolve(args: &EvaluateArgs) -> anyhow::Result<Settings> {
    let mut settings = Settings::resolve(&args.layers, None)?;
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
    if let Some(noise) = args.noise {
        evaluation.noise = noise.into();
    }
    settings.check()?;
    Ok(settings)
}

impl From<NoiseArg> for NoiseChoice {
    fn from(noise: NoiseArg) -> Self {
        match noise {
            NoiseArg::Clean => Self::Clean,
            NoiseArg::Paper => Self::Paper,
            NoiseArg::Hard => Self::Hard,
            NoiseArg::Lot => Self::Lot,
        }
    }
}

/// Drives every contestant through the evaluation of the settings, writes one line per run as they come and the tables
/// at the end, and prints the table.
///
/// # Errors
/// If a lot cannot be built or a file cannot be written, or by Ctrl-C; what was driven by then is written.
pub fn measure(
    settings: &Settings,
    contestants: &[Contestant],
    lots: &[Lot],
    run: &RunDir,
    stopwatch: &mut Stopwatch,
) -> anyhow::Result<()> {
    contestants.iter().try_for_each(|contestant| contestant.check(settings))?;
    let path = run.path().join("episodes.jsonl");
    let file = std::fs::File::create(&path).with_context(|| format!("{}: cannot be written", path.display()))?;
    let mut lines = std::io::BufWriter::new(file);
    let mut cells = Cells::default();
    let mut was_cut_short = false;
    for contestant in contestants {
        let mut work = Work::begin(format!("driving {}", contestant.name));
        let done = drive(settings, contestant, lots, &mut work, &mut |job, report| {
            cells.add(&contestant.name, job.lot, job.direction, report);
            let (driver, lot) = (contestant.name.as_str(), job.lot.name());
            let line = RunLine { driver, lot, direction: job.direction, trial: job.trial, report };
            serde_json::to_writer(&mut lines, &line)?;
            writeln!(lines)?;
            Ok(())
        });
        lines.flush()?;
        stopwatch.add("evaluation", work.seconds());
        let totals = cells.pooled(|cell| cell.driver == contestant.name);
        work.end(&format!("{} runs, {} near-collisions", totals.runs, totals.near_collisions));
        if !done? {
            was_cut_short = true;
            break;
        }
    }
    let evaluation = Evaluation { settings: &settings.evaluation, cells: &cells };
    println!("\nClosed loop\n\n{}", evaluation.to_markdown());
    evaluation.write(run)?;
    if was_cut_short {
        let kept = format!("the runs driven so far are in {}", run.path().display());
        return Err(Interrupted { kept }.into());
    }
    Ok(())
}

/// Drives one contestant, group by group; results come in the order of the jobs. `false` if cut short by Ctrl-C.
fn drive(
    settings: &Settings,
    contestant: &Contestant,
    lots: &[Lot],
    work: &mut Work,
    on_run: &mut dyn FnMut(&Job<'_>, &EpisodeReport) -> anyhow::Result<()>,
) -> anyhow::Result<bool> {
    let evaluation = &settings.evaluation;
    let jobs = Job::all(evaluation.seed, Purpose::Evaluation, lots, evaluation.trials, &evaluation.directions);
    let count = jobs.clone().count() as f64;
    let mut jobs = jobs.peekable();
    let (mut done, mut near_collisions) = (0, 0_u32);
    while jobs.peek().is_some() {
        let group: Vec<Job<'_>> = jobs.by_ref().take(GROUP).collect();
        let episodes = trials::episodes(&group, settings, evaluation.noise)?;
        let lengths_m: Vec<f32> = episodes.iter().map(|episode| episode.map().path().length_m()).collect();
        let mut shares = vec![0.0_f32; group.len()];
        let mut fleet = contestant.fleet(settings, group.len());
        let reports = run_lockstep(episodes, &mut *fleet, &mut |episode, frame| {
            shares[episode] = frame.progress_m / lengths_m[episode];
            near_collisions += u32::from(matches!(frame.event, Event::NearCollision { .. }));
            if episode == 0 {
                let runs = f64::from(done) + f64::from(shares.iter().sum::<f32>());
                work.at(runs / count, || format!("{near_collisions} near-collisions"));
            }
        });
        for (job, report) in group.iter().zip(&reports) {
            on_run(job, report)?;
            done += 1;
        }
        if interrupt::is_requested() && jobs.peek().is_some() {
            return Ok(false);
        }
    }
    Ok(true)
}
