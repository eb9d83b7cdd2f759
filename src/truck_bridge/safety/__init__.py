"""The safety core: pure, and dependent on nothing but its own tables."""

from truck_bridge.safety.core import Safety, State
from truck_bridge.safety.hearing import Hearing
from truck_bridge.safety.tables import (
    Axis,
    Driveline,
    Field,
    Followed,
    Heard,
    Limits,
    Measured,
    Obeyed,
    Override,
    Table,
    Timing,
)

__all__ = [
    "Axis",
    "Driveline",
    "Field",
    "Followed",
    "Heard",
    "Hearing",
    "Limits",
    "Measured",
    "Obeyed",
    "Override",
    "Safety",
    "State",
    "Table",
    "Timing",
]
