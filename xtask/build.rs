//! Notes which compiler builds this, and from which commit, for the manifest of every run: a program that is copied
//! elsewhere knows what it was made of.
#![allow(clippy::print_stdout, reason = "how a build script speaks to cargo")]

use std::path::Path;
use std::process::Command;

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
    let status = git(&[&["status", "--porcelain", "--untracked-files=no", "--"][..], &SOURCES[..]].concat());
    println!(
        "cargo::rustc-env=XTASK_GIT_CHANGES={}",
        status.map_or("unknown", |found| if found.is_empty() { "no" } else { "yes" })
    );
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

/// What git says about the checkout that is built; `None` without git or checkout.
fn git(args: &[&str]) -> Option<String> {
    let mut git = Command::new("git");
    // Set where git runs a hook: they name another checkout.
    for name in ["GIT_DIR", "GIT_WORK_TREE", "GIT_INDEX_FILE", "GIT_COMMON_DIR", "GIT_OBJECT_DIRECTORY"] {
        git.env_remove(name);
    }
    output(git.arg("--no-optional-locks").current_dir("..").args(args))
}

fn output(command: &mut Command) -> Option<String> {
    let output = command.output().ok().filter(|output| output.status.success())?;
    Some(String::from_utf8_lossy(&output.stdout).trim().to_owned())
}
