//! One training: steps, validation, and which weights are kept.

use crate::dataset::{Dataset, Sample};
use crate::fit::adam::Adam;
use crate::fit::batch_sampler::BatchSampler;
use crate::fit::engine::Engine;
use crate::fit::report::{CurvePoint, FitProgress, FitReport, Validation};
use crate::fit::settings::{FitSettings, KeepWeights};
use crate::loss::{self, LossParts, LossSettings};
use crate::network::{DeviceChoice, InferenceSettings, Predictor, Weights};
use sim::seed::RootSeed;
use sim::sensing::GridGeometry;
use std::borrow::Cow;
use std::ops::ControlFlow;

/// Trained weights and the report of their training.
#[derive(Debug, Clone)]
pub struct FitOutcome {
    /// The weights.
    pub weights: Weights,
    /// What the training did.
    pub report: FitReport,
}

/// Why a training cannot start.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FitError {
    /// The data set has no sample to train on.
    #[error("no training sample among {samples} samples: collect more, or hold back less than every {every}th block")]
    NoTrainingSamples {
        /// Samples in the data set.
        samples: usize,
        /// From the split.
        every: usize,
    },
    /// A batch without samples or without shards.
    #[error("batch {batch} and shards {shards}: both must be positive")]
    EmptyBatch {
        /// From the settings.
        batch: usize,
        /// From the settings.
        shards: usize,
    },
}

/// What a training needs besides weights, data and settings.
#[derive(Debug, Clone, Copy)]
pub struct FitContext {
    /// Patch of ground of the grids; errors in metres depend on it.
    pub geometry: GridGeometry,
    /// How the network will be used: validation does the same.
    pub inference: InferenceSettings,
    /// Where the network is computed.
    pub device: DeviceChoice,
    /// Root of the order of samples, mirroring and dropout.
    pub seed: RootSeed,
}

/// Trains `start` on a data set. `progress` is called after every step and may stop it.
///
/// # Errors
/// If there is nothing to train on.
pub fn fit(
    start: Weights,
    dataset: &Dataset,
    settings: &FitSettings,
    context: FitContext,
    progress: &mut dyn FnMut(&FitProgress) -> ControlFlow<()>,
) -> Result<FitOutcome, FitError> {
    if settings.batch == 0 || settings.shards == 0 {
        return Err(FitError::EmptyBatch { batch: settings.batch, shards: settings.shards });
    }
    let split = dataset.split(settings.validation);
    if split.training.is_empty() {
        return Err(FitError::NoTrainingSamples { samples: dataset.len(), every: settings.validation.every });
    }
    let steps = settings.steps(split.training.len());
    let validated = thinned(&split.validation, settings.validate_on_max);
    let validate = |weights: &Weights, samples: &[Sample]| {
        (!samples.is_empty()).then(|| evaluate(weights, samples, &settings.loss, context))
    };

    let mut weights = start;
    let mut adam = Adam::new(settings.adam, weights.values().len());
    let mut engine = Engine::new(weights.architecture(), settings.shards, context.device);
    let mut sampler = BatchSampler::new(&split.training, settings.mirror, context.seed);
    let mut batch = Vec::with_capacity(settings.batch);
    let mut curve = Vec::new();
    let mut since_point = MeanLoss::default();
    let mut best = Best::new(&weights);
    let mut latest = None;
    let mut done = 0;
    let mut stopped = false;
    while done < steps && !stopped {
        sampler.draw(settings.batch, &mut batch);
        let loss = engine.gradient(&weights, &batch, &settings.loss, context.seed, done);
        assert!(loss.total.is_finite(), "the loss became {loss:?} in step {done}: lower the learning rate");
        let norm = engine.reduce();
        let scale = match settings.gradient_norm_max {
            0.0 => 1.0,
            max => (max / norm.max(f32::MIN_POSITIVE)).min(1.0),
        };
        let learning_rate = settings.learning_rate.at(done, steps);
        adam.step(learning_rate, weights.values_mut(), engine.reduced(), scale);
        done += 1;
        since_point.add(loss);

        let samples_done = u64::from(done) * settings.batch as u64;
        let now = FitProgress { step: done, steps, samples_done, learning_rate, loss, validation: latest };
        stopped = progress(&now).is_break();
        let is_last = done == steps || stopped;
        if is_last || settings.validate_every > 0 && done % settings.validate_every == 0 {
            latest = validate(&weights, &validated);
            curve.push(CurvePoint { step: done, training: since_point.take(), validation: latest });
            best.offer(&weights, done, latest, settings.keep);
            if settings.patience > 0 && best.offers_since >= settings.patience {
                break;
            }
        }
    }
    let is_validated_on_all = validated.len() == split.validation.len();
    let validation = if is_validated_on_all { best.validation } else { validate(&best.weights, &split.validation) };
    let report = FitReport {
        training_samples: split.training.len(),
        validation_samples: split.validation.len(),
        steps: done,
        kept_step: best.step,
        stopped,
        validation,
        curve,
    };
    Ok(FitOutcome { weights: best.weights, report })
}

/// At most so many of the samples, evenly spread; 0 = all.
fn thinned(samples: &[Sample], at_most: usize) -> Cow<'_, [Sample]> {
    if at_most == 0 || at_most >= samples.len() {
        return Cow::Borrowed(samples);
    }
    Cow::Owned((0..at_most).map(|i| samples[i * samples.len() / at_most]).collect())
}

/// Compares the answers to samples with their labels.
pub fn evaluate(weights: &Weights, samples: &[Sample], loss: &LossSettings, context: FitContext) -> Validation {
    let grids: Vec<_> = samples.iter().map(|sample| &sample.grid).collect();
    let outputs = Predictor::new(weights.clone(), context.inference, context.device).raw(&grids);
    let as_trained = LossSettings { beta: 0.0, ..*loss };
    let (mut total, mut nll, mut squared_error) = (0.0, 0.0, 0.0);
    for (raw, sample) in outputs.into_iter().zip(samples) {
        total += f64::from(loss::of_sample(&as_trained, raw, sample.label, sample.tau_hat).parts.total);
        let plain = loss::of_sample(&LossSettings::unweighted(), raw, sample.label, 0.0);
        nll += f64::from(plain.parts.total);
        squared_error += f64::from(plain.squared_error);
    }
    let n = samples.len().max(1) as f64;
    Validation {
        samples: samples.len(),
        loss: (total / n) as f32,
        nll: (nll / n) as f32,
        rmse_m: (squared_error / n).sqrt() as f32 * context.geometry.side_m,
    }
}

/// The weights to return.
struct Best {
    weights: Weights,
    step: u32,
    validation: Option<Validation>,
    /// Validations since the last new best.
    offers_since: u32,
    lowest: f32,
}

impl Best {
    fn new(weights: &Weights) -> Self {
        Self { weights: weights.clone(), step: 0, validation: None, offers_since: 0, lowest: f32::INFINITY }
    }

    fn offer(&mut self, weights: &Weights, step: u32, found: Option<Validation>, keep: KeepWeights) {
        let is_lowest = found.is_some_and(|found| found.loss < self.lowest);
        if let Some(found) = found {
            self.lowest = self.lowest.min(found.loss);
            self.offers_since = if is_lowest { 0 } else { self.offers_since + 1 };
        }
        let is_kept = match (keep, found) {
            (KeepWeights::Last, _) | (KeepWeights::BestByValidation, None) => true,
            (KeepWeights::BestByValidation, Some(_)) => is_lowest,
        };
        if is_kept {
            self.weights.values_mut().copy_from_slice(weights.values());
            self.step = step;
            self.validation = found;
        }
    }
}

/// Mean of the losses of several steps.
#[derive(Default)]
struct MeanLoss {
    sum: [f64; 2],
    count: u32,
}

impl MeanLoss {
    fn add(&mut self, loss: LossParts) {
        self.sum[0] += f64::from(loss.misfit);
        self.sum[1] += f64::from(loss.log_variance);
        self.count += 1;
    }

    fn take(&mut self) -> LossParts {
        let Self { sum, count } = std::mem::take(self);
        let [misfit, log_variance] = sum.map(|sum| (sum / f64::from(count.max(1))) as f32);
        LossParts { misfit, log_variance, total: misfit + log_variance }
    }
}
