//! Custom operations of burn: what its CPU backend does slowly, or not to the same bits on every machine.
//!
//! | operation | on CPUs ([`cpu`]) | why not burn-flex's |
//! |---|---|---|
//! | [`encode`]: both convolutions with pools and `ReLU`s | table look-up, sparse backward pass | an eighth of the speed |
//! | [`dense`]: x · weight + bias | one chain of multiply-adds per output | its sums depend on the machine's caches |
//! | [`adam_step`]: Adam and the clipping of its gradient | two passes over the values | a dozen, and denormal numbers |
//!
//! They are registered through burn's backend extension (the burn book, chapter "Backend Extension"). On every other
//! backend they are what they mean, in plain operations of burn ([`plain`]), which is also what tests compare with.
//! Gradients on CPUs are written by hand ([`autodiff`]).

mod autodiff;
pub(crate) mod cpu;
mod flex;
pub(crate) mod plain;

use burn::backend::tensor::{BoolTensor, FloatTensor};
use burn::backend::{Backend, Dispatch, ExtensionType, backend_extension};
use burn::tensor::{Bool, Tensor};

/// The differentiable operations.
#[backend_extension(Flex, Cube: cfg(any(feature = "cuda", feature = "vulkan", feature = "wgpu")), Autodiff)]
pub trait NetworkOps: Backend {
    /// See [`encode`].
    fn encode(
        occupied: BoolTensor<Self>,
        weight_1: FloatTensor<Self>,
        bias_1: FloatTensor<Self>,
        weight_2: FloatTensor<Self>,
        bias_2: FloatTensor<Self>,
    ) -> FloatTensor<Self> {
        plain::encode::<Self>(occupied, weight_1, bias_1, weight_2, bias_2)
    }

    /// See [`dense`].
    fn dense(x: FloatTensor<Self>, weight: FloatTensor<Self>, bias: FloatTensor<Self>) -> FloatTensor<Self> {
        plain::dense::<Self>(x, weight, bias)
    }
}

/// The operation of the optimiser.
#[backend_extension(Flex, Cube: cfg(any(feature = "cuda", feature = "vulkan", feature = "wgpu")))]
pub trait OptimizerOps: Backend {
    /// See [`adam_step`].
    fn adam_step(
        step: AdamStep,
        gradient: FloatTensor<Self>,
        #[extension_type] moments: AdamMoments<Self>,
    ) -> AdamMoments<Self> {
        plain::adam_step::<Self>(step, gradient, moments)
    }
}

#[cfg(any(feature = "cuda", feature = "vulkan", feature = "wgpu"))]
mod gpu {
    //! GPUs compute the plain operations, and burn differentiates them.
    use super::{NetworkOps, OptimizerOps};
    use burn::backend::autodiff::checkpoint::strategy::CheckpointStrategy;
    use burn::backend::{Autodiff, Cube};

    impl NetworkOps for Cube {}
    impl<C: CheckpointStrategy> NetworkOps for Autodiff<Cube, C> {}
    impl OptimizerOps for Cube {}
}

/// Occupied cells `[batch, 25, 25]` to features `[batch, 6 · 6 · conv2]`, row by row, channels last: twice a
/// convolution with "same" padding, a max-pool of 2 and a `ReLU`.
///
/// `weight_1` `[conv1, 1, kernel, kernel]`, `bias_1` `[conv1]`, `weight_2` `[conv2, conv1, kernel, kernel]`, `bias_2`
/// `[conv2]`; channels are multiples of [`LANES`](crate::network::LANES), the first kernel is 7 at most.
pub fn encode(
    occupied: Tensor<3, Bool>,
    weight_1: Tensor<4>,
    bias_1: Tensor<1>,
    weight_2: Tensor<4>,
    bias_2: Tensor<1>,
) -> Tensor<2> {
    Tensor::from_dispatch(<Dispatch as NetworkOps>::encode(
        occupied.into_dispatch(),
        weight_1.into_dispatch(),
        bias_1.into_dispatch(),
        weight_2.into_dispatch(),
        bias_2.into_dispatch(),
    ))
}

/// `x` `[batch, inputs]` · `weight` `[inputs, outputs]` + `bias` `[outputs]`: `[batch, outputs]`.
pub fn dense(x: Tensor<2>, weight: Tensor<2>, bias: Tensor<1>) -> Tensor<2> {
    let (x, weight, bias) = (x.into_dispatch(), weight.into_dispatch(), bias.into_dispatch());
    Tensor::from_dispatch(<Dispatch as NetworkOps>::dense(x, weight, bias))
}

/// One step of Adam for one parameter: weights, running mean of the gradient and of its square, each of one shape.
pub fn adam_step<const D: usize>(
    step: AdamStep,
    weights: Tensor<D>,
    gradient: Tensor<D>,
    mean: Tensor<D>,
    mean_square: Tensor<D>,
) -> [Tensor<D>; 3] {
    let moments = AdamMoments {
        weights: weights.into_dispatch(),
        mean: mean.into_dispatch(),
        mean_square: mean_square.into_dispatch(),
    };
    let AdamMoments { weights, mean, mean_square } =
        <Dispatch as OptimizerOps>::adam_step(step, gradient.into_dispatch(), moments);
    [weights, mean, mean_square].map(Tensor::from_dispatch)
}

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
        self.learning_rate / (1.0 - self.beta_1.powi(self.number as i32))
    }

    /// Bias correction of the root of the mean square.
    pub(crate) fn root_correction(self) -> f32 {
        (1.0 - self.beta_2.powi(self.number as i32)).sqrt().recip()
    }

    /// What weight decay leaves of a weight.
    pub(crate) fn keep(self) -> f32 {
        1.0 - self.learning_rate * self.weight_decay
    }
}

#[cfg(test)]
mod tests;
