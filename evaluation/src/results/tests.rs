use super::*;
use crate::format::quoted_interval;
use crate::statistics::bootstrap::Interval;
use crate::statistics::poisson::Rate;
use crate::statistics::student::{half_width_of_mean, together};
use crate::trainings::{Team, TeamEstimate};
use experiment::drivers::NamedDriver;
use experiment::settings::Settings;
use experiment::trained::TrainedOn;
use experiment::trials::Purpose;
use sim::frame::Ending;
use sim::metrics::EpisodeMetrics;
use sim::seed::RootSeed;

fn report(near_collisions: u32, reference_m: f32, safe_ratio: f32) -> EpisodeReport {
    let metrics =
        EpisodeMetrics { near_collisions, safe_ratio, reference_m, driven_m: 50.0, ..EpisodeMetrics::default() };
    EpisodeReport { ending: Ending::ReachedEnd, metrics, events: Vec::new() }
}

fn drivers_named(n: usize) -> Vec<NamedDriver> {
    let expert = expert::ExpertSettings::half_points();
    (0..n).map(|i| NamedDriver::expert(&expert).renamed(&format!("driver {i}"))).collect()
}

/// Two drivers over lots a and b and two generated lots, both ways, three trials; what they did is given by a function.
fn results(drivers: usize, of: impl Fn(usize, &Trial<'_>) -> Option<EpisodeReport>) -> EvaluationResults {
    let settings = Settings::preset("default").unwrap();
    let lots = Lot::parse_all(&["lot-a", "lot-b", "test:2"], &settings.episode.vehicle).unwrap();
    let named = drivers_named(drivers);
    let plan = Plan { settings: &settings, drivers: &named, lots: &lots, compare_with: 0, shard: None };
    let mut results = EvaluationResults::new(&plan);
    let trials = Trial::all(RootSeed(1), Purpose::Evaluation, &lots, 3, &Direction::BOTH);
    for (index, trial) in trials.enumerate() {
        for driver in 0..drivers {
            if let Some(report) = of(driver, &trial) {
                results.add(0, driver, index, &trial, &report);
            }
        }
    }
    results
}

fn slice(results: &EvaluationResults, label: &str) -> Slice {
    results.slices().into_iter().find(|slice| slice.label == label).unwrap()
}

/// How teams stand, compared with the first.
fn judge_teams(results: &EvaluationResults, slice: &Slice, teams: &[Team]) -> Option<Vec<TeamEstimate>> {
    let (of_drivers, _) = results.judge(0, slice, 0, RootSeed(1));
    results.judge_teams(0, slice, teams, 0, &of_drivers, RootSeed(1))
}

/// The second of two networks was trained on lot b, and lot b was "unseen" all the same.
#[test]
fn what_any_driver_was_trained_on_is_not_unseen() {
    let settings = Settings::preset("default").unwrap();
    let car_park = "../scenarios/examples/car-park.lot.toml";
    let lots = Lot::parse_all(&["reference", car_park], &settings.episode.vehicle).unwrap();
    let mut named = drivers_named(2);
    // The car park was trained on where it lay before.
    let lots_of_second = ["lot-b", "no/such/lot.toml"].map(str::to_owned).into();
    let digests = lots.iter().filter_map(Lot::digest).collect();
    named[1].trained_on = TrainedOn { lots: lots_of_second, digests };
    let plan = Plan { settings: &settings, drivers: &named, lots: &lots, compare_with: 0, shard: None };
    let results = EvaluationResults::new(&plan);
    let unseen = results.groups().iter().filter(|group| !group.is_trained_on).map(|group| group.name.as_str());
    assert_eq!(unseen.collect::<Vec<_>>(), ["lot-c"]);
}

/// So were the lots on which the parameters of a planner were searched for.
#[test]
fn what_a_planner_was_tuned_on_is_not_unseen() {
    let mut settings = Settings::preset("default").unwrap();
    settings.training.lots = vec!["lot-b".to_owned()];
    let lots = Lot::parse_all(&["reference", "train:1:lane", "test:1:lane"], &settings.episode.vehicle).unwrap();
    let unseen_with = |driver: &str| {
        let named = NamedDriver::load_all(&[driver], &settings).unwrap();
        let plan = Plan { settings: &settings, drivers: &named, lots: &lots, compare_with: 0, shard: None };
        let results = EvaluationResults::new(&plan);
        let unseen = results.groups().iter().filter(|group| !group.is_trained_on);
        unseen.map(|group| group.name.clone()).collect::<Vec<_>>()
    };
    assert_eq!(unseen_with("tentacle"), ["lot-a", "lot-c", "train-lane", "test-lane"]);
    assert_eq!(unseen_with("tuned:tentacle"), ["lot-c", "test-lane"]);
    assert_eq!(unseen_with("tentacle:../planners/tuned/corridors/tentacle.toml"), ["lot-c", "train-lane", "test-lane"]);
}

#[test]
fn pooled_and_unweighted_means_differ_where_lots_differ_in_length() {
    // 2 events in every run of lot a over 200 m, 1 in every run of lot b over 50 m: 1 and 2 per 100 m.
    let results = results(1, |_, trial| match trial.lot.name() {
        "lot-a" => Some(report(2, 200.0, 0.5)),
        "lot-b" => Some(report(1, 50.0, 0.8)),
        _ => None,
    });
    let labels: Vec<String> = results.slices().into_iter().map(|slice| slice.label).collect();
    assert_eq!(labels, ["lot-a", "lot-b", "test-medium (2 lots)", "unseen", "all"], "lot a is the training lot");
    let all = slice(&results, "all");
    let totals = results.totals(0, 0, &all, None);
    assert_eq!((totals.runs, totals.near_collisions), (12, 18));
    assert!((totals.rate().per_unit - 18.0 / 15.0).abs() < 1e-9, "18 events in 1500 m");
    let [rate, safe_ratio] = results.unweighted(0, 0, &all);
    assert!((rate - 1.5).abs() < 1e-6 && (safe_ratio - 0.65).abs() < 1e-6, "{rate} {safe_ratio}");
    assert!((totals.safe_ratio() - 0.65).abs() < 1e-6, "six runs on either lot");
    assert_eq!(results.totals(0, 0, &all, Some(Direction::Reverse)).runs, 6);
    assert_eq!(results.totals(0, 0, &slice(&results, "unseen"), None).near_collisions, 6);
}

#[test]
fn a_constant_difference_has_a_narrow_interval_however_hard_the_trials_are() {
    let results =
        results(2, |driver, trial| Some(report(trial.index * 4 + driver as u32, 100.0, 0.5 + 0.1 * driver as f32)));
    let (estimates, comparisons) = results.judge(0, &slice(&results, "lot-b"), 0, RootSeed(1));
    let found = &comparisons[0];
    assert_eq!((found.driver, found.pairs), (1, 6));
    let difference = found.difference_per_100m.unwrap();
    assert!((difference.lower - 1.0).abs() < 1e-9 && (difference.upper - 1.0).abs() < 1e-9, "{difference:?}");
    assert!((found.difference_safe_ratio.unwrap().estimate - 0.1).abs() < 1e-6);
    // Trials of 0, 8, 16 events both ways: mean 8, variance 64, index 8: clusters.
    assert!((estimates[0].dispersion.unwrap().index - 8.0).abs() < 1e-9, "{estimates:?}");
    assert!(estimates[0].per_100m.unwrap().lower < 2.8);
    // 30 events against 24: the exact test, which knows of no pairs, sees nothing.
    assert!((found.ratio.ratio.unwrap() - 30.0 / 24.0).abs() < 1e-9 && found.ratio.p_value > 0.4, "{found:?}");
    assert_eq!(found.p_holm, found.ratio.p_value, "a single comparison");
}

/// All events are in one of three trials, both ways: trials drawn give 0 to 3 of it, and forward is never drawn without
/// reverse.
#[test]
fn forward_and_reverse_of_a_trial_are_resampled_together() {
    let results = results(2, |driver, trial| {
        let (is_hard, is_forward) = (trial.index == 1, trial.direction == Direction::Forward);
        // The second driver has the events of the other way.
        let near_collisions = if is_hard && is_forward == (driver == 0) { 6 } else { 0 };
        Some(report(near_collisions, 100.0, 0.5))
    });
    let (estimates, comparisons) = results.judge(0, &slice(&results, "lot-b"), 0, RootSeed(1));
    let interval = estimates[0].per_100m.unwrap();
    assert_eq!((interval.lower, interval.estimate, interval.upper), (0.0, 1.0, 3.0));
    assert_eq!(interval.units, 3);
    let difference = comparisons[0].difference_per_100m.unwrap();
    assert_eq!((difference.lower, difference.upper), (0.0, 0.0), "both trials' ways are in every draw");
}

#[test]
fn generated_lots_are_resampled_as_wholes() {
    // All events are on one of two lots: whole lots drawn give 0, 1 or 2 of it.
    let results = results(1, |_, trial| {
        let is_hard = trial.lot.name() == "test-medium-1";
        Some(report(if is_hard { 2 } else { 0 }, 100.0, 0.5))
    });
    let (estimates, _) = results.judge(0, &slice(&results, "test-medium (2 lots)"), 0, RootSeed(1));
    let interval = estimates[0].per_100m.unwrap();
    assert_eq!((interval.lower, interval.estimate, interval.upper), (0.0, 1.0, 2.0));
    let (dispersion, mean, variance) = (estimates[0].dispersion.unwrap(), 6.0, 72.0);
    assert!((dispersion.index - variance / mean).abs() < 1e-9, "{dispersion:?}");
}

#[test]
fn only_runs_that_all_drivers_have_driven_are_compared() {
    let results = results(2, |driver, trial| (driver == 0 || trial.index < 2).then(|| report(1, 100.0, 0.5)));
    let (_, comparisons) = results.judge(0, &slice(&results, "lot-a"), 0, RootSeed(1));
    assert_eq!(comparisons[0].pairs, 4);
    assert_eq!(comparisons[0].ratio.ratio, Some(1.0), "the third trial of the first driver does not count");
    assert_eq!(results.totals(0, 0, &slice(&results, "lot-a"), None).runs, 6, "but is in its own row");
}

#[test]
fn oscillation_is_per_driven_way() {
    let mut totals = Totals::default();
    let mut driven = report(0, 100.0, 0.5);
    (driven.metrics.steering_reversals, driven.metrics.steering_effort_rad) = (4, 3.0);
    totals.add(&driven);
    totals.add(&driven);
    assert!((totals.reversals_per_100m() - 8.0).abs() < 1e-9 && (totals.effort_rad_per_100m() - 6.0).abs() < 1e-6);
    let mut twice = totals.clone();
    twice.merge(&totals);
    assert_eq!((twice.runs, twice.steering_reversals), (4, 16));
}

/// 29 maps were 29 strata: the interval of the pooled rate said how sure it was on these very maps, and was quoted for others.
#[test]
fn pooled_lots_from_files_are_a_sample_of_their_kind_from_six_on() {
    const MAPS: [&str; 6] = ["alley", "avenue", "office", "quay", "ramps", "warehouse"];
    let judged = |maps: &[&str], label: &str| {
        let settings = Settings::preset("default").unwrap();
        let paths: Vec<String> = maps.iter().map(|map| format!("../scenarios/examples/maps/{map}.yaml")).collect();
        let lots = Lot::parse_all(&paths, &settings.episode.vehicle).unwrap();
        let drivers = drivers_named(1);
        let plan = Plan { settings: &settings, drivers: &drivers, lots: &lots, compare_with: 0, shard: None };
        let mut results = EvaluationResults::new(&plan);
        for (index, trial) in Trial::all(RootSeed(1), Purpose::Evaluation, &lots, 3, &Direction::BOTH).enumerate() {
            // Always at the same place.
            let near_collisions = 2 * u32::from(trial.lot.name() == "office");
            results.add(0, 0, index, &trial, &report(near_collisions, 100.0, 0.9));
        }
        let interval = results.judge(0, &slice(&results, label), 0, RootSeed(1)).0[0].per_100m.unwrap();
        (interval.lower, interval.estimate, interval.upper)
    };
    let (lower, rate, upper) = judged(&MAPS, "all");
    assert!(lower == 0.0 && upper > 2.0 * rate, "without the one map there is none: {rate} [{lower}, {upper}]");
    assert_eq!(judged(&MAPS, "office"), (2.0, 2.0, 2.0), "a lot by itself: its trials");
    assert_eq!(judged(&MAPS[..5], "all"), (0.4, 0.4, 0.4), "five are too few to speak for others");
}

/// What is alone of its kind was the same in every draw, as if its rate were known.
#[test]
fn lots_that_are_alone_of_their_kind_are_drawn_with_each_other() {
    let settings = Settings::preset("default").unwrap();
    let judged = |spec: &str| {
        let lots = Lot::parse_all(&[spec], &settings.episode.vehicle).unwrap();
        let drivers = drivers_named(1);
        let plan = Plan { settings: &settings, drivers: &drivers, lots: &lots, compare_with: 0, shard: None };
        let mut results = EvaluationResults::new(&plan);
        for (index, trial) in Trial::all(RootSeed(1), Purpose::Evaluation, &lots, 1, &Direction::BOTH).enumerate() {
            let near_collisions = u32::from(trial.lot.name().contains("hard"));
            results.add(0, 0, index, &trial, &report(near_collisions, 100.0, 0.9));
        }
        results.judge(0, &slice(&results, "all"), 0, RootSeed(1)).0[0].per_100m.unwrap()
    };
    // One of twelve kinds, with one lot each, has all near-collisions.
    let found = judged("test:12:all");
    assert!(found.units == 12 && found.lower == 0.0 && found.upper > 2.0 * found.estimate, "{found:?}");
    // Eleven kinds of two lots, and one of one, which goes to another.
    assert_eq!(judged("test:23:all").units, 23);
}

/// The intervals of five networks said how sure each was; that of "the default" came from a script beside the program.
#[test]
fn the_interval_of_a_team_is_for_other_lots_and_other_seeds() {
    // Everywhere: 0, 0 and 3 events by seed; the other team has one more of each; the last driver 2.
    let events = [0, 0, 3, 1, 1, 4, 2];
    let results = results(7, |driver, _| Some(report(events[driver], 100.0, 0.5)));
    let of_seeds = |drivers: &[usize], seeds: &[u64]| Team {
        name: String::new(),
        drivers: drivers.to_vec(),
        seeds: seeds.to_vec(),
        duplicates: Vec::new(),
    };
    let team = |drivers: &[usize]| of_seeds(drivers, &[1, 2, 3, 4, 5][..drivers.len()]);
    let teams = [team(&[0, 1, 2]), team(&[3, 4, 5]), team(&[6])];
    let slice = slice(&results, "all");
    let found = judge_teams(&results, &slice, &teams).unwrap();
    let rounded =
        |interval: Interval| [interval.lower, interval.estimate, interval.upper].map(|x| (x * 1e9).round() / 1e9);
    // Every lot is alike, so only the seeds vary: 1 ± t·s/√n = 1 ± 4.3027 · √3/√3, and never below none.
    assert_eq!(rounded(found[0].per_100m), [0.0, 1.0, 5.302_652_73]);
    assert_eq!(rounded(found[1].per_100m), [0.0, 2.0, 6.302_652_73]);
    assert_eq!(rounded(found[1].difference_per_100m), [1.0, 1.0, 1.0], "trainings of a seed are compared");
    let alone = results.judge(0, &slice, 0, RootSeed(1)).0.swap_remove(6);
    let quoted = quoted_interval(&results.totals(0, 6, &slice, None), &alone);
    assert_eq!([found[2].per_100m.lower, found[2].per_100m.upper], quoted, "a driver by itself, as elsewhere");
    assert_eq!(rounded(alone.per_100m.unwrap()), [2.0; 3], "varies with the lots alone");
    assert_eq!(rounded(found[2].difference_per_100m), [-3.302_652_73, 1.0, 5.302_652_73], "the other's seeds vary");
    // Seeds 2 to 4 are not paired with seeds 1 to 3: both means are uncertain by 3 · 4.3027 · 1/√3 / √3.
    let others = [team(&[0, 1, 2]), of_seeds(&[3, 4, 5], &[2, 3, 4])];
    let apart = judge_teams(&results, &slice, &others).unwrap()[1].difference_per_100m;
    let half_width = together(4.302_652_73, 4.302_652_73);
    assert!((apart.upper - 1.0 - half_width).abs() < 1e-7, "{apart:?}");
    // Nor are trainings whose seeds nobody knows, but with themselves.
    let unknown = [of_seeds(&[0, 1, 2], &[]), of_seeds(&[3, 4, 5], &[])];
    let found = judge_teams(&results, &slice, &unknown).unwrap();
    assert_eq!((found[1].difference_per_100m, rounded(found[0].difference_per_100m)), (apart, [0.0; 3]));
    // No draw of lots without events has any; the metres say what that supports.
    let none = judge_teams(&results, &slice, &[team(&[0, 1])]).unwrap()[0].per_100m;
    let metres = results.totals(0, 0, &slice, None).reference_m;
    assert_eq!([none.estimate, none.lower, none.upper], [0.0, 0.0, Rate::new(0, metres / 100.0).upper]);
    let first =
        |trial: &Trial<'_>| (trial.lot.name(), trial.index, trial.direction) == ("lot-a", 0, Direction::Forward);
    let one = self::results(5, |driver, trial| Some(report(u32::from(driver == 4 && first(trial)), 100.0, 0.5)));
    let of_two = judge_teams(&results, &slice, &[team(&[1, 2])]).unwrap()[0].per_100m;
    assert_eq!(rounded(of_two), [1.5; 3], "two trainings say nothing about other seeds");
    let of_one_lot = self::slice(&results, "lot-a");
    assert!(judge_teams(&results, &of_one_lot, &teams).is_none(), "of few trials all may be alike by chance");
    let one = judge_teams(&one, &slice, &[team(&[0, 1, 2, 3, 4])]).unwrap()[0].per_100m;
    assert!(one.estimate > 0.0 && one.upper == none.upper, "one event is not surer than none: {one:?}");
    // Lots and seeds that both vary: the first team's trainings are alike, the other's have 0, 1 and 2 events more.
    let both = self::results(6, |driver, trial| {
        let of_seed = if driver < 3 { 0 } else { driver as u32 - 3 };
        Some(report(3 + trial.index + of_seed, 100.0, 0.5))
    });
    let both = judge_teams(&both, &slice, &teams[..2]).unwrap();
    let [lots, both] = [both[0].per_100m, both[1].per_100m];
    assert!(lots.lower < lots.estimate && (both.estimate - lots.estimate - 1.0).abs() < 1e-9, "{lots:?} {both:?}");
    let half_width = half_width_of_mean(&[0.0, 1.0, 2.0]);
    let expected = both.estimate - together(lots.estimate - lots.lower, half_width);
    assert!((both.lower - expected).abs() < 1e-9, "{both:?} {expected}");
}

/// Contacts of several trainings stood without an interval, beside near-collisions that had one.
#[test]
fn the_interval_of_contacts_of_a_team_is_for_other_lots_and_other_seeds() {
    let touching = |near_collisions, contacts| {
        let mut report = report(near_collisions, 100.0, 0.5);
        report.metrics.contacts = contacts;
        Some(report)
    };
    let team = |drivers: [usize; 3]| Team {
        name: String::new(),
        drivers: drivers.to_vec(),
        seeds: vec![1, 2, 3],
        duplicates: Vec::new(),
    };
    let teams = [team([0, 1, 2]), team([3, 4, 5])];
    let contacts = |results: &EvaluationResults| {
        let found = judge_teams(results, &slice(results, "all"), &teams).unwrap();
        found.into_iter().map(|estimate| estimate.contacts_per_100m).collect::<Vec<Interval>>()
    };
    let is_near = |found: Interval, [lower, estimate, upper]: [f64; 3]| {
        let off = [found.lower - lower, found.estimate - estimate, found.upper - upper];
        assert!(off.iter().all(|off| off.abs() < 1e-7), "{found:?} is not [{lower}, {estimate}, {upper}]");
    };
    // Everywhere: 0, 0 and 3 contacts by seed, two near-collisions of each; the others touch nothing.
    let seeds_vary = results(6, |driver, _| touching(2, if driver == 2 { 3 } else { 0 }));
    let [some, none] = contacts(&seeds_vary)[..] else { panic!("two teams") };
    // 1 ± t·s/√n = 1 ± 4.3027 · √3/√3, and never below none.
    is_near(some, [0.0, 1.0, 5.302_652_73]);
    let metres = seeds_vary.totals(0, 3, &slice(&seeds_vary, "all"), None).reference_m;
    is_near(none, [0.0, 0.0, Rate::new(0, metres / 100.0).upper]);
    // Seeds alike: the interval of each of them, by the lots that are drawn.
    let lots_vary = results(6, |_, trial| touching(0, 4 * trial.index));
    let alone = lots_vary.judge(0, &slice(&lots_vary, "all"), 0, RootSeed(1)).0[0].contacts_per_100m.unwrap();
    assert!(alone.lower < alone.estimate && alone.estimate < alone.upper, "{alone:?}");
    is_near(contacts(&lots_vary)[0], [alone.lower, alone.estimate, alone.upper]);
}

/// Per route, whoever is put back often, and drives less of it, would weave less.
#[test]
fn reversals_are_compared_per_way_driven() {
    let results = results(2, |driver, _| {
        let mut report = report(0, 200.0, 0.5);
        (report.metrics.driven_m, report.metrics.steering_reversals) = if driver == 0 { (50.0, 4) } else { (25.0, 3) };
        Some(report)
    });
    let (_, comparisons) = results.judge(0, &slice(&results, "lot-a"), 0, RootSeed(1));
    // 3 in 25 m are 12 per 100 m, 4 in 50 m are 8; every trial is alike.
    let found = comparisons[0].difference_reversals_per_100m.unwrap();
    assert!([found.lower, found.estimate, found.upper].iter().all(|end| (end - 4.0).abs() < 1e-9), "{found:?}");
}
