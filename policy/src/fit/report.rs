//! Progress and report of a training.

use crate::files::{self, FileError, Format};
use crate::loss::LossParts;
use serde::{Deserialize, Serialize};
use sim::limits::RUN_TEXT_BYTES_MAX;
use std::path::Path;

/// The state after a step, for progress bars and logs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FitProgress {
    /// Steps done.
    pub step: u32,
    /// Steps in all.
    pub steps: u32,
    /// Samples trained on so far, repetitions counted.
    pub samples_done: u64,
    /// Learning rate of this step.
    pub learning_rate: f32,
    /// Loss of this batch.
    pub loss: LossParts,
    /// The latest validation.
    pub validation: Option<Validation>,
}

/// How well a network answers samples it was not trained on.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Validation {
    /// Number of samples.
    pub samples: usize,
    /// The loss as trained, with β = 0: "best" means the lowest of these. With one mode it is of the answer that is used,
    /// mirror averaging included; with several, of all modes as they leave the network, without it.
    pub loss: f32,
    /// Plain negative log-likelihood of the same: comparable between weighted and unweighted training, and not between networks
    /// of one mode and of several.
    pub nll: f32,
    /// Root mean square distance between label and the answer that is used, mirror averaging included, metres.
    pub rmse_m: f32,
}

/// One step of a training.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Step {
    /// Its learning rate.
    pub learning_rate: f32,
    /// The loss of its batch.
    pub loss: LossParts,
}

/// One point of the loss curve.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CurvePoint {
    /// After this step.
    pub step: u32,
    /// Learning rate of this step.
    pub learning_rate: f32,
    /// Mean training loss since the previous point.
    pub training: LossParts,
    /// Validation here.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub validation: Option<Validation>,
}

/// What a training did: `fit.toml`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FitReport {
    /// Samples trained on.
    pub training_samples: usize,
    /// Samples held back.
    pub validation_samples: usize,
    /// Mean weight of the squared error over the samples trained on: 1 = the weight of τ̂ does nothing. `None` in fits of
    /// earlier versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mean_weight: Option<f32>,
    /// Steps done.
    pub steps: u32,
    /// The step whose weights are returned.
    pub kept_step: u32,
    /// Whether it was told to stop early.
    pub stopped: bool,
    /// Validation of the weights that are returned.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub validation: Option<Validation>,
    /// Loss over steps.
    pub curve: Vec<CurvePoint>,
}

impl Format for FitReport {
    const NAME: &'static str = "fit.toml";
    /// 1 had no learning rates.
    const SCHEMA: u32 = 2;
    /// [`VALIDATIONS_MAX`](crate::fit::VALIDATIONS_MAX) points of its curve have 70 MB.
    const BYTES_MAX: u64 = RUN_TEXT_BYTES_MAX;
}

impl FitReport {
    /// Reads `fit.toml` of a folder; `None` if no training is finished there.
    ///
    /// # Errors
    /// If the file is missing, damaged or of another schema.
    pub fn read(folder: &Path) -> Result<Option<Self>, FileError> {
        files::read_if_finished(folder)
    }
}
