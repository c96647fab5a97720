//! A run on disk: one folder per round, never changed once it is there. docs/formats.md describes every file.
//!
//! ```text
//! round-00/round.toml       how it was collected
//!          grids.npy        u8  [n, 79]       a bit per cell (`packed.rs`): 1 = non-drivable
//!          labels.npy       f32 [n, 3]        u, w, τ̂ (image fractions)
//!          ticks.npz        [n] per column    episode, time, pose, command and driver of each sample
//!          noise_augmentations.npz   u8 [n, k, 79]   the same scenes with other noise, if k > 0
//!          model.safetensors, model.toml, fit.toml       the network trained after it
//!          learning.csv     how it was trained, step by step
//!          sha256sums       what of this is finished
//! round-01/…
//! round-01-member-1/…       another member of an ensemble, for rules that drive with one
//! round-01-critic/…         what warns of states that the network does not master, for rules that need it
//! final/                    an optional longer fit on everything
//! ```
//!
//! The run lists the data of a round file by file as soon as they are there, and the round's `sha256sums` in their place
//! when the network is. Of a folder without data, it lists the network file by file before the folder does.
//!
//! Every file and folder appears under its name only when it is complete: it is written beside, then renamed.

use crate::checkpoint::Checkpoint;
use crate::dataset::collection::Collection;
use crate::dataset::npy::{self, Archive};
use crate::dataset::packed;
use crate::dataset::round::Round;
use crate::dataset::sample::Sample;
use crate::dataset::tick::Tick;
use crate::files::{self, FileError, Format as _, RESTORE_REMEDY, WRITE_REMEDY, write_atomically};
use ndarray::{Array2, Array3, ArrayView1};
use ndarray_npy::{NpzWriter, WriteNpyExt as _};
use sim::sensing::OccupancyGrid;
use std::borrow::Cow;
use std::fs;
use std::path::{Path, PathBuf};
use storage::{sums, whole};

const AUGMENTATIONS: &str = "noise_augmentations.npz";
const AUGMENTATIONS_ARRAY: &str = "noise_augmentations";

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
    pub fn open(folder: &Path) -> Result<Self, FileError> {
        files::create_folder(folder)?;
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

    /// The folder of what is trained beside the network of a round.
    pub(crate) fn part_folder(&self, round: u32, part: &str) -> PathBuf {
        self.folder.join(format!("round-{round:02}-{part}"))
    }

    /// The folder of the final fit.
    pub fn final_folder(&self) -> PathBuf {
        self.folder.join("final")
    }

    /// Whether a round's data are there: collected by this run.
    ///
    /// # Errors
    /// See [`Self::is_finished`]; or if the folder was put there by somebody else.
    pub fn has_round(&self, round: u32) -> Result<bool, FileError> {
        let folder = self.round_folder(round);
        if self.is_finished(&folder)? {
            return Ok(true);
        }
        let is_there = folder.is_dir();
        if is_there && !sums::is_listed(&self.folder, &record_of(&folder))? {
            return Err(FileError::new(
                &folder,
                "this run did not collect it",
                "move the folder away: the run goes on with a round of its own",
            ));
        }
        Ok(is_there)
    }

    /// Whether a folder of the run is finished: its data and its network.
    ///
    /// # Errors
    /// If the run lists it as finished, but it is missing or incomplete.
    pub fn is_finished(&self, folder: &Path) -> Result<bool, FileError> {
        let list = list_of(folder);
        let is_listed = sums::is_listed(&self.folder, &list)?;
        if is_listed {
            sums::read_listed(&self.folder, &list, sums::LIST_BYTES_MAX)?;
        }
        Ok(is_listed)
    }

    /// The network in a finished folder of the run: the one that the run has there.
    ///
    /// # Errors
    /// If the run does not list the folder as it is, or see [`Checkpoint::load`].
    pub(crate) fn checkpoint(&self, folder: &Path) -> Result<Checkpoint, FileError> {
        if self.is_finished(folder)? { Checkpoint::load(folder) } else { Err(not_trained_here(folder)) }
    }

    /// Lists files of a folder without data before its own list does: with that, [`Self::check_trained`] knows them.
    ///
    /// # Errors
    /// If one cannot be read, or the list cannot be written.
    pub(crate) fn claim(&self, folder: &Path, files: &[&str]) -> Result<(), FileError> {
        if sums::is_listed(&self.folder, &record_of(folder))? {
            return Ok(());
        }
        let files: Vec<String> = files.iter().map(|file| format!("{}/{file}", name_of(folder))).collect();
        sums::list(&self.folder, &files.iter().map(String::as_str).collect::<Vec<_>>())
    }

    /// Refuses a trained network that this run did not train: it lists the folder, its data or all of its files.
    ///
    /// # Errors
    /// If it does not, or lists others.
    pub(crate) fn check_trained(&self, folder: &Path) -> Result<(), FileError> {
        let within = format!("{}/", name_of(folder));
        if !sums::names(&self.folder)?.iter().any(|name| name.starts_with(&within)) {
            return Err(not_trained_here(folder));
        }
        sums::check_folder(&self.folder, &name_of(folder))
    }

    /// Lists a folder of the run, all of whose files are listed there: nothing is added to it any more.
    ///
    /// # Errors
    /// If the list cannot be written.
    pub(crate) fn finish(&self, folder: &Path) -> Result<(), FileError> {
        if self.is_finished(folder)? { Ok(()) } else { sums::list_folder(&self.folder, &name_of(folder)) }
    }

    /// Writes the data of a round with a record of how it was collected.
    ///
    /// # Errors
    /// If the round exists already, or a file cannot be written.
    ///
    /// # Panics
    /// If there is not one tick per sample, or the record counts otherwise.
    pub fn write_round(&self, round: &Round, collection: &Collection) -> Result<(), FileError> {
        let (n, each) = (round.samples.len(), round.augmentations_each());
        assert_eq!(round.ticks.len(), n, "one tick per sample");
        assert_eq!((collection.samples, collection.noise_augmentations), (n, each), "what the record counts");
        let index = collection.round;
        let folder = self.round_folder(index);
        if folder.exists() {
            return Err(FileError::new(
                &folder,
                "this round exists already",
                "rounds are never overwritten: use another folder",
            ));
        }
        let partial = self.folder.join(format!(".round-{index:02}.{}", whole::PARTIAL));
        if partial.exists() {
            fs::remove_dir_all(&partial).map_err(|error| FileError::new(&partial, error, WRITE_REMEDY))?;
        }
        files::create_folder(&partial)?;

        let grids = packed::pack(round.samples.iter().map(|sample| &sample.grid));
        let labels = round.samples.iter().flat_map(|s| [s.label[0], s.label[1], s.tau_hat]).collect();
        let labels = Array2::from_shape_vec([n, 3], labels).expect("a label has three values");
        write_atomically(&partial.join("grids.npy"), |file| grids.write_npy(file).map_err(|error| error.to_string()))?;
        write_atomically(&partial.join("labels.npy"), |file| {
            labels.write_npy(file).map_err(|error| error.to_string())
        })?;
        Tick::write_all(&round.ticks, &partial)?;
        if each > 0 {
            let augmentations = packed::pack(round.noise_augmentations.iter())
                .into_shape_with_order([n, each, packed::GRID_BYTES])
                .expect("every sample has as many noise augmentations");
            // k times as large as the grids: nine times smaller when compressed.
            write_atomically(&partial.join(AUGMENTATIONS), |file| {
                let mut archive = NpzWriter::new_compressed(file);
                let written = archive.add_array(AUGMENTATIONS_ARRAY, &augmentations).and_then(|()| archive.finish());
                written.map(drop).map_err(|error| error.to_string())
            })?;
        }
        collection.write(&partial)?;
        sums::list_all(&partial)?;
        // Before the round is there: one that is there and not listed is none of this run's.
        sums::list_files_of(&self.folder, &name_of(&folder), &partial)?;
        fs::rename(&partial, &folder).map_err(|error| FileError::new(&folder, error, WRITE_REMEDY))
    }

    /// Reads the data of a round and the record of how it was collected.
    ///
    /// # Errors
    /// If a file is missing, damaged, from an older version, or does not fit the others.
    pub fn read_round(&self, index: u32) -> Result<(Round, Collection), FileError> {
        let folder = self.round_folder(index);
        let collection = self.read_collection(&folder)?;
        let samples = read_samples(&folder, collection.samples)?;
        let ticks = Tick::read_all(&folder, samples.len())?;
        let noise_augmentations =
            read_augmentations(&folder.join(AUGMENTATIONS), samples.len(), collection.noise_augmentations)?;
        Ok((Round { samples, ticks, noise_augmentations }, collection))
    }

    /// Reads the samples of a round alone.
    ///
    /// # Errors
    /// If a file is missing, from an older version, or is not what it should be.
    pub fn read_samples(&self, index: u32) -> Result<Vec<Sample>, FileError> {
        let folder = self.round_folder(index);
        let collection = self.read_collection(&folder)?;
        read_samples(&folder, collection.samples)
    }

    /// Reads the record of how a round was collected; the round is the one that this run lists, if it lists any.
    fn read_collection(&self, folder: &Path) -> Result<Collection, FileError> {
        sums::check_folder(&self.folder, &name_of(folder))?;
        files::read(folder)
    }
}

fn not_trained_here(folder: &Path) -> FileError {
    FileError::new(
        folder,
        "this run did not train the network there, or not to the end",
        "move the folder away, and continue the run: it trains its own",
    )
}

/// The record of how a round was collected, as the run lists it.
fn record_of(folder: &Path) -> String {
    format!("{}/{}", name_of(folder), Collection::NAME)
}

fn name_of(folder: &Path) -> Cow<'_, str> {
    folder.file_name().unwrap_or_default().to_string_lossy()
}

/// The list of a folder, as the run lists it.
fn list_of(folder: &Path) -> String {
    format!("{}/{}", name_of(folder), sums::FILE)
}

fn read_samples(folder: &Path, samples: usize) -> Result<Vec<Sample>, FileError> {
    let (grids_path, labels_path) = (folder.join("grids.npy"), folder.join("labels.npy"));
    let grids: Array2<u8> = npy::read(&grids_path, &[samples, packed::GRID_BYTES])?;
    let labels: Array2<f32> = npy::read(&labels_path, &[samples, 3])?;
    if let Some(bad) = labels.iter().position(|value| !value.is_finite()) {
        let problem = format!("row {} holds a value that is not finite", bad / 3);
        return Err(FileError::new(&labels_path, problem, RESTORE_REMEDY));
    }
    let of = |(grid, label): (OccupancyGrid, ArrayView1<'_, f32>)| Sample {
        grid,
        label: [label[0], label[1]],
        tau_hat: label[2],
    };
    Ok(packed::unpack(grids).zip(labels.outer_iter()).map(of).collect())
}

fn read_augmentations(path: &Path, samples: usize, each: usize) -> Result<Vec<OccupancyGrid>, FileError> {
    if each == 0 {
        return Ok(Vec::new());
    }
    if each > usize::from(u8::MAX) {
        let problem = format!("{each} noise augmentations according to round.toml; at most 255 are possible");
        return Err(FileError::new(path, problem, RESTORE_REMEDY));
    }
    let shape = [samples, each, packed::GRID_BYTES];
    let grids: Array3<u8> = Archive::open(path, &[&shape])?.read(AUGMENTATIONS_ARRAY, &shape)?;
    Ok(packed::unpack(grids).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_data::{collected, scratch};

    fn written(name: &str, samples: usize, each: usize) -> (Store, Round, Collection) {
        let store = Store::open(&scratch(name)).unwrap();
        let (round, collection) = collected(samples, each);
        store.write_round(&round, &collection).unwrap();
        (store, round, collection)
    }

    /// The files of the round are whole, but others.
    fn listed_anew(store: &Store) {
        let folder = store.round_folder(0);
        sums::list_all(&folder).unwrap();
        sums::list_files_of(store.folder(), "round-00", &folder).unwrap();
    }

    #[test]
    fn a_round_reads_back_as_written_and_is_never_overwritten() {
        let (store, round, collection) = written("round", 33, 2);
        assert!(store.has_round(0).unwrap() && !store.has_round(1).unwrap());
        assert_eq!(store.read_round(0).unwrap(), (round.clone(), collection.clone()));
        let again = store.write_round(&round, &collection);
        assert!(again.unwrap_err().to_string().contains("exists already"));
        fs::remove_dir_all(store.folder()).unwrap();
    }

    /// It would be learned from as this run's own.
    #[test]
    fn a_round_that_was_copied_from_another_run_is_refused() {
        let (store, mut round, collection) = written("copied-to", 5, 0);
        // Collected alike, to the record, but with another label.
        let other = Store::open(&scratch("copied-from")).unwrap();
        round.samples[2].label[0] += 0.1;
        other.write_round(&round, &collection).unwrap();
        let copy = |to: &Path| {
            fs::create_dir(to).unwrap();
            for file in fs::read_dir(other.round_folder(0)).unwrap().map(Result::unwrap) {
                fs::copy(file.path(), to.join(file.file_name())).unwrap();
            }
        };
        copy(&store.round_folder(1));
        assert!(store.has_round(1).unwrap_err().to_string().contains("this run did not collect it"));
        fs::remove_dir_all(store.round_folder(0)).unwrap();
        assert!(!store.has_round(0).unwrap(), "a run that died before the folder had its name collects it again");
        copy(&store.round_folder(0));
        for error in [store.read_round(0).unwrap_err(), store.read_samples(0).unwrap_err()] {
            let error = error.to_string();
            assert!(error.contains("labels.npy") && error.contains("another SHA-256"), "{error}");
        }
        fs::remove_dir_all(store.round_folder(0)).unwrap();
        fs::rename(store.round_folder(1), store.round_folder(0)).unwrap();
        sums::list_all(&store.round_folder(0)).unwrap();
        store.finish(&store.round_folder(0)).unwrap();
        store.read_round(0).unwrap();
        ndarray_npy::write_npy(store.round_folder(0).join("labels.npy"), &Array2::<f32>::zeros([5, 3])).unwrap();
        sums::list_all(&store.round_folder(0)).unwrap();
        assert!(store.read_round(0).unwrap_err().to_string().contains("sha256sums"), "finished, and replaced since");
        for store in [store, other] {
            fs::remove_dir_all(store.folder()).unwrap();
        }
    }

    #[test]
    fn an_empty_round_is_a_round() {
        let (store, ..) = written("empty", 0, 0);
        assert!(store.read_round(0).unwrap().0.samples.is_empty());
        fs::remove_dir_all(store.folder()).unwrap();
    }

    #[test]
    fn a_damaged_round_names_the_file() {
        let (store, ..) = written("damaged", 5, 0);
        let error = || store.read_round(0).unwrap_err().to_string();
        let path = |name: &str| store.round_folder(0).join(name);
        let whole = fs::read(path("labels.npy")).unwrap();
        ndarray_npy::write_npy(path("labels.npy"), &Array2::<f32>::zeros([4, 3])).unwrap();
        assert!(error().contains("labels.npy") && error().contains("SHA-256"), "{}", error());
        let listed = || listed_anew(&store);
        listed();
        assert!(error().contains("labels.npy") && error().contains("[5, 3]"), "{}", error());
        fs::write(path("labels.npy"), whole).unwrap();
        listed();
        Tick::write_all(&collected(4, 0).0.ticks, &store.round_folder(0)).unwrap();
        listed();
        assert!(error().contains("ticks.npz") && error().contains("shape [4] instead of [5]"), "{}", error());
        fs::write(path("round.toml"), "schema = 2\nwho = 1").unwrap();
        listed();
        assert!(error().contains("round.toml") && error().contains("who"), "{}", error());
        fs::remove_dir_all(store.folder()).unwrap();
    }

    /// Trained on without them, a round would silently give another network.
    #[test]
    fn noise_augmentations_that_are_missing_are_an_error() {
        let (store, ..) = written("missing", 5, 1);
        fs::remove_file(store.round_folder(0).join(AUGMENTATIONS)).unwrap();
        let error = store.read_round(0).unwrap_err().to_string();
        assert!(error.contains(AUGMENTATIONS), "{error}");
        fs::remove_dir_all(store.folder()).unwrap();
    }

    #[test]
    fn a_round_with_a_byte_per_cell_is_refused_by_the_name_of_its_record() {
        let (store, ..) = written("unpacked", 5, 0);
        let path = |name: &str| store.round_folder(0).join(name);
        ndarray_npy::write_npy(path("grids.npy"), &Array3::<u8>::zeros([5, 25, 25])).unwrap();
        let record = fs::read_to_string(path("round.toml")).unwrap();
        fs::write(path("round.toml"), record.replace("schema = 2", "schema = 1")).unwrap();
        listed_anew(&store);
        for error in [store.read_round(0).unwrap_err(), store.read_samples(0).unwrap_err()] {
            let error = error.to_string();
            assert!(error.contains("round.toml") && error.contains("schema 1"), "{error}");
        }
        fs::remove_dir_all(store.folder()).unwrap();
    }
}
