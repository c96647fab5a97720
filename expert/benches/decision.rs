//! Time of one decision, in situations met on the way through the reference lots.
//!
//! `cargo bench --profile dev -p expert`
#![allow(missing_docs, reason = "divan's macro writes functions without docs")]

use divan::counter::ItemsCount;
use expert::{ExpertSettings, ScriptedExpert, Sees};
use scenarios::reference::{ReferenceLot, lot};
use sim::driver::{Driver, GroundTruth, Situation};
use sim::episode::{Episode, EpisodeSettings};
use sim::map::Map;
use sim::seed::RootSeed;
use sim::sensing::Observation;
use std::sync::Arc;

/// Every how many ticks a situation is kept: prime, so that it beats with nothing.
const EVERY_TICKS: usize = 17;

fn main() {
    divan::main();
}

#[divan::bench(args = ['a', 'b', 'c'], sample_count = 20, sample_size = 1)]
fn whole_map(bencher: divan::Bencher<'_, '_>, name: char) {
    bench(bencher, name, Sees::WholeMap);
}

#[divan::bench(args = ['a', 'b', 'c'], sample_count = 20, sample_size = 1)]
fn patch_only(bencher: divan::Bencher<'_, '_>, name: char) {
    bench(bencher, name, Sees::PatchOnly);
}

fn bench(bencher: divan::Bencher<'_, '_>, name: char, sees: Sees) {
    let which = match name {
        'a' => ReferenceLot::A,
        'b' => ReferenceLot::B,
        _ => ReferenceLot::C,
    };
    let settings = EpisodeSettings::paper();
    let map = Arc::new(Map::build(lot(which, RootSeed(1)), &settings.vehicle).expect("reference lots are valid"));
    let expert = ExpertSettings { sees, ..ExpertSettings::paper() };
    let new_driver = || ScriptedExpert::new(expert.clone(), &settings);

    let mut episode = Episode::new(Arc::new(settings.clone()), Arc::clone(&map), RootSeed(1));
    let mut driver = new_driver();
    let mut situations = Vec::new();
    while episode.ending().is_none() {
        let truth = GroundTruth { map: &map, vehicle: episode.vehicle(), progress_m: episode.progress_m() };
        situations.push((driver.clone(), truth));
        let decision = driver.decide(&episode.situation());
        episode.apply(decision);
    }
    let situations: Vec<_> = situations.into_iter().step_by(EVERY_TICKS).collect();
    let observation = Observation::default();
    bencher.counter(ItemsCount::new(situations.len())).with_inputs(|| situations.clone()).bench_values(|situations| {
        for (mut driver, truth) in situations {
            divan::black_box(driver.decide(&Situation { observation: &observation, truth }));
        }
    });
}
