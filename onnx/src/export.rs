//! A trained network of ours as an ONNX file.

use crate::about::{self, About};
use crate::{INPUT, OUTPUT};
use policy::checkpoint::Checkpoint;
use policy::network::{ConvLayer, NetworkArchitecture, RESIDUAL_KERNEL};
use rten_onnx::onnx::{
    AttributeProto, AttributeType, DataType, Dimension, NodeProto, OperatorSetIdProto, StringStringEntryProto,
    TensorProto, TensorShapeProto, TypeProto, TypeProtoTensor, ValueInfoProto,
};
use rten_onnx::protobuf::{EncodeMessage, MessageWriter, ProtobufError, ValueWriter, WriteValue};
use sim::sensing::GRID_CELLS;
use std::cell::RefCell;

/// Operators of 2021, which every runtime in use knows.
const OPERATORS: i64 = 17;
/// Version of the format that came with them.
const FORMAT: i64 = 8;

/// The file: the network's own outputs for `[batch, 1, 25, 25]`. How they are used is written beside the graph ([`About`]) and
/// is not part of it.
pub fn export(checkpoint: &Checkpoint) -> Vec<u8> {
    file(checkpoint, None, layers(checkpoint.weights.architecture()))
}

/// The network's layers.
pub(crate) fn layers(architecture: NetworkArchitecture) -> Vec<NodeProto> {
    let mut nodes = vec![
        convolution("conv1", INPUT, architecture.conv1),
        max_pool("conv1", "pool1"),
        node("Relu", &["pool1"], "features1", Vec::new()),
    ];
    let map = residual(&mut nodes, "residual1", "features1", architecture.residual1, architecture.conv1.channels);
    nodes.extend([
        convolution("conv2", &map, architecture.conv2),
        max_pool("conv2", "pool2"),
        node("Relu", &["pool2"], "features2", Vec::new()),
    ]);
    let map = residual(&mut nodes, "residual2", "features2", architecture.residual2, architecture.conv2.channels);
    nodes.extend([
        node("Flatten", &[&map], "features", vec![integer("axis", 1)]),
        dense("fc1", "features", "fc1"),
        node("Relu", &["fc1"], "hidden", Vec::new()),
        dense("fc2", "hidden", OUTPUT),
    ]);
    nodes
}

/// Residual layers after `input`; the name of what the last of them answers.
fn residual(nodes: &mut Vec<NodeProto>, stage: &str, input: &str, layers: usize, channels: usize) -> String {
    let shape = ConvLayer { channels, kernel: RESIDUAL_KERNEL };
    (1..=layers).fold(input.to_owned(), |input, layer| {
        let name = format!("{stage}_{layer}");
        let [sum, output] = ["sum", "features"].map(|what| format!("{name}_{what}"));
        nodes.extend([
            convolution(&name, &input, shape),
            node("Add", &[&name, &input], &sum, Vec::new()),
            node("Relu", &[&sum], &output, Vec::new()),
        ]);
        output
    })
}

/// The file with these layers and the network's weights. `batch`: as many grids as are answered at once; free if `None`.
pub(crate) fn file(checkpoint: &Checkpoint, batch: Option<i64>, nodes: Vec<NodeProto>) -> Vec<u8> {
    let tensors = checkpoint.tensors().into_iter().map(|tensor| TensorProto {
        dims: tensor.shape.iter().map(|&length| length as i64).collect(),
        data_type: Some(DataType::FLOAT),
        raw_data: Some(RefCell::new(tensor.bytes)),
        name: Some(tensor.name),
        ..TensorProto::default()
    });
    let about = About::new(checkpoint.inference, checkpoint.conditions.clone());
    let model = ModelFile {
        graph: Graph {
            nodes,
            tensors: tensors.collect(),
            input: values(INPUT, batch, &[1, GRID_CELLS as i64, GRID_CELLS as i64]),
            output: values(OUTPUT, batch, &[checkpoint.weights.architecture().outputs() as i64]),
        },
        operators: OperatorSetIdProto { domain: Some(String::new()), version: Some(OPERATORS) },
        about: StringStringEntryProto { key: Some(about::KEY.to_owned()), value: Some(about.to_toml()) },
    };
    let mut bytes = Vec::new();
    model.encode(ValueWriter::new(&mut bytes)).expect("memory takes every byte");
    bytes
}

pub(crate) fn node(operator: &str, inputs: &[&str], output: &str, attribute: Vec<AttributeProto>) -> NodeProto {
    NodeProto {
        domain: None,
        name: Some(output.to_owned()),
        input: inputs.iter().map(|&name| name.to_owned()).collect(),
        output: vec![output.to_owned()],
        op_type: Some(operator.to_owned()),
        attribute,
    }
}

fn convolution(name: &str, input: &str, layer: ConvLayer) -> NodeProto {
    let (before, after) = layer.padding();
    let pads = [before, before, after, after].map(|cells| cells as i64);
    // Follows from the weight, but rten counts dimensions by it.
    let kernel = [layer.kernel as i64; 2];
    let attributes = vec![integers("kernel_shape", &kernel), integers("pads", &pads)];
    node("Conv", &[input, &weight(name), &bias(name)], name, attributes)
}

fn max_pool(input: &str, output: &str) -> NodeProto {
    node("MaxPool", &[input], output, vec![integers("kernel_shape", &[2, 2]), integers("strides", &[2, 2])])
}

fn dense(name: &str, input: &str, output: &str) -> NodeProto {
    node("Gemm", &[input, &weight(name), &bias(name)], output, vec![integer("transB", 1)])
}

fn weight(layer: &str) -> String {
    format!("{layer}.weight")
}

fn bias(layer: &str) -> String {
    format!("{layer}.bias")
}

pub(crate) fn integer(name: &str, i: i64) -> AttributeProto {
    let r#type = Some(AttributeType::INT);
    AttributeProto { name: Some(name.to_owned()), i: Some(i), r#type, ..AttributeProto::default() }
}

fn integers(name: &str, ints: &[i64]) -> AttributeProto {
    let r#type = Some(AttributeType::INTS);
    AttributeProto { name: Some(name.to_owned()), ints: ints.to_vec(), r#type, ..AttributeProto::default() }
}

/// Float32 `[batch, …]`.
fn values(name: &str, batch: Option<i64>, lengths: &[i64]) -> ValueInfoProto {
    let batch = Dimension { dim_value: batch, dim_param: batch.is_none().then(|| "batch".to_owned()) };
    let lengths = lengths.iter().map(|&length| Dimension { dim_value: Some(length), ..Dimension::default() });
    let shape = TensorShapeProto { dim: std::iter::once(batch).chain(lengths).collect() };
    let tensor_type = Some(TypeProtoTensor { elem_type: Some(DataType::FLOAT), shape: Some(shape) });
    ValueInfoProto { name: Some(name.to_owned()), r#type: Some(TypeProto { tensor_type, ..TypeProto::default() }) }
}

/// `ModelProto` of onnx.proto3. rten-onnx has one, but its graph has no name, which checkers of the format ask for.
struct ModelFile {
    graph: Graph,
    operators: OperatorSetIdProto,
    about: StringStringEntryProto,
}

impl EncodeMessage for ModelFile {
    fn encode_fields<W: WriteValue>(&self, fields: &mut MessageWriter<'_, W>) -> Result<(), ProtobufError> {
        fields.write_int64(1, FORMAT)?;
        fields.write_string(2, "lotpilot")?;
        fields.write_string(3, env!("CARGO_PKG_VERSION"))?;
        fields.write_message(7, &self.graph)?;
        fields.write_message(8, &self.operators)?;
        fields.write_message(14, &self.about)
    }
}

/// `GraphProto`.
struct Graph {
    nodes: Vec<NodeProto>,
    tensors: Vec<TensorProto>,
    input: ValueInfoProto,
    output: ValueInfoProto,
}

impl EncodeMessage for Graph {
    fn encode_fields<W: WriteValue>(&self, fields: &mut MessageWriter<'_, W>) -> Result<(), ProtobufError> {
        fields.write_repeated_message(1, &self.nodes)?;
        fields.write_string(2, "lotpilot")?;
        fields.write_repeated_message(5, &self.tensors)?;
        fields.write_message(11, &self.input)?;
        fields.write_message(12, &self.output)
    }
}
