//! One training: steps, validation, and which weights are kept.

use crate::dataset::{Dataset, Sample};
use crate::fit::batch_sampler::BatchSampler;
use crate::fit::report::{CurvePoint, FitProgress, FitReport, Validation};
use crate::fit::settings::{FitSettings, KeepWeights};
use crate::loss::{self, BatchLoss, LossParts, LossSettings};
use crate::network::{
    DeviceChoice, DropoutFactors, InferenceSettings, LookAheadNet, OUTPUTS, Predictor, Weights, occupied_tensor,
};
use burn::optim::GradientsParams;
use burn::tensor::{Device, Tensor, TensorData};
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

/// Why a training cannot start, or go on.
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
    /// A batch without samples.
    #[error("a batch of 0 samples: it must be positive")]
    EmptyBatch,
    /// Arithmetic that ran out of numbers.
    #[error("step {step}: {what} is no finite number; lower the learning rate or the gains of the loss")]
    NotFinite {
        /// The step, from 1.
        step: u32,
        /// The loss or the weights.
        what: &'static str,
    },
    /// A learning rate that burn does not accept.
    #[error("learning rate: {problem}")]
    LearningRate {
        /// What is wrong.
        problem: String,
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
/// If there is nothing to train on, the learning rate is impossible, or the loss or a weight is no finite number.
pub fn fit(
    start: Weights,
    dataset: &Dataset,
    settings: &FitSettings,
    context: FitContext,
    progress: &mut dyn FnMut(&FitProgress) -> ControlFlow<()>,
) -> Result<FitOutcome, FitError> {
    if settings.batch == 0 {
        return Err(FitError::EmptyBatch);
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

    let architecture = start.architecture();
    let device = context.device.device().autodiff();
    let mut net = LookAheadNet::from_weights(&start, &device);
    let mut optimizer = settings.adam.optimizer(settings.gradient_norm_max);
    let mut scheduler =
        settings.learning_rate.scheduler(steps).map_err(|problem| FitError::LearningRate { problem })?;
    let mut sampler = BatchSampler::new(&split.training, settings.mirror, context.seed);
    let mut batch = Vec::with_capacity(settings.batch);
    let mut curve = Vec::new();
    let mut since_point = MeanLoss::default();
    let mut best = Best::new(start);
    let mut latest = None;
    let mut done = 0;
    let mut stopped = false;
    while done < steps && !stopped {
        sampler.draw(settings.batch, &mut batch);
        let dropout = DropoutFactors::draw(&architecture, batch.len(), context.seed, u64::from(done), &device);
        let outputs = net.forward(occupied(&batch, &device), Some(dropout));
        let BatchLoss { misfit, log_variance } = batch_loss(&settings.loss, outputs, &batch, &device);
        let (misfit, log_variance) = (misfit.mean(), log_variance.mean());
        let gradients = (misfit.clone() + log_variance.clone()).backward();
        let loss = LossParts::new(misfit.into_scalar(), log_variance.into_scalar());
        if !loss.total.is_finite() {
            return Err(FitError::NotFinite { step: done + 1, what: "the loss" });
        }
        let gradients = GradientsParams::from_grads(gradients, &net);
        let learning_rate = scheduler.step();
        net = optimizer.step(learning_rate.clone(), net, gradients);
        done += 1;
        since_point.add(loss);

        let samples_done = u64::from(done) * settings.batch as u64;
        let learning_rate = learning_rate.base() as f32;
        let now = FitProgress { step: done, steps, samples_done, learning_rate, loss, validation: latest };
        stopped = progress(&now).is_break();
        let is_last = done == steps || stopped;
        if is_last || settings.validate_every > 0 && done % settings.validate_every == 0 {
            let weights = net.to_weights(architecture);
            if !weights.values().iter().all(|value| value.is_finite()) {
                return Err(FitError::NotFinite { step: done, what: "a weight" });
            }
            latest = validate(&weights, &validated);
            curve.push(CurvePoint { step: done, learning_rate, training: since_point.take(), validation: latest });
            best.offer(weights, done, latest, settings.keep);
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

fn occupied(samples: &[Sample], device: &Device) -> Tensor<3, burn::tensor::Bool> {
    occupied_tensor(samples.iter().map(|sample| &sample.grid), samples.len(), device)
}

fn batch_loss(settings: &LossSettings, outputs: Tensor<2>, samples: &[Sample], device: &Device) -> BatchLoss {
    let labels: Vec<f32> = samples.iter().flat_map(|sample| sample.label).collect();
    let weights: Vec<f32> = samples.iter().map(|s| settings.weight_of_squared_error(s.tau_hat)).collect();
    let tensor =
        |values: Vec<f32>, columns| Tensor::<2>::from_data(TensorData::new(values, [samples.len(), columns]), device);
    loss::of_batch(settings, outputs, tensor(labels, 2), tensor(weights, 1))
}

/// Compares the answers to samples with their labels.
pub fn evaluate(weights: &Weights, samples: &[Sample], loss: &LossSettings, context: FitContext) -> Validation {
    let grids: Vec<_> = samples.iter().map(|sample| &sample.grid).collect();
    let outputs = Predictor::new(weights, context.inference, context.device).raw(&grids);
    let squared_error: f64 = outputs
        .iter()
        .zip(samples)
        .flat_map(|(raw, sample)| (0..2).map(|axis| f64::from(sample.label[axis] - raw[axis]).powi(2)))
        .sum();
    let device = DeviceChoice::Cpu.device();
    let mean_loss = |settings: &LossSettings| {
        let raw = TensorData::new(outputs.as_flattened().to_vec(), [samples.len(), OUTPUTS]);
        let loss = batch_loss(settings, Tensor::from_data(raw, &device), samples, &device);
        let values: Vec<f32> = (loss.misfit + loss.log_variance).into_data().try_into_vec().expect("losses are f32");
        let sum: f64 = values.iter().map(|value| f64::from(*value)).sum();
        (sum / values.len().max(1) as f64) as f32
    };
    Validation {
        samples: samples.len(),
        loss: mean_loss(&LossSettings { beta: 0.0, ..*loss }),
        nll: mean_loss(&LossSettings::unweighted()),
        rmse_m: (squared_error / samples.len().max(1) as f64).sqrt() as f32 * context.geometry.side_m,
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
    fn new(weights: Weights) -> Self {
        Self { weights, step: 0, validation: None, offers_since: 0, lowest: f32::INFINITY }
    }

    fn offer(&mut self, weights: Weights, step: u32, found: Option<Validation>, keep: KeepWeights) {
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
            self.weights = weights;
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
        LossParts::new(misfit, log_variance)
    }
}
