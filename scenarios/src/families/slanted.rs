//! Car parks whose stalls are at a slant: aisles between rows of cars parked at 45° or 60°, to the same side on either side of
//! an aisle (herring-bone) or straight on (parallel); few stalls are empty, and never two neighbours.

use super::aisles::CarPark;
use super::course::{Aisles, Course, first_apart, lacking_at_corner_m};
use super::strip::{Notch, Strip, Stub, line_length_m, point_at};
use super::things::{self, Things, facing_rad};
use crate::clutter::{draw_car, yaw_rad};
use crate::corridor::{Side, to_millimetres};
use rand::RngExt as _;
use sim::geometry::{Vec2, signed_area_m2};
use sim::maths;
use sim::scenario::{Island, ObstacleClass, Scenario};
use sim::seed::Rng;
use std::f32::consts::{FRAC_PI_2, PI};
use std::ops::Range;

const AISLE_M: Range<f32> = 4.5..6.5;
/// Width of the cross aisles at the row ends, metres.
const CROSS_M: Range<f32> = 6.0..8.0;
/// The piece of an aisle that is driven, corner to corner, metres.
const LEG_M: Range<f32> = 38.0..62.0;
/// Across the stall, metres.
const STALL_WIDTH_M: Range<f32> = 2.4..2.7;
/// Share of the stalls that are taken.
const OCCUPANCY: Range<f64> = 0.6..0.95;
/// Between two rows that stand back to back, metres.
const MEDIAN_M: Range<f32> = 0.5..1.5;
/// From the corner of the aisle to the row, metres.
const ROW_END_M: Range<f32> = 1.0..2.0;
/// From the end of a row to its first stall, metres.
const END_M: f32 = 0.7;
/// How far the ends of aisles go on behind what closes them, metres.
const DEAD_END_M: Range<f32> = 6.0..10.0;
/// No row is deeper, metres: what tests take for a way goes on farther.
#[cfg(test)]
pub(super) const DEPTH_MAX_M: f32 = 5.65;
/// The centre line at most, run-outs included, metres.
const LENGTH_MAX_M: f32 = 225.0;

/// What stands at the ends of rows.
#[derive(Clone, Copy)]
enum End {
    Island(f32),
    Posts(ObstacleClass),
}

/// How cars stand in the rows of a lot.
struct Stalls {
    width_m: f32,
    slant_rad: f32,
    /// Metres along the row for each metre away from the aisle.
    cot: f32,
    /// Along the row from stall to stall, metres.
    pitch_m: f32,
    /// Of a row, metres.
    depth_m: f32,
    /// 1: stalls of a side lead away from the aisle in the direction of the route, −1: against it.
    leans: [f32; 2],
    end: End,
}

impl Stalls {
    fn draw(rng: &mut Rng) -> Self {
        let (slant_rad, width_m) =
            (if rng.random_bool(0.5) { 45.0_f32 } else { 60.0 }.to_radians(), rng.random_range(STALL_WIDTH_M));
        let (sin, cos) = maths::sin_cos(slant_rad);
        let lean = if rng.random_bool(0.5) { 1.0 } else { -1.0 };
        let is_herring_bone = rng.random_bool(0.6);
        let end = match rng.random_range(0..5) {
            0 => End::Island(0.15),
            1 => End::Island(0.5),
            2 | 3 => End::Posts(ObstacleClass::Bollard),
            _ => End::Posts(ObstacleClass::Cone),
        };
        let depth_m = across_row_m(ObstacleClass::Van, slant_rad) + 0.2;
        let leans = [lean, if is_herring_bone { lean } else { -lean }];
        Self { width_m, slant_rad, cot: cos / sin, pitch_m: width_m / sin, depth_m, leans, end }
    }
}

/// What a car of a class takes across the row, metres.
fn across_row_m(class: ObstacleClass, slant_rad: f32) -> f32 {
    let [length_m, width_m, _] = class.default_size_m();
    let (sin, cos) = maths::sin_cos(slant_rad);
    length_m * sin + width_m * cos
}

pub(super) fn draw(layout: &mut Rng, obstacles: &mut Rng) -> Option<(Scenario, Strip)> {
    let stalls = Stalls::draw(layout);
    let mut strip = first_apart(layout, 0.2, |rng| course(stalls.depth_m, rng))?;
    strip.notches = rows(&strip, &stalls, layout);
    let lot = CarPark { stall_m: stalls.width_m, occupancy: OCCUPANCY, side_aisles: &[] };
    lot.draw(strip, layout, obstacles, |things, strip, occupancy, rng| {
        for notch in &strip.notches {
            let row = Row { strip, notch, stalls: &stalls };
            row.park(things, occupancy, rng);
        }
    })
}

/// Up and down, from aisle to aisle.
fn course(depth_m: f32, rng: &mut Rng) -> Course {
    let (aisle_m, cross_m) = (rng.random_range(AISLE_M), rng.random_range(CROSS_M));
    let pitch_m = aisle_m + 2.0 * depth_m + rng.random_range(MEDIAN_M);
    let chamfer_m = lacking_at_corner_m(aisle_m, cross_m) * rng.random_range(1.3..1.8) + rng.random_range(0.0..0.5);
    let leg_m = rng.random_range(LEG_M);
    let aisles = Aisles { count: 2..=3, aisle_m, cross_m, leg_m, length_max_m: LENGTH_MAX_M };
    aisles.up_and_down(rng, |_| pitch_m, |_| chamfer_m, dead_end)
}

/// The way that is not taken at a corner.
fn dead_end(rng: &mut Rng) -> Option<Stub> {
    let depth_m = rng.random_range(DEAD_END_M);
    match rng.random_range(0..10) {
        0..4 => Some(Stub::Ahead(depth_m)),
        4..8 => Some(Stub::Behind(depth_m)),
        _ => None,
    }
}

/// On both sides of every aisle.
fn rows(strip: &Strip, stalls: &Stalls, rng: &mut Rng) -> Vec<Notch> {
    let mut rows = Vec::new();
    // Every other straight piece crosses from aisle to aisle.
    for (from_m, to_m) in strip.straights().into_iter().step_by(2) {
        for side in Side::BOTH {
            let (from_m, to_m) = (from_m + rng.random_range(ROW_END_M), to_m - rng.random_range(ROW_END_M));
            if to_m - from_m > 2.0 * END_M + stalls.depth_m * stalls.cot + 3.0 * stalls.pitch_m {
                rows.push(Notch { side, from_m, to_m, depth_m: stalls.depth_m });
            }
        }
    }
    rows
}

/// Which stalls of a row are taken: the first and the last one, and of two neighbours one at least.
fn taken(stalls: usize, occupancy: f64, rng: &mut Rng) -> Vec<bool> {
    // So many of those behind a taken one are free that all in all the share is right.
    let free = (1.0 - occupancy) / occupancy;
    let mut taken: Vec<bool> = vec![true; stalls];
    for k in 1..stalls - 1 {
        taken[k] = !(taken[k - 1] && rng.random_bool(free));
    }
    taken
}

/// A row of stalls: metres along the axis, and away from the aisle.
struct Row<'a> {
    strip: &'a Strip,
    notch: &'a Notch,
    stalls: &'a Stalls,
}

impl Row<'_> {
    fn lean(&self) -> f32 {
        self.stalls.leans[usize::from(self.notch.side == Side::Right)]
    }

    fn world(&self, s_m: f32, away_m: f32) -> Vec2 {
        self.strip.point(s_m, self.notch.side.sign() * (self.strip.half_width_m(s_m) + away_m))
    }

    /// Where something that begins at the aisle at `s_m` and is as slanted as the stalls comes to.
    fn slanted(&self, s_m: f32, away_m: f32) -> f32 {
        s_m + self.lean() * away_m * self.stalls.cot
    }

    fn park(&self, things: &mut Things<'_>, occupancy: f64, rng: &mut Rng) {
        let Stalls { slant_rad, cot, pitch_m, depth_m, .. } = *self.stalls;
        let overhang_m = depth_m * cot;
        let room_m = self.notch.to_m - self.notch.from_m - overhang_m - 2.0 * END_M;
        let count = (room_m / pitch_m).floor();
        let spare_m = (room_m - count * pitch_m) * rng.random::<f32>();
        let first_m = self.notch.from_m + END_M + spare_m + if self.lean() < 0.0 { overhang_m } else { 0.0 };
        let into_rad = self.notch.side.sign() * if self.lean() > 0.0 { slant_rad } else { PI - slant_rad };
        for (k, is_taken) in taken(count as usize, occupancy, rng).into_iter().enumerate() {
            let front_m = first_m + (k as f32 + 0.5) * pitch_m;
            let heading_rad = self.strip.pose(front_m).heading_rad + into_rad;
            let (class, away_m, heading_rad) = if is_taken {
                let class = draw_car(rng);
                let across_m = across_row_m(class, slant_rad);
                let from_aisle_m = rng.random_range(0.08..depth_m - across_m - 0.08);
                (class, from_aisle_m + 0.5 * across_m, heading_rad + yaw_rad(rng, 1.5) + facing_rad(rng))
            } else if rng.random_bool(0.5) {
                (ObstacleClass::WheelStop, depth_m - 1.0, heading_rad + FRAC_PI_2)
            } else {
                continue;
            };
            let at = self.world(self.slanted(front_m, away_m), away_m);
            things.stand(things::obstacle(class, at, heading_rad));
        }
        self.end(things, self.notch.from_m, first_m);
        self.end(things, self.notch.to_m, first_m + count * pitch_m);
    }

    /// Closes what is left between an end of the row and the stalls, which begin there at `front_m`.
    fn end(&self, things: &mut Things<'_>, end_m: f32, front_m: f32) {
        /// Posts are so far from each other at most, metres.
        const SPACING_M: f32 = 1.2;
        /// And so far from the stalls.
        const ASIDE_M: f32 = 0.2;
        /// So far back they stand beside the first car, whose blunt end leaves a gap at the aisle, metres.
        const BACK_M: f32 = 1.1;
        let inward = (front_m - end_m).signum();
        let beside = |away_m: f32| self.world(self.slanted(front_m, away_m) - inward * ASIDE_M, away_m);
        let at_end = |aside_m: f32, away_m: f32| self.world(end_m + inward * aside_m, away_m);
        match self.stalls.end {
            End::Island(height_m) => {
                let back_m = self.stalls.depth_m - 0.05;
                let corners = [at_end(0.05, 0.05), beside(0.05), beside(back_m), at_end(0.05, back_m)];
                let mut polygon = corners.map(to_millimetres).to_vec();
                if signed_area_m2(&polygon) < 0.0 {
                    polygon.reverse();
                }
                if things.reserve(polygon.clone()) {
                    things.islands.push(Island { polygon, height_m });
                }
            }
            End::Posts(class) => {
                let line = [at_end(0.3, 0.25), beside(0.25), beside(BACK_M)];
                let length_m = line_length_m(&line);
                let gaps = (length_m / SPACING_M).ceil();
                for k in 0..=gaps as usize {
                    let at = point_at(&line, k as f32 * length_m / gaps);
                    things.stand(things::obstacle(class, at, 0.0));
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sim::seed::{RootSeed, Stream};

    #[test]
    fn of_two_neighbours_one_is_taken_and_as_many_are_as_asked_for() {
        let mut rng = RootSeed(1).rng(Stream::Obstacles, 0);
        for occupancy in [0.6, 0.75, 0.95] {
            let rows: Vec<_> = (0..200).map(|_| taken(30, occupancy, &mut rng)).collect();
            for row in &rows {
                assert!(row[0] && row[29] && row.windows(2).all(|pair| pair[0] || pair[1]), "{row:?}");
            }
            let share = rows.iter().flatten().filter(|&&is_taken| is_taken).count() as f64 / 6000.0;
            assert!((share - occupancy).abs() < 0.05, "{share} instead of {occupancy}");
        }
    }

    #[test]
    fn no_row_is_deeper_than_the_deepest() {
        let mut rng = RootSeed(1).rng(Stream::Layout, 0);
        assert!((0..20).all(|_| Stalls::draw(&mut rng).depth_m < DEPTH_MAX_M));
    }
}
