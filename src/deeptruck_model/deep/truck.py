"""A trained truck as a Simulator."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from deeptruck_core.errors import InputError
from deeptruck_core.signals import SPEED, TruckInterface
from deeptruck_model.deep import io
from deeptruck_model.deep.coverage import Coverage, Driven
from deeptruck_model.deep.kernels import inference
from deeptruck_model.deep.network import State, TruckNetwork
from deeptruck_model.recordings import Recording
from deeptruck_model.simulators import Array, Run


class DeepState(NamedTuple):
    """h, c (members, batch, hidden) float32; y (members, batch, n_y) is each member's next fed-back
    response."""

    h: NDArray[np.float32]
    c: NDArray[np.float32]
    y: Array


class Prediction(NamedTuple):
    """A free run with its uncertainty: y and low..high (batch, T, n_y), and where the truck is inside the
    coverage."""

    y: Array
    low: Array
    high: Array
    covered: NDArray[np.bool_]


class DeepTruck:
    """The mean of an ensemble of `network.shape.members` models, each fed its own response.

    `details` are the other entries of the manifest: config, seeds, data hash, calibration. `reference` are
    held-out recordings that give its error; `driven` holds samples of the training data.
    """

    def __init__(
        self,
        network: TruckNetwork,
        interface: TruckInterface,
        coverage: Coverage | None = None,
        details: Mapping[str, Any] | None = None,
        reference: tuple[Recording, ...] = (),
        driven: Driven | None = None,
    ) -> None:
        self.network, self.coverage = network.eval(), coverage
        self.reference, self.driven = reference, driven
        self.details: dict[str, Any] = dict(details or {})
        self._interface = interface
        self._packed = inference.pack(network)
        first = network.shape.controls + network.shape.conditions
        self._default_y = network.mean[first : network.shape.signals].numpy().astype(np.float64)

    @property
    def interface(self) -> TruckInterface:
        """The channels of u, w and y."""
        return self._interface

    @property
    def dt(self) -> float:
        """Step in s."""
        return self.network.dt

    def reset(self, y0: Array) -> DeepState:
        """Zero internal state. y0 (batch, n_y); NaN acceleration or fuel start at the training mean."""
        y0 = self._start(y0)
        members, hidden = self.network.shape.members, self.network.shape.hidden
        zeros = np.zeros((members, len(y0), hidden), np.float32)
        return DeepState(zeros, zeros, np.repeat(y0[None], members, axis=0))

    def step(self, state: DeepState, u: Array, w: Array) -> tuple[DeepState, Array]:
        """One step; u (batch, n_u), w (batch, n_w)."""
        u, w = np.ascontiguousarray(u, np.float64), np.ascontiguousarray(w, np.float64)
        h, c, y, mean = inference.step(self._packed, self.network.dt, state.h, state.c, state.y, u, w)
        return DeepState(h, c, y), mean

    def force(self, state: DeepState, y: Array) -> DeepState:
        """The state in which every member is next fed the recorded y (batch, n_y), or its own response where
        that is NaN."""
        recorded = np.ascontiguousarray(y, np.float64)
        return state._replace(y=inference.force(state.y, recorded))

    def rollout(self, u: Array, w: Array, y0: Array, recorded: Array | None) -> Run:
        """Free run from y0 (batch, n_y), or forced run with `recorded` (batch, T, n_y)."""
        return Run(self._run(u, w, y0, recorded)[0], {})

    def predict(self, u: Array, w: Array, y0: Array) -> Prediction:
        """Free run with calibrated 90 % intervals and the coverage flag.

        Raises InputError if the truck was never calibrated (training calibrates it).
        """
        calibration = self.details.get("calibration")
        if calibration is None:
            raise InputError(
                "this deep truck has no calibrated intervals; train it with 'deeptruck-model train'"
            )
        mean, spread = self._run(u, w, y0, None)
        half = half_width(calibration, spread, self.dt)
        return Prediction(mean, mean - half, mean + half, self.covers(mean, w))

    def auxiliary_outputs(self, u: Array, w: Array, recorded: Array) -> dict[str, Array]:
        """The auxiliary outputs (those of gear, engine speed and torque that were recorded in training) along
        forced runs: by name, (batch, T). u (batch, T, n_u), w (batch, T, n_w), recorded (batch, T, n_y)."""
        names: list[str] = self.details.get("auxiliary", [])
        y = np.concatenate([self._start(recorded[:, 0])[:, None], recorded[:, 1:]], axis=1)
        commands, conditions, fed = (
            torch.as_tensor(x, dtype=torch.float32) for x in (u[:, :-1], w[:, :-1], y)
        )
        with torch.no_grad():
            both = self.network.unfold(commands, conditions, fed, form="training")
        after = both[..., self.network.shape.responses :].mean(dim=0)
        whole = torch.cat([after[:, :1], after], dim=1).double().numpy()
        return {name: whole[..., i] for i, name in enumerate(names)}

    def spread(self, u: Array, w: Array, y0: Array) -> Array:
        """Standard deviation over the members of a free run, (batch, T, n_y); 0 for a single model."""
        return self._run(u, w, y0, None)[1]

    def covers(self, y: Array, w: Array) -> NDArray[np.bool_]:
        """True where the training data have speed, acceleration and grade near y (..., n_y), w (..., n_w)."""
        if self.coverage is None:
            return np.ones(y.shape[:-1], bool)
        return self.coverage.covers(y, w)

    def inside(self, state: DeepState) -> dict[str, Array]:
        """Empty: a deep truck has no named internal signals."""
        return {}

    def parameters(self) -> dict[str, float]:
        """Empty: a deep truck has no physical parameters."""
        return {}

    def with_parameters(self, values: Mapping[str, float]) -> DeepTruck:
        """Raises InputError for any name, because a deep truck has no physical parameters."""
        if values:
            raise InputError(
                f"a deep truck has no parameter '{next(iter(values))}'; it is retrained, not tuned"
            )
        return self

    def with_details(self, details: Mapping[str, Any]) -> DeepTruck:
        """The same truck with other manifest entries."""
        return DeepTruck(
            self.network,
            self.interface,
            self.coverage,
            {**self.details, **details},
            self.reference,
            self.driven,
        )

    def save(self, path: Path, *, overwrite: bool = False) -> None:
        """Write a simulator directory: simulator.json, model.safetensors and the coverage of its training
        data.

        An older deep truck is replaced only with `overwrite`. Raises InputError as `files.Result.check` does.
        """
        io.save(self, path, overwrite=overwrite)

    def torch_module(self) -> TorchTruck:
        """A differentiable copy of the truck; gradients flow to state, u and w."""
        return TorchTruck(self)

    def _run(self, u: Array, w: Array, y0: Array, recorded: Array | None) -> tuple[Array, Array]:
        u, w = (np.ascontiguousarray(x, dtype=np.float64) for x in (u, w))
        y0 = self._start(y0)
        known = np.zeros((1, 1, y0.shape[1])) if recorded is None else recorded
        known = np.ascontiguousarray(known, dtype=np.float64)
        mean, spread = inference.run(self._packed, self.network.dt, u, w, y0, known, recorded is not None)
        return mean, spread

    def _start(self, y0: Array) -> Array:
        y0 = np.array(y0, dtype=np.float64)
        unknown = np.isnan(y0)
        unknown[:, SPEED] = False
        return np.ascontiguousarray(np.where(unknown, self._default_y, y0))


class TorchTruck(torch.nn.Module):
    """(state, u, w) -> (state, y) in float32 with gradients, batched: u (batch, n_u), w (batch, n_w), y
    (batch, n_y)."""

    def __init__(self, truck: DeepTruck) -> None:
        super().__init__()
        self.network = copy.deepcopy(truck.network).requires_grad_(False)
        self.interface, self.dt = truck.interface, truck.dt

    def reset(self, y0: Tensor) -> State:
        """Zero internal state at y0 (batch, n_y)."""
        return self.network.initial(y0)

    def forward(self, state: State, u: Tensor, w: Tensor) -> tuple[State, Tensor]:
        """One step of dt."""
        state = self.network.step(state, u, w)
        return state, state.y.mean(dim=0)


def load_directory(path: Path, manifest: dict[str, Any]) -> DeepTruck:
    """The deep truck under `path`. Raises InputError with one line where a file is missing, damaged or does
    not fit."""
    return DeepTruck(*io.read(path, manifest))


def half_width(calibration: dict[str, Any], spread: Array, dt: float) -> Array:
    """Half width of the interval (batch, T, n_y) of runs with `spread` (batch, T, n_y); 0 at the start."""
    time = np.arange(spread.shape[1])[:, None] * dt
    floor, growth, factor = (np.asarray(calibration[key]) for key in ("floor", "growth", "factor"))
    half: Array = factor * np.sqrt(spread**2 + (floor + growth * np.sqrt(time)) ** 2)
    half[:, 0] = 0.0
    return half
