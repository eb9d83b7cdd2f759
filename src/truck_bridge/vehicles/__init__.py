"""Vehicles as YAML: what a truck speaks and obeys, checked on loading and turned into the core's tables."""

from truck_bridge.vehicles.loading import NAMES, load
from truck_bridge.vehicles.vehicle import Transmitted, Vehicle

__all__ = ["NAMES", "Transmitted", "Vehicle", "load"]
