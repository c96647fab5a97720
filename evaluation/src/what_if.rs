//! What would have happened if one thing had been different: the car is driven on from a state before a near-collision,
//! and passes the place or does not.
//!
//! What is replaced by the truth, one thing at a time ([`Substitution`]), says what a near-collision hangs on. The car
//! is put into the state that it had; commands on their way to the actuators, smoothed answers and noise that comes and
//! goes are not those of that moment, which is why [`Substitution::Nothing`] is tried as well.

use crate::monitor::{Before, Incident, LOOK_BACK, LOOK_BACKS_S};
use anyhow::anyhow;
use experiment::drive::TrialBatch;
use experiment::drivers::NamedDriver;
use experiment::settings::{NoiseChoice, Settings, Smoothing};
use experiment::trials;
use sim::episode::{Episode, EpisodeSettings};
use sim::frame::Event;
use std::ops::ControlFlow;
use std::sync::Arc;

/// How far the car must get beyond the place, metres: its own length (chosen).
pub const PASS_M: f32 = 5.0;
/// The time that it has for that beyond the look-back, seconds (chosen).
const PASS_WITHIN_S: f32 = 10.0;

/// What is replaced by the truth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Substitution {
    /// Nothing: the same driver from there on, with other draws of the noise that comes and goes; where the car had just
    /// started, the same drive.
    Nothing,
    /// The grid, by the clean one.
    CleanGrid,
    /// The dead time, by none.
    NoDeadTime,
    /// The action smoothing, by none.
    NoSmoothing,
    /// The driver, by an expert that sees no more than the clean patch.
    ExpertOfPatch,
    /// The driver, by the expert, from the n-th of [`LOOK_BACKS_S`] on; all others from [`LOOK_BACK`] on.
    Expert(usize),
}

impl Substitution {
    /// Every one, in the order of tables.
    pub fn all() -> Vec<Self> {
        let fixed = [Self::Nothing, Self::CleanGrid, Self::NoDeadTime, Self::NoSmoothing, Self::ExpertOfPatch];
        fixed.into_iter().chain((0..LOOK_BACKS_S.len()).map(Self::Expert)).collect()
    }

    /// Its name in tables.
    pub fn name(self) -> String {
        match self {
            Self::Nothing => "nothing".to_owned(),
            Self::CleanGrid => "clean grid".to_owned(),
            Self::NoDeadTime => "no dead time".to_owned(),
            Self::NoSmoothing => "no smoothing".to_owned(),
            Self::ExpertOfPatch => "expert of the patch".to_owned(),
            Self::Expert(look_back) => format!("expert, {} s", LOOK_BACKS_S[look_back]),
        }
    }

    fn look_back(self) -> usize {
        match self {
            Self::Expert(look_back) => look_back,
            Self::Nothing | Self::CleanGrid | Self::NoDeadTime | Self::NoSmoothing | Self::ExpertOfPatch => LOOK_BACK,
        }
    }
}

/// What a driver's near-collisions are tried with: everything that is put in the place of something.
#[derive(Debug, Clone)]
pub struct Substitutes {
    no_dead_time: EpisodeSettings,
    no_smoothing: NamedDriver,
    expert: NamedDriver,
    expert_of_patch: NamedDriver,
}

impl Substitutes {
    /// The substitutes for a driver, under the settings of its evaluation.
    pub fn new(driver: &NamedDriver, settings: &Settings) -> Self {
        let mut no_dead_time = settings.episode.clone();
        no_dead_time.vehicle.dead_time_s = 0.0;
        Self {
            no_dead_time,
            no_smoothing: driver.clone().smoothed(Smoothing::Ticks(0.0)),
            expert: NamedDriver::expert(&settings.expert),
            expert_of_patch: NamedDriver::expert_of_patch(&settings.expert),
        }
    }

    /// Whether each incident of a batch is passed with this replaced.
    ///
    /// # Errors
    /// See [`passes`].
    pub fn passes(
        &self,
        batch: &TrialBatch<'_>,
        incidents: &[Incident],
        replaced: Substitution,
    ) -> anyhow::Result<Vec<bool>> {
        let batch = match replaced {
            Substitution::Nothing => *batch,
            Substitution::CleanGrid => TrialBatch { noise: NoiseChoice::Clean, ..*batch },
            Substitution::NoDeadTime => TrialBatch { episode: &self.no_dead_time, ..*batch },
            Substitution::NoSmoothing => TrialBatch { driver: &self.no_smoothing, ..*batch },
            Substitution::ExpertOfPatch => {
                TrialBatch { driver: &self.expert_of_patch, noise: NoiseChoice::Clean, ..*batch }
            }
            Substitution::Expert(_) => TrialBatch { driver: &self.expert, ..*batch },
        };
        passes(&batch, incidents, replaced.look_back())
    }
}

/// Whether the driver of the batch passes the place of each incident: put into the state of the n-th of [`LOOK_BACKS_S`], it
/// gets [`PASS_M`] beyond the place without a near-collision and without getting stuck.
///
/// # Errors
/// If an answer of the driver on the way is not finite; the error names the key of the near-collision.
pub fn passes(batch: &TrialBatch<'_>, incidents: &[Incident], look_back: usize) -> anyhow::Result<Vec<bool>> {
    // As many at a time as in the evaluation itself: memory does not depend on how often a driver fails.
    let chunks = incidents.chunks(batch.trials.len().max(1));
    let at_once = chunks.map(|incidents| passes_at_once(batch, incidents, look_back));
    Ok(at_once.collect::<anyhow::Result<Vec<_>>>()?.concat())
}

fn passes_at_once(batch: &TrialBatch<'_>, incidents: &[Incident], look_back: usize) -> anyhow::Result<Vec<bool>> {
    let start = |incident: &Incident| {
        let (map, trial) = (&batch.maps[incident.episode], &batch.trials[incident.episode]);
        let before = &incident.before[look_back];
        let mut episode = trials::episode_settings(batch.episode, batch.noise, map);
        episode.metrics.events_max = 1;
        episode.metrics.timeout_s = before.before_s + PASS_WITHIN_S;
        let (episode, map, seed) = (Arc::new(episode), Arc::clone(map), trial.episode_seed());
        let Before { vehicle, progress_m, refractory_s, .. } = *before;
        (incident.episode, Episode::under_way(episode, map, seed, vehicle, progress_m, refractory_s))
    };
    let episodes: Vec<(usize, Episode)> = incidents.iter().map(start).collect();
    let mut verdicts: Vec<Option<bool>> = vec![None; episodes.len()];
    let driven = batch.drive_from(episodes, &mut |episode, frame| {
        let verdict = match frame.event {
            Event::NearCollision { .. } | Event::Stuck { .. } => Some(false),
            Event::ReachedEnd => Some(true),
            Event::Drove => (frame.progress_m > incidents[episode].route_m + PASS_M).then_some(true),
        };
        verdicts[episode] = verdicts[episode].or(verdict);
        if verdicts.iter().all(Option::is_some) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    driven.map_err(|found| {
        let incident = &incidents[found.episode];
        let key = batch.replay_key(&batch.trials[incident.episode], incident.tick);
        anyhow!("{key}: driven on from before that, {} is not a finite number", found.what)
    })?;
    Ok(verdicts.into_iter().map(|verdict| verdict == Some(true)).collect())
}

#[cfg(test)]
mod tests;
