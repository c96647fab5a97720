//! The network as burn computes it: its definition.

use crate::network::architecture::{ConvLayer, NetworkArchitecture, OUTPUTS};
use crate::network::dropout::DropoutFactors;
use crate::network::weights::Weights;
use burn::module::{Module, Param};
use burn::nn::conv::{Conv2d, Conv2dConfig};
use burn::nn::{Linear, LinearConfig, PaddingConfig2d};
use burn::tensor::activation::relu;
use burn::tensor::module::max_pool2d;
use burn::tensor::ops::MaxPoolOptions;
use burn::tensor::{Device, Gradients, Tensor, TensorData};
use sim::sensing::{GRID_CELLS, OccupancyGrid};

/// The network as burn sees it.
#[derive(Module, Debug)]
pub struct LookAheadNet {
    conv1: Conv2d,
    conv2: Conv2d,
    fc1: Linear,
    fc2: Linear,
}

impl LookAheadNet {
    /// Puts weights on a device; an autodiff device makes them trainable.
    pub fn from_weights(weights: &Weights, device: &Device) -> Self {
        let architecture = weights.architecture();
        let parts = weights.parts();
        let conv = |inputs: usize, conv: ConvLayer, weight: &[f32], bias: &[f32]| {
            let (before, after) = conv.padding();
            let mut layer = Conv2dConfig::new([inputs, conv.channels], [conv.kernel, conv.kernel])
                .with_padding(PaddingConfig2d::Explicit(before, before, after, after))
                .init(device);
            layer.weight = param(weight, [conv.channels, inputs, conv.kernel, conv.kernel], device);
            layer.bias = Some(param(bias, [conv.channels], device));
            layer
        };
        let linear = |inputs: usize, outputs: usize, weight: &[f32], bias: &[f32]| {
            let mut layer = LinearConfig::new(inputs, outputs).init(device);
            layer.weight = param(weight, [inputs, outputs], device);
            layer.bias = Some(param(bias, [outputs], device));
            layer
        };
        Self {
            conv1: conv(1, architecture.conv1, parts.conv1_weight, parts.conv1_bias),
            conv2: conv(architecture.conv1.channels, architecture.conv2, parts.conv2_weight, parts.conv2_bias),
            fc1: linear(architecture.features(), architecture.hidden, parts.fc1_weight, parts.fc1_bias),
            fc2: linear(architecture.hidden, OUTPUTS, parts.fc2_weight, parts.fc2_bias),
        }
    }

    /// Grids `[batch, 1, 25, 25]` to raw outputs `[batch, 4]`: means of u and w, then both raw log-variances, before
    /// [`soft_clamp_log_variance`](crate::network::soft_clamp_log_variance).
    pub fn forward(&self, grids: Tensor<4>, dropout: Option<DropoutFactors>) -> Tensor<2> {
        let half = || MaxPoolOptions::new([2, 2]).with_stride([2, 2]);
        let x = relu(max_pool2d(self.conv1.forward(grids), half())); // [batch, conv1, 12, 12]
        let x = relu(max_pool2d(self.conv2.forward(x), half())); // [batch, conv2, 6, 6]
        let [batch, channels, rows, cols] = x.dims();
        // Channels last: the order of the inputs of `fc1` (see `Weights`).
        let features = x.permute([0, 2, 3, 1]).reshape([batch, rows * cols * channels]);
        let (on_features, on_hidden) = dropout.map(|factors| (factors.features, factors.hidden)).unzip();
        let features = times(features, on_features);
        let hidden = times(relu(self.fc1.forward(features)), on_hidden); // [batch, hidden]
        self.fc2.forward(hidden)
    }

    /// The gradients of all parameters, on the host.
    pub(crate) fn gradient(&self, architecture: NetworkArchitecture, gradients: &Gradients) -> Weights {
        let mut weights = Weights::zeros(architecture);
        let parts = weights.parts_mut();
        for (layer, weight, bias) in
            [(&self.conv1, parts.conv1_weight, parts.conv1_bias), (&self.conv2, parts.conv2_weight, parts.conv2_bias)]
        {
            read_gradient(&layer.weight, gradients, weight);
            read_gradient(layer.bias.as_ref().expect("every layer has a bias"), gradients, bias);
        }
        for (layer, weight, bias) in
            [(&self.fc1, parts.fc1_weight, parts.fc1_bias), (&self.fc2, parts.fc2_weight, parts.fc2_bias)]
        {
            read_gradient(&layer.weight, gradients, weight);
            read_gradient(layer.bias.as_ref().expect("every layer has a bias"), gradients, bias);
        }
        weights
    }
}

fn read_gradient<const D: usize>(parameter: &Param<Tensor<D>>, gradients: &Gradients, into: &mut [f32]) {
    let gradient = parameter.val().grad(gradients).expect("every parameter takes part in the loss");
    let values: Vec<f32> = gradient.into_data().try_into_vec().expect("gradients are f32");
    into.copy_from_slice(&values);
}

/// Grids as a tensor `[batch, 1, 25, 25]`, 1 = non-drivable; rows beyond `grids` are free.
pub(crate) fn grid_tensor(grids: &[&OccupancyGrid], batch: usize, device: &Device) -> Tensor<4> {
    assert!(grids.len() <= batch, "{} grids do not fit a batch of {batch}", grids.len());
    let mut cells: Vec<f32> = grids.iter().flat_map(|grid| grid.cells().map(f32::from)).collect();
    cells.resize(batch * GRID_CELLS * GRID_CELLS, 0.0);
    Tensor::from_data(TensorData::new(cells, [batch, 1, GRID_CELLS, GRID_CELLS]), device)
}

fn param<const D: usize>(values: &[f32], shape: [usize; D], device: &Device) -> Param<Tensor<D>> {
    Param::from_tensor(Tensor::from_data(TensorData::new(values.to_vec(), shape), device))
}

fn times(layer: Tensor<2>, factors: Option<Tensor<2>>) -> Tensor<2> {
    match factors {
        Some(factors) => layer * factors,
        None => layer,
    }
}
