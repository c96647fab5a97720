//! One trial of one lot, driven by one driver or several: what is shown of an episode.

use super::evaluate;
use crate::args::{LayerArgs, OneDirection, lot_name};
use crate::output::Output;
use anyhow::Context as _;
use clap::Args;
use experiment::drivers::DriverSpec;
use experiment::lots::Lot;
use experiment::notes;
use experiment::replay_key::ReplayKey;
use experiment::settings::{Layers, NoiseChoice, Settings};
use sim::limits::TRIAL_MAX;
use sim::seed::RootSeed;

/// Which trial, by the flags of an evaluation.
#[derive(Debug, Clone, Args)]
pub(crate) struct TrialArgs {
    /// Lot to drive, a single one; see `cargo xtask lots`.
    #[arg(long = "lots", alias = "lot", value_name = "SPEC", value_parser = lot_name, default_value = "lot-a")]
    lot: String,
    /// Direction to drive in.
    #[arg(long = "directions", alias = "direction", value_name = "WAY", default_value = "forward")]
    direction: OneDirection,
    /// Number of the trial, from 0: it decides obstacles and noise.
    #[arg(
        long,
        value_name = "N",
        default_value_t = 0,
        value_parser = clap::value_parser!(u32).range(..=i64::from(TRIAL_MAX))
    )]
    pub(crate) trial: u32,
    /// Sensor noise: clean, paper, hard, lot or a multiple of paper, 0 to 10 [default: the first of evaluation.noise].
    #[arg(long, alias = "level", value_name = "LEVEL")]
    noise: Option<NoiseChoice>,
    /// Seed of obstacles and noise of the trials [default: the setting evaluation.seed].
    #[arg(long)]
    seed: Option<u64>,
}

impl TrialArgs {
    /// The names of the flags, which conflict with a drive that is named in another way.
    pub(crate) const FLAGS: [&str; 5] = ["lot", "direction", "trial", "noise", "seed"];

    /// The settings, and a key for each of the drivers; notes about the lot are said.
    ///
    /// # Errors
    /// If something named does not exist, or the name of the lot stands for several.
    pub(crate) fn keys(
        &self,
        drivers: &[DriverSpec],
        layers: &LayerArgs,
        output: &Output,
    ) -> anyhow::Result<(Settings, Lot, Vec<ReplayKey>)> {
        let (settings, _) = evaluate::settings_for(drivers, &Layers::from(layers), output)?;
        let lot = Lot::parse_one(&self.lot, &settings.episode.vehicle).context("--lots")?;
        let evaluation = &settings.evaluation;
        let noise = self.noise.unwrap_or(evaluation.noise[0]);
        output.notes(&notes::of(std::slice::from_ref(&lot), &[noise]));
        let key = |driver: &DriverSpec| ReplayKey {
            driver: driver.clone(),
            lot: lot.spec(),
            direction: self.direction.into(),
            trial: self.trial,
            noise,
            seed: self.seed.map_or(evaluation.seed, RootSeed),
            tick: 0,
        };
        let keys = drivers.iter().map(key).collect();
        Ok((settings, lot, keys))
    }
}
