//! What is to be driven.

use experiment::drivers::NamedDriver;
use experiment::lots::Lot;
use experiment::settings::Settings;
use experiment::shard::Shard;
use experiment::trials::{Purpose, Trial};

/// Drivers × lots × directions × trials × noise levels.
#[derive(Debug, Clone, Copy)]
pub struct Plan<'a> {
    /// The section `evaluation` says which trials; `episode` and `training` what is driven with, and what was trained on.
    pub settings: &'a Settings,
    /// The drivers.
    pub drivers: &'a [NamedDriver],
    /// The lots.
    pub lots: &'a [Lot],
    /// The driver the others are compared with, an index of `drivers`.
    pub compare_with: usize,
    /// The share of the trials that is driven; `None`: all.
    pub shard: Option<Shard>,
}

impl<'a> Plan<'a> {
    /// Every trial that is driven, in order. Both ways of a trial are in the same shard: they share its obstacles.
    pub fn trials(&self) -> impl Iterator<Item = Trial<'a>> + Clone + use<'a> {
        let (evaluation, shard) = (&self.settings.evaluation, self.shard);
        let ways = evaluation.directions.len();
        Trial::all(evaluation.seed, Purpose::Evaluation, self.lots, evaluation.trials, &evaluation.directions)
            .enumerate()
            .filter(move |(index, _)| shard.is_none_or(|shard| shard.takes(index / ways)))
            .map(|(_, trial)| trial)
    }

    /// What can be known to go wrong before the first step.
    ///
    /// # Errors
    /// If a driver was trained for another patch of ground, or a lot from a file cannot be driven: a
    /// `scenarios::LoadError`.
    pub fn check(&self) -> anyhow::Result<()> {
        self.drivers.iter().try_for_each(|driver| driver.check(self.settings))?;
        let evaluation = &self.settings.evaluation;
        for lot in self.lots {
            for &direction in &evaluation.directions {
                lot.check_direction(direction, &self.settings.episode.vehicle)?;
            }
        }
        Ok(())
    }
}
