"""A simulator of your own, as small as one can be: `python:examples.shuttle:make[:arguments.yaml]`.

    deeptruck-model check-simulator python:examples.shuttle:make

It needs nothing of this package but the interface, which says what its columns mean and in which units. Here
are one gear, air drag, rolling resistance and two pedals.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deeptruck_core.signals import TruckInterface

Array = NDArray[np.float64]

INTERFACE = TruckInterface("shuttle", engine_unit="N m", brake_unit="percent", grade=True, fuel=False)
AIR_DENSITY, GRAVITY = 1.2, 9.81  # kg/m^3, m/s^2
PER_NM = 4.0  # N at the road for one N m of the engine
FULL_BRAKE = 6.0  # m/s^2
BODY = {"mass": 20000.0, "drag_area": 6.0, "rolling_resistance": 0.006, "torque_gain": 1.0, "brake_gain": 1.0}


@dataclass(frozen=True)
class Shuttle:
    """A batch of trucks. The state is their speed, (batch,): a new array at every step."""

    body: Mapping[str, float]
    dt: float = 0.1  # s
    interface: TruckInterface = INTERFACE

    def reset(self, y0: Array) -> Array:
        """The state at acceleration and speed y0 (batch, 2)."""
        return y0[:, 1].copy()

    def step(self, state: Array, u: Array, w: Array) -> tuple[Array, Array]:
        """One step under u (batch, 2) on the slope w (batch, 1): the new state, and y (batch, 2)."""
        b = self.body
        engine = PER_NM * b["torque_gain"] * u[:, 0] / b["mass"]
        brake = FULL_BRAKE * b["brake_gain"] * u[:, 1] / 100.0
        drag = 0.5 * AIR_DENSITY * b["drag_area"] / b["mass"] * state**2
        slows = brake + drag + GRAVITY * b["rolling_resistance"]
        speed = np.maximum(state + (engine - slows - GRAVITY * w[:, 0]) * self.dt, 0.0)
        return speed, np.stack([(speed - state) / self.dt, speed], axis=1)

    def force(self, state: Array, y: Array) -> Array:
        """The state at a recorded response y (batch, 2); where that is NaN, the own one stays."""
        return np.where(np.isnan(y[:, 1]), state, y[:, 1])

    def parameters(self) -> dict[str, float]:
        """What the mismatch tool may refit."""
        return dict(self.body)

    def with_parameters(self, values: Mapping[str, float]) -> Shuttle:
        """A changed copy."""
        return replace(self, body={**self.body, **values})


def make(arguments: Mapping[str, Any] | None = None) -> Shuttle:
    """The factory. `arguments` are the lines of a YAML file, such as 'mass: 30000'."""
    return Shuttle({**BODY, **(arguments or {})})
