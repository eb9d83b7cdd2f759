"""Changes of parameters that a simulator takes: no truck weighs 110 t, whatever a fit asks for."""

from __future__ import annotations

from collections.abc import Mapping

from deeptruck_model.errors import InputError
from deeptruck_model.simulators import Simulator

HALVINGS = 12


def accepted(simulator: Simulator, changes: Mapping[str, float], near: float = 0.0) -> dict[str, float]:
    """The relative changes, each halved until the simulator takes the value, and those `near` it on both
    sides (relative)."""
    return {name: _accepted(simulator, name, change, near) for name, change in changes.items()}


def _accepted(simulator: Simulator, name: str, change: float, near: float) -> float:
    own = simulator.parameters().get(name)
    if own is None:
        return change  # not its own; a force stands for it
    for _ in range(HALVINGS):
        try:
            for value in (own * (1.0 + change) * (1.0 + side) for side in (-near, near)):
                simulator.with_parameters({name: value})
        except InputError:
            change /= 2.0
        else:
            return change
    return 0.0
