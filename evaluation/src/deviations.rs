//! What the deviations of a preset from the paper do: one training per deviation, with that one thing as in the paper
//! and everything else as it is, then the policies of all on lots that none was trained on.
//!
//! The test `every_deviation_of_the_default_is_listed` holds [`DEVIATIONS`] against both presets.

use crate::names::{BC, DAGGER};
use crate::stage::{Stage, Step};
use experiment::settings::{Layers, Settings};
use serde::{Deserialize, Serialize};
use std::path::Path;
use toml::Value;

/// One thing that is not as in the paper.
#[derive(Debug, Clone, Copy)]
pub struct Deviation {
    /// As named on the command line.
    pub name: &'static str,
    /// What the paper has, for tables.
    pub of_paper: &'static str,
    /// The settings that say so, or what they begin with.
    pub keys: &'static [&'static str],
    /// Whether behaviour cloning is another, too.
    pub changes_cloning: bool,
}

/// Every one, in the order of a training.
pub const DEVIATIONS: [Deviation; 13] = [
    Deviation {
        name: "points",
        of_paper: "points as far as the way is open, at v = a_y/4.48",
        keys: &[
            "episode.controller.speed_law",
            "expert.elastic_band.reach_max_m",
            "expert.elastic_band.reach_share",
            "expert.label_advance_step_m",
            "expert.label_retreat_step_m",
        ],
        changes_cloning: true,
    },
    Deviation {
        name: "lots",
        of_paper: "one round trip of lot a per round",
        keys: &["training.lots", "training.trials"],
        changes_cloning: true,
    },
    Deviation {
        name: "disturbances",
        of_paper: "no disturbances while collecting",
        keys: &["dagger.disturbance"],
        // Only rounds of DAgger are disturbed.
        changes_cloning: false,
    },
    Deviation {
        name: "network",
        of_paper: "the paper's layers and dropout",
        keys: &[
            "dagger.network.conv1",
            "dagger.network.conv2",
            "dagger.network.residual1",
            "dagger.network.residual2",
            "dagger.network.hidden",
            "dagger.network.dropout_features",
            "dagger.network.dropout_hidden",
        ],
        changes_cloning: true,
    },
    Deviation { name: "modes", of_paper: "one Gaussian", keys: &["dagger.network.modes"], changes_cloning: true },
    Deviation {
        name: "loss",
        of_paper: "plain likelihood, β = 0",
        keys: &["dagger.fit.loss.beta"],
        changes_cloning: true,
    },
    Deviation {
        name: "mirror",
        of_paper: "no mirror images in training",
        keys: &["dagger.fit.mirror"],
        changes_cloning: true,
    },
    Deviation {
        name: "optimiser",
        of_paper: "batches of 512, a constant rate of 1e-5, no clipping",
        keys: &["dagger.fit.batch", "dagger.fit.learning_rate", "dagger.fit.gradient_norm_max"],
        changes_cloning: true,
    },
    Deviation {
        name: "start",
        of_paper: "every fit from new weights",
        keys: &["dagger.start"],
        changes_cloning: false,
    },
    Deviation {
        name: "averaging",
        of_paper: "no mirror averaging at the wheel",
        keys: &["dagger.inference.mirror_averaging"],
        changes_cloning: true,
    },
    Deviation {
        name: "smoothing",
        of_paper: "no action smoothing",
        keys: &["dagger.inference.smoothing_ticks"],
        changes_cloning: true,
    },
    Deviation {
        name: "iterations",
        of_paper: "until η̂ > η, at most 8 times",
        keys: &["dagger.iterations_min", "dagger.iterations_max"],
        changes_cloning: false,
    },
    Deviation {
        name: "steps",
        of_paper: "100 000 optimiser steps per fit",
        keys: &[
            "dagger.fit.budget",
            "dagger.cloning_budget",
            "dagger.fit.validate_every",
            "dagger.fit.validate_on_max",
        ],
        changes_cloning: true,
    },
];

/// Settings that differ and change nothing that is learned.
#[cfg(test)]
const WITHOUT_EFFECT: [&str; 1] = ["evaluation.elsewhere"];

/// The deviation of a name.
pub fn called(name: &str) -> Option<&'static Deviation> {
    DEVIATIONS.iter().find(|deviation| deviation.name == name)
}

/// How much is done, besides what the settings say: the arguments in the manifest.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Extent {
    /// Deviations by name: one training each, beside that of the settings as they are.
    pub deviations: Vec<String>,
    /// Lots that all are driven on, once each way.
    pub unseen: Vec<String>,
}

impl Extent {
    /// Everything that the settings have otherwise, but what is [too long](TOO_LONG).
    ///
    /// # Errors
    /// See [`as_in_the_paper`].
    pub fn of_all(settings: &Settings, unseen: &[String]) -> anyhow::Result<Self> {
        let mut names = Vec::new();
        for deviation in DEVIATIONS.iter().filter(|deviation| deviation.name != TOO_LONG) {
            if as_in_the_paper(settings, deviation)? != *settings {
                names.push(deviation.name.to_owned());
            }
        }
        Ok(Self { deviations: names, unseen: unseen.to_vec() })
    }
}

/// Not done unless it is asked for by name.
pub const TOO_LONG: &str = "steps";

/// Folder, and name, of the training that deviates in everything.
pub const BASE: &str = "as-it-is";

/// Folder of the stage that drives what was trained with the car and the controller of the settings.
pub const DRIVES: &str = "drives";

/// Folder of the stage that drives the policies of a training: its own where its car or controller is another.
pub fn drives_of(settings: &Settings, of_training: &Settings, name: &str) -> String {
    if of_training.episode == settings.episode { DRIVES.to_owned() } else { format!("{DRIVES}-{name}") }
}

/// Names in tables of the policies of a training: behaviour cloning, `DAgger`.
pub fn names(name: &str) -> [String; 2] {
    [BC, DAGGER].map(|method| if name == BASE { method.to_owned() } else { format!("{method}, {name}") })
}

/// The settings with one thing as in the paper.
///
/// # Errors
/// If they contradict each other then.
pub fn as_in_the_paper(settings: &Settings, deviation: &Deviation) -> anyhow::Result<Settings> {
    let paper = Settings::preset("paper")?.leaves();
    let is_of = |key: &str| deviation.keys.iter().any(|of| is_within(key, of));
    let overrides = paper.iter().filter(|(key, _)| is_of(key)).map(|(key, value)| format!("{key}={value}")).collect();
    Settings::resolve_over(settings, &Layers { overrides, ..Layers::default() }, None)
}

/// Settings of trainings that are not those of the preset `paper`, each with its own value and the paper's.
///
/// # Errors
/// If the preset cannot be read.
pub fn unlike_the_paper(settings: &Settings) -> anyhow::Result<Vec<String>> {
    let paper = Settings::preset("paper")?.leaves();
    let of_paper = |key: &str| paper.iter().find(|(known, _)| known == key).map(|(_, value)| value);
    let is_of_training = |key: &str| !is_within(key, "evaluation") && key != "seed";
    let unlike =
        settings.leaves().into_iter().filter(|(key, value)| is_of_training(key) && of_paper(key) != Some(value));
    let said = |(key, value): (String, Value)| {
        let of_paper = of_paper(&key).map_or_else(|| "none".to_owned(), Value::to_string);
        format!("{key} = {value} (paper: {of_paper})")
    };
    Ok(unlike.map(said).collect())
}

fn is_within(key: &str, of: &str) -> bool {
    key.strip_prefix(of).is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
}

/// The trainings, then the evaluations. `root`: the folder of the whole run.
///
/// # Errors
/// See [`as_in_the_paper`].
pub fn stages(settings: &Settings, extent: &Extent, root: &Path) -> anyhow::Result<Vec<Stage>> {
    let train = |name: &str, about: String, settings: Settings, changes_cloning: bool| Stage {
        folder: name.to_owned(),
        about,
        settings,
        step: Step::Train { cloning_of: (!changes_cloning).then(|| BASE.to_owned()), samples_of: None },
    };
    let mut stages = vec![train(BASE, "everything as it is".to_owned(), settings.clone(), true)];
    for deviation in extent.deviations.iter().filter_map(|name| called(name)) {
        let about = format!("as in the paper: {}", deviation.of_paper);
        let changed = as_in_the_paper(settings, deviation)?;
        stages.push(train(deviation.name, about, changed, deviation.changes_cloning));
    }
    let mut drives: Vec<Stage> = Vec::new();
    for training in &stages {
        let run = format!("run:{}", root.join(&training.folder).display());
        let [cloned, dagger] = names(&training.folder);
        let folder = drives_of(settings, &training.settings, &training.folder);
        let named = [(dagger, run.clone()), (cloned, format!("{run}/bc"))];
        let found = drives.iter_mut().find(|stage| stage.folder == folder).map(|stage| &mut stage.step);
        if let Some(Step::Drive { drivers }) = found {
            drivers.extend(named);
        } else {
            let mut settings = training.settings.clone();
            (settings.evaluation.lots, settings.evaluation.trials) = (extent.unseen.clone(), 1);
            drives.push(Stage {
                folder,
                about: "policies on lots that none was trained on".to_owned(),
                settings,
                step: Step::Drive { drivers: named.to_vec() },
            });
        }
    }
    stages.extend(drives);
    Ok(stages)
}

#[cfg(test)]
mod tests {
    use super::*;
    use experiment::settings::with_points_of_paper;

    #[test]
    fn every_deviation_of_the_default_is_listed() {
        let [default, paper] = ["default", "paper"].map(|name| Settings::preset(name).unwrap().leaves());
        let listed = |key: &str| {
            let keys = DEVIATIONS.iter().flat_map(|deviation| deviation.keys);
            keys.filter(|of| is_within(key, of)).count() + WITHOUT_EFFECT.iter().filter(|of| **of == key).count()
        };
        for (key, value) in &default {
            let of_paper = paper.iter().find(|(other, _)| other == key).map(|(_, value)| value);
            assert!(of_paper == Some(value) || listed(key) == 1, "{key}: {value} here, {of_paper:?} in the paper");
        }
        assert!(paper.iter().all(|(key, _)| default.iter().any(|(other, _)| other == key)));
    }

    /// `reproduce` has a control with the paper's points.
    #[test]
    fn the_points_of_the_paper_are_the_same_everywhere() {
        let settings = Settings::preset("default").unwrap();
        let points = as_in_the_paper(&settings, called("points").unwrap()).unwrap();
        assert_eq!(with_points_of_paper(&settings), points);
    }

    #[test]
    fn all_deviations_together_are_the_paper() {
        let mut settings = Settings::preset("default").unwrap();
        for deviation in &DEVIATIONS {
            let changed = as_in_the_paper(&settings, deviation).unwrap();
            assert_ne!(changed, settings, "{} changes nothing", deviation.name);
            settings = changed;
        }
        settings.evaluation.elsewhere.clear();
        assert_eq!(settings, Settings::preset("paper").unwrap());
    }

    #[test]
    fn what_is_unlike_the_paper_is_named_with_both_values() {
        let mut settings = Settings::preset("paper").unwrap();
        settings.evaluation.trials = 77;
        assert!(unlike_the_paper(&settings).unwrap().is_empty());
        settings.dagger.iterations_max = 5;
        settings.dagger.fit.loss.alpha = 0.4;
        let unlike = unlike_the_paper(&settings).unwrap();
        assert_eq!(unlike, ["dagger.fit.loss.alpha = 0.4 (paper: 1.5)", "dagger.iterations_max = 5 (paper: 8)"]);
    }

    #[test]
    fn another_controller_is_driven_by_itself_and_the_same_cloning_is_trained_once() {
        let settings = Settings::preset("default").unwrap();
        let deviations = ["points", "start", "mirror"].map(str::to_owned).to_vec();
        let extent = Extent { deviations, unseen: vec!["validation:9:all".to_owned()] };
        let stages = stages(&settings, &extent, Path::new("R")).unwrap();
        let folders: Vec<&str> = stages.iter().map(|stage| stage.folder.as_str()).collect();
        assert_eq!(folders, [BASE, "points", "start", "mirror", "drives", "drives-points"]);
        assert_eq!(stages[2].step, Step::Train { cloning_of: Some(BASE.to_owned()), samples_of: None });
        assert_eq!(stages[3].step, Step::Train { cloning_of: None, samples_of: None });
        let Step::Drive { drivers } = &stages[4].step else { panic!("{:?}", stages[4]) };
        assert_eq!(drivers.len(), 6);
        assert_eq!(drivers[0], ("DAgger".to_owned(), format!("run:R/{BASE}")));
        assert_eq!(stages[5].settings.episode, stages[1].settings.episode);
    }
}
