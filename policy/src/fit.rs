//! Supervised training on a data set. Behaviour cloning is one call; a `DAgger` iteration is another.
//!
//! One loop for every device, of burn's parts: module, autodiff, optimiser, gradient clipping, learning-rate scheduler.
//! On CPUs the result is the same bits for any number of threads.

mod batch_sampler;
mod device;
pub mod learning;
mod optimizer;
mod report;
mod schedule;
mod settings;
mod training;
mod unfinished;

pub use device::DeviceChoice;
pub use optimizer::AdamSettings;
pub use report::{CurvePoint, FitProgress, FitReport, Step, Validation};
pub use schedule::{LearningRate, ScheduleShape};
pub use settings::{Budget, FitSettings, KeepWeights, Mirror, STEPS_MAX, TooLong, VALIDATIONS_MAX};
pub use training::{FitContext, FitError, FitOutcome, evaluate, fit};
pub use unfinished::FILE as UNFINISHED;

#[cfg(test)]
mod tests;
