//! Every setting, section by section; each section is the settings type of the crate that it belongs to.

use super::noise::{NoiseChoice, one_or_many};
use super::smoothing::Smoothing;
use expert::ExpertSettings;
use policy::dagger::DaggerSettings;
use serde::{Deserialize, Serialize};
use sim::episode::EpisodeSettings;
use sim::scenario::Direction;
use sim::seed::RootSeed;
use toml::{Table, Value};

/// Everything that decides the outcome of a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Settings {
    /// Root of every random draw of a training: its trials, initial weights, shuffling, dropout.
    pub seed: RootSeed,
    /// Where training data come from.
    pub training: TrainingSettings,
    /// The closed-loop check.
    pub evaluation: EvaluationSettings,
    /// Data sampling, network and training.
    pub dagger: DaggerSettings,
    /// The teacher.
    pub expert: ExpertSettings,
    /// Car, sensor, controller, metrics.
    pub episode: EpisodeSettings,
}

/// Where training data come from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrainingSettings {
    /// Lots driven in every round; see `cargo xtask lots`. Of generated lots (`train:8`) every round takes the next ones.
    pub lots: Vec<String>,
    /// Ways they are driven.
    pub directions: Vec<Direction>,
    /// Times every lot is driven in each direction per round (paper: once), each with its own obstacles. Generated lots
    /// are driven once: they would look the same again.
    pub trials: u32,
    /// Generated lots of a kind that differ, over all rounds; then they come again, with other noise. 0: every round has
    /// new ones.
    pub different_lots: u32,
    /// What is seen wrongly.
    pub noise: NoiseChoice,
}

/// The closed-loop check.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EvaluationSettings {
    /// Root of obstacles and noise of the trials. Not the root seed, so that several trainings can be compared on the
    /// same trials. Equal numbers do no harm: training and evaluation draw from disjoint index ranges.
    pub seed: RootSeed,
    /// Lots to drive.
    pub lots: Vec<String>,
    /// Lots unlike those that are trained on, for the check at the end of a training; may be empty.
    pub elsewhere: Vec<String>,
    /// Ways they are driven.
    pub directions: Vec<Direction>,
    /// Times every lot is driven in each direction (paper: five).
    pub trials: u32,
    /// What is seen wrongly: one level, or several to be compared.
    #[serde(deserialize_with = "one_or_many")]
    pub noise: Vec<NoiseChoice>,
    /// Action smoothing of the drivers.
    pub smoothing: Smoothing,
    /// Whether networks may drive with a controller, a sensor or a control period that they were not trained with.
    pub untrained_conditions: bool,
}

impl Settings {
    /// Root seeds of so many trainings: the settings' own, and those that follow it.
    pub fn training_seeds(&self, trainings: u64) -> Vec<RootSeed> {
        (0..trainings).map(|index| RootSeed(self.seed.0 + index)).collect()
    }

    /// As written into a run.
    pub fn to_toml(&self) -> String {
        toml::to_string(self).expect("settings are plain values")
    }

    /// Every single value with its dotted key, as in `dagger.eta`.
    pub fn leaves(&self) -> Vec<(String, Value)> {
        fn add(table: &Table, prefix: &str, found: &mut Vec<(String, Value)>) {
            for (key, value) in table {
                match value {
                    Value::Table(section) => add(section, &format!("{prefix}{key}."), found),
                    _ => found.push((format!("{prefix}{key}"), value.clone())),
                }
            }
        }
        let mut found = Vec::new();
        // As they are written: what is 0.4 of single precision is longer as a double.
        add(&self.to_toml().parse().expect("settings are plain values"), "", &mut found);
        found
    }
}
