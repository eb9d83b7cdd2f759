"""Provides an FMU in any of its past states, by tracking which drive each instance has followed.

An FMU only runs forward. A state is represented by a drive (a start, and all inputs since) and a position in
it. The next step is done by an instance at that position. If there is none, an instance is set to a saved
state, or started, and driven with the same inputs; the result is the same because an FMU is deterministic.
"""

from __future__ import annotations

import weakref
from collections.abc import Callable, Sequence
from typing import Any

from deeptruck_model.fmu.description import Variable
from deeptruck_model.fmu.instance import Instance

SAVE_EVERY = 50  # steps between saved states of an instance
MAX_SAVED = 4  # of an instance
FEWEST = 8  # instances, before one is taken from a drive that may still go on


class Drive:
    """A start and all inputs since. It grows only at its end; a step from any earlier position creates a new
    drive."""

    __slots__ = ("__weakref__", "start", "steps")

    def __init__(
        self, start: Sequence[tuple[Variable, float]], steps: Sequence[Sequence[float]] = ()
    ) -> None:
        self.start, self.steps = start, list(steps)


class RunningInstance:
    """An instance, and its present position in a drive."""

    def __init__(self, instance: Instance) -> None:
        self.instance, self.length = instance, 0
        self.drive: Callable[[], Drive | None] = _nowhere
        self.saved: dict[int, Any] = {}  # states by the number of steps before them
        self.used = 0

    def begin(self, drive: Drive) -> list[float]:
        """Start a drive."""
        self.forget()
        self.drive, self.length = _nowhere, 0  # should the start fail
        out = self.instance.start(drive.start)
        self.drive = weakref.ref(drive)
        return out

    def forget(self) -> None:
        """Release all saved states."""
        for state in self.saved.values():
            self.instance.forget(state)
        self.saved = {}

    def step(self, inputs: Sequence[float], can_save: bool) -> list[float]:
        """Advance by one step."""
        if can_save and self.length % SAVE_EVERY == 0 and self.length not in self.saved:
            self.saved[self.length] = self.instance.save_state()
            if len(self.saved) > MAX_SAVED:
                self.instance.forget(self.saved.pop(min(self.saved)))
        out = self.instance.step(inputs)
        self.length += 1
        return out


def _nowhere() -> Drive | None:
    return None


class Instances:
    """All instances of one FMU. `make` gives a new one; `can_save` says whether one can save and restore its
    state, and `only_once` whether a process may have only one."""

    def __init__(self, make: Callable[[], Instance], can_save: bool, only_once: bool) -> None:
        self._make, self._can_save, self._only_once = make, can_save, only_once
        self._running: list[RunningInstance] = []
        self._clock, self._wanted = 0, FEWEST
        weakref.finalize(self, _close, self._running)

    def room_for(self, batch: int) -> None:
        """Keep enough instances for batches of this many rows."""
        self._wanted = max(self._wanted, 2 * batch)

    def begin(self, drive: Drive) -> list[float]:
        """Start a drive in a free instance and return the outputs of the FMU."""
        running = self._free()
        self._clock += 1
        running.used = self._clock
        return running.begin(drive)

    def step(self, drive: Drive, length: int, inputs: Sequence[float]) -> tuple[Drive, list[float]]:
        """One step after the first `length` steps of a drive: the drive with that step, and the outputs. If
        the drive already has other inputs there, a new drive is created."""
        running = self._at(drive, length)
        if length < len(drive.steps):
            drive = Drive(drive.start, drive.steps[:length])
            running.drive = weakref.ref(drive)
        out = running.step(inputs, self._can_save)
        drive.steps.append(inputs)
        return drive, out

    def alone(self) -> Instance:
        """An instance for a whole run without return to earlier states."""
        running = self._free()
        running.forget()
        running.drive = _nowhere
        return running.instance

    def _at(self, drive: Drive, length: int) -> RunningInstance:
        self._clock += 1
        on_it = [running for running in self._running if running.drive() is drive]
        for running in on_it:
            if running.length == length:
                running.used = self._clock
                return running
        running = next((p for p in on_it if any(at <= length for at in p.saved)), None) or self._free()
        self._go_back(running, drive, length)
        running.used = self._clock
        return running

    def _go_back(self, running: RunningInstance, drive: Drive, length: int) -> None:
        at = (
            max((k for k in running.saved if k <= length), default=None) if running.drive() is drive else None
        )
        if at is None:
            running.begin(drive)
        else:
            running.instance.restore(running.saved[at])
            running.length = at
            for later in [k for k in running.saved if k > at]:
                running.instance.forget(running.saved.pop(later))
        for inputs in drive.steps[running.length : length]:
            running.step(inputs, self._can_save)

    def _free(self) -> RunningInstance:
        """An instance whose drive is no longer referenced, a new one, or the least recently used one."""
        for running in self._running:
            if running.drive() is None:
                return running
        if not self._running or (not self._only_once and len(self._running) < self._wanted):
            self._running.append(RunningInstance(self._make()))
            return self._running[-1]
        return min(self._running, key=lambda running: running.used)


def _close(instances: list[RunningInstance]) -> None:
    for running in instances:
        running.forget()
        running.instance.close()
