//! Matrix products on slices.

use faer::linalg::matmul::matmul;
use faer::{Accum, MatMut, MatRef, Par};

/// A row-major matrix.
pub(crate) fn rows(values: &[f32], columns: usize) -> MatRef<'_, f32> {
    MatRef::from_row_major_slice(values, values.len() / columns, columns)
}

/// `into` (row-major) = or += left · right, on the calling thread.
pub(crate) fn product(accumulate: Accum, into: &mut [f32], left: MatRef<'_, f32>, right: MatRef<'_, f32>) {
    let into = MatMut::from_row_major_slice_mut(into, left.nrows(), right.ncols());
    matmul(into, accumulate, left, right, 1.0, Par::Seq);
}
