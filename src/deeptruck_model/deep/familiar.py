"""Whether a deep truck is judged by recordings that it was trained on."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from deeptruck_model.recordings import Recording

if TYPE_CHECKING:
    from deeptruck_model.deep.truck import DeepTruck

KEY = "trained_on"  # of the manifest
SHOWN = 3  # names in a line
OPTIMISTIC = "its errors there are optimistic"


def fingerprint(recording: Recording) -> str:
    """SHA-256 of the speed, so that a bag that was renamed or copied, or read by another topic map, is still
    known."""
    speed = np.ascontiguousarray(recording.channels["speed"], dtype="<f8")
    return hashlib.sha256(np.where(np.isnan(speed), np.nan, speed).tobytes()).hexdigest()


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
