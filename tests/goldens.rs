//! Golden digests of episodes: a change of physics, sensing, noise or a driver cannot pass unseen.
//!
//! Each case drives one lot and digests four layers of the loop from tick to tick: what was observed, what was decided,
//! where the car went, what was measured. `tests/goldens.toml` holds the digests by stretches of ticks (0, 1, 2–3, 4–7, …),
//! so that a failure can say when the runs part and which layer does so first.
//!
//! After an intended change: `UPDATE_GOLDENS=1 cargo test -p tests goldens`, and say in the commit what changed and why.
//! Digests are of exact bits. Those of the network hold on x86-64 with AVX2 and FMA.

use crate::bench::root;
use expert::{ExpertSettings, ScriptedExpert};
use planners::{PlannerContext, PlannerSpec};
use policy::network::{DeviceChoice, InferenceSettings, NetworkArchitecture, Predictor, Weights};
use scenarios::reference::{ReferenceLot, lot};
use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};
use sim::driver::{Decision, Driver, LookAheadPoint, Policy, SensorsOnly, Source};
use sim::episode::{Episode, EpisodeReport, EpisodeSettings};
use sim::frame::{Event, Frame};
use sim::geometry::Pose;
use sim::map::Map;
use sim::scenario::{Direction, NoiseLevel};
use sim::seed::RootSeed;
use sim::sensing::noise::NoiseSettings;
use sim::sensing::{GRID_CELLS, GridGeometry, Observation};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Ticks per case: 51 s of driving, with near-collisions of those who have any.
const TICKS: usize = 1024;

/// Digests of one case: a word per stretch of ticks in every layer.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Golden {
    observations: String,
    decisions: String,
    trajectory: String,
    metrics: String,
}

impl Golden {
    /// In the order of the loop: what changes first is the cause.
    fn layers(&self) -> [(&'static str, &str); 4] {
        [
            ("observations", &self.observations),
            ("decisions", &self.decisions),
            ("trajectory", &self.trajectory),
            ("metrics", &self.metrics),
        ]
    }

    /// Where another run parts from this one; `None` if it does not.
    fn difference(&self, other: &Self) -> Option<String> {
        let words =
            |golden: &Self| golden.layers().map(|(_, words)| words.split(' ').map(str::to_owned).collect::<Vec<_>>());
        let (ours, theirs) = (words(self), words(other));
        let n = ours.iter().chain(&theirs).map(Vec::len).max().unwrap_or(0);
        let stretch = (0..n).find(|&i| (0..4).any(|layer| ours[layer].get(i) != theirs[layer].get(i)))?;
        let names: Vec<&str> = (0..4)
            .filter(|&layer| ours[layer].get(stretch) != theirs[layer].get(stretch))
            .map(|layer| self.layers()[layer].0)
            .collect();
        let (first, last) = ticks_of(stretch);
        let since = if first == last { format!("at tick {first}") } else { format!("in ticks {first} to {last}") };
        Some(format!("{} changed first, {since} (there: {})", names[0], names.join(", ")))
    }
}

/// First and last tick of a stretch.
fn ticks_of(stretch: usize) -> (usize, usize) {
    let first = if stretch == 0 { 0 } else { 1 << (stretch - 1) };
    (first, (1_usize << stretch) - 1)
}

/// Digests the layers of an episode as it is driven.
#[derive(Default)]
struct Recorder {
    layers: [Sha256; 4],
    golden: Golden,
    ticks: usize,
}

impl Recorder {
    fn frame(&mut self, frame: &Frame, report: &EpisodeReport) {
        let [observations, decisions, trajectory, metrics] = &mut self.layers;
        (0..GRID_CELLS).for_each(|row| observations.update(frame.observation.grid.row(row).to_le_bytes()));
        let Decision { look_ahead, source, spread, speed_limit_mps } = frame.decision;
        floats(decisions, &[look_ahead.ahead_m, look_ahead.left_m]);
        decisions.update([source as u8, u8::from(spread.is_some())]);
        if let Some(spread) = spread {
            floats(decisions, &[spread.ahead_m, spread.left_m]);
        }
        floats(decisions, speed_limit_mps.as_slice());
        let (vehicle, command) = (&frame.vehicle, &frame.command);
        pose(trajectory, vehicle.pose);
        floats(trajectory, &[vehicle.speed_mps, vehicle.steering_rad, vehicle.accel_mps2, vehicle.accel_demand_mps2]);
        floats(trajectory, &[vehicle.speed_integral_mps2, command.steering_rad, command.speed_mps, frame.driven_m]);
        floats(metrics, &[frame.time_s, frame.progress_m, frame.safe_ratio, frame.clearance_m]);
        metrics.update(frame.contacts.to_le_bytes());
        match frame.event {
            Event::Drove => metrics.update([0]),
            Event::ReachedEnd => metrics.update([1]),
            Event::NearCollision { at, progress_m } => {
                pose(metrics, at);
                floats(metrics, &[progress_m]);
            }
            Event::Stuck { at, progress_m } => {
                pose(metrics, at);
                floats(metrics, &[-progress_m]);
            }
        }
        let so_far = &report.metrics;
        metrics.update(so_far.steering_reversals.to_le_bytes());
        floats(metrics, &[so_far.driven_m, so_far.safe_ratio, so_far.clearance_min_m, so_far.steering_effort_rad]);
        self.ticks += 1;
        if self.ticks.is_power_of_two() {
            self.end_stretch();
        }
    }

    /// Appends a word to every layer.
    fn end_stretch(&mut self) {
        let Golden { observations, decisions, trajectory, metrics } = &mut self.golden;
        for (layer, words) in self.layers.iter_mut().zip([observations, decisions, trajectory, metrics]) {
            let digest = layer.finalize_reset();
            let word = format!("{:08x}", u32::from_be_bytes([digest[0], digest[1], digest[2], digest[3]]));
            *words = if words.is_empty() { word } else { format!("{words} {word}") };
        }
    }
}

fn floats(layer: &mut Sha256, values: &[f32]) {
    for value in values {
        layer.update(value.to_bits().to_le_bytes());
    }
}

fn pose(layer: &mut Sha256, pose: Pose) {
    floats(layer, &[pose.x_m, pose.y_m, pose.heading_rad]);
}

/// Heads for the middle of the free cells of one row: simple enough that its decisions change only if what it sees does.
struct MiddleOfTheRow(GridGeometry);

impl Policy for MiddleOfTheRow {
    fn act(&mut self, observation: &Observation) -> Decision {
        const ROW: usize = 16;
        let free: Vec<usize> = (0..GRID_CELLS).filter(|&col| !observation.grid.is_occupied(ROW, col)).collect();
        let left_m = |col: usize| self.0.cell_in_ego(ROW, col).y;
        let sum_m: f32 = free.iter().map(|&col| left_m(col)).sum();
        let look_ahead = LookAheadPoint {
            ahead_m: self.0.cell_in_ego(ROW, 0).x,
            left_m: if free.is_empty() { 0.0 } else { sum_m / free.len() as f32 },
        };
        Decision { look_ahead, source: Source::Planner, spread: None, speed_limit_mps: None }
    }
}

/// A network that has learned nothing: its weights are drawn from a seed.
struct Untrained(Predictor, GridGeometry);

impl Policy for Untrained {
    fn act(&mut self, observation: &Observation) -> Decision {
        let prediction = self.0.predict(&[&observation.grid])[0];
        let spread = Some(prediction.spread(self.1));
        Decision { look_ahead: prediction.look_ahead(self.1), source: Source::Novice, spread, speed_limit_mps: None }
    }
}

fn drivers(settings: &EpisodeSettings) -> Vec<(&'static str, Box<dyn Driver>)> {
    let geometry = settings.sensing.geometry;
    let tentacle = PlannerSpec::all().into_iter().find(|planner| planner.name() == "tentacle").unwrap();
    let weights = Weights::init(NetworkArchitecture::compact(), RootSeed(1), 0);
    let untrained = Untrained(Predictor::new(&weights, InferenceSettings::plain(), DeviceChoice::Cpu), geometry);
    vec![
        ("middle of the row", Box::new(SensorsOnly(MiddleOfTheRow(geometry)))),
        ("expert", Box::new(ScriptedExpert::new(ExpertSettings::half_points(), settings))),
        ("tentacle", Box::new(SensorsOnly(tentacle.planner(&PlannerContext::of(settings))))),
        ("network", Box::new(SensorsOnly(untrained))),
    ]
}

fn drive(settings: &Arc<EpisodeSettings>, map: Arc<Map>, driver: &mut dyn Driver) -> Golden {
    let mut episode = Episode::new(Arc::clone(settings), map, RootSeed(3));
    let mut recorder = Recorder::default();
    while episode.ending().is_none() && recorder.ticks < TICKS {
        episode.observe();
        if episode.was_reset() {
            driver.reset();
        }
        let decision = driver.decide(&episode.situation());
        let frame = episode.apply(decision);
        recorder.frame(&frame, &episode.report());
    }
    if !recorder.ticks.is_power_of_two() {
        recorder.end_stretch();
    }
    recorder.golden
}

#[test]
fn goldens_of_every_layer_are_kept() {
    let mut driven = BTreeMap::new();
    for level in [NoiseLevel::Clean, NoiseLevel::Paper] {
        let settings = Arc::new(EpisodeSettings { noise: NoiseSettings::of(level), ..EpisodeSettings::paper() });
        for direction in Direction::BOTH {
            let scenario = direction.of(lot(ReferenceLot::C, RootSeed(2)));
            let map = Arc::new(Map::build(scenario, &settings.vehicle).unwrap());
            for (name, mut driver) in drivers(&settings) {
                let case = format!("{name}, {level:?}, {direction:?}").to_lowercase();
                driven.insert(case, drive(&settings, Arc::clone(&map), driver.as_mut()));
            }
        }
    }
    let file = root().join("tests/goldens.toml");
    if std::env::var_os("UPDATE_GOLDENS").is_some() {
        let head =
            "# Written by UPDATE_GOLDENS=1 cargo test -p tests goldens; tests/goldens.rs says what is digested.\n\n";
        std::fs::write(&file, head.to_owned() + &toml::to_string(&driven).unwrap()).unwrap();
        return;
    }
    let kept: BTreeMap<String, Golden> = toml::from_str(&std::fs::read_to_string(&file).unwrap()).unwrap();
    let changes: Vec<String> = driven
        .iter()
        .filter_map(|(case, golden)| {
            let kept = kept.get(case).cloned().unwrap_or_default();
            kept.difference(golden).map(|difference| format!("{case}: {difference}"))
        })
        .chain(kept.keys().filter(|case| !driven.contains_key(*case)).map(|case| format!("{case}: is not driven")))
        .collect();
    assert!(
        changes.is_empty(),
        "episodes changed:\n{}\nIntended? UPDATE_GOLDENS=1 cargo test -p tests goldens, and say why in the commit",
        changes.join("\n")
    );
}

#[test]
fn a_difference_names_the_first_layer_and_its_ticks() {
    let golden = |decisions: &str, trajectory: &str| Golden {
        observations: "a b c d".to_owned(),
        decisions: decisions.to_owned(),
        trajectory: trajectory.to_owned(),
        metrics: "a b c d".to_owned(),
    };
    let kept = golden("a b c d", "a b c d");
    assert_eq!(kept.difference(&kept.clone()), None);
    let at_once = kept.difference(&golden("a b c d", "x x x x")).unwrap();
    assert_eq!(at_once, "trajectory changed first, at tick 0 (there: trajectory)");
    let later = kept.difference(&golden("a b c x", "a b c x")).unwrap();
    assert_eq!(later, "decisions changed first, in ticks 4 to 7 (there: decisions, trajectory)");
    let shorter = kept.difference(&golden("a b c", "a b c d")).unwrap();
    assert!(shorter.starts_with("decisions changed first, in ticks 4 to 7"), "{shorter}");
}
