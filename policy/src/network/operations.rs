//! Custom operations of burn: what its CPU backend does slowly, or not to the same bits on every machine.
//!
//! | operation | on CPUs (`cpu`) | why not burn-flex's |
//! |---|---|---|
//! | [`encode`]: both convolutions with pools and `ReLU`s | table look-up, sparse backward pass | a fraction of the speed |
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
