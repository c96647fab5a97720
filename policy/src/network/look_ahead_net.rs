//! The network as a module of burn.

use crate::network::architecture::{ConvLayer, NetworkArchitecture, RESIDUAL_KERNEL};
use crate::network::dropout::DropoutFactors;
use crate::network::operations::{dense, first_layer, residual_layer, second_layer};
use crate::network::weights::Weights;
use burn::module::{Module, Param, ParamId};
use burn::nn::conv::{Conv2d, Conv2dConfig};
use burn::nn::{Linear, LinearConfig, PaddingConfig2d};
use burn::tensor::activation::relu;
use burn::tensor::{Bool, Device, Tensor, TensorData};
use sim::sensing::{GRID_CELLS, OccupancyGrid};

/// The network as burn sees it.
#[derive(Module, Debug)]
pub struct LookAheadNet {
    conv1: Conv2d,
    residual1: Vec<Conv2d>,
    conv2: Conv2d,
    residual2: Vec<Conv2d>,
    fc1: Linear,
    fc2: Linear,
}

impl LookAheadNet {
    /// Puts weights on a device; an autodiff device makes them trainable.
    pub fn from_weights(weights: &Weights, device: &Device) -> Self {
        let architecture = weights.architecture();
        let parts = weights.parts();
        let conv = |id: u64, inputs: usize, conv: ConvLayer, weight: &[f32], bias: &[f32]| {
            let (before, after) = conv.padding();
            let mut layer = Conv2dConfig::new([inputs, conv.channels], [conv.kernel, conv.kernel])
                .with_padding(PaddingConfig2d::Explicit(before, before, after, after))
                .init(device);
            layer.weight = param(id, weight, [conv.channels, inputs, conv.kernel, conv.kernel], device);
            layer.bias = Some(param(id + 1, bias, [conv.channels], device));
            layer
        };
        let residual = |id: u64, channels: usize, weights: &[f32], biases: &[f32]| {
            let layers = weights.chunks_exact(channels * channels * RESIDUAL_KERNEL.pow(2));
            let layers = (id..).step_by(2).zip(layers.zip(biases.chunks_exact(channels)));
            let shape = ConvLayer { channels, kernel: RESIDUAL_KERNEL };
            layers.map(|(id, (weight, bias))| conv(id, channels, shape, weight, bias)).collect()
        };
        let (channels1, channels2) = (architecture.conv1.channels, architecture.conv2.channels);
        let linear = |id: u64, inputs: usize, outputs: usize, weight: &[f32], bias: &[f32]| {
            let mut layer = LinearConfig::new(inputs, outputs).init(device);
            layer.weight = param(id, weight, [inputs, outputs], device);
            layer.bias = Some(param(id + 1, bias, [outputs], device));
            layer
        };
        Self {
            conv1: conv(0, 1, architecture.conv1, parts.conv1_weight, parts.conv1_bias),
            residual1: residual(RESIDUAL1, channels1, parts.residual1_weight, parts.residual1_bias),
            conv2: conv(2, channels1, architecture.conv2, parts.conv2_weight, parts.conv2_bias),
            residual2: residual(RESIDUAL2, channels2, parts.residual2_weight, parts.residual2_bias),
            fc1: linear(4, architecture.features(), architecture.hidden, parts.fc1_weight, parts.fc1_bias),
            fc2: linear(6, architecture.hidden, architecture.outputs(), parts.fc2_weight, parts.fc2_bias),
        }
    }

    /// Occupied cells `[batch, 25, 25]` to raw outputs `[batch, 4]`: means of u and w, then both raw log-variances,
    /// before [`soft_clamp_log_variance`](crate::network::soft_clamp_log_variance). With m modes `[batch, 5 m]`: these four
    /// of every mode, then their logits.
    pub fn forward(&self, occupied: Tensor<3, Bool>, dropout: Option<DropoutFactors>) -> Tensor<2> {
        let (on_features, on_hidden) = dropout.map(|factors| (factors.features, factors.hidden)).unzip();
        let map = first_layer(occupied, self.conv1.weight.val(), bias(self.conv1.bias.as_ref()));
        let map = self.residual1.iter().fold(map, residual);
        let features = second_layer(map, self.conv2.weight.val(), bias(self.conv2.bias.as_ref()));
        let features = self.residual2.iter().fold(features, residual); // [batch, features]
        let features = times(features, on_features.flatten());
        let hidden = relu(dense(features, self.fc1.weight.val(), bias(self.fc1.bias.as_ref())));
        let hidden = times(hidden, on_hidden.flatten()); // [batch, hidden]
        dense(hidden, self.fc2.weight.val(), bias(self.fc2.bias.as_ref()))
    }

    /// The parameters on the host.
    pub fn to_weights(&self, architecture: NetworkArchitecture) -> Weights {
        let mut weights = Weights::zeros(architecture);
        let parts = weights.parts_mut();
        read(self.conv1.weight.val(), parts.conv1_weight);
        read(bias(self.conv1.bias.as_ref()), parts.conv1_bias);
        read_all(&self.residual1, parts.residual1_weight, parts.residual1_bias);
        read(self.conv2.weight.val(), parts.conv2_weight);
        read(bias(self.conv2.bias.as_ref()), parts.conv2_bias);
        read_all(&self.residual2, parts.residual2_weight, parts.residual2_bias);
        read(self.fc1.weight.val(), parts.fc1_weight);
        read(bias(self.fc1.bias.as_ref()), parts.fc1_bias);
        read(self.fc2.weight.val(), parts.fc2_weight);
        read(bias(self.fc2.bias.as_ref()), parts.fc2_bias);
        weights
    }
}

/// Numbers of the first parameters of both kinds of residual layers; see [`param`].
const RESIDUAL1: u64 = 0x100;
const RESIDUAL2: u64 = 0x200;

fn residual(map: Tensor<2>, layer: &Conv2d) -> Tensor<2> {
    residual_layer(map, layer.weight.val(), bias(layer.bias.as_ref()))
}

/// Weights and biases of several layers, one after the other.
fn read_all(layers: &[Conv2d], weights: &mut [f32], biases: &mut [f32]) {
    let each = layers.len().max(1);
    let (weight_len, bias_len) = ((weights.len() / each).max(1), (biases.len() / each).max(1));
    let into = weights.chunks_exact_mut(weight_len).zip(biases.chunks_exact_mut(bias_len));
    for (layer, (into_weight, into_bias)) in layers.iter().zip(into) {
        read(layer.weight.val(), into_weight);
        read(bias(layer.bias.as_ref()), into_bias);
    }
}

fn bias(bias: Option<&Param<Tensor<1>>>) -> Tensor<1> {
    bias.expect("every layer has a bias").val()
}

fn read<const D: usize>(tensor: Tensor<D>, into: &mut [f32]) {
    let values: Vec<f32> = tensor.into_data().try_into_vec().expect("parameters are f32");
    into.copy_from_slice(&values);
}

/// Grids as a tensor `[batch, 25, 25]`, true = non-drivable.
pub(crate) fn occupied_tensor<'a>(grids: impl Iterator<Item = &'a OccupancyGrid>, device: &Device) -> Tensor<3, Bool> {
    const CELLS: usize = GRID_CELLS * GRID_CELLS;
    let mut cells = Vec::with_capacity(grids.size_hint().0 * CELLS);
    for grid in grids {
        cells.extend(grid.cells().map(|cell| cell == 1));
    }
    let batch = cells.len() / CELLS;
    Tensor::from_data(TensorData::new(cells, [batch, GRID_CELLS, GRID_CELLS]), device)
}

/// A parameter with a number of its own in the network, by which the optimiser's state on disk finds it again.
fn param<const D: usize>(id: u64, values: &[f32], shape: [usize; D], device: &Device) -> Param<Tensor<D>> {
    let param = Param::from_tensor(Tensor::from_data(TensorData::new(values.to_vec(), shape), device));
    let (_, tensor, mapper) = param.consume();
    Param::from_mapped_value(ParamId::from(id), tensor, mapper)
}

fn times(layer: Tensor<2>, factors: Option<Tensor<2>>) -> Tensor<2> {
    match factors {
        Some(factors) => layer * factors,
        None => layer,
    }
}
