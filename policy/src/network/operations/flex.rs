//! The operations on burn's CPU backend: tensors to slices and back.

use super::adam::{AdamMoments, AdamStep};
use super::cpu::encoder::EncoderWeights;
use super::cpu::{adam, dense};
use super::ops::{NetworkOps, OptimizerOps};
use crate::network::architecture::ConvLayer;
use burn::backend::flex::FlexTensor;
use burn::backend::{Flex, TensorMetadata as _};
use burn::tensor::TensorData;
use sim::maths;

impl NetworkOps for Flex {
    fn encode(
        occupied: FlexTensor,
        weight_1: FlexTensor,
        bias_1: FlexTensor,
        weight_2: FlexTensor,
        bias_2: FlexTensor,
    ) -> FlexTensor {
        let occupied = contiguous(occupied);
        let batch = occupied.shape()[0];
        let parameters = EncoderParameters::new([weight_1, bias_1, weight_2, bias_2]);
        let features = parameters.weights().forward(occupied.bytes());
        from_vec(features, [batch, parameters.weights().features_len()])
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

/// The parameters of the encoder, contiguous.
#[derive(Debug, Clone)]
pub(super) struct EncoderParameters {
    conv1: ConvLayer,
    conv2: ConvLayer,
    weight_1: FlexTensor,
    bias_1: FlexTensor,
    weight_2: FlexTensor,
    bias_2: FlexTensor,
}

impl EncoderParameters {
    /// Weight and bias of the first convolution, then of the second.
    pub(super) fn new(parameters: [FlexTensor; 4]) -> Self {
        let [weight_1, bias_1, weight_2, bias_2] = parameters.map(contiguous);
        let layer = |weight: &FlexTensor| ConvLayer { channels: weight.shape()[0], kernel: weight.shape()[2] };
        Self { conv1: layer(&weight_1), conv2: layer(&weight_2), weight_1, bias_1, weight_2, bias_2 }
    }

    pub(super) fn weights(&self) -> EncoderWeights<'_> {
        EncoderWeights {
            conv1: self.conv1,
            conv2: self.conv2,
            weight_1: values(&self.weight_1),
            bias_1: values(&self.bias_1),
            weight_2: values(&self.weight_2),
            bias_2: values(&self.bias_2),
        }
    }

    /// Gradients as tensors: weight and bias of the first convolution, then of the second.
    pub(super) fn tensors(&self, [weight_1, bias_1, weight_2, bias_2]: [Vec<f32>; 4]) -> [FlexTensor; 4] {
        [
            from_vec(weight_1, self.weight_1.shape()),
            from_vec(bias_1, self.bias_1.shape()),
            from_vec(weight_2, self.weight_2.shape()),
            from_vec(bias_2, self.bias_2.shape()),
        ]
    }
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
