//! Streets: kerbs with a pavement behind, parked cars on both sides that leave offset gaps and chicanes, pavements built out
//! into the street, refuges in its middle, trees and posts, side roads that are closed.

use super::course::{Course, first_apart};
use super::parts::{RUN_OUT_M, close, lot, things_on};
use super::strip::{Notch, Strip, Stub};
use super::things::{self, Rules, Things, facing_rad, side};
use super::walls::Wall;
use crate::clutter::{draw_car, yaw_rad};
use crate::corridor::{Side, to_millimetres};
use rand::RngExt as _;
use sim::geometry::Vec2;
use sim::scenario::{Island, Obstacle, ObstacleClass, Scenario};
use sim::seed::Rng;
use std::ops::Range;

/// The centre line between the run-outs, metres.
const LENGTH_M: Range<f32> = 90.0..180.0;
/// Width between the kerbs, metres.
const WIDTH_M: Range<f32> = 5.4..9.0;
const RADIUS_M: Range<f32> = 10.0..30.0;
/// Free width between parked cars, metres.
const GAP_M: Range<f32> = 2.7..3.6;
/// Distance from a parked car to the kerb, metres.
const FROM_KERB_M: Range<f32> = 0.1..0.4;
/// Distance between bumpers, metres.
const BUMPERS_M: Range<f32> = 0.6..2.0;
const SIDE_ROAD_WIDTH_M: Range<f32> = 4.0..6.0;
const SIDE_ROAD_DEPTH_M: Range<f32> = 6.0..12.0;
const PAVEMENT_M: Range<f32> = 1.5..3.5;

pub(super) fn draw(layout: &mut Rng, obstacles: &mut Rng) -> Option<(Scenario, Strip)> {
    let pavement_m = layout.random_range(PAVEMENT_M);
    let mut strip = first_apart(layout, pavement_m, course)?;
    strip.notches = side_roads(&strip, pavement_m, layout);
    if !strip.keeps_apart(pavement_m) {
        strip.notches.clear();
    }
    let mut things = things_on(&strip);
    let mouths: Vec<_> = strip.notches.iter().map(|notch| strip.mouth(notch)).chain(strip.stub_mouths()).collect();
    for mouth in &mouths {
        close(&mut things, mouth, obstacles);
    }
    if obstacles.random_bool(0.6) {
        built_out(&mut things, &strip, obstacles);
    }
    parked_cars(&mut things, &strip, obstacles);
    on_the_pavement(&mut things, &strip, pavement_m, obstacles);
    things.obstacles.extend(Wall::kerb().around(&strip.outline(0.0), &[]));
    Some((lot(&strip, strip.outline(pavement_m), things), strip))
}

fn course(rng: &mut Rng) -> Course {
    let mut course = Course::new(rng.random_range(WIDTH_M));
    let until_m = RUN_OUT_M + rng.random_range(LENGTH_M);
    course.straight(RUN_OUT_M + rng.random_range(10.0..40.0));
    while course.length_m() < until_m {
        if rng.random_bool(0.35) {
            let turn_rad = course.turn_rad(rng, 90.0..90.1, 135.0).signum() * std::f32::consts::FRAC_PI_2;
            let depth_m = rng.random_range(SIDE_ROAD_DEPTH_M);
            let stub = match rng.random_range(0..3) {
                0 => Some(Stub::Ahead(depth_m)),
                1 => Some(Stub::Behind(depth_m)),
                _ => None,
            };
            course.corner(turn_rad, rng.random_range(1.0..2.5), stub);
        } else {
            let turn_rad = course.turn_rad(rng, 20.0..110.0, 135.0);
            course.bend(rng.random_range(RADIUS_M), turn_rad);
        }
        course.straight(rng.random_range(16.0..60.0));
    }
    course.straight(RUN_OUT_M);
    course
}

/// At most one on either side of a straight piece.
fn side_roads(strip: &Strip, pavement_m: f32, rng: &mut Rng) -> Vec<Notch> {
    let mut roads = Vec::new();
    for (from_m, to_m) in strip.straights() {
        for side in Side::BOTH {
            let width_m = rng.random_range(SIDE_ROAD_WIDTH_M);
            let depth_m = rng.random_range(SIDE_ROAD_DEPTH_M);
            let place: f32 = rng.random();
            let clear_m = pavement_m + 2.0;
            let (low_m, high_m) = (from_m + clear_m, to_m - clear_m - width_m);
            if low_m < high_m && rng.random_bool(0.35) {
                let road_m = low_m + place * (high_m - low_m);
                roads.push(Notch { side, from_m: road_m, to_m: road_m + width_m, depth_m });
            }
        }
    }
    roads
}

/// Pavements built out from either side, and refuges that the way passes on their wider side.
fn built_out(things: &mut Things<'_>, strip: &Strip, rng: &mut Rng) {
    /// Between a refuge and the kerb on its narrower side, metres: far too narrow for the car, or wide enough.
    const NARROW_SIDE_M: [Range<f32>; 2] = [0.6..1.5, 2.8..4.0];
    let rules = Rules { gap_m: rng.random_range(2.9..4.2), apart_m: 8.0, corner_clear_m: 7.0 };
    for _ in 0..rng.random_range(1..10) {
        let side = side(rng);
        let (from_m, length_m) = (rng.random_range(0.0..strip.length_m()), rng.random_range(2.0..12.0));
        let half_m = strip.half_width_m(from_m);
        let (from_kerb_m, depth_m) = if rng.random_bool(0.5) {
            (0.03, rng.random_range(0.8..4.0))
        } else {
            let passable = usize::from(rng.random_bool(0.5));
            (rng.random_range(NARROW_SIDE_M[passable].clone()), rng.random_range(0.5..2.0))
        };
        let height_m = if rng.random_bool(0.8) { 0.15 } else { 1.0 };
        let taper_m = (depth_m * rng.random::<f32>()).min(0.4 * length_m);
        let across_m = (half_m - from_kerb_m - depth_m, half_m - from_kerb_m);
        let polygon = rounded_off(strip, side, (from_m, from_m + length_m), across_m, taper_m);
        let is_on_one_width = (strip.half_width_m(from_m + length_m) - half_m).abs() < 0.01;
        let meets_notch = strip
            .notches
            .iter()
            .any(|notch| notch.side == side && notch.from_m < from_m + length_m + 1.0 && from_m < notch.to_m + 1.0);
        if is_on_one_width && !meets_notch {
            things.narrow(Island { polygon, height_m }, side, from_m + 0.5 * length_m, &rules);
        }
    }
}

/// Ground along the strip whose inner corners are cut off; `across_m` is measured from the axis to the side.
fn rounded_off(
    strip: &Strip,
    side: Side,
    (from_m, to_m): (f32, f32),
    (inner_m, outer_m): (f32, f32),
    taper_m: f32,
) -> Vec<Vec2> {
    const STEPS: u8 = 4;
    let at = |s_m: f32, across_m: f32| to_millimetres(strip.point(s_m, side.sign() * across_m));
    let along = |k: u8, from_m: f32, to_m: f32| from_m + (to_m - from_m) * f32::from(k) / f32::from(STEPS);
    let inner = (0..=STEPS).map(|k| at(along(k, from_m + taper_m, to_m - taper_m), inner_m));
    // A quarter of the depth is upright.
    let shoulder_m = inner_m + 0.75 * (outer_m - inner_m);
    let mut polygon: Vec<Vec2> = std::iter::once(at(from_m, shoulder_m)).chain(inner).collect();
    polygon.push(at(to_m, shoulder_m));
    polygon.extend((0..=STEPS).rev().map(|k| at(along(k, from_m, to_m), outer_m)));
    if side == Side::Right {
        // Counter-clockwise, as all outlines are.
        polygon.reverse();
    }
    polygon.dedup_by(|b, a| a.distance(*b) < 0.02);
    polygon
}

/// Rows of cars at both kerbs with gaps between the rows; what would leave too little stays empty.
fn parked_cars(things: &mut Things<'_>, strip: &Strip, rng: &mut Rng) {
    let rules = Rules { gap_m: rng.random_range(GAP_M), apart_m: 7.5, corner_clear_m: 6.0 };
    let mut rows: Vec<(f32, f32, Side)> = Vec::new();
    let (density, longest) = (rng.random_range(0.3..0.9), rng.random_range(1..6));
    for side in Side::BOTH {
        let mut s_m = rng.random_range(0.0..15.0);
        while s_m < strip.length_m() {
            let length_m = rng.random_range(1..=longest) as f32 * 6.0;
            if rng.random_bool(density) {
                rows.push((s_m, s_m + length_m, side));
            }
            s_m += length_m + rng.random_range(3.0..12.0);
        }
    }
    // Neither side has the first choice everywhere.
    rows.sort_by(|a, b| a.0.total_cmp(&b.0));
    for (from_m, to_m, side) in rows {
        let mut front_m = from_m;
        while front_m < to_m {
            let class = draw_car(rng);
            let [length_m, width_m, _] = class.default_size_m();
            let protrusion_m = width_m + rng.random_range(FROM_KERB_M);
            let s_m = (front_m + 0.5 * length_m).min(strip.length_m());
            let yaw_rad = yaw_rad(rng, 2.0) + facing_rad(rng);
            let car = things.beside(class, side, s_m, protrusion_m, yaw_rad);
            things.narrow(car, side, s_m, &rules);
            front_m += length_m + rng.random_range(BUMPERS_M);
        }
    }
}

/// Trees, posts and people behind the kerb.
fn on_the_pavement(things: &mut Things<'_>, strip: &Strip, pavement_m: f32, rng: &mut Rng) {
    for side in Side::BOTH {
        let every_m = rng.random_range(5.0..14.0);
        let behind_m = rng.random_range(0.5..pavement_m.min(1.2));
        let mut s_m = rng.random_range(0.0..every_m);
        while s_m < strip.length_m() {
            let (class, diameter_m, height_m) = match rng.random_range(0..10) {
                0..5 => (ObstacleClass::Pillar, 0.4, 4.0),
                5..8 => (ObstacleClass::Bollard, 0.15, 0.9),
                8 => (ObstacleClass::Person, 0.5, 1.7),
                _ => (ObstacleClass::Cart, 0.6, 1.0),
            };
            let d_m = side.sign() * (strip.half_width_m(s_m) + behind_m);
            let at = things::obstacle(class, strip.point(s_m, d_m), strip.pose(s_m).heading_rad);
            let sized =
                Obstacle { length_m: Some(diameter_m), width_m: Some(diameter_m), height_m: Some(height_m), ..at };
            let is_in_side_road = strip
                .notches
                .iter()
                .any(|notch| notch.side == side && notch.from_m - 0.5 < s_m && s_m < notch.to_m + 0.5);
            if !is_in_side_road && !strip.is_near_corner(s_m, s_m, 8.0) {
                things.stand(sized);
            }
            s_m += every_m * rng.random_range(0.7..1.3);
        }
    }
}
