//! How long work takes on two quiet cores, as tasks: the stages that [`Progress`](experiment::progress::Progress) is
//! told, with seconds. For people: nothing that is computed depends on it.

use experiment::lots::Lot;
use experiment::settings::Settings;
use policy::dataset::store::Store;
use policy::fit::FitSettings;
use policy::network::{NetworkArchitecture, RESIDUAL_KERNEL};
use std::path::Path;

/// A stage of [`Progress::begin`](experiment::progress::Progress::begin) and how long it takes, seconds.
pub type Task = (&'static str, f64);

/// Measured on two cores of an AMD EPYC (Zen 3): seconds per run that is collected from, with noise augmentations.
const COLLECTED_RUN_S: f64 = 0.25;
/// The same per run driven; networks take longer, planners less (beside a compilation, with AVX-512: 0.16).
const DRIVEN_RUN_S: f64 = 0.15;
/// The same per labelled rollout, with the answers on held-back samples.
const ON_POLICY_RUN_S: f64 = 2.5;
/// Multiply-adds of a network's answer that training gets through per second, both directions counted as one.
const TRAINED_PER_S: f64 = 2.0e10;
/// The report of a run, whose worst near-collisions are driven again.
const REPORT_S: f64 = 15.0;

/// A training of as many iterations as there can be; with behaviour cloning, unless that is taken over.
pub fn training(settings: &Settings, has_cloning: bool) -> Vec<Task> {
    let dagger = &settings.dagger;
    let training = &settings.training;
    let runs_per_way: f64 = lots(&training.lots, settings)
        .iter()
        // Generated lots are driven once.
        .map(|lot| if lot.is_generated() { 1.0 } else { f64::from(training.trials) })
        .sum();
    let collecting_s = runs_per_way * training.directions.len() as f64 * COLLECTED_RUN_S;
    let fitting_s = |fit: &FitSettings| {
        // On about as many samples as eight round trips of lot a give.
        f64::from(fit.steps(50_000)) * fit.batch as f64 * multiply_adds(&dagger.network) / TRAINED_PER_S
    };
    let rounds = u32::from(!has_cloning)..=dagger.iterations_max;
    let mut tasks: Vec<Task> = rounds
        .flat_map(|round| {
            // Members of an ensemble and a critic are part of the same task.
            let training_s = dagger.fits_of_round(round).iter().map(fitting_s).sum();
            [("collecting", collecting_s), ("training", training_s)]
        })
        .collect();
    tasks.extend(dagger.final_fit().map(|fit| ("training", fitting_s(&fit))));
    tasks
}

/// What is left of a training in its folder: rounds that are there are read. All of it where the folder cannot be read, which
/// the training itself says.
pub fn rest_of_training(settings: &Settings, has_cloning: bool, folder: &Path) -> Vec<Task> {
    let mut tasks = training(settings, has_cloning);
    let done = tasks_done(settings, has_cloning, folder).unwrap_or(0);
    tasks.split_off(done)
}

/// How many of the tasks of a training are done in its folder.
fn tasks_done(settings: &Settings, has_cloning: bool, folder: &Path) -> anyhow::Result<usize> {
    if !folder.is_dir() {
        return Ok(0);
    }
    let (dagger, store) = (&settings.dagger, Store::open(folder)?);
    let first = u32::from(!has_cloning);
    let mut next = first;
    while next <= dagger.iterations_max && store.has_round(next)? {
        next += 1;
    }
    let Some(last) = next.checked_sub(1).filter(|&last| last >= first) else { return Ok(0) };
    // What is trained beside a network comes after it, and is done for certain once the next round is there.
    let is_trained = dagger.fits_of_round(last).len() == 1 && store.is_finished(&store.round_folder(last))?;
    Ok(2 * (last - first) as usize + 1 + usize::from(is_trained))
}

/// An evaluation of this many drivers.
pub fn evaluation(settings: &Settings, drivers: usize) -> Task {
    let evaluation = &settings.evaluation;
    let runs = runs(settings, evaluation.trials) * (drivers * evaluation.noise.len()) as f64;
    ("evaluation", runs * DRIVEN_RUN_S)
}

/// On-policy rollouts of every policy of two trainings.
pub fn on_policy(settings: &Settings) -> Task {
    let policies = 2.0 * f64::from(settings.dagger.iterations_max) + 1.0;
    ("on-policy rollouts", policies * runs(settings, 1) * ON_POLICY_RUN_S)
}

/// The report of a run.
pub fn report() -> Task {
    ("report", REPORT_S)
}

/// Runs over the evaluation's lots.
fn runs(settings: &Settings, trials: u32) -> f64 {
    let evaluation = &settings.evaluation;
    lots(&evaluation.lots, settings).len() as f64 * evaluation.directions.len() as f64 * f64::from(trials)
}

fn lots(specs: &[String], settings: &Settings) -> Vec<Lot> {
    Lot::parse_all(specs, &settings.episode.vehicle).unwrap_or_default()
}

fn multiply_adds(network: &NetworkArchitecture) -> f64 {
    let NetworkArchitecture { conv1, conv2, residual1, residual2, hidden, .. } = network;
    let first = 25 * 25 * conv1.kernel.pow(2) * conv1.channels;
    let second = 12 * 12 * conv2.kernel.pow(2) * conv1.channels * conv2.channels;
    let residual = RESIDUAL_KERNEL.pow(2)
        * (12 * 12 * residual1 * conv1.channels.pow(2) + 6 * 6 * residual2 * conv2.channels.pow(2));
    let dense = 6 * 6 * conv2.channels * hidden;
    (first + second + residual + dense) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use policy::decision_rule::DecisionRule;
    use policy::fit::Budget;
    use storage::sums;

    /// The networks of an ensemble were taken for one, and a critic for none.
    #[test]
    fn a_round_takes_as_long_as_all_of_its_networks() {
        let mut settings = Settings::preset("smoke").unwrap();
        settings.dagger.final_budget = Budget::Steps(0);
        let mut training_s = |rule: &str| -> Vec<f64> {
            settings.dagger.rule = DecisionRule::named(rule).unwrap();
            let tasks = training(&settings, true);
            tasks.into_iter().filter(|(stage, _)| *stage == "training").map(|(_, seconds)| seconds).collect()
        };
        let alone = training_s("all_below");
        assert!(alone.len() > 1 && alone.iter().all(|&seconds| seconds > 0.0), "{alone:?}");
        // Three members; a critic, trained for a quarter of the time; both.
        for (rule, times) in [
            ("vanilla", 1.0),
            ("ensemble_dagger", 3.0),
            ("safe_dagger", 1.25),
            ("lazy_dagger", 1.25),
            ("thrifty_dagger", 3.25),
        ] {
            let found = training_s(rule);
            assert_eq!(found.len(), alone.len(), "a task for each round, as they are begun");
            for (seconds, alone) in found.iter().zip(&alone) {
                assert!((seconds / alone - times).abs() < 0.01, "{rule}: {seconds} s, {alone} s without");
            }
        }
    }

    /// `--resume` waited once more for every round that was done.
    #[test]
    fn what_is_done_of_a_training_is_not_waited_for_again() {
        let folder = std::env::temp_dir().join(format!("evaluation-test-{}-rest", std::process::id()));
        let mut settings = Settings::preset("smoke").unwrap();
        settings.dagger.rule = DecisionRule::named("all_below").unwrap();
        settings.dagger.iterations_max = 2;
        let whole = training(&settings, true);
        assert_eq!(rest_of_training(&settings, true, &folder), whole);
        assert!(!folder.exists(), "nothing is made");
        let is_there = |file: &str| {
            let path = folder.join(file);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, "").unwrap();
            sums::list(&folder, &[file]).unwrap();
        };
        let collected_and_trained = ["round-00/round.toml", "round-00/sha256sums", "round-01/round.toml"];
        for (done, file) in (1..).zip(collected_and_trained) {
            is_there(file);
            assert_eq!(rest_of_training(&settings, true, &folder), whole[done..], "{file}");
        }
        assert_eq!(rest_of_training(&settings, false, &folder), whole[3..], "cloning was taken over");
        // Nobody knows whether its other members are trained.
        is_there("round-01/sha256sums");
        settings.dagger.rule = DecisionRule::named("ensemble_dagger").unwrap();
        assert_eq!(rest_of_training(&settings, true, &folder), training(&settings, true)[3..]);
        std::fs::remove_dir_all(folder).unwrap();
    }
}
