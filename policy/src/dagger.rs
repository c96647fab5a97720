//! `DAgger` with the paper's data-sampling function: Algorithms 1 and 2, in their order and with their line numbers.

mod disturbance;
mod gated_collector;
mod record;

pub use disturbance::DisturbanceSettings;
pub use gated_collector::{Collected, GatedCollector, Keep};
pub use record::{Collection, IterationRow};

use crate::checkpoint::Checkpoint;
use crate::dataset::store::{Store, StoreError, read_toml, write_toml};
use crate::dataset::{Dataset, Round};
use crate::decision_rule::DecisionRule;
use crate::fit::{self, FitError, FitOutcome, FitProgress, FitReport, FitSettings};
use crate::network::{DeviceChoice, LookAheadNetConfig, NetworkError, Predictor, Weights};
use disturbance::Disturbance;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use sim::batch::run_lockstep;
use sim::driver::Driver;
use sim::episode::Episode;
use sim::frame::Frame;
use sim::seed::{RootSeed, Stream};
use sim::sensing::{GridGeometry, Sensor};
use std::ops::ControlFlow;
use std::path::Path;

/// Everything a run is made of, besides its seed, its episodes and its expert.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DaggerSettings {
    /// η: iterations stop when the network drives more than this share of the ticks.
    pub eta: f64,
    /// Iterations made even if η is passed earlier.
    pub iterations_min: u32,
    /// Iterations made at most.
    pub iterations_max: u32,
    /// Which labelled ticks enter the data set.
    pub keep: Keep,
    /// Further looks at every kept tick, each with noise of its own, trained on with the same label: what is noise and
    /// what is not is learned sooner than it is from driving more. At most 255: each has a stream of its own.
    #[serde(default)]
    pub noise_augmentations: u8,
    /// Nudges of the wheel in iterations (not in behaviour cloning): what follows a mistake is seen and labelled.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub disturbance: Option<DisturbanceSettings>,
    /// Where each iteration's training starts.
    pub start: StartFrom,
    /// Where the network is computed.
    pub device: DeviceChoice,
    /// The patch of ground the grids show.
    pub geometry: GridGeometry,
    /// When the network may drive.
    pub rule: DecisionRule,
    /// The network.
    pub network: LookAheadNetConfig,
    /// Training of behaviour cloning.
    pub fit_cloning: FitSettings,
    /// Training of each iteration.
    pub fit_iteration: FitSettings,
    /// An optional longer training on all data at the end.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fit_final: Option<FitSettings>,
}

/// Where an iteration's training starts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StartFrom {
    /// From new weights (authors' code).
    Scratch,
    /// From the policy that collected.
    Previous,
}

impl DaggerSettings {
    /// τ .07, χ .1, η .9, α 1.5, from scratch; eight iterations at most (methods.md 13).
    pub fn paper() -> Self {
        Self {
            eta: 0.9,
            iterations_min: 1,
            iterations_max: 8,
            keep: Keep::ExpertTicks,
            noise_augmentations: 0,
            disturbance: None,
            start: StartFrom::Scratch,
            device: DeviceChoice::Cpu,
            geometry: GridGeometry::paper(),
            rule: DecisionRule::paper(),
            network: LookAheadNetConfig::paper(),
            fit_cloning: FitSettings::paper(),
            fit_iteration: FitSettings::paper(),
            fit_final: None,
        }
    }

    /// The same on a budget of minutes: the compact network, warm starts, some ten thousand quick steps in all. Every
    /// tick is kept: the network drives most of them from the first iteration on, and the rest alone would be rare, hard
    /// ticks. Two iterations at least, because η̂ may pass η by a hair in the first; three at most, for the time. Nudges
    /// (`DisturbanceSettings::quick`) cost .05 of η̂ and show no clear gain since points lie near what is steered at: on
    /// 42 km of development lots (lot a seed 77, and validation lots) 11, 12 and 10 near-collisions with them, 14, 12 and 11
    /// without, with 26 to 42 generated lots a round and fits of 5000 to 11 000 steps.
    pub fn quick() -> Self {
        Self {
            iterations_min: 2,
            iterations_max: 3,
            keep: Keep::EveryTick,
            noise_augmentations: 2,
            start: StartFrom::Previous,
            network: LookAheadNetConfig::compact(),
            fit_cloning: FitSettings::quick(7000),
            fit_iteration: FitSettings::quick(9000),
            ..Self::paper()
        }
    }
}

/// What `run` asks of its caller.
pub struct Hooks<'a> {
    /// The episodes of a round: 0 = behaviour cloning, then the iterations.
    pub episodes: &'a mut dyn FnMut(u32) -> Vec<Episode>,
    /// A fresh expert for one episode of a round.
    pub expert: &'a mut dyn FnMut(u32, usize) -> Box<dyn Driver + Send>,
    /// Every frame while collecting: round, episode, frame.
    pub on_frame: &'a mut dyn FnMut(u32, usize, &Frame),
    /// Called often; a break ends the run at the next safe point. What was finished stays on disk.
    pub progress: &'a mut dyn FnMut(&Progress<'_>) -> ControlFlow<()>,
}

/// Where a run stands.
#[derive(Debug)]
pub enum Progress<'a> {
    /// A collection begins.
    Collecting {
        /// 0 = behaviour cloning.
        round: u32,
        /// Episodes driven in lock-step.
        episodes: usize,
    },
    /// A collection is on disk (or was found there).
    Collected {
        /// 0 = behaviour cloning.
        round: u32,
        /// What was collected.
        collection: &'a Collection,
        /// Samples in the data set now.
        dataset: usize,
    },
    /// A training step.
    Fitting {
        /// The round whose data were added last; `None` = the final training.
        round: Option<u32>,
        /// The step.
        fit: &'a FitProgress,
    },
    /// An iteration is on disk (or was found there).
    Finished {
        /// Its line of the table.
        row: &'a IterationRow,
        /// Its training.
        fit: &'a FitReport,
    },
}

/// Why a run ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Stop {
    /// η̂ > η: the network drives nearly always.
    EtaReached,
    /// The cap on iterations.
    IterationCap,
    /// The caller said so.
    Interrupted,
}

/// Result of a run.
#[derive(Debug, Clone)]
pub struct Outcome {
    /// The policy trained last; `None` if interrupted before behaviour cloning was done.
    pub policy: Option<Checkpoint>,
    /// One line per finished round, behaviour cloning first.
    pub rows: Vec<IterationRow>,
    /// Why it ended.
    pub stop: Stop,
}

/// Why a run failed.
#[derive(Debug, thiserror::Error)]
pub enum DaggerError {
    /// A file.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// A training that cannot start.
    #[error("round {round}: {source}")]
    Fit {
        /// Which round.
        round: u32,
        /// Why.
        source: FitError,
    },
    /// A shape the network cannot have.
    #[error(transparent)]
    Network(#[from] NetworkError),
}

/// Behaviour cloning, then Algorithm 1. Rounds found in `store` are read instead of made again, so that a run that was
/// interrupted continues, with the same result.
///
/// # Errors
/// If the store holds another run, or a file cannot be read or written.
pub fn run(
    settings: &DaggerSettings,
    store: &Store,
    seed: RootSeed,
    hooks: &mut Hooks<'_>,
) -> Result<Outcome, DaggerError> {
    settings.network.validate()?;
    claim(store, settings, seed)?;
    let mut run = Run { settings, store, seed, hooks, rows: Vec::new() };
    let (policy, stop) = match run.dagger() {
        Ok((policy, stop)) => (Some(policy), stop),
        Err(Halt::Interrupted(policy)) => (policy, Stop::Interrupted),
        Err(Halt::Failed(error)) => return Err(error),
    };
    let policy = policy.map(|weights| Checkpoint { weights, geometry: settings.geometry });
    Ok(Outcome { policy, rows: run.rows, stop })
}

/// One run in progress.
struct Run<'r, 'h> {
    settings: &'r DaggerSettings,
    store: &'r Store,
    seed: RootSeed,
    hooks: &'r mut Hooks<'h>,
    rows: Vec<IterationRow>,
}

/// Why the algorithm did not come to its end.
enum Halt {
    /// With the policy finished last.
    Interrupted(Option<Weights>),
    Failed(DaggerError),
}

impl<E: Into<DaggerError>> From<E> for Halt {
    fn from(error: E) -> Self {
        Self::Failed(error.into())
    }
}

impl Run<'_, '_> {
    /// Algorithm 1.
    fn dagger(&mut self) -> Result<(Weights, Stop), Halt> {
        let (d_bc, collected) = self.data_sampling_function(None, 0)?;
        let mut d = Dataset::default(); // line 3: D ← D_BC
        self.aggregate(&mut d, d_bc, 0, &collected, None)?;
        let mut policy = self.train(None, &d, 0, &collected)?; // line 2: π_net,1 ← π_BC
        let mut eta_hat = 0.0; // line 4
        let mut i = 1;
        // Line 5: while η̂ ≤ η. Unrounded: the paper's last row prints 0.90 and stops (methods.md 12, 15).
        while eta_hat <= self.settings.eta || i <= self.settings.iterations_min {
            if i > self.settings.iterations_max {
                return Ok((self.finish(policy, &d)?, Stop::IterationCap));
            }
            let (d_i, collected) = self.data_sampling_function(Some(&policy), i)?; // line 6
            eta_hat = collected.eta_hat();
            self.aggregate(&mut d, d_i, i, &collected, Some(&policy))?; // line 7
            policy = self.train(Some(policy), &d, i, &collected)?; // line 8
            i += 1; // line 9
        }
        Ok((self.finish(policy, &d)?, Stop::EtaReached)) // line 11
    }

    /// Algorithm 2 over the episodes of a round, or what an earlier run found there. Behaviour cloning (`policy` =
    /// `None`) is the same with the expert at the wheel and every tick kept.
    fn data_sampling_function(&mut self, policy: Option<&Weights>, round: u32) -> Result<(Round, Collection), Halt> {
        if self.store.has_round(round) {
            return Ok(self.store.read_round(round)?);
        }
        let episodes = (self.hooks.episodes)(round);
        self.report(&Progress::Collecting { round, episodes: episodes.len() }, policy)?;
        let control_period_s = episodes.first().map_or(0.0, |episode| episode.settings().control_period_s());
        let experts = (0..episodes.len()).map(|episode| (self.hooks.expert)(round, episode)).collect();
        let novice = policy.map(|weights| Predictor::new(weights.clone(), self.settings.device));
        let mut collector =
            GatedCollector::new(novice, experts, self.settings.rule, self.settings.keep, self.settings.geometry)
                .with_augmenting_sensors(self.augmenting_sensors(&episodes, round))
                .with_disturbances(self.disturbances(episodes.len(), round));
        let on_frame = &mut *self.hooks.on_frame;
        let reports = run_lockstep(episodes, &mut collector, &mut |episode, frame| on_frame(round, episode, frame));
        let collected = collector.into_collected();
        let collection = Collection::new(round, &collected, control_period_s, &reports);
        self.store.write_round(round, &collected.round, &collection)?;
        Ok((collected.round, collection))
    }

    /// The sensors of the further looks, for every episode.
    fn augmenting_sensors(&self, episodes: &[Episode], round: u32) -> Vec<Vec<Sensor>> {
        let (seed, looks) = (self.seed, u64::from(self.settings.noise_augmentations));
        let augmenting_sensors = |(index, episode): (usize, &Episode)| {
            // 2^20 rounds of 2^20 episodes with 2^8 looks.
            let first = (u64::from(round) << 20 | index as u64) << 8;
            (0..looks).map(|look| episode.another_sensor(seed.child(Stream::NoiseAugmentation, first + look))).collect()
        };
        episodes.par_iter().enumerate().map(augmenting_sensors).collect()
    }

    /// Nudges for every episode of an iteration; none while cloning.
    fn disturbances(&self, episodes: usize, round: u32) -> Vec<Disturbance> {
        let Some(settings) = self.settings.disturbance.filter(|_| round > 0) else { return Vec::new() };
        let rng = |episode: u64| self.seed.rng(Stream::Disturbance, u64::from(round) << 20 | episode);
        (0..episodes as u64).map(|episode| Disturbance::new(settings, rng(episode))).collect()
    }

    /// Line 7: D ← D ∪ `D_i`.
    fn aggregate(
        &mut self,
        d: &mut Dataset,
        d_i: Round,
        round: u32,
        collection: &Collection,
        policy: Option<&Weights>,
    ) -> Result<(), Halt> {
        d.push(d_i);
        self.report(&Progress::Collected { round, collection, dataset: d.len() }, policy)
    }

    /// Line 8: trains on D, or reads what an earlier run trained.
    fn train(
        &mut self,
        previous: Option<Weights>,
        d: &Dataset,
        round: u32,
        collection: &Collection,
    ) -> Result<Weights, Halt> {
        let settings = self.settings;
        let folder = self.store.round_folder(round);
        let fit = if round == 0 { &settings.fit_cloning } else { &settings.fit_iteration };
        let start = match (settings.start, &previous) {
            (StartFrom::Previous, Some(weights)) => weights.clone(),
            _ => Weights::init(settings.network, self.seed, u64::from(round)),
        };
        let trained = self.trained_in(&folder, start, d, fit, Some(round))?;
        let Some((weights, fit)) = trained else {
            return Err(Halt::Interrupted(previous));
        };
        let row = IterationRow::new(collection, d.len(), &fit);
        self.report(&Progress::Finished { row: &row, fit: &fit }, Some(&weights))?;
        self.rows.push(row);
        Ok(weights)
    }

    /// The optional longer training at the end.
    fn finish(&mut self, policy: Weights, d: &Dataset) -> Result<Weights, Halt> {
        let Some(settings) = &self.settings.fit_final else {
            return Ok(policy);
        };
        let start = match self.settings.start {
            StartFrom::Previous => policy.clone(),
            StartFrom::Scratch => Weights::init(self.settings.network, self.seed, FINAL),
        };
        let trained = self.trained_in(&self.store.final_folder(), start, d, settings, None)?;
        trained.map(|(weights, _)| weights).ok_or(Halt::Interrupted(Some(policy)))
    }

    /// Trains into a folder, unless that was done before. `None` if interrupted.
    fn trained_in(
        &mut self,
        folder: &Path,
        start: Weights,
        d: &Dataset,
        settings: &FitSettings,
        round: Option<u32>,
    ) -> Result<Option<(Weights, FitReport)>, Halt> {
        if Checkpoint::exists(folder) {
            return Ok(Some((Checkpoint::load(folder)?.weights, read_toml(&folder.join(FIT))?)));
        }
        let index = round.map_or(FINAL, u64::from);
        let seed = self.seed.child(Stream::Shuffle, index);
        let progress = &mut *self.hooks.progress;
        let mut on_step = |fit: &FitProgress| progress(&Progress::Fitting { round, fit });
        let (geometry, device) = (self.settings.geometry, self.settings.device);
        let FitOutcome { weights, report } = fit::fit(start, d, settings, geometry, device, seed, &mut on_step)
            .map_err(|source| DaggerError::Fit { round: round.unwrap_or(u32::MAX), source })?;
        if report.stopped {
            return Ok(None);
        }
        // The checkpoint comes last: where it is, the training is complete.
        std::fs::create_dir_all(folder).map_err(|error| StoreError::new(folder, error, "check that it is writable"))?;
        write_toml(&folder.join(FIT), &report)?;
        let checkpoint = Checkpoint { weights, geometry: self.settings.geometry };
        checkpoint.save(folder)?;
        Ok(Some((checkpoint.weights, report)))
    }

    fn report(&mut self, progress: &Progress<'_>, policy: Option<&Weights>) -> Result<(), Halt> {
        match (self.hooks.progress)(progress) {
            ControlFlow::Continue(()) => Ok(()),
            ControlFlow::Break(()) => Err(Halt::Interrupted(policy.cloned())),
        }
    }
}

/// Index of the final training among the seeds of the rounds.
const FINAL: u64 = 0xFFFF;
const FIT: &str = "fit.toml";
const CONFIG: &str = "dagger.toml";

/// What a folder was begun with.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Claim {
    seed: RootSeed,
    settings: DaggerSettings,
}

/// Makes sure that a folder is continued only with what it was begun with.
fn claim(store: &Store, settings: &DaggerSettings, seed: RootSeed) -> Result<(), StoreError> {
    let path = store.folder().join(CONFIG);
    let ours = Claim { seed, settings: settings.clone() };
    if !path.exists() {
        return write_toml(&path, &ours);
    }
    if read_toml::<Claim>(&path)? == ours {
        return Ok(());
    }
    Err(StoreError::new(
        &path,
        "this folder was begun with another seed or other settings",
        "choose another folder, or delete this one",
    ))
}

#[cfg(test)]
mod tests;
