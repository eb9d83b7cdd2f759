"""What other controllers demand of the truck beside us, held to what the vehicle file gives each of them.

J1939-71 has TSC1 for it (PGN 0). Byte 1 holds the override control mode (SPN 695, bits 1 and 2; 0 hands back,
1 is speed, 2 torque, 3 a limit of both), conditions (SPN 696) and priority (SPN 897). Bytes 2 and 3 hold the
requested speed (SPN 898), byte 4 torque (SPN 518), byte 5 transmission rate (SPN 3349). The rate is measured:
what a frame says of itself proves nothing.
"""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass

from truck_bridge.safety.tables import Allowed, Table

MODE = 0b11  # bits of byte 1 that hold the override control mode


@dataclass
class _Demand:
    """What one controller demands of one axis."""

    on: bool = False
    since: float = math.nan
    last: float = -math.inf  # the newest message that demands
    due: float = -math.inf  # the next message, at the least period


class Demands:
    """Times are those at which the core is asked: a message that waited comes up to `Timing.stall` late."""

    def __init__(self, table: Table, refusals: Counter[str]) -> None:
        self._table = table
        self._refusals = refusals
        self._demands = {allowed.key: (allowed, _Demand()) for allowed in table.allowed}
        self.refused = -math.inf  # when, last

    def take(self, can_id: int, data: bytes, now: float) -> str:
        """Judge a frame of another node. Returns why control must fade, or nothing."""
        key = can_id & 0x03FF_FFFF
        if not any((axis.can_id ^ key) & 0x03FF_FF00 == 0 for axis in self._table.axes):
            return ""
        if key not in self._demands:
            return self._refuse("another node commands the truck", now)
        allowed, demand = self._demands[key]
        reason = self._objection(allowed, demand, data[0] & MODE, now) if len(data) == 8 else "length"
        return self._refuse(f"{allowed.name}: {reason}", now) if reason else ""

    def _objection(self, allowed: Allowed, demand: _Demand, mode: int, now: float) -> str:
        if demand.due - now > self._table.timing.stall:
            return "too often"
        demand.due = max(demand.due, now) + allowed.period_s[0]
        demand.on = mode != 0
        if not demand.on:
            return ""
        if self._quiet(allowed, demand, now):
            demand.since = now  # a release within a shorter pause does not end the demand
        demand.last = now
        if mode not in allowed.modes:
            return f"control mode {mode}"
        return "too long" if now - demand.since > allowed.longest_s else ""

    def _quiet(self, allowed: Allowed, demand: _Demand, now: float) -> bool:
        return now - demand.last > allowed.period_s[1] + self._table.timing.stall

    def broken_off(self, now: float) -> list[str]:
        """Demands that were neither repeated in time nor handed back, each said once."""
        found = []
        for allowed, demand in self._demands.values():
            if demand.on and self._quiet(allowed, demand, now):
                demand.on = False
                found.append(self._refuse(f"{allowed.name}: not repeated in time", now))
        return found

    def _refuse(self, reason: str, now: float) -> str:
        self._refusals[reason] += 1
        self.refused = now
        return reason
