//! What one step of Adam is given.

use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, ExtensionType};
use sim::maths;

/// What a step of Adam reads and renews.
#[derive(ExtensionType)]
pub struct AdamMoments<B: Backend> {
    /// The weights.
    pub weights: FloatTensor<B>,
    /// Running mean of the gradient.
    pub mean: FloatTensor<B>,
    /// Running mean of its square.
    pub mean_square: FloatTensor<B>,
}

/// The numbers of one step of Adam (Kingma and Ba 2015, with the bias corrections taken out of the loop).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AdamStep {
    /// Learning rate.
    pub learning_rate: f32,
    /// Decay of the mean of the gradient.
    pub beta_1: f32,
    /// Decay of the mean of its square.
    pub beta_2: f32,
    /// Added to the root of the mean square.
    pub epsilon: f32,
    /// Share of the weights taken off per step and unit of learning rate (decoupled).
    pub weight_decay: f32,
    /// Norm above which the gradient is scaled down to it; 0 = never.
    pub gradient_norm_max: f32,
    /// Number of this step, from 1.
    pub number: u32,
}

impl AdamStep {
    /// Factor that clips a gradient of this norm.
    pub(crate) fn gradient_scale(self, norm: f32) -> f32 {
        if self.gradient_norm_max == 0.0 {
            1.0
        } else {
            (self.gradient_norm_max / norm.max(f32::MIN_POSITIVE)).min(1.0)
        }
    }

    /// Factor of the mean: learning rate and bias correction.
    pub(crate) fn step_size(self) -> f32 {
        self.learning_rate / (1.0 - maths::pow(self.beta_1, self.number as f32))
    }

    /// Bias correction of the root of the mean square.
    pub(crate) fn root_correction(self) -> f32 {
        (1.0 - maths::pow(self.beta_2, self.number as f32)).sqrt().recip()
    }

    /// What weight decay leaves of a weight.
    pub(crate) fn keep(self) -> f32 {
        1.0 - self.learning_rate * self.weight_decay
    }
}
