"""The safety core: pure, and dependent on nothing but its own tables."""

from truck_bridge.safety.core import Safety, State
from truck_bridge.safety.tables import Axis, Driveline, Field, Heard, Limits, Measured, Table, Timing

__all__ = ["Axis", "Driveline", "Field", "Heard", "Limits", "Measured", "Safety", "State", "Table", "Timing"]
