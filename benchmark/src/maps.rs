//! Maps and starts of episodes.

use crate::{Effort, Goal, Report, time};
use scenarios::reference::{ReferenceLot, lot};
use sim::episode::{Episode, EpisodeSettings};
use sim::geometry::Vec2;
use sim::map::Map;
use sim::maths;
use sim::scenario::Scenario;
use sim::seed::RootSeed;
use std::hint::black_box;
use std::sync::Arc;

const MS: (&str, f64) = ("ms", 1e-3);

/// Measures a lane of 200 m, straight along an axis and at 45°, and the start of an episode on a reference lot.
///
/// # Errors
/// If the lane cannot be driven.
pub fn figures(effort: Effort, report: Report<'_>) -> anyhow::Result<()> {
    let settings = EpisodeSettings::paper();
    for degrees in [0.0_f32, 45.0] {
        let turned = |(x, y): (f32, f32)| maths::unit(degrees.to_radians()).rotate(Vec2::new(x, y));
        let boundary = [(-20.0, -1.6), (220.0, -1.6), (220.0, 1.6), (-20.0, 1.6)].map(turned);
        let scenario = Scenario::new("lane", boundary, [(0.0, 0.0), (200.0, 0.0)].map(turned));
        Map::build(scenario.clone(), &settings.vehicle)?;
        report(time(effort, &format!("map of 200 m at {degrees}°"), MS, Some(Goal::AtMost(3.0)), || {
            black_box(Map::build(scenario.clone(), &settings.vehicle)).ok();
        }));
    }
    let map = Arc::new(Map::build(lot(ReferenceLot::A, RootSeed(1)), &settings.vehicle)?);
    let settings = Arc::new(settings);
    report(time(effort, "start of an episode", MS, Some(Goal::AtMost(0.3)), || {
        black_box(Episode::new(Arc::clone(&settings), Arc::clone(&map), RootSeed(1)));
    }));
    Ok(())
}
