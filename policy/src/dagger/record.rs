//! What is written down about a round.

use super::Collected;
use crate::fit::FitReport;
use serde::{Deserialize, Serialize};
use sim::episode::EpisodeReport;

/// How a round was collected; `round.toml`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Collection {
    /// 0 = behaviour cloning.
    pub round: u32,
    /// Samples kept.
    pub samples: usize,
    /// Executed actions, `n_tot`.
    pub ticks: u64,
    /// Executed actions of the network, `n_net`.
    pub novice_ticks: u64,
    /// Sum of τ̂ over all ticks.
    pub tau_hat_sum: f64,
    /// Ticks in seconds.
    pub driven_s: f64,
    /// Near-collisions while collecting.
    pub near_collisions: u32,
    /// Metres driven.
    pub driven_m: f64,
    /// Episodes driven.
    pub episodes: usize,
}

impl Collection {
    pub(super) fn new(round: u32, collected: &Collected, control_period_s: f32, reports: &[EpisodeReport]) -> Self {
        Self {
            round,
            samples: collected.round.samples.len(),
            ticks: collected.n_tot,
            novice_ticks: collected.n_net,
            tau_hat_sum: collected.tau_hat_sum,
            driven_s: collected.n_tot as f64 * f64::from(control_period_s),
            near_collisions: reports.iter().map(|report| report.metrics.near_collisions).sum(),
            driven_m: reports.iter().map(|report| f64::from(report.metrics.driven_m)).sum(),
            episodes: reports.len(),
        }
    }

    /// η̂ = `n_net` / `n_tot` (Algorithm 2, line 19).
    pub fn eta_hat(&self) -> f64 {
        self.novice_ticks as f64 / self.ticks.max(1) as f64
    }

    /// Σ τ̂ per second of driving: the paper's "effect" row compares two of these.
    pub fn tau_hat_per_s(&self) -> f64 {
        self.tau_hat_sum / self.driven_s.max(f64::MIN_POSITIVE)
    }
}

/// One column of the paper's `DAgger` table, and what else is worth knowing.
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
    /// Negative log-likelihood of the policy trained in this round, on held-back samples.
    pub validation_nll: Option<f32>,
    /// Its root mean square distance to the labels, metres.
    pub validation_rmse_m: Option<f32>,
}

impl IterationRow {
    pub(super) fn new(collection: &Collection, dataset: usize, fit: &FitReport) -> Self {
        let is_iteration = collection.round > 0;
        Self {
            round: collection.round,
            samples: collection.samples,
            dataset,
            eta_hat: is_iteration.then(|| collection.eta_hat()),
            tau_hat_per_s: is_iteration.then(|| collection.tau_hat_per_s()),
            near_collisions: collection.near_collisions,
            validation_nll: fit.validation.map(|validation| validation.nll),
            validation_rmse_m: fit.validation.map(|validation| validation.rmse_m),
        }
    }
}
