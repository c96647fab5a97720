//! How far must be driven: before an evaluation, not after it.

use super::poisson;
use statrs::distribution::{Binomial, ContinuousCDF as _, Discrete as _, DiscreteCDF as _, Normal, Poisson};

/// Expected events of both drivers up to which the power is computed exactly; beyond, the square-root approximation is one
/// or two per cent too short.
const EXACT_UP_TO: f64 = 3000.0;

/// Where the search for the length of a drive begins, hundreds of metres.
const SHORTEST: f64 = 0.01;

/// Metres without an event that show, one-sided, a rate below `per_100m` (docs/methods.md 8.3: 0.1 → 3 km at 95 %).
pub fn to_bound(per_100m: f64, confidence: f64) -> f64 {
    100.0 * poisson::upper_bound(0, confidence) / per_100m
}

/// Two rates to be told apart, per 100 m, and how surely.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Question {
    /// The rates, per 100 m; they differ and neither is negative.
    pub per_100m: [f64; 2],
    /// Probability of seeing the difference, 0…1.
    pub power: f64,
    /// Two-sided level of the exact test, 0…1.
    pub alpha: f64,
    /// Variance over mean of the counts, ≥ 1 (quasi-Poisson: it multiplies the metres).
    pub dispersion: f64,
}

impl Question {
    /// Metres that each of the two drivers must drive.
    pub fn metres_each(&self) -> f64 {
        let [a, b] = self.per_100m;
        let approximate = self.hundred_metres_by_square_roots();
        let exact = if (a + b) * approximate > EXACT_UP_TO {
            approximate
        } else {
            let enough =
                |hundred_metres: f64| power([a * hundred_metres, b * hundred_metres], self.alpha) >= self.power;
            // Where little power is asked for, the approximation may be no metre at all.
            let (mut low, mut high) = (0.0, approximate.max(SHORTEST));
            while !enough(high) {
                (low, high) = (high, 2.0 * high);
            }
            for _ in 0..40 {
                let middle = 0.5 * (low + high);
                if enough(middle) {
                    high = middle;
                } else {
                    low = middle;
                }
                if high - low < 1e-4 * high {
                    break;
                }
            }
            high
        };
        100.0 * exact * self.dispersion
    }

    /// √n of a Poisson count has variance ¼ whatever its mean: (z₁ + z₂)² / (2 (√a − √b)²).
    fn hundred_metres_by_square_roots(&self) -> f64 {
        let z = |probability| Normal::standard().inverse_cdf(probability);
        let [a, b] = self.per_100m;
        // Less power than α/2 is there without any.
        let (sum, gap) = ((z(1.0 - 0.5 * self.alpha) + z(self.power)).max(0.0), a.sqrt() - b.sqrt());
        sum * sum / (2.0 * gap * gap)
    }
}

/// Probability that the exact conditional test finds the difference of two expected counts on equal exposures.
pub fn power(expected: [f64; 2], alpha: f64) -> f64 {
    let both = expected[0] + expected[1];
    if both <= 0.0 {
        return 0.0;
    }
    let total = Poisson::new(both).expect("a positive mean");
    let reach = 8.0 * both.sqrt() + 20.0;
    let (first, last) = ((both - reach).max(1.0) as u64, (both + reach) as u64);
    let mut critical: Option<u64> = None;
    let mut power = 0.0;
    for n in first..=last {
        let fair = Binomial::new(0.5, n).expect("a probability");
        // The largest count that is significantly small; it grows with n, by at most one a step.
        let is_significant = |k: u64| 2.0 * fair.cdf(k) <= alpha;
        let mut next = critical.map_or(0, |k| k + 1);
        while is_significant(next) {
            critical = Some(next);
            next += 1;
        }
        if let Some(k) = critical {
            let real = Binomial::new(expected[0] / both, n).expect("a probability");
            power += total.pmf(n) * (real.cdf(k) + real.sf(n - k - 1));
        }
    }
    power
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_of_methods_8_3() {
        assert!((to_bound(0.1, 0.95) - 2995.7).abs() < 0.1, "three kilometres");
        assert!((to_bound(0.01, 0.95) - 29_957.3).abs() < 1.0, "thirty kilometres");
    }

    /// Against a driver without events six are needed (2/2⁶ < .05), and a mean of ½χ²(.8; 12) = 7.906 gives six with a
    /// probability of 80 %.
    #[test]
    fn against_zero_the_answer_is_a_poisson_quantile() {
        let question = Question { per_100m: [1.0, 0.0], power: 0.8, alpha: 0.05, dispersion: 1.0 };
        assert!((question.metres_each() - 790.6).abs() < 0.2, "{}", question.metres_each());
        let twice = Question { per_100m: [0.0, 2.0], dispersion: 3.0, ..question };
        assert!((twice.metres_each() - 1.5 * 790.6).abs() < 0.3, "{}", twice.metres_each());
    }

    /// Six expected events against none, summed by hand: P(Poisson(6) ≥ 6) = 0.5543 (table of the Poisson distribution).
    #[test]
    fn power_against_zero_is_a_poisson_tail() {
        assert!((power([6.0, 0.0], 0.05) - 0.5543).abs() < 5e-5);
        assert_eq!(power([0.0, 0.0], 0.05), 0.0);
        assert!(power([50.0, 50.0], 0.05) <= 0.05, "an exact test keeps its level");
    }

    /// Here the approximation is no metre at all, and twice nothing is nothing: the search never ended.
    #[test]
    fn less_power_than_chance_is_answered() {
        let question = Question { per_100m: [1.0, 2.0], power: 0.25, alpha: 0.5, dispersion: 1.0 };
        assert!((0.0..1000.0).contains(&question.metres_each()), "{}", question.metres_each());
        let question = Question { per_100m: [1.4, 1.39], power: 0.01, alpha: 0.05, dispersion: 1.0 };
        assert!(question.metres_each() < 1000.0, "chance alone has nearly as much: {}", question.metres_each());
    }

    #[test]
    fn exact_and_approximate_answers_agree_for_many_events() {
        let question = Question { per_100m: [1.4, 1.2], power: 0.8, alpha: 0.05, dispersion: 1.0 };
        let approximate = 100.0 * question.hundred_metres_by_square_roots();
        let ratio = question.metres_each() / approximate;
        assert!((1.0..1.06).contains(&ratio), "{ratio}");
    }
}
