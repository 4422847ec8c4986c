"""Export of an actor as an ONNX graph, for runtimes without Python."""

from typing import Any, Final

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

from agents.policy.actor import ACTIONS, Actor
from agents.policy.features import CUT, MAGNIFIED
from formation_env.task.observation import SIZE

OPSET: Final = 21
IR_VERSION: Final = 10
"""Understood by ONNX runtimes since 2024; all operators used here are older."""
ACTIVATIONS: Final = {"tanh": "Tanh", "relu": "Relu", "elu": "Elu"}


def to_onnx(actor: Actor) -> bytes:
    """Content of an ONNX file: input `observation` (N, SIZE), output `action` (N, 3), both float32."""
    nodes, constants = _begin(actor)
    value = "features"
    for index, layer in enumerate(actor.layers):
        names = (f"layers.{index}.weight", f"layers.{index}.bias")
        constants += [numpy_helper.from_array(part, name) for part, name in zip(layer, names, strict=True)]
        nodes.append(helper.make_node("Gemm", [value, *names], [f"sum.{index}"], transB=1))
        value = f"sum.{index}"
        if index < len(actor.layers) - 1:
            nodes.append(helper.make_node(ACTIVATIONS[actor.functions.activation], [value], [f"hidden.{index}"]))
            value = f"hidden.{index}"
    end_nodes, end_constants = _end(actor, value)
    graph = helper.make_graph(
        [*nodes, *end_nodes],
        "actor",
        [helper.make_tensor_value_info("observation", TensorProto.FLOAT, ["N", SIZE])],
        [helper.make_tensor_value_info("action", TensorProto.FLOAT, ["N", ACTIONS])],
        [*constants, *end_constants],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", OPSET)], ir_version=IR_VERSION)
    onnx.checker.check_model(model, full_check=True)
    return bytes(model.SerializeToString())


def _begin(actor: Actor) -> tuple[list[Any], list[Any]]:
    """Nodes and constants from the observation to the first layer's input, see `agents.policy.features`."""
    if actor.functions.magnification == 1:
        return [helper.make_node("Identity", ["observation"], ["features"])], []
    factors = np.ones(SIZE, np.float32)
    factors[MAGNIFIED] = actor.functions.magnification
    numbers = {"factors": factors, "least": np.float32(-CUT), "greatest": np.float32(CUT)}
    constants = [numpy_helper.from_array(np.asarray(number), name) for name, number in numbers.items()]
    nodes = [
        helper.make_node("Mul", ["observation", "factors"], ["magnified"]),
        helper.make_node("Clip", ["magnified", "least", "greatest"], ["features"]),
    ]
    return nodes, constants


def _end(actor: Actor, value: str) -> tuple[list[Any], list[Any]]:
    """Nodes and constants after the last layer: squash, then sign(z) |z|^p."""
    numbers = {"power": actor.functions.throttle_power}
    squash: tuple[str, list[str]] = ("Tanh", [value])
    if actor.functions.squash == "clip":
        squash = ("Clip", [value, "low", "high"])
        numbers = {"low": -1.0, "high": 1.0} | numbers
    constants = [numpy_helper.from_array(np.asarray(number, np.float32), name) for name, number in numbers.items()]
    nodes = [
        helper.make_node(*squash, ["z"]),
        helper.make_node("Sign", ["z"], ["sign"]),
        helper.make_node("Abs", ["z"], ["size"]),
        helper.make_node("Pow", ["size", "power"], ["thrust"]),
        helper.make_node("Mul", ["sign", "thrust"], ["action"]),
    ]
    return nodes, constants
