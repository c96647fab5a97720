//! First convolution, max-pool and `ReLU` on binary cells.
//!
//! The input is binary, so a row of the kernel meets one of 2^kernel patterns. What it answers is looked up in a table,
//! and the rows of the kernel are added: no multiplication. Where all four cells of a pool see the same, one is enough.

use super::KERNEL_MAX;
use super::pool::{POOL, SILENT, better, with_relu};
use super::vectors::{int_vectors, int_vectors_mut, vectors, vectors_mut};
use crate::network::architecture::{ConvLayer, LANES, POOLED_1};
use pulp::Simd;
use sim::sensing::GRID_CELLS;

/// The rows of a grid with "same" padding, bit `c + padding` = column `c`.
pub(super) type PaddedRows = [u32; GRID_CELLS + KERNEL_MAX - 1];

/// Packs the cells of one grid (0 = free) into padded rows.
pub(super) fn padded_rows(occupied: &[u8], conv: ConvLayer) -> PaddedRows {
    let (before, _) = conv.padding();
    let mut rows = [0; GRID_CELLS + KERNEL_MAX - 1];
    for (row, cells) in rows[before..].iter_mut().zip(occupied.chunks_exact(GRID_CELLS)) {
        for (col, cell) in cells.iter().enumerate() {
            *row |= u32::from(*cell != 0) << (col + before);
        }
    }
    rows
}

/// The weights as the passes below want them.
pub(super) struct FirstLayer<'a> {
    conv: ConvLayer,
    /// `[kernel row, pattern, channel]`: what a kernel row adds when its cells hold `pattern` (bit = kernel column).
    table: Vec<f32>,
    bias: &'a [f32],
}

/// Where the four cells of a pool find the rows of the kernel in the table.
struct TableRows {
    of_cell: [[usize; KERNEL_MAX]; 4],
    /// All four cells see the same: every row of the kernel meets one and the same pattern.
    are_equal: bool,
}

/// Where the layer writes to and reads from: cells of the pooled map inside the zero padding of the second convolution.
#[derive(Debug, Clone, Copy)]
pub(super) struct PaddedMap {
    /// Cells per side, padding included.
    pub(super) side: usize,
    /// Cells of padding at the top and at the left.
    pub(super) before: usize,
}

impl<'a> FirstLayer<'a> {
    /// `weight` `[channel, 1, kernel, kernel]`.
    pub(super) fn new(conv: ConvLayer, weight: &[f32], bias: &'a [f32]) -> Self {
        let mut table = vec![0.0; (conv.kernel << conv.kernel) * conv.channels];
        for_each_table_entry(conv, |entry, of_weight| table[entry] += weight[of_weight]);
        Self { conv, table, bias }
    }

    /// Values of [`Self::table`].
    pub(super) fn table_len(conv: ConvLayer) -> usize {
        (conv.kernel << conv.kernel) * conv.channels
    }

    /// One grid to its pooled map `[side, side, channel]`, and who won each pool `[12, 12, channel]`.
    #[inline(always)]
    pub(super) fn forward<S: Simd>(
        &self,
        simd: S,
        rows: &PaddedRows,
        map: PaddedMap,
        pooled: &mut [f32],
        winners: &mut [u32],
    ) {
        let width = self.conv.channels / S::F32_LANES;
        let (table, bias) = (vectors::<S>(&self.table), vectors::<S>(self.bias));
        let (pooled, winners) = (vectors_mut::<S>(pooled), int_vectors_mut::<S>(winners));
        for row in 0..POOLED_1 {
            for col in 0..POOLED_1 {
                let entries = self.table_rows(rows, row, col);
                let pooled = &mut pooled[((row + map.before) * map.side + col + map.before) * width..][..width];
                let winners = &mut winners[(row * POOLED_1 + col) * width..][..width];
                for v in 0..width {
                    let sum = |cell: usize| {
                        let of_rows = &entries.of_cell[cell][..self.conv.kernel];
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
                    (pooled[v], winners[v]) = with_relu(simd, best, bias[v]);
                }
            }
        }
    }

    /// Adds one sample's share to the gradients of the table and the bias.
    #[inline(always)]
    #[expect(clippy::too_many_arguments, reason = "two inputs, the trace and two gradients, each by its name")]
    pub(super) fn backward<S: Simd>(
        &self,
        simd: S,
        rows: &PaddedRows,
        map: PaddedMap,
        d_pooled: &[f32],
        winners: &[u32],
        d_table: &mut [f32],
        d_bias: &mut [f32],
    ) {
        let width = self.conv.channels / S::F32_LANES;
        let (d_pooled, winners) = (vectors::<S>(d_pooled), int_vectors::<S>(winners));
        let (d_table, d_bias) = (vectors_mut::<S>(d_table), vectors_mut::<S>(d_bias));
        let (zero, silent) = (simd.splat_f32s(0.0), simd.splat_u32s(SILENT));
        for row in 0..POOLED_1 {
            for col in 0..POOLED_1 {
                let entries = self.table_rows(rows, row, col);
                let d_pooled = &d_pooled[((row + map.before) * map.side + col + map.before) * width..][..width];
                let winners = &winners[(row * POOLED_1 + col) * width..][..width];
                for v in 0..width {
                    let alive = simd.select_f32s(simd.equal_u32s(winners[v], silent), zero, d_pooled[v]);
                    d_bias[v] = simd.add_f32s(d_bias[v], alive);
                    // All four cells see the same: whoever won, the gradient goes to the same entries.
                    let cells = if entries.are_equal { 1 } else { POOL.len() };
                    for cell in 0..cells {
                        let is_winner = simd.equal_u32s(winners[v], simd.splat_u32s(cell as u32));
                        let share =
                            if entries.are_equal { alive } else { simd.select_f32s(is_winner, d_pooled[v], zero) };
                        for (kernel_row, table_row) in entries.of_cell[cell][..self.conv.kernel].iter().enumerate() {
                            // The pattern without cells has no weights.
                            if *table_row != kernel_row << self.conv.kernel {
                                let sum = &mut d_table[table_row * width + v];
                                *sum = simd.add_f32s(*sum, share);
                            }
                        }
                    }
                }
            }
        }
    }

    /// The gradient of the weights from that of the table.
    pub(super) fn d_weight(conv: ConvLayer, d_table: &[f32], d_weight: &mut [f32]) {
        d_weight.fill(0.0);
        for_each_table_entry(conv, |entry, of_weight| d_weight[of_weight] += d_table[entry]);
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
