//! Training learns, repeats, stops, and does not care about threads.

use super::*;
use crate::dataset::{Dataset, Sample, ValidationSplit};
use crate::fit::batch_sampler::BatchSampler;
use crate::loss::LossSettings;
use crate::network::{ConvLayer, InferenceSettings, NetworkArchitecture, Predictor, Weights};
use crate::test_data::{round, scratch};
use sim::seed::RootSeed;
use sim::sensing::GridGeometry;
use std::ops::ControlFlow;

fn tiny() -> NetworkArchitecture {
    NetworkArchitecture {
        conv1: ConvLayer { channels: 16, kernel: 3 },
        conv2: ConvLayer { channels: 16, kernel: 2 },
        residual1: 1,
        residual2: 1,
        hidden: 40,
        modes: 1,
        dropout_features: 0.1,
        dropout_hidden: 0.2,
    }
}

fn dataset(samples: usize) -> Dataset {
    let mut dataset = Dataset::default();
    dataset.push(round(samples));
    dataset
}

fn settings(steps: u32) -> FitSettings {
    FitSettings {
        batch: 33, // two chunks and a part of one
        validation: ValidationSplit { block: 20, every: 5 },
        validate_every: 20,
        patience: 0,
        ..FitSettings::quick(steps)
    }
}

fn train(dataset: &Dataset, settings: &FitSettings, device: DeviceChoice) -> FitOutcome {
    let start = Weights::init(tiny(), RootSeed(1), 0);
    let mut progress = |_: &FitProgress| ControlFlow::Continue(());
    fit(&start, dataset, settings, context(device), None, &mut progress).unwrap()
}

fn context(device: DeviceChoice) -> FitContext {
    FitContext { geometry: GridGeometry::paper(), inference: InferenceSettings::plain(), device, seed: RootSeed(2) }
}

#[test]
fn a_readable_rule_is_learned() {
    let dataset = dataset(1500);
    let start = Weights::init(tiny(), RootSeed(1), 0);
    let held_back = dataset.split(settings(1).validation).validation;
    let before = evaluate(&start, &held_back, &LossSettings::paper(), context(DeviceChoice::Cpu));
    let outcome = train(&dataset, &settings(400), DeviceChoice::Cpu);
    let after = outcome.report.validation.unwrap();
    assert!(after.rmse_m < 0.4 * before.rmse_m, "{before:?} {:?}", outcome.report);
    assert!(after.nll < before.nll - 0.5, "{before:?} {:?}", outcome.report);
    assert_eq!(outcome.report.curve.len(), 20);
}

/// Labels to the left and to the right of a tree, whatever the grid: one Gaussian answers with their mean.
#[test]
fn two_modes_learn_two_ways() {
    let samples: Vec<Sample> = (round(600).samples.iter().enumerate())
        .map(|(index, sample)| Sample { label: [if index % 2 == 0 { 0.3 } else { 0.7 }, 0.4], tau_hat: 0.0, ..*sample })
        .collect();
    let grids: Vec<_> = samples.iter().map(|sample| sample.grid).collect();
    let mut dataset = Dataset::default();
    dataset.push(samples.into());
    let from_the_mean = |modes| {
        let start = Weights::init(NetworkArchitecture { modes, ..tiny() }, RootSeed(1), 0);
        let mut progress = |_: &FitProgress| ControlFlow::Continue(());
        let fitted = fit(&start, &dataset, &settings(200), context(DeviceChoice::Cpu), None, &mut progress).unwrap();
        let predictor = Predictor::new(&fitted.weights, InferenceSettings::plain());
        let answers = predictor.predict(&grids.iter().collect::<Vec<_>>());
        answers.iter().map(|answer| (answer.mean[0] - 0.5).abs()).sum::<f32>() / answers.len() as f32
    };
    let [one, two] = [1, 2].map(from_the_mean);
    assert!(one < 0.08 && two > 0.15, "{one} {two}");
}

#[test]
fn one_two_and_eight_threads_learn_the_same_bits() {
    let dataset = dataset(200);
    let with_threads = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| train(&dataset, &settings(15), DeviceChoice::Cpu).weights)
    };
    let one = with_threads(1);
    assert_eq!(one.values(), with_threads(2).values());
    assert_eq!(one.values(), with_threads(8).values());
    assert_ne!(one, Weights::init(tiny(), RootSeed(1), 0));
}

#[test]
fn a_stop_keeps_what_was_learned() {
    let dataset = dataset(200);
    let start = Weights::init(tiny(), RootSeed(1), 0);
    let mut seen = Vec::new();
    let mut progress = |now: &FitProgress| {
        seen.push((now.step, now.samples_done));
        if now.step == 7 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let outcome = fit(&start, &dataset, &settings(50), context(DeviceChoice::Cpu), None, &mut progress).unwrap();
    assert!(outcome.report.stopped);
    assert_eq!((outcome.report.steps, outcome.report.kept_step), (7, 7));
    assert_eq!(seen.last(), Some(&(7, 7 * 33)));
}

/// Killed and continued at any step, before and after validations: the same bits as at once.
#[test]
fn an_interrupted_training_goes_on_to_the_same_bits() {
    let dataset = dataset(400);
    let settings = FitSettings { gradient_norm_max: 0.5, ..settings(70) };
    let whole = train(&dataset, &settings, DeviceChoice::Cpu);
    let path = scratch("unfinished");
    for stops in [&[1][..], &[19, 20, 21], &[33, 69]] {
        let mut stops = stops.to_vec();
        let outcome = loop {
            let stop = if stops.is_empty() { 0 } else { stops.remove(0) };
            let mut progress = |now: &FitProgress| {
                if now.step == stop { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
            };
            let start = Weights::init(tiny(), RootSeed(1), 0);
            let outcome =
                fit(&start, &dataset, &settings, context(DeviceChoice::Cpu), Some(&path), &mut progress).unwrap();
            if !outcome.report.stopped {
                break outcome;
            }
        };
        assert_eq!(outcome.weights, whole.weights);
        assert_eq!(outcome.report, whole.report);
        assert_eq!(outcome.steps, whole.steps);
        std::fs::remove_file(&path).unwrap();
    }
}

/// It was thrown away: a training stopped, with nothing left to do and nothing on disk.
#[test]
fn a_stop_at_the_last_step_comes_after_the_training() {
    let (dataset, path) = (dataset(200), scratch("last-step"));
    let mut stop = |now: &FitProgress| if now.step == 9 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) };
    let start = Weights::init(tiny(), RootSeed(1), 0);
    let outcome = fit(&start, &dataset, &settings(9), context(DeviceChoice::Cpu), Some(&path), &mut stop).unwrap();
    assert_eq!((outcome.report.stopped, outcome.report.steps, path.exists()), (false, 9, false));
}

/// Trained on, it would be another network under the same name.
#[test]
fn a_damaged_state_of_a_training_is_refused() {
    let (dataset, path) = (dataset(200), scratch("damaged-state"));
    let mut stop = |_: &FitProgress| ControlFlow::Break(());
    let mut train = || {
        let start = Weights::init(tiny(), RootSeed(1), 0);
        fit(&start, &dataset, &settings(9), context(DeviceChoice::Cpu), Some(&path), &mut stop)
    };
    train().unwrap();
    let mut bytes = std::fs::read(&path).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    std::fs::write(&path, bytes).unwrap();
    let error = train().unwrap_err().to_string();
    assert!(error.contains("damaged-state") && error.contains("SHA-256"), "{error}");
    std::fs::remove_file(path).unwrap();
}

/// It was continued: a network of two trainings under the name of one. Of other grids with the same labels, and for a network
/// that is used otherwise, it still was when settings and labels were compared.
#[test]
fn a_state_that_another_training_left_is_refused() {
    let path = scratch("state-of-another");
    let mut stop = |_: &FitProgress| ControlFlow::Break(());
    let mut train = |dataset: &Dataset, settings: &FitSettings, context: FitContext| {
        let start = Weights::init(tiny(), RootSeed(1), 0);
        fit(&start, dataset, settings, context, Some(&path), &mut stop).map(|outcome| outcome.report.steps)
    };
    let (own, own_settings, own_context) = (dataset(200), settings(9), context(DeviceChoice::Cpu));
    // The same labels, and another grid of one sample, as another noise gives it.
    let with_another_grid = |sample: usize| {
        let mut round = round(200);
        round.samples[sample].grid = round.samples[sample].grid.mirrored();
        let mut dataset = Dataset::default();
        dataset.push(round);
        dataset
    };
    let other_settings = FitSettings { gradient_norm_max: 0.5, ..settings(9) };
    let other_seed = FitContext { seed: RootSeed(3), ..own_context };
    let other_inference = FitContext { inference: InferenceSettings::smoothed(), ..own_context };
    assert_eq!(train(&own, &own_settings, own_context), Ok(1));
    for refused in [
        train(&own, &own_settings, other_seed),
        train(&own, &own_settings, other_inference),
        train(&own, &other_settings, own_context),
        train(&dataset(240), &own_settings, own_context),
        train(&with_another_grid(0), &own_settings, own_context),
        // Held back: validated on.
        train(&with_another_grid(199), &own_settings, own_context),
    ] {
        let error = refused.unwrap_err().to_string();
        assert!(error.contains("of another training") && error.contains("delete it"), "{error}");
    }
    assert_eq!(train(&own, &own_settings, own_context), Ok(2), "its own goes on");
    std::fs::remove_file(path).unwrap();
}

/// While training, a few samples are validated on; the report is on all of them.
#[test]
fn the_weights_returned_are_validated_on_everything_held_back() {
    let dataset = dataset(400);
    let settings = FitSettings { validate_on_max: 7, ..settings(40) };
    let outcome = train(&dataset, &settings, DeviceChoice::Cpu);
    assert!(outcome.report.curve.iter().all(|point| point.validation.unwrap().samples == 7));
    let held_back = dataset.split(settings.validation).validation;
    let all = evaluate(&outcome.weights, &held_back, &settings.loss, context(DeviceChoice::Cpu));
    assert_eq!(outcome.report.validation, Some(all));
}

/// It was that of answers outside the image, where nobody drives.
#[test]
fn the_error_is_that_of_what_is_driven_at() {
    let mut weights = Weights::zeros(tiny());
    // What it answers to every grid: half the image beyond a corner.
    weights.parts_mut().fc2_bias.copy_from_slice(&[1.5, -0.5, -4.6, -4.6]);
    let at_the_corner = |sample: &Sample| Sample { label: [1.0, 0.0], tau_hat: 0.0, ..*sample };
    let samples: Vec<Sample> = round(3).samples.iter().map(at_the_corner).collect();
    let found = evaluate(&weights, &samples, &LossSettings::paper(), context(DeviceChoice::Cpu));
    assert_eq!(found.rmse_m, 0.0);
    // ½ (0.5² / σ² + log σ²), log σ² = −4.6: the loss is of the answer itself.
    assert!((found.nll - 10.136).abs() < 1e-2, "{found:?}");
}

#[test]
fn the_best_weights_are_those_reported() {
    let dataset = dataset(400);
    let settings = settings(120);
    let outcome = train(&dataset, &settings, DeviceChoice::Cpu);
    let best = outcome.report.curve.iter().map(|point| point.validation.unwrap().loss).fold(f32::INFINITY, f32::min);
    let held_back = dataset.split(settings.validation).validation;
    let again = evaluate(&outcome.weights, &held_back, &settings.loss, context(DeviceChoice::Cpu));
    assert_eq!(outcome.report.validation, Some(again));
    assert_eq!(again.loss, best);
}

#[test]
fn nothing_to_learn_from_is_an_error() {
    let start = Weights::init(tiny(), RootSeed(1), 0);
    let mut progress = |_: &FitProgress| ControlFlow::Continue(());
    let empty = Dataset::default();
    let error = fit(&start, &empty, &settings(1), context(DeviceChoice::Cpu), None, &mut progress);
    assert!(matches!(error, Err(FitError::NoTrainingSamples { samples: 0, .. })));
}

#[test]
fn every_sample_is_drawn_once_per_epoch() {
    let samples = round(50).samples;
    let mut sampler = BatchSampler::new(&samples, Mirror::Off, RootSeed(4));
    let (mut first, mut second) = (Vec::new(), Vec::new());
    sampler.draw(50, &mut first);
    sampler.draw(50, &mut second);
    assert_ne!(first, second, "a new order per epoch");
    let keys = |drawn: &[Sample]| {
        let mut keys: Vec<_> = drawn.iter().map(|sample| sample.label.map(f32::to_bits)).collect();
        keys.sort_unstable();
        keys
    };
    assert_eq!(keys(&first), keys(&samples));
    assert_eq!(keys(&second), keys(&samples));
}

#[test]
fn patience_ends_a_training_that_no_longer_improves() {
    let dataset = dataset(400);
    let hasty = FitSettings { learning_rate: LearningRate::constant(3e-3), patience: 2, ..settings(2000) };
    let report = train(&dataset, &hasty, DeviceChoice::Cpu).report;
    assert!(!report.stopped && report.steps < 2000, "{} steps", report.steps);
    // The best, then two validations that are not better.
    assert_eq!(report.kept_step + 2 * hasty.validate_every, report.steps);
}

/// The same loop on the plain operations of a GPU. `.ci/gpu` runs it on a software Vulkan.
#[cfg(feature = "wgpu")]
#[test]
fn a_gpu_learns_as_a_cpu_does() {
    let dataset = dataset(200);
    let (cpu, gpu) = (
        train(&dataset, &settings(20), DeviceChoice::Cpu).report,
        train(&dataset, &settings(20), DeviceChoice::Wgpu).report,
    );
    let (cpu, gpu) = (cpu.curve[0], gpu.curve[0]);
    assert!((cpu.training.total - gpu.training.total).abs() < 1e-3, "{cpu:?} {gpu:?}");
    assert!((cpu.validation.unwrap().rmse_m - gpu.validation.unwrap().rmse_m).abs() < 1e-3, "{cpu:?} {gpu:?}");
}

/// This was a panic that did not name the round.
#[test]
fn a_loss_that_is_no_number_ends_the_training_with_its_step() {
    let mut round = round(200);
    round.samples[0].label[0] = f32::NAN;
    let mut dataset = Dataset::default();
    dataset.push(round);
    let start = Weights::init(tiny(), RootSeed(1), 0);
    let mut progress = |_: &FitProgress| ControlFlow::Continue(());
    let settings = FitSettings { batch: 200, ..settings(3) };
    let error = fit(&start, &dataset, &settings, context(DeviceChoice::Cpu), None, &mut progress).unwrap_err();
    assert_eq!(error, FitError::NotFinite { step: 1, what: "the loss" });
}

/// By the loss weights are chosen, by the likelihood trainings with and without the weight are compared; β is of neither.
#[test]
fn the_validation_loss_weighs_known_mistakes_and_the_likelihood_does_not() {
    let mut weights = Weights::zeros(tiny());
    weights.parts_mut().fc2_bias.copy_from_slice(&[0.5, 0.5, -4.6, -4.6]);
    let beside = |sample: &Sample| Sample { label: [0.6, 0.5], tau_hat: 1.0, ..*sample };
    let samples: Vec<Sample> = round(3).samples.iter().map(beside).collect();
    let loss = LossSettings { beta: 0.5, ..LossSettings::paper() };
    let found = evaluate(&weights, &samples, &loss, context(DeviceChoice::Cpu));
    // log σ² = −4.6, the middle of the clamp, on both axes, e²/σ² = 0.01 · e^4.6 = 0.99484 on one, W = (1 + 1.5)² = 6.25:
    // ¼ (6.25 · 0.99484 − 2 · 4.6) and ¼ (0.99484 − 2 · 4.6).
    assert!((found.loss + 0.745_56).abs() < 1e-4, "{found:?}");
    assert!((found.nll + 2.051_29).abs() < 1e-4, "{found:?}");
    // A tenth of 12 m, on one axis.
    assert!((found.rmse_m - 1.2).abs() < 1e-4, "{found:?}");
}

#[test]
fn epochs_are_passes_over_the_samples_trained_on() {
    let steps = |epochs: f32, samples: usize| {
        let settings = FitSettings { budget: Budget::Epochs(epochs), batch: 128, ..FitSettings::quick(1) };
        settings.steps(samples)
    };
    // 2 · 1000 / 128 = 15.6: the last batch is begun.
    assert_eq!([steps(2.0, 1000), steps(1.0, 128), steps(0.0, 1000)], [16, 1, 0]);
}
