//! Evaluations: the plan, the loop and the tables of the command line.

use crate::callback::{Failure, Function, Watch};
use crate::course::{SettingsFrom, directions, noise};
use crate::guard::{alone, detached, input, warn};
use anyhow::{Context as _, bail, ensure};
use evaluation::plan::Plan;
use evaluation::shards::{ShardRecord, Shards};
use evaluation::summary::Summary;
use evaluation::trainings::{self, Methods};
use experiment::drivers::{self, DriverSpec, NamedDriver};
use experiment::inputs;
use experiment::lots::Lot;
use experiment::manifest::{Build, Outcome, Request, processor_features};
use experiment::notes;
use experiment::run_dir::{Place, RunDir};
use experiment::settings::{Layers, Settings};
use experiment::shard::Shard;
use pyo3::prelude::*;
use serde::Serialize;
use sim::limits::RUN_LINES_BYTES_MAX;
use sim::seed::RootSeed;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use storage::sums;

/// Which trials; what is `None` is as in the settings.
#[derive(Debug, FromPyObject)]
#[pyo3(from_item_all)]
#[expect(clippy::struct_field_names, reason = "`trials` is the name in Python")]
pub(crate) struct Trials {
    lots: Option<Vec<String>>,
    trials: Option<u32>,
    directions: Option<String>,
    noise: Option<Vec<String>>,
    seed: Option<u64>,
    smoothing: Option<String>,
    compare_with: Option<String>,
    methods: Option<Vec<(String, Vec<String>)>>,
}

/// A driver as on the command line, or a function.
#[derive(Debug, FromPyObject)]
pub(crate) enum Named {
    Spec(String),
    Function(Py<PyAny>),
}

/// Drives named drivers and functions on the same trials and writes the files of `cargo xtask evaluate` into `out`; of a
/// shard, as `"2/16"`, only what [`merge`] needs.
#[pyfunction]
pub(crate) fn evaluate(
    py: Python<'_>,
    drivers: Vec<(String, Named)>,
    trials: Trials,
    settings: SettingsFrom,
    out: PathBuf,
    overwrite: bool,
    shard: Option<String>,
) -> PyResult<()> {
    let failure = Failure::default();
    let watch = Watch { failure: failure.clone() };
    let work = || {
        let shard = shard.map(|shard| shard.parse::<Shard>()).transpose().map_err(anyhow::Error::msg)?;
        let asked = Asked::new(drivers, &trials, settings, &failure)?;
        let plan = asked.plan(shard);
        plan.check()?;
        asked.say_notes(&failure)?;
        let run = asked.begin(&plan, &out, overwrite)?;
        asked.finish(&plan, &run, &watch)
    };
    let done = detached(py, || work().map_err(input));
    failure.take().map_or(done, Err)
}

/// Puts the shards of an evaluation together: what [`evaluate`] writes without one. Drives nothing.
#[pyfunction]
pub(crate) fn merge(
    py: Python<'_>,
    drivers: Vec<(String, Named)>,
    trials: Trials,
    settings: SettingsFrom,
    out: PathBuf,
    overwrite: bool,
    shards: Vec<PathBuf>,
) -> PyResult<()> {
    let failure = Failure::default();
    let watch = Watch { failure: failure.clone() };
    let work = || {
        let mut asked = Asked::new(drivers, &trials, settings, &failure)?;
        asked.reads.extend_from_slice(&shards);
        let shards = Shards::read(&shards)?;
        let is_asked_for =
            *shards.settings() == asked.settings && shards.manifest().arguments == asked.arguments(None)?;
        ensure!(is_asked_for, "the shards are of other drivers or settings than are asked for; drive them again");
        shards.manifest().check_inputs(&inputs::of(&asked.lots, &asked.drivers))?;
        let plan = asked.plan(None);
        let rows = shards.rows(&plan)?;
        asked.say_notes(&failure)?;
        let run = asked.begin(&plan, &out, overwrite)?;
        rows.write(&run)?;
        asked.finish(&plan, &run, &watch)
    };
    let done = detached(py, || work().map_err(input));
    failure.take().map_or(done, Err)
}

/// The text of a finished file of a run, held against its digest.
#[pyfunction]
pub(crate) fn read_finished(py: Python<'_>, file: PathBuf) -> PyResult<String> {
    alone(py, || sums::read_to_string(&file, RUN_LINES_BYTES_MAX).map_err(input))
}

/// What is to be driven, loaded.
struct Asked {
    settings: Settings,
    drivers: Vec<NamedDriver>,
    lots: Vec<Lot>,
    compare_with: usize,
    methods: Methods,
    /// Files and folders that are read.
    reads: Vec<PathBuf>,
}

impl Asked {
    fn new(
        drivers: Vec<(String, Named)>,
        trials: &Trials,
        settings: SettingsFrom,
        failure: &Failure,
    ) -> anyhow::Result<Self> {
        let layers = Layers::from(settings);
        let config = layers.file.clone();
        let settings = settings_of(&drivers, layers, trials)?;
        let loaded = drivers.into_iter().map(|(name, driver)| {
            if let Some(letter) = drivers::never_in_a_name(&name) {
                bail!("driver {name:?} contains {letter:?}, and tables hold its name; choose another");
            }
            match driver {
                Named::Spec(spec) => {
                    let spec: DriverSpec = spec.parse()?;
                    spec.ensure_whole()?;
                    Ok(spec.load(&settings)?.renamed(&name))
                }
                Named::Function(function) => {
                    let function = Arc::new(Function { function, failure: failure.clone() });
                    Ok(NamedDriver::callback(&name, function).smoothed(settings.evaluation.smoothing))
                }
            }
        });
        let mut drivers = loaded.collect::<anyhow::Result<Vec<NamedDriver>>>()?;
        let methods: Methods = trials.methods.iter().flatten().cloned().collect();
        trainings::assign(&methods, &mut drivers)?;
        let lots = Lot::parse_all(&settings.evaluation.lots, &settings.episode.vehicle)?;
        let compare_with = match &trials.compare_with {
            Some(name) => drivers.iter().position(|driver| driver.name == *name),
            None => Some(0),
        };
        let compare_with = compare_with.context("compare_with: name one of the drivers")?;
        let reads = inputs::places(&lots, &drivers).into_iter().chain(config).collect();
        Ok(Self { settings, drivers, lots, compare_with, methods, reads })
    }

    /// Warns with the notes about the lots.
    fn say_notes(&self, failure: &Failure) -> anyhow::Result<()> {
        let notes = notes::of(&self.lots, &self.settings.evaluation.noise);
        if let Err(error) = Python::attach(|py| warn(py, &notes)) {
            failure.note(error);
            bail!("the caller takes warnings for errors");
        }
        Ok(())
    }

    fn plan(&self, shard: Option<Shard>) -> Plan<'_> {
        let Self { settings, drivers, lots, compare_with, .. } = self;
        Plan { settings, drivers, lots, compare_with: *compare_with, shard }
    }

    /// What the manifest says besides the settings.
    fn arguments(&self, shard: Option<ShardRecord>) -> anyhow::Result<toml::Table> {
        #[derive(Serialize)]
        struct Arguments<'a> {
            drivers: Vec<String>,
            names: Vec<String>,
            compare_with: usize,
            #[serde(skip_serializing_if = "Methods::is_empty")]
            methods: &'a Methods,
            #[serde(skip_serializing_if = "Option::is_none")]
            shard: Option<ShardRecord>,
        }
        let names = self.drivers.iter().map(|driver| driver.name.clone()).collect();
        let (drivers, compare_with, methods) = (self.specs(), self.compare_with, &self.methods);
        let arguments = Arguments { drivers, names, compare_with, methods, shard };
        Ok(toml::Table::try_from(arguments)?)
    }

    fn specs(&self) -> Vec<String> {
        self.drivers.iter().map(|driver| driver.spec.to_string()).collect()
    }

    /// Claims the folder.
    fn begin(&self, plan: &Plan<'_>, out: &Path, overwrite: bool) -> anyhow::Result<RunDir> {
        let is_free = out.read_dir().map_or(true, |mut entries| entries.next().is_none());
        ensure!(
            overwrite || is_free,
            "{}: holds files already, and an evaluation from Python cannot be continued; choose another out, or overwrite=True",
            out.display()
        );
        let build = Build {
            program: concat!("lotpilot ", env!("CARGO_PKG_VERSION"), ", Python").to_owned(),
            // Shards of networks come together only from machines that round alike.
            processor_features: processor_features(),
            ..Build::default()
        };
        let place = Place {
            build: &build,
            out: Some(out),
            overwrite,
            command: "lotpilot.evaluate",
            preset: "python",
            seed: self.settings.evaluation.seed.0,
        };
        let arguments = self.arguments(ShardRecord::of(plan)?)?;
        let (inputs, reads) = (inputs::of(&self.lots, &self.drivers), self.reads.clone());
        RunDir::create(&place, &self.settings, &Request { arguments, inputs, reads })
    }

    /// Drives what is not driven yet, and writes the tables unless it is a shard.
    fn finish(&self, plan: &Plan<'_>, run: &RunDir, watch: &Watch) -> anyhow::Result<()> {
        let Some(results) = evaluation::evaluate::evaluate(plan, run, watch)? else { return Ok(()) };
        if plan.shard.is_none() {
            Summary::new(plan, &results).write(run)?;
        }
        run.finish(Outcome::Evaluation { drivers: self.specs() })
    }
}

/// The settings of the first run that drives, unless others are named, with the trials laid over them.
fn settings_of(drivers: &[(String, Named)], layers: Layers, trials: &Trials) -> anyhow::Result<Settings> {
    let specs = drivers.iter().filter_map(|(_, driver)| match driver {
        Named::Spec(spec) => Some(spec.parse()),
        Named::Function(_) => None,
    });
    let specs = specs.collect::<anyhow::Result<Vec<DriverSpec>>>()?;
    let mut settings = match drivers::settings_of_runs(&specs, &layers)? {
        Some((of_run, _)) => Settings::resolve_over(&of_run, &layers, None)?,
        None => Settings::resolve(&layers, None)?,
    };
    let evaluation = &mut settings.evaluation;
    evaluation.seed = trials.seed.map_or(evaluation.seed, RootSeed);
    if let Some(lots) = &trials.lots {
        evaluation.lots.clone_from(lots);
    }
    evaluation.trials = trials.trials.unwrap_or(evaluation.trials);
    if let Some(way) = &trials.directions {
        evaluation.directions = directions(way)?;
    }
    if let Some(levels) = &trials.noise {
        evaluation.noise = levels.iter().map(|level| noise(level)).collect::<anyhow::Result<_>>()?;
    }
    if let Some(smoothing) = &trials.smoothing {
        evaluation.smoothing = smoothing.parse().map_err(|error| anyhow::anyhow!("smoothing: {error}"))?;
    }
    settings.check()?;
    Ok(settings)
}
