"""A policy as ONNX: signals in physical units as inputs, commands in the interface's units as outputs, and
its memory.
"""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn

from deeptruck_cacc.controllers.policy import TYPICAL, MlpPolicy
from deeptruck_cacc.controllers.scaling import OBSERVED
from deeptruck_cacc.training.network import SeedBatch
from deeptruck_model.deep.onnx_export import write


def export_onnx(policy: MlpPolicy, path: str | Path) -> None:
    """Write `policy` as ONNX in float32 into a new file, completely or not at all.

    Inputs, each (batch, 1): the five signals of OBSERVED; and, for a policy with memory, memory (batch, 3, 6
    or 9), which starts as [0, NaN, NaN(, NaN, 0, 0(, NaN, NaN, NaN))]. Outputs (batch, 1): engine_command,
    brake_command; and memory_next with the shape of memory. The metadata entry `deeptruck` (JSON) has dt,
    units, interface, action, coverage, the memory's start and the card. Raises InputError for a file that
    exists or cannot be written.
    """
    start = policy.features.start(4)
    inputs = {name: TYPICAL[name] + torch.rand(4, 1) for name in OBSERVED[:4]} | {"grade": torch.zeros(4, 1)}
    outputs = ["engine_command", "brake_command"]
    if policy.features.memory:
        inputs["memory"] = torch.tensor(start, dtype=torch.float32)
        outputs.append("memory_next")
    facts = {
        "dt": policy.dt,
        "units": {name: policy.interface.unit(name) for name in policy.interface.u},
        "interface": policy.interface.to_dict(),
        "action": asdict(policy.scale),
        "coverage": policy.coverage,
        "memory": [None if np.isnan(x) else float(x) for x in start[0]],
        "card": policy.card,
    }
    axes = dict.fromkeys(inputs, 0)
    write(_Signals(policy), inputs, axes, outputs, {"deeptruck": json.dumps(facts)}, Path(path))


class _Signals(nn.Module):
    """A policy from the signals of OBSERVED."""

    def __init__(self, policy: MlpPolicy) -> None:
        super().__init__()
        self.batch = SeedBatch.of(policy)

    def forward(
        self,
        leader: Tensor,
        speed: Tensor,
        gap: Tensor,
        time_gap: Tensor,
        grade: Tensor,
        memory: Tensor | None = None,
    ) -> tuple[Tensor, ...]:
        signals = torch.cat([leader, speed, gap, speed * time_gap, grade], dim=1)
        action, after = self.batch(signals, signals[:, :0] if memory is None else memory)
        commands = self.batch.commands(action)
        engine, brake = commands[:, :1], commands[:, 1:]
        return (engine, brake) if memory is None else (engine, brake, after)
