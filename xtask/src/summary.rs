//! Runs pooled: counts, rates and their intervals (methods.md 8).

use crate::lots::Lot;
use serde::Serialize;
use sim::episode::{Ending, EpisodeReport};
use sim::scenario::Direction;
use statrs::distribution::{ChiSquared, ContinuousCDF as _};

/// Sums over runs.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
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
    /// Runs given up after too many events.
    pub given_up: u32,
    /// Safe ratios of the runs, added up.
    pub safe_ratio_sum: f64,
    /// Smallest clearance in any run, metres.
    pub clearance_min_m: Option<f32>,
    /// Changes of the steering direction.
    pub steering_reversals: u32,
}

impl Totals {
    /// Takes one run into account.
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
        self.given_up += u32::from(report.ending == Ending::TooManyEvents);
        self.safe_ratio_sum += f64::from(metrics.safe_ratio);
        self.clearance_min_m = smaller(self.clearance_min_m, Some(metrics.clearance_min_m));
        self.steering_reversals += metrics.steering_reversals;
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
    }

    /// Near-collisions per 100 m of route with their interval.
    pub fn rate(&self) -> Rate {
        Rate::new(self.near_collisions, self.reference_m / 100.0)
    }

    /// Mean over runs.
    pub fn safe_ratio(&self) -> f64 {
        self.safe_ratio_sum / f64::from(self.runs.max(1))
    }

    /// Driven way per simulated time, m/s.
    pub fn mean_speed_mps(&self) -> f64 {
        self.driven_m / self.duration_s.max(f64::MIN_POSITIVE)
    }
}

fn smaller(a: Option<f32>, b: Option<f32>) -> Option<f32> {
    [a, b].into_iter().flatten().filter(|value| value.is_finite()).min_by(f32::total_cmp)
}

/// Events per exposure with the exact Poisson 95 % interval of Garwood.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Rate {
    /// Events per unit of exposure.
    pub per_unit: f64,
    /// Lower end of the interval.
    pub lower: f64,
    /// Upper end of the interval.
    pub upper: f64,
}

impl Rate {
    /// `[½χ²(.025; 2n), ½χ²(.975; 2n + 2)] / exposure`.
    pub fn new(events: u32, exposure: f64) -> Self {
        let half_quantile = |probability, freedom: u32| {
            0.5 * ChiSquared::new(f64::from(freedom)).map_or(0.0, |chi2| chi2.inverse_cdf(probability))
        };
        let lower = if events == 0 { 0.0 } else { half_quantile(0.025, 2 * events) };
        let upper = half_quantile(0.975, 2 * events + 2);
        Self { per_unit: f64::from(events) / exposure, lower: lower / exposure, upper: upper / exposure }
    }
}

/// One driver on one lot in one direction.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Cell {
    /// Who drove.
    pub driver: String,
    /// Where.
    pub lot: String,
    /// The row of the printed table the lot belongs to.
    pub family: String,
    /// Which way.
    pub direction: Direction,
    /// What came of it.
    pub totals: Totals,
}

/// Cells in the order in which they were first met.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Cells(pub Vec<Cell>);

impl Cells {
    /// Takes one run into account.
    pub fn add(&mut self, driver: &str, lot: &Lot, direction: Direction, report: &EpisodeReport) {
        let is_it = |cell: &Cell| cell.driver == driver && cell.lot == lot.name() && cell.direction == direction;
        let index = self.0.iter().position(is_it).unwrap_or_else(|| {
            self.0.push(Cell {
                driver: driver.to_owned(),
                lot: lot.name().to_owned(),
                family: lot.family(),
                direction,
                totals: Totals::default(),
            });
            self.0.len() - 1
        });
        self.0[index].totals.add(report);
    }

    /// Drivers, in order.
    pub fn drivers(&self) -> Vec<&str> {
        distinct(self.0.iter().map(|cell| cell.driver.as_str()))
    }

    /// Lots, in order.
    pub fn lots(&self) -> Vec<&str> {
        distinct(self.0.iter().map(|cell| cell.lot.as_str()))
    }

    /// Families of lots, in order.
    pub fn families(&self) -> Vec<&str> {
        distinct(self.0.iter().map(|cell| cell.family.as_str()))
    }

    /// A family in tables: the name of its only lot, or how many there are.
    pub fn family_label(&self, family: &str) -> String {
        let lots = distinct(self.0.iter().filter(|cell| cell.family == family).map(|cell| cell.lot.as_str()));
        match lots[..] {
            [lot] => lot.to_owned(),
            _ => format!("{family} ({} lots)", lots.len()),
        }
    }

    /// Sums over the cells that are wanted.
    pub fn pooled(&self, wanted: impl Fn(&Cell) -> bool) -> Totals {
        let mut totals = Totals::default();
        self.0.iter().filter(|cell| wanted(cell)).for_each(|cell| totals.merge(&cell.totals));
        totals
    }
}

fn distinct<'a>(names: impl Iterator<Item = &'a str>) -> Vec<&'a str> {
    let mut seen = Vec::new();
    for name in names {
        if !seen.contains(&name) {
            seen.push(name);
        }
    }
    seen
}

#[cfg(test)]
mod tests {
    use super::*;

    /// methods.md 8.3: `DAgger` 0 in 51.8 → [0, .071]; tentacle 71 → [1.07, 1.73]; 13 in 11.55 → [.60, 1.92].
    #[test]
    fn garwood_intervals_of_methods_8_3() {
        for (events, exposure, lower, upper) in
            [(0, 51.8, 0.0, 0.071), (71, 51.8, 1.07, 1.73), (75, 51.8, 1.14, 1.81), (13, 11.55, 0.60, 1.92)]
        {
            let rate = Rate::new(events, exposure);
            assert!((rate.lower - lower).abs() < 0.005 && (rate.upper - upper).abs() < 0.005, "{events}: {rate:?}");
        }
    }

    #[test]
    fn cells_pool_over_lots_and_directions() {
        use sim::metrics::EpisodeMetrics;
        let report = |near_collisions, safe_ratio| EpisodeReport {
            ending: Ending::ReachedEnd,
            metrics: EpisodeMetrics { near_collisions, safe_ratio, reference_m: 50.0, ..EpisodeMetrics::default() },
            events: Vec::new(),
        };
        let lots = Lot::parse_all(&["lot-a", "lot-b", "test:2"]).unwrap();
        let mut cells = Cells::default();
        cells.add("x", &lots[0], Direction::Forward, &report(1, 0.5));
        cells.add("x", &lots[0], Direction::Reverse, &report(2, 0.7));
        cells.add("x", &lots[1], Direction::Forward, &report(4, 0.9));
        cells.add("y", &lots[2], Direction::Forward, &report(8, 0.1));
        cells.add("y", &lots[3], Direction::Forward, &report(8, 0.1));
        assert_eq!(cells.drivers(), ["x", "y"]);
        assert_eq!(cells.lots(), ["lot-a", "lot-b", "test-medium-0", "test-medium-1"]);
        let labels: Vec<String> = cells.families().iter().map(|family| cells.family_label(family)).collect();
        assert_eq!(labels, ["lot-a", "lot-b", "test-medium (2 lots)"]);
        let on_a = cells.pooled(|cell| cell.driver == "x" && cell.lot == "lot-a");
        assert_eq!((on_a.near_collisions, on_a.runs), (3, 2));
        assert!((on_a.rate().per_unit - 3.0).abs() < 1e-9, "three in one hundred metres");
        assert!((cells.pooled(|cell| cell.driver == "x").safe_ratio() - 0.7).abs() < 1e-6);
        assert_eq!(cells.pooled(|cell| cell.family == "test-medium").near_collisions, 16);
    }
}
