//! How vectors are used in this crate: through `pulp`, which picks the widest instruction set at run time.
//!
//! A kernel is a struct that implements [`WithSimd`]; [`run`] calls it with AVX-512, AVX2 or scalar instructions. The
//! results are the same bits on each: lanes never mix, sums run in a fixed order, and multiply-add is fused everywhere
//! (a processor without the instruction computes it in software). Lengths along channels are multiples of
//! [`LANES`](crate::network::LANES), the widest vector there is, so that kernels of convolutions have no remainder; those of
//! dense layers and of Adam load and store a part of a vector.

use pulp::{Arch, Simd, WithSimd};

/// Runs a kernel with the widest instructions of this processor.
pub(super) fn run<K: WithSimd>(kernel: K) -> K::Output {
    Arch::new().dispatch(kernel)
}

/// A slice as vectors.
///
/// # Panics
/// If its length is not a multiple of the vector's.
#[inline(always)]
pub(super) fn vectors<S: Simd>(values: &[f32]) -> &[S::f32s] {
    let (vectors, rest) = S::as_simd_f32s(values);
    assert!(rest.is_empty(), "{} values are not whole vectors", values.len());
    vectors
}

/// See [`vectors`].
#[inline(always)]
pub(super) fn vectors_mut<S: Simd>(values: &mut [f32]) -> &mut [S::f32s] {
    let (vectors, rest) = S::as_mut_simd_f32s(values);
    assert!(rest.is_empty(), "not whole vectors");
    vectors
}

/// See [`vectors`].
#[inline(always)]
pub(super) fn int_vectors<S: Simd>(values: &[u32]) -> &[S::u32s] {
    let (vectors, rest) = S::as_simd_u32s(values);
    assert!(rest.is_empty(), "not whole vectors");
    vectors
}

/// See [`vectors`].
#[inline(always)]
pub(super) fn int_vectors_mut<S: Simd>(values: &mut [u32]) -> &mut [S::u32s] {
    let (vectors, rest) = S::as_mut_simd_u32s(values);
    assert!(rest.is_empty(), "not whole vectors");
    vectors
}

/// `WIDTH` vectors, if a slice is exactly that.
#[inline(always)]
pub(super) fn whole<S: Simd, const WIDTH: usize>(values: &[f32]) -> Option<&[S::f32s; WIDTH]> {
    let (vectors, rest) = S::as_simd_f32s(values);
    if rest.is_empty() { vectors.try_into().ok() } else { None }
}

/// See [`whole`].
#[inline(always)]
pub(super) fn whole_mut<S: Simd, const WIDTH: usize>(values: &mut [f32]) -> Option<&mut [S::f32s; WIDTH]> {
    let (vectors, rest) = S::as_mut_simd_f32s(values);
    if rest.is_empty() { vectors.try_into().ok() } else { None }
}
