"""Whether a deep truck is judged by recordings that it was trained on."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from deeptruck_model.errors import InputError
from deeptruck_model.recordings import Recording

if TYPE_CHECKING:
    from deeptruck_model.deep.truck import DeepTruck

KEY = "trained_on"  # of the manifest
SHOWN = 3  # names in a line
BY_CHANCE_S = 10.0  # shorter pieces of a coarse sensor may be alike to the last digit
OPTIMISTIC = "its errors there are optimistic"


def fingerprint(recording: Recording) -> str:
    """SHA-256 of the speed, so that a bag that was renamed or copied, or read by another topic map, is still
    known."""
    speed = np.ascontiguousarray(recording.channels["speed"], dtype="<f8")
    return hashlib.sha256(np.where(np.isnan(speed), np.nan, speed).tobytes()).hexdigest()


def refuse_twice(recordings: Sequence[Recording]) -> None:
    """Raises InputError where one drive is there twice, under whatever name: what one copy holds out the
    other would train, and one drive would count as two."""
    seen: dict[str, str] = {}
    for r in recordings:
        if len(r) * r.dt < BY_CHANCE_S or not np.any(r.channels["speed"] > 0.0):
            continue
        content = _content(r)
        if content in seen:
            again = f"as '{seen[content]}' and as '{r.name}'" if seen[content] != r.name else "twice"
            raise InputError(f"the drive '{r.name}' is given {again}; give each drive once")
        seen[content] = r.name


def _content(recording: Recording) -> str:
    """SHA-256 of all channels; unlike `data_hash`, whatever the recording is called."""
    digest = hashlib.sha256()
    for name, values in sorted(recording.channels.items()):
        known = np.where(np.isnan(values), np.nan, values)  # one NaN, whatever its bits
        digest.update(name.encode() + np.ascontiguousarray(known, dtype="<f8").tobytes())
    return digest.hexdigest()


def trained_on(truck: DeepTruck, recordings: Sequence[Recording]) -> list[str]:
    """Names of those recordings that trained `truck`, or the truck that it was adapted from.

    Trucks of versions that did not store this know none; and one standstill is like another.
    """
    known = set(truck.details.get(KEY, ()))
    moving = [r for r in recordings if np.any(r.channels["speed"] > 0.0)]
    return [r.name for r in moving if fingerprint(r) in known]


def warning(truck: DeepTruck, recordings: Sequence[Recording], so: str = OPTIMISTIC) -> str:
    """One line that says so, and what follows; empty where the truck has seen none of them."""
    names = trained_on(truck, recordings)
    if not names:
        return ""
    more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
    return f"the truck was trained on {', '.join(names[:SHOWN])}{more}: {so}"
