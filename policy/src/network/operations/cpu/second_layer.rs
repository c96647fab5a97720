//! Second convolution, max-pool and `ReLU`.
//!
//! Forward, a window is read where it lies: a row of the kernel's window is one contiguous run of the padded map. The
//! four convolutions of a pool are computed together, so that each weight is loaded once for four products.
//!
//! Backward, a pool sends its gradient to one of its four cells and a silent one sends none, so that at most a quarter
//! of the products of a dense implementation remain. They are listed first and then computed without a branch.

use super::first_layer::PaddedMap;
use super::pool::{POOL, SILENT, better, with_relu};
use super::vectors::{int_vectors_mut, vectors, vectors_mut};
use crate::network::architecture::{ConvLayer, LANES, POOLED_2};
use pulp::Simd;

/// Sizes of the layer.
#[derive(Debug, Clone, Copy)]
pub(super) struct SecondLayer {
    /// Channels of the input.
    pub(super) inputs: usize,
    pub(super) conv: ConvLayer,
    pub(super) map: PaddedMap,
}

/// The outputs of a block: some vectors from channel `first` on.
struct Block<'a> {
    /// `[window value, output]`.
    weights: &'a [f32],
    bias: &'a [f32],
    first: usize,
}

/// Memory for the products that a backward pass has to compute, by what they share.
#[derive(Debug, Clone)]
pub(super) struct Sparse {
    /// Products of one output channel: (start of the window, gradient).
    of_channel: Vec<(usize, f32)>,
    /// Products of one cell of the convolution: (start of the output's weights, gradient).
    of_cell: Vec<(usize, f32)>,
}

impl Sparse {
    pub(super) fn new(layer: SecondLayer) -> Self {
        // One more than fits: what is not kept is written there.
        let of_channel = vec![(0, 0.0); POOLED_2 * POOLED_2 + 1];
        Self { of_channel, of_cell: vec![(0, 0.0); layer.conv.channels + 1] }
    }
}

/// A list that is filled without a branch: who wins a pool cannot be predicted.
struct List<'a> {
    memory: &'a mut [(usize, f32)],
    len: usize,
}

impl<'a> List<'a> {
    fn new(memory: &'a mut [(usize, f32)]) -> Self {
        Self { memory, len: 0 }
    }

    #[inline(always)]
    fn push(&mut self, item: (usize, f32), is_kept: bool) {
        self.memory[self.len] = item;
        self.len += usize::from(is_kept);
    }

    fn pushed(&self) -> &[(usize, f32)] {
        &self.memory[..self.len]
    }
}

impl SecondLayer {
    /// Values of one row of a window: they lie side by side in the padded map.
    fn span(self) -> usize {
        self.conv.kernel * self.inputs
    }

    /// Values of a window.
    pub(super) fn window_len(self) -> usize {
        self.conv.kernel * self.span()
    }

    /// Values of the padded map.
    pub(super) fn map_len(self) -> usize {
        self.map.side * self.map.side * self.inputs
    }

    /// Where the windows of the four cells of a pool start in the padded map.
    #[inline(always)]
    fn windows_of_pool(self, pool: usize) -> [usize; 4] {
        let (row, col) = (2 * (pool / POOLED_2), 2 * (pool % POOLED_2));
        POOL.map(|(down, right)| ((row + down) * self.map.side + col + right) * self.inputs)
    }

    /// Weights `[output, input, row, column]` as `[window value, output]`, cut into blocks of two vectors of outputs
    /// (the last may be of one): block by block, so that a block is read in one run.
    #[inline(always)]
    pub(super) fn by_window<S: Simd>(self, weight: &[f32]) -> Vec<f32> {
        let mut packed = Vec::with_capacity(weight.len());
        for (first, len) in blocks::<S>(self.conv.channels) {
            for at in 0..self.window_len() {
                let from = self.weight_index(at);
                packed.extend((first..first + len).map(|output| weight[output * self.window_len() + from]));
            }
        }
        packed
    }

    /// Weights `[output, input, row, column]` as `[output, window value]`.
    pub(super) fn by_output(self, weight: &[f32]) -> Vec<f32> {
        let order: Vec<usize> = (0..self.window_len()).map(|at| self.weight_index(at)).collect();
        weight.chunks_exact(self.window_len()).flat_map(|of_output| order.iter().map(|from| of_output[*from])).collect()
    }

    /// The transpose of [`Self::by_output`].
    pub(super) fn d_weight(self, by_output: &[f32], d_weight: &mut [f32]) {
        for (from, into) in by_output.chunks_exact(self.window_len()).zip(d_weight.chunks_exact_mut(self.window_len()))
        {
            for (at, value) in from.iter().enumerate() {
                into[self.weight_index(at)] = *value;
            }
        }
    }

    /// Which weight of an output `[input, row, column]` meets value `at` of a window `[row, column, input]`.
    fn weight_index(self, at: usize) -> usize {
        let (cell, input) = (at / self.inputs, at % self.inputs);
        input * self.conv.kernel * self.conv.kernel + cell
    }

    /// One padded map to features `[6 · 6, channel]`, and who won each pool.
    #[inline(always)]
    pub(super) fn forward<S: Simd>(
        self,
        simd: S,
        pooled: &[f32],
        by_window: &[f32],
        bias: &[f32],
        features: &mut [f32],
        winners: &mut [u32],
    ) {
        for (first, len) in blocks::<S>(self.conv.channels) {
            let weights = &by_window[first * self.window_len()..][..len * self.window_len()];
            let block = Block { weights, bias: &bias[first..first + len], first };
            // As many sums as fit the registers: with AVX-512 those of two pools.
            match (len == 2 * S::F32_LANES, S::F32_LANES == LANES) {
                (true, true) => self.forward_block::<S, 2, 8>(simd, pooled, &block, features, winners),
                (true, false) => self.forward_block::<S, 2, 4>(simd, pooled, &block, features, winners),
                (false, _) => self.forward_block::<S, 1, 8>(simd, pooled, &block, features, winners),
            }
        }
    }

    /// `WIDTH` vectors of outputs, `CELLS` cells of the convolution at a time: one pool or two.
    #[inline(always)]
    fn forward_block<S: Simd, const WIDTH: usize, const CELLS: usize>(
        self,
        simd: S,
        pooled: &[f32],
        block: &Block<'_>,
        features: &mut [f32],
        winners: &mut [u32],
    ) {
        let zero = simd.splat_f32s(0.0);
        let bias = vectors::<S>(block.bias);
        let span = self.span();
        for first_pool in (0..POOLED_2 * POOLED_2).step_by(CELLS / POOL.len()) {
            let mut sums = [[zero; WIDTH]; CELLS];
            let starts: [usize; CELLS] =
                std::array::from_fn(|cell| self.windows_of_pool(first_pool + cell / POOL.len())[cell % POOL.len()]);
            for kernel_row in 0..self.conv.kernel {
                let offset = kernel_row * self.map.side * self.inputs;
                let values = starts.map(|start| &pooled[start + offset..][..span]);
                let weights = vectors::<S>(&block.weights[kernel_row * span * WIDTH * S::F32_LANES..]);
                let weights = &weights.as_chunks::<WIDTH>().0[..span];
                for at in 0..span {
                    for cell in 0..CELLS {
                        let value = simd.splat_f32s(values[cell][at]);
                        for v in 0..WIDTH {
                            sums[cell][v] = simd.mul_add_f32s(value, weights[at][v], sums[cell][v]);
                        }
                    }
                }
            }
            for (pool, sums) in (first_pool..).zip(sums.as_chunks::<4>().0) {
                let at = pool * self.conv.channels + block.first;
                let features = vectors_mut::<S>(&mut features[at..at + WIDTH * S::F32_LANES]);
                let winners = int_vectors_mut::<S>(&mut winners[at..at + WIDTH * S::F32_LANES]);
                for v in 0..WIDTH {
                    let first = (sums[0][v], simd.splat_u32s(0));
                    let best =
                        (1..).zip(&sums[1..]).fold(first, |best, (cell, sums)| better(simd, best, sums[v], cell));
                    (features[v], winners[v]) = with_relu(simd, best, bias[v]);
                }
            }
        }
    }

    /// One sample's share: adds to the gradients of the weights (`[output, window value]`) and the bias, and writes
    /// that of the padded map.
    #[inline(always)]
    #[expect(clippy::too_many_arguments, reason = "three inputs, the trace, and three gradients, each by its name")]
    pub(super) fn backward<S: Simd>(
        self,
        simd: S,
        pooled: &[f32],
        by_output: &[f32],
        d_features: &[f32],
        winners: &[u32],
        sparse: &mut Sparse,
        d_pooled: &mut [f32],
        d_by_output: &mut [f32],
        d_bias: &mut [f32],
    ) {
        let channels = self.conv.channels;
        // Gradients of the weights: per output channel, its windows.
        for channel in 0..channels {
            let mut list = List::new(&mut sparse.of_channel);
            let mut sum = 0.0;
            for pool in 0..POOLED_2 * POOLED_2 {
                let at = pool * channels + channel;
                let is_alive = winners[at] != SILENT;
                // A silent pool has no window; whichever is listed is overwritten by the next.
                list.push((self.windows_of_pool(pool)[(winners[at] % SILENT) as usize], d_features[at]), is_alive);
                sum += if is_alive { d_features[at] } else { 0.0 };
            }
            d_bias[channel] += sum;
            let into = &mut d_by_output[channel * self.window_len()..][..self.window_len()];
            self.add_windows(simd, pooled, list.pushed(), into);
        }
        // Gradient of the map: per cell of the convolution, its output channels.
        d_pooled.fill(0.0);
        for pool in 0..POOLED_2 * POOLED_2 {
            let of_pool = pool * channels..(pool + 1) * channels;
            for (cell, start) in self.windows_of_pool(pool).into_iter().enumerate() {
                let mut list = List::new(&mut sparse.of_cell);
                for (channel, (gradient, winner)) in
                    d_features[of_pool.clone()].iter().zip(&winners[of_pool.clone()]).enumerate()
                {
                    list.push((channel * self.window_len(), *gradient), *winner == cell as u32);
                }
                self.add_outputs(simd, by_output, list.pushed(), &mut d_pooled[start..]);
            }
        }
    }

    /// `into` `[window value]` += Σ gradient · window.
    #[inline(always)]
    fn add_windows<S: Simd>(self, simd: S, pooled: &[f32], list: &[(usize, f32)], into: &mut [f32]) {
        for_each_group(self.window_len() / S::F32_LANES, |first, group| {
            let (read, written) = (|v| self.vector_of_window::<S>(first + v), |v| first + v);
            match group {
                Group::Nine => accumulate::<S, 9>(simd, pooled, list, read, into, written),
                Group::Eight => accumulate::<S, 8>(simd, pooled, list, read, into, written),
                Group::One => accumulate::<S, 1>(simd, pooled, list, read, into, written),
            }
        });
    }

    /// The window that begins at `d_pooled` += Σ gradient · weights of the output.
    #[inline(always)]
    fn add_outputs<S: Simd>(self, simd: S, by_output: &[f32], list: &[(usize, f32)], d_pooled: &mut [f32]) {
        if list.is_empty() {
            return;
        }
        for_each_group(self.window_len() / S::F32_LANES, |first, group| {
            let (read, written) = (|v| first + v, |v| self.vector_of_window::<S>(first + v));
            match group {
                Group::Nine => accumulate::<S, 9>(simd, by_output, list, read, d_pooled, written),
                Group::Eight => accumulate::<S, 8>(simd, by_output, list, read, d_pooled, written),
                Group::One => accumulate::<S, 1>(simd, by_output, list, read, d_pooled, written),
            }
        });
    }

    /// Where vector `at` of a window lies in the padded map, in vectors from the start of the window.
    #[inline(always)]
    fn vector_of_window<S: Simd>(self, at: usize) -> usize {
        let (stride, span) = (self.map.side * self.inputs / S::F32_LANES, self.span() / S::F32_LANES);
        at / span * stride + at % span
    }
}

/// The `N` vectors of `into` at `written` += Σ gradient · the `N` vectors of `values` at `read` from each start.
#[inline(always)]
fn accumulate<S: Simd, const N: usize>(
    simd: S,
    values: &[f32],
    list: &[(usize, f32)],
    read: impl Fn(usize) -> usize,
    into: &mut [f32],
    written: impl Fn(usize) -> usize,
) {
    let read: [usize; N] = std::array::from_fn(read);
    let (values, into) = (vectors::<S>(values), vectors_mut::<S>(into));
    let mut sums = [simd.splat_f32s(0.0); N];
    for (start, gradient) in list {
        let (values, gradient) = (&values[start / S::F32_LANES..], simd.splat_f32s(*gradient));
        for v in 0..N {
            sums[v] = simd.mul_add_f32s(gradient, values[read[v]], sums[v]);
        }
    }
    for v in 0..N {
        into[written(v)] = simd.add_f32s(into[written(v)], sums[v]);
    }
}

/// Vectors that are summed side by side in registers.
enum Group {
    Nine,
    Eight,
    One,
}

/// Cuts `len` vectors into groups: by nines where that works out (a 3×3 kernel), else by eights.
#[inline(always)]
fn for_each_group(len: usize, mut visit: impl FnMut(usize, Group)) {
    let mut first = 0;
    while first < len {
        let (step, group) = match len - first {
            _ if len.is_multiple_of(9) => (9, Group::Nine),
            8.. => (8, Group::Eight),
            _ => (1, Group::One),
        };
        visit(first, group);
        first += step;
    }
}

/// Blocks of outputs: (first, number), two vectors each, then one if the number of vectors is odd.
fn blocks<S: Simd>(channels: usize) -> impl Iterator<Item = (usize, usize)> {
    let block = 2 * S::F32_LANES;
    (0..channels).step_by(block).map(move |first| (first, block.min(channels - first)))
}
