//! Adam on one flat vector, and the fixed-order sum of the shards' gradients.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Settings of Adam other than the learning rate.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AdamSettings {
    /// Decay of the mean of the gradient.
    pub beta1: f32,
    /// Decay of the mean of its square.
    pub beta2: f32,
    /// Added to the root of the mean square.
    pub epsilon: f32,
    /// Share of the weights taken off per step and unit of learning rate (decoupled).
    pub weight_decay: f32,
}

impl AdamSettings {
    /// Kingma and Ba's values (the paper names only "Adam"), no weight decay (the paper has it for perception only).
    pub fn paper() -> Self {
        Self { beta1: 0.9, beta2: 0.999, epsilon: 1e-8, weight_decay: 0.0 }
    }
}

/// Adam's running means.
#[derive(Debug, Clone)]
pub(crate) struct Adam {
    settings: AdamSettings,
    mean: Vec<f32>,
    mean_square: Vec<f32>,
    step: i32,
}

/// Values handled by one thread at a time. Part of the result: it fixes the order of the sum of squares.
const CHUNK: usize = 1 << 15;

impl Adam {
    pub(crate) fn new(settings: AdamSettings, len: usize) -> Self {
        Self { settings, mean: vec![0.0; len], mean_square: vec![0.0; len], step: 0 }
    }

    /// One step along `gradient · scale`.
    pub(crate) fn step(&mut self, learning_rate: f32, weights: &mut [f32], gradient: &[f32], scale: f32) {
        self.step += 1;
        let AdamSettings { beta1, beta2, epsilon, weight_decay } = self.settings;
        let step_size = learning_rate / (1.0 - beta1.powi(self.step));
        let root_correction = (1.0 - beta2.powi(self.step)).sqrt().recip();
        let keep = 1.0 - learning_rate * weight_decay;
        (
            weights.par_chunks_mut(CHUNK),
            gradient.par_chunks(CHUNK),
            self.mean.par_chunks_mut(CHUNK),
            self.mean_square.par_chunks_mut(CHUNK),
        )
            .into_par_iter()
            .for_each(|(weights, gradient, mean, mean_square)| {
                let moments = mean.iter_mut().zip(mean_square);
                for ((weight, gradient), (mean, mean_square)) in weights.iter_mut().zip(gradient).zip(moments) {
                    let gradient = gradient * scale;
                    *mean = beta1 * *mean + (1.0 - beta1) * gradient;
                    *mean_square = beta2 * *mean_square + (1.0 - beta2) * gradient * gradient;
                    let root = mean_square.sqrt() * root_correction + epsilon;
                    *weight = *weight * keep - step_size * *mean / root;
                }
            });
    }
}

/// Adds `others` to `first` in order and returns the Euclidean norm of the sum.
pub(crate) fn sum_and_norm(first: &mut [f32], others: &[&[f32]]) -> f32 {
    let squares: Vec<f64> = first
        .par_chunks_mut(CHUNK)
        .enumerate()
        .map(|(index, sum)| {
            for other in others {
                for (sum, value) in sum.iter_mut().zip(&other[index * CHUNK..]) {
                    *sum += value;
                }
            }
            sum_of_squares(sum)
        })
        .collect();
    squares.into_iter().sum::<f64>().sqrt() as f32
}

/// In lanes, so that it is computed in lanes.
fn sum_of_squares(values: &[f32]) -> f64 {
    let (lines, rest) = values.as_chunks::<32>();
    let mut lanes = [0.0_f32; 32];
    for line in lines {
        for (lane, value) in lanes.iter_mut().zip(line) {
            *lane += value * value;
        }
    }
    lanes.iter().chain(&rest.iter().map(|value| value * value).collect::<Vec<_>>()).map(|&value| f64::from(value)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// With a constant gradient both means are exact after their corrections: each step is the learning rate.
    #[test]
    fn a_constant_gradient_moves_by_the_learning_rate() {
        let mut adam = Adam::new(AdamSettings::paper(), 3);
        let mut weights = [1.0, 1.0, 1.0];
        for _ in 0..10 {
            adam.step(0.01, &mut weights, &[2.0, -0.5, 0.0], 1.0);
        }
        assert!((weights[0] - 0.9).abs() < 1e-5, "{weights:?}");
        assert!((weights[1] - 1.1).abs() < 1e-5, "{weights:?}");
        assert_eq!(weights[2], 1.0);
    }

    #[test]
    fn weight_decay_shrinks_without_a_gradient() {
        let settings = AdamSettings { weight_decay: 0.1, ..AdamSettings::paper() };
        let mut weights = [1.0];
        Adam::new(settings, 1).step(0.5, &mut weights, &[0.0], 1.0);
        assert_eq!(weights, [0.95]);
    }

    #[test]
    fn the_norm_of_a_sum_spans_chunks() {
        let n = 2 * CHUNK + 17;
        let mut first = vec![1.0; n];
        let norm = sum_and_norm(&mut first, &[&vec![2.0; n], &vec![-1.0; n]]);
        assert!(first.iter().all(|value| *value == 2.0));
        assert!((norm / (2.0 * (n as f32).sqrt()) - 1.0).abs() < 1e-6);
    }
}
