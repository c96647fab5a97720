//! Drives the scripted expert over the reference lots and prints the results.
//!
//! `cargo run -p expert --example drive_lots -- --seeds 20 --lots a --set point_clearance_m=0.2`
#![allow(clippy::print_stdout, reason = "a tool that prints")]
#![allow(clippy::disallowed_methods, reason = "it also times: microseconds per decision")]

#[path = "shared/overrides.rs"]
mod overrides;

use clap::Parser;
use comfy_table::{Table, presets};
use expert::{ExpertSettings, ExpertStats, Rule, ScriptedExpert};
use rayon::prelude::*;
use scenarios::reference::{ReferenceLot, lot};
use sim::driver::Driver;
use sim::episode::{Episode, EpisodeReport, EpisodeSettings};
use sim::frame::{Event, Frame};
use sim::map::Map;
use sim::scenario::Direction;
use sim::seed::{RootSeed, Stream};
use std::sync::Arc;
use std::time::Instant;

/// Drives the scripted expert over the reference lots.
#[derive(Debug, Parser)]
struct Args {
    /// Trials per lot and direction; each draws its own obstacles.
    #[arg(long, default_value_t = 10)]
    seeds: u64,
    /// Seed of the first trial.
    #[arg(long, default_value_t = 1)]
    first_seed: u64,
    /// Which lots.
    #[arg(long, default_value = "abc")]
    lots: String,
    /// Overrides a setting of the expert, e.g. `weights.load=0.5`; may be repeated.
    #[arg(long = "set", value_name = "KEY=JSON")]
    overrides: Vec<String>,
    /// Lists every near-collision and stuck event with the last decisions before it.
    #[arg(long)]
    events: bool,
}

fn main() {
    let args = Args::parse();
    let expert = args
        .overrides
        .iter()
        .fold(ExpertSettings::half_points(), |settings, text| overrides::overridden(&settings, text));
    let mut table = Table::new();
    table.load_style(presets::NOTHING).set_header([
        "lot",
        "",
        "km",
        "near-coll",
        "contact",
        "stuck",
        "m/s",
        "safe",
        "closest",
        "<0.2 m",
        "far",
        "avoid",
        "relaxed",
        "last",
        "failed",
        "jumps",
        "µs",
    ]);
    for which in ReferenceLot::ALL.into_iter().filter(|lot| args.lots.contains(&lot.name()[4..])) {
        for direction in Direction::BOTH {
            let seeds: Vec<u64> = (args.first_seed..args.first_seed + args.seeds).collect();
            let runs: Vec<Run> = seeds.par_iter().map(|&seed| drive(&expert, which, direction, seed)).collect();
            table.add_row(row(which, direction, &runs));
            if args.events {
                runs.iter().flat_map(|run| &run.incidents).for_each(|incident| println!("{incident}"));
            }
        }
    }
    println!("{table}");
}

/// One driven trial.
struct Run {
    report: EpisodeReport,
    stats: ExpertStats,
    seconds: f64,
    incidents: Vec<String>,
    /// Ticks with less than [`TIGHT_M`] to the nearest thing.
    tight_ticks: u32,
}

/// What the column "<0.2 m" counts: the clearance plans keep where they can.
const TIGHT_M: f32 = 0.2;

fn drive(expert: &ExpertSettings, which: ReferenceLot, direction: Direction, seed: u64) -> Run {
    let settings = Arc::new(EpisodeSettings::paper());
    let scenario = direction.of(lot(which, RootSeed(seed)));
    let map = Arc::new(Map::build(scenario, &settings.vehicle).expect("reference lots are valid"));
    let mut driver = ScriptedExpert::new(expert.clone(), &settings, RootSeed(1).rng(Stream::Expert, 0));
    let mut episode = Episode::new(Arc::clone(&settings), map, RootSeed(seed));
    let mut seconds = 0.0;
    let mut incidents = Vec::new();
    let mut tight_ticks = 0;
    let mut recent: Vec<String> = Vec::new();
    while episode.ending().is_none() {
        // No `observe`: the expert does not look at the grid, and drawing it would take most of the time.
        if episode.was_reset() {
            driver.reset();
        }
        let before = *driver.stats();
        let started = Instant::now();
        let decision = driver.decide(&episode.situation());
        seconds += started.elapsed().as_secs_f64();
        let frame = episode.apply(decision);
        tight_ticks += u32::from(frame.clearance_m < TIGHT_M);
        recent.push(line(&frame, rule_between(&before, driver.stats())));
        if matches!(frame.event, Event::NearCollision { .. } | Event::Stuck { .. }) {
            let last = &recent[recent.len().saturating_sub(80)..];
            let thinned: Vec<&str> = last.iter().rev().step_by(8).rev().map(String::as_str).collect();
            let name = which.name();
            incidents.push(format!("{name} {direction:?} seed {seed}: {:?}\n{}", frame.event, thinned.join("\n")));
        }
    }
    Run { report: episode.report().expect("it has ended"), stats: *driver.stats(), seconds, incidents, tight_ticks }
}

fn line(frame: &Frame, rule: Rule) -> String {
    let point = frame.decision.look_ahead;
    format!(
        "  {:5} s {:6.2} m/s {:.2} steer {:+.1}° clear {:.2} point ({:.2}, {:+.2}) {rule:?}",
        frame.tick,
        frame.progress_m,
        frame.vehicle.speed_mps,
        frame.vehicle.steering_rad.to_degrees(),
        frame.clearance_m,
        point.ahead_m,
        point.left_m,
    )
}

/// The rule whose count grew.
fn rule_between(before: &ExpertStats, after: &ExpertStats) -> Rule {
    if after.far > before.far {
        Rule::Far
    } else if after.avoid > before.avoid {
        Rule::Avoid
    } else if after.relaxed > before.relaxed {
        Rule::Relaxed
    } else {
        Rule::LastResort
    }
}

fn row(which: ReferenceLot, direction: Direction, runs: &[Run]) -> Vec<String> {
    let mut stats = ExpertStats::default();
    for run in runs {
        stats.merge(&run.stats);
    }
    let sum = |of: fn(&EpisodeReport) -> f64| runs.iter().map(|run| of(&run.report)).sum::<f64>();
    let metres = sum(|report| f64::from(report.metrics.driven_m));
    let duration_s = sum(|report| f64::from(report.metrics.duration_s));
    let safe_ratio = sum(|report| f64::from(report.metrics.safe_ratio)) / runs.len() as f64;
    let closest_m = runs.iter().map(|run| run.report.metrics.clearance_min_m).fold(f32::INFINITY, f32::min);
    let tight = runs.iter().map(|run| f64::from(run.tight_ticks)).sum::<f64>() / stats.decisions as f64;
    let micros = 1e6 * runs.iter().map(|run| run.seconds).sum::<f64>() / stats.decisions as f64;
    let share = |count| format!("{:.4}", stats.share(count));
    vec![
        which.name().to_owned(),
        format!("{direction:?}"),
        format!("{:.2}", 1e-3 * sum(|report| f64::from(report.metrics.reference_m))),
        format!("{}", sum(|report| f64::from(report.metrics.near_collisions))),
        format!("{}", sum(|report| f64::from(report.metrics.contacts))),
        format!("{}", sum(|report| f64::from(report.metrics.stuck))),
        format!("{:.2}", metres / duration_s),
        format!("{safe_ratio:.3}"),
        format!("{closest_m:.3}"),
        format!("{tight:.4}"),
        share(stats.far),
        share(stats.avoid),
        share(stats.relaxed),
        share(stats.last_resort),
        share(stats.failed),
        share(stats.label_jumps),
        format!("{micros:.0}"),
    ]
}
