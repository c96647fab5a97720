//! The decision: pass an answer on, or drive the way out that is nearest to it.

use crate::forecast::{Forecaster, Moving};
use crate::local_map::LocalMap;
use crate::settings::SafetySettings;
use sim::controller::{self, ControllerSettings};
use sim::driver::{Decision, LookAheadPoint};
use sim::episode::EpisodeSettings;
use sim::sensing::{GridGeometry, Observation};
use sim::vehicle::{VehicleCommand, VehicleSettings};

/// Steering commands that are tried, as shares of full lock.
const STEERING_SHARES: [f32; 9] = [0.0, -0.15, 0.15, -0.35, 0.35, -0.65, 0.65, -1.0, 1.0];

/// The filter of one car.
#[derive(Debug, Clone)]
pub struct SafetyFilter {
    settings: SafetySettings,
    vehicle: VehicleSettings,
    controller: ControllerSettings,
    geometry: GridGeometry,
    control_period_s: f32,
    map: LocalMap,
    forecaster: Forecaster,
    /// What the car was told last: it obeys after its dead time.
    last: Option<VehicleCommand>,
}

/// Two steering commands in turn, and how far they get.
#[derive(Debug, Clone, Copy)]
struct WayOut {
    steering_rad: f32,
    free_m: f32,
}

impl SafetyFilter {
    /// For a car and its sensors.
    pub fn new(settings: &SafetySettings, episode: &EpisodeSettings) -> Self {
        let SafetySettings { nose_margin_m, side_margin_m, brake_mps2, .. } = *settings;
        Self {
            settings: settings.clone(),
            vehicle: episode.vehicle.clone(),
            controller: episode.controller.clone(),
            geometry: episode.sensing.geometry,
            control_period_s: episode.control_period_s(),
            map: LocalMap::new(episode.sensing.geometry),
            forecaster: Forecaster::new(&episode.vehicle, nose_margin_m, side_margin_m, brake_mps2),
            last: None,
        }
    }

    /// Forgets the past.
    pub fn reset(&mut self) {
        self.map.clear();
        self.last = None;
    }

    /// The answer, if it leaves a way out; otherwise what does, or leaves most.
    pub fn filtered(&mut self, observation: &Observation, decision: Decision) -> Decision {
        self.map.update(observation);
        let wanted = controller::pursue(&self.controller, &self.vehicle, &self.geometry, &decision);
        let car = self.after_dead_time(observation);
        let chosen = self.choose(car, wanted);
        let passed = chosen.unwrap_or(wanted);
        self.last = Some(passed);
        chosen.map_or(decision, |command| self.answer(command, decision))
    }

    /// `None` if the answer may pass.
    fn choose(&self, car: Moving, wanted: VehicleCommand) -> Option<VehicleCommand> {
        let SafetySettings { free_m, commit_s, slow_mps, brake_mps2, .. } = self.settings;
        let held = self.forecaster.roll(&self.map, car, wanted.steering_rad, wanted.speed_mps, free_m);
        if held.travel_m >= free_m {
            return None;
        }
        let commit_m = (commit_s * car.speed_mps).max(0.15);
        let committed = self.forecaster.roll(&self.map, car, wanted.steering_rad, wanted.speed_mps, commit_m);
        if committed.travel_m >= commit_m {
            let then = Moving { travel_m: 0.0, ..committed };
            if self.way_out(then, wanted, wanted.speed_mps).free_m >= free_m {
                return None;
            }
        }
        let way = self.way_out(car, wanted, wanted.speed_mps);
        if way.free_m >= free_m {
            return Some(VehicleCommand { steering_rad: way.steering_rad, ..wanted });
        }
        let way = self.way_out(car, wanted, slow_mps.min(wanted.speed_mps));
        if crate::settings::env("S_PASS", 1.0) > 0.5 && way.free_m < free_m {
            return None;
        }
        let stoppable_mps = (2.0 * brake_mps2 * way.free_m).sqrt();
        let speed_mps = if way.free_m >= free_m { slow_mps } else { stoppable_mps.clamp(0.3, slow_mps) };
        Some(VehicleCommand { steering_rad: way.steering_rad, speed_mps: speed_mps.min(wanted.speed_mps) })
    }

    /// Of all ways that are free far enough the one that begins nearest to what is wanted; otherwise the one that is free
    /// farthest.
    fn way_out(&self, car: Moving, wanted: VehicleCommand, speed_mps: f32) -> WayOut {
        let SafetySettings { free_m, branch_travels_m, .. } = self.settings;
        let lock_rad = self.vehicle.steering_max_rad;
        let mut firsts = STEERING_SHARES.map(|share| share * lock_rad).to_vec();
        firsts.sort_by(|a, b| (a - wanted.steering_rad).abs().total_cmp(&(b - wanted.steering_rad).abs()));
        firsts.insert(0, wanted.steering_rad);
        let mut best = WayOut { steering_rad: wanted.steering_rad, free_m: -1.0 };
        for steering_rad in firsts {
            let mut first = car;
            for branch_m in branch_travels_m {
                first = self.forecaster.roll(&self.map, first, steering_rad, speed_mps, branch_m);
                if first.travel_m > best.free_m {
                    best = WayOut { steering_rad, free_m: first.travel_m };
                }
                if first.travel_m < branch_m {
                    break;
                }
                for share in STEERING_SHARES {
                    let end = self.forecaster.roll(&self.map, first, share * lock_rad, speed_mps, free_m);
                    if end.travel_m > best.free_m {
                        best = WayOut { steering_rad, free_m: end.travel_m };
                    }
                    if end.travel_m >= free_m {
                        return best;
                    }
                }
            }
        }
        best
    }

    /// The car when it obeys the next command: until then it follows the last one.
    fn after_dead_time(&self, observation: &Observation) -> Moving {
        let odometry = observation.odometry;
        let car = Moving {
            pose: self.map.car(),
            steering_rad: odometry.steering_rad,
            speed_mps: odometry.speed_mps,
            travel_m: 0.0,
        };
        let Some(last) = self.last else { return car };
        let time_s = self.vehicle.dead_time_s.min(20.0 * self.control_period_s);
        let turn = self.vehicle.steering_rate_max_radps * time_s;
        let steering_rad = last.steering_rad.clamp(car.steering_rad - turn, car.steering_rad + turn);
        let curvature_per_m = (0.5 * (car.steering_rad + steering_rad)).tan() / self.vehicle.wheelbase_m;
        Moving { pose: car.pose.advanced_along_arc(curvature_per_m, car.speed_mps * time_s), steering_rad, ..car }
    }

    /// The point that pure pursuit steers to with a command.
    fn answer(&self, command: VehicleCommand, decision: Decision) -> Decision {
        let curvature_per_m = command.steering_rad.tan() / self.vehicle.wheelbase_m;
        // As far ahead as the answer, but not beyond a quarter of the circle.
        let quarter_m = 0.95 / curvature_per_m.abs().max(1e-3);
        let ahead_m = decision.look_ahead.ahead_m.max(1.5).min(quarter_m);
        let root = (1.0 - (curvature_per_m * ahead_m).powi(2)).sqrt();
        // The circle 2Y/(X² + Y²) = κ, the nearer of its two points, written without cancellation.
        let left_m = curvature_per_m * ahead_m * ahead_m / (1.0 + root);
        let speed_limit_mps = Some(command.speed_mps);
        Decision { look_ahead: LookAheadPoint { ahead_m, left_m }, speed_limit_mps, ..decision }
    }
}
