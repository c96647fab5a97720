//! Rows of parts of an evaluation in the order of the whole: the bytes that one command would have written.

use crate::evaluate::{BATCH, DRIVING, FILES};
use crate::plan::Plan;
use crate::read::{Place, Places};
use crate::records::{self, Driven};
use anyhow::ensure;
use experiment::run_dir::RunDir;
use experiment::trials::Trial;
use sim::limits::RUN_TEXT_BYTES_MAX;
use std::collections::BTreeSet;
use std::path::Path;
use storage::{growing, sums};

/// A trial in words: `LOT@DIRECTION@TRIAL`.
pub(crate) fn key(trial: &Trial<'_>) -> String {
    format!("{}@{}@{}", trial.lot.name(), trial.direction.name(), trial.index)
}

/// What was driven of a whole: some of its trials, or all of them by some of its drivers.
pub(crate) struct Part<'a> {
    pub(crate) folder: &'a Path,
    pub(crate) plan: Plan<'a>,
}

impl Part<'_> {
    /// The lines of a file with their places in the whole plan.
    fn rows(&self, name: &str, places: &Places<'_>) -> anyhow::Result<Vec<(Place, String)>> {
        let path = self.folder.join(name);
        let text = sums::read_to_string(&path, RUN_TEXT_BYTES_MAX)?;
        let own = Places::new(&self.plan);
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
            let levels = self.plan.settings.evaluation.noise.iter().enumerate();
            for (level, noise) in levels {
                for (driver, named) in self.plan.drivers.iter().enumerate() {
                    let missing = (0..own.trials.len()).find(|&trial| !seen.contains(&Place { level, driver, trial }));
                    if let Some(trial) = missing {
                        anyhow::bail!(
                            "{}: lacks {} by {} at noise {noise}; drive it again into another folder",
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

/// The lines of an evaluation, as one command would have written them.
#[derive(Debug)]
pub struct Rows([Vec<u8>; FILES.len()]);

impl Rows {
    /// Those of the parts of a plan, which are all of it.
    ///
    /// # Errors
    /// If a file is missing or damaged, or a row is missing, there twice, or of another part or plan.
    pub(crate) fn of(parts: &[Part<'_>], plan: &Plan<'_>) -> anyhow::Result<Self> {
        let places = Places::new(plan);
        let mut files = FILES.map(|_| Vec::new());
        for (name, file) in FILES.into_iter().zip(&mut files) {
            let mut rows = Vec::new();
            for part in parts {
                rows.extend(part.rows(name, &places)?);
            }
            // Stable: the near-collisions of a run stay in their order.
            rows.sort_by_key(|(place, _)| (place.trial / BATCH, *place));
            for (_, line) in rows {
                file.extend(line.into_bytes());
                file.push(b'\n');
            }
        }
        Ok(Self(files))
    }

    /// Writes them into the folder of a run.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn write(&self, run: &RunDir) -> anyhow::Result<()> {
        // An evaluation under way would be continued, in files that have been replaced.
        growing::clear(run.path(), DRIVING)?;
        // That of the runs is listed last: with it, the evaluation counts as driven.
        FILES.into_iter().zip(&self.0).rev().try_for_each(|(name, lines)| run.write(name, lines))
    }
}
