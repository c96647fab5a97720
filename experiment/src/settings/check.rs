//! What makes settings wrong as a whole: checked before a run folder exists.

use super::ranges;
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
        ranges::check_disturbance(&self.dagger.disturbance)?;
        self.dagger.network.validate().context("dagger.network")?;
        self.dagger.inference.validate().context("dagger.inference")?;
        Ok(())
    }
}
