//! Near-collisions one by one: where, why, and the key that replays each.
//!
//! Four rules, each on the clean map [all chosen]; the first that holds is the cause:
//!
//! | cause | rule |
//! |---|---|
//! | `noise_induced` | put into the state of [`LOOK_BACK`] (not before the last resume) and shown the clean grid, the same driver [passes](what_if::passes), and with the noise it does not |
//! | `oscillation` | [`OSCILLATION_REVERSALS`] or more steering reversals in the [`OSCILLATION_S`](crate::monitor::OSCILLATION_S) before (not before the last resume) |
//! | `narrow_passage` | within [`NEAR_M`] along the route the free width across it is less than the body and the near-collision distance on both sides |
//! | `corner` | the route turns by [`CORNER_DEG`] or more within [`NEAR_M`] of the place |
//! | `other` | none of these |
//!
//! Apart from its cause, a near-collision within [`NEAR_M`] of route after the car was put back for one is marked as one more
//! at the same place: it was put back where it had failed, and failed again.

use crate::monitor::{Incident, LOOK_BACK};
use crate::what_if;
use experiment::drive::TrialBatch;
use experiment::settings::NoiseChoice;
use experiment::trials;
use serde::{Deserialize, Serialize};
use sim::episode::EpisodeSettings;
use sim::geometry::wrap_angle;
use sim::map::Map;

/// Steering reversals that make an oscillation: the expert, on its way round corners and past parked cars, makes two.
pub const OSCILLATION_REVERSALS: u32 = 5;
/// What is near, metres along the route: the length of the car.
pub const NEAR_M: f32 = 5.0;
/// What is a corner, degrees.
pub const CORNER_DEG: f32 = 30.0;
/// Free width is measured up to here on either side, metres.
const WIDTH_MAX_M: f32 = 5.0;

/// Why a near-collision happened.
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
    /// If so, whether it would have passed as well with the noise, driven on from the same state; else `None`, and in files of
    /// earlier versions.
    #[serde(default)]
    pub passes_again: Option<bool>,
    /// Steering reversals just before.
    pub reversals_before: u32,
    /// Smallest free width across the route nearby, metres, up to 10.
    pub free_width_m: f32,
    /// Largest change of the route's heading nearby, degrees.
    pub turn_deg: f32,
    /// Route since the car was last put back on it after a near-collision, metres; `None` before the first one. In files of
    /// earlier versions also after it was stuck.
    pub since_resume_m: Option<f32>,
}

/// Whether a near-collision happened where the car had just been put back after another, so much route before: one more at
/// the same place.
pub fn is_again(since_resume_m: Option<f32>) -> bool {
    since_resume_m.is_some_and(|since_m| since_m < NEAR_M)
}

impl Findings {
    /// The first rule that holds. `noisy`: whether there was any noise to blame.
    fn cause(&self, noisy: bool, episode: &EpisodeSettings) -> Cause {
        let narrow_m = episode.vehicle.width_m + 2.0 * episode.metrics.near_collision_m;
        if noisy && self.passes_on_clean_grid == Some(true) && self.passes_again != Some(true) {
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

/// Cause and findings of every incident of a batch.
///
/// # Errors
/// If an answer of the driver on the way is not finite; the error names the key to replay.
pub fn explain(batch: &TrialBatch<'_>, incidents: &[Incident]) -> anyhow::Result<Vec<(Cause, Findings)>> {
    let is_noisy = |incident: &Incident| {
        let map = &batch.maps[incident.episode];
        trials::episode_settings(batch.episode, batch.noise, map).noise.intensity > 0.0
    };
    let noisy: Vec<Incident> = incidents.iter().copied().filter(is_noisy).collect();
    let clean = TrialBatch { noise: NoiseChoice::Clean, ..*batch };
    let passes = what_if::passes(&clean, &noisy, LOOK_BACK)?;
    let passing: Vec<Incident> =
        noisy.iter().zip(&passes).filter_map(|(&incident, &passes)| passes.then_some(incident)).collect();
    let mut again = what_if::passes(batch, &passing, LOOK_BACK)?.into_iter();
    let mut passes = passes.into_iter();
    let explain = |incident: &Incident| {
        let noisy = is_noisy(incident);
        let map = &batch.maps[incident.episode];
        let passes_on_clean_grid = if noisy { passes.next() } else { Some(false) };
        let findings = Findings {
            passes_on_clean_grid,
            passes_again: if passes_on_clean_grid == Some(true) { again.next() } else { None },
            reversals_before: incident.reversals_before,
            free_width_m: free_width_m(map, incident.route_m),
            turn_deg: turn_deg(map, incident.route_m),
            since_resume_m: incident.since_resume_m,
        };
        (findings.cause(noisy, batch.episode), findings)
    };
    Ok(incidents.iter().map(explain).collect())
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
