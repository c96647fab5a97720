//! Both convolutions with their pools, forward and backward.

use crate::network::architecture::{ConvLayer, LANES, POOLED_1, POOLED_2};
use crate::network::fast::matrix::{product, rows};
use crate::network::weights::Weights;
use faer::Accum;
use sim::sensing::{GRID_CELLS, OccupancyGrid};

/// The weights of both convolutions as the passes below want them.
#[derive(Debug, Clone)]
pub(crate) struct Encoder {
    conv1: ConvLayer,
    conv2: ConvLayer,
    /// `[kernel row, pattern, channel]`: what a kernel row adds when its cells hold `pattern` (bit = kernel column).
    table: Vec<f32>,
    /// `[kernel row · kernel column · input channel, output channel]`.
    matrix: Vec<f32>,
}

/// What the forward pass leaves for the backward pass.
#[derive(Debug, Clone, Default)]
pub(crate) struct EncoderTrace {
    /// `[batch, padded row, padded column, channel]`: first pool, zero-padded for the second convolution.
    pooled_1: Vec<f32>,
    /// `[batch, row, column, channel]`: which of four cells won the first pool, [`SILENT`] if `ReLU` cut it off.
    winner_1: Vec<u8>,
    /// The same for the second pool.
    winner_2: Vec<u8>,
    /// `[tile · 12 · 12, kernel · kernel · channel]`: windows of the second convolution.
    windows: Vec<f32>,
    /// `[tile · 12 · 12, output channel]`: second convolution, or its gradient.
    conv_2: Vec<f32>,
    /// One sample of `pooled_1`: its gradient.
    d_pooled_1: Vec<f32>,
    /// Gradient of `Encoder::table`.
    d_table: Vec<f32>,
    /// Gradient of `Encoder::matrix`.
    d_matrix: Vec<f32>,
}

/// Samples whose windows are laid out at a time: 4 × 144 rows stay in the second-level cache.
pub const TILE: usize = 4;
/// The winner of a pool whose value is cut off by `ReLU`.
const SILENT: u8 = 4;
/// The four cells of a pool, row by row; the first of equals wins.
const POOL: [(usize, usize); 4] = [(0, 0), (0, 1), (1, 0), (1, 1)];

impl Encoder {
    pub(crate) fn new(weights: &Weights) -> Self {
        let (conv1, conv2) = (weights.architecture().conv1, weights.architecture().conv2);
        let parts = weights.parts();
        let mut table = vec![0.0; table_len(conv1)];
        for_each_table_entry(conv1, |entry, weight| table[entry] += parts.conv1_weight[weight]);
        let mut matrix = vec![0.0; parts.conv2_weight.len()];
        for_each_matrix_entry(conv1, conv2, |entry, weight| matrix[entry] = parts.conv2_weight[weight]);
        Self { conv1, conv2, table, matrix }
    }

    /// Grids to `features` `[batch, 6 · 6 · channel]`.
    pub(crate) fn forward(
        &self,
        grids: &[OccupancyGrid],
        bias_1: &[f32],
        bias_2: &[f32],
        features: &mut [f32],
        trace: &mut EncoderTrace,
    ) {
        let batch = grids.len();
        let sizes = self.sizes();
        // The border stays zero: it is never written.
        trace.pooled_1.resize(batch * sizes.pooled_1, 0.0);
        trace.winner_1.resize(batch * sizes.winner_1, 0);
        trace.winner_2.resize(batch * sizes.features, 0);
        trace.windows.resize(TILE * sizes.windows, 0.0);
        trace.conv_2.resize(TILE * sizes.conv_2, 0.0);

        for first in (0..batch).step_by(TILE) {
            let tile = TILE.min(batch - first);
            for sample in 0..tile {
                let index = first + sample;
                let pooled_1 = block_mut(&mut trace.pooled_1, index, sizes.pooled_1);
                let winner_1 = block_mut(&mut trace.winner_1, index, sizes.winner_1);
                self.conv_1_and_pool(&grids[index], bias_1, pooled_1, winner_1);
                self.copy_windows(pooled_1, block_mut(&mut trace.windows, sample, sizes.windows));
            }
            let conv_2 = &mut trace.conv_2[..tile * sizes.conv_2];
            let windows = rows(&trace.windows[..tile * sizes.windows], self.window_len());
            product(Accum::Replace, conv_2, windows, rows(&self.matrix, self.conv2.channels));
            for sample in 0..tile {
                let index = first + sample;
                pool_2(
                    self.conv2.channels,
                    block(&trace.conv_2, sample, sizes.conv_2),
                    bias_2,
                    block_mut(features, index, sizes.features),
                    block_mut(&mut trace.winner_2, index, sizes.features),
                );
            }
        }
    }

    /// Writes the gradients of both convolutions, given the gradient of the features of the last forward pass.
    #[expect(clippy::too_many_arguments, reason = "four gradients, each with its name at the call")]
    pub(crate) fn backward(
        &self,
        grids: &[OccupancyGrid],
        d_features: &[f32],
        trace: &mut EncoderTrace,
        d_weight_1: &mut [f32],
        d_bias_1: &mut [f32],
        d_weight_2: &mut [f32],
        d_bias_2: &mut [f32],
    ) {
        let sizes = self.sizes();
        let batch = grids.len();
        trace.d_pooled_1.resize(sizes.pooled_1, 0.0);
        trace.d_table.clear();
        trace.d_table.resize(self.table.len(), 0.0);
        trace.d_matrix.clear();
        trace.d_matrix.resize(self.matrix.len(), 0.0);
        d_weight_1.fill(0.0);
        d_bias_1.fill(0.0);
        d_bias_2.fill(0.0);

        for first in (0..batch).step_by(TILE) {
            let tile = TILE.min(batch - first);
            for sample in 0..tile {
                let index = first + sample;
                let pooled_1 = block(&trace.pooled_1, index, sizes.pooled_1);
                self.copy_windows(pooled_1, block_mut(&mut trace.windows, sample, sizes.windows));
                unpool_2(
                    self.conv2.channels,
                    block(d_features, index, sizes.features),
                    block(&trace.winner_2, index, sizes.features),
                    block_mut(&mut trace.conv_2, sample, sizes.conv_2),
                    d_bias_2,
                );
            }
            let d_conv_2 = rows(&trace.conv_2[..tile * sizes.conv_2], self.conv2.channels);
            let windows = rows(&trace.windows[..tile * sizes.windows], self.window_len());
            product(Accum::Add, &mut trace.d_matrix, windows.transpose(), d_conv_2);
            let matrix = rows(&self.matrix, self.conv2.channels);
            // The windows are done with; their memory takes their gradient.
            product(Accum::Replace, &mut trace.windows[..tile * sizes.windows], d_conv_2, matrix.transpose());
            for sample in 0..tile {
                let index = first + sample;
                self.add_windows(block(&trace.windows, sample, sizes.windows), &mut trace.d_pooled_1);
                self.conv_1_backward(
                    &grids[index],
                    &trace.d_pooled_1,
                    block(&trace.winner_1, index, sizes.winner_1),
                    &mut trace.d_table,
                    d_bias_1,
                );
            }
        }
        for_each_table_entry(self.conv1, |entry, weight| d_weight_1[weight] += trace.d_table[entry]);
        for_each_matrix_entry(self.conv1, self.conv2, |entry, weight| d_weight_2[weight] = trace.d_matrix[entry]);
    }

    /// First convolution, pool, bias, `ReLU`: one grid to one zero-padded block.
    fn conv_1_and_pool(&self, grid: &OccupancyGrid, bias: &[f32], pooled: &mut [f32], winner: &mut [u8]) {
        let channels = self.conv1.channels;
        let words = padded_words(grid, self.conv1);
        for row in 0..POOLED_1 {
            for col in 0..POOLED_1 {
                let entries = self.table_entries(&words, row, col);
                let at = (row * POOLED_1 + col) * channels;
                let winner = &mut winner[at..at + channels];
                let at = self.padded_index(row, col);
                let pooled = &mut pooled[at..at + channels];
                for lane in (0..channels).step_by(LANES) {
                    let (value, from) = self.best_of_four(&entries, lane);
                    for i in 0..LANES {
                        let value = value[i] + bias[lane + i];
                        pooled[lane + i] = value.max(0.0);
                        winner[lane + i] = if value > 0.0 { from[i] as u8 } else { SILENT };
                    }
                }
            }
        }
    }

    /// Largest of the four convolutions of a pool, and whose it is, for [`LANES`] channels.
    #[inline]
    fn best_of_four(&self, entries: &PoolEntries, lane: usize) -> ([f32; LANES], [u32; LANES]) {
        let sum = |cell: usize| {
            let mut sum = [0.0; LANES];
            for &entry in &entries.of_cell[cell][..self.conv1.kernel] {
                let line: &[f32; LANES] = self.table[entry + lane..].first_chunk().expect("tables end with a line");
                for i in 0..LANES {
                    sum[i] += line[i];
                }
            }
            sum
        };
        let (mut best, mut from) = (sum(0), [0; LANES]);
        if entries.are_equal {
            return (best, from);
        }
        for cell in 1..POOL.len() {
            let value = sum(cell);
            for i in 0..LANES {
                let wins = value[i] > best[i];
                best[i] = if wins { value[i] } else { best[i] };
                from[i] = if wins { cell as u32 } else { from[i] };
            }
        }
        (best, from)
    }

    /// Adds what one sample contributes to the gradients of the table and the bias.
    fn conv_1_backward(
        &self,
        grid: &OccupancyGrid,
        d_pooled: &[f32],
        winner: &[u8],
        d_table: &mut [f32],
        d_bias: &mut [f32],
    ) {
        let channels = self.conv1.channels;
        let words = padded_words(grid, self.conv1);
        for row in 0..POOLED_1 {
            for col in 0..POOLED_1 {
                let entries = self.table_entries(&words, row, col);
                let at = (row * POOLED_1 + col) * channels;
                let winner = &winner[at..at + channels];
                let at = self.padded_index(row, col);
                let d_pooled = &d_pooled[at..at + channels];
                for lane in (0..channels).step_by(LANES) {
                    let gradient: &[f32; LANES] = d_pooled[lane..].first_chunk().expect("channels fill lanes");
                    let winner: &[u8; LANES] = winner[lane..].first_chunk().expect("channels fill lanes");
                    let alive = keep_where(gradient, |i| winner[i] != SILENT);
                    add(d_bias[lane..].first_chunk_mut().expect("channels fill lanes"), &alive);
                    // All four cells see the same: whoever won, the gradient goes to the same entries.
                    let cells = if entries.are_equal { 1 } else { POOL.len() };
                    for cell in 0..cells {
                        let share =
                            if entries.are_equal { alive } else { keep_where(gradient, |i| winner[i] == cell as u8) };
                        for (kernel_row, &entry) in entries.of_cell[cell][..self.conv1.kernel].iter().enumerate() {
                            // The pattern without cells has no weights.
                            if entry != (kernel_row << self.conv1.kernel) * channels {
                                add(d_table[entry + lane..].first_chunk_mut().expect("tables end with a line"), &share);
                            }
                        }
                    }
                }
            }
        }
    }

    /// Where the four convolutions of one pool find their kernel rows in the table.
    fn table_entries(&self, words: &PaddedWords, row: usize, col: usize) -> PoolEntries {
        let (kernel, channels) = (self.conv1.kernel, self.conv1.channels);
        let mask = (1 << kernel) - 1;
        let mut of_cell = [[0; MAX_KERNEL]; 4];
        for ((down, right), entries) in POOL.into_iter().zip(&mut of_cell) {
            for (kernel_row, entry) in entries[..kernel].iter_mut().enumerate() {
                let pattern = (words[2 * row + down + kernel_row] >> (2 * col + right) & mask) as usize;
                *entry = ((kernel_row << kernel) + pattern) * channels;
            }
        }
        let are_equal = of_cell.iter().all(|entries| *entries == of_cell[0]);
        PoolEntries { of_cell, are_equal }
    }

    /// Lays out the windows of the second convolution: one row per cell, kernel row by kernel row.
    fn copy_windows(&self, pooled: &[f32], windows: &mut [f32]) {
        let span = self.conv2.kernel * self.conv1.channels;
        let stride = self.padded_side() * self.conv1.channels;
        for (cell, window) in windows.chunks_exact_mut(self.window_len()).enumerate() {
            let start = cell / POOLED_1 * stride + cell % POOLED_1 * self.conv1.channels;
            for (kernel_row, part) in window.chunks_exact_mut(span).enumerate() {
                let from = start + kernel_row * stride;
                part.copy_from_slice(&pooled[from..from + span]);
            }
        }
    }

    /// Transpose of [`Self::copy_windows`]: sums the gradients of all windows a cell is part of.
    fn add_windows(&self, windows: &[f32], pooled: &mut [f32]) {
        let span = self.conv2.kernel * self.conv1.channels;
        let stride = self.padded_side() * self.conv1.channels;
        pooled.fill(0.0);
        for (cell, window) in windows.chunks_exact(self.window_len()).enumerate() {
            let start = cell / POOLED_1 * stride + cell % POOLED_1 * self.conv1.channels;
            for (kernel_row, part) in window.chunks_exact(span).enumerate() {
                let to = start + kernel_row * stride;
                for (sum, value) in pooled[to..to + span].iter_mut().zip(part) {
                    *sum += value;
                }
            }
        }
    }

    /// Cells per side of the zero-padded input of the second convolution.
    fn padded_side(&self) -> usize {
        POOLED_1 + self.conv2.kernel - 1
    }

    fn padded_index(&self, row: usize, col: usize) -> usize {
        let (before, _) = self.conv2.padding();
        ((row + before) * self.padded_side() + col + before) * self.conv1.channels
    }

    fn window_len(&self) -> usize {
        self.conv2.kernel * self.conv2.kernel * self.conv1.channels
    }

    fn sizes(&self) -> Sizes {
        Sizes {
            pooled_1: self.padded_side() * self.padded_side() * self.conv1.channels,
            winner_1: POOLED_1 * POOLED_1 * self.conv1.channels,
            windows: POOLED_1 * POOLED_1 * self.window_len(),
            conv_2: POOLED_1 * POOLED_1 * self.conv2.channels,
            features: POOLED_2 * POOLED_2 * self.conv2.channels,
        }
    }
}

/// Values per sample.
struct Sizes {
    pooled_1: usize,
    winner_1: usize,
    windows: usize,
    conv_2: usize,
    features: usize,
}

/// Largest kernel whose patterns are tabulated.
const MAX_KERNEL: usize = 7;

/// Table entries per cell of a pool and kernel row.
struct PoolEntries {
    of_cell: [[usize; MAX_KERNEL]; 4],
    /// All four cells see the same surroundings.
    are_equal: bool,
}

/// The rows of a grid with "same" padding, bit `c + padding` = column `c`.
type PaddedWords = [u32; GRID_CELLS + MAX_KERNEL - 1];

fn padded_words(grid: &OccupancyGrid, conv: ConvLayer) -> PaddedWords {
    let (before, _) = conv.padding();
    let mut words = [0; GRID_CELLS + MAX_KERNEL - 1];
    for (row, word) in words[before..before + GRID_CELLS].iter_mut().enumerate() {
        for col in 0..GRID_CELLS {
            *word |= u32::from(grid.is_occupied(row, col)) << (col + before);
        }
    }
    words
}

fn table_len(conv: ConvLayer) -> usize {
    (conv.kernel << conv.kernel) * conv.channels
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

/// Calls with every pair (entry of the window matrix, weight it is).
fn for_each_matrix_entry(conv1: ConvLayer, conv2: ConvLayer, mut visit: impl FnMut(usize, usize)) {
    let (inputs, outputs, cells) = (conv1.channels, conv2.channels, conv2.kernel * conv2.kernel);
    for cell in 0..cells {
        for input in 0..inputs {
            for output in 0..outputs {
                visit((cell * inputs + input) * outputs + output, (output * inputs + input) * cells + cell);
            }
        }
    }
}

/// Second pool, bias, `ReLU`: `[12 · 12, channel]` to `[6 · 6, channel]`.
fn pool_2(channels: usize, conv: &[f32], bias: &[f32], features: &mut [f32], winner: &mut [u8]) {
    for cell in 0..POOLED_2 * POOLED_2 {
        let [a, b, c, d] = pool_rows(cell).map(|row| &conv[row * channels..][..channels]);
        let features = &mut features[cell * channels..][..channels];
        let winner = &mut winner[cell * channels..][..channels];
        for i in 0..channels {
            // Two by two, as a tournament: the first of equals wins here too.
            let (top, top_from) = if b[i] > a[i] { (b[i], 1) } else { (a[i], 0) };
            let (low, low_from) = if d[i] > c[i] { (d[i], 3) } else { (c[i], 2) };
            let (best, from) = if low > top { (low, low_from) } else { (top, top_from) };
            let value = best + bias[i];
            features[i] = value.max(0.0);
            winner[i] = if value > 0.0 { from } else { SILENT };
        }
    }
}

/// Sends the gradient of each feature to the cell that won; the others get 0.
fn unpool_2(channels: usize, d_features: &[f32], winner: &[u8], d_conv: &mut [f32], d_bias: &mut [f32]) {
    for cell in 0..POOLED_2 * POOLED_2 {
        let d_features = &d_features[cell * channels..][..channels];
        let winner = &winner[cell * channels..][..channels];
        for (from, row) in pool_rows(cell).into_iter().enumerate() {
            let d_conv = &mut d_conv[row * channels..][..channels];
            for i in 0..channels {
                d_conv[i] = if winner[i] == from as u8 { d_features[i] } else { 0.0 };
            }
        }
        for i in 0..channels {
            d_bias[i] += if winner[i] == SILENT { 0.0 } else { d_features[i] };
        }
    }
}

/// Rows of the 12×12 cells that meet in one cell of the second pool.
fn pool_rows(cell: usize) -> [usize; 4] {
    let (row, col) = (2 * (cell / POOLED_2), 2 * (cell % POOLED_2));
    POOL.map(|(down, right)| (row + down) * POOLED_1 + col + right)
}

fn keep_where(values: &[f32; LANES], keep: impl Fn(usize) -> bool) -> [f32; LANES] {
    std::array::from_fn(|i| if keep(i) { values[i] } else { 0.0 })
}

fn add(sums: &mut [f32; LANES], values: &[f32; LANES]) {
    for i in 0..LANES {
        sums[i] += values[i];
    }
}

fn block<T>(values: &[T], index: usize, len: usize) -> &[T] {
    &values[index * len..(index + 1) * len]
}

fn block_mut<T>(values: &mut [T], index: usize, len: usize) -> &mut [T] {
    &mut values[index * len..(index + 1) * len]
}
