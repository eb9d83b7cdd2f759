"""Whether a simulator is a deep truck, asked without the library that learns: another needs none."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, TypeGuard

from deeptruck_model.simulators import Simulator

if TYPE_CHECKING:
    from deeptruck_model.deep.truck import DeepTruck


def is_deep(simulator: Simulator) -> TypeGuard[DeepTruck]:
    """Whether it is a deep truck; then its library is loaded already."""
    room = sys.modules.get("deeptruck_model.deep.truck")
    return room is not None and isinstance(simulator, room.DeepTruck)
