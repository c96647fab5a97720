//! Behaviour cloning and DAgger into a run folder: Algorithm 1 with its files, its progress and its learning curves.

use crate::drive;
use crate::inputs;
use crate::lots::{self, Lot};
use crate::manifest::Manifest;
use crate::progress::{Elapsed, Progress};
use crate::run_dir::RunDir;
use crate::settings::Settings;
use crate::trained;
use crate::trials::{self, Purpose, Trial};
use anyhow::ensure;
use expert::ScriptedExpert;
use policy::agreement::Agreement;
use policy::conditions::Conditions;
use policy::dagger::{Hooks, Learned, Outcome, Progress as DaggerProgress, Rollouts, RoundEpisode, Stop};
use policy::dataset::store::Store;
use policy::fit::FitProgress;
use sim::driver::Source;
use sim::episode::Episode;
use sim::frame::Frame;
use sim::limits::TRIAL_MAX;
use sim::map::Map;
use sim::seed::{EpisodeIndex, Rng, RootSeed, Stream};
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;

/// Trains, or continues what an interrupted training left in the folder, to the same result.
///
/// # Errors
/// If a lot cannot be driven, or a file cannot be read or written. Cancelling is not an error: the outcome says so.
pub fn train(settings: &Settings, run: &RunDir, progress: &dyn Progress) -> anyhow::Result<Outcome> {
    let lots = Lot::parse_all(&settings.training.lots, &settings.episode.vehicle)?;
    run.ensure_unchanged(&inputs::of(&lots, &[]))?;
    let store = Store::open(run.path())?;
    // A lot that cannot be driven is found here, with its error, not in the middle of a round.
    let mut first_episodes = (!store.has_round(0)?).then(|| episodes_of(settings, &lots, 0)).transpose()?;
    let monitor = RefCell::new(Monitor::new(progress));
    let conditions = Conditions::of(&settings.episode);
    let mut hooks = Hooks {
        episodes: &mut |round| {
            run.ensure_held()?;
            let first_episodes = first_episodes.take_if(|_| round == 0);
            let episodes = first_episodes.map_or_else(|| episodes_of(settings, &lots, round), Ok)?;
            monitor.borrow_mut().collection = Collection::of(&episodes);
            Ok(episodes)
        },
        on_frame: &mut |_, episode, frame| monitor.borrow_mut().frame(episode, frame),
        progress: &mut |report| {
            let mut monitor = monitor.borrow_mut();
            monitor.report(report);
            if progress.is_cancelled() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        },
    };
    let outcome = policy::dagger::run(&settings.dagger, &conditions, &store, settings.seed, &mut hooks)?;
    if monitor.into_inner().task.is_some() {
        // The final training has no row that ends it.
        progress.end(if outcome.stop == Stop::Interrupted { "stopped" } else { "done" });
    }
    Ok(outcome)
}

/// The episodes of a round with their experts. Lots that draw their obstacles are driven `training.trials` times. A
/// generated lot looks the same every time: it is driven once, and the next round has other ones. Where `different_lots`
/// brings one back within a round, each time is a trial of its own, with other noise.
///
/// # Errors
/// If a lot cannot be driven.
pub fn episodes_of(settings: &Settings, lots: &[Lot], round: u32) -> anyhow::Result<Vec<RoundEpisode>> {
    let training = &settings.training;
    let (generated, others): (Vec<Lot>, Vec<Lot>) = lots.iter().cloned().partition(Lot::is_generated);
    let of_a_kind = lots::generated_by_kind(&generated);
    let generated: Vec<Lot> =
        generated.iter().map(|lot| lot.in_round(round, of_a_kind[&lot.group()], training.different_lots)).collect();
    let purpose = Purpose::Training { round };
    let drawn = Trial::all(settings.seed, purpose, &others, training.trials, &training.directions);
    let mut driven_before: BTreeMap<&str, u32> = BTreeMap::new();
    let again = generated.iter().flat_map(|lot| {
        let times = driven_before.entry(lot.name()).or_default();
        let trial = *times;
        *times += 1;
        Trial::both_ways(settings.seed, purpose, lot, trial, &training.directions)
    });
    let trials: Vec<_> = drawn.chain(again).collect();
    let starts = drive::start(&trials, &trials::maps(&trials, &settings.episode)?, &settings.episode, training.noise);
    let seated = |((index, trial), episode): ((EpisodeIndex, &Trial<'_>), Episode)| {
        let expert = ScriptedExpert::new(settings.expert.clone(), &settings.episode, hand(settings.seed, index));
        RoundEpisode { index, direction: trial.direction, episode, expert: Box::new(expert) }
    };
    Ok(EpisodeIndex::of_round(round, trials.len()).zip(&trials).zip(starts).map(seated).collect())
}

/// The stream of the expert's label jitter in an episode of a training with this seed.
pub fn hand(seed: RootSeed, index: EpisodeIndex) -> Rng {
    seed.rng(Stream::Expert, index.stream())
}

/// One drive of a round of a finished training at its start, to be driven as it was: with its noise, its disturbances and
/// the network of the round before. `drive` counts from 0.
///
/// # Errors
/// If there is no such run, round or drive, a file of it cannot be read, or a lot has changed since.
pub fn drive_again(run: &Path, round: u32, drive: u32) -> anyhow::Result<(Arc<Map>, Rollouts)> {
    let settings = trained::settings_of(run)?;
    ensure!(round <= TRIAL_MAX, "round {round}: there are 0 to {TRIAL_MAX}");
    // First, because they say whether it is a training, and whether there is such a round.
    trained::policy_folder(run)?;
    let store = Store::open(run)?;
    let is_there = store.is_finished(&store.round_folder(round))?;
    ensure!(is_there, "round {round}: {} has no such round", run.display());
    let novice = (round > 0).then(|| Learned::of_round(&settings.dagger, &store, round)).transpose()?;
    let lots = Lot::parse_all(&settings.training.lots, &settings.episode.vehicle)?;
    Manifest::read(run)?.check_some_inputs(&inputs::of(&lots, &[]))?;
    let mut episodes = episodes_of(&settings, &lots, round)?;
    let count = episodes.len();
    ensure!((drive as usize) < count, "drive {drive} of round {round}: it has {count} drives, counted from 0");
    let episode = episodes.swap_remove(drive as usize);
    let map = Arc::clone(episode.episode.map());
    Ok((map, Rollouts::of_round(&settings.dagger, settings.seed, novice.as_ref(), vec![episode])))
}

/// Passes on what is reported during a training.
struct Monitor<'a> {
    progress: &'a dyn Progress,
    task: Option<Task>,
    collection: Collection,
    /// Samples that the running task has trained on here, after its first step.
    samples: u64,
    /// Samples that the network in training had been trained on at its last step.
    samples_of_network: u64,
}

/// What is being done at present.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Task {
    Collecting,
    Fitting,
}

/// Where the cars of a collection are.
#[derive(Default)]
struct Collection {
    /// Length of all routes together, metres.
    length_m: f64,
    /// How far each car is along its route, metres.
    progress_m: Vec<f32>,
    /// How far all are together, metres.
    all_progress_m: f64,
    novice_ticks: u64,
    ticks: u64,
}

impl Collection {
    fn of(episodes: &[RoundEpisode]) -> Self {
        let length_m = episodes.iter().map(|item| f64::from(item.episode.map().path().length_m())).sum();
        Self { length_m, progress_m: vec![0.0; episodes.len()], ..Self::default() }
    }

    fn advance(&mut self, episode: usize, progress_m: f32) {
        let before_m = std::mem::replace(&mut self.progress_m[episode], progress_m);
        // All of them are not added up anew at every tick of every car: the time for that grows with the square of their number.
        self.all_progress_m += f64::from(progress_m) - f64::from(before_m);
    }

    fn share(&self) -> f64 {
        self.all_progress_m / self.length_m.max(f64::MIN_POSITIVE)
    }
}

impl<'a> Monitor<'a> {
    fn new(progress: &'a dyn Progress) -> Self {
        Self { progress, task: None, collection: Collection::default(), samples: 0, samples_of_network: 0 }
    }

    fn frame(&mut self, episode: usize, frame: &Frame) {
        let collection = &mut self.collection;
        collection.advance(episode, frame.progress_m);
        collection.ticks += 1;
        collection.novice_ticks += u64::from(frame.decision.source == Source::Novice);
        self.progress.at(collection.share(), &mut |Elapsed { seconds }| {
            let per_s = collection.ticks as f64 / seconds;
            let eta_hat = collection.novice_ticks as f64 / collection.ticks as f64;
            format!("η̂ {eta_hat:.2}, {per_s:.0} ticks/s")
        });
    }

    fn report(&mut self, report: &DaggerProgress<'_>) {
        match *report {
            DaggerProgress::Collecting { round, .. } => {
                self.begin(Task::Collecting, &format!("round {round}: collecting"));
            }
            DaggerProgress::Collected { round, collection, dataset } => {
                let read_with = collection.agreement.map_or_else(String::new, |found| {
                    let Agreement { constant_within_tau, .. } = found;
                    format!(" (η̂; a constant answer: {:.1} %)", 100.0 * constant_within_tau)
                });
                let network = || format!(", the network drove {:.1} %{read_with}", 100.0 * collection.eta_hat());
                let eta = if round > 0 { network() } else { String::new() };
                self.end(&format!("{} samples, {dataset} in all{eta}", collection.samples));
            }
            DaggerProgress::Fitting { round, share, fit } => self.fitting(round, share, fit),
            DaggerProgress::Finished { row, .. } => self.end(&validation(row.validation_rmse_m)),
        }
    }

    fn fitting(&mut self, round: Option<u32>, share: f64, fit: &FitProgress) {
        if self.task.is_none() {
            let label = round.map_or_else(|| "final training".to_owned(), |round| format!("round {round}: training"));
            self.begin(Task::Fitting, &label);
            // What was trained on before an interruption took none of its time.
            (self.samples, self.samples_of_network) = (0, fit.samples_done);
        }
        // A critic or a member of an ensemble begins anew.
        let since = fit.samples_done.checked_sub(self.samples_of_network);
        self.samples += since.unwrap_or(fit.samples_done);
        self.samples_of_network = fit.samples_done;
        let samples = self.samples;
        self.progress.at(share, &mut |Elapsed { seconds }| {
            let per_s = samples as f64 / seconds;
            let validation = fit.validation.map_or_else(String::new, |at| format!(", validation {:.3} m", at.rmse_m));
            let (loss, learning_rate) = (fit.loss.total, fit.learning_rate);
            format!("loss {loss:.3}{validation}, learning rate {learning_rate:.1e}, {per_s:.0} samples/s")
        });
    }

    fn begin(&mut self, task: Task, label: &str) {
        let stage = match task {
            Task::Collecting => "collecting",
            Task::Fitting => "training",
        };
        self.progress.begin(stage, label);
        self.task = Some(task);
    }

    /// Rounds that were found on disk were never begun, and say nothing.
    fn end(&mut self, result: &str) {
        if self.task.take().is_some() {
            self.progress.end(result);
        }
    }
}

/// How far off a network is from the labels of the samples that were held back, if there are any.
fn validation(rmse_m: Option<f32>) -> String {
    rmse_m.map_or_else(|| "not validated".to_owned(), |error_m| format!("validation {error_m:.3} m off"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::manifest::Request;
    use crate::test_runs;
    use policy::fit::Budget;
    use policy::loss::LossParts;
    use sim::driver::Source;
    use sim::vehicle::VehicleCommand;

    /// Remembers what was said last, as if a second had passed, and how tasks ended.
    #[derive(Default)]
    struct Said {
        status: RefCell<String>,
        ends: RefCell<Vec<String>>,
    }

    impl Progress for Said {
        fn begin(&self, _: &'static str, _: &str) {}

        fn at(&self, _: f64, status: &mut dyn FnMut(Elapsed) -> String) {
            *self.status.borrow_mut() = status(Elapsed { seconds: 1.0 });
        }

        fn end(&self, result: &str) {
            self.ends.borrow_mut().push(result.to_owned());
        }

        fn is_cancelled(&self) -> bool {
            false
        }
    }

    /// From the second network on, samples since its begin were divided by the time since that of the first.
    #[test]
    fn the_speed_of_a_training_counts_all_networks_of_the_round() {
        let said = Said::default();
        let mut monitor = Monitor::new(&said);
        // The first goes on after an interruption.
        for samples_done in [50, 60, 70, 10, 20, 30] {
            let fit = FitProgress {
                step: 1,
                steps: 9,
                samples_done,
                learning_rate: 1e-3,
                loss: LossParts::default(),
                validation: None,
            };
            monitor.report(&DaggerProgress::Fitting { round: Some(1), share: 0.5, fit: &fit });
        }
        assert!(said.status.borrow().ends_with(" 50 samples/s"), "{}", said.status.borrow());
    }

    #[test]
    fn the_share_of_a_collection_is_that_of_all_its_routes() {
        let mut collection = Collection { length_m: 40.0, progress_m: vec![0.0; 3], ..Collection::default() };
        // The first car is put back in the end.
        for (car, progress_m, share) in [(0, 10.0, 0.25), (2, 20.0, 0.75), (0, 4.0, 0.6)] {
            collection.advance(car, progress_m);
            assert!((collection.share() - share).abs() < 1e-9, "{}", collection.share());
        }
        assert!(Collection::default().share().abs() < 1e-9, "of no routes");
    }

    /// It was trained to its end, and "stopped".
    #[test]
    fn a_final_training_that_is_done_is_not_said_to_have_stopped() {
        let path = test_runs::scratch("final-training");
        let mut settings = Settings::preset("smoke").unwrap();
        settings.training.lots = vec!["train:1:easy".to_owned()];
        (settings.dagger.iterations_min, settings.dagger.iterations_max) = (0, 0);
        settings.dagger.cloning_budget = Budget::Steps(10);
        settings.dagger.final_budget = Budget::Steps(10);
        let run = RunDir::create(&test_runs::place(&path, false), &settings, &Request::default()).unwrap();
        let said = Said::default();
        train(&settings, &run, &said).unwrap();
        let ends = said.ends.into_inner();
        assert_eq!(ends.last().map(String::as_str), Some("done"), "{ends:?}");
        drop(run);
        std::fs::remove_dir_all(path).unwrap();
    }

    /// Lots that came back within a round were driven with the same noise to the bit: copies, of which some were held back
    /// from the training and others not.
    #[test]
    fn no_two_drives_of_a_round_see_the_same_even_on_the_same_lot() {
        let mut settings = Settings::preset("smoke").unwrap();
        settings.training.lots = vec!["lot-a".to_owned(), "train:3:easy".to_owned()];
        settings.training.trials = 2;
        settings.training.different_lots = 1;
        let lots = Lot::parse_all(&settings.training.lots, &settings.episode.vehicle).unwrap();
        let mut seen = Vec::new();
        for RoundEpisode { direction, mut episode, .. } in episodes_of(&settings, &lots, 1).unwrap() {
            // A look a second for ten seconds: the car stands, the noise comes and goes.
            let looks: Vec<_> = (0..10)
                .map(|_| {
                    episode.observe();
                    let look = *episode.situation().observation;
                    for _ in 0..20 {
                        episode.apply_command(VehicleCommand::default(), Source::Expert);
                    }
                    look
                })
                .collect();
            seen.push((episode.map().scenario().name.clone(), direction, looks));
        }
        let drives = settings.training.directions.len() * 5;
        assert_eq!(seen.len(), drives);
        let names: Vec<_> = seen.iter().map(|(name, ..)| name.as_str()).collect();
        assert_eq!(
            names.iter().filter(|&&name| name == "train-easy-0").count(),
            drives / 5 * 3,
            "one lot, thrice: {names:?}"
        );
        for (at, drive) in seen.iter().enumerate() {
            assert!(!seen[..at].contains(drive), "drive {at} of {names:?}");
        }
    }

    /// With `dagger.fit.validation.every = 0` its line ended in "validation" and nothing.
    #[test]
    fn a_training_that_holds_nothing_back_says_so() {
        assert_eq!(validation(None), "not validated");
        assert_eq!(validation(Some(0.25)), "validation 0.250 m off");
    }

    /// A drive of a training that is driven again is the drive that was trained on: its expert, noise, disturbances and
    /// network.
    #[test]
    fn a_drive_of_a_training_is_driven_again_as_it_was_collected() {
        let run = std::env::temp_dir().join(format!("experiment-test-{}-drive-again", std::process::id()));
        let _ = std::fs::remove_dir_all(&run);
        let mut settings = Settings::preset("smoke").unwrap();
        settings.training.lots = vec!["train:2:easy".to_owned()];
        settings.dagger.fit.budget = Budget::Steps(30);
        settings.dagger.cloning_budget = Budget::Steps(30);
        assert!(settings.dagger.disturbance.enabled);
        let lots = Lot::parse_all(&settings.training.lots, &settings.episode.vehicle).unwrap();
        drop(RunDir::create(&test_runs::place(&run, false), &settings, &Request::default()).unwrap());
        let store = Store::open(&run).unwrap();
        let mut hooks = Hooks {
            episodes: &mut |round| Ok(episodes_of(&settings, &lots, round)?),
            on_frame: &mut |_, _, _| {},
            progress: &mut |_| ControlFlow::Continue(()),
        };
        let conditions = Conditions::of(&settings.episode);
        policy::dagger::run(&settings.dagger, &conditions, &store, settings.seed, &mut hooks).unwrap();
        for round in 0..2 {
            let (stored, collection) = store.read_round(round).unwrap();
            assert_eq!(collection.episodes.len(), 2);
            let (map, rollouts) = drive_again(&run, round, 1).unwrap();
            assert_eq!(map.scenario().name, collection.episodes[1].lot);
            let again = rollouts.drive(&mut |_, _| {}).unwrap().round;
            let first = collection.episodes[0].samples;
            assert_eq!(again.samples, stored.samples[first..], "round {round}");
            assert_eq!(again.ticks, stored.ticks[first..], "round {round}");
        }
        assert!(drive_again(&run, 1, 2).is_err_and(|error| error.to_string().contains("2 drives")));
        // It was driven by the last network there is.
        assert!(drive_again(&run, 2, 0).is_err_and(|error| error.to_string().contains("no such round")));
        std::fs::remove_dir_all(run).unwrap();
    }
}
