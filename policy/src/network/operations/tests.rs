//! The operations on CPUs against what they mean in plain operations of burn, and against finite differences.

use super::*;
use crate::network::architecture::{ConvLayer, NetworkArchitecture};
use crate::network::{LookAheadNet, Weights, occupied_tensor};
use crate::test_data::lots;
use burn::backend::{Autodiff, Flex};
use burn::module::Param;
use burn::tensor::{Device, Float, TensorData};
use rand::RngExt as _;
use sim::seed::{RootSeed, Stream};

type Reference = Autodiff<Flex>;

fn shapes() -> [NetworkArchitecture; 3] {
    let odd = NetworkArchitecture {
        conv1: ConvLayer { channels: 16, kernel: 4 },
        conv2: ConvLayer { channels: 48, kernel: 5 },
        hidden: 70,
        modes: 1,
        ..NetworkArchitecture::paper()
    };
    [NetworkArchitecture::paper(), NetworkArchitecture::compact(), odd]
}

/// Values between −0.5 and 0.5.
fn random(shape: impl Into<burn::tensor::Shape>, index: u64) -> TensorData {
    let mut rng = RootSeed(5).rng(Stream::Weights, index);
    let shape = shape.into();
    let values: Vec<f32> = (0..shape.num_elements()).map(|_| rng.random_range(-0.5..0.5)).collect();
    TensorData::new(values, shape)
}

fn vector<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
    tensor.into_data().try_into_vec().unwrap()
}

fn assert_close(name: &str, ours: &[f32], expected: &[f32]) {
    assert_eq!(ours.len(), expected.len(), "{name}");
    let scale = expected.iter().fold(0.0_f32, |most, value| most.max(value.abs()));
    assert!(scale > 0.0, "{name} is not all zero");
    for (index, (a, b)) in ours.iter().zip(expected).enumerate() {
        assert!((a - b).abs() <= 2e-5 * scale, "{name}[{index}]: {a} against {b}, largest {scale}");
    }
}

/// The parameters of the encoder, as leaves of a graph.
struct Leaves(Tensor<4>, Tensor<1>, Tensor<4>, Tensor<1>);

impl Leaves {
    fn new(architecture: NetworkArchitecture) -> Self {
        let device = Device::flex().autodiff();
        let leaf = |param: &Param<Tensor<4>>| param.val().detach().require_grad();
        let net = LookAheadNet::from_weights(&Weights::init(architecture, RootSeed(5), 0), &device);
        // Biases start at 0; here they must matter.
        let bias = |conv: ConvLayer, index| {
            (Tensor::<1>::from_data(random([conv.channels], index), &device) * 0.2).detach().require_grad()
        };
        let (conv1, conv2) = net.convolutions();
        Self(leaf(conv1), bias(architecture.conv1, 1), leaf(conv2), bias(architecture.conv2, 2))
    }

    fn gradients(&self, features: Tensor<2>) -> [Vec<f32>; 4] {
        // Every feature with a weight of its own.
        let weights = Tensor::from_data(random(features.shape(), 3), &features.device());
        let gradients = (features * weights).sum().backward();
        [
            vector(self.0.grad(&gradients).unwrap()),
            vector(self.1.grad(&gradients).unwrap()),
            vector(self.2.grad(&gradients).unwrap()),
            vector(self.3.grad(&gradients).unwrap()),
        ]
    }

    fn encoded(&self, occupied: Tensor<3, Bool>) -> Tensor<2> {
        encode(occupied, self.0.clone(), self.1.clone(), self.2.clone(), self.3.clone())
    }

    fn plainly_encoded(&self, occupied: Tensor<3, Bool>) -> Tensor<2> {
        Tensor::from_primitive::<Reference>(plain::encode::<Reference>(
            occupied.try_into_primitive::<Reference>().unwrap(),
            self.0.clone().try_into_primitive::<Reference>().unwrap(),
            self.1.clone().try_into_primitive::<Reference>().unwrap(),
            self.2.clone().try_into_primitive::<Reference>().unwrap(),
            self.3.clone().try_into_primitive::<Reference>().unwrap(),
        ))
    }
}

#[test]
fn encoding_and_its_gradients_equal_those_of_plain_operations() {
    let batch = 19; // a whole chunk and a part of one
    let device = Device::flex().autodiff();
    for architecture in shapes() {
        let leaves = Leaves::new(architecture);
        let occupied = occupied_tensor(lots(batch).iter(), &device);
        let (ours, expected) = (leaves.encoded(occupied.clone()), leaves.plainly_encoded(occupied));
        assert_close("features", &vector(ours.clone()), &vector(expected.clone()));
        let names = ["conv1.weight", "conv1.bias", "conv2.weight", "conv2.bias"];
        for ((name, ours), expected) in names.into_iter().zip(leaves.gradients(ours)).zip(leaves.gradients(expected)) {
            assert_close(name, &ours, &expected);
        }
    }
}

/// For a smooth function of one weight at a time, where no pool changes its winner.
#[test]
fn gradients_of_the_encoder_equal_finite_differences() {
    let device = Device::flex().autodiff();
    let occupied = occupied_tensor(lots(3).iter(), &device);
    let leaves = Leaves::new(NetworkArchitecture::compact());
    let [of_weight_1, of_bias_1, of_weight_2, of_bias_2] = leaves.gradients(leaves.encoded(occupied.clone()));
    let total = |leaves: &Leaves| -> f64 {
        let features = leaves.encoded(occupied.clone());
        let weights: Vec<f32> = random(features.shape(), 3).try_into_vec().unwrap();
        vector(features).iter().zip(weights).map(|(a, b)| f64::from(*a) * f64::from(b)).sum()
    };
    let moved = |part: usize, index: usize, by: f32| {
        let shift = |tensor: Tensor<1>| {
            let mut values = vector(tensor.clone());
            values[index] += by;
            Tensor::<1>::from_data(TensorData::from(values.as_slice()), &device)
        };
        let at = |this: usize, tensor: &Tensor<4>| {
            let flat = tensor.clone().flatten::<1>(0, 3);
            (if this == part { shift(flat) } else { flat }).reshape(tensor.shape())
        };
        let at_1 = |this: usize, tensor: &Tensor<1>| if this == part { shift(tensor.clone()) } else { tensor.clone() };
        Leaves(at(0, &leaves.0), at_1(1, &leaves.1), at(2, &leaves.2), at_1(3, &leaves.3))
    };
    let step = 3e-4;
    for (part, gradient) in [of_weight_1, of_bias_1, of_weight_2, of_bias_2].into_iter().enumerate() {
        let mut agreeing = 0;
        let tried: Vec<usize> = (0..gradient.len()).step_by(gradient.len().div_ceil(12)).collect();
        for &index in &tried {
            let difference =
                (total(&moved(part, index, step)) - total(&moved(part, index, -step))) / f64::from(2.0 * step);
            let slope = f64::from(gradient[index]);
            agreeing += usize::from((difference - slope).abs() < 0.05 * (1.0 + slope.abs()));
        }
        // At a kink of a ReLU or a pool the two differ; that is rare.
        assert!(agreeing * 10 >= tried.len() * 9, "part {part}: {agreeing} of {} agree", tried.len());
    }
}

#[test]
fn a_dense_layer_and_its_gradients_equal_those_of_plain_operations() {
    let device = Device::flex().autodiff();
    for (rows, inputs, outputs) in [(1, 30, 4), (3, 1152, 256), (37, 600, 70), (130, 40, 1000)] {
        let leaf = |data| Tensor::<2>::from_data(data, &device).require_grad();
        // As after a ReLU: half of the inputs are 0.
        let x = leaf((Tensor::<2>::from_data(random([rows, inputs], 1), &device)).clamp_min(0.0).into_data());
        let weight = leaf(random([inputs, outputs], 2));
        let bias = Tensor::<1>::from_data(random([outputs], 3), &device).require_grad();
        let ours = dense(x.clone(), weight.clone(), bias.clone());
        let expected = Tensor::<2, Float>::from_primitive::<Reference>(plain::dense::<Reference>(
            x.clone().try_into_primitive::<Reference>().unwrap(),
            weight.clone().try_into_primitive::<Reference>().unwrap(),
            bias.clone().try_into_primitive::<Reference>().unwrap(),
        ));
        assert_close("y", &vector(ours.clone()), &vector(expected.clone()));
        let gradients = |y: Tensor<2>| {
            let weights = Tensor::from_data(random(y.shape(), 4), &device);
            let found = (y * weights).sum().backward();
            [vector(x.grad(&found).unwrap()), vector(weight.grad(&found).unwrap()), vector(bias.grad(&found).unwrap())]
        };
        for ((name, ours), expected) in
            ["x", "weight", "bias"].into_iter().zip(gradients(ours)).zip(gradients(expected))
        {
            assert_close(&format!("{name} of {rows} x {inputs} x {outputs}"), &ours, &expected);
        }
    }
}

/// The property that makes closed-loop results independent of how many cars are still on the road.
#[test]
fn a_row_of_a_dense_layer_does_not_depend_on_the_others() {
    let device = Device::flex();
    let x = Tensor::<2>::from_data(random([45, 200], 1), &device).clamp_min(0.0);
    let weight = Tensor::<2>::from_data(random([200, 70], 2), &device);
    let bias = Tensor::<1>::from_data(random([70], 3), &device);
    let together = vector(dense(x.clone(), weight.clone(), bias.clone()));
    for (first, rows) in [(0, 1), (7, 2), (3, 5), (9, 17), (1, 33)] {
        let part = vector(dense(x.clone().narrow(0, first, rows), weight.clone(), bias.clone()));
        assert_eq!(part, together[first * 70..(first + rows) * 70], "{rows} rows from {first}");
    }
}

fn adam(number: u32, gradient_norm_max: f32) -> AdamStep {
    let weight_decay = 0.01;
    AdamStep { learning_rate: 0.01, beta_1: 0.9, beta_2: 0.999, epsilon: 1e-8, weight_decay, gradient_norm_max, number }
}

#[test]
fn adam_equals_its_plain_operations() {
    let device = Device::flex();
    // Longer than what one thread takes at a time, and no whole number of vectors.
    let n = 40_003;
    let tensor = |index| Tensor::<1>::from_data(random([n], index), &device);
    for gradient_norm_max in [0.0, 1.0, 1e6] {
        let (weights, gradient, mean, square) = (tensor(1), tensor(2), tensor(3), tensor(4).abs());
        let step = adam(3, gradient_norm_max);
        let primitive = |tensor: &Tensor<1>| tensor.clone().try_into_primitive::<Flex>().unwrap();
        let expected = plain::adam_step::<Flex>(
            step,
            primitive(&gradient),
            AdamMoments { weights: primitive(&weights), mean: primitive(&mean), mean_square: primitive(&square) },
        );
        let expected = [expected.weights, expected.mean, expected.mean_square];
        let ours = adam_step(step, weights, gradient, mean, square);
        for ((name, ours), expected) in ["weights", "mean", "square"].into_iter().zip(ours).zip(expected) {
            assert_close(name, &vector(ours), &vector(Tensor::<1>::from_primitive::<Flex>(expected)));
        }
    }
}

/// With a constant gradient both means are exact after their corrections: each step is the learning rate.
#[test]
fn a_constant_gradient_moves_by_the_learning_rate() {
    let device = Device::flex();
    let tensor = |values: [f32; 3]| Tensor::<1>::from_data(values, &device);
    let (mut weights, mut mean, mut square) = (tensor([1.0; 3]), tensor([0.0; 3]), tensor([0.0; 3]));
    for number in 1..=10 {
        let step = AdamStep { weight_decay: 0.0, ..adam(number, 0.0) };
        [weights, mean, square] = adam_step(step, weights, tensor([2.0, -0.5, 0.0]), mean, square);
    }
    let weights = vector(weights);
    assert!((weights[0] - 0.9).abs() < 1e-5 && (weights[1] - 1.1).abs() < 1e-5, "{weights:?}");
    assert_eq!(weights[2], 1.0);
}

/// Left alone, a mean that decays gets stuck at numbers that processors are a hundred times slower with.
#[test]
fn means_that_decay_become_zero_and_not_denormal() {
    let device = Device::flex();
    let tensor = |value: f32| Tensor::<1>::from_data([value; 20], &device);
    let (mut weights, mut mean, mut square) = (tensor(1.0), tensor(1e-20), tensor(1e-20));
    for number in 1..=50_000 {
        [weights, mean, square] = adam_step(adam(number, 5.0), weights, tensor(0.0), mean, square);
        let [mean, square] = [&mean, &square].map(|tensor| vector(tensor.clone())[0]);
        assert!(!mean.is_subnormal() && !square.is_subnormal(), "{mean} {square} in step {number}");
    }
    assert_eq!((vector(mean)[19], vector(square)[19]), (0.0, 0.0));
}
