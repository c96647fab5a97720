//! What a decision rests on.

use crate::network::Prediction;
use serde::{Deserialize, Serialize};
use sim::maths;

/// What the decision rests on.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Evidence {
    /// τ̂: distance between the network's clipped mean and the expert's answer, image fractions.
    pub discrepancy: f32,
    /// χ̂: standard deviation of the network's answer, (u, w), image fractions.
    pub doubt: [f32; 2],
    /// Spread of the answers of an ensemble's members about their mean, image fractions; 0 of a single network.
    pub disagreement: f32,
    /// What a critic predicts, 0…1: that the network is far off, or that a near-collision is near. 0 without a critic.
    pub alarm: f32,
}

impl Evidence {
    /// Algorithm 2, lines 7 and 8, of a single network. Both answers are clipped to the image, as they would be driven.
    pub fn new(predicted: &Prediction, expert: [f32; 2]) -> Self {
        let novice = predicted.clipped_mean();
        let expert = expert.map(|fraction| fraction.clamp(0.0, 1.0));
        let discrepancy = maths::hypot(novice[0] - expert[0], novice[1] - expert[1]);
        Self { discrepancy, doubt: predicted.sigma, disagreement: 0.0, alarm: 0.0 }
    }
}
