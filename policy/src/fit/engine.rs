//! The gradient of one batch, on CPUs or on a burn device.

use crate::dataset::Sample;
use crate::fit::adam::sum_and_norm;
use crate::loss::{self, LossParts, LossSettings};
use crate::network::fast::{self, Prepared, Trace};
use crate::network::{DeviceChoice, DropoutDraw, LookAheadNet, NetworkArchitecture, OUTPUTS, Weights, grid_tensor};
use burn::tensor::{Device, Tensor, TensorData};
use rayon::prelude::*;
use sim::seed::RootSeed;
use sim::sensing::OccupancyGrid;

/// Computes gradients; keeps its memory between steps.
pub(crate) struct Engine {
    shards: Vec<Shard>,
    /// The burn device to compute on, with autodiff; `None` = [`fast`].
    device: Option<Device>,
}

/// One part of a batch: the unit of work of one thread.
struct Shard {
    trace: Trace,
    grids: Vec<OccupancyGrid>,
    d_outputs: Vec<[f32; OUTPUTS]>,
    gradient: Weights,
    loss: LossParts,
}

impl Engine {
    pub(crate) fn new(architecture: NetworkArchitecture, shards: usize, device: DeviceChoice) -> Self {
        let device = device.burn_device().map(Device::autodiff);
        let shard = || Shard {
            trace: Trace::default(),
            grids: Vec::new(),
            d_outputs: Vec::new(),
            gradient: Weights::zeros(architecture),
            loss: LossParts::default(),
        };
        Self { shards: (0..shards).map(|_| shard()).collect(), device }
    }

    /// Mean loss of a batch; its gradient stays in the shards.
    pub(crate) fn gradient(
        &mut self,
        weights: &Weights,
        batch: &[Sample],
        settings: &LossSettings,
        seed: RootSeed,
        step: u32,
    ) -> LossParts {
        let architecture = weights.architecture();
        let prepared = Prepared::new(weights);
        let rows = batch.len().div_ceil(self.shards.len());
        let shards = self.shards.len() as u64;
        let device = self.device.as_ref();
        let compute = |(index, shard): (usize, &mut Shard)| {
            let samples = batch.chunks(rows).nth(index).unwrap_or_default();
            let draw = DropoutDraw::new(&architecture, samples.len(), seed, u64::from(step) * shards + index as u64);
            let scale = 1.0 / batch.len() as f32;
            match device {
                None => shard.compute(weights, &prepared, samples, settings, &draw, scale),
                Some(device) => shard.compute_on(device, weights, samples, settings, &draw, scale),
            }
        };
        match device {
            None => self.shards.par_iter_mut().enumerate().for_each(compute),
            // One device serves one shard at a time anyway.
            Some(_) => self.shards.iter_mut().enumerate().for_each(compute),
        }
        let mut loss = LossParts::default();
        for shard in &self.shards {
            loss.misfit += shard.loss.misfit;
            loss.log_variance += shard.loss.log_variance;
        }
        loss.total = loss.misfit + loss.log_variance;
        loss
    }

    /// Adds the shards' gradients, in order, into the first; returns the norm.
    pub(crate) fn reduce(&mut self) -> f32 {
        let (first, others) = self.shards.split_first_mut().expect("there is at least one shard");
        let others: Vec<&[f32]> = others.iter().map(|shard| shard.gradient.values()).collect();
        sum_and_norm(first.gradient.values_mut(), &others)
    }

    /// The sum after [`Self::reduce`].
    pub(crate) fn reduced(&self) -> &[f32] {
        self.shards[0].gradient.values()
    }
}

impl Shard {
    /// Gradient of the sum of the samples' losses times `scale`.
    fn compute(
        &mut self,
        weights: &Weights,
        prepared: &Prepared,
        samples: &[Sample],
        settings: &LossSettings,
        draw: &DropoutDraw,
        scale: f32,
    ) {
        self.grids.clear();
        self.grids.extend(samples.iter().map(|sample| sample.grid));
        let outputs = fast::forward(weights, prepared, &self.grids, samples.len(), Some(draw), &mut self.trace);
        self.loss = LossParts::default();
        self.d_outputs.clear();
        for (raw, sample) in outputs.iter().zip(samples) {
            let loss = loss::of_sample(settings, *raw, sample.label, sample.tau_hat);
            self.loss.misfit += scale * loss.parts.misfit;
            self.loss.log_variance += scale * loss.parts.log_variance;
            self.d_outputs.push(loss.gradient.map(|slope| scale * slope));
        }
        let (trace, gradient) = (&mut self.trace, &mut self.gradient);
        fast::backward(weights, prepared, &self.grids, &self.d_outputs, Some(draw), trace, gradient);
    }

    /// The same by burn's autodiff.
    fn compute_on(
        &mut self,
        device: &Device,
        weights: &Weights,
        samples: &[Sample],
        settings: &LossSettings,
        draw: &DropoutDraw,
        scale: f32,
    ) {
        let (n, architecture) = (samples.len(), weights.architecture());
        if n == 0 {
            self.gradient.values_mut().fill(0.0);
            self.loss = LossParts::default();
            return;
        }
        let grids: Vec<_> = samples.iter().map(|sample| &sample.grid).collect();
        let labels: Vec<f32> = samples.iter().flat_map(|sample| sample.label).collect();
        let gains: Vec<f32> = samples.iter().map(|s| settings.weight_of_squared_error(s.tau_hat)).collect();
        let tensor = |values: Vec<f32>, columns| Tensor::<2>::from_data(TensorData::new(values, [n, columns]), device);
        let net = LookAheadNet::from_weights(weights, device);
        let factors = draw.to_factors(&architecture, n, device);
        let outputs = net.forward(grid_tensor(&grids, n, device), Some(factors));
        let loss = loss::of_batch(settings, outputs, tensor(labels, 2), tensor(gains, 1));
        // A mean over the shard becomes the shard's share of the mean over the batch.
        let share = scale * n as f32;
        let (misfit, log_variance) = (loss.misfit * share, loss.log_variance * share);
        self.loss.misfit = misfit.clone().into_scalar();
        self.loss.log_variance = log_variance.clone().into_scalar();
        self.gradient = net.gradient(architecture, &(misfit + log_variance).backward());
    }
}
