"""Vehicles as YAML: the messages a truck sends and obeys, checked on loading and converted to the core's
tables.
"""

from truck_bridge.vehicles.loading import NAMES, load
from truck_bridge.vehicles.vehicle import Transmitted, Vehicle

__all__ = ["NAMES", "Transmitted", "Vehicle", "load"]
