//! Dropout drawn from our own stream: the same masks for any number of threads, on any device.

use crate::network::architecture::NetworkArchitecture;
use burn::tensor::{Device, Tensor, TensorData};
use rand::Rng as _;
use sim::seed::{RootSeed, Stream};

/// Factors that dropout puts on two layers: 0 or 1/(1 − share).
#[derive(Debug, Clone)]
pub struct DropoutFactors {
    /// `[batch, features]`.
    pub features: Tensor<2>,
    /// `[batch, hidden]`.
    pub hidden: Tensor<2>,
}

/// One draw of dropout for a batch: which values of two layers survive.
#[derive(Debug, Clone)]
pub struct DropoutDraw {
    features: Layer,
    hidden: Layer,
}

impl DropoutDraw {
    /// Draws for `rows` samples. `index` names the step (and the shard within it); the same index draws the same.
    pub fn new(architecture: &NetworkArchitecture, rows: usize, seed: RootSeed, index: u64) -> Self {
        let mut rng = seed.rng(Stream::Dropout, index);
        let mut layer = |share: f32, width: usize| Layer::draw(share, rows * width, &mut rng);
        Self {
            features: layer(architecture.dropout_features, architecture.features()),
            hidden: layer(architecture.dropout_hidden, architecture.hidden),
        }
    }

    pub(crate) fn apply_to_features(&self, values: &mut [f32]) {
        self.features.apply(values);
    }

    pub(crate) fn apply_to_hidden(&self, values: &mut [f32]) {
        self.hidden.apply(values);
    }

    pub(crate) fn features_scale(&self) -> f32 {
        self.features.scale()
    }

    pub(crate) fn hidden_scale(&self) -> f32 {
        self.hidden.scale()
    }

    /// The same draw as tensors, for [`LookAheadNet::forward`](crate::network::LookAheadNet::forward).
    pub(crate) fn to_factors(
        &self,
        architecture: &NetworkArchitecture,
        rows: usize,
        device: &Device,
    ) -> DropoutFactors {
        let tensor = |layer: &Layer, width: usize| {
            let mut factors = vec![1.0; rows * width];
            layer.apply(&mut factors);
            Tensor::from_data(TensorData::new(factors, [rows, width]), device)
        };
        DropoutFactors {
            features: tensor(&self.features, architecture.features()),
            hidden: tensor(&self.hidden, architecture.hidden),
        }
    }
}

/// Dropout of one layer. A value survives if its byte is at least `dropped` of 256.
#[derive(Debug, Clone)]
struct Layer {
    dropped: u8,
    /// One per value; empty if nothing is dropped.
    bytes: Vec<u8>,
}

impl Layer {
    fn draw(share: f32, len: usize, rng: &mut sim::seed::Rng) -> Self {
        let dropped = (256.0 * share).round().min(255.0) as u8;
        let mut bytes = vec![0; if dropped == 0 { 0 } else { len }];
        rng.fill_bytes(&mut bytes);
        Self { dropped, bytes }
    }

    fn apply(&self, values: &mut [f32]) {
        let scale = self.scale();
        for (value, &byte) in values.iter_mut().zip(&self.bytes) {
            *value = if byte >= self.dropped { *value * scale } else { 0.0 };
        }
    }

    /// What survives is scaled up, so that the expectation stays.
    fn scale(&self) -> f32 {
        256.0 / (256.0 - f32::from(self.dropped))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_draw_keeps_the_mean_and_repeats() {
        let architecture = NetworkArchitecture::paper();
        let draw = |index| DropoutDraw::new(&architecture, 64, RootSeed(3), index);
        let mut values = vec![1.0; 64 * architecture.features()];
        draw(0).apply_to_features(&mut values);
        let mean = values.iter().sum::<f32>() / values.len() as f32;
        assert!((mean - 1.0).abs() < 0.01, "mean {mean}");
        let dropped = values.iter().filter(|value| **value == 0.0).count() as f32 / values.len() as f32;
        assert!((dropped - 0.25).abs() < 0.01, "dropped {dropped}");
        let mut again = vec![1.0; values.len()];
        draw(0).apply_to_features(&mut again);
        assert_eq!(values, again);
        draw(1).apply_to_features(&mut again);
        assert_ne!(values, again);
    }

    #[test]
    fn no_dropout_changes_nothing() {
        let architecture =
            NetworkArchitecture { dropout_features: 0.0, dropout_hidden: 0.0, ..NetworkArchitecture::compact() };
        let mut values = vec![3.0; architecture.features()];
        DropoutDraw::new(&architecture, 1, RootSeed(3), 0).apply_to_features(&mut values);
        assert!(values.iter().all(|value| *value == 3.0));
    }
}
