//! An evaluation counted again from what it wrote.

use super::EvaluationResults;
use crate::evaluate::Plan;
use crate::failures::{self, Cause};
use crate::settings::NoiseChoice;
use crate::trials::{Purpose, Trial};
use anyhow::Context as _;
use serde::Deserialize;
use serde::de::DeserializeOwned;
use sim::episode::EpisodeReport;
use sim::scenario::Direction;
use std::collections::BTreeMap;
use std::path::Path;

/// What is read of a line of `runs.jsonl`.
#[derive(Deserialize)]
struct Driven {
    driver: String,
    lot: String,
    direction: Direction,
    trial: u32,
    noise: NoiseChoice,
    #[serde(flatten)]
    report: EpisodeReport,
}

/// What is read of a line of `failures.jsonl`.
#[derive(Deserialize)]
struct Failed {
    driver: String,
    lot: String,
    noise: NoiseChoice,
    cause: Cause,
    since_resume_m: Option<f32>,
}

impl EvaluationResults {
    /// Reads `runs.jsonl` and `failures.jsonl` of a folder: the same results as after driving the plan.
    ///
    /// # Errors
    /// If a file cannot be read, or was not written by this plan.
    pub fn read(plan: &Plan<'_>, folder: &Path) -> anyhow::Result<Self> {
        let mut results = Self::new(plan);
        let evaluation = &plan.settings.evaluation;
        let jobs =
            Trial::all(evaluation.seed, Purpose::Evaluation, plan.lots, evaluation.trials, &evaluation.directions);
        let jobs: Vec<Trial<'_>> = jobs.collect();
        let key = |job: &Trial<'_>| (job.lot.name().to_owned(), job.direction, job.trial);
        let index_of: BTreeMap<_, usize> = jobs.iter().map(key).zip(0..).collect();
        let level_of = |noise| evaluation.noise.iter().position(|&level| level == noise).context("another noise level");
        let driver_of = |name: &str| {
            let mut names = plan.entries.iter().map(|entry| &entry.contestant.name);
            names.position(|known| known == name).with_context(|| format!("another driver, {name:?}"))
        };
        each_line(&folder.join("runs.jsonl"), |run: Driven| {
            let index = index_of.get(&(run.lot, run.direction, run.trial)).copied().context("another run")?;
            results.add(level_of(run.noise)?, driver_of(&run.driver)?, index, &jobs[index], &run.report);
            Ok(())
        })?;
        each_line(&folder.join("failures.jsonl"), |failed: Failed| {
            let lot = plan.lots.iter().find(|lot| lot.name() == failed.lot).context("another lot")?;
            let (level, driver) = (level_of(failed.noise)?, driver_of(&failed.driver)?);
            results.add_cause(level, driver, lot, failed.cause, failures::is_again(failed.since_resume_m));
            Ok(())
        })?;
        Ok(results)
    }
}

fn each_line<T: DeserializeOwned>(path: &Path, mut take: impl FnMut(T) -> anyhow::Result<()>) -> anyhow::Result<()> {
    let text = std::fs::read_to_string(path).with_context(|| format!("{}: cannot be read", path.display()))?;
    for (index, line) in text.lines().enumerate() {
        let taken = serde_json::from_str(line).map_err(anyhow::Error::from).and_then(&mut take);
        taken.with_context(|| {
            format!("{}:{}: not of this evaluation; drive it again into another folder", path.display(), index + 1)
        })?;
    }
    Ok(())
}
