//! How centre lines are drawn.

use super::parts::RUN_OUT_M;
use super::strip::{Corner, Piece, Strip, Stub};
use rand::RngExt as _;
use sim::geometry::Pose;
use sim::seed::Rng;
use std::ops::{Range, RangeInclusive};

/// A centre line while it is drawn, along world +x at first.
pub(super) struct Course {
    pieces: Vec<Piece>,
    width_m: f32,
    heading_rad: f32,
    length_m: f32,
}

impl Course {
    pub(super) fn new(width_m: f32) -> Self {
        Self { pieces: Vec::new(), width_m, heading_rad: 0.0, length_m: 0.0 }
    }

    /// Along the centre line, metres.
    pub(super) fn length_m(&self) -> f32 {
        self.length_m
    }

    pub(super) fn width_m(&self) -> f32 {
        self.width_m
    }

    /// What follows has another width.
    pub(super) fn widen(&mut self, width_m: f32) {
        self.width_m = width_m;
    }

    pub(super) fn straight(&mut self, length_m: f32) {
        self.length_m += length_m;
        self.pieces.push(Piece::Straight { length_m, width_m: self.width_m });
    }

    pub(super) fn bend(&mut self, radius_m: f32, turn_rad: f32) {
        self.heading_rad += turn_rad;
        self.length_m += radius_m * turn_rad.abs();
        self.pieces.push(Piece::Arc { radius_m, turn_rad, width_m: self.width_m });
    }

    pub(super) fn corner(&mut self, turn_rad: f32, chamfer_m: f32, stub: Option<Stub>) {
        self.heading_rad += turn_rad;
        self.pieces.push(Piece::Corner(Corner { turn_rad, chamfer_m, stub }));
    }

    /// A turn by some degrees to either side, but not on to where the course would head more than `limit_deg` away from
    /// where it began.
    pub(super) fn turn_rad(&self, rng: &mut Rng, degrees: Range<f32>, limit_deg: f32) -> f32 {
        let angle_rad = rng.random_range(degrees).to_radians();
        let turn_rad = if rng.random_bool(0.5) { angle_rad } else { -angle_rad };
        if (self.heading_rad + turn_rad).abs() > limit_deg.to_radians() { -turn_rad } else { turn_rad }
    }

    pub(super) fn strip(&self) -> Option<Strip> {
        Strip::new(Pose::default(), &self.pieces)
    }
}

/// Parallel aisles, joined by cross aisles at their ends.
#[allow(clippy::struct_field_names, reason = "the postfix is the unit")]
pub(super) struct Aisles {
    /// How many at least and at most.
    pub(super) count: RangeInclusive<i32>,
    pub(super) aisle_m: f32,
    pub(super) cross_m: f32,
    /// The piece of an aisle that is driven, corner to corner, metres.
    pub(super) leg_m: f32,
    /// The centre line at most, run-outs included, metres.
    pub(super) length_max_m: f32,
}

impl Aisles {
    /// Up and down all of them. To each next one: how far it is, what is cut off the corners there, metres, and what
    /// is beside the way at either corner.
    pub(super) fn up_and_down(
        &self,
        rng: &mut Rng,
        mut pitch_m: impl FnMut(&mut Rng) -> f32,
        mut chamfer_m: impl FnMut(&mut Rng) -> f32,
        beside: fn(&mut Rng) -> Option<Stub>,
    ) -> Course {
        let Self { ref count, aisle_m, cross_m, leg_m, length_max_m } = *self;
        let mut turn_rad = if rng.random_bool(0.5) { 1.0 } else { -1.0 } * std::f32::consts::FRAC_PI_2;
        let mut course = Course::new(aisle_m);
        course.straight(RUN_OUT_M + leg_m * rng.random_range(0.4..1.0));
        let aisles = rng.random_range(count.clone());
        for k in 1..aisles {
            let pitch_m = pitch_m(rng);
            let needs_m = pitch_m + if k == aisles - 1 { 0.0 } else { leg_m };
            if course.length_m() + needs_m > length_max_m {
                break;
            }
            let chamfer_m = chamfer_m(rng);
            course.corner(turn_rad, chamfer_m, beside(rng));
            course.widen(cross_m);
            course.straight(pitch_m);
            course.corner(turn_rad, chamfer_m, beside(rng));
            course.widen(aisle_m);
            course.straight(if k == aisles - 1 { leg_m * rng.random_range(0.4..1.0) + RUN_OUT_M } else { leg_m });
            turn_rad = -turn_rad;
        }
        course
    }
}

/// What two corridors lack to what is comfortable at a sharp corner between them, metres (docs/methods.md 11 has the
/// least); so much of the inner corner is to be cut off, and more. The narrower one counts more.
pub(super) fn lacking_at_corner_m(before_m: f32, after_m: f32) -> f32 {
    const COMFORTABLE_M: f32 = 5.8;
    (COMFORTABLE_M - 0.65 * before_m.min(after_m) - 0.35 * before_m.max(after_m)).max(0.0)
}

/// Lengths of centre lines, run-outs included, metres.
const LENGTH_M: Range<f32> = 116.0..236.0;

/// The first of some draws whose strip keeps apart from itself by twice a distance.
pub(super) fn first_apart(rng: &mut Rng, distance_m: f32, mut draw: impl FnMut(&mut Rng) -> Course) -> Option<Strip> {
    const TRIES: usize = 40;
    (0..TRIES)
        .filter_map(|_| draw(rng).strip())
        .find(|strip| LENGTH_M.contains(&strip.length_m()) && strip.keeps_apart(distance_m))
}
