//! What is to be driven.

use anyhow::ensure;
use experiment::drivers::NamedDriver;
use experiment::lots::Lot;
use experiment::settings::Settings;
use experiment::shard::Shard;
use experiment::trials::{Purpose, Trial};
use sim::limits::RUN_TEXT_BYTES_MAX;
use std::collections::BTreeSet;

/// What a driver takes in `summary.json` for each kind of lots and level of noise, bytes: 4.6 kB of two drivers on 30 lots from files
/// (measured), and long names.
const SUMMARY_BYTES: u64 = 6000;

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
    /// If a driver was trained for another patch of ground, a lot from a file cannot be driven (a `scenarios::LoadError`), or
    /// the tables would be larger than what is read again.
    pub fn check(&self) -> anyhow::Result<()> {
        self.drivers.iter().try_for_each(|driver| driver.check(self.settings))?;
        let evaluation = &self.settings.evaluation;
        for lot in self.lots {
            for &direction in &evaluation.directions {
                lot.check_direction(direction, &self.settings.episode.vehicle)?;
            }
        }
        let kinds: BTreeSet<String> = self.lots.iter().map(Lot::group).collect();
        check_tables(self.drivers.len(), kinds.len(), evaluation.noise.len())
    }
}

/// Refuses tables that could not be read again. All generated lots of a family and split are one kind, each lot from a file is
/// one of its own.
fn check_tables(drivers: usize, kinds: usize, levels: usize) -> anyhow::Result<()> {
    let rows = (drivers * levels) as u64 * (kinds as u64 + 2);
    ensure!(
        rows * SUMMARY_BYTES <= RUN_TEXT_BYTES_MAX,
        "{drivers} drivers on {kinds} kinds of lots at {levels} levels of noise: the tables would have some {} MB, and at most {} MB \
         are read again; drive fewer drivers or lots from files at once",
        rows * SUMMARY_BYTES / 1_000_000,
        RUN_TEXT_BYTES_MAX / 1_000_000
    );
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use experiment::settings::NoiseChoice;

    /// After days of driving the tables were written, and could not be read for the report.
    #[test]
    fn tables_that_could_not_be_read_again_are_refused_before_anything_is_driven() {
        let mut settings = Settings::preset("default").unwrap();
        settings.evaluation.noise = vec![NoiseChoice::Paper; 100];
        let lots = Lot::parse_all(&["test:12:all"], &settings.episode.vehicle).unwrap();
        let drivers = vec![NamedDriver::expert(&settings.expert); 31];
        let plan = Plan { settings: &settings, drivers: &drivers[..30], lots: &lots, compare_with: 0, shard: None };
        assert!(plan.check().is_ok(), "12 kinds and all together and unseen, 6 kB each, are 252 MB");
        let refused = Plan { drivers: &drivers, ..plan }.check().unwrap_err().to_string();
        assert!(refused.contains("31 drivers on 12 kinds") && refused.contains("some 260 MB"), "{refused}");
    }
}
