//! A step of a run of several trainings: what it does, with which settings, and in which folder.

use crate::estimate::{self, Task};
use crate::names::EXPERT_EQUAL;
use experiment::drivers::{DriverSpec, NamedDriver};
use experiment::manifest;
use experiment::settings::Settings;
use experiment::shard::Shard;
use sim::seed::RootSeed;
use std::path::Path;
use storage::sums;

/// One step, with a folder of its own within the run.
#[derive(Debug, Clone, PartialEq)]
pub struct Stage {
    /// Its folder.
    pub folder: String,
    /// What it does, for people.
    pub about: String,
    /// Its settings.
    pub settings: Settings,
    /// The step itself.
    pub step: Step,
}

/// What can be done in a stage.
#[derive(Debug, Clone, PartialEq)]
pub enum Step {
    /// Trains a chain.
    Train {
        /// Folder of the chain whose behaviour cloning is taken over.
        cloning_of: Option<String>,
        /// Folder of the chain that decides how many samples an iteration keeps: as many as it has, on average.
        samples_of: Option<String>,
    },
    /// Drives `(name, spec)`, all compared with the driver of this name.
    Drive {
        /// Names in tables, specs of the command line.
        drivers: Vec<(String, String)>,
    },
    /// Drives a share of the trials of such a step.
    DriveShard {
        /// Names in tables, specs of the command line.
        drivers: Vec<(String, String)>,
        /// Which share.
        shard: Shard,
    },
    /// Networks drive, the expert labels every tick.
    OnPolicy {
        /// Whose trainings with and without the weight are compared; the first drives.
        seeds: Vec<RootSeed>,
    },
}

impl Stage {
    /// The same in a folder of the run: what it takes over from other stages lies there, too.
    pub(crate) fn within(mut self, folder: &str) -> Self {
        let within = |name: &mut String| name.insert_str(0, &format!("{folder}/"));
        within(&mut self.folder);
        if let Step::Train { cloning_of, samples_of } = &mut self.step {
            cloning_of.iter_mut().chain(samples_of).for_each(within);
        }
        self
    }

    /// What it does, with estimated seconds.
    pub fn tasks(&self) -> Vec<Task> {
        match &self.step {
            Step::Train { cloning_of, .. } => estimate::training(&self.settings, cloning_of.is_none()),
            Step::Drive { drivers } => vec![estimate::evaluation(&self.settings, drivers.len())],
            Step::DriveShard { drivers, shard } => {
                let (name, all_s) = estimate::evaluation(&self.settings, drivers.len());
                vec![(name, all_s / f64::from(shard.of()))]
            }
            Step::OnPolicy { .. } => vec![estimate::on_policy(&self.settings)],
        }
    }

    /// The same of what is left of it within its run; `None` if it is finished.
    ///
    /// # Errors
    /// If it cannot be told whether it is finished.
    pub fn tasks_left(&self, run: &Path) -> anyhow::Result<Option<Vec<Task>>> {
        let folder = run.join(&self.folder);
        if manifest::is_finished(&folder)? {
            return Ok(None);
        }
        if let Step::Train { cloning_of, .. } = &self.step {
            return Ok(Some(estimate::rest_of_training(&self.settings, cloning_of.is_none(), &folder)));
        }
        Ok(Some(self.tasks()))
    }
}

/// Refuses stages that were replaced since their run listed them: they may be whole, and another run's.
///
/// # Errors
/// If one was, or a list is missing or damaged.
pub fn ensure_of_run(stages: &[Stage], run: &Path) -> anyhow::Result<()> {
    stages.iter().try_for_each(|stage| Ok(sums::check_folder(run, &stage.folder)?))
}

/// Loads drivers under their names in tables.
///
/// # Errors
/// If something named does not exist.
pub fn load(drivers: &[(String, String)], settings: &Settings) -> anyhow::Result<Vec<NamedDriver>> {
    let load = |(name, spec): &(String, String)| {
        let mut driver = spec.parse::<DriverSpec>()?.load(settings)?.renamed(name);
        // Each has as many samples as the DAgger of its seed, so that their settings differ in more than the seed.
        driver.method = name.starts_with(EXPERT_EQUAL).then(|| EXPERT_EQUAL.to_owned());
        Ok(driver)
    };
    drivers.iter().map(load).collect()
}
