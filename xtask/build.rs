//! Notes which compiler builds this, and from which commit, for the manifest of every run: a program that is copied
//! elsewhere knows what it was made of.
#![allow(clippy::print_stdout, reason = "how a build script speaks to cargo")]

#[path = "build/git.rs"]
mod git;

use std::path::Path;
use std::process::Command;

/// The workspace, from where cargo runs this.
const WORKSPACE: &str = "..";

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
    println!(
        "cargo::rustc-env=XTASK_GIT_REVISION={}",
        git::answer(WORKSPACE, &["rev-parse", "HEAD"]).unwrap_or_default()
    );
    println!(
        "cargo::rustc-env=XTASK_GIT_CHANGES={}",
        git::changes(WORKSPACE, &SOURCES).unwrap_or_else(|| "unknown".to_owned())
    );
    println!("cargo::rerun-if-changed=build");
    for source in SOURCES {
        println!("cargo::rerun-if-changed={WORKSPACE}/{source}");
    }
    // What changes with every commit and checkout.
    for name in ["HEAD", "logs/HEAD"] {
        let path =
            git::answer(WORKSPACE, &["rev-parse", "--git-path", name]).map(|path| Path::new(WORKSPACE).join(path));
        if let Some(path) = path.filter(|path| path.exists()) {
            println!("cargo::rerun-if-changed={}", path.display());
        }
    }
}

fn output(command: &mut Command) -> Option<String> {
    git::text_of(&command.output().ok()?)
}
