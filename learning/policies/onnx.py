"""A network policy as an ONNX model, for runtimes without Python: all of `NetworkPolicy.act`, its scales and
the linear part included.

    s (n, obs) float32, k (n,) int64  ->  action (n, actions) float32
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...sims.errors import InputError
from .network import LIMIT, NetworkPolicy

if TYPE_CHECKING:
    from onnx import ModelProto, ValueInfoProto

OPSET, IR = 17, 8
"""Versions that a runtime of 2022 reads already; nothing here needs a later one."""


def onnx_model(policy: NetworkPolicy, about: str = "") -> ModelProto:
    """The policy, in single precision. about: a line for who opens it. Raises InputError without the package
    onnx."""
    try:
        from onnx import TensorProto, checker, helper, numpy_helper
    except ModuleNotFoundError:
        raise InputError("needs the package 'onnx': pip install 'warpdribble[onnx]'") from None

    net, states = policy.network, policy.M.shape[2]
    numbers: dict[str, np.ndarray | float] = {
        "mean": policy.mean,
        "scale": policy.scale,
        "least": -LIMIT,
        "most": LIMIT,
        "W1": net.W1,
        "e": net.e,
        "W2": net.W2,
        "b2": net.b2,
        "W3": net.W3,
        "b3": net.b3,
        "reach": policy.reach,
        "a_hat": policy.a_hat,
    }
    node = helper.make_node
    nodes = [
        node("Sub", ["s", "mean"], ["off"]),
        node("Div", ["off", "scale"], ["units"]),
        node("Clip", ["units", "least", "most"], ["x"]),
        node("MatMul", ["x", "W1"], ["W1 x"]),
        node("Gather", ["e", "k"], ["e_k"]),
        node("Add", ["W1 x", "e_k"], ["into 1"]),
        node("Elu", ["into 1"], ["h_1"]),
        node("Gemm", ["h_1", "W2", "b2"], ["into 2"]),
        node("Elu", ["into 2"], ["h_2"]),
        node("Gemm", ["h_2", "W3", "b3"], ["out"]),
        node("Mul", ["reach", "out"], ["added"]),
        node("Gather", ["a_hat", "k"], ["a_hat_k"]),
        node("Add", ["added", "a_hat_k"], ["without M" if states else "action"]),
    ]
    if states:
        numbers["M"] = policy.M
        whole = {"zero": [0], "states": [states], "one": [1], "two": [2]}
        numbers |= {name: np.array(value, np.int64) for name, value in whole.items()}
        nodes += [
            node("Gather", ["M", "k"], ["M_k"]),
            node("Slice", ["s", "zero", "states", "one"], ["first"]),
            node("Unsqueeze", ["first", "two"], ["column"]),
            node("MatMul", ["M_k", "column"], ["product"]),
            node("Squeeze", ["product", "two"], ["M_k s"]),
            node("Add", ["without M", "M_k s"], ["action"]),
        ]

    def told(name: str, kind: int, *shape: int) -> ValueInfoProto:
        return helper.make_tensor_value_info(name, kind, ["n", *shape])

    graph = helper.make_graph(
        nodes,
        "policy",
        [told("s", TensorProto.FLOAT, len(policy.mean)), told("k", TensorProto.INT64)],
        [told("action", TensorProto.FLOAT, policy.a_hat.shape[1])],
        [numpy_helper.from_array(_single(value), name) for name, value in numbers.items()],
        doc_string=about,
    )
    opset = helper.make_opsetid("", OPSET)
    model = helper.make_model(graph, producer_name="warpdribble", opset_imports=[opset], ir_version=IR)
    checker.check_model(model, full_check=True)
    return model


def _single(value: np.ndarray | float) -> np.ndarray:
    """Single precision, but for whole numbers."""
    array = np.asarray(value)
    return array if array.dtype == np.int64 else array.astype(np.float32)
