//! The mean of a few values, and what it adds to an interval that knows nothing of them.

use super::bootstrap::Interval;
use super::poisson::CONFIDENCE;
use statrs::distribution::{ContinuousCDF as _, StudentsT};
use statrs::statistics::Statistics as _;

/// Half of the 95 % interval of the mean of a normal population from which `values` were drawn: t·s/√n. 0 of fewer than
/// two, which say nothing about others.
///
/// Source: Student, The probable error of a mean, Biometrika 6 (1908).
pub fn half_width_of_mean(values: &[f64]) -> f64 {
    if values.len() < 2 {
        return 0.0;
    }
    let n = values.len() as f64;
    let t = StudentsT::new(0.0, 1.0, n - 1.0).expect("at least one degree of freedom");
    t.inverse_cdf(0.5 * (1.0 + CONFIDENCE)) * (values.variance() / n).sqrt()
}

/// The interval of an estimate that errs by two independent parts: by one as `interval` says, by the other up to ±
/// `half_width`. Distances from the estimate add up as squares, to either side by itself.
///
/// Source: Zou and Donner, Construction of confidence limits about effect measures, Statistics in Medicine 27 (2008).
pub fn widened(interval: Interval, half_width: f64) -> Interval {
    let Interval { estimate, lower, upper, .. } = interval;
    Interval {
        lower: estimate - together(estimate - lower, half_width),
        upper: estimate + together(upper - estimate, half_width),
        ..interval
    }
}

/// How far two independent parts err together.
pub fn together(a: f64, b: f64) -> f64 {
    (a * a + b * b).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_of_five_has_the_published_quantile() {
        // s = √2.5, t of four degrees of freedom: 2.776445.
        let expected = 2.776_445 * (2.5_f64 / 5.0).sqrt();
        let found = half_width_of_mean(&[1.0, 2.0, 3.0, 4.0, 5.0]);
        assert!((found - expected).abs() < 1e-5, "{found} {expected}");
        assert_eq!([half_width_of_mean(&[]), half_width_of_mean(&[7.0])], [0.0, 0.0]);
        assert_eq!(half_width_of_mean(&[7.0, 7.0, 7.0]), 0.0);
    }

    #[test]
    fn independent_errors_add_up_as_squares() {
        let interval = Interval { estimate: 10.0, lower: 7.0, upper: 22.0, units: 9, apart: 9 };
        assert_eq!(widened(interval, 0.0), interval);
        let both = widened(interval, 4.0);
        assert_eq!([both.lower, both.upper], [5.0, 10.0 + 160.0_f64.sqrt()]);
        let both = widened(interval, 5.0);
        assert_eq!(both.upper, 23.0);
    }
}
