"""Senders of the emulated truck's messages: controller, rate and signature as the vehicle file requires."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field

from truck_bridge.emulator.messages import SAYS, Truck
from truck_bridge.errors import InputError
from truck_bridge.j1939 import checksums
from truck_bridge.j1939.codec import Layout
from truck_bridge.safety import Heard
from truck_bridge.vehicles import Vehicle

UNSTATED_PERIOD_S = {"VDS": 0.1}  # periods of messages whose own is 'on request' or 'on change'; else 1 s


@dataclass
class Sender:
    """One broadcast message of one controller."""

    layout: Layout
    source: str
    address: int
    period_s: float
    check: str
    values: Callable[[], Mapping[str, float]] = field(repr=False)
    due: float = 0.0
    count: int = 0

    def frame(self) -> tuple[int, bytes]:
        """The next frame, with counter and checksum if the truck uses them."""
        can_id, data = (
            self.layout.can_id(self.address),
            self.layout.encode(_clipped(self.layout, self.values())),
        )
        if self.check != checksums.NONE:
            data = checksums.sign(self.check, can_id, data, self.count)
        self.count += 1
        return can_id, data


def voices(truck: Truck) -> Iterator[Sender]:
    """Every message with its senders: those from which the vehicle file expects it, else the usual one.

    Raises InputError if the file expects a message that no emulated controller sends.
    """
    vehicle = truck.vehicle
    received = {(vehicle.codec.by_pgn[one.key >> 8].name, one.key & 0xFF): one for one in vehicle.table.heard}
    for message, _ in received:
        if message not in SAYS:
            raise InputError(f"the ECU emulator does not speak {message}, which {vehicle.name} wants to hear")
    for message, (usual, _) in SAYS.items():
        addresses = [address for other, address in received if other == message]
        for address in addresses or _usual(vehicle, message, usual):
            yield _sender(truck, message, address, received.get((message, address)))


def _usual(vehicle: Vehicle, message: str, who: str) -> list[int]:
    spoken = who in vehicle.addresses and (message != "VDS" or vehicle.interface["grade"])
    return [vehicle.addresses[who]] if spoken else []


def _sender(truck: Truck, message: str, address: int, received: Heard | None) -> Sender:
    layout, says = truck.vehicle.codec[message], SAYS[message][1]
    names = {address: who for who, address in truck.vehicle.addresses.items()}
    period, check = layout.period_s or UNSTATED_PERIOD_S.get(message, 1.0), checksums.NONE
    if received is not None:
        period, check = received.period_s, received.check
    return Sender(layout, names[address], address, period, check, lambda: says(truck))


def _clipped(layout: Layout, values: Mapping[str, float]) -> dict[str, float]:
    """The values limited to the range of their signals, as a sensor saturates."""
    found = {}
    for key, value in values.items():
        signal = layout.signals[key]
        found[key] = min(max(value, signal.offset), signal.offset + signal.scale * signal.last)
    return found
