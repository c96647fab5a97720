//! Corridors of a building: thin walls with other rooms behind them, right-angled corners, doors and niches too narrow for
//! the car, pillars, dead ends beside the way.

use super::course::{Course, first_apart, lacking_at_corner_m};
use super::parts::{RUN_OUT_M, lot, things_on};
use super::strip::{Mouth, Notch, Strip, Stub};
use super::things::{Rules, Things, side};
use super::walls::{Opening, Wall, yard};
use crate::corridor::{Side, to_millimetres};
use rand::RngExt as _;
use sim::geometry::{Vec2, edges};
use sim::scenario::{Obstacle, ObstacleClass, Scenario};
use sim::seed::Rng;
use std::ops::Range;

/// The centre line between the run-outs, metres.
const LENGTH_M: Range<f32> = 90.0..180.0;
const LEG_M: Range<f32> = 14.0..45.0;
const WIDTH_M: Range<f32> = 3.2..6.5;
/// The car is 1.86 m wide.
const DOOR_M: Range<f32> = 0.8..1.6;
const NICHE_WIDTH_M: Range<f32> = 0.8..1.7;
const NICHE_DEPTH_M: Range<f32> = 0.4..2.5;
/// A car may look into a dead end, but not go far.
const DEAD_END_M: Range<f32> = 1.5..4.5;
/// At a corner a driver might take one for the way.
const CORNER_RECESS_M: Range<f32> = 0.5..1.8;
/// Corridors that go on behind a wall with a door.
const BEHIND_DOOR_M: Range<f32> = 3.0..10.0;
/// Between doors, niches and corners, metres.
const SPACING_M: Range<f32> = 4.0..14.0;
/// Rooms around the corridor are this deep, metres.
const ROOM_M: Range<f32> = 4.0..10.0;

pub(super) fn draw(layout: &mut Rng, obstacles: &mut Rng) -> Option<(Scenario, Strip)> {
    let mut strip = first_apart(layout, 1.5, course)?;
    let doors = cut_walls(&mut strip, layout);
    let outline = strip.outline(0.0);
    let wall = if layout.random_bool(0.65) { Wall::tall(layout) } else { Wall::low(layout) };
    let boundary = yard(&outline, ROOM_M, layout);
    let mut walls = wall.around(&outline, &doors);
    walls.extend(partitions(&outline, &boundary, &wall, layout));
    for mouth in strip.stub_mouths().into_iter().filter(|mouth| mouth.depth_m >= BEHIND_DOOR_M.start) {
        walls.extend(wall_with_door(&mouth, &wall, layout));
    }
    let mut things = things_on(&strip);
    pillars(&mut things, &strip, obstacles);
    things.obstacles.extend(walls);
    Some((lot(&strip, boundary, things), strip))
}

fn course(rng: &mut Rng) -> Course {
    let mut course = Course::new(rng.random_range(WIDTH_M));
    let until_m = RUN_OUT_M + rng.random_range(LENGTH_M);
    course.straight(RUN_OUT_M + rng.random_range(LEG_M));
    while course.length_m() < until_m {
        let before_m = course.width_m();
        let after_m = if rng.random_bool(0.5) { before_m } else { rng.random_range(WIDTH_M) };
        let turn_rad = course.turn_rad(rng, 90.0..90.1, 100.0).signum() * std::f32::consts::FRAC_PI_2;
        let lacking_m = lacking_at_corner_m(before_m, after_m);
        let is_recess = rng.random_bool(0.4);
        let depth_m = rng.random_range(if is_recess { CORNER_RECESS_M } else { BEHIND_DOOR_M });
        let stub = match rng.random_range(0..10) {
            0..3 => Some(Stub::Ahead(depth_m)),
            3..6 => Some(Stub::Behind(depth_m)),
            _ => None,
        };
        course.corner(turn_rad, lacking_m * rng.random_range(1.3..1.8), stub);
        course.widen(after_m);
        course.straight(rng.random_range(LEG_M));
    }
    course.straight(RUN_OUT_M);
    course
}

/// Niches and dead ends, which become part of the strip, and doors, which are returned.
fn cut_walls(strip: &mut Strip, rng: &mut Rng) -> Vec<Opening> {
    let mut doors = Vec::new();
    let mut notches = Vec::new();
    for (from_m, to_m) in strip.straights() {
        for side in Side::BOTH {
            let mut s_m = from_m + rng.random_range(SPACING_M);
            while s_m < to_m - 4.0 {
                let (width_m, depth_m) = match rng.random_range(0..10) {
                    0..5 => {
                        let d_m = side.sign() * strip.half_width_m(s_m);
                        doors.push(Opening { centre: strip.point(s_m, d_m), width_m: rng.random_range(DOOR_M) });
                        (0.0, 0.0)
                    }
                    5..8 => (rng.random_range(NICHE_WIDTH_M), rng.random_range(NICHE_DEPTH_M)),
                    // A pilaster.
                    8 => (rng.random_range(0.4..1.0), -rng.random_range(0.1..0.3)),
                    _ => (rng.random_range(2.5..5.0), rng.random_range(DEAD_END_M)),
                };
                if depth_m != 0.0 && s_m + 0.5 * width_m < to_m - 3.0 {
                    notches.push(Notch { side, from_m: s_m - 0.5 * width_m, to_m: s_m + 0.5 * width_m, depth_m });
                }
                s_m += width_m + rng.random_range(SPACING_M);
            }
        }
    }
    strip.notches = notches;
    doors
}

/// Across a mouth.
fn wall_with_door(&Mouth { a, b, .. }: &Mouth, wall: &Wall, rng: &mut Rng) -> Vec<Obstacle> {
    let half_door_m = 0.5 * rng.random_range(DOOR_M);
    let along = (b - a).normalize();
    let door = a.lerp(b, rng.random_range(0.35..0.65));
    let mut walls = wall.straight(a, door - along * half_door_m);
    walls.extend(wall.straight(door + along * half_door_m, b));
    walls
}

/// Walls between the rooms beside the corridor, from its walls to the next wall.
fn partitions(outline: &[Vec2], boundary: &[Vec2], wall: &Wall, rng: &mut Rng) -> Vec<Obstacle> {
    /// Shorter ones are niches and cut corners.
    const EDGE_MIN_M: f32 = 6.0;
    let mut walls = Vec::new();
    for (a, b) in edges(outline).filter(|(a, b)| a.distance(*b) > EDGE_MIN_M) {
        let along = (b - a).normalize();
        let mut at_m = rng.random_range(1.0..8.0);
        while at_m < a.distance(b) - 0.5 {
            let from = a + along * at_m;
            let outward = -along.perp();
            let reach_m = edges(outline)
                .chain(edges(boundary))
                .filter_map(|(c, d)| crossing_m(from + 0.05 * outward, outward, c, d))
                .fold(f32::INFINITY, f32::min);
            if reach_m.is_finite() {
                walls.extend(wall.straight(to_millimetres(from), to_millimetres(from + outward * reach_m)));
            }
            at_m += rng.random_range(5.0..16.0);
        }
    }
    walls
}

/// How far a ray goes to a segment, metres.
fn crossing_m(from: Vec2, direction: Vec2, c: Vec2, d: Vec2) -> Option<f32> {
    let across = d - c;
    let denominator = direction.perp_dot(across);
    if denominator == 0.0 {
        return None;
    }
    let reach_m = (c - from).perp_dot(across) / denominator;
    let share = (c - from).perp_dot(direction) / denominator;
    (reach_m >= 0.0 && (0.0..=1.0).contains(&share)).then_some(reach_m)
}

/// Rows of pillars along one wall where the corridor is wide enough.
fn pillars(things: &mut Things<'_>, strip: &Strip, rng: &mut Rng) {
    let rules = Rules { gap_m: 2.9, apart_m: 12.0, corner_clear_m: 7.0 };
    for (from_m, to_m) in strip.straights() {
        let side = side(rng);
        let spacing_m = rng.random_range(3.0..8.0);
        let protrusion_m = rng.random_range(0.4..0.9);
        if rng.random_bool(0.6) {
            continue;
        }
        let mut s_m = from_m + spacing_m;
        while s_m < to_m {
            let pillar = things.beside(ObstacleClass::Pillar, side, s_m, protrusion_m, 0.0);
            things.narrow(pillar, side, s_m, &rules);
            s_m += spacing_m;
        }
    }
}
