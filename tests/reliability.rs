//! What docs/reliability.md promises of runs: one owner, nothing lost, no damage unnoticed.

use crate::bench::{refuse, scratch, succeed, text, xtask};
use crate::determinism::files;
use policy::checkpoint::Checkpoint;
use policy::dataset::store::Store;
use policy::fit::{FitReport, learning};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;
use storage::sums;

/// A command under way, killed with the test.
struct Running(Child);

impl Running {
    fn start(arguments: &[&str], out: &Path) -> Self {
        let mut command = xtask();
        command.args(arguments).arg("--out").arg(out).stdout(Stdio::null()).stderr(Stdio::null());
        Self(command.spawn().unwrap())
    }

    /// Waits until a file of the run is there; false if the command ended before.
    fn wait_for(&mut self, file: &Path) -> bool {
        while !file.exists() {
            if self.0.try_wait().unwrap().is_some() {
                return file.exists();
            }
            std::thread::sleep(Duration::from_millis(2));
        }
        true
    }

    fn kill(mut self) {
        self.0.kill().unwrap();
        self.0.wait().unwrap();
    }

    /// Sends a signal, and waits for the exit code: a second, as is promised, and nine more, since machines are busy.
    #[cfg(unix)]
    fn ended_by(&mut self, signal: &str) -> Option<i32> {
        let sent = Command::new("kill").args(["-s", signal, &self.0.id().to_string()]).status().unwrap();
        assert!(sent.success());
        let ended = (0..1000).find_map(|_| {
            std::thread::sleep(Duration::from_millis(10));
            self.0.try_wait().unwrap()
        });
        ended.and_then(|status| status.code())
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn resume(command: &str, run: &Path) {
    succeed(xtask().args([command, "--resume"]).arg(run));
}

/// Kills a training when a file of its run appears, continues it, and compares every file with those of a run that was
/// left alone. Both use the same folder, which replay keys name.
#[test]
fn a_killed_training_goes_on_to_the_same_bytes() {
    let run = scratch("killed-training").join("run");
    let arguments = ["train-dagger", "--preset", "smoke"];
    succeed(xtask().args(arguments).arg("--out").arg(&run));
    let whole = files(&run);
    for file in ["sha256sums", "round-00/sha256sums", "round-01/fit.toml", "summary.json", "figures"] {
        std::fs::remove_dir_all(&run).unwrap();
        let mut running = Running::start(&arguments, &run);
        assert!(running.wait_for(&run.join(file)), "{file} never appears");
        running.kill();
        if file == "round-01/fit.toml" {
            // Its present network would be taken for what the whole training makes.
            let (path, driver) = (run.display().to_string(), format!("run:{}", run.display()));
            let key = format!("{driver}@lot-b@forward@0@paper@1@0");
            let onnx = run.with_extension("onnx").display().to_string();
            for command in [
                &["evaluate", "--lots", "lot-b", "--driver", &driver] as &[&str],
                &["replay", &key],
                &["render", "trajectories", "--driver", &driver],
                &["render", "animation", &key],
                &["visualise", "episode", "--driver", &driver],
                &["visualise", "replay", &key],
                &["export", "onnx", &path, "--out", &onnx],
            ] {
                let refusal = refuse(xtask().args(command));
                assert!(refusal.contains("not finished") && refusal.contains("net:"), "{command:?}: {refusal}");
            }
        }
        if file == "summary.json" {
            // What it had driven stayed, and was listed nowhere.
            let refusal = refuse(xtask().args([arguments[0], "--no-eval", "--resume"]).arg(&run));
            assert!(refusal.contains("drives already; leave it out"), "{refusal}");
        }
        resume(arguments[0], &run);
        let resumed = files(&run);
        assert_eq!(whole.keys().collect::<Vec<_>>(), resumed.keys().collect::<Vec<_>>(), "killed at {file}");
        for (name, bytes) in &whole {
            assert!(*bytes == resumed[name], "{name} differs, killed at {file}");
        }
        let faults = sums::verify(&run).faults;
        assert!(faults.is_empty(), "killed at {file}: {faults:?}");
    }
}

/// At a few operations on files of a few commands; without limits, `cargo xtask torture` strikes each of every command.
#[cfg(target_os = "linux")]
#[test]
fn deaths_full_disks_and_errors_of_the_disk_lose_nothing() {
    let printed =
        succeed(xtask().args(["torture", "--only", "evaluate,merge,tune,generate", "--strikes", "2", "--kills", "1"]));
    assert_eq!(printed.lines().filter(|line| line.ends_with("| 0 |")).count(), 4, "{printed}");
    // Three of four operations for two of the faults, and of more for the third.
    let of_three = ["torture", "--only", "export", "--strikes", "3", "--kills", "1"];
    let parts =
        [(["--shard", "1/2"], "| 2 of", 3), (["--shard", "2/2"], "| 1 of", 3), (["--from", "4"], "| 1 of 4", 2)];
    for (part, struck, faults) in parts {
        let printed = succeed(xtask().args(of_three).args(part));
        assert_eq!(printed.matches(struck).count(), faults, "{part:?}: {printed}");
    }
}

/// Ctrl-C left the folder that it works in, with a copy of the program, and what it was disturbing went on. On a busy machine the
/// process may end, as every command does within a second, before it has cleared up: not every time.
#[cfg(target_os = "linux")]
#[test]
fn an_interrupted_torture_leaves_nothing_behind() {
    let leaves_nothing = |attempt: u32| {
        let temporary = scratch(&format!("interrupted-torture-{attempt}"));
        let mut command = xtask();
        command.args(["torture", "--only", "train-bc"]).env("TMPDIR", &temporary);
        let mut running = Running(command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap());
        let folder = temporary.join(format!("lotpilot-torture-{}", running.0.id()));
        // What the first command says.
        assert!(running.wait_for(&folder.join("said")), "nothing was begun");
        assert_eq!(running.ended_by("INT"), Some(130));
        std::fs::read_dir(&temporary).unwrap().count() == 0
    };
    assert!((0..5).any(leaves_nothing));
}

/// `--resume` drove, although `--no-eval` had been asked for.
#[test]
fn a_training_without_an_evaluation_goes_on_without_one() {
    let run = scratch("no-evaluation").join("run");
    let arguments = ["train-bc", "--preset", "smoke", "--no-eval"];
    let mut running = Running::start(&arguments, &run);
    assert!(running.wait_for(&run.join("sha256sums")));
    running.kill();
    resume(arguments[0], &run);
    assert!(run.join("finished.toml").is_file() && !run.join("runs.jsonl").exists());
}

/// A folder that is not there yet, with `..` behind it, hid that the run lay there that was read: it was deleted.
#[test]
fn what_is_read_is_never_deleted_or_written_into_however_it_is_named() {
    let folder = scratch("what-is-read");
    succeed(xtask().current_dir(&folder).args(["train-bc", "--preset", "smoke", "--no-eval", "--out", "run"]));
    std::fs::write(folder.join("mine.toml"), "seed = 4\n").unwrap();
    let in_run = |command: &mut Command| succeed(command.current_dir(folder.join("run")));
    let evaluate = ["evaluate", "--driver", "expert", "--lots", "lot-b", "--trials", "1", "--directions", "forward"];
    let of_run = [&evaluate[..2], &["run:run"], &evaluate[3..]].concat();
    std::fs::create_dir(folder.join("other")).unwrap();
    std::fs::copy(folder.join("mine.toml"), folder.join("other/mine.toml")).unwrap();
    std::fs::create_dir(folder.join("network")).unwrap();
    for file in std::fs::read_dir(folder.join("run/round-00")).unwrap().map(Result::unwrap) {
        std::fs::copy(file.path(), folder.join("network").join(file.file_name())).unwrap();
    }
    for (arguments, out) in [(&of_run[..], "by-run"), (&evaluate[..], "by-expert")] {
        succeed(xtask().current_dir(&folder).args(arguments).args(["--out", out]));
    }
    for shard in ["1/2", "2/2"] {
        let out = format!("shard-{}", &shard[..1]);
        succeed(xtask().current_dir(&folder).args(&of_run).args(["--shard", shard, "--out", &out]));
    }
    let before = files(&folder);
    let refuses = |arguments: &[&str], part: &str| {
        let error = refuse(xtask().current_dir(&folder).args(arguments));
        assert!(error.contains(part), "{arguments:?}: {error}");
        assert_eq!(files(&folder).keys().collect::<Vec<_>>(), before.keys().collect::<Vec<_>>(), "{arguments:?}");
        assert!(files(&folder) == before, "{arguments:?} writes");
    };
    refuses(&[&of_run[..], &["--out", "none/../run", "--overwrite"]].concat(), "leads back up");
    refuses(&[&of_run[..], &["--out", "run", "--overwrite"]].concat(), "what is read lies there");
    for merged in [["shard-1", "shard-2"], ["by-run", "by-expert"]] {
        for out in ["run", merged[1]] {
            refuses(&["merge", merged[0], merged[1], "--out", out, "--overwrite"], "what is read lies there");
        }
    }
    refuses(&["render", "report", "by-run", "--out", "run", "--overwrite"], "lies within the run");
    refuses(&[&evaluate[..], &["--out", "run/elsewhere"]].concat(), "lies within the run");
    let within = refuse(xtask().current_dir(folder.join("run")).args(evaluate));
    assert!(within.contains("lies within the run"), "its next free folder would be run/runs/…: {within}");
    refuses(
        &["train-bc", "--preset", "smoke", "--no-eval", "--config", "other/mine.toml", "--out", "other", "--overwrite"],
        "what is read lies there",
    );
    for file in ["run/sha256sums", "run/round-00/model.safetensors", "run/new.onnx"] {
        refuses(&["export", "onnx", "run", "--out", file, "--overwrite"], "lies within the run");
    }
    refuses(
        &["export", "onnx", "network", "--out", "network/model.safetensors", "--overwrite"],
        "the network is read from that folder",
    );
    refuses(&["render", "results", "run", "--to", "mine.toml"], "is not a page of results");
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink("run", folder.join("link")).unwrap();
        let error = refuse(xtask().current_dir(&folder).args(evaluate).args(["--out", "link/new"]));
        assert!(error.contains("lies within the run"), "{error}");
    }
    // Beside it, by whatever name.
    in_run(xtask().args(evaluate).args(["--driver", "run:.", "--out", "../beside"]));
    in_run(xtask().args(evaluate).args(["--driver", "run:bc", "--out", "../beside-2"]));
    let faults = sums::verify(&folder.join("run")).faults;
    assert!(faults.is_empty(), "{faults:?}");
}

/// Runs of an evaluation that another plan would have driven were taken for those of this one.
#[test]
fn results_that_lack_runs_are_not_those_of_an_evaluation() {
    let run = scratch("lacks-runs").join("run");
    let evaluate = "evaluate --driver expert --lots lot-b --trials 2 --directions forward --out";
    succeed(xtask().args(evaluate.split(' ')).arg(&run));
    let runs = std::fs::read_to_string(run.join("runs.jsonl")).unwrap();
    let first = format!("{}\n", runs.lines().next().unwrap());
    sums::write(&run, "runs.jsonl", first.as_bytes()).unwrap();
    sums::unlist(&run, &["finished.toml"]).unwrap();
    std::fs::remove_file(run.join("finished.toml")).unwrap();
    let error = refuse(xtask().args(["evaluate", "--resume"]).arg(&run));
    assert!(error.contains("1 runs of the 2 that belong there"), "{error}");
}

/// What was driven on one lot was merged with what others drove on another one, without a word.
#[test]
fn lots_that_exchange_their_names_are_not_taken_for_each_other() {
    let folder = scratch("exchanged-names");
    let write = |file: &str, name: &str, length_m: u32| {
        let lot = format!(
            "name = \"{name}\"\nboundary = [[-18.0, -3.0], [34.0, -3.0], [34.0, 3.0], [-18.0, 3.0]]\n\
             reference_path.points = [[0.0, 0.0], [{length_m}.0, 0.0]]\n"
        );
        std::fs::write(folder.join(file), lot).unwrap();
    };
    let evaluate = |driver: &str| {
        let lots = ["--lots", "a.toml", "b.toml", "--trials", "1", "--out", driver];
        succeed(xtask().current_dir(&folder).args(["evaluate", "--driver", driver]).args(lots));
    };
    write("a.toml", "short", 10);
    write("b.toml", "long", 12);
    evaluate("expert");
    write("a.toml", "long", 10);
    write("b.toml", "short", 12);
    evaluate("vff");
    let error = refuse(xtask().current_dir(&folder).args(["merge", "expert", "vff"]));
    assert!(error.contains("lot \"short\" was a.toml, and is b.toml now"), "{error}");
}

/// A report that was written again under another name of its folder was not listed in its run, which was then damaged.
#[test]
fn a_report_of_a_stage_is_listed_in_its_run_by_whatever_name() {
    let run = scratch("report-of-stage").join("run");
    succeed(
        xtask()
            .args(["train-bc", "--preset", "smoke", "--set", "evaluation.elsewhere=[\"test:1\"]", "--out"])
            .arg(&run),
    );
    succeed(xtask().current_dir(run.join("elsewhere")).args(["render", "report", "."]));
    // It was called `.`.
    assert!(std::fs::read_to_string(run.join("elsewhere/report.md")).unwrap().starts_with("# elsewhere\n"));
    let faults = sums::verify(&run).faults;
    assert!(faults.is_empty(), "{faults:?}");
}

/// Samples of `round-01`, named from within its run, were refused by an error that named nothing.
#[test]
fn samples_of_a_round_are_drawn_from_within_its_run() {
    let run = scratch("samples-from-within").join("run");
    succeed(xtask().args(["train-bc", "--preset", "smoke", "--no-eval", "--out"]).arg(&run));
    succeed(xtask().current_dir(&run).args(["render", "samples", "round-00", "--count", "2", "--out", "../samples"]));
    assert!(run.with_file_name("samples").join("samples-round-00.png").is_file());
}

/// What an interrupted run was to go on with was called damage, to be deleted; and where a finished one had lost its report,
/// `--resume` was advised, which refuses.
#[test]
fn what_is_advised_of_a_run_that_is_not_whole_helps() {
    let run = scratch("advice").join("run");
    let mut running = Running::start(&["evaluate", "--driver", "expert", "--lots", "lot-b", "--trials", "2"], &run);
    assert!(running.wait_for(&run.join("driving.unfinished")));
    running.kill();
    let verify = || refuse(xtask().arg("verify").arg(&run));
    let said = verify();
    for part in ["driving.unfinished: ", "runs.jsonl: ", "this run is not finished", "cargo xtask evaluate --resume"] {
        assert!(said.contains(part), "no {part}: {said}");
    }
    for part in ["delete", "move away", "not what was written"] {
        assert!(!said.contains(part), "{part}: {said}");
    }
    resume("evaluate", &run);
    succeed(xtask().arg("verify").arg(&run));
    sums::unlist(&run, &["figures/sha256sums", "report.md"]).unwrap();
    damage(&run.join("report.html"), "truncated");
    let (said, advice) = (verify(), format!("cargo xtask render report {}", run.display()));
    assert!(said.matches(&advice).count() == 3 && !said.contains("--resume"), "{said}");
    succeed(xtask().args(["render", "report"]).arg(&run));
    succeed(xtask().arg("verify").arg(&run));
    std::fs::write(run.join("notes.txt"), "mine").unwrap();
    let said = verify();
    assert!(said.contains("notes.txt") && !said.contains("delete"), "{said}");
}

/// It lost its pictures, and the run was another by its digest, without a word. Lots were written into the run.
#[test]
fn a_report_is_not_replaced_by_one_that_can_replay_nothing() {
    let folder = scratch("report-from-elsewhere");
    let run = folder.join("run");
    let train = ["train-bc", "--preset", "smoke", "--set", "evaluation.elsewhere=[]", "--out", "run"];
    succeed(xtask().current_dir(&folder).args(train));
    let report = || std::fs::read(run.join("report.html")).unwrap();
    let whole = report();
    let again = || {
        let mut command = xtask();
        command.current_dir(&run).args(["render", "report", "."]);
        command
    };
    let error = refuse(&mut again());
    assert!(error.contains("cannot be replayed from here") && error.contains("--overwrite"), "{error}");
    assert!(report() == whole, "it is as it was");
    let output = again().arg("--overwrite").output().unwrap();
    let (_, said) = text(&output);
    assert!(output.status.success() && said.contains("written without the pictures of near-collisions"), "{said}");
    assert!(report().len() < whole.len() / 2, "there is no picture of a near-collision in it");
    succeed(xtask().current_dir(&folder).args(["render", "report", "run"]));
    assert!(report() == whole, "and back");

    let error = refuse(xtask().current_dir(&folder).args(["generate", "--lots", "lot-a", "--out", "run"]));
    assert!(error.contains("lies within the run"), "{error}");
    let error = refuse(xtask().current_dir(&folder).args(["visualise", "lot", "--out", "run/lot.rrd"]));
    assert!(error.contains("lies within the run"), "{error}");
    assert!(sums::verify(&run).faults.is_empty());
}

/// A planner whose file had changed drove in the pictures of near-collisions, if it had one at the same tick, and the report was
/// listed as the run's own.
#[test]
fn a_report_shows_no_drive_with_other_parameters() {
    let folder = scratch("other-parameters");
    let (run, file) = (folder.join("run"), folder.join("mine.toml"));
    let parameters = succeed(xtask().args(["drivers", "tentacle"]));
    std::fs::write(&file, &parameters).unwrap();
    let evaluate = "evaluate --driver tentacle:mine.toml --lots lot-b --trials 1 --directions forward --out run";
    succeed(xtask().current_dir(&folder).args(evaluate.split(' ')));
    let report = || std::fs::read(run.join("report.html")).unwrap();
    let whole = report();
    let again = || {
        let mut command = xtask();
        command.current_dir(&folder).args(["render", "report", "run"]);
        command
    };
    let others = parameters.replace("speed_mps = 2.2", "speed_mps = 1.9");
    assert_ne!(others, parameters);
    std::fs::write(&file, others).unwrap();
    let error = refuse(&mut again());
    assert!(error.contains("tentacle:mine.toml: changed since") && error.contains("--overwrite"), "{error}");
    assert!(report() == whole, "it is as it was");
    std::fs::write(&file, format!("{parameters}# the same\n")).unwrap();
    succeed(&mut again());
    assert!(report() == whole, "and made again");
}

/// Half of its keys named a folder that was gone, and nothing could be replayed any more.
#[test]
fn a_run_that_is_moved_in_the_middle_of_an_evaluation_is_finished_where_it_was_begun() {
    let folder = scratch("moved-meanwhile");
    let (run, moved) = (folder.join("run"), folder.join("moved"));
    let train = "train-bc --preset smoke --set evaluation.trials=40 --set evaluation.elsewhere=[] --out run";
    let training =
        xtask().current_dir(&folder).args(train.split(' ')).stdout(Stdio::null()).stderr(Stdio::null()).spawn();
    let mut training = Running(training.unwrap());
    // 32 by the expert, 32 by the network, then eight by each. When the expert's eight come, the network's part is finished.
    let driven = || std::fs::read_to_string(run.join("runs.jsonl")).unwrap_or_default().lines().count();
    while driven() <= 64 {
        assert!(training.0.try_wait().unwrap().is_none(), "it ended before it was moved");
        std::thread::sleep(Duration::from_millis(2));
    }
    training.0.kill().unwrap();
    training.0.wait().unwrap();
    assert!(!run.join("finished.toml").exists());
    let resume = |run: &str| {
        let mut command = xtask();
        command.current_dir(&folder).args(["train-bc", "--resume", run]);
        command
    };
    std::fs::rename(&run, &moved).unwrap();
    let error = refuse(&mut resume("moved"));
    assert!(error.contains("runs.jsonl: was driven by run:run/bc, which is run:moved/bc from here"), "{error}");
    std::fs::rename(&moved, &run).unwrap();
    succeed(&mut resume("run"));
    assert!(sums::verify(&run).faults.is_empty());
}

/// Keys in files named the run as whoever resumed it did.
#[test]
fn a_run_is_resumed_by_whatever_name_to_the_same_bytes() {
    let folder = scratch("other-name");
    let whole = folder.join("run");
    let arguments = ["train-bc", "--preset", "smoke", "--set", "evaluation.elsewhere=[]", "--out"];
    succeed(xtask().current_dir(&folder).args(arguments).arg("run"));
    let expected = files(&whole);
    std::fs::remove_dir_all(&whole).unwrap();
    let mut begun = xtask();
    begun.current_dir(&folder).args(arguments).arg("./run/").stdout(Stdio::null()).stderr(Stdio::null());
    let mut running = Running(begun.spawn().unwrap());
    assert!(running.wait_for(&whole.join("round-00/sha256sums")));
    running.kill();
    succeed(xtask().current_dir(&folder).args(["train-bc", "--resume"]).arg(&whole));
    let resumed = files(&whole);
    for (name, bytes) in &expected {
        assert!(resumed.get(name) == Some(bytes), "{name} differs");
    }
}

/// A file beyond `ulimit -f` killed the command without a word; and git in a hook named another repository's commit.
#[cfg(target_os = "linux")]
#[test]
fn limits_and_variables_of_the_shell_are_taken_for_what_they_are() {
    let folder = scratch("shell");
    let evaluate = "evaluate --driver tentacle --lots lot-b --trials 1 --out run";
    let xtask_path = xtask().get_program().to_string_lossy().into_owned();
    let mut limited = Command::new("sh");
    limited.current_dir(&folder).args(["-c", &format!("ulimit -f 32; exec {xtask_path} {evaluate}")]);
    let error = refuse(&mut limited);
    assert!(error.contains("too large"), "{error}");
    let mut limited = Command::new("sh");
    let generate = "generate --lots lot-b --out lots";
    limited.current_dir(&folder).args(["-c", &format!("ulimit -f 32; exec {xtask_path} {generate}")]);
    refuse(&mut limited);
    let left: Vec<_> = files(&folder.join("lots")).into_keys().collect();
    assert!(left.is_empty(), "{left:?}");
    succeed(xtask().current_dir(&folder).env("GIT_DIR", "/none").args(["evaluate", "--resume", "run"]));
    let manifest = |out: &str, git_dir: Option<&str>| {
        let mut command = xtask();
        command.current_dir(&folder).args(evaluate.split(' ').take(7)).args(["--directions", "forward", "--out", out]);
        git_dir.map(|folder| command.env("GIT_DIR", folder));
        succeed(&mut command);
        let text = std::fs::read_to_string(folder.join(out).join("manifest.toml")).unwrap();
        text.lines().filter(|line| line.starts_with("git_")).map(str::to_owned).collect::<Vec<_>>()
    };
    assert_eq!(manifest("hook", Some("/none")), manifest("none", None));
}

/// Two commands wrote into one folder, and the result belonged to neither.
#[test]
fn a_run_under_way_is_refused_by_name_and_process() {
    let run = scratch("owner").join("run");
    let mut running = Running::start(&["train-dagger", "--preset", "smoke", "--no-eval"], &run);
    assert!(running.wait_for(&run.join("sha256sums")));
    let owner = format!("in use by train-dagger, process {}", running.0.id());
    let out = run.to_string_lossy().into_owned();
    for arguments in [
        &["train-bc", "--preset", "smoke", "--seed", "9", "--overwrite", "--out", &out] as &[&str],
        &["evaluate", "--driver", "expert", "--out", &out],
        &["train-dagger", "--resume", &out],
        &["render", "report", &out],
    ] {
        let output = xtask().args(arguments).output().unwrap();
        let (_, stderr) = text(&output);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {stderr}");
        assert!(stderr.contains(&owner), "{arguments:?}: {stderr}");
    }
    running.kill();
    resume("train-dagger", &run);
}

/// Whatever signal comes, and whenever: 130, soon, nothing half-done is called finished, and the run can be continued.
#[cfg(unix)]
#[test]
fn signals_end_a_command_with_130_and_lose_nothing() {
    let train: &[&str] = &["train-dagger", "--preset", "smoke", "--no-eval"];
    let evaluate: &[&str] = &["evaluate", "--driver", "expert", "--lots", "lot-b", "--trials", "16"];
    for (signal, arguments, file) in [
        ("INT", train, "sha256sums"),
        ("TERM", train, "dagger.toml"),
        ("HUP", train, "round-00/fit.toml"),
        ("INT", evaluate, "driving.unfinished"),
    ] {
        // Under nohup commands ignore hang-ups, as they should.
        if signal == "HUP" && ignores_hang_ups() {
            continue;
        }
        let (command, run) = (arguments[0], scratch("signals").join(signal));
        let mut running = Running::start(arguments, &run);
        assert!(running.wait_for(&run.join(file)), "{command}: {file} never appears");
        assert_eq!(running.ended_by(signal), Some(130), "{command} after {signal}");
        assert!(!run.join("finished.toml").exists(), "{command} after {signal}");
        resume(command, &run);
    }
}

/// Under nohup a training goes on when its terminal is closed.
#[cfg(unix)]
#[test]
fn a_hang_up_that_is_ignored_from_the_start_stays_ignored() {
    let run = scratch("nohup").join("run");
    let mut shell = Command::new("sh");
    shell.args(["-c", "trap '' HUP; exec \"$@\"", "sh"]).arg(xtask().get_program());
    shell.args(["train-dagger", "--preset", "smoke", "--no-eval", "--out"]).arg(&run);
    let mut running = Running(shell.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap());
    assert!(running.wait_for(&run.join("sha256sums")));
    let sent = Command::new("kill").args(["-s", "HUP", &running.0.id().to_string()]).status().unwrap();
    assert!(sent.success());
    assert_eq!(running.0.wait().unwrap().code(), Some(0));
    assert!(run.join("finished.toml").exists());
}

/// Whether hang-ups are ignored from the start, by all that this process starts; said on Linux only.
fn ignores_hang_ups() -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    ignored.is_some_and(|mask| u64::from_str_radix(mask.trim(), 16).unwrap() & 1 == 1)
}

/// Whoever read stderr stands still, with the pipe full: the process could be killed only.
#[cfg(target_os = "linux")]
#[test]
fn a_signal_ends_a_command_that_nobody_listens_to() {
    let run = scratch("nobody-listens").join("run");
    let (reader, mut writer) = std::io::pipe().unwrap();
    // As much as a pipe holds.
    std::io::Write::write_all(&mut writer, &vec![b'\n'; 1 << 16]).unwrap();
    let mut command = xtask();
    command.args(["train-dagger", "--preset", "smoke", "--no-eval", "--out"]).arg(&run);
    let mut running = Running(command.stdout(Stdio::null()).stderr(writer).spawn().unwrap());
    assert!(running.wait_for(&run.join("sha256sums")));
    assert_eq!(running.ended_by("INT"), Some(130));
    drop(reader);
    resume("train-dagger", &run);
}

/// Damage as disks, copies and people make it.
const DAMAGES: [&str; 5] = ["a bit flipped", "truncated", "emptied", "a line or byte added", "removed"];

fn damage(path: &Path, how: &str) {
    let mut bytes = std::fs::read(path).unwrap();
    match how {
        "a bit flipped" if !bytes.is_empty() => {
            let middle = bytes.len() / 2;
            bytes[middle] ^= 4;
        }
        "truncated" => bytes.truncate(bytes.len() / 2),
        "emptied" => bytes.clear(),
        "removed" => return std::fs::remove_file(path).unwrap(),
        _ => bytes.push(b'\n'),
    }
    std::fs::write(path, bytes).unwrap();
}

/// Reads what a training left, as drivers, resumed trainings and reports do.
fn read_training(run: &Path) -> Result<(), String> {
    let round = run.join("round-00");
    let store = Store::open(run).map_err(|error| error.to_string())?;
    store.is_finished(&round).map_err(|error| error.to_string())?;
    store.read_round(0).map_err(|error| error.to_string())?;
    Checkpoint::load(&round).map_err(|error| error.to_string())?;
    learning::read(&round, "BC").map_err(|error| error.to_string())?;
    FitReport::read(&round).map_err(|error| error.to_string()).map(drop)
}

/// 31 of 243 damaged files changed a result without a word.
#[test]
fn every_damage_of_every_file_is_noticed_by_who_reads_it_and_by_verify() {
    let run = scratch("damage").join("run");
    succeed(xtask().args(["train-bc", "--preset", "smoke", "--out"]).arg(&run));
    assert!(sums::verify(&run).faults.is_empty());
    read_training(&run).unwrap();
    let files = content_of(&run);
    assert!(files.len() > 25, "{files:?}");
    let mut count = 0;
    for file in &files {
        let whole = std::fs::read(run.join(file)).unwrap();
        for how in DAMAGES {
            damage(&run.join(file), how);
            if std::fs::read(run.join(file)).is_ok_and(|bytes| bytes == whole) {
                continue;
            }
            assert!(!sums::verify(&run).faults.is_empty(), "{} {how}: verify says nothing", file.display());
            if file.starts_with("round-00") {
                assert!(read_training(&run).is_err(), "{} {how}: it is read", file.display());
            }
            std::fs::write(run.join(file), &whole).unwrap();
            count += 1;
        }
    }
    assert!(count > 100, "only {count} damages");
    assert!(sums::verify(&run).faults.is_empty(), "restored");

    let driver = format!("run:{}", run.display());
    let evaluate = ["evaluate", "--driver", &driver, "--lots", "lot-b", "--trials", "1"];
    let report = ["render", "report", run.to_str().unwrap()];
    let verify = ["verify", run.to_str().unwrap()];
    for (file, command) in [
        ("round-00/model.safetensors", &evaluate[..]),
        ("round-00/sha256sums", &evaluate),
        ("settings.toml", &evaluate),
        ("manifest.toml", &evaluate),
        ("table1.json", &report),
        ("summary.json", &report),
        ("runs.jsonl", &report),
        ("round-00/learning.csv", &report),
        ("figures/learning.svg", &verify),
    ] {
        let whole = std::fs::read(run.join(file)).unwrap();
        damage(&run.join(file), "a bit flipped");
        let output = xtask().args(command).output().unwrap();
        let (_, stderr) = text(&output);
        assert_eq!(output.status.code(), Some(2), "{command:?} with {file}: {stderr}");
        assert!(stderr.contains(file), "{command:?} does not name {file}: {stderr}");
        std::fs::write(run.join(file), whole).unwrap();
    }
    // A bit flipped in the list, in the name of what not every report has: it was left out, without a word.
    let list = std::fs::read_to_string(run.join(sums::FILE)).unwrap();
    for name in ["table1.json", "summary.json", "elsewhere.md"] {
        let flipped = format!("{}{}", char::from(name.as_bytes()[0] ^ 1), &name[1..]);
        std::fs::write(run.join(sums::FILE), list.replace(name, &flipped)).unwrap();
        let error = refuse(xtask().args(report));
        assert!(error.contains(&format!("{name}: is not listed in sha256sums")), "{error}");
    }
    std::fs::write(run.join(sums::FILE), list).unwrap();
    let printed = succeed(xtask().args(verify));
    assert!(printed.contains("all as they were written"), "{printed}");
}

/// Every file of a run but its lock, relative to it.
fn content_of(run: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut folders = vec![run.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.file_name().unwrap() != ".lock" {
                found.push(path.strip_prefix(run).unwrap().to_owned());
            }
        }
    }
    found.sort();
    found
}
