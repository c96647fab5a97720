//! The network arranged for CPUs: the values and gradients of [`LookAheadNet`](crate::network::LookAheadNet), several times as fast.
//!
//! Where the time goes, and what is done about it:
//!
//! * **First convolution.** The input is binary, so a row of the kernel meets one of 2^kernel patterns. Its answer is
//!   looked up in a table and the rows are added: no multiplication, and in uniform surroundings a quarter of it.
//! * **Pooling** keeps one of four neighbours before bias and `ReLU`, which change neither the winner nor the result.
//! * **Second convolution and dense layers** are matrix products (`faer`), channels last, so that a row of a kernel's
//!   window is one contiguous copy.
//!
//! Every sum runs in a fixed order that depends neither on threads nor on the neighbours in a batch; a caller that
//! wants answers independent of the batch calls with a constant number of rows.

mod encoder;
mod matrix;

use crate::network::architecture::{NetworkArchitecture, OUTPUTS};
use crate::network::dropout::DropoutDraw;
use crate::network::weights::Weights;
pub use encoder::TILE;
use encoder::{Encoder, EncoderTrace};
use faer::Accum;
use matrix::{product, rows};
use sim::sensing::OccupancyGrid;

/// Weights in the arrangement the forward pass wants; to be renewed when the weights change.
#[derive(Debug, Clone)]
pub struct Prepared {
    encoder: Encoder,
}

impl Prepared {
    /// Arranges the weights of the encoder (a few thousand values; the dense layers are used as they are).
    pub fn new(weights: &Weights) -> Self {
        Self { encoder: Encoder::new(weights) }
    }
}

/// Everything a forward pass leaves behind: the answer, and what the backward pass needs. Reused between calls.
#[derive(Debug, Clone, Default)]
pub struct Trace {
    encoder: EncoderTrace,
    /// `[batch, features]`, after dropout.
    features: Vec<f32>,
    /// `[batch, hidden]`, after dropout.
    hidden: Vec<f32>,
    /// `[batch, 4]`.
    outputs: Vec<f32>,
    /// `[batch, features]`: gradient.
    d_features: Vec<f32>,
    /// `[batch, hidden]`: gradient.
    d_hidden: Vec<f32>,
}

impl Trace {
    /// Raw outputs per sample: means of u and w, raw log-variances of both.
    pub fn outputs(&self) -> &[[f32; OUTPUTS]] {
        self.outputs.as_chunks().0
    }
}

/// Computes the raw outputs of a batch into `trace`.
///
/// `rows_in_all` ≥ number of grids: the dense layers are computed for this many rows, the surplus with whatever is left there.
/// A caller that wants the same answer whatever the number of grids passes a constant, and grids in multiples of
/// [`TILE`].
pub fn forward<'t>(
    weights: &Weights,
    prepared: &Prepared,
    grids: &[OccupancyGrid],
    rows_in_all: usize,
    dropout: Option<&DropoutDraw>,
    trace: &'t mut Trace,
) -> &'t [[f32; OUTPUTS]] {
    assert!(grids.len() <= rows_in_all, "{} grids do not fit into {rows_in_all} rows", grids.len());
    let architecture = weights.architecture();
    let (batch, features, hidden) = (rows_in_all, architecture.features(), architecture.hidden);
    let parts = weights.parts();
    trace.features.resize(batch * features, 0.0);
    trace.hidden.resize(batch * hidden, 0.0);
    trace.outputs.resize(batch * OUTPUTS, 0.0);

    prepared.encoder.forward(grids, parts.conv1_bias, parts.conv2_bias, &mut trace.features, &mut trace.encoder);
    if let Some(draw) = dropout {
        draw.apply_to_features(&mut trace.features);
    }

    product(Accum::Replace, &mut trace.hidden, rows(&trace.features, features), rows(parts.fc1_weight, hidden));
    for row in trace.hidden.chunks_exact_mut(hidden) {
        for (value, bias) in row.iter_mut().zip(parts.fc1_bias) {
            *value = (*value + bias).max(0.0);
        }
    }
    if let Some(draw) = dropout {
        draw.apply_to_hidden(&mut trace.hidden);
    }

    product(Accum::Replace, &mut trace.outputs, rows(&trace.hidden, hidden), rows(parts.fc2_weight, OUTPUTS));
    for row in trace.outputs.as_chunks_mut::<OUTPUTS>().0 {
        for (value, bias) in row.iter_mut().zip(parts.fc2_bias) {
            *value += bias;
        }
    }
    trace.outputs()
}

/// Writes the gradient of a loss to `gradient`, given its gradient by the raw outputs of the [`forward`] call that
/// filled `trace`.
pub fn backward(
    weights: &Weights,
    prepared: &Prepared,
    grids: &[OccupancyGrid],
    d_outputs: &[[f32; OUTPUTS]],
    dropout: Option<&DropoutDraw>,
    trace: &mut Trace,
    gradient: &mut Weights,
) {
    let architecture = weights.architecture();
    let (features, hidden) = (architecture.features(), architecture.hidden);
    let parts = weights.parts();
    let into = gradient.parts_mut();
    let d_outputs = d_outputs.as_flattened();
    trace.d_hidden.resize(trace.hidden.len(), 0.0);
    trace.d_features.resize(trace.features.len(), 0.0);

    // Last layer.
    product(Accum::Replace, into.fc2_weight, rows(&trace.hidden, hidden).transpose(), rows(d_outputs, OUTPUTS));
    column_sums(d_outputs, into.fc2_bias);
    product(Accum::Replace, &mut trace.d_hidden, rows(d_outputs, OUTPUTS), rows(parts.fc2_weight, OUTPUTS).transpose());

    // Dense layer. A unit that is 0 was cut off by ReLU or dropout; the others were scaled up by dropout.
    let scale = dropout.map_or(1.0, DropoutDraw::hidden_scale);
    gate(&mut trace.d_hidden, &trace.hidden, scale);
    product(
        Accum::Replace,
        into.fc1_weight,
        rows(&trace.features, features).transpose(),
        rows(&trace.d_hidden, hidden),
    );
    column_sums(&trace.d_hidden, into.fc1_bias);
    product(
        Accum::Replace,
        &mut trace.d_features,
        rows(&trace.d_hidden, hidden),
        rows(parts.fc1_weight, hidden).transpose(),
    );
    let scale = dropout.map_or(1.0, DropoutDraw::features_scale);
    gate(&mut trace.d_features, &trace.features, scale);

    prepared.encoder.backward(
        grids,
        &trace.d_features,
        &mut trace.encoder,
        into.conv1_weight,
        into.conv1_bias,
        into.conv2_weight,
        into.conv2_bias,
    );
}

/// Passes a gradient on, scaled, where the unit was alive.
fn gate(gradient: &mut [f32], activations: &[f32], scale: f32) {
    for (gradient, activation) in gradient.iter_mut().zip(activations) {
        *gradient = if *activation > 0.0 { *gradient * scale } else { 0.0 };
    }
}

/// Sums the rows of `values`.
fn column_sums(values: &[f32], sums: &mut [f32]) {
    sums.fill(0.0);
    for row in values.chunks_exact(sums.len()) {
        for (sum, value) in sums.iter_mut().zip(row) {
            *sum += value;
        }
    }
}

/// Floating point operations of one sample, forward and backward, as a plain implementation would count them.
pub fn training_flop(architecture: &NetworkArchitecture) -> usize {
    let conv1 = 2 * 25 * 25 * architecture.conv1.kernel.pow(2) * architecture.conv1.channels;
    let conv2 =
        2 * 12 * 12 * architecture.conv2.kernel.pow(2) * architecture.conv1.channels * architecture.conv2.channels;
    let dense = 2 * architecture.features() * architecture.hidden + 2 * architecture.hidden * OUTPUTS;
    2 * conv1 + 3 * (conv2 + dense)
}

#[cfg(test)]
mod tests;
