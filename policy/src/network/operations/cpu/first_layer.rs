//! First convolution, max-pool and `ReLU` on binary cells.
//!
//! The input is binary, so a row of the kernel meets one of 2^kernel patterns. What it answers is looked up in a table,
//! and the rows of the kernel are added: no multiplication. Where all four cells of a pool see the same, one is enough.

use super::pool::{POOL, better, with_relu};
use super::vectors::{self, int_vectors, int_vectors_mut, vectors, vectors_mut};
use super::{Answers, CHUNK, SILENT, add, by_chunks};
use crate::network::architecture::{ConvLayer, LANES, POOLED_1};
use pulp::{Simd, WithSimd};
use rayon::prelude::*;
use sim::sensing::GRID_CELLS;

/// Cells of one grid.
const CELLS: usize = GRID_CELLS * GRID_CELLS;
/// Outputs per channel.
const POOLS: usize = POOLED_1 * POOLED_1;
/// Largest kernel whose patterns are tabulated.
const KERNEL_MAX: usize = 7;

/// The rows of a grid with "same" padding, bit `c + padding` = column `c`.
type PaddedRows = [u32; GRID_CELLS + KERNEL_MAX - 1];

/// Packs the cells of one grid (0 = free) into padded rows.
fn padded_rows(occupied: &[u8], conv: ConvLayer) -> PaddedRows {
    let (before, _) = conv.padding();
    let mut rows = [0; GRID_CELLS + KERNEL_MAX - 1];
    for (row, cells) in rows[before..].iter_mut().zip(occupied.chunks_exact(GRID_CELLS)) {
        for (col, cell) in cells.iter().enumerate() {
            *row |= u32::from(*cell != 0) << (col + before);
        }
    }
    rows
}

/// The layer with its weights as the passes below want them.
pub(crate) struct FirstLayer<'a> {
    conv: ConvLayer,
    /// `[kernel row, pattern, channel]`: what a kernel row adds when its cells hold `pattern` (bit = kernel column).
    table: Vec<f32>,
    bias: &'a [f32],
}

/// Gradients of the weights, in burn's shapes.
#[derive(Debug, Clone)]
pub(crate) struct FirstGradients {
    /// `[channel, 1, kernel, kernel]`.
    pub(crate) weight: Vec<f32>,
    /// `[channel]`.
    pub(crate) bias: Vec<f32>,
}

/// Where the four cells of a pool find the rows of the kernel in the table.
struct TableRows {
    of_cell: [[usize; KERNEL_MAX]; 4],
    /// All four cells see the same: every row of the kernel meets one and the same pattern.
    are_equal: bool,
}

impl<'a> FirstLayer<'a> {
    /// `weight` `[channel, 1, kernel, kernel]`.
    pub(crate) fn new(conv: ConvLayer, weight: &[f32], bias: &'a [f32]) -> Self {
        let mut table = vec![0.0; (conv.kernel << conv.kernel) * conv.channels];
        for_each_table_entry(conv, |entry, of_weight| table[entry] += weight[of_weight]);
        Self { conv, table, bias }
    }

    /// `[batch, 12 · 12, channel]` of grids `occupied` `[batch, 25, 25]` (0 = free), and who won each pool.
    pub(crate) fn forward(&self, occupied: &[u8], is_traced: bool) -> Answers {
        by_chunks(occupied, CELLS, POOLS * self.bias.len(), is_traced, |occupied, y, winners| {
            vectors::run(Forward { layer: self, occupied, y, winners });
        })
    }

    /// Gradients of the weights, given that of the answers and who won each pool.
    pub(crate) fn backward(&self, occupied: &[u8], winners: &[u32], d_y: &[f32]) -> FirstGradients {
        assert_eq!(d_y.len(), winners.len(), "gradients of another batch than was traced");
        let chunk = CHUNK * POOLS * self.bias.len();
        // A chunk's share is summed by one thread, the shares in order: the same bits for any number of threads.
        let chunks = (occupied.par_chunks(CHUNK * CELLS), winners.par_chunks(chunk), d_y.par_chunks(chunk));
        let shares: Vec<Share> = chunks
            .into_par_iter()
            .map(|(occupied, winners, d_y)| vectors::run(Backward { layer: self, occupied, winners, d_y }))
            .collect();
        let mut sum = Share::new(self);
        for share in &shares {
            add(&mut sum.table, &share.table);
            add(&mut sum.bias, &share.bias);
        }
        FirstGradients { weight: self.d_weight(&sum.table), bias: sum.bias }
    }

    /// The gradient of the weights from that of the table.
    fn d_weight(&self, d_table: &[f32]) -> Vec<f32> {
        let mut d_weight = vec![0.0; self.conv.channels * self.conv.kernel * self.conv.kernel];
        for_each_table_entry(self.conv, |entry, of_weight| d_weight[of_weight] += d_table[entry]);
        d_weight
    }

    #[inline(always)]
    fn table_rows(&self, rows: &PaddedRows, row: usize, col: usize) -> TableRows {
        let kernel = self.conv.kernel;
        let mask = (1 << kernel) - 1;
        let mut of_cell = [[0; KERNEL_MAX]; 4];
        let first = (rows[2 * row] >> (2 * col) & mask) as usize;
        let mut are_equal = true;
        for (kernel_row, word) in rows[2 * row..=2 * row + kernel].iter().enumerate() {
            let (left, right) = ((word >> (2 * col) & mask) as usize, (word >> (2 * col + 1) & mask) as usize);
            if kernel_row < kernel {
                of_cell[0][kernel_row] = (kernel_row << kernel) + left;
                of_cell[1][kernel_row] = (kernel_row << kernel) + right;
            }
            if let Some(lower) = kernel_row.checked_sub(1) {
                of_cell[2][lower] = (lower << kernel) + left;
                of_cell[3][lower] = (lower << kernel) + right;
            }
            are_equal &= left == first && right == first;
        }
        TableRows { of_cell, are_equal }
    }
}

/// Forward pass of one chunk.
struct Forward<'a> {
    layer: &'a FirstLayer<'a>,
    occupied: &'a [u8],
    y: &'a mut [f32],
    /// With a place for every sample, or one that all share.
    winners: &'a mut [u32],
}

impl WithSimd for Forward<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { layer, occupied, y, winners } = self;
        let width = layer.bias.len() / S::F32_LANES;
        let (table, bias) = (vectors::<S>(&layer.table), vectors::<S>(layer.bias));
        let (y, winners) = (vectors_mut::<S>(y), int_vectors_mut::<S>(winners));
        let places = winners.len() / (POOLS * width);
        for (sample, occupied) in occupied.chunks_exact(CELLS).enumerate() {
            let rows = padded_rows(occupied, layer.conv);
            let y = &mut y[sample * POOLS * width..];
            let winners = &mut winners[sample % places * POOLS * width..];
            for pool in 0..POOLS {
                let entries = layer.table_rows(&rows, pool / POOLED_1, pool % POOLED_1);
                let y = &mut y[pool * width..][..width];
                let winners = &mut winners[pool * width..][..width];
                for v in 0..width {
                    let sum = |cell: usize| {
                        let of_rows = &entries.of_cell[cell][..layer.conv.kernel];
                        of_rows[1..]
                            .iter()
                            .fold(table[of_rows[0] * width + v], |sum, row| simd.add_f32s(sum, table[row * width + v]))
                    };
                    let mut best = (sum(0), simd.splat_u32s(0));
                    if !entries.are_equal {
                        for cell in 1..POOL.len() {
                            best = better(simd, best, sum(cell), cell as u32);
                        }
                    }
                    (y[v], winners[v]) = with_relu(simd, best, bias[v]);
                }
            }
        }
    }
}

/// One chunk's share of the gradients of the table and of the bias.
struct Share {
    table: Vec<f32>,
    bias: Vec<f32>,
}

impl Share {
    fn new(layer: &FirstLayer<'_>) -> Self {
        Self { table: vec![0.0; layer.table.len()], bias: vec![0.0; layer.bias.len()] }
    }
}

/// Backward pass of one chunk.
struct Backward<'a> {
    layer: &'a FirstLayer<'a>,
    occupied: &'a [u8],
    winners: &'a [u32],
    d_y: &'a [f32],
}

impl WithSimd for Backward<'_> {
    type Output = Share;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Share {
        let Self { layer, occupied, winners, d_y } = self;
        let (width, kernel) = (layer.bias.len() / S::F32_LANES, layer.conv.kernel);
        let (d_y, winners) = (vectors::<S>(d_y), int_vectors::<S>(winners));
        let mut share = Share::new(layer);
        let (d_table, d_bias) = (vectors_mut::<S>(&mut share.table), vectors_mut::<S>(&mut share.bias));
        let (zero, silent) = (simd.splat_f32s(0.0), simd.splat_u32s(SILENT));
        for (sample, occupied) in occupied.chunks_exact(CELLS).enumerate() {
            let rows = padded_rows(occupied, layer.conv);
            for pool in 0..POOLS {
                let entries = layer.table_rows(&rows, pool / POOLED_1, pool % POOLED_1);
                let at = (sample * POOLS + pool) * width;
                let (d_y, winners) = (&d_y[at..at + width], &winners[at..at + width]);
                for v in 0..width {
                    let alive = simd.select_f32s(simd.equal_u32s(winners[v], silent), zero, d_y[v]);
                    d_bias[v] = simd.add_f32s(d_bias[v], alive);
                    // All four cells see the same: whoever won, the gradient goes to the same entries.
                    let cells = if entries.are_equal { 1 } else { POOL.len() };
                    for cell in 0..cells {
                        let is_winner = simd.equal_u32s(winners[v], simd.splat_u32s(cell as u32));
                        let share = if entries.are_equal { alive } else { simd.select_f32s(is_winner, d_y[v], zero) };
                        for (kernel_row, table_row) in entries.of_cell[cell][..kernel].iter().enumerate() {
                            // The pattern without cells has no weights.
                            if *table_row != kernel_row << kernel {
                                let sum = &mut d_table[table_row * width + v];
                                *sum = simd.add_f32s(*sum, share);
                            }
                        }
                    }
                }
            }
        }
        share
    }
}

/// Calls with every pair (table entry, weight that is part of it).
fn for_each_table_entry(conv: ConvLayer, mut visit: impl FnMut(usize, usize)) {
    let (kernel, channels) = (conv.kernel, conv.channels);
    for row in 0..kernel {
        for pattern in 0..1usize << kernel {
            for col in (0..kernel).filter(|col| pattern >> col & 1 == 1) {
                for channel in 0..channels {
                    visit(((row << kernel) + pattern) * channels + channel, (channel * kernel + row) * kernel + col);
                }
            }
        }
    }
}

const _: () = assert!(GRID_CELLS + KERNEL_MAX <= 32 && LANES == 16, "a padded row fits a word");

#[cfg(test)]
mod tests {
    use super::*;
    use crate::network::operations::cpu::same_bits::{self, values};

    #[test]
    fn every_instruction_set_computes_the_same_bits() {
        for (channels, kernel) in [(16, 3), (48, 5)] {
            let conv = ConvLayer { channels, kernel };
            let (weight, bias) = (values(channels * kernel * kernel, 7919), values(channels, 31));
            let layer = &FirstLayer::new(conv, &weight, &bias);
            let occupied: Vec<u8> = (0..3 * CELLS).map(|i| u8::from(i * i % 7 < 3)).collect();
            let len = 3 * POOLS * channels;
            let d_y = values(len, 211);
            let (_, winners) = same_bits::on_each(|instructions| {
                let (mut y, mut winners) = (vec![0.0; len], vec![0; len]);
                instructions.run(Forward { layer, occupied: &occupied, y: &mut y, winners: &mut winners });
                (y, winners)
            });
            same_bits::on_each(|instructions| {
                let share = instructions.run(Backward { layer, occupied: &occupied, winners: &winners, d_y: &d_y });
                (share.table, share.bias)
            });
        }
    }
}
