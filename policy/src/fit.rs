//! Supervised training on a data set. Behaviour cloning is one call; a `DAgger` iteration is another.
//!
//! A batch is cut into a fixed number of shards, each computed by one thread; their gradients are added in order. The
//! result is the same bits for any number of threads.

mod adam;
mod engine;
mod schedule;

pub use adam::AdamSettings;
pub use schedule::{LearningRate, ScheduleShape};

use crate::dataset::{Dataset, Sample, ValidationSplit};
use crate::loss::{self, LossParts, LossSettings};
use crate::network::{DeviceChoice, Predictor, Weights};
use adam::Adam;
use engine::Engine;
use rand::RngExt as _;
use rand::seq::SliceRandom as _;
use serde::{Deserialize, Serialize};
use sim::seed::{RootSeed, Stream};
use sim::sensing::GridGeometry;
use std::borrow::Cow;
use std::ops::ControlFlow;

/// How to train.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FitSettings {
    /// How long.
    pub budget: Budget,
    /// Samples per step.
    pub batch: usize,
    /// Parts a batch is cut into for threads. Part of the result: another number gives other bits.
    pub shards: usize,
    /// Learning rate over time.
    pub learning_rate: LearningRate,
    /// The rest of Adam.
    pub adam: AdamSettings,
    /// A longer gradient is shortened to this norm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gradient_norm_max: Option<f32>,
    /// The loss.
    pub loss: LossSettings,
    /// Whether mirror images are trained on.
    pub mirror: Mirror,
    /// What is held back.
    pub validation: ValidationSplit,
    /// Steps between validations; 0 = only at the end.
    pub validate_every: u32,
    /// Held-back samples looked at while training, spread evenly over all; all of them if not said. The weights that
    /// are returned are validated on all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub validate_on_max: Option<usize>,
    /// Training ends early after this many validations without a new best.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub patience: Option<u32>,
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
    /// Paper, policy network training: Adam 1e-5, batch 512, "100k epochs" read as steps (methods.md 4.2).
    pub fn paper() -> Self {
        Self {
            budget: Budget::Steps(100_000),
            batch: 512,
            shards: 2,
            learning_rate: LearningRate::constant(1e-5),
            adam: AdamSettings::paper(),
            gradient_norm_max: Some(5.0),
            loss: LossSettings::paper(),
            mirror: Mirror::Off,
            validation: ValidationSplit::paper(),
            validate_every: 500,
            validate_on_max: None,
            patience: None,
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
            mirror: Mirror::Half,
            loss: LossSettings { beta: 0.5, ..LossSettings::paper() },
            validate_every: 250,
            // On all of them, validating would take longer than training.
            validate_on_max: Some(8000),
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
}

/// What a step looked like, for bars and logs.
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
    /// The loss as trained, β aside: what "best" is judged by.
    pub loss: f32,
    /// Plain negative log-likelihood: comparable between weighted and unweighted training.
    pub nll: f32,
    /// Root mean square distance between answer and label, metres.
    pub rmse_m: f32,
}

/// One point of the loss curve.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CurvePoint {
    /// After this step.
    pub step: u32,
    /// Mean training loss since the previous point.
    pub training: LossParts,
    /// Validation here.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub validation: Option<Validation>,
}

/// What a training did.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FitReport {
    /// Samples trained on.
    pub training_samples: usize,
    /// Samples held back.
    pub validation_samples: usize,
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

/// Trained weights and how it went.
#[derive(Debug, Clone)]
pub struct FitOutcome {
    /// The weights.
    pub weights: Weights,
    /// How it went.
    pub report: FitReport,
}

/// Why a training cannot start.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FitError {
    /// Nothing to learn from.
    #[error("no training sample among {samples} samples: collect more, or hold back less than every {every}th block")]
    NoTrainingSamples {
        /// Samples in the data set.
        samples: usize,
        /// From the split.
        every: usize,
    },
    /// A batch that cannot be cut.
    #[error("batch {batch} and shards {shards}: both must be positive")]
    EmptyBatch {
        /// From the settings.
        batch: usize,
        /// From the settings.
        shards: usize,
    },
}

/// Trains `start` on a data set. `progress` is called after every step and may stop it.
///
/// # Errors
/// If there is nothing to train on.
pub fn fit(
    start: Weights,
    dataset: &Dataset,
    settings: &FitSettings,
    geometry: GridGeometry,
    device: DeviceChoice,
    seed: RootSeed,
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
    let watched = thinned(&split.validation, settings.validate_on_max);
    let validate = |weights: &Weights, samples: &[Sample]| {
        (!samples.is_empty()).then(|| evaluate(weights, samples, &settings.loss, geometry, device))
    };

    let mut weights = start;
    let mut adam = Adam::new(settings.adam, weights.values().len());
    let mut engine = Engine::new(weights.config(), settings.shards, device);
    let mut deck = BatchSampler::new(&split.training, settings.mirror, seed);
    let mut batch = Vec::with_capacity(settings.batch);
    let mut curve = Vec::new();
    let mut since_point = MeanLoss::default();
    let mut best = Best::new(&weights);
    let mut latest = None;
    let mut done = 0;
    let mut stopped = false;
    while done < steps && !stopped {
        deck.deal(settings.batch, &mut batch);
        let loss = engine.gradient(&weights, &batch, &settings.loss, seed, done);
        assert!(loss.total.is_finite(), "the loss became {loss:?} in step {done}: lower the learning rate");
        let norm = engine.reduce();
        let scale = settings.gradient_norm_max.map_or(1.0, |max| (max / norm.max(f32::MIN_POSITIVE)).min(1.0));
        let learning_rate = settings.learning_rate.at(done, steps);
        adam.step(learning_rate, weights.values_mut(), engine.reduced(), scale);
        done += 1;
        since_point.add(loss);

        let samples_done = u64::from(done) * settings.batch as u64;
        let now = FitProgress { step: done, steps, samples_done, learning_rate, loss, validation: latest };
        stopped = progress(&now).is_break();
        let is_last = done == steps || stopped;
        if is_last || settings.validate_every > 0 && done % settings.validate_every == 0 {
            latest = validate(&weights, &watched);
            curve.push(CurvePoint { step: done, training: since_point.take(), validation: latest });
            best.offer(&weights, done, latest, settings.keep);
            if settings.patience.is_some_and(|patience| best.offers_since >= patience) {
                break;
            }
        }
    }
    let is_validated_on_all = watched.len() == split.validation.len();
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

/// At most so many of the samples, evenly spread.
fn thinned(samples: &[Sample], at_most: Option<usize>) -> Cow<'_, [Sample]> {
    match at_most {
        Some(at_most) if at_most < samples.len() => {
            Cow::Owned((0..at_most).map(|i| samples[i * samples.len() / at_most]).collect())
        }
        _ => Cow::Borrowed(samples),
    }
}

/// Answers samples and compares with their labels.
pub fn evaluate(
    weights: &Weights,
    samples: &[Sample],
    loss: &LossSettings,
    geometry: GridGeometry,
    device: DeviceChoice,
) -> Validation {
    let grids: Vec<_> = samples.iter().map(|sample| &sample.grid).collect();
    let outputs = Predictor::new(weights.clone(), device).raw(&grids);
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
        rmse_m: (squared_error / n).sqrt() as f32 * geometry.side_m,
    }
}

/// Deals samples in a new order each time all have been dealt.
struct BatchSampler<'a> {
    samples: &'a [Sample],
    mirror: Mirror,
    seed: RootSeed,
    order: Vec<u32>,
    next: usize,
    epoch: u64,
    rng: sim::seed::Rng,
}

impl<'a> BatchSampler<'a> {
    fn new(samples: &'a [Sample], mirror: Mirror, seed: RootSeed) -> Self {
        let order: Vec<u32> = (0..samples.len() as u32).collect();
        Self { samples, mirror, seed, next: order.len(), order, epoch: 0, rng: seed.rng(Stream::Shuffle, 0) }
    }

    fn deal(&mut self, count: usize, into: &mut Vec<Sample>) {
        into.clear();
        while into.len() < count {
            if self.next == self.order.len() {
                // A stream of its own per epoch: the order does not depend on how much the last one drew.
                self.rng = self.seed.rng(Stream::Shuffle, self.epoch);
                self.order.shuffle(&mut self.rng);
                self.epoch += 1;
                self.next = 0;
            }
            let sample = &self.samples[self.order[self.next] as usize];
            self.next += 1;
            let is_mirrored = self.mirror == Mirror::Half && self.rng.random::<bool>();
            into.push(if is_mirrored { sample.mirrored() } else { *sample });
        }
    }
}

/// The weights to return.
struct Best {
    weights: Weights,
    step: u32,
    validation: Option<Validation>,
    /// Offers since the last validation that was better than all before.
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

#[cfg(test)]
mod tests;
