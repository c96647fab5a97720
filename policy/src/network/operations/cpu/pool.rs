//! Max-pool of 2, bias and `ReLU`, with who won. The largest of four is found before the bias is added, which changes neither.

use super::SILENT;
use pulp::Simd;

/// The four cells of a pool, row by row; the first of equals wins.
pub(super) const POOL: [(usize, usize); 4] = [(0, 0), (0, 1), (1, 0), (1, 1)];

/// The largest value so far and whose it is, after that of `cell`.
#[inline(always)]
pub(super) fn better<S: Simd>(
    simd: S,
    (best, from): (S::f32s, S::u32s),
    value: S::f32s,
    cell: u32,
) -> (S::f32s, S::u32s) {
    let wins = simd.greater_than_f32s(value, best);
    (simd.select_f32s(wins, value, best), simd.select_u32s(wins, simd.splat_u32s(cell), from))
}

/// What the pool answers, and its winner.
#[inline(always)]
pub(super) fn with_relu<S: Simd>(simd: S, (best, from): (S::f32s, S::u32s), bias: S::f32s) -> (S::f32s, S::u32s) {
    let zero = simd.splat_f32s(0.0);
    let value = simd.add_f32s(best, bias);
    let is_alive = simd.greater_than_f32s(value, zero);
    (simd.select_f32s(is_alive, value, zero), simd.select_u32s(is_alive, from, simd.splat_u32s(SILENT)))
}
