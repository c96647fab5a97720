//! Everything that drives while a round is collected, as it was learned in the rounds before.

use crate::checkpoint::Checkpoint;
use crate::dagger::critic;
use crate::dagger::settings::DaggerSettings;
use crate::dataset::Dataset;
use crate::dataset::store::Store;
use crate::decision_rule::{DecisionRule, Thresholds};
use crate::drivers::Novice;
use crate::files::FileError;
use crate::network::{Ensemble, Predictor};
use sim::sensing::OccupancyGrid;
use std::path::PathBuf;

/// The network, and what its decision rule needs besides.
#[derive(Debug, Clone, PartialEq)]
pub struct Learned {
    policy: Checkpoint,
    /// The ensemble's other members.
    members: Vec<Checkpoint>,
    critic: Option<Checkpoint>,
    pub(crate) thresholds: Thresholds,
}

impl Learned {
    /// A network of a rule that needs nothing else.
    pub fn alone(policy: Checkpoint) -> Self {
        Self { policy, members: Vec::new(), critic: None, thresholds: Thresholds::default() }
    }

    /// The network that drives, or the first member of an ensemble.
    pub fn policy(&self) -> &Checkpoint {
        &self.policy
    }

    /// What collected a round after behaviour cloning, read from the folder of its run.
    ///
    /// # Errors
    /// If a file is missing or not what it should be, or a network is not the one that the run has there.
    pub fn of_round(settings: &DaggerSettings, store: &Store, round: u32) -> Result<Self, FileError> {
        let before = round.saturating_sub(1);
        let policy = store.checkpoint(&store.round_folder(before))?;
        let mut d = Dataset::default();
        // What was trained on sets the thresholds of one rule.
        if matches!(settings.rule, DecisionRule::ThriftyDagger(_)) {
            for earlier in 0..=before {
                d.push(store.read_round(earlier)?.0);
            }
        }
        Self::with_parts(settings, store, before, policy, &d)
    }

    /// The network of a round, which was trained on `d`, with what was trained beside it.
    pub(crate) fn with_parts(
        settings: &DaggerSettings,
        store: &Store,
        round: u32,
        policy: Checkpoint,
        d: &Dataset,
    ) -> Result<Self, FileError> {
        let members = members_of(settings, store, round)?;
        let critic = settings.rule.critic().map(|_| store.checkpoint(&critic_folder(store, round))).transpose()?;
        let mut learned = Self { members, critic, ..Self::alone(policy) };
        if let DecisionRule::ThriftyDagger(thrifty) = settings.rule {
            learned.thresholds = learned.thresholds(thrifty.rate, d);
        }
        Ok(learned)
    }

    /// The network of a round without a critic: to train one.
    pub(crate) fn uncritical(
        settings: &DaggerSettings,
        store: &Store,
        round: u32,
        policy: Checkpoint,
    ) -> Result<Self, FileError> {
        Ok(Self { members: members_of(settings, store, round)?, ..Self::alone(policy) })
    }

    /// The thresholds, from the answers to everything that was trained on.
    fn thresholds(&self, rate: f32, d: &Dataset) -> Thresholds {
        let (ensemble, critic) = (self.ensemble(), self.critic());
        let (mut disagreement, mut risk, mut discrepancy) = (Vec::new(), Vec::new(), Vec::new());
        for round in d.rounds() {
            let grids: Vec<&OccupancyGrid> = round.samples.iter().map(|sample| &sample.grid).collect();
            let (answers, spreads) = ensemble.predict_with_disagreement(&grids);
            disagreement.extend(spreads);
            discrepancy.extend(critic::discrepancies(&round.samples, &answers));
            risk.extend(critic.iter().flat_map(|critic| critic.predict(&grids)).map(|answer| critic::alarm(&answer)));
        }
        Thresholds::new(rate, disagreement, risk, &discrepancy)
    }

    pub(crate) fn novice(&self) -> Novice {
        Novice::new(&self.policy, &self.members)
    }

    pub(crate) fn critic(&self) -> Option<Predictor> {
        self.critic.as_ref().map(Checkpoint::predictor)
    }

    /// The networks as they answer single grids, unsmoothed.
    pub(crate) fn ensemble(&self) -> Ensemble {
        let others = self.members.iter().map(Checkpoint::predictor).collect();
        Ensemble::new(self.policy.predictor(), others)
    }
}

fn members_of(settings: &DaggerSettings, store: &Store, round: u32) -> Result<Vec<Checkpoint>, FileError> {
    (1..settings.rule.members()).map(|member| store.checkpoint(&member_folder(store, round, member))).collect()
}

/// Where another member of the ensemble of a round is; the first one is in the folder of the round.
pub(crate) fn member_folder(store: &Store, round: u32, member: usize) -> PathBuf {
    store.part_folder(round, &format!("member-{member}"))
}

/// Where the critic of the network of a round is.
pub(crate) fn critic_folder(store: &Store, round: u32) -> PathBuf {
    store.part_folder(round, "critic")
}
