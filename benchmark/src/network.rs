//! The network: answers and training.

use crate::{Effort, Figure, Report, figure, on_threads, time};
use policy::dataset::{Dataset, Round, Sample, ValidationSplit};
use policy::fit::{DeviceChoice, FitContext, FitProgress, FitSettings, KeepWeights, fit};
use policy::network::{InferenceSettings, NetworkArchitecture, Predictor, Weights};
use scenarios::reference::{ReferenceLot, lot};
use sim::episode::EpisodeSettings;
use sim::geometry::Pose;
use sim::map::Map;
use sim::maths;
use sim::scenario::NoiseLevel;
use sim::seed::RootSeed;
use sim::sensing::noise::NoiseSettings;
use sim::sensing::{GridGeometry, OccupancyGrid, Sensor};
use std::hint::black_box;
use std::ops::ControlFlow;

/// The networks that are measured.
fn networks() -> [(&'static str, NetworkArchitecture); 2] {
    // One mode, as what it is compared with (benchmark/peers).
    let compact = NetworkArchitecture { modes: 1, ..NetworkArchitecture::compact() };
    [("compact", compact), ("paper", NetworkArchitecture::paper())]
}

/// Sizes of batches that are answered.
pub const ANSWERED: [usize; 3] = [1, 64, 512];
/// Sizes of batches that are trained on.
pub const TRAINED: [usize; 2] = [128, 512];

/// What a car sees along a reference lot, off the middle of its lane, with noise `paper`.
fn grids(count: usize) -> anyhow::Result<Vec<OccupancyGrid>> {
    let settings = EpisodeSettings::paper();
    let map = Map::build(lot(ReferenceLot::A, RootSeed(1)), &settings.vehicle)?;
    let mut sensor = Sensor::new(&map, settings.sensing, &NoiseSettings::of(NoiseLevel::Paper), RootSeed(1));
    let length_m = map.path().length_m();
    Ok((0..count as u32)
        .map(|tick| {
            let on_path = map.path().pose_at((tick as f32 * 0.37) % length_m);
            let turned = Pose::new(on_path.position(), on_path.heading_rad + 0.2 * maths::sin(tick as f32 * 0.7));
            sensor.observe(&map, turned, tick).grid
        })
        .collect())
}

/// Measures answers: one thread, no mirror averaging.
///
/// # Errors
/// If the reference lot cannot be built.
pub fn answers(effort: Effort, report: Report<'_>) -> anyhow::Result<()> {
    let grids = grids(ANSWERED[2])?;
    for (name, architecture) in networks() {
        let weights = Weights::init(architecture, RootSeed(1), 0);
        let predictor = Predictor::new(&weights, InferenceSettings::plain());
        for batch in ANSWERED {
            let asked: Vec<&OccupancyGrid> = grids[..batch].iter().collect();
            let what = format!("answers, {name} network, batch {batch}, one thread");
            report(on_threads(1, || {
                time(effort, &what, ("µs", 1e-6), None, || {
                    black_box(predictor.raw(&asked));
                })
            }));
        }
    }
    Ok(())
}

/// Measures whole trainings, on two threads if on CPUs: samples per second, by fifths of the training.
///
/// # Errors
/// If the reference lot cannot be built.
pub fn training(effort: Effort, device: DeviceChoice, report: Report<'_>) -> anyhow::Result<()> {
    let samples: Vec<Sample> = grids(20_000)?
        .into_iter()
        .map(|grid| {
            // Something to learn: the middle of what is free in the lower half.
            let free: Vec<usize> = (0..25).filter(|col| !grid.is_occupied(18, *col)).collect();
            let middle = free.iter().sum::<usize>() as f32 / free.len().max(1) as f32;
            Sample { grid, label: [middle / 24.0, 0.4], tau_hat: 0.1 }
        })
        .collect();
    let mut dataset = Dataset::default();
    dataset.push(Round::from(samples));
    for (name, architecture) in networks() {
        for batch in TRAINED {
            report(on_threads(2, || trained(effort, device, (name, architecture), batch, &dataset)));
        }
    }
    Ok(())
}

fn trained(
    effort: Effort,
    device: DeviceChoice,
    (name, architecture): (&str, NetworkArchitecture),
    batch: usize,
    dataset: &Dataset,
) -> Figure {
    let steps = effort.training_steps;
    let settings = FitSettings {
        batch,
        validation: ValidationSplit::none(),
        validate_every: 0,
        keep: KeepWeights::Last,
        ..FitSettings::quick(steps)
    };
    let (geometry, inference, seed) = (GridGeometry::paper(), InferenceSettings::plain(), RootSeed(1));
    let context = FitContext { geometry, inference, device, seed };
    let part = (steps / 5).max(1);
    let (mut rates, mut began) = (Vec::new(), crate::now());
    let mut progress = |now: &FitProgress| {
        if now.step.is_multiple_of(part) {
            rates.push(f64::from(part) * batch as f64 / began.elapsed().as_secs_f64());
            began = crate::now();
        }
        ControlFlow::Continue(())
    };
    fit(&Weights::init(architecture, RootSeed(1), 0), dataset, &settings, context, None, &mut progress)
        .expect("there are samples to train on");
    let place = if device == DeviceChoice::Cpu { "two threads".to_owned() } else { format!("device {device:?}") };
    figure(&format!("training, {name} network, batch {batch}, {steps} steps, {place}"), "samples/s", None, rates)
}
