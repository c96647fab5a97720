//! Which obstacles and which noise a trial has.
//!
//! Everything is a child of a root seed under [`Stream::Episode`], at indices that training and evaluation never share:
//!
//! | index | what |
//! |---|---|
//! | 0 · 2⁴⁰ + round · 2²⁰ + trial | training |
//! | 1 · 2⁴⁰ + trial | evaluation |
//! | 2 · 2⁴⁰ + trial | calibration of the noise (`pixel-accuracy`) |
//! | 3 · 2⁴⁰ + trial | pictures (`generate`) |
//!
//! A trial's seed draws the obstacles of every lot. An episode's seed, which draws the noise, is a child of the trial's
//! under the lot's name and the direction. Nothing depends on the driver: all drivers meet the same trials.

use crate::lots::Lot;
use crate::settings::{NoiseChoice, Settings};
use anyhow::Context as _;
use sim::episode::{Episode, EpisodeConfig};
use sim::map::Map;
use sim::scenario::Direction;
use sim::seed::{RootSeed, Stream};
use sim::sensing::noise::NoiseConfig;
use std::sync::Arc;

/// What a trial is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Purpose {
    /// Data of a round; 0 = behaviour cloning.
    Training {
        /// The round.
        round: u32,
    },
    /// Measuring drivers.
    Evaluation,
    /// Measuring the noise.
    Calibration,
    /// Pictures and files.
    Pictures,
}

/// Seed of a trial.
pub fn trial_seed(root: RootSeed, purpose: Purpose, trial: u32) -> RootSeed {
    let (range, round) = match purpose {
        Purpose::Training { round } => (0_u64, round),
        Purpose::Evaluation => (1, 0),
        Purpose::Calibration => (2, 0),
        Purpose::Pictures => (3, 0),
    };
    assert!(trial < 1 << 20 && round < 1 << 20, "a round has fewer than 2^20 trials, a run fewer than 2^20 rounds");
    root.child(Stream::Episode, range << 40 | u64::from(round) << 20 | u64::from(trial))
}

/// Seed of one direction of a trial on a lot.
pub fn episode_seed(trial: RootSeed, lot: &str, direction: Direction) -> RootSeed {
    // FNV-1a, so that a lot's noise depends neither on what else is driven nor on the order.
    let hash = lot
        .bytes()
        .fold(0xCBF2_9CE4_8422_2325_u64, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01B3));
    let folded = (hash ^ hash >> 47) & ((1 << 47) - 1);
    trial.child(Stream::Episode, folded << 1 | u64::from(direction == Direction::Reverse))
}

/// One run to be driven.
#[derive(Debug, Clone, Copy)]
pub struct Job<'a> {
    /// Where.
    pub lot: &'a Lot,
    /// Which way.
    pub direction: Direction,
    /// Which trial of this lot.
    pub trial: u32,
    /// Its seed.
    pub seed: RootSeed,
}

impl<'a> Job<'a> {
    /// Every combination: lot by lot, trial by trial, direction by direction.
    pub fn all(
        root: RootSeed,
        purpose: Purpose,
        lots: &'a [Lot],
        trials: u32,
        directions: &'a [Direction],
    ) -> impl Iterator<Item = Self> + Clone {
        lots.iter().flat_map(move |lot| {
            (0..trials).flat_map(move |trial| {
                let seed = trial_seed(root, purpose, trial);
                directions.iter().map(move |&direction| Self { lot, direction, trial, seed })
            })
        })
    }

    /// Builds the map.
    ///
    /// # Errors
    /// If the lot cannot be driven.
    pub fn map(&self, config: &EpisodeConfig) -> anyhow::Result<Map> {
        let scenario = self.direction.of(self.lot.draw(self.seed).scenario);
        Map::build(scenario, &config.vehicle).with_context(|| self.lot.name().to_owned())
    }

    /// Seed of the noise.
    pub fn episode_seed(&self) -> RootSeed {
        episode_seed(self.seed, self.lot.name(), self.direction)
    }

    /// A car at the start.
    ///
    /// # Errors
    /// If the lot cannot be driven.
    pub fn episode(&self, settings: &Settings, noise: NoiseChoice) -> anyhow::Result<Episode> {
        let map = self.map(&settings.episode)?;
        let config = episode_config(settings, noise, &map);
        Ok(Episode::new(Arc::new(config), Arc::new(map), self.episode_seed()))
    }
}

/// The settings of an episode on a map. The level multiplies `episode.noise.intensity`.
pub fn episode_config(settings: &Settings, noise: NoiseChoice, map: &Map) -> EpisodeConfig {
    let mut config = settings.episode.clone();
    let level = noise.level(map.scenario().noise.level);
    config.noise.intensity *= NoiseConfig::of(level).intensity;
    config
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn no_two_trials_share_a_seed_even_under_one_root() {
        let root = RootSeed(1);
        let purposes = (0..9).map(|round| Purpose::Training { round });
        let purposes = purposes.chain([Purpose::Evaluation, Purpose::Calibration, Purpose::Pictures]);
        let trials: BTreeSet<_> =
            purposes.flat_map(|purpose| (0..100).map(move |trial| trial_seed(root, purpose, trial))).collect();
        assert_eq!(trials.len(), 1200);
        let trial = trial_seed(root, Purpose::Evaluation, 0);
        let episodes: BTreeSet<_> = ["lot-a", "lot-b", "lot-c"]
            .into_iter()
            .flat_map(|lot| Direction::BOTH.map(|direction| episode_seed(trial, lot, direction)))
            .collect();
        assert_eq!(episodes.len(), 6);
    }
}
