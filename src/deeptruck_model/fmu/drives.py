"""Which instance of an FMU is where on which drive, so that any state can be gone on from.

An FMU runs forward only. A state here is a drive (a start, and all inputs since) and how far along it; an
instance that stands there goes on. Where none does, one is set to a state it kept, or started, and drives
the inputs again: the same thing, as an FMU is deterministic.
"""

from __future__ import annotations

import weakref
from collections.abc import Callable, Sequence
from typing import Any

from deeptruck_model.fmu.description import Variable
from deeptruck_model.fmu.instance import Instance

KEEP_EVERY, KEPT = 50, 4  # steps between kept states of an instance, and how many it keeps
FEWEST = 8  # instances, before one is taken from a drive that may still go on


class Drive:
    """A start and the inputs since. It only grows at its end; from any other place a new one branches off."""

    __slots__ = ("__weakref__", "begin", "steps")

    def __init__(
        self, begin: Sequence[tuple[Variable, float]], steps: Sequence[Sequence[float]] = ()
    ) -> None:
        self.begin, self.steps = begin, list(steps)


class Place:
    """An instance, and where it stands."""

    def __init__(self, instance: Instance) -> None:
        self.instance, self.length = instance, 0
        self.drive: Callable[[], Drive | None] = _nowhere
        self.kept: dict[int, Any] = {}
        self.used = 0

    def begin(self, drive: Drive) -> list[float]:
        """Start on a drive."""
        self.forget()
        self.drive, self.length = _nowhere, 0  # should the start fail
        out = self.instance.start(drive.begin)
        self.drive = weakref.ref(drive)
        return out

    def forget(self) -> None:
        """Let go of all kept states."""
        for state in self.kept.values():
            self.instance.forget(state)
        self.kept = {}

    def step(self, inputs: Sequence[float], keep: bool) -> list[float]:
        """One step on."""
        if keep and self.length % KEEP_EVERY == 0 and self.length not in self.kept:
            self.kept[self.length] = self.instance.kept()
            if len(self.kept) > KEPT:
                self.instance.forget(self.kept.pop(min(self.kept)))
        out = self.instance.step(inputs)
        self.length += 1
        return out


def _nowhere() -> Drive | None:
    return None


class Instances:
    """All instances of one FMU. `make` gives a new one; `most` is 1 where a process may have only one."""

    def __init__(self, make: Callable[[], Instance], keeps: bool, only_once: bool) -> None:
        self._make, self._keeps, self._only_once = make, keeps, only_once
        self._places: list[Place] = []
        self._clock, self._wanted = 0, FEWEST
        weakref.finalize(self, _close, self._places)

    def room_for(self, batch: int) -> None:
        """Expect drives of so many rows side by side."""
        self._wanted = max(self._wanted, 2 * batch)

    def begin(self, drive: Drive) -> list[float]:
        """What the FMU has at the start of a drive."""
        place = self._free()
        self._clock += 1
        place.used = self._clock
        return place.begin(drive)

    def step(self, drive: Drive, length: int, inputs: Sequence[float]) -> tuple[Drive, list[float]]:
        """One step from a place on a drive; the drive that it lies on then."""
        place = self._at(drive, length)
        if length < len(drive.steps):
            drive = Drive(drive.begin, drive.steps[:length])
            place.drive = weakref.ref(drive)
        out = place.step(inputs, self._keeps)
        drive.steps.append(inputs)
        return drive, out

    def alone(self) -> Instance:
        """An instance for a whole run, which nobody comes back to."""
        place = self._free()
        place.forget()
        place.drive = _nowhere
        return place.instance

    def _at(self, drive: Drive, length: int) -> Place:
        self._clock += 1
        on_it = [place for place in self._places if place.drive() is drive]
        for place in on_it:
            if place.length == length:
                place.used = self._clock
                return place
        place = next((p for p in on_it if any(at <= length for at in p.kept)), None) or self._free()
        self._go_back(place, drive, length)
        place.used = self._clock
        return place

    def _go_back(self, place: Place, drive: Drive, length: int) -> None:
        at = max((k for k in place.kept if k <= length), default=None) if place.drive() is drive else None
        if at is None:
            place.begin(drive)
            place.length = 0
        else:
            place.instance.restore(place.kept[at])
            place.length = at
            for later in [k for k in place.kept if k > at]:
                place.instance.forget(place.kept.pop(later))
        for inputs in drive.steps[place.length : length]:
            place.step(inputs, self._keeps)

    def _free(self) -> Place:
        """An instance whose drive nobody knows any more, a new one, or the one longest unused."""
        for place in self._places:
            if place.drive() is None:
                return place
        if not self._places or (not self._only_once and len(self._places) < self._wanted):
            self._places.append(Place(self._make()))
            return self._places[-1]
        return min(self._places, key=lambda place: place.used)


def _close(places: list[Place]) -> None:
    for place in places:
        place.forget()
        place.instance.close()
