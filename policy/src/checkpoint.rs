//! A trained network on disk: `model.safetensors` for the numbers, `model.toml` for everything needed to use them.
//!
//! The tensors are laid out as `PyTorch` has them: convolutions `[out, in, rows, columns]`, dense layers `[out, in]`
//! with inputs in the order channel, row, column (what `flatten(1)` makes of `[batch, channel, row, column]`).

use crate::conditions::Conditions;
use crate::files::{self, FileError, Format, SCHEMA_REMEDY, write_atomically};
use crate::network::{
    ConvLayer, InferenceSettings, LOG_VARIANCE_MAX, LOG_VARIANCE_MIN, NetworkArchitecture, POOLED_2, Predictor,
    RESIDUAL_KERNEL, Weights,
};
use safetensors::tensor::{Dtype, SafeTensors, TensorView};
use serde::{Deserialize, Serialize};
use sim::limits::HEADER_BYTES_MAX;
use sim::sensing::GridGeometry;
use std::io::Write as _;
use std::path::Path;
use storage::sums;

/// A network, the meaning of its numbers, and how it is used.
#[derive(Debug, Clone, PartialEq)]
pub struct Checkpoint {
    /// The network.
    pub weights: Weights,
    /// What it was trained with.
    pub conditions: Conditions,
    /// How it drives.
    pub inference: InferenceSettings,
}

const NUMBERS: &str = "model.safetensors";

/// `model.toml`.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ModelFile {
    input: String,
    output: String,
    log_variance_min: f32,
    log_variance_max: f32,
    conditions: Conditions,
    inference: InferenceSettings,
    network: NetworkArchitecture,
    /// The layers in the order in which they are computed. Follows from `network`; for readers in other languages.
    layers: Vec<Layer>,
}

/// A layer, and what is applied to its output.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Layer {
    name: String,
    kind: LayerKind,
    /// The shape of `NAME.weight`; that of `NAME.bias` is its first number.
    weight_shape: Vec<usize>,
    /// Zeros around the input: cells at the top and at the left, then at the bottom and at the right. Convolutions only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    padding: Option<[usize; 2]>,
    /// Whether what the layer sees is added to its answer, before the activation. Convolutions only.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    residual: bool,
    /// Side and stride of the max-pool that follows. Convolutions only, and of them not the residual ones.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    max_pool: Option<usize>,
    /// Applied last.
    activation: Activation,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum LayerKind {
    Conv2d,
    Linear,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Activation {
    Relu,
    Identity,
}

impl ModelFile {
    /// Refuses what this program would misread.
    fn check(&self, path: &Path) -> Result<(), FileError> {
        if (self.log_variance_min, self.log_variance_max) != (LOG_VARIANCE_MIN, LOG_VARIANCE_MAX) {
            let problem = format!("log-variance bounds [{}, {}]", self.log_variance_min, self.log_variance_max);
            return Err(FileError::new(path, problem, SCHEMA_REMEDY));
        }
        let sound = self.network.validate().and_then(|()| self.inference.validate());
        sound.map_err(|error| FileError::new(path, error, RESTORE))?;
        let expected = layers(&self.network);
        if self.layers.len() != expected.len() {
            let problem = format!("{} layers instead of {}", self.layers.len(), expected.len());
            return Err(FileError::new(path, problem, RESTORE));
        }
        if let Some((found, expected)) = self.layers.iter().zip(&expected).find(|(found, expected)| found != expected) {
            let problem = format!("layer {found:?} is not what its network has: {expected:?}");
            return Err(FileError::new(path, problem, RESTORE));
        }
        Ok(())
    }

    /// The most bytes that the file of the numbers can have.
    fn numbers_bytes_max(&self) -> u64 {
        4 * self.network.parameter_count() as u64 + HEADER_BYTES_MAX
    }

    /// The network with the numbers of a safetensors file.
    fn with_numbers(self, bytes: &[u8], path: &Path) -> Result<Checkpoint, FileError> {
        let tensors = SafeTensors::deserialize(bytes).map_err(|error| FileError::new(path, error, RESTORE))?;
        let mut weights = Weights::zeros(self.network);
        from_pytorch(&mut weights, |name, shape| {
            let tensor = tensors.tensor(name).map_err(|error| {
                FileError::new(path, format!("tensor {name} of shape {shape:?} expected: {error}"), RESTORE)
            })?;
            if tensor.shape() != shape || tensor.dtype() != Dtype::F32 {
                let found = (tensor.dtype(), tensor.shape());
                let problem = format!("tensor {name}: expected F32 {shape:?}, found {:?} {:?}", found.0, found.1);
                return Err(FileError::new(path, problem, RESTORE));
            }
            Ok(tensor.data().as_chunks().0.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect())
        })?;
        if let Some(index) = weights.values().iter().position(|value| !value.is_finite()) {
            return Err(FileError::new(path, format!("value {index} is not finite"), RESTORE));
        }
        Ok(Checkpoint { weights, conditions: self.conditions, inference: self.inference })
    }
}

impl Format for ModelFile {
    const NAME: &'static str = "model.toml";
    /// 1 had `format_version`, and the settings of inference under `network`; 2 had of the conditions only the geometry.
    const SCHEMA: u32 = 3;
}

const INPUT: &str = "grid [batch, 1, 25, 25]: 1 = non-drivable, 0 = drivable; row 0 = far, column 0 = left";
const OUTPUT: &str = "[u, w, raw_u, raw_w]: (u, w) look-ahead point in image fractions, u 0 = left 1 = right, w 0 = far \
                      1 = near, clipped to [0, 1] in use; log sigma^2 = mid + half * tanh((raw - mid) / half) between \
                      log_variance_min and log_variance_max; if inference.mirror_averaging, the mean of the output for \
                      the grid and the output for grid.flip(-1) with 1 - u in place of u; driven at is the exponential \
                      mean over inference.smoothing_ticks of the point's curvature 2 Y / (X^2 + Y^2) and range \
                      (X^2 + Y^2)^0.5";

/// What a row of the network's output is.
fn output_of(modes: usize) -> String {
    if modes == 1 {
        return OUTPUT.to_owned();
    }
    format!(
        "{modes} answers one after another, then the logit of each: the likeliest drives; if inference.mirror_averaging, the \
         likeliest to the grid or to grid.flip(-1), averaged with the nearest to the other. An answer: {OUTPUT}"
    )
}

impl Checkpoint {
    /// Whether a folder holds a finished checkpoint.
    ///
    /// # Errors
    /// If the list of its files is damaged.
    pub fn exists(folder: &Path) -> Result<bool, FileError> {
        sums::is_listed(folder, NUMBERS)
    }

    /// Writes both files into a folder and lists them.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn save(&self, folder: &Path) -> Result<(), FileError> {
        self.write(folder)?;
        sums::list(folder, &Self::FILES)
    }

    /// The names of its files.
    pub(crate) const FILES: [&str; 2] = [ModelFile::NAME, NUMBERS];

    /// Writes both files into a folder. They are finished when they are listed.
    pub(crate) fn write(&self, folder: &Path) -> Result<(), FileError> {
        files::create_folder(folder)?;
        let network = self.weights.architecture();
        let about = ModelFile {
            input: INPUT.to_string(),
            output: output_of(network.modes),
            log_variance_min: LOG_VARIANCE_MIN,
            log_variance_max: LOG_VARIANCE_MAX,
            conditions: self.conditions.clone(),
            inference: self.inference,
            network,
            layers: layers(&network),
        };
        files::write(folder, &about)?;

        let path = folder.join(NUMBERS);
        let tensors = self.tensors();
        let views = tensors.iter().map(|tensor| {
            let view = TensorView::new(Dtype::F32, tensor.shape.clone(), &tensor.bytes).expect("bytes fit the shape");
            (tensor.name.as_str(), view)
        });
        let bytes = safetensors::serialize(views, None)
            .map_err(|error| FileError::new(&path, error, "report this: the weights cannot be serialised"))?;
        write_atomically(&path, |file| file.write_all(&bytes).map_err(|error| error.to_string()))
    }

    /// Reads both files.
    ///
    /// # Errors
    /// If a file is missing, damaged or of another schema, or its tensors are those of another network.
    pub fn load(folder: &Path) -> Result<Self, FileError> {
        let about: ModelFile = files::read(folder)?;
        about.check(&folder.join(ModelFile::NAME))?;
        let path = folder.join(NUMBERS);
        let numbers = sums::read(&path, about.numbers_bytes_max())?;
        about.with_numbers(&numbers, &path)
    }

    /// The same of the contents of both files, for a network that is part of a program. `folder` is what errors call the place
    /// that they come from.
    ///
    /// # Errors
    /// See [`Self::load`].
    pub fn from_contents(model: &str, numbers: &[u8], folder: &Path) -> Result<Self, FileError> {
        let path = folder.join(ModelFile::NAME);
        let about: ModelFile = files::parse(model, &path)?;
        about.check(&path)?;
        about.with_numbers(numbers, &folder.join(NUMBERS))
    }

    /// The patch of ground its grids show and its answers are fractions of.
    pub fn geometry(&self) -> GridGeometry {
        self.conditions.geometry()
    }

    /// The numbers, layer by layer.
    pub fn tensors(&self) -> Vec<Tensor> {
        to_pytorch(&self.weights)
    }

    /// The network ready to answer, without action smoothing.
    pub fn predictor(&self) -> Predictor {
        Predictor::new(&self.weights, self.inference)
    }
}

const RESTORE: &str = "model.safetensors and model.toml belong together: restore both, or train again";

fn layers(architecture: &NetworkArchitecture) -> Vec<Layer> {
    let of_conv = |conv: ConvLayer| {
        let (before, after) = conv.padding();
        Some([before, after])
    };
    let weights = shapes(architecture)
        .into_iter()
        .filter_map(|(name, shape)| Some((name.strip_suffix(".weight")?.to_owned(), shape)));
    weights
        .map(|(name, weight_shape)| {
            let is_residual = name.starts_with("residual");
            let (kind, padding, activation) = match name.as_str() {
                _ if is_residual => (LayerKind::Conv2d, Some([RESIDUAL_KERNEL / 2; 2]), Activation::Relu),
                "conv1" => (LayerKind::Conv2d, of_conv(architecture.conv1), Activation::Relu),
                "conv2" => (LayerKind::Conv2d, of_conv(architecture.conv2), Activation::Relu),
                "fc1" => (LayerKind::Linear, None, Activation::Relu),
                _ => (LayerKind::Linear, None, Activation::Identity),
            };
            let max_pool = padding.filter(|_| !is_residual).map(|_| 2);
            Layer { name, kind, weight_shape, padding, residual: is_residual, max_pool, activation }
        })
        .collect()
}

/// One tensor as it is stored, in the layout of PyTorch.
#[derive(Debug, Clone)]
pub struct Tensor {
    /// `LAYER.weight` or `LAYER.bias`.
    pub name: String,
    /// Its lengths.
    pub shape: Vec<usize>,
    /// float32, little-endian.
    pub bytes: Vec<u8>,
}

/// Names and shapes in the order of [`crate::network::Parts`], residual layers one by one.
fn shapes(architecture: &NetworkArchitecture) -> Vec<(String, Vec<usize>)> {
    let NetworkArchitecture { conv1, conv2, residual1, residual2, hidden, .. } = *architecture;
    let convolution = |name: &str, inputs: usize, conv: ConvLayer| {
        let weight = vec![conv.channels, inputs, conv.kernel, conv.kernel];
        [(format!("{name}.weight"), weight), (format!("{name}.bias"), vec![conv.channels])]
    };
    let dense = |name: &str, inputs: usize, outputs: usize| {
        [(format!("{name}.weight"), vec![outputs, inputs]), (format!("{name}.bias"), vec![outputs])]
    };
    let residual = |stage: &str, layers: usize, channels: usize| -> Vec<_> {
        let conv = ConvLayer { channels, kernel: RESIDUAL_KERNEL };
        (1..=layers).flat_map(|layer| convolution(&format!("{stage}_{layer}"), channels, conv)).collect()
    };
    let mut shapes = Vec::new();
    shapes.extend(convolution("conv1", 1, conv1));
    shapes.extend(residual("residual1", residual1, conv1.channels));
    shapes.extend(convolution("conv2", conv1.channels, conv2));
    shapes.extend(residual("residual2", residual2, conv2.channels));
    shapes.extend(dense("fc1", architecture.features(), hidden));
    shapes.extend(dense("fc2", hidden, architecture.outputs()));
    shapes
}

/// Where a tensor begins among the values of [`Weights`], in the order of [`shapes`]: of residual layers first the weights of all,
/// then their biases.
fn starts(architecture: &NetworkArchitecture) -> Vec<usize> {
    let [conv1, bias1, residual1, residual_bias1, conv2, bias2, residual2, residual_bias2, fc1, fc1_bias, fc2, _] =
        architecture.lengths();
    let mut starts = Vec::new();
    let mut next = 0;
    let mut layers = |count: usize, weights: usize, biases: usize| {
        for layer in 0..count {
            starts.extend([next + layer * weights / count, next + weights + layer * biases / count]);
        }
        next += weights + biases;
    };
    layers(1, conv1, bias1);
    layers(architecture.residual1, residual1, residual_bias1);
    layers(1, conv2, bias2);
    layers(architecture.residual2, residual2, residual_bias2);
    layers(1, fc1, fc1_bias);
    layers(1, fc2, architecture.outputs());
    starts
}

/// Which of the values of a tensor of ours is stored in this place.
fn index_of(architecture: &NetworkArchitecture, name: &str, stored: usize) -> usize {
    match name {
        "fc1.weight" => fc1_index(architecture, stored),
        "fc2.weight" => fc2_index(architecture, stored),
        _ => stored,
    }
}

fn to_pytorch(weights: &Weights) -> Vec<Tensor> {
    let architecture = weights.architecture();
    let shapes = shapes(&architecture).into_iter().zip(starts(&architecture));
    let tensor = |((name, shape), start): ((String, Vec<usize>), usize)| {
        let len: usize = shape.iter().product();
        let values = &weights.values()[start..][..len];
        let bytes = (0..len).flat_map(|stored| values[index_of(&architecture, &name, stored)].to_le_bytes()).collect();
        Tensor { name, shape, bytes }
    };
    shapes.map(tensor).collect()
}

fn from_pytorch<E>(
    weights: &mut Weights,
    mut tensor: impl FnMut(&str, &[usize]) -> Result<Vec<f32>, E>,
) -> Result<(), E> {
    let architecture = weights.architecture();
    for ((name, shape), start) in shapes(&architecture).into_iter().zip(starts(&architecture)) {
        let into = &mut weights.values_mut()[start..];
        for (stored, value) in tensor(&name, &shape)?.into_iter().enumerate() {
            into[index_of(&architecture, &name, stored)] = value;
        }
    }
    Ok(())
}

/// Ours is `[row, column, channel, hidden]`, stored is `[hidden, channel, row, column]`.
fn fc1_index(architecture: &NetworkArchitecture, stored: usize) -> usize {
    let cells = POOLED_2 * POOLED_2;
    let (unit, feature) = (stored / architecture.features(), stored % architecture.features());
    let (channel, cell) = (feature / cells, feature % cells);
    (cell * architecture.conv2.channels + channel) * architecture.hidden + unit
}

/// Ours is `[hidden, output]`, stored is `[output, hidden]`.
fn fc2_index(architecture: &NetworkArchitecture, stored: usize) -> usize {
    stored % architecture.hidden * architecture.outputs() + stored / architecture.hidden
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_data::scratch;
    use sim::episode::EpisodeSettings;
    use sim::seed::RootSeed;
    use std::fs;

    fn checkpoint(architecture: NetworkArchitecture) -> Checkpoint {
        let weights = Weights::init(architecture, RootSeed(1), 0);
        let inference = InferenceSettings { mirror_averaging: true, smoothing_ticks: 3.5 };
        Checkpoint { weights, conditions: Conditions::of(&EpisodeSettings::paper()), inference }
    }

    #[test]
    fn a_checkpoint_reads_back_bit_by_bit() {
        let folder = scratch("checkpoint");
        let saved = checkpoint(NetworkArchitecture::paper());
        assert!(!Checkpoint::exists(&folder).unwrap());
        saved.save(&folder).unwrap();
        assert!(Checkpoint::exists(&folder).unwrap());
        let loaded = Checkpoint::load(&folder).unwrap();
        assert_eq!(loaded.weights.values(), saved.weights.values());
        assert_eq!(loaded, saved);
        fs::remove_dir_all(folder).unwrap();
    }

    /// `fc1.weight[unit, (channel, row, column)]` is the weight from that feature to that unit.
    #[test]
    fn dense_layers_are_stored_in_pytorch_order() {
        let architecture = NetworkArchitecture { hidden: 3, ..NetworkArchitecture::compact() };
        let weights = Weights::init(architecture, RootSeed(2), 0);
        let tensors = to_pytorch(&weights);
        let value =
            |tensor: &Tensor, index: usize| f32::from_le_bytes(*tensor.bytes[4 * index..].first_chunk::<4>().unwrap());
        let named = |name: &str| tensors.iter().find(|tensor| tensor.name == name).unwrap();
        let (unit, channel, row, col) = (2, 17, 4, 1);
        assert_eq!(
            value(named("fc1.weight"), unit * 1152 + channel * 36 + row * 6 + col),
            weights.parts().fc1_weight[((row * 6 + col) * 32 + channel) * 3 + unit]
        );
        assert_eq!(value(named("fc2.weight"), 3 + 2), weights.parts().fc2_weight[2 * architecture.outputs() + 1]);
    }

    /// In memory the weights of all layers of a stage come before their biases.
    #[test]
    fn residual_layers_are_stored_one_by_one() {
        let architecture =
            NetworkArchitecture { residual1: 2, residual2: 3, hidden: 3, ..NetworkArchitecture::compact() };
        let mut weights = Weights::init(architecture, RootSeed(2), 0);
        weights.values_mut().iter_mut().zip(1_u16..).for_each(|(value, index)| *value = f32::from(index));
        let tensors = to_pytorch(&weights);
        let first = |name: &str| {
            let tensor = tensors.iter().find(|tensor| tensor.name == name).unwrap();
            f32::from_le_bytes(*tensor.bytes.first_chunk::<4>().unwrap())
        };
        let parts = weights.parts();
        assert_eq!(first("residual1_2.weight"), parts.residual1_weight[16 * 16 * 9]);
        assert_eq!(first("residual1_2.bias"), parts.residual1_bias[16]);
        assert_eq!(first("residual2_3.weight"), parts.residual2_weight[2 * 32 * 32 * 9]);
        assert_eq!(first("residual2_3.bias"), parts.residual2_bias[2 * 32]);
        let names: Vec<String> = layers(&architecture).into_iter().map(|layer| layer.name).collect();
        assert_eq!(names[..4], ["conv1", "residual1_1", "residual1_2", "conv2"]);
        assert_eq!(names[4..], ["residual2_1", "residual2_2", "residual2_3", "fc1", "fc2"]);
        let mut read = Weights::zeros(architecture);
        from_pytorch(&mut read, |name, _| {
            let tensor = tensors.iter().find(|tensor| tensor.name == name).unwrap();
            Ok::<_, ()>(tensor.bytes.as_chunks().0.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect())
        })
        .unwrap();
        assert_eq!(read, weights);
    }

    #[test]
    fn another_architecture_is_refused_by_tensor_and_shape() {
        let folder = scratch("architecture");
        checkpoint(NetworkArchitecture::compact()).save(&folder).unwrap();
        let small = fs::read(folder.join(NUMBERS)).unwrap();
        checkpoint(NetworkArchitecture::paper()).save(&folder).unwrap();
        sums::write(&folder, NUMBERS, &small).unwrap();
        let error = Checkpoint::load(&folder).unwrap_err().to_string();
        for part in ["model.safetensors", "conv1.weight", "[32, 1, 5, 5]", "[16, 1, 3, 3]"] {
            assert!(error.contains(part), "{error}");
        }
        fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn the_file_lists_the_layers_in_order_with_their_shapes() {
        let layers = layers(&NetworkArchitecture::paper());
        let names: Vec<&str> = layers.iter().map(|layer| layer.name.as_str()).collect();
        assert_eq!(names, ["conv1", "conv2", "fc1", "fc2"]);
        assert_eq!((layers[1].weight_shape.clone(), layers[1].padding), (vec![64, 32, 2, 2], Some([0, 1])));
        assert_eq!((layers[2].weight_shape.clone(), layers[2].max_pool), (vec![1000, 64 * 6 * 6], None));
        assert_eq!(layers[3].activation, Activation::Identity);
    }

    #[test]
    fn a_checkpoint_of_an_older_version_is_refused_by_name() {
        let folder = scratch("older");
        checkpoint(NetworkArchitecture::compact()).save(&folder).unwrap();
        let path = folder.join("model.toml");
        let text = fs::read_to_string(&path).unwrap();
        sums::write(&folder, "model.toml", text.replace("schema = 3", "format_version = 1").as_bytes()).unwrap();
        let error = Checkpoint::load(&folder).unwrap_err().to_string();
        assert!(error.contains("model.toml") && error.contains("older version"), "{error}");
        fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn a_folder_without_a_checkpoint_says_so() {
        let error = Checkpoint::load(&scratch("nothing")).unwrap_err().to_string();
        assert!(error.contains("model.toml"), "{error}");
    }
}
