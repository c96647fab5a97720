//! The operations arranged for CPUs, on slices. What is fast and why is said in each file.
#![expect(
    clippy::inline_always,
    reason = "a kernel is compiled in one piece for each instruction set; calls would leave it"
)]

pub(crate) mod adam;
mod convolution;
pub(crate) mod dense;
pub(crate) mod first_layer;
mod pool;
pub(crate) mod residual_layer;
#[cfg(test)]
mod same_bits;
pub(crate) mod second_layer;
mod vectors;

use rayon::prelude::*;

/// Samples that one thread computes one after the other. Part of the result: it fixes the order in which gradients of
/// samples are summed.
const CHUNK: usize = 16;

/// In place of the cell that an answer comes from: a `ReLU` cut it off.
const SILENT: u32 = 4;

/// What a layer answers to a batch, `[batch, cells, channel]`.
#[derive(Debug, Clone)]
pub(crate) struct Answers {
    pub(crate) y: Vec<f32>,
    /// Which cell of its pool each answer comes from, or [`SILENT`], for the backward pass; without a pool 0 or [`SILENT`]. Empty if
    /// nothing was traced.
    pub(crate) chosen: Vec<u32>,
}

/// Answers chunk by chunk. `visit`: the samples, their answers, and `chosen` with a place for each, or with one that all share
/// because nobody reads it.
fn by_chunks<T: Sync>(
    x: &[T],
    input_len: usize,
    output_len: usize,
    is_traced: bool,
    visit: impl Fn(&[T], &mut [f32], &mut [u32]) + Sync + Send,
) -> Answers {
    let mut y = vec![0.0; x.len() / input_len * output_len];
    let mut chosen = vec![0; if is_traced { y.len() } else { 0 }];
    let chunks = x.chunks(CHUNK * input_len).zip(y.chunks_mut(CHUNK * output_len));
    if is_traced {
        for_each_chunk(chunks.zip(chosen.chunks_mut(CHUNK * output_len)), |((x, y), chosen)| visit(x, y, chosen));
    } else {
        for_each_chunk(chunks, |(x, y)| visit(x, y, &mut vec![0; output_len]));
    }
    Answers { y, chosen }
}

/// `sum` += `share`, value by value.
#[inline(always)]
fn add(sum: &mut [f32], share: &[f32]) {
    for (sum, value) in sum.iter_mut().zip(share) {
        *sum += value;
    }
}

/// Calls with every chunk: on all threads of the pool, or on this one if there is only one chunk.
fn for_each_chunk<T: Send>(chunks: impl Iterator<Item = T>, visit: impl Fn(T) + Sync + Send) {
    let mut chunks: Vec<T> = chunks.collect();
    if chunks.len() == 1 {
        chunks.into_iter().for_each(visit);
    } else {
        chunks.par_drain(..).for_each(visit);
    }
}
