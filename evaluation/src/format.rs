//! How rates, differences and p-values are written.

use crate::judge::DriverEstimate;
use crate::statistics::bootstrap::Interval;
use crate::statistics::comparison::RateRatio;
use crate::statistics::poisson::{CONFIDENCE, DISPERSION_MAX, Rate, upper_bound};
use crate::totals::Totals;

/// The bootstrap's interval of a rate where events cluster, so that what takes them for independent may not be quoted
/// (docs/methods.md 8.3).
pub fn clustered(estimate: &DriverEstimate) -> Option<Interval> {
    estimate.per_100m.filter(|_| is_clustered(estimate.dispersion.map(|dispersion| dispersion.index)))
}

/// Whether events of an index of dispersion cluster.
fn is_clustered(dispersion: Option<f64>) -> bool {
    dispersion.is_some_and(|index| index > DISPERSION_MAX)
}

/// The interval that may be quoted (docs/methods.md 8.3), near-collisions per 100 m: the exact one or, where events cluster,
/// the farther ends of the exact one and the bootstrap's.
pub fn quoted_interval(totals: &Totals, estimate: &DriverEstimate) -> [f64; 2] {
    let rate = totals.rate();
    let bootstrap = estimate.per_100m.map(|interval| [interval.lower, interval.upper]);
    quotable([rate.lower, rate.upper], bootstrap, estimate.dispersion.map(|dispersion| dispersion.index))
}

/// The same from the exact interval, the bootstrap's and the index of dispersion.
pub(crate) fn quotable(exact: [f64; 2], bootstrap: Option<[f64; 2]>, dispersion: Option<f64>) -> [f64; 2] {
    wider(exact, bootstrap.filter(|_| is_clustered(dispersion)))
}

/// The interval of contacts that may be quoted, per 100 m: the farther ends of the exact one and the bootstrap's, whatever their
/// dispersion, because one drive along a wall has many.
pub fn contacts_interval(totals: &Totals, estimate: &DriverEstimate) -> [f64; 2] {
    let rate = totals.contact_rate();
    let bootstrap = estimate.contacts_per_100m.map(|interval| [interval.lower, interval.upper]);
    wider([rate.lower, rate.upper], bootstrap)
}

/// Contacts, and their rate with the interval that may be quoted.
pub fn quoted_contacts(totals: &Totals, estimate: &DriverEstimate) -> String {
    let rate = with_interval(totals.contact_rate().per_unit, contacts_interval(totals, estimate), 2);
    format!("{}: {rate}", totals.contacts)
}

/// As many digits as are asked for, or more (four at most) where a value that is not zero would look like zero.
fn digits_of(value: f64, digits: usize) -> usize {
    let is_shown = |&digits: &usize| format!("{value:.digits$}").contains(|digit: char| ('1'..='9').contains(&digit));
    (digits..=4).find(is_shown).unwrap_or(digits)
}

/// The farther ends of the exact interval and, if it counts, the bootstrap's: clusters make that wider, and of few events it may
/// be narrower by chance.
fn wider(exact: [f64; 2], bootstrap: Option<[f64; 2]>) -> [f64; 2] {
    bootstrap.map_or(exact, |[lower, upper]| [lower.min(exact[0]), upper.max(exact[1])])
}

/// The rate with the interval that may be quoted (docs/methods.md 8.3).
pub fn quoted_rate(totals: &Totals, estimate: &DriverEstimate) -> String {
    if clustered(estimate).is_none() {
        return exact_rate(totals.near_collisions, totals.reference_m);
    }
    format!("{} (b)", with_interval(totals.rate().per_unit, quoted_interval(totals, estimate), 2))
}

/// The rate with its exact interval; for a count of zero the bound it really supports.
pub fn exact_rate(near_collisions: u32, reference_m: f64) -> String {
    let Rate { per_unit, lower, upper } = Rate::new(near_collisions, reference_m / 100.0);
    let interval = with_interval(per_unit, [lower, upper], 2);
    if near_collisions > 0 {
        return interval;
    }
    format!("{interval}, < {:.3} one-sided", bound_per_100m(0, reference_m))
}

/// The one-sided upper bound that a count supports, near-collisions per 100 m.
pub fn bound_per_100m(near_collisions: u32, reference_m: f64) -> f64 {
    100.0 * upper_bound(near_collisions, CONFIDENCE) / reference_m
}

/// An estimate with its interval.
pub fn interval(of: Interval, digits: usize) -> String {
    with_interval(of.estimate, [of.lower, of.upper], digits)
}

/// A value with the ends of its interval: with so many digits, or more where the upper end would look like zero.
pub fn with_interval(value: f64, [lower, upper]: [f64; 2], digits: usize) -> String {
    let digits = digits_of(upper, digits);
    format!("{value:.digits$} [{lower:.digits$}, {upper:.digits$}]")
}

/// A difference with its interval; `*` if that excludes zero, by enough units.
pub fn difference(interval: Option<Interval>, digits: usize) -> String {
    interval.map_or_else(
        || "–".to_owned(),
        |interval| {
            let Interval { estimate, lower, upper, .. } = interval;
            let is_marked = interval.excludes_zero();
            // A mark beside an end that looks like zero would contradict it.
            let digits = if is_marked { digits_of(lower.abs().min(upper.abs()), digits) } else { digits };
            let mark = if is_marked { " *" } else { "" };
            format!("{estimate:+.digits$} [{lower:+.digits$}, {upper:+.digits$}]{mark}")
        },
    )
}

/// A ratio of rates with its interval.
pub fn rate_ratio(ratio: &RateRatio) -> String {
    let or = |none: &str, end: Option<f64>| end.map_or_else(|| none.to_owned(), |end| format!("{end:.2}"));
    format!("{} [{:.2}, {}]", or("–", ratio.ratio), ratio.lower, or("∞", ratio.upper))
}

/// A p-value to four decimals.
pub fn p_value(p: f64) -> String {
    if p < 1e-4 { "< .0001".to_owned() } else { format!("{p:.4}") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::statistics::poisson::Dispersion;

    /// Of three near-collisions of one drive in 280 km the tables said "0.00 [0.00, 0.00] (b)".
    #[test]
    fn a_small_rate_does_not_look_like_none_where_near_collisions_cluster() {
        let totals = Totals { near_collisions: 3, reference_m: 280_306.0, ..Totals::default() };
        let rate = Interval { estimate: 0.00107, lower: 0.0, upper: 0.0036, units: 1000, apart: 1 };
        let dispersion = Some(Dispersion { index: 3.0, freedom: 999, p_value: 0.0 });
        let estimate = DriverEstimate { dispersion, per_100m: Some(rate), ..DriverEstimate::default() };
        assert_eq!(quoted_rate(&totals, &estimate), "0.001 [0.000, 0.004] (b)");
        assert_eq!(interval(rate, 2), "0.001 [0.000, 0.004]");
        assert_eq!(interval(rate, 3), "0.001 [0.000, 0.004]");
        assert_eq!(with_interval(0.1, [0.05, 0.2], 2), "0.10 [0.05, 0.20]");
    }

    #[test]
    fn a_zero_says_what_it_supports_and_clusters_are_quoted_by_the_bootstrap() {
        assert_eq!(exact_rate(0, 5180.0), "0.00 [0.00, 0.07], < 0.058 one-sided");
        assert_eq!(exact_rate(71, 5180.0), "1.37 [1.07, 1.73]");
        assert_eq!(exact_rate(0, 280_306.0), "0.000 [0.000, 0.001], < 0.001 one-sided", "it was [0.00, 0.00]");
        let totals = Totals { near_collisions: 71, reference_m: 5180.0, ..Totals::default() };
        let interval = Interval { estimate: 1.37, lower: 0.9, upper: 2.0, units: 15, apart: 15 };
        let estimate = |index| DriverEstimate {
            dispersion: Some(Dispersion { index, freedom: 9, p_value: 0.1 }),
            per_100m: Some(interval),
            ..DriverEstimate::default()
        };
        assert_eq!(quoted_rate(&totals, &estimate(1.5)), "1.37 [1.07, 1.73]");
        assert_eq!(quoted_rate(&totals, &estimate(1.6)), "1.37 [0.90, 2.00] (b)");
        assert_eq!(difference(Some(interval), 1), "+1.4 [+0.9, +2.0] *");
        assert_eq!(quoted_interval(&totals, &estimate(1.6)), [0.9, 2.0]);
        let narrow =
            DriverEstimate { per_100m: Some(Interval { lower: 1.2, upper: 1.5, ..interval }), ..estimate(1.6) };
        assert_eq!(
            quoted_rate(&totals, &narrow),
            "1.37 [1.07, 1.73] (b)",
            "never narrower than of events that come alone"
        );
        let totals = Totals { contacts: 4, ..totals };
        let contacts = |lower, upper| {
            let contacts_per_100m = Some(Interval { estimate: 0.077, lower, upper, units: 15, apart: 15 });
            quoted_contacts(&totals, &DriverEstimate { contacts_per_100m, ..DriverEstimate::default() })
        };
        // Garwood's interval of 4 is [1.09, 10.24].
        assert_eq!(contacts(0.0, 0.3), "4: 0.08 [0.00, 0.30]", "all of them in one drive");
        assert_eq!(contacts(0.05, 0.1), "4: 0.08 [0.02, 0.20]");
        let none = Totals { reference_m: 93_118.0, ..Totals::default() };
        assert_eq!(quoted_contacts(&none, &DriverEstimate::default()), "0: 0.000 [0.000, 0.004]");
        let beside_zero = Interval { estimate: -0.0054, lower: -0.0112, upper: -0.0011, ..interval };
        assert_eq!(difference(Some(beside_zero), 2), "-0.005 [-0.011, -0.001] *", "it was -0.01 [-0.01, -0.00] *");
        let around_zero = Interval { lower: -0.1, ..interval };
        assert_eq!(difference(Some(around_zero), 1), "+1.4 [-0.1, +2.0]");
        let ratio = RateRatio { ratio: Some(1.97), lower: 0.86, upper: Some(4.28), p_value: 0.08 };
        assert_eq!(rate_ratio(&ratio), "1.97 [0.86, 4.28]");
        assert_eq!(rate_ratio(&RateRatio { ratio: None, upper: None, ..ratio }), "– [0.86, ∞]");
    }
}
