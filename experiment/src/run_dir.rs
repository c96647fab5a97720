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
//!   sha256sums         the digest of every finished file; it appears with the claim
//!   .lock              who writes here
//! ```

use crate::settings::Settings;
use anyhow::{Context as _, anyhow, bail, ensure};
use policy::dagger::Stop;
use serde::{Deserialize, Serialize};
use sim::limits::{RUN_TOML_BYTES_MAX, SETTINGS_BYTES_MAX};
use sim::seed::RootSeed;
use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use storage::lock::{self, Lock};
use storage::{sums, whole};

const MANIFEST: &str = "manifest.toml";
const SETTINGS: &str = "settings.toml";
const FINISHED: &str = "finished.toml";

/// A claimed folder: nobody else writes into it until the last clone is dropped, or the process ends.
#[derive(Debug, Clone)]
pub struct RunDir {
    path: PathBuf,
    /// The run that this is a folder of, and its path there.
    within: Option<(PathBuf, String)>,
    lock: Arc<Lock>,
    /// What the run, and the one that it is within, were begun with.
    inputs: Arc<Inputs>,
    /// Of that run, where this folder was reopened by itself.
    _lock_of_run: Option<Arc<Lock>>,
}

/// SHA-256 of what is read from elsewhere by name, as on the command line: see [`inputs`](crate::inputs).
pub type Inputs = BTreeMap<String, String>;

/// What a run was asked for beside its settings, and what it reads from elsewhere.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Request {
    /// Arguments of the command.
    pub arguments: toml::Table,
    /// Lots, parameters and networks from files.
    pub inputs: Inputs,
}

/// A training that may have been done several times, with other seeds.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Training {
    /// What all of them have in common: SHA-256 of the program's version, the settings but seed and evaluation, the lots from
    /// files, and which policy of the run it is.
    pub recipe: String,
    /// Its root seed.
    pub seed: RootSeed,
    /// Lots that it was trained on, as in its settings.
    pub lots: Vec<String>,
    /// SHA-256 of those from files: they are known by it wherever they lie now.
    pub digests: BTreeSet<String>,
}

/// What made a run: `manifest.toml`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// Version of this format: [`MANIFEST_SCHEMA`].
    pub schema: u32,
    /// The name and version of the program.
    pub program: String,
    /// The command that made it, and alone can go on with it.
    pub command: String,
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
    /// Its instructions that sums of networks may depend on: `avx2`, `fma`, …
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub processor_features: Vec<String>,
    /// The libraries that compute, with their versions: `libm 0.2.16`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub libraries: Vec<String>,
    /// What was asked for beside the settings.
    #[serde(default, skip_serializing_if = "toml::Table::is_empty")]
    pub arguments: toml::Table,
    /// SHA-256 of what was read from elsewhere.
    #[serde(default, skip_serializing_if = "Inputs::is_empty")]
    pub inputs: Inputs,
}

/// The version of `manifest.toml` that this program writes.
pub const MANIFEST_SCHEMA: u32 = 3;

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
    /// Its instructions that sums of networks may depend on.
    pub processor_features: Vec<String>,
    /// The libraries that compute, with their versions.
    pub libraries: Vec<String>,
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
    /// Claims a folder with settings and manifest: it is a run from the moment in which both are listed.
    ///
    /// # Errors
    /// If the folder is taken, in use by another process, or cannot be written.
    pub fn create(place: &Place<'_>, settings: &Settings, request: &Request) -> anyhow::Result<Self> {
        if let Some(out) = place.out {
            ensure_outside_of_runs(out)?;
        }
        Self::create_anywhere(place, settings, request)
    }

    /// Like [`create`](Self::create), within a run as well.
    fn create_anywhere(place: &Place<'_>, settings: &Settings, request: &Request) -> anyhow::Result<Self> {
        let run = match place.out {
            Some(out) => Self::claim_named(out, place)?,
            None => Self::claim_next_free(place)?,
        };
        let manifest = toml::to_string(&Manifest::new(place, settings, request)).expect("a manifest is plain values");
        whole::write(&run.path.join(SETTINGS), settings.to_toml().as_bytes())?;
        whole::write(&run.path.join(MANIFEST), manifest.as_bytes())?;
        sums::list(&run.path, &[SETTINGS, MANIFEST])?;
        Ok(Self { inputs: Arc::new(request.inputs.clone()), ..run })
    }

    /// Reopens the folder of an interrupted run.
    ///
    /// # Errors
    /// If there is none, another command made it, it is finished, its settings were changed, or another process is at it.
    pub fn resume(path: &Path, command: &str) -> anyhow::Result<(Self, Settings, Manifest)> {
        ensure!(path.is_dir(), "{}: there is no such run to resume", path.display());
        // Before the lock, which would leave its file in a folder that is no run.
        ensure!(
            sums::exists(path)?,
            "{0}: nothing was begun there; begin it anew with --out {0}, with --overwrite if it is not empty",
            path.display()
        );
        let run = Self::locked(path.to_path_buf(), command)?;
        let manifest = Manifest::read(path)?;
        ensure!(
            manifest.command == command,
            "{}: this is a run of {}; go on with: cargo xtask {1} --resume {0}",
            path.display(),
            manifest.command
        );
        ensure!(!is_finished(path)?, "{}: this run is finished; nothing is left to resume", path.display());
        let run = Self { inputs: Arc::new(manifest.inputs.clone()), ..run };
        Ok((run, settings_of(path)?, manifest))
    }

    /// Reopens the folder of a run, or of a finished stage of one, to write into it, whether it is finished or not.
    ///
    /// # Errors
    /// If there is none, or another process is at it.
    pub fn reopen(path: &Path, command: &str) -> anyhow::Result<Self> {
        ensure!(sums::exists(path)?, "{}: this is no run; list the folders in runs/", path.display());
        let own = Self::locked(path.to_path_buf(), command)?;
        let Some((run, list)) = run_around(path)? else { return Ok(own) };
        let lock = Arc::new(Lock::take(&run, command)?);
        Ok(Self { within: Some((run, list)), _lock_of_run: Some(lock), ..own })
    }

    /// Claims a folder within this run: `None` if it is finished, else as an interrupted command left it or new. It
    /// belongs to the run: what cannot be continued there is started again.
    ///
    /// # Errors
    /// If it is listed as finished but is not, was begun with other settings, is in use by another process, or cannot be
    /// written.
    pub fn stage(&self, folder: &str, place: &Place<'_>, settings: &Settings) -> anyhow::Result<Option<Self>> {
        self.stage_for(folder, place, settings, || Ok(Request::default()))
    }

    /// Like [`stage`](Self::stage), with what a new one was asked for beside its settings.
    ///
    /// # Errors
    /// See [`stage`](Self::stage); or if `request` fails.
    pub fn stage_for(
        &self,
        folder: &str,
        place: &Place<'_>,
        settings: &Settings,
        request: impl FnOnce() -> anyhow::Result<Request>,
    ) -> anyhow::Result<Option<Self>> {
        self.ensure_held()?;
        let (path, list) = (self.path.join(folder), format!("{folder}/{}", sums::FILE));
        if sums::is_listed(&self.path, &list)? {
            sums::read_listed(&self.path, &list, sums::LIST_BYTES_MAX)?;
            return Ok(None);
        }
        if is_finished(&path)? {
            // A death between the two, or another run that somebody put there.
            let Manifest { command, inputs, .. } = Manifest::read(&path)?;
            ensure!(
                command == place.command && settings_of(&path)? == *settings,
                "{}: this is another run, not a stage of this one; move it elsewhere, and go on with --resume",
                path.display()
            );
            let now = request()?.inputs;
            let changed = inputs.iter().find(|(name, digest)| now.get(*name) != Some(*digest));
            changed.map_or(Ok(()), |(name, _)| Err(has_changed(name)))?;
            sums::list(&self.path, &[&list])?;
            return Ok(None);
        }
        let stage = if sums::exists(&path)? {
            let (stage, found, _) = Self::resume(&path, place.command)?;
            ensure!(
                found == *settings,
                "{}: this stage was begun with other settings; delete the folder, or choose another --out",
                path.display()
            );
            stage
        } else {
            if path.exists() {
                Self::locked(path.clone(), place.command)?.clear()?;
            }
            // Whoever goes on with the run makes the same of it as the command that began it.
            let build = Build { command_line: Manifest::read(&self.path)?.command_line, ..place.build.clone() };
            let request = request()?;
            self.ensure_unchanged(&request.inputs)?;
            Self::create_anywhere(&Place { build: &build, out: Some(&path), ..*place }, settings, &request)?
        };
        // What the run was begun with counts.
        let inputs = stage.inputs.iter().chain(self.inputs.iter()).map(|(name, of)| (name.clone(), of.clone()));
        Ok(Some(Self { inputs: Arc::new(inputs.collect()), within: Some((self.path.clone(), list)), ..stage }))
    }

    /// Refuses to write on where the folder is another one now.
    ///
    /// # Errors
    /// If it was deleted or moved since it was claimed.
    pub fn ensure_held(&self) -> anyhow::Result<()> {
        Ok(self.lock.ensure_held()?)
    }

    /// Refuses lots, parameters and networks that are not what the run was begun with: they may have changed since they were
    /// read for the first time. Networks that the run itself makes are not among them.
    ///
    /// # Errors
    /// Naming what differs.
    pub fn ensure_unchanged(&self, found: &Inputs) -> anyhow::Result<()> {
        let changed = found.iter().find(|(name, digest)| self.inputs.get(*name).is_some_and(|begun| begun != *digest));
        changed.map_or(Ok(()), |(name, _)| Err(has_changed(name)))
    }

    /// Takes the lock of a folder that is there.
    fn locked(path: PathBuf, command: &str) -> anyhow::Result<Self> {
        let lock = Arc::new(Lock::take(&path, command)?);
        Ok(Self { path, within: None, lock, inputs: Arc::default(), _lock_of_run: None })
    }

    fn claim_named(path: &Path, place: &Place<'_>) -> anyhow::Result<Self> {
        fs::create_dir_all(path)
            .with_context(|| format!("{}: cannot be created; choose another --out", path.display()))?;
        // Before the lock is taken: nothing is written into a folder that is no run.
        ensure_free_or_run(path, place.overwrite)?;
        let run = Self::locked(path.to_path_buf(), place.command)?;
        // Whoever had the lock before may have made a run of it.
        ensure_free_or_run(path, place.overwrite)?;
        if !is_free(path)? {
            let name = path.display();
            ensure!(
                place.overwrite || path.join(FINISHED).is_file(),
                "{name}: this folder is not empty; continue it with --resume {name}, choose another --out, or delete it \
                 with --overwrite"
            );
            ensure!(
                place.overwrite,
                "{name}: this folder is not empty; choose another --out, or delete it with --overwrite"
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

    /// Deletes everything but the lock. The manifest goes last: until then the folder is known as a run.
    fn clear(&self) -> anyhow::Result<()> {
        let delete = || {
            let mut entries = fs::read_dir(&self.path)?.collect::<Result<Vec<_>, _>>()?;
            entries.sort_by_key(|entry| (entry.file_name() == MANIFEST, entry.file_name() == sums::FILE));
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

    /// Lists this folder anew in the run that it is a finished folder of, after something was written into it.
    ///
    /// # Errors
    /// If a list cannot be read or written.
    pub fn list_again(&self) -> anyhow::Result<()> {
        self.ensure_held()?;
        let listed = self.within.as_ref().map(|(run, list)| sums::list(run, &[list]));
        Ok(listed.unwrap_or(Ok(()))?)
    }

    /// The folder.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Writes a file and lists it: it is there whole or not at all.
    ///
    /// # Errors
    /// If it cannot be written, or the folder was deleted or moved meanwhile.
    pub fn write(&self, name: &str, content: &[u8]) -> anyhow::Result<()> {
        self.ensure_held()?;
        Ok(sums::write(&self.path, name, content)?)
    }

    /// Marks the run as finished, in the run that it is a folder of as well.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn finish(&self, outcome: Outcome) -> anyhow::Result<()> {
        let finished = Finished { schema: FINISHED_SCHEMA, outcome };
        self.write(FINISHED, toml::to_string(&finished)?.as_bytes())?;
        if let Some((run, list)) = &self.within {
            sums::list(run, &[list])?;
        }
        Ok(())
    }
}

fn has_changed(name: &str) -> anyhow::Error {
    anyhow!("{name}: changed since this run was begun; restore it, or begin again into another folder")
}

/// Refuses a folder or file within a run, whose files would no longer be its own alone.
///
/// # Errors
/// Naming the run.
pub fn ensure_outside_of_runs(folder: &Path) -> anyhow::Result<()> {
    let place = storage::place_of(folder).with_context(|| folder.display().to_string())?;
    if let Some(run) = place.ancestors().skip(1).find(|around| Manifest::is_in(around)) {
        bail!("{}: lies within the run {}; choose a place outside of it", folder.display(), run.display());
    }
    Ok(())
}

/// Refuses a folder with anything in it but a run.
fn ensure_free_or_run(path: &Path, overwrite: bool) -> anyhow::Result<()> {
    if !is_free(path)? && !Manifest::is_in(path) {
        let way_out = if overwrite { "so --overwrite will not delete it; choose" } else { "and not empty; choose" };
        bail!("{}: this folder is not a run, {way_out} another --out", path.display());
    }
    Ok(())
}

/// Whether a folder can be claimed as it is: there is nothing, or what a process leaves that dies before its claim, which is
/// never without the lock.
fn is_free(path: &Path) -> anyhow::Result<bool> {
    let names = fs::read_dir(path).and_then(|entries| entries.map(|entry| Ok(entry?.file_name())).collect());
    let names: Vec<_> = names.with_context(|| path.display().to_string())?;
    let is_of_claim =
        |name: &OsString| name == SETTINGS || name == MANIFEST || name.to_string_lossy().ends_with(".partial");
    let is_locked = names.iter().any(|name| name == lock::FILE);
    Ok(names.iter().all(|name| name == lock::FILE || is_of_claim(name)) && (names.is_empty() || is_locked))
}

/// The run that lists a folder within it, and the name of the folder's list there.
fn run_around(folder: &Path) -> anyhow::Result<Option<(PathBuf, String)>> {
    let mut list = PathBuf::from(sums::FILE);
    // It may be named by a link, or as `.`.
    let folder = folder.canonicalize().with_context(|| folder.display().to_string())?;
    let mut folder = folder.as_path();
    while let (Some(parent), Some(name)) = (folder.parent(), folder.file_name()) {
        list = Path::new(name).join(list);
        let listed = list.to_string_lossy();
        // Lists that other programs left are not read.
        if Manifest::is_in(parent) && sums::is_listed(parent, &listed)? {
            return Ok(Some((parent.to_owned(), listed.into_owned())));
        }
        folder = parent;
    }
    Ok(None)
}

/// One SHA-256 of all that a run wrote, but for what differs from one repetition to the next: wall times, the manifest, and
/// the reports that show it. The same for the same command on another machine, if it computed the same.
///
/// # Errors
/// If a list is missing or damaged.
pub fn digest(path: &Path) -> anyhow::Result<String> {
    const DIFFERENT: [&str; 5] = [MANIFEST, FINISHED, "wall_time.jsonl", "report.html", "report.md"];
    Ok(sums::digest_of_all(path, &DIFFERENT)?)
}

/// What a run came to; `None` if it is not finished.
///
/// # Errors
/// If the file is missing, damaged or of another version.
pub fn finished(path: &Path) -> anyhow::Result<Option<Finished>> {
    let file = path.join(FINISHED);
    let Some(text) = sums::read_if_listed(&file, RUN_TOML_BYTES_MAX)? else { return Ok(None) };
    let text = String::from_utf8(text).with_context(|| file.display().to_string())?;
    let finished: Finished = toml::from_str(&text).with_context(|| file.display().to_string())?;
    ensure!(
        finished.schema == FINISHED_SCHEMA,
        "{}: written by another version of lotpilot (schema {}, this one reads {FINISHED_SCHEMA})",
        file.display(),
        finished.schema
    );
    Ok(Some(finished))
}

/// Whether a run is finished.
///
/// # Errors
/// See [`finished`].
pub fn is_finished(path: &Path) -> anyhow::Result<bool> {
    Ok(finished(path)?.is_some())
}

/// The folder with the checkpoint that `run:DIR` or `run:DIR/bc` names.
///
/// # Errors
/// If there is no run, no network in it yet, or one of its rounds is missing or incomplete.
pub fn policy_folder(spec: &Path) -> anyhow::Result<PathBuf> {
    let (run, is_bc) = run_of(spec)?;
    let names = sums::names(run)?;
    let folders = names.iter().filter_map(|name| name.strip_suffix(&format!("/{}", sums::FILE)));
    // Not `round-01-critic`: what is trained beside the network of a round.
    let round_of = |folder: &str| folder.strip_prefix("round-")?.parse::<u32>().ok();
    let mut folders: Vec<&str> = folders.filter(|folder| *folder == "final" || round_of(folder).is_some()).collect();
    let rounds = folders.iter().filter(|folder| **folder != "final").count();
    if let Some(Finished { outcome: Outcome::Training { rounds: expected, .. }, .. }) = finished(run)? {
        ensure!(
            rounds == expected,
            "{}: {rounds} rounds are listed of {expected} that were finished; restore sha256sums from a copy, or train \
             again into another folder",
            run.display()
        );
    }
    folders.sort_by_key(|folder| (*folder == "final", round_of(folder)));
    let folder = if is_bc { folders.first() } else { folders.last() };
    let folder = folder.with_context(|| {
        let command = Manifest::read(run).map_or_else(|_| "another command".to_owned(), |manifest| manifest.command);
        if command.starts_with("train-") {
            format!("{}: no network is trained there yet; finish it with --resume {0}", run.display())
        } else {
            format!("{}: this is a run of {command}, which has no network of its own; name a training", run.display())
        }
    })?;
    sums::read_listed(run, &format!("{folder}/{}", sums::FILE), sums::LIST_BYTES_MAX)?;
    Ok(run.join(folder))
}

/// The folders with the checkpoints that drive as `run:DIR` or `run:DIR/bc`: the policy and, if the decision rule
/// has an ensemble drive, its other members. A final fit, and `bc`, are one network.
///
/// # Errors
/// See [`policy_folder`].
pub fn driving_folders(spec: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let policy = policy_folder(spec)?;
    let (run, is_bc) = run_of(spec)?;
    // Damage is an error. Settings that are whole may be of another version: the network alone can be used then.
    sums::read(&run.join(SETTINGS), SETTINGS_BYTES_MAX)?;
    let members = settings_of(spec).map_or(1, |settings| settings.dagger.rule.members());
    let round = policy.file_name().and_then(|name| name.to_str()).filter(|name| !is_bc && name.starts_with("round-"));
    let others = round.into_iter().flat_map(|round| (1..members).map(move |member| format!("{round}-member-{member}")));
    let others: Vec<PathBuf> = others
        .map(|member| {
            sums::read_listed(run, &format!("{member}/{}", sums::FILE), sums::LIST_BYTES_MAX)?;
            Ok(run.join(member))
        })
        .collect::<anyhow::Result<_>>()?;
    Ok(std::iter::once(policy).chain(others).collect())
}

/// The settings of the run that `run:DIR` or `run:DIR/bc` names.
///
/// # Errors
/// If there is no run, or its settings are not of this program.
pub fn settings_of(spec: &Path) -> anyhow::Result<Settings> {
    Settings::read(&run_of(spec)?.0.join(SETTINGS))
}

/// What a policy `DIR` or `DIR/bc` was trained by.
///
/// # Errors
/// See [`settings_of`].
pub fn training_of(spec: &Path) -> anyhow::Result<Training> {
    let mut settings = settings_of(spec)?;
    let seed = std::mem::replace(&mut settings.seed, RootSeed(0));
    settings.evaluation = Settings::preset("default")?.evaluation;
    let policy = if run_of(spec)?.1 { "bc" } else { "final" };
    let Manifest { program, inputs, .. } = Manifest::read(run_of(spec)?.0)?;
    let digests: Vec<_> = settings.training.lots.iter().map(|lots| inputs.get(lots)).collect();
    let recipe = sums::digest(format!("{policy}\n{program}\n{digests:?}\n{}", settings.to_toml()).as_bytes());
    let digests = digests.into_iter().flatten().cloned().collect();
    Ok(Training { recipe, seed, lots: settings.training.lots, digests })
}

/// The folder of the run, and whether its policy after behaviour cloning is meant.
fn run_of(spec: &Path) -> anyhow::Result<(&Path, bool)> {
    let (run, is_bc) = match (spec.file_name(), spec.parent()) {
        (Some(name), Some(run)) if name == "bc" && !spec.is_dir() => (run, true),
        _ => (spec, false),
    };
    ensure!(
        sums::exists(run)? || !run.join(SETTINGS).is_file(),
        "{}: this run has no sha256sums: an earlier version made it, or the list is lost; train again into another folder, \
         or restore the list from a copy",
        run.display()
    );
    ensure!(
        sums::exists(run)?,
        "{}: this is no run; train one with cargo xtask train-dagger, or list the folders in runs/",
        run.display()
    );
    Ok((run, is_bc))
}

/// Architecture and operating system.
fn target() -> String {
    format!("{}-{}", std::env::consts::ARCH, std::env::consts::OS)
}

impl Manifest {
    fn new(place: &Place<'_>, settings: &Settings, request: &Request) -> Self {
        let Place { build, command, preset, .. } = *place;
        Self {
            schema: MANIFEST_SCHEMA,
            program: build.program.clone(),
            command: command.to_owned(),
            command_line: build.command_line.clone(),
            preset: preset.to_owned(),
            root_seed: settings.seed.0,
            evaluation_seed: settings.evaluation.seed.0,
            git_revision: build.git_revision.clone(),
            git_dirty: build.git_dirty,
            rustc_version: build.rustc_version.clone(),
            threads: rayon::current_num_threads(),
            target: target(),
            processor: build.processor.clone(),
            processor_features: build.processor_features.clone(),
            libraries: build.libraries.clone(),
            arguments: request.arguments.clone(),
            inputs: request.inputs.clone(),
        }
    }

    /// Whether what is read from elsewhere is what the run was begun with.
    ///
    /// # Errors
    /// Naming what differs.
    pub fn check_inputs(&self, found: &Inputs) -> anyhow::Result<()> {
        for (name, digest) in &self.inputs {
            if found.get(name) != Some(digest) {
                return Err(has_changed(name));
            }
        }
        ensure!(found.len() == self.inputs.len(), "this run was begun with other lots or drivers; begin again");
        Ok(())
    }

    /// Whether the run was made on this architecture and system.
    pub fn is_of_this_target(&self) -> bool {
        self.target == target()
    }

    /// Whether the same program made another run: by name, version and revision.
    pub fn is_of_version_of(&self, other: &Self) -> bool {
        (&self.program, &self.git_revision, self.git_dirty) == (&other.program, &other.git_revision, other.git_dirty)
    }

    /// Whether a folder holds a manifest, of whatever version: the folder is a run then, and not something else with files
    /// of the same names.
    fn is_in(folder: &Path) -> bool {
        let text = storage::read::text(&folder.join(MANIFEST), RUN_TOML_BYTES_MAX).unwrap_or_default();
        let table: toml::Table = text.parse().unwrap_or_default();
        ["schema", "program", "command", "preset", "root_seed"].iter().all(|key| table.contains_key(*key))
    }

    /// Reads the manifest of a run.
    ///
    /// # Errors
    /// If it is missing, damaged or of another version.
    pub fn read(run: &Path) -> anyhow::Result<Self> {
        let path = run.join(MANIFEST);
        let text = sums::read_to_string(&path, RUN_TOML_BYTES_MAX)?;
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
    use policy::checkpoint::Checkpoint;
    use policy::conditions::Conditions;
    use policy::decision_rule::DecisionRule;
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
        RunDir::create(&place(out, overwrite), &Settings::preset("smoke")?, &Request::default())
    }

    fn message<T: std::fmt::Debug>(result: anyhow::Result<T>) -> String {
        format!("{:#}", result.unwrap_err())
    }

    #[test]
    fn a_run_is_resumed_until_finished_and_overwritten_only_when_told() {
        let path = scratch("claim");
        drop(create(&path, false).unwrap());
        assert!(message(create(&path, false)).contains("--resume"));
        let (run, settings, _) = RunDir::resume(&path, "train-dagger").unwrap();
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
        ] {
            assert!(refused.contains(&owner), "{refused}");
        }
        assert!(path.join(SETTINGS).is_file(), "nothing is deleted");
        let settings = Settings::preset("smoke").unwrap();
        let stage = || run.stage("elsewhere", &place(&path, false), &settings);
        let first = stage().unwrap();
        assert!(message(stage()).contains(&owner), "a folder within a run has an owner, too");
        // A finished stage is free, but its list stands in that of the run.
        first.unwrap().finish(Outcome::Reproduction { stages: 1 }).unwrap();
        assert!(message(RunDir::reopen(&path.join("elsewhere"), "render")).contains(&owner));
        drop(run);
        let stage = RunDir::reopen(&path.join("elsewhere"), "render").unwrap();
        assert!(message(RunDir::reopen(&path, "render")).contains("in use by render"), "until the stage is written");
        stage.write("report.html", b"anew").unwrap();
        stage.list_again().unwrap();
        assert_eq!(sums::verify(&path).faults, []);
        drop(stage);
        create(&path, true).unwrap();
        fs::remove_dir_all(path).unwrap();
    }

    /// A finished run that somebody put in the place of a stage was taken for it, whatever its seed.
    #[test]
    fn another_run_in_the_place_of_a_stage_is_refused() {
        let (path, other) = (scratch("stages"), scratch("other-run"));
        let run = create(&path, false).unwrap();
        create(&other, false).unwrap().finish(Outcome::Reproduction { stages: 1 }).unwrap();
        fs::rename(&other, path.join("own")).unwrap();
        let mut settings = Settings::preset("smoke").unwrap();
        assert!(run.stage("own", &place(&path, false), &settings).unwrap().is_none(), "what a death left unlisted");
        fs::rename(path.join("own"), path.join("foreign")).unwrap();
        settings.seed = RootSeed(77);
        assert!(message(run.stage("foreign", &place(&path, false), &settings)).contains("this is another run"));
        let of_another_command = Place { command: "train-bc", ..place(&path, false) };
        let settings = Settings::preset("smoke").unwrap();
        assert!(message(run.stage("foreign", &of_another_command, &settings)).contains("this is another run"));
        fs::remove_dir_all(path).unwrap();
    }

    #[test]
    fn no_run_is_begun_within_another() {
        let path = scratch("within");
        let run = create(&path, false).unwrap();
        assert!(message(create(&path.join("elsewhere"), false)).contains("lies within the run"));
        assert!(message(create(&path.join("none/new"), true)).contains("lies within the run"));
        assert!(!path.join("none").exists());
        drop(run);
        fs::remove_dir_all(path).unwrap();
    }

    /// Whatever is there when a process dies while it claims a folder: the folder can be used.
    #[test]
    fn a_death_in_the_first_moments_leaves_a_folder_that_can_be_begun_again() {
        let path = scratch("first-moments");
        drop(create(&path, false).unwrap());
        let whole: Vec<_> =
            [SETTINGS, MANIFEST, sums::FILE].map(|name| (name, fs::read(path.join(name)).unwrap())).into();
        for written in 0..whole.len() {
            for overwrite in [false, true] {
                fs::remove_dir_all(&path).unwrap();
                fs::create_dir(&path).unwrap();
                fs::write(path.join(lock::FILE), "train-dagger, process 1\n").unwrap();
                whole[..written].iter().for_each(|(name, content)| fs::write(path.join(name), content).unwrap());
                fs::write(path.join(whole[written].0).with_added_extension("partial"), "half").unwrap();
                let refused = message(RunDir::resume(&path, "train-dagger"));
                assert!(refused.contains("nothing was begun there") && refused.contains("--out"), "{refused}");
                drop(create(&path, overwrite).unwrap());
                RunDir::resume(&path, "train-dagger").unwrap();
            }
        }
        fs::remove_dir_all(path).unwrap();
    }

    /// A refused `--resume` left a `.lock` in any folder that was named.
    #[test]
    fn a_folder_that_is_no_run_stays_as_it_was() {
        let path = scratch("no-run");
        fs::create_dir_all(&path).unwrap();
        assert!(message(RunDir::resume(&path, "train-dagger")).contains("nothing was begun there"));
        assert_eq!(fs::read_dir(&path).unwrap().count(), 0);
        assert!(message(policy_folder(&path)).contains("this is no run"));
        // A run of an earlier version was called no run at all.
        fs::write(path.join(SETTINGS), "").unwrap();
        assert!(message(policy_folder(&path)).contains("an earlier version made it"));
        fs::remove_dir_all(path).unwrap();
    }

    /// Another command went on with it, and settings outside the section `dagger` could be edited.
    #[test]
    fn a_run_is_continued_only_by_its_command_with_its_settings_and_inputs() {
        let path = scratch("continued");
        drop(create(&path, false).unwrap());
        assert!(message(RunDir::resume(&path, "evaluate")).contains("cargo xtask train-dagger --resume"));
        let settings = fs::read_to_string(path.join(SETTINGS)).unwrap();
        fs::write(path.join(SETTINGS), settings.replacen("trials = 1", "trials = 2", 1)).unwrap();
        let refused = message(RunDir::resume(&path, "train-dagger"));
        assert!(refused.contains("settings.toml: is damaged"), "{refused}");
        fs::write(path.join(SETTINGS), settings).unwrap();
        let (_, _, manifest) = RunDir::resume(&path, "train-dagger").unwrap();
        manifest.check_inputs(&Inputs::new()).unwrap();
        let begun = Manifest { inputs: Inputs::from([("lots/x.toml".to_owned(), "1".to_owned())]), ..manifest };
        begun.check_inputs(&begun.inputs).unwrap();
        let changed = Inputs::from([("lots/x.toml".to_owned(), "2".to_owned())]);
        assert!(message(begun.check_inputs(&changed)).contains("lots/x.toml: changed"));
        fs::remove_dir_all(path).unwrap();
    }

    /// A lot was read when the run was begun, and again hours later by a stage of it.
    #[test]
    fn a_lot_that_changes_under_a_run_is_refused_by_its_stages() {
        let path = scratch("under-a-run");
        let settings = Settings::preset("smoke").unwrap();
        let of = |digest: &str| Inputs::from([("lots/x.toml".to_owned(), digest.to_owned())]);
        let request = Request { inputs: of("1"), ..Request::default() };
        let run = RunDir::create(&place(&path, false), &settings, &request).unwrap();
        let stage = run.stage("drives", &place(&path, false), &settings).unwrap().unwrap();
        for run in [&run, &stage] {
            run.ensure_unchanged(&of("1")).unwrap();
            run.ensure_unchanged(&Inputs::from([("run:R/chains/one".to_owned(), "1".to_owned())])).unwrap();
            assert!(message(run.ensure_unchanged(&of("2"))).contains("lots/x.toml: changed"));
        }
        // Read anew for a stage that begins, it was right by definition.
        let begin = || Ok(Request { inputs: of("2"), ..Request::default() });
        let refused = message(run.stage_for("chains/two", &place(&path, false), &settings, begin));
        assert!(refused.contains("lots/x.toml: changed") && !path.join("chains/two").exists(), "{refused}");
        drop((stage, run));
        let (run, ..) = RunDir::resume(&path, "train-dagger").unwrap();
        assert!(run.ensure_unchanged(&of("2")).is_err());
        fs::remove_dir_all(path).unwrap();
    }

    /// What was written went into whatever lay at the place by then.
    #[cfg(unix)]
    #[test]
    fn a_run_whose_folder_was_deleted_writes_no_more() {
        let path = scratch("deleted");
        let run = create(&path, false).unwrap();
        fs::remove_dir_all(&path).unwrap();
        let other = create(&path, false).unwrap();
        assert!(message(run.write("table1.md", b"of the first")).contains("was deleted or moved"));
        assert!(message(run.finish(Outcome::Reproduction { stages: 1 })).contains("was deleted or moved"));
        other.write("table1.md", b"of the second").unwrap();
        fs::remove_dir_all(path).unwrap();
    }

    #[test]
    fn a_folder_within_a_run_is_begun_once_continued_and_listed_when_finished() {
        let path = scratch("stages");
        let settings = Settings::preset("smoke").unwrap();
        let run = create(&path, false).unwrap();
        let stage = || run.stage("chains/one", &place(&path, false), &settings);
        drop(stage().unwrap().unwrap());
        let again = stage().unwrap().unwrap();
        again.finish(Outcome::Evaluation { drivers: Vec::new() }).unwrap();
        drop(again);
        assert!(stage().unwrap().is_none());
        fs::remove_file(path.join("chains/one/sha256sums")).unwrap();
        assert!(message(stage()).contains("chains/one/sha256sums"), "listed as finished, but incomplete");
        let resumed = Build { command_line: vec!["--resume".to_owned()], ..build().clone() };
        run.stage("chains/two", &Place { build: &resumed, ..place(&path, false) }, &settings).unwrap().unwrap();
        assert_eq!(Manifest::read(&path.join("chains/two")).unwrap().command_line, build().command_line);
        fs::remove_dir_all(path).unwrap();
    }

    #[test]
    fn a_folder_that_is_no_run_is_never_deleted() {
        let path = scratch("foreign");
        fs::create_dir_all(&path).unwrap();
        fs::write(path.join("thesis.txt"), "years of work").unwrap();
        assert!(message(create(&path, true)).contains("not a run"));
        // Files that are called like those of a run do not make one.
        fs::write(path.join(SETTINGS), Settings::preset("smoke").unwrap().to_toml()).unwrap();
        fs::write(path.join(sums::FILE), "").unwrap();
        fs::write(path.join(MANIFEST), "program = \"another 1.0\"\ncommand = \"build\"\n").unwrap();
        assert!(message(create(&path, true)).contains("not a run"));
        assert!(path.join("thesis.txt").exists());
        fs::remove_dir_all(path).unwrap();
    }

    /// `evaluate` drove with the first network of an ensemble alone.
    #[test]
    fn a_run_whose_rule_has_an_ensemble_drives_with_all_of_it() {
        let path = scratch("members");
        let mut settings = Settings::preset("smoke").unwrap();
        settings.dagger.rule = DecisionRule::named("ensemble_dagger").unwrap();
        RunDir::create(&place(&path, false), &settings, &Request::default()).unwrap();
        let weights = Weights::init(settings.dagger.network, RootSeed(1), 0);
        let checkpoint =
            Checkpoint { weights, conditions: Conditions::of(&settings.episode), inference: settings.dagger.inference };
        let rounds = ["round-00", "round-01"].into_iter();
        let folders = rounds.flat_map(|round| ["", "-member-1", "-member-2"].map(|part| format!("{round}{part}")));
        for folder in folders {
            checkpoint.save(&path.join(&folder)).unwrap();
            sums::list(&path, &[&format!("{folder}/sha256sums")]).unwrap();
        }
        let of_last = ["round-01", "round-01-member-1", "round-01-member-2"].map(|folder| path.join(folder));
        assert_eq!(driving_folders(&path).unwrap(), of_last);
        assert_eq!(driving_folders(&path.join("bc")).unwrap(), [path.join("round-00")]);
        let whole = fs::read(path.join(SETTINGS)).unwrap();
        fs::write(path.join(SETTINGS), &whole[1..]).unwrap();
        assert!(message(driving_folders(&path)).contains("settings.toml"), "damage does not make one network of it");
        fs::write(path.join(SETTINGS), whole).unwrap();
        fs::remove_dir_all(&of_last[2]).unwrap();
        assert!(message(driving_folders(&path)).contains("round-01-member-2/sha256sums"));
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
        let save = |folder: &str| {
            checkpoint.save(&path.join(folder)).unwrap();
            sums::list(&path, &[&format!("{folder}/sha256sums")]).unwrap();
        };
        for folder in ["round-00", "round-01", "round-99", "round-100"] {
            save(folder);
        }
        save("round-100-critic"); // trained beside the network
        fs::create_dir_all(path.join("round-101")).unwrap(); // collected, not trained yet
        assert_eq!(policy_folder(&path).unwrap(), path.join("round-100"), "of 101 rounds the last but one drove");
        assert_eq!(policy_folder(&path.join("bc")).unwrap(), path.join("round-00"));
        save("final");
        assert_eq!(policy_folder(&path).unwrap(), path.join("final"));
        // A round that was lost is an error: another would drive under its name.
        fs::remove_dir_all(path.join("final")).unwrap();
        assert!(message(policy_folder(&path)).contains("final/sha256sums"));
        fs::remove_dir_all(path).unwrap();
    }
}
