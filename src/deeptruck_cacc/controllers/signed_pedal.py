"""Base of controllers that plan on a simulator of the truck: one signed pedal, 1 full engine, -1 full
brake.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deeptruck_cacc.controllers.law import Perception, Seen
from deeptruck_cacc.controllers.policy import Observation
from deeptruck_cacc.controllers.scaling import ActionScale
from deeptruck_core.arrays import Array
from deeptruck_core.signals import TruckInterface
from deeptruck_model.simulators import Simulator


@dataclass
class SignedPedal(ABC):
    """A policy whose subclasses implement `_pedal`, which returns a signed pedal. Same contract as Policy."""

    simulator: Simulator
    _past: Any = field(default=None, repr=False)

    def __post_init__(self) -> None:
        self.scale, self.dt = ActionScale.of(self.simulator), self.simulator.dt
        self._perceive = Perception(self.dt)
        self._least = -1.0 if self.interface.brake_unit else 0.0

    @property
    def interface(self) -> TruckInterface:
        """The interface of the simulator."""
        return self.simulator.interface

    def reset(self) -> None:
        """Forget the past."""
        self._perceive.reset()
        self._past = None

    def act(self, observation: Observation) -> tuple[Array, Array]:
        """(engine_command, brake_command) in the interface's units, each (batch,); NaN if an observation is
        NaN."""
        seen, grade = self._perceive(observation)
        known = np.isfinite(seen.speed + seen.gap + seen.leader_speed + seen.target_gap)
        pedal = self._pedal(observation, seen, grade, known)
        engine, brake = np.where(known[:, None], pedal_commands(self.scale, pedal), np.nan).T
        return engine, brake

    @abstractmethod
    def _pedal(self, observation: Observation, seen: Seen, grade: Array, known: NDArray[np.bool_]) -> Array:
        """The pedals (batch,), 0 for observations that are not `known` (batch,)."""


def pedal_commands(scale: ActionScale, pedal: Array) -> Array:
    """Commands (n, 2) in the interface's units for signed pedals (n,)."""
    return scale.commands(np.column_stack([2 * np.maximum(pedal, 0.0) - 1, -pedal]))
