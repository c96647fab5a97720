//! All settings in one TOML file; each section is the settings type of the crate that uses it.
//!
//! Layers, lowest priority first: preset, file, `--set`, flags. The result is complete and checked, and is
//! written into the folder of a run before its first step.

mod check;
mod commented;
mod layers;
mod noise;
mod presets;
pub mod reference;
mod renamed;
mod schema;
mod smoothing;

pub use layers::Layers;
pub use noise::{NOISE_MAX, NoiseChoice};
pub use presets::{PRESETS, has_points_of_paper, with_points_of_paper};
pub use schema::{EvaluationSettings, Settings, TrainingSettings};
pub use smoothing::Smoothing;

#[cfg(test)]
mod tests;
