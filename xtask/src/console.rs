//! Progress on stderr: a bar on a terminal, a line every few seconds anywhere else.

use crate::interrupt;
use experiment::progress::{Elapsed, Progress};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::cell::RefCell;
use std::fmt::Write as _;
use std::io::IsTerminal as _;
use std::time::{Duration, Instant};

/// Between two plain lines.
const LINE_EVERY: Duration = Duration::from_secs(5);
/// Positions of a bar: work is reported as a share, so that seconds, ticks and steps can share one scale.
const LENGTH: u64 = 10_000;

/// Shows what is going on, and adds up where the time went.
#[derive(Debug, Default)]
pub(crate) struct Console {
    task: RefCell<Option<Task>>,
    /// Seconds by stage, in the order in which stages began.
    stages: RefCell<Vec<(&'static str, f64)>>,
}

#[derive(Debug)]
struct Task {
    stage: &'static str,
    label: String,
    bar: Option<ProgressBar>,
    started: Instant,
    last_shown: Instant,
}

impl Console {
    /// Says where the time went.
    pub(crate) fn report_time(&self) {
        let stages = self.stages.borrow();
        let total: f64 = stages.iter().map(|(_, seconds)| seconds).sum();
        let parts: Vec<String> = stages.iter().map(|(stage, seconds)| format!("{stage} {seconds:.1} s")).collect();
        eprintln!("time: {}, {total:.1} s in all", parts.join(", "));
    }

    /// Ends the running task; its line, if it has a result.
    fn finish(&self, result: Option<&str>) {
        let Some(task) = self.task.borrow_mut().take() else { return };
        let seconds = task.started.elapsed().as_secs_f64();
        if let Some(bar) = task.bar {
            bar.finish_and_clear();
        }
        if let Some(result) = result {
            eprintln!("{}: {result} ({seconds:.1} s)", task.label);
        }
        let mut stages = self.stages.borrow_mut();
        match stages.iter_mut().find(|(stage, _)| *stage == task.stage) {
            Some((_, sum)) => *sum += seconds,
            None => stages.push((task.stage, seconds)),
        }
    }
}

impl Progress for Console {
    fn begin(&self, stage: &'static str, label: &str) {
        self.finish(None);
        let bar = std::io::stderr().is_terminal().then(|| {
            let style = ProgressStyle::with_template("{prefix:22} {bar:30} {percent:>3} %  eta {eta:>4}  {msg}")
                .expect("the template is well-formed");
            let bar = ProgressBar::with_draw_target(Some(LENGTH), ProgressDrawTarget::stderr()).with_style(style);
            bar.with_prefix(label.to_owned())
        });
        let now = Instant::now();
        *self.task.borrow_mut() = Some(Task { stage, label: label.to_owned(), bar, started: now, last_shown: now });
    }

    fn at(&self, share: f64, status: &mut dyn FnMut(Elapsed) -> String) {
        let mut task = self.task.borrow_mut();
        let Some(task) = task.as_mut() else { return };
        let share = share.clamp(0.0, 1.0);
        // Faster than eyes, and building messages is not free.
        let every = if task.bar.is_some() { Duration::from_millis(80) } else { LINE_EVERY };
        if task.last_shown.elapsed() < every {
            return;
        }
        task.last_shown = Instant::now();
        let seconds = task.started.elapsed().as_secs_f64().max(1e-9);
        let status = status(Elapsed { seconds });
        if let Some(bar) = &task.bar {
            bar.set_message(status);
            bar.set_position((share * LENGTH as f64) as u64);
        } else {
            let left_s = seconds * (1.0 - share) / share.max(1e-3);
            let mut line = format!("{}: {:.0} %, about {left_s:.0} s left", task.label, 100.0 * share);
            if !status.is_empty() {
                let _ = write!(line, ", {status}");
            }
            eprintln!("{line}");
        }
    }

    fn end(&self, result: &str) {
        self.finish(Some(result));
    }

    fn is_cancelled(&self) -> bool {
        interrupt::is_requested()
    }
}
