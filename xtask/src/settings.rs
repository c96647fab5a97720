//! All settings in one TOML: every section is the configuration type of the crate it configures.
//!
//! Layers, lowest priority first: preset, `--config` file, `--set`, flags. What comes out is complete and checked, and is
//! written into the folder of a run before its first step.

mod layers;
mod noise;
mod presets;
mod ranges;

use crate::cli::LayerArgs;
use anyhow::{Context as _, ensure};
use expert::ExpertSettings;
use policy::dagger::DaggerSettings;
use serde::{Deserialize, Serialize};
use sim::episode::EpisodeSettings;
use sim::scenario::Direction;
use sim::seed::RootSeed;
use std::path::Path;

pub use noise::{NOISE_MAX, NoiseChoice};
pub use presets::PRESETS;

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
    /// Ways they are driven.
    pub directions: Vec<Direction>,
    /// Times every lot is driven in each direction (paper: five).
    pub trials: u32,
    /// What is seen wrongly: one level, or several to be compared.
    #[serde(deserialize_with = "noise::one_or_many")]
    pub noise: Vec<NoiseChoice>,
}

impl Settings {
    /// Preset → file → `--set` → seed.
    ///
    /// # Errors
    /// Naming what is wrong in which layer.
    pub fn resolve(layers: &LayerArgs, seed: Option<u64>) -> anyhow::Result<Self> {
        Self::resolve_over(&Self::preset(layers.preset_name())?, layers, seed)
    }

    /// The same over other settings than a preset's, e.g. a run's own.
    ///
    /// # Errors
    /// Naming what is wrong in which layer.
    pub fn resolve_over(base: &Self, layers: &LayerArgs, seed: Option<u64>) -> anyhow::Result<Self> {
        let mut settings = layers::apply(base, layers.config.as_deref(), &layers.overrides)?;
        if let Some(seed) = seed {
            settings.seed = RootSeed(seed);
        }
        settings.check()?;
        Ok(settings)
    }

    /// A named set.
    ///
    /// # Errors
    /// If there is none of this name.
    pub fn preset(name: &str) -> anyhow::Result<Self> {
        presets::by_name(name)
    }

    /// Reads complete settings, as written into a run.
    ///
    /// # Errors
    /// If the file cannot be read or is not complete.
    pub fn read(path: &Path) -> anyhow::Result<Self> {
        let text = std::fs::read_to_string(path)
            .with_context(|| format!("{}: not a run of this program, or not finished being created", path.display()))?;
        let settings: Self = toml::from_str(&text).with_context(|| path.display().to_string())?;
        settings.check()?;
        Ok(settings)
    }

    /// As written into a run and printed by `cargo xtask settings`.
    pub fn to_toml(&self) -> String {
        toml::to_string(self).expect("settings are plain values")
    }

    /// What no single section can know.
    pub(crate) fn check(&self) -> anyhow::Result<()> {
        for (key, seed) in [("seed", self.seed), ("evaluation.seed", self.evaluation.seed)] {
            ensure!(
                i64::try_from(seed.0).is_ok(),
                "{key} = {}: TOML integers end at {}; choose a smaller seed",
                seed.0,
                i64::MAX
            );
        }
        ensure!(
            self.dagger.geometry == self.episode.sensing.geometry,
            "dagger.geometry {:?} and episode.sensing.geometry {:?} differ: the network would misread its own answers; \
             set both",
            self.dagger.geometry,
            self.episode.sensing.geometry
        );
        for (section, lots, directions, trials) in [
            ("training", &self.training.lots, &self.training.directions, self.training.trials),
            ("evaluation", &self.evaluation.lots, &self.evaluation.directions, self.evaluation.trials),
        ] {
            ensure!(!lots.is_empty(), "{section}.lots is empty; name at least one lot (cargo xtask lots)");
            ensure!(!directions.is_empty(), "{section}.directions is empty; name \"forward\", \"reverse\" or both");
            ensure!(trials > 0, "{section}.trials is 0; at least one is needed");
        }
        let noise = &self.evaluation.noise;
        ensure!(
            !noise.is_empty(),
            "evaluation.noise is empty; name at least one level (clean, paper, hard, lot, 0.5 …)"
        );
        for (i, level) in noise.iter().enumerate() {
            ensure!(
                !noise[..i].contains(level),
                "evaluation.noise names {level} twice; results are told apart by level"
            );
        }
        let (physics, control) = (self.episode.physics_step_ms, self.episode.control_period_ms);
        ensure!(
            physics > 0 && control > 0 && control.is_multiple_of(physics),
            "episode.control_period_ms = {control} is not a multiple of episode.physics_step_ms = {physics}"
        );
        ranges::check(&self.episode)?;
        ranges::check_expert(&self.expert)?;
        self.dagger.disturbance.as_ref().map_or(Ok(()), ranges::check_disturbance)?;
        self.dagger.network.validate().context("dagger.network")?;
        Ok(())
    }
}

#[cfg(test)]
mod tests;
