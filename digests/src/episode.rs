//! One episode, digested as it is driven.

use crate::Golden;
use sha2::{Digest as _, Sha256};
use sim::driver::{Decision, Driver};
use sim::episode::{Episode, EpisodeSettings};
use sim::frame::{Event, Frame};
use sim::geometry::Pose;
use sim::map::Map;
use sim::metrics::EpisodeMetrics;
use sim::seed::RootSeed;
use sim::sensing::GRID_CELLS;
use std::sync::Arc;

/// Ticks per case: 51 s of driving, with near-collisions of those who have any.
const TICKS: usize = 1024;

/// Drives a map for at most 1024 ticks.
pub fn drive(settings: &Arc<EpisodeSettings>, map: Arc<Map>, driver: &mut dyn Driver) -> Golden {
    let mut episode = Episode::new(Arc::clone(settings), map, RootSeed(3));
    let mut recorder = Recorder::default();
    while episode.ending().is_none() && recorder.ticks < TICKS {
        episode.observe();
        if episode.was_reset() {
            driver.reset();
        }
        let decision = driver.decide(&episode.situation());
        let frame = episode.apply(decision);
        recorder.frame(&frame, &episode.metrics());
    }
    if !recorder.ticks.is_power_of_two() {
        recorder.end_stretch();
    }
    recorder.golden
}

/// Digests the layers of an episode as it is driven.
#[derive(Default)]
struct Recorder {
    layers: [Sha256; 4],
    golden: Golden,
    ticks: usize,
}

impl Recorder {
    fn frame(&mut self, frame: &Frame, so_far: &EpisodeMetrics) {
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
