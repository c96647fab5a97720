//! The one loop: drives a batch of trials in lock-step and passes every frame to an observer.
//!
//! Evaluation, tuning, replays, pictures and recordings all drive with [`TrialBatch::drive`]; training drives the same
//! episodes with a collector at the wheel ([`crate::training`]). They differ only in what the observer does.

use crate::drive_digest::DriveDigest;
use crate::drivers::{self, NamedDriver};
use crate::inputs;
use crate::lots::Lot;
use crate::manifest::Manifest;
use crate::replay_key::ReplayKey;
use crate::settings::{NoiseChoice, Settings};
use crate::trials::{self, Trial};
use anyhow::{anyhow, ensure};
use rayon::prelude::*;
use sim::batch::{NotFinite, SeatedFleet, run_fleets_until};
use sim::episode::{Episode, EpisodeReport, EpisodeSettings};
use sim::frame::Frame;
use sim::map::Map;
use sim::seed::{Rng, RootSeed};
use std::ops::ControlFlow;
use std::slice;
use std::sync::Arc;

/// Called with the index of the trial within the batch and its frame; a break ends the batch after this tick.
pub type Observer<'a> = &'a mut dyn FnMut(usize, &Frame) -> ControlFlow<()>;

/// Trials that are driven together, by one driver after another: all meet the same maps, obstacles, noise and starts.
#[derive(Debug, Clone, Copy)]
pub struct TrialBatch<'a> {
    /// Car, sensor, controller, metrics.
    pub episode: &'a EpisodeSettings,
    /// Who drives.
    pub driver: &'a NamedDriver,
    /// Where, in the order of the episodes.
    pub trials: &'a [Trial<'a>],
    /// Their maps ([`trials::maps`]).
    pub maps: &'a [Arc<Map>],
    /// Sensor noise.
    pub noise: NoiseChoice,
    /// Root seed of the trials.
    pub seed: RootSeed,
}

impl TrialBatch<'_> {
    /// A car at the start of every trial, in order.
    pub fn episodes(&self) -> Vec<Episode> {
        start(self.trials, self.maps, self.episode, self.noise)
    }

    /// Drives every trial to its end, or until the observer breaks; `None` marks trials that had not ended by then.
    ///
    /// # Errors
    /// If an answer of the driver is not finite; the error names the key to replay.
    pub fn drive(&self, observer: Observer<'_>) -> anyhow::Result<Vec<Option<EpisodeReport>>> {
        self.drive_from(self.episodes().into_iter().enumerate().collect(), observer).map_err(|found| {
            let key = self.replay_key(&self.trials[found.episode], found.tick);
            anyhow!("{key}: {} is not a finite number", found.what)
        })
    }

    /// Like [`Self::drive`], from given episodes, each with the index of its trial within the batch. The observer is
    /// called with the index of the episode.
    ///
    /// # Errors
    /// If an answer of the driver is not finite.
    pub fn drive_from(
        &self,
        episodes: Vec<(usize, Episode)>,
        observer: Observer<'_>,
    ) -> Result<Vec<Option<EpisodeReport>>, NotFinite> {
        let cars_each = self.driver.cars_per_fleet(episodes.len());
        let seat = self.driver.seating(self.episode);
        let (trials, episodes): (Vec<usize>, Vec<Episode>) = episodes.into_iter().unzip();
        let seed_of = |&car: &usize| self.trials[trials[car]].episode_seed();
        let fleets = SeatedFleet::in_all(episodes, cars_each, |cars| {
            let seeds: Vec<RootSeed> = cars.iter().map(seed_of).collect();
            seat(&seeds)
        });
        run_fleets_until(fleets, observer)
    }

    /// The key that replays a trial of the batch.
    pub fn replay_key(&self, trial: &Trial<'_>, tick: u32) -> ReplayKey {
        let (driver, lot) = (self.driver.spec.clone(), trial.lot.spec());
        let Self { noise, seed, .. } = *self;
        ReplayKey { driver, lot, direction: trial.direction, trial: trial.index, noise, seed, tick }
    }
}

/// A car at the start of every trial, in order, on maps that several drivers may share.
pub fn start(trials: &[Trial<'_>], maps: &[Arc<Map>], episode: &EpisodeSettings, noise: NoiseChoice) -> Vec<Episode> {
    let settings = |map: &Map| trials::episode_settings(episode, noise, map);
    let Some((trial, map)) = trials.iter().zip(maps).next() else { return Vec::new() };
    let first = Episode::new(Arc::new(settings(map)), Arc::clone(map), trial.episode_seed());
    let start =
        |(trial, map): (&Trial<'_>, &Arc<Map>)| first.another(&settings(map), Arc::clone(map), trial.episode_seed());
    trials.par_iter().zip(maps).map(start).collect()
}

/// The trial that a replay key names, ready to be driven again.
#[derive(Debug, Clone)]
pub struct Replay {
    /// The lot.
    pub lot: Lot,
    /// Its map, in the direction of the key.
    pub map: Arc<Map>,
    key: ReplayKey,
}

impl Replay {
    /// Draws the lot and builds the map.
    ///
    /// # Errors
    /// If the key names several lots, or one that cannot be driven.
    pub fn new(key: &ReplayKey, episode: &EpisodeSettings) -> anyhow::Result<Self> {
        let lot = Lot::parse_one(&key.lot, &episode.vehicle)?;
        let map = Arc::new(Trial::of_evaluation(key.seed, &lot, key.direction, key.trial).map(episode)?);
        Ok(Self { lot, map, key: key.clone() })
    }

    /// A drive of an evaluation with its driver: `settings` and `manifest` are those of the evaluation.
    ///
    /// # Errors
    /// If the network, the parameters or the lot have moved away or changed since: another drive would be taken for this one.
    pub fn of_run(key: &ReplayKey, settings: &Settings, manifest: &Manifest) -> anyhow::Result<(Self, NamedDriver)> {
        let replay = Self::new(key, &settings.episode)?;
        let driver = key.driver.clone().load(settings)?;
        manifest.check_some_inputs(&inputs::of(slice::from_ref(&replay.lot), slice::from_ref(&driver)))?;
        Ok((replay, driver))
    }

    /// The trial.
    pub fn trial(&self) -> Trial<'_> {
        Trial::of_evaluation(self.key.seed, &self.lot, self.key.direction, self.key.trial)
    }

    /// When the moment of its key was observed, seconds of simulated time: after an earlier near-collision a tick lasts until
    /// the car stands. Drives up to it.
    ///
    /// # Errors
    /// If the run ends before, naming the last tick; as [`TrialBatch::drive`].
    pub fn observed_at_s(&self, episode: &EpisodeSettings, driver: &NamedDriver) -> anyhow::Result<f32> {
        let (wanted, mut last, mut observed_s, mut end_s) = (self.key.tick, 0, 0.0, 0.0);
        self.drive(episode, driver, |frame| {
            (last, observed_s, end_s) = (frame.tick, end_s, frame.time_s);
            if last < wanted { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        })?;
        ensure!(last >= wanted, "{}: this run ends with tick {last}; name one up to that", self.key);
        Ok(observed_s)
    }

    /// The settings of its episode.
    pub fn episode_settings(&self, episode: &EpisodeSettings) -> EpisodeSettings {
        trials::episode_settings(episode, self.key.noise, &self.map)
    }

    /// A car at its start.
    pub fn episode(&self, episode: &EpisodeSettings) -> Episode {
        start(&[self.trial()], std::slice::from_ref(&self.map), episode, self.key.noise).remove(0)
    }

    /// The stream of the expert's label jitter in its episode.
    pub fn hand(&self) -> Rng {
        drivers::hand(self.trial().episode_seed())
    }

    /// Drives it again to its end; returns its report and its digest.
    ///
    /// # Errors
    /// See [`TrialBatch::drive`].
    pub fn again(&self, episode: &EpisodeSettings, driver: &NamedDriver) -> anyhow::Result<(EpisodeReport, String)> {
        let mut digest = DriveDigest::default();
        let report = self.drive(episode, driver, |frame| {
            digest.frame(frame);
            ControlFlow::Continue(())
        })?;
        Ok((report.expect("driven to its end"), digest.hex()))
    }

    /// Drives it again, until the observer breaks.
    ///
    /// # Errors
    /// See [`TrialBatch::drive`].
    pub fn drive(
        &self,
        episode: &EpisodeSettings,
        driver: &NamedDriver,
        mut observer: impl FnMut(&Frame) -> ControlFlow<()>,
    ) -> anyhow::Result<Option<EpisodeReport>> {
        let trials = [self.trial()];
        let maps = std::slice::from_ref(&self.map);
        let batch = TrialBatch { episode, driver, trials: &trials, maps, noise: self.key.noise, seed: self.key.seed };
        Ok(batch.drive(&mut |_, frame| observer(frame))?.remove(0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::Settings;
    use sim::frame::Event;

    /// The moment of a sixth near-collision was shown seconds before it: braking takes longer than a tick.
    #[test]
    fn a_moment_after_near_collisions_is_later_than_its_ticks_say() {
        let settings = Settings::preset("default").unwrap();
        let key = |tick: u32| format!("tentacle@lot-b@forward@0@hard@1@{tick}").parse::<ReplayKey>().unwrap();
        let driver = key(0).driver.load(&settings).unwrap();
        let mut seen = Vec::new();
        let replay = Replay::new(&key(0), &settings.episode).unwrap();
        let mut events = 0;
        let collect = |frame: &Frame| {
            seen.push((frame.tick, frame.time_s));
            events += usize::from(matches!(frame.event, Event::NearCollision { .. }));
            if events < 3 { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        };
        replay.drive(&settings.episode, &driver, collect).unwrap();
        assert_eq!(events, 3, "this lot has fewer; choose another");
        let [.., (_, before_s), (last, _)] = seen[..] else { panic!("{seen:?}") };
        let observed_at_s =
            |tick| Replay::new(&key(tick), &settings.episode)?.observed_at_s(&settings.episode, &driver);
        assert_eq!(observed_at_s(last).unwrap(), before_s);
        assert!(before_s > last as f32 * settings.episode.control_period_s() + 0.5, "{before_s} s at tick {last}");
        assert!(observed_at_s(1_000_000).unwrap_err().to_string().contains("this run ends with tick"));
    }
}
