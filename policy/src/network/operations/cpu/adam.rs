//! One step of Adam in one pass over its values.

use super::vectors;
use crate::network::operations::adam::AdamStep;
use pulp::{Simd, WithSimd};
use rayon::prelude::*;

/// Values handled by one thread at a time.
const CHUNK: usize = 1 << 14;

/// Below this a mean of gradients is 0, and [`SQUARE_MIN`] is for the mean of squares: far too small to move a weight,
/// far above the denormal numbers that processors are slow with and decaying means get stuck at.
pub(crate) const MEAN_MIN: f32 = 1e-30;
/// See [`MEAN_MIN`].
pub(crate) const SQUARE_MIN: f32 = 1e-36;

/// Updates weights and both means in place.
pub(crate) fn step(step: AdamStep, weights: &mut [f32], gradient: &[f32], mean: &mut [f32], mean_square: &mut [f32]) {
    let factors = Factors::of(step, norm(gradient));
    (
        weights.par_chunks_mut(CHUNK),
        gradient.par_chunks(CHUNK),
        mean.par_chunks_mut(CHUNK),
        mean_square.par_chunks_mut(CHUNK),
    )
        .into_par_iter()
        .for_each(|(weights, gradient, mean, mean_square)| {
            vectors::run(Kernel { factors, weights, gradient, mean, mean_square });
        });
}

/// Euclidean norm, summed in a fixed order: lanes within a chunk, then chunks.
fn norm(values: &[f32]) -> f32 {
    let squares: Vec<f64> = values.par_chunks(CHUNK).map(|values| vectors::run(SumOfSquares { values })).collect();
    squares.into_iter().sum::<f64>().sqrt() as f32
}

struct SumOfSquares<'a> {
    values: &'a [f32],
}

impl WithSimd for SumOfSquares<'_> {
    type Output = f64;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> f64 {
        // As many sums as there are values in a line, whatever the width of a vector: the order stays the same.
        let (lines, rest) = self.values.as_chunks::<LINE>();
        let mut sums = [0.0; LINE];
        for line in lines {
            let sums = vectors::vectors_mut::<S>(&mut sums);
            for (sum, values) in sums.iter_mut().zip(vectors::vectors::<S>(line)) {
                *sum = simd.mul_add_f32s(*values, *values, *sum);
            }
        }
        sums.iter()
            .map(|sum| f64::from(*sum))
            .chain(rest.iter().map(|value| f64::from(*value) * f64::from(*value)))
            .sum()
    }
}

/// Values whose squares are summed side by side.
const LINE: usize = 64;

/// What every value of a step is computed with. Two powers are among it: computed once, not once a vector.
#[derive(Debug, Clone, Copy)]
struct Factors {
    /// Factor of the gradient, which clips it.
    gradient: f32,
    beta_1: f32,
    beta_2: f32,
    epsilon: f32,
    /// See [`AdamStep::step_size`].
    step_size: f32,
    /// See [`AdamStep::root_correction`].
    root_correction: f32,
    /// See [`AdamStep::keep`].
    keep: f32,
}

impl Factors {
    /// `norm`: that of the gradient.
    fn of(step: AdamStep, norm: f32) -> Self {
        Self {
            gradient: step.gradient_scale(norm),
            beta_1: step.beta_1,
            beta_2: step.beta_2,
            epsilon: step.epsilon,
            step_size: step.step_size(),
            root_correction: step.root_correction(),
            keep: step.keep(),
        }
    }
}

struct Kernel<'a> {
    factors: Factors,
    weights: &'a mut [f32],
    gradient: &'a [f32],
    mean: &'a mut [f32],
    mean_square: &'a mut [f32],
}

impl WithSimd for Kernel<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { factors, weights, gradient, mean, mean_square } = self;
        let (weights, weights_rest) = S::as_mut_simd_f32s(weights);
        let (gradient, gradient_rest) = S::as_simd_f32s(gradient);
        let (mean, mean_rest) = S::as_mut_simd_f32s(mean);
        let (mean_square, mean_square_rest) = S::as_mut_simd_f32s(mean_square);
        for (((weights, gradient), mean), mean_square) in weights.iter_mut().zip(gradient).zip(mean).zip(mean_square) {
            [*weights, *mean, *mean_square] = update(simd, factors, *weights, *gradient, *mean, *mean_square);
        }
        if !gradient_rest.is_empty() {
            let [new, new_mean, new_square] = update(
                simd,
                factors,
                simd.partial_load_f32s(weights_rest),
                simd.partial_load_f32s(gradient_rest),
                simd.partial_load_f32s(mean_rest),
                simd.partial_load_f32s(mean_square_rest),
            );
            simd.partial_store_f32s(weights_rest, new);
            simd.partial_store_f32s(mean_rest, new_mean);
            simd.partial_store_f32s(mean_square_rest, new_square);
        }
    }
}

/// Weights, mean and mean of squares after one step.
#[inline(always)]
fn update<S: Simd>(
    simd: S,
    factors: Factors,
    weights: S::f32s,
    gradient: S::f32s,
    mean: S::f32s,
    mean_square: S::f32s,
) -> [S::f32s; 3] {
    let times = |vector, factor: f32| simd.mul_f32s(vector, simd.splat_f32s(factor));
    let above = |vector, least: f32| {
        let is_above = simd.greater_than_f32s(simd.abs_f32s(vector), simd.splat_f32s(least));
        simd.select_f32s(is_above, vector, simd.splat_f32s(0.0))
    };
    let gradient = times(gradient, factors.gradient);
    let mean = simd.add_f32s(times(mean, factors.beta_1), times(gradient, 1.0 - factors.beta_1));
    let mean = above(mean, MEAN_MIN);
    let square = simd.mul_f32s(times(gradient, 1.0 - factors.beta_2), gradient);
    let mean_square = above(simd.add_f32s(times(mean_square, factors.beta_2), square), SQUARE_MIN);
    let root =
        simd.add_f32s(times(simd.sqrt_f32s(mean_square), factors.root_correction), simd.splat_f32s(factors.epsilon));
    let change = simd.div_f32s(times(mean, factors.step_size), root);
    [simd.sub_f32s(times(weights, factors.keep), change), mean, mean_square]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::network::operations::cpu::same_bits::{self, values};

    #[test]
    fn every_instruction_set_computes_the_same_bits() {
        let step = AdamStep {
            learning_rate: 1e-3,
            beta_1: 0.9,
            beta_2: 0.999,
            epsilon: 1e-8,
            weight_decay: 0.01,
            gradient_norm_max: 1.0,
            number: 3,
        };
        // Whole lines, and a rest of each kind.
        for len in [LINE, 3 * LINE + 1, 7 * LINE + 13] {
            let gradient = values(len, 7919);
            let sum = same_bits::on_each(|instructions| instructions.run(SumOfSquares { values: &gradient }));
            let factors = Factors::of(step, sum.sqrt() as f32);
            same_bits::on_each(|instructions| {
                let (mut weights, mut mean) = (values(len, 31), values(len, 101));
                let mut mean_square: Vec<f32> = values(len, 211).iter().map(|value| value * value).collect();
                let (weights, mean, mean_square) = (&mut weights, &mut mean, &mut mean_square);
                instructions.run(Kernel { factors, weights, gradient: &gradient, mean, mean_square });
                [weights, mean, mean_square].map(|values| values.clone())
            });
        }
    }
}
