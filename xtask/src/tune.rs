//! `tune`: parameters of the model-based planners, searched the same way and for as long for each.
//!
//! Only lot a and training lots are driven, in trials of their own. All candidates of a planner meet the same obstacles
//! and noise. Fewer failures win — near-collisions plus stuck events, after both of which the car is put back on its
//! path, so that neither can be traded for the other —, then fewer near-collisions, then the larger safe ratio; runs
//! that do not reach the end come last. The best few and the starting point then drive fresh trials, and the best over
//! all of its trials is kept: picking the luckiest of many candidates would promise too much.

use crate::cli::TuneArgs;
use crate::drivers::PlannerFile;
use crate::interrupt::{self, Interrupted};
use crate::lots::Lot;
use crate::progress::{Stopwatch, Work};
use crate::report::markdown;
use crate::run_dir::{Place, RunDir};
use crate::settings::{NoiseChoice, Settings};
use crate::summary::Totals;
use crate::trials::{self, Purpose, Trial};
use anyhow::{Context as _, ensure};
use planners::search::{GENERATION, Search};
use planners::{Baseline, PlannerContext};
use rayon::prelude::*;
use serde::Serialize;
use sim::driver::SensorsOnly;
use sim::episode::{self, Episode, EpisodeReport};
use sim::scenario::Direction;
use sim::seed::RootSeed;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Candidates that drive fresh trials besides the starting point.
const FINALISTS: usize = 4;

/// The command.
///
/// # Errors
/// If something named does not exist or cannot be written, or by Ctrl-C.
pub fn run(args: &TuneArgs) -> anyhow::Result<()> {
    let mut settings = Settings::resolve(&args.layers, None)?;
    // Written into the folder, so that it says what was driven.
    settings.evaluation.seed = RootSeed(args.seed);
    settings.evaluation.lots.clone_from(&args.lots);
    settings.evaluation.trials = args.trials;
    settings.evaluation.directions = Direction::BOTH.to_vec();
    settings.evaluation.noise = vec![args.noise];
    settings.check()?;
    ensure!(args.budget > 0, "--budget is 0; at least the starting point must be driven");
    let baselines = planners(&args.planners)?;
    let lots = Lot::parse_all(&args.lots)?;
    for lot in &lots {
        ensure!(
            lot.is_for_training(),
            "--lots {:?}: parameters are tuned on lot-a and generated training lots only (train:N), so that the others \
             stay unseen",
            lot.name()
        );
    }
    let place = Place {
        out: args.out.as_deref(),
        overwrite: args.overwrite,
        command: "tune",
        preset: args.layers.preset_name(),
        seed: args.seed,
    };
    let run = RunDir::create(&place, &settings)?;
    let mut stopwatch = Stopwatch::default();
    let mut work = Work::begin("drawing lots");
    let course = Course::new(&settings, &lots, args.noise)?;
    stopwatch.add("lots", work.seconds());
    work.at(1.0, String::new);
    work.end(&format!("{} runs per candidate", course.search.len()));
    let mut tuned = Vec::new();
    for baseline in &baselines {
        let mut work = Work::begin(format!("tuning {}", baseline.name()));
        let found = tune(&course, baseline, args.budget as usize, RootSeed(args.seed), &mut work);
        stopwatch.add("tuning", work.seconds());
        let Some(found) = found else {
            drop(work);
            let kept = format!("{} of {} planners are tuned in {}", tuned.len(), baselines.len(), run.path().display());
            return Err(Interrupted { kept }.into());
        };
        work.end(&format!(
            "{:.2} → {:.2} failures per 100 m",
            found.before.failures_per_100m, found.after.failures_per_100m
        ));
        run.write(&format!("{}.toml", baseline.name()), found.to_toml(&settings)?.as_bytes())?;
        tuned.push(found);
    }
    let table = table(&tuned);
    println!("\n{table}");
    run.write("tuning.md", format!("{table}\n").as_bytes())?;
    run.finish(&Finished { planners: tuned.iter().map(|found| found.baseline.name()).collect() })?;
    eprintln!("written: {}/*.toml; drive one with --driver NAME:{0}/NAME.toml", run.path().display());
    stopwatch.report();
    Ok(())
}

#[derive(Serialize)]
struct Finished {
    planners: Vec<&'static str>,
}

/// The planners of these names, in the order of [`Baseline::all`]; all if none is named.
fn planners(names: &[String]) -> anyhow::Result<Vec<Baseline>> {
    let all = Baseline::all();
    for name in names {
        let known: Vec<&str> = all.iter().map(Baseline::name).collect();
        ensure!(known.contains(&name.as_str()), "no planner {name:?}; there are {}", known.join(", "));
    }
    let is_wanted = |baseline: &Baseline| names.is_empty() || names.iter().any(|name| name == baseline.name());
    Ok(all.into_iter().filter(is_wanted).collect())
}

/// Cars at the start of all runs that a candidate drives.
struct Course {
    rig: PlannerContext,
    /// Every candidate's.
    search: Vec<Episode>,
    /// The finalists'.
    fresh: Vec<Episode>,
}

impl Course {
    fn new(settings: &Settings, lots: &[Lot], noise: NoiseChoice) -> anyhow::Result<Self> {
        let evaluation = &settings.evaluation;
        let trials = evaluation.trials;
        // Lots that are the same in every trial get fresh noise; lot a gets fresh obstacles too.
        let jobs = Trial::all(evaluation.seed, Purpose::Tuning, lots, 2 * trials, &evaluation.directions);
        let (search, fresh): (Vec<Trial<'_>>, Vec<Trial<'_>>) = jobs.partition(|job| job.trial < trials);
        let episodes = |jobs: &[Trial<'_>]| trials::episodes(jobs, settings, noise);
        Ok(Self { rig: PlannerContext::of(&settings.episode), search: episodes(&search)?, fresh: episodes(&fresh)? })
    }

    /// Drives some runs with every candidate, in parallel; sums come in the order of the candidates.
    fn drive(&self, candidates: &[Baseline], starts: &[Episode], on_run: &(dyn Fn() + Sync)) -> Vec<Totals> {
        let planners: Vec<_> = candidates.par_iter().map(|candidate| candidate.planner(&self.rig)).collect();
        let reports: Vec<_> = (0..planners.len() * starts.len())
            .into_par_iter()
            .map(|index| {
                let mut driver = SensorsOnly(planners[index / starts.len()].clone());
                let report = episode::run(starts[index % starts.len()].clone(), &mut driver, &mut ());
                on_run();
                report
            })
            .collect();
        let total = |reports: &[EpisodeReport]| {
            let mut totals = Totals::default();
            for report in reports {
                totals.add(report);
            }
            totals
        };
        reports.chunks(starts.len()).map(total).collect()
    }
}

/// What decides between candidates; smaller is better.
fn rank(totals: &Totals) -> (u32, u32, u32, i64) {
    let unfinished = totals.timed_out + totals.given_up;
    let safe = (totals.safe_ratio() * 1e9) as i64;
    (unfinished, totals.near_collisions + totals.stuck, totals.near_collisions, -safe)
}

/// What a search found.
struct Found {
    baseline: Baseline,
    budget: usize,
    seed: RootSeed,
    /// Whether nothing better than the starting point was found.
    is_start: bool,
    /// The starting point and the found parameters, over search and fresh trials.
    before: Score,
    after: Score,
    /// Over fresh trials alone: what the choice did not profit from as much.
    before_fresh: Score,
    after_fresh: Score,
}

/// Sums as they are written down.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
struct Score {
    failures_per_100m: f64,
    near_collisions: u32,
    near_collisions_per_100m: f64,
    stuck: u32,
    unfinished_runs: u32,
    safe_ratio: f64,
    reference_m: f64,
}

impl Score {
    fn of(totals: &Totals) -> Self {
        let per_100m = |count: u32| round(100.0 * f64::from(count) / totals.reference_m);
        Self {
            failures_per_100m: per_100m(totals.near_collisions + totals.stuck),
            near_collisions: totals.near_collisions,
            near_collisions_per_100m: per_100m(totals.near_collisions),
            stuck: totals.stuck,
            unfinished_runs: totals.timed_out + totals.given_up,
            safe_ratio: round(totals.safe_ratio()),
            reference_m: round(totals.reference_m),
        }
    }
}

/// To four decimals, for people.
fn round(value: f64) -> f64 {
    (value * 1e4).round() / 1e4
}

/// Searches around one planner; `None` if cut short by Ctrl-C.
fn tune(course: &Course, start: &Baseline, budget: usize, seed: RootSeed, work: &mut Work) -> Option<Found> {
    let finalists_max = FINALISTS.min(budget - 1) + 1;
    let runs_all = budget * course.search.len() + finalists_max * course.fresh.len();
    let runs_done = AtomicUsize::new(0);
    let on_run = || {
        runs_done.fetch_add(1, Ordering::Relaxed);
    };
    // The same draws for every planner, as far as their dimensions allow.
    let mut search = Search::new(start.to_unit_cube(), budget, seed, 0);
    let mut tried: Vec<(Vec<f32>, Baseline, Totals)> = Vec::with_capacity(budget);
    loop {
        let best = tried.iter().min_by_key(|(_, _, totals)| rank(totals));
        let share = runs_done.load(Ordering::Relaxed) as f64 / runs_all as f64;
        work.at(share, || best.map_or_else(String::new, |(_, _, totals)| format!("{} failures", rank(totals).1)));
        let generation = search.ask(best.map(|(point, ..)| point.as_slice()));
        if generation.is_empty() {
            break;
        }
        if interrupt::is_requested() {
            return None;
        }
        // The starting point is driven as it is: its parameters may lie outside the ranges.
        let candidate = |point: &Vec<f32>| start.at(point);
        let mut candidates: Vec<Baseline> = generation.iter().map(candidate).collect();
        if tried.is_empty() {
            candidates[0] = start.clone();
        }
        let totals = course.drive(&candidates, &course.search, &on_run);
        tried.extend(
            generation.into_iter().zip(candidates).zip(totals).map(|((point, of), totals)| (point, of, totals)),
        );
    }
    let mut order: Vec<usize> = (1..tried.len()).collect();
    order.sort_by_key(|&index| rank(&tried[index].2));
    order.truncate(finalists_max - 1);
    order.insert(0, 0);
    let finalists: Vec<Baseline> = order.iter().map(|&index| tried[index].1.clone()).collect();
    let fresh = course.drive(&finalists, &course.fresh, &on_run);
    let together: Vec<Totals> = order
        .iter()
        .zip(&fresh)
        .map(|(&index, fresh)| {
            let mut totals = tried[index].2.clone();
            totals.merge(fresh);
            totals
        })
        .collect();
    let winner = (0..together.len()).min_by_key(|&place| (rank(&together[place]), place))?;
    Some(Found {
        baseline: finalists[winner].clone(),
        budget,
        seed,
        is_start: winner == 0,
        before: Score::of(&together[0]),
        after: Score::of(&together[winner]),
        before_fresh: Score::of(&fresh[0]),
        after_fresh: Score::of(&fresh[winner]),
    })
}

/// How parameters were found, as written beside them.
#[derive(Serialize)]
struct Record<'a> {
    method: String,
    candidates: usize,
    seed: u64,
    lots: &'a [String],
    trials: u32,
    noise: Vec<String>,
    kept_the_starting_point: bool,
    ranges: Vec<String>,
    before: Score,
    after: Score,
    before_on_fresh_trials: Score,
    after_on_fresh_trials: Score,
}

impl Found {
    fn to_toml(&self, settings: &Settings) -> anyhow::Result<String> {
        let evaluation = &settings.evaluation;
        let record = Record {
            method: format!(
                "half of the candidates uniform, half normal around the best, generations of {GENERATION}; the best \
                 {FINALISTS} and the starting point on fresh trials"
            ),
            candidates: self.budget,
            seed: self.seed.0,
            lots: &evaluation.lots,
            trials: evaluation.trials,
            noise: evaluation.noise.iter().map(|noise| noise.name()).collect(),
            kept_the_starting_point: self.is_start,
            ranges: self.baseline.search_space().iter().map(|(name, span)| format!("{name}: {span}")).collect(),
            before: self.before,
            after: self.after,
            before_on_fresh_trials: self.before_fresh,
            after_on_fresh_trials: self.after_fresh,
        };
        let file = PlannerFile {
            planner: self.baseline.name().to_owned(),
            parameters: self.baseline.parameters(),
            search: Some(toml::Table::try_from(&record).context("a record is plain values")?),
        };
        Ok(toml::to_string(&file)?)
    }
}

/// Before and after, one row per planner.
fn table(tuned: &[Found]) -> String {
    let header = [
        "planner",
        "near-collisions before",
        "after",
        "per 100 m before",
        "after",
        "stuck before",
        "after",
        "safe ratio before",
        "after",
        "found",
    ];
    let mut table = markdown(header.map(str::to_owned).to_vec());
    for found in tuned {
        let (before, after) = (&found.before, &found.after);
        let parameters = found.baseline.parameters();
        let values: Vec<String> = found
            .baseline
            .search_space()
            .iter()
            .map(|(name, _)| match &parameters[*name] {
                toml::Value::Float(value) => format!("{name} {value:.3}"),
                other => format!("{name} {other}"),
            })
            .collect();
        table.add_row(vec![
            found.baseline.name().to_owned(),
            before.near_collisions.to_string(),
            after.near_collisions.to_string(),
            format!("{:.2}", before.near_collisions_per_100m),
            format!("{:.2}", after.near_collisions_per_100m),
            before.stuck.to_string(),
            after.stuck.to_string(),
            format!("{:.3}", before.safe_ratio),
            format!("{:.3}", after.safe_ratio),
            if found.is_start { "nothing better".to_owned() } else { values.join(", ") },
        ]);
    }
    table.to_string()
}
