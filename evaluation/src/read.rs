//! Results of an evaluation, read back from its files.

use crate::incidents;
use crate::plan::Plan;
use crate::records::{self, FailureRecord, RunRecord};
use crate::results::EvaluationResults;
use anyhow::Context as _;
use experiment::trials::Trial;
use sim::limits::RUN_TEXT_BYTES_MAX;
use std::collections::BTreeMap;
use std::path::Path;
use storage::sums;

impl EvaluationResults {
    /// Reads `runs.jsonl` and `failures.jsonl` of a folder: the same results as after driving the plan.
    ///
    /// # Errors
    /// If a file is missing or damaged, or was not written by this plan.
    pub fn read(plan: &Plan<'_>, folder: &Path) -> anyhow::Result<Self> {
        let [runs, failures] =
            [records::RUNS, records::FAILURES].map(|name| sums::read_to_string(&folder.join(name), RUN_TEXT_BYTES_MAX));
        Self::of_lines(plan, folder, &runs?, &failures?)
    }

    /// Of the lines of both files, as far as they are written.
    ///
    /// # Errors
    /// If they were not written by this plan.
    pub(crate) fn of_lines(plan: &Plan<'_>, folder: &Path, runs: &str, failures: &str) -> anyhow::Result<Self> {
        let mut results = Self::new(plan);
        let evaluation = &plan.settings.evaluation;
        let trials: Vec<Trial<'_>> = plan.trials().collect();
        let key = |trial: &Trial<'_>| (trial.lot.name().to_owned(), trial.direction, trial.index);
        let index_of: BTreeMap<_, usize> = trials.iter().map(key).zip(0..).collect();
        let level_of = |noise| evaluation.noise.iter().position(|&level| level == noise).context("another noise level");
        let driver_of = |name: &str| {
            let mut names = plan.drivers.iter().map(|driver| &driver.name);
            names.position(|known| known == name).with_context(|| format!("another driver, {name:?}"))
        };
        records::each_line_of(&folder.join(records::RUNS), runs, |run: RunRecord| {
            let driven = run.driven;
            let index = index_of.get(&(driven.lot, driven.direction, driven.trial)).copied().context("another run")?;
            results.add(level_of(driven.noise)?, driver_of(&driven.driver)?, index, &trials[index], &run.report);
            Ok(())
        })?;
        records::each_line_of(&folder.join(records::FAILURES), failures, |failure: FailureRecord| {
            let driven = failure.driven;
            let lot = plan.lots.iter().find(|lot| lot.name() == driven.lot).context("another lot")?;
            let (level, driver) = (level_of(driven.noise)?, driver_of(&driven.driver)?);
            let is_again = incidents::is_again(failure.findings.since_resume_m);
            results.add_cause(level, driver, lot, failure.cause, is_again);
            Ok(())
        })?;
        Ok(results)
    }
}
