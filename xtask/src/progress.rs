//! What is going on: a bar on a terminal, a line every few seconds anywhere else. Always on stderr.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::fmt::Write as _;
use std::io::IsTerminal as _;
use std::time::{Duration, Instant};

/// Between two plain lines.
const LINE_EVERY: Duration = Duration::from_secs(5);
/// Positions of a bar: work is reported as a share, so that seconds, ticks and steps can share one scale.
const LENGTH: u64 = 10_000;

/// One stretch of work.
#[derive(Debug)]
pub struct Work {
    label: String,
    bar: Option<ProgressBar>,
    started: Instant,
    last_line: Instant,
}

impl Work {
    /// Begins.
    pub fn begin(label: impl Into<String>) -> Self {
        let label = label.into();
        let bar = std::io::stderr().is_terminal().then(|| {
            let style = ProgressStyle::with_template("{prefix:22} {bar:30} {percent:>3} %  eta {eta:>4}  {msg}")
                .expect("the template is well-formed");
            let bar = ProgressBar::with_draw_target(Some(LENGTH), ProgressDrawTarget::stderr()).with_style(style);
            bar.with_prefix(label.clone())
        });
        let now = Instant::now();
        Self { label, bar, started: now, last_line: now }
    }

    /// Reports the share done, 0…1. `message` is only asked for when it is shown.
    pub fn at(&mut self, share: f64, message: impl FnOnce() -> String) {
        let share = share.clamp(0.0, 1.0);
        if let Some(bar) = &self.bar {
            // Faster than eyes, and building messages is not free.
            if self.last_line.elapsed() >= Duration::from_millis(80) {
                self.last_line = Instant::now();
                bar.set_message(message());
                bar.set_position((share * LENGTH as f64) as u64);
            }
        } else if self.last_line.elapsed() >= LINE_EVERY {
            self.last_line = Instant::now();
            let left_s = self.seconds() * (1.0 - share) / share.max(1e-3);
            let mut line = format!("{}: {:.0} %, about {left_s:.0} s left", self.label, 100.0 * share);
            let message = message();
            if !message.is_empty() {
                let _ = write!(line, ", {message}");
            }
            eprintln!("{line}");
        }
    }

    /// Seconds since the beginning.
    pub fn seconds(&self) -> f64 {
        self.started.elapsed().as_secs_f64()
    }

    /// Ends with one line that stays.
    pub fn end(self, result: &str) {
        let seconds = self.seconds();
        if let Some(bar) = self.bar {
            bar.finish_and_clear();
        }
        eprintln!("{}: {result} ({seconds:.1} s)", self.label);
    }
}

/// Where the time of a command went.
#[derive(Debug, Default)]
pub struct Stopwatch {
    stretches: Vec<(&'static str, f64)>,
}

impl Stopwatch {
    /// Adds seconds to a stretch.
    pub fn add(&mut self, stretch: &'static str, seconds: f64) {
        match self.stretches.iter_mut().find(|(name, _)| *name == stretch) {
            Some((_, sum)) => *sum += seconds,
            None => self.stretches.push((stretch, seconds)),
        }
    }

    /// Prints the sums to stderr.
    pub fn report(&self) {
        let total: f64 = self.stretches.iter().map(|(_, seconds)| seconds).sum();
        let parts: Vec<String> =
            self.stretches.iter().map(|(name, seconds)| format!("{name} {seconds:.1} s")).collect();
        eprintln!("time: {}, {total:.1} s in all", parts.join(", "));
    }
}
