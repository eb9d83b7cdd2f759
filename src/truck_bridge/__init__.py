"""Connects a controller to a truck by J1939, through a safety core.

    from truck_bridge import Bridge, load_vehicle

    vehicle = load_vehicle("trucksim")                 # a name that is shipped, or a path
    bridge = Bridge(vehicle, can.Bus(...))             # commands in, limited frames out

`decode` and `check` read CAN logs. Each name is loaded at its first use. Bad input raises `InputError`.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from truck_bridge.bridge import Bridge, Status
    from truck_bridge.can_logs import check, decode
    from truck_bridge.errors import InputError
    from truck_bridge.vehicles import Vehicle
    from truck_bridge.vehicles import load as load_vehicle

__all__ = ["Bridge", "InputError", "Status", "Vehicle", "check", "decode", "load_vehicle"]

_HOMES = {
    "Bridge": ("bridge", "Bridge"),
    "InputError": ("errors", "InputError"),
    "Status": ("bridge", "Status"),
    "Vehicle": ("vehicles", "Vehicle"),
    "check": ("can_logs", "check"),
    "decode": ("can_logs", "decode"),
    "load_vehicle": ("vehicles", "load"),
}


def __getattr__(name: str) -> Any:
    """Load a public name on first use; the safety core needs none of them, and no library."""
    if name not in _HOMES:
        raise AttributeError(f"module 'truck_bridge' has no attribute '{name}'")
    module, attribute = _HOMES[name]
    return getattr(import_module(f"truck_bridge.{module}"), attribute)
