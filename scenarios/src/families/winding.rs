//! Ground of one width that winds gently, what stands on it, and a wall, a kerb or solid ground at its edge: what yards and
//! chicanes have in common.

use super::course::{Course, first_apart};
use super::parts::{RUN_OUT_M, enclosed, things_on};
use super::strip::Strip;
use super::things::Things;
use super::walls::Wall;
use rand::RngExt as _;
use sim::scenario::Scenario;
use sim::seed::Rng;
use std::ops::Range;

/// The centre line between the run-outs, metres.
const LENGTH_M: Range<f32> = 85.0..170.0;
/// Ground is free so far behind a wall, metres.
const BEHIND_WALL_M: Range<f32> = 2.0..10.0;
/// The course heads at most this far away from where it began, degrees.
const LIMIT_DEG: f32 = 100.0;

/// How such ground is drawn.
pub(super) struct Winding {
    pub(super) width_m: Range<f32>,
    /// The straight piece behind the start, metres.
    pub(super) first_m: Range<f32>,
    /// The other ones, metres.
    pub(super) straight_m: Range<f32>,
    /// How often there is a bend between two of them.
    pub(super) bend_share: f64,
    pub(super) turn_deg: Range<f32>,
    pub(super) radius_m: Range<f32>,
    /// Of ten lots, so many end at solid ground; two at a kerb, two at a tall wall, the rest at a low one.
    pub(super) solid_of_ten: i32,
}

impl Winding {
    /// Draws a lot; `None` if the draw failed. `fill` puts things on the ground.
    pub(super) fn draw(
        &self,
        layout: &mut Rng,
        obstacles: &mut Rng,
        fill: fn(&mut Things<'_>, &Strip, &mut Rng),
    ) -> Option<(Scenario, Strip)> {
        let strip = first_apart(layout, 1.0, |rng| self.course(rng))?;
        let mut things = things_on(&strip);
        fill(&mut things, &strip, obstacles);
        let of_ten: i32 = layout.random_range(0..10);
        let wall = match of_ten - self.solid_of_ten {
            ..0 => None,
            0..2 => Some(Wall::kerb()),
            2..4 => Some(Wall::tall(layout)),
            4.. => Some(Wall::low(layout)),
        };
        let lot = enclosed(&strip, things, wall, BEHIND_WALL_M, layout);
        Some((lot, strip))
    }

    fn course(&self, rng: &mut Rng) -> Course {
        let mut course = Course::new(rng.random_range(self.width_m.clone()));
        let until_m = RUN_OUT_M + rng.random_range(LENGTH_M);
        course.straight(RUN_OUT_M + rng.random_range(self.first_m.clone()));
        while course.length_m() < until_m {
            if rng.random_bool(self.bend_share) {
                let turn_rad = course.turn_rad(rng, self.turn_deg.clone(), LIMIT_DEG);
                course.bend(rng.random_range(self.radius_m.clone()), turn_rad);
            }
            course.straight(rng.random_range(self.straight_m.clone()));
        }
        course.straight(RUN_OUT_M);
        course
    }
}
