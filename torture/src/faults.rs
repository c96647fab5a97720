//! Faults of the system at an operation on files: `faults.c`, made into a library that processes load first.

use anyhow::{Context as _, ensure};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

const SOURCE: &str = include_str!("faults.c");

/// What happens to an operation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fault {
    /// The process dies before it, or in the middle of a write. What changes the folder is counted.
    Kill,
    /// It fails, and all after it: the disk is full. What needs space is counted.
    DiskFull,
    /// It fails, and no other. Everything is counted, reading too.
    InputOutput,
}

impl Fault {
    /// Every fault.
    pub const ALL: [Self; 3] = [Self::Kill, Self::DiskFull, Self::InputOutput];

    /// As the library and people call it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Kill => "KILL",
            Self::DiskFull => "ENOSPC",
            Self::InputOutput => "EIO",
        }
    }
}

/// The library, compiled.
#[derive(Debug)]
pub struct Library {
    path: PathBuf,
    log: PathBuf,
}

impl Library {
    /// Compiles it into a folder.
    ///
    /// # Errors
    /// If this is not Linux, or there is no C compiler.
    pub fn compile(folder: &Path) -> anyhow::Result<Self> {
        ensure!(cfg!(target_os = "linux"), "faults are injected on Linux only");
        let (source, path) = (folder.join("faults.c"), folder.join("faults.so"));
        fs::write(&source, SOURCE)?;
        let output = Command::new("cc")
            .args(["-O1", "-shared", "-fPIC", "-o"])
            .args([&path, &source])
            .arg("-ldl")
            .output()
            .context("cc: there is no C compiler; install gcc")?;
        ensure!(output.status.success(), "cc: {}", String::from_utf8_lossy(&output.stderr));
        Ok(Self { path, log: folder.join("operations") })
    }

    /// Has a fault happen to a command at the n-th operation on files below a folder, counted from 1; 0: to none.
    ///
    /// # Errors
    /// If the log of the operations before cannot be removed.
    pub fn load_into(&self, command: &mut Command, below: &Path, fault: Fault, n: usize) -> anyhow::Result<()> {
        match fs::remove_file(&self.log) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => return Err(error.into()),
            _ => {}
        }
        command.env("LD_PRELOAD", &self.path).env("FAULTS_BELOW", below).env("FAULTS_HOW", fault.name());
        command.env("FAULTS_AT", n.to_string()).env("FAULTS_LOG", &self.log);
        Ok(())
    }

    /// The operations that the last command performed, as in `rename round-00.lotpilot-partial`.
    ///
    /// # Errors
    /// If the list cannot be read.
    pub fn operations(&self) -> anyhow::Result<Vec<String>> {
        match fs::read(&self.log) {
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(Vec::new()),
            Err(error) => Err(error.into()),
            Ok(bytes) => Ok(String::from_utf8_lossy(&bytes).lines().map(str::to_owned).collect()),
        }
    }
}
