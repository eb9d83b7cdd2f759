"""Faults that forbid control, as the vehicle file defines them. Sends nothing; time is an argument."""

from __future__ import annotations

import math
from collections import Counter

from truck_bridge.faults import MOST, ActiveFaults, Fault
from truck_bridge.j1939 import diagnostics
from truck_bridge.j1939.diagnostics import DM1
from truck_bridge.j1939.transport import Broken, Transport
from truck_bridge.vehicles import Vehicle


class FaultWatch:
    """Pass every frame to `hear`; `blocking` returns the active faults that forbid control."""

    def __init__(self, vehicle: Vehicle) -> None:
        self._blocking, self._own = vehicle.blocking, vehicle.address
        self._names = {address: name for name, address in vehicle.addresses.items()}
        self._transport = Transport()
        self._faults, self._forbids = ActiveFaults(), ActiveFaults()  # all, and those that forbid control
        self._since = math.nan  # when listening began

    def hear(self, can_id: int, data: bytes, now: float) -> list[str]:
        """Process one frame. If it completes a DM1, returns the reported faults in words."""
        if can_id & 0xFF == self._own:
            return []  # what we report ourselves is no fault of the truck
        message = self._transport.hear(can_id, data, now) or diagnostics.single(can_id, data)
        report = diagnostics.report(message.data) if message and message.pgn == DM1 else None
        if message is None or report is None:
            return []
        self._faults.take(message.source, report, now)
        self._forbids.take(message.source, report.only(self._blocking.holds), now)
        return [self._named(Fault(message.source, what)) for what in report.active]

    def listen(self, now: float) -> None:
        """Advance time; the first call starts listening."""
        self._since = now if math.isnan(self._since) else self._since

    def active(self, now: float) -> list[str]:
        """All active faults, in words."""
        more = [f"{left} reports of others, beyond {MOST} at once"] if (left := self._faults.left_out) else []
        return [*(self._named(fault) for fault in self._faults.active(now)), *more]

    def blocking(self, now: float) -> list[str]:
        """Active faults that forbid control, in words."""
        return [f"fault: {self._named(fault)}" for fault in self._forbids.active(now)]

    def obstacles(self, now: float) -> list[str]:
        """Reasons why control cannot be given now: a fault, or too short a time of listening to
        exclude one."""
        found = self.blocking(now)
        least = self._blocking.listen_s
        if least and not now - self._since >= least:
            found.append(f"faults: listened for less than {least:g} s")
        return found

    def channels(self, now: float) -> dict[str, float]:
        """The values of deeptruck's fault channels."""
        return self._faults.channels(now)

    def finish(self) -> Counter[Broken]:
        """Number of multi-frame messages that are incomplete at the end of a log."""
        return self._transport.finish()

    def _named(self, fault: Fault) -> str:
        """Text such as 'SPN 110 FMI 16 (engine)'."""
        return f"{fault.what} ({self._names.get(fault.source, f'0x{fault.source:02X}')})"
