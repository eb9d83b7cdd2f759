"""A log through the safety core's received-message checks, as if control had been engaged all the time."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

from truck_bridge.can_logs.reader import Frame, read
from truck_bridge.safety import Safety, State, Table
from truck_bridge.vehicles import Vehicle

STEP_S = 0.01  # the core is asked so often between frames
HOLE_S = 1.0  # a log with a longer hole has been paused: hearing starts anew


@dataclass
class Checked:
    """What the checks would have done in a drive. `refusals` and `losses` are the core's own counts."""

    vehicle: str
    frames: int = 0
    seconds: float = 0.0  # of the log
    engaged_s: float = 0.0  # of these, in which control could have been held
    heard: Counter[str] = field(default_factory=Counter)  # frames by message
    refusals: Counter[str] = field(default_factory=Counter)
    losses: Counter[str] = field(default_factory=Counter)
    obstacles: Counter[str] = field(default_factory=Counter)  # what stood against engaging: turns of 10 ms
    driver_s: Counter[str] = field(default_factory=Counter)  # how long the driver acted, by signal

    notes: list[str] = field(default_factory=list)  # where the log is cut off

    @property
    def clean(self) -> bool:
        """Nothing refused, nothing lost, and engaged at all."""
        return self.engaged_s > 0 and not self.refusals and not self.losses


def check(path: Path, vehicle: Vehicle) -> Checked:
    """Replay a log to the core, without the driver who would have taken over. Raises InputError as `read`."""
    return _Replay(vehicle).run(path)


class _Replay:
    def __init__(self, vehicle: Vehicle) -> None:
        self._override = vehicle.table.override
        self._table: Table = replace(vehicle.table, override=(), needs_lead=False, engage_speed=(0.0, 1e3))
        self._names = {message.key: message.name for message in vehicle.table.heard}
        self._safety = Safety(self._table)
        self._now = 0.0
        self._found = Checked(vehicle.name)

    def run(self, path: Path) -> Checked:
        for frame in read(path, self._found.notes):
            if self._found.frames == 0 or not 0 <= frame.time - self._now <= HOLE_S:
                self._begin(frame.time)
            self._wait(frame.time)
            self._hear(frame)
        self._count()
        return self._found

    def _begin(self, now: float) -> None:
        self._count()
        self._safety = Safety(self._table)
        self._safety.arm(now)
        self._now = now

    def _count(self) -> None:
        self._found.refusals += self._safety.refusals
        self._found.losses += self._safety.losses

    def _hear(self, frame: Frame) -> None:
        self._found.frames += 1
        if frame.can_id & 0xFF == self._table.address:
            return  # a drive of the bridge itself: what it sent is no stranger's
        name = self._names.get(frame.can_id & 0x03FF_FFFF)
        if name is not None:
            self._found.heard[name] += 1
        self._safety.rx_hook(frame.can_id, frame.data, frame.time)

    def _wait(self, until: float) -> None:
        while self._now + STEP_S < until:
            self._now += STEP_S
            self._turn()

    def _turn(self) -> None:
        """10 ms of the drive: a controller that coasts, and a person who asks whenever they may."""
        safety, found = self._safety, self._found
        found.seconds += STEP_S
        safety.command({axis.name: axis.rest for axis in self._table.axes}, True, self._now)
        safety.tick(self._now)
        if safety.state is State.ENGAGED:
            found.engaged_s += STEP_S
        elif safety.state is not State.STANDBY:
            self._begin(self._now)
        elif obstacles := safety.obstacles(self._now, True):
            found.obstacles.update(obstacles)
        else:
            safety.engage(self._now, person=True, lead_vehicle=True)
        for name, least in self._override:
            if safety.hearing.value(name) >= least:
                found.driver_s[name] += STEP_S  # type: ignore[assignment]


def lines(found: Checked) -> Iterator[str]:
    """For people."""
    yield f"{found.frames} frames in {found.seconds:.1f} s"
    yield from found.notes
    yield f"heard for {found.vehicle}: {_listed(found.heard)}"
    yield f"could have been engaged for {found.engaged_s:.1f} s"
    yield f"refused: {_listed(found.refusals)}"
    yield f"control would have been lost: {_listed(found.losses)}"
    if found.engaged_s == 0:
        yield f"never engaged because: {', '.join(name for name, _ in found.obstacles.most_common())}"
    times = ", ".join(f"{name} {seconds:.1f} s" for name, seconds in found.driver_s.items())
    yield f"the driver acted: {times or 'never'}"


def _listed(counts: Counter[str]) -> str:
    return ", ".join(f"{name} {count}" for name, count in counts.most_common()) or "nothing"
