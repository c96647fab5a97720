//! The car a planner is installed in, and how a planner answers.

use sim::controller::{self, ControllerSettings};
use sim::driver::{Decision, LookAheadPoint, Source};
use sim::episode::EpisodeSettings;
use sim::geometry::{Pose, Vec2};
use sim::maths;
use sim::sensing::GridGeometry;
use sim::vehicle::VehicleSettings;

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
        controller::pursue(&self.controller, &self.vehicle, &self.geometry, &steer_along(curvature_per_m)).speed_mps
    }
}

/// Travel along an arc at which it is answered with a point, metres. Pure pursuit about the rear axle drives the same arc for
/// any value; here the point is ahead of the axle at every curvature a car can drive. (With `pursuit = "authors_code"` the
/// car drives another arc than was chosen, a tighter one.)
pub(crate) const POINT_ON_ARC_M: f32 = 6.0;

/// Answers with an arc of the rear axle, to be driven at no more than a speed if one is given, m/s.
pub(crate) fn steer_along_at(curvature_per_m: f32, speed_limit_mps: Option<f32>) -> Decision {
    Decision { speed_limit_mps, ..steer_along(curvature_per_m) }
}

/// Answers with an arc of the rear axle.
pub(crate) fn steer_along(curvature_per_m: f32) -> Decision {
    head_for(Pose::default().advanced_along_arc(curvature_per_m, POINT_ON_ARC_M).position())
}

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
}

impl WheelEstimate {
    pub(crate) fn new(context: &PlannerContext) -> Self {
        let rate_rad_per_tick = context.vehicle.steering_rate_max_radps * context.control_period_s;
        Self { steering_rad: 0.0, command_rad: 0.0, rate_rad_per_tick }
    }

    /// The angle one control period after the last command, radians.
    pub(crate) fn advance(&mut self) -> f32 {
        let (low, high) = (self.steering_rad - self.rate_rad_per_tick, self.steering_rad + self.rate_rad_per_tick);
        self.steering_rad = self.command_rad.clamp(low, high);
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

    #[test]
    fn arcs_are_answered_with_points_that_pure_pursuit_drives_back() {
        for curvature in [-0.25, -0.1, 0.0, 0.03, 0.25] {
            let decision = steer_along(curvature);
            assert!((decision.look_ahead.curvature_per_m() - curvature).abs() < 1e-5);
            assert!(decision.look_ahead.ahead_m > 3.0);
            assert_eq!(decision.source, Source::Planner);
        }
        assert!((context().speed_mps(0.0) - 2.2).abs() < 1e-6 && (context().speed_mps(0.2507) - 0.5).abs() < 1e-3);
    }

    #[test]
    fn the_wheels_turn_as_fast_as_they_can() {
        let mut wheel = WheelEstimate::new(&context());
        wheel.command_rad = 0.03;
        assert!((wheel.advance() - 0.0172).abs() < 1e-6); // 0.344 rad/s · 50 ms
        assert!((wheel.advance() - 0.03).abs() < 1e-6);
        wheel.reset();
        assert_eq!(wheel.advance(), 0.0);
    }
}
