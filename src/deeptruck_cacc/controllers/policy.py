"""The policy protocol, the trained network behind it, and its files. Needs no torch and no pickle."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import numpy as np
from safetensors.numpy import save as to_bytes

from deeptruck_cacc.controllers.scaling import OBSERVED, ActionScale, FeatureMap, paper_signals
from deeptruck_core import files, reading
from deeptruck_core.arrays import Array
from deeptruck_core.signals import TruckInterface

Observation = Mapping[str, Any]

TYPICAL = {"leader_speed": 20.0, "speed": 20.0, "gap": 40.0, "target_time_gap": 2.0, "grade": 0.0}
MANIFEST, WEIGHTS = "policy.json", "policy.safetensors"
POLICY = files.Result("a policy")


@runtime_checkable
class Policy(Protocol):
    """A car-following controller. Call `act` every `dt` seconds; `reset` before a new run.

    The observation has leader_speed, speed (m/s), gap (m), target_time_gap (s) and grade (ratio; optional),
    each a scalar or (batch,). Commands are (batch,) arrays in the units of `interface`. A NaN in the
    observation gives a NaN command; `guard.Guard` bridges missing signals.
    """

    @property
    def interface(self) -> TruckInterface: ...
    @property
    def dt(self) -> float: ...

    def reset(self) -> None:
        """Forget the past."""
        ...

    def act(self, observation: Observation) -> tuple[Array, Array]:
        """(engine_command, brake_command), each (batch,)."""
        ...


@dataclass
class MlpPolicy:
    """The mean of the paper's Gaussian MLP, with a feature map before it and an action scale after it.

    `layers` holds (weight (out, in), bias (out,)) pairs, with tanh between them and none after the last.
    `coverage` is the (low, high) of each signal in training; `card` is the model card (config, seed,
    simulator hash...).
    """

    layers: list[tuple[Array, Array]]
    features: FeatureMap
    scale: ActionScale
    interface: TruckInterface
    coverage: dict[str, tuple[float, float]] = field(default_factory=dict)
    card: dict[str, Any] = field(default_factory=dict)
    _memory: Array | None = field(default=None, repr=False)

    @property
    def dt(self) -> float:
        """Seconds between calls of `act`."""
        return self.features.dt

    def reset(self) -> None:
        """Forget the past."""
        self._memory = None

    def act(self, observation: Observation) -> tuple[Array, Array]:
        """(engine_command, brake_command) in the interface's units, each (batch,)."""
        signals = paper_signals(observation)
        if self._memory is None or len(self._memory) != len(signals):
            self._memory = self.features.start(len(signals))
        seen, memory = self.features(signals, self._memory)
        action = self.mean(seen)
        self._memory = self.features.remember(memory, action)
        commands = self.scale.commands(action)
        return commands[:, 0], commands[:, 1]

    def mean(self, features: Array) -> Array:
        """Mean action (batch, 2) before clipping, from features (batch, n)."""
        hidden = features
        for weight, bias in self.layers[:-1]:
            hidden = np.tanh(hidden @ weight.T + bias)
        weight, bias = self.layers[-1]
        return hidden @ weight.T + bias

    def save(self, path: str | Path, *, overwrite: bool = False) -> None:
        """Write a policy directory (policy.json, policy.safetensors), completely or not at all.

        Raises InputError if it cannot be written, and if `path` holds a policy and `overwrite` is not set.
        """
        with POLICY.replacing(Path(path), overwrite=overwrite) as draft:
            self.write(draft)

    def write(self, folder: Path) -> None:
        """Write policy.json and policy.safetensors into a folder, which is made if it does not exist."""
        tensors = {f"{k}.weight": np.ascontiguousarray(w) for k, (w, _) in enumerate(self.layers)}
        tensors |= {f"{k}.bias": np.ascontiguousarray(b) for k, (_, b) in enumerate(self.layers)}
        folder.mkdir(parents=True, exist_ok=True)
        # not by save_file: that leaves files which nobody else may read
        (folder / WEIGHTS).write_bytes(to_bytes(tensors))
        content = {**self._manifest(), "sha256": {WEIGHTS: reading.sha256(folder / WEIGHTS)}}
        (folder / MANIFEST).write_text(json.dumps(content, indent=2) + "\n")

    def _manifest(self) -> dict[str, Any]:
        units = {name: self.interface.unit(name) for name in self.interface.u}
        return {
            "kind": "mlp",
            "schema": 1,
            "dt": self.dt,
            "observation": {
                name: {"unit": unit}
                for name, unit in zip(OBSERVED, ("m/s", "m/s", "m", "s", "ratio"), strict=True)
            },
            "features": {"names": list(self.features.names), **self.features.to_dict()},
            "action": {"units": units, **asdict(self.scale)},
            "interface": self.interface.to_dict(),
            "hidden": [len(bias) for _, bias in self.layers[:-1]],
            "coverage": {name: list(limits) for name, limits in self.coverage.items()},
            "card": self.card,
        }
