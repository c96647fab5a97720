//! What lots on strips share: run-outs, closed mouths, the lot as a whole.

use super::route;
use super::strip::{Mouth, Strip};
use super::things::{self, Things};
use super::walls::{Wall, yard};
use crate::corridor::{tenths, to_millimetres};
use rand::RngExt as _;
use sim::geometry::Vec2;
use sim::scenario::{LotNoise, ObstacleClass, Scenario};
use sim::seed::Rng;
use std::ops::Range;

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

/// Closes a side road at its mouth or some way behind it: by a row of cones or bollards, a barrier or a kerb.
pub(super) fn close(things: &mut Things<'_>, mouth: &Mouth, rng: &mut Rng) {
    /// The car is 1.86 m wide.
    const SPACING_M: f32 = 1.2;
    /// Left open behind what closes it, metres.
    const BEHIND_M: f32 = 3.0;
    let behind_m: f32 = if rng.random_bool(0.5) { 0.0 } else { rng.random_range(0.0..4.0) };
    let shift = mouth.outward() * behind_m.min(mouth.depth_m - BEHIND_M).max(0.0);
    let (a, b) = (to_millimetres(mouth.a + shift), to_millimetres(mouth.b + shift));
    let class = match rng.random_range(0..6) {
        0 | 1 => ObstacleClass::Cone,
        2 => ObstacleClass::Bollard,
        3 => {
            things.obstacles.extend(Wall::low(rng).straight(a, b));
            return;
        }
        _ => {
            things.obstacles.extend(Wall::kerb().straight(a, b));
            return;
        }
    };
    let count = (a.distance(b) / SPACING_M).ceil();
    for k in 0..count as usize {
        things.stand(things::obstacle(class, a.lerp(b, (k as f32 + 0.5) / count), 0.0));
    }
}

/// How high solid ground beside the way is, metres: 0 hides nothing, more hides the ground behind corners.
pub(super) fn solid_height_m(rng: &mut Rng) -> f32 {
    if rng.random_bool(0.4) { 0.0 } else { tenths(rng.random_range(1.5..4.0)) }
}

/// Puts a lot together whose way ends at a wall with free ground behind, of so many metres, or else at solid ground.
pub(super) fn enclosed(
    strip: &Strip,
    mut things: Things<'_>,
    wall: Option<Wall>,
    behind_m: Range<f32>,
    rng: &mut Rng,
) -> Scenario {
    let outline = strip.outline(0.0);
    let (boundary, boundary_height_m) = match wall {
        None => (outline, solid_height_m(rng)),
        Some(wall) => {
            things.obstacles.extend(wall.around(&outline, &[]));
            (yard(&outline, behind_m, rng), 0.0)
        }
    };
    Scenario { boundary_height_m, ..lot(strip, boundary, things) }
}

/// Puts a lot together.
pub(super) fn lot(strip: &Strip, boundary: Vec<Vec2>, things: Things<'_>) -> Scenario {
    Scenario {
        name: String::new(),
        boundary,
        boundary_height_m: 0.0,
        reference_path: route::along(strip, driven_m(strip), &things.narrowings),
        noise: LotNoise::default(),
        islands: things.islands,
        obstacles: things.obstacles,
        speed_bumps: Vec::new(),
    }
}
