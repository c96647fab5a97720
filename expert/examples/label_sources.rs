//! What labels depend on that the bird's-eye view does not show: each line changes one thing the network cannot see,
//! asks a fresh expert again, and prints how far the label moves. What moves here cannot be learned from the view.
//!
//! `cargo run -p expert --example label_sources -- --seeds 4 --lots a`
#![allow(clippy::print_stdout, reason = "a tool that prints")]

#[path = "shared/overrides.rs"]
mod overrides;

use clap::Parser;
use expert::{ExpertSettings, ScriptedExpert, Sees};
use rayon::prelude::*;
use scenarios::reference::{ReferenceLot, lot};
use sim::driver::{Driver, GroundTruth, LookAheadPoint, Situation};
use sim::episode::{Episode, EpisodeSettings};
use sim::geometry::{Pose, Vec2};
use sim::map::Map;
use sim::scenario::Direction;
use sim::seed::{RootSeed, Stream};
use sim::sensing::Observation;
use sim::vehicle::VehicleState;
use std::sync::Arc;

/// Shows what labels depend on that the bird's-eye view does not show.
#[derive(Debug, Parser)]
struct Args {
    /// Trials per lot and direction.
    #[arg(long, default_value_t = 4)]
    seeds: u64,
    /// Which lots.
    #[arg(long, default_value = "a")]
    lots: String,
    /// Overrides a setting of the expert, e.g. `weights.load=0.5`; may be repeated.
    #[arg(long = "set", value_name = "KEY=JSON")]
    overrides: Vec<String>,
}

/// Every how many ticks labels are compared.
const EVERY_TICKS: u32 = 7;
/// Labels nearer than this agree: the paper's τ = 0.07 of a 12 m patch.
const TOLERANCE_M: f32 = 0.84;

/// One thing changed.
type Change = (&'static str, fn(&mut Asked));

/// What an expert is asked.
#[derive(Debug, Clone)]
struct Asked {
    settings: ExpertSettings,
    vehicle: VehicleState,
}

const CHANGES: [Change; 7] = [
    ("wheels straight", |asked| asked.vehicle.steering_rad = 0.0),
    ("speed 1.4 m/s", |asked| asked.vehicle.speed_mps = 1.4),
    ("ground outside the view unknown", |asked| asked.settings.sees = Sees::PatchOnly),
    ("5 cm to the left", |asked| shift(asked, Vec2::new(0.0, 0.05), 0.0)),
    ("20 cm to the left", |asked| shift(asked, Vec2::new(0.0, 0.2), 0.0)),
    ("10 cm ahead", |asked| shift(asked, Vec2::new(0.1, 0.0), 0.0)),
    ("turned by 1°", |asked| shift(asked, Vec2::ZERO, 0.0175)),
];

fn shift(asked: &mut Asked, in_ego: Vec2, turn_rad: f32) {
    let pose = asked.vehicle.pose;
    asked.vehicle.pose = Pose::new(pose.world_from_ego().point(in_ego), pose.heading_rad + turn_rad);
}

fn main() {
    let args = Args::parse();
    let expert = args
        .overrides
        .iter()
        .fold(ExpertSettings::half_points(), |settings, text| overrides::overridden(&settings, text));
    let lots: Vec<_> = ReferenceLot::ALL.into_iter().filter(|lot| args.lots.contains(&lot.name()[4..])).collect();
    let trials: Vec<_> = lots
        .iter()
        .flat_map(|&which| Direction::BOTH.map(|direction| (which, direction)))
        .flat_map(|(which, direction)| (1..=args.seeds).map(move |seed| (which, direction, seed)))
        .collect();
    let moves: Vec<_> =
        trials.par_iter().flat_map_iter(|&(which, direction, seed)| drive(&expert, which, direction, seed)).collect();
    println!("{:34} {:>8} {:>8} {:>8} {:>8} {:>9}", "", "left rms", "ahead rms", "median", "90 %", "> 0.84 m");
    let names = std::iter::once("memory of the last label").chain(CHANGES.iter().map(|(name, _)| *name));
    for (i, name) in names.enumerate() {
        let own: Vec<_> = moves.iter().map(|of_tick| of_tick[i]).collect();
        print_line(name, &own);
    }
}

/// How far each change moved the label, (ahead, left).
type Moves = [Vec2; CHANGES.len() + 1];

fn drive(expert: &ExpertSettings, which: ReferenceLot, direction: Direction, seed: u64) -> Vec<Moves> {
    let settings = Arc::new(EpisodeSettings::paper());
    let scenario = direction.of(lot(which, RootSeed(seed)));
    let map = Arc::new(Map::build(scenario, &settings.vehicle).expect("reference lots are valid"));
    let mut driver = ScriptedExpert::new(expert.clone(), &settings, RootSeed(1).rng(Stream::Expert, 0));
    let mut episode = Episode::new(Arc::clone(&settings), Arc::clone(&map), RootSeed(seed));
    let mut moves = Vec::new();
    while episode.ending().is_none() {
        let decision = driver.decide(&episode.situation());
        if episode.tick().is_multiple_of(EVERY_TICKS) {
            let asked = Asked { settings: expert.clone(), vehicle: episode.vehicle() };
            let answer = |asked: Asked| fresh_answer(asked, &settings, &map, episode.progress_m());
            let base = answer(asked.clone());
            let mut of_tick = [difference(decision.look_ahead, base); CHANGES.len() + 1];
            for (slot, (_, change)) in of_tick[1..].iter_mut().zip(CHANGES) {
                let mut changed = asked.clone();
                change(&mut changed);
                *slot = difference(answer(changed), base);
            }
            moves.push(of_tick);
        }
        episode.apply(decision);
    }
    moves
}

fn fresh_answer(asked: Asked, settings: &EpisodeSettings, map: &Map, progress_m: f32) -> LookAheadPoint {
    let mut driver = ScriptedExpert::new(asked.settings, settings, RootSeed(1).rng(Stream::Expert, 0));
    let truth = GroundTruth { map, vehicle: asked.vehicle, progress_m };
    driver.decide(&Situation { observation: &Observation::default(), truth }).look_ahead
}

fn difference(a: LookAheadPoint, b: LookAheadPoint) -> Vec2 {
    Vec2::new(a.ahead_m - b.ahead_m, a.left_m - b.left_m)
}

fn print_line(name: &str, moves: &[Vec2]) {
    let n = moves.len() as f32;
    let rms = |of: fn(&Vec2) -> f32| (moves.iter().map(|m| of(m) * of(m)).sum::<f32>() / n).sqrt();
    let mut lengths: Vec<f32> = moves.iter().map(|m| m.length()).collect();
    lengths.sort_by(f32::total_cmp);
    let quantile = |share: f32| lengths[(share * (n - 1.0)) as usize];
    let beyond = lengths.iter().filter(|&&length_m| length_m > TOLERANCE_M).count() as f32 / n;
    println!(
        "{name:34} {:8.2} {:8.2} {:8.2} {:8.2} {:8.1} %",
        rms(|m| m.y),
        rms(|m| m.x),
        quantile(0.5),
        quantile(0.9),
        100.0 * beyond
    );
}
