//! One process of a command.

use anyhow::Context as _;
use std::fs::{self, File};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// A command that takes longer hangs.
const LIMIT: Duration = Duration::from_mins(10);
const LOOK_EVERY: Duration = Duration::from_millis(1);

/// How a process ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Ended {
    /// The exit code; `None` if it was killed.
    pub code: Option<i32>,
    /// What it said.
    pub stderr: String,
    /// How long it took.
    pub took: Duration,
}

impl Ended {
    /// Whether it did all of its work.
    pub fn is_done(&self) -> bool {
        self.code == Some(0)
    }

    /// Whether it refused to continue, with one error that says why.
    pub fn is_refusal(&self) -> bool {
        self.code == Some(2) && self.stderr.matches("error: ").count() == 1 && !self.stderr.contains("panicked")
    }
}

/// Runs a command to its end, or kills it after some time. `said`: a file for what it says. `is_cancelled`: whether to give up.
///
/// # Errors
/// If it cannot be run, hangs, or all of this is cancelled: it is killed then.
pub fn run(
    command: &mut Command,
    said: &Path,
    kill_after: Option<Duration>,
    is_cancelled: fn() -> bool,
) -> anyhow::Result<Ended> {
    let stderr = File::create(said).with_context(|| said.display().to_string())?;
    command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(stderr);
    let began = Instant::now();
    let mut process = command.spawn()?;
    let status = loop {
        if let Some(status) = process.try_wait()? {
            break status;
        }
        if is_cancelled() {
            process.kill()?;
            break process.wait()?;
        }
        if began.elapsed() > kill_after.unwrap_or(LIMIT) {
            process.kill()?;
            let status = process.wait()?;
            anyhow::ensure!(kill_after.is_some(), "{command:?}: hangs");
            break status;
        }
        std::thread::sleep(LOOK_EVERY);
    };
    // The same signal may have ended it by itself.
    anyhow::ensure!(!is_cancelled(), "what was under way is not compared");
    let stderr = String::from_utf8_lossy(&fs::read(said)?).into_owned();
    Ok(Ended { code: status.code(), stderr, took: began.elapsed() })
}
