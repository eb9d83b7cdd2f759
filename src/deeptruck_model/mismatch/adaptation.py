"""A constant force per mass for one drive, estimated from its first minutes.

Load, wind and weather differ from day to day and cannot be learned from other drives. Each free run along the
begin of the drive gives the constant of least squared speed error; their mean is shrunk to zero by their
scatter.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from deeptruck_model import calls
from deeptruck_model.constants import GRAVITY
from deeptruck_model.errors import InputError
from deeptruck_model.mismatch.correction.corrected_truck import CorrectedTruck, Term
from deeptruck_model.mismatch.correction.improvement import free_runs, horizon
from deeptruck_model.mismatch.data import checks
from deeptruck_model.mismatch.data.prepared import Prepared, learned, prepare, same_signals
from deeptruck_model.mismatch.mechanisms import variant
from deeptruck_model.recordings import Recording
from deeptruck_model.recordings.given import Drives
from deeptruck_model.recordings.given import drives as known
from deeptruck_model.simulators import MinimalSimulator, Simulator, completed

FIRST_S = 300.0
CONSTANT = "grade_bias"  # the mechanism of a constant force per mass, as a slope
PRIOR = 0.03  # m/s^2, sd of what differs between drives
STEP = 0.02  # m/s^2, of the sensitivity
APART = 2.0  # by how much the mean of free runs varies beyond independent ones: slopes and wind last longer
LEAST_SD = 0.002  # m/s^2, of the constant that one free run asks for


@dataclass(frozen=True)
class Adapted:
    """The simulator with a constant acceleration (m/s^2) added, its standard deviation, and the seconds
    of the drive and the free runs that it was estimated from."""

    truck: CorrectedTruck
    constant: float
    sd: float
    seconds: float
    windows: int


def with_constant(simulator: Simulator, acceleration: float) -> CorrectedTruck:
    """The simulator with a constant force per mass (m/s^2) added."""
    return CorrectedTruck(
        simulator, [Term(CONSTANT, (variant("offset"),), (-acceleration / GRAVITY,))], {}, None, True
    )


def adapt(simulator: MinimalSimulator | str | Path, recordings: Drives, first_s: float = FIRST_S) -> Adapted:
    """The simulator adapted to the drive that the recordings are the pieces of, by its first `first_s`.

    The simulator may be named as `load` does, the drive by the path of its bag. Raises InputError where they
    do not belong to each other, or hold no free run.
    """
    calls.number(first_s, "first_s", "s")
    simulator = completed(simulator)
    recordings = known(recordings, rate_hz=1.0 / simulator.dt)
    drives = begin(simulator, recordings, first_s)
    horizon_s = horizon(drives)
    plain, moved = free_runs([(simulator, drives), (with_constant(simulator, STEP), drives)], horizon_s)
    if not len(plain.speed):
        raise InputError(
            f"the first {first_s:g} s of '{recordings[0].name}' hold no unbroken {horizon_s:g} s; "
            "record longer, or take more of it by --first-s"
        )
    slope = (moved.speed - plain.speed) / STEP
    square = np.maximum(np.sum(slope**2, axis=1), 1e-12)
    each = -np.sum(slope * plain.speed, axis=1) / square
    mean = float(np.average(each, weights=square))
    spread = max(float(np.std(each, ddof=1)) if len(each) > 1 else PRIOR, LEAST_SD)
    precision = len(each) / (APART * spread**2)
    constant = mean * precision / (precision + 1.0 / PRIOR**2)
    sd = float(1.0 / np.sqrt(precision + 1.0 / PRIOR**2))
    seconds = sum(len(p.recording) * p.dt for p in drives)
    return Adapted(with_constant(simulator, constant), constant, sd, seconds, len(plain.speed))


def begin(simulator: Simulator, recordings: Sequence[Recording], first_s: float) -> list[Prepared]:
    """The first `first_s` of a drive that may be cut into pieces, made fit for the simulator."""
    same_signals(simulator, recordings)
    pieces, left = [], first_s
    for r in recordings:
        n = min(len(r), round(left / r.dt))
        if n > 1:
            pieces.append(r.piece(0, n))
        left -= n * r.dt
    drives, _ = checks.clean(pieces)
    measured = checks.acceleration_is_measured(drives)
    return [learned(simulator, prepare(r, measured, simulator.interface)) for r in drives]
