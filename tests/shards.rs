//! What docs/cluster.md promises: shards of an evaluation come to the same bytes as one machine, or to one clear error.

use crate::bench::{scratch, succeed, text, xtask};
use crate::determinism::files;
use std::path::{Path, PathBuf};
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

/// Writes a file of a run anew, and its digest as well.
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

    refused(&[one, three], "missing: shard 2/3");
    refused(&[one, two, two, three], "are both shard 2/3");
    refused(&[one, two, &run], "this is no shard");
    refused(&[one, two, &folder], "this is no run");

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
    sums::unlist(&other, &["finished.toml"]).unwrap();
    refused(&[one, two, &other], "shard 3/3 is not finished");
    // It goes on as any evaluation does.
    succeed(xtask().args(["evaluate", "--resume"]).arg(&other));
    refused(&[one, two, two, &other], "are both shard 2/3");
}
