//! The driving policy network: what it is, its weights, and two ways to compute it.
//!
//! | type | computes with | used for |
//! |---|---|---|
//! | [`LookAheadNet`] | burn, on any of its devices | the definition; GPUs |
//! | [`Predictor`] on [`DeviceChoice::Cpu`] | [`fast`]: the same network arranged for CPUs | everything by default |
//!
//! Tests compare the two, values and gradients.

mod architecture;
mod device;
mod dropout;
mod error;
pub mod fast;
mod inference;
mod log_variance;
mod look_ahead_net;
mod predictor;
mod weights;

pub use architecture::{ConvLayer, LANES, NetworkArchitecture, OUTPUTS, POOLED_1, POOLED_2};
pub use device::DeviceChoice;
pub use dropout::{DropoutDraw, DropoutFactors};
pub use error::NetworkError;
pub use inference::InferenceSettings;
pub(crate) use log_variance::soft_clamp_slope;
pub use log_variance::{LOG_VARIANCE_MAX, LOG_VARIANCE_MIN, soft_clamp_log_variance};
pub use look_ahead_net::LookAheadNet;
pub(crate) use look_ahead_net::grid_tensor;
pub use predictor::{Prediction, Predictor};
pub use weights::{Parts, Weights};
