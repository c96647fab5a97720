//! Whole commands, run from outside: what they leave behind, and how they refuse bad input.

use crate::bench::{scratch, succeed, text, xtask};

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

#[test]
fn a_checkpoint_of_another_architecture_is_refused() {
    let folder = scratch("architecture");
    let run = folder.join("run");
    succeed(xtask().args(["train-bc", "--preset", "smoke", "--no-eval", "--out"]).arg(&run));
    let model = run.join("round-00/model.toml");
    let changed = std::fs::read_to_string(&model).unwrap().replacen("hidden = 64", "hidden = 128", 1);
    std::fs::write(&model, changed).unwrap();
    let net = format!("net:{}", run.join("round-00").display());
    refuses(&["evaluate", "--driver", &net, "--lots", "lot-b"], &["model.safetensors", "fc1"]);
}

#[test]
fn a_run_can_be_evaluated_later_and_generated_lots_can_be_driven() {
    let folder = scratch("later");
    let (run, lots, results) = (folder.join("run"), folder.join("lots"), folder.join("results"));
    succeed(xtask().args(["train-bc", "--preset", "smoke", "--no-eval", "--out"]).arg(&run));
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
    let lines = std::fs::read_to_string(results.join("episodes.jsonl")).unwrap();
    assert_eq!(lines.lines().count(), 2, "one line per driven run:\n{lines}");
    for line in lines.lines() {
        let run: serde_json::Value = serde_json::from_str(line).unwrap();
        assert!(run.is_object());
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

#[test]
fn help_has_examples_and_lists_are_printed() {
    for command in ["train-dagger", "train-bc", "evaluate", "generate"] {
        let help = succeed(xtask().args([command, "--help"]));
        assert!(help.contains("Examples:"), "{command} --help has examples");
    }
    assert!(succeed(xtask().arg("lots")).contains("lot-a"));
    assert!(succeed(xtask().arg("drivers")).contains("expert"));
    let settings = succeed(xtask().args(["settings", "--preset", "paper"]));
    assert!(settings.contains("eta = 0.9"), "{settings}");
}
