//! Ctrl-C: the first one asks the work to stop at the next safe point, the second one ends the process.

use std::sync::atomic::{AtomicBool, Ordering};

static REQUESTED: AtomicBool = AtomicBool::new(false);

/// Listens for Ctrl-C from now on.
///
/// # Errors
/// If the handler cannot be installed.
pub(crate) fn install() -> anyhow::Result<()> {
    ctrlc::set_handler(|| {
        if REQUESTED.swap(true, Ordering::Relaxed) {
            // 130 = 128 + SIGINT. Files are renamed into place when complete, so ending here leaves nothing half.
            std::process::exit(130);
        }
        crate::output::note("\nfinishing what is running; Ctrl-C again to end at once");
    })?;
    Ok(())
}

/// Whether Ctrl-C was pressed.
pub(crate) fn is_requested() -> bool {
    REQUESTED.load(Ordering::Relaxed)
}
