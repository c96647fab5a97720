//! The operations as burn's backend extension sees them, plain where no backend does better.

use super::adam::{AdamMoments, AdamStep};
use super::plain;
use burn::backend::tensor::{BoolTensor, FloatTensor};
use burn::backend::{Backend, backend_extension};

/// The differentiable operations.
#[backend_extension(
    Flex,
    Cube: cfg(any(feature = "cuda", feature = "vulkan", feature = "wgpu")),
    Fusion: cfg(any(feature = "cuda", feature = "vulkan", feature = "wgpu")),
    Autodiff
)]
pub trait NetworkOps: Backend {
    /// See [`first_layer`](super::first_layer).
    #[fusion(default)]
    fn first_layer(
        occupied: BoolTensor<Self>,
        weight: FloatTensor<Self>,
        bias: FloatTensor<Self>,
    ) -> FloatTensor<Self> {
        plain::first_layer::<Self>(occupied, weight, bias)
    }

    /// See [`residual_layer`](super::residual_layer).
    #[fusion(default)]
    fn residual_layer(x: FloatTensor<Self>, weight: FloatTensor<Self>, bias: FloatTensor<Self>) -> FloatTensor<Self> {
        plain::residual_layer::<Self>(x, weight, bias)
    }

    /// See [`second_layer`](super::second_layer).
    #[fusion(default)]
    fn second_layer(x: FloatTensor<Self>, weight: FloatTensor<Self>, bias: FloatTensor<Self>) -> FloatTensor<Self> {
        plain::second_layer::<Self>(x, weight, bias)
    }

    /// See [`dense`](super::dense).
    #[fusion(default)]
    fn dense(x: FloatTensor<Self>, weight: FloatTensor<Self>, bias: FloatTensor<Self>) -> FloatTensor<Self> {
        plain::dense::<Self>(x, weight, bias)
    }

    /// See [`tanh`](super::tanh).
    #[fusion(default)]
    fn tanh(x: FloatTensor<Self>) -> FloatTensor<Self> {
        Self::float_tanh(x)
    }

    /// See [`exp`](super::exp).
    #[fusion(default)]
    fn exp(x: FloatTensor<Self>) -> FloatTensor<Self> {
        Self::float_exp(x)
    }
}

/// The operation of the optimiser.
#[backend_extension(
    Flex,
    Cube: cfg(any(feature = "cuda", feature = "vulkan", feature = "wgpu")),
    Fusion: cfg(any(feature = "cuda", feature = "vulkan", feature = "wgpu"))
)]
pub trait OptimizerOps: Backend {
    /// See [`adam_step`](super::adam_step).
    #[fusion(default)]
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
