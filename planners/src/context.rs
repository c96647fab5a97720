//! The car a planner is installed in, and how a planner answers.

use sim::controller::{self, ControllerSettings, PursuitLaw};
use sim::driver::{Decision, LookAheadPoint, Source};
use sim::episode::EpisodeSettings;
use sim::geometry::{Pose, Vec2};
use sim::maths;
use sim::sensing::GridGeometry;
use sim::vehicle::VehicleSettings;
use std::f32::consts::FRAC_PI_2;

/// The car a planner is installed in: what it may know besides the grid.
#[derive(Debug, Clone, PartialEq)]
pub struct PlannerContext {
    /// Dimensions and limits.
    pub vehicle: VehicleSettings,
    /// Where the grid lies.
    pub geometry: GridGeometry,
    /// How an answer is turned into a command.
    pub controller: ControllerSettings,
    /// Between two answers, seconds.
    pub control_period_s: f32,
}

impl PlannerContext {
    /// The car of an episode.
    pub fn of(settings: &EpisodeSettings) -> Self {
        Self {
            vehicle: settings.vehicle.clone(),
            geometry: settings.sensing.geometry,
            controller: settings.controller.clone(),
            control_period_s: settings.control_period_s(),
        }
    }

    /// The middle of the front bumper, ego frame.
    pub(crate) fn bumper(&self) -> Vec2 {
        Vec2::new(self.vehicle.front_m(), 0.0)
    }

    /// Road-wheel angle of an arc of the rear axle, radians.
    pub(crate) fn steering_rad(&self, curvature_per_m: f32) -> f32 {
        maths::atan(curvature_per_m * self.vehicle.wheelbase_m)
    }

    /// Arc of the rear axle of a road-wheel angle, 1/m.
    pub(crate) fn curvature_per_m(&self, steering_rad: f32) -> f32 {
        maths::tan(steering_rad) / self.vehicle.wheelbase_m
    }

    /// What the controller would drive an arc with, m/s.
    pub(crate) fn speed_mps(&self, curvature_per_m: f32) -> f32 {
        let decision = self.steer_along(curvature_per_m);
        controller::pursue(&self.controller, &self.vehicle, &self.geometry, &decision).speed_mps
    }

    /// Answers with an arc of the rear axle: a point that the controller's form of pure pursuit turns back into it.
    pub(crate) fn steer_along(&self, curvature_per_m: f32) -> Decision {
        head_for(match self.controller.pursuit {
            // The circle through the point is the arc, wherever on it the point lies.
            PursuitLaw::Paper => {
                let travel_m = POINT_ON_ARC_M.min(FRAC_PI_2 / curvature_per_m.abs());
                Pose::default().advanced_along_arc(curvature_per_m, travel_m).position()
            }
            // tan δ (0.75 L_f + 0.3 cos η) = L sin η, solved for the bearing η from the bumper.
            PursuitLaw::AuthorsCode => {
                let tan = self.vehicle.wheelbase_m * curvature_per_m;
                let (across, along) = (self.vehicle.wheelbase_m, 0.3 * tan);
                let length = maths::hypot(across, along);
                let range_m = POINT_FROM_BUMPER_M.min(length / tan.abs());
                let bearing_rad = maths::atan2(along, across) + maths::asin(0.75 * tan * range_m / length);
                self.bumper() + range_m * maths::unit(bearing_rad)
            }
        })
    }

    /// The same, to be driven at no more than a speed, m/s.
    pub(crate) fn steer_along_at(&self, curvature_per_m: f32, speed_limit_mps: f32) -> Decision {
        Decision { speed_limit_mps: Some(speed_limit_mps), ..self.steer_along(curvature_per_m) }
    }
}

/// Travel along an arc at which it is answered with a point, metres; a quarter of a circle where that is shorter, for no
/// circle that is driven forwards reaches a point behind the axle. The paper's car drives none so tight.
const POINT_ON_ARC_M: f32 = 6.0;
/// The same for the authors' form of pursuit, from the front bumper, metres.
const POINT_FROM_BUMPER_M: f32 = 3.0;

/// Answers with a point, ego frame.
pub(crate) fn head_for(point: Vec2) -> Decision {
    let look_ahead = LookAheadPoint { ahead_m: point.x, left_m: point.y };
    Decision { look_ahead, source: Source::Planner, spread: None, speed_limit_mps: None }
}

/// Where the wheels probably stand. No planner is shown the wheel angle; it knows what it asked for and how fast the
/// wheels turn. The dead time (1.2 ticks) is not modelled.
#[derive(Debug, Clone, Copy)]
pub(crate) struct WheelEstimate {
    pub(crate) steering_rad: f32,
    /// Asked for last; the wheels are on their way to it.
    pub(crate) command_rad: f32,
    rate_rad_per_tick: f32,
    lock_rad: f32,
}

impl WheelEstimate {
    pub(crate) fn new(context: &PlannerContext) -> Self {
        let rate_rad_per_tick = context.vehicle.steering_rate_max_radps * context.control_period_s;
        Self { steering_rad: 0.0, command_rad: 0.0, rate_rad_per_tick, lock_rad: context.vehicle.steering_max_rad }
    }

    /// The angle one control period after the last command, radians.
    pub(crate) fn advance(&mut self) -> f32 {
        let (low, high) = (self.steering_rad - self.rate_rad_per_tick, self.steering_rad + self.rate_rad_per_tick);
        self.steering_rad = self.command_rad.clamp(-self.lock_rad, self.lock_rad).clamp(low, high);
        self.steering_rad
    }

    /// Straight wheels, as after a reset.
    pub(crate) fn reset(&mut self) {
        (self.steering_rad, self.command_rad) = (0.0, 0.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::context;

    /// The points of a short car's tighter arcs lay behind the axle, and it drove them at full lock.
    #[test]
    fn arcs_are_answered_with_points_that_pure_pursuit_drives_back() {
        let paper = context();
        let mut short = context();
        (short.vehicle.wheelbase_m, short.vehicle.steering_max_rad) = (1.0, 1.0);
        let cases: [(_, &[f32], f32); 2] =
            [(paper, &[-0.25, -0.1, 0.0, 0.001, 0.03, 0.25], 3.0), (short, &[-0.6, 0.0, 0.3, 0.6, 0.9], 1.0)];
        for (mut context, curvatures, ahead_min_m) in cases {
            for pursuit in [PursuitLaw::Paper, PursuitLaw::AuthorsCode] {
                context.controller.pursuit = pursuit;
                let (vehicle, geometry) = (&context.vehicle, &context.geometry);
                for &curvature in curvatures {
                    let decision = context.steer_along(curvature);
                    let steering_rad = controller::steering_rad(pursuit, vehicle, geometry, decision.look_ahead);
                    let driven = context.curvature_per_m(steering_rad);
                    assert!((driven - curvature).abs() < 1e-5, "{pursuit:?}: {curvature}, driven {driven}");
                    assert!(decision.look_ahead.ahead_m > ahead_min_m);
                    assert_eq!(decision.source, Source::Planner);
                }
            }
        }
        assert!((context().speed_mps(0.0) - 2.2).abs() < 1e-6 && (context().speed_mps(0.2507) - 0.5).abs() < 1e-3);
    }

    #[test]
    fn the_wheels_turn_as_fast_as_they_can() {
        let mut wheel = WheelEstimate::new(&context());
        wheel.command_rad = 0.03;
        assert!((wheel.advance() - 0.0172).abs() < 1e-6); // 0.344 rad/s · 50 ms
        assert!((wheel.advance() - 0.03).abs() < 1e-6);
        wheel.command_rad = 9.0;
        let angles_rad = (0..100).map(|_| wheel.advance());
        assert_eq!(angles_rad.last(), Some(context().vehicle.steering_max_rad), "they stop at the lock");
        wheel.reset();
        assert_eq!(wheel.advance(), 0.0);
    }
}
