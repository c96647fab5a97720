//! Evaluations: the plan, the loop and the tables of the command line.

use crate::callback::{Failure, Function, Watch};
use crate::course::{SettingsFrom, directions, noise};
use crate::guard::{detached, input};
use anyhow::Context as _;
use evaluation::plan::Plan;
use evaluation::summary::Summary;
use experiment::drivers::{DriverSpec, NamedDriver};
use experiment::inputs;
use experiment::lots::Lot;
use experiment::run_dir::{self, Build, Outcome, Place, Request, RunDir};
use experiment::settings::{Layers, Settings};
use pyo3::prelude::*;
use sim::seed::RootSeed;
use std::path::PathBuf;
use std::sync::Arc;

/// Which trials; what is `None` is as in the settings.
#[derive(Debug, FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Trials {
    lots: Option<Vec<String>>,
    trials: Option<u32>,
    directions: Option<String>,
    noise: Option<Vec<String>>,
    seed: Option<u64>,
    smoothing: Option<String>,
    compare_with: Option<String>,
}

/// A driver as on the command line, or a function.
#[derive(Debug, FromPyObject)]
pub(crate) enum Named {
    Spec(String),
    Function(Py<PyAny>),
}

/// Drives named drivers and functions on the same trials and writes the files of `cargo xtask evaluate` into `out`.
#[pyfunction]
pub(crate) fn evaluate(
    py: Python<'_>,
    drivers: Vec<(String, Named)>,
    trials: Trials,
    settings: SettingsFrom,
    out: PathBuf,
    overwrite: bool,
) -> PyResult<()> {
    let failure = Failure::default();
    let watch = Watch { failure: failure.clone() };
    let work = || {
        let settings = settings_of(&drivers, settings.into(), &trials)?;
        let loaded = drivers.into_iter().map(|(name, driver)| match driver {
            Named::Spec(spec) => Ok(spec.parse::<DriverSpec>()?.load(&settings)?.renamed(&name)),
            Named::Function(function) => {
                Ok(NamedDriver::callback(&name, Arc::new(Function { function, failure: failure.clone() })))
            }
        });
        let drivers = loaded.collect::<anyhow::Result<Vec<NamedDriver>>>()?;
        let lots = Lot::parse_all(&settings.evaluation.lots, &settings.episode.vehicle)?;
        let compare_with = match &trials.compare_with {
            Some(name) => drivers.iter().position(|driver| driver.name == *name),
            None => Some(0),
        };
        let compare_with = compare_with.context("compare_with: name one of the drivers")?;
        let plan = Plan { settings: &settings, drivers: &drivers, lots: &lots, compare_with, shard: None };
        plan.check()?;
        let build = Build {
            program: concat!("lotpilot ", env!("CARGO_PKG_VERSION"), ", Python").to_owned(),
            ..Build::default()
        };
        let place = Place {
            build: &build,
            out: Some(&out),
            overwrite,
            command: "lotpilot.evaluate",
            preset: "python",
            seed: settings.evaluation.seed.0,
        };
        let request = Request { inputs: inputs::of(&lots, &drivers), ..Request::default() };
        let run = RunDir::create(&place, &settings, &request)?;
        let Some(results) = evaluation::evaluate::evaluate(&plan, &run, &watch)? else { return Ok(()) };
        Summary::new(&plan, &results).write(&run)?;
        run.finish(Outcome::Evaluation { drivers: drivers.iter().map(|driver| driver.spec.to_string()).collect() })
    };
    let done = detached(py, || work().map_err(input));
    failure.take().map_or(done, Err)
}

/// The settings of the first run that drives, unless others are named, with the trials laid over them.
fn settings_of(drivers: &[(String, Named)], layers: Layers, trials: &Trials) -> anyhow::Result<Settings> {
    let specs = drivers.iter().filter_map(|(_, driver)| match driver {
        Named::Spec(spec) => Some(spec.parse()),
        Named::Function(_) => None,
    });
    let specs = specs.collect::<anyhow::Result<Vec<DriverSpec>>>()?;
    let run = specs.iter().find_map(DriverSpec::run).filter(|_| !layers.names_a_base());
    let mut settings = match run {
        Some(run) => Settings::resolve_over(&run_dir::settings_of(run)?, &layers, None)?,
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
