"""One step of a deep truck as an ONNX graph, for controllers and HIL rigs without Python.

Inputs h, c (members, batch, hidden), y (members, batch, n_y), u (batch, n_u), w (batch, n_w); outputs h_next,
c_next, y_next and `response`, the mean over members. A run starts with h = c = 0 and y = y0 for every member;
h_next, c_next and y_next are the next step's inputs.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import onnx
from onnx import ModelProto, numpy_helper, parser

from deeptruck_core import files
from deeptruck_model.deep.network import GEAR_OFFSET, GEAR_SPEED, REST_ACCELERATION, REST_SPEED, WEIGHTS
from deeptruck_model.deep.truck import DeepTruck

_STEP = """
<ir_version: 10, opset_import: ["" : 20]>
deeptruck_step (
  float[{members}, batch, {hidden}] h, float[{members}, batch, {hidden}] c, float[{members}, batch, {n_y}] y,
  float[batch, {n_u}] u, float[batch, {n_w}] w
) => (
  float[{members}, batch, {hidden}] h_next, float[{members}, batch, {hidden}] c_next,
  float[{members}, batch, {n_y}] y_next, float[batch, {n_y}] response
) {{
  uw = Concat <axis = 1> (u, w)
  y_shape = Shape (y)
  members_batch = Slice (y_shape, zero_i, two_i)
  tail = Constant <value_ints = [{n_uw}]> ()
  uw_shape = Concat <axis = 0> (members_batch, tail)
  uw_all = Expand (uw, uw_shape)
  signals = Concat <axis = 2> (uw_all, y)
  centred = Sub (signals, mean)
  scaled = Div (centred, scale)
  v = Slice (y, one_i, two_i, last_axis)
  shifted = Add (v, one)
  logarithm = Log (shifted)
  steps = Div (logarithm, code_width)
  from_centres = Sub (steps, code_centres)
  code = Tanh (from_centres)
  x = Concat <axis = 2> (scaled, code)
  from_x = MatMul (x, input)
  from_h = MatMul (h, recurrent)
  both = Add (from_x, from_h)
  gates = Add (both, bias)
  i_raw, f_raw, g_raw, o_raw = Split <axis = 2, num_outputs = 4> (gates)
  i = Sigmoid (i_raw)
  f = Sigmoid (f_raw)
  g = Tanh (g_raw)
  o = Sigmoid (o_raw)
  kept = Mul (f, c)
  entered = Mul (i, g)
  c_next = Add (kept, entered)
  c_tanh = Tanh (c_next)
  h_next = Mul (o, c_tanh)
  hidden_layer = MatMul (h_next, decoder)
  hidden_biased = Add (hidden_layer, decoder_bias)
  decoded = Tanh (hidden_biased)
  out = MatMul (decoded, output)
  out_biased = Add (out, output_bias)
{named}
  out_scaled = Mul (out_named, out_scale)
  raw = Add (out_scaled, out_mean)
  a = Slice (raw, zero_i, one_i, last_axis)
  gained = Mul (a, dt)
  moved = Add (v, gained)
  backwards = Less (moved, zero)
  slow = Less (moved, rest_speed)
  weak = Less (a, rest_acceleration)
  held = And (slow, weak)
  stands = Or (backwards, held)
  lost = Div (v, dt)
  stopping = Neg (lost)
  a_next = Where (stands, stopping, a)
  v_next = Where (stands, zero, moved)
  rest_raw = Slice (raw, one_i, outputs_i, last_axis)
  rest = Relu (rest_raw)
  y_next = Concat <axis = 2> (a_next, v_next, rest)
  response = ReduceMean <keepdims = 0> (y_next, zero_i)
}}
"""

_BLACK = "  out_named = Identity (out_biased)"
_GREY = """
  responses, gains_flat = Split <axis = 2> (out_biased, gain_split)
  gains = Reshape (gains_flat, gain_shape)
  share = Div (uw_all, share_scale)
  command = Slice (share, zero_i, one_i, last_axis)
  geared = Mul (command, gear_speed)
  reach = Add (v, gear_offset)
  gear_gain = Div (geared, reach)
  factors = Concat <axis = 2> (share, gear_gain)
  factors_each = Unsqueeze (factors, last_axis)
  effects = Mul (gains, factors_each)
  effect = ReduceSum <keepdims = 0> (effects, three_i)
  out_named = Add (responses, effect)
"""


def export(truck: DeepTruck, path: Path) -> ModelProto:
    """Write one step of `truck` to `path` (.onnx) and return the model; the interface is in its metadata.

    Raises InputError if the file cannot be written, and then leaves none.
    """
    model = build(truck)
    with files.new_file(path) as draft:
        draft.write_bytes(model.SerializeToString())
    return model


def build(truck: DeepTruck) -> ModelProto:
    """The ONNX model of one step."""
    shape, interface = truck.network.shape, truck.interface
    model = parser.parse_model(
        _STEP.format(
            members=shape.members,
            hidden=shape.hidden,
            n_u=shape.controls,
            n_w=shape.conditions,
            n_uw=shape.controls + shape.conditions,
            n_y=shape.responses,
            named=_GREY if shape.gains else _BLACK,
        )
    )
    used = {name for node in model.graph.node for name in node.input}
    constants = {name: array for name, array in _constants(truck).items() if name in used}
    model.graph.initializer.extend(numpy_helper.from_array(array, name) for name, array in constants.items())
    onnx.helper.set_model_props(model, {"interface": json.dumps(interface.to_dict()), "dt": str(truck.dt)})
    onnx.checker.check_model(model, full_check=True)
    return model


def _constants(truck: DeepTruck) -> dict[str, np.ndarray[Any, Any]]:
    network, shape = truck.network, truck.network.shape
    outputs, first = shape.responses - 1, shape.controls + shape.conditions
    columns = [first, *([first + 2] if outputs > 1 else [])]
    weights = {name: getattr(network, name).detach().numpy() for name in WEIGHTS}
    kept = np.r_[:outputs, shape.named : shape.outputs]  # the auxiliary outputs stay behind
    weights["output"] = weights["output"][..., kept]
    weights["output_bias"] = weights["output_bias"][..., kept]
    for name in ("bias", "decoder_bias", "output_bias"):
        weights[name] = weights[name][:, None]
    mean, scale = network.mean.numpy(), network.scale.numpy()
    width = math.log1p(network.top_speed) / max(1, shape.code)
    numbers = {
        "zero": 0.0,
        "one": 1.0,
        "dt": truck.dt,
        "rest_speed": REST_SPEED,
        "rest_acceleration": REST_ACCELERATION,
        "code_width": width,
        "gear_speed": GEAR_SPEED,
        "gear_offset": GEAR_OFFSET,
    }
    integers = {
        "zero_i": [0],
        "one_i": [1],
        "two_i": [2],
        "three_i": [3],
        "last_axis": [2],
        "outputs_i": [outputs],
        "gain_split": [outputs, outputs * shape.factors],
        "gain_shape": [0, 0, outputs, shape.factors],
    }
    arrays = {
        **weights,
        "mean": mean[: shape.signals],
        "scale": scale[: shape.signals],
        "code_centres": 0.5 + np.arange(shape.code),
        "out_mean": mean[columns],
        "out_scale": scale[columns],
        "share_scale": scale[:first],
        **numbers,
    }
    constants: dict[str, Any] = {name: np.asarray(value, np.float32) for name, value in arrays.items()}
    return constants | {name: np.array(value, np.int64) for name, value in integers.items()}
