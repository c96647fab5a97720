//! One training: steps, validation, and which weights are kept.

use crate::dataset::{Dataset, Sample, Split, kept_places};
use crate::files::FileError;
use crate::fit::batch_sampler::BatchSampler;
use crate::fit::device::DeviceChoice;
use crate::fit::report::{CurvePoint, FitProgress, FitReport, Step, Validation};
use crate::fit::settings::{FitSettings, KeepWeights, TooLong};
use crate::fit::unfinished::{self, Unfinished};
use crate::loss::{self, BatchLoss, LossParts, LossSettings};
use crate::network::{
    DropoutFactors, InferenceSettings, LookAheadNet, NetworkArchitecture, Predictor, Weights, occupied_tensor,
};
use burn::lr_scheduler::module_lr_scheduler::ModuleLrScheduler;
use burn::optim::{GradientsParams, ModuleOptimizer};
use burn::tensor::{Bytes, Device, Tensor, TensorData};
use sim::seed::RootSeed;
use sim::sensing::GridGeometry;
use std::borrow::Cow;
use std::ops::ControlFlow;
use std::path::Path;
use std::time::{Duration, Instant};

/// Trained weights and the report of their training.
#[derive(Debug, Clone)]
pub struct FitOutcome {
    /// The weights.
    pub weights: Weights,
    /// What the training did.
    pub report: FitReport,
    /// Every step.
    pub steps: Vec<Step>,
}

/// Why a training cannot start or continue.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FitError {
    /// The data set has no sample to train on.
    #[error("no training sample among {samples} samples: collect more, or hold back less than every {every}th block")]
    NoTrainingSamples {
        /// Samples in the data set.
        samples: usize,
        /// `every` of the split.
        every: usize,
    },
    /// A batch without samples.
    #[error("a batch of 0 samples: it must be positive")]
    EmptyBatch,
    /// More than can be read again.
    #[error(transparent)]
    TooLong(#[from] TooLong),
    /// Arithmetic that left the finite numbers.
    #[error("step {step}: {what} is not a finite number; lower the learning rate or the gains of the loss")]
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
    /// What an interrupted training left cannot be read, or what this one leaves cannot be written.
    #[error(transparent)]
    File(#[from] FileError),
}

/// What a training needs besides weights, data and settings.
#[derive(Debug, Clone, Copy)]
pub struct FitContext {
    /// Patch of ground of the grids; errors in metres depend on it.
    pub geometry: GridGeometry,
    /// How the network will be used: validation does the same, but for the loss of several modes ([`Validation`]).
    pub inference: InferenceSettings,
    /// Where the network is trained.
    pub device: DeviceChoice,
    /// Root of the order of samples, mirroring and dropout.
    pub seed: RootSeed,
}

/// Seconds of training between two copies of its state on disk: what a killed process loses at most.
const KEEP_EVERY_S: u64 = 60;

/// Trains `start` on a data set. `progress` is called after every step and may stop it. An interrupted training is kept
/// in the file `unfinished`, if one is named, and continues from there to the same result; the caller deletes the file
/// when it is no longer needed.
///
/// # Errors
/// If there is nothing to train on or too much, the learning rate is impossible, the loss or a weight is not a finite number,
/// or `unfinished` cannot be read or written, or is of another training.
pub fn fit(
    start: &Weights,
    dataset: &Dataset,
    settings: &FitSettings,
    context: FitContext,
    unfinished: Option<&Path>,
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
    settings.check_length(steps)?;
    let validator = Validator::new(&split.validation, settings, context);
    let mut learner = Learner::new(start, &split.training, settings, context, steps)?;
    let mut course = Course::new(start);
    let origin = || unfinished::origin(start, &split, context.inference, context.seed, settings);
    let mut keeper = unfinished.map(|path| Keeper::new(path, origin()));
    if let Some(Keeper { path, origin, .. }) = &keeper
        && let Some(left) = Unfinished::read(path, origin, start.architecture())?
    {
        learner.restore(&left, path)?;
        course.replay(left, settings.keep);
    }
    let mut stopped = false;
    while course.done() < steps && !stopped && !course.is_out_of_patience(settings) {
        let step;
        (learner, step) = learner.step(course.done())?;
        course.step(step);
        let done = course.done();
        // What was asked for in the last step comes after the training.
        stopped = progress(&course.progress(step, steps, settings.batch)).is_break() && done < steps;
        if done == steps || settings.validate_every > 0 && done.is_multiple_of(settings.validate_every) {
            course.validate(learner.finite_weights(done)?, &validator, settings.keep);
        }
        if let Some(keeper) = &mut keeper
            && (stopped || done < steps && keeper.is_due())
        {
            keeper.keep(&course, &learner)?;
        }
    }
    // Stopped between two validations.
    if course.curve.last().map_or(0, |point| point.step) < course.done() {
        course.validate(learner.weights(), &validator, settings.keep);
    }
    Ok(course.outcome(&split, &validator, stopped))
}

/// Compares networks with the labels that are held back from the training.
struct Validator<'a> {
    held_back: &'a [Sample],
    /// Those of them that are looked at during the training.
    looked_at: Cow<'a, [Sample]>,
    loss: &'a LossSettings,
    context: FitContext,
}

impl<'a> Validator<'a> {
    fn new(held_back: &'a [Sample], settings: &'a FitSettings, context: FitContext) -> Self {
        let looked_at = thinned(held_back, settings.validate_on_max);
        Self { held_back, looked_at, loss: &settings.loss, context }
    }

    /// During the training; `None` if nothing is held back.
    fn validate(&self, weights: &Weights) -> Option<Validation> {
        self.on(weights, &self.looked_at)
    }

    /// Of the weights to return, on all that is held back.
    fn validate_on_all(&self, best: &Best) -> Option<Validation> {
        let was_on_all = self.looked_at.len() == self.held_back.len();
        if was_on_all { best.validation } else { self.on(&best.weights, self.held_back) }
    }

    fn on(&self, weights: &Weights, samples: &[Sample]) -> Option<Validation> {
        (!samples.is_empty()).then(|| evaluate(weights, samples, self.loss, self.context))
    }
}

/// Keeps the state of a training on disk.
struct Keeper<'a> {
    path: &'a Path,
    /// See [`unfinished::origin`].
    origin: String,
    kept_at: Instant,
}

#[expect(clippy::disallowed_methods, reason = "when the state is copied to disk changes no result")]
impl<'a> Keeper<'a> {
    fn new(path: &'a Path, origin: String) -> Self {
        Self { path, origin, kept_at: Instant::now() }
    }

    fn is_due(&self) -> bool {
        self.kept_at.elapsed() >= Duration::from_secs(KEEP_EVERY_S)
    }

    fn keep(&mut self, course: &Course, learner: &Learner<'_>) -> Result<(), FileError> {
        course.keep(&self.origin, learner.weights(), learner.optimizer_state()).write(self.path)?;
        self.kept_at = Instant::now();
        Ok(())
    }
}

/// The network in training, and what trains it.
struct Learner<'a> {
    net: LookAheadNet,
    optimizer: ModuleOptimizer,
    scheduler: ModuleLrScheduler,
    sampler: BatchSampler<'a>,
    batch: Vec<Sample>,
    settings: &'a FitSettings,
    architecture: NetworkArchitecture,
    device: Device,
    seed: RootSeed,
}

impl<'a> Learner<'a> {
    fn new(
        start: &Weights,
        samples: &'a [Sample],
        settings: &'a FitSettings,
        context: FitContext,
        steps: u32,
    ) -> Result<Self, FitError> {
        let device = context.device.device().autodiff();
        let scheduler = settings.learning_rate.scheduler(steps);
        Ok(Self {
            net: LookAheadNet::from_weights(start, &device),
            optimizer: settings.adam.optimizer(settings.gradient_norm_max),
            scheduler: scheduler.map_err(|problem| FitError::LearningRate { problem })?,
            sampler: BatchSampler::new(samples, settings.mirror, context.seed),
            batch: Vec::with_capacity(settings.batch),
            settings,
            architecture: start.architecture(),
            device,
            seed: context.seed,
        })
    }

    /// Puts it where an interrupted training stopped: its weights, its optimiser, and as many draws and rates passed by.
    fn restore(&mut self, left: &Unfinished, path: &Path) -> Result<(), FitError> {
        self.net = LookAheadNet::from_weights(&left.weights, &self.device);
        let optimizer = self.settings.adam.optimizer(self.settings.gradient_norm_max);
        self.optimizer = optimizer
            .from_bytes(Bytes::from_bytes_vec(left.optimizer.clone()))
            .map_err(|error| FileError::new(path, error, unfinished::REMEDY))?;
        for _ in &left.steps {
            self.scheduler.step();
            self.sampler.draw(self.settings.batch, &mut self.batch);
        }
        Ok(())
    }

    /// One step of the optimiser, after `done` others. By value: the optimiser writes into weights that nobody else holds.
    fn step(mut self, done: u32) -> Result<(Self, Step), FitError> {
        self.sampler.draw(self.settings.batch, &mut self.batch);
        let (batch, device, loss) = (&self.batch, &self.device, &self.settings.loss);
        let dropout = DropoutFactors::draw(&self.architecture, batch.len(), self.seed, u64::from(done), device);
        let outputs = self.net.forward(occupied(batch, device), Some(dropout));
        let BatchLoss { misfit, log_variance } = batch_loss(loss, outputs, batch, device);
        let (misfit, log_variance) = (misfit.mean(), log_variance.mean());
        let gradients = (misfit.clone() + log_variance.clone()).backward();
        let loss = LossParts::new(misfit.into_scalar(), log_variance.into_scalar());
        if !loss.total.is_finite() {
            return Err(FitError::NotFinite { step: done + 1, what: "the loss" });
        }
        let gradients = GradientsParams::from_grads(gradients, &self.net);
        let learning_rate = self.scheduler.step();
        let net = self.optimizer.step(learning_rate.clone(), self.net, gradients);
        Ok((Self { net, ..self }, Step { learning_rate: learning_rate.base() as f32, loss }))
    }

    fn weights(&self) -> Weights {
        self.net.to_weights(self.architecture)
    }

    /// The weights after `done` steps, if all of them are finite numbers.
    fn finite_weights(&self, done: u32) -> Result<Weights, FitError> {
        let weights = self.weights();
        let is_finite = weights.values().iter().all(|value| value.is_finite());
        if is_finite { Ok(weights) } else { Err(FitError::NotFinite { step: done, what: "a weight" }) }
    }

    fn optimizer_state(&self) -> Vec<u8> {
        self.optimizer.into_bytes().expect("the state of an optimiser can be serialised").to_vec()
    }
}

/// At most this many of the samples, evenly spread; 0 = all.
fn thinned(samples: &[Sample], at_most: usize) -> Cow<'_, [Sample]> {
    if at_most == 0 || at_most >= samples.len() {
        return Cow::Borrowed(samples);
    }
    Cow::Owned(kept_places(samples.len(), at_most).map(|place| samples[place]).collect())
}

fn occupied(samples: &[Sample], device: &Device) -> Tensor<3, burn::tensor::Bool> {
    occupied_tensor(samples.iter().map(|sample| &sample.grid), device)
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
    let predictor = Predictor::new(weights, context.inference);
    let (answers, outputs) = predictor.raw_and_for_loss(&grids);
    let squared_error: f64 = answers
        .iter()
        .zip(samples)
        // What is driven at: within the image.
        .flat_map(|(raw, sample)| (0..2).map(|axis| f64::from(sample.label[axis] - raw[axis].clamp(0.0, 1.0))))
        .map(|error| error * error)
        .sum();
    let device = Device::flex();
    let mean_loss = |settings: &LossSettings| {
        let raw = TensorData::new(outputs.clone(), [samples.len(), weights.architecture().outputs()]);
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

/// What a training has done so far.
struct Course {
    steps: Vec<Step>,
    curve: Vec<CurvePoint>,
    since_point: MeanLoss,
    best: Best,
}

impl Course {
    fn new(start: &Weights) -> Self {
        let (steps, curve) = (Vec::new(), Vec::new());
        Self { steps, curve, since_point: MeanLoss::default(), best: Best::new(start.clone()) }
    }

    /// Steps done.
    fn done(&self) -> u32 {
        self.steps.len() as u32
    }

    fn latest(&self) -> Option<Validation> {
        self.curve.last().and_then(|point| point.validation)
    }

    fn is_out_of_patience(&self, settings: &FitSettings) -> bool {
        settings.patience > 0 && self.best.offers_since >= settings.patience
    }

    fn step(&mut self, step: Step) {
        self.since_point.add(step.loss);
        self.steps.push(step);
    }

    /// What is told of the step that was done last.
    fn progress(&self, last: Step, steps: u32, batch: usize) -> FitProgress {
        FitProgress {
            step: self.done(),
            steps,
            samples_done: u64::from(self.done()) * batch as u64,
            learning_rate: last.learning_rate,
            loss: last.loss,
            validation: self.latest(),
        }
    }

    /// Looks how good the weights are by now, and whether they are to be kept.
    fn validate(&mut self, weights: Weights, validator: &Validator<'_>, keep: KeepWeights) {
        let validation = validator.validate(&weights);
        let step = self.done();
        let learning_rate = self.steps.last().map_or(0.0, |step| step.learning_rate);
        self.curve.push(CurvePoint { step, learning_rate, training: self.since_point.take(), validation });
        if self.best.offer(step, validation, keep) {
            self.best.weights = weights;
        }
    }

    /// Everything so far, to be written.
    fn keep(&self, origin: &str, weights: Weights, optimizer: Vec<u8>) -> Unfinished {
        let (origin, best) = (origin.to_owned(), self.best.weights.clone());
        Unfinished { origin, weights, best, optimizer, steps: self.steps.clone(), curve: self.curve.clone() }
    }

    /// Goes through everything that was kept once more.
    fn replay(&mut self, left: Unfinished, keep: KeepWeights) {
        let last_point = left.curve.last().map_or(0, |point| point.step);
        for point in &left.curve {
            self.best.offer(point.step, point.validation, keep);
        }
        left.steps.iter().skip(last_point as usize).for_each(|step| self.since_point.add(step.loss));
        self.best.weights = left.best;
        (self.steps, self.curve) = (left.steps, left.curve);
    }

    /// What came of it: the best weights, and how they came about.
    fn outcome(self, split: &Split, validator: &Validator<'_>, stopped: bool) -> FitOutcome {
        let Self { steps, curve, best, .. } = self;
        let report = FitReport {
            training_samples: split.training.len(),
            validation_samples: split.validation.len(),
            mean_weight: Some(validator.loss.mean_weight(&split.training)),
            steps: steps.len() as u32,
            kept_step: best.step,
            stopped,
            validation: validator.validate_on_all(&best),
            curve,
        };
        FitOutcome { weights: best.weights, report, steps }
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

    /// Offers weights with this validation; says whether they are to be kept in place of those here.
    fn offer(&mut self, step: u32, found: Option<Validation>, keep: KeepWeights) -> bool {
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
            self.step = step;
            self.validation = found;
        }
        is_kept
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
