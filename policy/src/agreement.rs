//! What η̂ means: how often network and expert agree, beside what says how hard that is (docs/methods.md 4.5).
//!
//! Labels of half the range have errors of half the size, so that a network that has learned nothing more agrees more often
//! at the same τ. Hence the share of the ticks with τ̂ < τ stands beside that of the best constant answer, and beside the
//! share at a τ that is scaled as the labels are.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use sim::maths;
use sim::sensing::GridGeometry;
use std::cmp::Reverse;

/// Mean distance of the paper's points ahead of the bumper, metres: 460 m in 6425 samples of 0.05 s, and v = a_y/4.48.
pub const PAPER_LABEL_AHEAD_M: f64 = 460.0 / (6425.0 * 0.05) * 4.48;

/// Shares of the ticks whose τ̂ is at most [`Agreement::tau_hat_quantiles`].
pub const QUANTILES: [f64; 5] = [0.25, 0.5, 0.75, 0.9, 0.99];

/// Network and expert at every tick of a round, whoever drove.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Agreement {
    /// τ of the rule, or the paper's; image fractions.
    pub tau: f64,
    /// τ · mean range of the labels / mean range of the paper's labels, [`PAPER_LABEL_AHEAD_M`]; image fractions.
    pub tau_scaled: f64,
    /// Mean distance of the labels ahead of the bumper, metres.
    pub label_ahead_m: f64,
    /// Share of the ticks with τ̂ < τ.
    pub within_tau: f64,
    /// Share of the ticks with τ̂ < the scaled τ.
    pub within_tau_scaled: f64,
    /// The same of the constant answer that is within τ of the most labels.
    pub constant_within_tau: f64,
    /// The same of the constant answer that is within the scaled τ of the most labels.
    pub constant_within_tau_scaled: f64,
    /// τ̂ that the shares [`QUANTILES`] of the ticks are at or below, image fractions.
    pub tau_hat_quantiles: [f64; 5],
}

impl Agreement {
    /// The agreement, from the discrepancy τ̂ and the label of every tick; `None` without ticks. `bumper_to_patch_m`:
    /// from the front bumper to the lower edge of the patch, metres.
    pub(crate) fn new(
        tau: f32,
        tau_hats: &[f32],
        labels: &[[f32; 2]],
        geometry: &GridGeometry,
        bumper_to_patch_m: f32,
    ) -> Option<Self> {
        let count = tau_hats.len();
        if count == 0 || labels.len() != count {
            return None;
        }
        let ahead_m = |&[_, w]: &[f32; 2]| f64::from(bumper_to_patch_m + (1.0 - w) * geometry.side_m);
        let label_ahead_m = labels.iter().map(ahead_m).sum::<f64>() / count as f64;
        let tau_scaled = f64::from(tau) * label_ahead_m / PAPER_LABEL_AHEAD_M;
        let within =
            |limit: f64| tau_hats.iter().filter(|&&tau_hat| f64::from(tau_hat) < limit).count() as f64 / count as f64;
        let mut sorted = tau_hats.to_vec();
        sorted.sort_by(f32::total_cmp);
        Some(Self {
            tau: f64::from(tau),
            tau_scaled,
            label_ahead_m,
            within_tau: within(f64::from(tau)),
            within_tau_scaled: within(tau_scaled),
            constant_within_tau: best_constant(labels, tau),
            constant_within_tau_scaled: best_constant(labels, tau_scaled as f32),
            tau_hat_quantiles: QUANTILES
                .map(|share| f64::from(sorted[((share * count as f64).ceil() as usize).clamp(1, count) - 1])),
        })
    }
}

/// Candidates for a constant answer, and bins of labels, per image side.
const CELLS: usize = 128;

/// Points that are counted exactly.
const FINALISTS: usize = 64;

/// Share of the labels within `radius` of the best constant answer among 128 × 128 points: the finalists are found on rounded
/// labels, their shares are exact.
fn best_constant(labels: &[[f32; 2]], radius: f32) -> f64 {
    let place = |fraction: f32| ((fraction * CELLS as f32) as usize).min(CELLS - 1);
    let mut counts = vec![0_u32; CELLS * CELLS];
    for &[u, w] in labels {
        counts[place(w) * CELLS + place(u)] += 1;
    }
    let filled: Vec<(usize, u32)> = counts.iter().copied().enumerate().filter(|&(_, count)| count > 0).collect();
    let centre = |cell: usize| [cell % CELLS, cell / CELLS].map(|index| (index as f32 + 0.5) / CELLS as f32);
    let is_within = |[u, w]: [f32; 2], [u_label, w_label]: [f32; 2]| maths::hypot(u - u_label, w - w_label) < radius;
    let about = |cell: usize| -> u32 {
        let point = centre(cell);
        filled.iter().filter(|&&(of, _)| is_within(point, centre(of))).map(|(_, count)| count).sum()
    };
    let mut points: Vec<(u32, usize)> = (0..CELLS * CELLS).into_par_iter().map(|cell| (about(cell), cell)).collect();
    points.sort_unstable_by_key(|&(count, cell)| (Reverse(count), cell));
    let exactly = |&(_, cell): &(u32, usize)| labels.iter().filter(|&&label| is_within(centre(cell), label)).count();
    let best = points[..FINALISTS].iter().map(exactly).max().unwrap_or(0);
    best as f64 / labels.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(tau_hats: &[f32], labels: &[[f32; 2]]) -> Agreement {
        Agreement::new(0.07, tau_hats, labels, &GridGeometry::paper(), 0.5).unwrap()
    }

    /// Three of four labels lie within 0.01 of each other: a constant gets 3/4, whatever the network does.
    #[test]
    fn a_constant_answer_gets_the_labels_of_the_densest_disc() {
        let labels = [[0.5, 0.6], [0.505, 0.605], [0.495, 0.6], [0.2, 0.2]];
        let found = of(&[0.01, 0.5, 0.5, 0.5], &labels);
        assert_eq!((found.constant_within_tau, found.within_tau), (0.75, 0.25));
        // On a line of 101 labels 0.01 apart, a disc of radius 0.07 covers 13 or 14.
        let line: Vec<[f32; 2]> = (0..=100).map(|i| [0.01 * i as f32, 0.5]).collect();
        let share = best_constant(&line, 0.07);
        assert!((12.5 / 101.0..14.5 / 101.0).contains(&share), "{share}");
    }

    /// a_y = 0.5 m + (1 − w) · 12 m: labels half as far as the paper's have half of τ.
    #[test]
    fn tau_is_scaled_as_the_labels_are() {
        assert!((PAPER_LABEL_AHEAD_M - 6.415).abs() < 1e-3);
        let w = |ahead_m: f64| (1.0 - (ahead_m - 0.5) / 12.0) as f32;
        let far = of(&[0.06, 0.02], &[[0.5, w(PAPER_LABEL_AHEAD_M)]; 2]);
        assert!((far.tau_scaled - 0.07).abs() < 1e-6 && far.within_tau_scaled == 1.0, "{far:?}");
        let half = of(&[0.06, 0.02], &[[0.5, w(0.5 * PAPER_LABEL_AHEAD_M)]; 2]);
        assert!((half.tau_scaled - 0.035).abs() < 1e-6 && (half.label_ahead_m - 3.207).abs() < 1e-3);
        assert_eq!((half.within_tau, half.within_tau_scaled), (1.0, 0.5));
    }

    #[test]
    fn quantiles_are_of_the_ticks() {
        let tau_hats: Vec<f32> = (1..=100).rev().map(|i| 0.001 * i as f32).collect();
        let found = of(&tau_hats, &[[0.5; 2]; 100]).tau_hat_quantiles;
        for (found, expected) in found.into_iter().zip([0.025, 0.05, 0.075, 0.09, 0.099]) {
            assert!((found - expected).abs() < 1e-6, "{found} {expected}");
        }
        assert_eq!(Agreement::new(0.07, &[], &[], &GridGeometry::paper(), 0.5), None);
    }
}
