//! Ways marked on open ground by rows of cones or bollards, as at driving schools, at road works and on aprons: nothing else
//! says where the way runs, and the ground behind the rows is free and seen.

use super::course::{Course, first_apart, lacking_at_corner_m};
use super::parts::{RUN_OUT_M, lot, solid_height_m, things_on};
use super::strip::{Strip, is_on, line_length_m, point_at};
use super::things::{self, Rules, Things, side};
use super::walls::{Wall, yard};
use crate::clutter::draw_car;
use crate::corridor::tenths;
use rand::RngExt as _;
use sim::geometry::Vec2;
use sim::maths;
use sim::scenario::{Obstacle, ObstacleClass, Scenario};
use sim::seed::Rng;
use std::f32::consts::{FRAC_PI_2, PI};
use std::ops::Range;

/// Half of all ways are as narrow as this, the others wider, metres.
const NARROW_M: Range<f32> = 3.4..4.4;
const WIDE_M: Range<f32> = 4.4..6.5;
/// Radii of the centre line, metres: of bends, and of right angles and hairpins.
const RADIUS_M: Range<f32> = 7.0..20.0;
const TIGHT_M: Range<f32> = 7.0..10.0;
/// The centre line between the run-outs, metres.
const LENGTH_M: Range<f32> = 85.0..160.0;
/// The course may turn back, but not round.
const LIMIT_DEG: f32 = 170.0;
/// Twice this is left between the way and itself, metres.
const APART_M: f32 = 1.8;
/// Open ground around the way, metres.
const AROUND_M: Range<f32> = 15.0..25.0;
/// Between the middles of things in a row, metres.
const SPACING_M: Range<f32> = 0.9..1.8;
/// Free between two things of a row at most, metres: the car is 1.86 m wide.
const GAP_MAX_M: f32 = 1.75;
/// Things stand off their row by so much, metres.
const OFF_M: f32 = 0.04;

/// What the rows of a lot are made of.
struct Row {
    classes: &'static [ObstacleClass],
    spacing_m: f32,
    /// Share of the things that are missing; never two neighbours.
    missing: f64,
    /// Pieces of it stand in the row.
    wall: Option<Wall>,
}

pub(super) fn draw(layout: &mut Rng, obstacles: &mut Rng) -> Option<(Scenario, Strip)> {
    let width_m = if layout.random_bool(0.5) { NARROW_M } else { WIDE_M };
    let width_m = layout.random_range(width_m);
    let strip = first_apart(layout, APART_M, |rng| course(width_m, rng))?;
    let outline = strip.outline(0.0);
    let boundary = yard(&outline, AROUND_M, layout);
    let mut things = things_on(&strip);
    let row = Row::draw(obstacles);
    row.stand_along(&mut things, strip.outline(row.behind_m()), obstacles);
    if obstacles.random_bool(0.5) {
        in_the_lane(&mut things, &strip, row.class(obstacles), obstacles);
    }
    around(&mut things, &strip.outline(1.0), &boundary, obstacles);
    let boundary_height_m = solid_height_m(layout);
    Some((Scenario { boundary_height_m, ..lot(&strip, boundary, things) }, strip))
}

fn course(width_m: f32, rng: &mut Rng) -> Course {
    let mut course = Course::new(width_m);
    let until_m = RUN_OUT_M + rng.random_range(LENGTH_M);
    course.straight(RUN_OUT_M + rng.random_range(6.0..16.0));
    while course.length_m() < until_m {
        match rng.random_range(0..10) {
            // A right angle, round or sharp.
            0..3 => {
                let turn_rad = course.turn_rad(rng, 90.0..90.1, LIMIT_DEG).signum() * FRAC_PI_2;
                if rng.random_bool(0.7) {
                    bend(&mut course, rng.random_range(TIGHT_M), turn_rad);
                } else {
                    let lacking_m = lacking_at_corner_m(width_m, width_m);
                    course.corner(turn_rad, lacking_m * rng.random_range(1.3..1.8) + rng.random_range(0.0..1.0), None);
                }
            }
            // An S.
            3..6 => {
                let turn_rad = course.turn_rad(rng, 30.0..90.0, LIMIT_DEG);
                bend(&mut course, rng.random_range(RADIUS_M), turn_rad);
                if rng.random_bool(0.5) {
                    course.straight(rng.random_range(1.0..5.0));
                }
                bend(&mut course, rng.random_range(RADIUS_M), -turn_rad);
            }
            // A hairpin.
            6 => {
                let turn_rad = course.turn_rad(rng, 150.0..180.0, LIMIT_DEG);
                bend(&mut course, rng.random_range(TIGHT_M), turn_rad);
            }
            _ => {
                let turn_rad = course.turn_rad(rng, 30.0..150.0, LIMIT_DEG);
                bend(&mut course, rng.random_range(RADIUS_M), turn_rad);
            }
        }
        course.straight(rng.random_range(6.0..18.0));
    }
    course.straight(RUN_OUT_M);
    course
}

/// A bend, widened if it is tight: in it the car takes the ring between 3.7 and 6.75 m, or as broad a one.
fn bend(course: &mut Course, radius_m: f32, turn_rad: f32) {
    let width_m = course.width_m();
    let wider_m = match radius_m {
        ..10.0 => 0.6,
        ..14.0 => 0.3,
        _ => 0.0,
    };
    course.widen(width_m + wider_m);
    course.bend(radius_m, turn_rad);
    course.widen(width_m);
}

impl Row {
    fn draw(rng: &mut Rng) -> Self {
        use ObstacleClass::{Bollard, Cone};
        let (classes, wall): (&[_], _) = match rng.random_range(0..8) {
            0..4 => (&[Cone], None),
            4..6 => (&[Bollard], None),
            6 => (&[Cone, Bollard], Some(Wall::low(rng))),
            _ => (&[Cone, Bollard], Some(Wall::kerb())),
        };
        let missing = if rng.random_bool(0.4) { rng.random_range(0.05..0.3) } else { 0.0 };
        let thinnest_m = classes.iter().map(|class| class.default_size_m()[1]).fold(f32::INFINITY, f32::min);
        // Where one is missing, the gap is between the next ones.
        let pitches = if missing > 0.0 { 2.0 } else { 1.0 };
        let most_m = (GAP_MAX_M + thinnest_m - 2.0 * OFF_M) / pitches;
        let spacing_m = rng.random_range(SPACING_M.start..most_m.min(SPACING_M.end));
        Self { classes, spacing_m, missing, wall }
    }

    fn class(&self, rng: &mut Rng) -> ObstacleClass {
        self.classes[rng.random_range(0..self.classes.len())]
    }

    /// From the edge of the way to the middle of the row, metres: nothing reaches into the way.
    fn behind_m(&self) -> f32 {
        let thickest_m = self.classes.iter().map(|class| class.default_size_m()[1]).fold(0.0, f32::max);
        0.5 * thickest_m + OFF_M
    }

    /// All round the way, its ends included.
    fn stand_along(&self, things: &mut Things<'_>, mut line: Vec<Vec2>, rng: &mut Rng) {
        /// Begins at so many places of a row.
        const PIECE_SHARE: f64 = 0.05;
        /// A piece of wall ends so many places before the next thing.
        const BESIDE: f32 = 0.7;
        line.push(line[0]);
        let length_m = line_length_m(&line);
        let places = (length_m / self.spacing_m).ceil() as usize;
        let pitch_m = length_m / places as f32;
        let at = |place: f32| point_at(&line, place * pitch_m);
        let (mut place, mut is_missing) = (0, true);
        while place < places {
            if let Some(wall) = self.wall.filter(|_| rng.random_bool(PIECE_SHARE)) {
                let taken = rng.random_range(2..=4);
                let from = place as f32 - (1.0 - BESIDE);
                let to = (place + taken) as f32 - BESIDE;
                let strays_m = (to - from) * pitch_m - at(from).distance(at(to));
                if (1..=places - taken).contains(&place) && strays_m < 0.01 {
                    for piece in wall.straight(at(from), at(to)) {
                        things.stand(piece);
                    }
                    (place, is_missing) = (place + taken, false);
                    continue;
                }
            }
            is_missing = !is_missing && rng.random_bool(self.missing);
            if !is_missing {
                let off = OFF_M * maths::unit(rng.random_range(-PI..PI));
                things.stand(things::obstacle(self.class(rng), at(place as f32) + off, 0.0));
            }
            place += 1;
        }
    }
}

/// One or two in the lane, where it is straight; too near to the row for a way on their other side.
fn in_the_lane(things: &mut Things<'_>, strip: &Strip, class: ObstacleClass, rng: &mut Rng) {
    const TRIES: usize = 40;
    /// Straight before and behind, metres.
    const STRAIGHT_M: i32 = 4;
    /// Between it and the row at most, metres.
    const BESIDE_M: f32 = 1.6;
    let rules = Rules { gap_m: 2.9, apart_m: 12.0, corner_clear_m: 7.0 };
    let mut left = rng.random_range(1..=2);
    for _ in 0..TRIES {
        let (side, s_m) = (side(rng), rng.random_range(0.0..strip.length_m()));
        let room_m = 2.0 * strip.half_width_m(s_m) - rules.gap_m - 0.02;
        let protrusion_m = rng.random_range(0.45..room_m.min(BESIDE_M + class.default_size_m()[1]));
        let is_straight = (-STRAIGHT_M..=STRAIGHT_M).all(|k| strip.curvature_per_m(s_m + k as f32) == 0.0);
        let thing = things.beside(class, side, s_m, protrusion_m, 0.0);
        if left > 0 && is_straight && things.narrow(thing, side, s_m, &rules) {
            left -= 1;
        }
    }
}

/// A few cars, huts and small things on the ground around, off the way.
fn around(things: &mut Things<'_>, way: &[Vec2], boundary: &[Vec2], rng: &mut Rng) {
    /// From the boundary, metres.
    const INSIDE_M: f32 = 4.0;
    let (low, high) = (boundary[0] + INSIDE_M, boundary[2] - INSIDE_M);
    for _ in 0..rng.random_range(3..14) {
        let at = Vec2::new(rng.random_range(low.x..high.x), rng.random_range(low.y..high.y));
        let heading_rad = rng.random_range(-PI..PI);
        let thing = match rng.random_range(0..4) {
            0 => {
                let mut size = |range: Range<f32>| Some(tenths(rng.random_range(range)));
                let (length_m, width_m, height_m) = (size(2.0..6.0), size(2.0..3.0), size(2.0..3.2));
                Obstacle { length_m, width_m, height_m, ..things::obstacle(ObstacleClass::Wall, at, heading_rad) }
            }
            1 => {
                use ObstacleClass::{Cart, Cone, Person, Pillar};
                things::obstacle([Cone, Person, Cart, Pillar][rng.random_range(0..4)], at, heading_rad)
            }
            _ => things::obstacle(draw_car(rng), at, heading_rad),
        };
        if !is_on(way, &thing.outline()) {
            things.stand(thing);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::split::{Family, Split};
    use sim::geometry::{distance_to_segment_m, edges};
    use sim::seed::Stream;

    /// Half of the widest gap is as far as the row is from its things.
    #[test]
    fn no_gap_in_a_row_lets_the_car_through() {
        for index in 0..24 {
            let seed = Split::Test.seed(Family::Cones, index);
            let drawn = draw(&mut seed.rng(Stream::Layout, 0), &mut seed.rng(Stream::Obstacles, 0));
            let Some((scenario, strip)) = drawn else { continue };
            let outlines: Vec<_> = scenario.obstacles.iter().map(Obstacle::outline).collect();
            let mut line = strip.outline(0.2);
            line.push(line[0]);
            for k in 0..(line_length_m(&line) / 0.05) as usize {
                let point = point_at(&line, k as f32 * 0.05);
                let is_near = outlines
                    .iter()
                    .filter(|outline| outline[0].distance(point) < 8.0)
                    .any(|outline| edges(outline).any(|(a, b)| distance_to_segment_m(point, a, b) < 0.91));
                assert!(is_near, "test-cones-{index}: a gap at {point}");
            }
        }
    }
}
