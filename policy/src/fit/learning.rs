//! `learning.csv` in the folder of a round: its learning curve, step by step.

use crate::files::{FileError, RESTORE_REMEDY, WRITE_REMEDY, open, write_atomically};
use crate::fit::report::{FitReport, Step};
use serde::{Deserialize, Serialize};
use sim::limits::RUN_TEXT_BYTES_MAX;
use std::path::Path;
use storage::sums;

/// Name of the file.
pub(crate) const FILE: &str = "learning.csv";

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

/// Writes `learning.csv`; it is finished when it is listed.
pub(crate) fn write(folder: &Path, steps: &[Step], report: &FitReport) -> Result<(), FileError> {
    let mut validations = report.curve.iter().peekable();
    let mut rows = csv::Writer::from_writer(Vec::new());
    let path = folder.join(FILE);
    let failed = |error: &dyn std::fmt::Display| FileError::new(&path, error, WRITE_REMEDY);
    for (step, &Step { learning_rate, loss }) in (1..).zip(steps) {
        let validation = validations.next_if(|point| point.step == step).and_then(|point| point.validation);
        let row = Row {
            step,
            learning_rate,
            loss: loss.total,
            misfit: loss.misfit,
            log_variance: loss.log_variance,
            validation_loss: validation.map(|validation| validation.loss),
            validation_nll: validation.map(|validation| validation.nll),
            validation_rmse_m: validation.map(|validation| validation.rmse_m),
        };
        rows.serialize(row).map_err(|error| failed(&error))?;
    }
    let rows = rows.into_inner().map_err(|error| failed(&error))?;
    write_atomically(&path, |file| std::io::Write::write_all(file, &rows).map_err(|error| error.to_string()))
}

/// The learning curve of the fit in a folder; `None` if none is finished there.
///
/// # Errors
/// If the file is missing, damaged or not what it should be.
pub fn read(folder: &Path, name: &str) -> Result<Option<LearningCurve>, FileError> {
    if !sums::is_listed(folder, FILE)? {
        return Ok(None);
    }
    let path = folder.join(FILE);
    let mut curve = LearningCurve { name: name.to_owned(), ..LearningCurve::default() };
    for row in csv::Reader::from_reader(open(&path, RUN_TEXT_BYTES_MAX)?).deserialize() {
        let row: Row = row.map_err(|error| FileError::new(&path, error, RESTORE_REMEDY))?;
        curve.training.push((row.step, f64::from(row.loss)));
        curve.validation.extend(row.validation_loss.map(|loss| (row.step, f64::from(loss))));
        curve.validation_rmse_m.extend(row.validation_rmse_m.map(|error_m| (row.step, f64::from(error_m))));
    }
    Ok(Some(curve))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::{CurvePoint, Validation};
    use crate::loss::LossParts;
    use crate::test_data::scratch;

    #[test]
    fn a_curve_reads_back_with_validations_at_their_steps() {
        let folder = scratch("learning");
        std::fs::create_dir_all(&folder).unwrap();
        let validation = |loss| Some(Validation { samples: 9, loss, nll: loss, rmse_m: 0.5 });
        let point = |(step, at)| CurvePoint {
            step,
            learning_rate: 1e-3,
            training: LossParts::new(2.0, 1.0),
            validation: validation(at),
        };
        let report = FitReport {
            training_samples: 40,
            validation_samples: 9,
            mean_weight: None,
            steps: 4,
            kept_step: 4,
            stopped: false,
            validation: validation(1.5),
            curve: [(2, 2.5), (4, 1.5)].map(point).to_vec(),
        };
        let steps =
            [4.0, 3.0, 2.0, 1.0].map(|total| Step { learning_rate: 1e-3, loss: LossParts::new(total - 1.0, 1.0) });
        write(&folder, &steps, &report).unwrap();
        assert_eq!(read(&folder, "BC").unwrap(), None, "not listed yet");
        sums::list_all(&folder).unwrap();
        let curve = read(&folder, "BC").unwrap().unwrap();
        assert_eq!(curve.training, [(1, 4.0), (2, 3.0), (3, 2.0), (4, 1.0)]);
        assert_eq!(curve.validation, [(2, 2.5), (4, 1.5)]);
        std::fs::remove_dir_all(folder).unwrap();
    }
}
