//! Ways whose edges, width and furniture change as they go, so that a driver learns what ground has in common and not a few
//! kinds by heart: walls, kerbs and solid ground, niches, combs of bays, rows of anything with free ground behind, things in
//! the way of any shape at any angle.

use super::chicanes;
use super::course::{Course, first_apart, lacking_at_corner_m};
use super::parts::{RUN_OUT_M, enclosed, lot, solid_height_m, things_on};
use super::strip::{Notch, Strip, Stub, is_on, is_simple, line_length_m, point_at};
use super::things::{self, Thing, Things, round_bed, side};
use super::walls::{Wall, yard};
use super::yards;
use crate::clutter::draw_car;
use crate::corridor::{STALL_DEPTH_M, Side};
use rand::RngExt as _;
use sim::geometry::Vec2;
use sim::maths;
use sim::scenario::{ObstacleClass, Scenario};
use sim::seed::Rng;
use std::f32::consts::FRAC_PI_2;
use std::ops::Range;

/// Widths of the way, metres.
const NARROW_M: Range<f32> = 3.3..4.6;
const WIDE_M: Range<f32> = 4.6..8.0;
const OPEN_M: Range<f32> = 8.0..14.0;
/// Radii of the centre line, metres: of bends, and of hairpins.
const RADIUS_M: Range<f32> = 7.0..30.0;
const TIGHT_M: Range<f32> = 7.0..11.0;
/// The centre line between the run-outs, metres.
const LENGTH_M: Range<f32> = 85.0..160.0;
/// Straight pieces, metres.
const STRAIGHT_M: Range<f32> = 5.0..40.0;
/// The course may turn back, but not round.
const LIMIT_DEG: f32 = 170.0;
/// The legs of a way that turns back, how far their middles are apart at least, and what is between them, metres.
const BACK_M: Range<f32> = 12.0..26.0;
const LEGS_APART_M: f32 = 10.4;
const BETWEEN_LEGS_M: Range<f32> = 0.8..4.0;
/// Widths of gates, metres.
const GATE_M: Range<f32> = 3.0..3.8;
/// Twice this is left between the way and itself, metres.
const APART_M: f32 = 0.35;
/// Left behind a recess, metres.
const BEHIND_RECESS_M: f32 = 1.6;
/// Ground is free so far behind a wall, and around a way that rows mark, metres.
const BEHIND_M: Range<f32> = 2.0..12.0;
const AROUND_M: Range<f32> = 10.0..20.0;
/// Deeper recesses than a stall are closed at their mouth by a row; they are at most this deep, metres.
const DEEP_M: f32 = 9.0;
/// Free between two things of a row at most, metres: the car is 1.86 m wide.
const GAP_MAX_M: f32 = 1.5;
/// A row stands so far behind the edge of the way, metres.
const OFF_M: f32 = 0.04;
/// A row changes its kind after so many metres.
const CHANGES_M: Range<f32> = 8.0..40.0;

pub(super) fn draw(layout: &mut Rng, obstacles: &mut Rng) -> Option<(Scenario, Strip)> {
    let mut strip = first_apart(layout, APART_M, course)?;
    let palette = Palette::draw(obstacles);
    if layout.random_bool(0.3) {
        return Some((marked_by_rows(&strip, &palette, layout, obstacles), strip));
    }
    let way = strip.outline(0.0);
    cut_edges(&mut strip, layout);
    let mut things = things_on(&strip);
    for notch in &strip.notches {
        if notch.depth_m > STALL_DEPTH_M {
            let mouth = strip.mouth(notch);
            palette.stand_along(&mut things, &[mouth.a, mouth.b], &way, obstacles);
        }
        if notch.depth_m > 0.0 && obstacles.random_bool(0.5) {
            stand_in(&mut things, &strip, notch, &way, obstacles);
        }
    }
    furnish(&mut things, &strip, obstacles);
    let wall = match layout.random_range(0..10) {
        0..5 => None,
        5..7 => Some(Wall::tall(layout)),
        7..9 => Some(Wall::low(layout)),
        _ => Some(Wall::kerb()),
    };
    Some((enclosed(&strip, things, wall, BEHIND_M, layout), strip))
}

/// On open ground: nothing but rows says where the way runs.
fn marked_by_rows(strip: &Strip, palette: &Palette, layout: &mut Rng, obstacles: &mut Rng) -> Scenario {
    let mut things = things_on(strip);
    let way = strip.outline(0.0);
    let mut line = way.clone();
    line.push(line[0]);
    palette.stand_along(&mut things, &line, &way, obstacles);
    furnish(&mut things, strip, obstacles);
    let boundary = yard(&way, AROUND_M, layout);
    let boundary_height_m = solid_height_m(layout);
    Scenario { boundary_height_m, ..lot(strip, boundary, things) }
}

fn width_m(rng: &mut Rng) -> f32 {
    let of = match rng.random_range(0..20) {
        0..9 => NARROW_M,
        9..16 => WIDE_M,
        _ => OPEN_M,
    };
    rng.random_range(of)
}

fn course(rng: &mut Rng) -> Course {
    let mut course = Course::new(width_m(rng));
    let until_m = RUN_OUT_M + rng.random_range(LENGTH_M);
    course.straight(RUN_OUT_M + rng.random_range(6.0..20.0));
    while course.length_m() < until_m {
        let before_m = course.width_m();
        let after_m = if rng.random_bool(0.4) { before_m } else { width_m(rng) };
        match rng.random_range(0..20) {
            // A right angle.
            0..4 => {
                let turn_rad = course.turn_rad(rng, 90.0..90.1, LIMIT_DEG).signum() * FRAC_PI_2;
                let stub = match rng.random_range(0..10) {
                    0..2 => Some(Stub::Ahead(rng.random_range(0.5..4.5))),
                    2..4 => Some(Stub::Behind(rng.random_range(0.5..4.5))),
                    _ => None,
                };
                let lacking_m = lacking_at_corner_m(before_m, after_m);
                course.corner(turn_rad, lacking_m * rng.random_range(1.3..1.8), stub);
            }
            // Back round the end of a wall, or of whatever is between, once or twice.
            4..7 => {
                let turn_rad = course.turn_rad(rng, 90.0..90.1, LIMIT_DEG - 90.0).signum() * FRAC_PI_2;
                turn_back(&mut course, turn_rad, rng);
                if rng.random_bool(0.4) {
                    turn_back(&mut course, -turn_rad, rng);
                } else {
                    // Away from the way before.
                    bend(&mut course, rng.random_range(RADIUS_M), -turn_rad * rng.random_range(0.4..1.1));
                }
            }
            // A hairpin.
            7 => {
                let turn_rad = course.turn_rad(rng, 150.0..180.0, LIMIT_DEG);
                course.widen(before_m.max(4.2));
                course.bend(rng.random_range(TIGHT_M), turn_rad);
            }
            // An S.
            8..11 => {
                let turn_rad = course.turn_rad(rng, 20.0..90.0, LIMIT_DEG);
                bend(&mut course, rng.random_range(RADIUS_M), turn_rad);
                bend(&mut course, rng.random_range(RADIUS_M), -turn_rad);
            }
            11..16 => {
                let turn_rad = course.turn_rad(rng, 20.0..140.0, LIMIT_DEG);
                bend(&mut course, rng.random_range(RADIUS_M), turn_rad);
            }
            // A gate.
            16..18 => {
                course.widen(rng.random_range(GATE_M));
                course.straight(rng.random_range(0.3..4.0));
            }
            _ => {}
        }
        course.widen(after_m);
        course.straight(rng.random_range(STRAIGHT_M));
    }
    course.straight(RUN_OUT_M);
    course
}

/// Two right angles to the same side.
fn turn_back(course: &mut Course, turn_rad: f32, rng: &mut Rng) {
    let width_m = course.width_m().clamp(4.2, 9.4);
    course.widen(width_m);
    course.straight(rng.random_range(BACK_M));
    course.corner(turn_rad, 0.0, None);
    course.widen(width_m + 1.5);
    course.straight((width_m + rng.random_range(BETWEEN_LEGS_M)).max(LEGS_APART_M));
    course.corner(turn_rad, 0.0, None);
    course.widen(width_m);
    course.straight(rng.random_range(BACK_M));
}

/// A bend, widened if it is tight and narrow.
fn bend(course: &mut Course, radius_m: f32, turn_rad: f32) {
    let width_m = course.width_m();
    let least_m = if radius_m < 12.0 { 4.0 } else { 3.4 };
    course.widen(width_m.max(least_m));
    course.bend(radius_m, turn_rad);
    course.widen(width_m);
}

/// Recesses of the straight edges, where ground is left behind them.
fn cut_edges(strip: &mut Strip, rng: &mut Rng) {
    for notch in recesses(strip, rng) {
        strip.notches.push(Notch { depth_m: notch.depth_m + BEHIND_RECESS_M, ..notch });
        let is_apart = is_simple(&strip.outline(0.0));
        strip.notches.pop();
        if is_apart {
            strip.notches.push(notch);
        }
    }
}

/// What straight edges might be like.
fn recesses(strip: &Strip, rng: &mut Rng) -> Vec<Notch> {
    /// From where the edge begins or ends, metres.
    const CLEAR_M: f32 = 1.5;
    let mut notches = Vec::new();
    for (from_m, to_m) in strip.straights() {
        for side in Side::BOTH {
            let (low_m, high_m) = (from_m + CLEAR_M, to_m - CLEAR_M);
            let mut cut = |from_m: f32, to_m: f32, depth_m: f32| {
                if from_m >= low_m && to_m <= high_m {
                    notches.push(Notch { side, from_m, to_m, depth_m });
                }
            };
            match rng.random_range(0..20) {
                // Niches of all sizes, and what juts out.
                0..5 => {
                    let mut at_m = low_m + rng.random_range(0.0..4.0);
                    while at_m < high_m {
                        let length_m = rng.random_range(0.5..6.0);
                        let depth_m =
                            if rng.random_bool(0.2) { -rng.random_range(0.1..0.4) } else { rng.random_range(0.3..4.5) };
                        cut(at_m, at_m + length_m, depth_m);
                        at_m += length_m + rng.random_range(0.5..6.0);
                    }
                }
                // A comb.
                5..8 => {
                    let (bay_m, between_m) = (rng.random_range(1.0..4.0), rng.random_range(0.2..1.5));
                    let depth_m = rng.random_range(0.6..STALL_DEPTH_M);
                    let mut at_m = low_m;
                    while at_m < high_m {
                        cut(at_m, at_m + bay_m, depth_m);
                        at_m += bay_m + between_m;
                    }
                }
                // One long bay, or ground behind a row.
                8..15 => {
                    let depth_m = rng.random_range(2.0..DEEP_M);
                    let (from, to) = (rng.random_range(0.0..0.3), rng.random_range(0.7..1.0));
                    let length_m = high_m - low_m;
                    if length_m > 4.0 {
                        cut(low_m + from * length_m, low_m + to * length_m, depth_m);
                    }
                }
                _ => {}
            }
        }
    }
    notches
}

/// What rows are made of.
#[derive(Clone, Copy)]
enum Kind {
    Small(ObstacleClass),
    Tree,
    Box,
    Fence,
    Kerb,
    Parked,
    ParkedAcross,
    Bed,
}

/// The kinds of rows of a lot.
struct Palette(Vec<Kind>);

impl Palette {
    fn draw(rng: &mut Rng) -> Self {
        use Kind::{Bed, Box, Fence, Kerb, Parked, ParkedAcross, Small, Tree};
        use ObstacleClass::{Bollard, Cart, Cone, Person, Pillar};
        const SMALL: [ObstacleClass; 5] = [Cone, Bollard, Pillar, Cart, Person];
        let kind = |rng: &mut Rng| match rng.random_range(0..12) {
            0..5 => Small(SMALL[rng.random_range(0..SMALL.len())]),
            large => [Tree, Box, Fence, Kerb, Parked, ParkedAcross, Bed][large - 5],
        };
        Self((0..rng.random_range(1..=4)).map(|_| kind(rng)).collect())
    }

    /// From the beginning of a line to its end, to the right of it and off the way. No gap lets the car through.
    fn stand_along(&self, things: &mut Things<'_>, line: &[Vec2], way: &[Vec2], rng: &mut Rng) {
        let length_m = line_length_m(line);
        let (mut kind, mut gap_m, mut until_m) = (self.0[0], 0.0, 0.0);
        let mut at_m = rng.random_range(0.0..0.1);
        while at_m < length_m - 0.1 {
            if at_m >= until_m {
                kind = self.0[rng.random_range(0..self.0.len())];
                gap_m = rng.random_range(0.2..GAP_MAX_M);
                until_m = at_m + rng.random_range(CHANGES_M);
            }
            let along_m = kind.stand(things, line, at_m, way, rng);
            let along_m = along_m.or_else(|| Kind::Small(ObstacleClass::Bollard).stand(things, line, at_m, way, rng));
            // Where something stands already, and beside a bend, the next one follows at once.
            at_m += along_m.map_or(0.1, |along_m| along_m + gap_m * rng.random_range(0.6..1.0));
        }
    }
}

impl Kind {
    /// Takes so many metres of a line from a place on, if the line is straight there and nothing else is in the way.
    fn stand(self, things: &mut Things<'_>, line: &[Vec2], at_m: f32, way: &[Vec2], rng: &mut Rng) -> Option<f32> {
        /// What a line may bend beside a thing, metres.
        const STRAYS_M: f32 = 0.02;
        use ObstacleClass::{Curb, Pillar, Wall};
        let car = draw_car(rng);
        let [car_length_m, car_width_m, car_height_m] = car.default_size_m();
        // Along the line, across it, and its height, metres.
        let (class, [mut along_m, across_m, height_m]) = match self {
            Self::Small(class) => (class, class.default_size_m()),
            Self::Tree | Self::Bed => {
                let across_m = if matches!(self, Self::Tree) { 0.25..0.9 } else { 1.0..2.0 };
                let across_m = rng.random_range(across_m);
                (Pillar, [across_m, across_m, 4.0])
            }
            Self::Box => (Wall, [rng.random_range(0.5..5.0), rng.random_range(0.3..2.0), rng.random_range(0.4..2.6)]),
            Self::Fence => (Wall, [rng.random_range(2.0..9.0), 0.12, rng.random_range(0.8..2.2)]),
            Self::Kerb => (Curb, [rng.random_range(2.0..9.0), 0.2, 0.15]),
            Self::Parked => (car, [car_length_m, car_width_m, car_height_m]),
            Self::ParkedAcross => (car, [car_width_m, car_length_m, car_height_m]),
        };
        let left_m = line_length_m(line) - at_m;
        if matches!(self, Self::Box | Self::Fence | Self::Kerb) {
            along_m = along_m.min(left_m);
        }
        let (from, to) = (point_at(line, at_m), point_at(line, at_m + along_m));
        if along_m > left_m + 0.2 || from.distance(to) < along_m.min(left_m) - STRAYS_M || from.distance(to) < 0.05 {
            return None;
        }
        let ahead = (to - from).normalize();
        let centre = from + 0.5 * along_m * ahead - (OFF_M + 0.5 * across_m) * ahead.perp();
        let heading_rad = maths::angle_rad(ahead);
        let thing = match self {
            Self::Bed => Thing::from(round_bed(centre, 0.5 * across_m, if rng.random_bool(0.7) { 0.15 } else { 0.8 })),
            Self::Small(_) | Self::Parked => things::obstacle(class, centre, heading_rad).into(),
            Self::ParkedAcross => things::obstacle(class, centre, heading_rad + FRAC_PI_2).into(),
            _ => things::sized(class, centre, heading_rad, [along_m, across_m, height_m]).into(),
        };
        (!is_on(way, &thing.outline()) && things.stand(thing)).then_some(along_m)
    }
}

/// Vehicles or boxes side by side in a recess, at a slant.
fn stand_in(things: &mut Things<'_>, strip: &Strip, notch: &Notch, way: &[Vec2], rng: &mut Rng) {
    let slant_rad = rng.random_range(30.0_f32..=90.0).to_radians() * side(rng).sign();
    let (sin, cos) = maths::sin_cos(slant_rad.abs());
    let box_m = [rng.random_range(1.0..5.5), rng.random_range(0.5..2.4), rng.random_range(0.4..2.6)];
    let (is_car, empty) = (rng.random_bool(0.5), rng.random_range(0.0..0.5));
    let between_m = rng.random_range(0.2..1.2);
    let mut at_m = notch.from_m;
    loop {
        let car = draw_car(rng);
        let [length_m, width_m, height_m] = if is_car { car.default_size_m() } else { box_m };
        let along_m = length_m * cos + width_m * sin;
        let (s_m, d_m) = (at_m + 0.5 * along_m, 0.1 + 0.5 * (length_m * sin + width_m * cos));
        if at_m + along_m > notch.to_m {
            return;
        }
        let at = strip.point(s_m, notch.side.sign() * (strip.half_width_m(s_m) + d_m));
        let heading_rad = strip.pose(s_m).heading_rad + slant_rad;
        let class = if is_car { car } else { ObstacleClass::Wall };
        let thing = things::sized(class, at, heading_rad, [length_m, width_m, height_m]);
        if !rng.random_bool(empty) && d_m < notch.depth_m && !is_on(way, &thing.outline()) {
            things.stand(thing);
        }
        at_m += (width_m + between_m) / sin;
    }
}

/// What stands in the way, stretch by stretch.
fn furnish(things: &mut Things<'_>, strip: &Strip, rng: &mut Rng) {
    for (from_m, to_m) in strip.straights() {
        match rng.random_range(0..10) {
            0..6 => yards::scatter(things, strip, from_m..to_m, rng),
            6..9 => chicanes::barriers(things, strip, from_m..to_m, rng),
            _ => {}
        }
    }
}
