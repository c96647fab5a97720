//! Lanes of one width all along: bends that are not widened, S-curves, chicanes, offset gaps beside double-parked cars.

use super::course::{Course, first_apart};
use super::parts::{RUN_OUT_M, enclosed, things_on};
use super::strip::Strip;
use super::things::{Rules, Things, facing_rad, side};
use super::walls::Wall;
use crate::clutter::yaw_rad;
use rand::RngExt as _;
use sim::maths;
use sim::scenario::{ObstacleClass, Scenario};
use sim::seed::Rng;
use std::ops::Range;

/// Half of all lanes are as narrow as this, metres.
const NARROW_M: Range<f32> = 2.8..3.8;
/// Widths of most others, metres.
const WIDE_M: Range<f32> = 3.8..8.0;
/// Radii of the centre line, metres.
const RADIUS_M: Range<f32> = 8.0..30.0;
/// The centre line between the run-outs, metres.
const LENGTH_M: Range<f32> = 85.0..190.0;
/// Free beside double-parked cars, metres.
const GAP_M: Range<f32> = 2.7..2.9;
/// Ground is free so far behind a wall, metres.
const BEHIND_WALL_M: Range<f32> = 2.0..8.0;

/// What stands in the lane.
#[derive(Clone, Copy, PartialEq)]
enum Obstruction {
    Nothing,
    Small,
    DoubleParked,
}

pub(super) fn draw(layout: &mut Rng, obstacles: &mut Rng) -> Option<(Scenario, Strip)> {
    let obstruction = match obstacles.random_range(0..100) {
        0..50 => Obstruction::Nothing,
        50..75 => Obstruction::Small,
        _ => Obstruction::DoubleParked,
    };
    let gap_m = obstacles.random_range(GAP_M);
    let width_m = match obstruction {
        // The car takes the rest.
        Obstruction::DoubleParked => gap_m + layout.random_range(1.9..2.3),
        _ if layout.random_bool(0.67) => layout.random_range(NARROW_M),
        _ => layout.random_range(WIDE_M),
    };
    let strip = first_apart(layout, 1.0, |rng| course(width_m, rng))?;
    let mut things = things_on(&strip);
    match obstruction {
        Obstruction::Nothing => {}
        Obstruction::Small => small_things(&mut things, strip.length_m(), width_m, obstacles),
        Obstruction::DoubleParked => double_parked(&mut things, strip.length_m(), width_m, gap_m, obstacles),
    }
    let wall = match layout.random_range(0..100) {
        0..50 => None,
        50..70 => Some(Wall::tall(layout)),
        70..90 => Some(Wall::low(layout)),
        _ => Some(Wall::kerb()),
    };
    let lot = enclosed(&strip, things, wall, BEHIND_WALL_M, layout);
    Some((lot, strip))
}

fn course(width_m: f32, rng: &mut Rng) -> Course {
    let mut course = Course::new(width_m);
    let tightest_m = tightest_radius_m(width_m);
    let until_m = RUN_OUT_M + rng.random_range(LENGTH_M);
    course.straight(RUN_OUT_M + rng.random_range(0.0..10.0));
    while course.length_m() < until_m {
        // Tight ones more often than gentle ones.
        let share: f32 = rng.random();
        let radius_m = tightest_m + share * share * (RADIUS_M.end - tightest_m);
        match rng.random_range(0..10) {
            // A bend.
            0..6 => {
                let turn_rad = course.turn_rad(rng, 25.0..180.0, LIMIT_DEG);
                course.bend(radius_m, turn_rad);
            }
            // An S.
            6..8 => {
                let turn_rad = course.turn_rad(rng, 30.0..100.0, LIMIT_DEG);
                course.bend(radius_m, turn_rad);
                if rng.random_bool(0.5) {
                    course.straight(rng.random_range(2.0..8.0));
                }
                course.bend(radius_m, -turn_rad);
            }
            // A chicane: aside and back.
            _ => {
                let turn_rad = course.turn_rad(rng, 12.0..30.0, LIMIT_DEG);
                course.bend(radius_m, turn_rad);
                course.bend(radius_m, -turn_rad);
                course.straight(rng.random_range(4.0..10.0));
                course.bend(radius_m, -turn_rad);
                course.bend(radius_m, turn_rad);
            }
        }
        course.straight(rng.random_range(3.0..22.0));
    }
    course.straight(RUN_OUT_M);
    course
}

/// The course may turn back, but not round.
const LIMIT_DEG: f32 = 170.0;

/// The tightest bend, of the centre line, that the car goes round in a lane of a width, metres.
///
/// Round a bend the inner flank of the rear axle and the outer corner of the nose are the limits.
fn tightest_radius_m(width_m: f32) -> f32 {
    /// Half of the car's width, metres.
    const HALF_M: f32 = 0.93;
    /// Distance from the rear axle to the nose, metres.
    const NOSE_M: f32 = 3.8;
    /// Left free on both sides, also for steering in and out, metres.
    const CLEAR_M: f32 = 0.25;
    let fits = |radius_m: f32| {
        let axle_m = radius_m - 0.5 * width_m + CLEAR_M + HALF_M;
        maths::hypot(axle_m + HALF_M, NOSE_M) + CLEAR_M <= radius_m + 0.5 * width_m && axle_m > 5.0
    };
    let mut radius_m = RADIUS_M.start;
    while !fits(radius_m) && radius_m < RADIUS_M.end {
        radius_m += 0.25;
    }
    radius_m
}

/// Cones, bollards and posts at the edges.
fn small_things(things: &mut Things<'_>, length_m: f32, width_m: f32, rng: &mut Rng) {
    let rules = Rules { gap_m: 2.7_f32.min(width_m - 0.05), apart_m: 10.0, corner_clear_m: 0.0 };
    let mut s_m = RUN_OUT_M;
    while s_m < length_m {
        s_m += rng.random_range(8.0..30.0);
        let class = [ObstacleClass::Cone, ObstacleClass::Bollard, ObstacleClass::Pillar][rng.random_range(0..3)];
        let side = side(rng);
        let protrusion_m = rng.random_range(0.05_f32..0.5).min(width_m - rules.gap_m);
        let thing = things.beside(class, side, s_m.min(length_m), protrusion_m, 0.0);
        things.narrow(thing, side, s_m.min(length_m), &rules);
    }
}

/// Cars on alternating sides, one behind the other only now and then.
fn double_parked(things: &mut Things<'_>, length_m: f32, width_m: f32, gap_m: f32, rng: &mut Rng) {
    let rules = Rules { gap_m, apart_m: 8.0, corner_clear_m: 0.0 };
    let mut s_m = RUN_OUT_M + rng.random_range(8.0..20.0);
    let mut side = side(rng);
    while s_m < length_m {
        let class = [ObstacleClass::Sedan, ObstacleClass::Suv, ObstacleClass::Compact][rng.random_range(0..3)];
        let yaw_rad = yaw_rad(rng, 2.0) + facing_rad(rng);
        let car = things.beside(class, side, s_m, width_m - gap_m - 0.05, yaw_rad);
        things.narrow(car, side, s_m, &rules);
        s_m += rng.random_range(14.0..24.0);
        if rng.random_bool(0.8) {
            side = side.opposite();
        }
    }
}
