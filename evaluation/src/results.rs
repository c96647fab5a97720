//! Results of an evaluation: sums, and a few numbers per run.

use crate::incidents::Cause;
use crate::plan::Plan;
use crate::slices::{LotGroup, Slice};
use crate::totals::Totals;
use experiment::lots::Lot;
use experiment::trials::Trial;
use sim::episode::EpisodeReport;
use sim::scenario::Direction;
use std::collections::{BTreeMap, BTreeSet};

/// What is kept of one run: the bootstrap needs every one of them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct RunSummary {
    pub(crate) trial: u32,
    pub(crate) group: u32,
    /// Runs that share obstacles: they are resampled together.
    pub(crate) cluster: u32,
    /// Whether its lot is one of several from files: where they are pooled, they are the sample.
    pub(crate) is_of_sample: bool,
    pub(crate) near_collisions: u32,
    pub(crate) reference_m: f32,
    pub(crate) safe_ratio: f32,
    pub(crate) driven_m: f32,
    pub(crate) steering_reversals: u32,
    pub(crate) contacts: u32,
}

/// One driver at one noise level.
#[derive(Debug, Clone, Default)]
pub(crate) struct DriverResults {
    /// The runs in the order of the trials.
    pub(crate) runs: Vec<RunSummary>,
    /// Sums by group and direction.
    totals: BTreeMap<(u32, Direction), Totals>,
    /// Near-collisions by group and cause.
    causes: BTreeMap<(u32, Cause), u32>,
    /// Near-collisions at the place of the one before, by group.
    again: BTreeMap<u32, u32>,
}

/// Everything that is kept of an evaluation: sums, and 40 bytes per run.
#[derive(Debug)]
pub struct EvaluationResults {
    groups: Vec<LotGroup>,
    /// The lots by name.
    lots: BTreeMap<String, Place>,
    /// Results by noise level, then by driver.
    pub(crate) drivers: Vec<Vec<DriverResults>>,
}

/// So many lots from files are a sample of their kind (chosen: as many units as an interval needs to exclude zero).
pub(crate) const SAMPLE_MIN: usize = 6;

/// How the runs of a lot are counted.
#[derive(Debug, Clone, Copy)]
struct Place {
    group: u32,
    clusters: Clusters,
    is_of_sample: bool,
}

/// Which runs of a lot share obstacles.
#[derive(Debug, Clone, Copy)]
enum Clusters {
    /// All, whichever way and however often: a generated lot is a draw itself.
    WholeLot(u32),
    /// Both ways of a trial, counted from here.
    Trials(u32),
}

impl Clusters {
    fn of(self, trial: &Trial<'_>) -> u32 {
        match self {
            Self::WholeLot(cluster) => cluster,
            Self::Trials(first) => first + trial.index,
        }
    }
}

impl EvaluationResults {
    /// Nothing driven yet.
    pub fn new(plan: &Plan<'_>) -> Self {
        // Every driver's, and those of the settings. A lot from a file is known by its digest, wherever the file is now.
        let of_drivers = plan.drivers.iter().flat_map(|driver| &driver.trained_on.lots);
        let named: BTreeSet<&String> = plan.settings.training.lots.iter().chain(of_drivers).collect();
        let known: Vec<Lot> = named
            .into_iter()
            .filter_map(|spec| Lot::parse_all(&[spec], &plan.settings.episode.vehicle).ok())
            .flatten()
            .collect();
        // Two files may give one name to different ground, and two names to the same.
        let trained_on: BTreeSet<String> = known.iter().filter(|lot| !lot.is_from_file()).map(Lot::group).collect();
        let of_trainings = plan.drivers.iter().flat_map(|driver| driver.trained_on.digests.iter().cloned());
        let digests: BTreeSet<String> = of_trainings.chain(known.iter().filter_map(Lot::digest)).collect();
        let mut results = Self {
            groups: Vec::new(),
            lots: BTreeMap::new(),
            drivers: vec![vec![DriverResults::default(); plan.drivers.len()]; plan.settings.evaluation.noise.len()],
        };
        let mut free_cluster = 0;
        let mut index_of: BTreeMap<String, usize> = BTreeMap::new();
        for lot in plan.lots {
            let group = *index_of.entry(lot.group()).or_insert_with_key(|name| {
                let is_trained_on =
                    trained_on.contains(name) || lot.digest().is_some_and(|digest| digests.contains(&digest));
                results.groups.push(LotGroup { name: name.clone(), lots: 0, is_trained_on });
                results.groups.len() - 1
            });
            results.groups[group].lots += 1;
            let (clusters, count) = if lot.is_generated() {
                (Clusters::WholeLot(free_cluster), 1)
            } else {
                (Clusters::Trials(free_cluster), plan.settings.evaluation.trials)
            };
            free_cluster += count;
            let is_of_sample = lot.is_from_file();
            results.lots.insert(lot.name().to_owned(), Place { group: group as u32, clusters, is_of_sample });
        }
        results
    }

    /// Adds a run of a noise level, driver and trial of the plan. Trials come in order.
    pub fn add(&mut self, level: usize, driver: usize, trial_index: usize, trial: &Trial<'_>, report: &EpisodeReport) {
        let Place { group, clusters, is_of_sample } = self.lots[trial.lot.name()];
        let driver_results = &mut self.drivers[level][driver];
        driver_results.totals.entry((group, trial.direction)).or_default().add(report);
        let metrics = &report.metrics;
        driver_results.runs.push(RunSummary {
            trial: trial_index as u32,
            group,
            cluster: clusters.of(trial),
            is_of_sample,
            near_collisions: metrics.near_collisions,
            reference_m: metrics.reference_m,
            safe_ratio: metrics.safe_ratio,
            driven_m: metrics.driven_m,
            steering_reversals: metrics.steering_reversals,
            contacts: metrics.contacts,
        });
    }

    /// Adds the cause of a near-collision, and whether it happened at the place of the one before.
    pub fn add_cause(&mut self, level: usize, driver: usize, lot: &Lot, cause: Cause, is_again: bool) {
        let group = self.lots[lot.name()].group;
        let driver_results = &mut self.drivers[level][driver];
        *driver_results.causes.entry((group, cause)).or_default() += 1;
        *driver_results.again.entry(group).or_default() += u32::from(is_again);
    }

    /// Groups of lots, in the order of the plan.
    pub fn groups(&self) -> &[LotGroup] {
        &self.groups
    }

    /// Every slice: each group by itself, then the pooled ones.
    pub fn slices(&self) -> Vec<Slice> {
        Slice::all_of(&self.groups)
    }

    /// Sums over a slice, in one direction or both.
    pub fn totals(&self, level: usize, driver: usize, slice: &Slice, direction: Option<Direction>) -> Totals {
        let totals = &self.drivers[level][driver].totals;
        let is_asked_for = |way: &Direction| direction.is_none_or(|direction| direction == *way);
        let mut sum = Totals::default();
        for &group in slice.groups() {
            let ways = Direction::BOTH.into_iter().filter(is_asked_for);
            ways.filter_map(|way| totals.get(&(group, way))).for_each(|of_way| sum.merge(of_way));
        }
        sum
    }

    /// Mean over (lot, direction) of the rate per 100 m and of the safe ratio, all with the same weight whatever their
    /// length: the paper's "mean". All generated lots of a kind count as one.
    pub fn unweighted(&self, level: usize, driver: usize, slice: &Slice) -> [f64; 2] {
        let totals = &self.drivers[level][driver].totals;
        let both_ways = |&group: &u32| Direction::BOTH.map(|way| totals.get(&(group, way)));
        let (mut n, mut rate, mut safe_ratio) = (0, 0.0, 0.0);
        for totals in slice.groups().iter().flat_map(both_ways).flatten() {
            n += 1;
            rate += totals.rate().per_unit;
            safe_ratio += totals.safe_ratio();
        }
        [rate, safe_ratio].map(|sum| sum / f64::from(n.max(1)))
    }

    /// Near-collisions of a cause within a slice.
    pub fn count_of_cause(&self, level: usize, driver: usize, slice: &Slice, cause: Cause) -> u32 {
        let counts = &self.drivers[level][driver].causes;
        slice.groups().iter().filter_map(|&group| counts.get(&(group, cause))).sum()
    }

    /// Near-collisions at the place of the one before within a slice.
    pub fn count_of_again(&self, level: usize, driver: usize, slice: &Slice) -> u32 {
        let counts = &self.drivers[level][driver].again;
        slice.groups().iter().filter_map(|group| counts.get(group)).sum()
    }
}

#[cfg(test)]
mod tests;
