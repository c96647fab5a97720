"""Microseconds per call of onnxruntime, one thread, on the network of lotpilot: python onnx_inference.py NETWORK BATCH..."""

import sys
import time

import numpy as np
import onnx
import onnxruntime
from onnx import TensorProto, helper, numpy_helper

NETWORKS = {"compact": (16, 3, 32, 3, 256), "paper": (32, 5, 64, 2, 1000)}


def model(name):
    c1, k1, c2, k2, hidden = NETWORKS[name]
    rng = np.random.default_rng(1)

    def weight(key, *shape):
        values = (rng.standard_normal(shape) * np.sqrt(2 / np.prod(shape[1:]))).astype(np.float32)
        return numpy_helper.from_array(values, key)

    def conv(x, y, key, k):
        before, after = (k - 1) // 2, k // 2
        return [
            helper.make_node("Conv", [x, key + "w", key + "b"], [y + "c"], pads=[before, before, after, after]),
            helper.make_node("MaxPool", [y + "c"], [y + "p"], kernel_shape=[2, 2], strides=[2, 2]),
            helper.make_node("Relu", [y + "p"], [y]),
        ]

    nodes = conv("x", "a", "c1", k1) + conv("a", "b", "c2", k2) + [
        helper.make_node("Flatten", ["b"], ["f"]),
        helper.make_node("Gemm", ["f", "f1w", "f1b"], ["g"], transB=1),
        helper.make_node("Relu", ["g"], ["h"]),
        helper.make_node("Gemm", ["h", "f2w", "f2b"], ["y"], transB=1),
    ]
    weights = [
        weight("c1w", c1, 1, k1, k1), weight("c1b", c1), weight("c2w", c2, c1, k2, k2), weight("c2b", c2),
        weight("f1w", hidden, 36 * c2), weight("f1b", hidden), weight("f2w", 4, hidden), weight("f2b", 4),
    ]
    graph = helper.make_graph(
        nodes, name,
        [helper.make_tensor_value_info("x", TensorProto.FLOAT, ["n", 1, 25, 25])],
        [helper.make_tensor_value_info("y", TensorProto.FLOAT, ["n", 4])], weights,
    )
    found = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)])
    found.ir_version = 9
    onnx.checker.check_model(found)
    return found.SerializeToString()


def main():
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    session = onnxruntime.InferenceSession(model(sys.argv[1]), options, providers=["CPUExecutionProvider"])
    for batch in map(int, sys.argv[2:]):
        x = (np.random.default_rng(2).random((batch, 1, 25, 25)) < 0.5).astype(np.float32)
        times, began = [], time.perf_counter()
        while time.perf_counter() - began < 5:
            start = time.perf_counter()
            session.run(None, {"x": x})
            times.append(time.perf_counter() - start)
        median = 1e6 * sorted(times)[len(times) // 2]
        print(f"onnxruntime {onnxruntime.__version__} {sys.argv[1]} batch {batch}: {median:.1f} us")


main()
