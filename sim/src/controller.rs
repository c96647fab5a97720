//! From a look-ahead point to a vehicle command: pure pursuit and the speed law (docs/methods.md 2.4, 2.5).

use crate::driver::{Decision, LookAheadPoint, Source};
use crate::maths;
use crate::sensing::GridGeometry;
use crate::vehicle::{VehicleCommand, VehicleSettings};
use serde::{Deserialize, Serialize};

/// Which form of pure pursuit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PursuitLaw {
    /// δ = atan(2 L sin θ_l / L_f) about the rear axle: the exact circle through the point (paper).
    #[default]
    Paper,
    /// δ = atan(L sin η / (0.75 L_f + 0.3 cos η)) measured from the front bumper, 0.5 m behind the
    /// lower image edge (authors' code).
    AuthorsCode,
}

/// How fast to drive at a look-ahead point. The paper says v = a_y/2.24 "where the final v was set to half of a_y for
/// safety reasons"; docs/methods.md 2.5 lists the readings. Distances are measured from the front bumper.
///
/// Law B goes with points as far as the way is open, as the paper prints them. Law A with points half as far drives the same
/// circles at about the same speed (docs/paper.md says what that changes).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SpeedLaw {
    /// A: v = a_y / 2.24, the formula as printed and Kuwata's look-ahead schedule. The expert's points are half as far.
    #[default]
    Full,
    /// B: v = a_y / 4.48. Gives the paper's derived 1.43 m/s with points as far as the way is open.
    Halved,
    /// C: v = a_y / 2.
    HalfOfAhead,
    /// v = 2.2 − 1.7 |δ_sw| / 540° (the paper's law for the model-based planners).
    FallsWithSteering,
}

/// Settings of the controller.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ControllerSettings {
    /// Form of pure pursuit.
    pub pursuit: PursuitLaw,
    /// Speed law of the expert and of learned policies.
    pub speed_law: SpeedLaw,
    /// Speed law of model-based planners.
    pub planner_speed_law: SpeedLaw,
    /// Slowest command, m/s.
    pub speed_min_mps: f32,
    /// Fastest command, m/s.
    pub speed_max_mps: f32,
}

impl ControllerSettings {
    /// Experimental Setup: 0.5 to 2.2 m/s, with law A; preset `paper` has law B.
    pub fn paper() -> Self {
        Self {
            pursuit: PursuitLaw::Paper,
            speed_law: SpeedLaw::Full,
            planner_speed_law: SpeedLaw::FallsWithSteering,
            speed_min_mps: 0.5,
            speed_max_mps: 2.2,
        }
    }
}

/// Shortest look-ahead distance, metres: below it the circle through the point is meaningless.
const LOOK_AHEAD_MIN_M: f32 = 1.0;

/// Distance from the front bumper to the lower edge of the patch, metres: 0.5 m for the paper's car and patch
/// (docs/methods.md 2.5).
///
/// In whole millimetres: single precision makes 0.500_000_5 m of 4.30 m − (4.91 m − 1.11 m).
pub fn bumper_to_patch_m(vehicle: &VehicleSettings, geometry: &GridGeometry) -> f32 {
    ((geometry.near_edge_ahead_m - vehicle.front_m()) * 1000.0).round() / 1000.0
}

/// How far ahead of the front bumper a point lies, metres: a_y of the paper. A point has the same speed wherever the patch
/// lies.
fn ahead_of_bumper_m(vehicle: &VehicleSettings, geometry: &GridGeometry, target: LookAheadPoint) -> f32 {
    target.ahead_m - geometry.near_edge_ahead_m + bumper_to_patch_m(vehicle, geometry)
}

/// The command that drives at a decision's look-ahead point.
pub fn pursue(
    settings: &ControllerSettings,
    vehicle: &VehicleSettings,
    geometry: &GridGeometry,
    decision: &Decision,
) -> VehicleCommand {
    let steering_rad = steering_rad(settings.pursuit, vehicle, geometry, decision.look_ahead);
    let law = if decision.source == Source::Planner { settings.planner_speed_law } else { settings.speed_law };
    let by_law_mps = speed_mps(law, settings, vehicle, geometry, decision.look_ahead, steering_rad);
    let limited_mps = |limit_mps: f32| by_law_mps.min(limit_mps).max(settings.speed_min_mps);
    VehicleCommand { steering_rad, speed_mps: decision.speed_limit_mps.map_or(by_law_mps, limited_mps) }
}

/// Road-wheel angle that steers at a point, radians, within the vehicle's limits.
pub fn steering_rad(
    law: PursuitLaw,
    vehicle: &VehicleSettings,
    geometry: &GridGeometry,
    target: LookAheadPoint,
) -> f32 {
    let LookAheadPoint { ahead_m, left_m } = target;
    let steering_rad = match law {
        PursuitLaw::Paper => {
            if ahead_m <= 0.1 {
                // Beside or behind the axle: no forward circle reaches it, turn as hard as possible.
                vehicle.steering_max_rad * left_m.signum()
            } else {
                let distance_m = maths::hypot(ahead_m, left_m).max(LOOK_AHEAD_MIN_M); // L_f
                let bearing_rad = maths::atan2(left_m, ahead_m); // θ_l
                maths::atan(2.0 * vehicle.wheelbase_m * maths::sin(bearing_rad) / distance_m)
            }
        }
        PursuitLaw::AuthorsCode => {
            let ahead_m = ahead_of_bumper_m(vehicle, geometry, target);
            let distance_m = maths::hypot(ahead_m, left_m).max(LOOK_AHEAD_MIN_M);
            let bearing_rad = maths::atan2(left_m, ahead_m);
            let (sin, cos) = maths::sin_cos(bearing_rad);
            maths::atan(vehicle.wheelbase_m * sin / (0.75 * distance_m + 0.3 * cos))
        }
    };
    steering_rad.clamp(-vehicle.steering_max_rad, vehicle.steering_max_rad)
}

/// Longest chord from the rear axle to [`point_of`], metres.
const CHORD_M: f32 = 4.0;

/// A point on the circle that the rear axle drives with a road-wheel angle: [`PursuitLaw::Paper`] steers it again.
pub fn point_of(vehicle: &VehicleSettings, steering_rad: f32) -> LookAheadPoint {
    let steering_rad = steering_rad.clamp(-vehicle.steering_max_rad, vehicle.steering_max_rad);
    let curvature_per_m = maths::tan(steering_rad) / vehicle.wheelbase_m;
    // A chord as long as the radius spans 60° and ends ahead, however tight the circle.
    let chord_m = CHORD_M.min(1.0 / curvature_per_m.abs());
    let sine = 0.5 * chord_m * curvature_per_m;
    LookAheadPoint { ahead_m: chord_m * (1.0 - sine * sine).sqrt(), left_m: chord_m * sine }
}

fn speed_mps(
    law: SpeedLaw,
    settings: &ControllerSettings,
    vehicle: &VehicleSettings,
    geometry: &GridGeometry,
    target: LookAheadPoint,
    steering_rad: f32,
) -> f32 {
    let ahead_m = ahead_of_bumper_m(vehicle, geometry, target); // a_y
    let speed_mps = match law {
        SpeedLaw::Full => ahead_m / 2.24,
        SpeedLaw::Halved => ahead_m / 4.48,
        SpeedLaw::HalfOfAhead => ahead_m / 2.0,
        SpeedLaw::FallsWithSteering => {
            let share = steering_rad.abs() / vehicle.steering_max_rad; // |δ_sw| / 540°
            settings.speed_max_mps - share * (settings.speed_max_mps - settings.speed_min_mps)
        }
    };
    speed_mps.clamp(settings.speed_min_mps, settings.speed_max_mps)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_paper_law_drives_the_circle_through_the_point() {
        let (vehicle, geometry) = (VehicleSettings::hyundai_hg300(), GridGeometry::paper());
        for (ahead_m, left_m) in [(8.0, 1.0), (5.0, -2.0), (12.0, 4.0), (16.0, 0.0)] {
            let target = LookAheadPoint { ahead_m, left_m };
            let curvature =
                maths::tan(steering_rad(PursuitLaw::Paper, &vehicle, &geometry, target)) / vehicle.wheelbase_m;
            assert!((curvature - target.curvature_per_m()).abs() < 1e-5);
            // Rolling along that arc arrives at the point.
            let chord_m = maths::hypot(ahead_m, left_m);
            let half_turn = maths::atan2(left_m, ahead_m);
            let travel_m = if half_turn == 0.0 { chord_m } else { chord_m * half_turn / maths::sin(half_turn) };
            let end = crate::geometry::Pose::default().advanced_along_arc(curvature, travel_m);
            assert!(end.position().distance(glam::Vec2::new(ahead_m, left_m)) < 1e-3);
        }
    }

    #[test]
    fn pursuing_the_point_of_an_angle_steers_that_angle() {
        let (vehicle, geometry) = (VehicleSettings::hyundai_hg300(), GridGeometry::paper());
        for degrees in [-60.0_f32, -35.5, -10.0, 0.0, 0.5, 20.0, 35.5] {
            let steering_rad = degrees.to_radians().clamp(-vehicle.steering_max_rad, vehicle.steering_max_rad);
            let point = point_of(&vehicle, degrees.to_radians());
            assert!(point.ahead_m > 2.0, "{point:?}");
            assert!(
                (super::steering_rad(PursuitLaw::Paper, &vehicle, &geometry, point) - steering_rad).abs() < 1e-5,
                "{degrees}°"
            );
        }
    }

    #[test]
    fn speed_laws_match_the_paper() {
        let (vehicle, geometry, settings) =
            (VehicleSettings::hyundai_hg300(), GridGeometry::paper(), ControllerSettings::paper());
        let at =
            |law, ahead_m| speed_mps(law, &settings, &vehicle, &geometry, LookAheadPoint { ahead_m, left_m: 0.0 }, 0.0);
        // 0.5 + X_bev = 4.48 m → law B 1.0 m/s, A 2.0 m/s, C capped at 2.2 m/s.
        let ahead_m = 4.3 - 0.5 + 4.48;
        assert!((at(SpeedLaw::Halved, ahead_m) - 1.0).abs() < 1e-5);
        assert!((at(SpeedLaw::Full, ahead_m) - 2.0).abs() < 1e-5);
        assert_eq!(at(SpeedLaw::HalfOfAhead, ahead_m), 2.2);
        assert_eq!(at(SpeedLaw::Halved, 4.3), 0.5);
        let planner = |steering_rad| {
            let target = LookAheadPoint { ahead_m: 8.0, left_m: 0.0 };
            speed_mps(SpeedLaw::FallsWithSteering, &settings, &vehicle, &geometry, target, steering_rad)
        };
        assert_eq!(planner(0.0), 2.2);
        assert!((planner(vehicle.steering_max_rad) - 0.5).abs() < 1e-5);
    }

    #[test]
    fn a_driver_may_ask_for_less_speed_but_not_for_more() {
        let (vehicle, geometry, settings) =
            (VehicleSettings::hyundai_hg300(), GridGeometry::paper(), ControllerSettings::paper());
        let with_limit = |speed_limit_mps| {
            let look_ahead = LookAheadPoint { ahead_m: 8.0, left_m: 0.0 };
            let decision = Decision { look_ahead, source: Source::Planner, spread: None, speed_limit_mps };
            pursue(&settings, &vehicle, &geometry, &decision).speed_mps
        };
        assert_eq!([None, Some(9.0), Some(1.5), Some(0.0)].map(with_limit), [2.2, 2.2, 1.5, 0.5]);
    }

    #[test]
    fn the_bumper_is_where_the_vehicle_ends() {
        let (vehicle, geometry) = (VehicleSettings::hyundai_hg300(), GridGeometry::paper());
        assert_eq!(bumper_to_patch_m(&vehicle, &geometry), 0.5, "the authors' constant");
        let target = LookAheadPoint { ahead_m: 8.3, left_m: 0.0 };
        for near_edge_ahead_m in [3.8, 4.3, 5.1, 6.0] {
            let geometry = GridGeometry { near_edge_ahead_m, ..geometry };
            assert!((ahead_of_bumper_m(&vehicle, &geometry, target) - 4.5).abs() < 1e-5, "{near_edge_ahead_m} m");
        }
        let longer = VehicleSettings { length_m: vehicle.length_m + 0.3, ..vehicle };
        assert!((ahead_of_bumper_m(&longer, &geometry, target) - 4.2).abs() < 1e-5);
    }

    /// 4 m ahead of the bumper and 3 m aside are L_f = 5 m, sin η = .6, cos η = .8: tan δ = 2.845 · .6 / (.75 · 5 + .3 · .8).
    #[test]
    fn the_authors_law_steers_as_computed_by_hand() {
        let (vehicle, geometry) = (VehicleSettings::hyundai_hg300(), GridGeometry::paper());
        let from_bumper = |ahead_m: f32, left_m: f32| {
            let target = LookAheadPoint { ahead_m: ahead_m + vehicle.front_m(), left_m };
            steering_rad(PursuitLaw::AuthorsCode, &vehicle, &geometry, target)
        };
        let expected = 1.707 / 3.99;
        for (left_m, side) in [(3.0, 1.0), (-3.0, -1.0)] {
            let tan = maths::tan(from_bumper(4.0, left_m));
            assert!((tan - side * expected).abs() < 1e-5, "{tan} for {left_m} m to the left");
        }
        assert_eq!(from_bumper(4.0, 0.0), 0.0);
        assert_eq!(from_bumper(0.5, -3.0), -vehicle.steering_max_rad, "within the lock");
    }
}
