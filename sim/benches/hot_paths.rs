//! One observation, one control step without a driver, one map. `cargo bench --profile dev --workspace --bench hot_paths`.
#![allow(missing_docs, reason = "a benchmark")]

use divan::Bencher;
use sim::driver::{Decision, LookAheadPoint, Source};
use sim::episode::{Episode, EpisodeSettings};
use sim::geometry::{Pose, Vec2};
use sim::map::Map;
use sim::scenario::{NoiseLevel, Obstacle, ObstacleClass, Scenario, SpeedBump};
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
        let pose = Pose::new(Vec2::new((tick % 1900) as f32 * 0.1, 0.1), 0.05 * (tick as f32 * 0.1).sin());
        sensor.observe(&map, pose, tick)
    });
}

/// Five physics steps with collision checks, the safe ring and the clearance.
#[divan::bench(args = [WIDTH_M, 2.7])]
fn control_step_without_driver(bencher: Bencher<'_, '_>, lane_m: f32) {
    let (settings, map) = (Arc::new(EpisodeSettings::paper()), map(lane_m));
    let start = || Episode::new(Arc::clone(&settings), Arc::clone(&map), RootSeed(1));
    let decision =
        Decision { look_ahead: LookAheadPoint { ahead_m: 14.0, left_m: 0.0 }, source: Source::Expert, spread: None };
    let mut episode = start();
    bencher.bench_local(|| {
        if episode.ending().is_some() {
            episode = start();
        }
        episode.apply(decision)
    });
}

#[divan::bench]
fn map_build(bencher: Bencher<'_, '_>) {
    bencher
        .with_inputs(|| scenario(WIDTH_M))
        .bench_local_values(|scenario| Map::build(scenario, &VehicleSettings::hyundai_hg300()));
}
