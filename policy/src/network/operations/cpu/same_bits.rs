//! Tests hold what [`vectors`](super::vectors) promises: the same bits with every instruction set.

use super::vectors;
use pulp::WithSimd;
use std::fmt::Debug;

/// What a kernel is run with.
#[derive(Debug, Clone, Copy)]
pub(super) enum Instructions {
    Scalar,
    #[cfg(target_arch = "x86_64")]
    Avx2(pulp::x86::V3),
    Widest,
}

impl Instructions {
    pub(super) fn run<K: WithSimd>(self, kernel: K) -> K::Output {
        match self {
            Self::Scalar => kernel.with_simd(pulp::Scalar),
            #[cfg(target_arch = "x86_64")]
            Self::Avx2(avx2) => pulp::Simd::vectorize(avx2, kernel),
            Self::Widest => vectors::run(kernel),
        }
    }
}

/// Asserts that what is computed with every instruction set of this processor is the same, and gives it.
pub(super) fn on_each<T: PartialEq + Debug>(compute: impl Fn(Instructions) -> T) -> T {
    let scalar = compute(Instructions::Scalar);
    assert_eq!(compute(Instructions::Widest), scalar, "the widest");
    #[cfg(target_arch = "x86_64")]
    if let Some(avx2) = pulp::x86::V3::try_new() {
        assert_eq!(compute(Instructions::Avx2(avx2)), scalar, "AVX2");
    }
    scalar
}

/// Numbers of both signs below 1, others for another prime.
pub(super) fn values(n: usize, prime: usize) -> Vec<f32> {
    (0..n).map(|i| ((i * prime % 1000) as f32 - 400.0) / 613.0).collect()
}
