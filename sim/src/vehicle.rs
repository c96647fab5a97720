//! The car: parameters, state and command are three types, and [`step`] is a pure function of them.
//!
//! Kinematic bicycle about the rear axle with an exact arc step, a steering-rate limit and a PI speed loop
//! (docs/methods.md 2.1–2.3).

use crate::geometry::{Pose, Vec2};
use crate::maths;
use serde::{Deserialize, Serialize};

/// Dimensions and limits of the vehicle.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct VehicleSettings {
    /// Distance between the axles, metres (L in the paper).
    pub wheelbase_m: f32,
    /// Bumper to bumper, metres.
    pub length_m: f32,
    /// Without mirrors, metres.
    pub width_m: f32,
    /// Distance from the rear axle back to the rear bumper, metres.
    pub rear_overhang_m: f32,
    /// Largest road-wheel angle, radians.
    pub steering_max_rad: f32,
    /// Fastest change of the road-wheel angle, rad/s.
    pub steering_rate_max_radps: f32,
    /// Proportional gain of the speed loop, 1/s.
    pub speed_gain_p_per_s: f32,
    /// Integral gain of the speed loop, 1/s².
    pub speed_gain_i_per_s2: f32,
    /// Bound of the integral term (anti-windup), m/s².
    pub integral_max_mps2: f32,
    /// Strongest acceleration, m/s².
    pub accel_max_mps2: f32,
    /// Strongest service braking, m/s², positive.
    pub brake_max_mps2: f32,
    /// Emergency braking after a near-collision, m/s², positive.
    pub emergency_brake_mps2: f32,
    /// Fastest change of the demanded acceleration, m/s³.
    pub jerk_max_mps3: f32,
    /// Time constant of the drivetrain, seconds.
    pub drivetrain_lag_s: f32,
    /// Time from the instant an observation is taken to the instant the car obeys the command, seconds.
    pub dead_time_s: f32,
}

impl VehicleSettings {
    /// Hyundai HG 300 of the paper. Sources per number: docs/methods.md 2.1 and 2.3.
    pub fn hyundai_hg300() -> Self {
        Self {
            wheelbase_m: 2.845,
            length_m: 4.910,
            width_m: 1.860,
            rear_overhang_m: 1.11,
            steering_max_rad: 35.5_f32.to_radians(),
            // 300 °/s at the steering wheel; it turns ±540° (paper) for ±35.5°, a ratio of 15.2.
            steering_rate_max_radps: 0.344,
            speed_gain_p_per_s: 1.0,
            speed_gain_i_per_s2: 0.3,
            integral_max_mps2: 0.5,
            accel_max_mps2: 1.0,
            brake_max_mps2: 2.0,
            emergency_brake_mps2: 3.0,
            jerk_max_mps3: 2.0,
            drivetrain_lag_s: 0.3,
            dead_time_s: 0.061, // perception 20 + policy 10 + control 1 + actuator 30 ms (paper)
        }
    }

    /// Distance from the rear axle to the front bumper, metres.
    pub fn front_m(&self) -> f32 {
        self.length_m - self.rear_overhang_m
    }

    /// Tightest curvature at the rear axle, 1/m.
    pub fn curvature_max_per_m(&self) -> f32 {
        maths::tan(self.steering_max_rad) / self.wheelbase_m
    }

    /// Corners of the body in the ego frame, counter-clockwise from the front left.
    pub fn body_in_ego(&self) -> [Vec2; 4] {
        let (front, rear, side) = (self.front_m(), -self.rear_overhang_m, 0.5 * self.width_m);
        [Vec2::new(front, side), Vec2::new(rear, side), Vec2::new(rear, -side), Vec2::new(front, -side)]
    }
}

/// The state of a moving vehicle.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct VehicleState {
    /// Rear-axle pose in the world.
    pub pose: Pose,
    /// What the position lacks, metres: far from the origin single precision cannot hold what a step adds to it.
    #[serde(skip)]
    pub position_rest_m: Vec2,
    /// Forward speed, m/s.
    pub speed_mps: f32,
    /// Road-wheel angle, radians, positive to the left.
    pub steering_rad: f32,
    /// Acceleration the drivetrain delivers now, m/s².
    pub accel_mps2: f32,
    /// Demanded acceleration after the jerk limit, m/s².
    pub accel_demand_mps2: f32,
    /// Integral term of the speed loop, m/s².
    pub speed_integral_mps2: f32,
}

impl VehicleState {
    /// Standing still with straight wheels.
    pub fn at_rest(pose: Pose) -> Self {
        Self {
            pose,
            position_rest_m: Vec2::ZERO,
            speed_mps: 0.0,
            steering_rad: 0.0,
            accel_mps2: 0.0,
            accel_demand_mps2: 0.0,
            speed_integral_mps2: 0.0,
        }
    }

    /// Curvature of the present arc of the rear axle, 1/m, positive to the left.
    pub fn curvature_per_m(&self, settings: &VehicleSettings) -> f32 {
        maths::tan(self.steering_rad) / settings.wheelbase_m
    }
}

/// What the controller demands.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct VehicleCommand {
    /// Road-wheel angle, radians, positive to the left.
    pub steering_rad: f32,
    /// Forward speed, m/s.
    pub speed_mps: f32,
}

/// One physics step: actuators first, then the exact arc.
pub fn step(settings: &VehicleSettings, state: VehicleState, command: VehicleCommand, dt_s: f32) -> VehicleState {
    let error_mps = command.speed_mps - state.speed_mps;
    let integral = (state.speed_integral_mps2 + settings.speed_gain_i_per_s2 * error_mps * dt_s)
        .clamp(-settings.integral_max_mps2, settings.integral_max_mps2);
    let wanted =
        (settings.speed_gain_p_per_s * error_mps + integral).clamp(-settings.brake_max_mps2, settings.accel_max_mps2);
    let jerk_step = settings.jerk_max_mps3 * dt_s;
    let demand = wanted.clamp(state.accel_demand_mps2 - jerk_step, state.accel_demand_mps2 + jerk_step);
    let accel = state.accel_mps2 + (demand - state.accel_mps2) * (dt_s / settings.drivetrain_lag_s).min(1.0);
    let actuated = VehicleState { accel_demand_mps2: demand, speed_integral_mps2: integral, ..state };
    roll(settings, actuated, command.steering_rad, accel, dt_s)
}

/// One physics step of an emergency stop: full braking, wheels held.
pub fn step_emergency_stop(settings: &VehicleSettings, state: VehicleState, dt_s: f32) -> VehicleState {
    roll(settings, state, state.steering_rad, -settings.emergency_brake_mps2, dt_s)
}

fn roll(
    settings: &VehicleSettings,
    state: VehicleState,
    steering_rad: f32,
    accel_mps2: f32,
    dt_s: f32,
) -> VehicleState {
    let rate_step = settings.steering_rate_max_radps * dt_s;
    let steering_rad = steering_rad
        .clamp(-settings.steering_max_rad, settings.steering_max_rad)
        .clamp(state.steering_rad - rate_step, state.steering_rad + rate_step);
    let speed_mps = (state.speed_mps + accel_mps2 * dt_s).max(0.0);
    let travel_m = 0.5 * (state.speed_mps + speed_mps) * dt_s;
    let curvature_per_m = maths::tan(steering_rad) / settings.wheelbase_m;
    let (chord, heading_rad) = state.pose.chord_of_arc(curvature_per_m, travel_m);
    let moved = state.position_rest_m + chord;
    let pose = Pose::new(state.pose.position() + moved, heading_rad);
    let position_rest_m = moved - (pose.position() - state.pose.position());
    VehicleState { pose, position_rest_m, speed_mps, steering_rad, accel_mps2, ..state }
}
