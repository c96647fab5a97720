//! A stage that drives, with its drivers and lots.

use crate::conclusions;
use crate::plan::Plan;
use crate::stage::{self, Stage, Step};
use experiment::drivers::NamedDriver;
use experiment::lots::Lot;
use experiment::settings::Settings;
use experiment::shard::Shard;

/// What is needed to drive a stage, or to read what was driven.
#[derive(Debug)]
pub struct DriveStage<'a> {
    settings: &'a Settings,
    drivers: Vec<NamedDriver>,
    lots: Vec<Lot>,
    shard: Option<Shard>,
}

impl<'a> DriveStage<'a> {
    /// Loads the drivers and lots of a stage.
    ///
    /// # Errors
    /// If it does not drive, or something named does not exist.
    pub fn load(stage: &'a Stage) -> anyhow::Result<Self> {
        let (drivers, shard) = match &stage.step {
            Step::Drive { drivers } => (drivers, None),
            Step::DriveShard { drivers, shard } => (drivers, Some(*shard)),
            Step::Train { .. } | Step::OnPolicy { .. } => anyhow::bail!("{} does not drive", stage.folder),
        };
        let settings = &stage.settings;
        let drivers = stage::load(drivers, settings)?;
        let lots = Lot::parse_all(&settings.evaluation.lots, &settings.episode.vehicle)?;
        Ok(Self { settings, drivers, lots, shard })
    }

    /// The settings of the stage.
    pub fn settings(&self) -> &Settings {
        self.settings
    }

    /// What is driven.
    pub fn plan(&self) -> Plan<'_> {
        let Self { settings, drivers, lots, shard } = self;
        Plan { settings, drivers, lots, compare_with: conclusions::compare_with(drivers), shard: *shard }
    }
}
