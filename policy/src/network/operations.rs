//! Custom operations of burn: what its CPU backend does slowly, or not to the same bits on every machine.
//!
//! | operation | on CPUs (`cpu`) | why not burn-flex's |
//! |---|---|---|
//! | [`first_layer`], [`residual_layer`], [`second_layer`]: convolutions with pools and `ReLU`s | table look-up, windows read where they lie, a sparse backward pass behind pools | a fraction of the speed |
//! | [`dense`]: x · weight + bias | one chain of multiply-adds per output | its sums depend on the machine's caches |
//! | [`tanh`], [`exp`] | one value after the other | they are the platform's, which rounds as it likes |
//! | [`adam_step`]: Adam and the clipping of its gradient | two passes over the values | a dozen, and denormal numbers |
//!
//! They are registered through burn's backend extension (the burn book, chapter "Backend Extension"). On every other
//! backend they are what they mean, in plain operations of burn (`plain`), which is also what tests compare with.
//! Gradients on CPUs are written by hand (`autodiff`).

pub(crate) mod adam;
mod autodiff;
pub(crate) mod cpu;
mod flex;
mod ops;
pub(crate) mod plain;

pub use adam::{AdamMoments, AdamStep};
use burn::backend::Dispatch;
use burn::tensor::{Bool, Tensor};
pub use ops::{NetworkOps, OptimizerOps};

/// Occupied cells `[batch, 25, 25]` to `[batch, 12 · 12 · channels]`, row by row, channels last: a convolution with "same"
/// padding, a max-pool of 2 and a `ReLU`.
///
/// `weight` `[channels, 1, kernel, kernel]`, `bias` `[channels]`; channels are a multiple of [`LANES`](crate::network::LANES),
/// the kernel is 7 at most.
pub fn first_layer(occupied: Tensor<3, Bool>, weight: Tensor<4>, bias: Tensor<1>) -> Tensor<2> {
    let (weight, bias) = (weight.into_dispatch(), bias.into_dispatch());
    Tensor::from_dispatch(<Dispatch as NetworkOps>::first_layer(occupied.into_dispatch(), weight, bias))
}

/// A pooled map `[batch, cells · channels]`, of 12 or 6 cells per side, to one of the same shape: what a 3×3 convolution with
/// "same" padding answers is added to it, then a `ReLU`.
///
/// `weight` `[channels, channels, 3, 3]`, `bias` `[channels]`.
pub fn residual_layer(x: Tensor<2>, weight: Tensor<4>, bias: Tensor<1>) -> Tensor<2> {
    let (x, weight, bias) = (x.into_dispatch(), weight.into_dispatch(), bias.into_dispatch());
    Tensor::from_dispatch(<Dispatch as NetworkOps>::residual_layer(x, weight, bias))
}

/// A map `[batch, 12 · 12 · inputs]` to features `[batch, 6 · 6 · channels]`: a convolution with "same" padding, a max-pool of 2
/// and a `ReLU`.
///
/// `weight` `[channels, inputs, kernel, kernel]`, `bias` `[channels]`.
pub fn second_layer(x: Tensor<2>, weight: Tensor<4>, bias: Tensor<1>) -> Tensor<2> {
    let (x, weight, bias) = (x.into_dispatch(), weight.into_dispatch(), bias.into_dispatch());
    Tensor::from_dispatch(<Dispatch as NetworkOps>::second_layer(x, weight, bias))
}

/// `x` `[batch, inputs]` · `weight` `[inputs, outputs]` + `bias` `[outputs]`: `[batch, outputs]`.
pub fn dense(x: Tensor<2>, weight: Tensor<2>, bias: Tensor<1>) -> Tensor<2> {
    let (x, weight, bias) = (x.into_dispatch(), weight.into_dispatch(), bias.into_dispatch());
    Tensor::from_dispatch(<Dispatch as NetworkOps>::dense(x, weight, bias))
}

/// Hyperbolic tangent of every value.
pub fn tanh(x: Tensor<2>) -> Tensor<2> {
    Tensor::from_dispatch(<Dispatch as NetworkOps>::tanh(x.into_dispatch()))
}

/// e to the power of every value.
pub fn exp(x: Tensor<2>) -> Tensor<2> {
    Tensor::from_dispatch(<Dispatch as NetworkOps>::exp(x.into_dispatch()))
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

#[cfg(test)]
mod tests;
