//! Gradients on CPUs, written by hand.

use super::cpu::dense;
use super::cpu::encoder::EncoderTrace;
use super::flex::{EncoderParameters, contiguous, from_vec, values};
use super::ops::NetworkOps;
use burn::backend::autodiff::checkpoint::base::Checkpointer;
use burn::backend::autodiff::checkpoint::strategy::CheckpointStrategy;
use burn::backend::autodiff::grads::Gradients;
use burn::backend::autodiff::ops::{Backward, Ops, OpsKind};
use burn::backend::flex::FlexTensor;
use burn::backend::tensor::{BoolTensor, FloatTensor};
use burn::backend::{Autodiff, Flex, TensorMetadata as _};
use std::sync::Arc;

impl<C: CheckpointStrategy> NetworkOps for Autodiff<Flex, C> {
    fn encode(
        occupied: BoolTensor<Self>,
        weight_1: FloatTensor<Self>,
        bias_1: FloatTensor<Self>,
        weight_2: FloatTensor<Self>,
        bias_2: FloatTensor<Self>,
    ) -> FloatTensor<Self> {
        let nodes = [&weight_1, &bias_1, &weight_2, &bias_2].map(FloatTensor::<Self>::node);
        let parameters = [weight_1, bias_1, weight_2, bias_2].map(FloatTensor::<Self>::into_primitive);
        match Encode.prepare::<C>(nodes).compute_bound().stateful() {
            OpsKind::UnTracked(prepared) => {
                let [weight_1, bias_1, weight_2, bias_2] = parameters;
                prepared.finish(Flex::encode(occupied, weight_1, bias_1, weight_2, bias_2))
            }
            OpsKind::Tracked(prepared) => {
                let parameters = EncoderParameters::new(parameters);
                let occupied = contiguous(occupied);
                let (features, trace) = parameters.weights().forward_traced(occupied.bytes());
                let features = from_vec(features, [occupied.shape()[0], parameters.weights().features_len()]);
                prepared.finish(Arc::new(EncodeState { parameters, trace }), features)
            }
        }
    }

    fn dense(x: FloatTensor<Self>, weight: FloatTensor<Self>, bias: FloatTensor<Self>) -> FloatTensor<Self> {
        let nodes = [&x, &weight, &bias].map(FloatTensor::<Self>::node);
        let [x, weight, bias] = [x, weight, bias].map(|tensor| contiguous(tensor.into_primitive()));
        match Dense.prepare::<C>(nodes).compute_bound().stateful() {
            OpsKind::UnTracked(prepared) => prepared.finish(Flex::dense(x, weight, bias)),
            OpsKind::Tracked(prepared) => {
                let y = Flex::dense(x.clone(), weight.clone(), bias);
                prepared.finish((x, weight), y)
            }
        }
    }

    fn tanh(x: FloatTensor<Self>) -> FloatTensor<Self> {
        let node = x.node();
        let y = Flex::tanh(x.into_primitive());
        match Tanh.prepare::<C>([node]).compute_bound().stateful() {
            OpsKind::UnTracked(prepared) => prepared.finish(y),
            OpsKind::Tracked(prepared) => prepared.finish(y.clone(), y),
        }
    }

    fn exp(x: FloatTensor<Self>) -> FloatTensor<Self> {
        let node = x.node();
        let y = Flex::exp(x.into_primitive());
        match Exp.prepare::<C>([node]).compute_bound().stateful() {
            OpsKind::UnTracked(prepared) => prepared.finish(y),
            OpsKind::Tracked(prepared) => prepared.finish(y.clone(), y),
        }
    }
}

/// Backward pass of the encoder. Its parents are the weights; cells have no gradient.
#[derive(Debug)]
struct Encode;

#[derive(Debug)]
struct EncodeState {
    parameters: EncoderParameters,
    trace: EncoderTrace,
}

impl Backward<Flex, 4> for Encode {
    type State = Arc<EncodeState>;

    fn backward(self, ops: Ops<Self::State, 4>, grads: &mut Gradients, _: &mut Checkpointer) {
        let d_features = contiguous(grads.consume::<Flex>(&ops.node));
        let EncodeState { parameters, trace } = &*ops.state;
        let found = parameters.weights().backward(trace, values(&d_features));
        let found = parameters.tensors([found.weight_1, found.bias_1, found.weight_2, found.bias_2]);
        for (parent, gradient) in ops.parents.into_iter().zip(found) {
            if let Some(node) = parent {
                grads.register::<Flex>(node.id, gradient);
            }
        }
    }
}

/// Backward pass of a dense layer. Its parents are x, weight and bias.
#[derive(Debug)]
struct Dense;

impl Backward<Flex, 3> for Dense {
    /// x and weight.
    type State = (FlexTensor, FlexTensor);

    fn backward(self, ops: Ops<Self::State, 3>, grads: &mut Gradients, _: &mut Checkpointer) {
        let d_y = contiguous(grads.consume::<Flex>(&ops.node));
        let (x, weight) = ops.state;
        let (inputs, outputs) = (weight.shape()[0], weight.shape()[1]);
        let [of_x, of_weight, of_bias] = ops.parents;
        if let Some(node) = of_x {
            let gradient = dense::d_x(values(&d_y), values(&weight), inputs, outputs);
            grads.register::<Flex>(node.id, from_vec(gradient, x.shape()));
        }
        if let Some(node) = of_weight {
            let gradient = dense::d_weight(values(&x), values(&d_y), inputs, outputs);
            grads.register::<Flex>(node.id, from_vec(gradient, weight.shape()));
        }
        if let Some(node) = of_bias {
            let gradient = dense::d_bias(values(&d_y), outputs);
            grads.register::<Flex>(node.id, from_vec(gradient, [outputs]));
        }
    }
}

/// Backward pass of the hyperbolic tangent; keeps what it answered.
#[derive(Debug)]
struct Tanh;

impl Backward<Flex, 1> for Tanh {
    type State = FlexTensor;

    fn backward(self, ops: Ops<Self::State, 1>, grads: &mut Gradients, _: &mut Checkpointer) {
        pass_back(ops, grads, |y| 1.0 - y * y);
    }
}

/// Backward pass of the exponential function; keeps what it answered.
#[derive(Debug)]
struct Exp;

impl Backward<Flex, 1> for Exp {
    type State = FlexTensor;

    fn backward(self, ops: Ops<Self::State, 1>, grads: &mut Gradients, _: &mut Checkpointer) {
        pass_back(ops, grads, |y| y);
    }
}

/// Gradients of a function of every value, from its slope where it answered `y`.
fn pass_back(ops: Ops<FlexTensor, 1>, grads: &mut Gradients, slope_at: impl Fn(f32) -> f32) {
    let d_y = contiguous(grads.consume::<Flex>(&ops.node));
    let y = contiguous(ops.state);
    if let [Some(node)] = ops.parents {
        let gradient = values(&d_y).iter().zip(values(&y)).map(|(d_y, y)| d_y * slope_at(*y)).collect();
        grads.register::<Flex>(node.id, from_vec(gradient, y.shape()));
    }
}
