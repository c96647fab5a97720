//! The loss of the paper: Gaussian log-likelihood with the gain (1 + α τ̂) on the residual (docs/methods.md 4.2).
//!
//! Per sample, with s = log σ² and e = label − mean, both axes j averaged:
//!
//! `L = ½ · mean_j[ W · e_j² · exp(−s_j) + s_j ]`, `W = (1 + α τ̂)²`
//!
//! Two forms: closed ([`of_sample`], used on CPUs) and on burn tensors ([`of_batch`], used on GPUs).

use crate::network::{self, LOG_VARIANCE_MAX, LOG_VARIANCE_MIN, OUTPUTS};
use crate::string_or_table::string_or_table;
use burn::tensor::Tensor;
use serde::{Deserialize, Serialize};

/// How the loss is weighted.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LossSettings {
    /// α, gain of the discrepancy τ̂. 0 switches the paper's weighting off.
    pub alpha: f32,
    /// Where the gain enters.
    #[serde(deserialize_with = "string_or_table")]
    pub weight: WeightForm,
    /// β of β-NLL (Seitzer 2022): the loss of each axis times σ^2β, as a constant. 0 = the paper's loss.
    pub beta: f32,
}

/// Where the gain of the discrepancy enters the loss.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum WeightForm {
    /// The paper: on the residual, so the squared error is weighted by (1 + α τ̂)².
    ResidualSq,
    /// The authors' published code: on the squared error, 1 + gain · τ̂; α is not used.
    Linear {
        /// 10 (authors' code).
        #[serde(default = "authors_gain")]
        gain: f32,
    },
}

fn authors_gain() -> f32 {
    10.0
}

impl LossSettings {
    /// α = 1.5 on the residual, no β (paper, policy network training).
    pub fn paper() -> Self {
        Self { alpha: 1.5, weight: WeightForm::ResidualSq, beta: 0.0 }
    }

    /// Plain log-likelihood: comparable between networks trained with different weights.
    pub fn unweighted() -> Self {
        Self { alpha: 0.0, ..Self::paper() }
    }

    /// Weight of the squared error of a sample with discrepancy `tau_hat`.
    pub fn weight_of_squared_error(&self, tau_hat: f32) -> f32 {
        match self.weight {
            WeightForm::ResidualSq => (1.0 + self.alpha * tau_hat).powi(2),
            WeightForm::Linear { gain } => 1.0 + gain * tau_hat,
        }
    }
}

/// The loss and the two terms it is the sum of.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct LossParts {
    /// First term: weighted squared error over the predicted variance.
    pub misfit: f32,
    /// Second term: the price of a large variance.
    pub log_variance: f32,
    /// Their sum.
    pub total: f32,
}

/// Loss of one sample and its gradient by the raw outputs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SampleLoss {
    /// The loss by part.
    pub parts: LossParts,
    /// ∂L/∂(u, w, raw log-variance of u, of w).
    pub gradient: [f32; OUTPUTS],
    /// (label − mean)², summed over both axes, squared image fractions.
    pub squared_error: f32,
}

/// The loss in closed form: ∂L/∂mean = −W e exp(−s)/2, ∂L/∂s = (1 − W e² exp(−s))/4, then through the soft clamp.
pub fn of_sample(settings: &LossSettings, raw: [f32; OUTPUTS], label: [f32; 2], tau_hat: f32) -> SampleLoss {
    const PER_AXIS: f32 = 0.5;
    let weight = settings.weight_of_squared_error(tau_hat);
    let mut loss = SampleLoss { parts: LossParts::default(), gradient: [0.0; OUTPUTS], squared_error: 0.0 };
    for axis in 0..2 {
        let log_variance = network::soft_clamp_log_variance(raw[2 + axis]);
        let error = label[axis] - raw[axis];
        let precision = (-log_variance).exp();
        let scaled_square = weight * error * error * precision;
        // σ^2β is a constant of the sample: no gradient flows through it.
        let beta_factor = if settings.beta == 0.0 { 1.0 } else { (settings.beta * log_variance).exp() };
        let share = PER_AXIS * beta_factor;
        loss.parts.misfit += 0.5 * share * scaled_square;
        loss.parts.log_variance += 0.5 * share * log_variance;
        loss.gradient[axis] = -share * weight * error * precision;
        loss.gradient[2 + axis] = 0.5 * share * (1.0 - scaled_square) * network::soft_clamp_slope(log_variance);
        loss.squared_error += error * error;
    }
    loss.parts.total = loss.parts.misfit + loss.parts.log_variance;
    loss
}

/// Mean loss of a batch on burn tensors: outputs `[batch, 4]`, labels `[batch, 2]`, weights of the squared error
/// `[batch, 1]`.
pub fn of_batch(settings: &LossSettings, outputs: Tensor<2>, labels: Tensor<2>, weights: Tensor<2>) -> BatchLoss {
    let half = 0.5 * (LOG_VARIANCE_MAX - LOG_VARIANCE_MIN);
    let mid = 0.5 * (LOG_VARIANCE_MAX + LOG_VARIANCE_MIN);
    let means = outputs.clone().narrow(1, 0, 2); // [batch, 2]
    let raw = outputs.narrow(1, 2, 2); // [batch, 2]
    let log_variance = ((raw - mid) / half).tanh() * half + mid;
    let error = labels - means;
    let beta_factor = (log_variance.clone().detach() * settings.beta).exp();
    let misfit = (weights * error.powi_scalar(2) * log_variance.clone().neg().exp() * beta_factor.clone()).mean();
    let log_variance = (log_variance * beta_factor).mean();
    BatchLoss { misfit: misfit * 0.5, log_variance: log_variance * 0.5 }
}

/// Mean loss of a batch by part, each `[1]`.
#[derive(Debug, Clone)]
pub struct BatchLoss {
    /// First term.
    pub misfit: Tensor<1>,
    /// Second term.
    pub log_variance: Tensor<1>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use burn::tensor::{Device, TensorData};

    const RAW: [f32; OUTPUTS] = [0.43, 0.61, -3.1, -5.2];
    const LABEL: [f32; 2] = [0.5, 0.35];
    const TAU_HAT: f32 = 0.27;

    #[test]
    fn the_value_matches_the_formula_written_out() {
        let loss = of_sample(&LossSettings::paper(), RAW, LABEL, TAU_HAT).parts;
        let s = [RAW[2], RAW[3]].map(|raw| f64::from(network::soft_clamp_log_variance(raw)));
        let gain = 1.0 + 1.5 * f64::from(TAU_HAT);
        let expected: f64 = (0..2)
            .map(|j| {
                let r = gain * f64::from(LABEL[j] - RAW[j]);
                0.5 * (0.5 * r * r / s[j].exp() + 0.5 * s[j])
            })
            .sum();
        assert!((f64::from(loss.total) - expected).abs() < 1e-6, "{loss:?} against {expected}");
    }

    #[test]
    fn the_gradient_matches_finite_differences() {
        for settings in [
            LossSettings::paper(),
            LossSettings::unweighted(),
            LossSettings { weight: WeightForm::Linear { gain: 10.0 }, ..LossSettings::paper() },
        ] {
            let gradient = of_sample(&settings, RAW, LABEL, TAU_HAT).gradient;
            for (index, slope) in gradient.into_iter().enumerate() {
                let at = |delta: f32| {
                    let mut raw = RAW;
                    raw[index] += delta;
                    of_sample(&settings, raw, LABEL, TAU_HAT).parts.total
                };
                let step = 5e-3;
                let difference = (at(step) - at(-step)) / (2.0 * step);
                assert!(
                    (difference - slope).abs() < 2e-3 * (1.0 + slope.abs()),
                    "{settings:?} [{index}]: {difference} {slope}"
                );
            }
        }
    }

    #[test]
    fn closed_form_and_autodiff_agree() {
        let device = Device::flex().autodiff();
        for settings in [
            LossSettings::paper(),
            LossSettings { beta: 0.5, ..LossSettings::paper() },
            LossSettings { weight: WeightForm::Linear { gain: 10.0 }, ..LossSettings::paper() },
        ] {
            let outputs = Tensor::<2>::from_data(TensorData::new(RAW.to_vec(), [1, OUTPUTS]), &device).require_grad();
            let labels = Tensor::<2>::from_data(TensorData::new(LABEL.to_vec(), [1, 2]), &device);
            let weight = settings.weight_of_squared_error(TAU_HAT);
            let weights = Tensor::<2>::from_data(TensorData::new(vec![weight], [1, 1]), &device);
            let loss = of_batch(&settings, outputs.clone(), labels, weights);
            let closed = of_sample(&settings, RAW, LABEL, TAU_HAT);
            let misfit: f32 = loss.misfit.clone().into_scalar();
            assert!((misfit - closed.parts.misfit).abs() < 1e-5, "{settings:?}: {misfit} {closed:?}");
            let gradients = (loss.misfit + loss.log_variance).backward();
            let gradient: Vec<f32> = outputs.grad(&gradients).unwrap().into_data().try_into_vec().unwrap();
            for (a, b) in gradient.iter().zip(closed.gradient) {
                assert!((a - b).abs() < 1e-4 * (1.0 + b.abs()), "{settings:?}: {gradient:?} {closed:?}");
            }
        }
    }

    #[test]
    fn the_weight_raises_the_price_of_known_mistakes() {
        let settings = LossSettings::paper();
        assert_eq!(settings.weight_of_squared_error(0.0), 1.0);
        assert_eq!(settings.weight_of_squared_error(1.0), 6.25);
        let linear = LossSettings { weight: WeightForm::Linear { gain: 10.0 }, ..settings };
        assert_eq!(linear.weight_of_squared_error(0.5), 6.0);
    }
}
