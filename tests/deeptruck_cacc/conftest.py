from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from deeptruck_cacc.training import validation
from deeptruck_core.errors import InputError
from deeptruck_core.signals import TruckInterface

TOY = TruckInterface("toy")


@dataclass(frozen=True)
class ToyTruck:
    """A point mass with first-order pedals: the identity case, whose best answer is known in closed form.

    a' = (command - a) / lag, command = engine / 1000 - 0.06 brake - 0.05 - 9.81 grade (m/s^2).
    """

    lag: float = 0.3
    mass_factor: float = 1.0
    interface: TruckInterface = TOY
    dt: float = 0.1

    def reset(self, y0: np.ndarray) -> np.ndarray:
        return y0[:, :2].copy()

    def step(self, state: np.ndarray, u: np.ndarray, w: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        grade = w[:, 0] if w.shape[1] else 0.0
        command = (u[:, 0] / 1000 - 0.06 * u[:, 1]) / self.mass_factor - 0.05 - 9.81 * grade
        wanted = state[:, 0] + self.dt / self.lag * (command - state[:, 0])
        speed = np.maximum(state[:, 1] + wanted * self.dt, 0.0)
        acceleration = (speed - state[:, 1]) / self.dt
        y = np.column_stack([acceleration, speed, np.maximum(u[:, 0], 0.0) / 100])
        return y[:, :2].copy(), y

    def force(self, state: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.where(np.isnan(y[:, :2]), state, y[:, :2])

    def inside(self, state: np.ndarray) -> dict[str, np.ndarray]:
        return {}

    def parameters(self) -> dict[str, float]:
        return {"lag": self.lag, "mass_factor": self.mass_factor}

    def with_parameters(self, values: Mapping[str, float]) -> ToyTruck:
        if set(values) - set(self.parameters()):
            raise InputError("unknown parameter")
        return replace(self, **values)

    def save(self, path: Path) -> None:
        raise NotImplementedError

    def torch_module(self) -> Any:
        return ToyModule(self)


class ToyModule(torch.nn.Module):
    """The same truck, differentiable: reset(y0) -> state, module(state, u, w) -> (state, y)."""

    def __init__(self, truck: ToyTruck) -> None:
        super().__init__()
        self.truck = truck

    def reset(self, y0: torch.Tensor) -> torch.Tensor:
        return y0[:, :2]

    def forward(
        self, state: torch.Tensor, u: torch.Tensor, w: torch.Tensor
    ) -> tuple[torch.Tensor, torch.Tensor]:
        t = self.truck
        command = (u[:, 0] / 1000 - 0.06 * u[:, 1]) / t.mass_factor - 0.05 - 9.81 * w[:, 0]
        wanted = state[:, 0] + t.dt / t.lag * (command - state[:, 0])
        speed = torch.clamp(state[:, 1] + wanted * t.dt, min=0.0)
        acceleration = (speed - state[:, 1]) / t.dt
        y = torch.stack([acceleration, speed, torch.clamp(u[:, 0], min=0.0) / 100], dim=1)
        return y[:, :2], y


@pytest.fixture(scope="module")
def quick_exams() -> Iterator[None]:
    """As quick_exam, for a whole module."""
    with _quick_exam():
        yield


@pytest.fixture
def quick_exam() -> Iterator[None]:
    """Validate on 4 s instead of 40, for tests of what is kept."""
    with _quick_exam():
        yield


@contextmanager
def _quick_exam() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        for name in ("EXAM_S", "SETTLED_S", "STEADY_S"):
            patch.setattr(validation, name, getattr(validation, name) / 10)
        yield


@pytest.fixture
def toy() -> ToyTruck:
    return ToyTruck()


@pytest.fixture
def make_toy() -> type[ToyTruck]:
    return ToyTruck


@pytest.fixture(scope="session")
def shared_toy() -> ToyTruck:
    return ToyTruck()
