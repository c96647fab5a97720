//! How fast lotpilot is: what `cargo xtask bench` prints and docs/performance.md shows.
//!
//! | file | figures |
//! |---|---|
//! | [`driving`] | the closed loop, on one core and on two, with a cheap driver, the network and the expert |
//! | [`evaluating`] | `evaluate` on one thread and on two |
//! | [`maps`] | building a map, starting an episode |
//! | [`network`] | answers and training |
//! | [`page`] | figures as tables in a page |
//! | [`peers`] | other simulators and libraries in the same run |
//!
//! A figure is the median of several measurements, each long enough to leave the start behind, with the least and the
//! largest beside it. Nothing here asserts a time.

pub mod driving;
pub mod evaluating;
pub mod maps;
pub mod network;
pub mod page;
pub mod peers;

use std::time::{Duration, Instant};

/// The network that drives, as drivers are named: the one that ships. One that is not trained is given up before it has driven
/// far, and has other zeros among its sums.
const NETWORK: &str = "trained:default";

/// One figure.
#[derive(Debug, Clone, PartialEq)]
pub struct Figure {
    /// What was measured.
    pub what: String,
    /// The median.
    pub median: f64,
    /// The least and the largest measurement.
    pub range: (f64, f64),
    /// The unit of all three.
    pub unit: &'static str,
    /// What it should be.
    pub goal: Option<Goal>,
}

/// What a figure should be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Goal {
    /// The larger the better.
    AtLeast(f64),
    /// The smaller the better.
    AtMost(f64),
}

impl Goal {
    /// Whether a figure meets it.
    pub fn is_met(self, value: f64) -> bool {
        match self {
            Self::AtLeast(least) => value >= least,
            Self::AtMost(most) => value <= most,
        }
    }
}

/// How long to measure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Effort {
    /// Measurements per figure; 1 or more.
    pub repeats: usize,
    /// Least duration of one measurement.
    pub at_least: Duration,
    /// Optimiser steps of a training.
    pub training_steps: u32,
}

impl Effort {
    /// The effort for docs/performance.md: about twenty minutes on two cores.
    pub fn full() -> Self {
        Self { repeats: 5, at_least: Duration::from_secs(2), training_steps: 5000 }
    }

    /// The effort for a quick look: about two minutes.
    pub fn quick() -> Self {
        Self { repeats: 3, at_least: Duration::from_millis(500), training_steps: 500 }
    }
}

/// Collects figures; called with each as soon as it is there.
pub type Report<'a> = &'a mut dyn FnMut(Figure);

/// Work done per second. `work` does some and says how much.
fn rate(effort: Effort, what: &str, unit: &'static str, goal: Option<Goal>, mut work: impl FnMut() -> f64) -> Figure {
    let mut once = || {
        let began = now();
        let mut done = 0.0;
        while began.elapsed() < effort.at_least {
            done += work();
        }
        done / began.elapsed().as_secs_f64()
    };
    figure(what, unit, goal, (0..effort.repeats).map(|_| once()).collect())
}

/// Time of one call, in units of `unit_s` seconds.
fn time(
    effort: Effort,
    what: &str,
    (unit, unit_s): (&'static str, f64),
    goal: Option<Goal>,
    mut call: impl FnMut(),
) -> Figure {
    let mut per_second = rate(effort, what, unit, goal, || {
        call();
        1.0
    });
    let seconds = |rate: f64| 1.0 / rate / unit_s;
    per_second.median = seconds(per_second.median);
    per_second.range = (seconds(per_second.range.1), seconds(per_second.range.0));
    per_second
}

fn figure(what: &str, unit: &'static str, goal: Option<Goal>, mut measured: Vec<f64>) -> Figure {
    measured.sort_by(f64::total_cmp);
    let range = (measured[0], measured[measured.len() - 1]);
    Figure { what: what.to_owned(), median: measured[measured.len() / 2], range, unit, goal }
}

/// One figure over another.
fn ratio(what: &str, above: &Figure, below: &Figure, goal: Goal) -> Figure {
    let range = (above.range.0 / below.range.1, above.range.1 / below.range.0);
    Figure { what: what.to_owned(), median: above.median / below.median, range, unit: "×", goal: Some(goal) }
}

#[expect(clippy::disallowed_methods, reason = "what this crate is for")]
fn now() -> Instant {
    Instant::now()
}

/// Runs on a pool of this many threads.
fn on_threads<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> T {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads can be started");
    pool.install(work)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_figure_is_a_median_and_a_ratio_reaches_as_far_as_both_figures_do() {
        let of = |measured: [f64; 3]| figure("x", "s", None, measured.to_vec());
        let (above, below) = (of([4.0, 2.0, 3.0]), of([1.5, 1.0, 2.0]));
        assert_eq!((above.median, above.range), (3.0, (2.0, 4.0)));
        let gain = ratio("gain", &above, &below, Goal::AtLeast(2.0));
        assert_eq!((gain.median, gain.range, gain.unit), (2.0, (1.0, 4.0), "×"));
        assert!(Goal::AtLeast(2.0).is_met(gain.median) && !Goal::AtLeast(2.1).is_met(gain.median));
        assert!(Goal::AtMost(2.0).is_met(gain.median) && !Goal::AtMost(1.9).is_met(gain.median));
    }
}
