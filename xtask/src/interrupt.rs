//! Ctrl-C, SIGTERM and SIGHUP: work stops at the next safe point, and the process ends within a second in any case.
//! Every file is whole at any moment and unfinished work is on disk, so that ending anywhere loses next to nothing.

use crate::output::note;
use experiment::command_line::quoted_path;
#[cfg(unix)]
use signal_hook::{
    consts::{SIGHUP, SIGTERM, SIGXFSZ},
    flag,
};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, LazyLock, Mutex, mpsc};
use std::time::{Duration, Instant};

/// Exit status after a signal, whichever: 128 + SIGINT, as shells have it.
pub(crate) const EXIT: u8 = 130;
/// What work has to stop by itself.
pub(crate) const GRACE: Duration = Duration::from_millis(600);
/// What saying so may take.
const LAST_WORDS: Duration = Duration::from_millis(200);
/// Between two looks at the flag.
const LOOK_EVERY: Duration = Duration::from_millis(50);

static REQUESTED: LazyLock<Arc<AtomicBool>> = LazyLock::new(Arc::default);
/// How to continue the run under way.
static WAY_ON: Mutex<Option<String>> = Mutex::new(None);

/// Listens for signals from now on.
///
/// # Errors
/// If a handler cannot be installed.
pub(crate) fn install() -> anyhow::Result<()> {
    ctrlc::set_handler(|| {
        // The second one ends the process at once.
        if REQUESTED.swap(true, Ordering::Relaxed) {
            std::process::exit(EXIT.into());
        }
    })?;
    #[cfg(unix)]
    for signal in [SIGTERM, SIGHUP].into_iter().filter(|&signal| !is_ignored(signal)) {
        flag::register_conditional_shutdown(signal, EXIT.into(), Arc::clone(&REQUESTED))?;
        flag::register(signal, Arc::clone(&REQUESTED))?;
    }
    // A file that grows beyond `ulimit -f` is an error of writing then, as a full disk is.
    #[cfg(unix)]
    flag::register(SIGXFSZ, Arc::default())?;
    std::thread::Builder::new().name("signals".to_owned()).spawn(watch)?;
    Ok(())
}

/// Whether a signal was ignored from the start, as nohup ignores hang-ups, where the system tells (Linux): then it stays
/// ignored.
#[cfg(unix)]
fn is_ignored(signal: i32) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0);
    mask >> (signal - 1) & 1 == 1
}

fn watch() {
    while !is_requested() {
        std::thread::sleep(LOOK_EVERY);
    }
    let asked = Instant::now();
    while asked.elapsed() < GRACE {
        std::thread::sleep(LOOK_EVERY);
    }
    // Where nobody reads stderr, writing to it never ends.
    let (told, is_told) = mpsc::channel();
    let last_words = move || {
        note(said("what is finished is on disk"));
        let _ = told.send(());
    };
    if std::thread::Builder::new().name("last words".to_owned()).spawn(last_words).is_ok() {
        let _ = is_told.recv_timeout(LAST_WORDS);
    }
    std::process::exit(EXIT.into());
}

/// Notes which command continues which run.
pub(crate) fn can_resume(command: &str, run: &Path) {
    goes_on_with(&format!("{command} --resume {}", quoted_path(run)));
}

/// Notes the arguments of the command that continues what is under way.
pub(crate) fn goes_on_with(arguments: &str) {
    if let Ok(mut way_on) = WAY_ON.lock() {
        *way_on = Some(format!("; continue with: cargo xtask {arguments}"));
    }
}

/// Notes that nothing has to be continued.
pub(crate) fn nothing_to_continue() {
    if let Ok(mut way_on) = WAY_ON.lock() {
        *way_on = None;
    }
}

/// The last line of an interrupted command.
pub(crate) fn said(kept: &str) -> String {
    let way_on = WAY_ON.lock().ok().and_then(|way_on| way_on.clone()).unwrap_or_default();
    format!("interrupted: {kept}{way_on}")
}

/// Whether to stop.
pub(crate) fn is_requested() -> bool {
    REQUESTED.load(Ordering::Relaxed)
}
