//! Time of one decision, over every tick of drives through the reference lots and generated ones, both ways.
//!
//! `cargo bench --profile dev -p expert`
#![allow(missing_docs, reason = "divan's macro writes functions without docs")]

use divan::counter::ItemsCount;
use expert::{ExpertSettings, ScriptedExpert, Sees};
use sim::driver::{Driver, GroundTruth, Situation};
use sim::episode::{Episode, EpisodeSettings};
use sim::map::Map;
use sim::scenario::Direction;
use sim::seed::{RootSeed, Stream};
use sim::sensing::Observation;
use sim::vehicle::VehicleState;
use std::sync::Arc;

const LOTS: [&str; 4] = ["lot-a", "lot-b", "lot-c", "test:4"];

fn main() {
    divan::main();
}

#[divan::bench(args = LOTS, sample_count = 10, sample_size = 1)]
fn whole_map(bencher: divan::Bencher<'_, '_>, lots: &str) {
    bench(bencher, lots, Sees::WholeMap);
}

#[divan::bench(args = LOTS, sample_count = 10, sample_size = 1)]
fn patch_only(bencher: divan::Bencher<'_, '_>, lots: &str) {
    bench(bencher, lots, Sees::PatchOnly);
}

/// What the expert met on one drive, tick by tick.
struct Drive {
    map: Arc<Map>,
    ticks: Vec<(VehicleState, f32)>,
}

/// Decides every tick of the drives again, each drive with the memory of an expert that drives it.
fn bench(bencher: divan::Bencher<'_, '_>, lots: &str, sees: Sees) {
    let settings = Arc::new(EpisodeSettings::paper());
    let expert = ScriptedExpert::new(
        ExpertSettings { sees, ..ExpertSettings::half_points() },
        &settings,
        RootSeed(1).rng(Stream::Expert, 0),
    );
    let mut drives = Vec::new();
    for lot in scenarios::suite(lots).expect("there are such lots") {
        for direction in Direction::BOTH {
            let scenario = lot.scenario(RootSeed(1), &settings.vehicle).expect("no file is read");
            let map = Map::build(direction.of(scenario), &settings.vehicle).expect("lots are valid");
            drives.push(drive(expert.clone(), &settings, Arc::new(map)));
        }
    }
    let n_decisions: usize = drives.iter().map(|drive| drive.ticks.len()).sum();
    let observation = Observation::default();
    bencher.counter(ItemsCount::new(n_decisions)).bench(|| {
        for Drive { map, ticks } in &drives {
            let mut expert = expert.clone();
            for &(vehicle, progress_m) in ticks {
                let truth = GroundTruth { map, vehicle, progress_m };
                divan::black_box(expert.decide(&Situation { observation: &observation, truth }));
            }
        }
    });
}

fn drive(mut expert: ScriptedExpert, settings: &Arc<EpisodeSettings>, map: Arc<Map>) -> Drive {
    let mut episode = Episode::new(Arc::clone(settings), Arc::clone(&map), RootSeed(1));
    let mut ticks = Vec::new();
    while episode.ending().is_none() {
        ticks.push((episode.vehicle(), episode.progress_m()));
        let decision = expert.decide(&episode.situation());
        episode.apply(decision);
    }
    Drive { map, ticks }
}
