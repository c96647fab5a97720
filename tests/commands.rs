//! Whole commands, run from outside: what they leave behind, and how they refuse bad input.

use crate::bench::{refuse, scratch, succeed, text, xtask};
use policy::checkpoint::Checkpoint;
use policy::conditions::Conditions;
use policy::network::{InferenceSettings, NetworkArchitecture, Weights};
use sim::episode::EpisodeSettings;
use sim::seed::RootSeed;
use std::path::Path;
use storage::sums;

/// Bad input: exit code 2, one error that names what is wrong, and nothing written.
fn refuses(arguments: &[&str], expected: &[&str]) {
    let output = xtask().args(arguments).output().unwrap();
    let (stdout, stderr) = text(&output);
    assert_eq!(output.status.code(), Some(2), "{arguments:?} exits with 2:\n{stdout}\n{stderr}");
    for part in expected {
        assert!(stderr.contains(part), "{arguments:?} should mention {part:?}, but says:\n{stderr}");
    }
    assert!(!stderr.contains("panicked"), "{arguments:?} panics:\n{stderr}");
}

#[test]
fn bad_input_gets_one_clear_error() {
    refuses(&["train-dagger", "--preset", "papier"], &["papier", "paper"]);
    refuses(&["train-dagger", "--set", "dagger.etta=0.8"], &["etta", "eta"]);
    refuses(&["train-dagger", "--set", "dagger.eta=high"], &["dagger.eta"]);
    refuses(&["evaluate", "--driver", "nobody"], &["nobody", "expert"]);
    refuses(&["evaluate", "--driver", "expert", "--lots", "lot-q"], &["lot-q", "lot-a"]);
    refuses(&["evaluate", "--driver", "run:no/such/run"], &["no/such/run"]);
    refuses(&["evaluate", "--driver", "expert", "--lots", "no-such-lot.toml"], &["no-such-lot.toml"]);
    refuses(&["train-dagger", "--config", "no-such.toml"], &["no-such.toml"]);
    refuses(&["evaluate", "--driver", "expert", "--noise", "loud"], &["loud", "clean, paper, hard"]);
    refuses(&["evaluate", "--driver", "expert", "--noise", "paper,paper"], &["paper", "twice"]);
    refuses(&["evaluate", "--driver", "expert", "--compare-with", "nobody"], &["nobody", "name one of expert"]);
    refuses(&["evaluate", "--driver", "expert", "--driver", "expert"], &["expert", "twice"]);
    refuses(&["sample-size", "--below", "0"], &["--below 0"]);
    refuses(&["sample-size", "--between", "1,1"], &["equal rates"]);
    refuses(&["sample-size", "--between", "1,2", "--power", "1.5"], &["--power 1.5"]);
}

/// It drove to the edge of the image, or stood still, and the table said nothing of it.
#[test]
fn a_network_that_answers_with_no_number_ends_the_command_with_the_key_to_replay() {
    let folder = scratch("overflowing");
    let mut weights = Weights::init(NetworkArchitecture::compact(), RootSeed(1), 0);
    weights.parts_mut().fc2_weight.iter_mut().for_each(|weight| *weight = 3e38);
    let conditions = Conditions::of(&EpisodeSettings::paper());
    let checkpoint = Checkpoint { weights, conditions, inference: InferenceSettings::plain() };
    let [net, file] = ["net", "policy.onnx"].map(|name| folder.join(name));
    checkpoint.save(&net).unwrap();
    std::fs::write(&file, onnx::export::export(&checkpoint)).unwrap();
    for driver in [format!("net:{}", net.display()), format!("onnx:{}", file.display())] {
        let key = format!("{driver}@lot-b@forward@0@paper@1@0");
        let expected = format!("{key}: the driver's answer is not a finite number");
        let out = folder.join("evaluation").display().to_string();
        let evaluate =
            ["evaluate", "--driver", &driver, "--lots", "lot-b", "--trials", "1", "--overwrite", "--out", &out];
        refuses(&evaluate, &[&expected]);
        refuses(&["replay", &key], &[&expected]);
    }
}

/// Of a run by a function in Python it said that the line was of another evaluation.
#[test]
fn a_run_that_only_python_can_drive_is_refused_as_one_by_replay() {
    let out = scratch("replay-python").join("run");
    let evaluate = ["evaluate", "--driver", "expert", "--lots", "lot-b", "--trials", "1", "--out"];
    succeed(xtask().args(evaluate).arg(&out));
    let runs = std::fs::read_to_string(out.join("runs.jsonl")).unwrap();
    let by_python = runs.replace("\"expert@", "\"python:mine@");
    assert_ne!(by_python, runs);
    sums::write(&out, "runs.jsonl", by_python.as_bytes()).unwrap();
    let said = refuse(xtask().args(["replay", "--of"]).arg(&out));
    assert!(said.contains("a run cannot be driven from here") && said.contains("function in Python"), "{said}");
    assert!(!said.contains("not of this evaluation"), "{said}");
}

/// What the runtime printed of each answer stood before the line of `--json`.
#[test]
fn nothing_but_results_is_printed_where_an_onnx_network_drives() {
    let folder = scratch("onnx-prints");
    let (file, out) = (folder.join("policy.onnx").display().to_string(), folder.join("run"));
    succeed(xtask().args(["export", "onnx", "trained:default", "--out", &file]));
    let driver = format!("onnx:{file}");
    for name in ["RTEN_TIMING", "RTEN_OPTIMIZER_DEBUG", "RTEN_INFER_SHAPES_DEBUG"] {
        let evaluate = ["evaluate", "--driver", &driver, "--lots", "lot-b", "--trials", "1", "--json", "--out"];
        let said = refuse(xtask().args(evaluate).arg(&out).env(name, "1"));
        assert!(said.contains(name) && said.contains("unset it") && !out.exists(), "{said}");
    }
}

#[test]
fn a_refused_evaluation_writes_nothing() {
    let folder = scratch("refused");
    let out = folder.join("out");
    let lot = folder.join("wall.toml");
    let text = "name = \"wall\"\nboundary = [[0.0, 0.0], [40.0, 0.0], [40.0, 6.0], [0.0, 6.0]]\n\n[reference_path]\n\
                points = [[5.0, 3.0], [35.0, 3.0]]\n\n[[obstacle]]\nclass = \"pillar\"\nx_m = 20.0\ny_m = 3.0\n";
    std::fs::write(&lot, text).unwrap();
    let (out_name, lot_name) = (out.to_string_lossy().into_owned(), lot.to_string_lossy().into_owned());
    for (arguments, part) in [
        (vec!["--driver", "nobody"], "nobody"),
        (vec!["--driver", "expert", "--lots", &lot_name], "wall"),
        (vec!["--driver", "expert", "--noise", "-3"], "-3"),
        (vec!["--driver", "expert", "--trials", "0"], "evaluation.trials = 0 is out of range"),
    ] {
        let arguments: Vec<&str> = ["evaluate", "--out", &out_name].into_iter().chain(arguments).collect();
        refuses(&arguments, &[part]);
        assert!(!out.exists(), "{arguments:?} leaves {}", out.display());
    }
}

/// Settings that do not exist or make no sense, and folders that cannot be made, are named with their place, and
/// nothing is left behind.
#[test]
fn settings_and_folders_that_cannot_be_used_leave_nothing() {
    let folder = scratch("bad-settings");
    let (out, config, file) = (folder.join("out"), folder.join("mine.toml"), folder.join("file"));
    std::fs::write(&config, "seed = 2\n\n[episode.metrics]\nnear_colision_m = 0.4\n").unwrap();
    std::fs::write(&file, "no folder").unwrap();
    let name = |path: &Path| path.to_string_lossy().into_owned();
    let (out, config, below_file) = (name(&out), name(&config), name(&file.join("out")));
    for command in [&["evaluate", "--driver", "expert"] as &[&str], &["train-dagger"], &["tune"]] {
        for (arguments, expected) in [
            (
                &["--out", &out, "--config", &config] as &[&str],
                &["mine.toml:4", "near_colision_m", "near_collision_m"] as &[&str],
            ),
            (&["--out", &out, "--set", "nokey"], &["--set nokey", "key and a value"]),
            (
                &["--out", &out, "--set", "episode.metrics.near_collision_m=-1"],
                &["near_collision_m = -1", "more than 0"],
            ),
            (&["--out", &below_file], &["file/out: cannot be created", "--out"]),
        ] {
            refuses(&[command, arguments].concat(), expected);
            assert!(!Path::new(&out).exists(), "{command:?} {arguments:?} leaves {out}");
        }
    }
    refuses(&["tune", "--planner", "nobody", "--out", &out], &["nobody", "tentacle"]);
    refuses(&["tune", "--budget", "0", "--out", &out], &["--budget", "0 is not in 1..=1000000"]);
    refuses(&["evaluate", "--driver", "tuned:nobody", "--out", &out], &["tuned:nobody", "tuned:vvf"]);
    refuses(&["evaluate", "--driver", "expert", "--lots", "test:0", "--out", &out], &["test:0", "1 to 1000000"]);
    refuses(&["drivers", "nobody"], &["nobody", "tentacle"]);
    for twice in ["evaluation", "training"] {
        let setting = format!("{twice}.directions=[\"forward\", \"forward\"]");
        refuses(&["train-bc", "--set", &setting, "--out", &out], &["names forward twice"]);
    }
    // It trained without one, and said nothing.
    let iterations = ["train-bc", "--set", "dagger.iterations_max=2", "--out", &out];
    refuses(&iterations, &["--set dagger.iterations_max=2: train-bc has no iterations"]);
    refuses(&["scaling", "--resume", &out, "--different", "2"], &["--resume", "--different", "cannot be used with"]);
    refuses(&["evaluate", "--resume", &out, "--smoothing", "8"], &["--resume", "--smoothing", "cannot be used with"]);
    let mine = "scenarios/examples/slalom.toml";
    let trained = format!("training.lots=[{mine:?}]");
    for command in ["rules", "deviations", "reproduce"] {
        let arguments = ["--preset", "smoke", "--set", &trained, "--unseen", mine, "--out", &out];
        refuses(&[&[command], &arguments[..]].concat(), &["--unseen", "trained or tuned on it"]);
    }
    let around = ["evaluate", "--driver", "expert", "--lots", mine, "--out", "scenarios", "--overwrite"];
    refuses(&around, &["--out scenarios", "scenarios/examples/slalom.toml", "choose another --out"]);
    let around = ["train-dagger", "--preset", "smoke", "--also", mine, "--out", "scenarios", "--overwrite"];
    refuses(&around, &["--out scenarios", "scenarios/examples/slalom.toml", "choose another --out"]);
    for name in ["RAYON_NUM_THREADS", "RAYON_RS_NUM_CPUS"] {
        let output = xtask().arg("drivers").env(name, "1000000").output().unwrap();
        let (_, stderr) = text(&output);
        assert_eq!(output.status.code(), Some(2), "{name}: {stderr}");
        assert!(stderr.contains(&format!("{name} is more than")), "{stderr}");
        // It was refused where `--threads` decided, too.
        succeed(xtask().args(["--threads", "1", "drivers"]).env(name, "1000000"));
    }
    let key = "expert@lot-b@forward@0@paper@1@9";
    for (flag, value) in [("--trial", "3"), ("--lots", "lot-a"), ("--noise", "clean"), ("--seed", "2")] {
        let both = ["render", "animation", key, flag, value, "--out", &out];
        refuses(&both, &[flag, "cannot be used with"]);
    }
    let long = ["render", "animation", "--driver", "expert", "--lots", "lot-b", "--speed", "0.1", "--fps", "50"];
    refuses(&[&long[..], &["--out", &out]].concat(), &["pictures", "--from and --to", "--speed"]);
    assert!(!Path::new(&out).exists());
}

#[test]
fn sample_sizes_are_calculated() {
    let printed = succeed(xtask().args(["sample-size", "--below", "0.1", "--between", "1,0"]));
    assert!(printed.contains("2996 m") && printed.contains("791 m"), "{printed}");
    refuses(&["train-dagger", "--resume", "no/such/run"], &["no/such/run"]);
}

#[test]
fn a_broken_lot_is_named_with_file_line_and_remedy() {
    let folder = scratch("broken-lot");
    let path = folder.join("lot.toml");
    let text = "name = \"x\"\nboundary = [[0.0, 0.0], [40.0, 0.0], [40.0, 6.0], [0.0, 6.0]]\n\n[reference_path]\n\
                points = [[5.0, 3.0], [60.0, 3.0]]\n";
    std::fs::write(&path, text).unwrap();
    let path = path.to_string_lossy().into_owned();
    refuses(&["evaluate", "--driver", "expert", "--lots", &path], &["lot.toml:5", "reference_path"]);
}

/// A lane of 5 m with a wall across it where one is wanted, one pixel a decimetre: a tenth of what a car needs.
fn small_map(folder: &Path, is_walled: bool) -> String {
    let mut pixels = String::new();
    for row in 0..7 {
        for col in 0..60 {
            let is_occupied = row == 0 || row == 6 || col == 0 || col == 59 || (is_walled && col == 30);
            pixels.push_str(if is_occupied { "0 " } else { "254 " });
        }
        pixels.push('\n');
    }
    std::fs::write(folder.join("lane.pgm"), format!("P2\n60 7\n255\n{pixels}")).unwrap();
    let yaml = folder.join("lane.yaml");
    std::fs::write(&yaml, "image: lane.pgm\nresolution: 0.1\norigin: [0.0, 0.0, 0.0]\nnegate: 0\n").unwrap();
    yaml.to_string_lossy().into_owned()
}

#[test]
fn a_map_is_driven_in_two_commands() {
    let folder = scratch("own-map");
    let (map, lots, results) = (small_map(&folder, false), folder.join("lots"), folder.join("results"));
    let poses = ["--scale", "10", "--start", "0.5,0.35,0", "--goal", "4.0,0.35,0"];
    let line = succeed(xtask().args(["generate", "--lots", &map]).args(poses).arg("--out").arg(&lots));
    assert!(line.contains("lane.toml and .png: route 35."), "{line}");
    let lot = lots.join("lane.toml").to_string_lossy().into_owned();
    succeed(
        xtask()
            .args(["evaluate", "--driver", "expert", "--lots", &lot, "--trials", "1", "--directions", "forward"])
            .arg("--out")
            .arg(&results),
    );
    assert!(results.join("summary.md").is_file());
}

/// A lane of 5 m and a street that leads off it, a pixel a metre, with a route and noise of its own.
fn map_with_a_side_street(folder: &Path) -> String {
    let mut pixels = String::new();
    for y in (0..32).rev() {
        for x in 0..60 {
            let is_lane = (1..59).contains(&x) && (1..6).contains(&y);
            let is_street = (25..30).contains(&x) && (6..31).contains(&y);
            pixels.push_str(if is_lane || is_street { "254 " } else { "0 " });
        }
        pixels.push('\n');
    }
    std::fs::write(folder.join("side.pgm"), format!("P2\n60 32\n255\n{pixels}")).unwrap();
    std::fs::write(folder.join("side.yaml"), "image: side.pgm\nresolution: 1.0\norigin: [0.0, 0.0, 0.0]\n").unwrap();
    let route = "map = 'side.yaml'\nstart = [5.0, 3.5, 0.0]\ngoal = [40.0, 3.5, 0.0]\nnoise = { level = 'hard' }\n";
    std::fs::write(folder.join("side.lot.toml"), route).unwrap();
    folder.join("side.yaml").display().to_string()
}

/// Only `evaluate`, `generate` and trainings said that a route has junctions, and that a lot's own noise is ignored; of a
/// lot that `generate` wrote of a map nobody said the first.
#[test]
fn junctions_and_noise_that_is_ignored_are_said_before_anything_is_driven() {
    let folder = scratch("notes");
    let map = map_with_a_side_street(&folder);
    let place = |name: &str| folder.join(name).display().to_string();
    let said = |arguments: &[&str]| {
        let output = xtask().args(arguments).output().unwrap();
        let (stdout, stderr) = text(&output);
        assert!(output.status.success(), "{arguments:?} failed:\n{stdout}\n{stderr}");
        stderr
    };
    let junction = "side: the route has 1 junction, near (2";
    let noise = "side: the lot asks for noise hard, but is driven with paper";
    let (lots, out, written) = (place("lots"), place("out"), place("lots/side.toml"));
    let generated = said(&["generate", "--lots", &map, "--out", &lots]);
    assert!(generated.contains(junction) && generated.contains("--close-branches"), "{generated}");
    assert!(!generated.contains("noise"), "the lot keeps its noise: {generated}");
    assert!(generated.contains("generating: 1 lot ("), "{generated}");
    let once = ["--trials", "1", "--directions", "forward", "--out", &out];
    for arguments in [
        &[&["evaluate", "--driver", "expert", "--lots", &map], &once[..]].concat()[..],
        &["pixel-accuracy", "--lots", &written, "--trials", "1"],
        &["render", "noise", "--lots", &written, "--noise", "paper", "--at", "10", "--out", &lots],
        &["render", "trajectories", "--driver", "expert", "--lots", &written, "--out", &lots],
    ] {
        let said = said(arguments);
        assert!(said.contains(junction) && said.contains(noise), "{arguments:?}: {said}");
    }
    // Refused after the notes, because the map lies there.
    let here = folder.display().to_string();
    let around = ["--preset", "smoke", "--unseen", &map, "--overwrite", "--out", &here];
    for command in ["reproduce", "rules", "deviations"] {
        refuses(&[&[command], &around[..]].concat(), &[junction, noise, "choose another --out"]);
    }
}

#[test]
fn a_map_that_cannot_be_driven_is_refused_and_leaves_nothing() {
    let folder = scratch("bad-map");
    let map = small_map(&folder, true);
    let out = folder.join("lots").to_string_lossy().into_owned();
    let generate = |arguments: &[&str], expected: &[&str]| {
        let command = [&["generate", "--out", &out, "--lots"], arguments].concat();
        refuses(&command, expected);
        assert!(!Path::new(&out).exists(), "{arguments:?} leaves {out}");
    };
    let poses = ["--start", "0.5,0.35,0", "--goal", "4.5,0.35,0"];
    generate(&[&map], &["lane.yaml", "where to drive", "--start"]);
    generate(
        &[&[map.as_str(), "--scale", "10"], &poses[..]].concat(),
        &["lane.yaml: route", "a wall is in the way near"],
    );
    generate(&[&[map.as_str(), "--scale", "0"], &poses[..]].concat(), &["scale: it is 0"]);
    generate(&[&[map.as_str()], &poses[..]].concat(), &["start", "does not stand free", "scale"]);
    generate(&[&map, "--start", "1,2", "--loop"], &["--start", "x,y,degrees"]);
    generate(&["lot-a", "--scale", "10"], &["lot-a", ".yaml"]);
    let yaml = std::fs::read_to_string(&map).unwrap();
    for (from, to, expected) in [
        ("resolution: 0.1", "resolution: 0", "lane.yaml:2: resolution"),
        ("lane.pgm", "none.pgm", "none.pgm: cannot be read"),
        ("image", "]", "lane.yaml:1"),
    ] {
        std::fs::write(&map, yaml.replacen(from, to, 1)).unwrap();
        generate(&[&[map.as_str()], &poses[..]].concat(), &[expected]);
    }
    refuses(&["evaluate", "--driver", "expert", "--lots", "no-such.yaml"], &["no-such.yaml: cannot be read"]);
}

#[test]
fn a_checkpoint_that_was_edited_is_refused() {
    let folder = scratch("architecture");
    let run = folder.join("run");
    succeed(xtask().args(["train-bc", "--preset", "smoke", "--no-eval", "--out"]).arg(&run));
    let model = run.join("round-00/model.toml");
    let changed = std::fs::read_to_string(&model).unwrap().replacen("hidden = 64", "hidden = 128", 1);
    std::fs::write(&model, changed).unwrap();
    let net = format!("net:{}", run.join("round-00").display());
    let out = folder.join("out").to_string_lossy().into_owned();
    refuses(
        &["evaluate", "--driver", &net, "--lots", "lot-b", "--out", &out],
        &["model.toml", "SHA-256", "sha256sums"],
    );
    assert!(!Path::new(&out).exists(), "nothing is written");
}

#[test]
fn a_run_can_be_evaluated_later_and_generated_lots_can_be_driven() {
    let folder = scratch("later");
    let (run, lots, results) = (folder.join("run"), folder.join("lots"), folder.join("results"));
    succeed(xtask().args(["train-bc", "--preset", "smoke", "--no-eval", "--out"]).arg(&run));
    let error = refuse(xtask().args(["replay", "--of"]).arg(&run));
    assert!(error.contains("holds no finished evaluation"), "{error}");
    let error = refuse(xtask().args(["render", "samples", "--count", "300"]).arg(run.join("round-00")));
    assert!(error.contains("room for 1 to 256 samples"), "{error}");
    succeed(xtask().args(["generate", "--lots", "train:1", "--out"]).arg(&lots));
    let mut written: Vec<_> = std::fs::read_dir(&lots).unwrap().map(|entry| entry.unwrap().path()).collect();
    written.sort();
    let ending = |suffix: &str| written.iter().find(|path| path.to_string_lossy().ends_with(suffix)).unwrap().clone();
    assert!(std::fs::read(ending(".png")).unwrap().starts_with(b"\x89PNG"));
    let lot = ending(".toml").to_string_lossy().into_owned();
    let driver = format!("run:{}", run.display());
    succeed(
        xtask()
            .args(["evaluate", "--driver", "expert", "--driver", &driver, "--trials", "1", "--directions", "forward"])
            .args(["--lots", &lot, "--out"])
            .arg(&results),
    );
    let read = |name: &str| std::fs::read_to_string(results.join(name)).unwrap();
    // The run's own settings are used: its car, sensor and metrics, not those of a preset.
    assert!(read("settings.toml").contains("trials = 1"), "{}", read("settings.toml"));
    let of = |folder: &std::path::Path| -> toml::Table {
        std::fs::read_to_string(folder.join("settings.toml")).unwrap().parse().unwrap()
    };
    assert_eq!(of(&results)["dagger"], of(&run)["dagger"]);
    let lines = read("runs.jsonl");
    assert_eq!(lines.lines().count(), 2, "one line per driven run:\n{lines}");
    let mut near_collisions = 0;
    for line in lines.lines() {
        let run: serde_json::Value = serde_json::from_str(line).unwrap();
        for key in [
            "driver",
            "lot",
            "direction",
            "trial",
            "noise",
            "replay",
            "sha256",
            "timed_out",
            "mean_speed_mps",
            "ending",
        ] {
            assert!(!run[key].is_null(), "{key} is missing in {line}");
        }
        for key in ["near_collisions", "contacts", "stuck", "driven_m", "reference_m", "safe_ratio", "clearance_min_m"]
        {
            assert!(run["metrics"][key].is_number(), "{key} is missing in {line}");
        }
        near_collisions += run["metrics"]["near_collisions"].as_u64().unwrap();
    }
    assert_eq!(read("failures.jsonl").lines().count() as u64, near_collisions);
    assert_eq!(read("wall_time.jsonl").lines().count(), 2);
    runs_are_replayed(&results);
    is_a_report(&read("report.html"), &["Near-collisions, noise paper", "Safe ratio on ", "Configuration"]);
    let html = std::fs::read_to_string(run.join("report.html")).unwrap();
    is_a_report(&html, &["Validation error of the look-ahead point", "predicted σ", "Configuration"]);
    assert!(run.join("round-00/learning.csv").is_file());
}

/// Whoever had not trained for a quarter of an hour had no network to drive with.
#[test]
fn the_network_that_ships_drives_at_once() {
    let out = scratch("ships").join("run");
    let driver = ["evaluate", "--driver", "trained:default"];
    let lots = ["--lots", "lot-a", "lot-b", "lot-c", "--trials", "1"];
    let error = refuse(xtask().args(driver).args(["--preset", "paper"]));
    assert!(error.contains("speed_law = \"full\"") && error.contains("(--preset default)"), "{error}");
    succeed(xtask().args(driver).args(lots).arg("--out").arg(&out));
    let lines = std::fs::read_to_string(out.join("runs.jsonl")).unwrap();
    let runs: Vec<serde_json::Value> = lines.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let sum = |key: &str| runs.iter().map(|run| run["metrics"][key].as_f64().unwrap()).sum::<f64>();
    assert_eq!(runs.len(), 6, "three lots, both ways");
    // Of the five trainings in docs/elsewhere.md each has 4 to 15 in ten times as many trials.
    assert!(sum("reference_m") > 1000.0 && sum("near_collisions") < 6.0, "{lines}");
}

/// It was called no run, though it drives as any other network.
#[test]
fn the_network_that_ships_is_exported_by_its_name() {
    let folder = scratch("exported");
    let [by_name, by_folder] = ["name.onnx", "folder.onnx"].map(|name| folder.join(name).display().to_string());
    succeed(xtask().args(["export", "onnx", "trained:default", "--out", &by_name]));
    succeed(xtask().args(["export", "onnx", "policy/trained/default", "--out", &by_folder]));
    assert!(std::fs::read(&by_name).unwrap() == std::fs::read(&by_folder).unwrap(), "it is the same network");
    refuses(&["export", "onnx", "trained:Default", "--out", &by_name], &["did you mean trained:default?"]);
}

/// The page that a newcomer reads first had the three lots alone.
#[test]
fn the_report_of_a_training_shows_its_check_on_other_lots() {
    let run = scratch("report-of-other-lots").join("run");
    succeed(xtask().args(["train-bc", "--preset", "smoke", "--out"]).arg(&run));
    let read = |name: &str| std::fs::read_to_string(run.join(name)).unwrap();
    let (table, markdown, html) = (read("elsewhere.md"), read("report.md"), read("report.html"));
    assert!(markdown.contains("\n## Other lots\n\nThe same drivers on validation:1:lane, "), "{markdown}");
    assert!(markdown.contains(table.trim_end()), "{markdown}");
    is_a_report(&html, &[">Other lots</h2>", ">validation-lane"]);
    succeed(xtask().args(["render", "report"]).arg(&run));
    assert!(read("report.html") == html, "and when it is written again");
    std::fs::write(run.join("elsewhere.md"), table.replacen('0', "1", 1)).unwrap();
    let error = refuse(xtask().args(["render", "report"]).arg(&run));
    assert!(error.contains("elsewhere.md"), "{error}");
}

/// 29 maps and four drivers filled 3000 lines of a terminal.
#[test]
fn of_many_lots_a_terminal_shows_those_of_all_and_the_file_has_each() {
    let out = scratch("many-lots").join("run");
    let lots = ["test:12:all", "validation:12:all"];
    let once = ["--trials", "1", "--directions", "forward"];
    let printed = succeed(
        xtask().args(["evaluate", "--driver", "tentacle", "--lots"]).args(lots).args(once).arg("--out").arg(&out),
    );
    assert!(printed.contains("| all ") && !printed.contains("test-rooms"), "{printed}");
    assert!(printed.contains("The rows of the 24 lots or kinds of lots are in"), "{printed}");
    let summary = std::fs::read_to_string(out.join("summary.md")).unwrap();
    assert!(summary.contains("test-rooms") && summary.contains("validation-lane") && summary.contains("| all "));
}

/// Every run of an evaluation gives the same bits when it is driven alone, and a difference is reported.
fn runs_are_replayed(results: &Path) {
    let replay = ["replay", "--json", "--of", results.to_str().unwrap()];
    let rows = |printed: &str| serde_json::from_str::<Vec<serde_json::Value>>(printed).unwrap();
    let all = rows(&succeed(xtask().args(replay)));
    assert!(all.len() == 2 && all.iter().all(|row| row["same"] == true), "{all:?}");
    let key = all[1]["key"].as_str().unwrap();
    let one =
        rows(&succeed(xtask().args(["replay", "--json", "--config"]).arg(results.join("settings.toml")).arg(key)));
    assert!(one[0]["same"].is_null() && one[0]["sha256"] == all[1]["sha256"], "{one:?}");
    let (runs, digest) = (results.join("runs.jsonl"), all[1]["sha256"].as_str().unwrap());
    let recorded = std::fs::read_to_string(&runs).unwrap();
    sums::write(results, "runs.jsonl", recorded.replace(digest, &"0".repeat(64)).as_bytes()).unwrap();
    let output = xtask().args(replay).output().unwrap();
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{stderr}");
    assert!(stderr.contains(key) && stderr.contains("1 of 2 runs are not what was recorded"), "{stderr}");
    assert_eq!(rows(&String::from_utf8_lossy(&output.stdout))[1]["same"], false);
    sums::write(results, "runs.jsonl", recorded.as_bytes()).unwrap();
}

/// The near-collisions of a planner are tried again with each substitution, and a run that differs from the recorded
/// one is refused.
#[test]
fn what_would_have_avoided_near_collisions_is_counted_by_lot() {
    let folder = scratch("what-if");
    let run = folder.join("run");
    let evaluate =
        ["evaluate", "--driver", "tentacle", "--driver", "expert", "--lots", "lot-b", "test:2:lane", "--trials", "1"];
    succeed(xtask().args(evaluate).arg("--out").arg(&run));
    let failures = std::fs::read_to_string(run.join("failures.jsonl")).unwrap();
    let on_lot_b = failures.lines().filter(|line| line.contains("\"lot\":\"lot-b\"")).count();
    assert!(on_lot_b > 0 && !failures.contains("\"driver\":\"expert\""), "{failures}");

    let printed = succeed(xtask().args(["what-if", "--json"]).arg(&run));
    let rows = serde_json::from_str::<Vec<serde_json::Value>>(&printed).unwrap();
    let of_lot_b: Vec<_> = rows.iter().filter(|row| row["group"] == "lot-b").collect();
    assert!(of_lot_b.iter().all(|row| row["near_collisions"] == on_lot_b), "{rows:?}");
    let passed =
        |replaced: &str| of_lot_b.iter().find(|row| row["replaced"] == replaced).unwrap()["passed"].as_u64().unwrap();
    assert!(passed("expert, 6 s") > passed("nothing"), "the expert gets by where the planner does not: {rows:?}");

    let lots = folder.join("lots");
    succeed(xtask().args(["generate", "--lots", "lot-b", "--out"]).arg(&lots));
    let (lot, of_file) = (lots.join("lot-b-s1.toml"), folder.join("of-file"));
    succeed(
        xtask()
            .args(["evaluate", "--driver", "tentacle", "--trials", "1", "--lots"])
            .arg(&lot)
            .arg("--out")
            .arg(&of_file),
    );
    // Other obstacles under the same name.
    succeed(xtask().args(["generate", "--lots", "lot-b", "--seed", "2", "--out"]).arg(&lots));
    std::fs::copy(lots.join("lot-b-s2.toml"), &lot).unwrap();
    let error = refuse(xtask().arg("what-if").arg(&of_file));
    assert!(error.contains("lot-b-s1.toml: changed since this run was begun"), "{error}");

    let error = refuse(xtask().args(["what-if", "--driver", "expert", "--"]).arg(&run));
    assert!(error.contains("no near-collision of a driver \"expert\""), "{error}");
    let without = folder.join("without");
    succeed(
        xtask().args(["evaluate", "--driver", "expert", "--lots", "lot-c", "--trials", "1", "--out"]).arg(&without),
    );
    assert_eq!(succeed(xtask().args(["what-if", "--json"]).arg(&without)).trim(), "[]");
    assert_eq!(succeed(xtask().arg("what-if").arg(&without)).trim(), "no near-collisions");
    let error = refuse(xtask().arg("what-if").arg(folder.join("none")));
    assert!(error.contains("this is not a run"), "{error}");
    let moved = failures.replacen("\"tick\":", "\"tick\":1", 1);
    sums::write(&run, "failures.jsonl", moved.as_bytes()).unwrap();
    let error = refuse(xtask().arg("what-if").arg(&run));
    assert!(error.contains("near-collisions were recorded at the ticks"), "{error}");
}

/// One page that says what it should and loads nothing from anywhere.
fn is_a_report(html: &str, parts: &[&str]) {
    for part in parts {
        assert!(html.contains(part), "{part:?} is missing in the report");
    }
    for (found, why) in [("<script ", "foreign scripts"), ("<link", "files"), ("url(", "files"), ("@import", "styles")]
    {
        assert!(!html.contains(found), "the report has no {why}");
    }
    assert!(html.contains("default-src 'none'"), "its policy forbids to load anything");
    let tags = html.split('<').skip(1).filter_map(|tag| tag.split('>').next());
    for tag in tags.filter(|tag| tag.contains("src=") || tag.contains("href=")) {
        assert!(tag.contains("src=\"data:image/png;base64,") || tag.contains("href=\"#"), "{tag}");
    }
}

#[test]
fn pictures_are_drawn_and_never_replaced_unasked() {
    let folder = scratch("render");
    let out = folder.join("pictures").to_string_lossy().into_owned();
    succeed(xtask().args(["render", "lot", "--lots", "lot-b", "--out", &out]));
    succeed(xtask().args(["render", "contact-sheet", "--lots", "test:2:easy", "--out", &out]));
    succeed(xtask().args(["render", "noise", "--lots", "lot-b", "--at", "30", "--out", &out]));
    let line =
        succeed(xtask().args(["render", "trajectories", "--driver", "tentacle", "--lots", "lot-b", "--out", &out]));
    assert!(line.contains("drive-lot-b-forward-trial-0-tentacle.png"), "{line}");
    for name in ["lot-b.png", "lot-b.svg", "contact-sheet.png", "contact-sheet.svg", "noise-lot-b.png"] {
        assert!(Path::new(&out).join(name).is_file(), "{name} is missing");
    }
    let animation = ["render", "animation", "--driver", "expert", "vvf", "--lots", "lot-b", "--to", "4", "--out", &out];
    let line = succeed(xtask().args(animation));
    let gif = Path::new(&out).join("drive-lot-b-forward-trial-0.gif");
    assert!(line.contains("drive-lot-b-forward-trial-0.gif"), "{line}");
    let bytes = std::fs::read(&gif).unwrap();
    assert!(bytes.starts_with(b"GIF89a") && bytes.len() < 3_000_000, "{} bytes", bytes.len());
    let key = "expert@lot-b@forward@0@paper@1@40";
    let keys = ["render", "animation", key, "--to", "3", "--view", "follow", "--format", "apng", "--name", "key"];
    succeed(xtask().args(keys).args(["--out", &out]));
    assert!(std::fs::read(Path::new(&out).join("key.png")).unwrap().windows(4).any(|chunk| chunk == b"acTL"));
    refuses(&animation, &["drive-lot-b-forward-trial-0.gif", "--overwrite"]);
    let other = "expert@lot-b@forward@1@paper@1@40";
    refuses(&["render", "animation", key, other, "--name", "two", "--out", &out], &["another trial"]);
    let late = ["render", "animation", key, "--from", "9", "--to", "8", "--name", "late", "--out", &out];
    refuses(&late, &["nothing to show", "--from"]);
    // The place around its moment was shown without it; the last tick that can be written was a panic in a report.
    let early = ["render", "animation", key, "--to", "1", "--name", "early", "--out", &out];
    refuses(&early, &["--to 1: the moment of expert@lot-b@forward@0@paper@1@40 comes later, at 2.0 s"]);
    let second = "vvf@lot-b@forward@0@paper@1@70";
    let early = ["render", "animation", key, second, "--to", "3", "--name", "early", "--out", &out];
    refuses(&early, &["--to 3: the moment of vvf@lot-b@forward@0@paper@1@70 comes later, at 3.5 s"]);
    let beyond = "expert@lot-b@forward@0@paper@1@4294967295";
    let beyond = ["render", "animation", beyond, "--name", "beyond", "--out", &out];
    refuses(&beyond, &["1@4294967295: this run ends with tick", "name one up to that"]);
    refuses(&["render", "lot", "--lots", "lot-b", "--out", &out], &["lot-b.png", "--overwrite"]);
    refuses(&["render", "noise", "--lots", "lot-b", "--at", "1000", "--out", &out], &["--at 1000", "139"]);
    refuses(&["render", "noise", "--lots", "test:2", "--out", &out], &["test:2", "2 lots"]);
    refuses(&["render", "samples", "no/such/round-01", "--out", &out], &["no/such/round-01", "no such round"]);
    refuses(&["render", "samples", &out, "--out", &out], &["not a round", "round-01"]);
    refuses(&["render", "report", &out], &["this is not a run"]);
    refuses(&["render", "trajectories", "--run", "no/such/run"], &["no/such/run"]);
    refuses(&["visualise", "lot", "--lots", "test:2"], &["stands for 2 lots"]);
    // The second was left out of account without a word.
    refuses(&["visualise", "--out", "lot.rrd", "lot", "--spawn"], &["--out, --spawn, --connect: name one of them"]);
    refuses(&["visualise", "run", &out], &["this is not a run"]);
}

/// It was replaced as if nothing were there.
#[cfg(unix)]
#[test]
fn a_link_that_leads_nowhere_is_not_replaced_unasked() {
    let folder = scratch("leads-nowhere");
    for name in ["lot-b.png", "lot-b-s1.toml", "net.onnx"] {
        std::os::unix::fs::symlink("nowhere", folder.join(name)).unwrap();
    }
    let (out, file) = (folder.display().to_string(), folder.join("net.onnx").display().to_string());
    refuses(&["render", "lot", "--lots", "lot-b", "--out", &out], &["lot-b.png: exists already", "--overwrite"]);
    refuses(&["generate", "--lots", "lot-b", "--out", &out], &["lot-b-s1.toml: exists already", "--overwrite"]);
    refuses(&["export", "onnx", "trained:default", "--out", &file], &["net.onnx: exists already", "--overwrite"]);
}

/// Another seed was advised for lots that are the same with any, and was refused in the same words.
#[test]
fn another_seed_is_advised_only_where_it_draws_another_lot() {
    let folder = scratch("another-seed");
    for name in ["lot-b-s1.toml", "test-easy-0.toml"] {
        std::fs::write(folder.join(name), "").unwrap();
    }
    let out = folder.display().to_string();
    for (lot, advice) in [("lot-b", "choose another --out or --seed, or"), ("test-easy-0", "choose another --out, or")]
    {
        refuses(&["generate", "--lots", lot, "--out", &out], &["exists already", advice]);
    }
}

/// A picture that was too large left the empty folder that it would have been in.
#[test]
fn a_lot_whose_picture_is_refused_leaves_no_folder() {
    let out = scratch("too-large").join("lots");
    let name = out.display().to_string();
    refuses(&["generate", "--lots", "lot-a", "--pixels-per-metre", "1000", "--out", &name], &["pixels are too many"]);
    assert!(!out.exists());
}

/// A picture of a map took the place of the map's image; of two lots named after each other each took the other's.
#[test]
fn nothing_is_written_over_what_it_is_made_of() {
    let folder = scratch("over-another");
    let at = |name: &str| folder.join(name).display().to_string();
    for extension in ["yaml", "png", "lot.toml"] {
        std::fs::copy(format!("../scenarios/examples/maps/alley.{extension}"), at(&format!("alley.{extension}")))
            .unwrap();
    }
    let text = std::fs::read_to_string("../scenarios/examples/slalom.toml").unwrap();
    for (file, name) in [("a.toml", "b"), ("b.toml", "a")] {
        std::fs::write(at(file), text.replace("\"slalom\"", &format!("{name:?}"))).unwrap();
    }
    let image = std::fs::read(at("alley.png")).unwrap();
    let (map, beside, out) = (at("alley.yaml"), at("alley.lot.toml"), folder.display().to_string());
    let [a, b] = ["a.toml", "b.toml"].map(at);
    for command in [
        vec!["render", "lot", "--lots", &map, "--out", &out, "--overwrite"],
        vec!["generate", "--lots", &beside, "--out", &out, "--overwrite"],
        vec!["generate", "--lots", &a, &b, "--out", &out, "--overwrite"],
    ] {
        refuses(&command, &["what the lot is made of", "write into another folder"]);
    }
    assert_eq!(std::fs::read(at("alley.png")).unwrap(), image);
}

/// It was the default of clap, which exits by itself.
#[cfg(target_os = "linux")]
#[test]
fn help_that_nobody_gets_is_no_success() {
    for words in [&["--help"][..], &["evaluate", "--help"], &["--version"]] {
        let full = std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
        let output = xtask().args(words).stdout(full).output().unwrap();
        assert_eq!(output.status.code(), Some(2), "{words:?}: {}", text(&output).1);
    }
}

#[test]
fn a_finished_run_is_not_overwritten() {
    let folder = scratch("overwrite");
    let run = folder.join("run");
    succeed(xtask().args(["train-bc", "--preset", "smoke", "--no-eval", "--out"]).arg(&run));
    let before = std::fs::read(run.join("round-00/labels.npy")).unwrap();
    let run_name = run.to_string_lossy().into_owned();
    refuses(&["train-bc", "--preset", "smoke", "--no-eval", "--seed", "3", "--out", &run_name], &["run"]);
    assert_eq!(std::fs::read(run.join("round-00/labels.npy")).unwrap(), before);
}

/// Keys of earlier versions name the new ones; numbers out of range, e.g. in a wrong unit, name the range.
#[test]
fn old_keys_and_wrong_units_are_refused_with_a_remedy() {
    let folder = scratch("old-keys");
    let out = folder.join("out").to_string_lossy().into_owned();
    for (change, expected) in [
        ("dagger.relooks=2", &["dagger.relooks is dagger.noise_augmentations now"] as &[&str]),
        ("dagger.network.symmetric=true", &["dagger.inference.mirror_averaging"]),
        ("dagger.fit_iteration.batch=64", &["dagger.fit_iteration is dagger.fit now"]),
        ("dagger.fit_cloning.budget.steps=5", &["dagger.cloning_budget"]),
        ("expert.band.reach_share=0.4", &["expert.elastic_band"]),
        ("episode.sensing.smear=true", &["episode.sensing.occlusion"]),
        ("episode.vehicle.steering_ratio=15", &["is gone", "steering_max_rad"]),
        ("episode.vehicle.steering_max_rad=35.5", &["35.5 is out of range", "at most 1.5 rad"]),
        ("episode.vehicle.wheelbase_m=nan", &["NaN is out of range", "at most 20 m"]),
        ("dagger.eta=90", &["dagger.eta = 90 is out of range: 0 to 1 share of ticks"]),
        ("dagger.rule={}", &["an empty table changes nothing"]),
    ] {
        refuses(&["evaluate", "--driver", "expert", "--out", &out, "--set", change], expected);
        assert!(!Path::new(&out).exists(), "{change} leaves {out}");
    }
    refuses(&["settings", "--explain", "dagger.etta"], &["did you mean \"dagger.eta\"?"]);
    refuses(&["settings", "--explain", "dagger.relooks"], &["dagger.noise_augmentations"]);
}

/// Both forms are read again, and say the same settings.
#[test]
fn printed_settings_can_be_given_back() {
    let folder = scratch("settings");
    let plain = |arguments: &[&str]| succeed(xtask().arg("settings").args(arguments));
    let all = plain(&["--preset", "paper", "--all"]);
    for (name, text) in [("all.toml", &all), ("common.toml", &plain(&["--preset", "paper"]))] {
        let file = folder.join(name);
        std::fs::write(&file, text).unwrap();
        let file = file.to_string_lossy().into_owned();
        assert_eq!(plain(&["--preset", "paper", "--all", "--config", &file]), all, "{name}");
    }
    assert!(all.lines().filter(|line| line.contains(" = ")).count() > 100);
}

#[test]
fn a_lot_that_can_only_be_driven_forward_is_refused_with_its_line_and_the_flag() {
    let folder = scratch("forward-only");
    let (out, lot) = (folder.join("out"), folder.join("lot.toml"));
    let text = "name = \"x\"\nboundary = [[0.0, 0.0], [40.0, 0.0], [40.0, 6.0], [0.0, 6.0]]\n\n[reference_path]\n\
                points = [[5.0, 3.0], [39.2, 3.0]]\n";
    std::fs::write(&lot, text).unwrap();
    let (out, lot) = (out.to_string_lossy().into_owned(), lot.to_string_lossy().into_owned());
    refuses(
        &["evaluate", "--driver", "expert", "--lots", &lot, "--out", &out],
        &["lot.toml:5", "in reverse", "--directions forward"],
    );
    let lots = format!("training.lots=[\"{lot}\"]");
    refuses(&["train-bc", "--set", &lots, "--out", &out], &["lot.toml:5", "training.directions='[\"forward\"]'"]);
    // All trainings were done when this was found, and no --resume could continue.
    for command in ["rules", "reproduce"] {
        let expected = &["lot.toml:5", "evaluation.directions='[\"forward\"]'"];
        refuses(&[command, "--unseen", &lot, "--out", &out], expected);
    }
    assert!(!Path::new(&out).exists());
}

/// `| head` closes the pipe: no panic, and what was asked for is on disk.
#[test]
fn a_closed_pipe_loses_no_result() {
    use std::process::Stdio;
    let out = scratch("closed-pipe").join("out");
    let lists: &[&[&str]] = &[&["lots"], &["settings", "--all"], &["evaluate", "--help"]];
    for arguments in lists {
        let mut child = xtask().args(*arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        drop(child.stdout.take());
        let output = child.wait_with_output().unwrap();
        assert!(output.status.success() && output.stderr.is_empty(), "{arguments:?}: {}", text(&output).1);
    }
    let mut child = xtask()
        .args(["evaluate", "--driver", "tentacle", "--lots", "lot-b", "--trials", "1", "--directions", "forward"])
        .arg("--out")
        .arg(&out)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop((child.stdout.take(), child.stderr.take()));
    assert!(child.wait().unwrap().success());
    assert!(out.join("summary.md").is_file() && out.join("finished.toml").is_file());
}

#[test]
fn tables_are_printed_as_json_and_nothing_else_is() {
    let json = |arguments: &[&str]| -> Vec<serde_json::Value> {
        let printed = succeed(xtask().args(arguments).arg("--json"));
        printed.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
    };
    assert_eq!(json(&["lots"])[0][0]["name"], "lot-a");
    assert!(json(&["drivers"])[0].as_array().unwrap().iter().any(|driver| driver["name"] == "vvf"));
    let sizes = &json(&["sample-size", "--below", "0.1"])[0];
    assert_eq!(sizes[0]["metres"].as_f64().unwrap().round(), 2996.0);
    let out = scratch("json").join("run").to_string_lossy().into_owned();
    // Lots of the check elsewhere that are trained on are not passed off as unseen.
    let also = "validation:2:lane";
    let elsewhere = "evaluation.elsewhere=[\"validation:2:lane\"]";
    let tables = json(&["train-bc", "--preset", "smoke", "--also", also, "--set", elsewhere, "--quiet", "--out", &out]);
    assert_eq!(tables.len(), 3, "iterations, evaluation and the check elsewhere");
    assert!(tables[2][0]["lots"] == "validation-lane (2 lots)" && tables[2][0]["trained_on"] == true, "{}", tables[2]);
    assert!(tables[2].as_array().unwrap().iter().all(|row| row["contacts"].is_number()), "{}", tables[2]);
    let elsewhere = std::fs::read_to_string(Path::new(&out).join("elsewhere.md")).unwrap();
    assert!(
        elsewhere.contains("validation-lane (2 lots) (trained on)") && elsewhere.contains("BC per 100 m"),
        "{elsewhere}"
    );
    assert!(tables[0]["rows"][0]["samples"].is_number() && tables[1]["rows"][0]["near_collisions"].is_number());
}

/// It was trained, named as the policy, and behaviour cloning alone was driven.
#[test]
fn a_cloning_with_a_final_training_is_judged_by_that() {
    let out = scratch("bc-final").join("run").to_string_lossy().into_owned();
    let run = ["train-bc", "--preset", "smoke", "--set", "dagger.final_budget.steps=10", "--out", &out];
    let output = xtask().args(run).output().unwrap();
    let (printed, said) = text(&output);
    assert!(output.status.success(), "{said}");
    let summary = std::fs::read_to_string(Path::new(&out).join("summary.md")).unwrap();
    assert!(summary.contains("| BC, final training "), "{summary}");
    assert!(format!("{printed}{said}").contains("(the final training; model.safetensors"), "{printed}{said}");
}

#[test]
fn quiet_commands_say_nothing_and_colours_are_asked_for() {
    let output = xtask().args(["pixel-accuracy", "--lots", "lot-b", "--trials", "1", "-q"]).output().unwrap();
    assert!(output.status.success() && output.stderr.is_empty(), "{}", text(&output).1);
    for (arguments, is_coloured) in [
        (&["--color", "always", "settings", "--explain", "x"] as &[&str], true),
        (&["settings", "--explain", "x", "--color=never"], false),
        (&["settings", "--explain", "x"], false),
        (&["--color", "always", "no-such-command"], true),
        (&["no-such-command"], false),
    ] {
        let output = xtask().args(arguments).output().unwrap();
        assert_eq!(text(&output).1.contains('\x1b'), is_coloured, "{arguments:?}");
    }
    assert_eq!(succeed(xtask().arg("--version")).trim(), concat!("lotpilot ", env!("CARGO_PKG_VERSION")));
    assert!(succeed(xtask().args(["completions", "bash"])).contains("train-dagger"));
}

/// Words that earlier versions used are understood where they mean the same.
#[test]
fn old_flags_still_work() {
    let lines = |arguments: &[&str]| {
        let out = scratch("aliases").join("pictures").to_string_lossy().into_owned();
        succeed(xtask().args(arguments).args(["--out", &out])).lines().count()
    };
    assert_eq!(lines(&["render", "lot", "--lot", "lot-b"]), 2);
    assert_eq!(lines(&["render", "noise", "--lot", "lot-b", "--at", "30", "--level", "hard"]), 1);
    let old = ["--driver", "tentacle", "--lot", "lot-b", "--direction", "reverse"];
    assert_eq!(lines(&[&["render", "trajectories"], &old[..]].concat()), 2);
}

/// Files are looked for before anything is driven, and two drivers do not write the same one.
#[test]
fn drives_are_not_replaced_unasked_and_reports_go_where_they_should() {
    let folder = scratch("drives");
    let out = folder.join("pictures").to_string_lossy().into_owned();
    let draw = |driver: &'static str| ["render", "trajectories", "--driver", driver, "--lots", "lot-b", "--out", &out];
    succeed(xtask().args(draw("tentacle")));
    succeed(xtask().args(draw("vvf")));
    let refused = xtask().args(draw("vvf")).output().unwrap();
    let stderr = text(&refused).1;
    assert!(stderr.contains("--overwrite") && !stderr.contains("near-collisions"), "before it drives: {stderr}");
    let run = folder.join("run").to_string_lossy().into_owned();
    let trials = ["--lots", "lot-b", "--trials", "1", "--directions", "forward"];
    succeed(xtask().args(["evaluate", "--driver", "tentacle", "--out", &run]).args(trials));
    let report = ["render", "report", &run, "--out", &out];
    succeed(xtask().args(report));
    assert!(Path::new(&out).join("report.html").is_file());
    refuses(&report, &["report.html", "--overwrite"]);
}
