//! Runs pooled: counts, rates and what they say about the drivers (methods.md 8).

mod read;
mod slices;

pub use slices::{Comparison, DriverEstimate, Slice};

use crate::evaluate::Plan;
use crate::failures::Cause;
use crate::lots::Lot;
use crate::trials::Trial;
use serde::Serialize;
use sim::episode::EpisodeReport;
use sim::frame::Ending;
use sim::scenario::Direction;
use statistics::poisson::Rate;
use std::collections::BTreeMap;

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
    /// Road-wheel angle steered, radians.
    pub steering_effort_rad: f64,
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

/// Lots that share a row of the tables: a lot by itself, or all generated lots of one kind.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LotGroup {
    /// As [`Lot::family`].
    pub name: String,
    /// Lots in it.
    pub lots: usize,
    /// Whether drivers were trained on it.
    pub is_trained_on: bool,
}

impl LotGroup {
    /// Its name in tables.
    pub fn label(&self) -> String {
        if self.lots == 1 { self.name.clone() } else { format!("{} ({} lots)", self.name, self.lots) }
    }
}

/// One run, as far as it is kept: the bootstrap needs every one of them.
#[derive(Debug, Clone, Copy, PartialEq)]
struct RunSummary {
    job: u32,
    family: u32,
    /// Units of one cluster are resampled together.
    cluster: u32,
    near_collisions: u32,
    reference_m: f32,
    safe_ratio: f32,
    driven_m: f32,
    steering_reversals: u32,
}

/// One driver at one noise level.
#[derive(Debug, Clone, Default)]
struct DriverResults {
    /// In the order of the jobs.
    units: Vec<RunSummary>,
    /// By family and direction.
    totals: BTreeMap<(u32, Direction), Totals>,
    /// By family.
    causes: BTreeMap<(u32, Cause), u32>,
    /// By family: near-collisions at the place of the one before.
    again: BTreeMap<u32, u32>,
}

/// Everything that is kept of an evaluation: sums, and 32 bytes per run.
#[derive(Debug)]
pub struct EvaluationResults {
    families: Vec<LotGroup>,
    /// LotGroup and cluster of a lot by name; no cluster where every run is one.
    lots: BTreeMap<String, (u32, Option<u32>)>,
    /// By noise level, then by driver.
    drivers: Vec<Vec<DriverResults>>,
}

impl EvaluationResults {
    /// Nothing driven yet.
    pub fn new(plan: &Plan<'_>) -> Self {
        // Specs that no longer stand for anything (a file that moved) were trained on by nobody here.
        let trained_on: Vec<String> = plan
            .settings
            .training
            .lots
            .iter()
            .filter_map(|spec| Lot::parse_all(&[spec]).ok())
            .flatten()
            .map(|lot| lot.family())
            .collect();
        let mut results = Self {
            families: Vec::new(),
            lots: BTreeMap::new(),
            drivers: vec![vec![DriverResults::default(); plan.entries.len()]; plan.settings.evaluation.noise.len()],
        };
        for (index, lot) in plan.lots.iter().enumerate() {
            let name = lot.family();
            let family = results.families.iter().position(|family| family.name == name).unwrap_or_else(|| {
                let is_trained_on = trained_on.contains(&name);
                results.families.push(LotGroup { name, lots: 0, is_trained_on });
                results.families.len() - 1
            });
            results.families[family].lots += 1;
            let cluster = lot.is_generated().then_some(index as u32);
            results.lots.insert(lot.name().to_owned(), (family as u32, cluster));
        }
        results
    }

    /// Takes a run into account: which level and driver of the plan, which of its jobs. Jobs come in order.
    pub fn add(&mut self, level: usize, driver: usize, job_index: usize, job: &Trial<'_>, report: &EpisodeReport) {
        let (family, cluster) = self.lots[job.lot.name()];
        let account = &mut self.drivers[level][driver];
        account.totals.entry((family, job.direction)).or_default().add(report);
        let metrics = &report.metrics;
        account.units.push(RunSummary {
            job: job_index as u32,
            family,
            // Behind the lots, of which each can be a cluster.
            cluster: cluster.unwrap_or(self.lots.len() as u32 + job_index as u32),
            near_collisions: metrics.near_collisions,
            reference_m: metrics.reference_m,
            safe_ratio: metrics.safe_ratio,
            driven_m: metrics.driven_m,
            steering_reversals: metrics.steering_reversals,
        });
    }

    /// Takes the cause of a near-collision into account, and whether it is one more at the same place.
    pub fn add_cause(&mut self, level: usize, driver: usize, lot: &Lot, cause: Cause, is_again: bool) {
        let (family, _) = self.lots[lot.name()];
        let account = &mut self.drivers[level][driver];
        *account.causes.entry((family, cause)).or_default() += 1;
        *account.again.entry(family).or_default() += u32::from(is_again);
    }

    /// Families, in the order of the plan.
    pub fn families(&self) -> &[LotGroup] {
        &self.families
    }

    /// Sums over a slice, in one direction or both.
    pub fn totals(&self, level: usize, driver: usize, slice: &Slice, direction: Option<Direction>) -> Totals {
        let mut sum = Totals::default();
        for (&(family, way), totals) in &self.drivers[level][driver].totals {
            if slice.contains(family) && direction.is_none_or(|direction| direction == way) {
                sum.merge(totals);
            }
        }
        sum
    }

    /// Mean over (lot, direction) of the rate per 100 m and of the safe ratio, all with the same weight whatever their
    /// length: the paper's "mean".
    pub fn unweighted(&self, level: usize, driver: usize, slice: &Slice) -> [f64; 2] {
        let cells = self.drivers[level][driver].totals.iter().filter(|((family, _), _)| slice.contains(*family));
        let (mut n, mut rate, mut safe_ratio) = (0, 0.0, 0.0);
        for (_, totals) in cells {
            n += 1;
            rate += totals.rate().per_unit;
            safe_ratio += totals.safe_ratio();
        }
        [rate, safe_ratio].map(|sum| sum / f64::from(n.max(1)))
    }

    /// Near-collisions of a cause within a slice.
    pub fn count_of_cause(&self, level: usize, driver: usize, slice: &Slice, cause: Cause) -> u32 {
        let counts = &self.drivers[level][driver].causes;
        counts.iter().filter(|((family, of), _)| *of == cause && slice.contains(*family)).map(|(_, n)| n).sum()
    }

    /// Near-collisions at the place of the one before within a slice.
    pub fn count_of_again(&self, level: usize, driver: usize, slice: &Slice) -> u32 {
        let counts = &self.drivers[level][driver].again;
        counts.iter().filter(|(family, _)| slice.contains(**family)).map(|(_, n)| n).sum()
    }
}

#[cfg(test)]
mod tests;
