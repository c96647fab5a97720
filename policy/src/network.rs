//! The driving policy network: what it is, its weights, and two ways to compute it.
//!
//! | type | computes with | used for |
//! |---|---|---|
//! | [`LookAheadNet`] | burn, on any of its devices | the definition; GPUs |
//! | [`Predictor`] on [`DeviceChoice::Cpu`] | [`fast`]: the same network arranged for CPUs | everything by default |
//!
//! Tests hold the two against each other, values and gradients.

mod dropout;
pub mod fast;
mod predictor;
mod weights;

pub use dropout::DropoutDraw;
pub use predictor::{DeviceChoice, Prediction, Predictor};
pub use weights::{Parts, Weights};

use burn::module::{Module, Param};
use burn::nn::conv::{Conv2d, Conv2dConfig};
use burn::nn::{Linear, LinearConfig, PaddingConfig2d};
use burn::tensor::activation::relu;
use burn::tensor::module::max_pool2d;
use burn::tensor::ops::MaxPoolOptions;
use burn::tensor::{Device, Gradients, Tensor, TensorData};
use serde::{Deserialize, Serialize};
use sim::sensing::{GRID_CELLS, OccupancyGrid};

/// Cells per side after the first and after the second max-pool of 2: 25 → 12 → 6.
pub const POOLED_1: usize = GRID_CELLS / 2;
/// See [`POOLED_1`].
pub const POOLED_2: usize = POOLED_1 / 2;
/// Values the network answers: means of u and w, then the raw log-variances of both.
pub const OUTPUTS: usize = 4;

/// Bounds of log σ²: σ between 0.01 and 1 image fraction (methods.md 4.2).
pub const LOG_VARIANCE_MIN: f32 = -9.2;
/// See [`LOG_VARIANCE_MIN`].
pub const LOG_VARIANCE_MAX: f32 = 0.0;

/// One convolution with "same" padding, followed by a max-pool of 2 and a `ReLU`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ConvConfig {
    /// Output channels; a multiple of 16.
    pub channels: usize,
    /// Cells per side of the kernel, 1 to 7. An even kernel pads one more at the bottom and at the right.
    pub kernel: usize,
}

impl ConvConfig {
    /// Padding before (top, left) and after (bottom, right).
    pub fn padding(self) -> (usize, usize) {
        ((self.kernel - 1) / 2, self.kernel / 2)
    }
}

/// Shape of the network.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LookAheadNetConfig {
    /// First convolution, on 25×25 cells.
    pub conv1: ConvConfig,
    /// Second convolution, on 12×12 cells.
    pub conv2: ConvConfig,
    /// Units of the fully connected layer.
    pub hidden: usize,
    /// Dropout after the second pool, 0…1; applied in steps of 1/256.
    pub dropout_features: f32,
    /// Dropout after the fully connected layer, 0…1; applied in steps of 1/256.
    pub dropout_hidden: f32,
    /// In use, the answer is the mean of the answer to a grid and of the mirrored answer to its mirror image: left and
    /// right are then treated alike to the bit, and errors partly cancel. Training sees single grids as always.
    #[serde(default)]
    pub mirror_averaging: bool,
    /// In use, the point that is driven at is an exponential mean of the answers over about so many ticks, in curvature
    /// and range; 0: the last answer alone.
    #[serde(default)]
    pub smoothing_ticks: f32,
}

impl LookAheadNetConfig {
    /// The paper's layer list with the authors' published kernel sizes (methods.md 4.1): 2 318 092 parameters.
    pub fn paper() -> Self {
        Self {
            conv1: ConvConfig { channels: 32, kernel: 5 },
            conv2: ConvConfig { channels: 64, kernel: 2 },
            hidden: 1000,
            dropout_features: 0.25,
            dropout_hidden: 0.5,
            mirror_averaging: false,
            smoothing_ticks: 0.0,
        }
    }

    /// Half the channels, 3×3 kernels and a quarter of the head: 300 996 parameters, trained twice as fast as with the
    /// paper's head and as well (55 000 samples of lot a: 1.01 against 1.02 m). With that much data dropout costs more
    /// than it gives (1.00 against 1.02 m). Near-collisions in 42 km of development lots, the same weights: 33 without
    /// memory, 26 with 3.5 ticks, 22 with 8; of others, trained with it: 23 with 8, 23 with 12, 34 with 18.
    pub fn compact() -> Self {
        Self {
            conv1: ConvConfig { channels: 16, kernel: 3 },
            conv2: ConvConfig { channels: 32, kernel: 3 },
            hidden: 256,
            dropout_features: 0.0,
            dropout_hidden: 0.2,
            mirror_averaging: true,
            smoothing_ticks: 8.0,
        }
    }

    /// Inputs of the fully connected layer.
    pub fn features(&self) -> usize {
        POOLED_2 * POOLED_2 * self.conv2.channels
    }

    /// Number of trainable values.
    pub fn parameter_count(&self) -> usize {
        Parts::lengths(self).sum()
    }

    /// Checks what the arithmetic relies on.
    ///
    /// # Errors
    /// The first value that is impossible.
    pub fn validate(&self) -> Result<(), NetworkError> {
        for (layer, conv) in [("conv1", self.conv1), ("conv2", self.conv2)] {
            if conv.channels == 0 || conv.channels % fast::LANES != 0 {
                return Err(NetworkError::Channels { layer, channels: conv.channels, multiple: fast::LANES });
            }
            if !(1..=7).contains(&conv.kernel) {
                return Err(NetworkError::Kernel { layer, kernel: conv.kernel });
            }
        }
        if !(self.smoothing_ticks.is_finite() && self.smoothing_ticks >= 0.0) {
            return Err(NetworkError::Memory { ticks: self.smoothing_ticks });
        }
        if self.hidden == 0 {
            return Err(NetworkError::NoHiddenUnits);
        }
        for (name, share) in [("dropout_features", self.dropout_features), ("dropout_hidden", self.dropout_hidden)] {
            if !(0.0..1.0).contains(&share) {
                return Err(NetworkError::Dropout { name, share });
            }
        }
        Ok(())
    }
}

/// Why a network shape is refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum NetworkError {
    /// The vector width of the first convolution.
    #[error("{layer} has {channels} channels; the arithmetic wants a positive multiple of {multiple}")]
    Channels {
        /// Which convolution.
        layer: &'static str,
        /// What was asked for.
        channels: usize,
        /// What is possible.
        multiple: usize,
    },
    /// The kernel does not fit the tables of the first convolution.
    #[error("{layer} has a kernel of {kernel} cells; 1 to 7 are possible")]
    Kernel {
        /// Which convolution.
        layer: &'static str,
        /// What was asked for.
        kernel: usize,
    },
    /// A fully connected layer without units.
    #[error("the fully connected layer needs at least one unit")]
    NoHiddenUnits,
    /// A memory that is no length of time.
    #[error("smoothing_ticks is {ticks}; 0 or more ticks are possible")]
    Memory {
        /// As given.
        ticks: f32,
    },
    /// A share outside [0, 1).
    #[error("{name} is {share}; a share from 0 to below 1 is possible")]
    Dropout {
        /// Which layer.
        name: &'static str,
        /// What was asked for.
        share: f32,
    },
}

/// Keeps log σ² inside its bounds without a corner: `mid + half · tanh((raw − mid)/half)`.
///
/// Slope 1 at the middle (σ = 0.1), positive everywhere, so that a saturated value can still be learned away from.
pub fn soft_clamp_log_variance(raw: f32) -> f32 {
    CLAMP_MID + CLAMP_HALF * ((raw - CLAMP_MID) / CLAMP_HALF).tanh()
}

/// Slope of [`soft_clamp_log_variance`], given its value.
pub(crate) fn soft_clamp_slope(log_variance: f32) -> f32 {
    let tanh = (log_variance - CLAMP_MID) / CLAMP_HALF;
    1.0 - tanh * tanh
}

/// Inverse of [`soft_clamp_log_variance`], for initial values.
pub(crate) fn soft_clamp_inverse(log_variance: f32) -> f32 {
    CLAMP_MID + CLAMP_HALF * ((log_variance - CLAMP_MID) / CLAMP_HALF).atanh()
}

const CLAMP_MID: f32 = 0.5 * (LOG_VARIANCE_MIN + LOG_VARIANCE_MAX);
const CLAMP_HALF: f32 = 0.5 * (LOG_VARIANCE_MAX - LOG_VARIANCE_MIN);

/// The network as burn sees it.
#[derive(Module, Debug)]
pub struct LookAheadNet {
    conv1: Conv2d,
    conv2: Conv2d,
    fc1: Linear,
    fc2: Linear,
}

/// Factors that dropout puts on two layers: 0 or 1/(1 − share).
#[derive(Debug, Clone)]
pub struct DropoutFactors {
    /// `[batch, features]`.
    pub features: Tensor<2>,
    /// `[batch, hidden]`.
    pub hidden: Tensor<2>,
}

impl LookAheadNet {
    /// Puts weights on a device; an autodiff device makes them trainable.
    pub fn from_weights(weights: &Weights, device: &Device) -> Self {
        let config = weights.config();
        let parts = weights.parts();
        let conv = |inputs: usize, conv: ConvConfig, weight: &[f32], bias: &[f32]| {
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
            conv1: conv(1, config.conv1, parts.conv1_weight, parts.conv1_bias),
            conv2: conv(config.conv1.channels, config.conv2, parts.conv2_weight, parts.conv2_bias),
            fc1: linear(config.features(), config.hidden, parts.fc1_weight, parts.fc1_bias),
            fc2: linear(config.hidden, OUTPUTS, parts.fc2_weight, parts.fc2_bias),
        }
    }

    /// Grids `[batch, 1, 25, 25]` to raw outputs `[batch, 4]`: means of u and w, then both raw log-variances, before
    /// [`soft_clamp_log_variance`].
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
    pub(crate) fn gradient(&self, config: LookAheadNetConfig, gradients: &Gradients) -> Weights {
        let mut weights = Weights::zeros(config);
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
