//! Race tracks: a closed band around an inner island or between thin walls, driven once round from a barrier back to it.

use super::course::Course;
use super::parts::{close, driven_m, lot, things_on};
use super::strip::{Mouth, Strip, is_simple};
use super::things::{Rules, Things, side};
use super::walls::{Wall, yard};
use crate::corridor::Side;
use rand::RngExt as _;
use sim::geometry::{Vec2, edges};
use sim::maths;
use sim::scenario::{Island, Obstacle, ObstacleClass, Scenario};
use sim::seed::Rng;
use std::f32::consts::TAU;
use std::ops::Range;

const WIDTH_M: Range<f32> = 4.5..9.0;
const RADIUS_M: Range<f32> = 8.0..30.0;
/// Once round, metres.
const LENGTH_M: Range<f32> = 130.0..225.0;
/// The barrier stands in the middle of a straight at least so long, metres.
const STRAIGHT_MIN_M: f32 = 12.0;
/// Left between the band and itself, metres.
const APART_M: f32 = 1.5;

pub(super) fn draw(layout: &mut Rng, obstacles: &mut Rng) -> Option<(Scenario, Strip)> {
    const TRIES: usize = 200;
    let width_m = layout.random_range(WIDTH_M);
    let strip = (0..TRIES).find_map(|_| ring(width_m, layout))?;
    let mut things = things_on(&strip);
    let half_m = 0.5 * width_m;
    let barrier = Mouth { a: strip.point(0.0, half_m), b: strip.point(0.0, -half_m), depth_m: 0.0 };
    close(&mut things, &barrier, obstacles);
    cones(&mut things, &strip, obstacles);
    let (outer, inner) = (strip.edge(Side::Right, 0.0), strip.edge(Side::Left, 0.0));
    let wall = match layout.random_range(0..10) {
        0..5 => None,
        5..7 => Some(Wall::tall(layout)),
        _ => Some(Wall::low(layout)),
    };
    let Some(wall) = wall else {
        let infield = Island { polygon: inner, height_m: 0.15 };
        return Some((Scenario { islands: vec![infield], ..lot(&strip, outer, things) }, strip));
    };
    things.obstacles.extend(wall.around(&outer, &[]));
    // The other way round, so that it stands inside.
    let inner: Vec<_> = inner.into_iter().rev().collect();
    things.obstacles.extend(wall.around(&inner, &[]));
    Some((lot(&strip, yard(&outer, 2.0..8.0, layout), things), strip))
}

/// A polygon around a middle, its corners rounded, to the left, from the middle of its longest side.
fn ring(width_m: f32, rng: &mut Rng) -> Option<Strip> {
    let corners = rng.random_range(4..=8);
    let mut polygon: Vec<Vec2> = (0..corners)
        .map(|k| {
            let bearing_rad = TAU * (k as f32 + rng.random_range(-0.3..0.3)) / corners as f32;
            maths::unit(bearing_rad) * rng.random_range(0.4..1.0) * Vec2::new(1.0, 0.75)
        })
        .collect();
    let around: f32 = edges(&polygon).map(|(a, b)| a.distance(b)).sum();
    // Rounding shortens it.
    let scale_m = 1.15 * rng.random_range(LENGTH_M) / around;
    for corner in &mut polygon {
        *corner *= scale_m;
    }
    let side_m = |k: usize| polygon[k].distance(polygon[(k + 1) % corners]);
    let longest = (0..corners).max_by(|&a, &b| side_m(a).total_cmp(&side_m(b)))?;
    polygon.rotate_left(longest);
    let side_m = |k: usize| polygon[(k + 1) % corners] - polygon[k % corners];
    // Corner k + 1 lies between sides k and k + 1; the last one is corner 0.
    let turns_rad: Vec<f32> = (0..corners).map(|k| side_m(k).angle_to(side_m(k + 1))).collect();
    // Tight ones more often than gentle ones.
    let radius_m = |share: f32| RADIUS_M.start + share * share * (RADIUS_M.end - RADIUS_M.start);
    let radii_m: Vec<f32> = (0..corners).map(|_| radius_m(rng.random())).collect();
    let tangents_m: Vec<f32> = turns_rad
        .iter()
        .zip(&radii_m)
        .map(|(turn_rad, radius_m)| radius_m * maths::tan(0.5 * turn_rad.abs()))
        .collect();
    let straight_m = |k: usize| side_m(k).length() - tangents_m[k % corners] - tangents_m[(k + corners - 1) % corners];
    if (0..corners).any(|k| straight_m(k) < 1.0) || straight_m(0) < STRAIGHT_MIN_M {
        return None;
    }
    let mut course = Course::new(width_m);
    course.straight(0.5 * straight_m(0));
    for k in 0..corners {
        course.bend(radii_m[k], turns_rad[k]);
        course.straight(if k + 1 == corners { 0.5 * straight_m(0) } else { straight_m(k + 1) });
    }
    let strip = course.strip()?;
    let keeps_apart = Side::BOTH.iter().all(|&side| {
        // The inner edge must have a radius of its own.
        is_simple(&strip.edge(side, 0.0)) && is_simple(&strip.edge(side, APART_M))
    });
    (LENGTH_M.contains(&strip.length_m()) && keeps_apart).then_some(strip)
}

/// A few at the edges.
fn cones(things: &mut Things<'_>, strip: &Strip, rng: &mut Rng) {
    let rules = Rules { gap_m: 3.2, apart_m: 10.0, corner_clear_m: 0.0 };
    let (from_m, to_m) = driven_m(strip);
    for _ in 0..rng.random_range(0..6) {
        let (side, s_m) = (side(rng), rng.random_range(from_m..to_m));
        let protrusion_m = rng.random_range(0.3..1.2);
        let cone = things.beside(ObstacleClass::Cone, side, s_m, protrusion_m, 0.0);
        things.narrow(Obstacle { heading_deg: 0.0, ..cone }, side, s_m, &rules);
    }
}
