//! The paper in a box, end to end: one report that loads nothing, resumed and shared out to the same bytes, and refusals.

use crate::bench::{scratch, succeed, text, xtask};
use crate::determinism::files;
use std::collections::BTreeMap;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::Output;
use std::sync::LazyLock;
use std::time::Duration;
use storage::sums;

/// Stages of a smoke run, in their order.
const STAGES: [&str; 18] = [
    "chains/s1-weighted",
    "chains/s1-unweighted",
    "chains/s1-expert-equal",
    "chains/s1-any-below",
    "chains/s1-tau-only",
    "chains/s1-expert-only",
    "chains/s1-alpha-15",
    "chains/s1-far-points",
    "drives/reference",
    "drives/unseen",
    "drives/rules",
    "drives/controls",
    "drives/far-points",
    "drives/readings",
    "drives/readings-unseen",
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
    let is_kept = |name: &str| ["manifest.toml", "wall_time.jsonl", ".lock"].iter().all(|other| !name.ends_with(other));
    files(run).into_iter().filter(|(name, _)| is_kept(name)).map(|(name, bytes)| (name, normal(bytes))).collect()
}

/// Makes what `whole` holds on two machines, and holds it against that, byte for byte.
fn assert_same_from_shards(command: &str, whole: &Path, run: &impl Fn(&[&str]) -> Output, arguments: &[&str]) {
    let shards = ["1", "2"].map(|number| whole.with_file_name(format!("shard-{number}")));
    for (number, shard) in (1..).zip(&shards) {
        let share = format!("--shard={number}/2");
        let made = run(&[arguments, &[&share, "--out", &shard.to_string_lossy()]].concat());
        assert!(made.status.success(), "{}", text(&made).1);
    }
    let merged = whole.with_file_name("merged");
    refused(&["render", "results"], &[&shards[0]], "this is a shard");
    refused(&["merge", "--out", &merged.to_string_lossy()], &[&shards[0]], "missing: shard 2/2");
    succeed(xtask().arg("merge").args(&shards).arg("--out").arg(&merged));
    succeed(xtask().args([command, "--resume"]).arg(&merged));
    assert!(sums::verify(&merged).faults.is_empty());
    let (expected, found) = (contents(whole), contents(&merged));
    assert_eq!(expected.keys().collect::<Vec<_>>(), found.keys().collect::<Vec<_>>(), "{command}");
    for (name, bytes) in &expected {
        // Lists have the digests of manifests, which name other command lines.
        assert!(name.ends_with("sha256sums") || *bytes == found[name], "{name} differs between one machine and two");
    }
}

/// A run on one machine, and what it printed.
static WHOLE: LazyLock<(PathBuf, String)> = LazyLock::new(|| {
    let folder = scratch("reproduce-whole").join("run");
    let printed = succeed(xtask().args(["reproduce", "--preset", "smoke", "--out"]).arg(&folder));
    (folder, printed)
});

/// Holds a run against that on one machine, byte for byte.
fn assert_same_as_whole(run: &Path, when: &str) {
    let (expected, found) = (contents(&WHOLE.0), contents(run));
    assert_eq!(expected.keys().collect::<Vec<_>>(), found.keys().collect::<Vec<_>>(), "{when}");
    for (name, bytes) in &expected {
        assert!(*bytes == found[name], "{name} differs {when}");
    }
    for name in ["report.md", "report.html"] {
        let [expected, found] = [&*WHOLE.0, run].map(|run| std::fs::read(run.join(name)).unwrap());
        assert!(expected == found, "{name} differs {when}");
    }
    assert_eq!(listed(&WHOLE.0), listed(run), "{when}");
    assert!(sums::verify(run).faults.is_empty());
}

/// What each training lists: the digest of a run is made of it.
fn listed(run: &Path) -> BTreeMap<OsString, Vec<String>> {
    let trainings = std::fs::read_dir(run.join("chains")).unwrap().map(Result::unwrap);
    trainings.map(|training| (training.file_name(), sums::names(&training.path()).unwrap())).collect()
}

/// Near-collisions (contacts) of a driver, summed over the runs of a stage.
fn counted(run: &Path, stage: &str, driver: &str) -> String {
    let text = std::fs::read_to_string(run.join("drives").join(stage).join("runs.jsonl")).unwrap();
    let runs = text.lines().map(|line| serde_json::from_str::<serde_json::Value>(line).unwrap());
    let metrics: Vec<_> = runs.filter(|run| run["driver"] == driver).map(|run| run["metrics"].clone()).collect();
    assert!(!metrics.is_empty(), "{driver} did not drive in {stage}");
    let sum = |name: &str| metrics.iter().map(|of_run| of_run[name].as_u64().unwrap()).sum::<u64>();
    format!("{} ({})", sum("near_collisions"), sum("contacts"))
}

#[test]
fn a_report_is_written_and_an_interrupted_run_comes_to_the_same() {
    let resumed = scratch("reproduce").join("resumed");
    let (whole, printed) = &*WHOLE;
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
        "### Half and far points",
        "### Action smoothing",
        "### Readings of the planners",
        "### Calibration",
        "within 1 σ",
        "](figures/rates-beside-paper.svg)",
        "](figures/safe-ratios-beside-paper.svg)",
    ] {
        assert!(report.contains(part), "{part} is missing from {report}");
    }
    // What the tables of the ablations count is what the drives wrote.
    let row = |table: &str, name: &str| {
        let (_, rest) = report.split_once(table).unwrap();
        let cells = rest.lines().map(|line| line.split('|').map(str::trim).collect::<Vec<_>>());
        cells.into_iter().find(|cells| cells.get(1) == Some(&name)).unwrap_or_else(|| panic!("{table}: {name}"))
    };
    let equal = "expert's data alone, as many samples";
    for name in ["BC", "DAgger", "DAgger, α = 0", "expert's data alone", equal, "DAgger, α = 15"] {
        assert_eq!(row("### Controls", name)[5], counted(whole, "controls", name), "{name}");
    }
    let samples = |name: &str| row("### Controls", name)[3].parse::<u32>().unwrap();
    assert_eq!(samples(equal), samples("DAgger"));
    assert!(samples(equal) < samples("expert's data alone"), "or it were the same control");
    for name in ["expert", "BC", "DAgger", "tentacle", "vvf", "mppi, tuned"] {
        let row = row("### Action smoothing", name);
        assert_eq!(row[2], counted(whole, "unsmoothed", name), "{name}");
        assert_eq!(row[5], counted(whole, "smoothed", name), "{name}");
    }
    for name in ["DAgger", "tentacle/short", "dwa/fox", "cvm", "cvm/simmons"] {
        let row = row("### Readings of the planners", name);
        assert_eq!(row[2], counted(whole, "readings", name), "{name}");
        assert_eq!(row[5], counted(whole, "readings-unseen", name), "{name}");
    }
    assert_ne!(counted(whole, "smoothed", "vvf"), "0 (0)", "or the tables could be empty");

    let html = std::fs::read_to_string(whole.join("report.html")).unwrap();
    for foreign in ["<script", "<link", "<iframe", "@import", "src=\"http", "href=\"http", "url(http", "src=\"figures"]
    {
        assert!(!html.contains(foreign), "the page loads something: {foreign}");
    }
    assert!(html.matches("<svg").count() >= 5, "figures are in the page");

    // Once it was replaced by an empty page.
    refused(&["render", "report"], &[whole], "neither a training nor an evaluation");
    refused(&["render", "results", "--out", "pictures"], &[whole], "name it with --to");
    assert_eq!(std::fs::read_to_string(whole.join("report.html")).unwrap(), html);

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
    assert_same_as_whole(&resumed, "after resuming");

    let page = resumed.with_file_name("results.md");
    let results = || {
        succeed(xtask().args(["render", "results"]).arg(&resumed).arg("--to").arg(&page));
        std::fs::read_to_string(&page).unwrap()
    };
    let expected = results();
    // A flipped bit in the name of a training in the list, and its rows were gone from the page, without a word.
    let list = std::fs::read_to_string(resumed.join(sums::FILE)).unwrap();
    std::fs::write(resumed.join(sums::FILE), list.replace("s1-far-points/", "s1-far-pointr/")).unwrap();
    assert!(results() == expected, "the page is another one");
    std::fs::write(resumed.join(sums::FILE), list).unwrap();
    // So they would be with a training that was deleted.
    let (training, aside) = (resumed.join("chains/s1-far-points"), resumed.with_file_name("aside"));
    std::fs::rename(&training, &aside).unwrap();
    let missing = "chains/s1-far-points/sha256sums: cannot be read";
    refused(&["render", "results"], &[&resumed, Path::new("--to"), &page], missing);
    std::fs::rename(&aside, &training).unwrap();
    // A stage that was driven in another run was shown as this run's.
    let reference = resumed.join("drives/reference");
    let wall_times = std::fs::read(reference.join("wall_time.jsonl")).unwrap();
    sums::write(&reference, "wall_time.jsonl", b"").unwrap();
    refused(&["render", "results"], &[&resumed, Path::new("--to"), &page], "drives/reference/sha256sums: is damaged");
    sums::write(&reference, "wall_time.jsonl", &wall_times).unwrap();

    let again = xtask().args(["reproduce", "--resume"]).arg(&resumed).output().unwrap();
    assert_eq!(again.status.code(), Some(2));
    assert!(text(&again).1.contains("finished"), "{}", text(&again).1);
}

fn refused(arguments: &[&str], folders: &[&Path], part: &str) {
    let output = xtask().args(arguments).args(folders).output().unwrap();
    let (_, stderr) = text(&output);
    assert_eq!(output.status.code(), Some(2), "{arguments:?}: {stderr}");
    assert!(stderr.contains(part) && stderr.lines().count() == 1, "{part:?} is missing in: {stderr}");
}

/// Its chains could not be trained, nor its lots be driven, on several machines.
#[test]
fn shards_of_trainings_and_of_drives_come_to_the_bytes_of_one_machine() {
    let folder = scratch("reproduce-shards");
    let run = folder.join("run");
    let shards = |part: &str, of: usize| (1..=of).map(|i| folder.join(part).join(i.to_string())).collect::<Vec<_>>();
    let shard = |first: &[&str], number: usize, out: &[PathBuf]| {
        let share = format!("{number}/{}", out.len());
        succeed(xtask().args(first).args(["--shard", &share, "--out"]).arg(&out[number - 1]));
    };
    // More than there are behaviour clonings: those of the first chain are trained by others, too.
    let trained = shards("trained", 4);
    let train = ["reproduce", "--preset", "smoke"];
    shard(&train, 1, &trained);
    let one = trained[0].as_path();
    refused(&["merge", "--out", "nowhere"], &[one], "missing: shard 2/4, shard 3/4, shard 4/4");
    refused(&["render", "results"], &[one], "this is a shard");
    refused(&["reproduce", "--shard", "1/2", "--networks"], &[one], "this is a shard");
    (2..=4).for_each(|number| shard(&train, number, &trained));
    let all: Vec<&Path> = trained.iter().map(PathBuf::as_path).collect();
    // There are more shards than trainings.
    let idle = folder.join("idle");
    succeed(xtask().args(train).args(["--shard", "7/1000000", "--out"]).arg(&idle));
    refused(&["merge", "--out", "nowhere"], &[&idle], "shard 11/1000000 and 999989 more");
    let damaged = trained[1].join("chains/s1-unweighted/round-01/model.safetensors");
    let content = std::fs::read(&damaged).unwrap();
    std::fs::write(&damaged, &content[1..]).unwrap();
    let out = run.to_string_lossy();
    refused(&["merge", "--out", &out], &[&one.join("chains/s1-weighted")], "this is not a shard");
    refused(&["merge", "--out", &out], &all, "model.safetensors: is damaged");
    assert!(!run.exists());
    std::fs::write(&damaged, content).unwrap();
    refused(&["merge", "--overwrite", "--out", &one.to_string_lossy()], &all, "what is read lies there");
    succeed(xtask().arg("merge").args(&trained).arg("--out").arg(&run));
    // A merge that died continues, and does nothing twice.
    std::fs::rename(run.join("chains/s1-alpha-15"), run.join("chains/s1-alpha-15.lotpilot-partial")).unwrap();
    std::fs::remove_file(run.join("chains/s1-alpha-15.lotpilot-partial/sha256sums")).unwrap();
    sums::unlist(&run, &["chains/s1-alpha-15/sha256sums"]).unwrap();
    succeed(xtask().arg("merge").args(&trained).arg("--out").arg(&run));
    assert!(sums::verify(&run).faults.is_empty() && !run.join("chains/s1-alpha-15.lotpilot-partial").exists());
    let manifest = std::fs::read_to_string(run.join("manifest.toml")).unwrap();
    assert!(manifest.contains(r#"command_line = ["reproduce", "--preset", "smoke"]"#), "{manifest}");
    assert!(!run.join("drives").exists() && run.join("chains/s1-alpha-15/finished.toml").is_file());

    // Three shards of two trials per lot: one has nothing to do in some stages.
    let driven = shards("driven", 3);
    let networks = out.clone() + "/";
    let drive = ["reproduce", "--networks", &networks];
    (1..=3).for_each(|number| shard(&drive, number, &driven));
    let [first, second, third] = [0, 1, 2].map(|i| driven[i].as_path());
    let stages = [first, second, third].map(|shard| shard.join("drives/unseen"));
    refused(&["merge"], &stages.each_ref().map(PathBuf::as_path), "this is a stage of a shard");
    refused(&["reproduce", "--shard", "1/3", "--overwrite", "--out", &out, "--networks"], &[&run], "lies there");
    // Stopped before its end, it continues.
    sums::unlist(second, &["finished.toml", "drives/smoothed/sha256sums"]).unwrap();
    std::fs::remove_dir_all(second.join("drives/smoothed")).unwrap();
    refused(&["merge"], &[first, second, third], "shard 2/3 is not finished");
    let manifest = std::fs::read_to_string(second.join("manifest.toml")).unwrap();
    sums::write(second, "manifest.toml", manifest.replacen("\"lotpilot", "\"old lotpilot", 1).as_bytes()).unwrap();
    refused(&["reproduce", "--resume"], &[second], "begun with another version of lotpilot");
    // Not every processor has FMA.
    let differ = [("target = \"", "target = \"other-"), ("\"fma\"", "\"sse\"")];
    for (here, elsewhere) in differ.into_iter().filter(|(here, _)| manifest.contains(here)) {
        sums::write(second, "manifest.toml", manifest.replacen(here, elsewhere, 1).as_bytes()).unwrap();
        refused(&["reproduce", "--resume"], &[second], "begun on a machine that rounds otherwise");
    }
    sums::write(second, "manifest.toml", manifest.as_bytes()).unwrap();
    succeed(xtask().args(["reproduce", "--resume"]).arg(second));
    // One machine began to drive; what the shards drove takes its place.
    let mut alone = xtask().args(["reproduce", "--resume"]).arg(&run).spawn().unwrap();
    while !run.join("drives/reference/driving.unfinished").exists() {
        assert!(alone.try_wait().unwrap().is_none(), "it ended before it was killed");
        std::thread::sleep(Duration::from_millis(5));
    }
    alone.kill().unwrap();
    alone.wait().unwrap();
    refused(&["merge"], &[first, third], "missing: shard 2/3");
    refused(&["merge"], &[first, second, third, one], "made with another");
    refused(&["merge", "--out", "nowhere"], &[first, second, third], "--out: these shards drove networks of");
    let printed = succeed(xtask().arg("merge").args([third, first, second]));
    assert!(printed.contains("DAgger has fewer near-collisions"), "{printed}");
    assert_same_as_whole(&run, "after merging");
    refused(&["merge"], &[first, second, third], "this run is finished");
    refused(&["reproduce", "--shard", "1/3", "--networks"], &[&run], "this run is finished");
}

/// They could be had from their own commands alone.
#[test]
fn a_table_with_trainings_of_its_own_is_that_of_its_command() {
    let folder = scratch("reproduce-tables");
    let settings = [
        "training.lots=[\"train:1:easy\"]",
        "dagger.fit.budget.steps=20",
        "dagger.cloning_budget.steps=20",
        "dagger.fit.mirror=\"off\"",
        "dagger.fit.loss.beta=0",
        "dagger.disturbance.enabled=false",
        "dagger.inference.mirror_averaging=false",
        "dagger.inference.smoothing_ticks=0",
    ];
    let run = |words: &[&str], out: &str| {
        let settings = settings.iter().flat_map(|setting| ["--set", setting]);
        let named = ["--preset", "smoke", "--unseen", "test:1:easy", "--out"];
        succeed(xtask().args(words).args(settings).args(named).arg(folder.join(out)));
    };
    run(&["reproduce", "--tables", "deviations"], "whole");
    run(&["deviations"], "alone");
    let read = |name: &str| std::fs::read(folder.join(name)).unwrap();
    for name in ["deviations.md", "deviations.csv", "deviations.svg"] {
        assert!(read(&format!("whole/{name}")) == read(&format!("alone/{name}")), "{name} differs");
    }
    let table = String::from_utf8(read("alone/deviations.md")).unwrap();
    let report = String::from_utf8(read("whole/report.md")).unwrap();
    assert!(report.contains(table.trim_end()) && report.contains("](figures/deviations.svg)"), "{report}");
    assert!(!report.contains("Decision rules at equal samples"), "nobody asked for it");
    assert!(sums::verify(&folder.join("whole")).faults.is_empty());
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
        (vec!["--set", "dagger.rule=safe_dagger"], "by the paper's rule, all_below"),
        (vec!["--preset", "paper", "--tables", "deviations"], "these settings are as in the paper in all of that"),
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
    let arguments = ["--of", "points,network", "--unseen", "validation:1:lane"];
    let made = run(&[&arguments[..], &["--out", &out]].concat());
    assert!(made.status.success(), "{}", text(&made).1);
    assert_same_from_shards("deviations", Path::new(&out), &run, &arguments);
    let csv = std::fs::read_to_string(folder.join("out/deviations.csv")).unwrap();
    let count = |part: &str| csv.lines().filter(|line| line.contains(part)).count();
    assert_eq!((count("as-it-is"), count("points"), count("network,")), (2, 2, 2), "{csv}");
    let averaging = "dagger.inference.mirror_averaging=false";
    for (arguments, part) in [
        (&["--of", "pints"] as &[&str], "there are points"),
        (&["--of", "network,network"], "named twice"),
        (&["--set", averaging, "--of", "averaging"], "as in the paper there"),
    ] {
        let refused = run(arguments);
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
            .unwrap()
    };
    let out_name = out.to_string_lossy().into_owned();
    let arguments = ["--different", "2,1", "--unseen", "validation:1:lane"];
    let first = run(&[&arguments[..], &["--out", &out_name]].concat());
    assert!(first.status.success(), "{}", text(&first).1);
    assert_same_from_shards("scaling", &out, &run, &arguments);
    let table = std::fs::read_to_string(out.join("scaling.md")).unwrap();
    let rows: Vec<&str> = table.lines().filter(|line| line.contains("| BC ") || line.contains("| DAgger ")).collect();
    assert_eq!(rows.len(), 4, "two trainings, two policies of each:\n{table}");
    // Each is compared with that of the next more lots, however they are named.
    assert!(rows[0].starts_with("| 1 ") && rows[3].starts_with("| 2 "), "{table}");
    assert!(std::fs::read_to_string(out.join("scaling.svg")).unwrap().contains("different lots"));
    assert!(std::fs::read_to_string(out.join("scaling.csv")).unwrap().contains("validation-lane"));

    // The table in the page of all results.
    let page = folder.join("results.md");
    let render = |others: &[&str]| {
        let mut render = xtask();
        render.args(["render", "results"]).arg(&WHOLE.0).arg("--with").args(others).arg("--to").arg(&page);
        render.output().unwrap()
    };
    let unknown = render(&[&WHOLE.0.to_string_lossy()]);
    assert_eq!(unknown.status.code(), Some(2));
    assert!(text(&unknown).1.contains("a run of reproduce has no table of its own"), "{}", text(&unknown).1);
    // The page was looked at first, and said to be in the way of a run that has none.
    let diary = folder.join("diary.md");
    std::fs::write(&diary, "dear").unwrap();
    let whole = WHOLE.0.display().to_string();
    let mut onto_diary = xtask();
    onto_diary.args(["render", "results", &out_name, "--with", &whole, "--to"]).arg(&diary);
    let said = text(&onto_diary.output().unwrap()).1;
    assert!(said.contains("a run of reproduce has no table of its own") && !said.contains("diary"), "{said}");
    refused(&["render", "results", &out_name, "--to"], &[&diary], "is not a page of results");
    assert_eq!(std::fs::read_to_string(&diary).unwrap(), "dear");
    assert!(render(&[&out_name, &format!("Few lots={out_name}")]).status.success());
    let results = std::fs::read_to_string(&page).unwrap();
    let (_, last) = results.split_once("\n## Few lots\n").unwrap();
    assert!(last.contains("Made by `cargo xtask scaling --preset smoke") && last.contains(&table), "{last}");
    assert!(last.contains("](pictures/results/scaling-2.svg)"), "each plot has a file of its own: {last}");
    assert!(["scaling.svg", "scaling-2.svg"].iter().all(|plot| folder.join("pictures/results").join(plot).is_file()));
    refused(&["render", "results"], &[&folder.join("nowhere")], "nowhere: this is not a finished run of reproduce or");
    let merged = out.with_file_name("merged");
    sums::write(&merged.join("drives"), "wall_time.jsonl", b"").unwrap();
    refused(&["render", "results", "--to"], &[&diary, &merged], "drives/sha256sums: is damaged");
    // And as a page of its own.
    let own = folder.join("results-scaling.md");
    succeed(xtask().args(["render", "results", &out_name, "--to"]).arg(&own));
    let own = std::fs::read_to_string(own).unwrap();
    assert!(own.starts_with("# Near-collisions against different lots\n") && own.contains(&table), "{own}");
    assert!(own.contains("| command | `cargo xtask scaling --preset smoke"), "{own}");
    assert!(own.contains(&format!("`cargo xtask render results {out_name} --to ")), "{own}");
    assert!(own.contains("](pictures/results-scaling/scaling.svg)"), "{own}");
    for (arguments, part) in [
        (["--different", "0"], "name at least one lot"),
        (["--different", "4,4"], "named twice"),
        (["--unseen", "train:2"], "trained or tuned on it"),
    ] {
        let refused = run(&arguments);
        assert_eq!(refused.status.code(), Some(2));
        assert!(text(&refused).1.contains(part), "{arguments:?}: {}", text(&refused).1);
    }
}

#[test]
fn rules_keep_every_tick_with_the_presets_that_train_on_many_lots() {
    for (preset, keep) in [("default", "every_tick"), ("strong", "every_tick"), ("paper", "expert_ticks")] {
        let out = scratch(&format!("rules-keep-{preset}")).join("out");
        let mut killed = xtask().args(["rules", "--preset", preset, "--out"]).arg(&out).spawn().unwrap();
        let settings = (0..6000).find_map(|_| {
            std::thread::sleep(Duration::from_millis(20));
            std::fs::read_to_string(out.join("settings.toml")).ok()
        });
        killed.kill().unwrap();
        killed.wait().unwrap();
        let settings = settings.expect("settings within two minutes");
        let line = format!("keep = \"{keep}\"");
        assert!(settings.lines().any(|found| found == line), "{preset}: {settings}");
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
    let arguments = [
        "--rule=expert_only,ensemble_dagger,lazy_dagger",
        "--set=dagger.rule.ensemble_dagger.members=2",
        "--iterations=1",
        "--samples=200",
        "--unseen=validation:1:lane",
    ];
    let first = run(&[&arguments[..], &["--out", &out_name]].concat());
    assert!(first.status.success(), "{}", text(&first).1);
    let table = std::fs::read_to_string(out.join("rules.md")).unwrap();
    let rows: Vec<&str> = table.lines().filter(|line| line.starts_with("| ")).skip(1).collect();
    assert_eq!(rows.len(), 4, "behaviour cloning and three rules:\n{table}");
    let thresholds = "EnsembleDAgger has the thresholds of the settings";
    for part in ["Of one training of each rule;", thresholds, "Intervals of 95 % are for other lots;"] {
        assert!(table.contains(part), "{part} is missing in {table}");
    }
    assert!(rows[1].starts_with("| expert only") && rows[1].contains("100.0 %"), "{table}");
    let cells = |row: &str| row.split('|').map(|cell| cell.trim().to_owned()).collect::<Vec<_>>();
    // Two members, as the settings say; a network is what they train three of otherwise.
    assert_eq!(cells(rows[2])[1..4], ["EnsembleDAgger", "400", "2"], "{table}");
    assert_eq!(cells(rows[1])[6], "–", "nobody had the wheel but the expert: {table}");
    assert!(std::fs::read_to_string(out.join("rules.csv")).unwrap().contains("LazyDAgger"));
    assert!(std::fs::read_to_string(out.join("rules.svg")).unwrap().contains("expert is asked"));
    assert_same_from_shards("rules", &out, &run, &arguments);
    // A run that was moved before its end: its networks are known by where they lie in it.
    let moved = folder.join("moved");
    std::fs::rename(&out, &moved).unwrap();
    let listed = std::fs::read_to_string(moved.join("sha256sums")).unwrap();
    let unfinished: Vec<&str> = listed.lines().filter(|line| !line.ends_with("  finished.toml")).collect();
    std::fs::write(moved.join("sha256sums"), unfinished.join("\n") + "\n").unwrap();
    std::fs::remove_file(moved.join("finished.toml")).unwrap();
    succeed(xtask().args(["rules", "--resume"]).arg(&moved));
    assert_eq!(std::fs::read_to_string(moved.join("rules.md")).unwrap(), table);
    for (arguments, part) in [
        (["--rule", "anybody"], "there are expert_only"),
        (["--rule", "vanilla,vanilla"], "named twice"),
        (["--rule=vanilla", "--set=dagger.rule.safe_dagger.tau=0.02"], "thresholds of safe_dagger, which is not among"),
        (["--samples", "2000000000"], "out of range"),
        (["--unseen", "train:2"], "trained or tuned on it"),
    ] {
        let refused = run(&arguments);
        assert_eq!(refused.status.code(), Some(2));
        assert!(text(&refused).1.contains(part), "{}", text(&refused).1);
    }
}
