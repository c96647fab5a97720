//! Settings of a run.

use crate::dagger::critic;
use crate::dagger::disturbance::DisturbanceSettings;
use crate::dagger::gated_collector::Keep;
use crate::decision_rule::DecisionRule;
use crate::fit::{Budget, DeviceChoice, FitSettings};
use crate::network::{InferenceSettings, NetworkArchitecture};
use crate::string_or_table::string_or_table;
use serde::{Deserialize, Serialize};

/// Everything a run depends on besides its seed, its episodes and their experts.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DaggerSettings {
    /// η: iterations stop when the network drives more than this share of the ticks.
    pub eta: f64,
    /// Iterations made even if η is passed earlier; never more than `iterations_max`.
    pub iterations_min: u32,
    /// Iterations made at most.
    pub iterations_max: u32,
    /// Which labelled ticks enter the data set.
    pub keep: Keep,
    /// Noise augmentations of every kept tick, 0 to 255: the same scene with other draws of the sensor noise, trained on
    /// with the same label. Cheaper than driving more, and teaches what is noise.
    pub noise_augmentations: u8,
    /// Samples of a round that are learned from, spread evenly over those that are kept; 0 = all. Makes rules compare at
    /// equal samples.
    #[serde(default)]
    pub samples_per_round: u32,
    /// Where each iteration's training starts.
    pub start: StartFrom,
    /// Where the network is trained; it drives on CPUs.
    pub device: DeviceChoice,
    /// When the network may drive.
    #[serde(deserialize_with = "string_or_table")]
    pub rule: DecisionRule,
    /// The network.
    pub network: NetworkArchitecture,
    /// How the network drives, while collecting and later.
    pub inference: InferenceSettings,
    /// Disturbance injection in iterations, not in behaviour cloning: what follows a mistake is seen and labelled.
    pub disturbance: DisturbanceSettings,
    /// How each network is trained. Its budget is that of an iteration.
    pub fit: FitSettings,
    /// How long behaviour cloning is trained.
    pub cloning_budget: Budget,
    /// How long a last network is trained on all data at the end; 0 steps = the last iteration's network is the result.
    pub final_budget: Budget,
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
    /// τ .07, χ .1, η .9, α 1.5, from scratch; eight iterations at most (docs/methods.md 13).
    pub fn paper() -> Self {
        Self {
            eta: 0.9,
            iterations_min: 1,
            iterations_max: 8,
            keep: Keep::ExpertTicks,
            noise_augmentations: 0,
            samples_per_round: 0,
            start: StartFrom::Scratch,
            device: DeviceChoice::Cpu,
            rule: DecisionRule::paper(),
            network: NetworkArchitecture::paper(),
            inference: InferenceSettings::plain(),
            disturbance: DisturbanceSettings::off(),
            fit: FitSettings::paper(),
            cloning_budget: FitSettings::paper().budget,
            final_budget: Budget::Steps(0),
        }
    }

    /// The same on a budget of minutes: the compact network, warm starts, 25 000 to 34 000 quick steps in all.
    ///
    /// At least two iterations, because η̂ may pass η narrowly in the first; at most three, for
    /// the time. Disturbances are aimed at danger (docs/notebook/earlier.md, "Aimed disturbances").
    pub fn quick() -> Self {
        Self {
            iterations_min: 2,
            iterations_max: 3,
            start: StartFrom::Previous,
            network: NetworkArchitecture::compact(),
            inference: InferenceSettings::smoothed(),
            disturbance: DisturbanceSettings::aimed(),
            fit: FitSettings::quick(9000),
            cloning_budget: Budget::Steps(7000),
            ..Self::paper()
        }
    }

    /// How round `round` is trained: behaviour cloning is round 0.
    pub(crate) fn fit_of_round(&self, round: u32) -> FitSettings {
        let budget = if round == 0 { self.cloning_budget } else { self.fit.budget };
        FitSettings { budget, ..self.fit.clone() }
    }

    /// How every network of a round is trained: the one that drives alone or first, an ensemble's other members, then a critic.
    pub fn fits_of_round(&self, round: u32) -> Vec<FitSettings> {
        let fit = self.fit_of_round(round);
        let critic = self.rule.critic().map(|_| critic::fit_settings(&fit));
        let mut fits = vec![fit; self.rule.members()];
        fits.extend(critic);
        fits
    }

    /// How the last network is trained; `None` if the last iteration's is the result.
    pub fn final_fit(&self) -> Option<FitSettings> {
        let budget = self.final_budget;
        budget.is_positive().then(|| FitSettings { budget, ..self.fit.clone() })
    }
}
