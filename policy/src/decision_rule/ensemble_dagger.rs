//! `EnsembleDAgger`: the mean of an ensemble drives while it is near the expert's answer and its members agree (Menda,
//! Driggs-Campbell and Kochenderfer 2019, "EnsembleDAgger: A Bayesian Approach to Safe Imitation Learning").

use crate::decision_rule::evidence::Evidence;
use serde::{Deserialize, Serialize};

/// Settings of `EnsembleDAgger`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct EnsembleDaggerSettings {
    /// τ: threshold of the discrepancy, image fractions.
    pub tau: f32,
    /// χ: threshold of the members' disagreement, image fractions.
    pub chi: f32,
    /// Networks, each from initial weights and an order of samples of its own; 2 or more.
    pub members: u8,
}

impl Default for EnsembleDaggerSettings {
    /// The paper's τ, so that rules compare; χ half of it, and three members for their time (both chosen).
    fn default() -> Self {
        Self { tau: 0.07, chi: 0.035, members: 3 }
    }
}

impl EnsembleDaggerSettings {
    pub(crate) fn trusts_novice(self, evidence: &Evidence) -> bool {
        evidence.discrepancy < self.tau && evidence.disagreement < self.chi
    }
}
