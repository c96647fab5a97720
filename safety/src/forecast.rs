//! Where the car gets to with one steering command, and then another.

use crate::local_map::{CELL_M, LocalMap};
use sim::geometry::{Pose, Vec2};
use sim::vehicle::VehicleSettings;

/// Travel between two poses that are checked, metres.
const STEP_M: f32 = 0.25;

/// A car under way in a forecast.
#[derive(Debug, Clone, Copy)]
pub struct Moving {
    /// Rear axle, in the frame of the map.
    pub pose: Pose,
    /// Road-wheel angle, radians.
    pub steering_rad: f32,
    /// Speed, m/s.
    pub speed_mps: f32,
    /// Travel since the forecast began, metres.
    pub travel_m: f32,
}

/// Rolls the car along over remembered ground.
#[derive(Debug, Clone)]
pub struct Forecaster {
    vehicle: VehicleSettings,
    brake_mps2: f32,
    /// Points of the outline that meet an obstacle first, ego.
    outline: Vec<Vec2>,
}

impl Forecaster {
    /// For a body with margins. `brake_mps2`: how fast it comes to a lower speed.
    pub fn new(vehicle: &VehicleSettings, nose_margin_m: f32, side_margin_m: f32, brake_mps2: f32) -> Self {
        let (front_m, rear_m) = (vehicle.front_m() + nose_margin_m, -vehicle.rear_overhang_m);
        let side_m = 0.5 * vehicle.width_m + side_margin_m;
        let between = |from: f32, to: f32, step_m: f32| {
            let pieces = ((to - from) / step_m).ceil().max(1.0);
            (0..=pieces as usize).map(move |k| from + (to - from) * k as f32 / pieces)
        };
        let nose = between(-side_m, side_m, CELL_M).map(|left_m| Vec2::new(front_m, left_m));
        let sides = between(rear_m, front_m, 2.0 * CELL_M)
            .flat_map(|ahead_m| [Vec2::new(ahead_m, side_m), Vec2::new(ahead_m, -side_m)]);
        Self { vehicle: vehicle.clone(), brake_mps2, outline: nose.chain(sides).collect() }
    }

    /// Whether the body would stand on blocked ground.
    pub fn hits(&self, map: &LocalMap, pose: Pose) -> bool {
        let ego = pose.world_from_ego();
        self.outline.iter().any(|&point| map.is_blocked(ego.point(point)))
    }

    /// Holds a steering command until the car meets something or has travelled to `to_m`. Whether it got there is whether
    /// its travel is `to_m`.
    pub fn roll(&self, map: &LocalMap, mut car: Moving, steering_rad: f32, speed_mps: f32, to_m: f32) -> Moving {
        while car.travel_m < to_m {
            let next = self.step(car, steering_rad, speed_mps, STEP_M.min(to_m - car.travel_m));
            if self.hits(map, next.pose) {
                break;
            }
            car = next;
        }
        car
    }

    fn step(&self, car: Moving, steering_rad: f32, speed_mps: f32, step_m: f32) -> Moving {
        let time_s = step_m / car.speed_mps.max(0.3);
        let turn = self.vehicle.steering_rate_max_radps * time_s;
        let max = self.vehicle.steering_max_rad;
        let to_rad = steering_rad.clamp(-max, max).clamp(car.steering_rad - turn, car.steering_rad + turn);
        let curvature_per_m = (0.5 * (car.steering_rad + to_rad)).tan() / self.vehicle.wheelbase_m;
        let change = self.brake_mps2 * time_s;
        Moving {
            pose: car.pose.advanced_along_arc(curvature_per_m, step_m),
            steering_rad: to_rad,
            speed_mps: speed_mps.clamp(car.speed_mps - change, car.speed_mps + change),
            travel_m: car.travel_m + step_m,
        }
    }
}
