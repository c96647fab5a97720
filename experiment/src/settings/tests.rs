//! Layers and the sentences that errors are made of.

use super::*;
use policy::fit::STEPS_MAX;
use scenarios::LotSpec;
use scenarios::split::Family;
use sim::seed::RootSeed;

fn layers(overrides: &[&str]) -> Layers {
    Layers { preset: None, file: None, overrides: overrides.iter().map(|&text| text.into()).collect() }
}

fn error(overrides: &[&str]) -> String {
    format!("{:#}", Settings::resolve(&layers(overrides), None).unwrap_err())
}

fn resolved(overrides: &[&str]) -> Settings {
    Settings::resolve(&layers(overrides), None).unwrap()
}

/// Settings from a file of this text.
fn from_file(name: &str, text: &str) -> anyhow::Result<Settings> {
    let path = std::env::temp_dir().join(format!("xtask-test-{}-{name}.toml", std::process::id()));
    std::fs::write(&path, text).unwrap();
    let result = Settings::resolve(&Layers { file: Some(path.clone()), ..layers(&[]) }, None);
    std::fs::remove_file(path).unwrap();
    result
}

#[test]
fn every_preset_is_sound_and_survives_toml() {
    for preset in PRESETS {
        let settings = Settings::preset(preset.name).unwrap();
        settings.check().unwrap();
        assert_eq!(toml::from_str::<Settings>(&settings.to_toml()).unwrap(), settings, "{}", preset.name);
        let untouched = layers::apply(&settings, None, &[]).unwrap();
        assert_eq!(untouched, settings, "an empty change changes nothing");
    }
}

/// `validation:4:all` are four lots of the first four families.
#[test]
fn trainings_end_with_lots_of_every_family() {
    for preset in ["default", "strong"] {
        let elsewhere = Settings::preset(preset).unwrap().evaluation.elsewhere;
        let lots: Vec<LotSpec> = elsewhere.iter().flat_map(|name| scenarios::suite(name).unwrap()).collect();
        for family in Family::EVERY {
            let is_of_family =
                |lot: &&LotSpec| matches!(lot, LotSpec::Generated { family: other, .. } if *other == family);
            assert_eq!(lots.iter().filter(is_of_family).count(), 4, "{preset}: {family:?}");
        }
    }
}

#[test]
fn later_layers_win() {
    let text = "seed = 5\n[dagger]\neta = 0.7\niterations_max = 3\n[evaluation]\ntrials = 2\n";
    let path = std::env::temp_dir().join(format!("xtask-test-{}-layers.toml", std::process::id()));
    std::fs::write(&path, text).unwrap();
    let args = Layers { file: Some(path.clone()), ..layers(&["dagger.eta=0.6", "seed=6", "training.noise=hard"]) };
    let settings = Settings::resolve(&args, Some(7)).unwrap();
    std::fs::remove_file(path).unwrap();
    assert_eq!(settings.seed, RootSeed(7), "the flag");
    assert_eq!(settings.dagger.eta, 0.6, "--set");
    assert_eq!(settings.dagger.iterations_max, 3, "the file");
    assert_eq!(settings.evaluation.trials, 2, "the file");
    assert_eq!(settings.training.noise, NoiseChoice::Hard);
    assert_eq!(settings.expert, Settings::preset("default").unwrap().expert, "the preset");
}

#[test]
fn enums_change_their_variant_whole() {
    use policy::decision_rule::DecisionRule;
    use policy::fit::Budget;
    use policy::loss::WeightForm;
    let rule = DecisionRule::TauOnly { tau: 0.05 };
    assert_eq!(resolved(&["dagger.rule={tau_only={tau=0.05}}"]).dagger.rule, rule);
    assert_eq!(resolved(&["dagger.rule.tau_only.tau=0.05"]).dagger.rule, rule);
    assert_eq!(from_file("rule", "[dagger.rule.tau_only]\ntau = 0.05\n").unwrap().dagger.rule, rule);
    assert_eq!(resolved(&["dagger.rule=expert_only"]).dagger.rule, DecisionRule::ExpertOnly);
    assert_eq!(resolved(&["dagger.cloning_budget.epochs=3"]).dagger.cloning_budget, Budget::Epochs(3.0));
    let weight = resolved(&["dagger.fit.loss.weight.linear.gain=8"]).dagger.fit.loss.weight;
    assert_eq!(weight, WeightForm::Linear { gain: 8.0 });
    let DecisionRule::AllBelow { tau, chi, .. } = resolved(&["dagger.rule.all_below.tau=0.06"]).dagger.rule else {
        panic!("a changed value is not a changed variant");
    };
    assert_eq!((tau, chi), (0.06, 0.1));
}

/// As the README names them: the variant alone, with the defaults of its fields.
#[test]
fn enums_are_named_by_their_variant_alone() {
    use policy::decision_rule::DecisionRule;
    use policy::loss::WeightForm;
    assert_eq!(resolved(&["dagger.rule=tau_only"]).dagger.rule, DecisionRule::TauOnly { tau: 0.07 });
    assert_eq!(resolved(&["dagger.rule=all_below"]).dagger.rule, DecisionRule::paper());
    let weight = resolved(&["dagger.fit.loss.weight=linear"]).dagger.fit.loss.weight;
    assert_eq!(weight, WeightForm::Linear { gain: 10.0 });
}

/// What is switched off is printed, too: a key that is not seen is not found.
#[test]
fn printed_settings_show_what_is_switched_off() {
    let text = Settings::preset("paper").unwrap().to_toml();
    for part in ["[dagger.disturbance]\nenabled = false", "[dagger.final_budget]\nsteps = 0", "patience = 0"] {
        assert!(text.contains(part), "{part:?} is missing in:\n{text}");
    }
}

/// Whoever drove `"lot-a,train:2"` was told that it had not been trained on them.
#[test]
fn lots_between_commas_are_named_one_by_one() {
    let settings = resolved(&[r#"training.lots=["lot-a, train:2", "lot-b"]"#]);
    assert_eq!(settings.training.lots, ["lot-a", "train:2", "lot-b"]);
}

#[test]
fn errors_name_the_key_and_what_there_is() {
    for (overrides, parts) in [
        (
            &["dagger.etta=0.8"] as &[&str],
            &["--set dagger.etta=0.8", "no key \"etta\"", "did you mean \"eta\"?", "iterations_max"] as &[&str],
        ),
        (&["dager.eta=0.8"], &["no key \"dager\"", "did you mean \"dagger\"?", "evaluation"]),
        (&["training.noise=papr"], &["training.noise", "did you mean \"paper\"?", "hard"]),
        (&["dagger.eta=high"], &["dagger.eta", "f64", "it may be 0 to 1 share of ticks"]),
        // Degrees for radians, millimetres for metres.
        (&["episode.vehicle.steering_max_rad=35.5"], &["steering_max_rad = 35.5", "more than 0, at most 1.5 rad"]),
        (&["episode.metrics.near_collision_m=500"], &["near_collision_m = 500", "at most 10 m"]),
        (&["dagger.relooks=2"], &["dagger.relooks is dagger.noise_augmentations now"]),
        (&["dagger.fit_cloning.batch=64"], &["dagger.fit_cloning is gone", "dagger.cloning_budget"]),
        (&["expert.band.reach_share=0.4"], &["expert.band is expert.elastic_band now"]),
        (&["episode.vehicle.steering_ratio=15"], &["steering_ratio is gone"]),
        (&["dagger.eta"], &["--set dagger.eta", "as in --set dagger.eta=0.8"]),
        (&["training.lots=[lot-a]"], &["quotes"]),
        (&["training.lots=lot-a"], &["training.lots", "expected a sequence; write a list, as in '[\"lot-a\"]'"]),
        (&["training.directions=forward"], &["write a list, as in '[\"lot-a\"]'; it may be forward | reverse"]),
        (&["seed.of=1"], &["seed"]),
        (&["evaluation.trials=0"], &["evaluation.trials = 0 is out of range: 1 to 100000"]),
        (&["dagger.rule=tau_onli"], &["dagger.rule", "no value \"tau_onli\"", "did you mean \"tau_only\"?"]),
        (
            &["dagger.inference.smoothing_ticks=-1"],
            &["dagger.inference.smoothing_ticks = -1", "0 to 1000 control ticks"],
        ),
        (&["dagger.network.conv1.channels=17"], &["dagger.network", "conv1", "17"]),
        (&["episode.control_period_ms=45"], &["45", "multiple"]),
        (
            &["episode.metrics.near_collision_m=-1"],
            &["episode.metrics.near_collision_m = -1", "more than 0, at most 10 m"],
        ),
        (&["episode.metrics.safe_range_m=0"], &["episode.metrics.safe_range_m = 0", "more than 0"]),
        (
            &["dagger.disturbance={ enabled = true, curvature_max_per_m = -0.1 }"],
            &["dagger.disturbance.curvature_max_per_m = -0.1", "more than 0, at most 1 1/m"],
        ),
        (&["episode.noise.blob=-0.5"], &["episode.noise.blob = -0.5", "0 to 100 × level paper"]),
        (&["episode.vehicle.wheelbase_m=nan"], &["episode.vehicle.wheelbase_m = NaN"]),
        (&["expert.elastic_band.reach_share=-1"], &["expert.elastic_band.reach_share = -1", "more than 0, at most 1"]),
        (&["expert.point_clearance_m=nan"], &["expert.point_clearance_m = NaN"]),
        (&["expert.weights.load=-0.1"], &["expert.weights.load = -0.1", "0 to 100"]),
        (&["expert.branch_travels_m=[0.8, 2.0, -3.6, 5.4, 7.6]"], &["expert.branch_travels_m = -3.6"]),
        (&["episode.controller.speed_min_mps=3"], &["speed_min_mps = 3", "speed_max_mps = 2.2"]),
    ] {
        let error = error(overrides);
        for part in parts {
            assert!(error.contains(part), "{overrides:?}: {part:?} is missing in: {error}");
        }
    }
}

#[test]
fn errors_in_files_name_the_line() {
    for (name, text, parts) in [
        ("syntax", "seed = 1\n\n[dagger\neta = 1\n", &[":3"] as &[&str]),
        ("key", "seed = 1\n[dagger]\nkeep = \"expert_ticks\"\netta = 0.8\n", &[":4", "did you mean \"eta\"?"]),
        ("type", "[training]\ntrials = \"two\"\n", &[":2", "training.trials"]),
        ("deep", "[dagger.fit]\nbatch = 64\n[dagger.fit.adam]\nbeta3 = 1\n", &[":4", "beta3"]),
    ] {
        let error = format!("{:#}", from_file(name, text).unwrap_err());
        for part in parts {
            assert!(error.contains(part), "{name}: {part:?} is missing in: {error}");
        }
    }
    let missing = Layers { file: Some("nowhere/at-all.toml".into()), ..layers(&[]) };
    let error = format!("{:#}", Settings::resolve(&missing, None).unwrap_err());
    assert!(error.contains("nowhere/at-all.toml"), "{error}");
}

/// Each of them was counted once per trial, and 16 016 drives were too many.
#[test]
fn a_generated_lot_is_driven_once_a_round_whatever_the_trials() {
    let mut settings = Settings::preset("default").unwrap();
    settings.training.trials = 8;
    settings.training.lots = vec!["lot-a".to_owned(), "train:1000".to_owned()];
    settings.check().unwrap();
    settings.training.lots.push("train:4000:hard".to_owned());
    let error = format!("{:#}", settings.check().unwrap_err());
    assert!(error.contains("10016 drives a round"), "{error}");
}

/// It is driven once, at the first level: a million drives were too many, and a few thousand were counted.
#[test]
fn the_check_elsewhere_is_counted_as_it_is_driven() {
    let mut settings = Settings::preset("default").unwrap();
    settings.evaluation.trials = 60_000;
    settings.evaluation.noise = vec![NoiseChoice::Paper, NoiseChoice::Hard];
    settings.check().unwrap();
    settings.evaluation.elsewhere = vec!["validation:1000000:all".to_owned(); 6];
    let error = format!("{:#}", settings.check().unwrap_err());
    assert!(error.contains("evaluation.elsewhere and directions: 12000000 runs"), "{error}");
    settings.evaluation.trials = 100_000;
    settings.evaluation.lots = vec!["test:100".to_owned()];
    let error = format!("{:#}", settings.check().unwrap_err());
    assert!(error.contains("evaluation.lots, trials, directions and noise: 40000000 runs"), "{error}");
}

/// Nothing bounded them: a reproduction was killed for memory when all of its trainings were done.
#[test]
fn on_policy_rollouts_of_more_drives_than_can_be_held_are_refused() {
    let mut settings = Settings::preset("default").unwrap();
    settings.evaluation.lots = vec!["test:5000:easy".to_owned()];
    settings.check_rollouts().unwrap();
    settings.evaluation.lots.push("lot-b".to_owned());
    settings.check().unwrap();
    let error = settings.check_rollouts().unwrap_err().to_string();
    assert!(error.contains("evaluation.lots and directions: 10002 drives") && error.contains("--unseen"), "{error}");
}

/// A lower rate than the paper's, which is constant, was refused for a floor that nothing uses.
#[test]
fn the_floor_of_the_learning_rate_counts_where_it_is_used() {
    let lower = |shape: &str| {
        let shape = format!("dagger.fit.learning_rate.shape={shape}");
        let changes = layers(&["dagger.fit.learning_rate.peak=5e-6", &shape]);
        Settings::resolve(&Layers { preset: Some("paper".to_owned()), ..changes }, None)
    };
    lower("constant").unwrap();
    let error = format!("{:#}", lower("cosine").unwrap_err());
    assert!(error.contains("is more than dagger.fit.learning_rate.peak = 0.000005"), "{error}");
}

/// Such a training could neither end nor go on: its files were longer than what is read.
#[test]
fn a_training_whose_files_cannot_be_read_again_is_refused() {
    let check = |budget: &str, steps: u32, validate_every: u32| {
        let steps = format!("{budget}.steps={steps}");
        let changes = layers(&[&steps, &format!("dagger.fit.validate_every={validate_every}")]);
        Settings::resolve(&changes, None).map(drop).map_err(|error| format!("{error:#}"))
    };
    for budget in ["dagger.fit.budget", "dagger.cloning_budget", "dagger.final_budget"] {
        assert_eq!(check(budget, STEPS_MAX, 250), Ok(()));
        assert_eq!(check(budget, STEPS_MAX, 0), Ok(()));
        let error = check(budget, STEPS_MAX + 1, 0).unwrap_err();
        assert!(error.contains(&format!("{budget}.steps = 50000001 is out of range")), "{error}");
        let error = check(budget, STEPS_MAX, 249).unwrap_err();
        assert!(error.contains(budget) && error.contains("validate_every = 249"), "{error}");
        assert!(error.contains("200803 validations; at most 200000"), "{error}");
    }
}

/// One training with the greatest seed was refused for want of a seed that nobody uses.
#[test]
fn the_greatest_seed_has_room_for_one_training() {
    let mut settings = Settings::preset("default").unwrap();
    settings.seed = RootSeed(i64::MAX as u64);
    settings.check().unwrap();
    settings.check_training_seeds(1).unwrap();
    assert_eq!(settings.training_seeds(1), [settings.seed]);
    let error = settings.check_training_seeds(2).unwrap_err().to_string();
    assert!(error.contains("leaves no room for 2 trainings"), "{error}");
    settings.seed = RootSeed(i64::MAX as u64 - 4);
    settings.check_training_seeds(5).unwrap();
    assert!(settings.check_training_seeds(6).is_err());
}

#[test]
fn unknown_presets_list_the_known() {
    let error = Settings::preset("papper").unwrap_err().to_string();
    assert!(error.contains("papper") && error.contains("default, strong, paper, smoke"), "{error}");
}
