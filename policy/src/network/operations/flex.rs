//! The operations on burn's CPU backend: tensors to slices and back.

use super::adam::{AdamMoments, AdamStep};
use super::cpu::first_layer::FirstLayer;
use super::cpu::residual_layer::ResidualLayer;
use super::cpu::second_layer::SecondLayer;
use super::cpu::{adam, dense};
use super::ops::{NetworkOps, OptimizerOps};
use crate::network::architecture::ConvLayer;
use burn::backend::flex::FlexTensor;
use burn::backend::{Flex, TensorMetadata as _};
use burn::tensor::TensorData;
use sim::maths;

impl NetworkOps for Flex {
    fn first_layer(occupied: FlexTensor, weight: FlexTensor, bias: FlexTensor) -> FlexTensor {
        let [occupied, weight, bias] = [occupied, weight, bias].map(contiguous);
        batch_of(first(&weight, &bias).forward(occupied.bytes(), false).y, &occupied)
    }

    fn residual_layer(x: FlexTensor, weight: FlexTensor, bias: FlexTensor) -> FlexTensor {
        let [x, weight, bias] = [x, weight, bias].map(contiguous);
        batch_of(residual(&x, &weight, &bias).forward(values(&x), false).y, &x)
    }

    fn second_layer(x: FlexTensor, weight: FlexTensor, bias: FlexTensor) -> FlexTensor {
        let [x, weight, bias] = [x, weight, bias].map(contiguous);
        batch_of(second(&weight, &bias).forward(values(&x), false).y, &x)
    }

    fn dense(x: FlexTensor, weight: FlexTensor, bias: FlexTensor) -> FlexTensor {
        let [x, weight, bias] = [x, weight, bias].map(contiguous);
        let y = dense::forward(values(&x), values(&weight), values(&bias));
        from_vec(y, [x.shape()[0], bias.shape()[0]])
    }

    fn tanh(x: FlexTensor) -> FlexTensor {
        of_each(x, maths::tanh)
    }

    fn exp(x: FlexTensor) -> FlexTensor {
        of_each(x, maths::exp)
    }
}

impl OptimizerOps for Flex {
    fn adam_step(step: AdamStep, gradient: FlexTensor, moments: AdamMoments<Self>) -> AdamMoments<Self> {
        let AdamMoments { weights, mean, mean_square } = moments;
        let [mut weights, mut mean, mut mean_square] = [weights, mean, mean_square].map(contiguous);
        let gradient = contiguous(gradient);
        adam::step(step, weights.storage_mut(), values(&gradient), mean.storage_mut(), mean_square.storage_mut());
        AdamMoments { weights, mean, mean_square }
    }
}

/// The first layer, of contiguous weights.
pub(super) fn first<'a>(weight: &'a FlexTensor, bias: &'a FlexTensor) -> FirstLayer<'a> {
    FirstLayer::new(layer(weight), values(weight), values(bias))
}

/// A residual layer for maps like `x`, of contiguous weights.
pub(super) fn residual<'a>(x: &FlexTensor, weight: &'a FlexTensor, bias: &'a FlexTensor) -> ResidualLayer<'a> {
    let cells = ResidualLayer::cells(x.shape()[1], bias.shape()[0]);
    ResidualLayer::new(cells, values(weight), values(bias))
}

/// The second layer, of contiguous weights.
pub(super) fn second<'a>(weight: &'a FlexTensor, bias: &'a FlexTensor) -> SecondLayer<'a> {
    SecondLayer::new(layer(weight), values(weight), values(bias))
}

fn layer(weight: &FlexTensor) -> ConvLayer {
    ConvLayer { channels: weight.shape()[0], kernel: weight.shape()[2] }
}

/// `[batch, values]`, as many rows as `x` has: at least one.
pub(super) fn batch_of(y: Vec<f32>, x: &FlexTensor) -> FlexTensor {
    let batch = x.shape()[0];
    let len = y.len() / batch;
    from_vec(y, [batch, len])
}

/// The tensor with its values in order, and no others, in memory.
pub(super) fn contiguous(tensor: FlexTensor) -> FlexTensor {
    let is_whole = tensor.is_contiguous()
        && tensor.layout().start_offset() == 0
        && tensor.bytes().len() == tensor.layout().num_elements() * tensor.dtype().size();
    if is_whole { tensor } else { tensor.to_contiguous() }
}

/// A function of every value.
fn of_each(tensor: FlexTensor, function: impl Fn(f32) -> f32) -> FlexTensor {
    let tensor = contiguous(tensor);
    let values = values(&tensor).iter().copied().map(function).collect();
    from_vec(values, tensor.shape())
}

/// The values of a contiguous tensor.
pub(super) fn values(tensor: &FlexTensor) -> &[f32] {
    tensor.storage()
}

pub(super) fn from_vec(values: Vec<f32>, shape: impl Into<burn::tensor::Shape>) -> FlexTensor {
    FlexTensor::from_data(TensorData::new(values, shape.into()))
}
