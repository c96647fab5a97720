//! A trained network on disk: `model.safetensors` for the numbers, `model.toml` for everything needed to use them.
//!
//! The tensors are laid out as `PyTorch` has them: convolutions `[out, in, rows, columns]`, dense layers `[out, in]`
//! with inputs in the order channel, row, column (what `flatten(1)` makes of `[batch, channel, row, column]`).

use crate::dataset::store::{StoreError, read_toml, write_atomically, write_toml};
use crate::network::{LOG_VARIANCE_MAX, LOG_VARIANCE_MIN, LookAheadNetConfig, OUTPUTS, POOLED_2, Weights};
use safetensors::tensor::{Dtype, SafeTensors, TensorView};
use serde::{Deserialize, Serialize};
use sim::sensing::GridGeometry;
use std::fs;
use std::io::Write as _;
use std::path::Path;

/// A network and the meaning of its numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct Checkpoint {
    /// The network.
    pub weights: Weights,
    /// The patch of ground its grids show and its answers are fractions of.
    pub geometry: GridGeometry,
}

const FORMAT_VERSION: u32 = 1;
const NUMBERS: &str = "model.safetensors";
const CARD: &str = "model.toml";

/// `model.toml`.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Card {
    format_version: u32,
    input: String,
    output: String,
    log_variance_min: f32,
    log_variance_max: f32,
    geometry: GridGeometry,
    network: LookAheadNetConfig,
}

const INPUT: &str = "grid [batch, 1, 25, 25]: 1 = non-drivable, 0 = drivable; row 0 = far, column 0 = left";
const OUTPUT: &str = "[u, w, raw_u, raw_w]: (u, w) look-ahead point in image fractions, u 0 = left 1 = right, w 0 = far \
                      1 = near, clipped to [0, 1] in use; log sigma^2 = mid + half * tanh((raw - mid) / half) between \
                      log_variance_min and log_variance_max; if network.mirror_averaging, the mean of the output for the grid and \
                      the output for grid.flip(-1) with 1 - u in place of u; driven at is the exponential mean over \
                      network.smoothing_ticks of the point's curvature 2 Y / (X^2 + Y^2) and range (X^2 + Y^2)^0.5";

impl Checkpoint {
    /// Whether a folder holds a finished checkpoint.
    pub fn exists(folder: &Path) -> bool {
        folder.join(NUMBERS).is_file()
    }

    /// Writes both files into a folder; the numbers last, so that their presence means a finished checkpoint.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn save(&self, folder: &Path) -> Result<(), StoreError> {
        fs::create_dir_all(folder)
            .map_err(|error| StoreError::new(folder, error, "check that the parent folder is writable"))?;
        let card = Card {
            format_version: FORMAT_VERSION,
            input: INPUT.to_string(),
            output: OUTPUT.to_string(),
            log_variance_min: LOG_VARIANCE_MIN,
            log_variance_max: LOG_VARIANCE_MAX,
            geometry: self.geometry,
            network: self.weights.config(),
        };
        write_toml(&folder.join(CARD), &card)?;

        let path = folder.join(NUMBERS);
        let tensors: Vec<Tensor> = to_pytorch(&self.weights);
        let views = tensors.iter().map(|tensor| {
            let view = TensorView::new(Dtype::F32, tensor.shape.clone(), &tensor.bytes).expect("bytes fit the shape");
            (tensor.name, view)
        });
        let bytes = safetensors::serialize(views, None)
            .map_err(|error| StoreError::new(&path, error, "report this: the weights cannot be serialised"))?;
        write_atomically(&path, |file| file.write_all(&bytes).map_err(|error| error.to_string()))
    }

    /// Reads both files.
    ///
    /// # Errors
    /// If a file is missing, of another version, or its tensors are those of another network.
    pub fn load(folder: &Path) -> Result<Self, StoreError> {
        let path = folder.join(CARD);
        let card: Card = read_toml(&path)?;
        if card.format_version != FORMAT_VERSION {
            let problem = format!("format version {} instead of {FORMAT_VERSION}", card.format_version);
            return Err(StoreError::new(&path, problem, "train again, or use the program that wrote it"));
        }
        if (card.log_variance_min, card.log_variance_max) != (LOG_VARIANCE_MIN, LOG_VARIANCE_MAX) {
            let problem = format!("log-variance bounds [{}, {}]", card.log_variance_min, card.log_variance_max);
            return Err(StoreError::new(&path, problem, "train again, or use the program that wrote it"));
        }
        card.network
            .validate()
            .map_err(|error| StoreError::new(&path, error, "restore the file the training wrote"))?;

        let path = folder.join(NUMBERS);
        let bytes = fs::read(&path).map_err(|error| StoreError::new(&path, error, RESTORE))?;
        let tensors = SafeTensors::deserialize(&bytes).map_err(|error| StoreError::new(&path, error, RESTORE))?;
        let mut weights = Weights::zeros(card.network);
        from_pytorch(&mut weights, |name, shape| {
            let tensor = tensors.tensor(name).map_err(|error| {
                StoreError::new(&path, format!("tensor {name} of shape {shape:?} expected: {error}"), RESTORE)
            })?;
            if tensor.shape() != shape || tensor.dtype() != Dtype::F32 {
                let found = (tensor.dtype(), tensor.shape());
                let problem = format!("tensor {name}: expected F32 {shape:?}, found {:?} {:?}", found.0, found.1);
                return Err(StoreError::new(&path, problem, RESTORE));
            }
            Ok(tensor.data().as_chunks().0.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect())
        })?;
        if let Some(index) = weights.values().iter().position(|value| !value.is_finite()) {
            return Err(StoreError::new(&path, format!("value {index} is not finite"), RESTORE));
        }
        Ok(Self { weights, geometry: card.geometry })
    }
}

const RESTORE: &str = "model.safetensors and model.toml belong together: restore both, or train again";

/// One tensor as it is stored.
struct Tensor {
    name: &'static str,
    shape: Vec<usize>,
    bytes: Vec<u8>,
}

/// Names and shapes in the order of [`crate::network::Parts`].
fn shapes(config: &LookAheadNetConfig) -> [(&'static str, Vec<usize>); 8] {
    let (conv1, conv2, hidden) = (config.conv1, config.conv2, config.hidden);
    [
        ("conv1.weight", vec![conv1.channels, 1, conv1.kernel, conv1.kernel]),
        ("conv1.bias", vec![conv1.channels]),
        ("conv2.weight", vec![conv2.channels, conv1.channels, conv2.kernel, conv2.kernel]),
        ("conv2.bias", vec![conv2.channels]),
        ("fc1.weight", vec![hidden, config.features()]),
        ("fc1.bias", vec![hidden]),
        ("fc2.weight", vec![OUTPUTS, hidden]),
        ("fc2.bias", vec![OUTPUTS]),
    ]
}

fn to_pytorch(weights: &Weights) -> Vec<Tensor> {
    let config = weights.config();
    let parts = weights.parts();
    let values: [Vec<f32>; 8] = [
        parts.conv1_weight.to_vec(),
        parts.conv1_bias.to_vec(),
        parts.conv2_weight.to_vec(),
        parts.conv2_bias.to_vec(),
        (0..parts.fc1_weight.len()).map(|stored| parts.fc1_weight[fc1_index(&config, stored)]).collect(),
        parts.fc1_bias.to_vec(),
        (0..parts.fc2_weight.len()).map(|stored| parts.fc2_weight[fc2_index(&config, stored)]).collect(),
        parts.fc2_bias.to_vec(),
    ];
    shapes(&config)
        .into_iter()
        .zip(values)
        .map(|((name, shape), values)| {
            let bytes = values.into_iter().flat_map(f32::to_le_bytes).collect();
            Tensor { name, shape, bytes }
        })
        .collect()
}

fn from_pytorch<E>(
    weights: &mut Weights,
    mut tensor: impl FnMut(&str, &[usize]) -> Result<Vec<f32>, E>,
) -> Result<(), E> {
    let config = weights.config();
    let parts = weights.parts_mut();
    let into = [
        parts.conv1_weight,
        parts.conv1_bias,
        parts.conv2_weight,
        parts.conv2_bias,
        parts.fc1_weight,
        parts.fc1_bias,
        parts.fc2_weight,
        parts.fc2_bias,
    ];
    for ((name, shape), into) in shapes(&config).into_iter().zip(into) {
        for (stored, value) in tensor(name, &shape)?.into_iter().enumerate() {
            let index = match name {
                "fc1.weight" => fc1_index(&config, stored),
                "fc2.weight" => fc2_index(&config, stored),
                _ => stored,
            };
            into[index] = value;
        }
    }
    Ok(())
}

/// Ours is `[row, column, channel, hidden]`, stored is `[hidden, channel, row, column]`.
fn fc1_index(config: &LookAheadNetConfig, stored: usize) -> usize {
    let cells = POOLED_2 * POOLED_2;
    let (unit, feature) = (stored / config.features(), stored % config.features());
    let (channel, cell) = (feature / cells, feature % cells);
    (cell * config.conv2.channels + channel) * config.hidden + unit
}

/// Ours is `[hidden, output]`, stored is `[output, hidden]`.
fn fc2_index(config: &LookAheadNetConfig, stored: usize) -> usize {
    stored % config.hidden * OUTPUTS + stored / config.hidden
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dataset::store::tests::scratch;
    use sim::seed::RootSeed;

    fn checkpoint(config: LookAheadNetConfig) -> Checkpoint {
        Checkpoint { weights: Weights::init(config, RootSeed(1), 0), geometry: GridGeometry::paper() }
    }

    #[test]
    fn a_checkpoint_reads_back_bit_by_bit() {
        let folder = scratch("checkpoint");
        let saved = checkpoint(LookAheadNetConfig::paper());
        assert!(!Checkpoint::exists(&folder));
        saved.save(&folder).unwrap();
        assert!(Checkpoint::exists(&folder));
        let loaded = Checkpoint::load(&folder).unwrap();
        assert_eq!(loaded.weights.values(), saved.weights.values());
        assert_eq!(loaded, saved);
        fs::remove_dir_all(folder).unwrap();
    }

    /// `fc1.weight[unit, (channel, row, column)]` is the weight from that feature to that unit.
    #[test]
    fn dense_layers_are_stored_in_pytorch_order() {
        let config = LookAheadNetConfig { hidden: 3, ..LookAheadNetConfig::compact() };
        let weights = Weights::init(config, RootSeed(2), 0);
        let tensors = to_pytorch(&weights);
        let value =
            |tensor: &Tensor, index: usize| f32::from_le_bytes(*tensor.bytes[4 * index..].first_chunk::<4>().unwrap());
        let (unit, channel, row, col) = (2, 17, 4, 1);
        assert_eq!(
            value(&tensors[4], unit * 1152 + channel * 36 + row * 6 + col),
            weights.parts().fc1_weight[((row * 6 + col) * 32 + channel) * 3 + unit]
        );
        assert_eq!(value(&tensors[6], 3 + 2), weights.parts().fc2_weight[2 * OUTPUTS + 1]);
    }

    #[test]
    fn another_architecture_is_refused_by_tensor_and_shape() {
        let folder = scratch("architecture");
        checkpoint(LookAheadNetConfig::compact()).save(&folder).unwrap();
        let small = fs::read(folder.join(NUMBERS)).unwrap();
        checkpoint(LookAheadNetConfig::paper()).save(&folder).unwrap();
        fs::write(folder.join(NUMBERS), small).unwrap();
        let error = Checkpoint::load(&folder).unwrap_err().to_string();
        for part in ["model.safetensors", "conv1.weight", "[32, 1, 5, 5]", "[16, 1, 3, 3]"] {
            assert!(error.contains(part), "{error}");
        }
        fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn a_folder_without_a_checkpoint_says_so() {
        let error = Checkpoint::load(&scratch("nothing")).unwrap_err().to_string();
        assert!(error.contains("model.toml"), "{error}");
    }
}
