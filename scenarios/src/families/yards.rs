//! Yards and squares: wide ground on which trees, fountains, benches, huts and cars stand apart, so that there is a choice of
//! ways past them; no gap leaves it open whether the car fits.

use super::strip::Strip;
use super::things::{self, Rules, Thing, Things, side};
use super::winding::Winding;
use crate::clutter::draw_car;
use rand::RngExt as _;
use sim::geometry::{Vec2, distance_to_segment_m, edges};
use sim::scenario::{ObstacleClass, Scenario};
use sim::seed::Rng;
use std::f32::consts::PI;
use std::ops::Range;

const GROUND: Winding = Winding {
    width_m: 11.0..22.0,
    first_m: 10.0..40.0,
    straight_m: 15.0..60.0,
    bend_share: 0.6,
    turn_deg: 15.0..90.0,
    radius_m: 18.0..40.0,
    solid_of_ten: 5,
};
/// No two things are so far from each other, or from the edge, metres: the car is 1.86 m wide, and anything within 0.5 m
/// of it is a near-collision.
const DOUBTFUL_M: Range<f32> = 1.4..3.0;
/// One thing is tried per so much ground, m².
const GROUND_M2: Range<f32> = 15.0..70.0;

pub(super) fn draw(layout: &mut Rng, obstacles: &mut Rng) -> Option<(Scenario, Strip)> {
    GROUND.draw(layout, obstacles, |things, strip, rng| scatter(things, strip, 0.0..strip.length_m(), rng))
}

/// Things anywhere on a stretch of one width, as many as stand clear of each other.
pub(super) fn scatter(things: &mut Things<'_>, strip: &Strip, stretch_m: Range<f32>, rng: &mut Rng) {
    let rules = Rules { gap_m: rng.random_range(3.0..4.5), apart_m: 7.0, corner_clear_m: 0.0 };
    let width_m = 2.0 * strip.half_width_m(stretch_m.start);
    let tries = (stretch_m.end - stretch_m.start) * width_m / rng.random_range(GROUND_M2);
    for _ in 0..tries as usize {
        let (s_m, side) = (rng.random_range(stretch_m.clone()), side(rng));
        let d_m = side.sign() * rng.random_range(0.0..0.5 * width_m);
        let thing = thing_at(strip.point(s_m, d_m), rng);
        let outline = thing.outline();
        let to_edge_m = outline
            .iter()
            .map(|&corner| 0.5 * width_m - side.sign() * strip.local(corner, s_m).y)
            .fold(f32::INFINITY, f32::min);
        let is_clear = things.outlines.iter().all(|other| !DOUBTFUL_M.contains(&apart_m(other, &outline)));
        if to_edge_m > 0.1 && !DOUBTFUL_M.contains(&to_edge_m) && is_clear {
            things.narrow(thing, side, s_m, &rules);
        }
    }
}

fn thing_at(at: Vec2, rng: &mut Rng) -> Thing {
    let heading_rad = rng.random_range(-PI..PI);
    let sized = |class, length_m: f32, width_m: f32, height_m: f32| {
        Thing::from(things::sized(class, at, heading_rad, [length_m, width_m, height_m]))
    };
    match rng.random_range(0..10) {
        // Trees.
        0..4 => {
            let trunk_m = rng.random_range(0.25..0.9);
            sized(ObstacleClass::Pillar, trunk_m, trunk_m, 4.0)
        }
        // A bench, a hedge, a piece of wall.
        4..6 => sized(
            ObstacleClass::Wall,
            rng.random_range(1.5..8.0),
            rng.random_range(0.3..1.4),
            rng.random_range(0.4..2.5),
        ),
        // A hut.
        6 => sized(ObstacleClass::Wall, rng.random_range(2.0..5.0), rng.random_range(2.0..4.0), 2.5),
        7 => things::obstacle(draw_car(rng), at, heading_rad).into(),
        // A fountain, a flower bed.
        _ => {
            let radius_m = rng.random_range(0.8..3.0);
            things::round_bed(at, radius_m, if rng.random_bool(0.7) { 0.15 } else { 0.8 }).into()
        }
    }
}

/// Between two outlines that do not overlap, metres.
fn apart_m(one: &[Vec2], other: &[Vec2]) -> f32 {
    let from = |points: &[Vec2], outline: &[Vec2]| {
        points
            .iter()
            .flat_map(|&point| edges(outline).map(move |(a, b)| distance_to_segment_m(point, a, b)).collect::<Vec<_>>())
            .fold(f32::INFINITY, f32::min)
    };
    from(one, other).min(from(other, one))
}
