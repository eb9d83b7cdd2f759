"""The last thing between software and forty tonnes.

The promise. No frame leaves unless it is on the vehicle's list, well formed and within the limits of value,
rate and jerk at the present speed, and a person has engaged control on fresh, plausible signals. When the
driver acts, or anything control depends on is lost, control is handed back within one cycle or faded without
a step, and stays handed back until a person engages again.

Pure: no clock, no input or output; time (monotonic seconds) is an argument and frames come and go as
integers.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum

from truck_bridge.safety.checks import checksum_ok, counter_ok
from truck_bridge.safety.tables import SIGNED, Axis, Heard, Table


class State(Enum):
    """What may leave: nothing; claims; demands; demands on their way to rest; the frames that hand back."""

    SILENT = "silent"
    STANDBY = "standby"
    ENGAGED = "engaged"
    FADING = "fading"
    RELEASING = "releasing"


IN_CONTROL = (State.ENGAGED, State.FADING)


@dataclass
class _Sent:
    """What last left on an axis."""

    value: float  # demand as on the wire, or rest
    exact: float = math.nan  # the planned demand behind it, before rounding
    slew: float = 0.0  # unit/s
    time: float = -math.inf
    counter: int | None = None
    releases: int = 0
    data: bytes = b""


@dataclass
class _Rate:
    """Frames of one message in the present second."""

    start: float = -math.inf
    count: int = 0
    counter: int | None = None


class Safety:
    """See the module. Every refusal is counted by reason in `refusals`, every loss of control in `losses`."""

    def __init__(self, table: Table) -> None:
        self.table = table
        self.state = State.SILENT
        self.reason = ""  # why control was lost last; empty while engaged
        self.warning = ""  # what the driver must be told; stays until the next engagement or disarming
        self.refusals: Counter[str] = Counter()
        self.losses: Counter[str] = Counter()
        self._axes = {axis.can_id: axis for axis in table.axes}
        self._heard = {heard.key: heard for heard in table.heard}
        self._forget()

    def _forget(self) -> None:
        self._sent = {axis.name: _Sent(axis.rest) for axis in self.table.axes}
        self._rates = {heard.key: _Rate() for heard in self.table.heard}
        self._values: dict[str, tuple[float, float]] = {}  # signal: value, time of reception
        self._demands: dict[str, float] = {}
        self._commanded = -math.inf
        self._envelope_speed = 0.0
        self._since: dict[str, float] = {}  # implausible pairs: since when
        self._link = True
        self._now = -math.inf
        self._engaged_at = self._faded_at = -math.inf

    # -- the person and the controller

    @property
    def controls_allowed(self) -> bool:
        """The one bit: demands may leave."""
        return self.state in IN_CONTROL

    @property
    def linked(self) -> bool:
        """Bus and address are ours."""
        return self._link

    def arm(self, now: float) -> None:
        """From silent to standby: the address may be claimed and signals are heard; no demand leaves."""
        if self.state is State.SILENT:
            self._forget()
            self._now = now
            self.state = State.STANDBY

    def disarm(self) -> None:
        """Silent at once. Call it after a release has run out, or when the bus is gone."""
        if self.controls_allowed:
            self._lose("disarmed")
        self.state, self.warning = State.SILENT, ""

    def command(self, demands: Mapping[str, float], engaged: bool, now: float) -> bool:
        """The controller's demands by axis, and whether it believes to be engaged: its heartbeat.

        Refused (False) and answered with a graded release when a demand is NaN, missing or outside the
        envelope.
        """
        for axis in self.table.axes:
            demand = demands.get(axis.name, math.nan)
            low, high = self._widest(axis)
            if not low <= demand <= high:
                self.refusals[
                    "command not a number" if math.isnan(demand) else "command outside envelope"
                ] += 1
                self._demands = {}
                self._fade("command refused", now)
                return False
        self._demands, self._commanded = dict(demands), now
        if (
            self.state is State.ENGAGED
            and not engaged
            and now > self._engaged_at + self.table.timing.controller_timeout
        ):
            self._fade("controller not engaged", now)
        return True

    def engage(self, now: float, person: bool, lead_vehicle: bool) -> tuple[str, ...]:
        """Ask for control. Empty when granted, otherwise every reason why not."""
        obstacles = self.obstacles(now, lead_vehicle)
        if not person:
            obstacles = (*obstacles, "nobody asked: engaging needs a person")
        if obstacles:
            self.refusals["engagement"] += 1
            return obstacles
        for axis in self.table.axes:
            start = self.value(axis.start_from, axis.rest)
            low, high = self._envelope(axis)
            self._sent[axis.name] = _Sent(
                min(max(start, low), high), time=now - axis.period_s, counter=self._sent[axis.name].counter
            )
        self.state, self._engaged_at, self.reason, self.warning = State.ENGAGED, now, "", ""
        self._since = {}
        return ()

    def obstacles(self, now: float, lead_vehicle: bool) -> tuple[str, ...]:
        """Why control cannot be given now; empty when it can."""
        table = self.table
        found = [] if self.state is State.STANDBY else [f"not in standby but {self.state.value}"]
        if not self._link:
            found.append("no bus or no address")
        if not self._demands or now - self._commanded > table.timing.controller_timeout:
            found.append("no fresh command")
        found += [f"{heard.name} not fresh" for heard in table.heard if not self._fresh(heard, now)]
        found += [f"driver: {name}" for name, least in table.override if self.value(name, 0.0) >= least]
        found += [f"truck: {name}" for name, value in table.forbidden if self.value(name, -1.0) == value]
        found += [f"implausible: {pair}" for pair in self._implausible()]
        if table.needs_lead and not lead_vehicle:
            found.append("no vehicle ahead")
        low, high = table.engage_speed
        if not low <= self.value("speed", math.inf) <= high:
            found.append(f"speed outside {low:g}..{high:g} m/s")
        return tuple(found)

    def release(self, now: float, reason: str = "released") -> None:
        """Hand back at once: release frames on every axis, then silence."""
        if self.controls_allowed:
            self._lose(reason)
            self._let_go()

    def fade(self, now: float, reason: str) -> None:
        """Hand back gradually, for a cause outside the core (a node lost, a lead vehicle lost)."""
        self._fade(reason, now)

    def link(self, up: bool) -> None:
        """Bus off, interface unplugged, address lost (False), or all of them well again (True).

        Without a link nothing can be handed back in order, so control ends at once; a link that returns
        re-engages nothing.
        """
        if self._link and not up and self.state in (*IN_CONTROL, State.RELEASING):
            self._lose("link lost")
            self.state = State.STANDBY
        self._link = up

    # -- time

    def tick(self, now: float) -> None:
        """Time passes. Call at least every 20 ms while engaged; a longer pause is answered like a loss."""
        gap, self._now = now - self._now, now
        if self.controls_allowed and not 0 <= gap <= self.table.timing.stall:
            self.release(now, "clock jumped" if gap < 0 else "stalled")
        self._move_envelope(max(gap, 0.0))
        if self.state is State.ENGAGED:
            self._watch(now)
        if self.state is State.FADING:
            faded = all(self._at_rest(axis) for axis in self.table.axes)
            if faded or now - self._faded_at > self.table.timing.fade_longest:
                self._let_go()
        if self.state is State.RELEASING:
            least = self.table.timing.override_release
            if all(sent.releases >= least for sent in self._sent.values()):
                self.state = State.STANDBY

    def _watch(self, now: float) -> None:
        """While engaged: everything control depends on."""
        self._since = {pair: self._since.get(pair, now) for pair in self._implausible()}
        if now - self._commanded > self.table.timing.controller_timeout:
            self._fade("controller lost", now)
        for heard in self.table.heard:
            if not self._fresh(heard, now):
                self._fade(f"{heard.name} stale", now)
        for pair, since in self._since.items():
            if now - since >= self.table.timing.persist:
                self._fade(f"implausible: {pair}", now)
        for name, value in self.table.forbidden:
            if self.value(name, -1.0) == value:
                self._fade(f"truck: {name}", now)

    def _implausible(self) -> list[str]:
        found = []
        speed = self.value("speed", 0.0)
        if abs(speed - self.value("second_speed", speed)) > self.table.speed_gap_m_s:
            found.append("two wheel speeds")
        line, ratio = self.table.driveline, self.value("gear_ratio", 0.0)
        coupled = (
            self.value("driveline", 0.0) == 1
            and self.value("shifting", 0.0) == 0
            and self.value("lockup", 1.0) == 1
        )
        if line and coupled and ratio > 0 and speed > line.above_m_s:
            expected = self.value("engine_speed", 0.0) * line.metres_per_radian / ratio
            if abs(expected - speed) > line.tolerance * speed:
                found.append("wheel and engine speed")
        return found

    # -- frames in

    def rx_hook(self, can_id: int, data: bytes, now: float) -> None:
        """A frame was heard."""
        if self.state is State.SILENT:
            return
        source = can_id & 0xFF
        if source == self.table.address and can_id not in self.table.always:
            axis = self._axes.get(can_id)
            if axis is None or data != self._sent[axis.name].data:  # an echo of our own frame is no conflict
                self.release(now, "another node uses our address")
        elif source not in self.table.friends and any(
            (axis.can_id ^ can_id) & 0x03FF_FF00 == 0 for axis in self.table.axes
        ):
            self._fade("another node commands the truck", now)
        heard = self._heard.get(can_id & 0x03FF_FFFF)
        if heard is not None and self._accept(heard, can_id, data, now):
            self._take(heard, int.from_bytes(data, "little"), now)

    def _accept(self, heard: Heard, can_id: int, data: bytes, now: float) -> bool:
        """Length, checksum, counter and rate of a heard frame."""
        rate = self._rates[heard.key]
        word = int.from_bytes(data, "little")
        if len(data) != 8:
            return self._refuse(f"{heard.name} length")
        if heard.check != "none":
            before, rate.counter = rate.counter, (word >> 56) & 0xF
            if not checksum_ok(heard.check, can_id, word):
                return self._refuse(f"{heard.name} checksum")
            if not counter_ok(heard.check, word, before):
                return self._refuse(f"{heard.name} counter")
        if now - rate.start >= 1.0:
            rate.start, rate.count = now, 0
        rate.count += 1
        if rate.count > 2.0 / heard.period_s:
            self._fade(f"{heard.name} too often", now)
            return self._refuse(f"{heard.name} too often")
        return True

    def _take(self, heard: Heard, word: int, now: float) -> None:
        """Values of a frame. What is not available or impossible does not refresh its signal."""
        for signal in heard.signals:
            value = signal.field.read(word)
            if value is None or not signal.low <= value <= signal.high:
                self.refusals[f"{signal.name} invalid"] += 1
            else:
                self._values[signal.name] = (value, now)
        for name, least in self.table.override:
            if self.value(name, 0.0) >= least:
                self.release(now, f"driver: {name}")

    def _refuse(self, reason: str) -> bool:
        self.refusals[reason] += 1
        return False

    def value(self, name: str, otherwise: float) -> float:
        """Last valid value of a heard signal."""
        return self._values.get(name, (otherwise, 0.0))[0]

    def _fresh(self, heard: Heard, now: float) -> bool:
        return all(
            now - self._values.get(signal.name, (0.0, -math.inf))[1] <= heard.timeout_s
            for signal in heard.signals
        )

    # -- frames out

    def plan(self, axis: Axis, now: float) -> float | None:
        """What the axis shall send now: a demand within all limits, NaN for the release frame, None for
        silence.
        """
        sent = self._sent[axis.name]
        if self.state is State.RELEASING:
            return math.nan if sent.releases < self.table.timing.override_release else None
        if not self.controls_allowed:
            return None
        low, high = self._envelope(axis)
        elapsed = self._elapsed(axis, now)
        near = abs(sent.exact - sent.value) <= 0.51 * axis.demand.scale
        start = sent.exact if near else sent.value  # rounding must not swallow steps smaller than one bit
        if self.state is State.FADING:
            step, target = axis.limits.fade * elapsed, axis.rest
        else:
            step = self._rate(axis, now) * elapsed
            target = min(max(self._demands[axis.name], low), high)
            target = start + self._soften(axis, target - start, sent.slew, elapsed)
        value = min(max(target, start - step), start + step)
        sent.exact = min(max(value, low), high)
        idle = axis.idle_at_rest and abs(sent.exact - axis.rest) < axis.demand.scale / 2
        return math.nan if idle else sent.exact

    def _soften(self, axis: Axis, distance: float, slew: float, elapsed: float) -> float:
        """The part of a distance that the jerk limit lets go in one cycle, slowing down before the target."""
        change = axis.limits.jerk * elapsed
        arriving = math.sqrt(2 * axis.limits.jerk * abs(distance))
        wanted = math.copysign(min(arriving, abs(distance) / elapsed), distance)
        return min(max(wanted, slew - change), slew + change) * elapsed

    def tx_hook(self, can_id: int, data: bytes, now: float) -> bool:
        """May this frame leave? Judged from its bits alone. A refusal is counted by reason."""
        if self.state is State.SILENT:
            return self._refuse("silent")
        if can_id in self.table.always:
            return True
        axis = self._axes.get(can_id)
        if axis is None:
            return self._refuse("not on the list")
        sent, word = self._sent[axis.name], int.from_bytes(data, "little")
        reason = self._malformed(axis, data, word, sent, now) or self._unlawful(axis, word, sent, now)
        if reason:
            return self._refuse(reason)
        value = axis.demand.read(word)
        released = word & SIGNED == axis.release
        value = axis.rest if released or value is None else value
        sent.slew = 0.0 if released else (value - sent.value) / self._elapsed(axis, now)
        sent.value, sent.time, sent.counter, sent.data = value, now, (word >> 56) & 0xF, bytes(data)
        sent.releases += self.state is State.RELEASING
        return True

    def _malformed(self, axis: Axis, data: bytes, word: int, sent: _Sent, now: float) -> str:
        if len(data) != 8:
            return "length"
        if not self._link:
            return "no link"
        if not checksum_ok(axis.check, axis.can_id, word):
            return "checksum"
        if not counter_ok(axis.check, word, sent.counter):
            return "counter"
        return "too early" if now - sent.time < 0.5 * axis.period_s else ""

    def _unlawful(self, axis: Axis, word: int, sent: _Sent, now: float) -> str:
        """Why a well-formed frame must not leave in this state."""
        quantum = axis.demand.scale
        elapsed = self._elapsed(axis, now)
        if word & SIGNED == axis.release:
            if self.state is State.RELEASING:
                return "" if sent.releases < self.table.timing.override_release else "silence"
            if not self.controls_allowed:
                return "controls not allowed"
            return "" if abs(sent.value - axis.rest) <= axis.limits.rate * elapsed + quantum else "step"
        if not self.controls_allowed:
            return "controls not allowed"
        mask = ((1 << axis.demand.bits) - 1) << axis.demand.start
        value = axis.demand.read(word)
        if (word & SIGNED) & ~mask != axis.active or value is None:
            return "form"
        low, high = self._envelope(axis)
        if not low - quantum / 2 <= value <= high + quantum / 2:
            return "value"
        return self._hasty(axis, value, sent, elapsed, now)

    def _hasty(self, axis: Axis, value: float, sent: _Sent, elapsed: float, now: float) -> str:
        """Rate and jerk, each with the rounding of the wire."""
        quantum, move = axis.demand.scale, value - sent.value
        if self.state is State.FADING:
            before, after = abs(sent.value - axis.rest), abs(value - axis.rest)
            return (
                "rate" if after > before + quantum or abs(move) > axis.limits.fade * elapsed + quantum else ""
            )
        if abs(move) > self._rate(axis, now) * elapsed + quantum:
            return "rate"
        low, high = self._envelope(axis)
        inside = (
            low + quantum < value < high - quantum
        )  # at the envelope its own motion goes before the jerk limit
        bend = abs(move / elapsed - sent.slew) * elapsed
        return "jerk" if inside and bend > axis.limits.jerk * elapsed**2 + 2 * quantum else ""

    # -- limits

    def _elapsed(self, axis: Axis, now: float) -> float:
        """Time a demand has had to move: since the last frame, but never more than two periods."""
        return min(max(now - self._sent[axis.name].time, 0.5 * axis.period_s), 2 * axis.period_s)

    def _rate(self, axis: Axis, now: float) -> float:
        young = now - self._engaged_at < self.table.timing.handover
        return axis.limits.rate * (self.table.timing.handover_scale if young else 1.0)

    def _at_rest(self, axis: Axis) -> bool:
        return abs(self._sent[axis.name].value - axis.rest) <= axis.demand.scale

    def _move_envelope(self, gap: float) -> None:
        """The speed behind the envelope follows the truck no faster than a truck can change speed (12
        m/s^2).
        """
        speed, step = self.value("speed", 0.0), 12.0 * gap
        self._envelope_speed = min(max(speed, self._envelope_speed - step), self._envelope_speed + step)

    def _envelope(self, axis: Axis) -> tuple[float, float]:
        limits, speed = axis.limits, self._envelope_speed
        return _between(speed, limits.speed, limits.low), _between(speed, limits.speed, limits.high)

    @staticmethod
    def _widest(axis: Axis) -> tuple[float, float]:
        return min(axis.limits.low), max(axis.limits.high)

    # -- losing control

    def _lose(self, reason: str) -> None:
        self.losses[reason] += 1
        self.reason = reason
        self.warning = f"Take over: control was handed back ({reason})"

    def _fade(self, reason: str, now: float) -> None:
        if self.state is State.ENGAGED:
            self._lose(reason)
            self.state, self._faded_at = State.FADING, now

    def _let_go(self) -> None:
        for sent in self._sent.values():
            sent.releases = 0
        self.state = State.RELEASING


def _between(x: float, points: tuple[float, ...], values: tuple[float, ...]) -> float:
    """Linear between the points, constant outside."""
    for (x0, y0), (x1, y1) in zip(
        zip(points, values, strict=True), zip(points[1:], values[1:], strict=True), strict=False
    ):
        if x <= x1:
            return y0 + (y1 - y0) * max(x - x0, 0.0) / (x1 - x0)
    return values[-1]
