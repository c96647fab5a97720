//! The shape of the workspace, checked where prose would rot.

use crate::bench::{cargo, root, succeed};
use crate::import_graph::Crate;
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// Normal dependencies (no dev, no build) of every workspace member.
fn dependencies() -> BTreeMap<String, Vec<String>> {
    let metadata = succeed(cargo().args(["metadata", "--format-version", "1", "--no-deps", "--offline"]));
    let metadata: Value = serde_json::from_str(&metadata).unwrap();
    let text = |value: &Value| value.as_str().unwrap().to_owned();
    let packages = metadata["packages"].as_array().unwrap();
    packages
        .iter()
        .map(|package| {
            let dependencies = package["dependencies"].as_array().unwrap();
            let normal = dependencies.iter().filter(|dependency| dependency["kind"].is_null());
            (text(&package["name"]), normal.map(|dependency| text(&dependency["name"])).collect())
        })
        .collect()
}

/// Each crate with the siblings that it may use: the data flows from left to right, never back.
const LAYERS: [(&str, &[&str]); 14] = [
    ("sim", &[]),
    ("storage", &[]),
    ("scenarios", &["sim", "storage"]),
    ("expert", &["sim"]),
    ("planners", &["sim"]),
    ("policy", &["sim", "storage"]),
    ("onnx", &["sim", "storage", "policy"]),
    ("experiment", &["sim", "storage", "scenarios", "expert", "planners", "policy", "onnx"]),
    ("evaluation", &["sim", "storage", "planners", "policy", "experiment"]),
    ("report", &["sim", "storage", "policy", "experiment", "evaluation"]),
    ("benchmark", &["sim", "storage", "scenarios", "expert", "policy", "experiment", "evaluation"]),
    ("torture", &["storage"]),
    (
        "xtask",
        &[
            "sim",
            "storage",
            "scenarios",
            "planners",
            "policy",
            "onnx",
            "experiment",
            "evaluation",
            "report",
            "benchmark",
            "torture",
        ],
    ),
    ("digests", &["sim", "storage", "scenarios", "expert", "planners"]),
];

/// `cargo test` compiled burn, and all that uses it, a second time: two crates that only tests use asked for one feature more of
/// what burn depends on. `cargo tree -e features -i CRATE` says who asks for what.
#[test]
fn tests_compile_no_library_again() {
    let with_features = |edges: &str| -> BTreeSet<String> {
        let tree = ["tree", "--workspace", "--offline", "--prefix", "none", "--format", "{p} {f}", "--edges", edges];
        let tree = succeed(cargo().args(tree));
        tree.lines().map(|line| line.trim_end_matches(" (*)").to_owned()).collect()
    };
    let of_command = with_features("normal,build");
    assert!(of_command.iter().any(|line| line.starts_with("burn-core v")), "{of_command:?}");
    let twice: Vec<String> = of_command.difference(&with_features("normal,build,dev")).cloned().collect();
    assert_eq!(twice, [""; 0], "tests use these with more features: ask for them in Cargo.toml, too");
}

#[test]
fn dependencies_point_one_way() {
    let dependencies = dependencies();
    let crates = LAYERS.map(|(name, _)| name);
    for (name, allowed) in LAYERS {
        for sibling in dependencies[name].iter().filter(|name| crates.contains(&name.as_str())) {
            assert!(allowed.contains(&sibling.as_str()), "{name} must not know {sibling}");
        }
    }
    for forbidden in ["burn", "rerun", "clap", "image", "toml", "anyhow"] {
        assert!(!dependencies["sim"].contains(&forbidden.to_owned()), "sim must not know {forbidden}");
    }
    for (name, dependencies) in &dependencies {
        for only_in_xtask in ["clap", "clap_complete", "indicatif", "ctrlc", "signal-hook"] {
            let knows = dependencies.contains(&only_in_xtask.to_owned());
            assert!(!knows || name == "xtask", "only xtask may know {only_in_xtask}, {name} does");
        }
        assert!(!dependencies.contains(&"rerun".to_owned()), "nobody who trains waits for rerun, {name} does");
    }
}

/// Libraries report and return; only the command line prints, and the program that compares digests on any platform.
#[test]
fn libraries_do_not_print() {
    for (name, _) in LAYERS.iter().filter(|(name, _)| !["xtask", "digests"].contains(name)) {
        each_source(&root().join(name).join("src"), &mut |path, text| {
            for word in ["println!", "eprintln!", "print!(", "clap::", "std::env::args"] {
                assert!(!text.contains(word), "{} uses {word}", path.display());
            }
        });
    }
}

/// Calls with every source file below a folder; returns how many there were.
pub(crate) fn each_source(folder: &Path, look: &mut dyn FnMut(&Path, &str)) -> usize {
    let mut seen = 0;
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            seen += each_source(&path, look);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            look(&path, &std::fs::read_to_string(&path).unwrap());
            seen += 1;
        }
    }
    seen
}

/// Files that import each other cannot be understood, tested or moved one at a time.
#[test]
fn no_file_imports_in_a_circle() {
    let metadata = succeed(cargo().args(["metadata", "--format-version", "1", "--no-deps", "--offline"]));
    let metadata: Value = serde_json::from_str(&metadata).unwrap();
    let mut files = 0;
    for package in metadata["packages"].as_array().unwrap() {
        let name = package["name"].as_str().unwrap();
        let mut circles = Vec::new();
        for target in package["targets"].as_array().unwrap() {
            let crate_of_target = Crate::read(std::path::Path::new(target["src_path"].as_str().unwrap()));
            files += crate_of_target.len();
            circles.extend(crate_of_target.circle());
        }
        assert!(circles.is_empty(), "{name} imports in a circle:\n{}", circles.join("\n"));
    }
    assert!(files > 100, "only {files} files were looked at");
}

/// `sim` computes; it neither reads nor writes files, nor looks at the clock.
#[test]
fn sim_touches_no_files_and_no_clock() {
    let seen = each_source(&root().join("sim/src"), &mut |path, text| {
        for word in ["std::fs", "std::time", "std::env", "println!", "rand::rng()"] {
            assert!(!text.contains(word), "{} uses {word}", path.display());
        }
    });
    assert!(seen > 15, "only {seen} files were looked at");
}

#[test]
fn licences_are_there() {
    for file in ["LICENSE-MIT", "LICENSE-APACHE", "Cargo.lock", "README.md"] {
        assert!(root().join(file).is_file(), "{file} is missing");
    }
}
