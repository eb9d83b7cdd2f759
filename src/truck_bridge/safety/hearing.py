"""What the truck says: frames checked, signals with their age, and what they mean for control."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass

from truck_bridge.safety.checks import checksum_ok, counter_ok
from truck_bridge.safety.tables import Heard, Table

NEVER = (math.nan, -math.inf)  # value and time of a signal that has not come yet
TOO_OFTEN = 1.75  # times the nominal rate: a second sender, or a flood


@dataclass
class _Arrivals:
    """Frames of one message in the present second."""

    start: float = -math.inf
    count: int = 0
    counter: int | None = None


class Hearing:
    """Signals of the heard messages. A value that is not available or impossible does not refresh its
    signal.
    """

    def __init__(self, table: Table, refusals: Counter[str]) -> None:
        self._table = table
        self._refusals = refusals
        self._messages = {heard.key: heard for heard in table.heard}
        self._arrivals = {heard.key: _Arrivals() for heard in table.heard}
        self._values: dict[str, tuple[float, float]] = {}  # signal: value, time of reception
        self._doubtful: dict[str, float] = {}  # implausible pairs, since when

    def take(self, can_id: int, data: bytes, now: float) -> str:
        """Take a frame if it is one of ours to hear. Returns why control must fade, or nothing."""
        heard = self._messages.get(can_id & 0x03FF_FFFF)
        if heard is None:
            return ""
        if not self._sound(heard, can_id, data):
            return ""
        word = int.from_bytes(data, "little")
        for signal in heard.signals:
            value = signal.field.read(word)
            if value is None or not signal.low <= value <= signal.high:
                self._refusals[f"{signal.name} invalid"] += 1
            else:
                self._values[signal.name] = (value, now)
        return self._count(heard, now)

    def _sound(self, heard: Heard, can_id: int, data: bytes) -> bool:
        """Length, checksum and counter."""
        if len(data) != 8:
            return self._refuse(f"{heard.name} length")
        if heard.check == "none":
            return True
        arrivals, word = self._arrivals[heard.key], int.from_bytes(data, "little")
        if not checksum_ok(heard.check, can_id, word):
            return self._refuse(f"{heard.name} checksum")
        before, arrivals.counter = arrivals.counter, (word >> 56) & 0xF
        return counter_ok(heard.check, word, before) or self._refuse(f"{heard.name} counter")

    def _count(self, heard: Heard, now: float) -> str:
        arrivals = self._arrivals[heard.key]
        if now - arrivals.start >= 1.0:
            arrivals.start, arrivals.count = now, 0
        arrivals.count += 1
        if arrivals.count * heard.period_s <= TOO_OFTEN:
            return ""
        self._refuse(f"{heard.name} too often")
        return f"{heard.name} too often"

    def _refuse(self, reason: str) -> bool:
        self._refusals[reason] += 1
        return False

    def value(self, name: str) -> float:
        """Last valid value of a signal; NaN before the first, which compares as false with everything."""
        return self._values.get(name, NEVER)[0]

    def stale(self, now: float) -> list[str]:
        """Messages of which a signal has not come validly for longer than its time-out."""
        return [
            heard.name
            for heard in self._table.heard
            if any(
                now - self._values.get(signal.name, NEVER)[1] > heard.timeout_s for signal in heard.signals
            )
        ]

    def driver_acts(self) -> list[str]:
        """Driver signals at or above their threshold."""
        return [name for name, least in self._table.override if self.value(name) >= least]

    def forbids(self) -> list[str]:
        """Truck signals at a value that forbids control."""
        return [name for name, value in self._table.forbidden if self.value(name) == value]

    def implausible(self) -> list[str]:
        """Pairs of signals that contradict each other now."""
        speed, ratio, line = self.value("speed"), self.value("gear_ratio"), self._table.driveline
        found = []
        if abs(speed - self.value("second_speed")) > self._table.speed_gap_m_s:
            found.append("two wheel speeds")
        if line is not None and self._coupled() and ratio > 0 and speed > line.above_m_s:
            turning = self.value("engine_speed") * line.metres_per_radian
            if abs(turning - speed * ratio) > line.tolerance * speed * ratio:
                found.append("wheel and engine speed")
        return found

    def _coupled(self) -> bool:
        """Driveline engaged, no gear change under way, converter locked where there is one."""
        return self.value("driveline") == 1 and self.value("shifting") != 1 and self.value("lockup") != 0

    def persistently_implausible(self, now: float) -> list[str]:
        """Pairs that have contradicted each other for longer than a gear change or a jolt explains."""
        self._doubtful = {pair: self._doubtful.get(pair, now) for pair in self.implausible()}
        return [p for p, since in self._doubtful.items() if now - since >= self._table.timing.persist]
