//! Named sets of settings, each with its reason.

use super::noise::NoiseChoice;
use super::schema::{EvaluationSettings, Settings, TrainingSettings};
use super::smoothing::Smoothing;
use anyhow::bail;
use expert::ExpertSettings;
use policy::dagger::{DaggerSettings, DisturbanceSettings, StartFrom};
use policy::dataset::ValidationSplit;
use policy::fit::{Budget, FitSettings};
use policy::network::{ConvLayer, InferenceSettings, NetworkArchitecture};
use sim::controller::{ControllerSettings, SpeedLaw};
use sim::episode::EpisodeSettings;
use sim::scenario::Direction;
use sim::seed::RootSeed;

/// A preset.
#[derive(Debug, Clone, Copy)]
pub struct Preset {
    /// As named on the command line.
    pub name: &'static str,
    /// What it is for.
    pub about: &'static str,
    make: fn() -> Settings,
}

/// Every preset.
pub const PRESETS: [Preset; 4] = [
    Preset { name: "default", about: "trains and checks within minutes on two cores", make: default },
    Preset { name: "strong", about: "thrice the lots and a larger network; several times as long", make: strong },
    Preset { name: "paper", about: "the paper's regime; many hours", make: paper },
    Preset { name: "smoke", about: "every step, as short as possible: for tests", make: smoke },
];

impl Settings {
    /// A named set.
    ///
    /// # Errors
    /// If there is none of this name.
    pub fn preset(name: &str) -> anyhow::Result<Self> {
        if let Some(preset) = PRESETS.iter().find(|preset| preset.name == name) {
            return Ok((preset.make)());
        }
        let names: Vec<&str> = PRESETS.iter().map(|preset| preset.name).collect();
        bail!("no preset {name:?}; there are {}", names.join(", "))
    }
}

/// Eight round trips of lot a per round instead of one, and generated lots of every family besides: here they cost
/// seconds, not hours of a person's day. What is learned on lot a alone does not carry over to corridors, and what is
/// learned on corridors (easy, medium, hard) does not carry over to other kinds of lots: on validation lots of all
/// families the policy had 3.6 near-collisions per 100 m trained on corridors, .3 trained on all
/// (docs/notebook/attempts.md). Most corridors are hard, because most of what fails among them fails there.
fn default() -> Settings {
    let base = with_half_points();
    Settings {
        training: TrainingSettings { lots: lots_of_every_family(1), trials: 8, ..base.training },
        evaluation: EvaluationSettings { elsewhere: ELSEWHERE.map(str::to_owned).to_vec(), ..base.evaluation },
        dagger: DaggerSettings::quick(),
        ..base
    }
}

/// Four lots of every family that the default trains on, none of them trained on.
const ELSEWHERE: [&str; 4] = ["validation:48:all", "validation:4:cones", "validation:4:slanted", "validation:4:mixed"];

/// Lot a, and this many times the generated lots of every family that the default trains on.
fn lots_of_every_family(times: u32) -> Vec<String> {
    let generated = [
        ("easy", 4),
        ("medium", 10),
        ("hard", 20),
        ("lane", 16),
        ("rooms", 14),
        ("street", 16),
        ("aisles", 14),
        ("track", 4),
        ("open", 12),
        ("halls", 12),
        ("yards", 10),
        ("chicanes", 12),
        ("cones", 12),
        ("slanted", 8),
        ("mixed", 40),
    ];
    let of_family = |(family, count)| format!("train:{}:{family}", times * count);
    std::iter::once("lot-a".to_owned()).chain(generated.map(of_family)).collect()
}

/// The default with more of both things that it is short of, lots and channels: on development lots either alone takes
/// off a third of the near-collisions of behaviour cloning, an ensemble of three default networks nothing
/// (docs/notebook/attempts.md).
fn strong() -> Settings {
    let base = default();
    Settings {
        training: TrainingSettings { lots: lots_of_every_family(3), ..base.training },
        dagger: DaggerSettings {
            network: NetworkArchitecture {
                conv1: ConvLayer { channels: 32, kernel: 5 },
                conv2: ConvLayer { channels: 64, kernel: 3 },
                hidden: 512,
                ..base.dagger.network
            },
            fit: FitSettings { budget: Budget::Steps(20_000), validate_every: 1000, ..base.dagger.fit },
            cloning_budget: Budget::Steps(16_000),
            ..base.dagger
        },
        ..base
    }
}

/// The paper, and our reading where it contradicts itself or says nothing (docs/paper.md, "Choices the paper leaves open"):
/// data from lot a, one round trip per round; evaluation on three lots, both ways, five trials. What the paper or the
/// authors' code states is held against it by the test `the_paper_preset_has_what_the_paper_states`. With
/// fewer optimiser steps (`--set dagger.fit.budget.steps=N --set dagger.cloning_budget.steps=N`) it is affordable.
fn paper() -> Settings {
    let episode = EpisodeSettings::paper();
    let names = |names: &[&str]| names.iter().map(|&name| name.to_owned()).collect();
    Settings {
        seed: RootSeed(1),
        training: TrainingSettings {
            lots: names(&["lot-a"]),
            directions: Direction::BOTH.to_vec(),
            trials: 1,
            different_lots: 0,
            noise: NoiseChoice::Paper,
        },
        evaluation: EvaluationSettings {
            seed: RootSeed(1),
            lots: names(&["lot-a", "lot-b", "lot-c"]),
            elsewhere: Vec::new(),
            directions: Direction::BOTH.to_vec(),
            trials: 5,
            noise: vec![NoiseChoice::Paper],
            smoothing: Smoothing::Own,
            untrained_conditions: false,
        },
        dagger: DaggerSettings::paper(),
        expert: ExpertSettings::paper(),
        episode: EpisodeSettings {
            controller: ControllerSettings { speed_law: SpeedLaw::Halved, ..episode.controller },
            ..episode
        },
    }
}

/// The settings with the expert's points as in the paper, as far as the way is open, and driven at half as fast (docs/paper.md,
/// "Points at half of the open way").
#[must_use]
pub fn with_points_of_paper(settings: &Settings) -> Settings {
    let (paper, mut changed) = (paper(), settings.clone());
    changed.episode.controller.speed_law = paper.episode.controller.speed_law;
    changed.expert.elastic_band.reach_share = paper.expert.elastic_band.reach_share;
    changed.expert.elastic_band.reach_max_m = paper.expert.elastic_band.reach_max_m;
    changed.expert.label_advance_step_m = paper.expert.label_advance_step_m;
    changed.expert.label_retreat_step_m = paper.expert.label_retreat_step_m;
    changed
}

/// Whether the expert's points lie as far as the way is open anyway.
pub fn has_points_of_paper(settings: &Settings) -> bool {
    with_points_of_paper(settings) == *settings
}

/// The paper's experiment in the reading of every preset but `paper`: points at half of the open way, driven at by
/// v = a_y/2.24 (docs/paper.md, "Points at half of the open way").
fn with_half_points() -> Settings {
    let base = paper();
    let controller = ControllerSettings { speed_law: SpeedLaw::Full, ..base.episode.controller };
    Settings { expert: ExpertSettings::half_points(), episode: EpisodeSettings { controller, ..base.episode }, ..base }
}

/// One way, one iteration, a network that fits into a cache, a few hundred steps.
fn smoke() -> Settings {
    let fit = FitSettings {
        batch: 64,
        budget: Budget::Steps(250),
        validation: ValidationSplit { block: 100, every: 5 },
        validate_every: 125,
        ..FitSettings::quick(250)
    };
    let base = with_half_points();
    Settings {
        training: TrainingSettings { directions: vec![Direction::Forward], ..base.training },
        evaluation: EvaluationSettings {
            directions: vec![Direction::Forward],
            lots: vec!["lot-b".to_owned()],
            elsewhere: vec!["validation:1:lane".to_owned()],
            trials: 1,
            ..base.evaluation
        },
        dagger: DaggerSettings {
            iterations_max: 1,
            noise_augmentations: 1,
            disturbance: DisturbanceSettings::quick(),
            start: StartFrom::Previous,
            network: NetworkArchitecture {
                conv1: ConvLayer { channels: 16, kernel: 3 },
                conv2: ConvLayer { channels: 16, kernel: 2 },
                residual1: 1,
                residual2: 1,
                hidden: 64,
                modes: 2,
                dropout_features: 0.0,
                dropout_hidden: 0.1,
            },
            inference: InferenceSettings { mirror_averaging: true, smoothing_ticks: 4.0 },
            cloning_budget: fit.budget,
            fit,
            ..base.dagger
        },
        ..base
    }
}
