//! Dropout drawn from a stream of the root seed: the same masks in every run, on any device. burn's own draws from a
//! generator of the process, which tests and other trainings in it would share.

use crate::network::architecture::NetworkArchitecture;
use burn::tensor::{Device, Tensor, TensorData};
use rand::Rng as _;
use sim::seed::{RootSeed, Stream};

/// Factors that dropout puts on two layers: 0 or 1/(1 − share). `None` if nothing is dropped.
#[derive(Debug, Clone)]
pub struct DropoutFactors {
    /// `[batch, features]`.
    pub features: Option<Tensor<2>>,
    /// `[batch, hidden]`.
    pub hidden: Option<Tensor<2>>,
}

impl DropoutFactors {
    /// Draws for `rows` samples. `index` names the step; the same index draws the same.
    pub fn draw(architecture: &NetworkArchitecture, rows: usize, seed: RootSeed, index: u64, device: &Device) -> Self {
        let mut rng = seed.rng(Stream::Dropout, index);
        let mut layer = |share: f32, width: usize| {
            let factors = draw_layer(share, rows * width, &mut rng)?;
            Some(Tensor::from_data(TensorData::new(factors, [rows, width]), device))
        };
        Self {
            features: layer(architecture.dropout_features, architecture.features()),
            hidden: layer(architecture.dropout_hidden, architecture.hidden),
        }
    }
}

/// A value survives if its byte is at least `dropped` of 256. What survives is scaled up: the expectation stays.
fn draw_layer(share: f32, len: usize, rng: &mut sim::seed::Rng) -> Option<Vec<f32>> {
    let dropped = (256.0 * share).round().min(255.0) as u8;
    if dropped == 0 {
        return None;
    }
    let mut bytes = vec![0; len];
    rng.fill_bytes(&mut bytes);
    let scale = 256.0 / (256.0 - f32::from(dropped));
    Some(bytes.into_iter().map(|byte| if byte >= dropped { scale } else { 0.0 }).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_draw_keeps_the_mean_and_repeats() {
        let architecture = NetworkArchitecture::paper();
        let draw = |index| {
            let factors = DropoutFactors::draw(&architecture, 64, RootSeed(3), index, &Device::flex());
            factors.features.unwrap().into_data().try_into_vec::<f32>().unwrap()
        };
        let values = draw(0);
        let mean = values.iter().sum::<f32>() / values.len() as f32;
        assert!((mean - 1.0).abs() < 0.01, "mean {mean}");
        let dropped = values.iter().filter(|value| **value == 0.0).count() as f32 / values.len() as f32;
        assert!((dropped - 0.25).abs() < 0.01, "dropped {dropped}");
        assert_eq!(values, draw(0));
        assert_ne!(values, draw(1));
    }

    #[test]
    fn no_dropout_draws_nothing() {
        let architecture =
            NetworkArchitecture { dropout_features: 0.0, dropout_hidden: 0.0, ..NetworkArchitecture::compact() };
        let factors = DropoutFactors::draw(&architecture, 1, RootSeed(3), 0, &Device::flex());
        assert!(factors.features.is_none() && factors.hidden.is_none());
    }
}
