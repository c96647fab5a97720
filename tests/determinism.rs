//! Same seed, same bytes: weights, data sets and tables, for 1 and 2 threads.

use crate::bench::{scratch, succeed, xtask};
use std::collections::BTreeMap;
use std::path::Path;

/// Every file of a run by name, except for the manifest (it names the command line), the report (it shows the
/// manifest), the wall time, and the lists of their digests.
pub(crate) fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut files = BTreeMap::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(next) = folders.pop() {
        for entry in std::fs::read_dir(next).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else {
                let name = path.strip_prefix(folder).unwrap().to_string_lossy().into_owned();
                let file_name = path.file_name().unwrap().to_string_lossy();
                if !["manifest.toml", "report.html", "report.md", "wall_time.jsonl", "sha256sums"]
                    .contains(&&*file_name)
                {
                    files.insert(name, std::fs::read(&path).unwrap());
                }
            }
        }
    }
    files
}

#[test]
fn one_and_two_threads_write_the_same_bytes() {
    let folder = scratch("determinism");
    // Both into the same folder, one after the other: keys and pictures name the run that they belong to.
    let out = folder.join("run");
    let train = |threads: &str| {
        let printed = succeed(
            xtask().args(["--threads", threads, "train-dagger", "--preset", "smoke", "--seed", "7", "--out"]).arg(&out),
        );
        let files = files(&out);
        let digest = digest_of(&out);
        std::fs::remove_dir_all(&out).unwrap();
        (files, printed, digest)
    };
    let (one, printed_by_one, digest_by_one) = train("1");
    let (two, printed_by_two, digest_by_two) = train("2");
    for needed in
        ["settings.toml", "round-00/grids.npy", "round-00/learning.csv", "round-01/model.safetensors", "table1.json"]
    {
        assert!(one.contains_key(needed), "{needed} is missing from {:?}", one.keys());
    }
    assert!(one.contains_key("summary.csv"), "{:?}", one.keys());
    assert_eq!(one.keys().collect::<Vec<_>>(), two.keys().collect::<Vec<_>>());
    for (name, bytes) in &one {
        assert!(*bytes == two[name], "{name} differs between 1 and 2 threads");
    }
    assert_eq!(printed_by_one, printed_by_two, "what is printed differs between 1 and 2 threads");
    assert_eq!(digest_by_one, digest_by_two);
}

/// The digest of a whole run, as `verify` prints it.
fn digest_of(run: &Path) -> String {
    let verified: serde_json::Value =
        serde_json::from_str(&succeed(xtask().args(["verify", "--json"]).arg(run))).unwrap();
    verified["sha256"].as_str().unwrap().to_owned()
}

#[test]
fn another_seed_gives_other_data() {
    let folder = scratch("seeds");
    let labels = |seed: &str| {
        let out = folder.join(seed);
        succeed(xtask().args(["train-bc", "--preset", "smoke", "--no-eval", "--seed", seed, "--out"]).arg(&out));
        std::fs::read(out.join("round-00/labels.npy")).unwrap()
    };
    assert_ne!(labels("1"), labels("2"));
}

/// Two drivers that fail often, on a reference lot and generated ones, at two noise levels: every table, the list of
/// near-collisions with their causes, and the bootstrap.
#[test]
fn an_evaluation_is_the_same_for_one_and_two_threads() {
    let folder = scratch("evaluation-threads");
    let run = folder.join("run");
    succeed(xtask().args(["train-bc", "--preset", "smoke", "--no-eval", "--out"]).arg(&run));
    let driver = format!("run:{}", run.display());
    let evaluate = |threads: &str| {
        let out = folder.join(threads);
        let printed = succeed(
            xtask()
                .args(["--threads", threads, "evaluate", "--driver", "expert", &driver, "--lots", "lot-b,test:2:easy"])
                .args(["--trials", "1", "--noise", "clean,1.5", "--out"])
                .arg(&out),
        );
        (files(&out), printed)
    };
    let (one, printed_by_one) = evaluate("1");
    let (two, printed_by_two) = evaluate("2");
    for needed in [
        "runs.jsonl",
        "summary.csv",
        "summary.json",
        "summary.md",
        "comparisons.csv",
        "noise_sweep.csv",
        "failures.jsonl",
        "failures.md",
        "figures/noise.svg",
        "figures/near-collision-0.svg",
    ] {
        assert!(one.get(needed).is_some_and(|bytes| !bytes.is_empty()), "{needed} is missing from {:?}", one.keys());
    }
    assert_eq!(one.keys().collect::<Vec<_>>(), two.keys().collect::<Vec<_>>());
    for (name, bytes) in &one {
        assert!(*bytes == two[name], "{name} differs between 1 and 2 threads");
    }
    assert_eq!(printed_by_one, printed_by_two, "what is printed differs between 1 and 2 threads");
}
