//! A residual layer (He 2016): a 3×3 convolution with "same" padding whose answer is added to its input, then `ReLU`. A map
//! keeps its size and its channels.
//!
//! Few answers are cut off, so both passes are dense. The gradient of the input is a convolution, too.

use super::convolution::{Convolution, Gradients, blocks};
use super::vectors::{self, int_vectors_mut, vectors_mut};
use super::{Answers, CHUNK, SILENT, add, by_chunks};
use crate::network::architecture::{ConvLayer, POOLED_1, POOLED_2, RESIDUAL_KERNEL};
use pulp::{Simd, WithSimd};
use rayon::prelude::*;

/// The layer with its weights, in burn's shapes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ResidualLayer<'a> {
    convolution: Convolution,
    /// `[channel, channel, 3, 3]`.
    weight: &'a [f32],
    /// `[channel]`.
    bias: &'a [f32],
}

impl<'a> ResidualLayer<'a> {
    /// `cells`: per side of the map.
    pub(crate) fn new(cells: usize, weight: &'a [f32], bias: &'a [f32]) -> Self {
        let conv = ConvLayer { channels: bias.len(), kernel: RESIDUAL_KERNEL };
        assert_eq!(
            weight.len(),
            bias.len() * bias.len() * RESIDUAL_KERNEL * RESIDUAL_KERNEL,
            "weights of a residual layer"
        );
        Self { convolution: Convolution { inputs: bias.len(), conv, cells }, weight, bias }
    }

    /// Cells per side of maps of so many values.
    pub(crate) fn cells(values: usize, channels: usize) -> usize {
        [POOLED_1, POOLED_2].into_iter().find(|cells| cells * cells * channels == values).expect("a pooled map")
    }

    /// `[batch, cells, channel]` of `x` of the same shape, and which answers the `ReLU` cut off.
    pub(crate) fn forward(&self, x: &[f32], is_traced: bool) -> Answers {
        let (layer, windows) = (*self, self.windows());
        let len = self.convolution.input_len();
        by_chunks(x, len, len, is_traced, |x, y, cut_off| {
            vectors::run(Forward { layer, windows: &windows, x, y, cut_off });
        })
    }

    /// The gradients, given that of the answers and which of them were cut off.
    pub(crate) fn backward(&self, x: &[f32], cut_off: &[u32], d_y: &[f32]) -> Gradients {
        assert_eq!(d_y.len(), cut_off.len(), "gradients of another batch than was traced");
        let (layer, windows, transposed) = (*self, self.windows(), self.transposed());
        let mut d_x = vec![0.0; x.len()];
        let chunk = CHUNK * self.convolution.input_len();
        // A chunk's share is summed by one thread, the shares in order: the same bits for any number of threads.
        let shares: Vec<Share> =
            (x.par_chunks(chunk), d_x.par_chunks_mut(chunk), cut_off.par_chunks(chunk), d_y.par_chunks(chunk))
                .into_par_iter()
                .map(|(x, d_x, cut_off, d_y)| {
                    let (windows, transposed) = (windows.as_slice(), transposed.as_slice());
                    vectors::run(Backward { layer, windows, transposed, x, d_x, cut_off, d_y })
                })
                .collect();
        let mut sum = Share::new(self);
        for share in &shares {
            add(&mut sum.by_window, &share.by_window);
            add(&mut sum.bias, &share.bias);
        }
        Gradients { x: d_x, weight: self.d_weight(&sum.by_window), bias: sum.bias }
    }

    /// Where the window of every cell starts in the padded map.
    fn windows(&self) -> Vec<usize> {
        let cells = self.convolution.cells;
        (0..cells * cells).map(|cell| self.convolution.window(cell / cells, cell % cells)).collect()
    }

    /// The weights of the convolution that the gradient of the input is: inputs and outputs change places, and each kernel is
    /// turned round.
    fn transposed(&self) -> Vec<f32> {
        const KERNEL: usize = RESIDUAL_KERNEL * RESIDUAL_KERNEL;
        let channels = self.bias.len();
        let of = |at: usize| {
            let (from, to, cell) = (at / KERNEL / channels, at / KERNEL % channels, at % KERNEL);
            self.weight[(to * channels + from) * KERNEL + KERNEL - 1 - cell]
        };
        (0..self.weight.len()).map(of).collect()
    }

    /// The gradient of the weights from `[window value, output]`.
    fn d_weight(&self, by_window: &[f32]) -> Vec<f32> {
        let window_len = self.convolution.window_len();
        let mut d_weight = vec![0.0; by_window.len()];
        for (at, of_outputs) in by_window.chunks_exact(self.bias.len()).enumerate() {
            for (output, value) in of_outputs.iter().enumerate() {
                d_weight[output * window_len + self.convolution.weight_index(at)] = *value;
            }
        }
        d_weight
    }

    /// What the convolution alone answers, `[cells, channel]`.
    #[inline(always)]
    fn convolve<S: Simd>(&self, simd: S, windows: &[usize], packed: &[f32], map: &[f32], into: &mut [f32]) {
        for (first, len) in blocks::<S>(self.bias.len()) {
            let weights = self.convolution.weights_of_block(packed, first, len);
            // Twelve sums: enough for the processor to have something to do, and they fit the registers.
            if len == 2 * S::F32_LANES {
                self.convolve_block::<S, 2, 6>(simd, first, windows, weights, map, into);
            } else {
                self.convolve_block::<S, 1, 12>(simd, first, windows, weights, map, into);
            }
        }
    }

    /// `WIDTH` vectors of outputs from channel `first` on, `CELLS` cells of the map at a time.
    #[inline(always)]
    fn convolve_block<S: Simd, const WIDTH: usize, const CELLS: usize>(
        &self,
        simd: S,
        first: usize,
        windows: &[usize],
        weights: &[f32],
        map: &[f32],
        into: &mut [f32],
    ) {
        for (index, starts) in windows.as_chunks::<CELLS>().0.iter().enumerate() {
            let sums = self.convolution.sums::<S, WIDTH, CELLS>(simd, map, *starts, weights);
            for (cell, sums) in (index * CELLS..).zip(sums) {
                let at = cell * self.bias.len() + first;
                vectors_mut::<S>(&mut into[at..at + WIDTH * S::F32_LANES]).copy_from_slice(&sums);
            }
        }
    }

    /// `into` `[window value, output]` += Σ window · gradient over all cells.
    #[inline(always)]
    fn add_products<S: Simd>(&self, simd: S, map: &[f32], d_sums: &[f32], into: &mut [f32]) {
        for (first, len) in blocks::<S>(self.bias.len()) {
            if len == 2 * S::F32_LANES {
                self.add_products_of::<S, 2, 6>(simd, first, map, d_sums, into);
            } else {
                self.add_products_of::<S, 1, 12>(simd, first, map, d_sums, into);
            }
        }
    }

    /// Of `WIDTH` vectors of outputs from channel `first` on, `VALUES` values of the window at a time.
    #[inline(always)]
    fn add_products_of<S: Simd, const WIDTH: usize, const VALUES: usize>(
        &self,
        simd: S,
        first: usize,
        map: &[f32],
        d_sums: &[f32],
        into: &mut [f32],
    ) {
        let (channels, span) = (self.bias.len(), self.convolution.span());
        let (width, first) = (channels / S::F32_LANES, first / S::F32_LANES);
        let (d_sums, into) = (vectors::vectors::<S>(d_sums), vectors_mut::<S>(into));
        for kernel_row in 0..RESIDUAL_KERNEL {
            for value in (0..span).step_by(VALUES) {
                let mut sums = [[simd.splat_f32s(0.0); WIDTH]; VALUES];
                for (row, d_sums) in d_sums.chunks_exact(self.convolution.cells * width).enumerate() {
                    let values = map[self.convolution.window(row + kernel_row, 0) + value..].chunks(channels);
                    for (values, d_sums) in values.zip(d_sums.chunks_exact(width)) {
                        let (values, d_sums) = (&values[..VALUES], &d_sums[first..][..WIDTH]);
                        for i in 0..VALUES {
                            let value = simd.splat_f32s(values[i]);
                            for v in 0..WIDTH {
                                sums[i][v] = simd.mul_add_f32s(value, d_sums[v], sums[i][v]);
                            }
                        }
                    }
                }
                for i in 0..VALUES {
                    let into = &mut into[(kernel_row * span + value + i) * width + first..][..WIDTH];
                    for v in 0..WIDTH {
                        into[v] = simd.add_f32s(into[v], sums[i][v]);
                    }
                }
            }
        }
    }
}

/// Forward pass of one chunk.
struct Forward<'a> {
    layer: ResidualLayer<'a>,
    windows: &'a [usize],
    x: &'a [f32],
    y: &'a mut [f32],
    /// 0, or [`SILENT`] where the answer is cut off. With a place for every sample, or one that all share.
    cut_off: &'a mut [u32],
}

impl WithSimd for Forward<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { layer, windows, x, y, cut_off } = self;
        let convolution = layer.convolution;
        let packed = convolution.packed::<S>(layer.weight);
        // The border stays zero: it is never written.
        let mut map = vec![0.0; convolution.map_len()];
        let len = convolution.input_len();
        let places = cut_off.len() / len;
        let bias = vectors::vectors::<S>(layer.bias);
        let zero = simd.splat_f32s(0.0);
        for (sample, (x, y)) in x.chunks_exact(len).zip(y.chunks_exact_mut(len)).enumerate() {
            convolution.pad(x, &mut map);
            layer.convolve(simd, windows, &packed, &map, y);
            let cut_off = int_vectors_mut::<S>(&mut cut_off[sample % places * len..][..len]);
            let (x, y) = (vectors::vectors::<S>(x), vectors_mut::<S>(y));
            for (((y, x), cut_off), bias) in y.iter_mut().zip(x).zip(cut_off).zip(bias.iter().cycle()) {
                let value = simd.add_f32s(*x, simd.add_f32s(*y, *bias));
                let is_alive = simd.greater_than_f32s(value, zero);
                *y = simd.select_f32s(is_alive, value, zero);
                *cut_off = simd.select_u32s(is_alive, simd.splat_u32s(0), simd.splat_u32s(SILENT));
            }
        }
    }
}

/// One chunk's share of the gradients: of the weights `[window value, output]` and of the bias.
struct Share {
    by_window: Vec<f32>,
    bias: Vec<f32>,
}

impl Share {
    fn new(layer: &ResidualLayer<'_>) -> Self {
        Self { by_window: vec![0.0; layer.weight.len()], bias: vec![0.0; layer.bias.len()] }
    }
}

/// Backward pass of one chunk.
struct Backward<'a> {
    layer: ResidualLayer<'a>,
    windows: &'a [usize],
    transposed: &'a [f32],
    x: &'a [f32],
    d_x: &'a mut [f32],
    cut_off: &'a [u32],
    d_y: &'a [f32],
}

impl WithSimd for Backward<'_> {
    type Output = Share;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Share {
        let Self { layer, windows, transposed, x, d_x, cut_off, d_y } = self;
        let convolution = layer.convolution;
        let transposed = convolution.packed::<S>(transposed);
        let mut share = Share::new(&layer);
        // The borders stay zero: they are never written.
        let mut map = vec![0.0; convolution.map_len()];
        let mut d_map = vec![0.0; convolution.map_len()];
        // Of what the convolution and its input add up to, before the `ReLU`.
        let len = convolution.input_len();
        let mut d_sums = vec![0.0; len];
        for sample in 0..x.len() / len {
            let of_sample = sample * len..(sample + 1) * len;
            for ((d_sum, d_y), cut_off) in
                d_sums.iter_mut().zip(&d_y[of_sample.clone()]).zip(&cut_off[of_sample.clone()])
            {
                *d_sum = if *cut_off == SILENT { 0.0 } else { *d_y };
            }
            for d_sums in d_sums.chunks_exact(share.bias.len()) {
                add(&mut share.bias, d_sums);
            }
            convolution.pad(&x[of_sample.clone()], &mut map);
            layer.add_products(simd, &map, &d_sums, &mut share.by_window);
            convolution.pad(&d_sums, &mut d_map);
            let d_x = &mut d_x[of_sample];
            layer.convolve(simd, windows, &transposed, &d_map, d_x);
            add(d_x, &d_sums);
        }
        share
    }
}

const _: () = assert!(
    (POOLED_1 * POOLED_1).is_multiple_of(12) && (POOLED_2 * POOLED_2).is_multiple_of(12),
    "no cell is left over"
);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::network::operations::cpu::same_bits::{self, values};

    #[test]
    fn every_instruction_set_computes_the_same_bits() {
        for (cells, channels) in [(12, 16), (6, 48)] {
            let (weight, bias) = (values(channels * channels * 9, 7919), values(channels, 31));
            let layer = ResidualLayer::new(cells, &weight, &bias);
            let (windows, transposed) = (layer.windows(), layer.transposed());
            let len = 3 * cells * cells * channels;
            let (x, d_y) = (values(len, 101), values(len, 211));
            let (_, cut_off) = same_bits::on_each(|instructions| {
                let (mut y, mut cut_off) = (vec![0.0; len], vec![0; len]);
                instructions.run(Forward { layer, windows: &windows, x: &x, y: &mut y, cut_off: &mut cut_off });
                (y, cut_off)
            });
            same_bits::on_each(|instructions| {
                let mut d_x = vec![0.0; len];
                let (windows, transposed) = (windows.as_slice(), transposed.as_slice());
                let kernel =
                    Backward { layer, windows, transposed, x: &x, d_x: &mut d_x, cut_off: &cut_off, d_y: &d_y };
                let share = instructions.run(kernel);
                (d_x, share.by_window, share.bias)
            });
        }
    }
}
