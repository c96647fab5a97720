//! A training as signals: the same entities whether it is going on or finished.

use super::{colours, layout};
use crate::run_dir;
use crate::settings::Settings;
use anyhow::{Context as _, ensure};
use policy::dagger::Collection;
use policy::fit::{FitProgress, FitReport, FitSettings, Validation};
use policy::loss::LossParts;
use protocol::{Clock, Mark, Moments, Shape};
use serde::de::DeserializeOwned;
use std::path::Path;

/// Steps from one point of a live curve to the next: some hundred points per round.
const LIVE_EVERY: u32 = 20;

/// Where a training stands; steps are counted over all rounds.
#[derive(Debug, Clone, Copy, Default)]
pub struct Curve {
    round: i64,
    steps_before: i64,
    step: i64,
}

impl Curve {
    fn clock(&self) -> Clock {
        Clock::Training { step: self.steps_before + self.step, round: self.round }
    }

    /// A round was collected.
    pub fn collected(&mut self, collection: &Collection, dataset: usize) -> (Clock, Vec<Mark>) {
        self.round = i64::from(collection.round);
        self.steps_before += self.step;
        self.step = 0;
        let mut marks = vec![
            signal("rounds/samples/new", collection.samples as f64),
            signal("rounds/samples/dataset", dataset as f64),
            signal(
                "rounds/near_collisions",
                100.0 * f64::from(collection.near_collisions) / collection.driven_m.max(1.0),
            ),
        ];
        if collection.round > 0 {
            marks.push(signal("rounds/eta_hat/eta_hat", collection.eta_hat()));
        }
        (self.clock(), marks)
    }

    /// A training step; `None` for those that are left out.
    pub fn step(&mut self, fit: &FitProgress) -> Option<(Clock, Vec<Mark>)> {
        self.step = i64::from(fit.step);
        if !fit.step.is_multiple_of(LIVE_EVERY) && fit.step != fit.steps {
            return None;
        }
        let mut marks = loss(&fit.loss);
        marks.push(signal("training/learning_rate", f64::from(fit.learning_rate)));
        marks.extend(fit.validation.iter().flat_map(validation));
        Some((self.clock(), marks))
    }

    /// A finished training, point by point.
    fn finished(&mut self, fit: &FitReport, settings: &FitSettings) -> Moments {
        let point = |point: &policy::fit::CurvePoint| {
            self.step = i64::from(point.step);
            let mut marks = loss(&point.training);
            let learning_rate = settings.learning_rate.at(point.step.saturating_sub(1), fit.steps);
            marks.push(signal("training/learning_rate", f64::from(learning_rate)));
            marks.extend(point.validation.iter().flat_map(validation));
            (self.clock(), marks)
        };
        fit.curve.iter().map(point).collect()
    }
}

fn signal(entity: &str, value: f64) -> Mark {
    Mark::new(entity, Shape::Value(value))
}

fn loss(loss: &LossParts) -> Vec<Mark> {
    vec![
        signal("training/loss/misfit", f64::from(loss.misfit)),
        signal("training/loss/log_variance", f64::from(loss.log_variance)),
        signal("training/loss/total", f64::from(loss.total)),
    ]
}

fn validation(validation: &Validation) -> [Mark; 2] {
    [
        signal("training/validation/nll", f64::from(validation.nll)),
        signal("training/validation_error/rmse", f64::from(validation.rmse_m)),
    ]
}

/// Names and colours.
pub fn always() -> Vec<Mark> {
    let line = |entity: &str, name: &str, colour, dotted| {
        Mark::new(entity, Shape::Signal { name: name.to_owned(), colour, dotted })
    };
    vec![
        line("training/loss/misfit", "misfit", colours::EXPERT, false),
        line("training/loss/log_variance", "log variance", colours::PATCH, false),
        line("training/loss/total", "training loss, total", colours::RING, false),
        line("training/validation/nll", "validation, negative log-likelihood", colours::NOVICE, false),
        line("training/validation_error/rmse", "validation error, m", colours::NOVICE, false),
        line("training/learning_rate", "learning rate", colours::PLANNER, false),
        line("rounds/eta_hat/eta_hat", "η̂: share the network drove", colours::NOVICE, true),
        line("rounds/samples/new", "new in this round", colours::EXPERT, true),
        line("rounds/samples/dataset", "in the data set", colours::FAINT, true),
        line("rounds/near_collisions", "near-collisions per 100 m", colours::FAILURE, true),
    ]
}

/// Everything that a run's folder holds, as the moments of a recording, with its tables.
///
/// # Errors
/// If there is no run, or a file of it is not what it should be.
pub fn read(run: &Path) -> anyhow::Result<(Vec<Mark>, Moments)> {
    let settings: Settings = run_dir::settings_of(run)?;
    let mut curve = Curve::default();
    let (mut moments, mut dataset) = (Vec::new(), 0);
    for round in 0_u32.. {
        let folder = run.join(format!("round-{round:02}"));
        if !folder.join("round.toml").is_file() {
            break;
        }
        let collection: Collection = toml_of(&folder.join("round.toml"))?;
        dataset += collection.samples;
        moments.push(curve.collected(&collection, dataset));
        let fit = folder.join("fit.toml");
        if fit.is_file() {
            let of_round = if round == 0 { &settings.dagger.fit_cloning } else { &settings.dagger.fit_iteration };
            moments.extend(curve.finished(&toml_of(&fit)?, of_round));
        }
    }
    ensure!(
        !moments.is_empty(),
        "{}: no round is finished there; runs of train-bc and train-dagger have rounds",
        run.display()
    );
    let mut marks = always();
    for (entity, name) in layout::TABLES {
        let text = std::fs::read_to_string(run.join(name)).unwrap_or_else(|_| format!("This run has no `{name}` yet."));
        marks.push(Mark::new(entity, Shape::Document(text)));
    }
    Ok((marks, moments))
}

fn toml_of<T: DeserializeOwned>(path: &Path) -> anyhow::Result<T> {
    let text = std::fs::read_to_string(path).with_context(|| path.display().to_string())?;
    toml::from_str(&text).with_context(|| path.display().to_string())
}
