//! The three rules on small scenes, and what every label must keep.

use expert::{ExpertSettings, ExpertStats, ScriptedExpert, Sees};
use proptest::prelude::*;
use sim::driver::{Driver, GroundTruth, LookAheadPoint, Situation};
use sim::episode::{Episode, EpisodeReport, EpisodeSettings};
use sim::frame::Ending;
use sim::geometry::{Pose, Vec2};
use sim::map::Map;
use sim::scenario::{Direction, Obstacle, ObstacleClass, Scenario};
use sim::seed::{RootSeed, Stream};
use sim::sensing::{GridGeometry, Observation};
use sim::vehicle::{VehicleSettings, VehicleState};
use std::sync::Arc;

/// A lane along x, 100 m long, with its middle on y = 0; the route ends 30 m before the lane does.
fn lane(width_m: f32, obstacles: Vec<Obstacle>) -> Scenario {
    Scenario::lane(-20.0..=80.0, width_m, -5.0..=50.0).with_corner_radius_m(5.0).with_obstacles(obstacles)
}

fn car(x_m: f32, y_m: f32, heading_rad: f32) -> Obstacle {
    Obstacle::new(ObstacleClass::Sedan, Pose::new(Vec2::new(x_m, y_m), heading_rad))
}

/// Two 6 m aisles that meet at a right angle, to the left when driven forward.
fn corner() -> Scenario {
    let boundary = [(-25.0, -3.0), (33.0, -3.0), (33.0, 55.0), (27.0, 55.0), (27.0, 3.0), (-25.0, 3.0)];
    Scenario::new("corner", boundary, [(-5.0, 0.0), (30.0, 0.0), (30.0, 35.0)]).with_corner_radius_m(5.0)
}

/// A corner of a parking deck, to the left when driven forward: straight on, and to the right, lie pockets.
fn corner_with_pockets() -> Scenario {
    let (outside, pocket_right) = ([(-25.0, -3.4), (27.0, -3.4)], [(27.0, -8.4), (33.0, -8.4), (33.0, -2.4)]);
    let (pocket_ahead, inside) = ([(39.0, -2.4), (39.0, 2.6), (34.0, 2.6)], [(34.0, 55.0), (27.0, 55.0), (27.0, 3.6)]);
    let boundary = [&outside[..], &pocket_right, &pocket_ahead, &inside, &[(-25.0, 3.6)]].concat();
    Scenario::new("deck", boundary, [(-5.0, 0.0), (30.5, 0.0), (30.5, 35.0)]).with_corner_radius_m(5.0)
}

fn map(scenario: Scenario) -> Map {
    Map::build(scenario, &VehicleSettings::hyundai_hg300()).expect("the scenes of these tests are valid")
}

fn expert(sees: Sees) -> ScriptedExpert {
    let settings = ExpertSettings { sees, ..ExpertSettings::half_points() };
    ScriptedExpert::new(settings, &EpisodeSettings::paper(), RootSeed(1).rng(Stream::Expert, 0))
}

/// First answer of an expert without a past.
fn answer(map: &Map, pose: Pose, speed_mps: f32) -> LookAheadPoint {
    let vehicle = VehicleState { speed_mps, ..VehicleState::at_rest(pose) };
    let progress_m = map.path().project_m(pose.position());
    let truth = GroundTruth { map, vehicle, progress_m };
    expert(Sees::WholeMap).decide(&Situation { observation: &Observation::default(), truth }).look_ahead
}

fn drive(scenario: Scenario, sees: Sees) -> (EpisodeReport, Vec<LookAheadPoint>, ExpertStats) {
    let settings = Arc::new(EpisodeSettings::paper());
    let mut episode = Episode::new(settings, Arc::new(map(scenario)), RootSeed(1));
    let mut driver = expert(sees);
    let mut points = Vec::new();
    while episode.ending().is_none() {
        let decision = driver.decide(&episode.situation());
        points.push(decision.look_ahead);
        episode.apply(decision);
    }
    (episode.report().expect("it has ended"), points, *driver.stats())
}

#[test]
fn an_open_lane_is_looked_down_in_the_middle() {
    let far_m = ExpertSettings::half_points().elastic_band.reach_max_m + VehicleSettings::hyundai_hg300().front_m();
    for width_m in [2.8, 3.4, 5.0] {
        let point = answer(&map(lane(width_m, Vec::new())), Pose::default(), 1.5);
        assert!((point.ahead_m - far_m).abs() < 0.1 && point.left_m.abs() < 0.1, "{width_m} m: {point:?}");
    }
}

/// Pure pursuit drives the circle to the point: it must meet the middle at the range the car is steered at.
#[test]
fn from_beside_the_middle_the_car_is_steered_back_to_it() {
    let pose = Pose::new(Vec2::new(0.0, 0.3), 0.02);
    let map = map(lane(3.4, Vec::new()));
    let point = answer(&map, pose, 1.5);
    let steer_m = ExpertSettings::half_points().elastic_band.steer_m;
    let met = pose.advanced_along_arc(point.curvature_per_m(), steer_m).position();
    assert!(met.y.abs() < 0.1, "{point:?} leads through {met}");
}

#[test]
fn a_car_on_the_right_shifts_the_point_to_the_left() {
    // The car takes the lane up to y = −0.58; the middle of what is left is y = 0.96.
    let point = answer(&map(lane(5.0, vec![car(9.0, -1.5, 0.0)])), Pose::default(), 1.0);
    let beside = Pose::default().advanced_along_arc(point.curvature_per_m(), 7.0).position();
    assert!((0.3..1.6).contains(&beside.y), "{point:?} leads through {beside}");
}

#[test]
fn a_blocked_lane_gives_a_near_point() {
    let short_route = |obstacles| {
        let mut scenario = lane(4.0, obstacles);
        scenario.reference_path.points[1] = Vec2::new(3.0, 0.0);
        map(scenario)
    };
    let ahead_of_bumper_m = |obstacles| {
        let point = answer(&short_route(obstacles), Pose::default(), 0.5);
        point.ahead_m - VehicleSettings::hyundai_hg300().front_m()
    };
    let open_m = ahead_of_bumper_m(Vec::new());
    let blocked_m = ahead_of_bumper_m(vec![car(9.0, 0.0, std::f32::consts::FRAC_PI_2)]);
    assert!(blocked_m < 2.0 && blocked_m < 0.4 * open_m, "{blocked_m} m, open {open_m} m");
}

#[test]
fn a_right_angle_is_driven_both_ways_without_a_near_collision() {
    for direction in Direction::BOTH {
        for sees in [Sees::WholeMap, Sees::PatchOnly] {
            let (report, points, stats) = drive(direction.of(corner()), sees);
            let metrics = &report.metrics;
            assert_eq!(report.ending, Ending::ReachedEnd, "{direction:?} {sees:?}");
            assert_eq!((metrics.near_collisions, metrics.stuck), (0, 0), "{direction:?} {sees:?}: {:?}", report.events);
            assert_eq!(stats.decisions, points.len() as u64);
            assert_eq!(stats.far + stats.avoid + stats.relaxed + stats.last_resort, stats.decisions);
        }
    }
}

/// Of ways within the patch the longest was taken, and that was the pocket ahead: the way on leaves the patch after fewer metres.
#[test]
fn a_pocket_that_is_seen_to_end_is_not_taken_for_the_way() {
    for sees in [Sees::WholeMap, Sees::PatchOnly] {
        let (report, ..) = drive(corner_with_pockets(), sees);
        assert_eq!(report.ending, Ending::ReachedEnd, "{sees:?}");
        assert_eq!(report.metrics.near_collisions, 0, "{sees:?}: {:?}", report.events);
    }
}

#[test]
fn labels_keep_their_limits_and_stay_in_the_patch() {
    let geometry = GridGeometry::paper();
    let (_, points, _) = drive(corner(), Sees::WholeMap);
    for pair in points.windows(2) {
        let [before, after] = [pair[0], pair[1]];
        assert!(geometry.contains(Vec2::new(after.ahead_m, after.left_m)), "{after:?}");
        let change = (after.curvature_per_m() - before.curvature_per_m()).abs();
        assert!(change < 0.0121, "curvature changed by {change} from {before:?} to {after:?}");
        assert!(after.curvature_per_m().abs() < 0.2151, "{after:?}");
    }
}

#[test]
fn the_same_run_gives_the_same_bytes() {
    let bits = || -> Vec<[u32; 2]> {
        let (_, points, _) = drive(lane(3.2, vec![car(25.0, -2.2, 0.05)]), Sees::WholeMap);
        points.iter().map(|point| [point.ahead_m.to_bits(), point.left_m.to_bits()]).collect()
    };
    assert_eq!(bits(), bits());
}

#[test]
fn an_inspected_decision_is_the_same_decision() {
    let map = map(lane(4.0, vec![car(14.0, -1.9, 0.0)]));
    let vehicle = VehicleState { speed_mps: 1.2, ..VehicleState::at_rest(Pose::new(Vec2::new(0.0, 0.2), 0.03)) };
    let truth = GroundTruth { map: &map, vehicle, progress_m: 5.0 };
    let situation = Situation { observation: &Observation::default(), truth };
    let plain = expert(Sees::WholeMap).decide(&situation);
    let (decision, inspection) = expert(Sees::WholeMap).inspect(&situation);
    assert_eq!(decision, plain);
    assert_eq!(inspection.decided, plain.look_ahead);
    assert!(inspection.way.len() > 5 && inspection.candidates.len() == 33);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]

    /// Widths are multiples of two nodes, so that the raster has a mirror image too.
    #[test]
    fn a_mirrored_scene_has_a_mirrored_label(
        width in 16_u8..28,
        left_m in -0.35_f32..0.35,
        heading_rad in -0.06_f32..0.06,
        speed_mps in 0.5_f32..2.0,
        (car_ahead_m, protrudes_m) in (11.0_f32..18.0, 0.0_f32..0.5),
    ) {
        let width_m = 0.2 * f32::from(width);
        let label = |side: f32| {
            let obstacle = car(car_ahead_m, side * (0.5 * width_m + 0.92 - protrudes_m), 0.0);
            let pose = Pose::new(Vec2::new(0.0, side * left_m), side * heading_rad);
            answer(&map(lane(width_m, vec![obstacle])), pose, speed_mps)
        };
        let (left, right) = (label(1.0), label(-1.0));
        // Look-ups at the nearest node round to different sides.
        prop_assert!((left.left_m + right.left_m).abs() < 0.25, "{:?} and {:?}", left, right);
        prop_assert!((left.ahead_m - right.ahead_m).abs() < 0.6, "{:?} and {:?}", left, right);
    }
}
