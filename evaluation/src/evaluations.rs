//! Evaluations of the same trials by different drivers, put together: the same bytes as from one that names all of them.

use crate::parts::{Part, Rows};
use crate::plan::Plan;
use crate::shards::{self, ShardRecord};
use crate::trainings::Methods;
use anyhow::{Context as _, ensure};
use experiment::command_line::quoted_path;
use experiment::drivers::DriverSpec;
use experiment::manifest::{self, Inputs, Manifest};
use experiment::settings::{EvaluationSettings, Settings};
use experiment::trained;
use serde::Deserialize as _;
use std::path::{Path, PathBuf};

/// The command that makes them.
const COMMAND: &str = "evaluate";

/// A finished evaluation.
#[derive(Debug)]
struct EvaluationRun {
    folder: PathBuf,
    manifest: Manifest,
    settings: Settings,
    drivers: Vec<DriverSpec>,
    methods: Methods,
}

impl EvaluationRun {
    fn read(folder: &Path) -> anyhow::Result<Self> {
        let name = folder.display();
        shards::ensure_is_run(folder)?;
        let mut manifest = Manifest::read(folder)?;
        ensure!(
            manifest.command == COMMAND,
            "{name}: this is not a shard or an evaluation, but a run of {}; name folders of shards or evaluations",
            manifest.command
        );
        ensure!(
            ShardRecord::take_from(&mut manifest)?.is_none(),
            "{name}: a shard among whole evaluations; merge the shards first, then their evaluation with the others"
        );
        ensure!(
            manifest::is_finished(folder)?,
            "{name}: not finished; continue with: cargo xtask {COMMAND} --resume {}",
            quoted_path(folder)
        );
        let drivers = manifest.arguments.get("drivers").cloned();
        let drivers = drivers.with_context(|| format!("{name}/manifest.toml: names no drivers"))?;
        let drivers = Vec::<String>::deserialize(drivers).with_context(|| format!("{name}/manifest.toml: drivers"))?;
        let drivers = DriverSpec::parse_all(&drivers).with_context(|| format!("{name}/manifest.toml"))?;
        let methods = manifest.arguments.get("methods").cloned().map(Methods::deserialize).transpose();
        let methods = methods.with_context(|| format!("{name}/manifest.toml: methods"))?.unwrap_or_default();
        Ok(Self { folder: folder.to_owned(), settings: trained::settings_of(folder)?, manifest, drivers, methods })
    }

    /// Whether a network drove: only then does it matter how the machine rounds.
    fn has_networks(&self) -> bool {
        self.drivers.iter().any(DriverSpec::is_network)
    }

    /// Refuses what was driven differently.
    fn check_is_comparable_with(&self, first: &Self) -> anyhow::Result<()> {
        let (own, others) = (&self.settings, &first.settings);
        let has_expert =
            |run: &Self| run.drivers.iter().any(|it| matches!(it, DriverSpec::Expert | DriverSpec::GridExpert));
        let has_onnx = |run: &Self| run.drivers.iter().any(|driver| matches!(driver, DriverSpec::Onnx { .. }));
        let any = |has: &dyn Fn(&Self) -> bool| has(self) || has(first);
        let both_have_networks = self.has_networks() && first.has_networks();
        let trials = |of: &Settings| EvaluationSettings { elsewhere: Vec::new(), ..of.evaluation.clone() };
        let differs = [
            ("version of lotpilot", !self.manifest.is_of_version_of(&first.manifest)),
            ("architecture or system", self.manifest.target != first.manifest.target),
            ("use of AVX2 and FMA", both_have_networks && !self.manifest.rounds_like(&first.manifest)),
            ("choice of lots, trials, noise or smoothing ([evaluation])", trials(own) != trials(others)),
            ("car, sensor or metrics ([episode])", own.episode != others.episode),
            ("expert ([expert])", any(&has_expert) && own.expert != others.expert),
            (
                "use of what networks answer ([dagger.inference])",
                any(&has_onnx) && own.dagger.inference != others.dagger.inference,
            ),
        ];
        if let Some((what, _)) = differs.into_iter().find(|(_, differs)| *differs) {
            anyhow::bail!(
                "{}: made with another {what} than {}, so that their drivers cannot be compared; drive one of them again",
                self.folder.display(),
                first.folder.display()
            );
        }
        for driver in &self.drivers {
            ensure!(
                !first.drivers.contains(driver),
                "{} and {} both have driver {driver}; leave one of the folders out",
                first.folder.display(),
                self.folder.display()
            );
        }
        Ok(())
    }
}

/// Finished evaluations of the same trials by different drivers.
#[derive(Debug)]
pub struct Evaluations {
    runs: Vec<EvaluationRun>,
}

impl Evaluations {
    /// Reads the manifests of some folders, at least one.
    ///
    /// # Errors
    /// If one is a shard or not a finished evaluation, two differ in trials, settings of driving or versions, or a
    /// driver is in two of them.
    pub fn read(folders: &[PathBuf]) -> anyhow::Result<Self> {
        let runs = folders.iter().map(|folder| EvaluationRun::read(folder)).collect::<anyhow::Result<Vec<_>>>()?;
        for (at, run) in runs.iter().enumerate() {
            runs[..at].iter().try_for_each(|earlier| run.check_is_comparable_with(earlier))?;
        }
        Ok(Self { runs })
    }

    /// The first that names a run, else the first: its `[training]` says which lots count as trained on, as in one
    /// evaluation that names all drivers.
    fn leading(&self) -> &EvaluationRun {
        let names_run = |run: &&EvaluationRun| run.drivers.iter().any(|driver| driver.run().is_some());
        self.runs.iter().find(names_run).unwrap_or(&self.runs[0])
    }

    /// Those of the first that names a run, else of the first: what the others were driven with is the same.
    pub fn settings(&self) -> &Settings {
        &self.leading().settings
    }

    /// What the settings of the same started from.
    pub fn preset(&self) -> &str {
        &self.leading().manifest.preset
    }

    /// What made them: the version that drove all of them, and the machine, that of the networks if there are any. How it
    /// rounds is what others that are merged later are held against.
    pub fn made_by(&self) -> &Manifest {
        let of_networks = self.runs.iter().find(|run| run.has_networks());
        &of_networks.unwrap_or_else(|| self.leading()).manifest
    }

    /// The drivers of all, those of the first folder first.
    pub fn drivers(&self) -> Vec<DriverSpec> {
        self.runs.iter().flat_map(|run| run.drivers.iter().cloned()).collect()
    }

    /// The methods of all; what two call by one name adds up.
    pub fn methods(&self) -> Methods {
        let mut methods = Methods::new();
        for (name, drivers) in self.runs.iter().flat_map(|run| &run.methods) {
            methods.entry(name.clone()).or_default().extend(drivers.iter().cloned());
        }
        methods
    }

    /// Refuses files of lots or drivers that have changed since.
    ///
    /// # Errors
    /// The first of them.
    pub fn check_inputs(&self, found: &Inputs) -> anyhow::Result<()> {
        for run in &self.runs {
            for (name, digest) in &run.manifest.inputs {
                ensure!(
                    found.get(name) == Some(digest),
                    "{name}: changed since {} was driven; restore it, or drive again",
                    run.folder.display()
                );
            }
        }
        Ok(())
    }

    /// Puts their rows in the order of the whole plan, which has their drivers in order.
    ///
    /// # Errors
    /// If a file is missing or damaged, or a row is missing, there twice, or of another evaluation.
    pub fn rows(&self, plan: &Plan<'_>) -> anyhow::Result<Rows> {
        let mut others = plan.drivers;
        let parts: Vec<Part<'_>> = self
            .runs
            .iter()
            .map(|run| {
                let (own, rest) = others.split_at(run.drivers.len());
                others = rest;
                Part { folder: &run.folder, plan: Plan { drivers: own, compare_with: 0, ..*plan } }
            })
            .collect();
        Rows::of(&parts, plan)
    }
}
