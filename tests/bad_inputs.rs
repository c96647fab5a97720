//! The table of bad inputs. Each gets one error that says what is wrong and what would be right, before
//! anything is written and without time or memory worth mentioning. Most are given to the functions that read them;
//! [`whole_commands_refuse_within_their_means_and_leave_nothing`] gives some to commands.

#![expect(clippy::too_many_lines, clippy::format_collect, reason = "tables of cases, and files made up for them")]

use crate::bench::scratch;
#[cfg(unix)]
use crate::bench::{text, xtask};
use experiment::drivers::DriverSpec;
use experiment::replay_key::ReplayKey;
use experiment::settings::{Layers, Settings, reference};
use expert::ScriptedExpert;
use policy::checkpoint::Checkpoint;
use policy::conditions::Conditions;
use policy::network::{InferenceSettings, NetworkArchitecture, Weights};
use sim::driver::Driver as _;
use sim::episode::Episode;
use sim::map::Map;
use sim::scenario::Scenario;
use sim::seed::{RootSeed, Stream};
#[cfg(unix)]
use sim::validate::is_hidden;
use sim::vehicle::VehicleSettings;
#[cfg(unix)]
use std::collections::BTreeMap;
use std::path::Path;
#[cfg(unix)]
use std::path::PathBuf;
#[cfg(unix)]
use std::process::{Command, Stdio};
use std::sync::Arc;
#[cfg(unix)]
use std::time::SystemTime;
use storage::sums;

/// Longest error, bytes: no file is quoted at length.
const ERROR_MAX: usize = 3000;

/// Cases, and what went wrong with which.
#[derive(Default)]
struct Table {
    cases: usize,
    faults: Vec<String>,
}

impl Table {
    /// Checks one case.
    fn refuse<T>(&mut self, what: &str, result: Result<T, impl std::fmt::Display>, expected: &str) {
        self.cases += 1;
        let error = match result {
            Ok(_) => "(accepted)".to_owned(),
            Err(error) => format!("{error:#}"),
        };
        if !error.contains(expected) {
            self.faults.push(format!("{what}\n  says:   {error}\n  lacks:  {expected}"));
        }
        if error.len() > ERROR_MAX {
            self.faults.push(format!("{what}: an error of {} bytes", error.len()));
        }
    }

    fn finish(self, cases_min: usize) {
        assert!(self.faults.is_empty(), "{}", self.faults.join("\n"));
        assert!(self.cases >= cases_min, "only {} cases", self.cases);
    }
}

const LOT: &str = "\
name = \"lane\"
boundary = [[0, 0], [60, 0], [60, 30], [0, 30]]
boundary_height_m = 1.0
[reference_path]
points = [[5, 12], [40, 12]]
corner_radius_m = 5
[noise]
level = \"paper\"
[[island]]
polygon = [[20, 20], [24, 20], [24, 24]]
height_m = 0.15
[[obstacle]]
class = \"sedan\"
x_m = 30
y_m = 20
heading_deg = 10
[[speed_bump]]
x_m = 15
y_m = 12
length_m = 0.5
width_m = 6
";

/// The lot with teeth of a length on one side, 4998 in 480 m, which makes 20 000 vertices with the rest.
fn with_comb(is_upright: bool, tooth_m: f64) -> String {
    let (root_m, step_m) = (if is_upright { 30.0 } else { 60.0 }, 480.0 / 4998.0);
    let tooth = |i: u16| {
        let (from, to) = (f64::from(i) * step_m, (f64::from(i) + 0.5) * step_m);
        [(root_m, from), (root_m + tooth_m, from), (root_m + tooth_m, to), (root_m, to)]
    };
    let teeth = (0..4998).flat_map(tooth).chain([(root_m, 480.0), (0.0, 480.0), (0.0, 0.0)]);
    let vertex = |(x, y): (f64, f64)| if is_upright { format!("[{y:.3}, {x}],") } else { format!("[{x}, {y:.3}],") };
    LOT.replacen("[[0, 0], [60, 0], [60, 30], [0, 30]]", &format!("[{}]", teeth.map(vertex).collect::<String>()), 1)
}

#[test]
fn lots_that_are_refused() {
    let parse = |text: &str| scenarios::load::parse(text, "lot.toml", &VehicleSettings::hyundai_hg300());
    parse(LOT).unwrap();
    let (many, long) = ("[[obstacle]]\nclass = \"cone\"\nx_m = 9\ny_m = 28\n".repeat(10_001), "n".repeat(101));
    let islands = "[[island]]\npolygon = [[20, 20], [24, 20], [24, 24]]\nheight_m = 1\n".repeat(5000);
    let bumps = "[[speed_bump]]\nx_m = 9\ny_m = 28\nlength_m = 1\nwidth_m = 1\n".repeat(1001);
    let points = |count: usize| (0..count).map(|i| format!("[{i}, 1],")).collect::<String>();
    let winding: String = (0..51)
        .flat_map(|i| if i % 2 == 0 { [(5, i), (495, i)] } else { [(495, i), (5, i)] })
        .map(|(x, i)| format!("[{x}, {}],", 12 + 9 * i))
        .collect();
    // Text replaced, by what, part of the error.
    let table: &[(&str, &str, &str)] = &[
        ("name = \"lane\"", "", "missing field `name`"),
        ("\"lane\"", "lane", "lot.toml:1: not TOML"),
        ("\"lane\"", "7", "invalid type: integer `7`"),
        ("\"lane\"", "[\"lane\"]", "expected a string"),
        ("\"lane\"", "\"\"", "name is empty"),
        ("\"lane\"", "\" \\t\"", "name is empty"),
        ("\"lane\"", "\"a/b\"", "contains '/'"),
        ("\"lane\"", "\"a|b\"", "contains '|'"),
        ("\"lane\"", "\"..\\\\b\"", "contains '\\\\'"),
        ("\"lane\"", "\"a\\nb\"", "contains '\\n'"),
        ("\"lane\"", "\"a\\u0000\"", "contains '\\0'"),
        ("\"lane\"", "\"a\\u202Eb\"", "contains '\\u{202e}'"),
        ("\"lane\"", "\"a\\u200Bb\"", "contains '\\u{200b}'"),
        ("\"lane\"", &format!("\"{long}\""), "has 101 characters; shorten it to at most 100"),
        ("\"lane\"", &format!("\"{}\"", "駐".repeat(67)), "has 201 bytes; shorten it to at most 200"),
        ("name =", "title =", "unknown field `title`"),
        ("[[0, 0], [60, 0], [60, 30], [0, 30]]", "7", "invalid type"),
        ("[[0, 0], [60, 0], [60, 30], [0, 30]]", "[]", "0 vertices enclose no ground"),
        ("[[0, 0], [60, 0], [60, 30], [0, 30]]", "[[0, 0], [60, 0]]", "2 vertices enclose no ground"),
        ("[[0, 0], [60, 0], [60, 30], [0, 30]]", "[[0, 0], [60, 0], [70, 0]]", "boundary"),
        ("[0, 30]]", "[0]]", "write points as [x, y]"),
        ("[0, 30]]", "[0, 30, 1]]", "a point of 3 numbers"),
        ("[0, 30]]", "[\"0\", 30]]", "invalid type: string"),
        ("[0, 30]]", "[nan, 30]]", "vertex 4: x is NaN"),
        ("[0, 30]]", "[0, inf]]", "vertex 4: y is inf"),
        ("[0, 30]]", "[0, -inf]]", "vertex 4: y is -inf"),
        ("[0, 30]]", "[0, 1e39]]", "vertex 4: y is inf"),
        ("[0, 30]]", "[0, 1e30]]", "from the origin"),
        ("[0, 30]]", "[0, 600]]", "spans 60 m × 600 m; keep it within 500 m"),
        ("[0, 30]]", "[0, 30], [0, 0]]", "vertices 5 and 1 are the same point"),
        ("[60, 30], [0, 30]]", "[0, 30], [60, 30]]", "meets the edge"),
        ("[0, 30]]", &format!("[0, 30], {}]", points(20_000)), "20007 vertices, islands included; leave some out"),
        ("boundary_height_m = 1.0", "boundary_height_m = -1", "boundary_height_m is -1"),
        ("boundary_height_m = 1.0", "boundary_height_m = 9", "up to 5"),
        ("boundary_height_m = 1.0", "boundary_height_m = nan", "boundary_height_m is NaN"),
        ("boundary_height_m = 1.0", "boundary_height_m = true", "invalid type: boolean"),
        ("[reference_path]", "[reference]", "unknown field `reference`"),
        ("points = [[5, 12], [40, 12]]", "", "missing field `points`"),
        ("[[5, 12], [40, 12]]", "[]", "the route has 0 points"),
        ("[[5, 12], [40, 12]]", "[[5, 12]]", "the route has 1 points"),
        ("[[5, 12], [40, 12]]", "[[5, 12], [5, 12]]", "points 1 and 2 are the same"),
        ("[[5, 12], [40, 12]]", "[[5, 12], [9, 12]]", "is 4.00 m long; make it at least 5 m"),
        ("[[5, 12], [40, 12]]", "[[5, 12], [nan, 12]]", "point 2: x is NaN"),
        ("[[5, 12], [40, 12]]", "[[5, 12], [1e30, 12]]", "outside the lot"),
        ("[[5, 12], [40, 12]]", "[[5, 12], [70, 12]]", "lot.toml:5: reference_path, point 2"),
        ("[[5, 12], [40, 12]]", "[[5, 12], [40, 12], [6, 12.1]]", "turns by 180°"),
        ("[[5, 12], [40, 12]]", "[[1, 12], [40, 12]]", "does not fit at the start"),
        ("[[5, 12], [40, 12]]", "[[5, 12], [22, 12], [22, 22]]", "runs into island 1"),
        ("[[5, 12], [40, 12]]", "[[5, 20], [40, 20]]", "runs into island 1"),
        ("[[5, 12], [40, 12]]", &format!("[{}]", points(10_001)), "there are 10001 points"),
        ("corner_radius_m = 5", "corner_radius_m = -5", "corner_radius_m is -5"),
        ("corner_radius_m = 5", "corner_radius_m = 1e9", "from 0 to 100"),
        ("corner_radius_m = 5", "corner_radius_m = nan", "corner_radius_m is NaN"),
        ("corner_radius_m", "corner_radius", "unknown field `corner_radius`"),
        ("\"paper\"", "\"papr\"", "unknown variant `papr`"),
        ("\"paper\"", "2", "lot.toml:8"),
        ("level", "grade", "unknown field `grade`"),
        ("[[20, 20], [24, 20], [24, 24]]", "[[20, 20], [24, 20]]", "island 1: 2 vertices"),
        ("[[20, 20], [24, 20], [24, 24]]", "[[20, 20], [24, 20], [24, 40]]", "lies outside the boundary"),
        ("[[20, 20], [24, 20], [24, 24]]", "[[20, 20], [20.01, 20], [20, 20.01]]", "spread the vertices out"),
        ("[[20, 20], [24, 20], [24, 24]]", "[[20, 20], [nan, 20], [24, 24]]", "island 1: x is NaN"),
        ("[[20, 20], [24, 20], [24, 24]]", "[[20, 20], [24], [24, 24]]", "write points as [x, y]"),
        ("height_m = 0.15", "height_m = 0", "island 1: height_m is 0"),
        ("height_m = 0.15", "high_m = 1", "unknown field `high_m`"),
        ("\"sedan\"", "\"tank\"", "unknown variant `tank`, expected one of `sedan`"),
        ("\"sedan\"", &format!("\"{}\"", "c".repeat(100_000)), "unknown variant `ccc"),
        ("class = \"sedan\"\n", "", "missing field `class`"),
        ("x_m = 30", "", "missing field `x_m`"),
        ("x_m = 30", "x_m = nan", "obstacle 1: x_m is NaN"),
        ("x_m = 30", "x_m = inf", "obstacle 1: x_m is inf"),
        ("x_m = 30", "x_m = 1e9", "more than 50 m from the lot"),
        ("x_m = 30", "x = 30", "unknown field `x`"),
        ("heading_deg = 10", "heading_deg = nan", "obstacle 1: heading_deg is NaN"),
        ("heading_deg = 10", "heading_deg = \"10\"", "invalid type: string"),
        ("heading_deg = 10", "length_m = 0", "obstacle 1: length_m is 0"),
        ("heading_deg = 10", "length_m = -4", "obstacle 1: length_m is -4"),
        ("heading_deg = 10", "length_m = 1e6", "above 0 and up to 30"),
        ("heading_deg = 10", "width_m = inf", "obstacle 1: width_m is inf"),
        ("heading_deg = 10", "height_m = 21", "above 0 and up to 20"),
        ("y_m = 20", "y_m = 20\ny_m = 20", "not TOML: duplicate key"),
        ("y_m = 20", "y_m = 12", "stands on the reference path"),
        ("length_m = 0.5", "", "missing field `length_m`"),
        ("length_m = 0.5", "length_m = 0", "speed_bump 1: length_m is 0"),
        ("width_m = 6", "width_m = 31", "speed_bump 1: width_m is 31"),
        ("x_m = 15", "x_m = -99", "speed_bump 1: it stands at"),
        ("x_m = 15", "x_m = nan", "speed_bump 1: x_m is NaN"),
        ("[[island]]", &format!("{islands}[[island]]"), "there are 5001 islands; leave some out: at most 5000 fit"),
        ("[[speed_bump]]", "[speed_bump]", "has double brackets, as in [[obstacle]]"),
        ("[[speed_bump]]", &format!("{bumps}[[speed_bump]]"), "there are 1002 speed bumps"),
        ("[[obstacle]]", &format!("{many}[[obstacle]]"), "there are 10002 obstacles"),
        ("[[obstacle]]", "[[obstacles]]", "unknown field `obstacles`"),
        ("[[obstacle]]", &format!("{}[[obstacle]]", "a.".repeat(20_000)), "not TOML"),
        ("[[obstacle]]", &format!("x = {}", "[".repeat(20_000)), "not TOML"),
        ("[[obstacle]]", "\u{7}", "not TOML"),
        (LOT, "", "missing field `name`"),
        (LOT, "}", "lot.toml:1: not TOML"),
        (LOT, "name = 1\nname = 2", "not TOML: duplicate key"),
    ];
    let mut cases = Table::default();
    for (from, to, expected) in table {
        assert!(LOT.contains(from), "the lot has no {from:?}");
        let what = format!("{from:?} → {:?}", to.chars().take(60).collect::<String>());
        cases.refuse(&what, parse(&LOT.replacen(from, to, 1)), expected);
    }
    let large = LOT
        .replace("[60, 0], [60, 30], [0, 30]", "[500, 0], [500, 500], [0, 500]")
        .replace("[[5, 12], [40, 12]]", &format!("[{winding}]"));
    cases.refuse("a route of 25 km", parse(&large), "the route is 25 km long; end it within 20000 m");
    for is_upright in [false, true] {
        let expected = "the outlines of boundary and islands are 4299 km long; leave some out: at most 200 km fit";
        cases.refuse("a comb of 430 m", parse(&with_comb(is_upright, 430.0)), expected);
    }
    parse(&with_comb(true, 19.5)).unwrap();
    cases.finish(90);
}

/// Every setting with a range, and every one with choices, refuses any other value.
#[test]
fn settings_that_are_refused() {
    let resolve = |change: &str| {
        let overrides = vec![change.to_owned()];
        Settings::resolve(&Layers { overrides, ..Layers::default() }, None)
    };
    let mut cases = Table::default();
    for entry in reference::entries() {
        let wrong: &[&str] = match (entry.range, entry.choices.is_empty()) {
            (Some(_), _) => &["nan", "inf", "-inf", "1e30", "-1e30", "\"word\"", "{}", "[]", "[nan]", "true"],
            (None, false) => &["nan", "70.5", "\"no-such-word\"", "[[]]", "{ a = 1, b = 2 }"],
            (None, true) => &["nan", "-1", "true", "{ a = 1, b = 2 }"],
        };
        for value in wrong {
            cases.refuse(&format!("{} = {value}", entry.key), resolve(&format!("{}={value}", entry.key)), &entry.key);
        }
    }
    for (change, expected) in [
        ("dagger.eta=7", "dagger.eta = 7 is out of range: 0 to 1 share of ticks"),
        ("dagger.rule.tau_only.tau=nan", "dagger.rule.tau_only.tau = NaN is out of range"),
        ("dagger.fit.budget.steps=0", "dagger.fit.budget.steps = 0 is out of range: 1 to"),
        ("dagger.cloning_budget.steps=0", "dagger.cloning_budget.steps = 0 is out of range: 1 to"),
        ("dagger.cloning_budget.epochs=0", "dagger.cloning_budget.epochs = 0 is out of range: more than 0"),
        ("dagger.fit.learning_rate.peak=-0.1", "dagger.fit.learning_rate.peak = -0.1 is out of range"),
        ("dagger.fit.learning_rate.floor=0.5", "is more than dagger.fit.learning_rate.peak"),
        ("dagger.fit.adam.beta1=2", "dagger.fit.adam.beta1 = 2 is out of range: 0 to below 1"),
        ("dagger.fit.adam.beta1=1", "dagger.fit.adam.beta1 = 1 is out of range: 0 to below 1"),
        ("dagger.fit.batch=0", "dagger.fit.batch = 0 is out of range: 1 to"),
        ("dagger.fit.validation.every=1", "nothing is left to train on"),
        ("dagger.network.hidden=1000000000000", "dagger.network.hidden = 1000000000000 is out of range"),
        ("dagger.network.residual1=9", "dagger.network.residual1 = 9 is out of range"),
        (
            "dagger.network={conv1={channels=1024,kernel=7},conv2={channels=1024,kernel=7},hidden=65536,modes=1,dropout_features=0.0,dropout_hidden=0.0}",
            "parameters; at most 64000000 are possible",
        ),
        ("expert.elastic_band.reach_share=nan", "expert.elastic_band.reach_share = NaN is out of range"),
        ("expert.branch_travels_m=[5.0, 4.0, 6.0, 7.0, 8.0]", "is not increasing"),
        ("expert.clearances_m=[0.1, 0.2, 0.03]", "write the comfortable one first"),
        ("expert.first_step_m=0.25", "expert.first_step_m = 0.25 does not divide 0.6 m"),
        ("expert.second_step_m=5", "expert.second_step_m = 5 along expert.curvature_max_per_m = 0.215 turns by"),
        ("expert={ first_step_m = 0.6, second_curvature_max_per_m = 0.9 }", "turns by 0.54 rad"),
        ("episode.noise={ intensity = 50, blob = 3 }", "times episode.noise.blob = 3, times 1 for the strongest"),
        ("episode={ sensing = { geometry = { side_m = 2 } }, metrics = { safe_range_m = 8.5 } }", "in whose pixels"),
        ("expert.elastic_band.trust_from_m=0.5", "trust_from_m = 0.5 is not less than trust_to_m = 0.4"),
        ("expert.elastic_band.bend_to_rad=0.6", "bend_from_rad = 0.6 is not less than bend_to_rad = 0.6"),
        ("training.lots=[]", "training.lots is empty"),
        ("training.lots=[\"lot-z\"]", "training.lots: \"lot-z\" is not a lot"),
        ("training.lots=[\"train:1000000\"]", "drives a round; at most 10000 are possible"),
        ("evaluation.lots=[\"test:0\"]", "evaluation.lots: \"test:0\" asks for \"0\" lots"),
        ("evaluation.lots=[\"test:1000000:all\", \"train:1000000\"]", "runs; at most 10000000 are possible"),
        ("evaluation.elsewhere=[\"\"]", "evaluation.elsewhere: \"\" is not a lot"),
        ("evaluation.noise=[]", "evaluation.noise is empty"),
        (
            &format!("evaluation.noise=[{}]", (0..101).map(|i| format!("{i}e-2,")).collect::<String>()),
            "evaluation.noise names 101 levels; at most 100 are possible",
        ),
        ("evaluation.noise=[1, 1.0]", "evaluation.noise names 1 twice"),
        ("evaluation.noise=[\"paper\", 0.5, 1]", "evaluation.noise names paper and 1, which are the same"),
        ("evaluation.noise=[2, \"hard\"]", "evaluation.noise names 2 and hard, which are the same"),
        ("training.noise=11", "not within 0 (clean) … 10"),
        ("training.directions=[]", "training.directions is empty"),
        ("seed=-1", "seed"),
        ("seed=9223372036854775808", "--set seed=9223372036854775808"),
        ("=1", "--set =1"),
        ("", "write a key and a value"),
        ("seed", "write a key and a value"),
        ("seed.=1", "seed"),
        ("a=1", "no key \"a\""),
        ("seed==1", "is not a TOML value"),
        ("seed=1\nseed=2", "is not a TOML value"),
        (&format!("{}b=1", "a.".repeat(20_000)), "a key of 20001 parts"),
        (&format!("seed={}", "[".repeat(20_000)), "is not a TOML value"),
    ] {
        cases.refuse(&change[..change.len().min(60)], resolve(change), expected);
    }
    cases.finish(1000);
}

/// Whatever a range holds can be driven with: no panic, nothing that is not finite. Settings that were refused, and cars that
/// did not fit, counted as driven: nothing would have been said had all been.
#[test]
fn every_setting_drives_at_either_end_of_its_range() {
    let whole = ["episode.physics_step_ms", "episode.control_period_ms"];
    let of_drives = |key: &str| key.starts_with("episode.") || key.starts_with("expert.");
    let (mut failed, mut driven, mut ends) = (Vec::new(), 0, 0);
    for entry in reference::entries().iter().filter(|entry| of_drives(&entry.key) && !whole.contains(&&*entry.key)) {
        let Some(range) = entry.range else { continue };
        for end in range.ends() {
            let whole = Settings::preset("default").unwrap().to_toml().parse::<toml::Table>().unwrap();
            let value = entry.key.split('.').fold(&toml::Value::Table(whole), |value, part| &value[part]).clone();
            let change = match value {
                toml::Value::Integer(_) => format!("{}={}", entry.key, end as i64),
                toml::Value::Array(values) => format!("{}={:?}", entry.key, vec![end; values.len()]),
                _ => format!("{}={end:?}", entry.key),
            };
            let layers = Layers { overrides: vec![change.clone()], ..Layers::default() };
            ends += 1;
            // What several settings decide together may refuse an end.
            let Ok(settings) = Settings::resolve(&layers, None) else { continue };
            match std::panic::catch_unwind(|| drive(&settings)) {
                Ok(Some(true)) => driven += 1,
                Ok(None) => {}
                Ok(Some(false)) | Err(_) => failed.push(change),
            }
        }
    }
    assert!(failed.is_empty(), "these do not drive: {failed:#?}");
    assert!(ends > 150 && 4 * driven > 3 * ends, "only {driven} of {ends} ends are driven");
}

/// Whether a second of driving by the expert stays finite; `None` if the car does not fit the lot.
fn drive(settings: &Settings) -> Option<bool> {
    let lane = Scenario::lane(-100.0..=200.0, 60.0, 0.0..=100.0);
    let episode = Arc::new(settings.episode.clone());
    let map = Map::build(lane, &episode.vehicle).ok()?;
    let mut expert = ScriptedExpert::new(settings.expert.clone(), &episode, RootSeed(1).rng(Stream::Expert, 0));
    let mut episode = Episode::new(episode, Arc::new(map), RootSeed(1));
    for _ in 0..20 {
        if episode.ending().is_some() {
            break;
        }
        episode.observe();
        let decision = expert.decide(&episode.situation());
        let label = decision.look_ahead;
        let frame = episode.apply(decision);
        let at = frame.vehicle;
        let numbers =
            [at.pose.x_m, at.pose.y_m, at.pose.heading_rad, at.speed_mps, at.steering_rad, label.ahead_m, label.left_m];
        if !numbers.iter().all(|number| number.is_finite()) {
            return Some(false);
        }
    }
    Some(true)
}

#[test]
fn names_of_lots_drivers_and_moments_that_are_refused() {
    let no_lot =
        ["", " ", "lot-d", "LOT-A", "lot-a,", ",", "lot-a,,lot-b", "train", "validate:3", "trainings:2", "-", "test"];
    let lots = [
        ("test:", "asks for \"\" lots"),
        ("test:0", "asks for \"0\" lots"),
        ("test:-1", "asks for \"-1\" lots"),
        ("test:1.5", "asks for \"1.5\" lots"),
        ("test:1000001", "asks for \"1000001\" lots"),
        ("test:99999999999999999999999", "lots, not for a number from 1 to 1000000"),
        ("test:3:", "has no family \"\""),
        ("test:3:brutal", "has no family \"brutal\""),
        ("test:3:hard:1", "has \"1\" too much"),
        ("test-hard--1", "is not a lot"),
        ("test-hard-18446744073709551616", "is not a lot"),
        ("sealed", "does not say which phrase"),
        ("sealed:", "has the phrase \"\""),
        ("sealed:a", "does not say how many lots"),
        ("sealed:A b:3", "has the phrase \"A b\""),
        ("sealed:-a:3", "has the phrase \"-a\""),
        (&format!("sealed:{}:3", "a".repeat(41)), "write 1 to 40 of a-z"),
        ("test:١", "asks for \"١\" lots"),
    ];
    let lots = no_lot.iter().map(|&name| (name, "here are lot-a, lot-b")).chain(lots);
    let mut cases = Table::default();
    for (name, expected) in lots {
        cases.refuse(name, scenarios::suite(name), expected);
    }
    for (driver, expected) in [
        ("", "no driver \"\"; there are expert"),
        ("nobody", "no driver \"nobody\""),
        ("Expert", "no driver \"Expert\""),
        ("expert:x", "no driver \"expert:x\""),
        ("tuned:", "here are tuned:tentacle"),
        ("tuned:expert", "here are tuned:tentacle"),
        ("tuned:vvf:x", "here are tuned:tentacle"),
        ("vvf ", "no driver \"vvf \""),
        (":", "no driver \":\""),
        ("run:a|b", "contains '|', and tables hold its name; rename the file or folder"),
        ("net:a\nb/round-01", "contains '\\n'"),
        ("run:a\u{202e}b", "contains '\\u{202e}'"),
    ] {
        cases.refuse(driver, driver.parse::<DriverSpec>(), expected);
    }
    let settings = Settings::preset("smoke").unwrap();
    for (driver, expected) in [
        ("run:no/such/run", "this is not a run"),
        ("run:", "names no folder or file"),
        ("run:no/such/run/bc", "this is not a run"),
        ("net:no/such/net", "lists no finished model.safetensors"),
        ("net:", "names no folder or file"),
        ("vvf:no/such.toml", "no/such.toml: cannot be read"),
        ("vvf:", "names no folder or file"),
        ("vvf:/", "it is a folder"),
    ] {
        let load = || driver.parse::<DriverSpec>()?.load(&settings);
        cases.refuse(driver, load(), expected);
    }
    for (key, expected) in [
        ("", "1 parts, not the 7"),
        ("expert@lot-b", "2 parts, not the 7"),
        ("expert@lot-b@forward@0@paper@1@0@", "8 parts, not the 7"),
        ("@lot-b@forward@0@paper@1@0", "driver and lot have names"),
        ("expert@@forward@0@paper@1@0", "driver and lot have names"),
        ("nobody@lot-b@forward@0@paper@1@0", "no driver \"nobody\""),
        ("expert@lot-b@Forward@0@paper@1@0", "no direction \"Forward\""),
        ("expert@lot-b@@0@paper@1@0", "no direction \"\""),
        ("expert@lot-b@forward@@paper@1@0", "trial \"\" is not a number"),
        ("expert@lot-b@forward@-1@paper@1@0", "trial \"-1\" is not a number"),
        ("expert@lot-b@forward@1048576@paper@1@0", "trial 1048576 is too large; there are 0 to 1048575"),
        ("expert@lot-b@forward@4294967296@paper@1@0", "too large"),
        ("expert@lot-b@forward@0@loud@1@0", "no noise \"loud\""),
        ("expert@lot-b@forward@0@11@1@0", "not within 0 (clean) … 10"),
        ("expert@lot-b@forward@0@nan@1@0", "noise NaN is not within"),
        ("expert@lot-b@forward@0@paper@x@0", "seed \"x\" is not a number"),
        ("expert@lot-b@forward@0@paper@18446744073709551616@0", "seed"),
        ("expert@lot-b@forward@0@paper@1@", "tick \"\" is not a number"),
        ("expert@lot-b@forward@0@paper@1@1e3", "tick \"1e3\" is not a number"),
        ("expert@lot-b@forward@0@paper@1@4294967296", "too large"),
    ] {
        cases.refuse(key, key.parse::<ReplayKey>(), expected);
    }
    cases.finish(60);
}

/// A map of free pixels with a wall around it, and what drives it.
struct MapFiles {
    yaml: String,
    image: Vec<u8>,
    lot: String,
    line: String,
}

impl MapFiles {
    fn sound() -> Self {
        let is_wall = |col: usize, row: usize| col == 0 || col == 59 || row == 0 || row == 29;
        let pixels = (0..30).flat_map(|row| (0..60).map(move |col| if is_wall(col, row) { 0 } else { 254 }));
        Self {
            yaml: "image: map.pgm\nresolution: 1.0\norigin: [0.0, 0.0, 0.0]\nnegate: 0\noccupied_thresh: 0.65\n\
                   free_thresh: 0.196\nmode: trinary\n"
                .to_owned(),
            image: [&b"P5\n60 30\n255\n"[..], &pixels.collect::<Vec<u8>>()].concat(),
            lot:
                "map = \"map.yaml\"\nscale = 1.0\ncentre_line = \"line.csv\"\nwall_height_m = 1.0\ndrop_specks_m2 = 0\n"
                    .to_owned(),
            line: "x,y\n8,12\n40,12\n".to_owned(),
        }
    }

    fn load(&self, folder: &Path) -> Result<(), scenarios::LoadError> {
        let files = [
            ("map.yaml", self.yaml.as_bytes()),
            ("map.pgm", &self.image),
            ("map.lot.toml", self.lot.as_bytes()),
            ("line.csv", self.line.as_bytes()),
        ];
        for (name, content) in files {
            std::fs::write(folder.join(name), content).unwrap();
        }
        scenarios::load::load(&folder.join("map.lot.toml"), &VehicleSettings::hyundai_hg300()).map(drop)
    }
}

#[test]
fn maps_that_are_refused() {
    let folder = scratch("bad-maps");
    MapFiles::sound().load(&folder).unwrap();
    let mut cases = Table::default();
    for (from, to, expected) in [
        ("image: map.pgm\n", "", "missing field `image`"),
        ("image: map.pgm", "image: none.pgm", "none.pgm: cannot be read"),
        ("image: map.pgm", "image: .", "it is a folder"),
        ("image: map.pgm", "image: map.yaml", "not a readable image"),
        ("image: map.pgm", "image: /dev/zero", "neither next to the YAML file nor in a folder below"),
        ("image: map.pgm", "image: /etc/passwd", "neither next to the YAML file nor in a folder below"),
        ("image: map.pgm", "image: ../../../../etc/hostname", "image"),
        ("image: map.pgm", "image: [map.pgm]", "map.yaml:1"),
        ("resolution: 1.0\n", "", "missing field `resolution`"),
        ("resolution: 1.0", "resolution: 0", "map.yaml:2: resolution: it is 0"),
        ("resolution: 1.0", "resolution: -1", "map.yaml:2: resolution: it is -1"),
        ("resolution: 1.0", "resolution: .nan", "resolution: it is NaN"),
        ("resolution: 1.0", "resolution: .inf", "resolution: it is inf"),
        ("resolution: 1.0", "resolution: 1e-300", "write metres per pixel, 0.0001 to 1000"),
        ("resolution: 1.0", "resolution: 1e300", "write metres per pixel, 0.0001 to 1000"),
        ("resolution: 1.0", "resolution: fine", "map.yaml:2"),
        ("resolution: 1.0", "resolution: 8.7", "is not drivable"),
        ("resolution: 1.0", "resolution: 0.0005", "is not drivable: the map spans"),
        ("origin: [0.0, 0.0, 0.0]\n", "", "missing field `origin`"),
        ("[0.0, 0.0, 0.0]", "[0.0, 0.0]", "map.yaml:3"),
        ("[0.0, 0.0, 0.0]", "[.nan, 0.0, 0.0]", "origin: a number is NaN"),
        ("[0.0, 0.0, 0.0]", "[1e30, 0.0, 0.0]", "origin: a number is 1000000"),
        ("[0.0, 0.0, 0.0]", "[90.0, 0.0, 0.0]", "is not drivable: the map spans"),
        ("[0.0, 0.0, 0.0]", "zero", "map.yaml:3"),
        ("negate: 0", "negate: maybe", "map.yaml:4"),
        ("negate: 0", "negate: 1", "is not drivable"),
        ("occupied_thresh: 0.65", "occupied_thresh: 1.5", "occupied_thresh: it is 1.5"),
        ("occupied_thresh: 0.65", "occupied_thresh: .nan", "occupied_thresh: it is NaN"),
        ("free_thresh: 0.196", "free_thresh: 0.7", "above occupied_thresh"),
        ("free_thresh: 0.196", "free_thresh: -1", "free_thresh: it is -1"),
        ("mode: trinary", "mode: binary", "map.yaml:7"),
        ("image", "]", "map.yaml:1"),
        ("image", "\u{1}", "map.yaml:1"),
        ("image: map.pgm", "image: &a [*a]", "map.yaml:1"),
    ] {
        let mut map = MapFiles::sound();
        map.yaml = map.yaml.replacen(from, to, 1);
        cases.refuse(&format!("{from:?} → {to:?}"), map.load(&folder), expected);
    }
    for (from, to, expected) in [
        ("map = \"map.yaml\"\n", "", "unknown field `scale`"),
        ("map = \"map.yaml\"", "map = \"map.png\"", "neither a ROS map nor a TPCAP case"),
        ("map = \"map.yaml\"", "map = \"none.yaml\"", "none.yaml: cannot be read"),
        ("map = \"map.yaml\"", "map = 3", "map.lot.toml:1"),
        ("scale = 1.0", "scale = 0", "scale: it is 0"),
        ("scale = 1.0", "scale = -1", "scale: it is -1"),
        ("scale = 1.0", "scale = nan", "scale: it is NaN"),
        ("scale = 1.0", "scale = 1e300", "0.001 to 10000"),
        ("scale = 1.0", "scale = 9", "keep it within 500 m"),
        ("scale = 1.0", "scale = 101", "a pixel of the map is 101 m in the lot"),
        ("scale = 1.0", "sclae = 20", "unknown field `sclae`"),
        ("centre_line = \"line.csv\"", "centre_line = \"none.csv\"", "none.csv: cannot be read"),
        ("centre_line = \"line.csv\"", "centre_line = \".\"", "it is a folder"),
        ("centre_line = \"line.csv\"", "", "the map does not say where to drive"),
        ("centre_line = \"line.csv\"", "start = [8, 12, 0]", "a start is given, but not where to drive"),
        ("centre_line = \"line.csv\"", "start = [8, 12]\nloop = true", "map.lot.toml:3"),
        ("centre_line = \"line.csv\"", "start = [nan, 12, 0]\nloop = true", "start: a number is NaN"),
        ("centre_line = \"line.csv\"", "start = [1e30, 12, 0]\nloop = true", "start: a number is 1000000"),
        ("centre_line = \"line.csv\"", "start = [0, 12, 0]\nloop = true", "start: (0.00, 12.00) is not drivable"),
        ("centre_line = \"line.csv\"", "start = [8, 12, 0]\ngoal = [0, 0, 0]", "goal: (0.00, 0.00) is not drivable"),
        ("centre_line = \"line.csv\"", "start = [8, 12, 0]\ngoal = [9, 9, 0]\nloop = true", "goal is given too"),
        ("centre_line", "loop = true\ncentre_line", "loop is given too"),
        ("drop_specks_m2 = 0", "clearance_m = 3", "clearance_m: it is 3"),
        ("drop_specks_m2 = 0", "clearance_m = nan", "clearance_m: it is NaN"),
        ("drop_specks_m2 = 0", "clearance_m = 0.2", "clearance_m: centre_line is given too"),
        ("wall_height_m = 1.0", "wall_height_m = -1", "wall_height_m: it is -1"),
        ("drop_specks_m2 = 0", "drop_specks_m2 = 1e9", "drop_specks_m2: it is 1000000000"),
        ("drop_specks_m2 = 0", "name = \"a/b\"", "contains '/'"),
        ("drop_specks_m2 = 0", "is_image_anywhere = true", "unknown field `is_image_anywhere`"),
        ("drop_specks_m2 = 0", "noise = { level = \"loud\" }", "unknown variant `loud`"),
    ] {
        let mut map = MapFiles::sound();
        map.lot = map.lot.replacen(from, to, 1);
        cases.refuse(&format!("{from:?} → {to:?}"), map.load(&folder), expected);
    }
    let wiggle: String = (0..10_001).map(|i| format!("{},12\n", 8 + i % 2)).collect();
    for (line, expected) in [
        ("", "the line has 0 points"),
        ("x,y\n", "the line has 0 points"),
        ("8,12\n", "the line has 1 points"),
        ("8,12\n8,12\n", "the line has 1 points"),
        ("8,12\nx,12\n", "line.csv:2"),
        ("8,12\n9\n", "line.csv:2: \"9\" is not a point"),
        ("8,12\nnan,12\n", "line.csv:2: \"nan,12\" is not a point"),
        ("8,12\ninf,12\n", "line.csv:2: \"inf,12\" is not a point"),
        ("8,12\n2e9,12\n", "line.csv:2: \"2e9,12\" is not a point"),
        ("8,12\n1e30,12\n", "line.csv:2: \"1e30,12\" is not a point"),
        ("8,12\n9e7,12\n", "is 90000 km long in the lot; shorten it to at most 20000 m"),
        ("8,12\n70,12\n", "too narrow"),
        ("8,12\n40,1.2\n", "too narrow"),
        (&wiggle, "the line has more than 10000 points"),
    ] {
        let map = MapFiles { line: line.to_owned(), ..MapFiles::sound() };
        cases.refuse(&line[..line.len().min(40)], map.load(&folder), expected);
    }
    for (image, expected) in [
        (&b""[..], "not a readable image"),
        (b"P5", "not a readable image"),
        (b"P5\n60 30\n255\n", "not a readable image"),
        (b"P5\n0 30\n255\n", "image"),
        (b"P5\n60 0\n255\n", "image"),
        (b"P2\n0 0\n255\n", "image"),
        (b"P1\n0 1\n", "image"),
        (b"P4\n0 1\n", "image"),
        (b"P7\nWIDTH 0\nHEIGHT 1\nDEPTH 1\nMAXVAL 255\nENDHDR\n", "image"),
        (b"P5\n60000 60000\n255\n", "it is too large"),
        (b"P5\n4294967295 4294967295\n255\n", "it is too large"),
        (b"P5\n99999999999 1\n255\n", "not a readable image"),
        (b"P5\n-1 1\n255\n", "not a readable image"),
        (b"P5\n60 30\n0\n", "not a readable image"),
        (b"P5\n4096 4096\n255\n\0\0", "not a readable image"),
        (b"\x89PNG\r\n\x1a\n", "not a readable image"),
        (b"GIF89a", "image"),
    ] {
        let map = MapFiles { image: image.to_vec(), ..MapFiles::sound() };
        cases.refuse(&String::from_utf8_lossy(image), map.load(&folder), expected);
    }
    let case = folder.join("case.csv");
    for (text, expected) in [
        ("", "the file ends after 0 numbers"),
        ("1,2", "the file ends after 2 numbers"),
        ("x,y", "\"x\" is not a number of metres"),
        ("nan,2,0,9,2,0,0", "\"nan\" is not a number of metres"),
        ("1e30,2,0,9,2,0,0", "\"1e30\" is not a number of metres"),
        ("1,2,0,9,2,0,-1", "number 7, the number of obstacles, is -1"),
        ("1,2,0,9,2,0,1.5", "number 7, the number of obstacles, is 1.5"),
        ("1,2,0,9,2,0,20000", "number 7, the number of obstacles, is 20000"),
        ("1,2,0,9,2,0,1,2", "number 8, the number of vertices of obstacle 1, is 2"),
        ("1,2,0,9,2,0,1,3,0,0", "the file ends after 10 numbers, before a vertex of obstacle 1"),
        ("1,2,0,9,2,0,0,7", "1 numbers are left over"),
    ] {
        std::fs::write(&case, text).unwrap();
        cases.refuse(text, scenarios::load::load(&case, &VehicleSettings::hyundai_hg300()), expected);
    }
    cases.finish(90);
}

#[test]
fn files_of_planners_and_networks_that_are_refused() {
    let folder = scratch("bad-files");
    let settings = Settings::preset("smoke").unwrap();
    let file = folder.join("dwa.toml");
    let sound = std::fs::read_to_string(crate::bench::root().join("planners/tuned/corridors/dwa.toml")).unwrap();
    let load = |text: &str| {
        std::fs::write(&file, text).unwrap();
        format!("dwa:{}", file.display()).parse::<DriverSpec>()?.load(&settings)
    };
    load(&sound).unwrap();
    let mut cases = Table::default();
    for (from, to, expected) in [
        ("\"dwa\"", "\"vvf\"", "these are parameters of \"vvf\""),
        ("\"dwa\"", "dwa", "dwa.toml"),
        ("planner = \"dwa\"\n", "", "missing field `planner`"),
        ("[parameters]", "[params]", "unknown field `params`"),
        ("window_s =", "windows_s =", "windows_s"),
        ("brake_mps2 = 2.0\n", "", "brake_mps2"),
        ("brake_mps2 = 2.0", "brake_mps2 = nan", "brake_mps2"),
        ("brake_mps2 = 2.0", "brake_mps2 = -1", "brake_mps2"),
        ("brake_mps2 = 2.0", "brake_mps2 = \"2\"", "dwa.toml"),
        ("planner", "]", "dwa.toml"),
    ] {
        cases.refuse(&format!("{from:?} → {to:?}"), load(&sound.replacen(from, to, 1)), expected);
    }
    let network = NetworkArchitecture::compact();
    let (weights, inference) = (Weights::init(network, RootSeed(1), 0), InferenceSettings::plain());
    let checkpoint = Checkpoint { weights, conditions: Conditions::of(&settings.episode), inference };
    checkpoint.save(&folder).unwrap();
    // Damage is another test's: here files are whole, but wrong.
    let listed = || sums::list_all(&folder).unwrap();
    let (model, numbers) = (folder.join("model.toml"), folder.join("model.safetensors"));
    let (about, bytes) = (std::fs::read_to_string(&model).unwrap(), std::fs::read(&numbers).unwrap());
    for (from, to, expected) in [
        ("schema = 3", "schema = 1", "schema 1; this program reads schema 3"),
        ("schema = 3\n", "", "no schema number"),
        ("hidden = 256", "hidden = 1000000000000", "hidden units; at most 65536 are possible"),
        ("hidden = 256", "hidden = 0", "at least one unit"),
        ("hidden = 256", "hidden = 60000", "parameters; at most 64000000 are possible"),
        ("hidden = 256", "hidden = 128", "layer"),
        ("channels = 16", "channels = 1600000", "channels in conv1; at most 1024 are possible"),
        ("channels = 16", "channels = 17", "17 channels"),
        ("kernel = 3", "kernel = 0", "kernel of 0 cells"),
        ("kernel = 3", "kernel = 900", "kernel of 900 cells"),
        ("dropout_hidden = 0.2", "dropout_hidden = nan", "dropout_hidden is NaN"),
        ("smoothing_ticks = 0.0", "smoothing_ticks = -1", "smoothing_ticks is -1"),
        ("log_variance_min =", "log_variance_mni =", "log_variance_mni"),
    ] {
        assert!(about.contains(from), "{from:?} is not in\n{about}");
        std::fs::write(&model, about.replacen(from, to, 1)).unwrap();
        listed();
        cases.refuse(&format!("{from:?} → {to:?}"), Checkpoint::load(&folder), expected);
    }
    std::fs::write(&model, &about).unwrap();
    let mut not_finite = bytes.clone();
    let end = not_finite.len();
    not_finite[end - 4..].copy_from_slice(&f32::NAN.to_le_bytes());
    let forged = [&u64::MAX.to_le_bytes()[..], &bytes[8..]].concat();
    let larger = [&bytes[..], &vec![0; 70_000]].concat();
    for (content, expected) in [
        (&b""[..], "model.safetensors"),
        (&bytes[..100], "model.safetensors"),
        (&bytes[..end - 4], "model.safetensors"),
        (&forged, "model.safetensors"),
        (&larger, "bytes or more; at most"),
        (&not_finite, "is not finite"),
    ] {
        std::fs::write(&numbers, content).unwrap();
        listed();
        cases.refuse(expected, Checkpoint::load(&folder), expected);
    }
    std::fs::remove_file(&numbers).unwrap();
    cases.refuse("no numbers", Checkpoint::load(&folder), "model.safetensors");
    cases.finish(30);
}

/// A command with at most 600 MB of addresses and ten seconds of processor time, in a folder of its own.
#[cfg(unix)]
fn within_means(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new("sh");
    let program = xtask();
    command.args(["-c", "ulimit -v 600000; ulimit -t 10; exec \"$@\"", "sh"]).arg(program.get_program());
    // A stack for each of many processors would take the addresses.
    command.args(arguments).current_dir(folder).env("RAYON_NUM_THREADS", "2");
    command
}

/// What lies in a folder and below it: of each file its length, when it was written and, unless it is large or no file,
/// its content.
#[cfg(unix)]
fn content_in(folder: &Path) -> BTreeMap<PathBuf, (u64, SystemTime, Vec<u8>)> {
    let mut found = BTreeMap::new();
    for entry in folder.read_dir().unwrap() {
        let entry = entry.unwrap();
        let (path, about) = (entry.path(), entry.metadata().unwrap());
        if about.is_dir() {
            found.extend(content_in(&path));
            found.insert(path, (0, SystemTime::UNIX_EPOCH, Vec::new()));
        } else {
            let is_read = about.is_file() && about.len() < 1_000_000;
            let content = if is_read { std::fs::read(&path).unwrap() } else { Vec::new() };
            found.insert(path, (about.len(), about.modified().unwrap(), content));
        }
    }
    found
}

/// A white PNG of 60 × 30 pixels whose colour profile unpacks to so many zeros, 258 times a whole number.
#[cfg(unix)]
fn png_with_profile(zeros: u32) -> Vec<u8> {
    let crc = |bytes: &[u8]| {
        let bit = |crc: u32| crc >> 1 ^ if crc & 1 == 1 { 0xEDB8_8320 } else { 0 };
        !bytes.iter().fold(!0, |crc, &byte| (0..8).fold(crc ^ u32::from(byte), |crc, _| bit(crc)))
    };
    let chunk = |name: &[u8; 4], content: &[u8]| {
        let checked = [name, content].concat();
        [&(content.len() as u32).to_be_bytes()[..], &checked, &crc(&checked).to_be_bytes()].concat()
    };
    // Deflated with fixed codes: a zero, copies of the 258 bytes from one byte before on, a last one of 257, the end.
    let bits = |text: &str| text.bytes().map(|bit| bit == b'1').collect::<Vec<_>>();
    let copies = bits("1100010100000").repeat((zeros / 258 - 1) as usize);
    let stream = [bits("11000110000"), copies, bits("110001000111100000"), bits("0000000")].concat();
    let byte = |bits: &[bool]| bits.iter().rev().fold(0, |byte, &bit| byte << 1 | u8::from(bit));
    let deflated = stream.chunks(8).map(byte).collect::<Vec<_>>();
    let adler = (zeros % 65521) << 16 | 1;
    let profile = [&b"icc\0\0\x78\x01"[..], &deflated, &adler.to_be_bytes()].concat();
    let rows = [&[0_u8][..], &[255; 60]].concat().repeat(30);
    let sums =
        rows.iter().fold((1, 0), |(a, b), &byte| ((a + u32::from(byte)) % 65521, (b + (a + u32::from(byte))) % 65521));
    let length = rows.len() as u16;
    let stored = [&[0x78, 1, 1][..], &length.to_le_bytes(), &(!length).to_le_bytes(), &rows].concat();
    let pixels = [stored, (sums.1 << 16 | sums.0).to_be_bytes().to_vec()].concat();
    let header = [0, 0, 0, 60, 0, 0, 0, 30, 8, 0, 0, 0, 0];
    let chunks = [chunk(b"IHDR", &header), chunk(b"iCCP", &profile), chunk(b"IDAT", &pixels), chunk(b"IEND", &[])];
    [b"\x89PNG\r\n\x1a\n".to_vec(), chunks.concat()].concat()
}

/// Exit code 2, one error, no panic, bounded time and memory, and the folder as it was. What is large stays below the
/// limits of a file's size where these alone would refuse it.
#[cfg(unix)]
#[test]
fn whole_commands_refuse_within_their_means_and_leave_nothing() {
    let folder = scratch("bad-commands");
    let write = |name: &str, content: &[u8]| std::fs::write(folder.join(name), content).unwrap();
    write("lane.toml", LOT.as_bytes());
    write(
        "cones.toml",
        (LOT.to_owned() + &"[[obstacle]]\nclass = \"cone\"\nx_m = 9\ny_m = 28\n".repeat(20_000)).as_bytes(),
    );
    write("comb.toml", LOT.replacen("[0, 30]]", &format!("[0, 30], {}]", "[1, 2],".repeat(100_000)), 1).as_bytes());
    write("long-comb.toml", with_comb(true, 430.0).as_bytes());
    write("keys.toml", (0..60_000).map(|i| format!("[a{i}.b]\n")).collect::<String>().as_bytes());
    write("name.toml", LOT.replace("lane", &"n".repeat(900_000)).as_bytes());
    std::fs::File::create(folder.join("huge.toml")).unwrap().set_len(200_000_000_000).unwrap();
    let sound = MapFiles::sound();
    write("map.yaml", sound.yaml.replace("map.pgm", "noise.pgm").as_bytes());
    // A quarter of the pixels is occupied, but none near the start.
    let noise = (0..4096_u32 * 4096).map(|i| {
        let mixed = (i ^ i >> 15).wrapping_mul(0x2c1b_3c6d);
        let mixed = (mixed ^ mixed >> 12).wrapping_mul(0x297a_2d39);
        let is_near = (i % 4096).abs_diff(205) < 5 && (i / 4096).abs_diff(3890) < 5;
        if mixed >> 30 == 0 && !is_near { 0 } else { 255 }
    });
    write("noise.pgm", &[&b"P5\n4096 4096\n255\n"[..], &noise.collect::<Vec<u8>>()].concat());
    // Pillars of a pixel each.
    let pillars = (0..4096_u32 * 4096).map(|i| if i % 8 == 4 && i / 4096 % 32 == 4 { 0 } else { 255 });
    write("pillars.pgm", &[&b"P5\n4096 4096\n255\n"[..], &pillars.collect::<Vec<u8>>()].concat());
    write("pillars.yaml", sound.yaml.replace("map.pgm", "pillars.pgm").as_bytes());
    write("bomb.yaml", sound.yaml.replace("map.pgm", "bomb.pgm").as_bytes());
    write("bomb.pgm", b"P5\n60000 60000\n255\n\xff");
    write("profile.yaml", sound.yaml.replace("map.pgm", "profile.png").as_bytes());
    write("profile.png", &png_with_profile(258 * 2_600_000)); // more than the memory it is read in
    write("zero.yaml", sound.yaml.replace("map.pgm", "/dev/zero").as_bytes());
    let aliases = (1..30).map(|i| format!("a{i}: &a{i} [{}]\n", format!("*a{},", i - 1).repeat(9)));
    write("aliases.yaml", ("a0: &a0 [x]\n".to_owned() + &aliases.collect::<String>()).as_bytes());
    write("far.csv", b"8,12\n2e9,12\n");
    write("far.lot.toml", b"map = \"map.yaml\"\ncentre_line = \"far.csv\"\n");
    write("back.csv", b"8,12\n40,12\n8,12\n");
    write("small.yaml", sound.yaml.as_bytes());
    write("map.pgm", &sound.image);
    write("back.lot.toml", b"map = \"small.yaml\"\ncentre_line = \"back.csv\"\n");
    for (name, lot) in [("stars.toml", "a*b"), ("bars.toml", "a+b")] {
        write(name, LOT.replace("\"lane\"", &format!("{lot:?}")).as_bytes());
    }
    write("deep.toml", "[".repeat(250_000).as_bytes());
    write("eta.toml", b"[dagger]\neta = 7\n");
    assert!(Command::new("mkfifo").arg(folder.join("pipe.toml")).status().unwrap().success());
    let before = content_in(&folder);
    let route = ["--start", "8,12,0", "--goal", "40,12,0"];
    let deep_key = format!("{}b=1", "a.".repeat(20_000));
    let cases: &[(&[&str], &str)] = &[
        (&["evaluate", "--driver", "expert", "--method", "mine"], "write a name and its drivers"),
        (&["evaluate", "--driver", "expert", "--method", "mine=net:*"], "no driver is named so; there are expert"),
        (&["evaluate", "--driver", "expert", "--method", "mine=[*"], "no driver is named so"),
        (&["evaluate", "--driver", "expert", "vvf", "cvm", "--method", "mine=*"], "is no training"),
        (&["evaluate", "--driver", "expert", "--lots", "cones.toml"], "there are 20001 obstacles"),
        (&["evaluate", "--driver", "expert", "--lots", "comb.toml"], "100007 vertices"),
        (&["evaluate", "--driver", "expert", "--lots", "long-comb.toml"], "4299 km long"),
        (&["evaluate", "--driver", "expert", "--lots", "keys.toml"], "unknown field `a0`"),
        (&["evaluate", "--driver", "expert", "--lots", "name.toml"], "900000 characters"),
        (&["evaluate", "--driver", "expert", "--lots", "huge.toml"], "are read; name a smaller file"),
        (&["evaluate", "--driver", "expert", "--lots", "pipe.toml"], "it is not a regular file"),
        (&["evaluate", "--driver", "expert", "--lots", "far.lot.toml"], "far.csv:2"),
        (
            &["evaluate", "--driver", "expert", "--lots", "back.lot.toml"],
            "centre_line: it turns back at (40.00, 12.00)",
        ),
        (&["evaluate", "--driver", "expert", "--lots", "lane.toml", "--trials", "0"], "evaluation.trials = 0"),
        (
            &["evaluate", "--driver", "expert", "--lots", "lot-b", "--set", "episode.vehicle.length_m=30"],
            "does not fit at the start",
        ),
        (
            &["evaluate", "--driver", "expert", "--set", "episode.vehicle.emergency_brake_mps2=1e-5"],
            "episode.vehicle.emergency_brake_mps2",
        ),
        (&["generate", "--lots", "stars.toml", "bars.toml", "--out", "."], "would both be a-b.toml"),
        (&["render", "lot", "--lots", "stars.toml", "bars.toml", "--out", "p", "--overwrite"], "would both be a-b.png"),
        (
            &["evaluate", "--driver", "expert", "--lots", "test:600000,train:600000", "--trials", "1"],
            "lots; at most 1000000",
        ),
        (&["render", "noise", "--lots", "test:600000,train:600000"], "1200000 lots are named"),
        (
            &["evaluate", "--driver", "expert", "--lots", "test:300000", "--shard", "1/1"],
            "take more than 16000000 bytes",
        ),
        (&["evaluate", "--driver", "expert", "--lots", "test:1000001"], "from 1 to 1000000"),
        (&["evaluate", "--driver", "dwa:pipe.toml"], "it is not a regular file"),
        (&["evaluate", "--driver", "expert", "--out", "a|b"], "without '|'"),
        (
            &["pixel-accuracy", "--lots", "lot-b", "--noise", "10", "--set", "episode.noise.blob=100"],
            "at most 100 is possible",
        ),
        (
            &["render", "noise", "--lots", "lot-b", "--noise", "10", "--set", "episode.noise.blob=100"],
            "at most 100 is possible",
        ),
        (&["evaluate", "--driver", "expert", "--out", "a\u{202e}b"], "without '\\u{202e}'"),
        (&["evaluate", "--driver", "expert", "--lots", "a\u{200b}.toml"], "contains '\\u{200b}'"),
        (&["evaluate", "--driver", "dwa:huge.toml"], "200000000000 bytes or more"),
        (&["evaluate", "--driver", "dwa:deep.toml"], "at most 65536 are read"),
        (&["evaluate", "--driver", "expert", "--threads", "1000000"], "--threads"),
        (&["evaluate", "--driver", "expert", "--threads", "0"], "--threads"),
        (&["evaluate", "--driver", "expert", "--noise", "nan"], "nan"),
        (&["generate", "--lots", "bomb.yaml", route[0], route[1], route[2], route[3]], "it is too large"),
        (&["generate", "--lots", "profile.yaml", "--start", "-500,12,0", "--loop"], "without colour profile"),
        (&["generate", "--lots", "zero.yaml", route[0], route[1], route[2], route[3]], "neither next to the YAML file"),
        (
            &["generate", "--lots", "zero.yaml", "--image-anywhere", route[0], route[1], route[2], route[3]],
            "it is not a regular file",
        ),
        (&["generate", "--lots", "aliases.yaml", route[0], route[1], route[2], route[3]], "aliases.yaml"),
        (
            &["generate", "--lots", "map.yaml", "--scale", "0.1", "--start", "205,205,0", "--loop"],
            "corners; smooth the image",
        ),
        (
            &["generate", "--lots", "pillars.yaml", "--scale", "0.1", "--start", "205,205,0", "--loop"],
            "islands; smooth",
        ),
        (&["generate", "--lots", "lot-a", "--count", "0"], "--count"),
        (&["render", "contact-sheet", "--lots", "test:1000"], "a contact sheet has room for"),
        (&["generate", "--lots", "lot-a", "--count", "2000000"], "--count"),
        (&["generate", "--lots", "lot-a", "--pixels-per-metre", "1e9"], "at most 1000"),
        (&["generate", "--lots", "lot-a", "--pixels-per-metre", "nan"], "must be positive"),
        (&["render", "trajectories", "--driver", "expert", "--trial", "1048576"], "--trial"),
        (&["render", "animation", "expert@lot-b@forward@1048576@paper@1@9"], "0 to 1048575"),
        (&["render", "animation", "--driver", "expert", "--speed", "1e-30"], "--speed must be"),
        (&["render", "animation", "--driver", "expert", "--to", "nan"], "--from and --to"),
        (&["render", "report", "."], "this is not a run"),
        (&["render", "contact-sheet", "--lots", "lot-a", "--pixels-per-metre", "5"], "--pixels-per-metre"),
        (&["render", "trajectories", "--driver", "expert", "--round", "1"], "--round"),
        (&["render", "samples", "round-01"], "there is no such round"),
        (&["replay"], "<KEY|--of"),
        (&["replay", "exprt@lot-b@forward@0@paper@1@9"], "did you mean expert?"),
        (&["visualise", "replay", "expert@lot-z@forward@0@paper@1@9"], "\"lot-z\" is not a lot"),
        (&["visualise", "episode", "--driver", "net:nope"], "net:nope"),
        (&["visualise", "lot", "--out", "map.yaml"], "map.yaml: exists already, and is not a recording"),
        (&["evaluate", "--driver", "expert", "--record", "0"], "--record"),
        (&["evaluate", "--driver", "expert", "--shard", "1/2", "--json"], "--json"),
        (&["drivers", "vvf", "--json"], "--json"),
        (&["tune", "--planner", "vvf,vvf"], "\"vvf\" is named twice"),
        (&["train-dagger", "--resume", ".", "--overwrite"], "--overwrite"),
        (&["evaluate", "--resume", ".", "--overwrite"], "--overwrite"),
        (&["evaluate", "--resume", "map.yaml"], "there is no such run"),
        (&["what-if", "map.yaml"], "this is not a run"),
        (&["replay", "expert@lot-b@forward@1048576@paper@1@9"], "0 to 1048575"),
        (&["replay", "expert@lot-z@forward@0@paper@1@9"], "\"lot-z\" is not a lot"),
        (&["replay", "--of", "."], "this is not a run"),
        (&["replay", "--of", ".", "--sample", "0"], "--sample"),
        (&["visualise", "episode", "--driver", "expert", "--trial", "4000000000"], "--trial"),
        (&["settings", "--config", "deep.toml"], "deep.toml:1"),
        (&["settings", "--config", "pipe.toml"], "it is not a regular file"),
        (&["settings", "--config", "/dev/zero"], "it is not a regular file"),
        (&["settings", "--config", "huge.toml"], "200000000000 bytes or more"),
        (&["settings", "--set", &deep_key], "a key of 20001 parts"),
        (&["settings", "--set", "training.lots=[\"lot-z\"]"], "training.lots: \"lot-z\" is not a lot"),
        (&["train-dagger", "--set", "dagger.fit.batch=0"], "dagger.fit.batch = 0"),
        (&["train-dagger", "--set", "dagger.fit.learning_rate.floor=1"], "is more than"),
        (&["train-dagger", "--resume", "no/such/run"], "no such run"),
        (&["tune", "--trials", "0"], "evaluation.trials = 0"),
        (&["tune", "--trials", "2000"], "40000 drives for each planner"),
        (&["reproduce", "--unseen", "lot-z"], "\"lot-z\" is not a lot"),
        (&["reproduce", "--set", "evaluation.lots=[\"test:5001:easy\"]"], "10002 drives"),
        (&["pixel-accuracy", "--trials", "0"], "--trials"),
        (&["sample-size", "--between", "nan,1"], "nan"),
        (&["sample-size", "--below", "1e-12"], "a rate is 0 or at least 0.000000001"),
        (&["sample-size", "--between", "1,1.0000000000000002"], "no distance tells rates apart"),
        (&["evaluate", "--driver", "expert", "--seed", "-1"], "invalid value '-1' for '--seed"),
        (&["settings", "--config", "eta.toml"], "eta.toml: dagger.eta = 7 is out of range"),
        (&["verify", "."], "this is not a run"),
    ];
    for (arguments, expected) in cases {
        let output = within_means(&folder, arguments).stdin(Stdio::null()).output().unwrap();
        let stderr = text(&output).1;
        let shown: Vec<&str> = arguments.iter().map(|word| &word[..word.len().min(60)]).collect();
        assert_eq!(output.status.code(), Some(2), "{shown:?}: {}\n{stderr}", output.status);
        assert!(stderr.to_lowercase().contains(&expected.to_lowercase()), "{shown:?} lacks {expected:?}:\n{stderr}");
        let errors = stderr.lines().filter(|line| line.starts_with("error: ")).count();
        assert!(errors == 1 && !stderr.contains("panicked") && stderr.len() < ERROR_MAX, "{shown:?}:\n{stderr}");
        assert!(
            !stderr.contains(|letter| letter != '\n' && is_hidden(letter)),
            "{shown:?} quotes what nobody sees:\n{stderr:?}"
        );
        let after = content_in(&folder);
        assert!(after.keys().eq(before.keys()), "{shown:?} leaves something: {:?}", after.keys());
        assert!(after == before, "{shown:?} changes a file");
    }
}

/// Full and closed outputs: what was asked for is on disk, and only what could not be printed is an error.
#[cfg(target_os = "linux")]
#[test]
fn outputs_that_are_full_or_closed_lose_no_result() {
    let folder = scratch("outputs");
    let run = |name: &str, redirected: &str| {
        let out = folder.join(name);
        let command = format!("exec \"$@\" {redirected}");
        let mut shell = Command::new("sh");
        shell.args(["-c", &command, "sh"]).arg(xtask().get_program()).args(["evaluate", "--driver", "tentacle"]);
        shell.args(["--lots", "lot-b", "--trials", "1", "--directions", "forward", "--out"]).arg(&out);
        let status = shell.current_dir(&folder).output().unwrap().status.code();
        assert!(out.join("finished.toml").is_file() && out.join("summary.md").is_file(), "{redirected}: {status:?}");
        status
    };
    assert_eq!(run("err-full", "2> /dev/full"), Some(0));
    assert_eq!(run("both-full", "> /dev/full 2>&1"), Some(2), "results could not be printed");
    assert_eq!(run("closed", ">&- 2>&-"), Some(0));
    assert_eq!(run("head", "2>&1 | head -1"), Some(0));
}

/// The command line was read as text, and a name that is not text was a panic.
#[cfg(target_os = "linux")]
#[test]
fn a_folder_whose_name_is_no_text_is_written_into() {
    use std::os::unix::ffi::OsStrExt as _;
    let out = scratch("no-text").join(std::ffi::OsStr::from_bytes(b"bar\xe9"));
    let output = xtask().args(["generate", "--lots", "lot-b", "--out"]).arg(&out).output().unwrap();
    assert!(output.status.success(), "{}", text(&output).1);
    assert!(out.join("lot-b-s1.toml").is_file());
}
