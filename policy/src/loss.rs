//! The loss of the paper: Gaussian log-likelihood with the gain (1 + α τ̂) on the residual (docs/methods.md 4.2).
//!
//! Per sample, with s = log σ² and e = label − mean, both axes j averaged:
//!
//! `L = ½ · mean_j[ W · e_j² · exp(−s_j) + s_j ]`, `W = (1 + α τ̂)²`
//!
//! For a network with several modes k of weight π_k, with `L_kj` the loss of each on axis j, before the mean:
//! `½ [ −log Σ_k π_k exp(−L_ku) + Σ_k r_k L_kw ]`. A mode's share in a sample, `r_k = π_k exp(−L_ku) / Σ π exp(−L_u)`, is a matter
//! of u alone: modes are ways, and ways differ in their side. If w counted as well, one mode would take all labels of full
//! range, whose w is nearly always the same, and none would stand for a way.
//!
//! This is β = 0. β-NLL multiplies the loss of each axis and mode by `σ^2β`, but for the shares ([`LossSettings::beta`]).

use crate::dataset::Sample;
use crate::network::{LOG_VARIANCE_MAX, LOG_VARIANCE_MIN, OUTPUTS, operations};
use crate::string_or_table::string_or_table;
use burn::tensor::Tensor;
use burn::tensor::activation::log_softmax;
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

    /// The same with the paper's weight and this α.
    #[must_use]
    pub fn with_alpha(self, alpha: f32) -> Self {
        Self { alpha, weight: WeightForm::ResidualSq, ..self }
    }

    /// Whether another trains the same networks: what it does not use may differ.
    pub fn is_like(&self, other: &Self) -> bool {
        self.in_effect() == other.in_effect()
    }

    /// The same, as all are written that have its effect.
    fn in_effect(self) -> Self {
        match self.weight {
            WeightForm::Linear { gain: 0.0 } => self.with_alpha(0.0),
            WeightForm::Linear { .. } => Self { alpha: 0.0, ..self },
            WeightForm::ResidualSq => self,
        }
    }

    /// Weight of the squared error of a sample with discrepancy `tau_hat`.
    pub fn weight_of_squared_error(&self, tau_hat: f32) -> f32 {
        match self.weight {
            WeightForm::ResidualSq => {
                let gain = 1.0 + self.alpha * tau_hat;
                gain * gain
            }
            WeightForm::Linear { gain } => 1.0 + gain * tau_hat,
        }
    }
}

impl LossSettings {
    /// Mean weight of the squared error of samples; 1 of none.
    pub(crate) fn mean_weight(&self, samples: &[Sample]) -> f32 {
        let sum: f64 = samples.iter().map(|sample| f64::from(self.weight_of_squared_error(sample.tau_hat))).sum();
        if samples.is_empty() { 1.0 } else { (sum / samples.len() as f64) as f32 }
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

impl LossParts {
    /// The loss from its two terms.
    pub(crate) fn new(misfit: f32, log_variance: f32) -> Self {
        Self { misfit, log_variance, total: misfit + log_variance }
    }
}

/// The loss of every sample and axis, each term by itself, `[batch, 2]`.
#[derive(Debug, Clone)]
pub struct BatchLoss {
    /// First term.
    pub misfit: Tensor<2>,
    /// Second term; with several modes, and what it costs to choose between them.
    pub log_variance: Tensor<2>,
}

/// The loss of a batch: outputs `[batch, 4]` or, with m modes, `[batch, 5 m]` as they left the network, labels `[batch, 2]`,
/// weights of the squared error `[batch, 1]`.
pub fn of_batch(settings: &LossSettings, outputs: Tensor<2>, labels: Tensor<2>, weights: Tensor<2>) -> BatchLoss {
    match outputs.dims()[1] {
        OUTPUTS => of_one(settings, outputs, labels, weights),
        width => of_mixture(settings, &outputs, width / (OUTPUTS + 1), &labels, &weights),
    }
}

/// Expectation and maximisation: with the share that each mode has in a sample held constant, the sum of their losses by
/// these shares has the value of the loss above and its gradient. With β > 0 these losses are times σ^2β; the shares, and the
/// price of choosing, `½ Σ_k r_k log(r_k / π_k)`, are those of β = 0.
fn of_mixture(
    settings: &LossSettings,
    outputs: &Tensor<2>,
    modes: usize,
    labels: &Tensor<2>,
    weights: &Tensor<2>,
) -> BatchLoss {
    let log_weights = log_softmax(outputs.clone().narrow(1, modes * OUTPUTS, modes), 1); // [batch, modes]
    let of_mode = |settings: &LossSettings, mode| {
        of_one(settings, outputs.clone().narrow(1, mode * OUTPUTS, OUTPUTS), labels.clone(), weights.clone())
    };
    let plain = LossSettings { beta: 0.0, ..*settings };
    let energies = (0..modes).map(|mode| {
        let BatchLoss { misfit, log_variance } = of_mode(&plain, mode);
        (misfit + log_variance).narrow(1, 0, 1) // that of u
    });
    let energies = Tensor::cat(energies.collect(), 1); // [batch, modes]
    let log_shares = log_softmax(log_weights.clone() - energies, 1).detach();
    let shares = operations::exp(log_shares.clone());
    // Half for each of the two axes.
    let choice = (shares.clone() * (log_shares - log_weights)).sum_dim(1) * 0.5; // [batch, 1]
    let of_modes = (0..modes).map(|mode| {
        let share = shares.clone().narrow(1, mode, 1);
        let BatchLoss { misfit, log_variance } = of_mode(settings, mode);
        BatchLoss { misfit: misfit * share.clone(), log_variance: log_variance * share }
    });
    let sum = |a: BatchLoss, b: BatchLoss| BatchLoss {
        misfit: a.misfit + b.misfit,
        log_variance: a.log_variance + b.log_variance,
    };
    let BatchLoss { misfit, log_variance } = of_modes.reduce(sum).expect("at least one mode");
    BatchLoss { misfit, log_variance: log_variance + choice }
}

/// The loss of one Gaussian.
fn of_one(settings: &LossSettings, outputs: Tensor<2>, labels: Tensor<2>, weights: Tensor<2>) -> BatchLoss {
    let half = 0.5 * (LOG_VARIANCE_MAX - LOG_VARIANCE_MIN);
    let mid = 0.5 * (LOG_VARIANCE_MAX + LOG_VARIANCE_MIN);
    let means = outputs.clone().narrow(1, 0, 2); // [batch, 2]
    let raw = outputs.narrow(1, 2, 2); // [batch, 2]
    let log_variance = operations::tanh((raw - mid) / half) * half + mid;
    let error = labels - means;
    let misfit = weights * error.square() * operations::exp(log_variance.clone().neg());
    if settings.beta == 0.0 {
        return BatchLoss { misfit: misfit * 0.5, log_variance: log_variance * 0.5 };
    }
    // σ^2β is a constant of the sample: no gradient flows through it.
    let factor = operations::exp(log_variance.clone().detach() * settings.beta) * 0.5;
    BatchLoss { misfit: misfit * factor.clone(), log_variance: log_variance * factor }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::network::soft_clamp_log_variance;
    use burn::tensor::{Device, TensorData};

    const RAW: [f32; OUTPUTS] = [0.43, 0.61, -3.1, -5.2];
    const LABEL: [f32; 2] = [0.5, 0.35];
    const TAU_HAT: f32 = 0.27;

    /// Loss of one sample, and its gradient by the raw outputs.
    fn loss_and_gradient(settings: &LossSettings, raw: &[f32]) -> (f32, Vec<f32>) {
        let device = Device::flex().autodiff();
        let tensor =
            |values: &[f32]| Tensor::<2>::from_data(TensorData::new(values.to_vec(), [1, values.len()]), &device);
        let outputs = tensor(raw).require_grad();
        let weight = tensor(&[settings.weight_of_squared_error(TAU_HAT)]);
        let loss = of_batch(settings, outputs.clone(), tensor(&LABEL), weight);
        let total = (loss.misfit + loss.log_variance).mean();
        let gradient = outputs.grad(&total.backward()).unwrap().into_data().try_into_vec().unwrap();
        (total.into_scalar(), gradient)
    }

    fn formula(settings: &LossSettings, raw: [f32; OUTPUTS], constant_at: [f32; OUTPUTS]) -> f64 {
        let weight = f64::from(settings.weight_of_squared_error(TAU_HAT));
        (0..2)
            .map(|j| {
                let s = f64::from(soft_clamp_log_variance(raw[2 + j]));
                let factor =
                    libm::exp(f64::from(settings.beta) * f64::from(soft_clamp_log_variance(constant_at[2 + j])));
                let e = f64::from(LABEL[j] - raw[j]);
                0.25 * factor * (weight * e * e / libm::exp(s) + s)
            })
            .sum()
    }

    fn readings() -> [LossSettings; 4] {
        [
            LossSettings::paper(),
            LossSettings::unweighted(),
            LossSettings { beta: 0.5, ..LossSettings::paper() },
            LossSettings { weight: WeightForm::Linear { gain: 10.0 }, ..LossSettings::paper() },
        ]
    }

    #[test]
    fn losses_are_alike_where_they_weigh_alike() {
        let linear = |gain, alpha| LossSettings { weight: WeightForm::Linear { gain }, alpha, ..LossSettings::paper() };
        let of_paper = LossSettings::paper();
        for (one, other) in [
            (linear(10.0, 1.5), linear(10.0, 0.0)),
            (linear(0.0, 1.5), LossSettings::unweighted()),
            (linear(10.0, 1.5).with_alpha(1.5), of_paper),
        ] {
            assert!(one.is_like(&other), "{one:?} {other:?}");
            assert_eq!(one.weight_of_squared_error(TAU_HAT), other.weight_of_squared_error(TAU_HAT));
        }
        let others = [linear(10.0, 1.5), linear(5.0, 1.5), of_paper.with_alpha(0.0), of_paper.with_alpha(15.0)];
        assert!(others.iter().all(|other| !other.is_like(&of_paper)));
        assert!(!linear(10.0, 1.5).is_like(&linear(5.0, 1.5)));
        assert!(!LossSettings { beta: 0.5, ..of_paper }.is_like(&of_paper));
    }

    #[test]
    fn the_value_matches_the_formula_written_out() {
        for settings in readings() {
            let (loss, _) = loss_and_gradient(&settings, &RAW);
            let expected = formula(&settings, RAW, RAW);
            assert!((f64::from(loss) - expected).abs() < 1e-5, "{settings:?}: {loss} against {expected}");
        }
    }

    /// β's factor is held constant, as Seitzer's stop-gradient does.
    #[test]
    fn the_gradient_matches_finite_differences() {
        for settings in readings() {
            let (_, gradient) = loss_and_gradient(&settings, &RAW);
            for (index, slope) in gradient.into_iter().enumerate() {
                let at = |delta: f32| {
                    let mut raw = RAW;
                    raw[index] += delta;
                    formula(&settings, raw, RAW)
                };
                let step = 1e-3;
                let difference = (at(step) - at(-step)) / f64::from(2.0 * step);
                assert!(
                    (difference - f64::from(slope)).abs() < 1e-3 * (1.0 + f64::from(slope.abs())),
                    "{settings:?} [{index}]: {difference} {slope}"
                );
            }
        }
    }

    /// Two modes in closed form; the gradient by finite differences, with the shares held. With β, of the sum by shares: it is no
    /// likelihood of a mixture then.
    #[test]
    fn modes_share_a_sample_by_its_side() {
        for beta in [0.0, 0.5] {
            check_two_modes(&LossSettings { beta, ..LossSettings::paper() });
        }
    }

    fn check_two_modes(settings: &LossSettings) {
        let other = [0.48, 0.33, -4.4, -2.9];
        let raw: Vec<f32> = RAW.into_iter().chain(other).chain([0.3, -0.8]).collect();
        let of_axis = |raw: &[f32], mode: usize, axis: usize| {
            let (mean, raw_log_variance) = (raw[mode * OUTPUTS + axis], raw[mode * OUTPUTS + 2 + axis]);
            let error = f64::from(LABEL[axis] - mean);
            let log_variance = f64::from(soft_clamp_log_variance(raw_log_variance));
            let weight = f64::from(settings.weight_of_squared_error(TAU_HAT));
            0.5 * (weight * error * error * libm::exp(-log_variance) + log_variance)
        };
        // σ^2β, a constant at the outputs themselves.
        let factor = |mode: usize, axis: usize| {
            let log_variance = f64::from(soft_clamp_log_variance(raw[mode * OUTPUTS + 2 + axis]));
            libm::exp(f64::from(settings.beta) * log_variance)
        };
        // The likelihood of each mode by its side.
        let by_side = |raw: &[f32]| {
            let logits = &raw[2 * OUTPUTS..];
            let weights: f64 = logits.iter().map(|&logit| libm::exp(f64::from(logit))).sum();
            [0, 1].map(|mode| libm::exp(f64::from(logits[mode]) - of_axis(raw, mode, 0)) / weights)
        };
        let held = by_side(&raw);
        let shares = held.map(|side| side / (held[0] + held[1]));
        let value = |raw: &[f32]| {
            let sides = by_side(raw);
            // What β adds to the losses of the sides, and the losses of the ranges.
            let of_modes: f64 = (0..2)
                .map(|mode| {
                    let more = (factor(mode, 0) - 1.0) * of_axis(raw, mode, 0);
                    shares[mode] * (more + factor(mode, 1) * of_axis(raw, mode, 1))
                })
                .sum();
            0.5 * (of_modes - libm::log(sides[0] + sides[1]))
        };
        let (loss, gradient) = loss_and_gradient(settings, &raw);
        assert!((f64::from(loss) - value(&raw)).abs() < 1e-5, "{settings:?}: {loss} against {}", value(&raw));
        for (index, slope) in gradient.into_iter().enumerate() {
            let at = |delta: f32| {
                let mut raw = raw.clone();
                raw[index] += delta;
                value(&raw)
            };
            let difference = (at(1e-3) - at(-1e-3)) / 2e-3;
            assert!(
                (difference - f64::from(slope)).abs() < 2e-3 * (1.0 + f64::from(slope.abs())),
                "{settings:?} [{index}]: {difference} {slope}"
            );
        }
    }

    /// A label of the usual range, to the left or to the right: no mode may claim it for its range.
    #[test]
    fn the_range_of_a_label_does_not_choose_the_mode() {
        let settings = LossSettings { alpha: 0.0, ..LossSettings::paper() };
        let wide = -2.0;
        // The first has the label's side, the second its range to a centimetre.
        let raw = [LABEL[0], 0.6, wide, wide, 0.9, LABEL[1], wide, -9.0, 0.0, 0.0];
        let (_, gradient) = loss_and_gradient(&settings, &raw);
        assert!(gradient[8] < 0.0 && gradient[9] > 0.0, "the first becomes likelier: {gradient:?}");
    }

    #[test]
    fn the_weight_raises_the_price_of_known_mistakes() {
        let settings = LossSettings::paper();
        assert_eq!(settings.weight_of_squared_error(0.0), 1.0);
        assert_eq!(settings.weight_of_squared_error(1.0), 6.25);
        // Half of the samples at τ̂ = 1: (1 + 6.25) / 2. With α = 15: (1 + 256) / 2.
        let grid = sim::sensing::OccupancyGrid::free();
        let samples = [0.0, 1.0].map(|tau_hat| Sample { grid, label: [0.5; 2], tau_hat });
        assert_eq!((settings.mean_weight(&samples), settings.mean_weight(&[])), (3.625, 1.0));
        assert_eq!(LossSettings { alpha: 15.0, ..settings }.mean_weight(&samples), 128.5);
        let linear = LossSettings { weight: WeightForm::Linear { gain: 10.0 }, ..settings };
        assert_eq!(linear.weight_of_squared_error(0.5), 6.0);
    }
}
