//! The driving policy network: a module of burn, its weights on the host, and how it answers.
//!
//! [`LookAheadNet`] is the network. Its convolutions and its dense layers are custom [`operations`]: fast on CPUs,
//! plain burn on GPUs, where it can be trained. The same module is trained (with autodiff) and drives (without, in [`Predictor`]).

mod architecture;
mod dropout;
mod ensemble;
mod error;
mod inference;
mod log_variance;
mod look_ahead_net;
pub mod modes;
pub mod operations;
mod predictor;
mod weights;

pub use architecture::{
    ConvLayer, LANES, NetworkArchitecture, OUTPUTS, POOLED_1, POOLED_2, RESIDUAL_KERNEL, row_width,
};
pub use dropout::DropoutFactors;
pub use ensemble::Ensemble;
pub use error::NetworkError;
pub use inference::InferenceSettings;
pub use log_variance::{LOG_VARIANCE_MAX, LOG_VARIANCE_MIN, soft_clamp_log_variance};
pub use look_ahead_net::LookAheadNet;
pub(crate) use look_ahead_net::occupied_tensor;
pub use predictor::{Prediction, Predictor};
pub use weights::{Parts, Weights};
