//! The paper in a box, end to end: one report that loads nothing, resumed to the same bytes, and refusals.

use crate::bench::{scratch, succeed, text, xtask};
use crate::determinism::files;
use std::collections::BTreeMap;
use std::path::Path;
use std::time::Duration;

/// Stages of a smoke run, in their order.
const STAGES: [&str; 13] = [
    "chains/s1-weighted",
    "chains/s1-unweighted",
    "chains/s1-any-below",
    "chains/s1-tau-only",
    "chains/s1-expert-only",
    "chains/s1-alpha-15",
    "drives/reference",
    "drives/unseen",
    "drives/rules",
    "drives/controls",
    "drives/unsmoothed",
    "drives/smoothed",
    "on-policy",
];

/// Files by name; the folder of the run, which replay keys name, is written as RUN.
fn contents(run: &Path) -> BTreeMap<String, Vec<u8>> {
    let path = run.to_string_lossy().into_owned();
    let normal = |bytes: Vec<u8>| match String::from_utf8(bytes) {
        Ok(text) => text.replace(&path, "RUN").into_bytes(),
        Err(binary) => binary.into_bytes(),
    };
    let is_kept = |name: &str| !name.ends_with("manifest.toml") && !name.ends_with("wall_time.jsonl");
    files(run).into_iter().filter(|(name, _)| is_kept(name)).map(|(name, bytes)| (name, normal(bytes))).collect()
}

#[test]
fn a_report_is_written_and_an_interrupted_run_comes_to_the_same() {
    let folder = scratch("reproduce");
    let (whole, resumed) = (folder.join("whole"), folder.join("resumed"));
    let printed = succeed(xtask().args(["reproduce", "--preset", "smoke", "--out"]).arg(&whole));
    assert!(printed.contains("Cannot be told") && printed.contains("DAgger has fewer near-collisions"), "{printed}");
    for stage in STAGES {
        assert!(whole.join(stage).join("finished.toml").is_file(), "{stage}");
    }
    let cloned = |chain: &str| std::fs::read(whole.join(chain).join("round-00/model.safetensors")).unwrap();
    assert_eq!(cloned(STAGES[0]), cloned(STAGES[3]), "behaviour cloning is shared");

    let report = std::fs::read_to_string(whole.join("report.md")).unwrap();
    for part in [
        "## What holds here",
        "Table 1",
        "effect of the weight",
        "paper: tentacle",
        "### Decision rule",
        "any below",
        "### Controls",
        "expert's data alone",
        "### Action smoothing",
        "### Calibration",
        "within 1 σ",
        "](figures/rates-beside-paper.svg)",
        "](figures/safe-ratios-beside-paper.svg)",
    ] {
        assert!(report.contains(part), "{part} is missing from {report}");
    }
    let html = std::fs::read_to_string(whole.join("report.html")).unwrap();
    for foreign in ["<script", "<link", "<iframe", "@import", "src=\"http", "href=\"http", "url(http", "src=\"figures"]
    {
        assert!(!html.contains(foreign), "the page loads something: {foreign}");
    }
    assert!(html.matches("<svg").count() >= 5, "figures are in the page");

    // Killed in the middle of the third chain.
    let mut killed = xtask().args(["reproduce", "--preset", "smoke", "--out"]).arg(&resumed).spawn().unwrap();
    while !resumed.join("chains/s1-any-below/round-01").exists() {
        assert!(killed.try_wait().unwrap().is_none(), "it ended before it was killed");
        std::thread::sleep(Duration::from_millis(5));
    }
    killed.kill().unwrap();
    killed.wait().unwrap();
    let printed_again = succeed(xtask().args(["--threads", "1", "reproduce", "--resume"]).arg(&resumed));
    assert!(printed_again.contains("DAgger has fewer near-collisions"), "{printed_again}");
    let (expected, found) = (contents(&whole), contents(&resumed));
    assert_eq!(expected.keys().collect::<Vec<_>>(), found.keys().collect::<Vec<_>>());
    for name in ["report.md", "report.html"] {
        assert!(
            std::fs::read(whole.join(name)).unwrap() == std::fs::read(resumed.join(name)).unwrap(),
            "{name} differs"
        );
    }
    for (name, bytes) in &expected {
        assert!(*bytes == found[name], "{name} differs after resuming");
    }

    let again = xtask().args(["reproduce", "--resume"]).arg(&resumed).output().unwrap();
    assert_eq!(again.status.code(), Some(2));
    assert!(text(&again).1.contains("finished"), "{}", text(&again).1);
}

#[test]
fn what_cannot_be_reproduced_is_refused_before_anything_is_written() {
    let folder = scratch("reproduce-refused");
    let out = folder.join("out").to_string_lossy().into_owned();
    for (arguments, part) in [
        (vec!["--unseen", "lot-q"], "lot-q"),
        (vec!["--unseen", "train:2"], "trained or tuned on it"),
        (vec!["--unseen", "lot-a"], "trained or tuned on it"),
        (vec!["--tuned", "no/such/folder"], "no/such/folder"),
        (vec!["--preset", "papier"], "papier"),
        (vec!["--set", "dagger.etta=0.8"], "etta"),
    ] {
        let output = xtask().args(["reproduce", "--out", &out]).args(&arguments).output().unwrap();
        let (stdout, stderr) = text(&output);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}:\n{stdout}\n{stderr}");
        assert!(stderr.contains(part), "{arguments:?} should mention {part:?}: {stderr}");
        assert!(!Path::new(&out).exists(), "{arguments:?} leaves {out}");
    }
}

#[test]
fn each_deviation_from_the_paper_is_trained_and_driven() {
    let folder = scratch("deviations");
    let out = folder.join("out").to_string_lossy().into_owned();
    let short = ["dagger.fit.budget.steps=20", "dagger.cloning_budget.steps=20", "training.lots=[\"train:1:easy\"]"];
    let run = |arguments: &[&str]| {
        let mut command = xtask();
        command.args(["deviations", "--preset", "smoke"]).args(short.iter().flat_map(|change| ["--set", change]));
        command.args(arguments).output().unwrap()
    };
    let made = run(&["--of", "points,network", "--unseen", "validation:1:lane", "--out", &out]);
    assert!(made.status.success(), "{}", text(&made).1);
    let csv = std::fs::read_to_string(folder.join("out/deviations.csv")).unwrap();
    let count = |part: &str| csv.lines().filter(|line| line.contains(part)).count();
    assert_eq!((count("as-it-is"), count("points"), count("network,")), (2, 2, 2), "{csv}");
    for (of, part) in
        [("pints", "there are points"), ("network,network", "named twice"), ("ticks", "as in the paper there")]
    {
        let refused = run(&["--of", of]);
        assert_eq!(refused.status.code(), Some(2));
        assert!(text(&refused).1.contains(part), "{}", text(&refused).1);
    }
}

#[test]
fn trainings_on_few_and_many_lots_end_in_one_table() {
    let folder = scratch("scaling");
    let out = folder.join("out");
    let few = ["--set", "training.lots=[\"train:2:lane\"]", "--set", "dagger.fit.budget.steps=20"];
    let run = |arguments: &[&str]| {
        xtask()
            .args(["scaling", "--preset", "smoke", "--set", "dagger.cloning_budget.steps=20"])
            .args(few)
            .args(arguments)
            .output()
    };
    let out_name = out.to_string_lossy().into_owned();
    let first = run(&["--different", "2,1", "--unseen", "validation:1:lane", "--out", &out_name]).unwrap();
    assert!(first.status.success(), "{}", text(&first).1);
    let table = std::fs::read_to_string(out.join("scaling.md")).unwrap();
    let rows: Vec<&str> = table.lines().filter(|line| line.contains("BC") || line.contains("DAgger")).collect();
    assert_eq!(rows.len(), 4, "two trainings, two policies of each:\n{table}");
    assert!(rows[0].starts_with("| 2 ") && rows[3].starts_with("| 1 "), "{table}");
    assert!(std::fs::read_to_string(out.join("scaling.svg")).unwrap().contains("different lots"));
    assert!(std::fs::read_to_string(out.join("scaling.csv")).unwrap().contains("validation-lane"));
    for (arguments, part) in [
        (["--different", "0"], "name at least one lot"),
        (["--different", "4,4"], "named twice"),
        (["--unseen", "train:2"], "trained on it"),
    ] {
        let refused = run(&arguments).unwrap();
        assert_eq!(refused.status.code(), Some(2));
        assert!(text(&refused).1.contains(part), "{arguments:?}: {}", text(&refused).1);
    }
}

#[test]
fn rules_of_the_family_end_in_one_table_of_effort_and_safety() {
    let folder = scratch("rules");
    let out = folder.join("out");
    let run = |arguments: &[&str]| {
        xtask()
            .args(["rules", "--preset", "smoke", "--set", "dagger.cloning_budget.steps=20"])
            .args(["--set", "training.lots=[\"train:1:lane\"]", "--set", "dagger.fit.budget.steps=20"])
            .args(arguments)
            .output()
            .unwrap()
    };
    let out_name = out.to_string_lossy().into_owned();
    let first = run(&[
        "--rule",
        "expert_only,ensemble_dagger,lazy_dagger",
        "--iterations=1",
        "--samples=200",
        "--unseen=validation:1:lane",
        "--out",
        &out_name,
    ]);
    assert!(first.status.success(), "{}", text(&first).1);
    let table = std::fs::read_to_string(out.join("rules.md")).unwrap();
    let rows: Vec<&str> = table.lines().skip(2).collect();
    assert_eq!(rows.len(), 4, "behaviour cloning and three rules:\n{table}");
    assert!(rows[1].starts_with("| expert only") && rows[1].contains("100.0 %"), "{table}");
    assert!(rows[2].starts_with("| EnsembleDAgger") && rows[2].contains("| 400 "), "{table}");
    assert!(std::fs::read_to_string(out.join("rules.csv")).unwrap().contains("LazyDAgger"));
    assert!(std::fs::read_to_string(out.join("rules.svg")).unwrap().contains("expert is asked"));
    for (arguments, part) in [
        (["--rule", "anybody"], "there are expert_only"),
        (["--rule", "vanilla,vanilla"], "named twice"),
        (["--unseen", "train:2"], "trained on it"),
    ] {
        let refused = run(&arguments);
        assert_eq!(refused.status.code(), Some(2));
        assert!(text(&refused).1.contains(part), "{}", text(&refused).1);
    }
}
