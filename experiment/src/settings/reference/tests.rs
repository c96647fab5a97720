//! The reference is complete, and says nothing that is not so.

use super::*;
use crate::settings::Layers;
use std::collections::BTreeSet;

fn resolve(change: &str) -> anyhow::Result<Settings> {
    Settings::resolve(&Layers { overrides: vec![change.to_owned()], ..Layers::default() }, None)
}

/// Every key of every preset and of every variant has an entry, and every entry is such a key.
#[test]
fn every_setting_is_described_and_every_description_has_a_setting() {
    let presets = PRESETS.iter().map(|preset| Settings::preset(preset.name).unwrap());
    let variants = [
        "dagger.rule=any_below_literal",
        "dagger.rule=tau_only",
        "dagger.rule=expert_only",
        "dagger.rule=vanilla",
        "dagger.rule=safe_dagger",
        "dagger.rule=ensemble_dagger",
        "dagger.rule=hg_dagger",
        "dagger.rule=lazy_dagger",
        "dagger.rule=thrifty_dagger",
        "dagger.fit.loss.weight=linear",
        "dagger.fit.budget.epochs=1",
        "dagger.cloning_budget.epochs=1",
        "dagger.final_budget.epochs=1",
    ];
    let settings = presets.chain(variants.map(|change| resolve(change).unwrap()));
    let keys: BTreeSet<String> = settings.flat_map(|settings| settings.leaves()).map(|(key, _)| key).collect();
    let described: BTreeSet<String> = entries().iter().map(|entry| entry.key.clone()).collect();
    assert_eq!(described.len(), entries().len(), "no entry twice");
    assert_eq!(described.difference(&keys).collect::<Vec<_>>(), Vec::<&String>::new(), "entries without a setting");
    assert_eq!(keys.difference(&described).collect::<Vec<_>>(), Vec::<&String>::new(), "settings without an entry");
}

#[test]
fn every_number_has_a_range_and_is_refused_outside_of_it() {
    for entry in entries() {
        let Some(range) = entry.range else { continue };
        assert!(range.low.value < range.high.value, "{}", entry.key);
        // Whole numbers stay whole: or they would be refused for that.
        for wrong in [range.low.value - 1.0, range.high.value + range.high.value.abs().max(1.0), f64::NAN] {
            let change = format!("{}={}", entry.key, if wrong.is_nan() { "nan".to_owned() } else { wrong.to_string() });
            let Err(error) = resolve(&change) else { panic!("{change} is accepted") };
            let error = format!("{error:#}");
            assert!(error.contains(&entry.key), "{change}: {error}");
        }
    }
    let is_number = |value: &Value| matches!(value, Value::Float(_) | Value::Integer(_));
    for preset in PRESETS {
        for (key, _) in
            Settings::preset(preset.name).unwrap().leaves().into_iter().filter(|(_, value)| is_number(value))
        {
            assert!(entry(&key).unwrap().range.is_some() || key.ends_with("seed"), "{key} has a range");
        }
    }
}

/// The words are those that the settings take.
#[test]
fn choices_are_those_that_are_read() {
    let mut compared = Vec::new();
    for entry in entries().iter().filter(|entry| !entry.choices.is_empty()) {
        let is_gpu = |choice: &String| ["cuda", "wgpu", "vulkan"].contains(&choice.as_str());
        for choice in entry.choices.iter().filter(|choice| !is_gpu(choice)) {
            let value = if entry.key.ends_with("directions") { format!("[\"{choice}\"]") } else { choice.clone() };
            // Of a variant that is in use.
            let result = resolve(&format!("{}={value}", entry.key));
            assert!(result.is_ok(), "{}={value}: {:#}", entry.key, result.unwrap_err());
        }
        let error = format!("{:#}", resolve(&format!("{}=no-such-word", entry.key)).unwrap_err());
        if let Some((_, known)) = error.split_once(&format!("{} takes ", entry.key)) {
            let known: BTreeSet<&str> = known.split(';').next().unwrap().split(", ").map(str::trim).collect();
            let named: BTreeSet<&str> =
                entry.choices.iter().filter(|choice| !is_gpu(choice)).map(String::as_str).collect();
            assert_eq!(named, known, "{}: {error}", entry.key);
            compared.push(&entry.key);
        }
    }
    // All but lists, truth values, and words beside numbers.
    assert_eq!(compared.len(), 19, "these were compared: {compared:?}");
}

#[test]
fn named_sections_of_the_docs_exist() {
    let docs = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs");
    for entry in entries() {
        let (file, section) = entry.docs.split_once(' ').unwrap();
        let text = std::fs::read_to_string(docs.join(file)).unwrap();
        let is_there = text.lines().any(|line| {
            let heading = line.trim_start_matches('#');
            heading.len() < line.len() && heading.split_whitespace().next() == Some(section)
        });
        assert!(is_there, "{}: no section {section} in docs/{file}", entry.key);
        let tags = ["paper", "authors' code", "cited", "derived", "chosen"];
        assert!(tags.iter().any(|tag| entry.source.starts_with(tag)), "{}: {}", entry.key, entry.source);
    }
}

#[test]
fn a_key_is_explained_with_its_value_in_every_preset() {
    let text = explain("dagger.fit.learning_rate.peak").unwrap();
    for part in ["Highest learning rate", "range    more than 0, at most 1", "0.00001 (paper)", "4.2"] {
        assert!(text.contains(part), "{part:?} is missing in:\n{text}");
    }
    assert!(explain("dagger.eta").unwrap().contains("default  0.9\n"), "presets agree");
    assert!(explain("dagger.fit").unwrap().contains("dagger.fit.adam.beta1"), "a section");
    let error = explain("dagger.etta").unwrap_err().to_string();
    assert!(error.contains("did you mean \"dagger.eta\"?"), "{error}");
    let error = explain("dagger.rule.tau").unwrap_err().to_string();
    assert!(error.contains("did you mean \"dagger.rule.all_below.tau\"?"), "of many τ the default's: {error}");
    assert!(explain("dagger.relooks").unwrap_err().to_string().contains("dagger.noise_augmentations"));
}

#[test]
fn printed_settings_are_read_again_and_lines_stay_short() {
    for preset in PRESETS {
        let settings = Settings::preset(preset.name).unwrap();
        let all = settings.to_commented_toml();
        assert_eq!(toml::from_str::<Settings>(&all).unwrap(), settings, "{}", preset.name);
        let common = settings.common_to_commented_toml();
        let values = common.lines().filter(|line| line.contains(" = ") && !line.starts_with('#')).count();
        let comments = common.lines().filter(|line| line.starts_with('#')).count();
        assert!((15..=25).contains(&values) && comments == values, "{values} values, {comments} comments:\n{common}");
        let file = std::env::temp_dir().join(format!("xtask-test-{}-{}.toml", std::process::id(), preset.name));
        std::fs::write(&file, &common).unwrap();
        let layers = Layers { preset: Some(preset.name.to_owned()), file: Some(file.clone()), overrides: Vec::new() };
        assert_eq!(Settings::resolve(&layers, None).unwrap(), settings, "{}", preset.name);
        std::fs::remove_file(file).unwrap();
        for line in common.lines() {
            assert!(line.chars().count() <= 120, "{line}");
        }
    }
}

#[test]
fn every_old_key_leads_to_a_new_one() {
    let exists = |key: &str| entries().iter().any(|e| e.key == key || e.key.starts_with(&format!("{key}.")));
    for (old, new) in renamed::RENAMED {
        assert!(exists(new) && !exists(old), "{old} → {new}");
    }
    for (old, _) in renamed::REMOVED {
        assert!(!exists(old), "{old}");
    }
}

/// Key, value in preset `paper`, where it is from. "Silent": the paper does not mention such a thing, so it is off.
#[rustfmt::skip]
const OF_THE_PAPER: [(&str, &str, &str); 51] = [
    ("training.lots", "[\"lot-a\"]", "Driving Policy Network Training: one parking lot"),
    ("training.directions", "[\"forward\", \"reverse\"]", "… there and back, 460 m"),
    ("training.trials", "1", "… once"),
    ("training.different_lots", "0", "silent"),
    ("evaluation.lots", "[\"lot-a\", \"lot-b\", \"lot-c\"]", "Results: three parking lots"),
    ("evaluation.elsewhere", "[]", "silent"),
    ("evaluation.directions", "[\"forward\", \"reverse\"]", "Results"),
    ("evaluation.trials", "5", "Results"),
    ("evaluation.smoothing", "\"own\"", "silent"),
    ("dagger.eta", "0.9", "Driving Policy Network Training"),
    ("dagger.iterations_min", "1", "Algorithm 1: while η̂ ≤ η"),
    ("dagger.keep", "\"expert_ticks\"", "Algorithm 2, line 15"),
    ("dagger.noise_augmentations", "0", "silent"),
    ("dagger.samples_per_round", "0", "silent: all"),
    ("dagger.start", "\"scratch\"", "authors' code"),
    ("dagger.rule.all_below.tau", "0.07", "Driving Policy Network Training"),
    ("dagger.rule.all_below.chi", "0.1", "Driving Policy Network Training"),
    ("dagger.inference.mirror_averaging", "false", "silent"),
    ("dagger.inference.smoothing_ticks", "0.0", "silent"),
    ("dagger.disturbance.enabled", "false", "silent"),
    ("dagger.disturbance.aim", "'random'", "silent"),
    ("dagger.final_budget.steps", "0", "silent"),
    ("dagger.network.conv1.channels", "32", "authors' code"),
    ("dagger.network.conv1.kernel", "5", "authors' code"),
    ("dagger.network.conv2.channels", "64", "authors' code"),
    ("dagger.network.conv2.kernel", "2", "authors' code"),
    ("dagger.network.residual1", "0", "Driving Policy Network"),
    ("dagger.network.residual2", "0", "Driving Policy Network"),
    ("dagger.network.hidden", "1000", "Driving Policy Network"),
    ("dagger.network.modes", "1", "Driving Policy Network"),
    ("dagger.network.dropout_features", "0.25", "authors' code"),
    ("dagger.network.dropout_hidden", "0.5", "authors' code"),
    ("dagger.fit.budget.steps", "100000", "Driving Policy Network Training: epochs 100k"),
    ("dagger.cloning_budget.steps", "100000", "Driving Policy Network Training: epochs 100k"),
    ("dagger.fit.batch", "512", "Driving Policy Network Training"),
    ("dagger.fit.learning_rate.peak", "1e-5", "Driving Policy Network Training"),
    ("dagger.fit.learning_rate.floor", "1e-5", "silent: constant"),
    ("dagger.fit.learning_rate.shape", "\"constant\"", "silent: constant"),
    ("dagger.fit.learning_rate.warm_up_steps", "0", "silent"),
    ("dagger.fit.gradient_norm_max", "0.0", "silent"),
    ("dagger.fit.adam.weight_decay", "0.0", "silent: it has one for perception only"),
    ("dagger.fit.loss.alpha", "1.5", "Driving Policy Network Training"),
    ("dagger.fit.loss.weight", "\"residual_sq\"", "equation of the loss"),
    ("dagger.fit.loss.beta", "0.0", "equation of the loss"),
    ("dagger.fit.mirror", "\"off\"", "silent"),
    ("expert.elastic_band.reach_share", "1.0", "rule three: as far as possible"),
    ("expert.reaction_delay_s", "0.0", "silent"),
    ("expert.label_jitter", "0.0", "silent"),
    ("episode.controller.speed_law", "\"halved\"", "Vehicle and Hardware: a_y/2.24, the final v half"),
    ("episode.controller.speed_max_mps", "2.2", "Vehicle and Hardware"),
    ("episode.control_period_ms", "50", "Driving Policy Network Training: 0.05 s"),
];

#[test]
fn the_paper_preset_has_what_the_paper_states() {
    let settings = Value::try_from(Settings::preset("paper").unwrap()).unwrap();
    for (key, expected, place) in OF_THE_PAPER {
        let found = key.split('.').try_fold(&settings, |value, part| value.get(part)).cloned();
        let expected: Table = format!("value = {expected}").parse().unwrap();
        let is_same = match (&found, &expected["value"]) {
            (Some(Value::Float(found)), Value::Float(expected)) => {
                (found / expected - 1.0).abs() < 1e-6 || found == expected
            }
            (found, expected) => found.as_ref() == Some(expected),
        };
        assert!(is_same, "{key} = {found:?}; the paper ({place}) has {}", expected["value"]);
    }
    // What only this preset has from the paper is held against it here.
    for entry in entries().iter().filter(|entry| entry.source.contains("in preset paper")) {
        assert!(OF_THE_PAPER.iter().any(|(key, ..)| *key == entry.key), "{} is held against nothing", entry.key);
    }
}
