//! `SafeDAgger`: a critic that sees what the network sees predicts whether the network is off, so that the expert need
//! not be asked at every tick (Zhang and Cho 2017, "Query-Efficient Imitation Learning for End-to-End Simulated Driving").

use crate::decision_rule::evidence::Evidence;
use serde::{Deserialize, Serialize};

/// Settings of `SafeDAgger`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SafeDaggerSettings {
    /// τ: the critic learns whether τ̂ is above, image fractions.
    pub tau: f32,
}

impl Default for SafeDaggerSettings {
    /// The paper's τ, so that rules compare.
    fn default() -> Self {
        Self { tau: 0.07 }
    }
}

/// The critic's answer from which on a state counts as unsafe: as likely as not.
pub(crate) const UNSAFE: f32 = 0.5;

/// The critic learned what the settings say.
pub(crate) fn trusts_novice(evidence: &Evidence) -> bool {
    evidence.alarm < UNSAFE
}
