//! Car parks with several parallel aisles: rows of stalls, many of them empty, on both sides and across the ends; the way
//! goes round the row ends from aisle to aisle; side aisles are closed or dead ends.

use super::course::{Aisles, Course, first_apart};
use super::parts::{close, enclosed, things_on};
use super::strip::{Mouth, Notch, Strip, Stub};
use super::things::{self, Rules, Things, facing_rad, side};
use super::walls::Wall;
use crate::clutter::{draw_car, yaw_rad};
use crate::corridor::{STALL_DEPTH_M, Side};
use rand::RngExt as _;
use sim::maths;
use sim::scenario::{ObstacleClass, Scenario};
use sim::seed::Rng;
use std::ops::Range;

/// Aisles are so wide, metres.
const AISLE_M: Range<f32> = 5.0..8.0;
/// The piece of an aisle that is driven, corner to corner, metres.
const LEG_M: Range<f32> = 26.0..60.0;
const STALL_WIDTH_M: Range<f32> = 2.3..2.7;
/// Between two rows that stand back to back, metres.
const MEDIAN_M: Range<f32> = 0.5..2.5;
/// Between the cross aisle and the first stall, metres.
const ROW_END_M: Range<f32> = 1.0..3.0;
const SIDE_AISLE_M: Range<f32> = 4.5..6.0;
/// How far the ends of aisles go on behind what closes them, metres.
const DEAD_END_M: Range<f32> = STALL_DEPTH_M + 0.5..10.0;
/// Ground is free so far behind a wall, metres.
const BEHIND_WALL_M: Range<f32> = 2.0..8.0;
/// The centre line at most, run-outs included, metres.
const LENGTH_MAX_M: f32 = 225.0;

pub(super) fn draw(layout: &mut Rng, obstacles: &mut Rng) -> Option<(Scenario, Strip)> {
    let stall_m = layout.random_range(STALL_WIDTH_M);
    let mut strip = first_apart(layout, 0.2, course)?;
    let (rows, side_aisles) = rows(&strip, stall_m, layout);
    strip.notches = rows.iter().chain(&side_aisles).copied().collect();
    let lot = CarPark { stall_m, occupancy: 0.25..0.9, side_aisles: &side_aisles };
    lot.draw(strip, layout, obstacles, |things, strip, occupancy, rng| {
        for row in &rows {
            park(things, strip, row, stall_m, occupancy, rng);
        }
    })
}

/// What car parks have in common, however cars stand in their rows.
pub(super) struct CarPark<'a> {
    /// Width of stalls across the end of an aisle, metres.
    pub(super) stall_m: f32,
    /// Share of the stalls in which a car stands.
    pub(super) occupancy: Range<f64>,
    /// Of the notches of the strip, those that are to be closed.
    pub(super) side_aisles: &'a [Notch],
}

impl CarPark<'_> {
    /// Closes ends of aisles and side aisles or fills them with stalls, lets rows be filled to an occupancy, and encloses all
    /// of it; `None` if the strip meets itself.
    pub(super) fn draw(
        &self,
        strip: Strip,
        layout: &mut Rng,
        obstacles: &mut Rng,
        fill_rows: impl FnOnce(&mut Things<'_>, &Strip, f64, &mut Rng),
    ) -> Option<(Scenario, Strip)> {
        if !strip.keeps_apart(0.2) {
            return None;
        }
        let mut things = things_on(&strip);
        let occupancy = obstacles.random_range(self.occupancy.clone());
        let side_mouths = self.side_aisles.iter().map(|aisle| (strip.mouth(aisle), false));
        let is_row = |mouth: &Mouth| mouth.depth_m <= STALL_DEPTH_M;
        let end_mouths = strip.stub_mouths().into_iter().map(|mouth| (mouth, is_row(&mouth)));
        for (mouth, has_stalls) in side_mouths.chain(end_mouths) {
            if has_stalls {
                park_across(&mut things, &mouth, self.stall_m, occupancy, obstacles);
            } else {
                close(&mut things, &mouth, obstacles);
            }
        }
        fill_rows(&mut things, &strip, occupancy, obstacles);
        in_the_aisle(&mut things, &strip, obstacles);
        let wall = match layout.random_range(0..10) {
            0..5 => None,
            5..8 => Some(Wall::kerb()),
            _ => Some(Wall::low(layout)),
        };
        let lot = enclosed(&strip, things, wall, BEHIND_WALL_M, layout);
        Some((lot, strip))
    }
}

/// Up and down, from aisle to aisle.
fn course(rng: &mut Rng) -> Course {
    let aisle_m = rng.random_range(AISLE_M);
    let cross_m = rng.random_range(AISLE_M);
    let pitch_m = aisle_m + 2.0 * STALL_DEPTH_M + rng.random_range(MEDIAN_M);
    let leg_m = rng.random_range(LEG_M);
    let aisles = Aisles { count: 2..=4, aisle_m, cross_m, leg_m, length_max_m: LENGTH_MAX_M };
    aisles.up_and_down(rng, |_| pitch_m, |rng| rng.random_range(0.0..1.0), row_or_dead_end)
}

/// What a driver sees where the way turns off: a row of stalls across the end of the aisle, or ground that goes on.
fn row_or_dead_end(rng: &mut Rng) -> Option<Stub> {
    let depth_m = if rng.random_bool(0.4) { STALL_DEPTH_M } else { rng.random_range(DEAD_END_M) };
    match rng.random_range(0..10) {
        0..4 => Some(Stub::Ahead(depth_m)),
        4..8 => Some(Stub::Behind(depth_m)),
        _ => None,
    }
}

/// Rows of stalls along the aisles, and side aisles through them.
fn rows(strip: &Strip, stall_m: f32, rng: &mut Rng) -> (Vec<Notch>, Vec<Notch>) {
    let (mut rows, mut side_aisles) = (Vec::new(), Vec::new());
    for (i, (from_m, to_m)) in strip.straights().into_iter().enumerate() {
        // Every other piece crosses from aisle to aisle; its ends are corners.
        if i % 2 == 1 {
            continue;
        }
        for side in Side::BOTH {
            let (from_m, to_m) = (from_m + rng.random_range(ROW_END_M), to_m - rng.random_range(ROW_END_M));
            let gap_m = rng.random_range(SIDE_AISLE_M);
            let has_gap = to_m - from_m > 3.0 * gap_m && rng.random_bool(0.4);
            let depth_m = STALL_DEPTH_M;
            if !has_gap {
                push_row(&mut rows, side, (from_m, to_m), stall_m);
                continue;
            }
            let at_m = rng.random_range(from_m + gap_m..to_m - 2.0 * gap_m);
            side_aisles.push(Notch { side, from_m: at_m, to_m: at_m + gap_m, depth_m });
            push_row(&mut rows, side, (from_m, at_m - 0.5), stall_m);
            push_row(&mut rows, side, (at_m + gap_m + 0.5, to_m), stall_m);
        }
    }
    (rows, side_aisles)
}

/// As many stalls as there is room for.
fn push_row(rows: &mut Vec<Notch>, side: Side, (from_m, to_m): (f32, f32), stall_m: f32) {
    let stalls = ((to_m - from_m) / stall_m).floor();
    if stalls >= 2.0 {
        rows.push(Notch { side, from_m, to_m: from_m + stalls * stall_m, depth_m: STALL_DEPTH_M });
    }
}

/// Cars in some of the stalls, at a right angle to the aisle; wheel stops in others.
fn park(things: &mut Things<'_>, strip: &Strip, row: &Notch, stall_m: f32, occupancy: f64, rng: &mut Rng) {
    let stalls = ((row.to_m - row.from_m) / stall_m).round() as usize;
    for k in 0..stalls {
        let s_m = row.from_m + (k as f32 + 0.5) * stall_m;
        let edge_m = strip.half_width_m(s_m);
        let heading_rad = strip.pose(s_m).heading_rad + std::f32::consts::FRAC_PI_2;
        let class = draw_car(rng);
        let set_back_m = rng.random_range(0.1..0.4);
        let heading = heading_rad + yaw_rad(rng, 3.0) + facing_rad(rng);
        let (class, d_m, heading) = if rng.random_bool(occupancy) {
            (class, edge_m + set_back_m + 0.5 * class.default_size_m()[0], heading)
        } else if rng.random_bool(0.5) {
            (ObstacleClass::WheelStop, edge_m + STALL_DEPTH_M - 0.6, heading_rad + std::f32::consts::FRAC_PI_2)
        } else {
            continue;
        };
        things.stand(things::obstacle(class, strip.point(s_m, row.side.sign() * d_m), heading));
    }
}

/// Cars in some of the stalls across the end of an aisle, wheel stops in others.
fn park_across(things: &mut Things<'_>, mouth: &Mouth, stall_m: f32, occupancy: f64, rng: &mut Rng) {
    let stalls = (mouth.a.distance(mouth.b) / stall_m).floor().max(1.0);
    for k in 0..stalls as usize {
        let class = draw_car(rng);
        let into_rad = maths::angle_rad(mouth.outward());
        let (class, depth_m, heading_rad) = if rng.random_bool(occupancy) {
            let depth_m = rng.random_range(0.1..0.4) + 0.5 * class.default_size_m()[0];
            (class, depth_m, into_rad + yaw_rad(rng, 3.0) + facing_rad(rng))
        } else if rng.random_bool(0.5) {
            (ObstacleClass::WheelStop, STALL_DEPTH_M - 0.6, into_rad + std::f32::consts::FRAC_PI_2)
        } else {
            continue;
        };
        let at = mouth.a.lerp(mouth.b, (k as f32 + 0.5) / stalls) + mouth.outward() * depth_m;
        things.stand(things::obstacle(class, at, heading_rad));
    }
}

/// A cone, a cart or a car that waits beside the row.
fn in_the_aisle(things: &mut Things<'_>, strip: &Strip, rng: &mut Rng) {
    let rules = Rules { gap_m: 2.9, apart_m: 9.0, corner_clear_m: 8.0 };
    for _ in 0..rng.random_range(0..5) {
        let s_m = rng.random_range(0.0..strip.length_m());
        let side = side(rng);
        let class = [ObstacleClass::Cone, ObstacleClass::Cart, ObstacleClass::Person, ObstacleClass::Sedan]
            [rng.random_range(0..4)];
        let protrusion_m = class.default_size_m()[1] + rng.random_range(-0.2..0.1);
        let thing = things.beside(class, side, s_m, protrusion_m, yaw_rad(rng, 3.0));
        things.narrow(thing, side, s_m, &rules);
    }
}
