//! The `DAgger` family in one trainer: a training per decision rule and seed, at equal samples, lots and optimiser steps,
//! then one evaluation of all policies on lots that none was trained on (docs/methods.md 5).
//!
//! Rules differ in who drives while data are collected, and in nothing else, except for those of an ensemble: that
//! trains three networks and drives with their mean. Behaviour cloning is the same for all rules of a seed and is
//! trained once.

use crate::stage::{Stage, Step};
use experiment::settings::{Layers, Settings};
use policy::decision_rule::DecisionRule;
use serde::{Deserialize, Serialize};
use sim::seed::RootSeed;
use std::collections::BTreeMap;
use std::path::Path;

/// How much is done, besides what the settings say: the arguments in the manifest.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Extent {
    /// Rules by name, one training of each per seed.
    pub rules: Vec<String>,
    /// Root seeds: the settings' first, then the next.
    pub seeds: u64,
    /// Iterations of every training.
    pub iterations: u32,
    /// Samples of a round that are learned from.
    pub samples: u32,
    /// Lots that all are driven on, once each way.
    pub unseen: Vec<String>,
}

impl Extent {
    /// Every rule, as the command compares them unless something else is said.
    pub fn of_all(seeds: u64, unseen: &[String]) -> Self {
        let rules = all().map(|(name, _)| name.to_owned()).to_vec();
        Self { rules, seeds, iterations: ITERATIONS, samples: SAMPLES, unseen: unseen.to_vec() }
    }
}

/// Iterations that tell rules apart (chosen).
pub const ITERATIONS: u32 = 2;
/// Samples of a round: about a third of the ticks that [`FEW_LOTS`] give (chosen).
pub const SAMPLES: u32 = 20_000;

/// Folder of the stage that drives.
pub const DRIVES: &str = "drives";

/// What is set before the user sets anything: three lots of each of the first twelve families and one round trip of lot a in every round,
/// and fits of as many steps as so few samples are worth; rules and seeds make for many trainings.
pub const FEW_LOTS: [&str; 5] = [
    r#"training.lots=["lot-a", "train:36:all"]"#,
    "training.trials=1",
    "dagger.cloning_budget.steps=2000",
    "dagger.fit.budget.steps=2000",
    EVERY_TICK,
];
/// Every tick is learned from: rules that let the network drive on would leave the expert's ticks of its worst moments alone, and
/// too few of them for equal samples.
pub const EVERY_TICK: &str = r#"dagger.keep="every_tick""#;

/// Settings of a comparison beside other trainings: of few lots where those of the others are the default's, else of their own.
/// What is set and not the default's stays.
///
/// # Errors
/// If they contradict what is set so.
pub fn in_short(settings: &Settings) -> anyhow::Result<Settings> {
    let default = Settings::preset("default")?;
    let changes = if settings.training == default.training { &FEW_LOTS[..] } else { &[EVERY_TICK] };
    let values = [settings, &default].map(|settings| BTreeMap::from_iter(settings.leaves()));
    let is_the_defaults = |change: &&&str| {
        let key = change.split_once('=').map_or(**change, |(key, _)| key);
        let [value, of_default] = values.each_ref().map(|values| values.get(key));
        value == of_default
    };
    let overrides = changes.iter().filter(is_the_defaults).map(|&change| change.to_owned()).collect();
    Settings::resolve_over(settings, &Layers { overrides, ..Layers::default() }, None)
}

/// Name in tables of what every training begins with.
pub const CLONED: &str = "behaviour cloning";

/// Rules by the name of their setting, each with its name in tables.
pub fn all() -> [(&'static str, &'static str); 10] {
    [
        ("expert_only", "expert only"),
        ("vanilla", "vanilla DAgger"),
        ("safe_dagger", "SafeDAgger"),
        ("ensemble_dagger", "EnsembleDAgger"),
        ("hg_dagger", "HG-DAgger"),
        ("lazy_dagger", "LazyDAgger"),
        ("thrifty_dagger", "ThriftyDAgger"),
        ("all_below", "paper, all below"),
        ("any_below_literal", "paper, any below"),
        ("tau_only", "paper, τ̂ alone"),
    ]
}

/// Name in tables of a rule.
pub fn title(rule: &str) -> &str {
    all().into_iter().find(|(name, _)| *name == rule).map_or(rule, |(_, title)| title)
}

/// The rule of a name, with its own thresholds; with those of the settings if that is the rule which they name.
pub fn rule_of(settings: &Settings, name: &str) -> Option<DecisionRule> {
    let of_settings = settings.dagger.rule;
    let rule = DecisionRule::named(name)?;
    Some(if rule.is_like(&of_settings) { of_settings } else { rule })
}

/// The rule of the settings, where it has thresholds that are not its own.
pub fn with_other_thresholds(settings: &Settings) -> Option<&'static str> {
    let (name, _) = all().into_iter().find(|(name, _)| {
        DecisionRule::named(name)
            .is_some_and(|rule| rule.is_like(&settings.dagger.rule) && rule != settings.dagger.rule)
    })?;
    Some(name)
}

/// Folder of a training.
pub fn folder(rule: &str, seed: RootSeed) -> String {
    format!("s{}-{rule}", seed.0)
}

/// Drivers of the last stage: behaviour cloning of each seed, then each rule of each seed, with the rule's name.
pub fn policies<'e>(settings: &Settings, extent: &'e Extent) -> Vec<(RootSeed, Option<&'e str>)> {
    let of_seed = |seed| {
        let rules = extent.rules.iter().map(move |rule| (seed, Some(rule.as_str())));
        std::iter::once((seed, None)).chain(rules)
    };
    settings.training_seeds(extent.seeds).into_iter().flat_map(of_seed).collect()
}

/// The trainings, then the evaluation. `root`: the folder of the whole run.
pub fn stages(settings: &Settings, extent: &Extent, root: &Path) -> Vec<Stage> {
    let mut stages = Vec::new();
    for seed in settings.training_seeds(extent.seeds) {
        for rule in &extent.rules {
            stages.push(Stage {
                folder: folder(rule, seed),
                about: format!("{}, seed {}", title(rule), seed.0),
                settings: of_rule(settings, extent, rule, seed),
                step: Step::Train {
                    cloning_of: extent.rules.first().filter(|first| *first != rule).map(|first| folder(first, seed)),
                    samples_of: None,
                },
            });
        }
    }
    let driver = |(seed, rule): (RootSeed, Option<&str>)| {
        let first = extent.rules.first().map_or("", String::as_str);
        let run = root.join(folder(rule.unwrap_or(first), seed));
        let name = format!("{} (seed {})", rule.map_or(CLONED, title), seed.0);
        let bc = if rule.is_none() { "/bc" } else { "" };
        (name, format!("run:{}{bc}", run.display()))
    };
    let mut settings = settings.clone();
    (settings.evaluation.lots, settings.evaluation.trials) = (extent.unseen.clone(), 1);
    let drivers = policies(&settings, extent).into_iter().map(driver).collect();
    stages.push(Stage {
        folder: DRIVES.to_owned(),
        about: "all policies on lots that none was trained on".to_owned(),
        settings,
        step: Step::Drive { drivers },
    });
    stages
}

/// The settings of a training: rules make as many iterations and learn from as many samples.
fn of_rule(settings: &Settings, extent: &Extent, rule: &str, seed: RootSeed) -> Settings {
    let rule = rule_of(settings, rule);
    let mut settings = Settings { seed, ..settings.clone() };
    let dagger = &mut settings.dagger;
    dagger.rule = rule.unwrap_or(dagger.rule);
    (dagger.iterations_min, dagger.iterations_max) = (extent.iterations, extent.iterations);
    dagger.samples_per_round = extent.samples;
    settings
}

#[cfg(test)]
mod tests {
    use super::*;
    use experiment::settings::reference;
    use policy::dagger::Keep;
    use policy::decision_rule::SafeDaggerSettings;
    use policy::fit::Budget;
    use std::collections::BTreeSet;

    #[test]
    fn trainings_differ_in_rule_and_seed_alone_and_all_are_driven() {
        let settings = Settings::preset("default").unwrap();
        let rules = ["expert_only", "ensemble_dagger"].map(str::to_owned).to_vec();
        let extent =
            Extent { rules, seeds: 2, iterations: 1, samples: 500, unseen: vec!["validation:9:all".to_owned()] };
        let stages = stages(&settings, &extent, Path::new("R"));
        assert_eq!(stages.len(), 5);
        let (control, ensemble) = (&stages[0], &stages[1]);
        let mut alike = control.settings.clone();
        alike.dagger.rule = ensemble.settings.dagger.rule;
        assert_eq!(alike, ensemble.settings);
        assert_eq!(control.settings.dagger.samples_per_round, 500);
        let cloning_of = Some("s1-expert_only".to_owned());
        assert_eq!(ensemble.step, Step::Train { cloning_of, samples_of: None });
        let Step::Drive { drivers } = &stages[4].step else { panic!("the last stage drives") };
        assert_eq!(drivers[0], ("behaviour cloning (seed 1)".to_owned(), "run:R/s1-expert_only/bc".to_owned()));
        assert_eq!(drivers[5], ("EnsembleDAgger (seed 2)".to_owned(), "run:R/s2-ensemble_dagger".to_owned()));
    }

    /// `reproduce --tables rules --set dagger.fit.budget.steps=3000` compared rules with fits of 2000 steps.
    #[test]
    fn a_comparison_in_short_keeps_what_is_set() {
        let mut settings = Settings::preset("default").unwrap();
        settings.dagger.fit.budget = Budget::Steps(3000);
        let short = in_short(&settings).unwrap();
        assert_eq!(short.dagger.fit.budget, Budget::Steps(3000));
        assert_eq!(short.dagger.cloning_budget, Budget::Steps(2000));
        assert_eq!(short.dagger.keep, Keep::EveryTick);
        assert_eq!(short.training.lots, ["lot-a", "train:36:all"]);
        // Lots of one's own: those, and fits of their length.
        settings.training.lots = vec!["lot-b".to_owned()];
        settings.dagger.keep = Keep::EveryTick;
        assert_eq!(in_short(&settings).unwrap(), settings);
    }

    /// `--set dagger.rule.safe_dagger.tau=0.02` changed nothing.
    #[test]
    fn a_rule_that_the_settings_name_has_their_thresholds_and_others_have_their_own() {
        let thresholds = SafeDaggerSettings { tau: 0.02 };
        let mut settings = Settings::preset("default").unwrap();
        assert_eq!(with_other_thresholds(&settings), None);
        settings.dagger.rule = DecisionRule::SafeDagger(thresholds);
        assert_ne!(thresholds, SafeDaggerSettings::default());
        assert_eq!(with_other_thresholds(&settings), Some("safe_dagger"));
        let rules = ["all_below", "safe_dagger"].map(str::to_owned).to_vec();
        let extent = Extent { rules, seeds: 1, iterations: 1, samples: 500, unseen: Vec::new() };
        let trained = stages(&settings, &extent, Path::new("R"));
        let rules: Vec<DecisionRule> = trained[..2].iter().map(|stage| stage.settings.dagger.rule).collect();
        assert_eq!(rules, [DecisionRule::paper(), DecisionRule::SafeDagger(thresholds)]);
    }

    #[test]
    fn every_rule_has_a_title_and_is_a_setting() {
        let titled: BTreeSet<&str> = all().into_iter().map(|(name, _)| name).collect();
        let setting = reference::entries().iter().find(|entry| entry.key == "dagger.rule").unwrap();
        let named: BTreeSet<&str> = setting.choices.iter().map(String::as_str).collect();
        assert_eq!(titled, named);
        for name in named {
            assert!(DecisionRule::named(name).is_some(), "{name}");
        }
        assert!(DecisionRule::named("anybody").is_none());
    }
}
