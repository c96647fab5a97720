//! A training that is not finished, on disk: everything that its next step depends on.
//!
//! Learning rate, order of samples and dropout are functions of the number of the step; the mean loss since the last
//! validation and the bookkeeping of the best weights follow from the steps and the curve. The rest is here.

use crate::dataset::{Sample, Split};
use crate::files::FileError;
use crate::fit::report::{CurvePoint, Step};
use crate::fit::settings::FitSettings;
use crate::loss::LossParts;
use crate::network::{InferenceSettings, NetworkArchitecture, Weights};
use safetensors::tensor::{Dtype, SafeTensors, TensorView};
use serde::{Deserialize, Serialize};
use sim::seed::RootSeed;
use sim::sensing::GRID_CELLS;
use std::path::Path;
use storage::{sealed, sums};

/// Name of the file in the folder of the round: safetensors after a line with its SHA-256.
pub const FILE: &str = "fit.unfinished";

/// What helps against a file that no training goes on with.
pub(crate) const REMEDY: &str = "delete it to begin this training again";

/// A training after some steps.
pub(crate) struct Unfinished {
    /// [`origin()`] of the training.
    pub(crate) origin: String,
    /// The network.
    pub(crate) weights: Weights,
    /// The best network so far.
    pub(crate) best: Weights,
    /// The state of the optimiser, as burn writes it.
    pub(crate) optimizer: Vec<u8>,
    /// Every step so far.
    pub(crate) steps: Vec<Step>,
    /// Every validation so far.
    pub(crate) curve: Vec<CurvePoint>,
}

/// What is not an array.
#[derive(Serialize, Deserialize)]
struct About {
    origin: String,
    curve: Vec<CurvePoint>,
}

/// SHA-256 of what a training follows from: its first weights, the samples that it learns from and is validated on, how its
/// network is used, its seed and its settings. A file that another training left, copied beside this one, has another.
pub(crate) fn origin(
    start: &Weights,
    split: &Split,
    inference: InferenceSettings,
    seed: RootSeed,
    settings: &FitSettings,
) -> String {
    let of_sample = |sample: &Sample| {
        let Sample { grid, label: [u, w], tau_hat } = sample;
        let mut bytes: Vec<u8> = (0..GRID_CELLS).flat_map(|row| grid.row(row).to_le_bytes()).collect();
        bytes.extend(bytes_of(&[*u, *w, *tau_hat]));
        bytes
    };
    let settings = [toml::to_string(&inference), toml::to_string(settings)]
        .map(|settings| settings.expect("settings are serialised wherever they are kept").into_bytes());
    // Sample by sample: as bytes, all of them are as large again as the data set.
    let samples = split.training.iter().chain(&split.validation).map(of_sample);
    let parts = std::iter::once(bytes_of(start.values())).chain(samples);
    sums::digest_of_parts(parts.chain([seed.0.to_le_bytes().to_vec()]).chain(settings))
}

impl Unfinished {
    pub(crate) fn write(&self, path: &Path) -> Result<(), FileError> {
        let failed =
            |error: &dyn std::fmt::Display| FileError::new(path, error, "report this: it cannot be serialised");
        let about = About { origin: self.origin.clone(), curve: self.curve.clone() };
        let about = toml::to_string(&about).map_err(|error| failed(&error))?;
        let steps: Vec<f32> =
            self.steps.iter().flat_map(|step| [step.learning_rate, step.loss.misfit, step.loss.log_variance]).collect();
        let [weights, best, steps] = [self.weights.values(), self.best.values(), &steps].map(bytes_of);
        let parts: [(&str, Dtype, &[u8]); 5] = [
            ("weights", Dtype::F32, &weights),
            ("best", Dtype::F32, &best),
            ("steps", Dtype::F32, &steps),
            ("optimizer", Dtype::U8, &self.optimizer),
            ("about", Dtype::U8, about.as_bytes()),
        ];
        let tensors = parts.map(|(name, kind, bytes)| {
            let length = if kind == Dtype::F32 { bytes.len() / 4 } else { bytes.len() };
            (name, TensorView::new(kind, vec![length], bytes).expect("lengths fit the bytes"))
        });
        sealed::write(path, &safetensors::serialize(tensors, None).map_err(|error| failed(&error))?)
    }

    /// Reads what an interrupted training of this origin left; `None` if there is nothing.
    pub(crate) fn read(
        path: &Path,
        origin: &str,
        architecture: NetworkArchitecture,
    ) -> Result<Option<Self>, FileError> {
        let Some(bytes) = sealed::read(path)? else { return Ok(None) };
        let failed = |error: &dyn std::fmt::Display| FileError::new(path, error, REMEDY);
        let tensors = SafeTensors::deserialize(&bytes).map_err(|error| failed(&error))?;
        let tensor = |name| tensors.tensor(name).map(|tensor| tensor.data().to_vec()).map_err(|error| failed(&error));
        let floats = |name| Ok::<Vec<f32>, FileError>(floats_of(&tensor(name)?));
        let weights = |name| {
            let (mut weights, values) = (Weights::zeros(architecture), floats(name)?);
            if values.len() != weights.values().len() {
                return Err(failed(&"it is of another network"));
            }
            weights.values_mut().copy_from_slice(&values);
            Ok(weights)
        };
        let about = String::from_utf8(tensor("about")?).map_err(|error| failed(&error))?;
        let about: About = toml::from_str(&about).map_err(|error| failed(&error))?;
        if about.origin != origin {
            return Err(failed(&"it is of another training"));
        }
        let steps = floats("steps")?;
        let steps = steps.as_chunks().0.iter().map(|&[learning_rate, misfit, log_variance]| Step {
            learning_rate,
            loss: LossParts::new(misfit, log_variance),
        });
        Ok(Some(Self {
            origin: about.origin,
            weights: weights("weights")?,
            best: weights("best")?,
            optimizer: tensor("optimizer")?,
            steps: steps.collect(),
            curve: about.curve,
        }))
    }
}

fn bytes_of(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

fn floats_of(bytes: &[u8]) -> Vec<f32> {
    bytes.as_chunks().0.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect()
}
