//! Sums over runs, and the rates computed from them (docs/methods.md 8).

use crate::statistics::poisson::Rate;
use serde::{Deserialize, Serialize};
use sim::episode::EpisodeReport;
use sim::frame::Ending;

/// Sums over runs.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Totals {
    /// Runs driven.
    pub runs: u32,
    /// Length of the routes, metres: what rates are per.
    pub reference_m: f64,
    /// Way driven, metres.
    pub driven_m: f64,
    /// Simulated time, seconds.
    pub duration_s: f64,
    /// Near-collisions.
    pub near_collisions: u32,
    /// Times the body touched something.
    pub contacts: u32,
    /// Times the car got stuck.
    pub stuck: u32,
    /// Runs ended by the time limit.
    pub timed_out: u32,
    /// Runs given up: after too many events, or where nothing ahead on the route is free.
    pub given_up: u32,
    /// Safe ratios of the runs, added up.
    pub safe_ratio_sum: f64,
    /// Smallest clearance in any run, metres.
    pub clearance_min_m: Option<f32>,
    /// Changes of the steering direction.
    pub steering_reversals: u32,
    /// Road-wheel angle steered, radians.
    pub steering_effort_rad: f64,
}

impl Totals {
    /// Adds one run.
    pub fn add(&mut self, report: &EpisodeReport) {
        let metrics = &report.metrics;
        self.runs += 1;
        self.reference_m += f64::from(metrics.reference_m);
        self.driven_m += f64::from(metrics.driven_m);
        self.duration_s += f64::from(metrics.duration_s);
        self.near_collisions += metrics.near_collisions;
        self.contacts += metrics.contacts;
        self.stuck += metrics.stuck;
        self.timed_out += u32::from(report.ending == Ending::TimedOut);
        self.given_up += u32::from(matches!(report.ending, Ending::TooManyEvents | Ending::Blocked));
        self.safe_ratio_sum += f64::from(metrics.safe_ratio);
        self.clearance_min_m = smaller(self.clearance_min_m, Some(metrics.clearance_min_m));
        self.steering_reversals += metrics.steering_reversals;
        self.steering_effort_rad += f64::from(metrics.steering_effort_rad);
    }

    /// Adds other sums.
    pub fn merge(&mut self, other: &Self) {
        self.runs += other.runs;
        self.reference_m += other.reference_m;
        self.driven_m += other.driven_m;
        self.duration_s += other.duration_s;
        self.near_collisions += other.near_collisions;
        self.contacts += other.contacts;
        self.stuck += other.stuck;
        self.timed_out += other.timed_out;
        self.given_up += other.given_up;
        self.safe_ratio_sum += other.safe_ratio_sum;
        self.clearance_min_m = smaller(self.clearance_min_m, other.clearance_min_m);
        self.steering_reversals += other.steering_reversals;
        self.steering_effort_rad += other.steering_effort_rad;
    }

    /// Near-collisions per 100 m of route with their interval.
    pub fn rate(&self) -> Rate {
        Rate::new(self.near_collisions, self.reference_m / 100.0)
    }

    /// Contacts per 100 m of route with their interval.
    pub fn contact_rate(&self) -> Rate {
        Rate::new(self.contacts, self.reference_m / 100.0)
    }

    /// Mean over runs.
    pub fn safe_ratio(&self) -> f64 {
        self.safe_ratio_sum / f64::from(self.runs.max(1))
    }

    /// Steering reversals per 100 m driven: the paper's oscillation as a number.
    pub fn reversals_per_100m(&self) -> f64 {
        100.0 * f64::from(self.steering_reversals) / self.driven_m.max(f64::MIN_POSITIVE)
    }

    /// Road-wheel angle steered per 100 m driven, radians.
    pub fn effort_rad_per_100m(&self) -> f64 {
        100.0 * self.steering_effort_rad / self.driven_m.max(f64::MIN_POSITIVE)
    }

    /// Driven way per simulated time, m/s.
    pub fn mean_speed_mps(&self) -> f64 {
        self.driven_m / self.duration_s.max(f64::MIN_POSITIVE)
    }
}

fn smaller(a: Option<f32>, b: Option<f32>) -> Option<f32> {
    [a, b].into_iter().flatten().filter(|value| value.is_finite()).min_by(f32::total_cmp)
}

#[cfg(test)]
mod tests {
    use super::*;
    use sim::metrics::EpisodeMetrics;

    /// What `merge` forgets is missing of all lots together, and of no lot by itself.
    #[test]
    fn sums_of_parts_are_those_of_all_runs() {
        let run = |ending: Ending, times: u8| {
            let (count, of) = (u32::from(times), f32::from(times));
            let metrics = EpisodeMetrics {
                duration_s: 10.0 * of,
                driven_m: 20.0 * of,
                reference_m: 30.0 * of,
                near_collisions: count,
                contacts: 2 * count,
                stuck: 3 * count,
                safe_ratio: 0.125 * of,
                clearance_min_m: 1.0 / of,
                steering_reversals: 4 * count,
                steering_effort_rad: 5.0 * of,
                ..EpisodeMetrics::default()
            };
            EpisodeReport { ending, metrics, events: Vec::new() }
        };
        let runs = [
            run(Ending::TimedOut, 1),
            run(Ending::Blocked, 2),
            run(Ending::TooManyEvents, 4),
            run(Ending::ReachedEnd, 2),
        ];
        let sum = |runs: &[EpisodeReport]| {
            let mut totals = Totals::default();
            for run in runs {
                totals.add(run);
            }
            totals
        };
        // 1 + 2 + 4 + 2 = 9 times each.
        let expected = Totals {
            runs: 4,
            reference_m: 270.0,
            driven_m: 180.0,
            duration_s: 90.0,
            near_collisions: 9,
            contacts: 18,
            stuck: 27,
            timed_out: 1,
            given_up: 2,
            safe_ratio_sum: 1.125,
            clearance_min_m: Some(0.25),
            steering_reversals: 36,
            steering_effort_rad: 45.0,
        };
        assert_eq!(sum(&runs), expected);
        let mut parts = sum(&runs[..2]);
        parts.merge(&sum(&runs[2..]));
        assert_eq!(parts, expected);
        assert_eq!(parts.mean_speed_mps(), 2.0, "180 m in 90 s");
    }
}
