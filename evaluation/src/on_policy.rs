//! On-policy labelled rollouts: networks drive, the expert labels every tick. Is the predicted variance right there, and
//! what does the weight on τ̂ change?

use crate::calibration::{self, AxisCalibration};
use crate::json;
use crate::names::{BC, DAGGER, UNWEIGHTED};
use crate::stages::Chain;
use crate::statistics::bootstrap::{DRAWS, Interval, Units};
use anyhow::Context as _;
use experiment::inputs;
use experiment::lots::Lot;
use experiment::progress::Progress;
use experiment::run_dir::RunDir;
use experiment::settings::Settings;
use experiment::trained;
use experiment::trials::{self, Purpose, Trial};
use experiment::{drive, drivers};
use policy::checkpoint::Checkpoint;
use policy::dagger::{Collected, Rollouts, RoundEpisode};
use policy::dataset::store::Store;
use policy::dataset::{Dataset, Sample, ValidationSplit};
use policy::decision_rule::Evidence;
use serde::{Deserialize, Serialize};
use sim::episode::Episode;
use sim::seed::{EpisodeIndex, RootSeed};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// The version of `on_policy.json` that this program writes.
pub const SCHEMA: u32 = 2;
const FILE: &str = "on_policy.json";

/// What was found; `on_policy.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OnPolicy {
    /// Version of the format: [`SCHEMA`].
    pub schema: u32,
    /// Per policy, kind of states and axis.
    pub calibration: Vec<Calibration>,
    /// Per iteration; empty where nothing is weighted.
    pub effect: Vec<Effect>,
}

/// How large errors are where the network says how large they will be.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Calibration {
    /// Name of the policy.
    pub policy: String,
    /// The kind of states.
    pub states: States,
    /// `across` or `along`.
    pub axis: String,
    /// Labels.
    pub samples: usize,
    /// Share of the labels within 1 σ and 2 σ of the mean, 0…1; .683 and .954 if errors are normal and σ is right.
    pub coverage: [f64; 2],
    /// Root mean squares of the predicted σ and of the error, metres, by tenths of the samples, the surest first.
    pub bins: Vec<[f64; 2]>,
}

/// Where errors were looked at.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum States {
    /// Samples of its data set that it was not trained on; the best weights were chosen by some of them.
    HeldBack,
    /// Those it came into by driving.
    OnPolicy,
}

/// Σ τ̂ of two policies of the same iteration, trained with and without the weight on τ̂.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Effect {
    /// The iteration.
    pub iteration: u32,
    /// Ratio on the held-back samples of both data sets so far; the validation blocks are resampled. Of the first seed.
    pub held_back: Option<Interval>,
    /// The same ratio of every seed, the first included.
    #[serde(default)]
    pub held_back_by_seed: Vec<f64>,
    /// Σ τ̂ per second while driving, with the weight and without. Of the first seed.
    pub driving_per_s: [f64; 2],
}

impl OnPolicy {
    /// Reads what a finished stage found.
    ///
    /// # Errors
    /// If its file cannot be read.
    pub fn read(folder: &Path) -> anyhow::Result<Self> {
        let path = folder.join(FILE);
        json::read_versioned(&path, SCHEMA)?.with_context(|| format!("{}: is missing", path.display()))
    }
}

/// A finished training.
struct Trained {
    store: Store,
    /// The samples that were held back, round by round.
    held_back: Vec<Vec<Sample>>,
}

impl Trained {
    fn open(folder: &Path, by: ValidationSplit) -> anyhow::Result<Self> {
        let store = Store::open(folder)?;
        let mut dataset = Dataset::default();
        let mut rounds = 0;
        while store.is_finished(&store.round_folder(rounds))? {
            dataset.push(store.read_samples(rounds)?.into());
            rounds += 1;
        }
        let held_back = dataset.split_by_round(by).into_iter().map(|split| split.validation).collect();
        Ok(Self { store, held_back })
    }

    fn iterations(&self) -> u32 {
        self.held_back.len().saturating_sub(1) as u32
    }

    /// Samples held back of the rounds from one to another, round by round.
    fn held_back(&self, from: u32, to: u32) -> &[Vec<Sample>] {
        &self.held_back[from as usize..=to as usize]
    }
}

/// A training with the weight on τ̂ and one without, from one seed.
struct Pair {
    weighted: Trained,
    /// None where the other has no weight, either.
    unweighted: Option<Trained>,
}

impl Pair {
    fn open(root: &Path, settings: &Settings, seed: RootSeed) -> anyhow::Result<Self> {
        let open = |chain: Chain| Trained::open(&root.join(chain.folder(seed)), settings.dagger.fit.validation);
        let unweighted = Chain::Unweighted.is_trained(settings).then(|| open(Chain::Unweighted)).transpose()?;
        Ok(Self { weighted: open(Chain::Weighted)?, unweighted })
    }

    /// The iterations that both have, with both.
    fn iterations(&self) -> impl Iterator<Item = Iteration<'_>> {
        let Self { weighted, unweighted } = self;
        unweighted.iter().flat_map(move |unweighted| {
            let last = weighted.iterations().min(unweighted.iterations());
            (1..=last).map(move |number| Iteration { number, both: [weighted, unweighted] })
        })
    }
}

/// An iteration of a training with the weight on τ̂ and of one without.
struct Iteration<'a> {
    number: u32,
    both: [&'a Trained; 2],
}

impl Iteration<'_> {
    /// The folder of the network of each.
    fn folders(&self) -> [PathBuf; 2] {
        self.both.map(|trained| trained.store.round_folder(self.number))
    }

    /// The held-back samples of both data sets so far, round by round.
    fn held_back(&self) -> impl Iterator<Item = &Vec<Sample>> {
        let [weighted, unweighted] = self.both;
        weighted.held_back(0, self.number).iter().chain(unweighted.held_back(1, self.number))
    }

    /// τ̂ of both policies on all of them, in their order.
    fn tau_hats(&self) -> anyhow::Result<[Vec<f64>; 2]> {
        let samples: Vec<&Sample> = self.held_back().flatten().collect();
        let [weighted, unweighted] = self.folders();
        let of = |folder: &Path| Ok::<_, anyhow::Error>(tau_hats(&Checkpoint::load(folder)?, &samples));
        Ok([of(&weighted)?, of(&unweighted)?])
    }
}

/// Drives, compares and writes; `false` if it was cancelled. The first of the seeds alone drives.
///
/// # Errors
/// If a chain is incomplete or a file cannot be read or written.
pub fn run(
    settings: &Settings,
    seeds: &[RootSeed],
    root: &Path,
    run: &RunDir,
    progress: &dyn Progress,
) -> anyhow::Result<bool> {
    let folder = |chain: Chain| root.join(chain.folder(settings.seed));
    let pair = Pair::open(root, settings, settings.seed)?;
    let Pair { weighted, unweighted } = &pair;
    let others: Vec<RootSeed> = seeds.iter().copied().filter(|&seed| seed != settings.seed).collect();
    let lots = Lot::parse_all(&settings.evaluation.lots, &settings.episode.vehicle)?;
    run.ensure_unchanged(&inputs::of(&lots, &[]))?;
    let policies = 3 + 2 * pair.iterations().count() as u32;
    let mut drives = Drives::new(settings, &lots, policies, others.len() as u32, progress);
    let mut ratios_of_others: Vec<Vec<f64>> = Vec::new();
    for seed in others {
        if !drives.begin_other(&format!("seed {}", seed.0)) {
            return Ok(false);
        }
        let other = Pair::open(root, settings, seed)?;
        let ratio = |iteration: Iteration<'_>| Ok(ratio_of_sums(&iteration.tau_hats()?));
        ratios_of_others.push(other.iterations().map(ratio).collect::<anyhow::Result<_>>()?);
    }
    let mut policies = vec![
        (BC, weighted.store.round_folder(0), weighted, 0),
        (DAGGER, trained::policy_folder(&folder(Chain::Weighted))?, weighted, weighted.iterations()),
    ];
    if let Some(unweighted) = unweighted {
        let path = trained::policy_folder(&folder(Chain::Unweighted))?;
        policies.push((UNWEIGHTED, path, unweighted, unweighted.iterations()));
    }
    let mut calibration = Vec::new();
    for (name, path, chain, rounds) in policies {
        let Some(driven) = drives.samples(&path)? else { return Ok(false) };
        let driven: Vec<&Sample> = driven.iter().collect();
        let policy = Checkpoint::load(&path)?;
        let held_back: Vec<&Sample> = chain.held_back(0, rounds).iter().flatten().collect();
        calibration.extend(calibrations(name, States::HeldBack, &policy, &held_back));
        calibration.extend(calibrations(name, States::OnPolicy, &policy, &driven));
    }
    let mut effect = Vec::new();
    for (at, iteration) in pair.iterations().enumerate() {
        let mut driving_per_s = [0.0; 2];
        for (per_s, folder) in driving_per_s.iter_mut().zip(iteration.folders()) {
            let Some(driven_per_s) = drives.tau_hat_per_s(&folder)? else { return Ok(false) };
            *per_s = driven_per_s;
        }
        let sums = iteration.tau_hats()?;
        let rounds: Vec<usize> = iteration.held_back().map(Vec::len).collect();
        let held_back = ratio(&sums, &rounds, settings.dagger.fit.validation.block, settings.evaluation.seed);
        let of_others = ratios_of_others.iter().filter_map(|ratios| ratios.get(at));
        let held_back_by_seed = std::iter::once(ratio_of_sums(&sums)).chain(of_others.copied()).collect();
        effect.push(Effect { iteration: iteration.number, held_back, held_back_by_seed, driving_per_s });
    }
    drives.end();
    run.write(FILE, json::to_text(&OnPolicy { schema: SCHEMA, calibration, effect })?.as_bytes())?;
    Ok(true)
}

/// What policies met at the wheel. Only what they saw is not kept: whoever is asked for that again drives again.
struct Drives<'a> {
    settings: &'a Settings,
    lots: &'a [Lot],
    /// Σ τ̂ per second of every policy that drove, by its folder.
    tau_hats_per_s: BTreeMap<PathBuf, f64>,
    progress: &'a dyn Progress,
    /// Policies that drive at most, and pairs of trainings that are compared without driving: they take about as long.
    at_most: u32,
    others_begun: u32,
}

impl<'a> Drives<'a> {
    fn new(settings: &'a Settings, lots: &'a [Lot], policies: u32, others: u32, progress: &'a dyn Progress) -> Self {
        progress.begin("on-policy rollouts", "on-policy rollouts");
        let tau_hats_per_s = BTreeMap::new();
        Self { settings, lots, tau_hats_per_s, progress, at_most: policies + others, others_begun: 0 }
    }

    /// Says what is done next; `false` if cancelled.
    fn says(&self, what: &str) -> bool {
        let done = self.tau_hats_per_s.len() as f64 + f64::from(self.others_begun);
        self.progress.at(done / f64::from(self.at_most), &mut |_| what.to_owned());
        !self.progress.is_cancelled()
    }

    /// Another pair of trainings is compared, without driving; `false` if cancelled.
    fn begin_other(&mut self, name: &str) -> bool {
        let goes_on = self.says(name);
        self.others_begun += 1;
        goes_on
    }

    /// What the policy in a folder saw, labelled; `None` if cancelled.
    fn samples(&mut self, folder: &Path) -> anyhow::Result<Option<Vec<Sample>>> {
        if !self.says(&folder.display().to_string()) {
            return Ok(None);
        }
        self.drive(folder).map(Some)
    }

    /// Σ τ̂ per second that the policy in a folder drove; `None` if cancelled.
    fn tau_hat_per_s(&mut self, folder: &Path) -> anyhow::Result<Option<f64>> {
        if !self.says(&folder.display().to_string()) {
            return Ok(None);
        }
        if !self.tau_hats_per_s.contains_key(folder) {
            self.drive(folder)?;
        }
        Ok(self.tau_hats_per_s.get(folder).copied())
    }

    /// Lets the policy in a folder drive: what it saw, labelled.
    fn drive(&mut self, folder: &Path) -> anyhow::Result<Vec<Sample>> {
        let Collected { round, tau_hat_sum, driven_s, .. } =
            rollout(self.settings, self.lots, &Checkpoint::load(folder)?)?;
        self.tau_hats_per_s.insert(folder.to_owned(), tau_hat_sum / driven_s.max(f64::MIN_POSITIVE));
        Ok(round.samples)
    }

    fn end(self) {
        self.progress.end(&format!("{} policies", self.tau_hats_per_s.len()));
    }
}

/// The network alone drives one trial of every lot of the evaluation, at the noise of the training (`training.noise`), whatever
/// levels the evaluation has; the expert labels every tick. All drives are held at once: see [`Settings::check_rollouts`].
fn rollout(settings: &Settings, lots: &[Lot], policy: &Checkpoint) -> anyhow::Result<Collected> {
    let evaluation = &settings.evaluation;
    let trials: Vec<Trial<'_>> =
        Trial::all(evaluation.seed, Purpose::Evaluation, lots, 1, &evaluation.directions).collect();
    let maps = trials::maps(&trials, &settings.episode)?;
    let episodes = drive::start(&trials, &maps, &settings.episode, settings.training.noise);
    let seated = |((index, trial), episode): ((EpisodeIndex, &Trial<'_>), Episode)| {
        let expert = Box::new(drivers::expert(&settings.expert, &settings.episode, trial.episode_seed()));
        RoundEpisode { index, direction: trial.direction, episode, expert }
    };
    let episodes = EpisodeIndex::of_round(0, trials.len()).zip(&trials).zip(episodes).map(seated).collect();
    Ok(Rollouts::on_policy(policy, episodes).drive(&mut |_, _| {})?)
}

/// τ̂ of a policy on samples.
fn tau_hats(policy: &Checkpoint, samples: &[&Sample]) -> Vec<f64> {
    let grids: Vec<_> = samples.iter().map(|sample| &sample.grid).collect();
    let predictions = policy.predictor().predict(&grids);
    let of = |(sample, prediction): (&&Sample, _)| f64::from(Evidence::new(prediction, sample.label).discrepancy);
    samples.iter().zip(&predictions).map(of).collect()
}

/// First sum over second.
fn ratio_of_sums([first, second]: &[Vec<f64>; 2]) -> f64 {
    first.iter().sum::<f64>() / second.iter().sum::<f64>().max(f64::MIN_POSITIVE)
}

/// First sum over second, with its interval; `None` for fewer than two blocks. Neighbouring samples look alike, so blocks
/// are resampled, both policies' together. None crosses a round; `rounds` are the lengths of the rounds.
fn ratio([first, second]: &[Vec<f64>; 2], rounds: &[usize], block: usize, seed: RootSeed) -> Option<Interval> {
    let block = block.max(1);
    let mut units = Units::new(2);
    units.begin_stratum();
    let mut begin = 0;
    for &samples in rounds {
        let of_round = begin..begin + samples;
        for (first, second) in first[of_round.clone()].chunks(block).zip(second[of_round].chunks(block)) {
            units.push(&[first.iter().sum(), second.iter().sum()]);
        }
        begin += samples;
    }
    let of_sums = |sums: &[f64], out: &mut [f64]| out[0] = sums[0] / sums[1].max(f64::MIN_POSITIVE);
    units.percentile_intervals(seed, DRAWS, 1, &of_sums).pop().filter(|interval| interval.units > 1)
}

/// Both axes of a policy on labelled states.
fn calibrations(
    name: &str,
    states: States,
    policy: &Checkpoint,
    samples: &[&Sample],
) -> impl Iterator<Item = Calibration> {
    let axes = calibration::of_policy(policy, samples);
    axes.into_iter().map(move |AxisCalibration { name: axis, samples, coverage, bins }| Calibration {
        policy: name.to_owned(),
        states,
        axis,
        samples,
        coverage,
        bins,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use policy::conditions::Conditions;
    use policy::network::{InferenceSettings, NetworkArchitecture, Weights};
    use sim::episode::EpisodeSettings;
    use sim::sensing::OccupancyGrid;

    /// A network that answers every grid with one point: all of its weights are 0 but the last biases.
    fn constant([u, w]: [f32; 2]) -> Checkpoint {
        let mut weights = Weights::zeros(NetworkArchitecture { modes: 1, ..NetworkArchitecture::compact() });
        weights.parts_mut().fc2_bias.copy_from_slice(&[u, w, -4.6, -4.6]);
        let conditions = Conditions::of(&EpisodeSettings::paper());
        Checkpoint { weights, conditions, inference: InferenceSettings::plain() }
    }

    /// Turned over, the paper's conclusion on the weight would be the opposite. Behaviour cloning, which both have, counts once.
    #[test]
    fn the_effect_is_the_error_with_the_weight_over_that_without_on_the_data_of_both() {
        let root = std::env::temp_dir().join(format!("evaluation-test-{}-effect", std::process::id()));
        let _ = std::fs::remove_dir_all(&root);
        std::fs::create_dir_all(&root).unwrap();
        let sample = Sample { grid: OccupancyGrid::free(), label: [0.5, 0.4], tau_hat: 0.0 };
        let trained = |name: &str, answer: [f32; 2], held_back: &[usize]| {
            let store = Store::open(&root.join(name)).unwrap();
            constant(answer).save(&store.round_folder(1)).unwrap();
            Trained { store, held_back: held_back.iter().map(|&count| vec![sample; count]).collect() }
        };
        // 0.1 and 0.3 off.
        let weighted = trained("weighted", [0.5, 0.5], &[2, 3]);
        let unweighted = Some(trained("unweighted", [0.5, 0.7], &[2, 4, 9]));
        let pair = Pair { weighted, unweighted };
        let iterations: Vec<Iteration<'_>> = pair.iterations().collect();
        let [iteration] = &iterations[..] else { panic!("one of the two has a second iteration") };
        assert_eq!(iteration.held_back().map(Vec::len).collect::<Vec<_>>(), [2, 3, 4]);
        let tau_hats = iteration.tau_hats().unwrap();
        assert_eq!(tau_hats.each_ref().map(Vec::len), [9, 9]);
        assert!((ratio_of_sums(&tau_hats) - 1.0 / 3.0).abs() < 1e-5, "{tau_hats:?}");
        std::fs::remove_dir_all(root).unwrap();
    }

    #[test]
    fn the_ratio_of_sums_is_resampled_in_blocks() {
        let first = vec![0.1; 40];
        let half = vec![0.2; 40];
        let interval = ratio(&[first.clone(), half], &[40], 10, RootSeed(1)).unwrap();
        for value in [interval.lower, interval.estimate, interval.upper] {
            assert!((value - 0.5).abs() < 1e-12, "{interval:?}");
        }
        // All of the second policy's error lies in one block of four: without it, the ratio is very large.
        let late: Vec<f64> = (0..40).map(|i| if i < 10 { 0.8 } else { 0.0 }).collect();
        let interval = ratio(&[first.clone(), late], &[40], 10, RootSeed(1)).unwrap();
        assert!((interval.estimate - 0.5).abs() < 1e-12 && interval.upper > 1.0, "{interval:?}");
        assert_eq!(ratio(&[first.clone(), first.clone()], &[40], 40, RootSeed(1)), None);
        assert_eq!(ratio(&[first.clone(), first], &[0, 40, 0], 40, RootSeed(1)), None);
        assert_eq!(ratio(&[vec![], vec![]], &[], 40, RootSeed(1)), None);
    }

    #[test]
    fn no_block_crosses_a_round() {
        // The first round ends within its only block; every block after it is all 0.1 or all 0.3.
        let first: Vec<f64> = (0..85).map(|i| if i < 5 || (i - 5) / 10 % 2 == 0 { 0.1 } else { 0.3 }).collect();
        let ones = vec![1.0; 85];
        let by_round = ratio(&[first.clone(), ones.clone()], &[5, 80], 10, RootSeed(1)).unwrap();
        assert_eq!(by_round.units, 9);
        // Blocks of halves of two neighbours would all be alike: 0.16…0.22.
        assert!(by_round.lower < 0.15 && by_round.upper > 0.24, "{by_round:?}");
    }
}
