//! Adam for a module of burn.

use crate::network::operations::{AdamStep, adam_step};
use burn::optim::{AdamState, AdaptiveMomentumState, LearningRate, ModuleOptimizer, Optimizer};
use burn::tensor::{Device, Tensor};
use serde::{Deserialize, Serialize};

/// Settings of Adam other than the learning rate.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AdamSettings {
    /// Decay of the mean of the gradient.
    pub beta1: f32,
    /// Decay of the mean of its square.
    pub beta2: f32,
    /// Added to the root of the mean square.
    pub epsilon: f32,
    /// Share of the weights taken off per step and unit of learning rate (decoupled).
    pub weight_decay: f32,
}

impl AdamSettings {
    /// Kingma and Ba's values (the paper names only "Adam"), no weight decay (the paper has it for perception only).
    pub fn paper() -> Self {
        Self { beta1: 0.9, beta2: 0.999, epsilon: 1e-8, weight_decay: 0.0 }
    }

    /// The optimiser of a module. A gradient of a parameter (a layer's weights or biases) whose norm is above
    /// `gradient_norm_max` is scaled down to it, as burn's clipping by norm does; 0 = never.
    pub fn optimizer(self, gradient_norm_max: f32) -> ModuleOptimizer {
        Adam { settings: self, gradient_norm_max }.into()
    }
}

/// burn's Adam and clipping as one operation (see [`operations`](crate::network::operations)), with decoupled weight
/// decay.
#[derive(Debug, Clone)]
struct Adam {
    settings: AdamSettings,
    gradient_norm_max: f32,
}

impl Optimizer for Adam {
    /// burn's own: records are those of its Adam.
    type State<const D: usize> = AdamState<D>;

    fn step<const D: usize>(
        &self,
        learning_rate: LearningRate,
        tensor: Tensor<D>,
        gradient: Tensor<D>,
        state: Option<AdamState<D>>,
    ) -> (Tensor<D>, Option<AdamState<D>>) {
        let AdamState { momentum } = state.unwrap_or_else(|| {
            let zeros = || Tensor::zeros(tensor.shape(), &tensor.device());
            AdamState::new(AdaptiveMomentumState::new(0, zeros(), zeros()))
        });
        let time = momentum.time + 1;
        let AdamSettings { beta1, beta2, epsilon, weight_decay } = self.settings;
        let step = AdamStep {
            learning_rate: learning_rate as f32,
            beta_1: beta1,
            beta_2: beta2,
            epsilon,
            weight_decay,
            gradient_norm_max: self.gradient_norm_max,
            number: time as u32,
        };
        let [tensor, mean, mean_square] = adam_step(step, tensor, gradient, momentum.moment_1, momentum.moment_2);
        (tensor, Some(AdamState::new(AdaptiveMomentumState::new(time, mean, mean_square))))
    }

    fn to_device<const D: usize>(state: AdamState<D>, device: &Device) -> AdamState<D> {
        AdamState::new(state.momentum.to_device(device))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use burn::grad_clipping::GradientClippingConfig;
    use burn::module::Param;
    use burn::nn::{Linear, LinearConfig};
    use burn::optim::{AdamWConfig, GradientsParams};
    use burn::tensor::TensorData;
    use sim::maths;

    /// Ten steps of a layer towards the same answers; its weights.
    fn stepped(mut optimizer: ModuleOptimizer) -> Vec<f32> {
        let device = Device::flex().autodiff();
        let values = |n: usize, factor: f32| (0..n).map(|i| maths::sin(factor * i as f32)).collect::<Vec<f32>>();
        let tensor = |rows: usize, columns: usize, factor| {
            Tensor::<2>::from_data(TensorData::new(values(rows * columns, factor), [rows, columns]), &device)
        };
        let mut layer: Linear = LinearConfig::new(37, 5).init(&device);
        layer.weight = Param::from_tensor(tensor(37, 5, 0.7));
        layer.bias = Some(Param::from_tensor(Tensor::zeros([5], &device)));
        for step in 0..10 {
            // Steep at first, so that some gradients are clipped and some are not.
            let error = (layer.forward(tensor(8, 37, 1.3)) - tensor(8, 5, 2.1)) * (3.0 / (1.0 + step as f32));
            let gradients = GradientsParams::from_grads(error.square().sum().backward(), &layer);
            layer = optimizer.step(0.01, layer, gradients);
        }
        layer.weight.val().into_data().try_into_vec().unwrap()
    }

    #[test]
    fn steps_are_those_of_burns_own_adam_with_its_clipping() {
        for (weight_decay, norm_max) in [(0.0, 5.0), (0.3, 5.0), (0.3, 0.0)] {
            let ours = AdamSettings { weight_decay, ..AdamSettings::paper() };
            let mut burns = AdamWConfig::new().with_epsilon(ours.epsilon).with_weight_decay(weight_decay);
            if norm_max > 0.0 {
                burns = burns.with_grad_clipping(Some(GradientClippingConfig::Norm(norm_max)));
            }
            let (found, expected) = (stepped(ours.optimizer(norm_max)), stepped(burns.init()));
            for (a, b) in found.iter().zip(&expected) {
                assert!((a - b).abs() < 1e-5, "decay {weight_decay}, clipped at {norm_max}: {a} against burn's {b}");
            }
        }
    }
}
