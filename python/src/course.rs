//! What environments drive: lots × directions × trials, by the names, settings and seeds of the command line.

use anyhow::ensure;
use experiment::lots::Lot;
use experiment::notes;
use experiment::settings::{Layers, NoiseChoice, Settings};
use experiment::trials::{self, Trial};
use pyo3::prelude::*;
use sim::collision::BodyBox;
use sim::episode::Episode;
use sim::limits::TRIAL_MAX;
use sim::map::Map;
use sim::scenario::Direction;
use sim::seed::RootSeed;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// Maps that are kept at most.
const MAPS_KEPT: usize = 512;
/// Memory of the maps that are kept, bytes: most take up to a few megabytes, that of a large lot 100 MB. One is kept whatever
/// it takes.
const KEPT_BYTES: usize = 1 << 30;

/// Where settings come from, as on the command line: preset, then file, then single changes.
#[derive(Debug, Clone, Default, FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct SettingsFrom {
    preset: Option<String>,
    config: Option<PathBuf>,
    overrides: Vec<String>,
}

impl From<SettingsFrom> for Layers {
    fn from(from: SettingsFrom) -> Self {
        Self { preset: from.preset, file: from.config, overrides: from.overrides }
    }
}

/// The directions that a name stands for.
///
/// # Errors
/// If it stands for none.
pub(crate) fn directions(name: &str) -> anyhow::Result<Vec<Direction>> {
    let named: Vec<Direction> =
        Direction::BOTH.into_iter().filter(|way| name == "both" || way.name() == name).collect();
    ensure!(!named.is_empty(), "no directions {name:?}; there are both, forward and reverse");
    Ok(named)
}

/// Noise by name.
///
/// # Errors
/// If there is none of this name.
pub(crate) fn noise(name: &str) -> anyhow::Result<NoiseChoice> {
    name.parse().map_err(anyhow::Error::msg)
}

/// Lot and direction by index; of a lot whose obstacles are drawn for every trial, also root seed and trial.
type MapKey = (usize, usize, Option<(RootSeed, u32)>);

/// Maps of episodes that come again.
#[derive(Debug, Default)]
struct KeptMaps {
    maps: BTreeMap<MapKey, Arc<Map>>,
    /// State of the generator that draws which map goes. No result depends on it.
    draws: u64,
}

impl KeptMaps {
    /// Keeps a map. Where there is no room, others go at random. Episodes take turns: if the oldest went, none would be left
    /// when it comes again. If some always stayed, they would even when their seed is driven no more.
    fn keep(&mut self, key: MapKey, map: &Arc<Map>) {
        let bytes = |map: &Arc<Map>| map.distance_field().size_bytes();
        let is_full = |maps: &BTreeMap<MapKey, Arc<Map>>| {
            maps.len() >= MAPS_KEPT || bytes(map) + maps.values().map(bytes).sum::<usize>() > KEPT_BYTES
        };
        while !self.maps.is_empty() && is_full(&self.maps) {
            // Knuth's linear congruential generator: its upper bits are as good as needed here.
            self.draws = self.draws.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let index = (self.draws >> 33) as usize % self.maps.len();
            let goes = *self.maps.keys().nth(index).expect("it is one of them");
            self.maps.remove(&goes);
        }
        self.maps.insert(key, Arc::clone(map));
    }
}

/// Episodes by number: trial by trial, lot by lot, direction by direction.
#[derive(Debug)]
pub(crate) struct Course {
    pub(crate) settings: Settings,
    /// The outline of every car.
    pub(crate) body: BodyBox,
    lots: Vec<Lot>,
    directions: Vec<Direction>,
    /// Trials of each lot and direction before they come again.
    trials: Option<u32>,
    noise: NoiseChoice,
    maps: Mutex<KeptMaps>,
    /// An episode that others share their car with.
    first: OnceLock<Episode>,
}

impl Course {
    /// Reads settings and lots.
    ///
    /// # Errors
    /// If something is not known by its name, or a lot cannot be driven in a direction.
    pub(crate) fn new(
        from: SettingsFrom,
        lots: &[String],
        way: &str,
        trials: Option<u32>,
        level: &str,
    ) -> anyhow::Result<Self> {
        let settings = Settings::resolve(&from.into(), None)?;
        let vehicle = &settings.episode.vehicle;
        let lots = Lot::parse_all(lots, vehicle)?;
        ensure!(!lots.is_empty(), "no lots are named; name at least one, as in lots=[\"lot-a\"]");
        ensure!(trials != Some(0), "trials: must be 1 or more; None never repeats one");
        let directions = directions(way)?;
        for lot in &lots {
            directions.iter().try_for_each(|&direction| lot.check_direction(direction, vehicle))?;
        }
        Ok(Self {
            body: BodyBox::new(vehicle),
            lots,
            directions,
            trials,
            noise: noise(level)?,
            maps: Mutex::default(),
            first: OnceLock::new(),
            settings,
        })
    }

    /// Notes about its lots.
    pub(crate) fn notes(&self) -> Vec<String> {
        notes::of(&self.lots, &[self.noise])
    }

    /// Number of lots.
    pub(crate) fn lot_count(&self) -> usize {
        self.lots.len()
    }

    /// Number of lots × directions: a trial of each is driven before the next trial.
    fn rows(&self) -> u64 {
        (self.lots.len() * self.directions.len()) as u64
    }

    /// The trial of an episode.
    pub(crate) fn trial(&self, seed: RootSeed, number: u64) -> Trial<'_> {
        let (lot, direction) = self.row(number);
        let all = u64::from(TRIAL_MAX) + 1; // counted from 0
        let trials = self.trials.map_or(all, u64::from).min(all);
        let index = (number / self.rows() % trials) as u32;
        Trial::of_evaluation(seed, &self.lots[lot], self.directions[direction], index)
    }

    fn row(&self, number: u64) -> (usize, usize) {
        let row = (number % self.rows()) as usize;
        (row / self.directions.len(), row % self.directions.len())
    }

    /// A car at the start of an episode.
    ///
    /// # Errors
    /// If its lot cannot be driven.
    pub(crate) fn start(&self, seed: RootSeed, number: u64) -> anyhow::Result<Episode> {
        let (trial, map) = (self.trial(seed, number), self.map(seed, number)?);
        let settings = trials::episode_settings(&self.settings.episode, self.noise, &map);
        let start = || Episode::new(Arc::new(settings.clone()), Arc::clone(&map), trial.episode_seed());
        Ok(self.first.get_or_init(start).another(&settings, Arc::clone(&map), trial.episode_seed()))
    }

    /// The map of an episode. Those that come again are kept.
    ///
    /// # Errors
    /// If its lot cannot be driven.
    pub(crate) fn map(&self, seed: RootSeed, number: u64) -> anyhow::Result<Arc<Map>> {
        let trial = self.trial(seed, number);
        let ((lot, way), drawn) = (self.row(number), trial.lot.is_drawn_per_trial());
        let key = |way: usize| (lot, way, drawn.then_some((seed, trial.index)));
        if let Some(map) = self.kept().maps.get(&key(way)) {
            return Ok(Arc::clone(map));
        }
        if drawn && self.trials.is_none() {
            return Ok(Arc::new(trial.map(&self.settings.episode)?));
        }
        // A lot that is found by a search is found once for both ways, in this thread: cars are what is shared out, and a
        // forked process has no other threads.
        let drawn = trial.lot.draw(trial.seed).scenario;
        let map_of = |&direction: &Direction| {
            let map = Trial { direction, ..trial }.map_of(drawn.clone(), &self.settings.episode)?;
            Ok(Arc::new(map))
        };
        let maps = self.directions.iter().map(map_of).collect::<anyhow::Result<Vec<Arc<Map>>>>()?;
        let mut kept = self.kept();
        for (way, map) in maps.iter().enumerate() {
            kept.keep(key(way), map);
        }
        Ok(Arc::clone(&maps[way]))
    }

    fn kept(&self) -> std::sync::MutexGuard<'_, KeptMaps> {
        self.maps.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
