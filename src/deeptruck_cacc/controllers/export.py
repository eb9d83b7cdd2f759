"""ONNX export of a policy: signals in physical units as input, commands in the interface's units as output,
and memory.
"""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

from deeptruck_cacc.controllers.onnx_policy import FACTS
from deeptruck_cacc.controllers.policy import MlpPolicy
from deeptruck_cacc.controllers.radar_filter import RadarFilter
from deeptruck_cacc.controllers.scaling import (
    ACCELERATION_UNIT,
    GAP_UNIT,
    INTEGRAL_UNIT,
    LEAST_SPEED,
    OBSERVED,
    POWER_UNIT,
    SPEED_HASTE,
    TIME_GAP_UNIT,
    TIME_GAPS,
    WANTED,
    ActionScale,
    FeatureMap,
)
from deeptruck_core import files
from deeptruck_core.arrays import Array
from deeptruck_core.constants import ROUNDED_GRAVITY


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
    """Write `policy` as ONNX (opset 17, float32) into a new file, completely or not at all.

    Inputs, each (batch, 1): the five signals of OBSERVED; and, for a policy with memory, memory (batch, 3, 6
    or 9), which starts as [0, NaN, NaN(, NaN, 0, 0(, NaN, NaN, NaN))]. Outputs (batch, 1): engine_command,
    brake_command; and memory_next with the shape of memory. Raises InputError for a file that exists or
    cannot be written.
    """
    g = _Graph()
    leader, speed, gap, time_gap, grade = OBSERVED
    target = g.add("Mul", speed, time_gap)
    f, track = policy.features, ""
    if f.radar:
        leader, gap, track = _track(g, f.radar, leader, speed, gap)
    signals = g.add("Concat", leader, speed, gap, target, grade, axis=1)
    features = g.add("Add", g.add("MatMul", signals, g.constant(f.matrix.T)), g.constant(f.offset))
    integral_and_slow = ""
    if f.memory:
        features, integral_and_slow = _recall(g, f, signals, features)
    action = g.clip(_network(g, policy, features), -1.0, 1.0)
    if f.memory:
        _remember(g, f, integral_and_slow, action, track)
    _command(g, policy.scale, action)
    _write(g, policy, Path(path))


def _track(g: _Graph, radar: RadarFilter, leader: str, speed: str, gap: str) -> tuple[str, str, str]:
    """`RadarFilter` as ONNX nodes: estimated leader speed and gap, and the next track."""
    seen, old = g.add("Concat", gap, leader, axis=1), g.columns("memory", 6, 9)
    off = g.add("Abs", g.add("Sub", seen, g.columns(old, 0, 2)))
    near = g.add("Less", off, g.constant(np.array([radar.lost_m, radar.lost_speed])))
    kept = g.add("And", g.columns(near, 0, 1), g.columns(near, 1, 2))
    still = g.add("Mul", leader, g.constant(0.0))
    track = g.add("Where", kept, old, g.add("Concat", seen, still, axis=1))
    error = g.add("Sub", seen, g.columns(track, 0, 2))
    track = g.add("Add", track, g.add("MatMul", error, g.constant(np.transpose(radar.gain))))
    gap, leader, pull = (g.columns(track, k, k + 1) for k in range(3))
    dt = g.constant(radar.dt)
    moved = g.add("Mul", g.add("Sub", leader, speed), dt), g.add("Mul", pull, dt)
    after = g.add("Add", gap, moved[0]), g.add("Add", leader, moved[1]), pull
    return leader, gap, g.add("Concat", *after, axis=1)


def _recall(g: _Graph, f: FeatureMap, signals: str, features: str) -> tuple[str, str]:
    """`FeatureMap` with memory as ONNX nodes: all features, and the next memory without the slow actions."""
    speeds, old = g.columns(signals, 0, 2), g.columns("memory", 1, 3)
    slow = g.add("Where", g.add("IsNaN", old), speeds, old)
    error = g.add("Sub", g.columns(signals, 2, 3), g.columns(signals, 3, 4))
    if f.power:
        ratio = g.add("Div", error, g.constant(f.knee_m))
        error = g.add("Div", error, g.add("Add", g.add("Mul", ratio, ratio), g.constant(1.0)))
    counted = g.clip(error, -f.integral_clip_m, f.integral_clip_m)
    integral = g.add("Add", g.columns("memory", 0, 1), g.add("Mul", counted, g.constant(f.dt)))
    integral = g.clip(integral, -f.integral_limit, f.integral_limit)
    rates = g.add("Div", g.add("Sub", speeds, slow), g.constant(f.slow_s))
    after = g.add("Add", slow, g.add("Mul", rates, g.constant(f.dt)))
    scaled = (
        g.add("Div", integral, g.constant(INTEGRAL_UNIT)),
        g.add("Div", rates, g.constant(ACCELERATION_UNIT)),
    )
    parts = [features, *scaled]
    kept = [integral, after]
    if f.power:
        ideal, pull, far = _ideal(g, f, signals)
        power = _power(g, f, signals, g.columns(rates, 1, 2), integral, (ideal, pull, far))
        parts += [*power, g.columns("memory", 4, 6)]
        kept.append(g.add("Add", ideal, g.add("Mul", pull, g.constant(f.dt))))
    return g.add("Concat", *parts, axis=1), g.add("Concat", *kept, axis=1)


def _remember(g: _Graph, f: FeatureMap, integral_and_slow: str, action: str, track: str) -> None:
    """`FeatureMap.remember` as ONNX nodes."""
    parts = [integral_and_slow]
    if f.power:
        slow = g.columns("memory", 4, 6)
        change = g.add("Mul", g.add("Sub", action, slow), g.constant(f.dt / f.slow_s))
        parts.append(g.add("Add", slow, change))
    parts += [track] if f.radar else []
    g.add("Concat", *parts, output="memory_next", axis=1)


def _time_gap(g: _Graph, signals: str) -> str:
    """`FeatureMap._time_gap` as ONNX nodes."""
    moving = g.add("Max", g.columns(signals, 1, 2), g.constant(LEAST_SPEED))
    return g.clip(g.add("Div", g.columns(signals, 3, 4), moving), *TIME_GAPS)


def _ideal(g: _Graph, f: FeatureMap, signals: str) -> tuple[str, str, str]:
    """`FeatureMap._ideal` as ONNX nodes."""
    leader, speed, gap = (g.columns(signals, k, k + 1) for k in range(3))
    time_gap = _time_gap(g, signals)
    if f.approach:
        far = g.add("Sub", gap, g.add("Mul", time_gap, leader))
        above, slope = _approach(g, far, time_gap, f.approach)
        pull = g.add("Mul", slope, g.add("Sub", leader, speed))
        return g.add("Add", leader, above), pull, g.add("Mul", gap, g.constant(0.0))
    old = g.columns("memory", 3, 4)
    ideal = g.add("Where", g.add("IsNaN", old), leader, old)
    far = g.add("Sub", gap, g.add("Mul", time_gap, ideal))
    return ideal, g.add("Div", g.add("Sub", leader, ideal), time_gap), far


def _approach(g: _Graph, far: str, time_gap: str, rate: float) -> tuple[str, str]:
    """`approach.approach` as ONNX nodes."""
    most = g.add("Mul", time_gap, g.constant(rate))
    knee, size = g.add("Mul", most, time_gap), g.add("Abs", far)
    way = g.add("Mul", g.add("Max", size, knee), g.constant(2 * rate))
    most = g.add("Sqrt", g.add("Sub", way, g.add("Mul", most, most)))
    above = g.add("Mul", most, g.clip(g.add("Div", far, knee), -1.0, 1.0))
    return above, g.add("Div", g.constant(rate), most)


def _power(
    g: _Graph, f: FeatureMap, signals: str, rate: str, integral: str, follower: tuple[str, str, str]
) -> list[str]:
    """`FeatureMap._power` as ONNX nodes, column by column; `follower` is the result of `_ideal`."""
    speed, gap, target, grade = (g.columns(signals, k, k + 1) for k in range(1, 5))
    moving, time_gap = g.add("Max", speed, g.constant(LEAST_SPEED)), _time_gap(g, signals)
    (ideal, pull, far), lasting = follower, g.add("Mul", integral, g.constant(f.integral_rate))
    behind = g.add("Sub", ideal, speed)
    closing = g.add("Mul", time_gap, g.constant(f.closing_share))
    closing = g.add("Add", closing, g.constant(f.closing_s))
    lasting = g.add("Div", lasting, time_gap)
    speeds = g.add("Mul", g.add("Add", behind, lasting), g.constant(SPEED_HASTE))
    errors = g.add("Add", speeds, g.add("Div", far, closing))
    wanted = g.clip(g.add("Add", pull, g.add("Div", errors, closing)), *WANTED)
    error = g.add("Sub", gap, target)
    slope = g.add("Mul", grade, g.constant(ROUNDED_GRAVITY))
    weight = g.add("Mul", speed, g.constant(1 / POWER_UNIT))
    late = g.add("Tanh", g.add("Mul", g.add("Div", error, moving), g.constant(1 / TIME_GAP_UNIT)))
    accelerations = [g.add("Mul", x, g.constant(1 / ACCELERATION_UNIT)) for x in (pull, wanted)]
    powers = [g.add("Mul", g.add("Add", x, slope), weight) for x in (wanted, rate)]
    far = g.add("Mul", far, g.constant(1 / GAP_UNIT))
    return [accelerations[0], behind, far, late, accelerations[1], *powers]


def _network(g: _Graph, policy: MlpPolicy, features: str) -> str:
    hidden = features
    for k, (weight, bias) in enumerate(policy.layers):
        hidden = g.add("Gemm", hidden, g.constant(weight), g.constant(bias), transB=1)
        hidden = hidden if k + 1 == len(policy.layers) else g.add("Tanh", hidden)
    return hidden


def _command(g: _Graph, s: ActionScale, action: str) -> None:
    """`ActionScale` as ONNX nodes."""
    half = g.constant(0.5)
    engine = g.add("Add", g.add("Mul", g.columns(action, 0, 1), half), half)
    brake = g.add("Relu", g.columns(action, 1, 2))
    if s.exclusive:
        rest = g.add("Sub", engine, brake)
        engine, brake = g.add("Relu", rest), g.add("Relu", g.add("Neg", rest))
    scaled = g.add("Mul", engine, g.constant(s.engine_high - s.engine_low))
    g.add("Add", scaled, g.constant(s.engine_low), output="engine_command")
    g.add("Mul", brake, g.constant(s.brake_high), output="brake_command")


def _write(g: _Graph, policy: MlpPolicy, path: Path) -> None:
    def port(name: str, width: int) -> onnx.ValueInfoProto:
        return helper.make_tensor_value_info(name, TensorProto.FLOAT, ["batch", width])

    inputs = [port(name, 1) for name in OBSERVED]
    outputs = [port("engine_command", 1), port("brake_command", 1)]
    if policy.features.memory:
        inputs.append(port("memory", policy.features.remembered))
        outputs.append(port("memory_next", policy.features.remembered))
    graph = helper.make_graph(g.nodes, "deeptruck_cacc", inputs, outputs, g.constants)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)
    units = {name: policy.interface.unit(name) for name in policy.interface.u}
    facts = {
        "dt": policy.dt,
        "units": units,
        "interface": policy.interface.to_dict(),
        "action": asdict(policy.scale),
        "coverage": policy.coverage,
        "memory": [None if np.isnan(x) else float(x) for x in policy.features.start(1)[0]],
        "card": policy.card,
    }
    helper.set_model_props(model, {FACTS: json.dumps(facts)})
    onnx.checker.check_model(model)
    with files.new_file(path) as draft:
        draft.write_bytes(model.SerializeToString())
