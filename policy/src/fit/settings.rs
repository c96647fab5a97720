//! How to train.

use crate::dataset::ValidationSplit;
use crate::fit::optimizer::AdamSettings;
use crate::fit::schedule::{LearningRate, ScheduleShape};
use crate::loss::LossSettings;
use serde::{Deserialize, Serialize};

/// Steps of a training: its state, `fit.unfinished`, then stays within the 2 GB that are read again.
pub const STEPS_MAX: u32 = 50_000_000;
/// Validations of a training: its report, `fit.toml`, has some 300 bytes of each.
pub const VALIDATIONS_MAX: u32 = 200_000;

/// A training whose files would be longer than what is read again.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum TooLong {
    /// Too many steps.
    #[error("{steps} steps; at most {STEPS_MAX} are possible")]
    Steps {
        /// Steps of the training.
        steps: u32,
    },
    /// Too many validations.
    #[error(
        "validate_every = {validate_every} makes {validations} validations; at most {VALIDATIONS_MAX} are possible"
    )]
    Validations {
        /// Steps between them.
        validate_every: u32,
        /// How many.
        validations: u32,
    },
}

/// Settings of one training.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FitSettings {
    /// When training ends.
    pub budget: Budget,
    /// Samples per step.
    pub batch: usize,
    /// Learning rate over time.
    pub learning_rate: LearningRate,
    /// Adam without its learning rate.
    pub adam: AdamSettings,
    /// Norm above which the gradient of a parameter (a layer's weights or biases) is scaled down to it; 0 = never.
    pub gradient_norm_max: f32,
    /// The loss.
    pub loss: LossSettings,
    /// Whether mirror images are trained on.
    pub mirror: Mirror,
    /// Which samples are held back.
    pub validation: ValidationSplit,
    /// Steps between validations; 0 = only at the end.
    pub validate_every: u32,
    /// Most held-back samples used per validation while training, spread evenly over all of them; 0 = all. The weights
    /// that are returned are validated on all.
    pub validate_on_max: usize,
    /// Training ends early after this many validations without a new best; 0 = never.
    pub patience: u32,
    /// Which weights are returned.
    pub keep: KeepWeights,
}

/// How long to train.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Budget {
    /// Optimiser steps.
    Steps(u32),
    /// Passes over the training samples: grows with the data set.
    Epochs(f32),
}

impl Budget {
    /// Whether there is anything to train.
    pub fn is_positive(self) -> bool {
        match self {
            Self::Steps(steps) => steps > 0,
            Self::Epochs(epochs) => epochs > 0.0,
        }
    }
}

/// Whether mirror images are trained on. Turning left and right are the same skill, but the paper does not say so.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Mirror {
    /// Samples as they are (paper).
    Off,
    /// Every sample is mirrored with probability ½ each time it is used.
    Half,
}

/// Which weights are returned.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum KeepWeights {
    /// Those with the lowest validation loss seen (authors' code). The last if nothing is held back.
    BestByValidation,
    /// The last.
    Last,
}

impl FitSettings {
    /// Paper, policy network training: Adam 1e-5, batch 512, "100k epochs" read as steps, no clipping of gradients
    /// (docs/methods.md 4.2).
    pub fn paper() -> Self {
        Self {
            budget: Budget::Steps(100_000),
            batch: 512,
            learning_rate: LearningRate::constant(1e-5),
            adam: AdamSettings::paper(),
            gradient_norm_max: 0.0,
            loss: LossSettings::paper(),
            mirror: Mirror::Off,
            validation: ValidationSplit::paper(),
            validate_every: 500,
            validate_on_max: 0,
            patience: 0,
            keep: KeepWeights::BestByValidation,
        }
    }

    /// Seconds instead of hours: Adam falling from 1e-3 to 1e-5 along a cosine, smaller batches, mirror images, and
    /// β = 0.5: on straights labels are certain to a decimetre, and without β their steep likelihood leaves little
    /// gradient for corners, where near-collisions happen (behaviour cloning on lot a: 26 against 41 in 4620 m).
    pub fn quick(steps: u32) -> Self {
        Self {
            budget: Budget::Steps(steps),
            batch: 128,
            learning_rate: LearningRate { peak: 1e-3, floor: 1e-5, warm_up_steps: 50, shape: ScheduleShape::Cosine },
            gradient_norm_max: 5.0,
            mirror: Mirror::Half,
            loss: LossSettings { beta: 0.5, ..LossSettings::paper() },
            validate_every: 250,
            // On all of them, validating would take longer than training.
            validate_on_max: 8000,
            ..Self::paper()
        }
    }

    /// Steps on a number of training samples.
    pub fn steps(&self, training_samples: usize) -> u32 {
        match self.budget {
            Budget::Steps(steps) => steps,
            Budget::Epochs(epochs) => (epochs * training_samples as f32 / self.batch as f32).ceil() as u32,
        }
    }

    /// Checks that what a training of so many steps writes can be read again.
    ///
    /// # Errors
    /// If it has too many steps or validations.
    pub fn check_length(&self, steps: u32) -> Result<(), TooLong> {
        if steps > STEPS_MAX {
            return Err(TooLong::Steps { steps });
        }
        let validate_every = self.validate_every;
        match steps.checked_div(validate_every) {
            Some(validations) if validations > VALIDATIONS_MAX => {
                Err(TooLong::Validations { validate_every, validations })
            }
            _ => Ok(()),
        }
    }
}
