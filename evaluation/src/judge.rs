//! How drivers compare in a slice of the lots, judged by resampling (docs/methods.md 8.3).

use crate::results::{EvaluationResults, RunSummary, SAMPLE_MIN};
use crate::slices::Slice;
use crate::statistics::bootstrap::{DRAWS, Interval, Units};
use crate::statistics::comparison::{RateRatio, holm};
use crate::statistics::poisson::Dispersion;
use serde::Serialize;
use sim::seed::RootSeed;
use std::collections::{BTreeMap, BTreeSet};

/// A driver in a slice, judged by resampling.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct DriverEstimate {
    /// How clustered its near-collisions are; `None` where that cannot be said.
    pub dispersion: Option<Dispersion>,
    /// Near-collisions per 100 m; `None` where a single trial or lot is all there is.
    pub per_100m: Option<Interval>,
    /// Safe ratio, mean over runs.
    pub safe_ratio: Option<Interval>,
    /// Contacts per 100 m.
    pub contacts_per_100m: Option<Interval>,
}

/// A driver against the reference driver. Differences are driver − reference, so that a positive one of
/// near-collisions, and a negative one of safe ratios, favours the reference.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Comparison {
    /// Index of the driver in the plan.
    #[serde(skip)]
    pub driver: usize,
    /// Runs both have driven.
    pub pairs: usize,
    /// Near-collisions per 100 m, paired bootstrap; `None` where a single trial or lot is all there is.
    pub difference_per_100m: Option<Interval>,
    /// Safe ratio, paired bootstrap.
    pub difference_safe_ratio: Option<Interval>,
    /// Steering reversals per 100 m driven, paired bootstrap.
    pub difference_reversals_per_100m: Option<Interval>,
    /// Rates, exact if events are independent.
    pub ratio: RateRatio,
    /// Its p-value, adjusted for the number of drivers compared (Holm).
    pub p_holm: f64,
}

impl EvaluationResults {
    /// How the drivers stand in a slice at a noise level, and how they compare with one of them. What is independent is
    /// resampled (docs/methods.md 8.3): whole trials of fixed lots, both ways, because they share their obstacles;
    /// whole lots within their kind of generated lots, which are a sample themselves, and also of six or more lots from
    /// files where they are pooled (chosen). What is alone of its kind is drawn with the others that are. Only runs that all
    /// drivers have driven count.
    pub fn judge(
        &self,
        level: usize,
        slice: &Slice,
        with: usize,
        seed: RootSeed,
    ) -> (Vec<DriverEstimate>, Vec<Comparison>) {
        let pairs = self.common_runs(level, slice);
        let drivers = self.drivers[level].len();
        let mut estimates = vec![DriverEstimate::default(); drivers];
        if pairs.is_empty() {
            return (estimates, Vec::new());
        }
        let strata = strata(&pairs, slice.is_pooled());
        for (driver, estimate) in estimates.iter_mut().enumerate() {
            estimate.dispersion = dispersion(&strata, driver);
        }
        let others: Vec<usize> = (0..drivers).filter(|&driver| driver != with).collect();
        let intervals = bootstrap(&strata, &others, with, seed);
        let interval = |place: usize, which: Statistic| Some(intervals.as_ref()?[STATISTICS * place + which as usize]);
        for (driver, estimate) in estimates.iter_mut().enumerate() {
            estimate.per_100m = interval(driver, Statistic::NearCollisions);
            estimate.safe_ratio = interval(driver, Statistic::SafeRatio);
            estimate.contacts_per_100m = interval(driver, Statistic::Contacts);
        }
        let counts = |driver: usize| {
            let runs = pairs.iter().map(|row| row[driver]);
            let (events, metres) = runs.fold((0, 0.0), |(events, metres), run| {
                (events + run.near_collisions, metres + f64::from(run.reference_m))
            });
            (events, metres / 100.0)
        };
        let ratios: Vec<RateRatio> = others.iter().map(|&other| RateRatio::new(counts(other), counts(with))).collect();
        let p_holm = holm(&ratios.iter().map(|ratio| ratio.p_value).collect::<Vec<_>>());
        let comparisons = others.iter().zip(ratios).zip(p_holm).enumerate().map(|(i, ((&driver, ratio), p_holm))| {
            let place = drivers + i;
            Comparison {
                driver,
                pairs: pairs.len(),
                difference_per_100m: interval(place, Statistic::NearCollisions),
                difference_safe_ratio: interval(place, Statistic::SafeRatio),
                difference_reversals_per_100m: interval(place, Statistic::Reversals),
                ratio,
                p_holm,
            }
        });
        (estimates, comparisons.collect())
    }

    /// Per trial of the slice that every driver has finished, the runs of all drivers.
    pub(crate) fn common_runs(&self, level: usize, slice: &Slice) -> Vec<Vec<RunSummary>> {
        let Some((first, rest)) = self.drivers[level].split_first() else { return Vec::new() };
        let of_trial = |runs: &[RunSummary], trial: u32| {
            runs.binary_search_by_key(&trial, |run| run.trial).ok().map(|index| runs[index])
        };
        let row = |run: &RunSummary| {
            let rest = rest.iter().map(|results| of_trial(&results.runs, run.trial));
            std::iter::once(Some(*run)).chain(rest).collect()
        };
        first.runs.iter().filter(|run| slice.contains(run.group)).filter_map(row).collect()
    }
}

fn dispersion(strata: &[Stratum<'_>], driver: usize) -> Option<Dispersion> {
    let strata: Vec<Vec<(u32, f64)>> = strata
        .iter()
        .map(|clusters| {
            let cluster = |rows: &[Vec<RunSummary>]| {
                let runs = rows.iter().map(|row| row[driver]);
                runs.fold((0, 0.0), |(n, m), run| (n + run.near_collisions, m + f64::from(run.reference_m)))
            };
            clusters.iter().map(|rows| cluster(rows)).collect()
        })
        .collect();
    Dispersion::within(strata.iter().map(Vec::as_slice))
}

/// Clusters of runs, resampled among each other: of each its runs, and of each run all drivers.
pub(crate) type Stratum<'a> = Vec<&'a [Vec<RunSummary>]>;

/// Trials are ordered lot by lot, so clusters lie together; the lots of a stratum need not.
pub(crate) fn strata(pairs: &[Vec<RunSummary>], is_pooled: bool) -> Vec<Stratum<'_>> {
    let of_sample = pairs.iter().filter(|row| row[0].is_of_sample).map(|row| row[0].group);
    let are_sample = is_pooled && of_sample.collect::<BTreeSet<_>>().len() >= SAMPLE_MIN;
    let is_of_sample = |row: &[RunSummary]| are_sample && row[0].is_of_sample;
    let cluster = |row: &[RunSummary]| if is_of_sample(row) { (true, row[0].group) } else { (false, row[0].cluster) };
    let mut strata: BTreeMap<Option<u32>, Stratum<'_>> = BTreeMap::new();
    for rows in pairs.chunk_by(|a, b| cluster(a) == cluster(b)) {
        let group = (!is_of_sample(&rows[0])).then_some(rows[0][0].group);
        strata.entry(group).or_default().push(rows);
    }
    collapsed(strata.into_values().collect())
}

/// Strata of one cluster, which every draw would have alike as if its rate were known, as one stratum; a single such one goes to
/// the smallest other. What differs between them counts as chance then: intervals are rather too wide.
///
/// Source: collapsed strata, Cochran, Sampling Techniques, 3rd edition, 5A.12 (1977).
fn collapsed(strata: Vec<Stratum<'_>>) -> Vec<Stratum<'_>> {
    let (single, mut strata): (Vec<_>, Vec<_>) = strata.into_iter().partition(|clusters| clusters.len() == 1);
    let joined: Stratum<'_> = single.into_iter().flatten().collect();
    match strata.iter_mut().min_by_key(|clusters| clusters.len()) {
        Some(smallest) if joined.len() == 1 => smallest.extend(joined),
        _ if joined.is_empty() => {}
        _ => strata.push(joined),
    }
    strata
}

/// What is resampled of every driver, by its place among them.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Statistic {
    /// Near-collisions per 100 m of route.
    NearCollisions,
    /// Safe ratio, mean over runs.
    SafeRatio,
    /// Steering reversals per 100 m driven.
    Reversals,
    /// Contacts per 100 m of route.
    Contacts,
}

/// How many there are.
pub(crate) const STATISTICS: usize = 4;
/// Sums per driver that they are made of, behind the runs and the hundreds of metres that all share.
const COLUMNS: usize = 5;
const SHARED: usize = 2;

/// How many sums some drivers have.
pub(crate) fn columns(drivers: usize) -> usize {
    SHARED + COLUMNS * drivers
}

/// Adds a trial, of all drivers, to the sums.
pub(crate) fn add(sums: &mut [f64], row: &[RunSummary]) {
    sums[0] += 1.0;
    sums[1] += f64::from(row[0].reference_m) / 100.0;
    for (sums, run) in sums[SHARED..].chunks_exact_mut(COLUMNS).zip(row) {
        sums[0] += f64::from(run.near_collisions);
        sums[1] += f64::from(run.safe_ratio);
        sums[2] += f64::from(run.steering_reversals);
        sums[3] += f64::from(run.driven_m) / 100.0;
        sums[4] += f64::from(run.contacts);
    }
}

/// The statistics of a driver: by [`Statistic`].
pub(crate) fn statistics(sums: &[f64], driver: usize) -> [f64; STATISTICS] {
    let [near_collisions, safe_ratio, reversals, driven_100m, contacts] =
        sums[SHARED..].as_chunks::<COLUMNS>().0[driver];
    let [runs, reference_100m] = sums.as_chunks::<SHARED>().0[0];
    [
        near_collisions / reference_100m,
        safe_ratio / runs,
        reversals / driven_100m.max(f64::MIN_POSITIVE),
        contacts / reference_100m,
    ]
}

/// The hundreds of metres of route in the sums.
pub(crate) fn reference_100m(sums: &[f64]) -> f64 {
    sums[1]
}

/// The sums of each cluster.
pub(crate) fn units(strata: &[Stratum<'_>], drivers: usize) -> Units {
    let mut units = Units::new(columns(drivers));
    let mut sums = vec![0.0; columns(drivers)];
    for clusters in strata {
        units.begin_stratum();
        for rows in clusters {
            sums.fill(0.0);
            for row in *rows {
                add(&mut sums, row);
            }
            units.push(&sums);
        }
    }
    units
}

/// The statistics of every driver, then the differences of every other driver from `with`. `None` if nothing varies
/// because there is a single cluster.
fn bootstrap(strata: &[Stratum<'_>], others: &[usize], with: usize, seed: RootSeed) -> Option<Vec<Interval>> {
    let drivers = strata[0][0][0].len();
    let of_sums = |sums: &[f64], out: &mut [f64]| {
        let (of_drivers, differences) = out.split_at_mut(STATISTICS * drivers);
        for (driver, out) in of_drivers.chunks_exact_mut(STATISTICS).enumerate() {
            out.copy_from_slice(&statistics(sums, driver));
        }
        for (&other, out) in others.iter().zip(differences.chunks_exact_mut(STATISTICS)) {
            for (which, difference) in out.iter_mut().enumerate() {
                *difference = of_drivers[STATISTICS * other + which] - of_drivers[STATISTICS * with + which];
            }
        }
    };
    let varies = strata.iter().any(|clusters| clusters.len() > 1);
    let outputs = STATISTICS * (drivers + others.len());
    varies.then(|| units(strata, drivers).percentile_intervals(seed, DRAWS, outputs, &of_sums))
}
