//! Results of an evaluation, read back from its files.

use crate::incidents;
use crate::plan::Plan;
use crate::records::{self, FailureRecord, RecordHeader, RunRecord};
use crate::results::EvaluationResults;
use anyhow::{Context as _, ensure};
use experiment::replay_key;
use experiment::trials::Trial;
use sim::scenario::Direction;
use std::collections::BTreeMap;
use std::path::Path;

impl EvaluationResults {
    /// Reads `runs.jsonl` and `failures.jsonl` of a folder: the same results as after driving the plan.
    ///
    /// # Errors
    /// If a file is missing or damaged, or was not written by this plan, by all of it.
    pub fn read(plan: &Plan<'_>, folder: &Path) -> anyhow::Result<Self> {
        let mut results = Self::new(plan);
        let places = Places::new(plan);
        let mut runs = 0;
        records::each_line(&folder.join(records::RUNS), |run| {
            runs += 1;
            results.take_run(&places, &run)
        })?;
        let asked_for = places.trials.len() * plan.drivers.len() * plan.settings.evaluation.noise.len();
        ensure!(
            runs == asked_for,
            "{}: {runs} runs of the {asked_for} that belong there: it is another evaluation; move it elsewhere, and drive again",
            folder.display()
        );
        records::each_line(&folder.join(records::FAILURES), |failure| results.take_failure(&places, &failure))?;
        Ok(results)
    }

    /// Adds a line of `runs.jsonl`.
    ///
    /// # Errors
    /// If it was not written by this plan.
    pub(crate) fn take_run(&mut self, places: &Places<'_>, run: &RunRecord) -> anyhow::Result<()> {
        let Place { level, driver, trial } = places.of_drive(&run.header, &run.replay)?;
        self.add(level, driver, trial, &places.trials[trial], &run.report);
        Ok(())
    }

    /// Adds a line of `failures.jsonl`.
    ///
    /// # Errors
    /// If it was not written by this plan.
    pub(crate) fn take_failure(&mut self, places: &Places<'_>, failure: &FailureRecord) -> anyhow::Result<()> {
        let Place { level, driver, trial } = places.of_drive(&failure.header, &failure.replay)?;
        let is_again = incidents::is_again(failure.findings.since_resume_m);
        self.add_cause(level, driver, places.trials[trial].lot, failure.cause, is_again);
        Ok(())
    }
}

/// Where a line belongs: indices of the noise level, the driver and the trial in a plan.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Place {
    pub(crate) level: usize,
    pub(crate) driver: usize,
    pub(crate) trial: usize,
}

/// Finds the places of lines in a plan.
pub(crate) struct Places<'a> {
    plan: &'a Plan<'a>,
    /// The trials of the plan, in order.
    pub(crate) trials: Vec<Trial<'a>>,
    index_of: BTreeMap<(String, Direction, u32), usize>,
}

impl<'a> Places<'a> {
    pub(crate) fn new(plan: &'a Plan<'a>) -> Self {
        let trials: Vec<Trial<'a>> = plan.trials().collect();
        let key = |trial: &Trial<'_>| (trial.lot.name().to_owned(), trial.direction, trial.index);
        let index_of = trials.iter().map(key).zip(0..).collect();
        Self { plan, trials, index_of }
    }

    /// Where a line belongs.
    ///
    /// # Errors
    /// If it is of another plan.
    pub(crate) fn of(&self, header: &RecordHeader) -> anyhow::Result<Place> {
        let key = (header.lot.clone(), header.direction, header.trial);
        let levels = &self.plan.settings.evaluation.noise;
        let mut names = self.plan.drivers.iter().map(|driver| &driver.name);
        Ok(Place {
            level: levels.iter().position(|&level| level == header.noise).context("another noise level")?,
            driver: names
                .position(|name| *name == header.driver)
                .with_context(|| format!("another driver, {:?}", header.driver))?,
            trial: self.index_of.get(&key).copied().context("another run")?,
        })
    }

    /// The same of a line with a replay key. Two files may have exchanged the names of their lots.
    ///
    /// # Errors
    /// If it is of another plan, or its lot lies in another file now.
    pub(crate) fn of_drive(&self, header: &RecordHeader, replay: &str) -> anyhow::Result<Place> {
        let place = self.of(header)?;
        let (then, now) = (replay_key::lot_of(replay), self.trials[place.trial].lot.spec());
        ensure!(then == now, "lot {:?} was {then}, and is {now} now", header.lot);
        Ok(place)
    }
}
