//! `tune`: parameters of the model-based planners, searched the same way and for as long for each.
//!
//! Only lot a and training lots are driven, in trials of their own. All candidates of a planner meet the same obstacles
//! and noise. Fewer failures win — near-collisions plus stuck events, after both of which the car is put back on its
//! path, so that neither can be traded for the other —, then fewer near-collisions, then the larger safe ratio; runs
//! that do not reach the end come last. The best few and the starting point then drive fresh trials, and the best over
//! all of its trials is kept: picking the luckiest of many candidates would promise too much.

use crate::totals::Totals;
use anyhow::{Context as _, ensure};
use experiment::drive::{self, TrialBatch};
use experiment::drivers::{NamedDriver, PlannerFile};
use experiment::lots::Lot;
use experiment::progress::Progress;
use experiment::run_dir::RunDir;
use experiment::settings::{NoiseChoice, Settings};
use experiment::trials::{self, Purpose, Trial};
use planners::PlannerSpec;
use planners::search::{GENERATION, Search};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use sim::episode::{Episode, EpisodeSettings};
use sim::map::Map;
use sim::seed::RootSeed;
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::Arc;
use storage::{sealed, sums};

/// Candidates that drive fresh trials besides the starting point.
const FINALISTS: usize = 4;
/// Bytes of what candidates did: a million, the most of a search, of at most 400 bytes each.
const CANDIDATES_BYTES_MAX: u64 = 400_000_000;

/// Tunes planners one after another and writes `NAME.toml` for each as it is found. Lots, trials, directions, noise and
/// seed are those of the section `evaluation`. Ends early if cancelled: what is returned is what was found by then. What
/// every candidate did is kept in `NAME.candidates.toml`: an interrupted search continues from there, to the same
/// result.
///
/// # Errors
/// If a lot is not for training or cannot be driven, a file cannot be read or written, or candidates are of another search.
pub fn tune(
    settings: &Settings,
    planners: &[Start],
    budget: usize,
    run: &RunDir,
    progress: &dyn Progress,
) -> anyhow::Result<Vec<Found>> {
    let evaluation = &settings.evaluation;
    let lots = Lot::parse_all(&evaluation.lots, &settings.episode.vehicle)?;
    check(&lots)?;
    progress.begin("lots", "drawing lots");
    let course = Course::new(settings, &lots, evaluation.noise[0])?;
    progress.end(&format!("{} runs per candidate", course.search.trials.len()));
    let mut tuned = Vec::new();
    for start in planners {
        progress.begin("tuning", &format!("tuning {}", start.name));
        let name = file_stem(&start.name);
        let candidates = format!("{name}.candidates.toml");
        let mut log = CandidateLog::read(run.path().join(&candidates), origin(settings, start, budget))?;
        let held = || run.ensure_held();
        let Some(found) = search(&course, start, budget, evaluation.seed, &mut log, progress, &held)? else { break };
        run.ensure_held()?;
        sums::list(run.path(), &[&candidates])?;
        progress.end(&format!(
            "{:.2} → {:.2} near-collisions and times stuck per 100 m",
            found.before.failures_per_100m, found.after.failures_per_100m
        ));
        run.write(&format!("{name}.toml"), found.to_toml(settings)?.as_bytes())?;
        tuned.push(found);
    }
    Ok(tuned)
}

/// What the files of a planner are named after, e.g. `dwa-fox` for `dwa/fox`.
pub fn file_stem(planner: &str) -> String {
    planner.replace('/', "-")
}

/// Whether parameters may be tuned on these lots.
///
/// # Errors
/// If one of them must stay unseen.
pub fn check(lots: &[Lot]) -> anyhow::Result<()> {
    let unseen = lots.iter().find(|lot| !lot.is_for_training());
    ensure!(
        unseen.is_none(),
        "lot {:?}: parameters are tuned on lot-a and generated training lots only (train:N), so that the others stay \
         unseen",
        unseen.map_or("", Lot::name)
    );
    Ok(())
}

/// A planner to be tuned.
#[derive(Debug, Clone)]
pub struct Start {
    /// As on the command line, with the reading: `dwa/fox`.
    pub name: String,
    /// The first candidate.
    pub planner: PlannerSpec,
}

/// The planners of these names; if none is named, all as the paper or the literature has them.
///
/// # Errors
/// If nothing is named so, or one is named twice.
pub fn planners_named(names: &[String]) -> anyhow::Result<Vec<Start>> {
    let all = PlannerSpec::all();
    if names.is_empty() {
        return Ok(all.into_iter().map(|planner| Start { name: planner.name().to_owned(), planner }).collect());
    }
    let start = |(index, name): (usize, &String)| {
        ensure!(!names[..index].contains(name), "planner {name:?} is named twice; name it once");
        let planner = PlannerSpec::named(name).with_context(|| {
            let known: Vec<&str> = all.iter().map(PlannerSpec::name).collect();
            format!("no planner {name:?}; there are {}", known.join(", "))
        })?;
        Ok(Start { name: name.clone(), planner })
    };
    names.iter().enumerate().map(start).collect()
}

/// Trials with their maps.
struct Stretch<'a> {
    trials: Vec<Trial<'a>>,
    maps: Vec<Arc<Map>>,
}

/// All runs that candidates drive.
struct Course<'a> {
    episode: &'a EpisodeSettings,
    noise: NoiseChoice,
    seed: RootSeed,
    /// What every candidate drives.
    search: Stretch<'a>,
    /// What the finalists drive.
    fresh: Stretch<'a>,
}

impl<'a> Course<'a> {
    fn new(settings: &'a Settings, lots: &'a [Lot], noise: NoiseChoice) -> anyhow::Result<Self> {
        let evaluation = &settings.evaluation;
        let count = evaluation.trials;
        // Lots that are the same in every trial get fresh noise; lot a gets fresh obstacles too.
        let all = Trial::all(evaluation.seed, Purpose::Tuning, lots, 2 * count, &evaluation.directions);
        let (search, fresh): (Vec<Trial<'_>>, Vec<Trial<'_>>) = all.partition(|trial| trial.index < count);
        let episode = &settings.episode;
        let stretch = |trials: Vec<Trial<'a>>| {
            let maps = trials::maps(&trials, episode)?;
            Ok::<_, anyhow::Error>(Stretch { trials, maps })
        };
        Ok(Self { episode, noise, seed: evaluation.seed, search: stretch(search)?, fresh: stretch(fresh)? })
    }

    /// Drives a stretch with every candidate, in parallel; sums come in the order of the candidates.
    fn drive(&self, candidates: &[PlannerSpec], stretch: &Stretch<'_>) -> anyhow::Result<Vec<Totals>> {
        let starts: Vec<Episode> = drive::start(&stretch.trials, &stretch.maps, self.episode, self.noise);
        let drive = |candidate: &PlannerSpec| {
            let driver = &NamedDriver::planner(candidate.clone());
            let (trials, maps) = (&stretch.trials, &stretch.maps);
            let batch = TrialBatch { episode: self.episode, driver, trials, maps, noise: self.noise, seed: self.seed };
            let episodes = starts.iter().cloned().enumerate().collect();
            let reports = batch.drive_from(episodes, &mut |_, _| ControlFlow::Continue(()));
            let reports = reports.with_context(|| {
                let parameters = candidate.parameters().to_string();
                format!("{} with {}", driver.spec, parameters.trim_end().replace('\n', ", "))
            })?;
            let mut totals = Totals::default();
            reports.iter().flatten().for_each(|report| totals.add(report));
            Ok(totals)
        };
        candidates.par_iter().map(drive).collect()
    }
}

/// What candidates did, in the order in which they were driven: on disk after every generation.
struct CandidateLog {
    path: PathBuf,
    /// The [`origin()`] of the search.
    origin: String,
    totals: Vec<Totals>,
    /// How many of them the search has been told.
    told: usize,
}

#[derive(Serialize, Deserialize)]
struct Candidates {
    /// Files of earlier versions lack it: nobody knows what they are of.
    #[serde(default)]
    origin: String,
    candidate: Vec<Totals>,
}

/// SHA-256 of what candidates follow from: those of another search, copied beside this one, have another. Not of the manifest,
/// which differs between machines that find the same.
fn origin(settings: &Settings, Start { name, planner }: &Start, budget: usize) -> String {
    let start = format!("{}\n{budget} {name}\n{}", settings.to_toml(), planner.parameters());
    sums::digest(start.as_bytes())
}

impl CandidateLog {
    /// What an interrupted search of this origin left.
    fn read(path: PathBuf, origin: String) -> anyhow::Result<Self> {
        let Some(text) = sealed::read_up_to(&path, CANDIDATES_BYTES_MAX)? else {
            return Ok(Self { path, origin, totals: Vec::new(), told: 0 });
        };
        let found: Candidates = toml::from_slice(&text).with_context(|| path.display().to_string())?;
        ensure!(
            found.origin == origin,
            "{}: was left by another search; restore it from a copy, or delete it to begin this planner's search again",
            path.display()
        );
        Ok(Self { path, origin, totals: found.candidate, told: 0 })
    }

    /// Whether the search has been told all that an interrupted one left.
    fn is_read(&self) -> bool {
        self.told >= self.totals.len()
    }

    /// What the next candidates did, driven unless they were before.
    fn next(
        &mut self,
        count: usize,
        drive: impl FnOnce() -> anyhow::Result<Vec<Totals>>,
    ) -> anyhow::Result<Vec<Totals>> {
        if self.told + count > self.totals.len() {
            self.totals.truncate(self.told);
            self.totals.extend(drive()?);
            let candidates = Candidates { origin: self.origin.clone(), candidate: self.totals.clone() };
            sealed::write(&self.path, toml::to_string(&candidates)?.as_bytes())?;
        }
        self.told += count;
        Ok(self.totals[self.told - count..self.told].to_vec())
    }
}

/// What decides between candidates; smaller is better.
fn rank(totals: &Totals) -> (u32, u32, u32, i64) {
    let unfinished = totals.timed_out + totals.given_up;
    let safe = (totals.safe_ratio() * 1e9) as i64;
    (unfinished, totals.near_collisions + totals.stuck, totals.near_collisions, -safe)
}

/// What a search found.
#[derive(Debug, Clone)]
pub struct Found {
    /// As on the command line.
    pub name: String,
    /// The planner with the parameters found.
    pub planner: PlannerSpec,
    budget: usize,
    seed: RootSeed,
    /// Whether nothing better than the starting point was found.
    pub is_start: bool,
    /// The starting point and the found parameters, over search and fresh trials.
    pub before: Score,
    /// See `before`.
    pub after: Score,
    /// The starting point over fresh trials alone: what the choice did not profit from as much.
    pub before_fresh: Score,
    /// The found parameters over the same.
    pub after_fresh: Score,
}

/// Sums as they are written down.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Score {
    /// Near-collisions and stuck events per 100 m of route.
    pub failures_per_100m: f64,
    /// Near-collisions.
    pub near_collisions: u32,
    /// Near-collisions per 100 m of route.
    pub near_collisions_per_100m: f64,
    /// Contacts.
    pub contacts: u32,
    /// Stuck events.
    pub stuck: u32,
    /// Runs that did not reach the end.
    pub unfinished_runs: u32,
    /// Mean over runs, 0…1.
    pub safe_ratio: f64,
    /// Length of the routes, metres.
    pub reference_m: f64,
}

impl Score {
    fn of(totals: &Totals) -> Self {
        let per_100m = |count: u32| round(100.0 * f64::from(count) / totals.reference_m);
        Self {
            failures_per_100m: per_100m(totals.near_collisions + totals.stuck),
            near_collisions: totals.near_collisions,
            near_collisions_per_100m: per_100m(totals.near_collisions),
            contacts: totals.contacts,
            stuck: totals.stuck,
            unfinished_runs: totals.timed_out + totals.given_up,
            safe_ratio: round(totals.safe_ratio()),
            reference_m: round(totals.reference_m),
        }
    }
}

/// Rounds to four decimals, for people.
fn round(value: f64) -> f64 {
    (value * 1e4).round() / 1e4
}

/// Searches around one planner; `None` if cancelled. `held` fails where the folder has become another run's.
fn search(
    course: &Course<'_>,
    Start { name, planner: start }: &Start,
    budget: usize,
    seed: RootSeed,
    log: &mut CandidateLog,
    progress: &dyn Progress,
    held: &dyn Fn() -> anyhow::Result<()>,
) -> anyhow::Result<Option<Found>> {
    let drive = |candidates: &[PlannerSpec], stretch: &Stretch<'_>| {
        let totals = course.drive(candidates, stretch)?;
        // Before they are written there.
        held()?;
        Ok::<_, anyhow::Error>(totals)
    };
    let finalists_max = FINALISTS.min(budget - 1) + 1;
    let runs_all = budget * course.search.trials.len() + finalists_max * course.fresh.trials.len();
    // The same draws for every planner, as far as their dimensions allow.
    let mut search = Search::new(start.to_unit_cube(), budget, seed, 0);
    let mut tried: Vec<(Vec<f32>, PlannerSpec, Totals)> = Vec::with_capacity(budget);
    loop {
        let best = tried.iter().min_by_key(|(_, _, totals)| rank(totals));
        // What is read back took none of the time.
        if log.is_read() {
            let share = (tried.len() * course.search.trials.len()) as f64 / runs_all as f64;
            let events = best.map(|(_, _, totals)| rank(totals).1);
            let said = |events: u32| format!("best so far: {events} near-collisions and times stuck");
            progress.at(share, &mut |_| events.map_or_else(String::new, said));
        }
        let generation = search.ask(best.map(|(point, ..)| point.as_slice()));
        if generation.is_empty() {
            break;
        }
        if progress.is_cancelled() {
            return Ok(None);
        }
        // The starting point is driven as it is: its parameters may lie outside the ranges.
        let candidate = |point: &Vec<f32>| start.at(point);
        let mut candidates: Vec<PlannerSpec> = generation.iter().map(candidate).collect();
        if tried.is_empty() {
            candidates[0] = start.clone();
        }
        let totals = log.next(candidates.len(), || drive(&candidates, &course.search))?;
        tried.extend(
            generation.into_iter().zip(candidates).zip(totals).map(|((point, of), totals)| (point, of, totals)),
        );
    }
    let mut order: Vec<usize> = (1..tried.len()).collect();
    order.sort_by_key(|&index| rank(&tried[index].2));
    order.truncate(finalists_max - 1);
    order.insert(0, 0);
    let finalists: Vec<PlannerSpec> = order.iter().map(|&index| tried[index].1.clone()).collect();
    let fresh = log.next(finalists.len(), || drive(&finalists, &course.fresh))?;
    let together: Vec<Totals> = order
        .iter()
        .zip(&fresh)
        .map(|(&index, fresh)| {
            let mut totals = tried[index].2.clone();
            totals.merge(fresh);
            totals
        })
        .collect();
    progress.at(1.0, &mut |_| String::new());
    let winner = (0..together.len()).min_by_key(|&place| (rank(&together[place]), place)).unwrap_or(0);
    Ok(Some(Found {
        name: name.clone(),
        planner: finalists[winner].clone(),
        budget,
        seed,
        is_start: winner == 0,
        before: Score::of(&together[0]),
        after: Score::of(&together[winner]),
        before_fresh: Score::of(&fresh[0]),
        after_fresh: Score::of(&fresh[winner]),
    }))
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
            ranges: self.planner.search_space().iter().map(|(name, span)| format!("{name}: {span}")).collect(),
            before: self.before,
            after: self.after,
            before_on_fresh_trials: self.before_fresh,
            after_on_fresh_trials: self.after_fresh,
        };
        let file = PlannerFile {
            planner: self.planner.name().to_owned(),
            parameters: self.planner.parameters(),
            search: Some(toml::Table::try_from(&record).context("a record is plain values")?),
        };
        Ok(toml::to_string(&file)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use experiment::progress::Shares;
    use std::cell::Cell;

    /// `tune --resume` went on with the candidates of any search that somebody had copied there.
    #[test]
    fn candidates_of_another_search_are_refused() {
        let path = std::env::temp_dir().join(format!("evaluation-test-{}-cvm.candidates.toml", std::process::id()));
        let settings = Settings::preset("default").unwrap();
        let starts = planners_named(&["cvm".to_owned(), "vvf".to_owned()]).unwrap();
        let own = || origin(&settings, &starts[0], 8);
        let mut log = CandidateLog::read(path.clone(), own()).unwrap();
        log.next(1, || Ok(vec![Totals::default()])).unwrap();
        assert_eq!(CandidateLog::read(path.clone(), own()).unwrap().totals, [Totals::default()]);
        let mut of_another_seed = settings.clone();
        of_another_seed.evaluation.seed = RootSeed(2);
        for other in [
            origin(&of_another_seed, &starts[0], 8),
            origin(&settings, &starts[1], 8),
            origin(&settings, &starts[0], 9),
        ] {
            let refused = CandidateLog::read(path.clone(), other).err().unwrap().to_string();
            assert!(refused.contains("candidates.toml: was left by another search"), "{refused}");
        }
        // As earlier versions wrote it.
        sealed::write(&path, b"candidate = []").unwrap();
        assert!(CandidateLog::read(path.clone(), own()).is_err());
        std::fs::remove_file(path).unwrap();
    }

    /// Their share was reported after that of nothing, as if they had been driven in no time.
    #[test]
    fn candidates_that_are_read_back_are_done_before_anything_is_reported() {
        let path = std::env::temp_dir().join(format!("evaluation-test-{}-back.candidates.toml", std::process::id()));
        let mut settings = Settings::preset("smoke").unwrap();
        settings.evaluation.trials = 1;
        let lots = Lot::parse_all(&["train:1:easy"], &settings.episode.vehicle).unwrap();
        let course = Course::new(&settings, &lots, NoiseChoice::Clean).unwrap();
        let start = &planners_named(&["cvm".to_owned()]).unwrap()[0];
        let reported = || {
            let shares = Shares::default();
            let mut log = CandidateLog::read(path.clone(), origin(&settings, start, 2)).unwrap();
            search(&course, start, 2, settings.evaluation.seed, &mut log, &shares, &|| Ok(())).unwrap().unwrap();
            shares.0.into_inner()
        };
        let driven = reported();
        assert!(driven.len() > 2 && driven[0] == 0.0 && driven.is_sorted(), "{driven:?}");
        assert_eq!(reported(), [1.0]);
        std::fs::remove_file(path).unwrap();
    }

    /// A search whose folder was deleted and begun again by another went on to its end, and listed its candidates there.
    #[test]
    fn a_search_ends_where_its_folder_is_another_runs() {
        let path = std::env::temp_dir().join(format!("evaluation-test-{}-held.candidates.toml", std::process::id()));
        let mut settings = Settings::preset("smoke").unwrap();
        settings.evaluation.trials = 1;
        let lots = Lot::parse_all(&["train:1:easy"], &settings.episode.vehicle).unwrap();
        let course = Course::new(&settings, &lots, NoiseChoice::Clean).unwrap();
        let start = &planners_named(&["cvm".to_owned()]).unwrap()[0];
        let mut log = CandidateLog::read(path.clone(), origin(&settings, start, 2)).unwrap();
        let times_asked = Cell::new(0);
        let held = || {
            times_asked.set(times_asked.get() + 1);
            ensure!(times_asked.get() < 2, "it is another run's");
            Ok(())
        };
        let seed = settings.evaluation.seed;
        let refused = search(&course, start, 2, seed, &mut log, &Shares::default(), &held).unwrap_err();
        assert_eq!(refused.to_string(), "it is another run's");
        let written = CandidateLog::read(path.clone(), origin(&settings, start, 2)).unwrap().totals.len();
        assert_eq!(written, 2, "what the finalists did is not written");
        std::fs::remove_file(path).unwrap();
    }

    /// Neither kind of failure can be traded for the other, nor for giving up.
    #[test]
    fn candidates_are_ranked_by_unfinished_runs_then_failures_then_near_collisions_then_room() {
        let of = |timed_out, given_up, near_collisions, stuck, safe_ratio_sum| Totals {
            runs: 10,
            timed_out,
            given_up,
            near_collisions,
            stuck,
            safe_ratio_sum,
            ..Totals::default()
        };
        // The best first: 4 failures, 4 with less room, 4 of which more are near-collisions, 5; then unfinished runs.
        let ordered = [
            of(0, 0, 2, 2, 9.0),
            of(0, 0, 2, 2, 8.0),
            of(0, 0, 3, 1, 9.0),
            of(0, 0, 1, 4, 9.0),
            of(0, 1, 0, 0, 9.0),
            of(1, 1, 0, 0, 9.0),
        ];
        assert!(ordered.is_sorted_by(|better, worse| rank(better) < rank(worse)), "{:?}", ordered.each_ref().map(rank));
    }

    /// The luckiest of many candidates would be lucky again.
    #[test]
    fn finalists_drive_other_trials_than_they_were_chosen_by() {
        let mut settings = Settings::preset("smoke").unwrap();
        settings.evaluation.trials = 3;
        let lots = Lot::parse_all(&["train:1:easy"], &settings.episode.vehicle).unwrap();
        let course = Course::new(&settings, &lots, NoiseChoice::Clean).unwrap();
        let seeds = |stretch: &Stretch<'_>| stretch.trials.iter().map(|trial| trial.seed).collect::<Vec<_>>();
        let (search, fresh) = (seeds(&course.search), seeds(&course.fresh));
        assert_eq!((search.len(), fresh.len()), (3, 3));
        assert!(fresh.iter().all(|seed| !search.contains(seed)), "{search:?} {fresh:?}");
    }
}
