"""How the demand of one axis may move: envelope over speed, rate, jerk, and what last left."""

from __future__ import annotations

import math

from truck_bridge.safety.tables import SIGNED, Axis

TRUCK_M_S2 = 12.0  # no truck changes speed faster; the envelope follows the measured speed no faster either


class Motion:
    """One axis. `value` is the demand on the wire, `exact` the planned one behind it before rounding."""

    def __init__(self, axis: Axis) -> None:
        self.axis = axis
        self.counter: int | None = None
        self.data = b""
        self.start(axis.rest, 0.0, -math.inf)

    def start(self, demand: float, speed: float, now: float) -> None:
        """Begin at a demand (rest for NaN; or the nearest one inside the envelope), standing still."""
        demand = self.axis.rest if math.isnan(demand) else demand
        self.time = now - self.axis.period_s
        self.speed = speed
        low, high = self.envelope(speed, now)
        self.value = self.exact = min(max(demand, low), high)
        self.slew = 0.0
        self.releases = 0

    @property
    def at_rest(self) -> bool:
        return abs(self.value - self.axis.rest) <= self.axis.demand.scale

    def elapsed(self, now: float) -> float:
        """Time the demand has had to move: since the last frame, but never more than two periods."""
        return min(max(now - self.time, 0.5 * self.axis.period_s), 2 * self.axis.period_s)

    def envelope_speed(self, speed: float, now: float) -> float:
        """Measured speed, followed no faster than a truck can go."""
        step = TRUCK_M_S2 * self.elapsed(now)
        return min(max(speed, self.speed - step), self.speed + step)

    def envelope(self, speed: float, now: float) -> tuple[float, float]:
        """Lowest and highest demand at a measured speed."""
        limits, at = self.axis.limits, self.envelope_speed(speed, now)
        return between(at, limits.speed, limits.low), between(at, limits.speed, limits.high)

    # what to send

    def towards(self, demand: float, rate: float, speed: float, now: float) -> float:
        """The next demand on the way to `demand`, at most `rate` a second and within the jerk limit."""
        low, high = self.envelope(speed, now)
        distance = min(max(demand, low), high) - self.exact
        elapsed, jerk = self.elapsed(now), self.axis.limits.jerk
        bend = jerk * elapsed / 2
        stopping = math.sqrt(bend**2 + 2 * jerk * abs(distance)) - bend  # can still stop at the demand
        slew = math.copysign(min(stopping, abs(distance) / elapsed), distance)
        slew = min(max(slew, self.slew - jerk * elapsed), self.slew + jerk * elapsed)
        slew = min(max(slew, -rate), rate)
        return self._plan(min(max(self.exact + slew * elapsed, low), high))

    def towards_rest(self, speed: float, now: float) -> float:
        """The next demand of a graded release."""
        low, high = self.envelope(speed, now)
        step = self.axis.limits.fade * self.elapsed(now)
        value = min(max(self.axis.rest, self.exact - step), self.exact + step)
        return self._plan(min(max(value, low), high))

    def _plan(self, value: float) -> float:
        self._planned = value
        return value

    # what may leave

    def outside(self, value: float, speed: float, now: float) -> bool:
        """True when a demand lies outside the envelope by more than the rounding of the wire."""
        low, high = self.envelope(speed, now)
        return not low - self.axis.demand.scale / 2 <= value <= high + self.axis.demand.scale / 2

    def hasty(self, value: float, rate: float, speed: float, now: float) -> str:
        """'rate' or 'jerk' where a demand moves too fast, beyond the rounding of the wire; else nothing."""
        move, elapsed, quantum = value - self.value, self.elapsed(now), 1.01 * self.axis.demand.scale
        if abs(move) > rate * elapsed + quantum:
            return "rate"
        low, high = self.envelope(speed, now)
        inside = low + quantum < value < high - quantum  # at its edge the envelope's own motion goes first
        bend = abs(move - self.slew * elapsed)
        return "jerk" if inside and bend > self.axis.limits.jerk * elapsed**2 + quantum else ""

    def leaves_fade(self, value: float, now: float) -> bool:
        """True when a demand of a graded release moves away from rest, or too fast towards it."""
        quantum, rest = 1.01 * self.axis.demand.scale, self.axis.rest
        away = abs(value - rest) > abs(self.value - rest) + quantum
        return away or abs(value - self.value) > self.axis.limits.fade * self.elapsed(now) + quantum

    def falls(self, value: float, speed: float, now: float) -> bool:
        """True when a demand is nearer to rest than the last one, unless the envelope brings it there."""
        reach = max(map(abs, self.envelope(speed, now)))
        least = min(abs(self.value - self.axis.rest), reach)
        return abs(value - self.axis.rest) < least - 1.01 * self.axis.demand.scale

    def took(self, data: bytes, speed: float, now: float) -> None:
        """A frame left: remember it."""
        word = int.from_bytes(data, "little")
        released = word & SIGNED == self.axis.release
        value = self.axis.demand.read(word)
        self.value = self.axis.rest if released or value is None else value
        near = abs(self._planned - self.value) <= 0.51 * self.axis.demand.scale
        exact = self._planned if near else self.value  # rounding must not swallow steps below one bit
        self.slew = 0.0 if released else (exact - self.exact) / self.elapsed(now)
        self.speed = self.envelope_speed(speed, now)
        self.exact, self.time, self.data = exact, now, data
        self.counter = (word >> 56) & 0xF

    _planned: float = math.nan


def between(x: float, points: tuple[float, ...], values: tuple[float, ...]) -> float:
    """Linear between the points, constant outside."""
    for left in range(len(points) - 1):
        x0, x1 = points[left], points[left + 1]
        if x <= x1:
            return values[left] + (values[left + 1] - values[left]) * max(x - x0, 0.0) / (x1 - x0)
    return values[-1]
