//! What lots on strips share: run-outs, closed mouths, the lot as a whole.

use super::route;
use super::strip::{Mouth, Strip};
use super::things::{self, Things};
use super::walls::Wall;
use rand::RngExt as _;
use sim::geometry::Vec2;
use sim::scenario::{LotNoise, ObstacleClass, Scenario};
use sim::seed::Rng;

/// Straight ground before the start and behind the finish, metres, so that no wall is close there.
pub(super) const RUN_OUT_M: f32 = 18.0;
/// Nothing stands in the way this close to start and finish, metres.
const END_CLEAR_M: f32 = 9.0;

/// The stretch of an axis that is driven.
pub(super) fn driven_m(strip: &Strip) -> (f32, f32) {
    (RUN_OUT_M, strip.length_m() - RUN_OUT_M)
}

/// Obstacles for the stretch of an axis on which some may stand in the way.
pub(super) fn things_on(strip: &Strip) -> Things<'_> {
    let (from_m, to_m) = driven_m(strip);
    Things::new(strip, (from_m + END_CLEAR_M, to_m - END_CLEAR_M))
}

/// Closes the mouth of a side road by a row of cones or bollards, or by a barrier.
pub(super) fn close(things: &mut Things<'_>, (a, b): Mouth, rng: &mut Rng) {
    /// The car is 1.86 m wide.
    const SPACING_M: f32 = 1.2;
    let class = match rng.random_range(0..4) {
        0 | 1 => ObstacleClass::Cone,
        2 => ObstacleClass::Bollard,
        _ => {
            things.obstacles.extend(Wall::low(rng).straight(a, b));
            return;
        }
    };
    let count = (a.distance(b) / SPACING_M).ceil();
    for k in 0..count as usize {
        things.stand(things::obstacle(class, a.lerp(b, (k as f32 + 0.5) / count), 0.0));
    }
}

/// Puts a lot together.
pub(super) fn lot(strip: &Strip, boundary: Vec<Vec2>, things: Things<'_>) -> Scenario {
    Scenario {
        name: String::new(),
        boundary,
        boundary_height_m: 0.0,
        reference_path: route::along(strip, driven_m(strip), &things.narrowings),
        noise: LotNoise::default(),
        islands: Vec::new(),
        obstacles: things.obstacles,
        speed_bumps: Vec::new(),
    }
}
