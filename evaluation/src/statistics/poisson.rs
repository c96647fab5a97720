//! Counts of rare events over an exposure.

use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF as _};

/// Two-sided confidence of every interval that is printed.
pub const CONFIDENCE: f64 = 0.95;

/// Above this dispersion the events cannot be taken for independent: the exact interval alone is too narrow to be quoted
/// (docs/methods.md 8.3).
pub const DISPERSION_MAX: f64 = 1.5;

/// Quantile of the χ² distribution with `2·half_freedom` degrees of freedom, halved.
fn half_chi_squared(probability: f64, half_freedom: u32) -> f64 {
    let chi_squared = ChiSquared::new(2.0 * f64::from(half_freedom)).expect("at least two degrees of freedom");
    0.5 * chi_squared.inverse_cdf(probability)
}

/// Exact two-sided interval of the expected count, given the observed one: `[½χ²(q; 2n), ½χ²(1 − q; 2n + 2)]` with
/// q = (1 − confidence)/2.
///
/// Source: Garwood, Fiducial limits for the Poisson distribution, Biometrika 28 (1936).
pub fn garwood_interval(events: u32, confidence: f64) -> [f64; 2] {
    let tail = 0.5 * (1.0 - confidence);
    let lower = if events == 0 { 0.0 } else { half_chi_squared(tail, events) };
    [lower, half_chi_squared(1.0 - tail, events + 1)]
}

/// Exact one-sided upper bound of the expected count: what a count, above all zero, really supports. Zero events bound
/// the expected count by −ln(1 − confidence), "three" at 95 %.
pub fn upper_bound(events: u32, confidence: f64) -> f64 {
    half_chi_squared(confidence, events + 1)
}

/// Events per unit of exposure with Garwood's 95 % interval.
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
    /// Events over an exposure > 0.
    pub fn new(events: u32, exposure: f64) -> Self {
        let [lower, upper] = garwood_interval(events, CONFIDENCE);
        Self { per_unit: f64::from(events) / exposure, lower: lower / exposure, upper: upper / exposure }
    }
}

/// How much more the counts of units vary than independent events would: 1 for Poisson counts.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Dispersion {
    /// Variance of the rate of all, where units are drawn within their strata, over that of as many independent events. Not
    /// Pearson's X² over its degrees of freedom, to which a quiet stratum adds as much as the one with most events.
    pub index: f64,
    /// Degrees of freedom of X²: units less strata.
    pub freedom: u32,
    /// Probability of a larger X² if the events were independent (χ² approximation).
    pub p_value: f64,
}

impl Dispersion {
    /// The dispersion of `(events, exposure)` per unit, stratum by stratum: every stratum may have its own rate, so
    /// that a hard lot and an easy one are not mistaken for clusters. `None` without two units in a stratum that saw an
    /// event.
    pub fn within<'a>(strata: impl IntoIterator<Item = &'a [(u32, f64)]>) -> Option<Self> {
        let sums = |units: &[(u32, f64)]| {
            units.iter().fold((0.0, 0.0), |(n, of), &(events, exposure)| (n + f64::from(events), of + exposure))
        };
        let strata: Vec<&[(u32, f64)]> = strata.into_iter().filter(|units| units.len() > 1).collect();
        let (all_events, all_exposure) = sums(&strata.concat());
        let rate_of_all = all_events / all_exposure;
        let (mut variance, mut x_squared, mut freedom) = (0.0, 0.0, 0);
        for units in strata {
            let (n, (events, exposure)) = (units.len() as f64, sums(units));
            // Drawn once more, a unit adds its exposure as well: what moves the rate of all is what it has beyond that.
            let mean = (events - rate_of_all * exposure) / n;
            let off = |&(events, exposure): &(u32, f64)| f64::from(events) - rate_of_all * exposure - mean;
            variance += n / (n - 1.0) * units.iter().map(off).map(|off| off * off).sum::<f64>();
            if events > 0.0 {
                let of_unit = |&(found, of): &(u32, f64)| {
                    let expected = events / exposure * of;
                    (f64::from(found) - expected) * (f64::from(found) - expected) / expected
                };
                x_squared += units.iter().map(of_unit).sum::<f64>();
                freedom += units.len() as u32 - 1;
            }
        }
        (freedom > 0).then(|| Self {
            index: variance / all_events,
            freedom,
            p_value: ChiSquared::new(f64::from(freedom)).expect("freedom is positive").sf(x_squared),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn assert_interval([lower, upper]: [f64; 2], expected: [f64; 2], digits: i32) {
        let half_a_digit = 0.5 * libm::pow(10.0, -f64::from(digits)) * 1.000_001;
        assert!(
            (lower - expected[0]).abs() <= half_a_digit && (upper - expected[1]).abs() <= half_a_digit,
            "[{lower}, {upper}] is not {expected:?}"
        );
    }

    /// Biometrika Tables for Statisticians, vol. 1, table 40 (Pearson and Hartley): 95 % limits of a Poisson mean.
    #[test]
    fn the_table_of_pearson_and_hartley() {
        for (events, lower, upper, digits) in [
            (0, 0.0, 3.69, 2),
            (1, 0.0253, 5.57, 4),
            (2, 0.242, 7.22, 3),
            (3, 0.619, 8.77, 3),
            (4, 1.09, 10.24, 2),
            (5, 1.62, 11.67, 2),
            (10, 4.80, 18.39, 2),
            (20, 12.22, 30.89, 2),
            (50, 37.11, 65.92, 2),
        ] {
            let [found_lower, found_upper] = garwood_interval(events, 0.95);
            assert_interval([found_lower, 0.0], [lower, 0.0], digits);
            assert!((found_upper - upper).abs() <= 0.0051, "{events}: {found_upper}, the table has {upper}");
        }
    }

    /// The example in the manual of R's `poisson.test(137, 24.19893)`: 95 % interval 4.753125 … 6.692709.
    #[test]
    fn the_example_of_r_poisson_test() {
        let rate = Rate::new(137, 24.19893);
        assert!((rate.per_unit - 5.661_407).abs() < 5e-7, "{rate:?}");
        assert_interval([rate.lower, rate.upper], [4.753_125, 6.692_709], 6);
    }

    /// docs/methods.md 8.3: `DAgger` 0 in 51.8 → [0, .071], one-sided .058; tentacle 71 → [1.07, 1.73]; VVF 75 → [1.14, 1.81];
    /// 13 in 11.55 → [.60, 1.92].
    #[test]
    fn the_figures_of_methods_8_3() {
        for (events, exposure, expected, digits) in [
            (0, 51.8, [0.0, 0.0712], 4),
            (71, 51.8, [1.07, 1.73], 2),
            (75, 51.8, [1.14, 1.81], 2),
            (13, 11.55, [0.60, 1.92], 2),
        ] {
            let rate = Rate::new(events, exposure);
            assert_interval([rate.lower, rate.upper], expected, digits);
        }
        assert!((upper_bound(0, 0.95) / 51.8 - 0.058).abs() < 0.0005);
        assert!((upper_bound(0, 0.95) - libm::log(20.0)).abs() < 1e-9, "the rule of three");
    }

    #[test]
    fn dispersion_is_variance_over_mean() {
        // Counts 0, 2, 4: mean 2, sample variance 4.
        let index = |strata: &[&[(u32, f64)]]| Dispersion::within(strata.iter().copied()).map(|d| (d.index, d.freedom));
        assert_eq!(index(&[&[(0, 1.0), (2, 1.0), (4, 1.0)]]), Some((2.0, 2)));
        // Counts in proportion to the exposure do not vary at all; nor do two lots with a rate each.
        assert_eq!(index(&[&[(1, 10.0), (2, 20.0)]]), Some((0.0, 1)));
        assert_eq!(index(&[&[(1, 1.0), (1, 1.0)], &[(9, 1.0), (9, 1.0)]]), Some((0.0, 2)));
        assert_eq!(index(&[&[(0, 1.0), (0, 1.0)], &[(3, 1.0)]]), None);
    }

    /// Pearson's X² per degree of freedom is 1.4 here: the exact interval, of half the variance, was quoted.
    #[test]
    fn what_varies_where_most_events_are_makes_the_rate_uncertain() {
        let many = [(11, 1.0), (29, 1.0), (20, 1.0), (20, 1.0), (20, 1.0)];
        let few = [(0, 1.0), (1, 1.0), (0, 1.0), (1, 1.0), (0, 1.0)];
        let found = Dispersion::within([&many[..], &few[..]]).unwrap();
        // 5/4 · 162 and 5/4 · 1.2, over 102; X² = 8.1 + 3.
        assert!((found.index - 2.0).abs() < 1e-9, "{found:?}");
        assert!(found.freedom == 8 && (0.15..0.25).contains(&found.p_value), "{found:?}");
    }

    /// A long lot of a hard kind has more events and more metres, but too few of these for so many: which of them are drawn
    /// moves the rate of all, though each has its kind's rate. X² is 0.
    #[test]
    fn lots_of_other_lengths_make_the_rate_uncertain_where_kinds_differ() {
        let (hard, easy) = ([(9, 1.0), (27, 3.0)], [(0, 2.0), (0, 2.0)]);
        let found = Dispersion::within([&hard[..], &easy[..]]).unwrap();
        // 36 in 8: 4.5 each. Of the hard ones 4.5 and 13.5 are beyond that, 4.5 off their mean: 2 · 2 · 4.5² over 36.
        assert!((found.index - 2.25).abs() < 1e-9 && found.p_value > 0.999, "{found:?}");
    }

    /// Bortkiewicz's horse kicks (1898), 200 corps-years: mean .61, variance .6110 (with n − 1), so nearly Poisson.
    #[test]
    fn horse_kicks_are_not_clustered() {
        let mut units = Vec::new();
        for (deaths, corps_years) in [(0, 109), (1, 65), (2, 22), (3, 3), (4, 1)] {
            units.extend(std::iter::repeat_n((deaths, 1.0), corps_years));
        }
        let dispersion = Dispersion::within([&units[..]]).unwrap();
        assert!((dispersion.index - 1.0016).abs() < 5e-4, "{dispersion:?}");
        assert!((0.45..0.52).contains(&dispersion.p_value), "{dispersion:?}");
    }
}
