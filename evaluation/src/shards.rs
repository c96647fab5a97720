//! An evaluation that was driven in shards, on several machines, put together again: the same bytes as on one.

use crate::evaluate::{BATCH, FILES};
use crate::plan::Plan;
use crate::read::{Place, Places};
use crate::records::{self, Driven};
use anyhow::{Context as _, ensure};
use experiment::run_dir::{self, Manifest, RunDir};
use experiment::settings::Settings;
use experiment::shard::Shard;
use experiment::trials::Trial;
use serde::{Deserialize, Serialize};
use sim::limits::RUN_TEXT_BYTES_MAX;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use storage::sums;

/// The argument of the manifest that says what a shard is to drive.
const ARGUMENT: &str = "shard";

/// What a shard is to drive, as its manifest says it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ShardRecord {
    /// Which of how many.
    pub number: Shard,
    /// SHA-256 of the settings.
    pub settings_sha256: String,
    /// The trials, `LOT@DIRECTION@TRIAL`: every driver drives each of them at every noise level.
    pub keys: Vec<String>,
}

impl ShardRecord {
    /// Of a plan; `None` if it is to be driven whole.
    pub fn of(plan: &Plan<'_>) -> Option<Self> {
        let keys = || plan.trials().map(|trial| key(&trial)).collect();
        plan.shard.map(|number| Self { number, settings_sha256: digest(plan.settings), keys: keys() })
    }
}

fn key(trial: &Trial<'_>) -> String {
    format!("{}@{}@{}", trial.lot.name(), trial.direction.name(), trial.index)
}

fn digest(settings: &Settings) -> String {
    sums::digest(settings.to_toml().as_bytes())
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
        ensure!(sums::exists(folder)?, "{name}: this is no run; name the folders that evaluate --shard wrote");
        let mut manifest = Manifest::read(folder)?;
        let record = manifest.arguments.remove(ARGUMENT);
        let record = record
            .with_context(|| format!("{name}: this is no shard; name the folders that evaluate --shard wrote"))?;
        let record: ShardRecord = record.try_into().with_context(|| format!("{name}: manifest.toml"))?;
        ensure!(
            run_dir::is_finished(folder)?,
            "{name}: shard {} is not finished; go on with: cargo xtask evaluate --resume {name}",
            record.number
        );
        let settings = run_dir::settings_of(folder)?;
        ensure!(
            digest(&settings) == record.settings_sha256,
            "{name}: its settings.toml is not the one that it was begun with; restore it, or drive the shard again"
        );
        Ok(Self { folder: folder.to_owned(), record, manifest, settings })
    }

    /// Refuses what does not belong to the same evaluation.
    fn check_belongs_to(&self, first: &Self) -> anyhow::Result<()> {
        let version = |run: &Self| {
            let Manifest { program, git_revision, git_dirty, .. } = &run.manifest;
            (program.clone(), git_revision.clone(), *git_dirty)
        };
        let differs = [
            ("number of shards", self.record.number.of() != first.record.number.of()),
            ("version of lotpilot", version(self) != version(first)),
            ("architecture or system", self.manifest.target != first.manifest.target),
            ("drivers", self.manifest.arguments != first.manifest.arguments),
            ("settings", self.settings != first.settings),
            ("files of lots or drivers", self.manifest.inputs != first.manifest.inputs),
        ];
        if let Some((what, _)) = differs.into_iter().find(|(_, differs)| *differs) {
            anyhow::bail!(
                "{}: driven with another {what} than {}, so they are of different evaluations; drive one of them again",
                self.folder.display(),
                first.folder.display()
            );
        }
        Ok(())
    }
}

/// All shards of an evaluation, finished.
#[derive(Debug)]
pub struct Shards {
    runs: Vec<ShardRun>,
}

impl Shards {
    /// Reads the manifests of some folders.
    ///
    /// # Errors
    /// If one is no finished shard, they are of different evaluations, or a shard is missing or there twice.
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
        let missing = first.record.number.all().filter(|number| runs.iter().all(|run| run.record.number != *number));
        let missing: Vec<String> = missing.map(|number| number.to_string()).collect();
        ensure!(
            missing.is_empty(),
            "missing: shard {}; name its folder as well, or drive it with --shard",
            missing.join(", shard ")
        );
        Ok(Self { runs })
    }

    /// The settings of all of them.
    pub fn settings(&self) -> &Settings {
        &self.runs[0].settings
    }

    /// The manifest of all of them, but for what tells them apart.
    pub fn manifest(&self) -> &Manifest {
        &self.runs[0].manifest
    }

    /// Puts their rows in the order of the whole plan.
    ///
    /// # Errors
    /// If a file is missing or damaged, or a row is missing, there twice, or of another shard or evaluation.
    pub fn rows(&self, plan: &Plan<'_>) -> anyhow::Result<Rows> {
        let places = Places::new(plan);
        let parts: Vec<Plan<'_>> =
            self.runs.iter().map(|run| Plan { shard: Some(run.record.number), ..*plan }).collect();
        for (run, part) in self.runs.iter().zip(&parts) {
            let expected = part.trials().map(|trial| key(&trial));
            ensure!(
                expected.eq(run.record.keys.iter().cloned()),
                "{}: its manifest lists other trials than its settings stand for; drive the shard again",
                run.folder.display()
            );
        }
        let mut files = FILES.map(|_| Vec::new());
        for (name, file) in FILES.into_iter().zip(&mut files) {
            let mut rows = Vec::new();
            for (run, part) in self.runs.iter().zip(&parts) {
                rows.extend(run.rows(name, part, &places)?);
            }
            // Stable: the near-collisions of a run stay in their order.
            rows.sort_by_key(|(place, _)| (place.trial / BATCH, *place));
            for (_, line) in rows {
                file.extend(line.into_bytes());
                file.push(b'\n');
            }
        }
        Ok(Rows(files))
    }
}

impl ShardRun {
    /// The lines of a file with their places in the whole plan.
    fn rows(&self, name: &str, part: &Plan<'_>, places: &Places<'_>) -> anyhow::Result<Vec<(Place, String)>> {
        let path = self.folder.join(name);
        let text = sums::read_to_string(&path, RUN_TEXT_BYTES_MAX)?;
        let own = Places::new(part);
        let mut lines = text.lines();
        let mut rows = Vec::new();
        let mut seen = BTreeSet::new();
        records::each_line_of(&path, text.as_bytes(), |driven: Driven| {
            let is_new = seen.insert(own.of(&driven)?);
            ensure!(is_new || name == records::FAILURES, "there twice");
            rows.push((places.of(&driven)?, lines.next().unwrap_or_default().to_owned()));
            Ok(())
        })?;
        if name != records::FAILURES {
            let levels = part.settings.evaluation.noise.iter().enumerate();
            for (level, noise) in levels {
                for (driver, named) in part.drivers.iter().enumerate() {
                    let missing = (0..own.trials.len()).find(|&trial| !seen.contains(&Place { level, driver, trial }));
                    if let Some(trial) = missing {
                        anyhow::bail!(
                            "{}: lacks {} by {} at noise {noise}; drive the shard again into another folder",
                            path.display(),
                            key(&own.trials[trial]),
                            named.name
                        );
                    }
                }
            }
        }
        Ok(rows)
    }
}

/// The lines of an evaluation, as one machine would have written them.
#[derive(Debug)]
pub struct Rows([Vec<u8>; FILES.len()]);

impl Rows {
    /// Writes them into the folder of a run.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn write(&self, run: &RunDir) -> anyhow::Result<()> {
        // That of the runs is listed last: with it, the evaluation counts as driven.
        FILES.into_iter().zip(&self.0).rev().try_for_each(|(name, lines)| run.write(name, lines))
    }
}
