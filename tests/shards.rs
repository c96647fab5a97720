//! What docs/cluster.md promises: shards of an evaluation give the same bytes as one machine, or one clear error.

use crate::bench::{refuse, root, scratch, succeed, text, xtask};
use crate::determinism::files;
use std::path::{Path, PathBuf};
#[cfg(unix)]
use std::process::Command;
use storage::sums;

/// Two drivers that fail now and then, 18 trials: more than are driven at a time.
const EVALUATE: [&str; 10] =
    ["evaluate", "--driver", "tentacle", "cvm", "--lots", "lot-b,test:8:easy", "--trials", "1", "--noise", "clean,1.5"];

fn drive(shard: &str, out: &Path) {
    succeed(xtask().args(EVALUATE).args(["--shard", shard, "--out"]).arg(out));
}

fn refused(shards: &[&Path], part: &str) {
    let folder = scratch("refused-merge").join("run");
    let output = xtask().arg("merge").args(shards).arg("--out").arg(&folder).output().unwrap();
    let (_, stderr) = text(&output);
    assert_eq!(output.status.code(), Some(2), "{stderr}");
    assert!(stderr.contains(part) && stderr.lines().count() == 1, "{part:?} is missing in: {stderr}");
    assert!(!folder.exists(), "a refused merge leaves {}", folder.display());
}

/// Writes a file of a run again, and its digest as well.
fn forge(run: &Path, name: &str, change: impl Fn(&str) -> String) {
    let content = std::fs::read_to_string(run.join(name)).unwrap();
    let changed = change(&content);
    assert_ne!(changed, content, "{name}");
    sums::write(run, name, changed.as_bytes()).unwrap();
}

fn copy(from: &Path, to: &Path) {
    let _ = std::fs::remove_dir_all(to);
    std::fs::create_dir_all(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap() {
        let entry = entry.unwrap();
        // Pictures are in folders, and read by nobody.
        if entry.file_type().unwrap().is_dir() {
            continue;
        }
        std::fs::copy(entry.path(), to.join(entry.file_name())).unwrap();
    }
}

#[test]
fn three_shards_merge_to_the_bytes_of_one_machine_and_nothing_else_merges() {
    let folder = scratch("shards");
    let run = folder.join("run");
    // Into the same folder one after the other: reports and keys name it.
    let printed = succeed(xtask().args(EVALUATE).arg("--out").arg(&run));
    let whole = files(&run);
    assert!(whole["runs.jsonl"].len() > 10_000 && !whole["failures.jsonl"].is_empty());
    std::fs::remove_dir_all(&run).unwrap();
    let shards: Vec<PathBuf> = (1..=3).map(|number| folder.join(format!("shard-{number}"))).collect();
    for (number, out) in (1..).zip(&shards) {
        drive(&format!("{number}/3"), out);
        assert!(!out.join("summary.md").exists(), "no table of a part");
    }
    let [one, two, three] = [&shards[0], &shards[1], &shards[2]].map(PathBuf::as_path);
    let merged = succeed(xtask().arg("merge").args([three, one, two]).arg("--out").arg(&run));
    let together = files(&run);
    assert_eq!(whole.keys().collect::<Vec<_>>(), together.keys().collect::<Vec<_>>());
    for (name, bytes) in &whole {
        assert!(*bytes == together[name], "{name} differs between one machine and three shards");
    }
    assert_eq!(printed, merged);
    assert!(sums::verify(&run).faults.is_empty());
    // It says who drove, not who merged.
    for shard in &shards {
        forge(shard, "manifest.toml", |text| text.replacen("rustc_version = \"", "rustc_version = \"old ", 1));
    }
    succeed(xtask().arg("merge").args(&shards).arg("--overwrite").arg("--out").arg(&run));
    let manifest = std::fs::read_to_string(run.join("manifest.toml")).unwrap();
    assert!(manifest.contains("rustc_version = \"old "), "{manifest}");

    refused(&[one, three], "missing: shard 2/3");
    refused(&[one, two, two, three], "are both shard 2/3");
    refused(&[one, two, &run], "this is not a shard");
    refused(&[one, two, &folder], "this is not a run");

    let other = folder.join("other");
    copy(three, &other);
    forge(&other, "settings.toml", |text| text.replacen("seed = 1", "seed = 2", 1));
    refused(&[one, two, &other], "is not the one that it was begun with");
    copy(three, &other);
    forge(&other, "runs.jsonl", |text| text.lines().skip(1).flat_map(|line| [line, "\n"]).collect());
    refused(&[one, two, &other], "runs.jsonl: lacks");
    copy(three, &other);
    forge(&other, "runs.jsonl", |text| text.lines().next().unwrap().to_owned() + "\n" + text);
    refused(&[one, two, &other], "runs.jsonl:2: ");
    copy(three, &other);
    std::fs::copy(two.join("runs.jsonl"), other.join("runs.jsonl")).unwrap();
    refused(&[one, two, &other], "runs.jsonl");
    sums::list(&other, &["runs.jsonl"]).unwrap();
    refused(&[one, two, &other], "runs.jsonl:1: not of this evaluation");
    copy(three, &other);
    forge(&other, "manifest.toml", |text| text.replacen("program = \"", "program = \"old ", 1));
    refused(&[one, two, &other], "another version of lotpilot");
    copy(three, &other);
    forge(&other, "manifest.toml", |text| text.replacen("compare_with = 0", "compare_with = 1", 1));
    refused(&[one, two, &other], "another choice of drivers, lots or comparison");
    copy(three, &other);
    sums::unlist(&other, &["finished.toml"]).unwrap();
    refused(&[one, two, &other], "shard 3/3 is not finished");
    // These were ignored.
    for (flag, part) in [("--record", "of which nothing is recorded"), ("--json", "which has no tables")] {
        let error = refuse(xtask().args(["evaluate", flag, "--resume"]).arg(&other));
        assert!(error.contains(part), "{error}");
    }
    // It continues as any evaluation does, and what a process that died just before left is gone.
    std::fs::write(other.join("driving.unfinished"), "").unwrap();
    succeed(xtask().args(["evaluate", "--resume"]).arg(&other));
    assert!(!other.join("driving.unfinished").exists());
    refused(&[one, two, two, &other], "are both shard 2/3");
}

#[test]
fn evaluations_of_two_drivers_merge_to_the_bytes_of_one_and_others_do_not() {
    let folder = scratch("by-driver");
    let run = folder.join("run");
    let of = |driver: &str| -> PathBuf {
        let out = folder.join(driver);
        let trials = ["--lots", "lot-b,test:8:easy", "--trials", "1", "--noise", "clean,1.5"];
        succeed(xtask().args(["evaluate", "--driver", driver]).args(trials).arg("--out").arg(&out));
        out
    };
    let printed = succeed(xtask().args(EVALUATE).arg("--out").arg(&run));
    let whole = files(&run);
    std::fs::remove_dir_all(&run).unwrap();
    let (tentacle, cvm) = (of("tentacle"), of("cvm"));
    let merged = succeed(xtask().arg("merge").args([&tentacle, &cvm]).arg("--out").arg(&run));
    let together = files(&run);
    assert_eq!(whole.keys().collect::<Vec<_>>(), together.keys().collect::<Vec<_>>());
    for (name, bytes) in &whole {
        assert!(*bytes == together[name], "{name} differs between one evaluation and two");
    }
    assert_eq!(printed, merged);
    assert!(sums::verify(&run).faults.is_empty());
    refused(&[&run, &cvm], "both have driver cvm");
    let other = folder.join("other");
    copy(&cvm, &other);
    forge(&other, "manifest.toml", |text| text.replacen("program = \"", "program = \"old ", 1));
    refused(&[&tentacle, &other], "another version of lotpilot");
    copy(&cvm, &other);
    forge(&other, "runs.jsonl", |text| text.lines().skip(1).flat_map(|line| [line, "\n"]).collect());
    refused(&[&tentacle, &other], "runs.jsonl: lacks");
    copy(&cvm, &other);
    std::fs::write(other.join("runs.jsonl"), "{}").unwrap();
    refused(&[&tentacle, &other], "runs.jsonl");
    copy(&cvm, &other);
    sums::unlist(&other, &["finished.toml"]).unwrap();
    refused(&[&tentacle, &other], "not finished; continue with: cargo xtask evaluate --resume");
}

/// Of networks whose seeds nobody knows, too: in one evaluation, in shards, and in evaluations that are merged.
#[test]
fn trainings_of_a_method_are_judged_together_wherever_they_drove() {
    let folder = scratch("method");
    let out = |name: &str| folder.join(name).to_string_lossy().into_owned();
    let networks = [1, 2, 3].map(|seed| {
        let run = out(&format!("seed-{seed}"));
        succeed(xtask().args([
            "train-bc",
            "--preset",
            "smoke",
            "--no-eval",
            "--seed",
            &seed.to_string(),
            "--out",
            &run,
        ]));
        format!("net:{run}/round-00")
    });
    let method = format!("mine=net:{}/round-*", out("*"));
    let evaluate = |drivers: &[&str], words: &[&str], name: &str| {
        let lots = ["--preset", "smoke", "--lots", "test:8:easy", "--trials", "1", "--directions", "forward"];
        succeed(xtask().args(["evaluate", "--driver"]).args(drivers).args(lots).args(words).args(["--out", &out(name)]))
    };
    let all: Vec<&str> = networks.iter().map(String::as_str).chain(["vvf"]).collect();
    let printed = evaluate(&all, &["--method", &method], "run");
    assert!(printed.contains("Several trainings, as one"), "{printed}");
    let whole = files(&folder.join("run"));
    let rows = String::from_utf8(whole["trainings.csv"].clone()).unwrap();
    assert_eq!(rows.lines().filter(|row| row.starts_with("mine,3,")).count(), rows.lines().count() / 2, "{rows}");
    // As it is when a process dies before its tables are written.
    std::fs::remove_file(folder.join("run/trainings.csv")).unwrap();
    sums::unlist(&folder.join("run"), &["finished.toml", "trainings.csv"]).unwrap();
    succeed(xtask().args(["evaluate", "--resume", &out("run")]));
    assert!(files(&folder.join("run")) == whole, "resumed");
    let merged = |folders: [&str; 2], words: &[&str]| {
        std::fs::remove_dir_all(folder.join("run")).unwrap();
        let printed = succeed(xtask().arg("merge").args(folders.map(out)).args(words).args(["--out", &out("run")]));
        (printed, files(&folder.join("run")))
    };
    for shard in ["1", "2"] {
        evaluate(&all, &["--method", &method, "--shard", &format!("{shard}/2")], shard);
    }
    assert!(merged(["1", "2"], &[]) == (printed.clone(), whole.clone()), "shards");
    // A machine whose products round twice drove networks otherwise, and its shard was merged.
    let rounding_otherwise = |name: &str| {
        let run = folder.join(format!("{name}-rounds-otherwise"));
        copy(&folder.join(name), &run);
        forge(&run, "manifest.toml", |text| {
            if text.contains("\"fma\"") {
                text.replacen("\"fma\"", "\"none\"", 1)
            } else {
                text.replacen("processor_features = [", "processor_features = [\"avx2\", \"fma\", ", 1)
            }
        });
        run
    };
    refused(&[&folder.join("1"), &rounding_otherwise("2")], "use of AVX2 and FMA");
    // The report replays what networks did, on the machine that merges.
    refused(&[&rounding_otherwise("1"), &rounding_otherwise("2")], "merge on such a machine");
    evaluate(&all[..2], &[], "two");
    evaluate(&all[2..], &[], "others");
    assert!(merged(["two", "others"], &["--method", &method]) == (printed.clone(), whole.clone()), "evaluations");
    // So was its evaluation with those of other networks.
    refused(&[&folder.join("two"), &rounding_otherwise("others")], "use of AVX2 and FMA");
    evaluate(&all[..3], &["--method", &method], "three");
    evaluate(&all[3..], &[], "vvf");
    assert!(merged(["three", "vvf"], &[]) == (printed, whole), "what was named before holds");
    // A planner drives alike on both, and what comes out is of the machine of the networks, whoever is named first.
    let planner = rounding_otherwise("vvf");
    let mixed = folder.join("mixed");
    succeed(xtask().arg("merge").arg(&planner).arg(folder.join("three")).arg("--out").arg(&mixed));
    let features = |run: &Path| {
        let manifest = std::fs::read_to_string(run.join("manifest.toml")).unwrap();
        let manifest = manifest.parse::<toml::Table>().unwrap();
        manifest.get("processor_features").cloned()
    };
    assert_eq!(features(&mixed), features(&folder.join("three")));
    assert_ne!(features(&mixed), features(&planner));
    let refused = xtask().arg("merge").args(["1", "2"].map(out)).args(["--method", &method]).output().unwrap();
    assert!(text(&refused).1.contains("--method: shards are judged as they were driven"), "{}", text(&refused).1);
    let copy_of_first = out("copy/round-00");
    let twice: Vec<String> = networks[..2].iter().cloned().chain([format!("net:{copy_of_first}")]).collect();
    copy(&folder.join("seed-1"), &folder.join("copy"));
    copy(&folder.join("seed-1/round-00"), Path::new(&copy_of_first));
    let lots = ["--preset", "smoke", "--lots", "test:8:easy", "--method", &method, "--out"];
    let refused = xtask().args(["evaluate", "--driver"]).args(&twice).args(lots).arg(out("twice")).output().unwrap();
    assert!(text(&refused).1.contains("are the same network; leave one out"), "{}", text(&refused).1);
}

#[test]
fn what_was_merged_merges_again_and_is_compared_with_whom_one_likes() {
    let folder = scratch("merged-again");
    let of = |driver: &str, words: &[&str], name: &str| -> PathBuf {
        let out = folder.join(name);
        let lane =
            ["evaluate", "--driver", driver, "--lots", "test:1:easy", "--trials", "1", "--directions", "forward"];
        succeed(xtask().args(lane).args(words).arg("--out").arg(&out));
        out
    };
    let [tentacle, cvm, vvf] = ["tentacle", "cvm", "vvf"].map(|driver| of(driver, &[], driver));
    let merge = |folders: [&Path; 2], with: &str, out: &Path| {
        let with = ["--compare-with", with, "--out"];
        xtask().arg("merge").args(folders).args(with).arg(out).output().unwrap()
    };
    let (two, three) = (folder.join("two"), folder.join("three"));
    assert!(merge([&tentacle, &cvm], "tentacle", &two).status.success());
    let printed = text(&merge([&two, &vvf], "vvf", &three)).0;
    assert!(printed.contains("Compared with vvf") && printed.contains("tentacle"), "{printed}");
    let (_, error) = text(&merge([&tentacle, &cvm], "expert", &folder.join("none")));
    assert!(error.contains("--compare-with expert: is not one of the drivers; name one of tentacle, cvm"), "{error}");

    refused(&[&tentacle, &of("vvf", &["--seed", "2"], "seed")], "another choice of lots, trials, noise or smoothing");
    let other_car = ["--set", "episode.vehicle.dead_time_s=0.5"];
    refused(&[&tentacle, &of("vvf", &other_car, "car")], "another car, sensor or metrics");
    let shard = of("vvf", &["--shard", "1/2"], "shard");
    refused(&[&tentacle, &shard], "a shard among whole evaluations");
    refused(&[&shard, &tentacle], "this is not a shard");
    let other_expert = ["--set", "expert.horizon_m=10"];
    refused(&[&of("expert", &[], "expert"), &of("dwa", &other_expert, "dwa")], "another expert");
    let merged = merge([&tentacle, &of("apf", &other_expert, "apf")], "apf", &folder.join("no-expert"));
    assert!(merged.status.success(), "nobody drives by it: {}", text(&merged).1);

    // Files whose content is not as it was driven.
    let (parameters, lot) = (folder.join("mine.toml"), folder.join("lane.toml"));
    std::fs::copy(root().join("planners/tuned/tentacle.toml"), &parameters).unwrap();
    std::fs::copy(root().join("scenarios/examples/lanes/lane-r10-w5.0.toml"), &lot).unwrap();
    let mine = of(&format!("tentacle:{}", parameters.display()), &[], "mine");
    let lot_name = lot.to_string_lossy().into_owned();
    let [first, second] =
        ["tentacle", "cvm"].map(|driver| of(driver, &["--lots", &lot_name], &format!("{driver}-lane")));
    for (file, from, to, folders) in [
        (&parameters, "speed_mps = 0.", "speed_mps = 0.8", [&mine, &vvf]),
        (&lot, "[17.000, 2.500]", "[17.000, 2.600]", [&first, &second]),
    ] {
        let sound = std::fs::read_to_string(file).unwrap();
        let changed = sound.replacen(from, to, 1);
        assert_ne!(changed, sound, "{}", file.display());
        std::fs::write(file, changed).unwrap();
        refused(&folders.map(PathBuf::as_path), &format!("{}: changed since", file.display()));
        std::fs::write(file, sound).unwrap();
    }

    // Which lots count as trained on, the run says, not whoever is named first.
    let trained = folder.join("trained");
    let small = ["--set", "training.lots=[\"train:1:lane\"]", "--set", "dagger.cloning_budget.steps=20"];
    succeed(xtask().args(["train-bc", "--preset", "smoke", "--no-eval"]).args(small).arg("--out").arg(&trained));
    let run = of(&format!("run:{}", trained.display()), &[], "network");
    let config = trained.join("settings.toml").to_string_lossy().into_owned();
    let planner = of("cvm", &["--config", &config, "--set", "training.lots=[\"lot-a\"]"], "planner");
    let first_named = folder.join("first-named");
    let merged = merge([&planner, &run], "cvm", &first_named);
    assert!(merged.status.success(), "{}", text(&merged).1);
    let settings = |run: &Path| std::fs::read_to_string(run.join("settings.toml")).unwrap();
    assert_ne!(settings(&planner), settings(&run));
    assert_eq!(settings(&first_named), settings(&run));

    // The version is of who drove, not of who merges.
    let old = [&tentacle, &cvm].map(|run| {
        let old = run.with_extension("old");
        copy(run, &old);
        forge(&old, "manifest.toml", |text| text.replacen("program = \"", "program = \"old ", 1));
        old
    });
    let both = folder.join("both-old");
    assert!(merge([&old[0], &old[1]], "cvm", &both).status.success());
    refused(&[&both, &vvf], "another version of lotpilot");
}

/// The text between two marks of docs/cluster.md, with what users fill in filled in, small.
#[cfg(unix)]
fn documented(after: &str, until: &str) -> String {
    let docs = std::fs::read_to_string(root().join("docs/cluster.md")).unwrap();
    let (_, rest) = docs.split_once(after).unwrap_or_else(|| panic!("docs/cluster.md has no {after:?}"));
    let (text, _) = rest.split_once(until).unwrap_or_else(|| panic!("docs/cluster.md has no {until:?}"));
    let mut text = text.to_owned();
    for (users, ours) in
        [("run:runs/NAME", "tentacle"), ("sealed:mine:4800:all --trials 1", "test:2:easy"), ("/16", "/2")]
    {
        assert!(text.contains(users), "{users} is missing in {text}");
        text = text.replace(users, ours);
    }
    text
}

/// Runs a script of bash in a folder where the program and what starts jobs are as on a cluster.
#[cfg(unix)]
fn job(folder: &Path, script: &str, variables: &[(&str, &str)]) {
    let mut bash = Command::new("bash");
    bash.args(["-ec", script]).current_dir(folder).envs(variables.iter().copied());
    let path = std::env::var("PATH").unwrap();
    succeed(bash.env("PATH", format!("{}:{path}", folder.join("bin").display())));
}

#[cfg(unix)]
#[test]
fn the_scripts_for_slurm_and_kubernetes_drive_their_shards_and_go_on() {
    let folder = scratch("cluster");
    std::fs::create_dir_all(folder.join("target/debug")).unwrap();
    std::fs::create_dir_all(folder.join("bin")).unwrap();
    std::os::unix::fs::symlink(xtask().get_program(), folder.join("target/debug/xtask")).unwrap();
    std::fs::write(folder.join("bin/srun"), "#!/bin/sh\nshift\nexec \"$@\"\n").unwrap();
    std::fs::set_permissions(folder.join("bin/srun"), std::os::unix::fs::PermissionsExt::from_mode(0o755)).unwrap();

    let slurm = documented("```bash\n", "```");
    let kubernetes = documented("args:\n            - |\n", "          resources:")
        .replace("              ", "")
        .replace("/lotpilot/xtask", "target/debug/xtask");
    let one_machine = ["evaluate", "--driver", "tentacle", "--lots", "test:2:easy"];
    succeed(xtask().args(one_machine).arg("--out").arg(folder.join("one")));
    let one = files(&folder.join("one"));
    for (name, script, variable, from) in
        [("slurm", slurm, "SLURM_ARRAY_TASK_ID", 1), ("kubernetes", kubernetes, "JOB_COMPLETION_INDEX", 0)]
    {
        let shard = |number: u32| {
            job(&folder, &script, &[(variable, &(from + number).to_string()), ("SLURM_CPUS_PER_TASK", "1")]);
        };
        shard(0);
        shard(1);
        // Begun again: a shard that was stopped continues, and one that is done is left alone.
        sums::unlist(&folder.join("shards/1"), &["finished.toml"]).unwrap();
        std::fs::remove_file(folder.join("shards/1/finished.toml")).unwrap();
        shard(0);
        shard(1);
        let merge = ["merge", "shards/1", "shards/2", "--out", name];
        succeed(xtask().args(merge).current_dir(&folder));
        let merged = files(&folder.join(name));
        for table in ["runs.jsonl", "failures.jsonl", "summary.json"] {
            assert!(merged[table] == one[table], "{table} of {name}");
        }
        std::fs::remove_dir_all(folder.join("shards")).unwrap();
    }
}
