"""One controller: receives command messages (checks, arbitration, time-outs, return without a step); acts."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field

from truck_bridge.j1939 import checksums
from truck_bridge.vehicles import Transmitted

TIMEOUT_S = 0.1  # a controller forgets a demand that is not repeated; five TSC1 periods
RETURN_PER_S = 200.0  # demand units a second, back to the driver after a time-out
BAD_LIMIT = 3  # bad frames in a row before a source is ignored
GOOD_LIMIT = 10  # good ones in a row before it is received again


@dataclass
class _Source:
    """The demand of one source address on one controller."""

    demand: float = math.nan  # NaN: it hands back
    priority: int = 3
    received: float = -math.inf
    bad: int = 0
    good: int = GOOD_LIMIT
    counter: int | None = None


class Receiver:
    """Receiver of one command message in one controller."""

    def __init__(self, message: Transmitted) -> None:
        self._message = message
        self._sources: dict[int, _Source] = {}
        self._last = math.nan
        self._updated = -math.inf
        self.controlling = 0xFF

    def hear(self, can_id: int, data: bytes, now: float) -> None:
        """Process a frame that may be for this controller."""
        axis = self._message.axis
        if (can_id ^ axis.can_id) & 0x03FF_FF00:
            return
        source = self._sources.setdefault(can_id & 0xFF, _Source())
        if not self._sound(can_id, data, source):
            source.bad, source.good = source.bad + 1, 0
            return
        source.good += 1
        if source.good >= GOOD_LIMIT:
            source.bad = 0
        values = self._message.layout.decode(data).values
        active = all(
            values[key] == value for key, value in self._message.active.items() if key.endswith("Mode")
        )
        source.demand = values[self._message.demand] if active else math.nan
        source.priority = int(values.get("OverrideControlModePriority", values.get("XBRPriority", 2.0)))
        source.received = now

    def _sound(self, can_id: int, data: bytes, source: _Source) -> bool:
        kind = self._message.axis.check
        if len(data) != 8 or not checksums.verify(kind, can_id, data):
            return False
        if kind == checksums.NONE:
            return True
        before, source.counter = source.counter, data[7] & 0x0F
        return before is None or source.counter != before  # a repeated frame is a stuck sender

    def demand(self, now: float) -> float:
        """The present demand; NaN if there is none. After a time-out it returns to rest at RETURN_PER_S."""
        live = [
            (source.priority, -source.received, address, source.demand)
            for address, source in self._sources.items()
            if now - source.received <= TIMEOUT_S and not math.isnan(source.demand) and source.bad < BAD_LIMIT
        ]
        elapsed, self._updated = now - self._updated, now
        if live:
            _, _, self.controlling, self._last = min(live)
        elif not math.isnan(self._last):
            self.controlling = 0xFF
            step = RETURN_PER_S * elapsed
            handed_back = any(math.isnan(source.demand) for source in self._sources.values())
            self._last = math.copysign(max(abs(self._last) - step, 0.0), self._last)
            if handed_back or self._last == 0.0:
                self._last = math.nan
        return self._last


@dataclass
class Actuator:
    """What an actuator gives of the demand on it. Sound by default; set a field at any time for a fault.

    What its controller says on the bus, of whom it obeys and in which mode, stays that of the demand.
    """

    full: float  # greatest demand of the axis, signed, in its unit
    gain: float = 1.0  # share of the demand that it gives; 0: no answer
    late_s: float = 0.0  # by which it is late
    stuck: float = 0.0  # 1: it keeps giving what it gives now
    drags: float = 0.0  # share of `full` that it gives at least
    lost: float = 0.0  # 1: the frames that command it are lost on the wire
    given: float = 0.0  # now, in the unit of the axis
    _demands: deque[tuple[float, float]] = field(default_factory=deque, repr=False)  # time and demand

    def act(self, demand: float, now: float) -> None:
        """Time passes with this demand on it; NaN for none."""
        self._demands.append((now, 0.0 if math.isnan(demand) else demand))
        while len(self._demands) > 1 and self._demands[1][0] <= now - self.late_s + 1e-9:
            self._demands.popleft()
        if not self.stuck:
            least = self.drags * self.full
            given = self.gain * self._demands[0][1]
            self.given = min(given, least) if self.full < 0 else max(given, least)


FAULTS = ("gain", "late_s", "stuck", "drags", "lost")  # fields of an Actuator that make it faulty
