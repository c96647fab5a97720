//! What people read: every `--help`, and the tables that commands print. The texts are in `snapshots/`; after a change that
//! is meant, `INSTA_UPDATE=always cargo test -p tests printed` writes them again, and `git diff` shows what changed.

use crate::bench::{scratch, succeed, xtask};

/// Width of a printed table; help may be wider, as examples are.
const COLUMNS: usize = 100;

fn printed(arguments: &[&str]) -> String {
    succeed(xtask().args(arguments))
}

#[test]
fn every_help_has_examples_and_ends_with_what_holds_everywhere() {
    insta::assert_snapshot!("help", printed(&["--help"]));
    for command in [
        "train-bc",
        "train-dagger",
        "evaluate",
        "merge",
        "reproduce",
        "rules",
        "scaling",
        "deviations",
        "guard",
        "generate",
        "export",
        "pixel-accuracy",
        "sample-size",
        "bench",
        "settings",
        "lots",
        "drivers",
        "tune",
        "torture",
        "replay",
        "verify",
        "what-if",
        "render",
        "visualise",
        "completions",
    ] {
        let help = printed(&[command, "--help"]);
        assert!(help.contains("cargo xtask ") && help.contains("Examples:") || command == "completions", "{command}");
        let (threads, quiet) = (help.find("--threads").unwrap(), help.find("--quiet").unwrap());
        assert!(quiet < threads && help.rfind("--").unwrap() >= threads, "{command}: --threads is the last flag");
        insta::assert_snapshot!(format!("help-{command}"), help);
    }
    for what in ["lot", "trajectories", "contact-sheet", "samples", "noise", "report", "results", "animation"] {
        let help = printed(&["render", what, "--help"]);
        assert!(help.contains(&format!("cargo xtask render {what} ")), "render {what} has no example");
        insta::assert_snapshot!(format!("help-render-{what}"), help);
    }
    for what in ["lot", "episode", "replay", "run", "failures"] {
        let help = printed(&["visualise", what, "--help"]);
        assert!(help.contains(&format!("cargo xtask visualise {what} ")), "visualise {what} has no example");
    }
}

#[test]
fn lists_and_explanations_are_readable() {
    insta::assert_snapshot!("lots", printed(&["lots"]));
    insta::assert_snapshot!("drivers", printed(&["drivers"]));
    insta::assert_snapshot!("settings", printed(&["settings"]));
    insta::assert_snapshot!("explain", printed(&["settings", "--explain", "dagger.fit.learning_rate.peak"]));
    insta::assert_snapshot!("sample-size", printed(&["sample-size", "--below", "0.1", "--between", "1.4,0.5"]));
}

#[test]
fn tables_fit_the_terminal() {
    let out = scratch("printed").join("out").to_string_lossy().into_owned();
    let drivers = ["--driver", "expert", "--driver", "tentacle", "--driver", "vvf"];
    let trials = ["--lots", "lot-b", "--trials", "1", "--directions", "forward", "--out", &out];
    let tables = printed(&[&["evaluate"], &drivers[..], &trials[..]].concat());
    for line in tables.lines() {
        assert!(line.chars().count() <= COLUMNS, "wider than {COLUMNS} columns: {line}");
    }
    insta::assert_snapshot!("evaluate", tables);
    let pixels = printed(&["pixel-accuracy", "--lots", "lot-b", "--trials", "1"]);
    assert!(pixels.lines().all(|line| line.chars().count() <= COLUMNS), "{pixels}");
    insta::assert_snapshot!("pixel-accuracy", pixels);
}
