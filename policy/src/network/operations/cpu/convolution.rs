//! What the convolutions over channels share: the windows of a padded map. A window is read where it lies: a row of it is one
//! contiguous run of the padded map.

use super::vectors;
use crate::network::architecture::ConvLayer;
use pulp::Simd;

/// A convolution with "same" padding.
#[derive(Debug, Clone, Copy)]
pub(super) struct Convolution {
    /// Channels of the input.
    pub(super) inputs: usize,
    pub(super) conv: ConvLayer,
    /// Cells per side of the map.
    pub(super) cells: usize,
}

/// The gradients of a layer: of its input `[batch, cells, channel]`, its weights and its bias, in burn's shapes.
#[derive(Debug, Clone)]
pub(crate) struct Gradients {
    pub(crate) x: Vec<f32>,
    pub(crate) weight: Vec<f32>,
    pub(crate) bias: Vec<f32>,
}

impl Convolution {
    /// Cells per side of the padded map.
    fn side(self) -> usize {
        self.cells + self.conv.kernel - 1
    }

    /// Values of the map.
    pub(super) fn input_len(self) -> usize {
        self.cells * self.cells * self.inputs
    }

    /// Values of the padded map.
    pub(super) fn map_len(self) -> usize {
        self.side() * self.side() * self.inputs
    }

    /// Values of one row of a window: they lie side by side in the padded map.
    pub(super) fn span(self) -> usize {
        self.conv.kernel * self.inputs
    }

    /// Values of a window.
    pub(super) fn window_len(self) -> usize {
        self.conv.kernel * self.span()
    }

    /// Where the window of a cell starts in the padded map.
    pub(super) fn window(self, row: usize, col: usize) -> usize {
        (row * self.side() + col) * self.inputs
    }

    /// Where a row of the map starts in the padded one.
    fn row_start(self, row: usize) -> usize {
        let (before, _) = self.conv.padding();
        self.window(row + before, before)
    }

    /// Puts a map into a padded one, whose border stays as it is.
    #[inline(always)]
    pub(super) fn pad(self, x: &[f32], map: &mut [f32]) {
        let len = self.cells * self.inputs;
        for (row, x) in x.chunks_exact(len).enumerate() {
            map[self.row_start(row)..][..len].copy_from_slice(x);
        }
    }

    /// Takes a map out of a padded one.
    #[inline(always)]
    pub(super) fn unpad(self, map: &[f32], x: &mut [f32]) {
        let len = self.cells * self.inputs;
        for (row, x) in x.chunks_exact_mut(len).enumerate() {
            x.copy_from_slice(&map[self.row_start(row)..][..len]);
        }
    }

    /// Weights `[output, input, row, column]` as `[window value, output]`, cut into the blocks of [`blocks`]: block by block,
    /// so that a block is read in one run.
    #[inline(always)]
    pub(super) fn packed<S: Simd>(self, weight: &[f32]) -> Vec<f32> {
        let mut packed = Vec::with_capacity(weight.len());
        for (first, len) in blocks::<S>(self.conv.channels) {
            for at in 0..self.window_len() {
                let from = self.weight_index(at);
                packed.extend((first..first + len).map(|output| weight[output * self.window_len() + from]));
            }
        }
        packed
    }

    /// The weights of a block from channel `first` on.
    #[inline(always)]
    pub(super) fn weights_of_block(self, packed: &[f32], first: usize, len: usize) -> &[f32] {
        &packed[first * self.window_len()..][..len * self.window_len()]
    }

    /// Which weight of an output `[input, row, column]` meets value `at` of a window `[row, column, input]`.
    pub(super) fn weight_index(self, at: usize) -> usize {
        let (cell, input) = (at / self.inputs, at % self.inputs);
        input * self.conv.kernel * self.conv.kernel + cell
    }

    /// `WIDTH` vectors of outputs of the windows that start there, without the bias. Computed together, so that each weight
    /// is loaded once. `weights`: those of the block.
    #[inline(always)]
    pub(super) fn sums<S: Simd, const WIDTH: usize, const CELLS: usize>(
        self,
        simd: S,
        map: &[f32],
        starts: [usize; CELLS],
        weights: &[f32],
    ) -> [[S::f32s; WIDTH]; CELLS] {
        let span = self.span();
        let mut sums = [[simd.splat_f32s(0.0); WIDTH]; CELLS];
        for kernel_row in 0..self.conv.kernel {
            let offset = self.window(kernel_row, 0);
            let values = starts.map(|start| &map[start + offset..][..span]);
            let weights = vectors::vectors::<S>(&weights[kernel_row * span * WIDTH * S::F32_LANES..]);
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
        sums
    }
}

/// Blocks of outputs: (first, number), two vectors each, then one if the number of vectors is odd.
pub(super) fn blocks<S: Simd>(channels: usize) -> impl Iterator<Item = (usize, usize)> {
    let block = 2 * S::F32_LANES;
    (0..channels).step_by(block).map(move |first| (first, block.min(channels - first)))
}
