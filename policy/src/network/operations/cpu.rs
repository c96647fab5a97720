//! The operations arranged for CPUs, on slices. What is fast and why is said in each file.
#![expect(
    clippy::inline_always,
    reason = "a kernel is compiled in one piece for each instruction set; calls would leave it"
)]

pub(crate) mod adam;
pub(crate) mod dense;
pub(crate) mod encoder;
mod first_layer;
mod pool;
mod second_layer;
mod vectors;

use rayon::prelude::*;

/// Samples that one thread computes one after the other. Part of the result: it fixes the order in which gradients of
/// samples are summed.
const CHUNK: usize = 16;

/// Largest kernel of the first convolution whose patterns are tabulated.
const KERNEL_MAX: usize = 7;

/// Calls with every chunk: on all threads of the pool, or on this one if there is only one chunk.
fn for_each_chunk<T: Send>(chunks: impl Iterator<Item = T>, visit: impl Fn(T) + Sync + Send) {
    let mut chunks: Vec<T> = chunks.collect();
    if chunks.len() == 1 {
        chunks.into_iter().for_each(visit);
    } else {
        chunks.par_drain(..).for_each(visit);
    }
}
