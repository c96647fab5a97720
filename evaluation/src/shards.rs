//! Work that was shared out to several machines, put together again: the same bytes as from one.

use crate::parts::{self, Part, Rows};
use crate::plan::Plan;
use crate::stage::Stage;
use crate::stages;
use anyhow::{Context as _, ensure};
use experiment::command_line::quoted_path;
use experiment::drivers::DriverSpec;
use experiment::manifest::{self, Manifest};
use experiment::settings::Settings;
use experiment::shard::Shard;
use experiment::trained;
use serde::{Deserialize, Serialize};
use sim::limits::RUN_TOML_BYTES_MAX;
use std::path::{Path, PathBuf};
use storage::sums;

/// The argument of the manifest that says what a shard is to drive.
const ARGUMENT: &str = "shard";

/// What a shard is to do, as its manifest says it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ShardRecord {
    /// Which of how many.
    pub number: Shard,
    /// SHA-256 of the settings.
    pub settings_sha256: String,
    /// The trials of an evaluation, `LOT@DIRECTION@TRIAL`: every driver drives each of them at every noise level. The
    /// folders of the stages of a run of trainings.
    pub keys: Vec<String>,
    /// The folder of a reproduction whose networks are trained.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub networks: Option<PathBuf>,
}

impl ShardRecord {
    /// The record of a plan; `None` if it is to be driven whole.
    ///
    /// # Errors
    /// If a manifest has no room for the keys of so many trials.
    pub fn of(plan: &Plan<'_>) -> anyhow::Result<Option<Self>> {
        let Some(number) = plan.shard else { return Ok(None) };
        let mut keys = Vec::new();
        let mut bytes = 0;
        for trial in plan.trials() {
            let key = parts::key(&trial);
            bytes += key.len() as u64;
            ensure!(
                bytes <= RUN_TOML_BYTES_MAX,
                "the keys of the trials of shard {number} take more than {RUN_TOML_BYTES_MAX} bytes; drive fewer runs, or \
                 in more shards"
            );
            keys.push(key);
        }
        Ok(Some(Self { number, settings_sha256: digest(plan.settings), keys, networks: None }))
    }

    /// The record of a run of trainings: of these, or of what the networks in a folder drive.
    pub fn of_stages(number: Shard, networks: Option<PathBuf>, settings: &Settings, stages: Vec<Stage>) -> Self {
        let mut record = Self { number, settings_sha256: digest(settings), keys: Vec::new(), networks };
        record.keys = record.share_of(stages).into_iter().map(|stage| stage.folder).collect();
        record
    }

    /// The stages of a run of trainings that the shard does.
    pub fn share_of(&self, stages: Vec<Stage>) -> Vec<Stage> {
        let part = if self.networks.is_some() { stages::Part::Drives } else { stages::Part::Trainings };
        stages::share(stages, part, self.number)
    }

    /// Takes the record of a shard out of the arguments of a manifest; `None` if it is of no shard.
    ///
    /// # Errors
    /// If it is of another version.
    pub fn take_from(manifest: &mut Manifest) -> anyhow::Result<Option<Self>> {
        let record = manifest.arguments.remove(ARGUMENT);
        record.map(|record| record.try_into().context("manifest.toml")).transpose()
    }

    /// Adds the record to the arguments of a manifest.
    pub fn add_to(&self, arguments: &mut toml::Table) {
        arguments.insert(ARGUMENT.to_owned(), toml::Value::try_from(self).expect("a record is plain values"));
    }
}

fn digest(settings: &Settings) -> String {
    sums::digest(settings.to_toml().as_bytes())
}

/// Whether a folder is that of a shard, finished or not.
///
/// # Errors
/// If it is not a run, or its manifest is damaged.
pub fn is_shard(folder: &Path) -> anyhow::Result<bool> {
    ensure_is_run(folder)?;
    Ok(Manifest::read(folder)?.arguments.contains_key(ARGUMENT))
}

pub(crate) fn ensure_is_run(folder: &Path) -> anyhow::Result<()> {
    let name = folder.display();
    ensure!(
        sums::exists(folder)?,
        "{name}: this is not a run; name the folders that evaluate, or a command with --shard, wrote"
    );
    Ok(())
}

/// A finished shard.
#[derive(Debug)]
struct ShardRun {
    folder: PathBuf,
    record: ShardRecord,
    /// Without the record.
    manifest: Manifest,
    settings: Settings,
}

impl ShardRun {
    fn read(folder: &Path) -> anyhow::Result<Self> {
        let name = folder.display();
        ensure_is_run(folder)?;
        let mut manifest = Manifest::read(folder)?;
        let record = ShardRecord::take_from(&mut manifest).with_context(|| name.to_string())?;
        let record = record
            .with_context(|| format!("{name}: this is not a shard; name folders that a command with --shard wrote"))?;
        ensure!(
            manifest::is_finished(folder)?,
            "{name}: shard {} is not finished; continue with: cargo xtask {} --resume {}",
            record.number,
            manifest.command,
            quoted_path(folder)
        );
        let settings = trained::settings_of(folder)?;
        ensure!(
            digest(&settings) == record.settings_sha256,
            "{name}: its settings.toml is not the one that it was begun with; restore it, or make the shard again"
        );
        Ok(Self { folder: folder.to_owned(), record, manifest, settings })
    }

    /// Refuses what does not belong to the same whole.
    fn check_belongs_to(&self, first: &Self) -> anyhow::Result<()> {
        let differs = [
            ("command", self.manifest.command != first.manifest.command),
            ("number of shards", self.record.number.of() != first.record.number.of()),
            ("version of lotpilot", !self.manifest.is_of_version_of(&first.manifest)),
            ("architecture or system", self.manifest.target != first.manifest.target),
            ("use of AVX2 and FMA", has_networks(&self.manifest) && !self.manifest.rounds_like(&first.manifest)),
            ("folder of networks", self.record.networks != first.record.networks),
            ("choice of drivers, lots or comparison", self.manifest.arguments != first.manifest.arguments),
            ("set of settings", self.settings != first.settings),
            ("content of files of lots or drivers", self.manifest.inputs != first.manifest.inputs),
        ];
        if let Some((what, _)) = differs.into_iter().find(|(_, differs)| *differs) {
            anyhow::bail!(
                "{}: made with another {what} than {}, so they are not shards of one whole; make one of them again",
                self.folder.display(),
                first.folder.display()
            );
        }
        Ok(())
    }
}

/// Missing shards that are named.
const MISSING_NAMED_MAX: usize = 10;

/// All shards of a whole, finished.
#[derive(Debug)]
pub struct Shards {
    runs: Vec<ShardRun>,
}

/// Whether networks drive in a run, or are trained: only then does it matter how a machine rounds. Where planners are tuned or
/// are the only ones that drive, with the expert, it does not.
pub fn has_networks(manifest: &Manifest) -> bool {
    let named = |key| manifest.arguments.get(key).and_then(toml::Value::as_array);
    let Some(drivers) = named("drivers") else { return named("planners").is_none() };
    let is_network = |driver: &toml::Value| {
        let spec = driver.as_str().and_then(|driver| driver.parse::<DriverSpec>().ok());
        spec.is_none_or(|spec| spec.is_network())
    };
    drivers.iter().any(is_network)
}

impl Shards {
    /// Reads the manifests of some folders.
    ///
    /// # Errors
    /// If one is not a finished shard, they are not of one whole, or a shard is missing or there twice.
    pub fn read(folders: &[PathBuf]) -> anyhow::Result<Self> {
        let mut runs = folders.iter().map(|folder| ShardRun::read(folder)).collect::<anyhow::Result<Vec<_>>>()?;
        runs.sort_by_key(|run| run.record.number);
        let first = runs.first().context("no shard is named")?;
        runs.iter().try_for_each(|run| run.check_belongs_to(first))?;
        for pair in runs.windows(2) {
            let [one, other] = pair else { unreachable!("windows of two") };
            ensure!(
                one.record.number != other.record.number,
                "{} and {} are both shard {}; name one of them",
                one.folder.display(),
                other.folder.display(),
                one.record.number
            );
        }
        let number = first.record.number;
        let missing = number.all().filter(|number| runs.iter().all(|run| run.record.number != *number));
        // There may be as many as somebody cared to write behind the slash.
        let named: Vec<String> = missing.take(MISSING_NAMED_MAX).map(|number| number.to_string()).collect();
        let others = (number.of() as usize - runs.len()).saturating_sub(named.len());
        ensure!(
            named.is_empty(),
            "missing: shard {}{}; name its folder as well, or make it with --shard",
            named.join(", shard "),
            if others > 0 { format!(" and {others} more") } else { String::new() }
        );
        Ok(Self { runs })
    }

    /// The settings of all of them.
    pub fn settings(&self) -> &Settings {
        &self.runs[0].settings
    }

    /// The manifest of all of them, except for what tells them apart.
    pub fn manifest(&self) -> &Manifest {
        &self.runs[0].manifest
    }

    /// The reproduction whose networks they drove.
    pub fn networks(&self) -> Option<&Path> {
        self.runs[0].record.networks.as_deref()
    }

    /// Refuses another run than theirs: what they did would not be part of it. `remedy`: what to do then.
    ///
    /// # Errors
    /// If settings, lots, other files that are read, or the version of lotpilot are others.
    pub fn check_are_of(
        &self,
        run: &Path,
        settings: &Settings,
        manifest: &Manifest,
        remedy: &str,
    ) -> anyhow::Result<()> {
        let own = self.manifest();
        let is_theirs = *settings == *self.settings()
            && manifest.arguments == own.arguments
            && manifest.target == own.target
            && manifest.rounds_like(own)
            && manifest.program == own.program
            // Shards of drives read networks besides.
            && manifest.inputs.iter().all(|(name, digest)| own.inputs.get(name) == Some(digest))
            // A program outside of its checkout, as nodes of a cluster are sent it, does not know its revision.
            && manifest.git_revision.iter().all(|revision| own.git_revision.iter().all(|other| revision == other));
        ensure!(
            is_theirs,
            "{}: its settings, lots, files or version of lotpilot are not those of the shards, so they are not part of it; \
             {remedy}",
            run.display()
        );
        Ok(())
    }

    /// Folders of the shards of a stage, that of the first shard first.
    pub fn folders_of(&self, stage: &str) -> Vec<PathBuf> {
        self.runs.iter().map(|run| run.folder.join(stage)).collect()
    }

    /// The stages of a run of trainings that they did, each with the folder that it is in.
    ///
    /// # Errors
    /// If a manifest lists others than the shard was to do, or a file in one of them is missing or damaged.
    pub fn stages(&self, all: &[Stage]) -> anyhow::Result<Vec<(String, PathBuf)>> {
        let mut found = Vec::new();
        for run in &self.runs {
            let share = run.record.share_of(all.to_vec());
            ensure!(
                share.iter().map(|stage| &stage.folder).eq(&run.record.keys),
                "{}: its manifest lists other stages than its settings stand for; make the shard again",
                run.folder.display()
            );
            for Stage { folder, .. } in share {
                let path = run.folder.join(&folder);
                sums::read_listed(&run.folder, &format!("{folder}/{}", sums::FILE), sums::LIST_BYTES_MAX)?;
                if let Some(fault) = sums::verify(&path).faults.into_iter().next() {
                    return Err(fault.into());
                }
                found.push((folder, path));
            }
        }
        Ok(found)
    }

    /// Puts their rows in the order of the whole plan.
    ///
    /// # Errors
    /// If a file is missing or damaged, or a row is missing, there twice, or of another shard or evaluation.
    pub fn rows(&self, plan: &Plan<'_>) -> anyhow::Result<Rows> {
        let part = |run: &ShardRun| Plan { shard: Some(run.record.number), ..*plan };
        let parts: Vec<Part<'_>> = self.runs.iter().map(|run| Part { folder: &run.folder, plan: part(run) }).collect();
        for (run, part) in self.runs.iter().zip(&parts) {
            let expected = part.plan.trials().map(|trial| parts::key(&trial));
            ensure!(
                expected.eq(run.record.keys.iter().cloned()),
                "{}: its manifest lists other trials than its settings stand for; drive the shard again",
                run.folder.display()
            );
        }
        Rows::of(&parts, plan)
    }
}
