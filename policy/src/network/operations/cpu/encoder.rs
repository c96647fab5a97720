//! Both layers on a batch: forward, and backward with what forward leaves.

use super::first_layer::{FirstLayer, PaddedMap, PaddedRows, padded_rows};
use super::second_layer::{SecondLayer, Sparse};
use super::{CHUNK, for_each_chunk, vectors};
use crate::network::architecture::{ConvLayer, POOLED_1, POOLED_2};
use pulp::{Simd, WithSimd};
use rayon::prelude::*;
use sim::sensing::GRID_CELLS;

/// Cells of one grid.
const CELLS: usize = GRID_CELLS * GRID_CELLS;

/// The weights of both layers, in burn's shapes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct EncoderWeights<'a> {
    pub(crate) conv1: ConvLayer,
    pub(crate) conv2: ConvLayer,
    /// `[conv1, 1, kernel, kernel]`.
    pub(crate) weight_1: &'a [f32],
    /// `[conv1]`.
    pub(crate) bias_1: &'a [f32],
    /// `[conv2, conv1, kernel, kernel]`.
    pub(crate) weight_2: &'a [f32],
    /// `[conv2]`.
    pub(crate) bias_2: &'a [f32],
}

/// The gradients of the weights, in the same shapes.
#[derive(Debug, Clone)]
pub(crate) struct EncoderGradients {
    pub(crate) weight_1: Vec<f32>,
    pub(crate) bias_1: Vec<f32>,
    pub(crate) weight_2: Vec<f32>,
    pub(crate) bias_2: Vec<f32>,
}

/// What the forward pass leaves for the backward pass, by chunk: each is allocated and cleared by the thread that fills
/// it.
#[derive(Debug, Clone)]
pub(crate) struct EncoderTrace {
    chunks: Vec<ChunkTrace>,
}

/// The trace of one chunk, by sample.
#[derive(Debug, Clone)]
struct ChunkTrace {
    rows: Vec<PaddedRows>,
    /// `[batch, padded row, padded column, conv1]`.
    pooled: Vec<f32>,
    /// `[batch, 12 · 12, conv1]`.
    winners_1: Vec<u32>,
    /// `[batch, 6 · 6, conv2]`.
    winners_2: Vec<u32>,
}

impl EncoderWeights<'_> {
    fn map(&self) -> PaddedMap {
        PaddedMap { side: POOLED_1 + self.conv2.kernel - 1, before: self.conv2.padding().0 }
    }

    fn second_layer(&self) -> SecondLayer {
        SecondLayer { inputs: self.conv1.channels, conv: self.conv2, map: self.map() }
    }

    fn winners_1_len(&self) -> usize {
        POOLED_1 * POOLED_1 * self.conv1.channels
    }

    /// Features of one sample.
    pub(crate) fn features_len(&self) -> usize {
        POOLED_2 * POOLED_2 * self.conv2.channels
    }

    /// Features `[batch, 6 · 6 · conv2]` of grids `occupied` `[batch, 25, 25]` (0 = free), row by row, channels last.
    pub(crate) fn forward(&self, occupied: &[u8]) -> Vec<f32> {
        let first = FirstLayer::new(self.conv1, self.weight_1, self.bias_1);
        let mut features = vec![0.0; occupied.len() / CELLS * self.features_len()];
        let chunks = occupied.chunks(CHUNK * CELLS).zip(features.chunks_mut(CHUNK * self.features_len()));
        for_each_chunk(chunks, |(occupied, features)| {
            // Nobody reads it: one place serves every sample.
            let trace = &mut ChunkTrace::new(self, 1);
            vectors::run(Forward { weights: self, first: &first, occupied, features, trace });
        });
        features
    }

    /// The same, with what [`Self::backward`] needs.
    pub(crate) fn forward_traced(&self, occupied: &[u8]) -> (Vec<f32>, EncoderTrace) {
        let first = FirstLayer::new(self.conv1, self.weight_1, self.bias_1);
        let mut features = vec![0.0; occupied.len() / CELLS * self.features_len()];
        let chunks = occupied.par_chunks(CHUNK * CELLS).zip(features.par_chunks_mut(CHUNK * self.features_len()));
        let traced = |(occupied, features): (&[u8], &mut [f32])| {
            let mut trace = ChunkTrace::new(self, occupied.len() / CELLS);
            vectors::run(Forward { weights: self, first: &first, occupied, features, trace: &mut trace });
            trace
        };
        let trace = EncoderTrace { chunks: chunks.map(traced).collect() };
        (features, trace)
    }

    /// Gradients of the weights, given that of the features.
    pub(crate) fn backward(&self, trace: &EncoderTrace, d_features: &[f32]) -> EncoderGradients {
        let first = FirstLayer::new(self.conv1, self.weight_1, self.bias_1);
        let by_output = self.second_layer().by_output(self.weight_2);
        let samples: usize = trace.chunks.iter().map(|chunk| chunk.rows.len()).sum();
        assert_eq!(d_features.len(), samples * self.features_len(), "gradients of another batch than was traced");
        // A chunk's share is summed by one thread, the shares in order: the same bits for any number of threads.
        let d_features = d_features.par_chunks(CHUNK * self.features_len());
        let share = |(trace, d_features)| {
            vectors::run(Backward { weights: self, first: &first, by_output: &by_output, trace, d_features })
        };
        let shares: Vec<Share> = trace.chunks.par_iter().zip(d_features).map(share).collect();
        let mut sum = Share::new(self);
        for share in &shares {
            for (sum, share) in [
                (&mut sum.table, &share.table),
                (&mut sum.bias_1, &share.bias_1),
                (&mut sum.by_output, &share.by_output),
                (&mut sum.bias_2, &share.bias_2),
            ] {
                for (sum, value) in sum.iter_mut().zip(share) {
                    *sum += value;
                }
            }
        }
        let mut gradients = EncoderGradients {
            weight_1: vec![0.0; self.weight_1.len()],
            bias_1: sum.bias_1,
            weight_2: vec![0.0; self.weight_2.len()],
            bias_2: sum.bias_2,
        };
        FirstLayer::d_weight(self.conv1, &sum.table, &mut gradients.weight_1);
        self.second_layer().d_weight(&sum.by_output, &mut gradients.weight_2);
        gradients
    }
}

impl ChunkTrace {
    /// With places for so many samples.
    fn new(weights: &EncoderWeights<'_>, samples: usize) -> Self {
        Self {
            rows: vec![PaddedRows::default(); samples],
            // The border stays zero: it is never written.
            pooled: vec![0.0; samples * weights.second_layer().map_len()],
            winners_1: vec![0; samples * weights.winners_1_len()],
            winners_2: vec![0; samples * weights.features_len()],
        }
    }
}

/// Forward pass of one chunk.
struct Forward<'a> {
    weights: &'a EncoderWeights<'a>,
    first: &'a FirstLayer<'a>,
    occupied: &'a [u8],
    features: &'a mut [f32],
    /// With a place for every sample, or one that all share.
    trace: &'a mut ChunkTrace,
}

impl WithSimd for Forward<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { weights, first, occupied, features, trace } = self;
        let second = weights.second_layer();
        let by_window = second.by_window::<S>(weights.weight_2);
        let (map_len, winners_1_len, features_len) =
            (second.map_len(), weights.winners_1_len(), weights.features_len());
        for (sample, (occupied, features)) in
            occupied.chunks_exact(CELLS).zip(features.chunks_exact_mut(features_len)).enumerate()
        {
            let place = if trace.rows.len() == 1 { 0 } else { sample };
            let rows = &mut trace.rows[place];
            let pooled = &mut trace.pooled[place * map_len..][..map_len];
            let winners_1 = &mut trace.winners_1[place * winners_1_len..][..winners_1_len];
            let winners_2 = &mut trace.winners_2[place * features_len..][..features_len];
            *rows = padded_rows(occupied, weights.conv1);
            first.forward(simd, rows, second.map, pooled, winners_1);
            second.forward(simd, pooled, &by_window, weights.bias_2, features, winners_2);
        }
    }
}

/// One chunk's share of the gradients: of the table and the bias of the first layer, of the weights and the bias of the
/// second.
struct Share {
    table: Vec<f32>,
    bias_1: Vec<f32>,
    by_output: Vec<f32>,
    bias_2: Vec<f32>,
}

impl Share {
    fn new(weights: &EncoderWeights<'_>) -> Self {
        Self {
            table: vec![0.0; FirstLayer::table_len(weights.conv1)],
            bias_1: vec![0.0; weights.bias_1.len()],
            by_output: vec![0.0; weights.weight_2.len()],
            bias_2: vec![0.0; weights.bias_2.len()],
        }
    }
}

/// Backward pass of one chunk.
struct Backward<'a> {
    weights: &'a EncoderWeights<'a>,
    first: &'a FirstLayer<'a>,
    by_output: &'a [f32],
    trace: &'a ChunkTrace,
    d_features: &'a [f32],
}

impl WithSimd for Backward<'_> {
    type Output = Share;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Share {
        let Self { weights, first, by_output, trace, d_features } = self;
        let second = weights.second_layer();
        let (map_len, winners_1_len, features_len) =
            (second.map_len(), weights.winners_1_len(), weights.features_len());
        let mut share = Share::new(weights);
        let mut d_pooled = vec![0.0; map_len];
        let mut sparse = Sparse::new(second);
        for (sample, d_features) in d_features.chunks_exact(features_len).enumerate() {
            second.backward(
                simd,
                &trace.pooled[sample * map_len..][..map_len],
                by_output,
                d_features,
                &trace.winners_2[sample * features_len..][..features_len],
                &mut sparse,
                &mut d_pooled,
                &mut share.by_output,
                &mut share.bias_2,
            );
            first.backward(
                simd,
                &trace.rows[sample],
                second.map,
                &d_pooled,
                &trace.winners_1[sample * winners_1_len..][..winners_1_len],
                &mut share.table,
                &mut share.bias_1,
            );
        }
        share
    }
}
