//! The operations on CPUs against what they mean in plain operations of burn, and against finite differences.

use super::*;
use crate::network::architecture::ConvLayer;
use crate::network::occupied_tensor;
use crate::test_data::lots;
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Flex};
use burn::tensor::{Device, Float, TensorData};
use rand::RngExt as _;
use sim::seed::{RootSeed, Stream};

type Reference = Autodiff<Flex>;

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

/// What a layer sees, as after a `ReLU` half of it 0, and its parameters, as leaves of a graph.
struct Leaves {
    x: Tensor<2>,
    weight: Tensor<4>,
    bias: Tensor<1>,
}

impl Leaves {
    /// `cells`: per side of the map.
    fn new(batch: usize, cells: usize, inputs: usize, conv: ConvLayer) -> Self {
        let device = Device::flex().autodiff();
        let x = Tensor::<2>::from_data(random([batch, cells * cells * inputs], 1), &device).clamp_min(0.0);
        let weight = random([conv.channels, inputs, conv.kernel, conv.kernel], 2);
        Self {
            x: x.detach().require_grad(),
            weight: Tensor::from_data(weight, &device).require_grad(),
            bias: Tensor::from_data(random([conv.channels], 3), &device).require_grad(),
        }
    }

    /// Primitives of the plain operations.
    fn primitives(&self) -> [FloatTensor<Reference>; 3] {
        [
            self.x.clone().try_into_primitive::<Reference>().unwrap(),
            self.weight.clone().try_into_primitive::<Reference>().unwrap(),
            self.bias.clone().try_into_primitive::<Reference>().unwrap(),
        ]
    }

    /// Of the sum of the answers, each with a weight of its own; that of x only if it is part of the graph.
    fn gradients(&self, y: Tensor<2>) -> Vec<(&'static str, Vec<f32>)> {
        let weights = Tensor::from_data(random(y.shape(), 4), &y.device());
        let found = (y * weights).sum().backward();
        let of_x = self.x.grad(&found).map(|gradient| ("x", vector(gradient)));
        let of_weights =
            [("weight", vector(self.weight.grad(&found).unwrap())), ("bias", vector(self.bias.grad(&found).unwrap()))];
        of_x.into_iter().chain(of_weights).collect()
    }

    fn assert_alike(&self, name: &str, ours: Tensor<2>, expected: FloatTensor<Reference>) {
        let expected = Tensor::<2>::from_primitive::<Reference>(expected);
        assert_close(name, &vector(ours.clone()), &vector(expected.clone()));
        let (ours, expected) = (self.gradients(ours), self.gradients(expected));
        assert_eq!(ours.len(), expected.len(), "{name}");
        for ((part, ours), (_, expected)) in ours.iter().zip(&expected) {
            assert_close(&format!("{part} of {name}"), ours, expected);
        }
    }
}

/// A whole chunk and a part of one.
const BATCH: usize = 19;

#[test]
fn the_first_layer_and_its_gradients_equal_those_of_plain_operations() {
    let occupied = occupied_tensor(lots(BATCH).iter(), &Device::flex().autodiff());
    for (channels, kernel) in [(16, 3), (32, 5), (16, 4), (48, 7), (16, 1)] {
        let leaves = Leaves::new(1, 1, 1, ConvLayer { channels, kernel });
        let ours = first_layer(occupied.clone(), leaves.weight.clone(), leaves.bias.clone());
        let [_, weight, bias] = leaves.primitives();
        let cells = occupied.clone().try_into_primitive::<Reference>().unwrap();
        let expected = plain::first_layer::<Reference>(cells, weight, bias);
        leaves.assert_alike(&format!("{channels} channels, kernel {kernel}"), ours, expected);
    }
}

#[test]
fn the_second_layer_and_its_gradients_equal_those_of_plain_operations() {
    for (inputs, channels, kernel) in [(16, 32, 3), (32, 64, 2), (16, 48, 5), (16, 16, 1)] {
        let leaves = Leaves::new(BATCH, 12, inputs, ConvLayer { channels, kernel });
        let ours = second_layer(leaves.x.clone(), leaves.weight.clone(), leaves.bias.clone());
        let [x, weight, bias] = leaves.primitives();
        let expected = plain::second_layer::<Reference>(x, weight, bias);
        leaves.assert_alike(&format!("{inputs} to {channels} channels, kernel {kernel}"), ours, expected);
    }
}

#[test]
fn a_residual_layer_and_its_gradients_equal_those_of_plain_operations() {
    for (cells, channels) in [(12, 16), (6, 32), (12, 48), (6, 16), (6, 64)] {
        let leaves = Leaves::new(BATCH, cells, channels, ConvLayer { channels, kernel: 3 });
        let ours = residual_layer(leaves.x.clone(), leaves.weight.clone(), leaves.bias.clone());
        let [x, weight, bias] = leaves.primitives();
        let expected = plain::residual_layer::<Reference>(x, weight, bias);
        leaves.assert_alike(&format!("{channels} channels on {cells} cells"), ours, expected);
    }
}

/// With weights of 0 only the input is left.
#[test]
fn a_residual_layer_without_weights_passes_on_what_it_sees() {
    let leaves = Leaves::new(2, 6, 16, ConvLayer { channels: 16, kernel: 3 });
    let y = residual_layer(leaves.x.clone(), leaves.weight.clone().zeros_like(), leaves.bias.clone().zeros_like());
    assert_eq!(vector(y), vector(leaves.x));
}

/// All convolutions one after the other.
#[derive(Clone)]
struct Chain {
    weights: [Tensor<4>; 4],
    biases: [Tensor<1>; 4],
}

impl Chain {
    fn new(device: &Device) -> Self {
        let shapes = [[16, 1, 3, 3], [16, 16, 3, 3], [32, 16, 3, 3], [32, 32, 3, 3]];
        let leaf = |index: usize| Tensor::<4>::from_data(random(shapes[index], index as u64), device) * 0.4;
        let bias = |index: usize| Tensor::<1>::from_data(random([shapes[index][0]], 9 + index as u64), device) * 0.2;
        Self {
            weights: std::array::from_fn(|index| leaf(index).detach().require_grad()),
            biases: std::array::from_fn(|index| bias(index).detach().require_grad()),
        }
    }

    /// The sum of the features, each with a weight of its own.
    fn total(&self, occupied: &Tensor<3, Bool>) -> Tensor<1> {
        let ([w1, w2, w3, w4], [b1, b2, b3, b4]) = (self.weights.clone(), self.biases.clone());
        let map = residual_layer(first_layer(occupied.clone(), w1, b1), w2, b2);
        let features = residual_layer(second_layer(map, w3, b3), w4, b4);
        let weights = Tensor::from_data(random(features.shape(), 3), &features.device());
        (features * weights).sum()
    }
}

/// Along random directions, one parameter at a time: where no pool changes its winner and no `ReLU` its mind.
#[test]
fn gradients_of_all_convolutions_equal_finite_differences() {
    let device = Device::flex().autodiff();
    let occupied = occupied_tensor(lots(3).iter(), &device);
    let chain = Chain::new(&device);
    let found = chain.total(&occupied).backward();
    let total = |chain: &Chain| f64::from(chain.total(&occupied).into_scalar::<f32>());
    let step = 2e-4;
    let (mut agreeing, mut tried) = (0, 0);
    for part in 0..4 {
        for direction in 20..28 {
            let along = Tensor::<4>::from_data(random(chain.weights[part].shape(), direction), &device);
            let slope = (chain.weights[part].grad(&found).unwrap() * along.clone().inner()).sum();
            let at = |by: f32| {
                let mut moved = chain.clone();
                moved.weights[part] = moved.weights[part].clone() + along.clone() * by;
                total(&moved)
            };
            let of_weights = ((at(step) - at(-step)) / f64::from(2.0 * step), slope.into_scalar::<f32>());
            let along = Tensor::<1>::from_data(random(chain.biases[part].shape(), direction), &device);
            let slope = (chain.biases[part].grad(&found).unwrap() * along.clone().inner()).sum();
            let at = |by: f32| {
                let mut moved = chain.clone();
                moved.biases[part] = moved.biases[part].clone() + along.clone() * by;
                total(&moved)
            };
            let of_biases = ((at(step) - at(-step)) / f64::from(2.0 * step), slope.into_scalar::<f32>());
            for (difference, slope) in [of_weights, of_biases] {
                let slope = f64::from(slope);
                agreeing += usize::from((difference - slope).abs() < 0.05 * (1.0 + slope.abs()));
                tried += 1;
            }
        }
    }
    assert!(agreeing * 10 >= tried * 9, "{agreeing} of {tried} agree");
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
