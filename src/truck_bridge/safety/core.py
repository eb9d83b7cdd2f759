"""The last thing between software and forty tonnes.

The promise. No frame leaves unless it is on the vehicle's list, well formed and within the limits of value,
rate and jerk at the present speed, and a person has engaged control on fresh, plausible signals. When the
driver acts, or anything control depends on is lost, control is handed back within one cycle or faded without
a step, and stays handed back until a person engages again.

Pure: no clock, no input or output; time (monotonic seconds) is an argument and frames come and go as integers
and bytes.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from enum import Enum

from truck_bridge.safety.checks import checksum_ok, counter_ok
from truck_bridge.safety.demands import Demands
from truck_bridge.safety.hearing import Hearing
from truck_bridge.safety.motion import Motion
from truck_bridge.safety.tables import SIGNED, Axis, Table


class State(Enum):
    """Each state says which frames may leave.

    SILENT none; STANDBY address claims; ENGAGED the controller's demands; FADING demands that move towards
    rest; RELEASING the frames that hand back.
    """

    SILENT = "silent"
    STANDBY = "standby"
    ENGAGED = "engaged"
    FADING = "fading"
    RELEASING = "releasing"


IN_CONTROL = (State.ENGAGED, State.FADING)
TWIN = "another node uses our address"


class Safety:
    """See the module. Every refusal is counted by reason in `refusals`, every loss of control in `losses`."""

    def __init__(self, table: Table) -> None:
        self.table = table
        self.state = State.SILENT
        self.reason = ""  # why control was lost last; empty while engaged
        self.warning = ""  # what the driver must be told, until the next engagement or disarming
        self.refusals: Counter[str] = Counter()
        self.losses: Counter[str] = Counter()
        self._forget()

    def _forget(self) -> None:
        self._listen()
        self._motions = {axis.can_id: Motion(axis) for axis in self.table.axes}
        self._demands: dict[str, float] = {}
        self._commanded = -math.inf
        self._link = True
        self._now = self._engaged_at = self._faded_at = self._twin = -math.inf

    def _listen(self) -> None:
        """Anew: nothing heard yet."""
        self.hearing = Hearing(self.table, self.refusals)
        self.others = Demands(self.table, self.refusals)

    # the person and the controller

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
            self.state, self._now = State.STANDBY, now

    def disarm(self) -> None:
        """Silent at once. Call it after a release has run out, or when the bus is gone."""
        if self.controls_allowed:
            self._lose("disarmed")
        self.state, self.warning = State.SILENT, ""

    def command(self, demands: Mapping[str, float], engaged: bool, now: float) -> bool:
        """Take one demand per axis, in the axis's unit; each call is also the controller's heartbeat.

        `engaged` is the bridge's engaged bit as the controller received it last; False for too long ends
        control. A demand that is NaN, missing or outside the envelope is refused: the result is False and
        control fades.
        """
        for axis in self.table.axes:
            demand = demands.get(axis.name, math.nan)
            if not min(axis.limits.low) <= demand <= max(axis.limits.high):
                self.refusals[f"command {'not a number' if math.isnan(demand) else 'outside envelope'}"] += 1
                self._demands = {}
                self.fade(now, "command refused")
                return False
        self._demands, self._commanded = dict(demands), now
        if not engaged and now > self._engaged_at + self.table.timing.controller_timeout:
            self.fade(now, "controller not engaged")
        return True

    def engage(self, now: float, person: bool, lead_vehicle: bool) -> tuple[str, ...]:
        """Ask for control. Empty when granted, otherwise every reason why not."""
        obstacles = self.obstacles(now, lead_vehicle)
        if not person:
            obstacles = (*obstacles, "nobody asked: engaging needs a person")
        if obstacles:
            self.refusals["engagement"] += 1
            return obstacles
        for motion in self._motions.values():
            motion.start(self.hearing.value(motion.axis.start_from), self._speed, now)
        self.state, self._engaged_at, self.reason, self.warning = State.ENGAGED, now, "", ""
        return ()

    def obstacles(self, now: float, lead_vehicle: bool) -> tuple[str, ...]:
        """Why control cannot be given now; empty when it can."""
        table, hearing = self.table, self.hearing
        found = [] if self.state is State.STANDBY else [f"not in standby but {self.state.value}"]
        if not self._link:
            found.append("no bus or no address")
        if not self._demands or now - self._commanded > table.timing.controller_timeout:
            found.append("no fresh command")
        found += [f"{name} not fresh" for name in hearing.stale(now)]
        found += [f"driver: {name}" for name in hearing.driver_acts()]
        found += [f"truck: {name}" for name in hearing.forbids()]
        found += [f"implausible: {doubt}" for doubt in hearing.doubts(now, {})]
        found += hearing.seconds(now)
        if now - self._twin <= table.timing.quiet:
            found.append(TWIN)
        if now - self.others.refused <= table.timing.quiet:
            found.append("another controller demands what it may not")
        if table.needs_lead and not lead_vehicle:
            found.append("no vehicle ahead")
        low, high = table.engage_speed
        if not low <= hearing.value("speed") <= high:
            found.append(f"speed outside {low:g}..{high:g} m/s")
        return tuple(found)

    def release(self, now: float, reason: str = "released") -> None:
        """Hand back at once: release frames on every axis, then silence."""
        if self.controls_allowed:
            self._lose(reason)
            self._let_go()

    def fade(self, now: float, reason: str) -> None:
        """Hand back gradually. Also for a cause outside the core: a node lost, the lead vehicle lost."""
        if self.state is State.ENGAGED:
            self._lose(reason)
            self.state, self._faded_at = State.FADING, now

    def link(self, up: bool) -> None:
        """Bus off, interface unplugged, address lost (False), or all of them well again (True).

        Without a link nothing can be handed back in order, so control ends at once; a link that returns
        re-engages nothing.
        """
        if not up and self.state in (*IN_CONTROL, State.RELEASING):
            self._lose("link lost")
            self.state = State.STANDBY
        self._link = up

    def _lose(self, reason: str) -> None:
        self.losses[reason] += 1
        self.reason = reason
        self.warning = f"Take over: control was handed back ({reason})"

    def _let_go(self) -> None:
        self.state = State.RELEASING

    # time

    def tick(self, now: float) -> None:
        """Time passes. Call it at least every 20 ms while engaged; a longer pause is answered like a loss."""
        gap, self._now = now - self._now, now
        if gap < 0:
            self._rewind(now)
        elif gap > self.table.timing.stall:
            self.release(now, "stalled")
        for reason in self.others.broken_off(now):
            self.fade(now, reason)
        if self.state is State.ENGAGED:
            self._watch(now)
        if self.state is State.FADING:
            resting = all(motion.at_rest for motion in self._motions.values())
            if resting or now - self._faded_at > self.table.timing.fade_longest:
                self._let_go()
        if self.state is State.RELEASING:
            enough = self.table.timing.releases
            if all(motion.releases >= enough for motion in self._motions.values()):
                self.state = State.STANDBY

    def _rewind(self, now: float) -> None:
        """The clock went back: nothing heard or sent has a meaningful age any more."""
        self.release(now, "clock went back")
        self._listen()
        self._commanded = -math.inf
        for motion in self._motions.values():
            motion.time = now - motion.axis.period_s

    def _watch(self, now: float) -> None:
        """While engaged: everything control depends on. The first cause found is the one reported."""
        if now - self._commanded > self.table.timing.controller_timeout:
            self.fade(now, "controller lost")
        for name in self.hearing.stale(now):
            self.fade(now, f"{name} stale")
        for name in self.hearing.forbids():
            self.fade(now, f"truck: {name}")
        demanded = {motion.axis.name: motion.value for motion in self._motions.values()}
        for doubt in self.hearing.lasting(self.hearing.doubts(now, demanded), now):
            self.fade(now, f"implausible: {doubt}")

    @property
    def _speed(self) -> float:
        return self.hearing.value("speed")

    # frames in

    def rx_hook(self, can_id: int, data: bytes, now: float) -> None:
        """A frame was heard."""
        if self.state is State.SILENT:
            return
        source, own = can_id & 0xFF, self._motions.get(can_id)
        if source == self.table.address and can_id not in self.table.always:
            if own is None or own.data != data:  # an echo of our own frame is no conflict
                self._twin = now
                self.refusals[TWIN] += 1
                if self.state is State.STANDBY:
                    self.warning = f"Do not engage: {TWIN}"
                self.release(now, TWIN)
        elif demanded := self.others.take(can_id, data, now):
            self.fade(now, demanded)
        if message := self.hearing.take(can_id, data, now):
            self.fade(now, message)
        for name in self.hearing.driver_acts():
            self.release(now, f"driver: {name}")

    # frames out

    def plan(self, axis: Axis, now: float) -> float | None:
        """What the axis shall send now: a demand within all limits, NaN for the release frame, or None."""
        motion = self._motions[axis.can_id]
        if self.state is State.RELEASING:
            return math.nan if motion.releases < self.table.timing.releases else None
        if not self.controls_allowed:
            return None
        if self.state is State.FADING:
            demand = motion.towards_rest(self._speed, now)
        else:
            demand = motion.towards(self._demands[axis.name], self._rate(axis, now), self._speed, now)
        idle = axis.idle_at_rest and abs(demand - axis.rest) < axis.demand.scale / 2
        return math.nan if idle else demand

    def tx_hook(self, can_id: int, data: bytes, now: float) -> bool:
        """May this frame leave? Judged from its bits alone. A refusal is counted by reason."""
        reason = self._objection(can_id, data, now)
        if reason:
            self.refusals[reason] += 1
            return False
        motion = self._motions.get(can_id)
        if motion is not None:
            motion.took(data, self._speed, now)
            motion.releases += self.state is State.RELEASING
        return True

    def _objection(self, can_id: int, data: bytes, now: float) -> str:
        if self.state is State.SILENT:
            return "silent"
        if can_id in self.table.always:
            return ""
        motion = self._motions.get(can_id)
        if motion is None:
            return "not on the list"
        return self._malformed(motion, data, now) or self._unlawful(motion, data, now)

    def _malformed(self, motion: Motion, data: bytes, now: float) -> str:
        axis, word = motion.axis, int.from_bytes(data, "little")
        if len(data) != 8:
            return "length"
        if not self._link:
            return "no link"
        if not checksum_ok(axis.check, axis.can_id, word):
            return "checksum"
        if not counter_ok(axis.check, word, motion.counter):
            return "counter"
        if not 0 <= now - self._now <= self.table.timing.stall:
            return "not watched"  # nobody asked the core for so long that its state is worth nothing
        return "too early" if now - motion.time < 0.5 * axis.period_s else ""

    def _unlawful(self, motion: Motion, data: bytes, now: float) -> str:
        """Why a well-formed frame must not leave in this state."""
        axis, word = motion.axis, int.from_bytes(data, "little") & SIGNED
        if self.state is State.RELEASING:
            if word != axis.release:
                return "controls not allowed"
            return "" if motion.releases < self.table.timing.releases else "silence"
        if not self.controls_allowed:
            return "controls not allowed"
        if word == axis.release:
            step = abs(motion.value - axis.rest) > axis.limits.rate * motion.elapsed(now) + axis.demand.scale
            return "step" if step else ""
        value = axis.demand.read(word)
        if word & ~axis.demand.mask != axis.active or value is None:
            return "form"
        if motion.outside(value, self._speed, now):
            return "value"
        if self.state is State.FADING:
            return "rate" if motion.leaves_fade(value, now) else ""
        return motion.hasty(value, self._rate(axis, now), self._speed, now)

    def _rate(self, axis: Axis, now: float) -> float:
        """Tighter while handing over from the driver."""
        young = now - self._engaged_at < self.table.timing.handover
        return axis.limits.rate * (self.table.timing.handover_scale if young else 1.0)
