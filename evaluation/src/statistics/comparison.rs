//! Two rates compared exactly, as if every event were independent of the others.

use super::bootstrap::Interval;
use super::poisson::CONFIDENCE;
use serde::Serialize;
use statrs::distribution::{Beta, Binomial, ContinuousCDF as _, Discrete as _};

/// Two-sided exact binomial test: the probability of all outcomes that are no more likely than the observed one.
///
/// As R's `binom.test`, its tolerance of 10⁻⁷ for equal likelihoods included.
pub fn binomial_test(successes: u32, trials: u32, probability: f64) -> f64 {
    let binomial = Binomial::new(probability, u64::from(trials)).expect("a probability");
    let observed = binomial.pmf(u64::from(successes));
    let as_rare = (0..=trials).map(|k| binomial.pmf(u64::from(k))).filter(|&pmf| pmf <= observed * (1.0 + 1e-7));
    as_rare.sum::<f64>().min(1.0)
}

/// Exact two-sided interval of a probability.
///
/// Source: Clopper and Pearson, The use of confidence or fiducial limits illustrated in the case of the binomial,
/// Biometrika 26 (1934).
pub fn clopper_pearson(successes: u32, trials: u32, confidence: f64) -> [f64; 2] {
    let tail = 0.5 * (1.0 - confidence);
    let quantile = |probability, a: u32, b: u32| {
        Beta::new(f64::from(a), f64::from(b)).expect("positive shapes").inverse_cdf(probability)
    };
    let failures = trials - successes;
    let lower = if successes == 0 { 0.0 } else { quantile(tail, successes, failures + 1) };
    let upper = if failures == 0 { 1.0 } else { quantile(1.0 - tail, successes + 1, failures) };
    [lower, upper]
}

/// One rate over another. Given the sum of both counts, the first is binomial with p = E₁/(E₁ + E₂) if the rates are
/// equal (docs/methods.md 8.3; R's `poisson.test` with two counts).
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct RateRatio {
    /// First rate / second rate; `None` without an event in the second.
    pub ratio: Option<f64>,
    /// Lower end of the 95 % interval.
    pub lower: f64,
    /// Upper end; `None` = unbounded.
    pub upper: Option<f64>,
    /// Two-sided exact p-value of equal rates.
    pub p_value: f64,
}

impl RateRatio {
    /// The ratio of two `(events, exposure)` with exposures > 0.
    pub fn new((events_1, exposure_1): (u32, f64), (events_2, exposure_2): (u32, f64)) -> Self {
        let both = events_1 + events_2;
        // p / (1 − p) = ratio · E₁ / E₂
        let ratio_of = |p: f64| (p < 1.0).then(|| p / (1.0 - p) * exposure_2 / exposure_1);
        let [lower, upper] = clopper_pearson(events_1, both, CONFIDENCE);
        Self {
            ratio: (events_2 > 0).then(|| f64::from(events_1) / exposure_1 / (f64::from(events_2) / exposure_2)),
            lower: if both == 0 { 0.0 } else { ratio_of(lower).unwrap_or(0.0) },
            upper: if both == 0 { None } else { ratio_of(upper) },
            p_value: binomial_test(events_1, both, exposure_1 / (exposure_1 + exposure_2)),
        }
    }
}

/// The interval of a rate over another, from the intervals of both, where events of the first cluster. The second is a rate
/// and its interval, whose upper end must be less than twice the rate.
///
/// Source: Donner and Zou, Closed-form confidence intervals for functions of the normal mean and standard deviation,
/// Statistical Methods in Medical Research 21 (2012).
pub fn ratio_of_intervals(first: Interval, (second, [second_lower, second_upper]): (f64, [f64; 2])) -> [f64; 2] {
    let Interval { estimate, lower, upper, .. } = first;
    let both = estimate * second;
    let end = |first_end: f64, second_end: f64, sign: f64| {
        let below = second_end * (2.0 * second - second_end);
        let under_root = both * both - first_end * (2.0 * estimate - first_end) * below;
        (both + sign * under_root.max(0.0).sqrt()) / below
    };
    [end(lower, second_upper, -1.0), end(upper, second_lower, 1.0)]
}

/// p-values adjusted for their number, in their order.
///
/// Source: Holm, A simple sequentially rejective multiple test procedure, Scandinavian Journal of Statistics 6 (1979).
pub fn holm(p_values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..p_values.len()).collect();
    order.sort_by(|&a, &b| p_values[a].total_cmp(&p_values[b]));
    let mut adjusted = vec![0.0; p_values.len()];
    let mut largest = 0.0_f64;
    for (rank, &index) in order.iter().enumerate() {
        largest = largest.max(p_values[index] * (p_values.len() - rank) as f64).min(1.0);
        adjusted[index] = largest;
    }
    adjusted
}

#[cfg(test)]
mod tests {
    use super::*;

    fn assert_near(found: f64, expected: f64, tolerance: f64) {
        assert!((found - expected).abs() <= tolerance, "{found} is not {expected}");
    }

    /// Tables of exact binomial limits (Clopper and Pearson's chart; e.g. Documenta Geigy), 95 %.
    #[test]
    fn exact_binomial_tables() {
        for (successes, trials, lower, upper) in [
            (0, 10, 0.0, 0.3085),
            (1, 10, 0.0025, 0.4450),
            (5, 10, 0.1871, 0.8129),
            (10, 10, 0.6915, 1.0),
            (10, 20, 0.2720, 0.7280),
            (0, 100, 0.0, 0.0362),
        ] {
            let [found_lower, found_upper] = clopper_pearson(successes, trials, 0.95);
            assert_near(found_lower, lower, 5e-5);
            assert_near(found_upper, upper, 5e-5);
        }
    }

    /// The example in the manual of R's `binom.test(682, 682 + 243, p = 3/4)` (Conover 1971): p = 0.3825, interval
    /// 0.7076683 … 0.7654066.
    #[test]
    fn the_example_of_r_binom_test() {
        assert_near(binomial_test(682, 925, 0.75), 0.3825, 5e-5);
        let [lower, upper] = clopper_pearson(682, 925, 0.95);
        assert_near(lower, 0.707_668_3, 5e-8);
        assert_near(upper, 0.765_406_6, 5e-8);
    }

    /// The sign test: 1 of 10 → 2·11/1024, 5 of 10 → 1, 0 of 6 → 2/64.
    #[test]
    fn the_sign_test_in_closed_form() {
        assert_near(binomial_test(1, 10, 0.5), 22.0 / 1024.0, 1e-12);
        assert_near(binomial_test(5, 10, 0.5), 1.0, 1e-12);
        assert_near(binomial_test(0, 6, 0.5), 2.0 / 64.0, 1e-12);
        assert_near(binomial_test(0, 0, 0.5), 1.0, 1e-12);
    }

    /// The example in the manual of R's `poisson.test(c(11, 6+8+7), c(800, 1083+1050+878))` (breast cancer after
    /// fluoroscopy): ratio 1.971488, p = 0.07967, interval 0.8584264 … 4.2772659.
    #[test]
    fn the_example_of_r_poisson_test_with_two_rates() {
        let found = RateRatio::new((11, 800.0), (21, 3011.0));
        assert_near(found.ratio.unwrap(), 1.971_488, 5e-7);
        assert_near(found.p_value, 0.079_67, 5e-6);
        assert_near(found.lower, 0.858_426_4, 5e-7);
        assert_near(found.upper.unwrap(), 4.277_265_9, 5e-7);
    }

    /// A rate that is known makes the ratio as uncertain as the other is; where both are not, by hand.
    #[test]
    fn intervals_of_two_rates_make_that_of_their_ratio() {
        let first = Interval { estimate: 4.0, lower: 4.0, upper: 4.0, units: 1, apart: 1 };
        let [lower, upper] = ratio_of_intervals(first, (2.0, [1.6, 2.5]));
        assert_near(lower, 4.0 / 2.5, 1e-12);
        assert_near(upper, 4.0 / 1.6, 1e-12);
        let [lower, upper] = ratio_of_intervals(Interval { lower: 3.0, upper: 6.0, ..first }, (2.0, [2.0, 2.0]));
        assert_near(lower, 1.5, 1e-12);
        assert_near(upper, 3.0, 1e-12);
        // (8 − √(64 − 3·5·2.5·1.5)) / 3.75 and (8 + √(64 − 6·2·1.6·2.4)) / 3.84
        let [lower, upper] = ratio_of_intervals(Interval { lower: 3.0, upper: 6.0, ..first }, (2.0, [1.6, 2.5]));
        assert_near(lower, (8.0 - 7.75_f64.sqrt()) / 3.75, 1e-12);
        assert_near(upper, (8.0 + 17.92_f64.sqrt()) / 3.84, 1e-12);
        let none = Interval { estimate: 0.0, lower: 0.0, upper: 0.5, units: 1, apart: 0 };
        assert_near(ratio_of_intervals(none, (2.0, [1.6, 2.5]))[0], 0.0, 1e-12);
    }

    #[test]
    fn tentacle_and_vvf_of_the_paper_do_not_differ_and_dagger_does() {
        let found = RateRatio::new((71, 51.8), (75, 51.8));
        assert!(found.p_value > 0.7 && found.lower < 1.0 && found.upper.unwrap() > 1.0, "{found:?}");
        let found = RateRatio::new((0, 51.8), (71, 51.8));
        assert_near(found.p_value, libm::exp2(-70.0), 1e-24);
        assert_eq!((found.ratio, found.lower), (Some(0.0), 0.0));
        let nothing = RateRatio::new((0, 51.8), (0, 51.8));
        assert_eq!((nothing.ratio, nothing.lower, nothing.upper, nothing.p_value), (None, 0.0, None, 1.0));
    }

    /// R: `p.adjust(c(0.01, 0.04, 0.03, 0.005), "holm")` = 0.03 0.06 0.06 0.02.
    #[test]
    fn holm_steps_down() {
        for (found, expected) in holm(&[0.01, 0.04, 0.03, 0.005]).into_iter().zip([0.03, 0.06, 0.06, 0.02]) {
            assert_near(found, expected, 1e-12);
        }
    }
}
