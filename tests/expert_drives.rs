//! The expert on the reference lots with the obstacles of one seed, on example maps and in hairpins.

use expert::{ExpertSettings, ScriptedExpert};
use scenarios::reference::{ReferenceLot, lot};
use sim::episode::{self, Episode, EpisodeReport, EpisodeSettings};
use sim::frame::Ending;
use sim::map::Map;
use sim::maths;
use sim::scenario::Direction;
use sim::seed::{RootSeed, Stream};
use std::f32::consts::PI;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;

#[test]
fn the_expert_drives_every_reference_lot_both_ways_without_a_near_collision() {
    let settings = Arc::new(EpisodeSettings::paper());
    for which in [ReferenceLot::A, ReferenceLot::B, ReferenceLot::C] {
        for direction in Direction::BOTH {
            let seed = RootSeed(4);
            let map = Arc::new(Map::build(direction.of(lot(which, seed)), &settings.vehicle).unwrap());
            let mut expert =
                ScriptedExpert::new(ExpertSettings::half_points(), &settings, RootSeed(1).rng(Stream::Expert, 0));
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

/// ROS maps, TPCAP cases and lots written by hand are lots like any other.
#[test]
fn the_expert_drives_the_example_maps_without_a_near_collision() {
    let settings = Arc::new(EpisodeSettings::paper());
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenarios/examples");
    let files = |folder: &str, ending: &str| {
        let entries = examples.join(folder).read_dir().unwrap().map(|entry| entry.unwrap().path());
        let mut files: Vec<PathBuf> =
            entries.filter(|path| path.extension().is_some_and(|found| found == ending)).collect();
        files.sort();
        files.into_iter().map(|path| (path, &Direction::BOTH[..]))
    };
    let beside = [
        ("slalom.toml", &Direction::BOTH[..]),
        ("car-park.yaml", &Direction::BOTH),
        ("car-park-loop.lot.toml", &Direction::BOTH),
        ("car-park-centre.lot.toml", &Direction::BOTH),
        ("open-lot.csv", &[Direction::Forward]),
    ];
    let beside = beside.into_iter().map(|(file, directions)| (examples.join(file), directions));
    // In a bend of R = 8 m the body sweeps 2.63 m: a hand's breadth less than this lane is wide, on either side.
    let lanes = files("lanes", "toml").filter(|(path, _)| !path.ends_with("lane-r8-w2.8.toml"));
    let maps = ["maps", "maps-blind", "maps-blind-2"].into_iter().flat_map(|folder| files(folder, "yaml"));
    for (path, directions) in beside.chain(lanes).chain(maps) {
        let scenario = scenarios::load::load(&path, &settings.vehicle).unwrap_or_else(|error| panic!("{error}"));
        for &direction in directions {
            let map = Arc::new(Map::build(direction.of(scenario.clone()), &settings.vehicle).unwrap());
            let mut expert =
                ScriptedExpert::new(ExpertSettings::half_points(), &settings, RootSeed(1).rng(Stream::Expert, 0));
            let report = episode::run(Episode::new(Arc::clone(&settings), map, RootSeed(4)), &mut expert, &mut ());
            assert_eq!(report.ending, Ending::ReachedEnd, "{} {direction:?}", path.display());
            let metrics = &report.metrics;
            assert_eq!(
                (metrics.near_collisions, metrics.contacts, metrics.stuck),
                (0, 0, 0),
                "{} {direction:?}: {:?}",
                path.display(),
                report.events
            );
        }
    }
}

/// A hairpin between walls: two straights and half a ring from `inner_m` to `outer_m`.
fn hairpin(inner_m: f32, outer_m: f32) -> String {
    let half_ring = |radius_m: f32, parts: u32| {
        (0..=parts).map(move |part| {
            let angle = PI * (part as f32 / parts as f32 - 0.5);
            let (sine, cosine) = maths::sin_cos(angle);
            (radius_m * cosine, radius_m * sine)
        })
    };
    let list = |points: Vec<(f32, f32)>| {
        points.iter().fold(String::new(), |mut text, (x, y)| {
            let _ = write!(text, "[{x:.3}, {y:.3}], ");
            text
        })
    };
    let end_m = -30.0;
    let outline = half_ring(outer_m, 48).chain([(end_m, outer_m), (end_m, inner_m)]);
    let inside: Vec<_> = half_ring(inner_m, 48).collect();
    let outline = outline.chain(inside.into_iter().rev()).chain([(end_m, -inner_m), (end_m, -outer_m)]);
    let middle_m = 0.5 * (inner_m + outer_m);
    let route = [(-16.0, -middle_m)].into_iter().chain(half_ring(middle_m, 16)).chain([(-12.0, middle_m)]);
    format!(
        "name = \"hairpin\"\nboundary = [{}]\nboundary_height_m = 1.0\n[reference_path]\npoints = [{}]\n",
        list(outline.collect()),
        list(route.collect())
    )
}

fn drive_hairpin(inner_m: f32, width_m: f32, curvature_max_per_m: f32) -> [EpisodeReport; 2] {
    let settings = Arc::new(EpisodeSettings::paper());
    let lot = scenarios::load::parse(&hairpin(inner_m, inner_m + width_m), "hairpin.toml", &settings.vehicle).unwrap();
    Direction::BOTH.map(|direction| {
        let map = Arc::new(Map::build(direction.of(lot.clone()), &settings.vehicle).unwrap());
        let expert = ExpertSettings { curvature_max_per_m, ..ExpertSettings::half_points() };
        let mut expert = ScriptedExpert::new(expert, &settings, RootSeed(1).rng(Stream::Expert, 0));
        episode::run(Episode::new(Arc::clone(&settings), map, RootSeed(4)), &mut expert, &mut ())
    })
}

/// Pure pursuit of a point that is seen turns no tighter than R = 4.3 m, of which the body sweeps 3.37 to 6.46 m. With its
/// labels allowed that far the expert drives hairpins that leave .3 to .4 m more; with the default's R = 4.65 m it needs
/// the room for that circle (docs/maps.md).
#[test]
fn hairpins_near_the_turning_limit_are_driven() {
    let default_per_m = ExpertSettings::half_points().curvature_max_per_m;
    for (inner_m, width_m, curvature_max_per_m) in [
        (3.5, 3.6, default_per_m),
        (3.0, 4.2, default_per_m),
        (4.0, 3.4, default_per_m),
        (3.0, 3.8, 0.225),
        (3.2, 3.6, 0.225),
        (3.5, 3.5, 0.225),
    ] {
        for EpisodeReport { ending, metrics, .. } in drive_hairpin(inner_m, width_m, curvature_max_per_m) {
            let failures = (metrics.near_collisions, metrics.contacts, metrics.stuck);
            assert_eq!((ending, failures), (Ending::ReachedEnd, (0, 0, 0)), "{inner_m} m inside, {width_m} m wide");
        }
    }
    let [too_tight, _] = drive_hairpin(2.8, 3.4, default_per_m);
    assert!(too_tight.metrics.near_collisions > 0, "no circle of a label fits in there");
}
