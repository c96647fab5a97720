//! How centre lines are drawn.

use super::strip::{Corner, Piece, Strip, Stub};
use rand::RngExt as _;
use sim::geometry::Pose;
use sim::seed::Rng;
use std::ops::Range;

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

/// Of centre lines, run-outs included, metres.
const LENGTH_M: Range<f32> = 116.0..236.0;

/// The first of some draws whose strip keeps apart from itself by twice a distance.
pub(super) fn first_apart(rng: &mut Rng, distance_m: f32, mut draw: impl FnMut(&mut Rng) -> Course) -> Option<Strip> {
    const TRIES: usize = 40;
    (0..TRIES)
        .filter_map(|_| draw(rng).strip())
        .find(|strip| LENGTH_M.contains(&strip.length_m()) && strip.keeps_apart(distance_m))
}
