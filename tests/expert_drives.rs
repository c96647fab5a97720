//! The expert on the reference lots: a few of the hundred seeds of the acceptance run (README, results).

use expert::{ExpertSettings, ScriptedExpert};
use scenarios::reference::{ReferenceLot, lot};
use sim::episode::{self, Episode, EpisodeSettings};
use sim::frame::Ending;
use sim::map::Map;
use sim::scenario::Direction;
use sim::seed::RootSeed;
use std::path::Path;
use std::sync::Arc;

#[test]
fn the_expert_drives_every_reference_lot_both_ways_without_a_near_collision() {
    let settings = Arc::new(EpisodeSettings::paper());
    for which in [ReferenceLot::A, ReferenceLot::B, ReferenceLot::C] {
        for direction in Direction::BOTH {
            let seed = RootSeed(4);
            let map = Arc::new(Map::build(direction.of(lot(which, seed)), &settings.vehicle).unwrap());
            let mut expert = ScriptedExpert::new(ExpertSettings::half_points(), &settings);
            let report = episode::run(Episode::new(Arc::clone(&settings), map, seed), &mut expert, &mut ());
            let metrics = &report.metrics;
            assert_eq!(report.ending, Ending::ReachedEnd, "{which:?} {direction:?}");
            assert_eq!(
                (metrics.near_collisions, metrics.contacts, metrics.stuck),
                (0, 0, 0),
                "{which:?} {direction:?}: {:?}",
                report.events
            );
            assert!((1.0..2.0).contains(&metrics.mean_speed_mps()), "{which:?}: {} m/s", metrics.mean_speed_mps());
        }
    }
}

/// ROS maps and TPCAP cases become lots like any other.
#[test]
fn the_expert_drives_the_example_maps_without_a_near_collision() {
    let settings = Arc::new(EpisodeSettings::paper());
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenarios/examples");
    let maps = examples.join("maps").read_dir().unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let mut maps: Vec<String> = maps
        .filter(|file| Path::new(file).extension().is_some_and(|ending| ending == "yaml"))
        .map(|file| format!("maps/{file}"))
        .collect();
    maps.sort();
    for (file, directions) in [
        ("car-park.yaml", &Direction::BOTH[..]),
        ("car-park-loop.lot.toml", &Direction::BOTH),
        ("car-park-centre.lot.toml", &Direction::BOTH),
        ("open-lot.csv", &[Direction::Forward]),
    ]
    .into_iter()
    .chain(maps.iter().map(|file| (file.as_str(), &Direction::BOTH[..])))
    {
        let scenario =
            scenarios::load::load(&examples.join(file), &settings.vehicle).unwrap_or_else(|error| panic!("{error}"));
        for &direction in directions {
            let map = Arc::new(Map::build(direction.of(scenario.clone()), &settings.vehicle).unwrap());
            let mut expert = ScriptedExpert::new(ExpertSettings::half_points(), &settings);
            let report = episode::run(Episode::new(Arc::clone(&settings), map, RootSeed(4)), &mut expert, &mut ());
            assert_eq!(report.ending, Ending::ReachedEnd, "{file} {direction:?}");
            let metrics = &report.metrics;
            assert_eq!(
                (metrics.near_collisions, metrics.contacts, metrics.stuck),
                (0, 0, 0),
                "{file} {direction:?}: {:?}",
                report.events
            );
        }
    }
}
