//! How near-collisions fall with the number of different lots that are trained on, at as many drives and optimiser steps:
//! one training per number, then one evaluation of all of them on lots that none was trained on.
//!
//! A training of few lots meets each more often, with other noise every time. All make as many iterations as there can be,
//! whatever η says.

use crate::names::{BC, DAGGER};
use crate::stage::{Stage, Step};
use experiment::settings::Settings;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// How much is done, besides what the settings say: the arguments in the manifest.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Extent {
    /// Generated lots of a kind that differ in a training: one training each.
    pub different_lots: Vec<u32>,
    /// Lots that all are driven on, once each way.
    pub unseen: Vec<String>,
}

/// Folder of the stage that drives.
pub const DRIVES: &str = "drives";

/// Folder of a training.
pub fn folder(different_lots: u32) -> String {
    format!("lots-{different_lots:04}")
}

/// Different lots that a training met in so many rounds: a round drives no more of a kind than are listed of it.
pub fn lots_met(listed_of_kinds: impl IntoIterator<Item = usize>, different_lots: u32, rounds: usize) -> usize {
    listed_of_kinds.into_iter().map(|listed| (different_lots as usize).min(rounds * listed)).sum()
}

/// Names in tables of what was trained on so many lots of a kind: behaviour cloning, `DAgger`.
pub fn names(different_lots: u32) -> [String; 2] {
    [BC, DAGGER].map(|name| format!("{name}, {different_lots} of a kind"))
}

/// The trainings, then the evaluation. `root`: the folder of the whole run.
pub fn stages(settings: &Settings, extent: &Extent, root: &Path) -> Vec<Stage> {
    let training = |&different_lots: &u32| {
        let mut settings = settings.clone();
        settings.training.different_lots = different_lots;
        // Where η ended one of them earlier, it would have driven less than the others.
        settings.dagger.iterations_min = settings.dagger.iterations_max;
        Stage {
            folder: folder(different_lots),
            about: format!("training on {different_lots} different lots of a kind"),
            settings,
            step: Step::Train { cloning_of: None, samples_of: None },
        }
    };
    let mut stages: Vec<Stage> = extent.different_lots.iter().map(training).collect();
    let drivers = |&different_lots: &u32| {
        let run = format!("run:{}", root.join(folder(different_lots)).display());
        let [cloned, dagger] = names(different_lots);
        [(cloned, format!("{run}/bc")), (dagger, run)]
    };
    let mut settings = settings.clone();
    (settings.evaluation.lots, settings.evaluation.trials) = (extent.unseen.clone(), 1);
    stages.push(Stage {
        folder: DRIVES.to_owned(),
        about: "all policies on lots that none was trained on".to_owned(),
        settings,
        step: Step::Drive { drivers: extent.different_lots.iter().flat_map(drivers).collect() },
    });
    stages
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Behaviour cloning, which has one round, was said to have met four times the lots that it had.
    #[test]
    fn a_round_meets_no_more_lots_than_are_listed() {
        let met = |different, rounds| lots_met([16, 16, 4], different, rounds);
        assert_eq!([met(1, 1), met(16, 1), met(64, 1), met(64, 4)], [3, 36, 36, 144]);
    }

    #[test]
    fn trainings_differ_in_the_number_of_lots_alone_and_all_are_driven() {
        let settings = Settings::preset("default").unwrap();
        let extent = Extent { different_lots: vec![1, 16], unseen: vec!["validation:9:all".to_owned()] };
        let stages = stages(&settings, &extent, Path::new("R"));
        let [few, many, drives] = stages.as_slice() else { panic!("{stages:?}") };
        assert_eq!((few.settings.training.different_lots, many.settings.training.different_lots), (1, 16));
        let mut alike = few.settings.clone();
        alike.training.different_lots = 16;
        assert_eq!(alike, many.settings);
        // A training whose network passed η ended before the others, with fewer drives.
        let (of_few, asked) = (&few.settings.dagger, &settings.dagger);
        assert!(asked.iterations_min < asked.iterations_max);
        assert_eq!((of_few.iterations_min, of_few.iterations_max), (asked.iterations_max, asked.iterations_max));
        let Step::Drive { drivers } = &drives.step else { panic!("{drives:?}") };
        assert_eq!(drivers.len(), 4);
        assert_eq!(drivers[3], ("DAgger, 16 of a kind".to_owned(), "run:R/lots-0016".to_owned()));
    }
}
