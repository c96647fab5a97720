//! Intervals that hold however events cluster: resampling whole units.
//!
//! A unit is a row of sums (events, metres, … of every driver in the same place), so that resampling rows is paired: all
//! drivers get the same units in every draw. Rows are drawn with replacement within their stratum: of n rows n − 1, which
//! count n / (n − 1) times, because n of n would spread by (n − 1) / n too little, and strata are often of five.
//!
//! Source: Rao and Wu, Resampling inference with complex survey data, JASA 83 (1988).

use super::poisson::CONFIDENCE;
use rand::RngExt as _;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use sim::seed::{Rng, RootSeed, Stream};

/// Draws of the bootstrap (docs/methods.md 8.3).
pub const DRAWS: u64 = 10_000;

/// Fewer units tell nothing apart at 95 %: among five, all differ to the same side by chance with probability 2·2⁻⁵ = .06,
/// and so a bootstrap of five would exclude zero (the sign test; docs/methods.md 8.3).
pub const UNITS_MIN: u32 = 6;

/// An end so close to zero is zero: more than sums of draws are rounded by, and less than any difference that is one.
const ROUNDING: f64 = 1e-9;

/// Percentile interval of a statistic.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Interval {
    /// The statistic of the units as they are.
    pub estimate: f64,
    /// 2.5 % of the draws are below.
    pub lower: f64,
    /// 2.5 % of the draws are above.
    pub upper: f64,
    /// Units that were resampled; a stratum of one does not count, for it is the same in every draw.
    pub units: u32,
    /// Those of them in which the statistic, of one alone, is not zero: as in the sign test, the others tell nothing apart.
    #[serde(skip)]
    pub apart: u32,
}

impl Interval {
    /// Whether zero lies outside, by at least [`UNITS_MIN`] units that are not zero themselves.
    pub fn excludes_zero(&self) -> bool {
        self.apart >= UNITS_MIN && (self.lower > ROUNDING || self.upper < -ROUNDING)
    }
}

/// Units to resample.
#[derive(Debug, Clone, Default)]
pub struct Units {
    columns: usize,
    /// Row-major, stratum after stratum.
    values: Vec<f64>,
    /// Rows per stratum.
    strata: Vec<u32>,
}

impl Units {
    /// Nothing yet, with so many values per unit.
    pub fn new(columns: usize) -> Self {
        Self { columns, ..Self::default() }
    }

    /// Begins a stratum: what follows is resampled among itself.
    pub fn begin_stratum(&mut self) {
        self.strata.push(0);
    }

    /// Adds a unit to the present stratum.
    ///
    /// # Panics
    /// Without a stratum, or with a wrong number of values.
    pub fn push(&mut self, unit: &[f64]) {
        assert_eq!(unit.len(), self.columns, "every unit has the same columns");
        *self.strata.last_mut().expect("a stratum is begun first") += 1;
        self.values.extend_from_slice(unit);
    }

    /// 95 % percentile intervals of several statistics, each a function of the sums of all columns. `of_sums` writes
    /// `statistics` values. Every draw has its own random stream: the result does not depend on the number of threads.
    pub fn percentile_intervals(
        &self,
        seed: RootSeed,
        draws: u64,
        statistics: usize,
        of_sums: &(dyn Fn(&[f64], &mut [f64]) + Sync),
    ) -> Vec<Interval> {
        let mut estimates = vec![0.0; statistics];
        let mut sums = vec![0.0; self.columns];
        self.values.chunks_exact(self.columns).for_each(|unit| add(&mut sums, unit, 1.0));
        of_sums(&sums, &mut estimates);

        let mut drawn = vec![0.0; draws as usize * statistics];
        drawn.par_chunks_exact_mut(statistics).enumerate().for_each_init(
            || vec![0.0; self.columns],
            |sums, (draw, statistics)| {
                let mut rng = seed.rng(Stream::Bootstrap, draw as u64);
                self.resample(&mut rng, sums);
                of_sums(sums, statistics);
            },
        );
        let tail = 0.5 * (1.0 - CONFIDENCE);
        let units = self.strata.iter().filter(|&&rows| rows > 1).sum();
        let apart = self.apart(statistics, of_sums);
        let interval = |(statistic, &estimate): (usize, &f64)| {
            let mut values: Vec<f64> = drawn.iter().skip(statistic).step_by(statistics).copied().collect();
            values.sort_by(f64::total_cmp);
            let [lower, upper] = [tail, 1.0 - tail].map(|probability| quantile(&values, probability));
            Interval { estimate, lower, upper, units, apart: apart[statistic] }
        };
        estimates.par_iter().enumerate().map(interval).collect()
    }

    /// Of each statistic, in how many of the resampled units it is not zero.
    fn apart(&self, statistics: usize, of_sums: &(dyn Fn(&[f64], &mut [f64]) + Sync)) -> Vec<u32> {
        let (mut apart, mut of_unit) = (vec![0; statistics], vec![0.0; statistics]);
        let mut units = self.values.chunks_exact(self.columns);
        for &rows in &self.strata {
            // A single one is not resampled.
            for unit in units.by_ref().take(rows as usize).filter(|_| rows > 1) {
                of_sums(unit, &mut of_unit);
                for (apart, value) in apart.iter_mut().zip(&of_unit) {
                    *apart += u32::from(value.abs() > ROUNDING);
                }
            }
        }
        apart
    }

    fn resample(&self, rng: &mut Rng, sums: &mut [f64]) {
        sums.fill(0.0);
        let mut first = 0;
        for &rows in &self.strata {
            let row = |row: usize| &self.values[row * self.columns..(row + 1) * self.columns];
            if rows == 1 {
                add(sums, row(first), 1.0);
            }
            for _ in 1..rows {
                let drawn = first + rng.random_range(0..rows) as usize;
                add(sums, row(drawn), f64::from(rows) / f64::from(rows - 1));
            }
            first += rows as usize;
        }
    }
}

fn add(sums: &mut [f64], unit: &[f64], times: f64) {
    for (sum, value) in sums.iter_mut().zip(unit) {
        *sum += times * value;
    }
}

/// A quantile of sorted values, linear between order statistics (type 7 of Hyndman and Fan 1996, R's default).
fn quantile(sorted: &[f64], probability: f64) -> f64 {
    let at = probability * (sorted.len() - 1) as f64;
    let (low, share) = (at as usize, at.fract());
    let high = (low + 1).min(sorted.len() - 1);
    sorted[low] + share * (sorted[high] - sorted[low])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mean_interval(values: &[f64], draws: u64) -> Interval {
        let mut units = Units::new(2);
        units.begin_stratum();
        for &value in values {
            units.push(&[value, 1.0]);
        }
        units.percentile_intervals(RootSeed(1), draws, 1, &|sums, out| out[0] = sums[0] / sums[1])[0]
    }

    #[test]
    fn quantiles_are_those_of_r() {
        // quantile(c(1, 2, 3, 4, 10), c(.25, .9)) = 2, 7.6
        let values = [1.0, 2.0, 3.0, 4.0, 10.0];
        assert_eq!(quantile(&values, 0.25), 2.0);
        assert!((quantile(&values, 0.9) - 7.6).abs() < 1e-12);
        assert_eq!((quantile(&values, 0.0), quantile(&values, 1.0)), (1.0, 10.0));
    }

    /// The bootstrap distribution of a mean of n zeros and ones is binomial, known exactly: n = 100, p = 0.3 has its
    /// 2.5 % and 97.5 % quantiles at 21 and 39.
    #[test]
    fn the_mean_of_zeros_and_ones_has_the_binomial_interval() {
        let values: Vec<f64> = (0..100).map(|i| f64::from(u8::from(i < 30))).collect();
        let interval = mean_interval(&values, DRAWS);
        assert!((interval.estimate - 0.3).abs() < 1e-12);
        assert!((interval.lower - 0.21).abs() < 0.0101 && (interval.upper - 0.39).abs() < 0.0101, "{interval:?}");
    }

    /// Twelve families of three lots each: intervals of 95 % hold the truth of such skewed counts in 90
    /// of 100 repetitions. When three of three were drawn, they held it in 85.
    #[test]
    fn intervals_of_many_small_strata_hold_the_truth_as_often_as_they_say() {
        // Events come in clusters; the mean is 1.
        const EVENTS: [f64; 10] = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 2.0, 6.0];
        const REPETITIONS: u64 = 400;
        let holds = (0..REPETITIONS).filter(|&repetition| {
            let mut rng = RootSeed(7).rng(Stream::Bootstrap, repetition);
            let mut units = Units::new(2);
            for _ in 0..12 {
                units.begin_stratum();
                (0..3).for_each(|_| units.push(&[EVENTS[rng.random_range(0..EVENTS.len())], 1.0]));
            }
            let interval =
                units.percentile_intervals(RootSeed(repetition), 400, 1, &|sums, out| out[0] = sums[0] / sums[1])[0];
            interval.lower <= 1.0 && 1.0 <= interval.upper
        });
        let share = holds.count() as f64 / REPETITIONS as f64;
        assert!((0.885..0.98).contains(&share), "{share}");
    }

    /// Pairing removes what both drivers share, strata what lies between lots.
    #[test]
    fn shared_difficulty_and_strata_do_not_widen_a_difference() {
        let mut units = Units::new(3);
        for lot in [0.0, 50.0] {
            units.begin_stratum();
            for i in 0..10 {
                let shared = lot + f64::from(i * i);
                units.push(&[shared + 1.0, shared, 1.0]);
            }
        }
        let intervals = units.percentile_intervals(RootSeed(1), 500, 2, &|sums, out| {
            out[0] = (sums[0] - sums[1]) / sums[2];
            out[1] = sums[2];
        });
        let is_alone = |interval: Interval, value: f64| {
            (interval.lower - value).abs() < 1e-9 && (interval.upper - value).abs() < 1e-9
        };
        assert!(is_alone(intervals[0], 1.0) && intervals[0].excludes_zero(), "{intervals:?}");
        assert!(is_alone(intervals[1], 20.0), "every draw counts as many units: {intervals:?}");
    }

    #[test]
    fn an_interval_of_two_runs_gets_no_star() {
        assert!(!mean_interval(&[1.0, 1.1], 500).excludes_zero());
        assert!(!mean_interval(&[1.0; 5], 500).excludes_zero());
        assert!(mean_interval(&[1.0; 6], 500).excludes_zero());
        let mut units = Units::new(1);
        for _ in 0..6 {
            units.begin_stratum();
            units.push(&[1.0]);
        }
        let fixed = units.percentile_intervals(RootSeed(1), 500, 1, &|sums, out| out[0] = sums[0])[0];
        assert_eq!((fixed.units, fixed.excludes_zero()), (0, false), "six strata of one: nothing was resampled");
    }

    /// One near-collision more on each of four of 300 lots had a star, where the exact test beside it says p = .125.
    #[test]
    fn units_that_do_not_differ_give_no_star() {
        let more_in = |count: u32| -> Vec<f64> { (0..300).map(|i| f64::from(u8::from(i < count))).collect() };
        let few = mean_interval(&more_in(4), DRAWS);
        assert!(few.lower > 0.0, "all but one draw in fifty have one of the four: {few:?}");
        assert_eq!((few.units, few.apart, few.excludes_zero()), (300, 4, false));
        assert!(mean_interval(&more_in(6), DRAWS).excludes_zero());
    }

    /// Where two drivers have as many near-collisions in a draw, their rates differ by the last bit of a sum. An interval
    /// that ended at −3·10⁻¹⁷ had a star.
    #[test]
    fn an_interval_that_ends_at_zero_gets_no_star() {
        let ends_at = |upper: f64| Interval { estimate: -0.07, lower: -0.14, upper, units: 29, apart: 6 };
        assert!(!ends_at(-2.8e-17).excludes_zero() && ends_at(-1e-4).excludes_zero());
        let begins_at = |lower: f64| Interval { estimate: 0.07, lower, upper: 0.14, units: 29, apart: 6 };
        assert!(!begins_at(2.8e-17).excludes_zero() && begins_at(1e-4).excludes_zero());
    }

    #[test]
    fn one_and_two_threads_draw_the_same() {
        let values: Vec<f64> = (0..50).map(|i| f64::from(i % 7)).collect();
        let with = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| mean_interval(&values, 1000))
        };
        assert_eq!(with(1), with(2));
    }
}
