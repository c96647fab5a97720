//! What makes settings wrong as a whole: checked before a run folder exists.

use super::reference;
use super::schema::Settings;
use anyhow::{Context as _, ensure};

impl Settings {
    /// Checks ranges, and what no single section can know.
    ///
    /// # Errors
    /// Naming the key, its value and what is possible.
    pub fn check(&self) -> anyhow::Result<()> {
        for (key, seed) in [("seed", self.seed), ("evaluation.seed", self.evaluation.seed)] {
            ensure!(
                i64::try_from(seed.0).is_ok(),
                "{key} = {}: TOML integers end at {}; choose a smaller seed",
                seed.0,
                i64::MAX
            );
        }
        reference::check(&toml::Table::try_from(self).context("settings are plain values")?, "")?;
        for (section, lots, directions) in [
            ("training", &self.training.lots, &self.training.directions),
            ("evaluation", &self.evaluation.lots, &self.evaluation.directions),
        ] {
            ensure!(!lots.is_empty(), "{section}.lots is empty; name at least one lot (cargo xtask lots)");
            ensure!(!directions.is_empty(), "{section}.directions is empty; name \"forward\", \"reverse\" or both");
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
            control.is_multiple_of(physics),
            "episode.control_period_ms = {control} is not a multiple of episode.physics_step_ms = {physics}"
        );
        let (low, high) = (self.episode.controller.speed_min_mps, self.episode.controller.speed_max_mps);
        ensure!(
            low <= high,
            "episode.controller.speed_min_mps = {low} is more than episode.controller.speed_max_mps = {high}"
        );
        self.dagger.network.validate().context("dagger.network")?;
        Ok(())
    }
}
