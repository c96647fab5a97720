//! Model-based planners on the command line: how they are named, driven and tuned.

use crate::bench::{root, scratch, succeed, text, xtask};
use experiment::drivers::DriverSpec;
use experiment::settings::Settings;
use std::path::Path;

/// Exit code 2, one error that mentions all of these, nothing written.
fn refuses(driver: &str, out: &Path, expected: &[&str]) {
    let output = xtask().args(["evaluate", "--lots", "lot-b", "--driver", driver, "--out"]).arg(out).output().unwrap();
    let (_, stderr) = text(&output);
    assert_eq!(output.status.code(), Some(2), "{driver}: {stderr}");
    for part in expected {
        assert!(stderr.contains(part), "{driver} should mention {part:?}, but says:\n{stderr}");
    }
    assert!(!out.exists(), "nothing is written for {driver}");
}

#[test]
fn parameters_come_from_a_file_or_are_refused() {
    let folder = scratch("planner-files");
    let out = folder.join("out");
    let listed = succeed(xtask().arg("drivers"));
    assert!(listed.lines().any(|line| line.starts_with("tuned:NAME")), "{listed}");
    for name in ["tentacle", "vvf", "dwa", "dwa/fox", "cvm", "cvm/simmons", "apf", "vff", "mppi"] {
        assert!(listed.lines().any(|line| line.starts_with(name)), "{name} is not listed:\n{listed}");
    }
    let complete = succeed(xtask().args(["drivers", "vvf"]));
    let path = folder.join("vvf.toml");
    let driver = format!("vvf:{}", path.display());
    let refuses_text = |changed: String, expected: &[&str]| {
        std::fs::write(&path, changed).unwrap();
        refuses(&driver, &out, expected);
    };
    refuses_text(complete.replace("mask", "maks"), &["vvf.toml", "maks"]);
    refuses_text(complete.lines().filter(|line| !line.starts_with("mask")).collect::<Vec<_>>().join("\n"), &["mask"]);
    refuses_text(complete.replace("mask = 0.5", "mask = 7.0"), &["vvf.toml", "mask = 7", "0 to 1"]);
    refuses_text(complete.replace("planner = \"vvf\"", "planner = \"apf\""), &["vvf.toml", "apf"]);
    refuses("vvf:no-such.toml", &out, &["no-such.toml", "cargo xtask drivers vvf"]);
    // Unchanged parameters drive like the planner itself; a driver is its name.
    std::fs::write(&path, complete).unwrap();
    let drive = ["evaluate", "--lots", "lot-b", "--trials", "1", "--directions", "forward", "--driver", "vvf", &driver];
    succeed(xtask().args(drive).arg("--out").arg(&out));
    let lines = std::fs::read_to_string(out.join("runs.jsonl")).unwrap();
    let runs: Vec<serde_json::Value> = lines.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(runs.len(), 2);
    assert_ne!(runs[0]["driver"], runs[1]["driver"]);
    assert_eq!(runs[0]["metrics"], runs[1]["metrics"]);
}

/// What ships as `tuned:NAME` was found on lot a and training lots only, with the same budget for every planner, and is no
/// worse there than the planner it started from.
#[test]
fn tuned_planners_ship_with_what_found_them() {
    let listed = succeed(xtask().arg("drivers"));
    assert!(listed.lines().any(|line| line.starts_with("tuned:NAME")), "{listed}");
    let mut budgets = Vec::new();
    for name in ["tentacle", "vvf", "dwa", "cvm", "apf", "vff", "mppi"] {
        let spec = format!("tuned:{name}");
        assert!(listed.lines().any(|line| line.starts_with(name)), "{name} is not listed:\n{listed}");
        let file: toml::Table = succeed(xtask().args(["drivers", &spec])).parse().unwrap();
        assert_eq!(file["planner"].as_str(), Some(name));
        let search = &file["search"];
        let failures = |when: &str| search[when]["failures_per_100m"].as_float().unwrap();
        assert!(failures("after") <= failures("before"), "{spec}");
        let lots: Vec<&str> = search["lots"].as_array().unwrap().iter().map(|lot| lot.as_str().unwrap()).collect();
        assert!(lots.iter().all(|lot| *lot == "lot-a" || lot.starts_with("train:")), "{spec}: {lots:?}");
        let candidates =
            (search["candidates"].as_integer(), search["trials"].as_integer(), search["seed"].as_integer());
        budgets.push((candidates, lots.len(), search["before"]["reference_m"].as_float()));
    }
    assert!(budgets.iter().all(|(candidates, ..)| *candidates == budgets[0].0), "{budgets:?}");
    assert!(budgets.windows(2).all(|two| two[0] == two[1]), "every planner drives as much: {budgets:?}");
    for tuning in ["corridors", "earlier"] {
        for file in std::fs::read_dir(root().join("planners/tuned").join(tuning)).unwrap() {
            let path = file.unwrap().path();
            let spec = format!("{}:{}", path.file_stem().unwrap().display(), path.display());
            spec.parse::<DriverSpec>().unwrap().load(&Settings::preset("default").unwrap()).unwrap();
        }
    }
    let out = scratch("tuned").join("out");
    let drive = ["evaluate", "--lots", "lot-a", "--trials", "1", "--directions", "forward", "--noise", "clean"];
    succeed(xtask().args(drive).args(["--driver", "tuned:tentacle", "--out"]).arg(out));
}

/// Tuning writes parameters that drive, is no worse than where it started, and is the same for 1 and 2 threads.
#[test]
fn tuning_is_repeatable_and_writes_what_can_be_driven() {
    let folder = scratch("tune");
    let tune = |threads: &str| {
        let out = folder.join(threads);
        let settings = ["tune", "--planner", "cvm", "--budget", "3", "--lots", "train:1"];
        let output = xtask().args(["--threads", threads]).args(settings).arg("--out").arg(&out).output().unwrap();
        let (said, file) = (text(&output).1, out.join("cvm.toml"));
        assert!(said.contains(&format!("drive one with --driver cvm:{}", file.display())), "{said}");
        std::fs::read_to_string(file).unwrap()
    };
    let written = tune("1");
    assert_eq!(written, tune("2"));
    let file: toml::Table = written.parse().unwrap();
    assert_eq!(file["search"]["candidates"].as_integer(), Some(3));
    let failures = |when: &str| file["search"][when]["failures_per_100m"].as_float().unwrap();
    assert!(failures("after") <= failures("before"));
    let driver = format!("cvm:{}", folder.join("1/cvm.toml").display());
    let drive = ["evaluate", "--lots", "lot-b", "--trials", "1", "--directions", "forward", "--driver", &driver];
    succeed(xtask().args(drive).arg("--out").arg(folder.join("driven")));
    let refused = xtask().args(["tune", "--lots", "lot-b", "--out"]).arg(folder.join("unseen")).output().unwrap();
    assert_eq!(refused.status.code(), Some(2));
    assert!(text(&refused).1.contains("stay unseen"));
    assert!(!folder.join("unseen").exists());
}
