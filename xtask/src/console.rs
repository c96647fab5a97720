//! Progress on stderr: a bar on a terminal, a line every few seconds anywhere else.

use crate::interrupt;
use crate::output::{Output, note};
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
/// Seconds of work that an estimate is worth before there is anything to measure.
const ESTIMATE_S: f64 = 10.0;

/// Shows what is going on and when the whole command will be done, and adds up where the time went.
#[derive(Debug)]
pub(crate) struct Console {
    is_quiet: bool,
    task: RefCell<Option<Task>>,
    plan: RefCell<Plan>,
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
    /// Estimated seconds; `None` if it is not in the plan.
    planned_s: Option<f64>,
    /// The share that was done when it was begun: by a command that was interrupted.
    done_before: Option<f64>,
}

/// How far the running task is.
#[derive(Debug, Clone, Copy)]
struct Done {
    /// The share that is done.
    share: f64,
    /// That of a command before.
    before: f64,
    /// Since it was begun or continued.
    seconds: f64,
}

impl Done {
    /// The share that was done in these seconds.
    fn now(self) -> f64 {
        self.share - self.before
    }

    /// Seconds left of the task, if it goes on like this.
    fn left_s(self) -> f64 {
        self.seconds * (1.0 - self.share) / self.now().max(1e-3)
    }
}

/// Tasks to come with estimated seconds, and how the estimates of those that are done compare with the time they took.
#[derive(Debug, Default)]
pub(crate) struct Plan {
    to_come: Vec<(&'static str, f64)>,
    estimated_s: f64,
    taken_s: f64,
}

impl Plan {
    /// Takes the next task of this stage off the plan, and what was to come before it: that is not needed any more.
    fn begin(&mut self, stage: &str) -> Option<f64> {
        let place = self.to_come.iter().position(|(planned, _)| *planned == stage)?;
        self.to_come.drain(..=place).next_back().map(|(_, seconds)| seconds)
    }

    /// Seconds left of the whole command, given how much of the running task is done.
    fn left_s(&self, planned_s: f64, done: Done) -> f64 {
        let estimated_s = self.estimated_s + planned_s * done.now();
        let pace = (self.taken_s + done.seconds + ESTIMATE_S) / (estimated_s + ESTIMATE_S);
        let to_come_s: f64 = self.to_come.iter().map(|(_, seconds)| seconds).sum();
        // A task that has begun is its own best estimate, once there is something to see of it.
        let planned_left_s = pace * planned_s * (1.0 - done.share);
        let trust = done.now().clamp(0.0, 1.0);
        trust * done.left_s() + (1.0 - trust) * planned_left_s + pace * to_come_s
    }
}

impl Console {
    pub(crate) fn new(output: &Output) -> Self {
        let is_quiet = output.is_quiet();
        Self { is_quiet, task: RefCell::default(), plan: RefCell::default(), stages: RefCell::default() }
    }

    /// The tasks of the whole command, by stage, with the seconds that each is estimated to take.
    pub(crate) fn plan(&self, to_come: Vec<(&'static str, f64)>) {
        self.plan.borrow_mut().to_come = to_come;
    }

    /// Says where the time went.
    pub(crate) fn report_time(&self) {
        let stages = self.stages.borrow();
        // A share of nothing took none.
        if stages.is_empty() {
            return;
        }
        let total: f64 = stages.iter().map(|(_, seconds)| seconds).sum();
        let parts: Vec<String> = stages.iter().map(|(stage, seconds)| format!("{stage} {seconds:.1} s")).collect();
        self.note(&format!("time: {}, {total:.1} s in all", parts.join(", ")));
    }

    fn note(&self, text: &str) {
        if !self.is_quiet {
            note(text);
        }
    }

    /// Ends the running task; its line, if it has a result.
    fn finish(&self, result: Option<&str>) {
        let Some(task) = self.task.borrow_mut().take() else { return };
        let seconds = task.started.elapsed().as_secs_f64();
        if let Some(bar) = task.bar {
            bar.finish_and_clear();
        }
        if let Some(result) = result {
            self.note(&format!("{}: {result} ({seconds:.1} s)", task.label));
        }
        if let Some(planned_s) = task.planned_s {
            let mut plan = self.plan.borrow_mut();
            plan.estimated_s += planned_s * (1.0 - task.done_before.unwrap_or(0.0));
            plan.taken_s += seconds;
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
        let bar = (!self.is_quiet && std::io::stderr().is_terminal()).then(|| {
            let style = ProgressStyle::with_template("{prefix:22} {bar:30} {percent:>3} %  {msg}")
                .expect("the template is well-formed");
            let bar = ProgressBar::with_draw_target(Some(LENGTH), ProgressDrawTarget::stderr()).with_style(style);
            bar.with_prefix(label.to_owned())
        });
        let (now, planned_s) = (Instant::now(), self.plan.borrow_mut().begin(stage));
        let label = label.to_owned();
        *self.task.borrow_mut() =
            Some(Task { stage, label, bar, started: now, last_shown: now, planned_s, done_before: None });
    }

    fn at(&self, share: f64, status: &mut dyn FnMut(Elapsed) -> String) {
        let mut task = self.task.borrow_mut();
        let Some(task) = task.as_mut().filter(|_| !self.is_quiet) else { return };
        let share = share.clamp(0.0, 1.0);
        let before = *task.done_before.get_or_insert(share);
        // Faster than eyes, and building messages is not free.
        let every = if task.bar.is_some() { Duration::from_millis(80) } else { LINE_EVERY };
        if task.last_shown.elapsed() < every {
            return;
        }
        task.last_shown = Instant::now();
        let seconds = task.started.elapsed().as_secs_f64().max(1e-9);
        let done = Done { share, before, seconds };
        // A task that nobody planned is all there is.
        let left_s =
            task.planned_s.map_or_else(|| done.left_s(), |planned_s| self.plan.borrow().left_s(planned_s, done));
        let status = status(Elapsed { seconds });
        let mut line = format!("about {} left", duration(left_s));
        if !status.is_empty() {
            let _ = write!(line, ", {status}");
        }
        if let Some(bar) = &task.bar {
            bar.set_message(line);
            bar.set_position((share * LENGTH as f64) as u64);
        } else {
            note(format_args!("{}: {:.0} %, {line}", task.label, 100.0 * share));
        }
    }

    fn end(&self, result: &str) {
        self.finish(Some(result));
    }

    fn is_cancelled(&self) -> bool {
        interrupt::is_requested()
    }
}

/// `1 lot`, `2 lots`.
pub(crate) fn counted_lots(count: usize) -> String {
    format!("{count} lot{}", if count == 1 { "" } else { "s" })
}

/// `40 s`, `3 min`, `2 h 5 min`.
fn duration(seconds: f64) -> String {
    let minutes = (seconds / 60.0).round() as u64;
    match (seconds, minutes) {
        (..90.0, _) => format!("{seconds:.0} s"),
        (_, ..60) => format!("{minutes} min"),
        _ => format!("{} h {} min", minutes / 60, minutes % 60),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_left_is_that_of_the_whole_command() {
        let mut plan = Plan { to_come: vec![("a", 100.0), ("b", 50.0), ("c", 50.0)], ..Plan::default() };
        let at = |share, seconds| Done { share, before: 0.0, seconds };
        let planned_s = plan.begin("a").unwrap();
        assert!((plan.left_s(planned_s, at(0.0, 0.0)) - 200.0).abs() < 1e-9, "the estimate, before anything is seen");
        // Twice as slow as estimated, half of the first task in.
        let left_s = plan.left_s(planned_s, at(0.5, 100.0));
        assert!((250.0..400.0).contains(&left_s), "{left_s}");
        plan.estimated_s += 100.0;
        plan.taken_s += 200.0;
        // A task that is skipped is not waited for.
        let planned_s = plan.begin("c").unwrap();
        let left_s = plan.left_s(planned_s, at(0.0, 0.0));
        assert!((90.0..101.0).contains(&left_s), "{left_s}");
        assert_eq!(plan.begin("b"), None);
        assert_eq!([45.0, 600.0, 7500.0].map(duration), ["45 s", "10 min", "2 h 5 min"]);
    }
    /// What was done before counted as done at once: a tenth that takes ten minutes was "about 7 s left".
    #[test]
    fn the_time_left_after_an_interruption_is_that_of_what_is_left() {
        let done = Done { share: 0.95, before: 0.9, seconds: 300.0 };
        assert!((done.left_s() - 300.0).abs() < 1e-6);
        let plan = Plan::default();
        let left_s = plan.left_s(6000.0, done);
        assert!((250.0..350.0).contains(&left_s), "{left_s}");
    }
}
