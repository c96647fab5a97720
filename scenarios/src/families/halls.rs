//! Halls with rows of racks: aisles hardly wider than the car needs between solid rows that hide what is behind, wide cross
//! aisles at their ends; the way turns off where others go on, which a kerb, cones or a barrier close.

use super::course::{Aisles, Course, first_apart, lacking_at_corner_m};
use super::parts::{close, lot, solid_height_m, things_on};
use super::strip::{Notch, Strip, Stub};
use super::things::{Rules, Things, side};
use crate::clutter::yaw_rad;
use crate::corridor::Side;
use rand::RngExt as _;
use sim::scenario::{ObstacleClass, Scenario};
use sim::seed::Rng;
use std::ops::Range;

/// Width of the aisles between racks, metres.
const AISLE_M: Range<f32> = 3.4..5.5;
/// Width of the cross aisles at the ends of the racks, metres.
const CROSS_M: Range<f32> = 5.5..11.0;
/// Width of a row of racks, metres.
const RACK_M: Range<f32> = 1.6..4.0;
/// The piece of an aisle that is driven, corner to corner, metres.
const LEG_M: Range<f32> = 28.0..60.0;
/// Gaps in a row of racks, metres.
const GAP_M: Range<f32> = 2.0..3.6;
/// How far other aisles go on, metres.
const DEPTH_M: Range<f32> = 5.5..11.0;
/// The centre line at most, run-outs included, metres.
const LENGTH_MAX_M: f32 = 225.0;

pub(super) fn draw(layout: &mut Rng, obstacles: &mut Rng) -> Option<(Scenario, Strip)> {
    let mut strip = first_apart(layout, 0.2, course)?;
    for other in other_aisles(&strip, layout) {
        strip.notches.push(other);
        if !strip.keeps_apart(0.2) {
            // It would meet the way itself.
            strip.notches.pop();
        }
    }
    let mut things = things_on(&strip);
    let mouths = strip.notches.iter().map(|other| strip.mouth(other)).chain(strip.stub_mouths());
    for mouth in mouths {
        close(&mut things, &mouth, obstacles);
    }
    pallets(&mut things, &strip, obstacles);
    let boundary_height_m = solid_height_m(layout);
    let outline = strip.outline(0.0);
    Some((Scenario { boundary_height_m, ..lot(&strip, outline, things) }, strip))
}

/// Up and down, by the next aisle or the next but one.
fn course(rng: &mut Rng) -> Course {
    let (aisle_m, cross_m) = (rng.random_range(AISLE_M), rng.random_range(CROSS_M));
    let leg_m = rng.random_range(LEG_M);
    let chamfer_m = lacking_at_corner_m(aisle_m, cross_m) * rng.random_range(1.3..1.8);
    let pitch_m = |rng: &mut Rng| {
        let rows = rng.random_range(1..=2) as f32;
        (rows * (aisle_m + rng.random_range(RACK_M))).max(10.5)
    };
    let aisles = Aisles { count: 2..=4, aisle_m, cross_m, leg_m, length_max_m: LENGTH_MAX_M };
    aisles.up_and_down(rng, pitch_m, |_| chamfer_m, goes_on)
}

/// The way that is not taken at a corner.
fn goes_on(rng: &mut Rng) -> Option<Stub> {
    let depth_m = rng.random_range(DEPTH_M);
    match rng.random_range(0..10) {
        0..5 => Some(Stub::Ahead(depth_m)),
        5..9 => Some(Stub::Behind(depth_m)),
        _ => None,
    }
}

/// Gaps in the rows of racks, through which one sees the next aisle.
fn other_aisles(strip: &Strip, rng: &mut Rng) -> Vec<Notch> {
    let mut gaps = Vec::new();
    for (from_m, to_m) in strip.straights() {
        for side in Side::BOTH {
            let (width_m, depth_m) = (rng.random_range(GAP_M), rng.random_range(DEPTH_M));
            let place: f32 = rng.random();
            let (low_m, high_m) = (from_m + 3.0, to_m - 3.0 - width_m);
            if low_m < high_m && rng.random_bool(0.4) {
                let at_m = low_m + place * (high_m - low_m);
                gaps.push(Notch { side, from_m: at_m, to_m: at_m + width_m, depth_m });
            }
        }
    }
    gaps
}

/// Pallets, columns and people beside the racks.
fn pallets(things: &mut Things<'_>, strip: &Strip, rng: &mut Rng) {
    let rules = Rules { gap_m: 2.8, apart_m: 10.0, corner_clear_m: 7.0 };
    for _ in 0..rng.random_range(0..8) {
        let (side, s_m) = (side(rng), rng.random_range(0.0..strip.length_m()));
        let class = [ObstacleClass::Pillar, ObstacleClass::Cart, ObstacleClass::Person, ObstacleClass::Cone]
            [rng.random_range(0..4)];
        let protrusion_m = rng.random_range(0.2..1.2);
        let thing = things.beside(class, side, s_m, protrusion_m, yaw_rad(rng, 10.0));
        things.narrow(thing, side, s_m, &rules);
    }
}
