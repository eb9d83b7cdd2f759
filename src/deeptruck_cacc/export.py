"""ONNX export: signals in physical units in, commands in the interface's units out, memory included."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import onnx
from numpy.typing import NDArray
from onnx import TensorProto, helper, numpy_helper

from deeptruck_cacc.policy import MlpPolicy
from deeptruck_cacc.scaling import OBSERVED

Array = NDArray[np.float64]


class _Graph:
    """Nodes and constants under construction; every method returns the name of its result."""

    def __init__(self) -> None:
        self.nodes: list[onnx.NodeProto] = []
        self.constants: list[onnx.TensorProto] = []

    def constant(self, value: Array | float | list[int]) -> str:
        integer = isinstance(value, list)
        name = f"c{len(self.constants)}"
        array = np.asarray(value, np.int64 if integer else np.float32)
        self.constants.append(numpy_helper.from_array(array, name))
        return name

    def add(self, kind: str, *inputs: str, output: str = "", **attributes: int) -> str:
        output = output or f"n{len(self.nodes)}"
        self.nodes.append(helper.make_node(kind, list(inputs), [output], **attributes))
        return output

    def columns(self, source: str, start: int, stop: int) -> str:
        return self.add("Slice", source, *(self.constant([k]) for k in (start, stop, 1)))  # along axis 1

    def clip(self, source: str, low: float, high: float) -> str:
        return self.add("Clip", source, self.constant(low), self.constant(high))


def export_onnx(policy: MlpPolicy, path: str | Path) -> None:
    """Write `policy` as ONNX (opset 17, float32), whole or not at all.

    Inputs, each (batch, 1): the five signals of OBSERVED; and, for a policy with memory, memory (batch, 3),
    which starts as [0, NaN, NaN]. Outputs (batch, 1): engine_command, brake_command; and memory_next
    (batch, 3).
    """
    g = _Graph()
    leader, speed, gap, time_gap, grade = OBSERVED
    target = g.add("Mul", speed, time_gap)
    signals = g.add("Concat", leader, speed, gap, target, grade, axis=1)
    f = policy.features
    features = g.add("Add", g.add("MatMul", signals, g.constant(f.matrix.T)), g.constant(f.offset))
    if f.memory:
        features = _remember(g, policy, signals, features)
    _command(g, policy, _network(g, policy, features))
    _write(g, policy, Path(path))


def _remember(g: _Graph, policy: MlpPolicy, signals: str, features: str) -> str:
    """FeatureMap's memory: features with the three slow ones behind them."""
    f = policy.features
    speeds, old = g.columns(signals, 0, 2), g.columns("memory", 1, 3)
    slow = g.add("Where", g.add("IsNaN", old), speeds, old)
    error = g.add("Sub", g.columns(signals, 2, 3), g.columns(signals, 3, 4))
    error = g.clip(error, -f.integral_clip_m, f.integral_clip_m)
    integral = g.add("Add", g.columns("memory", 0, 1), g.add("Mul", error, g.constant(f.dt)))
    integral = g.clip(integral, -f.integral_limit, f.integral_limit)
    rates = g.add("Div", g.add("Sub", speeds, slow), g.constant(f.slow_s))
    after = g.add("Add", slow, g.add("Mul", rates, g.constant(f.dt)))
    g.add("Concat", integral, after, output="memory_next", axis=1)
    scaled = g.add("Div", integral, g.constant(5.0)), g.add("Div", rates, g.constant(0.5))
    return g.add("Concat", features, *scaled, axis=1)


def _network(g: _Graph, policy: MlpPolicy, features: str) -> str:
    hidden = features
    for k, (weight, bias) in enumerate(policy.layers):
        hidden = g.add("Gemm", hidden, g.constant(weight), g.constant(bias), transB=1)
        hidden = hidden if k + 1 == len(policy.layers) else g.add("Tanh", hidden)
    return hidden


def _command(g: _Graph, policy: MlpPolicy, mean: str) -> None:
    """ActionScale."""
    s = policy.scale
    action = g.clip(mean, -1.0, 1.0)
    half = (s.engine_high - s.engine_low) / 2
    engine = g.add("Mul", g.columns(action, 0, 1), g.constant(half))
    g.add("Add", engine, g.constant(s.engine_low + half), output="engine_command")
    brake = g.add("Relu", g.columns(action, 1, 2))
    g.add("Mul", brake, g.constant(s.brake_high), output="brake_command")


def _write(g: _Graph, policy: MlpPolicy, path: Path) -> None:
    def port(name: str, width: int) -> onnx.ValueInfoProto:
        return helper.make_tensor_value_info(name, TensorProto.FLOAT, ["batch", width])

    inputs = [port(name, 1) for name in OBSERVED]
    outputs = [port("engine_command", 1), port("brake_command", 1)]
    if policy.features.memory:
        inputs.append(port("memory", 3))
        outputs.append(port("memory_next", 3))
    graph = helper.make_graph(g.nodes, "deeptruck_cacc", inputs, outputs, g.constants)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)
    units = {name: policy.interface.unit(name) for name in policy.interface.u}
    facts = {"dt": policy.dt, "units": units, "interface": policy.interface.to_dict(), "card": policy.card}
    helper.set_model_props(model, {"deeptruck": json.dumps(facts)})
    onnx.checker.check_model(model)
    path.parent.mkdir(parents=True, exist_ok=True)
    draft = path.with_name(f".{path.name}")
    onnx.save(model, draft)
    draft.replace(path)
