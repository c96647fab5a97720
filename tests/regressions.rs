//! What once went wrong, one test per symptom.

use crate::bench::scratch;
use expert::{ExpertSettings, ScriptedExpert};
use scenarios::LoadError;
use scenarios::load::{check_direction, load_with_notes, parse, to_toml};
use sim::controller::{ControllerSettings, SpeedLaw, pursue};
use sim::driver::{Decision, Driver as _, GroundTruth, LookAheadPoint, Situation, Source};
use sim::episode::EpisodeSettings;
use sim::geometry::{Pose, Vec2};
use sim::map::Map;
use sim::scenario::{Direction, Obstacle, ObstacleClass, Scenario};
use sim::seed::{RootSeed, Stream};
use sim::sensing::{GridGeometry, Observation};
use sim::vehicle::{VehicleSettings, VehicleState};

fn car() -> VehicleSettings {
    VehicleSettings::hyundai_hg300()
}

/// A fresh expert's answers at rest at the start of a lot, one per tick.
fn answers(settings: &ExpertSettings, episode: &EpisodeSettings, lot: Scenario, poses: &[Pose]) -> Vec<LookAheadPoint> {
    let map = Map::build(lot, &episode.vehicle).unwrap();
    let mut expert = ScriptedExpert::new(settings.clone(), episode, RootSeed(1).rng(Stream::Expert, 0));
    let observation = Observation::default();
    let answer = |&pose: &Pose| {
        let truth = GroundTruth { map: &map, vehicle: VehicleState::at_rest(pose), progress_m: 0.0 };
        expert.decide(&Situation { observation: &observation, truth }).look_ahead
    };
    poses.iter().map(answer).collect()
}

/// The gap between bumper and patch was a constant of its own: a patch moved by a metre made the car slower by .45 m/s.
#[test]
fn moving_the_patch_does_not_change_the_speed() {
    let settings = ControllerSettings { speed_law: SpeedLaw::Full, ..ControllerSettings::paper() };
    let look_ahead = LookAheadPoint { ahead_m: 7.0, left_m: 0.5 };
    let decision = Decision { look_ahead, source: Source::Expert, spread: None, speed_limit_mps: None };
    let speed_mps = |near_edge_ahead_m| {
        let geometry = GridGeometry { near_edge_ahead_m, ..GridGeometry::paper() };
        pursue(&settings, &car(), &geometry, &decision).speed_mps
    };
    let expected_mps = (7.0 - 3.8) / 2.24;
    for near_edge_ahead_m in [3.8, 4.3, 5.3] {
        assert!((speed_mps(near_edge_ahead_m) - expected_mps).abs() < 1e-5, "{}", speed_mps(near_edge_ahead_m));
    }
}

/// Lots were checked with the default car, whatever car was to drive them.
#[test]
fn a_wider_car_is_refused_where_the_default_car_fits() {
    let text = to_toml(&Scenario::lane(0.0..=40.0, 2.2, 5.0..=30.0));
    assert!(parse(&text, "lane.toml", &car()).is_ok());
    let wide = VehicleSettings { width_m: 2.4, ..car() };
    let error = parse(&text, "lane.toml", &wide).unwrap_err().to_string();
    assert!(error.contains("reference_path, point 1: the car (4.91 m × 2.40 m) does not fit"), "{error}");
}

/// A lot that leaves no room behind its finish was refused in reverse without a file, and with the points counted from
/// the wrong end.
#[test]
fn a_lot_that_cannot_be_driven_in_reverse_is_refused_with_file_and_line() {
    let text = to_toml(&Scenario::lane(0.0..=40.0, 4.0, 5.0..=39.5));
    let file = scratch("reverse").join("lane.toml");
    std::fs::write(&file, &text).unwrap();
    let lot = load_with_notes(&file, &car()).unwrap();
    assert_eq!(check_direction(&file, &lot, Direction::Forward, &car()), Ok(()));
    let error = check_direction(&file, &lot, Direction::Reverse, &car()).unwrap_err();
    let line = 1 + text.lines().position(|line| line.contains("[39.5, 0.0]")).unwrap();
    let expected = format!(
        "{}:{line}: the lot cannot be driven in reverse: reference_path, point 2: the car (4.91 m × 1.86 m) does not fit \
         at the start",
        file.display()
    );
    assert!(error.to_string().starts_with(&expected), "got:      {error}\nexpected: {expected}");
    let LoadError::ForwardOnly { location, .. } = error else { panic!("{error:?}") };
    assert_eq!(location.line, Some(line));
}

/// Single precision makes 3.7999997 m of the distance from axle to bumper.
#[test]
fn errors_show_no_rounding_noise() {
    let text = to_toml(&Scenario::lane(0.0..=40.0, 4.0, 0.5..=30.0));
    let error = parse(&text, "lane.toml", &car()).unwrap_err().to_string();
    assert!(error.contains("leave 1.11 m behind, 3.80 m ahead of and 0.93 m beside the first point"), "{error}");
}

/// The expert took every tick for 50 ms.
#[test]
fn the_reaction_delay_is_the_same_time_at_any_control_period() {
    let settings = ExpertSettings { reaction_delay_s: 0.2, ..ExpertSettings::half_points() };
    let poses: Vec<Pose> = (0..8).map(|i| Pose::new(Vec2::new(0.0, 0.08 * i as f32), 0.0)).collect();
    for (control_period_ms, delay_ticks) in [(50, 4), (100, 2), (200, 1)] {
        let episode = EpisodeSettings { control_period_ms, ..EpisodeSettings::paper() };
        let points = answers(&settings, &episode, Scenario::lane(-20.0..=80.0, 5.0, 0.0..=50.0), &poses);
        let repeated = points.iter().take_while(|point| **point == points[0]).count();
        assert_eq!(repeated, delay_ticks + 1, "{control_period_ms} ms: {points:?}");
    }
}

/// The expert took 0.5 m/s for the slowest speed, whatever the controller commands.
#[test]
fn the_expert_knows_the_slowest_speed() {
    let slow = EpisodeSettings::paper();
    let mut fast = EpisodeSettings::paper();
    fast.controller.speed_min_mps = 2.0;
    let car_ahead = Obstacle::new(ObstacleClass::Sedan, Pose::new(Vec2::new(9.0, 0.4), 0.0));
    let lane = Scenario::lane(-20.0..=80.0, 7.0, 0.0..=5.0).with_obstacles([car_ahead]);
    let answer = |episode| answers(&ExpertSettings::half_points(), episode, lane.clone(), &[Pose::default()])[0];
    assert_ne!(answer(&slow), answer(&fast), "wheels that turn at 2 m/s bend the way less");
}
