//! Notes which compiler builds this, and from which commit, for the manifest of every run: a program that is copied
//! elsewhere knows what it was made of.
#![allow(clippy::print_stdout, reason = "how a build script speaks to cargo")]

use std::collections::BTreeSet;
use std::io::Write as _;
use std::path::Path;
use std::process::{Command, Output, Stdio};

/// What the program is made of, beside this folder: the crates it links and the files of the workspace.
const SOURCES: [&str; 16] = [
    "Cargo.lock",
    "Cargo.toml",
    "rust-toolchain.toml",
    "benchmark",
    "evaluation",
    "experiment",
    "expert",
    "onnx",
    "planners",
    "policy",
    "report",
    "scenarios",
    "sim",
    "storage",
    "torture",
    "xtask",
];

fn main() {
    let rustc = std::env::var("RUSTC").unwrap_or_else(|_| "rustc".to_owned());
    let version = output(Command::new(rustc).arg("--version")).unwrap_or_default();
    println!("cargo::rustc-env=XTASK_RUSTC={version}");
    println!("cargo::rustc-env=XTASK_GIT_REVISION={}", git(&["rev-parse", "HEAD"]).unwrap_or_default());
    println!("cargo::rustc-env=XTASK_GIT_CHANGES={}", changes().unwrap_or_else(|| "unknown".to_owned()));
    for source in SOURCES {
        println!("cargo::rerun-if-changed=../{source}");
    }
    // What changes with every commit and checkout.
    for name in ["HEAD", "logs/HEAD"] {
        if let Some(path) = git(&["rev-parse", "--git-path", name])
            && Path::new("..").join(&path).exists()
        {
            println!("cargo::rerun-if-changed={}", Path::new("..").join(path).display());
        }
    }
}

/// How the sources differ from the commit: git's hash of the names and contents that do; empty if none does, `None` without
/// git or checkout. Of names and contents, because what git prints depends on the settings of its user.
fn changes() -> Option<String> {
    let names_of = |args: &[&str]| git(&[args, &["-z", "--"], &SOURCES].concat());
    let changed = names_of(&["diff", "HEAD", "--name-only", "--no-renames", "--relative"])?;
    let untracked = names_of(&["ls-files", "--others", "--exclude-standard"])?;
    let names: BTreeSet<&str> =
        changed.split('\0').chain(untracked.split('\0')).filter(|name| !name.is_empty()).collect();
    if names.is_empty() {
        return Some(String::new());
    }
    let content = |name: &str| git(&["hash-object", "--no-filters", "--", name]).unwrap_or_else(|| "gone".to_owned());
    let differences: Vec<String> = names.into_iter().map(|name| format!("{}  {name}\n", content(name))).collect();
    let mut hash =
        git_command(&["hash-object", "--stdin"]).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().ok()?;
    hash.stdin.take()?.write_all(differences.concat().as_bytes()).ok()?;
    text_of(&hash.wait_with_output().ok()?)
}

/// What git says about the checkout that is built; `None` without git or checkout.
fn git(args: &[&str]) -> Option<String> {
    output(&mut git_command(args))
}

fn git_command(args: &[&str]) -> Command {
    let mut git = Command::new("git");
    // Set where git runs a hook: they name another checkout.
    for name in ["GIT_DIR", "GIT_WORK_TREE", "GIT_INDEX_FILE", "GIT_COMMON_DIR", "GIT_OBJECT_DIRECTORY"] {
        git.env_remove(name);
    }
    git.arg("--no-optional-locks").current_dir("..").args(args);
    git
}

fn output(command: &mut Command) -> Option<String> {
    text_of(&command.output().ok()?)
}

fn text_of(output: &Output) -> Option<String> {
    output.status.success().then(|| String::from_utf8_lossy(&output.stdout).trim().to_owned())
}
