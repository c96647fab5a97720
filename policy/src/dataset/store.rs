//! A run on disk: one folder per round, never changed once it is there.
//!
//! ```text
//! round-00/grids.npy        u8  [n, 25, 25]   1 = non-drivable, row 0 = far, column 0 = left
//!          labels.npy       f32 [n, 3]        u, w, τ̂ (image fractions)
//!          noise_augmentations.npz      u8  [n, k, 25, 25]  array `noise_augmentations`: the same scenes with other noise, if k > 0
//!          round.toml       how it was collected
//!          model.safetensors, model.toml, fit.toml    the network trained after it
//! round-01/…
//! final/                    an optional longer fit on everything
//! ```
//!
//! Every file and folder appears under its name only when it is complete: it is written beside, then renamed.

use super::{Round, Sample};
use ndarray::{Array2, Array3, Array4};
use ndarray_npy::{NpzReader, NpzWriter, ReadNpyExt as _, WriteNpyExt as _};
use serde::Serialize;
use serde::de::DeserializeOwned;
use sim::sensing::{GRID_CELLS, OccupancyGrid};
use std::fs::{self, File};
use std::io::{BufReader, BufWriter, Write as _};
use std::path::{Path, PathBuf};

/// What went wrong with a file, and what to do about it.
#[derive(Debug, thiserror::Error)]
#[error("{}: {problem}; {remedy}", path.display())]
pub struct StoreError {
    /// Which file or folder.
    pub path: PathBuf,
    /// What is wrong.
    pub problem: String,
    /// What helps.
    pub remedy: &'static str,
}

impl StoreError {
    /// An error at a path.
    pub(crate) fn new(path: &Path, problem: impl std::fmt::Display, remedy: &'static str) -> Self {
        Self { path: path.to_path_buf(), problem: problem.to_string(), remedy }
    }
}

const WRITE_REMEDY: &str = "check that the folder exists, is writable and has space";
const RELOOKS: &str = "noise_augmentations.npz";
const RELOOKS_ARRAY: &str = "noise_augmentations";
const READ_REMEDY: &str = "delete this round and all later ones to collect them again, or restore the file";

/// The folder of one run.
#[derive(Debug, Clone)]
pub struct Store {
    folder: PathBuf,
}

impl Store {
    /// Opens or creates the folder.
    ///
    /// # Errors
    /// If it cannot be created.
    pub fn open(folder: &Path) -> Result<Self, StoreError> {
        fs::create_dir_all(folder).map_err(|error| StoreError::new(folder, error, WRITE_REMEDY))?;
        Ok(Self { folder: folder.to_path_buf() })
    }

    /// The folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// The folder of a round.
    pub fn round_folder(&self, round: u32) -> PathBuf {
        self.folder.join(format!("round-{round:02}"))
    }

    /// The folder of the final fit.
    pub fn final_folder(&self) -> PathBuf {
        self.folder.join("final")
    }

    /// Whether a round's data are there.
    pub fn has_round(&self, round: u32) -> bool {
        self.round_folder(round).is_dir()
    }

    /// Writes the data of a round with a record of how it was collected.
    ///
    /// # Errors
    /// If the round exists already, or a file cannot be written.
    pub fn write_round(&self, index: u32, round: &Round, about: &impl Serialize) -> Result<(), StoreError> {
        let folder = self.round_folder(index);
        if folder.exists() {
            return Err(StoreError::new(
                &folder,
                "this round exists already",
                "rounds are never overwritten: use another folder",
            ));
        }
        let partial = self.folder.join(format!(".round-{index:02}.partial"));
        if partial.exists() {
            fs::remove_dir_all(&partial).map_err(|error| StoreError::new(&partial, error, WRITE_REMEDY))?;
        }
        fs::create_dir_all(&partial).map_err(|error| StoreError::new(&partial, error, WRITE_REMEDY))?;

        let n = round.samples.len();
        let cells = round.samples.iter().flat_map(|sample| sample.grid.cells()).collect();
        let grids = Array3::from_shape_vec([n, GRID_CELLS, GRID_CELLS], cells).expect("a grid has 25×25 cells");
        let labels = round.samples.iter().flat_map(|s| [s.label[0], s.label[1], s.tau_hat]).collect();
        let labels = Array2::from_shape_vec([n, 3], labels).expect("a label has three values");
        write_atomically(&partial.join("grids.npy"), |file| grids.write_npy(file).map_err(|error| error.to_string()))?;
        write_atomically(&partial.join("labels.npy"), |file| {
            labels.write_npy(file).map_err(|error| error.to_string())
        })?;
        if !round.noise_augmentations.is_empty() {
            let cells = round.noise_augmentations.iter().flat_map(OccupancyGrid::cells).collect();
            let shape = [n, round.noise_augmentations.len() / n, GRID_CELLS, GRID_CELLS];
            let noise_augmentations =
                Array4::from_shape_vec(shape, cells).expect("every sample has as many further looks");
            // k times as large as the grids: 20 times smaller when compressed.
            write_atomically(&partial.join(RELOOKS), |file| {
                let mut archive = NpzWriter::new_compressed(file);
                let written = archive.add_array(RELOOKS_ARRAY, &noise_augmentations).and_then(|()| archive.finish());
                written.map(drop).map_err(|error| error.to_string())
            })?;
        }
        write_toml(&partial.join("round.toml"), about)?;
        fs::rename(&partial, &folder).map_err(|error| StoreError::new(&folder, error, WRITE_REMEDY))
    }

    /// Reads the data of a round and the record of how it was collected.
    ///
    /// # Errors
    /// If a file is missing or is not what it should be.
    pub fn read_round<About: DeserializeOwned>(&self, index: u32) -> Result<(Round, About), StoreError> {
        let folder = self.round_folder(index);
        let about = read_toml(&folder.join("round.toml"))?;
        let samples = self.read_samples(index)?;
        let noise_augmentations = Self::read_relooks(&folder.join(RELOOKS), samples.len())?;
        Ok((Round { samples, noise_augmentations }, about))
    }

    /// Reads the samples of a round without the further looks at them.
    ///
    /// # Errors
    /// If a file is missing or is not what it should be.
    pub fn read_samples(&self, index: u32) -> Result<Vec<Sample>, StoreError> {
        let folder = self.round_folder(index);
        let (grids_path, labels_path) = (folder.join("grids.npy"), folder.join("labels.npy"));
        let grids = Array3::<u8>::read_npy(open(&grids_path)?)
            .map_err(|error| StoreError::new(&grids_path, error, READ_REMEDY))?;
        let labels = Array2::<f32>::read_npy(open(&labels_path)?)
            .map_err(|error| StoreError::new(&labels_path, error, READ_REMEDY))?;
        let n = grids.shape()[0];
        if grids.shape()[1..] != [GRID_CELLS, GRID_CELLS] {
            let problem = format!("shape {:?} instead of [n, {GRID_CELLS}, {GRID_CELLS}]", grids.shape());
            return Err(StoreError::new(&grids_path, problem, READ_REMEDY));
        }
        if labels.shape() != [n, 3] {
            let problem = format!("shape {:?} instead of [{n}, 3], one row per grid", labels.shape());
            return Err(StoreError::new(&labels_path, problem, READ_REMEDY));
        }
        if let Some(bad) = labels.iter().position(|value| !value.is_finite()) {
            let problem = format!("row {} holds a value that is not finite", bad / 3);
            return Err(StoreError::new(&labels_path, problem, READ_REMEDY));
        }
        let samples = grids
            .outer_iter()
            .zip(labels.outer_iter())
            .map(|(cells, label)| {
                let cells: Vec<u8> = cells.iter().copied().collect();
                Sample { grid: OccupancyGrid::from_cells(&cells), label: [label[0], label[1]], tau_hat: label[2] }
            })
            .collect();
        Ok(samples)
    }

    fn read_relooks(path: &Path, n: usize) -> Result<Vec<OccupancyGrid>, StoreError> {
        if !path.exists() {
            return Ok(Vec::new());
        }
        let grids: Array4<u8> = NpzReader::new(open(path)?)
            .and_then(|mut archive| archive.by_name(RELOOKS_ARRAY))
            .map_err(|error| StoreError::new(path, error, READ_REMEDY))?;
        if grids.shape()[0] != n || grids.shape()[2..] != [GRID_CELLS, GRID_CELLS] {
            let problem = format!("shape {:?} instead of [{n}, k, {GRID_CELLS}, {GRID_CELLS}]", grids.shape());
            return Err(StoreError::new(path, problem, READ_REMEDY));
        }
        let cells: Vec<u8> = grids.into_iter().collect();
        Ok(cells.chunks_exact(GRID_CELLS * GRID_CELLS).map(OccupancyGrid::from_cells).collect())
    }
}

/// Writes a TOML file under its name only when it is complete.
pub(crate) fn write_toml(path: &Path, value: &impl Serialize) -> Result<(), StoreError> {
    let text = toml::to_string_pretty(value)
        .map_err(|error| StoreError::new(path, error, "report this: the settings cannot be written as TOML"))?;
    write_atomically(path, |file| file.write_all(text.as_bytes()).map_err(|error| error.to_string()))
}

/// Reads a TOML file.
pub(crate) fn read_toml<T: DeserializeOwned>(path: &Path) -> Result<T, StoreError> {
    let text = fs::read_to_string(path).map_err(|error| StoreError::new(path, error, READ_REMEDY))?;
    toml::from_str(&text).map_err(|error| StoreError::new(path, error, READ_REMEDY))
}

/// Writes a file beside and renames it.
pub(crate) fn write_atomically(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<File>) -> Result<(), String>,
) -> Result<(), StoreError> {
    let partial = path.with_extension("partial");
    let fail = |problem: String| StoreError::new(path, problem, WRITE_REMEDY);
    let mut file = BufWriter::new(File::create(&partial).map_err(|error| fail(error.to_string()))?);
    write(&mut file).map_err(fail)?;
    let file = file.into_inner().map_err(|error| fail(error.to_string()))?;
    // The name must not be on disk before the content is.
    file.sync_all().map_err(|error| fail(error.to_string()))?;
    fs::rename(&partial, path).map_err(|error| fail(error.to_string()))
}

fn open(path: &Path) -> Result<BufReader<File>, StoreError> {
    File::open(path).map(BufReader::new).map_err(|error| StoreError::new(path, error, READ_REMEDY))
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::dataset::tests::round;
    use serde::Deserialize;

    #[derive(Debug, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields)]
    struct About {
        collected_by: String,
    }

    /// A folder of this test, empty.
    pub(crate) fn scratch(name: &str) -> PathBuf {
        let folder = std::env::temp_dir().join(format!("policy-test-{}-{name}", std::process::id()));
        let _ = fs::remove_dir_all(&folder);
        folder
    }

    #[test]
    fn a_round_reads_back_as_written_and_is_never_overwritten() {
        let folder = scratch("round");
        let store = Store::open(&folder).unwrap();
        let (mut round, about) = (round(33), About { collected_by: "expert".to_string() });
        round.noise_augmentations =
            round.samples.iter().flat_map(|sample| [sample.grid.mirrored(), sample.grid]).collect();
        assert!(!store.has_round(0));
        store.write_round(0, &round, &about).unwrap();
        assert!(store.has_round(0));
        assert_eq!(store.read_round::<About>(0).unwrap(), (round.clone(), about));
        let again = store.write_round(0, &round, &About { collected_by: String::new() });
        assert!(again.unwrap_err().to_string().contains("exists already"));
        fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn an_empty_round_is_a_round() {
        let folder = scratch("empty");
        let store = Store::open(&folder).unwrap();
        store.write_round(3, &Round::default(), &About { collected_by: String::new() }).unwrap();
        assert!(store.read_round::<About>(3).unwrap().0.samples.is_empty());
        fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn a_damaged_round_names_the_file() {
        let folder = scratch("damaged");
        let store = Store::open(&folder).unwrap();
        store.write_round(0, &round(5), &About { collected_by: String::new() }).unwrap();
        let labels = Array2::<f32>::zeros([4, 3]);
        ndarray_npy::write_npy(store.round_folder(0).join("labels.npy"), &labels).unwrap();
        let error = store.read_round::<About>(0).unwrap_err().to_string();
        assert!(error.contains("labels.npy") && error.contains("[5, 3]"), "{error}");
        fs::write(store.round_folder(0).join("round.toml"), "who = 1").unwrap();
        let error = store.read_round::<About>(0).unwrap_err().to_string();
        assert!(error.contains("round.toml") && error.contains("who"), "{error}");
        fs::remove_dir_all(folder).unwrap();
    }
}
