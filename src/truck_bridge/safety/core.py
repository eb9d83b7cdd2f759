"""The last thing between software and forty tonnes.

The promise. No frame leaves unless it is on the vehicle's list, well formed and within the limits of value,
rate and jerk at the present speed, and a person has engaged control on fresh, plausible signals. When the
driver acts, control is handed back within one cycle. When anything control depends on is lost, demands fade
without a step; braking for a hazard goes on to a standstill. Control stays lost until a person engages again.

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
from truck_bridge.safety.ending import STANDS_M_S, BrakeHold
from truck_bridge.safety.hearing import Hearing
from truck_bridge.safety.motion import Motion
from truck_bridge.safety.tables import SIGNED, Axis, Table


class State(Enum):
    """Each state says which frames may leave.

    SILENT none; STANDBY what `Table.always` has; ENGAGED the controller's demands; HOLDING brake demands that
    hold a standing truck; STOPPING brake demands that do not fall (go on braking); FADING demands that move
    towards rest (roll out); RELEASING the frames that hand back (let go).
    """

    SILENT = "silent"
    STANDBY = "standby"
    ENGAGED = "engaged"
    HOLDING = "holding"
    STOPPING = "stopping"
    FADING = "fading"
    RELEASING = "releasing"


BRAKED = (State.HOLDING, State.STOPPING)
IN_CONTROL = (State.ENGAGED, *BRAKED, State.FADING)
TWIN = "another node uses our address"
STANDS = "Standing: engage to drive off, or take over"


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
        self._hold = BrakeHold({axis.name: axis.holds_beyond for axis in self.table.axes if axis.brakes})
        self._demands: dict[str, float] = {}
        self._goes_on: dict[str, float] = {}  # with which a loss of the controller goes on
        self._commanded = -math.inf
        self._gap = (math.nan, math.nan)  # to the vehicle ahead and needed, m
        self._link = True
        self._now = self._engaged_at = self._faded_at = self._seen_at = self._moved_at = (
            self._twin
        ) = -math.inf

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

    def command(
        self,
        demands: Mapping[str, float],
        engaged: bool,
        now: float,
        gap: tuple[float, float] = (math.nan, math.nan),
        goes_on: Mapping[str, float] | None = None,
    ) -> bool:
        """Take one demand per axis, in the axis's unit; each call is also the controller's heartbeat.

        `gap`: m to the vehicle ahead, and needed behind it; NaN where the controller does not say. `goes_on`:
        demands of braking axes that what is ahead needs should control be lost after this call.

        `engaged` is the bridge's engaged bit as the controller received it last; False for too long
        is a loss. A demand that is NaN, missing or outside the envelope is refused: the result is False and
        control fades.
        """
        brakes = {axis.name: axis.limits for axis in self.table.axes if axis.brakes}
        self._goes_on = {
            name: demand
            for name, demand in (goes_on or {}).items()
            if name in brakes and min(brakes[name].low) <= demand <= max(brakes[name].high)
        }
        for axis in self.table.axes:
            demand = demands.get(axis.name, math.nan)
            if not min(axis.limits.low) <= demand <= max(axis.limits.high):
                self.refusals[f"command {'not a number' if math.isnan(demand) else 'outside envelope'}"] += 1
                self.fade(now, "command refused")
                self._demands = {}
                return False
        self._demands, self._commanded, self._gap = dict(demands), now, gap
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
            if self.state is State.STANDBY:  # a truck that is held goes on from there
                motion.start(self.hearing.value(motion.axis.start_from), self._speed, now)
        self.state, self._engaged_at, self.reason, self.warning = State.ENGAGED, now, "", ""
        self._moved_at = now
        return ()

    def obstacles(self, now: float, lead_vehicle: bool) -> tuple[str, ...]:
        """Why control cannot be given now; empty when it can."""
        table, hearing = self.table, self.hearing
        ready = self.state in (State.STANDBY, State.HOLDING)
        found = [] if ready else [f"not in standby but {self.state.value}"]
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
        if self._gap[0] < self._gap[1]:
            found.append(f"too near the vehicle ahead: {self._gap[0]:.0f} m, needs {self._gap[1]:.0f} m")
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
        """Control cannot go on, for a cause in the core or outside: roll out, or go on braking."""
        if self.state is not State.ENGAGED:
            return
        self._lose(reason)
        if self._hold.begin(self._on_the_wire, self._demands, asked=self._goes_on):
            self._go_on_braking(now)
        else:
            self.state, self._faded_at = State.FADING, now

    def _go_on_braking(self, now: float) -> None:
        self.state, self._seen_at = State.STOPPING, now
        self.warning = f"Take over: braking to a standstill ({self.reason})"
        for motion in self._motions.values():
            motion.slew = 0.0

    def _stand(self, now: float) -> None:
        """Hold a truck that has stood for so long that its driver is asked (ISO 15622)."""
        if not self._speed < STANDS_M_S:
            self._moved_at = now
        if self.state is State.ENGAGED and now - self._moved_at >= self.table.timing.stands:
            self._hold.hold(self._on_the_wire)
            self.state, self.warning = State.HOLDING, STANDS

    def _fresh(self, now: float) -> dict[str, float]:
        """The demands of a controller that is alive."""
        return self._demands if now - self._commanded <= self.table.timing.controller_timeout else {}

    @property
    def _on_the_wire(self) -> dict[str, float]:
        return {motion.axis.name: motion.value for motion in self._motions.values()}

    def link(self, up: bool) -> None:
        """Bus off, interface unplugged, address lost (False), or all of them well again (True).

        Without a link no release can be sent, so control is handed back at once; a link that returns
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
            self.fade(now, "stalled")
            if self.state is State.FADING:
                self._let_go()  # the truck has timed out
        for reason in self.others.broken_off(now):
            self.fade(now, reason)
        if self.state is State.ENGAGED:
            self._watch(now)
            self._stand(now)
        if self.state is State.STOPPING and self._is_blind(now):
            self.state, self._faded_at = State.FADING, now
        alive = self.state is State.FADING and not self._is_blind(now) and self._fresh(now)
        if alive and self._hold.begin(alive, asked=self._goes_on):
            self._go_on_braking(now)
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

    def _is_blind(self, now: float) -> bool:
        """Whether no speed has been heard for so long that the truck stands, if its brakes brake."""
        self._seen_at = max(self._seen_at, self.hearing.received("speed"))
        return now - self._seen_at > self.table.timing.blind

    def _watch(self, now: float) -> None:
        """While engaged: everything control depends on. The first cause found is the one reported."""
        if now - self._commanded > self.table.timing.controller_timeout:
            self.fade(now, "controller lost")
        for name in self.hearing.stale(now):
            self.fade(now, f"{name} stale")
        for name in self.hearing.forbids():
            self.fade(now, f"truck: {name}")
        for doubt in self.hearing.lasting(self.hearing.doubts(now, self._on_the_wire), now):
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
        demand, wanted = motion.towards_rest(self._speed, now), self._wanted(axis, now)
        if not self._rests(axis) or (axis.brakes and abs(wanted) > abs(demand)):
            demand = motion.towards(wanted, self._rate(axis, now), self._speed, now)
        idle = axis.idle_at_rest and abs(demand - axis.rest) < axis.demand.scale / 2
        return math.nan if idle else demand

    def _rests(self, axis: Axis) -> bool:
        """Whether the demand of an axis moves towards rest, unless a controller that is alive brakes more."""
        return self.state is State.FADING or (self.state in BRAKED and not axis.brakes)

    def _wanted(self, axis: Axis, now: float) -> float:
        """What the controller demands; of a truck that is braked or held what is held, or more."""
        if self.state is State.ENGAGED:
            return self._demands[axis.name]
        wanted = self._fresh(now).get(axis.name, axis.rest)
        if self.state is State.FADING or not axis.brakes:
            return wanted
        self._hold.rise(axis.name, wanted)
        return self._hold.rise(axis.name, self._motions[axis.can_id].exact)

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
        holds = self.state in BRAKED and axis.brakes
        if word == axis.release:
            if holds and not motion.at_rest:
                return "falls"
            step = abs(motion.value - axis.rest) > axis.limits.rate * motion.elapsed(now) + axis.demand.scale
            return "step" if step else ""
        value = axis.demand.read(word)
        if word & ~axis.demand.mask != axis.active or value is None:
            return "form"
        if motion.outside(value, self._speed, now):
            return "value"
        if holds and motion.falls(value, self._speed, now):
            return "falls"
        more = axis.brakes and abs(self._fresh(now).get(axis.name, axis.rest)) > abs(motion.value)
        if self._rests(axis) and not (more and abs(value) > abs(motion.value)):
            return "rate" if motion.leaves_fade(value, now) else ""
        return motion.hasty(value, self._rate(axis, now), self._speed, now)

    def _rate(self, axis: Axis, now: float) -> float:
        """Tighter while handing over from the driver."""
        young = now - self._engaged_at < self.table.timing.handover
        return axis.limits.rate * (self.table.timing.handover_scale if young else 1.0)
