//! Runs for tests.

use crate::manifest::{Build, Request};
use crate::run_dir::{Place, RunDir};
use crate::settings::Settings;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

pub(crate) fn scratch(name: &str) -> PathBuf {
    let path = std::env::temp_dir().join(format!("xtask-test-{}-{name}", std::process::id()));
    let _ = fs::remove_dir_all(&path);
    path
}

pub(crate) fn build() -> &'static Build {
    static BUILD: LazyLock<Build> = LazyLock::new(Build::default);
    &BUILD
}

pub(crate) fn place(out: &Path, overwrite: bool) -> Place<'_> {
    Place { build: build(), out: Some(out), overwrite, command: "train-dagger", preset: "smoke", seed: 1 }
}

pub(crate) fn create(out: &Path, overwrite: bool) -> anyhow::Result<RunDir> {
    RunDir::create(&place(out, overwrite), &Settings::preset("smoke")?, &Request::default())
}

pub(crate) fn message<T: std::fmt::Debug>(result: anyhow::Result<T>) -> String {
    format!("{:#}", result.unwrap_err())
}
