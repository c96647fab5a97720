//! A network from an ONNX file at the wheel of many cars.

use crate::network::OnnxNetwork;
use policy::action_smoothing;
use policy::drivers::novice_decision;
use policy::network::InferenceSettings;
use rten::ThreadPool;
use sim::action_smoothing::FleetSmoothing;
use sim::driver::{Decision, Fleet, Seat};
use sim::sensing::GridGeometry;
use std::fmt;
use std::sync::Arc;

/// The network alone drives every seat, its answers used as those of [`policy::drivers::NetFleet`] are.
pub struct OnnxFleet {
    network: OnnxNetwork,
    mirror_averaging: bool,
    geometry: GridGeometry,
    smoothing: FleetSmoothing,
    /// One thread: fleets drive side by side.
    pool: Arc<ThreadPool>,
}

impl fmt::Debug for OnnxFleet {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.network.fmt(f)
    }
}

impl OnnxFleet {
    /// Seats a network. `geometry`: the patch of ground that its grids show.
    pub fn new(network: &OnnxNetwork, inference: InferenceSettings, geometry: GridGeometry) -> Self {
        Self {
            network: network.clone(),
            mirror_averaging: inference.mirror_averaging,
            geometry,
            smoothing: FleetSmoothing::new(inference.smoothing_ticks),
            // With more threads sums are taken in another order, and other bits come out.
            pool: Arc::new(ThreadPool::with_num_threads(1)),
        }
    }
}

impl Fleet for OnnxFleet {
    fn decide(&mut self, seats: &[Seat<'_>], decisions: &mut Vec<Decision>) {
        let grids: Vec<_> = seats.iter().map(|seat| &seat.situation.observation.grid).collect();
        let mut answers = self.network.predict(&grids, self.mirror_averaging, &self.pool);
        action_smoothing::smooth_all(&mut self.smoothing, seats, &mut answers, self.geometry);
        decisions.extend(answers.iter().map(|answer| {
            let decision = novice_decision(answer, self.geometry);
            Decision { spread: decision.spread.filter(|_| self.network.has_spread()), ..decision }
        }));
    }
}
