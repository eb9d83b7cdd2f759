"""The real vehicle's description, with the bridge's errors turned into ours."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from deeptruck_model.errors import InputError
from deeptruck_model.signals import TruckInterface
from truck_bridge import vehicles
from truck_bridge.errors import InputError as BridgeError


@contextmanager
def bridge_errors() -> Iterator[None]:
    """Raise the bridge's InputError as ours."""
    try:
        yield
    except BridgeError as error:
        raise InputError(str(error)) from None


def load(name: str) -> vehicles.Vehicle:
    """A vehicle by name or YAML file. Raises InputError."""
    with bridge_errors():
        return vehicles.load(name)


def interface(vehicle: vehicles.Vehicle) -> TruckInterface:
    """Its truck interface in our vocabulary."""
    return TruckInterface.from_dict(vehicle.interface)
