"""One step of a deep truck, or any torch module, as ONNX, for controllers and HIL rigs without Python."""

from __future__ import annotations

import copy
import json
import logging
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import torch
from onnx.reference import ReferenceEvaluator
from torch import Tensor, nn

from deeptruck_core import files
from deeptruck_model.deep.network import State
from deeptruck_model.deep.truck import DeepTruck


def export(truck: DeepTruck, path: Path) -> None:
    """Write one step of `truck` to the new file `path`, with its interface (JSON) and dt as metadata.

    Inputs h, c (members, batch, hidden), y (members, batch, n_y), u (batch, n_u), w (batch, n_w); outputs
    h_next, c_next, y_next and `response`, the mean of y_next over members. A run starts with h = c = 0 and
    y = y0 for every member; h_next, c_next and y_next are the next step's inputs. Raises InputError if the
    file exists or cannot be written.
    """
    shape = truck.network.shape
    columns = {"h": shape.hidden, "c": shape.hidden, "y": shape.responses}
    inputs = {name: torch.rand(shape.members, 4, count) for name, count in columns.items()}
    inputs |= {"u": torch.rand(4, shape.controls), "w": torch.zeros(4, shape.conditions)}
    facts = {"interface": json.dumps(truck.interface.to_dict()), "dt": str(truck.dt)}
    axes = dict.fromkeys(columns, 1) | {"u": 0, "w": 0}
    write(_Step(truck), inputs, axes, ("h_next", "c_next", "y_next", "response"), facts, path)


class _Step(nn.Module):
    def __init__(self, truck: DeepTruck) -> None:
        super().__init__()
        self.network = copy.deepcopy(truck.network).requires_grad_(False)

    def forward(self, h: Tensor, c: Tensor, y: Tensor, u: Tensor, w: Tensor) -> tuple[Tensor, ...]:
        state = self.network.step(State(h, c, y, y[..., :0]), u, w)  # auxiliary outputs are not fed back
        return state.h, state.c, state.y, state.y.mean(dim=0)


def write(
    module: nn.Module,
    inputs: Mapping[str, Tensor],
    batch_axes: Mapping[str, int],
    outputs: Sequence[str],
    facts: Mapping[str, str],
    path: Path,
) -> None:
    """Write `module`, which takes `inputs` in this order and returns a tuple of `outputs`, to the new file
    `path`, in float32 with `facts` as metadata.

    `inputs` are examples of 3 rows or more along `batch_axes`, whose number is free in the file. Raises
    InputError if the file exists or cannot be written, and AssertionError, before it is written, if the graph
    computes other numbers than the module.
    """
    files.check_new(path)
    batch = torch.export.Dim("batch")
    logging.getLogger("torch.onnx").setLevel(logging.ERROR)  # it warns of libraries that nothing here needs
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # torch's exporter uses what torch deprecates
        program = torch.onnx.export(
            module.eval(),
            tuple(inputs.values()),
            input_names=list(inputs),
            output_names=list(outputs),
            dynamic_shapes=tuple({axis: batch} for axis in batch_axes.values()),
            verbose=False,
        )
    assert program is not None  # only of other exporters
    model = program.model_proto
    onnx.helper.set_model_props(model, facts)
    few = {name: x.narrow(batch_axes[name], 0, 2) for name, x in inputs.items()}
    _check(model, few, [x.detach().numpy() for x in module(*few.values())])
    with files.new_file(path) as draft:
        draft.write_bytes(model.SerializeToString())


def _check(model: onnx.ModelProto, inputs: Mapping[str, Tensor], expected: Sequence[Any]) -> None:
    """Raises AssertionError if the graph does not compute the `expected` outputs from `inputs`."""
    onnx.checker.check_model(model, full_check=True)
    computed = ReferenceEvaluator(model).run(None, {name: x.numpy() for name, x in inputs.items()})
    for output, numbers, own in zip(model.graph.output, computed, expected, strict=True):
        np.testing.assert_allclose(numbers, own, rtol=1e-4, atol=1e-4, err_msg=f"ONNX output {output.name}")
