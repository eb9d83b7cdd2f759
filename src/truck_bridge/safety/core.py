"""The last thing between software and forty tonnes.

The promise. No frame leaves unless it is on the vehicle's list, well formed and within the limits of value,
rate and jerk at the present speed, and a person has engaged control on fresh, plausible signals. When the
driver acts, control is handed back within one cycle. When anything control depends on is lost, demands fade
without a step. Whoever takes control away, braking that a known hazard needs goes on until the hazard is no
longer assumed, or the driver takes over. Control stays lost until a person engages again.

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
from truck_bridge.safety.ending import SLOW_M_S, STANDS_M_S, BrakeHold
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
CUT_OFF = "Take over: no brake demand reaches the truck (link lost)"


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
        self._pressed: dict[str, tuple[float, float]] = {}  # first and last of a signal's firm frames
        self._commanded = -math.inf
        self._gap = (math.nan, math.nan)  # to the vehicle ahead and needed, m
        self.linked, self._moves = True, True  # bus and address are ours
        self._now = self._engaged_at = self._faded_at = self._moved_at = -math.inf
        self._twin = self._cut_off = -math.inf

    def _listen(self) -> None:
        """Anew: nothing heard yet."""
        self.hearing = Hearing(self.table, self.refusals)
        self.others = Demands(self.table, self.refusals)

    # the person and the controller

    @property
    def controls_allowed(self) -> bool:
        """The one bit: demands may leave."""
        return self.state in IN_CONTROL

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
        needs: Mapping[str, float] | None = None,
        assumed_s: float = math.inf,
    ) -> bool:
        """Take one demand per axis, in the axis's unit; each call is also the controller's heartbeat.

        `engaged` is the bridge's engaged bit as the controller received it last; False for too long is a
        loss. `gap`: m to the vehicle ahead, and needed behind it; NaN where the controller does not say.
        `needs`: demands of braking axes that the hazard ahead needs, assumed for `assumed_s` from now; they
        go on should control end. A demand that is NaN, missing or outside the envelope is refused: the result
        is False, control fades, and what was said of a hazard before still holds.
        """
        axes, needs = self.table.axes, needs or {}
        refused = [asked for axis in axes if not axis.takes(asked := demands.get(axis.name, math.nan))]
        sane = (axis.name for axis in axes if axis.brakes and axis.takes(needs.get(axis.name, math.nan)))
        hazard = {name: needs[name] for name in sane}
        if any(hazard.values()) or not refused:
            self._hold.know(hazard, now + min(assumed_s, self.table.timing.assumed))
        if refused:
            self.refusals[f"command {'not a number' if math.isnan(refused[0]) else 'outside envelope'}"] += 1
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
        if not self.linked:
            found.append("no bus or no address")
        if not self._demands or now - self._commanded > table.timing.controller_timeout:
            found.append("no fresh command")
        found += [f"{name} not fresh" for name in hearing.stale(now)]
        found += [f"driver: {act.name}" for act in table.override if hearing.value(act.name) >= act.least]
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

    # the end of control

    def release(self, now: float, reason: str = "released") -> None:
        """A person who is not the driver takes control away: release frames on every axis, then silence."""
        if self.state in BRAKED and not self._moves:
            self._let_go(reason)
        else:
            self._end(reason, now, State.RELEASING)

    def fade(self, now: float, reason: str) -> None:
        """Control cannot go on, for a cause in the core or outside."""
        if self.state is State.ENGAGED:
            self._end(reason, now, State.FADING)

    def link(self, up: bool) -> None:
        """Bus off, interface unplugged, address lost (False), or all of them well again (True).

        Without a link nothing can be sent. One that returns re-engages nothing.
        """
        if self.linked and not up:
            self._cut_off = self._now
            self._end("link lost", self._now, State.STANDBY)
        self.linked = up
        if self.state in BRAKED:
            self._warn_braked()

    def _end(self, reason: str, now: float, otherwise: State) -> None:
        """Control is lost, whoever says so but the driver: braking that a known hazard needs goes on, as does
        what brakes or holds the truck already; from other driving the core goes to the state `otherwise`.
        """
        if self.state in (State.ENGAGED, State.FADING):
            self._lose(reason)
            self.state, self._faded_at = otherwise, now
            if self._hold.knows(now):
                self._go_on_braking()

    def _let_go(self, reason: str) -> None:
        """By the driver, or a standing truck by a person: at once."""
        if self.controls_allowed:
            self._lose(reason)
            self.state = State.RELEASING

    def _lose(self, reason: str) -> None:
        if self.state in (State.ENGAGED, State.HOLDING):
            self.losses[reason] += 1
        self.reason = reason
        self.warning = f"Take over: control was handed back ({reason})"

    def _go_on_braking(self) -> None:
        self._hold.begin(self._on_the_wire, self._demands)
        self.state = State.STOPPING
        self._warn_braked()
        for motion in self._motions.values():
            motion.slew = 0.0

    def _stand(self, now: float) -> None:
        """Hold a truck that has stood for so long that its driver is asked (ISO 15622)."""
        if self._moves:
            self._moved_at = now
        elif self.state is State.ENGAGED and now - self._moved_at >= self.table.timing.stands:
            self._hold.hold(self._on_the_wire)
            self.state = State.HOLDING
            self._warn_braked()

    def _warn_braked(self) -> None:
        braking = f"Take over: braking to a standstill ({self.reason})"
        self.warning = CUT_OFF if not self.linked else braking if self.state is State.STOPPING else STANDS

    def _fresh(self, now: float) -> dict[str, float]:
        """The demands of a controller that is alive."""
        return self._demands if now - self._commanded <= self.table.timing.controller_timeout else {}

    @property
    def _on_the_wire(self) -> dict[str, float]:
        return {motion.axis.name: motion.value for motion in self._motions.values()}

    # time

    def tick(self, now: float) -> None:
        """Time passes. Call it at least every 20 ms while engaged; a longer pause is answered like a loss."""
        passed, self._now, timing = now - self._now, now, self.table.timing
        if not 0 <= passed <= timing.stall:
            self._hold.shift(passed)
        if passed < 0:
            self._rewind(now, passed)
        elif passed > timing.stall:
            self._end("stalled", now, State.RELEASING)  # the truck has timed out
        for reason in self.others.broken_off(now):
            self.fade(now, reason)
        if not math.isnan(self._speed):
            self._moves = self._speed >= STANDS_M_S
        if self.state is State.ENGAGED:
            self._watch(now)
            self._stand(now)
        if self.state is State.FADING and self._hold.knows(now):
            self._go_on_braking()  # for a hazard that a controller that is alive has seen since
        rolls = self._moves and not self._speed < SLOW_M_S
        if self.state is State.STOPPING and rolls and not self._hold.knows(now):
            self._lose(self.reason)
            self.state, self._faded_at = State.FADING, now
        if self.state is State.FADING:
            resting = all(motion.at_rest for motion in self._motions.values())
            if resting or now - self._faded_at > timing.fade_longest:
                self.state = State.RELEASING
        enough = all(motion.releases >= timing.releases for motion in self._motions.values())
        ended = self.state is State.RELEASING and (enough or not self.linked)
        cut_off = self.state in BRAKED and not self.linked and now - self._cut_off > timing.outage
        if ended or cut_off:
            self.state = State.STANDBY

    def _rewind(self, now: float, passed: float) -> None:
        """The clock went back: nothing heard or sent has a meaningful age any more."""
        self._end("clock went back", now, State.RELEASING)
        self._listen()
        self._pressed.clear()
        self._commanded = -math.inf
        self._cut_off += passed
        for motion in self._motions.values():
            motion.time = now - motion.axis.period_s

    def _watch(self, now: float) -> None:
        """While engaged: everything control depends on. The first cause found is the one reported."""
        if now - self._commanded > self.table.timing.controller_timeout:
            self.fade(now, "controller lost")
        for name in self.hearing.stale(now):
            self.fade(now, f"{name} stale")
        doubts = self.hearing.doubts(now, self._on_the_wire)
        wrong = {f"truck: {name}": self.table.timing.persist for name in self.hearing.forbids()}
        wrong |= {f"implausible: {doubt}": may_last for doubt, may_last in doubts.items()}
        for reason in self.hearing.lasting(wrong, now):
            self.fade(now, reason)

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
                self._end(TWIN, now, State.RELEASING)
        elif demanded := self.others.take(can_id, data, now):
            self.fade(now, demanded)
        if message := self.hearing.take(can_id, data, now):
            self.fade(now, message)
        self._hear_driver(now)

    def _hear_driver(self, now: float) -> None:
        """A driver who acts takes over at once. Where a hazard is braked for hard, who means it does; who
        brakes then takes over by lifting the foot, and until then the brakes give the greater of both.
        """
        known = self._moves and self._hold.knows(now)
        hard = known and self._hold.is_hard(self._on_the_wire, self._demands)
        for act in self.table.override:
            value, heard = self.hearing.value(act.name), act.name in self.hearing.accepted
            first, last = self._pressed.get(act.name, (now, now))
            pressed = heard and value >= act.firm
            if pressed:
                self._pressed[act.name] = first, (last := now)
            elif heard:
                self._pressed.pop(act.name, None)
            lasts = heard and last - first >= act.held_s
            if hard and lasts and pressed and act.brakes:
                self._end(f"driver: {act.name}", now, State.RELEASING)
            elif lasts if hard else value >= act.least:
                self._let_go(f"driver: {act.name}")

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
        if not self.linked:
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
