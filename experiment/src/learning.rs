//! `learning.csv` in the folder of a round: its learning curve, step by step.

use anyhow::Context as _;
use policy::fit::{FitProgress, FitReport};
use policy::loss::LossParts;
use serde::{Deserialize, Serialize};
use sim::limits::RUN_TEXT_BYTES_MAX;
use std::path::Path;

const FILE: &str = "learning.csv";

/// A row: an optimiser step. Where the network was validated, on held-back samples and after the step.
#[derive(Debug, Serialize, Deserialize)]
struct Row {
    step: u32,
    learning_rate: f32,
    loss: f32,
    misfit: f32,
    log_variance: f32,
    validation_loss: Option<f32>,
    validation_nll: Option<f32>,
    validation_rmse_m: Option<f32>,
}

/// The learning curve of one fit.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct LearningCurve {
    /// Short: `BC`, `i = 1`.
    pub name: String,
    /// Optimiser step (counted from 1 in every round) and training loss, nats per sample.
    pub training: Vec<(u32, f64)>,
    /// The same of held-back samples.
    pub validation: Vec<(u32, f64)>,
    /// Error of the point on held-back samples, root mean square, metres.
    pub validation_rmse_m: Vec<(u32, f64)>,
}

/// Collects the steps of one fit.
#[derive(Debug, Default)]
pub struct Recorder {
    steps: Vec<(f32, LossParts)>,
}

impl Recorder {
    /// Adds a step; step 1 starts a new curve.
    pub fn step(&mut self, fit: &FitProgress) {
        if fit.step == 1 {
            self.steps.clear();
        }
        self.steps.push((fit.learning_rate, fit.loss));
    }

    /// Writes `learning.csv` into the folder of the fit. Nothing is written for a fit that was not recorded, such
    /// as one of an earlier command.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write(&mut self, folder: &Path, fit: &FitReport) -> anyhow::Result<()> {
        let steps = std::mem::take(&mut self.steps);
        if steps.len() != fit.steps as usize {
            return Ok(());
        }
        let mut validations = fit.curve.iter().peekable();
        let mut csv = csv::Writer::from_writer(Vec::new());
        for (step, (learning_rate, loss)) in (1..).zip(steps) {
            let validation = validations.next_if(|point| point.step == step).and_then(|point| point.validation);
            csv.serialize(Row {
                step,
                learning_rate,
                loss: loss.total,
                misfit: loss.misfit,
                log_variance: loss.log_variance,
                validation_loss: validation.map(|validation| validation.loss),
                validation_nll: validation.map(|validation| validation.nll),
                validation_rmse_m: validation.map(|validation| validation.rmse_m),
            })?;
        }
        Ok(storage::whole::write(&folder.join(FILE), &csv.into_inner()?)?)
    }
}

/// The learning curve of the fit in a folder; `None` if there is no fit. Runs made before there was a `learning.csv` have
/// means over stretches of steps in `fit.toml`.
///
/// # Errors
/// If a file is not what it should be.
pub fn read(folder: &Path, name: &str) -> anyhow::Result<Option<LearningCurve>> {
    let mut round = LearningCurve { name: name.to_owned(), ..LearningCurve::default() };
    let path = folder.join(FILE);
    if path.is_file() {
        let mut csv = csv::Reader::from_reader(
            storage::read::open(&path, RUN_TEXT_BYTES_MAX).with_context(|| path.display().to_string())?,
        );
        for row in csv.deserialize() {
            let row: Row = row.with_context(|| path.display().to_string())?;
            round.training.push((row.step, f64::from(row.loss)));
            round.validation.extend(row.validation_loss.map(|loss| (row.step, f64::from(loss))));
            round.validation_rmse_m.extend(row.validation_rmse_m.map(|error_m| (row.step, f64::from(error_m))));
        }
        return Ok(Some(round));
    }
    let Some(fit) = report(folder)? else { return Ok(None) };
    for point in &fit.curve {
        round.training.push((point.step, f64::from(point.training.total)));
        round.validation.extend(point.validation.map(|validation| (point.step, f64::from(validation.loss))));
        round.validation_rmse_m.extend(point.validation.map(|at| (point.step, f64::from(at.rmse_m))));
    }
    Ok(Some(round))
}

/// The report of the fit in a folder; `None` if there is none.
///
/// # Errors
/// If the file is not what it should be.
pub fn report(folder: &Path) -> anyhow::Result<Option<FitReport>> {
    Ok(FitReport::read(folder)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use policy::fit::{CurvePoint, Validation};

    fn loss(total: f32) -> LossParts {
        LossParts { misfit: total - 1.0, log_variance: 1.0, total }
    }

    #[test]
    fn a_curve_reads_back_with_validations_at_their_steps() {
        let folder = std::env::temp_dir().join(format!("xtask-test-{}-learning", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let validation = |loss| Some(Validation { samples: 9, loss, nll: loss, rmse_m: 0.5 });
        let fit = FitReport {
            training_samples: 40,
            validation_samples: 9,
            steps: 4,
            kept_step: 4,
            stopped: false,
            validation: validation(1.5),
            curve: [(2, 2.5), (4, 1.5)]
                .map(|(step, at)| CurvePoint {
                    step,
                    learning_rate: 1e-3,
                    training: loss(3.0),
                    validation: validation(at),
                })
                .to_vec(),
        };
        let mut recorder = Recorder::default();
        // An interrupted fit, then the whole one.
        for step in [1, 2, 1, 2, 3, 4] {
            recorder.step(&FitProgress {
                step,
                steps: 4,
                samples_done: 0,
                learning_rate: 1e-3,
                loss: loss(5.0 - step as f32),
                validation: None,
            });
        }
        recorder.write(&folder, &fit).unwrap();
        let round = read(&folder, "BC").unwrap().unwrap();
        assert_eq!(round.training, [(1, 4.0), (2, 3.0), (3, 2.0), (4, 1.0)]);
        assert_eq!(round.validation, [(2, 2.5), (4, 1.5)]);
        // Unwatched: the file stays as it is.
        recorder.write(&folder, &fit).unwrap();
        assert_eq!(read(&folder, "BC").unwrap().unwrap(), round);
        std::fs::remove_dir_all(folder).unwrap();
    }
}
