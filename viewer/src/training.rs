//! A training as signals: its learning curves, and what every round collected.

use crate::colours::{self, Colour};
use crate::layout;
use crate::recording::Recording;
use crate::shapes::color;
use anyhow::ensure;
use experiment::manifest;
use policy::dataset::Collection;
use policy::fit::FitReport;
use rerun::{SeriesLines, SeriesPoints, TextDocument};
use sim::limits::RUN_TEXT_BYTES_MAX;
use std::path::Path;
use storage::sums;

/// Signals of a training: entity, name, colour.
const CURVES: [(&str, &str, Colour); 6] = [
    ("training/loss/misfit", "misfit", colours::EXPERT),
    ("training/loss/log_variance", "log variance", colours::PATCH),
    ("training/loss/total", "training loss, total", colours::RING),
    ("training/validation/nll", "validation, negative log-likelihood", colours::NOVICE),
    ("training/validation_error/rmse", "validation error, m", colours::NOVICE),
    ("training/learning_rate", "learning rate", colours::PLANNER),
];
/// Signals with one point per round.
const ROUNDS: [(&str, &str, Colour); 4] = [
    ("rounds/eta_hat/eta_hat", "η̂: share the network drove", colours::NOVICE),
    ("rounds/samples/new", "new in this round", colours::EXPERT),
    ("rounds/samples/dataset", "in the data set", colours::FAINT),
    ("rounds/near_collisions", "near-collisions per 100 m", colours::FAILURE),
];

/// Shows what the folder of a training holds.
///
/// # Errors
/// If there is no training, or a file of it cannot be read.
pub(crate) fn show(run: &Path, recording: &Recording) -> anyhow::Result<()> {
    for (entity, name, colour) in CURVES {
        let line = SeriesLines::new().with_names([name]).with_colors([color(colour)]).with_widths([1.5]);
        recording.log_static(entity, &line);
    }
    for (entity, name, colour) in ROUNDS {
        let points = SeriesPoints::new().with_names([name]).with_colors([color(colour)]).with_marker_sizes([4.0]);
        recording.log_static(entity, &points);
    }
    let (mut rounds, mut dataset, mut first_step) = (0_u32, 0, 0_i64);
    loop {
        let folder = run.join(format!("round-{rounds:02}"));
        let Some(collection) = Collection::read(&folder)? else { break };
        dataset += collection.samples;
        recording.at_step(first_step, i64::from(rounds));
        collected(&collection, dataset, recording);
        if let Some(fit) = FitReport::read(&folder)? {
            fitted(&fit, first_step, i64::from(rounds), recording);
            first_step += i64::from(fit.steps);
        }
        rounds += 1;
    }
    // The last training, on everything, if there was one.
    if let Some(fit) = FitReport::read(&run.join("final"))? {
        fitted(&fit, first_step, i64::from(rounds), recording);
    }
    ensure!(rounds > 0, "{}: no round is finished there; runs of train-bc and train-dagger have rounds", run.display());
    for (entity, name) in layout::TABLES {
        let read = || sums::read(&run.join(name), RUN_TEXT_BYTES_MAX);
        let table = manifest::has_file(run, name)?.then(read).transpose()?;
        let text = table.map_or_else(
            || format!("This run has no `{name}` yet."),
            |table| String::from_utf8_lossy(&table).into_owned(),
        );
        recording.log_static(entity, &TextDocument::from_markdown(text));
    }
    Ok(())
}

fn collected(collection: &Collection, dataset: usize, recording: &Recording) {
    let value = |entity: &str, value: f64| recording.log_value(entity, value);
    value("rounds/samples/new", collection.samples as f64);
    value("rounds/samples/dataset", dataset as f64);
    value("rounds/near_collisions", 100.0 * f64::from(collection.near_collisions) / collection.driven_m.max(1.0));
    if collection.round > 0 {
        value("rounds/eta_hat/eta_hat", collection.eta_hat());
    }
}

/// A finished fit, point by point.
fn fitted(fit: &FitReport, first_step: i64, round: i64, recording: &Recording) {
    let value = |entity: &str, value: f32| recording.log_value(entity, f64::from(value));
    for point in &fit.curve {
        recording.at_step(first_step + i64::from(point.step), round);
        value("training/loss/misfit", point.training.misfit);
        value("training/loss/log_variance", point.training.log_variance);
        value("training/loss/total", point.training.total);
        value("training/learning_rate", point.learning_rate);
        if let Some(validation) = &point.validation {
            value("training/validation/nll", validation.nll);
            value("training/validation_error/rmse", validation.rmse_m);
        }
    }
}
