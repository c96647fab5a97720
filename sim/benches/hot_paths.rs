//! The closed loop and its parts, maps and episodes. `cargo bench --profile dev -p sim --bench hot_paths`.
#![allow(missing_docs, reason = "a benchmark")]

use divan::Bencher;
use divan::counter::ItemsCount;
use sim::batch::{SeatedFleet, run_fleets, run_lockstep};
use sim::driver::{Decision, Driver, Fleet, GroundTruth, LookAheadPoint, OneDriverEach, Situation, Source};
use sim::episode::{self, Episode, EpisodeSettings};
use sim::geometry::{Pose, Vec2};
use sim::map::Map;
use sim::maths;
use sim::scenario::{Island, NoiseLevel, Obstacle, ObstacleClass, Scenario, SpeedBump};
use sim::seed::RootSeed;
use sim::sensing::noise::NoiseSettings;
use sim::sensing::{SensingSettings, Sensor};
use sim::vehicle::VehicleSettings;
use std::sync::Arc;

/// Width of the lane, metres.
const WIDTH_M: f32 = 3.2;

fn main() {
    divan::main();
}

/// A 200 m lane of some width, with parked cars in stalls on both sides, double-parked noses and bumps.
fn scenario(width_m: f32) -> Scenario {
    let half = 0.5 * width_m;
    let parked = (0..90).flat_map(|i| {
        [(half + 2.6, 90.0), (-half - 2.6, -90.0)].map(|(y, heading_deg): (f32, f32)| {
            Obstacle::new(ObstacleClass::Sedan, Pose::new(Vec2::new(2.4 * i as f32, y), heading_deg.to_radians()))
        })
    });
    let noses = (0..10)
        .map(|i| Obstacle::new(ObstacleClass::Compact, Pose::new(Vec2::new(15.0 + 20.0 * i as f32, half + 0.55), 0.0)));
    let bump = |i| SpeedBump { x_m: 60.0 * i as f32, y_m: 0.0, heading_deg: 0.0, length_m: 0.5, width_m };
    Scenario::lane(-20.0..=220.0, width_m, 0.0..=200.0)
        .with_obstacles(parked.chain(noses))
        .with_speed_bumps((0..3).map(bump))
}

fn map(width_m: f32) -> Arc<Map> {
    Arc::new(Map::build(scenario(width_m), &VehicleSettings::hyundai_hg300()).expect("the lane is sound"))
}

#[divan::bench(args = [(NoiseLevel::Clean, false), (NoiseLevel::Clean, true), (NoiseLevel::Paper, true), (NoiseLevel::Hard, true)])]
fn observation(bencher: Bencher<'_, '_>, (level, occlusion): (NoiseLevel, bool)) {
    let map = map(WIDTH_M);
    let settings = SensingSettings { occlusion, ..SensingSettings::paper() };
    let mut sensor = Sensor::new(&map, settings, &NoiseSettings::of(level), RootSeed(1));
    let mut tick = 0;
    bencher.bench_local(|| {
        tick += 1;
        let pose = Pose::new(Vec2::new((tick % 1900) as f32 * 0.1, 0.1), 0.05 * maths::sin(tick as f32 * 0.1));
        sensor.observe(&map, pose, tick)
    });
}

/// A lane between rooms: walls of some height in 300 pieces of up to 4 m.
#[divan::bench(args = [0.15, 2.0])]
fn observation_between_walls(bencher: Bencher<'_, '_>, wall_height_m: f32) {
    let wall = |x, y, length_m, width_m| Island {
        polygon: sim::geometry::rectangle(Pose::new(Vec2::new(x, y), 0.0), length_m, width_m).to_vec(),
        height_m: wall_height_m,
    };
    let along = (0..12).flat_map(|i| [2.0, -2.0].map(|y| wall(17.0 * i as f32, y, 14.0, 0.2)));
    let across = (0..12).flat_map(|i| [6.0, -6.0].map(|y| wall(17.0 * i as f32, y, 0.2, 6.0)));
    let mut scenario = Scenario::lane(-20.0..=220.0, 20.0, 0.0..=200.0);
    scenario.islands = along.chain(across).collect();
    let map = Map::build(scenario, &VehicleSettings::hyundai_hg300()).expect("the rooms are sound");
    let mut sensor = Sensor::new(&map, SensingSettings::paper(), &NoiseSettings::of(NoiseLevel::Paper), RootSeed(1));
    let mut tick = 0;
    bencher.bench_local(|| {
        tick += 1;
        let pose = Pose::new(Vec2::new((tick % 1900) as f32 * 0.1, 0.1), 0.05 * maths::sin(tick as f32 * 0.1));
        sensor.observe(&map, pose, tick)
    });
}

/// Five physics steps with collision checks, the safe ring and the clearance.
#[divan::bench(args = [WIDTH_M, 2.7])]
fn control_step_without_driver(bencher: Bencher<'_, '_>, lane_m: f32) {
    let (settings, map) = (Arc::new(EpisodeSettings::paper()), map(lane_m));
    let start = || Episode::new(Arc::clone(&settings), Arc::clone(&map), RootSeed(1));
    let decision = Decision {
        look_ahead: LookAheadPoint { ahead_m: 14.0, left_m: 0.0 },
        source: Source::Expert,
        spread: None,
        speed_limit_mps: None,
    };
    let mut episode = start();
    bencher.bench_local(|| {
        if episode.ending().is_some() {
            episode = start();
        }
        episode.apply(decision)
    });
}

/// Control steps of whole runs with noise `paper` and a driver that costs next to nothing: it heads for the route 7 m ahead.
#[divan::bench(args = [WIDTH_M, 2.7], sample_count = 10)]
fn closed_loop(bencher: Bencher<'_, '_>, lane_m: f32) {
    let (settings, map) = (Arc::new(EpisodeSettings::paper()), map(lane_m));
    let drive = || {
        let episode = Episode::new(Arc::clone(&settings), Arc::clone(&map), RootSeed(1));
        episode::run(episode, &mut AlongRoute, &mut ())
    };
    bencher.counter(ItemsCount::new(drive().metrics.ticks)).bench_local(drive);
}

/// The same in lock-step, 32 cars on one thread or on two, for 40 s each. Parted: every car has a fleet of its own;
/// otherwise one fleet answers for all.
#[divan::bench(args = [(1, true), (2, true), (1, false), (2, false)], sample_count = 10)]
fn closed_loop_in_lockstep(bencher: Bencher<'_, '_>, (threads, is_parted): (usize, bool)) {
    const CARS: usize = 32;
    let mut settings = EpisodeSettings::paper();
    settings.metrics.timeout_s = 40.0;
    let (settings, map) = (Arc::new(settings), map(WIDTH_M));
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads can be started");
    let episodes = || -> Vec<Episode> {
        let episode = |seed| Episode::new(Arc::clone(&settings), Arc::clone(&map), RootSeed(seed));
        (0..CARS as u64).map(episode).collect()
    };
    let drive = |episodes: Vec<Episode>| {
        let mut fleet = OneDriverEach(vec![AlongRoute; episodes.len()]);
        pool.install(|| {
            if is_parted {
                let fleet =
                    |cars: &[usize]| -> Box<dyn Fleet + Send> { Box::new(OneDriverEach(vec![AlongRoute; cars.len()])) };
                run_fleets(SeatedFleet::in_all(episodes, 1, fleet), &mut |_, _| ())
            } else {
                run_lockstep(episodes, &mut fleet, &mut |_, _| ())
            }
            .expect("it answers with numbers")
        })
    };
    let n_steps: u32 = drive(episodes()).iter().map(|report| report.metrics.ticks).sum();
    bencher.counter(ItemsCount::new(n_steps)).with_inputs(episodes).bench_local_values(drive);
}

#[derive(Clone)]
struct AlongRoute;

impl Driver for AlongRoute {
    fn decide(&mut self, situation: &Situation<'_>) -> Decision {
        let GroundTruth { map, vehicle, progress_m } = situation.truth;
        let target = map.path().pose_at(progress_m + 7.0).position();
        let in_ego = vehicle.pose.world_from_ego().inverse_point(target);
        let look_ahead = LookAheadPoint { ahead_m: in_ego.x.max(1.0), left_m: in_ego.y };
        Decision { look_ahead, source: Source::Expert, spread: None, speed_limit_mps: None }
    }
}

#[divan::bench]
fn episode_new(bencher: Bencher<'_, '_>) {
    let (settings, map) = (Arc::new(EpisodeSettings::paper()), map(WIDTH_M));
    bencher.bench_local(|| Episode::new(Arc::clone(&settings), Arc::clone(&map), RootSeed(1)));
}

/// Building the map of the lane, turned by some degrees.
#[divan::bench(args = [0, 45])]
fn map_build(bencher: Bencher<'_, '_>, turned_deg: i32) {
    let lane = turned(&scenario(WIDTH_M), (turned_deg as f32).to_radians());
    bencher
        .with_inputs(|| lane.clone())
        .bench_local_values(|scenario| Map::build(scenario, &VehicleSettings::hyundai_hg300()).expect("it is sound"));
}

/// A scenario turned about the origin.
fn turned(scenario: &Scenario, by_rad: f32) -> Scenario {
    let turn = Pose::new(Vec2::ZERO, by_rad).world_from_ego();
    let all = |points: &[Vec2]| points.iter().map(|&point| turn.point(point)).collect::<Vec<Vec2>>();
    let obstacles = scenario.obstacles.iter().map(|obstacle| {
        let Pose { heading_rad, .. } = obstacle.centre();
        Obstacle::new(obstacle.class, Pose::new(turn.point(obstacle.centre().position()), heading_rad + by_rad))
    });
    Scenario::new("lane", all(&scenario.boundary), all(&scenario.reference_path.points)).with_obstacles(obstacles)
}
