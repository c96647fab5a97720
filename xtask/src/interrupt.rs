//! Ctrl-C: the first one asks the work to stop at the next safe point, the second one ends the process.

use std::sync::atomic::{AtomicBool, Ordering};

static REQUESTED: AtomicBool = AtomicBool::new(false);

/// Work was cut short by Ctrl-C; what was kept.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Interrupted {
    /// What is on disk and how to go on, one sentence.
    pub kept: String,
}

impl std::fmt::Display for Interrupted {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "interrupted: {}", self.kept)
    }
}

impl std::error::Error for Interrupted {}

/// Listens for Ctrl-C from now on.
///
/// # Errors
/// If the handler cannot be installed.
pub fn install() -> anyhow::Result<()> {
    ctrlc::set_handler(|| {
        if REQUESTED.swap(true, Ordering::Relaxed) {
            // 130 = 128 + SIGINT. Files are renamed into place when complete, so ending here leaves nothing half.
            std::process::exit(130);
        }
        eprintln!("\nfinishing what is running; Ctrl-C again to end at once");
    })?;
    Ok(())
}

/// Whether Ctrl-C was pressed.
pub fn is_requested() -> bool {
    REQUESTED.load(Ordering::Relaxed)
}
