//! The fast arrangement against burn's own layers, and its determinism.

use super::*;
use crate::loss::{self, LossSettings};
use crate::network::architecture::ConvLayer;
use crate::network::look_ahead_net::{LookAheadNet, grid_tensor};
use crate::test_data::lots;
use burn::tensor::{Device, Tensor, TensorData};
use rand::RngExt as _;
use sim::seed::{RootSeed, Stream};
use sim::sensing::OccupancyGrid;

fn shapes() -> [NetworkArchitecture; 3] {
    let odd = NetworkArchitecture {
        conv1: ConvLayer { channels: 16, kernel: 4 },
        conv2: ConvLayer { channels: 48, kernel: 5 },
        hidden: 70,
        ..NetworkArchitecture::paper()
    };
    [NetworkArchitecture::paper(), NetworkArchitecture::compact(), odd]
}

/// Biases start at 0; here they must matter.
fn weights_with_biases(architecture: NetworkArchitecture) -> Weights {
    let mut weights = Weights::init(architecture, RootSeed(5), 0);
    let mut rng = RootSeed(5).rng(Stream::Weights, 1);
    let parts = weights.parts_mut();
    for bias in [parts.conv1_bias, parts.conv2_bias, parts.fc1_bias] {
        bias.fill_with(|| rng.random_range(-0.1..0.1));
    }
    parts.fc2_weight.fill_with(|| rng.random_range(-0.1..0.1));
    weights
}

#[test]
fn values_and_gradients_equal_those_of_burn() {
    let batch = 7; // a full tile and a part of one
    let grids = lots(batch);
    let labels: Vec<[f32; 2]> = (0..batch).map(|i| [0.1 * i as f32, 0.9 - 0.1 * i as f32]).collect();
    let tau_hats: Vec<f32> = (0..batch).map(|i| 0.05 * i as f32).collect();
    let settings = LossSettings::paper();
    for architecture in shapes() {
        let weights = weights_with_biases(architecture);
        let draw = DropoutDraw::new(&architecture, batch, RootSeed(9), 0);

        let prepared = Prepared::new(&weights);
        let mut trace = Trace::default();
        let outputs = forward(&weights, &prepared, &grids, grids.len(), Some(&draw), &mut trace).to_vec();
        let d_outputs: Vec<[f32; OUTPUTS]> = (0..batch)
            .map(|i| loss::of_sample(&settings, outputs[i], labels[i], tau_hats[i]).gradient.map(|g| g / batch as f32))
            .collect();
        let mut gradient = Weights::zeros(architecture);
        backward(&weights, &prepared, &grids, &d_outputs, Some(&draw), &mut trace, &mut gradient);

        let device = Device::flex().autodiff();
        let net = LookAheadNet::from_weights(&weights, &device);
        let refs: Vec<&OccupancyGrid> = grids.iter().collect();
        let factors = draw.to_factors(&architecture, batch, &device);
        let burn_outputs = net.forward(grid_tensor(&refs, batch, &device), Some(factors));
        let values: Vec<f32> = burn_outputs.clone().into_data().try_into_vec().unwrap();
        assert_close("outputs", outputs.as_flattened(), &values);
        let labels = Tensor::from_data(TensorData::new(labels.as_flattened().to_vec(), [batch, 2]), &device);
        let sample_weights = tau_hats.iter().map(|tau| settings.weight_of_squared_error(*tau)).collect();
        let sample_weights = Tensor::from_data(TensorData::new::<f32, _>(sample_weights, [batch, 1]), &device);
        let parts = loss::of_batch(&settings, burn_outputs, labels, sample_weights);
        let burn_gradient = net.gradient(architecture, &(parts.misfit + parts.log_variance).backward());

        let (ours, theirs) = (gradient.parts(), burn_gradient.parts());
        for (name, a, b) in [
            ("conv1.weight", ours.conv1_weight, theirs.conv1_weight),
            ("conv1.bias", ours.conv1_bias, theirs.conv1_bias),
            ("conv2.weight", ours.conv2_weight, theirs.conv2_weight),
            ("conv2.bias", ours.conv2_bias, theirs.conv2_bias),
            ("fc1.weight", ours.fc1_weight, theirs.fc1_weight),
            ("fc1.bias", ours.fc1_bias, theirs.fc1_bias),
            ("fc2.weight", ours.fc2_weight, theirs.fc2_weight),
            ("fc2.bias", ours.fc2_bias, theirs.fc2_bias),
        ] {
            assert!(a.iter().any(|value| *value != 0.0), "{name} of {architecture:?} has a gradient");
            assert_close(name, a, b);
        }
    }
}

fn assert_close(name: &str, a: &[f32], b: &[f32]) {
    assert_eq!(a.len(), b.len(), "{name}");
    let scale = b.iter().fold(0.0_f32, |most, value| most.max(value.abs()));
    for (index, (a, b)) in a.iter().zip(b).enumerate() {
        assert!((a - b).abs() <= 2e-5 * scale, "{name}[{index}]: {a} against burn's {b}, largest {scale}");
    }
}

#[test]
fn a_trace_can_be_used_again() {
    let architecture = NetworkArchitecture::compact();
    let weights = weights_with_biases(architecture);
    let prepared = Prepared::new(&weights);
    let grids = lots(9);
    let fresh = forward(&weights, &prepared, &grids, grids.len(), None, &mut Trace::default()).to_vec();
    let mut used = Trace::default();
    forward(&weights, &prepared, &lots(12)[3..], 9, None, &mut used);
    let mut gradient = Weights::zeros(architecture);
    backward(&weights, &prepared, &lots(12)[3..], &[[1.0; OUTPUTS]; 9], None, &mut used, &mut gradient);
    assert_eq!(forward(&weights, &prepared, &grids, grids.len(), None, &mut used), fresh);
}
