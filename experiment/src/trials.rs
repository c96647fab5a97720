//! Seeds of trials: which obstacles and which noise each has.
//!
//! Everything is a child of a root seed under [`Stream::Episode`], at indices that training and evaluation never share:
//!
//! | index | what |
//! |---|---|
//! | 0 · 2⁴⁰ + round · 2²⁰ + trial | training |
//! | 1 · 2⁴⁰ + trial | evaluation |
//! | 2 · 2⁴⁰ + trial | calibration of the noise (`pixel-accuracy`) |
//! | 3 · 2⁴⁰ + trial | pictures (`generate`) |
//! | 4 · 2⁴⁰ + trial | search of parameters (`tune`) |
//!
//! A trial's seed draws the obstacles of every lot. An episode's seed, which draws the noise, is a child of the trial's
//! under the lot's name and the direction. Nothing depends on the driver: all drivers meet the same trials.

use crate::lots::Lot;
use crate::settings::NoiseChoice;
use anyhow::Context as _;
use rayon::prelude::*;
use sim::episode::EpisodeSettings;
use sim::map::Map;
use sim::scenario::{Direction, Scenario};
use sim::seed::{EpisodeIndex, RootSeed, Stream};
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
    /// Searching parameters of planners.
    Tuning,
}

/// Seed of a trial.
pub fn trial_seed(root: RootSeed, purpose: Purpose, trial: u32) -> RootSeed {
    let (range, round) = match purpose {
        Purpose::Training { round } => (0_u64, round),
        Purpose::Evaluation => (1, 0),
        Purpose::Calibration => (2, 0),
        Purpose::Pictures => (3, 0),
        Purpose::Tuning => (4, 0),
    };
    root.child(Stream::Episode, range << 40 | EpisodeIndex::new(round, trial).stream())
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

/// One run to be driven: a lot, a direction, and the obstacles and noise of a trial.
#[derive(Debug, Clone, Copy)]
pub struct Trial<'a> {
    /// Where.
    pub lot: &'a Lot,
    /// Which way.
    pub direction: Direction,
    /// Which trial of this lot, from 0.
    pub index: u32,
    /// Its seed.
    pub seed: RootSeed,
}

impl<'a> Trial<'a> {
    /// Every combination: lot by lot, trial by trial, direction by direction.
    pub fn all(
        root: RootSeed,
        purpose: Purpose,
        lots: &'a [Lot],
        trials: u32,
        directions: &'a [Direction],
    ) -> impl Iterator<Item = Self> + Clone {
        lots.iter().flat_map(move |lot| {
            (0..trials).flat_map(move |trial| Self::both_ways(root, purpose, lot, trial, directions))
        })
    }

    /// One trial of a lot, direction by direction.
    pub fn both_ways(
        root: RootSeed,
        purpose: Purpose,
        lot: &'a Lot,
        trial: u32,
        directions: &'a [Direction],
    ) -> impl Iterator<Item = Self> + Clone {
        let seed = trial_seed(root, purpose, trial);
        directions.iter().map(move |&direction| Self { lot, direction, index: trial, seed })
    }

    /// Whether another trial drives through the same obstacles: they are drawn once for both.
    fn shares_obstacles_with(&self, other: &Self) -> bool {
        self.lot.name() == other.lot.name() && (self.index == other.index || !self.lot.is_drawn_per_trial())
    }

    /// A single one.
    pub fn new(root: RootSeed, purpose: Purpose, lot: &'a Lot, direction: Direction, index: u32) -> Self {
        Self { lot, direction, index, seed: trial_seed(root, purpose, index) }
    }

    /// One of an evaluation, named by its parts, as in a replay key.
    pub fn of_evaluation(root: RootSeed, lot: &'a Lot, direction: Direction, index: u32) -> Self {
        Self::new(root, Purpose::Evaluation, lot, direction, index)
    }

    /// Builds the map from its lot as drawn.
    ///
    /// # Errors
    /// If the lot cannot be driven.
    pub fn map_of(&self, drawn: Scenario, episode: &EpisodeSettings) -> anyhow::Result<Map> {
        Map::build(self.direction.of(drawn), &episode.vehicle).with_context(|| self.lot.name().to_owned())
    }

    /// Draws the lot and builds the map.
    ///
    /// # Errors
    /// If the lot cannot be driven.
    pub fn map(&self, episode: &EpisodeSettings) -> anyhow::Result<Map> {
        self.map_of(self.lot.draw(self.seed).scenario, episode)
    }

    /// Seed of the noise.
    pub fn episode_seed(&self) -> RootSeed {
        episode_seed(self.seed, self.lot.name(), self.direction)
    }
}

/// The map of every trial, in order. Neighbours that share obstacles draw them once, as a generated lot is found by a search,
/// and drive on one map each way: that of a large lot takes 100 MB.
///
/// # Errors
/// If a lot cannot be driven.
pub fn maps(trials: &[Trial<'_>], episode: &EpisodeSettings) -> anyhow::Result<Vec<Arc<Map>>> {
    let neighbours: Vec<&[Trial<'_>]> = trials.chunk_by(Trial::shares_obstacles_with).collect();
    let maps = neighbours
        .par_iter()
        .map(|trials| {
            let drawn = trials[0].lot.draw(trials[0].seed).scenario;
            let first_of = |way: Direction| trials.iter().find(|trial| trial.direction == way);
            let ways: Vec<&Trial<'_>> = Direction::BOTH.into_iter().filter_map(first_of).collect();
            let maps: Vec<Arc<Map>> = ways
                .par_iter()
                .map(|trial| Ok(Arc::new(trial.map_of(drawn.clone(), episode)?)))
                .collect::<anyhow::Result<_>>()?;
            let map_of = |trial: &Trial<'_>| {
                let way = ways.iter().position(|first| first.direction == trial.direction).expect("it is one of them");
                Arc::clone(&maps[way])
            };
            Ok(trials.iter().map(map_of).collect())
        })
        .collect::<anyhow::Result<Vec<Vec<Arc<Map>>>>>()?;
    Ok(maps.into_iter().flatten().collect())
}

/// The settings of an episode on a map. The choice multiplies `episode.noise.intensity`.
pub fn episode_settings(base: &EpisodeSettings, noise: NoiseChoice, map: &Map) -> EpisodeSettings {
    let mut episode = base.clone();
    episode.noise.intensity *= noise.intensity(map.scenario().noise.level);
    episode
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    /// Sixteen trials of a lot from a file held sixteen times its raster.
    #[test]
    fn trials_of_a_lot_share_a_map_each_way_and_drawn_ones_do_not() {
        let settings = EpisodeSettings::paper();
        let lots = Lot::parse_all(&["lot-b", "test:1:easy"], &settings.vehicle).unwrap();
        let trials: Vec<_> = Trial::all(RootSeed(1), Purpose::Evaluation, &lots, 2, &Direction::BOTH).collect();
        let maps = maps(&trials, &settings).unwrap();
        for (trial, map) in trials.iter().zip(&maps) {
            assert_eq!(map.scenario(), trial.map(&settings).unwrap().scenario());
        }
        let of = |lot: &str, way| {
            let maps = trials.iter().zip(&maps).filter(|(trial, _)| trial.lot.name() == lot && trial.direction == way);
            let maps: Vec<_> = maps.map(|(_, map)| map).collect();
            Arc::ptr_eq(maps[0], maps[1])
        };
        assert_eq!(Direction::BOTH.map(|way| of("test-easy-0", way)), [true, true]);
        assert_eq!(Direction::BOTH.map(|way| of("lot-b", way)), [false, false]);
    }

    #[test]
    fn no_two_trials_share_a_seed_even_under_one_root() {
        let root = RootSeed(1);
        let purposes = (0..9).map(|round| Purpose::Training { round });
        let purposes = purposes.chain([Purpose::Evaluation, Purpose::Calibration, Purpose::Pictures, Purpose::Tuning]);
        let trials: BTreeSet<_> =
            purposes.flat_map(|purpose| (0..100).map(move |trial| trial_seed(root, purpose, trial))).collect();
        assert_eq!(trials.len(), 1300);
        let trial = trial_seed(root, Purpose::Evaluation, 0);
        let episodes: BTreeSet<_> = ["lot-a", "lot-b", "lot-c"]
            .into_iter()
            .flat_map(|lot| Direction::BOTH.map(|direction| episode_seed(trial, lot, direction)))
            .collect();
        assert_eq!(episodes.len(), 6);
    }
}
