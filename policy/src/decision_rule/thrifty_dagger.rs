//! `ThriftyDAgger`: the expert takes over where a state is novel or risky, rarer than a given share of the ticks (Hoque et
//! al. 2021, "`ThriftyDAgger`: Budget-Aware Novelty and Risk Gating for Interactive Imitation Learning").
//!
//! Novelty is the disagreement of an ensemble. Risk is what a critic predicts: γ to the power of the ticks until the next
//! near-collision, 0 if none follows; where the authors' Q function is the discounted chance of success. Both thresholds
//! are quantiles over the data so far; the authors' code takes them from held-back data, then from what the robot drove in the
//! present iteration (docs/methods.md 5).

use crate::decision_rule::gate::{Gate, GateTick, Wheel};
use serde::{Deserialize, Serialize};

/// Settings of `ThriftyDAgger`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ThriftyDaggerSettings {
    /// Share of the ticks so far that would count as novel, and as risky: the budget.
    pub rate: f32,
    /// γ: discount of a near-collision per tick.
    pub discount: f32,
    /// Networks of the ensemble, 2 or more.
    pub members: u8,
}

impl Default for ThriftyDaggerSettings {
    /// All chosen: the authors ask for 1 % with one robot and one person; 0.98 per tick is e⁻¹ after 2.5 s.
    fn default() -> Self {
        Self { rate: 0.05, discount: 0.98, members: 3 }
    }
}

/// Least predicted risk that is one: while there were no near-collisions, quantiles of it are quantiles of nothing (chosen).
const RISK_MIN: f32 = 0.1;

/// Thresholds, from the data that the network was trained on.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Thresholds {
    /// More disagreement is novel.
    pub(crate) novelty: f32,
    /// More predicted risk is risky.
    pub(crate) risk: f32,
    /// The expert hands back below this risk …
    pub(crate) risk_release: f32,
    /// … and below this discrepancy.
    pub(crate) discrepancy_release: f32,
}

impl Thresholds {
    /// The thresholds, from the disagreement, the risk and the discrepancy of every sample.
    pub(crate) fn new(rate: f32, mut disagreement: Vec<f32>, mut risk: Vec<f32>, discrepancy: &[f32]) -> Self {
        let count = discrepancy.len().max(1) as f32;
        let risky = quantile(&mut risk, 1.0 - rate).max(RISK_MIN);
        Self {
            novelty: quantile(&mut disagreement, 1.0 - rate),
            risk: risky,
            risk_release: quantile(&mut risk, 0.5).max(0.5 * risky),
            discrepancy_release: discrepancy.iter().sum::<f32>() / count,
        }
    }
}

/// The value that a share of the values is at or below; 0 of none.
fn quantile(values: &mut [f32], share: f32) -> f32 {
    values.sort_by(f32::total_cmp);
    let last = values.len().saturating_sub(1);
    values.get((share * last as f32).round() as usize).copied().unwrap_or(0.0)
}

pub(crate) struct ThriftyDaggerGate {
    thresholds: Thresholds,
    wheel: Wheel,
}

impl ThriftyDaggerGate {
    pub(crate) fn new(thresholds: Thresholds) -> Self {
        Self { thresholds, wheel: Wheel::default() }
    }
}

impl Gate for ThriftyDaggerGate {
    fn trusts_novice(&mut self, tick: &GateTick<'_>) -> bool {
        let (found, limits) = (&tick.evidence, &self.thresholds);
        let takes = found.disagreement > limits.novelty || found.alarm > limits.risk;
        let returns = found.discrepancy < limits.discrepancy_release && found.alarm < limits.risk_release;
        self.wheel.turn(takes, returns)
    }

    fn reset(&mut self) {
        self.wheel = Wheel::default();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::decision_rule::evidence::Evidence;
    use crate::decision_rule::test_ticks::with_tick;

    #[test]
    fn thresholds_are_quantiles_and_means_of_the_data() {
        let ramp: Vec<f32> = (0..=100).map(|i| i as f32 / 100.0).collect();
        let found = Thresholds::new(0.05, ramp.clone(), ramp.clone(), &ramp);
        let expected = Thresholds { novelty: 0.95, risk: 0.95, risk_release: 0.5, discrepancy_release: 0.5 };
        assert!((found.discrepancy_release - 0.5).abs() < 1e-5);
        assert_eq!(Thresholds { discrepancy_release: 0.5, ..found }, expected);
        let without = Thresholds::new(0.05, ramp, vec![0.0; 101], &[0.02]);
        assert_eq!((without.risk, without.risk_release), (RISK_MIN, 0.5 * RISK_MIN), "no near-collision so far");
    }

    #[test]
    fn the_expert_drives_from_the_alarm_until_the_network_is_near_and_calm() {
        let limits = Thresholds { novelty: 0.1, risk: 0.4, risk_release: 0.2, discrepancy_release: 0.05 };
        let mut gate = ThriftyDaggerGate::new(limits);
        for (discrepancy, alarm, is_novices) in
            [(0.3, 0.3, true), (0.02, 0.5, false), (0.02, 0.3, false), (0.06, 0.1, false), (0.02, 0.1, true)]
        {
            assert_eq!(with_tick(discrepancy, alarm, |tick| gate.trusts_novice(tick)), is_novices, "{alarm}");
        }
    }

    /// Neither risky nor near the expert's answer: the disagreement alone takes the wheel, and nothing but a reset gives it back.
    #[test]
    fn what_the_members_disagree_about_is_novel_and_a_reset_hands_back() {
        let limits = Thresholds { novelty: 0.1, risk: 0.4, risk_release: 0.2, discrepancy_release: 0.05 };
        let mut gate = ThriftyDaggerGate::new(limits);
        let trusts = |gate: &mut ThriftyDaggerGate, disagreement: f32| {
            with_tick(0.3, 0.3, |tick| {
                let evidence = Evidence { disagreement, ..tick.evidence };
                gate.trusts_novice(&GateTick { evidence, novice: tick.novice, situation: tick.situation })
            })
        };
        assert!(trusts(&mut gate, 0.1), "no more than the threshold");
        assert!(!trusts(&mut gate, 0.11));
        assert!(!trusts(&mut gate, 0.0), "far from the expert's answer");
        gate.reset();
        assert!(trusts(&mut gate, 0.0));
    }
}
