//! The dense layer: `x · weight + bias`.
//!
//! Every output is one chain of multiply-adds over the inputs, in order. It does not depend on the other rows of a
//! batch, on the number of threads or on the caches of the machine; burn-flex's product (crate `gemm`) cuts the chain
//! at a length that follows from the first-level cache.
//!
//! Gradients are products of `faer`. On x86-64 with AVX2 and FMA it cuts their sums after every 512 terms, whatever the machine;
//! elsewhere it calls `gemm`, too, which cuts sums of more than 512 terms by that cache.

use super::vectors;
use super::{CHUNK, for_each_chunk};
use crate::network::architecture::LANES;
use faer::linalg::matmul::matmul;
use faer::{Accum, MatMut, MatRef, Par};
use pulp::{Simd, WithSimd};
use rayon::prelude::*;

/// `[rows, outputs]` from `x` `[rows, inputs]`, `weight` `[inputs, outputs]` and `bias` `[outputs]`.
pub(crate) fn forward(x: &[f32], weight: &[f32], bias: &[f32]) -> Vec<f32> {
    let (inputs, outputs) = (weight.len() / bias.len(), bias.len());
    let rows = x.len() / inputs;
    let mut y = vec![0.0; rows * outputs];
    // As few parts as there are threads: the more rows share a part, the less often the weights are read.
    let part = rows.div_ceil(rayon::current_num_threads()).max(CHUNK).next_multiple_of(ROWS);
    let parts = x.chunks(part * inputs).zip(y.chunks_mut(part * outputs));
    for_each_chunk(parts, |(x, y)| vectors::run(Forward { x, weight, bias, y }));
    y
}

/// Gradient of `weight` `[inputs, outputs]`: `xᵀ · d_y`.
pub(crate) fn d_weight(x: &[f32], d_y: &[f32], inputs: usize, outputs: usize) -> Vec<f32> {
    let mut gradient = vec![0.0; inputs * outputs];
    let (x, d_y) = (rows(x, inputs), rows(d_y, outputs));
    gradient.par_chunks_mut(BLOCK * outputs).enumerate().for_each(|(block, gradient)| {
        let x = x.subcols(block * BLOCK, gradient.len() / outputs);
        product(gradient, x.transpose(), d_y);
    });
    gradient
}

/// Gradient of `x` `[rows, inputs]`: `d_y · weightᵀ`.
pub(crate) fn d_x(d_y: &[f32], weight: &[f32], inputs: usize, outputs: usize) -> Vec<f32> {
    let mut gradient = vec![0.0; d_y.len() / outputs * inputs];
    let weight = rows(weight, outputs);
    gradient.par_chunks_mut(BLOCK * inputs).zip(d_y.par_chunks(BLOCK * outputs)).for_each(|(gradient, d_y)| {
        product(gradient, rows(d_y, outputs), weight.transpose());
    });
    gradient
}

/// Gradient of `bias` `[outputs]`: the sum of the rows.
pub(crate) fn d_bias(d_y: &[f32], outputs: usize) -> Vec<f32> {
    let mut sums = vec![0.0; outputs];
    for row in d_y.chunks_exact(outputs) {
        for (sum, value) in sums.iter_mut().zip(row) {
            *sum += value;
        }
    }
    sums
}

/// Rows of a gradient that one thread computes.
const BLOCK: usize = 64;

/// A row-major matrix.
fn rows(values: &[f32], columns: usize) -> MatRef<'_, f32> {
    MatRef::from_row_major_slice(values, values.len() / columns, columns)
}

/// `into` (row-major) = left · right, on the calling thread.
fn product(into: &mut [f32], left: MatRef<'_, f32>, right: MatRef<'_, f32>) {
    let into = MatMut::from_row_major_slice_mut(into, left.nrows(), right.ncols());
    matmul(into, Accum::Replace, left, right, 1.0, Par::Seq);
}

struct Forward<'a> {
    x: &'a [f32],
    weight: &'a [f32],
    bias: &'a [f32],
    y: &'a mut [f32],
}

/// Rows computed side by side: each weight is loaded once for all of them. Fewer rows go one by one and leave out the
/// inputs that are 0, which a `ReLU` makes many.
const ROWS: usize = 4;
/// Rows from which on it pays to copy a block of the weights, so that it lies in one piece.
const PACKED_FROM: usize = 32 * ROWS;

impl WithSimd for Forward<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let whole = self.y.len() / self.bias.len() / ROWS * ROWS;
        // As many sums as fit the registers.
        if S::F32_LANES == LANES { self.rows::<S, 4>(simd, whole) } else { self.rows::<S, 3>(simd, whole) }
    }
}

impl Forward<'_> {
    /// The first `whole` rows by blocks, the others one by one.
    #[inline(always)]
    fn rows<S: Simd, const WIDTH: usize>(self, simd: S, whole: usize) {
        let Self { x, weight, bias, y } = self;
        let outputs = bias.len();
        let inputs = weight.len() / outputs;
        let (x_whole, x_single) = x.split_at(whole * inputs);
        let (y_whole, y_single) = y.split_at_mut(whole * outputs);
        let mut packed = Vec::new();
        // Loops, not closures: a closure that the compiler does not inline is compiled without the instruction set.
        for (first, width) in blocks::<S, WIDTH>(outputs) {
            let columns = first..outputs.min(first + width * S::F32_LANES);
            let (weights, stride, offset) = if whole >= PACKED_FROM {
                packed.clear();
                for weights in weight.chunks_exact(outputs) {
                    packed.extend_from_slice(&weights[columns.clone()]);
                }
                (packed.as_slice(), columns.len(), 0)
            } else {
                (weight, outputs, first)
            };
            for (x, y) in x_whole.chunks_exact(ROWS * inputs).zip(y_whole.chunks_exact_mut(ROWS * outputs)) {
                let x: [&[f32]; ROWS] = std::array::from_fn(|row| &x[row * inputs..][..inputs]);
                let weights = weights.chunks_exact(stride).map(|weights| &weights[offset..offset + columns.len()]);
                let bias = &bias[columns.clone()];
                let y = y.chunks_exact_mut(outputs).map(|y| &mut y[columns.clone()]);
                if width == WIDTH {
                    block::<S, WIDTH>(simd, x, weights, bias, y);
                } else {
                    block::<S, 1>(simd, x, weights, bias, y);
                }
            }
        }
        let mut nonzero = vec![(0, 0.0); inputs];
        for (x, y) in x_single.chunks_exact(inputs).zip(y_single.chunks_exact_mut(outputs)) {
            // Without a branch: which inputs are 0 cannot be predicted.
            let mut count = 0;
            for (at, value) in x.iter().enumerate() {
                nonzero[count] = (at, *value);
                count += usize::from(*value != 0.0);
            }
            let nonzero = &nonzero[..count];
            for (first, width) in blocks::<S, 8>(outputs) {
                match width {
                    8 => sparse_block::<S, 8>(simd, nonzero, weight, bias, first, y),
                    _ => sparse_block::<S, 1>(simd, nonzero, weight, bias, first, y),
                }
            }
        }
    }
}

/// Cuts the outputs into blocks of `WIDTH` vectors, then of one, the last of which may be a part of one: the first output
/// of each block, and its vectors.
#[inline(always)]
fn blocks<S: Simd, const WIDTH: usize>(outputs: usize) -> impl Iterator<Item = (usize, usize)> {
    let whole = outputs / (WIDTH * S::F32_LANES) * (WIDTH * S::F32_LANES);
    let wide = (0..whole).step_by(WIDTH * S::F32_LANES).map(|first| (first, WIDTH));
    wide.chain((whole..outputs).step_by(S::F32_LANES).map(|first| (first, 1)))
}

/// `WIDTH` vectors of outputs of all rows, given the weights of these outputs by input.
#[inline(always)]
fn block<'a, S: Simd, const WIDTH: usize>(
    simd: S,
    x: [&[f32]; ROWS],
    weights: impl Iterator<Item = &'a [f32]>,
    bias: &[f32],
    y: impl Iterator<Item = &'a mut [f32]>,
) {
    let inputs = x[0].len();
    let x = x.map(|x| &x[..inputs]);
    let mut sums = [load::<S, WIDTH>(simd, bias); ROWS];
    for (at, weights) in (0..inputs).zip(weights) {
        let weights = load::<S, WIDTH>(simd, weights);
        for row in 0..ROWS {
            let value = simd.splat_f32s(x[row][at]);
            for v in 0..WIDTH {
                sums[row][v] = simd.mul_add_f32s(value, weights[v], sums[row][v]);
            }
        }
    }
    for (y, sums) in y.zip(sums) {
        store::<S, WIDTH>(simd, sums, y);
    }
}

/// `WIDTH` vectors of outputs of one row, given its inputs that are not 0.
#[inline(always)]
fn sparse_block<S: Simd, const WIDTH: usize>(
    simd: S,
    nonzero: &[(usize, f32)],
    weight: &[f32],
    bias: &[f32],
    first: usize,
    y: &mut [f32],
) {
    let columns = first..bias.len().min(first + WIDTH * S::F32_LANES);
    let mut sums = load::<S, WIDTH>(simd, &bias[columns.clone()]);
    for (at, value) in nonzero {
        let start = at * bias.len();
        let weights = load::<S, WIDTH>(simd, &weight[start + columns.start..start + columns.end]);
        let value = simd.splat_f32s(*value);
        for v in 0..WIDTH {
            sums[v] = simd.mul_add_f32s(value, weights[v], sums[v]);
        }
    }
    store::<S, WIDTH>(simd, sums, &mut y[columns]);
}

/// `WIDTH` whole vectors, or a part of one.
#[inline(always)]
fn load<S: Simd, const WIDTH: usize>(simd: S, values: &[f32]) -> [S::f32s; WIDTH] {
    match vectors::whole::<S, WIDTH>(values) {
        Some(vectors) => *vectors,
        None => [simd.partial_load_f32s(values); WIDTH],
    }
}

#[inline(always)]
fn store<S: Simd, const WIDTH: usize>(simd: S, vectors: [S::f32s; WIDTH], into: &mut [f32]) {
    match vectors::whole_mut::<S, WIDTH>(into) {
        Some(into) => *into = vectors,
        None => simd.partial_store_f32s(into, vectors[0]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::network::operations::cpu::same_bits::{self, values};

    #[test]
    fn every_instruction_set_computes_the_same_bits() {
        // Zeros are skipped.
        let values = |n: usize| values(n, 7919).iter().map(|value| value.max(0.0)).collect::<Vec<_>>();
        let (inputs, outputs) = (50, 70);
        let (weight, bias) = (values(inputs * outputs), values(outputs));
        for rows in [1, 5, 130] {
            let x = values(rows * inputs);
            same_bits::on_each(|instructions| {
                let mut y = vec![0.0; rows * outputs];
                instructions.run(Forward { x: &x, weight: &weight, bias: &bias, y: &mut y });
                y
            });
        }
    }
}
