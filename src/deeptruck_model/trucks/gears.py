"""Overall gear ratios, engine speed over road speed in rad/m, estimated from recordings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from deeptruck_core.arrays import Array
from deeptruck_core.errors import InputError
from deeptruck_model.recordings.consistency.sensors import (
    LEAST_STEADY_S,
    TURNING_M_S,
    TURNING_RAD_S,
    steady_ratios,
)
from deeptruck_model.recordings.recording import Recording
from deeptruck_model.simulators import Simulator
from deeptruck_model.trucks.truck import PhysicsTruck

NEAR = 0.04  # of a ratio: worn tyres turn up to 3 % faster
TIED = 0.02  # of the share, by which two factors do not differ
FITS = 0.7  # share of it near one of the stated ratios
SCALED = 0.15  # relative: tyres of one axle, and a speed sensor that is off, differ by less
FACTORS = np.exp(np.linspace(-0.8, 0.8, 801))  # by which all ratios may be off together


@dataclass(frozen=True)
class Misfit:
    """`share` of the steady driving is near a stated ratio; `factor` times the stated ones fit `best`."""

    share: float
    factor: float
    best: float

    def __str__(self) -> str:
        says = f"its gear ratios explain {100 * self.share:.0f} % of the steady driving of the recordings"
        if self.best >= FITS:
            return (
                f"{says}, {self.factor:.3f} times these {100 * self.best:.0f} %: check axle ratio and tyres"
            )
        return f"{says}: check gears, axle ratio and tyres, or whether this is the recorded truck"


def check(simulator: Simulator, recordings: Sequence[Recording]) -> None:
    """Raises InputError if a physics truck, corrected or not, has other gears than the recordings.

    If all ratios differ by one factor near one, the cause may be tyres or the speed sensor, and nothing is
    raised.
    """
    off = _misfit_of(simulator, recordings)
    if off is not None and not (off.best >= FITS and abs(off.factor - 1.0) < SCALED):
        raise InputError(other_truck(simulator, recordings))


def other_truck(simulator: Simulator, recordings: Sequence[Recording]) -> str:
    """A sentence if a physics truck, corrected or not, has other gears than the recordings; else empty.

    Other simulators state no ratios.
    """
    off = _misfit_of(simulator, recordings)
    name = simulator.interface.name
    return f"the simulator '{name}' is another truck than the recorded one: {off}" if off else ""


def _misfit_of(simulator: Simulator, recordings: Sequence[Recording]) -> Misfit | None:
    truck = getattr(simulator, "base", simulator)
    if not isinstance(truck, PhysicsTruck):
        return None
    values, gears = truck.specification.values, truck.specification.ratios
    return misfit([r * values["final_drive"] / values["wheel_radius"] for r in gears], recordings)


def misfit(stated: Sequence[float], recordings: Sequence[Recording]) -> Misfit | None:
    """The misfit between stated overall ratios (rad/m) and the recordings; None if they agree, or if less
    than LEAST_STEADY_S of steady driving has an engine speed."""
    seen = steady_ratios(recordings)
    if not len(seen) or len(seen) * recordings[0].dt < LEAST_STEADY_S:
        return None
    shares = np.array([_share(np.log(seen), np.log(np.asarray(stated) * f)) for f in (1.0, *FACTORS)])
    if shares[0] >= FITS:
        return None
    alike = np.flatnonzero(shares[1:] > shares[1:].max() - TIED)  # gears a step apart look alike
    spans = np.split(alike, np.flatnonzero(np.diff(alike) > 1) + 1)
    middles = np.array([span[len(span) // 2] for span in spans])
    best = int(middles[np.argmin(np.abs(np.log(FACTORS[middles])))])
    return Misfit(float(shares[0]), float(FACTORS[best]), float(shares[1 + best]))


def _share(seen: Array, stated: Array) -> float:
    """Share of the logarithms `seen` within NEAR of one of `stated`."""
    ordered = np.concatenate([[-np.inf], np.sort(stated), [np.inf]])
    place = np.searchsorted(ordered, seen)
    off = np.minimum(np.abs(seen - ordered[place - 1]), np.abs(seen - ordered[place]))
    return float(np.mean(off < NEAR))


def from_gears(recordings: Sequence[Recording]) -> tuple[float, ...]:
    """Overall ratio of each gear from 1 on, rad/m, by recorded gear and engine speed; empty without these.

    Gears that were not driven are interpolated on the geometric series of the others.
    """
    pairs = [
        (r.channels["gear"], r.channels["engine_speed"], r.channels["speed"])
        for r in recordings
        if {"gear", "engine_speed"} <= r.channels.keys()
    ]
    if not pairs:
        return ()
    gear, engine, speed = (np.concatenate(x) for x in zip(*pairs, strict=True))
    turning = (speed > TURNING_M_S) & (engine > TURNING_RAD_S)
    gears = np.arange(1, int(np.nanmax(gear)) + 1)
    own = [turning & (gear == k) for k in gears]
    seen = [float(np.log(np.median(engine[m] / speed[m]))) if m.any() else np.nan for m in own]
    known = np.isfinite(seen)
    if known.sum() < 2:
        return ()
    line = np.polyval(np.polyfit(gears[known], np.array(seen)[known], 1), gears)
    return tuple(np.minimum.accumulate(np.exp(np.where(known, seen, line))).tolist())
