//! How long tasks report progress and are cancelled.

use std::cell::RefCell;

/// Receives progress and says whether to continue. Shared between threads: implementations use interior mutability.
///
/// Work is a sequence of tasks, one at a time: `begin`, any number of `at`, `end`. A task that is begun while another
/// runs ends that one without a result.
pub trait Progress {
    /// Begins a task. `stage`: what its time is added to (`"training"`); `label`: what people read.
    fn begin(&self, stage: &'static str, label: &str);

    /// Reports the share of the task that is done, 0…1. `status` is only called if it is shown.
    fn at(&self, share: f64, status: &mut dyn FnMut(Elapsed) -> String);

    /// Ends the task with a line that stays.
    fn end(&self, result: &str);

    /// Whether the user asked to stop. Work ends at the next point at which everything finished is on disk.
    fn is_cancelled(&self) -> bool;
}

/// Wall time since the beginning of a task. Shown to people only: nothing computed depends on it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Elapsed {
    /// Seconds, more than 0.
    pub seconds: f64,
}

/// The error of cancelled work.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("interrupted: {kept}")]
pub struct Interrupted {
    /// What is on disk and how to continue, in one sentence.
    pub kept: String,
}

/// Remembers which shares were reported, for tests of what people wait for; is never cancelled.
#[derive(Debug, Clone, Default)]
pub struct Shares(pub RefCell<Vec<f64>>);

impl Progress for Shares {
    fn begin(&self, _: &'static str, _: &str) {}

    fn at(&self, share: f64, _: &mut dyn FnMut(Elapsed) -> String) {
        self.0.borrow_mut().push(share);
    }

    fn end(&self, _: &str) {}

    fn is_cancelled(&self) -> bool {
        false
    }
}

/// Reports to nobody and is never cancelled.
#[derive(Debug, Clone, Copy, Default)]
pub struct Silent;

impl Progress for Silent {
    fn begin(&self, _: &'static str, _: &str) {}

    fn at(&self, _: f64, _: &mut dyn FnMut(Elapsed) -> String) {}

    fn end(&self, _: &str) {}

    fn is_cancelled(&self) -> bool {
        false
    }
}
