//! Vanilla `DAgger`: a mixture of expert and network (Ross, Gordon and Bagnell 2011, "A Reduction of Imitation Learning
//! and Structured Prediction to No-Regret Online Learning", algorithm 3.1).

use crate::decision_rule::gate::{Gate, GateTick};
use rand::RngExt as _;
use serde::{Deserialize, Serialize};
use sim::maths;
use sim::seed::Rng;

/// Settings of vanilla `DAgger`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct VanillaSettings {
    /// p: in round i the expert drives a tick with probability `β_i` = pⁱ; behaviour cloning is round 0. 0: never.
    pub beta: f32,
}

impl Default for VanillaSettings {
    fn default() -> Self {
        Self { beta: 0.5 }
    }
}

impl VanillaSettings {
    pub(crate) fn gate(self, round: u32, rng: Rng) -> VanillaGate {
        VanillaGate { beta: maths::pow(self.beta, round as f32), rng }
    }
}

pub(crate) struct VanillaGate {
    beta: f32,
    rng: Rng,
}

impl Gate for VanillaGate {
    fn trusts_novice(&mut self, _: &GateTick<'_>) -> bool {
        self.rng.random::<f32>() >= self.beta
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::decision_rule::test_ticks::with_tick;
    use sim::seed::{RootSeed, Stream};

    #[test]
    fn the_expert_drives_a_share_that_halves_from_round_to_round() {
        for (round, share) in [(0, 1.0), (1, 0.5), (3, 0.125)] {
            let mut gate = VanillaSettings::default().gate(round, RootSeed(1).rng(Stream::DecisionRule, 0));
            let experts =
                with_tick(0.0, 0.0, |tick| (0..10_000).filter(|_| !gate.trusts_novice(tick)).count()) as f64 / 1e4;
            assert!((experts - share).abs() < 0.02, "round {round}: {experts}");
        }
    }
}
