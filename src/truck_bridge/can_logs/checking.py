"""Runs the safety core's checks of received messages on a log, as if control had been engaged throughout."""

from __future__ import annotations

import math
import statistics
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

from deeptruck_core.account import Account
from truck_bridge.can_logs.faults import unread
from truck_bridge.can_logs.frames import Frame
from truck_bridge.can_logs.reader import read
from truck_bridge.fault_watch import FaultWatch
from truck_bridge.j1939.transport import Broken
from truck_bridge.safety import Safety, State, Table
from truck_bridge.vehicles import Vehicle

STEP_S = 0.01  # the core is asked so often between frames
HOLE_S = 1.0  # a log with a longer hole has been paused: hearing starts anew

Times = dict[str, tuple[float, float]]  # first and last time of each reason, s from the start of the log


@dataclass
class Checked:
    """Result of the checks for a drive. `refusals` and `losses` are the core's own counts."""

    vehicle: str
    frames: int = 0
    seconds: float = 0.0  # of the log, without its pauses
    pauses: int = 0
    paused_s: float = 0.0
    engaged_s: float = 0.0  # of these, in which control could have been held
    received: Counter[str] = field(default_factory=Counter)  # frames by message
    refusals: Counter[str] = field(default_factory=Counter)
    losses: Counter[str] = field(default_factory=Counter)
    refused_s: Times = field(default_factory=dict)
    lost_s: Times = field(default_factory=dict)
    obstacles: Counter[str] = field(default_factory=Counter)  # what stood against engaging: turns of 10 ms
    driver_s: Counter[str] = field(default_factory=Counter)  # how long the driver acted, by signal
    faults: Counter[str] = field(default_factory=Counter)  # that controllers reported, messages by fault
    faults_s: Times = field(default_factory=dict)

    # rolling radius that engine speed, gear and wheel speed show, as a share of the vehicle file's
    radii: list[float] = field(default_factory=list)
    account: Account = field(default_factory=lambda: Account("", "frames"))  # of the log
    broken: Counter[Broken] = field(default_factory=Counter)  # messages of several frames, not whole

    @property
    def clean(self) -> bool:
        """Whether control was engaged, and nothing was refused or lost."""
        return self.engaged_s > 0 and not self.refusals and not self.losses


def check(path: Path, vehicle: Vehicle, *, channel: str | None = None) -> Checked:
    """Replay a log's bus to the core, without the interventions of the driver. Raises InputError as `read`
    does."""
    return _Replay(vehicle).run(path, channel)


class _Replay:
    def __init__(self, vehicle: Vehicle) -> None:
        self._override = vehicle.table.override
        self._table: Table = replace(  # a person drives, and brakes; nobody obeys us
            vehicle.table,
            override=(),
            coasts_m_s2=math.inf,
            needs_lead=False,
            engage_speed=(0.0, 1e3),
            obeyed=tuple(replace(one, from_demand=math.inf) for one in vehicle.table.obeyed),
        )
        self._names = {message.key: message.name for message in vehicle.table.heard}
        self._safety = Safety(self._table)
        self._vehicle, self._faults = vehicle, FaultWatch(vehicle)
        self._now = self._start = self._latest = 0.0
        self._seen = Counter[str](), Counter[str]()
        self._found = Checked(vehicle.name)

    def run(self, path: Path, channel: str | None) -> Checked:
        self._found.account.source = str(path)
        for frame in read(path, self._found.account, channel=channel):
            if self._found.frames == 0:
                self._start = self._latest = frame.time
            step, since = frame.time - self._now, frame.time - self._latest
            if self._found.frames and since > HOLE_S:  # a clock that goes back comes to this time again
                self._found.pauses += 1
                self._found.paused_s += since
            self._latest = max(self._latest, frame.time)
            if self._found.frames == 0 or not 0 <= step <= HOLE_S:
                self._begin(frame.time)
                self._listen()
            self._wait(frame.time)
            self._hear(frame)
            self._note(frame.time)
        self._count()
        self._found.broken += self._faults.finish()
        return self._found

    def _listen(self) -> None:
        """Reset the faults, because those reported before a gap may not persist."""
        self._found.broken += self._faults.finish()
        self._faults = FaultWatch(self._vehicle)

    def _begin(self, now: float) -> None:
        self._count()
        self._safety = Safety(self._table)
        self._safety.arm(now)
        self._now, self._seen = now, (Counter(), Counter())

    def _count(self) -> None:
        self._found.refusals += self._safety.refusals
        self._found.losses += self._safety.losses

    def _note(self, now: float) -> None:
        """Note the time of each new reason."""
        counts, at = (self._safety.refusals, self._safety.losses), now - self._start
        for times, count, seen in zip(
            (self._found.refused_s, self._found.lost_s), counts, self._seen, strict=True
        ):
            for reason in count - seen:
                times[reason] = (times.get(reason, (at, at))[0], at)
            seen.update(count - seen)

    def _hear(self, frame: Frame) -> None:
        self._found.frames += 1
        if frame.can_id & 0xFF == self._table.address:
            return  # a drive of the bridge itself: what it sent is no stranger's
        name = self._names.get(frame.can_id & 0x03FF_FFFF)
        if name is not None:
            self._found.received[name] += 1
        self._safety.rx_hook(frame.can_id, frame.data, frame.time)
        if "speed" in self._safety.hearing.accepted:
            self._measure_radius()
        self._hear_faults(frame)

    def _measure_radius(self) -> None:
        line, value = self._table.driveline, self._safety.hearing.value
        coupled = value("driveline") == 1 and value("shifting") != 1 and value("lockup") != 0
        turning = coupled and min(value("gear_ratio"), value("engine_speed")) > 0
        if line is not None and turning and value("speed") > line.above_m_s:
            shown = value("speed") * value("gear_ratio") / value("engine_speed")
            self._found.radii.append(shown / line.metres_per_radian)

    def _hear_faults(self, frame: Frame) -> None:
        reported, at = self._faults.hear(frame.can_id, frame.data, frame.time), frame.time - self._start
        for fault in reported:
            self._found.faults[fault] += 1
            self._found.faults_s[fault] = (self._found.faults_s.get(fault, (at, at))[0], at)
        for fault in self._faults.blocking(frame.time) if reported else ():
            self._safety.fade(frame.time, fault)

    def _wait(self, until: float) -> None:
        while self._now + STEP_S < until:
            self._now += STEP_S
            self._turn()

    def _turn(self) -> None:
        """10 ms of the drive: a controller that coasts, and a person who requests control whenever
        possible."""
        safety, found = self._safety, self._found
        found.seconds += STEP_S
        safety.command({axis.name: axis.rest for axis in self._table.axes}, True, self._now)
        safety.tick(self._now)
        self._note(self._now)
        if safety.state is State.ENGAGED:
            found.engaged_s += STEP_S
        elif safety.state is not State.STANDBY:
            self._begin(self._now)
        elif obstacles := (*safety.obstacles(self._now, True), *self._faults.blocking(self._now)):
            found.obstacles.update(obstacles)
        else:
            safety.engage(self._now, person=True, lead_vehicle=True)
        for act in self._override:
            if safety.hearing.value(act.name) >= act.least:
                found.driver_s[act.name] += STEP_S  # type: ignore[assignment]


def lines(found: Checked) -> Iterator[str]:
    """The result as text lines."""
    pauses = f", beside {found.pauses} pauses of {found.paused_s:.1f} s in all" if found.pauses else ""
    yield f"{found.frames} frames in {found.seconds:.1f} s{pauses}"
    yield from found.account.lines()
    yield from unread(found.broken)
    received = ", ".join(f"{name} {count}" for name, count in found.received.most_common())
    yield f"received for {found.vehicle}: {received or 'nothing'}"
    yield f"could have been engaged for {found.engaged_s:.1f} s"
    if len(found.radii) > 1:
        middle = statistics.median(found.radii)
        away = sorted(abs(radius / middle - 1) for radius in found.radii)[int(0.98 * (len(found.radii) - 1))]
        yield f"rolling radius by the gears: {middle:.3f} of the file's; 98 % within {100 * away:.1f} % of it"
    yield f"refused: {_timed(found.refusals, found.refused_s)}"
    yield f"control would have been lost: {_timed(found.losses, found.lost_s)}"
    yield f"faults reported: {_timed(found.faults, found.faults_s)}"
    if found.engaged_s == 0:
        yield f"never engaged because: {', '.join(name for name, _ in found.obstacles.most_common())}"
    times = ", ".join(f"{name} {seconds:.1f} s" for name, seconds in found.driver_s.items())
    yield f"the driver acted: {times or 'never'}"


def _timed(counts: Counter[str], times: Times) -> str:
    """Each reason with its count and its first and last time."""
    reported = []
    for name, count in counts.most_common():
        first, last = times[name]
        when = f"at {first:.2f} s" if count == 1 else f"{count} times, {first:.2f} to {last:.2f} s"
        reported.append(f"{name} ({when})")
    return ", ".join(reported) or "nothing"
