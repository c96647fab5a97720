//! Gradients on CPUs, written by hand.

use super::cpu::{Answers, dense};
use super::flex::{self, contiguous, from_vec, values};
use super::ops::NetworkOps;
use burn::backend::autodiff::NodeId;
use burn::backend::autodiff::checkpoint::base::Checkpointer;
use burn::backend::autodiff::checkpoint::strategy::CheckpointStrategy;
use burn::backend::autodiff::grads::Gradients;
use burn::backend::autodiff::ops::{Backward, Ops, OpsKind};
use burn::backend::flex::FlexTensor;
use burn::backend::tensor::{BoolTensor, FloatTensor};
use burn::backend::{Autodiff, Flex, TensorMetadata as _};
use std::sync::Arc;

impl<C: CheckpointStrategy> NetworkOps for Autodiff<Flex, C> {
    fn first_layer(
        occupied: BoolTensor<Self>,
        weight: FloatTensor<Self>,
        bias: FloatTensor<Self>,
    ) -> FloatTensor<Self> {
        let nodes = [&weight, &bias].map(FloatTensor::<Self>::node);
        let [weight, bias] = [weight, bias].map(|tensor| contiguous(tensor.into_primitive()));
        match First.prepare::<C>(nodes).compute_bound().stateful() {
            OpsKind::UnTracked(prepared) => prepared.finish(Flex::first_layer(occupied, weight, bias)),
            OpsKind::Tracked(prepared) => {
                let occupied = contiguous(occupied);
                let Answers { y, chosen } = flex::first(&weight, &bias).forward(occupied.bytes(), true);
                let y = flex::batch_of(y, &occupied);
                prepared.finish(Trace { x: occupied, weight, bias, chosen: Arc::new(chosen) }, y)
            }
        }
    }

    fn residual_layer(x: FloatTensor<Self>, weight: FloatTensor<Self>, bias: FloatTensor<Self>) -> FloatTensor<Self> {
        let nodes = [&x, &weight, &bias].map(FloatTensor::<Self>::node);
        let [x, weight, bias] = [x, weight, bias].map(|tensor| contiguous(tensor.into_primitive()));
        match Residual.prepare::<C>(nodes).compute_bound().stateful() {
            OpsKind::UnTracked(prepared) => prepared.finish(Flex::residual_layer(x, weight, bias)),
            OpsKind::Tracked(prepared) => {
                let Answers { y, chosen } = flex::residual(&x, &weight, &bias).forward(values(&x), true);
                let y = flex::batch_of(y, &x);
                prepared.finish(Trace { x, weight, bias, chosen: Arc::new(chosen) }, y)
            }
        }
    }

    fn second_layer(x: FloatTensor<Self>, weight: FloatTensor<Self>, bias: FloatTensor<Self>) -> FloatTensor<Self> {
        let nodes = [&x, &weight, &bias].map(FloatTensor::<Self>::node);
        let [x, weight, bias] = [x, weight, bias].map(|tensor| contiguous(tensor.into_primitive()));
        match Second.prepare::<C>(nodes).compute_bound().stateful() {
            OpsKind::UnTracked(prepared) => prepared.finish(Flex::second_layer(x, weight, bias)),
            OpsKind::Tracked(prepared) => {
                let Answers { y, chosen } = flex::second(&weight, &bias).forward(values(&x), true);
                let y = flex::batch_of(y, &x);
                prepared.finish(Trace { x, weight, bias, chosen: Arc::new(chosen) }, y)
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

/// What the forward pass of a convolution leaves for the backward pass.
#[derive(Debug, Clone)]
struct Trace {
    x: FlexTensor,
    weight: FlexTensor,
    bias: FlexTensor,
    chosen: Arc<Vec<u32>>,
}

/// Backward pass of the first layer. Its parents are the weights; cells have no gradient.
#[derive(Debug)]
struct First;

impl Backward<Flex, 2> for First {
    type State = Trace;

    fn backward(self, ops: Ops<Self::State, 2>, grads: &mut Gradients, _: &mut Checkpointer) {
        let d_y = contiguous(grads.consume::<Flex>(&ops.node));
        let Trace { x, weight, bias, chosen } = &ops.state;
        let found = flex::first(weight, bias).backward(x.bytes(), chosen, values(&d_y));
        let [of_weight, of_bias] = ops.parents.map(|parent| parent.map(|node| node.id));
        register(grads, [(of_weight, found.weight, weight), (of_bias, found.bias, bias)]);
    }
}

/// Backward pass of a residual layer. Its parents are x, weight and bias.
#[derive(Debug)]
struct Residual;

impl Backward<Flex, 3> for Residual {
    type State = Trace;

    fn backward(self, ops: Ops<Self::State, 3>, grads: &mut Gradients, _: &mut Checkpointer) {
        let d_y = contiguous(grads.consume::<Flex>(&ops.node));
        let Trace { x, weight, bias, chosen } = &ops.state;
        let found = flex::residual(x, weight, bias).backward(values(x), chosen, values(&d_y));
        let [of_x, of_weight, of_bias] = ops.parents.map(|parent| parent.map(|node| node.id));
        register(grads, [(of_x, found.x, x), (of_weight, found.weight, weight), (of_bias, found.bias, bias)]);
    }
}

/// Backward pass of the second layer. Its parents are x, weight and bias.
#[derive(Debug)]
struct Second;

impl Backward<Flex, 3> for Second {
    type State = Trace;

    fn backward(self, ops: Ops<Self::State, 3>, grads: &mut Gradients, _: &mut Checkpointer) {
        let d_y = contiguous(grads.consume::<Flex>(&ops.node));
        let Trace { x, weight, bias, chosen } = &ops.state;
        let found = flex::second(weight, bias).backward(values(x), chosen, values(&d_y));
        let [of_x, of_weight, of_bias] = ops.parents.map(|parent| parent.map(|node| node.id));
        register(grads, [(of_x, found.x, x), (of_weight, found.weight, weight), (of_bias, found.bias, bias)]);
    }
}

/// Registers gradients with the nodes that ask for them.
fn register<const N: usize>(grads: &mut Gradients, found: [(Option<NodeId>, Vec<f32>, &FlexTensor); N]) {
    for (parent, gradient, like) in found {
        if let Some(id) = parent {
            grads.register::<Flex>(id, from_vec(gradient, like.shape()));
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
