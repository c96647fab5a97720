//! Evaluations that belong to a run: in folders within its own.

use anyhow::ensure;
use evaluation::plan::Plan;
use evaluation::results::EvaluationResults;
use experiment::drivers::NamedDriver;
use experiment::lots::Lot;
use experiment::manifest::Outcome;
use experiment::progress::{Interrupted, Progress};
use experiment::run_dir::{Place, RunDir};
use experiment::settings::Settings;

/// Drives drivers over the lots of some settings into a folder within a run, or continues what is there.
///
/// # Errors
/// If a lot cannot be built or a file cannot be written, or on Ctrl-C; what was driven by then is kept.
pub(crate) fn evaluate(
    run: &RunDir,
    folder: &str,
    settings: &Settings,
    drivers: &[NamedDriver],
    progress: &dyn Progress,
) -> anyhow::Result<EvaluationResults> {
    let lots = Lot::parse_all(&settings.evaluation.lots, &settings.episode.vehicle)?;
    ensure!(!drivers.is_empty(), "no driver is named");
    let plan = Plan { settings, drivers, lots: &lots, compare_with: drivers.len() - 1, shard: None };
    let place = Place {
        build: crate::build_info::get(),
        out: None,
        overwrite: false,
        command: "evaluate",
        preset: "run",
        seed: settings.evaluation.seed.0,
    };
    let Some(stage) = run.stage(folder, &place, settings)? else {
        return EvaluationResults::read(&plan, &run.path().join(folder));
    };
    let Some(results) = evaluation::evaluate::evaluate(&plan, &stage, progress)? else {
        return Err(Interrupted { kept: format!("what was done is in {}", run.path().display()) }.into());
    };
    stage.finish(Outcome::Evaluation { drivers: drivers.iter().map(|driver| driver.spec.to_string()).collect() })?;
    Ok(results)
}
