//! What the operations mean, in plain operations of burn: computed on GPUs, compared with in tests.

use super::adam::{AdamMoments, AdamStep};
use crate::network::architecture::ConvLayer;
use burn::backend::tensor::{BoolTensor, FloatTensor};
use burn::backend::{Backend, FloatDType, Scalar, TensorMetadata as _};
use burn::tensor::Shape;
use burn::tensor::ops::ConvOptions;

pub(crate) fn first_layer<B: Backend>(
    occupied: BoolTensor<B>,
    weight: FloatTensor<B>,
    bias: FloatTensor<B>,
) -> FloatTensor<B> {
    let [batch, rows, cols] = occupied.shape().dims();
    let cells = B::float_reshape(B::bool_into_float(occupied, FloatDType::F32), Shape::new([batch, 1, rows, cols]));
    flat::<B>(pooled::<B>(convolved::<B>(cells, weight, bias)))
}

pub(crate) fn residual_layer<B: Backend>(
    x: FloatTensor<B>,
    weight: FloatTensor<B>,
    bias: FloatTensor<B>,
) -> FloatTensor<B> {
    let [channels] = bias.shape().dims();
    let map = map::<B>(x, channels);
    flat::<B>(B::relu(B::float_add(map.clone(), convolved::<B>(map, weight, bias))))
}

pub(crate) fn second_layer<B: Backend>(
    x: FloatTensor<B>,
    weight: FloatTensor<B>,
    bias: FloatTensor<B>,
) -> FloatTensor<B> {
    let [_, inputs, ..] = weight.shape().dims::<4>();
    flat::<B>(pooled::<B>(convolved::<B>(map::<B>(x, inputs), weight, bias)))
}

/// `[batch, cells · channels]`, channels last, to `[batch, channel, row, column]`.
fn map<B: Backend>(x: FloatTensor<B>, channels: usize) -> FloatTensor<B> {
    let [batch, values] = x.shape().dims();
    let side = (values / channels).isqrt();
    B::float_permute(B::float_reshape(x, Shape::new([batch, side, side, channels])), &[0, 3, 1, 2])
}

/// The inverse of [`map`].
fn flat<B: Backend>(map: FloatTensor<B>) -> FloatTensor<B> {
    let [batch, channels, rows, cols] = map.shape().dims();
    let channels_last = B::float_permute(map, &[0, 2, 3, 1]);
    B::float_reshape(channels_last, Shape::new([batch, rows * cols * channels]))
}

/// Convolution with "same" padding.
fn convolved<B: Backend>(x: FloatTensor<B>, weight: FloatTensor<B>, bias: FloatTensor<B>) -> FloatTensor<B> {
    let [channels, _, kernel, _] = weight.shape().dims();
    let mut options = ConvOptions::new([1, 1], [0, 0], [1, 1], 1);
    options.padding = [ConvLayer { channels, kernel }.padding(); 2];
    B::conv2d(x, weight, Some(bias), options)
}

/// Max-pool of 2, `ReLU`.
fn pooled<B: Backend>(x: FloatTensor<B>) -> FloatTensor<B> {
    B::relu(B::max_pool2d(x, [2, 2], [2, 2], [0, 0], [1, 1], false))
}

pub(crate) fn dense<B: Backend>(x: FloatTensor<B>, weight: FloatTensor<B>, bias: FloatTensor<B>) -> FloatTensor<B> {
    let [outputs] = bias.shape().dims();
    B::float_add(B::float_matmul(x, weight), B::float_reshape(bias, Shape::new([1, outputs])))
}

pub(crate) fn adam_step<B: Backend>(
    step: AdamStep,
    gradient: FloatTensor<B>,
    moments: AdamMoments<B>,
) -> AdamMoments<B> {
    let times = |tensor, factor: f32| B::float_mul_scalar(tensor, Scalar::from(factor));
    let AdamMoments { weights, mean, mean_square } = moments;
    let gradient = clipped::<B>(gradient, step.gradient_norm_max);
    let mean = B::float_add(times(mean, step.beta_1), times(gradient.clone(), 1.0 - step.beta_1));
    let square = B::float_mul(times(gradient.clone(), 1.0 - step.beta_2), gradient);
    let mean_square = B::float_add(times(mean_square, step.beta_2), square);
    let root = times(B::float_sqrt(mean_square.clone()), step.root_correction());
    let root = B::float_add_scalar(root, Scalar::from(step.epsilon));
    let change = B::float_div(times(mean.clone(), step.step_size()), root);
    AdamMoments { weights: B::float_sub(times(weights, step.keep()), change), mean, mean_square }
}

/// The gradient, scaled down to a norm of `norm_max` if it is above; 0 = as it is.
fn clipped<B: Backend>(gradient: FloatTensor<B>, norm_max: f32) -> FloatTensor<B> {
    if norm_max == 0.0 {
        return gradient;
    }
    let norm = B::float_sqrt(B::float_sum(B::float_mul(gradient.clone(), gradient.clone()))); // [1]
    let norm = B::float_clamp_min(norm, Scalar::from(f32::MIN_POSITIVE));
    let scale = B::float_mul_scalar(B::float_recip(norm), Scalar::from(norm_max));
    let scale = B::float_clamp_max(scale, Scalar::from(1.0_f32));
    let ones = Shape::from(vec![1; gradient.shape().num_dims()]);
    B::float_mul(gradient, B::float_reshape(scale, ones))
}
