//! Reads one [`ViewRequest`] as JSON, from the file that is named or from standard input, and shows what it asks for.
//!
//! `cargo xtask visualise` and `--record` build and start it.
#![allow(clippy::disallowed_methods, reason = "wall time only limits how often progress is said")]

use anyhow::Context as _;
use experiment::progress::{Elapsed, Interrupted, Progress};
use experiment::view_request::ViewRequest;
use sim::limits::VIEW_REQUEST_BYTES_MAX;
use std::cell::RefCell;
use std::io::{IsTerminal as _, Read as _, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use viewer::RERUN_VERSION;

/// Bad input, or an environment in which the work cannot be done. Our own bugs panic (101).
const EXIT_REFUSED: u8 = 2;
/// Ended by Ctrl-C, as shells have it.
const EXIT_INTERRUPTED: u8 = 130;
/// Stack size of every thread of the pool, bytes: as much as the main thread has on Linux.
const STACK_BYTES: usize = 8 << 20;

/// Whether Ctrl-C was pressed.
static INTERRUPTED: AtomicBool = AtomicBool::new(false);

fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) if error.is::<Interrupted>() => ExitCode::from(EXIT_INTERRUPTED),
        Err(error) => {
            say(format_args!("error: {error:#}\n"));
            ExitCode::from(EXIT_REFUSED)
        }
    }
}

fn run() -> anyhow::Result<()> {
    ctrlc::set_handler(|| {
        if INTERRUPTED.swap(true, Ordering::Relaxed) {
            std::process::exit(i32::from(EXIT_INTERRUPTED));
        }
    })?;
    rayon::ThreadPoolBuilder::new().stack_size(STACK_BYTES).build_global()?;
    let request = read_request()?;
    let mut files = Vec::new();
    let shown = viewer::show(&request, &Console::default(), &mut files);
    for file in &files {
        let megabytes = std::fs::metadata(file).map_or(0.0, |metadata| metadata.len() as f64 / 1e6);
        let _ = writeln!(std::io::stdout(), "written: {} ({megabytes:.1} MB)", file.display());
    }
    if let Some(files) = on_command_line(&files) {
        let _ = writeln!(std::io::stdout(), "open: {}", viewer_command(&files));
    }
    shown
}

/// Says something on stderr; nobody can be told if that is closed.
fn say(text: std::fmt::Arguments<'_>) {
    let mut stderr = std::io::stderr().lock();
    let _ = stderr.write_fmt(text);
    let _ = stderr.flush();
}

fn read_request() -> anyhow::Result<ViewRequest> {
    let text = match std::env::args_os().nth(1) {
        Some(path) => {
            let path = Path::new(&path);
            storage::read::text(path, VIEW_REQUEST_BYTES_MAX).with_context(|| path.display().to_string())?
        }
        None => std::io::read_to_string(std::io::stdin().take(VIEW_REQUEST_BYTES_MAX)).context("standard input")?,
    };
    serde_json::from_str(&text).context("the request; cargo xtask visualise writes one")
}

/// Says what is going on on stderr: a line that is written over on a terminal, a line every few seconds anywhere else.
#[derive(Default)]
struct Console {
    label: RefCell<String>,
    said: RefCell<Option<Instant>>,
}

impl Progress for Console {
    fn begin(&self, _: &'static str, label: &str) {
        label.clone_into(&mut self.label.borrow_mut());
        *self.said.borrow_mut() = Some(Instant::now());
    }

    fn at(&self, share: f64, status: &mut dyn FnMut(Elapsed) -> String) {
        let mut said = self.said.borrow_mut();
        let Some(last) = said.as_mut() else { return };
        let is_terminal = std::io::stderr().is_terminal();
        let seconds = last.elapsed().as_secs_f64();
        if last.elapsed() < Duration::from_millis(if is_terminal { 100 } else { 5000 }) {
            return;
        }
        *last = Instant::now();
        let line = format!("{}: {:.0} %, {}", self.label.borrow(), 100.0 * share, status(Elapsed { seconds }));
        if is_terminal {
            say(format_args!("\r\x1b[K{line}"));
        } else {
            say(format_args!("{line}\n"));
        }
    }

    fn end(&self, result: &str) {
        let start = if std::io::stderr().is_terminal() { "\r\x1b[K" } else { "" };
        say(format_args!("{start}{}: {result}\n", self.label.borrow()));
    }

    fn is_cancelled(&self) -> bool {
        INTERRUPTED.load(Ordering::Relaxed)
    }
}

/// How files are named on a command line: the file, or all of a folder.
fn on_command_line(files: &[PathBuf]) -> Option<String> {
    let [first, others @ ..] = files else { return None };
    let folder = first.parent().filter(|_| !others.is_empty());
    Some(folder.map_or_else(|| first.display().to_string(), |folder| format!("{}/*.rrd", folder.display())))
}

/// How to open recordings, with a remedy if the viewer is missing or another version.
fn viewer_command(files: &str) -> String {
    let install = format!("pip install rerun-sdk=={RERUN_VERSION}");
    let found = Command::new("rerun").arg("--version").output();
    let said = found.ok().filter(|output| output.status.success()).map(|output| output.stdout);
    let version = said.as_deref().map(String::from_utf8_lossy);
    // It says: rerun_py 0.36.3 (release) [rustc …
    match version.as_deref().and_then(|said| said.split_whitespace().nth(1)) {
        Some(RERUN_VERSION) => format!("rerun {files}"),
        Some(other) => format!("rerun {files} (the one installed here is {other}; these need: {install})"),
        None => format!("rerun {files} (which is not installed here: {install})"),
    }
}
