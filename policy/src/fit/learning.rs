//! `learning.csv` in the folder of a round: its learning curve, step by step.

use crate::files::{FileError, RESTORE_REMEDY, write_atomically};
use crate::fit::report::{FitReport, Step};
use serde::{Deserialize, Serialize};
use sim::limits::RUN_LINES_BYTES_MAX;
use std::io::Read;
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
    /// Optimiser step (counted from 1 in every round) and training loss, nats per sample. Of more than a million steps, means of
    /// 2, 4, 8 … of them, each at its last step.
    pub training: Vec<(u32, f64)>,
    /// The same of held-back samples.
    pub validation: Vec<(u32, f64)>,
    /// Error of the point on held-back samples, root mean square, metres.
    pub validation_rmse_m: Vec<(u32, f64)>,
}

/// Writes `learning.csv`; it is finished when it is listed.
pub(crate) fn write(folder: &Path, steps: &[Step], report: &FitReport) -> Result<(), FileError> {
    let mut validations = report.curve.iter().peekable();
    write_atomically(&folder.join(FILE), |file| {
        let mut rows = csv::Writer::from_writer(file);
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
            rows.serialize(row).map_err(|error| error.to_string())?;
        }
        rows.flush().map_err(|error| error.to_string())
    })
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
    let of_rows = curve_of(sums::open(&path, RUN_LINES_BYTES_MAX)?);
    let curve = of_rows.map_err(|error| match error.kind() {
        csv::ErrorKind::Io(error) => FileError::unreadable(&path, error, RESTORE_REMEDY),
        _ => FileError::new(&path, error, RESTORE_REMEDY),
    })?;
    Ok(Some(LearningCurve { name: name.to_owned(), ..curve }))
}

fn curve_of(file: impl Read) -> csv::Result<LearningCurve> {
    let mut curve = LearningCurve::default();
    let mut training = Thinned::new(POINTS_MAX);
    let mut rows = csv::Reader::from_reader(file);
    // `deserialize` takes a file whose first bytes cannot be read for an empty one.
    rows.headers()?;
    for row in rows.deserialize() {
        let row: Row = row?;
        training.push(row.step, f64::from(row.loss));
        curve.validation.extend(row.validation_loss.map(|loss| (row.step, f64::from(loss))));
        curve.validation_rmse_m.extend(row.validation_rmse_m.map(|error_m| (row.step, f64::from(error_m))));
    }
    curve.training = training.finish();
    Ok(curve)
}

/// Points of a curve that are held, an even number: no picture shows as many.
const POINTS_MAX: usize = 1 << 20;

/// Means of as few steps as leave at most so many points.
struct Thinned {
    points_max: usize,
    points: Vec<(u32, f64)>,
    /// Steps of a point.
    stretch: u32,
    /// Of the point to come: its steps so far, the sum of their values, and the last of them.
    begun: (u32, f64, u32),
}

impl Thinned {
    fn new(points_max: usize) -> Self {
        Self { points_max, points: Vec::new(), stretch: 1, begun: (0, 0.0, 0) }
    }

    fn push(&mut self, step: u32, value: f64) {
        let (count, sum, _) = self.begun;
        self.begun = (count + 1, sum + value, step);
        if self.begun.0 < self.stretch {
            return;
        }
        self.end_point();
        if self.points.len() == self.points_max {
            let pairs = self.points.as_chunks().0.iter();
            self.points = pairs.map(|&[(_, first), (step, second)]| (step, f64::midpoint(first, second))).collect();
            self.stretch *= 2;
        }
    }

    fn end_point(&mut self) {
        let (count, sum, step) = std::mem::take(&mut self.begun);
        self.points.push((step, sum / f64::from(count)));
    }

    fn finish(mut self) -> Vec<(u32, f64)> {
        if self.begun.0 > 0 {
            self.end_point();
        }
        self.points
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::{CurvePoint, Validation};
    use crate::loss::LossParts;
    use crate::test_data::scratch;

    /// Longer curves than can be read back stopped a training at its end.
    #[test]
    fn a_long_curve_is_read_as_means_over_stretches_that_fit() {
        let thinned = |steps: u32| {
            let mut points = Thinned::new(8);
            (1..=steps).for_each(|step| points.push(step, f64::from(step)));
            points.finish()
        };
        assert_eq!(thinned(7), (1..=7).map(|step| (step, f64::from(step))).collect::<Vec<_>>(), "as they are");
        assert_eq!(thinned(8), [(2, 1.5), (4, 3.5), (6, 5.5), (8, 7.5)]);
        assert_eq!(thinned(18), [(4, 2.5), (8, 6.5), (12, 10.5), (16, 14.5), (18, 17.5)]);
        assert_eq!(thinned(1000).len(), 8, "the last stretch of 128 is shorter");
    }

    /// A report was written without the curve, and said nothing.
    #[test]
    fn a_curve_that_a_failing_disk_does_not_give_is_no_empty_one() {
        struct Failing;
        impl Read for Failing {
            fn read(&mut self, _: &mut [u8]) -> std::io::Result<usize> {
                Err(std::io::Error::other("the disk fails"))
            }
        }
        assert!(curve_of(Failing).unwrap_err().to_string().contains("the disk fails"));
    }

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
