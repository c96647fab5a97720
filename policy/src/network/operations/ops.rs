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
    /// See [`encode`](super::encode).
    #[fusion(default)]
    fn encode(
        occupied: BoolTensor<Self>,
        weight_1: FloatTensor<Self>,
        bias_1: FloatTensor<Self>,
        weight_2: FloatTensor<Self>,
        bias_2: FloatTensor<Self>,
    ) -> FloatTensor<Self> {
        plain::encode::<Self>(occupied, weight_1, bias_1, weight_2, bias_2)
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
