"""Approximate gradients for simulators without gradients: physics trucks and corrected trucks.

Every forward step is the simulator's. Only the backward pass uses a simple truck: the simulator's calibrated
pedal map and a first-order lag, started at every step from the simulator's true state. Its errors therefore
affect the gradient but do not accumulate along the path, and training minimises the true cost.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import torch
from torch import Tensor

from deeptruck_cacc.controllers.pedals import PedalMap
from deeptruck_core.constants import ROUNDED_GRAVITY
from deeptruck_core.signals import ACCELERATION, FUEL, SPEED, TruckInterface
from deeptruck_model.simulators import Simulator

LAG_S = 0.4  # of engine and brakes together; the gradient need not know it well


class LentState(NamedTuple):
    """The simulator's state, and acceleration and speed (batch,) with their gradient history."""

    inner: Any
    acceleration: Tensor
    speed: Tensor


@dataclass(frozen=True)
class LentGradient:
    """A Simulator with the `torch_module()` that the analytic trainer requires."""

    simulator: Simulator

    def __getattr__(self, name: str) -> Any:
        return getattr(self.simulator, name)

    @property
    def interface(self) -> TruckInterface:
        """The interface of the simulator."""
        return self.simulator.interface

    def torch_module(self) -> LentModule:
        """(state, u, w) -> (state, y), with the simulator's numbers and the pedal map's gradients."""
        return LentModule(self.simulator)


def with_gradient(simulator: Simulator) -> Simulator:
    """The simulator if it is differentiable, else the simulator with an approximate gradient."""
    return simulator if hasattr(simulator, "torch_module") else LentGradient(simulator)


class LentModule(torch.nn.Module):
    """Module of LentGradient. u (batch, n_u), w (batch, n_w), y (batch, n_y), float32."""

    def __init__(self, simulator: Simulator) -> None:
        super().__init__()
        self.simulator, self.dt = simulator, simulator.dt
        pedals = PedalMap.calibrate(simulator)
        scale = pedals.scale
        self.reach = scale.engine_low, scale.engine_high - scale.engine_low, max(scale.brake_high, 1e-12)
        self.first, self.step = float(pedals.speed[0]), float(pedals.speed[1] - pedals.speed[0])
        rows = [pedals.coast, pedals.full - pedals.coast, pedals.brake - pedals.coast]
        self.table = torch.stack([torch.tensor(row, dtype=torch.float32) for row in rows], dim=1)

    def reset(self, y0: Tensor) -> LentState:
        """The simulator's reset at y0 (batch, n_y)."""
        return LentState(
            self.simulator.reset(y0.double().numpy()), torch.zeros_like(y0[:, 0]), y0[:, SPEED].clone()
        )

    def forward(self, state: LentState, u: Tensor, w: Tensor) -> tuple[LentState, Tensor]:
        """One step of dt."""
        inner, y = self.simulator.step(state.inner, u.detach().double().numpy(), w.detach().double().numpy())
        true = torch.tensor(y, dtype=torch.float32)
        wanted = self._pedals(state.speed, u, w)
        acceleration = state.acceleration + (wanted - state.acceleration) * (self.dt / LAG_S)
        speed = state.speed + acceleration * self.dt
        acceleration = _as_true(acceleration, true[:, ACCELERATION])
        speed = _as_true(speed, true[:, SPEED])
        return LentState(inner, acceleration, speed), torch.stack(
            [acceleration, speed, *true[:, FUEL:].unbind(dim=1)], dim=1
        )

    def _pedals(self, speed: Tensor, u: Tensor, w: Tensor) -> Tensor:
        """Settled acceleration, m/s^2, (batch,), linear in both pedals."""
        at = ((speed - self.first) / self.step).clamp(0.0, len(self.table) - 1.001)
        low = at.detach().long()
        share = (at - low)[:, None]
        coast, engine, brake = (self.table[low] * (1 - share) + self.table[low + 1] * share).unbind(dim=1)
        least, span, full_brake = self.reach
        out = coast + engine * (u[:, 0] - least) / span
        if u.shape[1] > 1:
            out = out + brake * u[:, 1] / full_brake
        return out - ROUNDED_GRAVITY * w[:, 0] if w.shape[1] else out


def _as_true(estimate: Tensor, true: Tensor) -> Tensor:
    """The true value with the estimate's gradient."""
    return estimate + (true - estimate).detach()
