//! The folder of a run: claimed before the first step, never overwritten by accident.
//!
//! ```text
//! runs/train-dagger-default-s1/
//!   manifest.toml      who made this: revision, compiler, command line, seed
//!   settings.toml      every setting
//!   round-00/ …        data, network and loss curve of each round (policy::dataset::store)
//!   table1.md .json    the paper's table from this run
//!   summary.md .json .csv, comparisons.csv, trainings.csv, noise_sweep.csv, runs.jsonl, failures.md .jsonl     (evaluate)
//!   report.html .md    what people read first; it quotes the command line
//!   wall_time.jsonl    differs from one repetition to the next, as manifest, report and lists of digests do, and nothing else
//!   finished.toml      written last
//!   sha256sums         the digest of every finished file; it appears with the claim
//!   .lock              who writes here
//! ```

use crate::command_line::quoted_path;
use crate::manifest::{
    Build, FINISHED, FINISHED_SCHEMA, Finished, Inputs, MANIFEST, Manifest, Outcome, Request, SETTINGS, has_changed,
    is_finished,
};
use crate::settings::Settings;
use anyhow::{Context as _, bail, ensure};
use sim::limits::RUN_TOML_BYTES_MAX;
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use storage::lock::{self, Lock};
use storage::{sums, whole};

/// A claimed folder: nobody else writes into it until the last clone is dropped, or the process ends.
#[derive(Debug, Clone)]
pub struct RunDir {
    path: PathBuf,
    /// The run that this folder belongs to, and its path there.
    within: Option<(PathBuf, String)>,
    lock: Arc<Lock>,
    /// What the run, and the one that it is within, were begun with.
    inputs: Arc<Inputs>,
    /// The lock of that run, where this folder was reopened by itself.
    _lock_of_run: Option<Arc<Lock>>,
}

/// Where a run goes.
#[derive(Debug, Clone, Copy)]
pub struct Place<'a> {
    /// Who makes it.
    pub build: &'a Build,
    /// The folder; `None`: the next free one in `runs/`.
    pub out: Option<&'a Path>,
    /// Whether to delete the folder of an earlier run there, with all that it holds.
    pub overwrite: bool,
    /// The command, as part of the folder's name.
    pub command: &'a str,
    /// Name of the preset.
    pub preset: &'a str,
    /// Seed, as part of the folder's name.
    pub seed: u64,
}

/// What is written with a report, as the folder lists it.
const OF_REPORT: [&str; 3] = ["report.html", "report.md", "figures/sha256sums"];

/// Where runs go that are not told where.
const RUNS: &str = "runs";

impl RunDir {
    /// Claims a folder with settings and manifest: it is a run from the moment in which both are listed.
    ///
    /// # Errors
    /// If the folder is taken, in use by another process, cannot be written, or is, holds or lies within what is read.
    pub fn create(place: &Place<'_>, settings: &Settings, request: &Request) -> anyhow::Result<Self> {
        ensure_outside_of_runs(place.out.unwrap_or(Path::new(RUNS)))?;
        place.out.map_or(Ok(()), |out| ensure_apart(out, &request.reads))?;
        Self::create_anywhere(place, settings, request)
    }

    /// Like [`create`](Self::create), within a run, or around what is read, as well.
    fn create_anywhere(place: &Place<'_>, settings: &Settings, request: &Request) -> anyhow::Result<Self> {
        let manifest = toml::to_string(&Manifest::new(place.build, [place.command, place.preset], settings, request))
            .expect("a manifest is plain values");
        let settings = settings.to_toml();
        for (what, text) in [("manifest", &manifest), ("settings", &settings)] {
            ensure!(
                text.len() as u64 <= RUN_TOML_BYTES_MAX,
                "the {what} of this run would have {} bytes, and at most {RUN_TOML_BYTES_MAX} are read; name fewer lots, drive \
                 fewer runs, or in more shards",
                text.len()
            );
        }
        let run = match place.out {
            Some(out) => Self::claim_named(out, place)?,
            None => Self::claim_next_free(place)?,
        };
        whole::write(&run.path.join(SETTINGS), settings.as_bytes())?;
        whole::write(&run.path.join(MANIFEST), manifest.as_bytes())?;
        sums::list(&run.path, &[SETTINGS, MANIFEST])?;
        Ok(Self { inputs: Arc::new(request.inputs.clone()), ..run })
    }

    /// Reopens the folder of an interrupted run.
    ///
    /// # Errors
    /// If there is none, it is part of another run, another command made it, it is finished, its settings were changed, or
    /// another process is using it.
    pub fn resume(path: &Path, command: &str) -> anyhow::Result<(Self, Settings, Manifest)> {
        if sums::exists(path)?
            && let Some(whole) = run_that_holds(path)?
        {
            bail!(
                "{}: this is a part of {}; continue with: cargo xtask {} --resume {}",
                path.display(),
                whole.display(),
                Manifest::read(&whole)?.command,
                quoted_path(&whole)
            );
        }
        Self::resume_anywhere(path, command)
    }

    /// [`resume`](Self::resume), also within another run.
    fn resume_anywhere(path: &Path, command: &str) -> anyhow::Result<(Self, Settings, Manifest)> {
        ensure!(path.is_dir(), "{}: there is no such run to resume", path.display());
        // Before the lock, which would leave its file in a folder that is not a run.
        if !sums::exists(path)? {
            let name = path.display();
            ensure!(
                is_free(path)? || !Manifest::is_in(path),
                "{name}: its list of files, sha256sums, is lost; restore it from a copy"
            );
            ensure!(is_free(path)?, "{name}: this is not a run; name the folder of one, as in runs/NAME");
            bail!("{name}: nothing was begun there; begin it with --out {}", quoted_path(path));
        }
        let run = Self::locked(path.to_path_buf(), command)?;
        let manifest = Manifest::read(path)?;
        ensure!(
            manifest.command == command,
            "{}: this is a run of {}; continue with: cargo xtask {1} --resume {}",
            path.display(),
            manifest.command,
            quoted_path(path)
        );
        ensure!(!is_finished(path)?, "{}: this run is finished; nothing is left to resume", path.display());
        let run = Self { inputs: Arc::new(manifest.inputs.clone()), ..run };
        Ok((run, Settings::read(&path.join(SETTINGS))?, manifest))
    }

    /// Reopens the folder of a run, or of a finished stage of one, to write its report into it, whether it is finished or
    /// not.
    ///
    /// # Errors
    /// If there is none, another process is using it, or it is not the stage that its run lists.
    pub fn reopen(path: &Path, command: &str) -> anyhow::Result<Self> {
        ensure!(sums::exists(path)?, "{}: this is not a run; list the folders in runs/", path.display());
        let own = Self::locked(path.to_path_buf(), command)?;
        let Some((run, name)) = run_around(path)? else { return Ok(own) };
        let lock = Arc::new(Lock::take(&run, command)?);
        // What is listed again is the run's own.
        sums::check_folder(&run, &name)?;
        Ok(Self { within: Some((run, name)), _lock_of_run: Some(lock), ..own })
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

    /// Like [`stage`](Self::stage), with what a new one was asked for besides its settings.
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
                command == place.command && Settings::read(&path.join(SETTINGS))? == *settings,
                "{}: this is another run, not a stage of this one; move it elsewhere, and continue with --resume",
                path.display()
            );
            let now = request()?.inputs;
            let changed = inputs.iter().find(|(name, digest)| now.get(*name) != Some(*digest));
            changed.map_or(Ok(()), |(name, _)| Err(has_changed(name)))?;
            // Of a stage whose report was being written, the run knows the other files.
            sums::check_folder(&self.path, folder)?;
            sums::list_folder(&self.path, folder)?;
            return Ok(None);
        }
        let stage = if sums::exists(&path)? {
            let (stage, found, _) = Self::resume_anywhere(&path, place.command)?;
            ensure!(
                found == *settings,
                "{}: this stage was begun with other settings; delete the folder, or choose another --out",
                path.display()
            );
            stage
        } else {
            if path.exists() {
                let (is_free, name) = (is_free(&path)?, path.display());
                ensure!(
                    is_free || !Manifest::is_in(&path),
                    "{name}: its list of files, sha256sums, is lost; restore it from a copy, or move the folder elsewhere to begin \
                     this stage again, and continue with --resume"
                );
                ensure!(
                    is_free,
                    "{name}: holds files that are not of this run; move them elsewhere, and continue with --resume"
                );
                Self::locked(path.clone(), place.command)?.clear()?;
            }
            // Whoever continues the run gets the same from it as the command that began it.
            let build = Build { command_line: Manifest::read(&self.path)?.command_line, ..place.build.clone() };
            let request = request()?;
            self.ensure_unchanged(&request.inputs)?;
            Self::create_anywhere(&Place { build: &build, out: Some(&path), ..*place }, settings, &request)?
        };
        // What the run was begun with counts.
        let inputs = stage.inputs.iter().chain(self.inputs.iter()).map(|(name, of)| (name.clone(), of.clone()));
        let within = Some((self.path.clone(), folder.to_owned()));
        Ok(Some(Self { inputs: Arc::new(inputs.collect()), within, ..stage }))
    }

    /// Refuses to continue writing if the folder has been replaced.
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
        // Before the lock is taken: nothing is written into a folder that is not a run.
        ensure_free_or_run(path, place.overwrite)?;
        let run = Self::locked(path.to_path_buf(), place.command)?;
        // Whoever had the lock before may have made a run of it.
        ensure_free_or_run(path, place.overwrite)?;
        if !is_free(path)? {
            let name = path.display();
            ensure!(
                place.overwrite || path.join(FINISHED).is_file(),
                "{name}: this folder is not empty; continue it with --resume {}, choose another --out, or delete it \
                 with --overwrite",
                quoted_path(path)
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
        let runs = Path::new(RUNS);
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

    /// Notes in its run that the report of this finished folder is being written: the run lists its other files, until
    /// [`list_again`](Self::list_again). A process that dies in between leaves a folder that is reopened if these are the
    /// run's.
    ///
    /// # Errors
    /// If a list cannot be read or written, or the folder was deleted or moved meanwhile.
    pub fn list_without_report(&self) -> anyhow::Result<()> {
        self.ensure_held()?;
        let listed = self.within.as_ref().map(|(run, name)| sums::list_but(run, name, &OF_REPORT));
        Ok(listed.unwrap_or(Ok(()))?)
    }

    /// Updates the digest of this finished folder in its run, after its report was written.
    ///
    /// # Errors
    /// If a list cannot be read or written, or the folder was deleted or moved meanwhile.
    pub fn list_again(&self) -> anyhow::Result<()> {
        self.ensure_held()?;
        let listed = self.within.as_ref().map(|(run, name)| sums::list_folder(run, name));
        Ok(listed.unwrap_or(Ok(()))?)
    }

    /// The folder.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// SHA-256 of its settings and its manifest: what is left unfinished of another run has another.
    ///
    /// # Errors
    /// If one is missing or damaged.
    pub fn identity(&self) -> anyhow::Result<String> {
        let contents = [SETTINGS, MANIFEST].map(|name| sums::read(&self.path.join(name), RUN_TOML_BYTES_MAX));
        let [settings, manifest] = contents;
        Ok(sums::digest(&[settings?, manifest?].concat()))
    }

    /// Writes a file and lists it: it is there whole or not at all.
    ///
    /// # Errors
    /// If it cannot be written, or the folder was deleted or moved meanwhile.
    pub fn write(&self, name: &str, content: &[u8]) -> anyhow::Result<()> {
        self.ensure_held()?;
        Ok(sums::write(&self.path, name, content)?)
    }

    /// Marks the run as finished, also in the run that it belongs to.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn finish(&self, outcome: Outcome) -> anyhow::Result<()> {
        let finished = Finished { schema: FINISHED_SCHEMA, outcome };
        self.write(FINISHED, toml::to_string(&finished)?.as_bytes())?;
        if let Some((run, name)) = &self.within {
            sums::list_folder(run, name)?;
        }
        Ok(())
    }
}

/// Refuses a folder that is, holds or lies within what is read: to overwrite it would delete what is needed.
fn ensure_apart(out: &Path, reads: &[PathBuf]) -> anyhow::Result<()> {
    let place_of = |path: &Path| storage::place_of(path).with_context(|| path.display().to_string());
    let place = place_of(out)?;
    for read in reads {
        let other = place_of(read)?;
        ensure!(
            !place.starts_with(&other) && !other.starts_with(&place),
            "--out {}: what is read lies there, or around it: {}; choose another --out",
            out.display(),
            read.display()
        );
    }
    Ok(())
}

/// Refuses a folder or file within a run: the run would no longer hold only its own files.
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

/// What is said where something that a run names cannot be read.
pub fn paths_are_as_made(run: &Path) -> String {
    format!(
        "{}: it names drivers and lots as they lay when it was made; use it in the folder in which it was made, with what it names \
         where it was",
        run.display()
    )
}

/// Refuses a folder with anything in it but a run.
fn ensure_free_or_run(path: &Path, overwrite: bool) -> anyhow::Result<()> {
    if !is_free(path)? && !Manifest::is_in(path) {
        let way_out = if overwrite { "so --overwrite will not delete it; choose" } else { "and not empty; choose" };
        bail!("{}: this folder is not a run, {way_out} another --out", path.display());
    }
    Ok(())
}

/// Whether a folder can be claimed as it is: it is empty, or holds what a process leaves if it dies before its claim,
/// which always includes the lock.
fn is_free(path: &Path) -> anyhow::Result<bool> {
    let names = fs::read_dir(path).and_then(|entries| entries.map(|entry| Ok(entry?.file_name())).collect());
    let names: Vec<_> = names.with_context(|| path.display().to_string())?;
    let is_of_claim =
        |name: &OsString| name == SETTINGS || name == MANIFEST || name.to_string_lossy().ends_with(whole::PARTIAL);
    let is_locked = names.iter().any(|name| name == lock::FILE);
    Ok(names.iter().all(|name| name == lock::FILE || is_of_claim(name)) && (names.is_empty() || is_locked))
}

/// The run that a folder lies in, whether it is listed there yet or not.
fn run_that_holds(folder: &Path) -> anyhow::Result<Option<PathBuf>> {
    let folder = folder.canonicalize().with_context(|| folder.display().to_string())?;
    Ok(folder.ancestors().skip(1).find(|around| Manifest::is_in(around)).map(Path::to_path_buf))
}

/// The run that lists a folder within it, or files of it, and the folder's path there.
fn run_around(folder: &Path) -> anyhow::Result<Option<(PathBuf, String)>> {
    // It may be named by a link, or as `.`.
    let folder = folder.canonicalize().with_context(|| folder.display().to_string())?;
    // Lists that other programs left are not read.
    for run in folder.ancestors().skip(1).filter(|around| Manifest::is_in(around)) {
        let name = folder.strip_prefix(run).unwrap_or(&folder).to_string_lossy();
        let within = format!("{name}/");
        if sums::names(run)?.iter().any(|listed| listed.starts_with(&within)) {
            return Ok(Some((run.to_owned(), name.into_owned())));
        }
    }
    Ok(None)
}

/// The command that continues the run which a folder is, or lies in; `None` if that is finished, or there is none.
///
/// # Errors
/// If what the run says of itself is missing or damaged.
pub fn way_on(folder: &Path) -> anyhow::Result<Option<String>> {
    let folder = folder.canonicalize().with_context(|| folder.display().to_string())?;
    let mut runs = folder.ancestors().filter(|around| Manifest::is_in(around));
    let Some(run) = runs.next() else { return Ok(None) };
    if is_finished(run)? {
        return Ok(None);
    }
    // A stage is continued with its run.
    let whole = runs.last().unwrap_or(run);
    Ok(Some(format!("cargo xtask {} --resume {}", Manifest::read(whole)?.command, quoted_path(whole))))
}

/// The command that writes a file or folder of a run again, if it is of a report that the run has of its own, or a stage whose
/// report was being written when a command died.
pub fn way_to_report(path: &Path) -> Option<String> {
    let is_of_report = |run: &&Path| {
        let name = path.strip_prefix(run).unwrap_or(path);
        let is_named = name.starts_with("figures") || OF_REPORT.iter().any(|of| name == Path::new(of));
        let is_stage = || name.as_os_str().is_empty() && run_around(path).is_ok_and(|run| run.is_some());
        let has_one = || ["dagger.toml", "runs.jsonl"].iter().any(|of| sums::is_listed(run, of).unwrap_or(false));
        (is_named || is_stage()) && has_one()
    };
    let run = path.ancestors().find(is_of_report)?;
    Some(format!("cargo xtask render report {}", quoted_path(run)))
}

/// One SHA-256 of all that a run wrote, except for what differs from one repetition to the next: wall times, the
/// manifest, and the reports that show it. The same for the same command on another machine, if it computed the same.
///
/// # Errors
/// If a list is missing or damaged.
pub fn digest(path: &Path) -> anyhow::Result<String> {
    const DIFFERENT: [&str; 5] = [MANIFEST, FINISHED, "wall_time.jsonl", "report.html", "report.md"];
    Ok(sums::digest_of_all(path, &DIFFERENT)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_runs::{build, create, message, place, scratch};
    use sim::seed::RootSeed;

    /// The settings of a run were read to 256 kB, however many lots they named: it drove for hours, and had no report.
    #[test]
    fn settings_that_are_written_are_read_back_and_longer_ones_are_refused_before_there_is_a_folder() {
        let path = scratch("many-lots");
        let mut settings = Settings::preset("smoke").unwrap();
        let name = |number| format!("lots/{}-{number}.toml", "x".repeat(100));
        settings.evaluation.lots = (0..10_000).map(name).collect();
        drop(RunDir::create(&place(&path, false), &settings, &Request::default()).unwrap());
        assert_eq!(RunDir::resume(&path, "train-dagger").unwrap().1, settings);
        fs::remove_dir_all(&path).unwrap();
        settings.evaluation.lots = (0..200_000).map(name).collect();
        let refused = message(RunDir::create(&place(&path, false), &settings, &Request::default()));
        assert!(refused.contains("the settings of this run") && !path.exists(), "{refused}");
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

    /// Both wrote into it, and the result belonged to neither.
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

    /// Whatever lay in the place of a stage became the run's own as soon as its report was written again.
    #[test]
    fn a_report_makes_no_foreign_or_changed_stage_the_runs_own() {
        let path = scratch("foreign-stage");
        let elsewhere = path.join("elsewhere");
        let settings = Settings::preset("smoke").unwrap();
        let run = create(&path, false).unwrap();
        let stage = run.stage("elsewhere", &place(&path, false), &settings).unwrap().unwrap();
        stage.write("runs.jsonl", b"mine").unwrap();
        stage.write("report.html", b"of mine").unwrap();
        stage.finish(Outcome::Reproduction { stages: 1 }).unwrap();
        drop((stage, run));
        let finished = fs::read(path.join(sums::FILE)).unwrap();
        let refused = |part: &str| {
            sums::write(&elsewhere, "runs.jsonl", b"another's").unwrap();
            let before = fs::read(path.join(sums::FILE)).unwrap();
            let refused = message(RunDir::reopen(&elsewhere, "render"));
            assert!(refused.contains(part), "{refused}");
            assert_eq!(fs::read(path.join(sums::FILE)).unwrap(), before);
            sums::write(&elsewhere, "runs.jsonl", b"mine").unwrap();
        };
        refused("elsewhere/sha256sums: is damaged");
        let reopen = || {
            let stage = RunDir::reopen(&elsewhere, "render").unwrap();
            stage.list_without_report().unwrap();
            stage
        };
        // Killed when half of the report is there.
        reopen().write("report.html", b"of mine, anew").unwrap();
        let faults = sums::verify(&path).faults;
        assert!(faults.len() == 1 && sums::is_unfinished(&faults[0]), "{faults:?}");
        let way = way_to_report(&faults[0].path).unwrap();
        assert!(way.ends_with(&format!("render report {}", quoted_path(&elsewhere))), "{way}");
        refused("elsewhere/runs.jsonl: is not the file that the run wrote");
        let stage = reopen();
        stage.write("report.html", b"of mine").unwrap();
        stage.list_again().unwrap();
        assert_eq!((sums::verify(&path).faults, fs::read(path.join(sums::FILE)).unwrap()), (Vec::new(), finished));
        drop(stage);
        // The run itself knows what a death left of it as well.
        drop(reopen());
        let (run, ..) = RunDir::resume(&path, "train-dagger").unwrap();
        assert!(run.stage("elsewhere", &place(&path, false), &settings).unwrap().is_none());
        assert_eq!(sums::verify(&path).faults, []);
        drop(run);
        fs::remove_dir_all(path).unwrap();
    }

    /// While reports are written anew, a stage is known by its other files: none of a report is held against it, nor anything
    /// against another stage.
    #[test]
    fn reports_of_two_stages_that_were_cut_off_are_found_and_written_again_each_by_itself() {
        let path = scratch("two-reports");
        let settings = Settings::preset("smoke").unwrap();
        let run = create(&path, false).unwrap();
        let stages = ["drives", "elsewhere"];
        let write_report = |stage: &RunDir| {
            for name in ["report.html", "report.md"] {
                stage.write(name, b"a report").unwrap();
            }
            sums::write_folder(stage.path(), "figures", [("a.svg".to_owned(), b"a figure".to_vec())]).unwrap();
        };
        for name in stages {
            let stage = run.stage(name, &place(&path, false), &settings).unwrap().unwrap();
            stage.write("runs.jsonl", name.as_bytes()).unwrap();
            write_report(&stage);
            stage.finish(Outcome::Reproduction { stages: 1 }).unwrap();
        }
        drop(run);
        let finished = fs::read(path.join(sums::FILE)).unwrap();
        let reopen = |name: &str| {
            let stage = RunDir::reopen(&path.join(name), "render").unwrap();
            stage.list_without_report().unwrap();
            stage
        };
        // Killed when the page of one, then of the other, is there, and its figures are those of before.
        for name in stages {
            reopen(name).write("report.html", b"another report").unwrap();
        }
        let listed = sums::names(&path).unwrap();
        for name in stages {
            let is_listed = |file: &str| listed.contains(&format!("{name}/{file}"));
            assert!(is_listed("runs.jsonl") && !OF_REPORT.iter().any(|file| is_listed(file)), "{listed:?}");
        }
        let cut_off = |stages: &[&str]| {
            let faults = sums::verify(&path).faults;
            assert!(faults.iter().all(sums::is_unfinished), "{faults:?}");
            let ways: Vec<String> = faults.iter().filter_map(|fault| way_to_report(&fault.path)).collect();
            let way = |name: &&str| format!("cargo xtask render report {}", quoted_path(&path.join(name)));
            let expected: Vec<String> = stages.iter().map(way).collect();
            assert_eq!((faults.len(), ways), (stages.len(), expected));
        };
        cut_off(&stages[..]);
        for (at, name) in stages.iter().enumerate() {
            let stage = reopen(name);
            write_report(&stage);
            stage.list_again().unwrap();
            drop(stage);
            cut_off(&stages[at + 1..]);
        }
        assert_eq!(fs::read(path.join(sums::FILE)).unwrap(), finished);
        fs::remove_dir_all(path).unwrap();
    }

    /// It was told to delete what it was to go on with, and where figures were lost, to go on though it was finished.
    #[test]
    fn what_helps_a_run_that_is_not_whole_is_said_by_name() {
        let path = scratch("way-on");
        let run = create(&path, false).unwrap();
        let settings = Settings::preset("smoke").unwrap();
        let stage = run.stage("drives", &place(&path, false), &settings).unwrap().unwrap();
        let whole = path.canonicalize().unwrap();
        let on = Some(format!("cargo xtask train-dagger --resume {}", quoted_path(&whole)));
        assert_eq!([way_on(&path).unwrap(), way_on(&path.join("drives")).unwrap()], [on.clone(), on.clone()]);
        stage.write("runs.jsonl", b"").unwrap();
        stage.finish(Outcome::Reproduction { stages: 1 }).unwrap();
        assert_eq!([way_on(&path).unwrap(), way_on(&path.join("drives")).unwrap()], [on, None]);
        run.finish(Outcome::Reproduction { stages: 1 }).unwrap();
        assert_eq!([way_on(&path).unwrap(), way_on(&std::env::temp_dir()).unwrap()], [None, None]);
        let report = |name: &str| way_to_report(&path.join(name));
        let of_drives = Some(format!("cargo xtask render report {}", quoted_path(&path.join("drives"))));
        assert_eq!(["drives/figures/a.svg", "drives/report.md"].map(report), [of_drives.clone(), of_drives]);
        assert_eq!(["drives/runs.jsonl", "figures", "report.md"].map(report), [None, None, None]);
        drop((stage, run));
        fs::remove_dir_all(path).unwrap();
    }

    /// What an evaluation left unfinished is continued by the same alone.
    #[test]
    fn runs_of_other_settings_or_arguments_have_another_identity_and_one_that_is_resumed_keeps_its_own() {
        let path = scratch("identity");
        let settings = Settings::preset("smoke").unwrap();
        let identity = |settings: &Settings, key: &str| {
            let arguments = [(key.to_owned(), 1.into())].into_iter().collect();
            let request = Request { arguments, ..Request::default() };
            RunDir::create(&place(&path, true), settings, &request).unwrap().identity().unwrap()
        };
        let one = identity(&settings, "a");
        assert_eq!(RunDir::resume(&path, "train-dagger").unwrap().0.identity().unwrap(), one);
        assert_eq!(identity(&settings, "a"), one, "it depends on nothing else");
        assert_ne!(identity(&settings, "b"), one);
        assert_ne!(identity(&Settings { seed: RootSeed(2), ..settings }, "a"), one);
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

    /// Whatever a process leaves if it dies while it claims a folder, the folder can be used.
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
                fs::write(path.join(whole[written].0).with_added_extension(whole::PARTIAL), "half").unwrap();
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
        fs::remove_dir_all(path).unwrap();
    }

    /// `--overwrite` was advised, which deletes what is finished.
    #[test]
    fn a_run_that_lost_its_list_alone_is_to_be_restored() {
        let path = scratch("lost-list");
        drop(create(&path, false).unwrap());
        fs::write(path.join("runs.jsonl"), "").unwrap();
        fs::remove_file(path.join(sums::FILE)).unwrap();
        let refused = message(RunDir::resume(&path, "train-dagger"));
        assert!(refused.contains("restore it from a copy") && !refused.contains("--overwrite"), "{refused}");
        fs::remove_file(path.join(MANIFEST)).unwrap();
        let refused = message(RunDir::resume(&path, "train-dagger"));
        assert!(refused.contains("this is not a run"), "{refused}");
        fs::remove_dir_all(path).unwrap();
    }

    /// Hours of drives were deleted without a word, where a run in the same state is refused.
    #[test]
    fn a_stage_that_lost_its_list_alone_is_to_be_restored() {
        let path = scratch("lost-list-of-stage");
        let settings = Settings::preset("smoke").unwrap();
        let run = create(&path, false).unwrap();
        let begin = || run.stage("drives", &place(&path, false), &settings);
        drop(begin().unwrap().unwrap());
        let (list, runs) = (path.join("drives").join(sums::FILE), path.join("drives/runs.jsonl"));
        fs::remove_file(&list).unwrap();
        drop(begin().unwrap().unwrap());
        fs::write(&runs, "hours of drives").unwrap();
        let kept = fs::read(&list).unwrap();
        fs::remove_file(&list).unwrap();
        let refused = message(begin());
        assert!(refused.contains("drives: its list of files, sha256sums, is lost; restore it"), "{refused}");
        assert_eq!(fs::read(&runs).unwrap(), b"hours of drives");
        fs::write(&list, kept).unwrap();
        drop(begin().unwrap().unwrap());
        drop(run);
        fs::remove_dir_all(path).unwrap();
    }

    /// Another command went on with it, and settings outside the section `dagger` could be edited.
    #[test]
    fn a_run_is_continued_only_by_its_command_with_its_settings_and_inputs() {
        let path = scratch("to be continued");
        drop(create(&path, false).unwrap());
        let refused = message(RunDir::resume(&path, "evaluate"));
        assert!(refused.ends_with(&format!("cargo xtask train-dagger --resume '{}'", path.display())), "{refused}");
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
        // Read again for a stage that begins, it was right by definition.
        let begin = || Ok(Request { inputs: of("2"), ..Request::default() });
        let refused = message(run.stage_for("chains/two", &place(&path, false), &settings, begin));
        assert!(refused.contains("lots/x.toml: changed") && !path.join("chains/two").exists(), "{refused}");
        drop((stage, run));
        let (run, ..) = RunDir::resume(&path, "train-dagger").unwrap();
        assert!(run.ensure_unchanged(&of("2")).is_err());
        fs::remove_dir_all(path).unwrap();
    }

    /// What was written went into whatever was there by then.
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
        // It was told to be continued by a command that refuses it.
        let refused = message(RunDir::resume(&path.join("chains/one"), "train-dagger"));
        assert!(refused.contains("this is a part of") && refused.contains("train-dagger --resume"), "{refused}");
        again.finish(Outcome::Evaluation { drivers: Vec::new() }).unwrap();
        drop(again);
        assert!(stage().unwrap().is_none());
        fs::remove_file(path.join("chains/one/sha256sums")).unwrap();
        assert!(message(stage()).contains("chains/one/sha256sums"), "listed as finished, but incomplete");
        // What somebody put where a stage was to come was deleted.
        fs::create_dir(path.join("notes")).unwrap();
        fs::write(path.join("notes/mine.txt"), "mine").unwrap();
        assert!(message(run.stage("notes", &place(&path, false), &settings)).contains("move them elsewhere"));
        assert!(path.join("notes/mine.txt").is_file());
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
}
