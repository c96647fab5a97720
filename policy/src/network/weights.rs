//! The weights of a network on the host: one flat vector, cut into named parts.

use crate::network::architecture::{NetworkArchitecture, OUTPUTS, RESIDUAL_KERNEL};
use crate::network::log_variance::soft_clamp_inverse;
use sim::seed::{RootSeed, Stream};

/// All trainable values of one network, in the order of [`Parts`].
#[derive(Debug, Clone, PartialEq)]
pub struct Weights {
    architecture: NetworkArchitecture,
    values: Vec<f32>,
}

/// One slice per layer and kind. Shapes are burn's:
///
/// | part | shape |
/// |---|---|
/// | `conv1_weight` | `[conv1, 1, kernel, kernel]` |
/// | `residual1_weight` | `[layer, conv1, conv1, 3, 3]` |
/// | `conv2_weight` | `[conv2, conv1, kernel, kernel]` |
/// | `residual2_weight` | `[layer, conv2, conv2, 3, 3]` |
/// | `fc1_weight` | `[6·6·conv2, hidden]`; inputs are ordered row, column, channel |
/// | `fc2_weight` | `[hidden, outputs]`; outputs are u, w, raw log-variance of u, of w, and the same and logits for each of several modes |
#[derive(Debug)]
#[expect(missing_docs, reason = "the table above says it once")]
pub struct Parts<T> {
    pub conv1_weight: T,
    pub conv1_bias: T,
    pub residual1_weight: T,
    pub residual1_bias: T,
    pub conv2_weight: T,
    pub conv2_bias: T,
    pub residual2_weight: T,
    pub residual2_bias: T,
    pub fc1_weight: T,
    pub fc1_bias: T,
    pub fc2_weight: T,
    pub fc2_bias: T,
}

impl<T> Parts<T> {
    fn from_fn(mut part: impl FnMut() -> T) -> Self {
        Self {
            conv1_weight: part(),
            conv1_bias: part(),
            residual1_weight: part(),
            residual1_bias: part(),
            conv2_weight: part(),
            conv2_bias: part(),
            residual2_weight: part(),
            residual2_bias: part(),
            fc1_weight: part(),
            fc1_bias: part(),
            fc2_weight: part(),
            fc2_bias: part(),
        }
    }
}

/// Standard deviation of the initial weights of the last layer: its biases decide the first answers.
const LAST_LAYER_STD: f32 = 0.01;
/// First answer for (u, w): straight ahead, a little beyond the middle of the patch.
const INITIAL_MEAN: [f32; 2] = [0.5, 0.4];
/// Between the first answers of neighbouring modes, in u.
const INITIAL_APART: f32 = 0.1;
/// First answer for log σ: σ = 0.15 image fractions, 1.8 m.
const INITIAL_LOG_SIGMA: f32 = -1.9;

impl Weights {
    /// He initialisation, half of it in residual layers, small last layer, biases as in docs/methods.md 4.1. `index` tells
    /// apart networks of one seed.
    ///
    /// Drawn in the order of the parts from our own stream, so that no other thread can shift a draw.
    ///
    /// # Panics
    /// If the shape was not validated.
    pub fn init(architecture: NetworkArchitecture, seed: RootSeed, index: u64) -> Self {
        let mut weights = Self::zeros(architecture);
        let mut normal = Normal { rng: seed.rng(Stream::Weights, index), spare: None };
        let fan_in_1 = architecture.conv1.kernel.pow(2);
        let fan_in_2 = architecture.conv2.kernel.pow(2) * architecture.conv1.channels;
        let parts = weights.parts_mut();
        let residual_std = |channels: usize| 0.5 * he_std(RESIDUAL_KERNEL.pow(2) * channels);
        normal.fill(parts.conv1_weight, he_std(fan_in_1));
        normal.fill(parts.residual1_weight, residual_std(architecture.conv1.channels));
        normal.fill(parts.conv2_weight, he_std(fan_in_2));
        normal.fill(parts.residual2_weight, residual_std(architecture.conv2.channels));
        normal.fill(parts.fc1_weight, he_std(architecture.features()));
        normal.fill(parts.fc2_weight, LAST_LAYER_STD);
        let raw_log_variance = soft_clamp_inverse(2.0 * INITIAL_LOG_SIGMA);
        for mode in 0..architecture.modes {
            // Side by side, so that modes have something to divide between them.
            let aside = (mode as f32 - 0.5 * (architecture.modes - 1) as f32) * INITIAL_APART;
            let first = [INITIAL_MEAN[0] + aside, INITIAL_MEAN[1], raw_log_variance, raw_log_variance];
            parts.fc2_bias[mode * OUTPUTS..][..OUTPUTS].copy_from_slice(&first);
        }
        weights
    }

    /// Every value 0: the shape of a gradient.
    ///
    /// # Panics
    /// If the shape was not validated.
    pub fn zeros(architecture: NetworkArchitecture) -> Self {
        if let Err(error) = architecture.validate() {
            panic!("network shape was not validated: {error}");
        }
        Self { architecture, values: vec![0.0; architecture.parameter_count()] }
    }

    /// The shape.
    pub fn architecture(&self) -> NetworkArchitecture {
        self.architecture
    }

    /// All values.
    pub fn values(&self) -> &[f32] {
        &self.values
    }

    /// All values, to be changed.
    pub fn values_mut(&mut self) -> &mut [f32] {
        &mut self.values
    }

    /// The values by name.
    pub fn parts(&self) -> Parts<&[f32]> {
        let mut rest = self.values.as_slice();
        let mut lengths = self.architecture.lengths().into_iter();
        Parts::from_fn(|| {
            rest.split_off(..lengths.next().expect("a length for every part")).expect("the values fill the parts")
        })
    }

    /// The values by name, to be changed.
    pub fn parts_mut(&mut self) -> Parts<&mut [f32]> {
        let mut rest = self.values.as_mut_slice();
        let mut lengths = self.architecture.lengths().into_iter();
        Parts::from_fn(|| {
            rest.split_off_mut(..lengths.next().expect("a length for every part")).expect("the values fill the parts")
        })
    }
}

/// √(2 / fan-in): keeps the variance through a `ReLU` (He 2015).
fn he_std(fan_in: usize) -> f32 {
    (2.0 / fan_in as f32).sqrt()
}

/// Normal draws by Box and Muller's transform, two at a time.
struct Normal {
    rng: sim::seed::Rng,
    spare: Option<f32>,
}

impl Normal {
    fn fill(&mut self, values: &mut [f32], std: f32) {
        for value in values {
            *value = std * self.draw();
        }
    }

    fn draw(&mut self) -> f32 {
        use rand::RngExt as _;
        if let Some(spare) = self.spare.take() {
            return spare;
        }
        // 1 − x lies in (0, 1]: its logarithm is finite.
        let radius = (-2.0 * libm::log(1.0 - self.rng.random::<f64>())).sqrt();
        let (sin, cos) = libm::sincos(std::f64::consts::TAU * self.rng.random::<f64>());
        self.spare = Some((radius * sin) as f32);
        (radius * cos) as f32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_networks_have_the_parameters_that_are_said() {
        assert_eq!(NetworkArchitecture::paper().parameter_count(), 2_318_092);
        assert_eq!(NetworkArchitecture::compact().parameter_count(), 302_538);
    }

    #[test]
    fn initial_weights_have_the_intended_spread() {
        let weights = Weights::init(NetworkArchitecture::compact(), RootSeed(1), 0);
        let std = |values: &[f32]| (values.iter().map(|v| v * v).sum::<f32>() / values.len() as f32).sqrt();
        let parts = weights.parts();
        assert!((std(parts.fc1_weight) / he_std(1152) - 1.0).abs() < 0.01);
        assert!((std(parts.conv2_weight) / he_std(144) - 1.0).abs() < 0.05);
        assert!((std(parts.fc2_weight) / 0.01 - 1.0).abs() < 0.05);
        assert!((crate::network::log_variance::soft_clamp_log_variance(parts.fc2_bias[2]) - -3.8).abs() < 1e-5);
    }

    #[test]
    fn a_seed_fixes_the_weights_and_an_index_changes_them() {
        let init = |seed, index| Weights::init(NetworkArchitecture::compact(), RootSeed(seed), index);
        assert_eq!(init(7, 0), init(7, 0));
        assert_ne!(init(7, 0), init(7, 1));
        assert_ne!(init(7, 0), init(8, 0));
    }
}
