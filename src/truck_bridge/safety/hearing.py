"""What the truck says: frames checked, signals with their age, and what they mean for control."""

from __future__ import annotations

import math
from collections import Counter, deque
from collections.abc import Mapping
from dataclasses import dataclass

from truck_bridge.safety.checks import checksum_ok, counter_ok
from truck_bridge.safety.tables import Heard, Measured, Table

NEVER = (math.nan, -math.inf, -math.inf)  # a signal that has not come yet; see Hearing._values
TOO_OFTEN = 1.75  # times the nominal rate: a second sender, or a flood
GRAVITY = 9.81  # m/s^2, restated: the core imports nothing
STEEP = 0.1  # rise over run that `Table.coasts_m_s2` has in it
UNHEARD_SLOPE = 0.06  # rise over run that may be there where the truck does not say
SLOPE_ERROR = 0.02
GIVES_LITTLE = 0.25  # share of the demanded braking or torque, below which an actuator does not answer
HARD_M_S2 = 1.5  # what `Axis.holds_beyond` gives
MOVES_M_S = 3.0  # below, a truck stops within the time that is judged


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
        self._by_group: dict[int, list[Heard]] = {}
        for heard in table.heard:
            self._by_group.setdefault(heard.key >> 8, []).append(heard)
        self._arrivals = {heard.key: _Arrivals() for heard in table.heard}
        # signal: value, time of reception, time since which it repeats that value
        self._values: dict[str, tuple[float, float, float]] = {}
        self.accepted: set[str] = set()  # signals that the last frame refreshed
        self._seconds: dict[str, float] = {}  # signals that an undeclared node sends too: when, last
        self._doubtful: dict[str, float] = {}  # contradictions, since when
        self._speeds = deque([(math.nan, math.nan)])  # time and value, back to `Timing.slowing` ago
        self._slowed = -math.inf  # when a demand of ours last slowed the truck, or may have
        self._braked = deque([(math.nan, 0.0)])  # time and share of `holds_beyond`, to `Timing.answer` ago

    def take(self, can_id: int, data: bytes, now: float) -> str:
        """Take a frame if it is one of ours to hear. Returns why control must fade, or nothing."""
        self.accepted = set()
        heard = self._messages.get(can_id & 0x03FF_FFFF)
        if heard is None:
            return self._second(can_id, data, now)
        if not self._sound(heard, can_id, data):
            return ""
        word = int.from_bytes(data, "little")
        for signal in heard.signals:
            value = _valid(signal, word)
            last, at, since = self._values.get(signal.name, NEVER)
            since = since if value == last else now
            elapsed = max(now - at, heard.period_s)
            if value is None:
                self._refuse(f"{signal.name} invalid")
            elif abs(value - last) > signal.fastest * elapsed + signal.field.scale:
                self._refuse(f"{signal.name} jumps")
            elif value - last > signal.rises * elapsed + signal.field.scale:
                self._refuse(f"{signal.name} jumps up")
            elif now - since > signal.still_s:
                self._refuse(f"{signal.name} stands still")
            else:
                self._values[signal.name] = (value, now, since)
                self.accepted.add(signal.name)
                if signal.name == "speed":
                    self._remember(value, now)
        return self._count(heard, now)

    def _remember(self, speed: float, now: float) -> None:
        """Keep a speed, and those since the newest that is `Timing.slowing` old."""
        self._speeds.append((now, speed))
        while now - self._speeds[1][0] >= self._table.timing.slowing:
            self._speeds.popleft()

    def _second(self, can_id: int, data: bytes, now: float) -> str:
        """A node that the table does not name: it may not send a signal that control depends on."""
        word, found = int.from_bytes(data, "little"), ""
        if len(data) == 8:
            for heard in self._by_group.get(can_id >> 8 & 0x3_FFFF, ()):
                for signal in heard.signals:
                    if _valid(signal, word) is not None:
                        found = f"{signal.name} from a second sender (0x{can_id & 0xFF:02X})"
                        self._refuse(found)
                        self._seconds[found] = now
        return found

    def seconds(self, now: float) -> list[str]:
        """Signals that an undeclared node sends too, heard of late."""
        return [what for what, at in self._seconds.items() if now - at <= self._table.timing.quiet]

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
        """Last valid value of a signal. NaN before the first, so that every comparison with it is False."""
        return self._values.get(name, NEVER)[0]

    def stale(self, now: float) -> list[str]:
        """Messages with a signal whose last valid value is older than the message's time-out."""
        return [
            heard.name
            for heard in self._table.heard
            if any(
                now - self._values.get(signal.name, NEVER)[1] > heard.timeout_s for signal in heard.signals
            )
        ]

    def forbids(self) -> list[str]:
        """Truck signals at a value that forbids control."""
        return [name for name, value in self._table.forbidden if self.value(name) == value]

    def doubts(self, now: float, demanded: Mapping[str, float]) -> dict[str, float]:
        """What contradicts what now, and for how long that may last, s. `demanded` is ours, by axis."""
        speed, ratio, line = self.value("speed"), self.value("gear_ratio"), self._table.driveline
        timing, found = self._table.timing, {}
        if abs(speed - self.value("second_speed")) > self._table.speed_gap_m_s:
            found["two wheel speeds"] = timing.persist
        if line is not None and ratio > 0 and self._coupled(now):
            turning = self.value("engine_speed") * line.metres_per_radian / ratio
            most = max(speed, turning)
            if most > line.above_m_s and abs(turning - speed) > line.tolerance * most + line.slack_m_s:
                found["wheel and engine speed"] = timing.persist
        if self._brakes_alone(now, demanded):
            found["slows without our demand"] = timing.persist
        if self._brake_is_silent(now, demanded):
            found["the brake does not answer"] = 0.0
        if self._shifting(now):
            return found
        for obeyed in self._table.obeyed:
            value, demand = self.value(obeyed.signal), abs(demanded.get(obeyed.axis, math.nan))
            deaf = demand > obeyed.from_demand and value != self._table.address
            if not math.isnan(value) and (deaf or value not in obeyed.explained):
                found[f"{obeyed.signal} is {value:g}"] = timing.unexplained
        for followed in self._table.followed:
            value, demand = self.value(followed.signal), demanded.get(followed.axis, math.nan)
            if not speed > followed.above_m_s:
                continue
            if (value - demand) / followed.beyond > 1:
                found[f"{followed.signal} beyond our demand"] = timing.unexplained
            elif demand > followed.beyond > 0 and value < GIVES_LITTLE * demand:
                found[f"{followed.signal} far below our demand"] = timing.weak
        return found

    def _slope(self, unheard: float) -> float:
        """m/s^2 by which the road slows the truck; that of a slope `unheard` where it is not on the bus."""
        pitch = self.value("pitch")
        slope = unheard if math.isnan(pitch) else math.sin(math.radians(pitch)) + SLOPE_ERROR * (unheard > 0)
        return GRAVITY * slope

    def _slowing(self, timing_s: float) -> float:
        """Mean deceleration over the last `Timing.slowing`, m/s^2; NaN before so long."""
        (then, before), (last, speed) = self._speeds[0], self._speeds[-1]
        return (before - speed) / (last - then) if last - then >= timing_s else math.nan

    def _brakes_alone(self, now: float, demanded: Mapping[str, float]) -> bool:
        """Whether the truck slows down more than anything but somebody else's brake explains."""
        timing = self._table.timing
        if not demanded or any(value < 0 if axis == "engine" else value for axis, value in demanded.items()):
            self._slowed = now
        most = self._table.coasts_m_s2 - GRAVITY * STEEP + self._slope(STEEP)
        return now - self._slowed >= timing.settle and self._slowing(timing.slowing) > most

    def _brake_is_silent(self, now: float, demanded: Mapping[str, float]) -> bool:
        """Whether the truck hardly slows although we have demanded what gives HARD_M_S2 and more."""
        timing, axes = self._table.timing, self._table.axes
        share = max(demanded.get(axis.name, 0.0) / axis.holds_beyond for axis in axes)
        self._braked.append((now, share))
        while now - self._braked[1][0] >= timing.answer:
            self._braked.popleft()
        if share <= 1 or not now - self._braked[0][0] >= timing.answer or not self.value("speed") > MOVES_M_S:
            return False
        asked = HARD_M_S2 * min(least for _, least in self._braked)
        least = GIVES_LITTLE * asked + self._slope(-UNHEARD_SLOPE)
        return asked > HARD_M_S2 and self._slowing(timing.slowing) < least

    def _shifting(self, now: float) -> bool:
        value, _, since = self._values.get("shifting", NEVER)
        return value == 1 and now - since <= self._table.timing.gear_change

    def _coupled(self, now: float) -> bool:
        """Driveline engaged, no gear change under way, converter locked where there is one."""
        return self.value("driveline") == 1 and not self._shifting(now) and self.value("lockup") != 0

    def lasting(self, doubts: Mapping[str, float], now: float) -> list[str]:
        """Which of these have lasted for so long, s, as they may; each is tested at every turn."""
        self._doubtful = {doubt: self._doubtful.get(doubt, now) for doubt in doubts}
        return [doubt for doubt, since in self._doubtful.items() if now - since >= doubts[doubt]]


def _valid(signal: Measured, word: int) -> float | None:
    """The number of a signal, or None where there is none or no truck can produce it."""
    value = signal.field.read(word)
    return value if value is not None and signal.low <= value <= signal.high else None
