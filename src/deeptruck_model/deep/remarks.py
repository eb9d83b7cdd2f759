"""Remarks that limit an evaluation: overlapping runs, other driving conditions, another truck,
training data.
"""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, TypeGuard

import numpy as np

from deeptruck_model.recordings import Recording
from deeptruck_model.simulators import Simulator

if TYPE_CHECKING:
    from deeptruck_model.deep.truck import DeepTruck


ENOUGH_S = 1800.0  # of driving to calibrate by
OVERLAP = 2.0  # times the driving that the runs may be long together
OUTSIDE = 0.1  # share of the samples
HELD_ENOUGH = 0.75  # of the points, by intervals that were to hold 90 %
KEY = "trained_on"  # of the manifest
SHOWN = 3  # names in a line
OPTIMISTIC = "its errors there are optimistic"


def remarks(
    simulator: Simulator, recordings: Sequence[Recording], metrics: dict[str, Any], horizon_s: float = 0.0
) -> list[str]:
    """One line per remark; empty if the figures need none. `horizon_s` is the requested one."""
    found = [_overlap(recordings, metrics)]
    if (run_s := metrics["horizon_s"]) <= horizon_s - metrics.get("dt", 0.0):
        found = [f"no segment of the recordings is {horizon_s:g} s long: the runs are {run_s:.1f} s", *found]
    if is_deep(simulator):
        found += [_outside(simulator, recordings), _other(simulator, recordings, metrics)]
    return [line for line in found if line]


def few_runs(truck: DeepTruck, recordings: Sequence[Recording]) -> str:
    """One line if the recordings are too short to set intervals by; else none."""
    driven, horizon = sum(len(r) * r.dt for r in recordings), truck.details["calibration"]["horizon_s"]
    if driven >= ENOUGH_S:
        return ""
    return (
        f"{driven / 60:.1f} min of driving are about {max(1, round(driven / horizon))} independent runs of "
        f"{horizon:.0f} s: little to set intervals by; an hour or more is worth it"
    )


def _overlap(recordings: Sequence[Recording], metrics: dict[str, Any]) -> str:
    driven, horizon = sum(len(r) * r.dt for r in recordings), metrics["horizon_s"]
    if metrics["trials"] * horizon <= OVERLAP * driven:
        return ""
    return (
        f"{metrics['trials']} runs of {horizon:.0f} s from {driven:.0f} s of driving overlap: they count as "
        f"about {max(1, round(driven / horizon))} independent ones"
    )


def _outside(truck: DeepTruck, recordings: Sequence[Recording]) -> str:
    """Remark on driving conditions on which the truck was not trained."""
    names = (*truck.interface.y, *truck.interface.w)
    whole = [r.columns(names) for r in recordings if all(name in r.channels for name in names)]
    samples = np.concatenate([x[np.isfinite(x).all(axis=1)] for x in [*whole, np.zeros((0, len(names)))]])
    responses = len(truck.interface.y)
    covered = truck.covers(samples[:, :responses], samples[:, responses:])
    share = 1.0 - float(covered.mean()) if len(covered) else 0.0
    if share <= OUTSIDE:
        return ""
    return (
        f"{100 * share:.0f} % of the driving is outside the speeds, accelerations and grades of the truck's "
        "training: there it guesses"
    )


def _other(truck: DeepTruck, recordings: Sequence[Recording], metrics: dict[str, Any]) -> str:
    """Remark on recordings outside the truck's intervals: of another truck, or of this one with
    another load."""
    held = [m["inside_90"] for m in metrics.values() if isinstance(m, dict) and "inside_90" in m]
    if not held or min(held) >= HELD_ENOUGH:
        return ""
    trucks = (r.interface.name for r in recordings if not r.from_table)  # a table's is that of its file
    others = dict.fromkeys(name for name in trucks if name != truck.interface.name)
    named = f" (recorded on {', '.join(others)}, trained on {truck.interface.name})" if others else ""
    return (
        f"the 90 % intervals hold only {100 * min(held):.0f} % of the points of one channel: this is another "
        f"truck or load than in training{named}, which 'mismatch' finds, or too few drives set them, which "
        "'calibrate' corrects"
    )


def speed_hash(recording: Recording) -> str:
    """SHA-256 of the speed, by which a bag is recognised even if it was renamed, copied, or read with another
    topic map."""
    speed = np.ascontiguousarray(recording.channels["speed"], dtype="<f8")
    return hashlib.sha256(np.where(np.isnan(speed), np.nan, speed).tobytes()).hexdigest()


def trained_on(truck: DeepTruck, recordings: Sequence[Recording]) -> list[str]:
    """Names of the recordings that trained `truck`, or the truck from which it was adapted.

    Older versions did not store this. Recordings without motion are left out: all of them have the same hash.
    """
    known = set(truck.details.get(KEY, ()))
    moving = [r for r in recordings if np.any(r.channels["speed"] > 0.0)]
    return [r.name for r in moving if speed_hash(r) in known]


def warning(truck: DeepTruck, recordings: Sequence[Recording], so: str = OPTIMISTIC) -> str:
    """A warning in one line; empty if the truck was trained on none of these recordings."""
    names = trained_on(truck, recordings)
    if not names:
        return ""
    more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
    return f"the truck was trained on {', '.join(names[:SHOWN])}{more}: {so}"


def is_deep(simulator: Simulator) -> TypeGuard[DeepTruck]:
    """Whether the simulator is a deep truck, found without importing torch for others."""
    room = sys.modules.get("deeptruck_model.deep.truck")
    return room is not None and isinstance(simulator, room.DeepTruck)
