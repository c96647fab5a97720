//! Ticks for the tests of rules.

use crate::decision_rule::evidence::Evidence;
use crate::decision_rule::gate::GateTick;
use sim::driver::{GroundTruth, LookAheadPoint, Situation};
use sim::episode::EpisodeSettings;
use sim::geometry::{Pose, Vec2};
use sim::map::Map;
use sim::scenario::{LotNoise, ReferencePath, Scenario};
use sim::sensing::{Observation, OccupancyGrid};
use sim::vehicle::VehicleState;

/// In the middle of a straight lane 5 m wide, at 1.4 m/s.
pub(crate) fn with_situation<T>(episode: &EpisodeSettings, then: impl FnOnce(&Situation<'_>) -> T) -> T {
    with_car_at(20.0, episode, then)
}

/// The same so far along the lane, which ends at 56 m.
pub(crate) fn with_car_at<T>(x_m: f32, episode: &EpisodeSettings, then: impl FnOnce(&Situation<'_>) -> T) -> T {
    let v = Vec2::new;
    let scenario = Scenario {
        name: "straight lane".to_string(),
        boundary: vec![v(-4.0, -2.5), v(56.0, -2.5), v(56.0, 2.5), v(-4.0, 2.5)],
        boundary_height_m: 0.0,
        reference_path: ReferencePath { points: vec![v(0.0, 0.0), v(50.0, 0.0)], corner_radius_m: 12.0 },
        noise: LotNoise::default(),
        islands: Vec::new(),
        obstacles: Vec::new(),
        speed_bumps: Vec::new(),
    };
    let map = Map::build(scenario, &episode.vehicle).unwrap();
    let vehicle = VehicleState { speed_mps: 1.4, ..VehicleState::at_rest(Pose::new(v(x_m, 0.0), 0.0)) };
    let observation = Observation { grid: OccupancyGrid::free() };
    let truth = GroundTruth { map: &map, vehicle, progress_m: x_m };
    then(&Situation { observation: &observation, truth })
}

/// A tick with a discrepancy and an alarm.
pub(crate) fn with_tick<T>(discrepancy: f32, alarm: f32, then: impl FnOnce(&GateTick<'_>) -> T) -> T {
    let evidence = Evidence { discrepancy, doubt: [0.0; 2], disagreement: 0.0, alarm };
    with_situation(&EpisodeSettings::paper(), |situation| {
        then(&GateTick { evidence, novice: LookAheadPoint { ahead_m: 8.0, left_m: 0.0 }, situation })
    })
}
