//! Forecast of the body along an arc, with the steering-rate limit.

use crate::line_of_sight::KnownGround;
use sim::geometry::{Pose, Vec2};
use sim::maths;
use sim::vectors::{FourPoints, f32x4};
use sim::vehicle::VehicleSettings;

/// Largest turn of a step that forecasts hold for, radians: its sine and cosine are then right to 2·10⁻⁵, and its way is taken
/// to be 1 % longer than it is. By default steps turn by less than 0.08 rad.
pub const STEP_TURN_MAX_RAD: f32 = 0.5;
/// Discs that cover the body with its lengthened nose.
const DISCS: usize = 6;
/// Those that are enough along an arc: nose, middle and rear axle.
const COARSE_DISCS: [usize; 3] = [5, 3, 1];

/// A moving rear axle. No angle is kept: a step needs no trigonometry.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Motion {
    /// Rear axle, world.
    pub(crate) position: Vec2,
    /// Unit vector ahead, world.
    pub(crate) ahead: Vec2,
    /// Present curvature, 1/m.
    pub(crate) curvature_per_m: f32,
}

impl Motion {
    pub(crate) fn new(pose: Pose, curvature_per_m: f32) -> Self {
        Self { position: pose.position(), ahead: pose.ahead(), curvature_per_m }
    }

    /// After another `travel_m` on which the curvature moves towards `target_per_m`, at most by `change_per_m`.
    #[must_use]
    #[inline]
    pub(crate) fn step(self, target_per_m: f32, change_per_m: f32, travel_m: f32) -> Self {
        let next_per_m = self.next_curvature_per_m(target_per_m, change_per_m);
        let half_turn = HalfTurn::new(self.curvature_per_m + next_per_m, travel_m);
        Self { curvature_per_m: next_per_m, ..self.turn(half_turn, travel_m) }
    }

    /// After another `travel_m` at the present curvature, given its half turn: [`Self::step`] without a change, to the bit.
    #[must_use]
    #[inline]
    pub(crate) fn turn(self, half_turn: HalfTurn, travel_m: f32) -> Self {
        // The chord of a step points along its mean heading; its shortening is below 0.1 mm.
        let along = half_turn.0.rotate(self.ahead);
        Self { position: self.position + along * travel_m, ahead: half_turn.0.rotate(along), ..self }
    }

    /// Whether a step towards `target_per_m` gets there.
    #[inline]
    pub(crate) fn reaches(self, target_per_m: f32, change_per_m: f32) -> bool {
        self.next_curvature_per_m(target_per_m, change_per_m) == target_per_m
    }

    /// Four points on the vehicle axis, world.
    #[expect(
        clippy::inline_always,
        reason = "called, it takes motions through memory: numbers that are stored, and loaded as vectors"
    )]
    #[inline(always)]
    fn four_on_axis(self, ahead_m: f32x4) -> FourPoints {
        FourPoints::splat(self.position) + FourPoints::splat(self.ahead) * ahead_m
    }

    #[inline]
    fn next_curvature_per_m(self, target_per_m: f32, change_per_m: f32) -> f32 {
        target_per_m.clamp(self.curvature_per_m - change_per_m, self.curvature_per_m + change_per_m)
    }

    /// A point on the vehicle axis, world.
    #[inline]
    pub(crate) fn on_axis(self, ahead_m: f32) -> Vec2 {
        self.position + self.ahead * ahead_m
    }
}

/// Half of what the heading changes by in one step, as a rotation.
#[derive(Debug, Clone, Copy)]
pub(crate) struct HalfTurn(Vec2);

impl HalfTurn {
    /// The half turn of a step at whose ends the curvatures have this sum.
    #[inline]
    pub(crate) fn new(sum_per_m: f32, travel_m: f32) -> Self {
        let half_turn = 0.25 * sum_per_m * travel_m;
        let square = half_turn * half_turn;
        // cos and sin to 4th and 3rd order: small turns (`STEP_TURN_MAX_RAD`).
        Self(Vec2::new(1.0 - square * (0.5 - square / 24.0), half_turn * (1.0 - square / 6.0)))
    }
}

/// The body, covered by discs, as the forecast sees it.
#[derive(Debug, Clone)]
#[expect(clippy::struct_field_names, reason = "lengths in metres, as everywhere")]
pub(crate) struct Footprint {
    /// Centres of the discs, metres ahead of the rear axle; the last one is repeated.
    disc_centres_m: [f32x4; 2],
    /// The same of the coarse discs.
    coarse_disc_centres_m: f32x4,
    nose_m: f32,
    /// Distance of a disc's centre to the nearest non-drivable point at which the clearance is 0, metres.
    keep_m: f32,
}

impl Footprint {
    pub(crate) fn new(vehicle: &VehicleSettings, nose_margin_m: f32, disc_relief_m: f32) -> Self {
        let segment_m = (vehicle.length_m + nose_margin_m) / DISCS as f32;
        let radius_m = maths::hypot(0.5 * segment_m, 0.5 * vehicle.width_m);
        let centre_m = |disc: usize| (disc as f32 + 0.5) * segment_m - vehicle.rear_overhang_m;
        let four_m = |of_lane: [usize; 4]| f32x4::from(of_lane.map(centre_m));
        let [nose, middle, rear] = COARSE_DISCS;
        Self {
            disc_centres_m: [four_m([0, 1, 2, 3]), four_m([4, 5, 5, 5])],
            coarse_disc_centres_m: four_m([nose, middle, rear, rear]),
            nose_m: centre_m(DISCS - 1),
            keep_m: radius_m - disc_relief_m,
        }
    }

    /// Centre of the foremost disc, metres ahead of the rear axle.
    pub(crate) fn nose_m(&self) -> f32 {
        self.nose_m
    }

    /// Distance of a disc's centre to the nearest non-drivable point at a clearance, metres.
    pub(crate) fn distance_m(&self, clearance_m: f32) -> f32 {
        clearance_m + self.keep_m
    }

    /// Clearance of the whole body, metres.
    #[inline]
    pub(crate) fn clearance_m(&self, ground: KnownGround<'_>, motion: Motion) -> f32 {
        let [rear, front] = self.disc_centres_m.map(|ahead_m| ground.at_four(motion.four_on_axis(ahead_m)));
        lowest_number(rear.fast_min(front)) - self.keep_m
    }

    /// Clearance of nose, middle and rear axle, metres, to within the raster's node spacing.
    ///
    /// Enough along an arc: its inner edge is swept by the rear axle, its outer edge by the nose, and what lies
    /// between them is met by the middle half a body length later than by all discs.
    #[expect(
        clippy::inline_always,
        reason = "called, it takes motions through memory: numbers that are stored, and loaded as vectors"
    )]
    #[inline(always)]
    pub(crate) fn coarse_clearance_m(&self, ground: KnownGround<'_>, motion: Motion) -> f32 {
        lowest_number(ground.at_four_nearest_nodes(motion.four_on_axis(self.coarse_disc_centres_m))) - self.keep_m
    }
}

/// The lowest lane, if all are numbers. A comparison is one instruction, and `f32::min` several.
#[inline]
fn lowest_number(values: f32x4) -> f32 {
    let lower = |a: f32, b: f32| if b < a { b } else { a };
    let [a, b, c, d] = values.to_array();
    lower(lower(a, b), lower(c, d))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_steps_follow_the_exact_arc() {
        for curvature in [-0.2326_f32, -0.05, 0.0, 0.11, 0.2326] {
            let mut motion = Motion::new(Pose::default(), curvature);
            (0..47).for_each(|_| motion = motion.step(curvature, 0.0, 0.3));
            let exact = Pose::default().advanced_along_arc(curvature, 47.0 * 0.3);
            assert!(motion.position.distance(exact.position()) < 0.01, "{curvature}: {motion:?}");
            assert!((motion.ahead.length() - 1.0).abs() < 1e-4);
            assert!(motion.ahead.distance(exact.ahead()) < 1e-3);
        }
    }

    #[test]
    fn forecasts_hold_for_the_largest_turn_of_a_step() {
        for (curvature_per_m, travel_m) in [(1.0, STEP_TURN_MAX_RAD), (-0.1, STEP_TURN_MAX_RAD / 0.1)] {
            let motion = Motion::new(Pose::default(), curvature_per_m).step(curvature_per_m, 0.0, travel_m);
            let exact = Pose::default().advanced_along_arc(curvature_per_m, travel_m);
            assert!(motion.ahead.distance(exact.ahead()) < 3e-5, "{motion:?}");
            assert!(motion.position.distance(exact.position()) < 0.012 * travel_m, "{motion:?}");
        }
    }

    #[test]
    fn the_footprint_is_that_of_the_findings() {
        let footprint = Footprint::new(&VehicleSettings::hyundai_hg300(), 0.5, 0.047);
        assert!((footprint.keep_m - 0.987).abs() < 1e-3);
        assert!((footprint.nose_m() + 0.45 - 4.3).abs() < 0.01);
    }

    #[test]
    fn steering_takes_its_time() {
        let mut motion = Motion::new(Pose::default(), 0.0);
        motion = motion.step(0.2, 0.024, 0.2);
        assert_eq!(motion.curvature_per_m, 0.024);
        (0..20).for_each(|_| motion = motion.step(0.2, 0.024, 0.2));
        assert_eq!(motion.curvature_per_m, 0.2);
    }
}
