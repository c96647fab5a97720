//! Supervised training on a data set. Behaviour cloning is one call; a `DAgger` iteration is another.
//!
//! A batch is cut into a fixed number of shards, each computed by one thread; their gradients are added in order. The
//! result is the same bits for any number of threads.

mod adam;
mod batch_sampler;
mod engine;
mod report;
mod schedule;
mod settings;
mod training;

pub use adam::AdamSettings;
pub use report::{CurvePoint, FitProgress, FitReport, Validation};
pub use schedule::{LearningRate, ScheduleShape};
pub use settings::{Budget, FitSettings, KeepWeights, Mirror};
pub use training::{FitContext, FitError, FitOutcome, evaluate, fit};

#[cfg(test)]
mod tests;
