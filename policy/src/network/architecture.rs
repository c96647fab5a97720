//! The shape of the network.

use crate::network::error::NetworkError;
use serde::{Deserialize, Serialize};
use sim::limits::{CHANNELS_MAX, HIDDEN_MAX, MODES_MAX, PARAMETERS_MAX, RESIDUAL_LAYERS_MAX};
use sim::sensing::GRID_CELLS;

/// Cells per side after the first and after the second max-pool of 2: 25 → 12 → 6.
pub const POOLED_1: usize = GRID_CELLS / 2;
/// See [`POOLED_1`].
pub const POOLED_2: usize = POOLED_1 / 2;
/// Values of one answer: means of u and w, then the raw log-variances of both.
pub const OUTPUTS: usize = 4;

/// Values in a row of `modes` answers: [`OUTPUTS`], of several each with a logit.
pub fn row_width(modes: usize) -> usize {
    if modes == 1 { OUTPUTS } else { modes * (OUTPUTS + 1) }
}

/// Channels are computed in groups of this many.
pub const LANES: usize = 16;

/// Cells per side of the kernel of a residual layer.
pub const RESIDUAL_KERNEL: usize = 3;

/// One convolution with "same" padding. `conv1` and `conv2` are followed by a max-pool of 2 and a `ReLU`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ConvLayer {
    /// Output channels; a multiple of 16.
    pub channels: usize,
    /// Cells per side of the kernel, 1 to 7. An even kernel pads one more at the bottom and at the right.
    pub kernel: usize,
}

impl ConvLayer {
    /// Padding before (top, left) and after (bottom, right).
    pub fn padding(self) -> (usize, usize) {
        ((self.kernel - 1) / 2, self.kernel / 2)
    }
}

/// Shape of the network.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NetworkArchitecture {
    /// First convolution, on 25×25 cells.
    pub conv1: ConvLayer,
    /// Second convolution, on 12×12 cells.
    pub conv2: ConvLayer,
    /// Residual layers (He 2016) after the first pool, on 12×12 cells, 0 to 8: a 3×3 convolution that is added to what it
    /// sees, then a `ReLU`. 0 = none (paper).
    #[serde(default)]
    pub residual1: usize,
    /// The same after the second pool, on 6×6 cells.
    #[serde(default)]
    pub residual2: usize,
    /// Units of the fully connected layer.
    pub hidden: usize,
    /// Answers that are weighed against each other, 1 to 8: the components of a mixture of Gaussians. 1 = one Gaussian.
    pub modes: usize,
    /// Dropout after the second pool, 0…1; applied in steps of 1/256.
    pub dropout_features: f32,
    /// Dropout after the fully connected layer, 0…1; applied in steps of 1/256.
    pub dropout_hidden: f32,
}

impl NetworkArchitecture {
    /// The paper's layer list with the authors' published kernel sizes (docs/methods.md 4.1): 2 318 092 parameters.
    pub fn paper() -> Self {
        Self {
            conv1: ConvLayer { channels: 32, kernel: 5 },
            conv2: ConvLayer { channels: 64, kernel: 2 },
            residual1: 0,
            residual2: 0,
            hidden: 1000,
            modes: 1,
            dropout_features: 0.25,
            dropout_hidden: 0.5,
        }
    }

    /// Half the channels, 3×3 kernels, a quarter of the head and two modes: 302 538 parameters. With one mode it is trained twice
    /// as fast as with the paper's head and as well (55 000 samples of lot a: 1.01 against 1.02 m). With that much data dropout
    /// costs more than it gives (1.00 against 1.02 m), and residual layers more time than what they take off is worth; two modes
    /// take off a quarter of the near-collisions, because two ways past an obstacle have no mean (docs/notebook/attempts.md).
    pub fn compact() -> Self {
        Self {
            conv1: ConvLayer { channels: 16, kernel: 3 },
            conv2: ConvLayer { channels: 32, kernel: 3 },
            residual1: 0,
            residual2: 0,
            hidden: 256,
            modes: 2,
            dropout_features: 0.0,
            dropout_hidden: 0.2,
        }
    }

    /// Inputs of the fully connected layer.
    pub fn features(&self) -> usize {
        POOLED_2 * POOLED_2 * self.conv2.channels
    }

    /// Values that leave the network: one answer per mode, then, if there are several, the logit of each.
    pub fn outputs(&self) -> usize {
        row_width(self.modes)
    }

    /// Number of trainable values.
    pub fn parameter_count(&self) -> usize {
        self.lengths().iter().sum()
    }

    /// Values of each part of [`Weights`](crate::network::Weights), in their order.
    pub(crate) fn lengths(&self) -> [usize; 12] {
        let Self { conv1, conv2, residual1, residual2, hidden, .. } = *self;
        let residual_weights = RESIDUAL_KERNEL * RESIDUAL_KERNEL;
        [
            conv1.channels * conv1.kernel * conv1.kernel,
            conv1.channels,
            residual1 * conv1.channels * conv1.channels * residual_weights,
            residual1 * conv1.channels,
            conv2.channels * conv1.channels * conv2.kernel * conv2.kernel,
            conv2.channels,
            residual2 * conv2.channels * conv2.channels * residual_weights,
            residual2 * conv2.channels,
            self.features() * hidden,
            hidden,
            hidden * self.outputs(),
            self.outputs(),
        ]
    }

    /// Checks what the arithmetic relies on.
    ///
    /// # Errors
    /// The first value that is impossible.
    pub fn validate(&self) -> Result<(), NetworkError> {
        for (layer, conv) in [("conv1", self.conv1), ("conv2", self.conv2)] {
            if conv.channels == 0 || conv.channels % LANES != 0 {
                return Err(NetworkError::Channels { layer, channels: conv.channels, multiple: LANES });
            }
            if conv.channels > CHANNELS_MAX {
                let what = format!("{} channels in {layer}", conv.channels);
                return Err(NetworkError::TooLarge { what, max: CHANNELS_MAX });
            }
            if !(1..=7).contains(&conv.kernel) {
                return Err(NetworkError::Kernel { layer, kernel: conv.kernel });
            }
        }
        for (stage, layers) in [("residual1", self.residual1), ("residual2", self.residual2)] {
            if layers > RESIDUAL_LAYERS_MAX {
                let what = format!("{layers} layers of {stage}");
                return Err(NetworkError::TooLarge { what, max: RESIDUAL_LAYERS_MAX });
            }
        }
        if self.hidden == 0 {
            return Err(NetworkError::NoHiddenUnits);
        }
        if self.hidden > HIDDEN_MAX {
            return Err(NetworkError::TooLarge { what: format!("{} hidden units", self.hidden), max: HIDDEN_MAX });
        }
        if !(1..=MODES_MAX).contains(&self.modes) {
            return Err(NetworkError::Modes { modes: self.modes, max: MODES_MAX });
        }
        let parameters = self.parameter_count();
        if parameters > PARAMETERS_MAX {
            return Err(NetworkError::TooLarge { what: format!("{parameters} parameters"), max: PARAMETERS_MAX });
        }
        for (name, share) in [("dropout_features", self.dropout_features), ("dropout_hidden", self.dropout_hidden)] {
            if !(0.0..1.0).contains(&share) {
                return Err(NetworkError::Dropout { name, share });
            }
        }
        Ok(())
    }
}
