//! What is reported about a round.

use crate::agreement::Agreement;
use crate::dataset::{Collection, Effort};
use crate::fit::FitReport;
use serde::{Deserialize, Serialize};

/// One column of the paper's `DAgger` table, with more counts.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct IterationRow {
    /// 0 = behaviour cloning.
    pub round: u32,
    /// Samples collected in this round.
    pub samples: usize,
    /// Samples in the data set after it.
    pub dataset: usize,
    /// η̂ of this collection: of the policy trained in the round before. None in behaviour cloning.
    pub eta_hat: Option<f64>,
    /// Σ τ̂ per second of driving. None in behaviour cloning.
    pub tau_hat_per_s: Option<f64>,
    /// Near-collisions while collecting.
    pub near_collisions: u32,
    /// What collecting cost; `None` in tables of earlier versions.
    #[serde(default)]
    pub effort: Option<Effort>,
    /// What η̂ is to be read with; `None` in behaviour cloning.
    #[serde(default)]
    pub agreement: Option<Agreement>,
    /// Mean weight of the squared error in this round's training; `None` in tables of earlier versions.
    #[serde(default)]
    pub mean_weight: Option<f32>,
    /// Negative log-likelihood of the policy trained in this round, on held-back samples.
    pub validation_nll: Option<f32>,
    /// Its root mean square distance to the labels, metres.
    pub validation_rmse_m: Option<f32>,
}

impl IterationRow {
    pub(crate) fn new(collection: &Collection, dataset: usize, fit: &FitReport) -> Self {
        let is_iteration = collection.round > 0;
        Self {
            round: collection.round,
            samples: collection.samples,
            dataset,
            eta_hat: is_iteration.then(|| collection.eta_hat()),
            tau_hat_per_s: is_iteration.then(|| collection.tau_hat_per_s()),
            near_collisions: collection.near_collisions,
            effort: collection.effort,
            agreement: collection.agreement,
            mean_weight: fit.mean_weight,
            validation_nll: fit.validation.map(|validation| validation.nll),
            validation_rmse_m: fit.validation.map(|validation| validation.rmse_m),
        }
    }
}
