"""Hooks for a user's own physics: forces at the road, and filters on the commands."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from deeptruck_core.arrays import Array
from deeptruck_core.errors import InputError


class View:
    """What a force sees at a substep: live, read-only by convention, each (batch,) but `u` and `time`.

    acceleration is the last substep's. Forces are in N: traction_force positive forward; brake_force,
    drag_force, rolling_force and grade_force positive when they resist a forward motion. brake_force and
    rolling_force are what can act: at rest less may suffice. `u` (batch, 2) are the commands after the
    command filters, in the interface's units.
    """

    speed: Array
    acceleration: Array
    distance: Array
    elevation: Array
    gear: Array
    ratio: Array
    shifting: Array
    engine_speed: Array
    engine_torque: Array
    traction_force: Array
    brake_force: Array
    brake_temperature: Array
    drag_force: Array
    rolling_force: Array
    grade_force: Array
    mass: Array
    effective_mass: Array
    u: Array
    grade: Array
    time: float

    def __init__(self, records: NDArray[np.void], u: Array, grade: Array) -> None:
        for name in View.__annotations__:
            if name not in ("u", "grade", "time"):
                setattr(self, name, records[name])
        self.u, self.grade, self.time = u, grade, float(records["time"][0]) if len(records) else 0.0


@runtime_checkable
class Force(Protocol):
    """A longitudinal force at the road with a state of its own; copied (deepcopy) with the truck's state."""

    def reset(self, batch: int) -> None:
        """Start anew for a batch of trucks."""
        ...

    def force(self, view: View, dt: float) -> Array:
        """N, positive forward, (batch,), for a substep of dt seconds; advances the own state by dt."""
        ...


@runtime_checkable
class CommandFilter(Protocol):
    """Change of commands between sender and truck: delay, rate limit, quantisation."""

    def reset(self, batch: int) -> None:
        """Start anew for a batch of trucks."""
        ...

    def filter(self, u: Array, time: float, dt: float) -> Array:
        """Commands (batch, 2) as they take effect during the substep of dt seconds that starts at `time`."""
        ...


def total_force(forces: tuple[Force, ...], view: View, dt: float) -> Array:
    """Sum of all forces, (batch,). Raises InputError if one returns another shape."""
    total = np.zeros(len(view.speed))
    for force in forces:
        value = force.force(view, dt)
        if np.shape(value) not in ((), total.shape):
            raise InputError(
                f"force {type(force).__name__} returned shape {np.shape(value)}; it must return {total.shape}"
            )
        total += value
    return total
