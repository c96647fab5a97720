//! Near-collisions one by one: where, why, and the key that replays each.
//!
//! Four rules, each on the clean map [all chosen]; the first that holds is the cause:
//!
//! | cause | rule |
//! |---|---|
//! | `noise_induced` | put into the same state up to [`LOOK_BACK_S`] earlier (not before the last resume) and shown the clean grid, the same driver gets [`PASS_M`] beyond the place without an event |
//! | `oscillation` | [`OSCILLATION_REVERSALS`] or more steering reversals in the [`OSCILLATION_S`] before (not before the last resume) |
//! | `narrow_passage` | within [`NEAR_M`] along the route the free width across it is less than the body and the near-collision distance on both sides |
//! | `corner` | the route turns by [`CORNER_DEG`] or more within [`NEAR_M`] of the place |
//! | `other` | none of these |
//!
//! Apart from its cause, a near-collision within [`NEAR_M`] of route after a resume is marked as one more at the same
//! place: the car was put back where it had failed, and failed again.

use anyhow::anyhow;
use experiment::drive::TrialBatch;
use experiment::settings::NoiseChoice;
use experiment::trials;
use serde::{Deserialize, Serialize};
use sim::episode::{Episode, EpisodeSettings};
use sim::frame::{Event, Frame};
use sim::geometry::{Pose, wrap_angle};
use sim::map::Map;
use sim::metrics::steering_reversals;
use sim::vehicle::VehicleState;
use std::collections::VecDeque;
use std::ops::ControlFlow;
use std::sync::Arc;

/// How long before the incident the driver is shown the clean grid, seconds: about the 8 m in which the place comes into
/// view.
pub const LOOK_BACK_S: f32 = 6.0;
/// How far it must get beyond the place, metres: the length of the car.
pub const PASS_M: f32 = 5.0;
/// In which time beyond the look-back, seconds.
const PASS_WITHIN_S: f32 = 10.0;
/// Steering reversals that make an oscillation: the expert, on its way round corners and past parked cars, makes two.
pub const OSCILLATION_REVERSALS: u32 = 5;
/// In the last seconds.
pub const OSCILLATION_S: f32 = 5.0;
/// What is near, metres along the route: the length of the car.
pub const NEAR_M: f32 = 5.0;
/// What is a corner, degrees.
pub const CORNER_DEG: f32 = 30.0;
/// Free width is measured up to here on either side, metres.
const WIDTH_MAX_M: f32 = 5.0;

/// Why.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Cause {
    /// On the clean grid the driver would have passed.
    NoiseInduced,
    /// The car oscillated.
    Oscillation,
    /// The passage is hardly wider than the car.
    NarrowPassage,
    /// The route turns.
    Corner,
    /// None of these.
    Other,
}

impl Cause {
    /// Every cause, the strongest first.
    pub const ALL: [Self; 5] = [Self::NoiseInduced, Self::Oscillation, Self::NarrowPassage, Self::Corner, Self::Other];

    /// Its name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::NoiseInduced => "noise-induced",
            Self::Oscillation => "oscillation",
            Self::NarrowPassage => "narrow passage",
            Self::Corner => "corner",
            Self::Other => "other",
        }
    }
}

/// What the rules found at a near-collision.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Findings {
    /// Whether the driver would have passed on the clean grid; `None` in files of earlier versions, if that was not tried.
    pub passes_on_clean_grid: Option<bool>,
    /// Steering reversals just before.
    pub reversals_before: u32,
    /// Smallest free width across the route nearby, metres, up to 10.
    pub free_width_m: f32,
    /// Largest change of the route's heading nearby, degrees.
    pub turn_deg: f32,
    /// Route since the car was last put back on it, metres; `None` before the first time.
    pub since_resume_m: Option<f32>,
}

/// Whether a near-collision happened where the car had just been put back, so much route before: one more at the same
/// place.
pub fn is_again(since_resume_m: Option<f32>) -> bool {
    since_resume_m.is_some_and(|since_m| since_m < NEAR_M)
}

impl Findings {
    /// The first rule that holds. `noisy`: whether there was any noise to blame.
    fn cause(&self, noisy: bool, episode: &EpisodeSettings) -> Cause {
        let narrow_m = episode.vehicle.width_m + 2.0 * episode.metrics.near_collision_m;
        if noisy && self.passes_on_clean_grid == Some(true) {
            Cause::NoiseInduced
        } else if self.reversals_before >= OSCILLATION_REVERSALS {
            Cause::Oscillation
        } else if self.free_width_m < narrow_m {
            Cause::NarrowPassage
        } else if self.turn_deg >= CORNER_DEG {
            Cause::Corner
        } else {
            Cause::Other
        }
    }
}

/// A near-collision when it happened.
#[derive(Debug, Clone, Copy)]
pub struct Incident {
    /// Index of the episode within its group.
    pub episode: usize,
    /// Control tick.
    pub tick: u32,
    /// Rear-axle pose when it was counted.
    pub at: Pose,
    /// Along the route, metres.
    pub route_m: f32,
    /// Speed at the last observation, m/s.
    pub speed_mps: f32,
    reversals_before: u32,
    since_resume_m: Option<f32>,
    /// State and progress from which the clean grid is tried, and how long before.
    earlier: (VehicleState, f32),
    earlier_s: f32,
}

/// Remembers the last seconds of every episode of a group; its size does not depend on how long they last.
#[derive(Debug)]
pub struct IncidentMonitor {
    control_period_s: f32,
    recent: Vec<VecDeque<(VehicleState, f32)>>,
    /// Where along the route the car was last put back, metres.
    resumed_at_m: Vec<Option<f32>>,
    incidents: Vec<Incident>,
}

impl IncidentMonitor {
    /// Over so many episodes.
    pub fn new(episodes: usize, episode: &EpisodeSettings) -> Self {
        let control_period_s = episode.control_period_s();
        let ticks = (LOOK_BACK_S / control_period_s) as usize + 1;
        Self {
            control_period_s,
            recent: vec![VecDeque::with_capacity(ticks); episodes],
            resumed_at_m: vec![None; episodes],
            incidents: Vec::new(),
        }
    }

    /// Adds one frame.
    pub fn frame(&mut self, episode: usize, frame: &Frame) {
        let recent = &mut self.recent[episode];
        if recent.is_empty() && frame.tick > 0 {
            self.resumed_at_m[episode] = Some(frame.progress_m);
        }
        if recent.len() > (LOOK_BACK_S / self.control_period_s) as usize {
            recent.pop_front();
        }
        recent.push_back((frame.vehicle, frame.progress_m));
        if let Event::NearCollision { at, progress_m } = frame.event {
            let ticks = (OSCILLATION_S / self.control_period_s) as usize;
            let last = recent.iter().skip(recent.len().saturating_sub(ticks));
            self.incidents.push(Incident {
                episode,
                tick: frame.tick,
                at,
                route_m: progress_m,
                speed_mps: frame.vehicle.speed_mps,
                reversals_before: steering_reversals(last.map(|(vehicle, _)| vehicle.steering_rad)),
                since_resume_m: self.resumed_at_m[episode].map(|resumed_at_m| progress_m - resumed_at_m),
                earlier: recent[0],
                earlier_s: recent.len() as f32 * self.control_period_s,
            });
        }
        if matches!(frame.event, Event::NearCollision { .. } | Event::Stuck { .. }) {
            recent.clear();
        }
    }

    /// The near-collisions seen, episode by episode.
    pub fn into_incidents(mut self) -> Vec<Incident> {
        self.incidents.sort_by_key(|incident| (incident.episode, incident.tick));
        self.incidents
    }
}

/// Cause and findings of every incident of a batch.
///
/// # Errors
/// Where the driver answers with what is no finite number on the way: names the key to replay.
pub fn explain(batch: &TrialBatch<'_>, incidents: &[Incident]) -> anyhow::Result<Vec<(Cause, Findings)>> {
    let is_noisy = |incident: &Incident| {
        let map = &batch.maps[incident.episode];
        trials::episode_settings(batch.episode, batch.noise, map).noise.intensity > 0.0
    };
    let noisy: Vec<Incident> = incidents.iter().copied().filter(is_noisy).collect();
    let mut passes = passes_on_clean_grid(batch, &noisy)?.into_iter();
    let explain = |incident: &Incident| {
        let noisy = is_noisy(incident);
        let map = &batch.maps[incident.episode];
        let findings = Findings {
            passes_on_clean_grid: if noisy { passes.next() } else { Some(false) },
            reversals_before: incident.reversals_before,
            free_width_m: free_width_m(map, incident.route_m),
            turn_deg: turn_deg(map, incident.route_m),
            since_resume_m: incident.since_resume_m,
        };
        (findings.cause(noisy, batch.episode), findings)
    };
    Ok(incidents.iter().map(explain).collect())
}

/// Drives on from the state before each incident on the clean grid.
fn passes_on_clean_grid(batch: &TrialBatch<'_>, incidents: &[Incident]) -> anyhow::Result<Vec<bool>> {
    // As many at a time as in the evaluation itself: memory does not depend on how often a driver fails.
    let passes = incidents.chunks(batch.trials.len()).map(|incidents| passes_at_once(batch, incidents));
    Ok(passes.collect::<anyhow::Result<Vec<_>>>()?.concat())
}

fn passes_at_once(batch: &TrialBatch<'_>, incidents: &[Incident]) -> anyhow::Result<Vec<bool>> {
    let start = |incident: &Incident| {
        let (map, trial) = (&batch.maps[incident.episode], &batch.trials[incident.episode]);
        let mut episode = trials::episode_settings(batch.episode, NoiseChoice::Clean, map);
        episode.metrics.events_max = 1;
        episode.metrics.timeout_s = incident.earlier_s + PASS_WITHIN_S;
        let (vehicle, progress_m) = incident.earlier;
        Episode::under_way(Arc::new(episode), Arc::clone(map), trial.episode_seed(), vehicle, progress_m)
    };
    let episodes: Vec<Episode> = incidents.iter().map(start).collect();
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
        anyhow!("{key}: on a clean grid from before that, {} is no finite number", found.what)
    })?;
    Ok(verdicts.into_iter().map(|verdict| verdict == Some(true)).collect())
}

/// Places along the route near a place, metres.
fn nearby(map: &Map, route_m: f32) -> impl Iterator<Item = f32> {
    let length_m = map.path().length_m();
    (-10..=10).map(move |i| (route_m + 0.1 * i as f32 * NEAR_M).clamp(0.0, length_m))
}

/// Smallest width between what lies left and right of the route.
fn free_width_m(map: &Map, route_m: f32) -> f32 {
    let width_m = |s_m: f32| {
        let pose = map.path().pose_at(s_m);
        let left = pose.ahead().perp();
        let free_m = |side: f32| {
            let steps = 0..(WIDTH_MAX_M / 0.05) as u32;
            let first = steps
                .map(|i| 0.05 * i as f32)
                .find(|&m| map.signed_distance_m(pose.position() + side * m * left) <= 0.0);
            first.unwrap_or(WIDTH_MAX_M)
        };
        free_m(1.0) + free_m(-1.0)
    };
    nearby(map, route_m).map(width_m).fold(f32::INFINITY, f32::min)
}

/// Largest difference between two headings of the route.
fn turn_deg(map: &Map, route_m: f32) -> f32 {
    let here_rad = map.path().pose_at(route_m).heading_rad;
    let turns = nearby(map, route_m).map(|s_m| wrap_angle(map.path().pose_at(s_m).heading_rad - here_rad));
    let (low, high) = turns.fold((0.0_f32, 0.0_f32), |(low, high), turn| (low.min(turn), high.max(turn)));
    (high - low).to_degrees()
}

#[cfg(test)]
mod tests;
