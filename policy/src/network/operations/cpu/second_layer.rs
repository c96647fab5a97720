//! Second convolution, max-pool and `ReLU`.
//!
//! Forward, the four convolutions of a pool are computed together.
//!
//! Backward, a pool sends its gradient to one of its four cells and a silent one sends none, so that at most a quarter
//! of the products of a dense implementation remain. They are listed first and then computed without a branch.

use super::convolution::{Convolution, Gradients, blocks};
use super::pool::{POOL, better, with_relu};
use super::vectors::{self, int_vectors_mut, vectors_mut};
use super::{Answers, CHUNK, SILENT, add, by_chunks};
use crate::network::architecture::{ConvLayer, LANES, POOLED_1, POOLED_2};
use pulp::{Simd, WithSimd};
use rayon::prelude::*;

/// Outputs per channel.
const POOLS: usize = POOLED_2 * POOLED_2;

/// The layer with its weights, in burn's shapes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SecondLayer<'a> {
    convolution: Convolution,
    /// `[channel, input, kernel, kernel]`.
    weight: &'a [f32],
    /// `[channel]`.
    bias: &'a [f32],
}

impl<'a> SecondLayer<'a> {
    pub(crate) fn new(conv: ConvLayer, weight: &'a [f32], bias: &'a [f32]) -> Self {
        let inputs = weight.len() / (conv.channels * conv.kernel * conv.kernel);
        Self { convolution: Convolution { inputs, conv, cells: POOLED_1 }, weight, bias }
    }

    /// `[batch, 6 · 6, channel]` of `x` `[batch, 12 · 12, input]`, and who won each pool.
    pub(crate) fn forward(&self, x: &[f32], is_traced: bool) -> Answers {
        let windows = self.windows();
        by_chunks(x, self.convolution.input_len(), POOLS * self.bias.len(), is_traced, |x, y, winners| {
            vectors::run(Forward { layer: *self, windows: &windows, x, y, winners });
        })
    }

    /// The gradients, given that of the answers and who won each pool.
    pub(crate) fn backward(&self, x: &[f32], winners: &[u32], d_y: &[f32]) -> Gradients {
        assert_eq!(d_y.len(), winners.len(), "gradients of another batch than was traced");
        let (layer, windows, by_output) = (*self, self.windows(), self.by_output());
        let (input_len, output_len) = (self.convolution.input_len(), POOLS * self.bias.len());
        let mut d_x = vec![0.0; x.len()];
        // A chunk's share is summed by one thread, the shares in order: the same bits for any number of threads.
        let shares: Vec<Share> = (
            x.par_chunks(CHUNK * input_len),
            d_x.par_chunks_mut(CHUNK * input_len),
            winners.par_chunks(CHUNK * output_len),
            d_y.par_chunks(CHUNK * output_len),
        )
            .into_par_iter()
            .map(|(x, d_x, winners, d_y)| {
                vectors::run(Backward { layer, windows: &windows, by_output: &by_output, x, d_x, winners, d_y })
            })
            .collect();
        let mut sum = Share::new(self);
        for share in &shares {
            add(&mut sum.by_output, &share.by_output);
            add(&mut sum.bias, &share.bias);
        }
        Gradients { x: d_x, weight: self.d_weight(&sum.by_output), bias: sum.bias }
    }

    /// Where the windows of the four cells of every pool start in the padded map.
    fn windows(&self) -> Vec<usize> {
        let of_pool = |pool: usize| {
            let (row, col) = (2 * (pool / POOLED_2), 2 * (pool % POOLED_2));
            POOL.map(|(down, right)| self.convolution.window(row + down, col + right))
        };
        (0..POOLS).flat_map(of_pool).collect()
    }

    /// The weights as `[output, window value]`.
    fn by_output(&self) -> Vec<f32> {
        let window_len = self.convolution.window_len();
        let order: Vec<usize> = (0..window_len).map(|at| self.convolution.weight_index(at)).collect();
        self.weight.chunks_exact(window_len).flat_map(|of_output| order.iter().map(|from| of_output[*from])).collect()
    }

    /// The inverse of [`Self::by_output`].
    fn d_weight(&self, by_output: &[f32]) -> Vec<f32> {
        let window_len = self.convolution.window_len();
        let mut d_weight = vec![0.0; by_output.len()];
        for (from, into) in by_output.chunks_exact(window_len).zip(d_weight.chunks_exact_mut(window_len)) {
            for (at, value) in from.iter().enumerate() {
                into[self.convolution.weight_index(at)] = *value;
            }
        }
        d_weight
    }

    /// `into` `[window value]` += Σ gradient · window.
    #[inline(always)]
    fn add_windows<S: Simd>(&self, simd: S, map: &[f32], list: &[(usize, f32)], into: &mut [f32]) {
        for_each_group(self.convolution.window_len() / S::F32_LANES, |first, group| {
            let (read, written) = (|v| self.vector_of_window::<S>(first + v), |v| first + v);
            match group {
                Group::Nine => accumulate::<S, 9>(simd, map, list, read, into, written),
                Group::Eight => accumulate::<S, 8>(simd, map, list, read, into, written),
                Group::One => accumulate::<S, 1>(simd, map, list, read, into, written),
            }
        });
    }

    /// The window that begins at `d_map` += Σ gradient · weights of the output.
    #[inline(always)]
    fn add_outputs<S: Simd>(&self, simd: S, by_output: &[f32], list: &[(usize, f32)], d_map: &mut [f32]) {
        if list.is_empty() {
            return;
        }
        for_each_group(self.convolution.window_len() / S::F32_LANES, |first, group| {
            let (read, written) = (|v| first + v, |v| self.vector_of_window::<S>(first + v));
            match group {
                Group::Nine => accumulate::<S, 9>(simd, by_output, list, read, d_map, written),
                Group::Eight => accumulate::<S, 8>(simd, by_output, list, read, d_map, written),
                Group::One => accumulate::<S, 1>(simd, by_output, list, read, d_map, written),
            }
        });
    }

    /// Where vector `at` of a window lies in the padded map, in vectors from the start of the window.
    #[inline(always)]
    fn vector_of_window<S: Simd>(&self, at: usize) -> usize {
        let (stride, span) = (self.convolution.window(1, 0) / S::F32_LANES, self.convolution.span() / S::F32_LANES);
        at / span * stride + at % span
    }
}

/// Forward pass of one chunk.
struct Forward<'a> {
    layer: SecondLayer<'a>,
    windows: &'a [usize],
    x: &'a [f32],
    y: &'a mut [f32],
    /// With a place for every sample, or one that all share.
    winners: &'a mut [u32],
}

impl WithSimd for Forward<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { layer: SecondLayer { convolution, weight, bias }, windows, x, y, winners } = self;
        let packed = convolution.packed::<S>(weight);
        // The border stays zero: it is never written.
        let mut map = vec![0.0; convolution.map_len()];
        let output_len = POOLS * bias.len();
        let places = winners.len() / output_len;
        for (sample, (x, y)) in x.chunks_exact(convolution.input_len()).zip(y.chunks_exact_mut(output_len)).enumerate()
        {
            convolution.pad(x, &mut map);
            let winners = &mut winners[sample % places * output_len..][..output_len];
            for (first, len) in blocks::<S>(bias.len()) {
                let block = Block { convolution, first, packed: &packed, bias };
                // As many sums as fit the registers: with AVX-512 those of two pools.
                match (len == 2 * S::F32_LANES, S::F32_LANES == LANES) {
                    (true, true) => block.forward::<S, 2, 8>(simd, &map, windows, y, winners),
                    (true, false) => block.forward::<S, 2, 4>(simd, &map, windows, y, winners),
                    (false, _) => block.forward::<S, 1, 8>(simd, &map, windows, y, winners),
                }
            }
        }
    }
}

/// Some vectors of outputs, from channel `first` on.
struct Block<'a> {
    convolution: Convolution,
    first: usize,
    packed: &'a [f32],
    bias: &'a [f32],
}

impl Block<'_> {
    /// `WIDTH` vectors of outputs, `CELLS` cells of the convolution at a time: one pool or two.
    #[inline(always)]
    fn forward<S: Simd, const WIDTH: usize, const CELLS: usize>(
        &self,
        simd: S,
        map: &[f32],
        windows: &[usize],
        y: &mut [f32],
        winners: &mut [u32],
    ) {
        let (channels, len) = (self.bias.len(), WIDTH * S::F32_LANES);
        let weights = self.convolution.weights_of_block(self.packed, self.first, len);
        let bias = vectors::vectors::<S>(&self.bias[self.first..][..len]);
        for (index, starts) in windows.as_chunks::<CELLS>().0.iter().enumerate() {
            let sums = self.convolution.sums::<S, WIDTH, CELLS>(simd, map, *starts, weights);
            let first_pool = index * CELLS / POOL.len();
            for (pool, sums) in (first_pool..).zip(sums.as_chunks::<4>().0) {
                let at = pool * channels + self.first;
                let y = vectors_mut::<S>(&mut y[at..at + len]);
                let winners = int_vectors_mut::<S>(&mut winners[at..at + len]);
                for v in 0..WIDTH {
                    let first = (sums[0][v], simd.splat_u32s(0));
                    let best =
                        (1..).zip(&sums[1..]).fold(first, |best, (cell, sums)| better(simd, best, sums[v], cell));
                    (y[v], winners[v]) = with_relu(simd, best, bias[v]);
                }
            }
        }
    }
}

/// One chunk's share of the gradients: of the weights `[output, window value]` and of the bias.
struct Share {
    by_output: Vec<f32>,
    bias: Vec<f32>,
}

impl Share {
    fn new(layer: &SecondLayer<'_>) -> Self {
        Self { by_output: vec![0.0; layer.weight.len()], bias: vec![0.0; layer.bias.len()] }
    }
}

/// Backward pass of one chunk.
struct Backward<'a> {
    layer: SecondLayer<'a>,
    windows: &'a [usize],
    by_output: &'a [f32],
    x: &'a [f32],
    d_x: &'a mut [f32],
    winners: &'a [u32],
    d_y: &'a [f32],
}

impl WithSimd for Backward<'_> {
    type Output = Share;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Share {
        let Self { layer, windows, by_output, x, d_x, winners, d_y } = self;
        let (convolution, channels) = (layer.convolution, layer.bias.len());
        let (input_len, output_len, window_len) = (convolution.input_len(), POOLS * channels, convolution.window_len());
        let windows = windows.as_chunks::<4>().0;
        let mut share = Share::new(&layer);
        // The border stays zero: it is never written.
        let mut map = vec![0.0; convolution.map_len()];
        let mut d_map = vec![0.0; convolution.map_len()];
        // One more than fits: what is not kept is written there.
        let mut of_channel = vec![(0, 0.0); POOLS + 1];
        let mut of_cell = vec![(0, 0.0); channels + 1];
        for (sample, x) in x.chunks_exact(input_len).enumerate() {
            let winners = &winners[sample * output_len..][..output_len];
            let d_y = &d_y[sample * output_len..][..output_len];
            convolution.pad(x, &mut map);
            // Gradients of the weights: per output channel, its windows.
            for channel in 0..channels {
                let mut list = List::new(&mut of_channel);
                let mut sum = 0.0;
                for (pool, windows) in windows.iter().enumerate() {
                    let at = pool * channels + channel;
                    let is_alive = winners[at] != SILENT;
                    // A silent pool has no window; whichever is listed is overwritten by the next.
                    list.push((windows[(winners[at] % SILENT) as usize], d_y[at]), is_alive);
                    sum += if is_alive { d_y[at] } else { 0.0 };
                }
                share.bias[channel] += sum;
                let into = &mut share.by_output[channel * window_len..][..window_len];
                layer.add_windows(simd, &map, list.pushed(), into);
            }
            // Gradient of the map: per cell of the convolution, its output channels.
            d_map.fill(0.0);
            for (pool, windows) in windows.iter().enumerate() {
                let of_pool = pool * channels..(pool + 1) * channels;
                for (cell, start) in windows.iter().enumerate() {
                    let mut list = List::new(&mut of_cell);
                    for (channel, (gradient, winner)) in
                        d_y[of_pool.clone()].iter().zip(&winners[of_pool.clone()]).enumerate()
                    {
                        list.push((channel * window_len, *gradient), *winner == cell as u32);
                    }
                    layer.add_outputs(simd, by_output, list.pushed(), &mut d_map[*start..]);
                }
            }
            convolution.unpad(&d_map, &mut d_x[sample * input_len..][..input_len]);
        }
        share
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
    let (values, into) = (vectors::vectors::<S>(values), vectors_mut::<S>(into));
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::network::operations::cpu::same_bits::{self, values};

    #[test]
    fn every_instruction_set_computes_the_same_bits() {
        for (inputs, channels, kernel) in [(16, 32, 3), (32, 48, 2)] {
            let conv = ConvLayer { channels, kernel };
            let (weight, bias) = (values(channels * inputs * kernel * kernel, 7919), values(channels, 31));
            let layer = SecondLayer::new(conv, &weight, &bias);
            let (windows, by_output) = (layer.windows(), layer.by_output());
            let len = 3 * POOLS * channels;
            let x: Vec<f32> = values(3 * layer.convolution.input_len(), 101).iter().map(|x| x.max(0.0)).collect();
            let d_y = values(len, 211);
            let (_, winners) = same_bits::on_each(|instructions| {
                let (mut y, mut winners) = (vec![0.0; len], vec![0; len]);
                instructions.run(Forward { layer, windows: &windows, x: &x, y: &mut y, winners: &mut winners });
                (y, winners)
            });
            same_bits::on_each(|instructions| {
                let mut d_x = vec![0.0; x.len()];
                let (windows, by_output) = (windows.as_slice(), by_output.as_slice());
                let kernel = Backward { layer, windows, by_output, x: &x, d_x: &mut d_x, winners: &winners, d_y: &d_y };
                let share = instructions.run(kernel);
                (d_x, share.by_output, share.bias)
            });
        }
    }
}
