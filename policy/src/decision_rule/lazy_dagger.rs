//! `LazyDAgger`: `SafeDAgger` with two thresholds, so that the wheel changes hands less often (Hoque et al. 2021,
//! "`LazyDAgger`: Reducing Context Switching in Interactive Imitation Learning"). The scripted expert is the human.

use crate::decision_rule::gate::{Gate, GateTick, Wheel};
use crate::decision_rule::safe_dagger::UNSAFE;
use serde::{Deserialize, Serialize};

/// Settings of `LazyDAgger`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LazyDaggerSettings {
    /// τ: the expert takes over where a critic predicts a τ̂ above, image fractions …
    pub tau: f32,
    /// … and hands back once τ̂ itself is below this share of τ.
    pub release_share: f32,
}

impl Default for LazyDaggerSettings {
    /// The paper's τ, so that rules compare; the authors hand back at a quarter of the squared discrepancy.
    fn default() -> Self {
        Self { tau: 0.07, release_share: 0.5 }
    }
}

impl LazyDaggerSettings {
    pub(crate) fn gate(self) -> LazyDaggerGate {
        LazyDaggerGate { settings: self, wheel: Wheel::default() }
    }
}

pub(crate) struct LazyDaggerGate {
    settings: LazyDaggerSettings,
    wheel: Wheel,
}

impl Gate for LazyDaggerGate {
    fn trusts_novice(&mut self, tick: &GateTick<'_>) -> bool {
        let LazyDaggerSettings { tau, release_share } = self.settings;
        let is_near = tick.evidence.discrepancy < release_share * tau;
        self.wheel.turn(tick.evidence.alarm >= UNSAFE, is_near)
    }

    fn reset(&mut self) {
        self.wheel = Wheel::default();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::decision_rule::test_ticks::with_tick;

    #[test]
    fn the_expert_keeps_the_wheel_until_the_network_is_near() {
        let mut gate = LazyDaggerSettings::default().gate();
        // τ̂, alarm, whether the network drives.
        for (discrepancy, alarm, is_novices) in
            [(0.2, 0.4, true), (0.05, 0.6, false), (0.05, 0.0, false), (0.03, 0.0, true), (0.05, 0.0, true)]
        {
            assert_eq!(with_tick(discrepancy, alarm, |tick| gate.trusts_novice(tick)), is_novices, "{discrepancy}");
        }
    }

    #[test]
    fn a_car_that_was_put_back_is_the_networks_again() {
        let mut gate = LazyDaggerSettings::default().gate();
        assert!(!with_tick(0.05, 0.6, |tick| gate.trusts_novice(tick)));
        assert!(!with_tick(0.05, 0.0, |tick| gate.trusts_novice(tick)), "not near enough to be handed back to");
        gate.reset();
        assert!(with_tick(0.05, 0.0, |tick| gate.trusts_novice(tick)));
    }
}
