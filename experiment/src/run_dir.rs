//! The folder of a run: claimed before the first step, never overwritten by accident.
//!
//! ```text
//! runs/train-dagger-default-s1/
//!   manifest.toml      who made this: revision, compiler, command line, seed
//!   settings.toml      every setting
//!   round-00/ …        data, network and loss curve of each round (policy::dataset::store)
//!   table1.md .json    the paper's table from this run
//!   summary.md .json .csv, comparisons.csv, noise_sweep.csv, runs.jsonl, failures.md .jsonl     (evaluate)
//!   wall_time.jsonl    the only file that differs from one repetition to the next, but for the manifest
//!   finished.toml      written last
//! ```

use crate::settings::Settings;
use anyhow::{Context as _, bail, ensure};
use policy::checkpoint::Checkpoint;
use policy::dagger::Stop;
use serde::{Deserialize, Serialize};
use sim::limits::RUN_TOML_BYTES_MAX;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use storage::lock::{self, Lock};

const MANIFEST: &str = "manifest.toml";
const SETTINGS: &str = "settings.toml";
const FINISHED: &str = "finished.toml";

/// A claimed folder: nobody else writes into it until the last clone is dropped, or the process ends.
#[derive(Debug, Clone)]
pub struct RunDir {
    path: PathBuf,
    _lock: Arc<Lock>,
}

/// What made a run: `manifest.toml`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// Version of this format: [`MANIFEST_SCHEMA`].
    pub schema: u32,
    /// The name and version of the program.
    pub program: String,
    /// The command line, without the name of the program.
    pub command_line: Vec<String>,
    /// What the settings started from.
    pub preset: String,
    /// Root seed of the training.
    pub root_seed: u64,
    /// Root seed of the trials of the evaluation.
    pub evaluation_seed: u64,
    /// Revision of the repository that the program was built from, if known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub git_revision: Option<String>,
    /// Whether files of the repository differed from that revision.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub git_dirty: Option<bool>,
    /// The compiler that built the program.
    pub rustc_version: String,
    /// Threads it computed with; results do not depend on it.
    pub threads: usize,
    /// Architecture and operating system.
    pub target: String,
    /// The processor, if known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub processor: Option<String>,
}

/// The version of `manifest.toml` that this program writes.
pub const MANIFEST_SCHEMA: u32 = 1;

/// What a run came to, written last: `finished.toml`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Finished {
    /// Version of this format: [`FINISHED_SCHEMA`].
    pub schema: u32,
    /// What was done.
    pub outcome: Outcome,
}

/// The version of `finished.toml` that this program writes.
pub const FINISHED_SCHEMA: u32 = 1;

/// What was done in a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "kind", deny_unknown_fields)]
pub enum Outcome {
    /// Behaviour cloning, or DAgger.
    Training {
        /// Why it ended.
        stop: Stop,
        /// Rounds, behaviour cloning included.
        rounds: usize,
    },
    /// Drivers were driven.
    Evaluation {
        /// Who, as named on the command line.
        drivers: Vec<String>,
    },
    /// Parameters of planners were searched.
    Tuning {
        /// Which.
        planners: Vec<String>,
    },
    /// The paper was reproduced.
    Reproduction {
        /// Stages that were done.
        stages: usize,
    },
}

/// The program that makes a run, as its manifest describes it.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Build {
    /// Name and version.
    pub program: String,
    /// The command line, without the name of the program.
    pub command_line: Vec<String>,
    /// Revision of the repository, if known.
    pub git_revision: Option<String>,
    /// Whether files of the repository differ from that revision.
    pub git_dirty: Option<bool>,
    /// The compiler.
    pub rustc_version: String,
    /// The processor that it runs on, if known.
    pub processor: Option<String>,
}

/// Where a run goes.
#[derive(Debug, Clone, Copy)]
pub struct Place<'a> {
    /// Who makes it.
    pub build: &'a Build,
    /// The folder; `None`: the next free one in `runs/`.
    pub out: Option<&'a Path>,
    /// Whether to delete what an earlier run left there.
    pub overwrite: bool,
    /// The command, as part of the folder's name.
    pub command: &'a str,
    /// Name of the preset.
    pub preset: &'a str,
    /// Seed, as part of the folder's name.
    pub seed: u64,
}

impl RunDir {
    /// Claims a folder and writes settings and manifest into it.
    ///
    /// # Errors
    /// If the folder is taken, in use by another process, or cannot be written.
    pub fn create(place: &Place<'_>, settings: &Settings) -> anyhow::Result<Self> {
        let run = match place.out {
            Some(out) => Self::claim_named(out, place)?,
            None => Self::claim_next_free(place)?,
        };
        run.write(SETTINGS, settings.to_toml().as_bytes())?;
        let manifest =
            toml::to_string(&Manifest::new(place.build, place.preset, settings)).expect("a manifest is plain values");
        run.write(MANIFEST, manifest.as_bytes())?;
        Ok(run)
    }

    /// Reopens the folder of an interrupted run.
    ///
    /// # Errors
    /// If there is none, it is finished, or another process is at it.
    pub fn resume(path: &Path, command: &str) -> anyhow::Result<(Self, Settings)> {
        ensure!(path.is_dir(), "{}: there is no such run to resume", path.display());
        let run = Self::locked(path.to_path_buf(), command)?;
        ensure!(!path.join(FINISHED).is_file(), "{}: this run is finished; nothing is left to resume", path.display());
        let settings = Settings::read(&path.join(SETTINGS))?;
        Ok((run, settings))
    }

    /// Reopens the folder of a run to write into it, whether it is finished or not.
    ///
    /// # Errors
    /// If there is none, or another process is at it.
    pub fn reopen(path: &Path, command: &str) -> anyhow::Result<Self> {
        ensure!(path.join(SETTINGS).is_file(), "{}: this is no run; list the folders in runs/", path.display());
        Self::locked(path.to_path_buf(), command)
    }

    /// Claims the folder of a stage within a run: `None` if it is finished, else as an interrupted one left it or new.
    /// The folder belongs to the run: what cannot be continued there is started again.
    ///
    /// # Errors
    /// If it was begun with other settings, is in use by another process, or cannot be written.
    pub fn stage(path: &Path, place: &Place<'_>, settings: &Settings) -> anyhow::Result<Option<Self>> {
        if is_finished(path) {
            return Ok(None);
        }
        if path.join(MANIFEST).is_file() {
            let (run, found) = Self::resume(path, place.command)?;
            ensure!(
                found == *settings,
                "{}: this stage was begun with other settings; delete the folder, or choose another --out",
                path.display()
            );
            return Ok(Some(run));
        }
        if path.exists() {
            Self::locked(path.to_path_buf(), place.command)?.clear()?;
        }
        Self::create(&Place { out: Some(path), ..*place }, settings).map(Some)
    }

    /// Takes the lock of a folder that is there.
    fn locked(path: PathBuf, command: &str) -> anyhow::Result<Self> {
        let lock = Arc::new(Lock::take(&path, command)?);
        Ok(Self { path, _lock: lock })
    }

    fn claim_named(path: &Path, place: &Place<'_>) -> anyhow::Result<Self> {
        fs::create_dir_all(path)
            .with_context(|| format!("{}: cannot be created; choose another --out", path.display()))?;
        let is_empty = fs::read_dir(path)?.all(|entry| entry.is_ok_and(|entry| entry.file_name() == lock::FILE));
        let is_run = path.join(SETTINGS).is_file();
        // Before the lock is taken: nothing is written into a folder that is no run.
        if !is_empty && !is_run {
            let way_out =
                if place.overwrite { "so --overwrite will not delete it; choose" } else { "and not empty; choose" };
            bail!("{}: this folder is not a run, {way_out} another --out", path.display());
        }
        let run = Self::locked(path.to_path_buf(), place.command)?;
        if is_run {
            let path = path.display();
            ensure!(
                place.overwrite || is_finished(&run.path),
                "{path}: this folder is not empty; continue it with --resume {path}, choose another --out, or delete it \
                 with --overwrite"
            );
            ensure!(
                place.overwrite,
                "{path}: this folder is not empty; choose another --out, or delete it with --overwrite"
            );
            run.clear()?;
        }
        Ok(run)
    }

    /// `runs/NAME`, or with the next free number. Creating the folder is the claim: two commands started at once get two.
    fn claim_next_free(place: &Place<'_>) -> anyhow::Result<Self> {
        let name = format!("{}-{}-s{}", place.command, place.preset, place.seed);
        let runs = Path::new("runs");
        fs::create_dir_all(runs).context("runs: cannot be created here; choose a folder with --out")?;
        let mut n = 1;
        loop {
            let path = runs.join(if n == 1 { name.clone() } else { format!("{name}-{n}") });
            match fs::create_dir(&path) {
                Ok(()) => return Self::locked(path, place.command),
                Err(error) if error.kind() == std::io::ErrorKind::AlreadyExists => n += 1,
                Err(error) => {
                    return Err(error).with_context(|| format!("{}: choose a folder with --out", path.display()));
                }
            }
        }
    }

    /// Deletes everything but the lock. The settings go last: until then the folder is known as a run.
    fn clear(&self) -> anyhow::Result<()> {
        let delete = || {
            let mut entries = fs::read_dir(&self.path)?.collect::<Result<Vec<_>, _>>()?;
            entries.sort_by_key(|entry| entry.file_name() == SETTINGS);
            for entry in entries {
                if entry.file_type()?.is_dir() {
                    fs::remove_dir_all(entry.path())?;
                } else if entry.file_name() != lock::FILE {
                    fs::remove_file(entry.path())?;
                }
            }
            Ok::<_, std::io::Error>(())
        };
        delete().with_context(|| format!("{}: cannot be deleted", self.path.display()))
    }

    /// The folder.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Writes a file under a temporary name and renames it, so that it never exists half-written.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn write(&self, name: &str, content: &[u8]) -> anyhow::Result<()> {
        Ok(storage::whole::write(&self.path.join(name), content)?)
    }

    /// Marks the run as finished.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn finish(&self, outcome: Outcome) -> anyhow::Result<()> {
        let finished = Finished { schema: FINISHED_SCHEMA, outcome };
        self.write(FINISHED, toml::to_string(&finished)?.as_bytes())
    }
}

/// Whether a run is finished.
pub fn is_finished(path: &Path) -> bool {
    path.join(FINISHED).is_file()
}

/// The folder with the checkpoint that `run:DIR` or `run:DIR/bc` names.
///
/// # Errors
/// If there is no run, or no network in it yet.
pub fn policy_folder(spec: &Path) -> anyhow::Result<PathBuf> {
    let (run, is_bc) = run_of(spec)?;
    let last = if is_bc {
        Some(run.join("round-00"))
    } else {
        let mut rounds: Vec<PathBuf> = fs::read_dir(run)
            .with_context(|| run.display().to_string())?
            .filter_map(|entry| Some(entry.ok()?.path()))
            .filter(|path| path.file_name().is_some_and(|name| name.to_string_lossy().starts_with("round-")))
            .filter(|path| Checkpoint::exists(path))
            .collect();
        rounds.sort();
        let last_fit = Some(run.join("final")).filter(|path| Checkpoint::exists(path));
        last_fit.or_else(|| rounds.pop())
    };
    last.filter(|path| Checkpoint::exists(path))
        .with_context(|| format!("{}: no network is trained there yet; finish it with --resume {0}", run.display()))
}

/// The settings of the run that `run:DIR` or `run:DIR/bc` names.
///
/// # Errors
/// If there is no run, or its settings are not of this program.
pub fn settings_of(spec: &Path) -> anyhow::Result<Settings> {
    Settings::read(&run_of(spec)?.0.join(SETTINGS))
}

/// The folder of the run, and whether its policy after behaviour cloning is meant.
fn run_of(spec: &Path) -> anyhow::Result<(&Path, bool)> {
    let (run, is_bc) = match (spec.file_name(), spec.parent()) {
        (Some(name), Some(run)) if name == "bc" && !spec.is_dir() => (run, true),
        _ => (spec, false),
    };
    ensure!(
        run.join(SETTINGS).is_file(),
        "{}: this is no run; train one with cargo xtask train-dagger, or list the folders in runs/",
        run.display()
    );
    Ok((run, is_bc))
}

impl Manifest {
    fn new(build: &Build, preset: &str, settings: &Settings) -> Self {
        Self {
            schema: MANIFEST_SCHEMA,
            program: build.program.clone(),
            command_line: build.command_line.clone(),
            preset: preset.to_owned(),
            root_seed: settings.seed.0,
            evaluation_seed: settings.evaluation.seed.0,
            git_revision: build.git_revision.clone(),
            git_dirty: build.git_dirty,
            rustc_version: build.rustc_version.clone(),
            threads: rayon::current_num_threads(),
            target: format!("{}-{}", std::env::consts::ARCH, std::env::consts::OS),
            processor: build.processor.clone(),
        }
    }

    /// Reads the manifest of a run.
    ///
    /// # Errors
    /// If it cannot be read or is of another version.
    pub fn read(run: &Path) -> anyhow::Result<Self> {
        let path = run.join(MANIFEST);
        let text = storage::read::text(&path, RUN_TOML_BYTES_MAX)
            .with_context(|| format!("{}: cannot be read", path.display()))?;
        let table: toml::Table = text.parse().with_context(|| path.display().to_string())?;
        let schema = table.get("schema").and_then(toml::Value::as_integer).unwrap_or(0);
        ensure!(
            schema == i64::from(MANIFEST_SCHEMA),
            "{}: written by another version of lotpilot (schema {schema}, this one reads {MANIFEST_SCHEMA}); make the \
             run again, or use the revision it names",
            path.display()
        );
        table.try_into().with_context(|| path.display().to_string())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use policy::conditions::Conditions;
    use policy::network::Weights;
    use sim::seed::RootSeed;
    use std::sync::LazyLock;

    fn scratch(name: &str) -> PathBuf {
        let path = std::env::temp_dir().join(format!("xtask-test-{}-{name}", std::process::id()));
        let _ = fs::remove_dir_all(&path);
        path
    }

    fn build() -> &'static Build {
        static BUILD: LazyLock<Build> = LazyLock::new(Build::default);
        &BUILD
    }

    fn place(out: &Path, overwrite: bool) -> Place<'_> {
        Place { build: build(), out: Some(out), overwrite, command: "train-dagger", preset: "smoke", seed: 1 }
    }

    fn create(out: &Path, overwrite: bool) -> anyhow::Result<RunDir> {
        RunDir::create(&place(out, overwrite), &Settings::preset("smoke")?)
    }

    fn stage(out: &Path) -> anyhow::Result<Option<RunDir>> {
        RunDir::stage(out, &place(out, false), &Settings::preset("smoke")?)
    }

    fn message<T: std::fmt::Debug>(result: anyhow::Result<T>) -> String {
        format!("{:#}", result.unwrap_err())
    }

    #[test]
    fn a_run_is_resumed_until_finished_and_overwritten_only_when_told() {
        let path = scratch("claim");
        drop(create(&path, false).unwrap());
        assert!(message(create(&path, false)).contains("--resume"));
        let (run, settings) = RunDir::resume(&path, "train-dagger").unwrap();
        assert_eq!(settings, Settings::preset("smoke").unwrap());
        run.finish(Outcome::Reproduction { stages: 8 }).unwrap();
        drop(run);
        assert!(message(RunDir::resume(&path, "train-dagger")).contains("finished"));
        assert!(message(create(&path, false)).contains("--overwrite"));
        create(&path, true).unwrap();
        assert!(!path.join(FINISHED).exists());
        fs::remove_dir_all(path).unwrap();
    }

    /// Both wrote into it, and what came out was of neither.
    #[test]
    fn a_run_has_one_owner_at_a_time() {
        let path = scratch("owner");
        let run = create(&path, false).unwrap();
        let owner = format!("in use by train-dagger, process {}", std::process::id());
        for refused in [
            message(create(&path, false)),
            message(create(&path, true)),
            message(RunDir::resume(&path, "train-bc")),
            message(RunDir::reopen(&path, "render")),
            message(stage(&path)),
        ] {
            assert!(refused.contains(&owner), "{refused}");
        }
        assert!(path.join(SETTINGS).is_file(), "nothing is deleted");
        drop(run);
        create(&path, true).unwrap();
        fs::remove_dir_all(path).unwrap();
    }

    #[test]
    fn a_folder_that_is_no_run_is_never_deleted() {
        let path = scratch("foreign");
        fs::create_dir_all(&path).unwrap();
        fs::write(path.join("thesis.txt"), "years of work").unwrap();
        assert!(message(create(&path, true)).contains("not a run"));
        assert!(path.join("thesis.txt").exists());
        fs::remove_dir_all(path).unwrap();
    }

    #[test]
    fn the_policy_of_a_run_is_its_last_network() {
        let path = scratch("policy");
        assert!(message(policy_folder(&path)).contains("this is no run"));
        create(&path, false).unwrap();
        assert!(message(policy_folder(&path)).contains("no network"));
        let settings = Settings::preset("smoke").unwrap();
        let weights = Weights::init(settings.dagger.network, RootSeed(1), 0);
        let checkpoint =
            Checkpoint { weights, conditions: Conditions::of(&settings.episode), inference: settings.dagger.inference };
        for round in ["round-00", "round-01", "round-10"] {
            checkpoint.save(&path.join(round)).unwrap();
        }
        fs::create_dir_all(path.join("round-11")).unwrap(); // collected, not trained yet
        assert_eq!(policy_folder(&path).unwrap(), path.join("round-10"));
        assert_eq!(policy_folder(&path.join("bc")).unwrap(), path.join("round-00"));
        checkpoint.save(&path.join("final")).unwrap();
        assert_eq!(policy_folder(&path).unwrap(), path.join("final"));
        fs::remove_dir_all(path).unwrap();
    }
}
