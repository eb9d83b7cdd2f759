"""A physics truck fitted to recordings, to compare with: the pool's Volvo in this truck's clothes.

Its structure is right and its numbers are another truck's, as when an engineer starts from a truck they know.
Gear ratios are read off the recorded gear, engine speed and speed; FITTED are fitted on free runs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import minimize

from deeptruck_model import trucks
from deeptruck_model.deep.data.windows import common_interface, cut
from deeptruck_model.errors import InputError
from deeptruck_model.recordings import Recording
from deeptruck_model.signals import ACCELERATION, SPEED
from deeptruck_model.simulators import Array
from deeptruck_model.trucks import PhysicsTruck
from deeptruck_model.trucks.specification import Specification

STARTS_FROM = "volvo"
FITTED = (
    "mass",
    "drag_area",
    "rolling_resistance",
    "full_load_gain",
    "engine_friction",
    "engine_brake_torque",
    "boost_lag",
    "brake_gain",
    "fuel_gain",
    "shift_time",
    "upshift_low",
    "upshift_high",
    "downshift_low",
    "downshift_high",
)
RUNS, SECONDS = 150, 20.0
EVALUATIONS = 2000
SPAN = 1.1  # of the logarithm: each scalar between a third and three times its start
SPEED_S = 5.0  # a speed error counts as the acceleration that brings it about in this time


def physics(recordings: Sequence[Recording], evaluations: int = EVALUATIONS) -> PhysicsTruck:
    """A physics truck fitted to recordings: its structure is right, its numbers begin as another truck's.

    Gear ratios are read off the recorded gear, engine speed and speed; FITTED are fitted on free runs.
    Raises InputError for interfaces that a physics truck does not have.
    """
    interface = common_interface(recordings)
    pieces = [piece for r in recordings for piece in cut(r, interface)]
    truck = PhysicsTruck(_dressed(trucks.load(STARTS_FROM).specification, pieces), dt=recordings[0].dt)
    u, w, y = _windows(pieces)
    scale = np.nanstd(y, axis=(0, 1))
    scale[SPEED] = scale[ACCELERATION] * SPEED_S
    initial = truck.parameters()

    def at(logarithms: Array) -> PhysicsTruck:
        factors = np.exp(logarithms)
        return truck.with_parameters({n: initial[n] * float(f) for n, f in zip(FITTED, factors, strict=True)})

    def cost(logarithms: Array) -> float:
        try:
            run = at(logarithms).rollout(u, w, y[:, 0], inside=False).y
        except InputError:  # a scalar out of its range
            return 1e3
        return float(np.nanmean(((run - y) / scale) ** 2))

    bounds = [(-SPAN, SPAN)] * len(FITTED)
    found = minimize(
        cost, np.zeros(len(FITTED)), method="Powell", bounds=bounds, options={"maxfev": evaluations}
    )
    return at(found.x)


def _dressed(known: Specification, pieces: Sequence[Recording]) -> Specification:
    """The known truck with the recordings' interface and gear ratios."""
    interface = pieces[0].interface
    ratios = _ratios(pieces, known.values["final_drive"] / known.values["wheel_radius"])
    return replace(known, interface=interface, ratios=ratios or known.ratios)


def _ratios(pieces: Sequence[Recording], final: float) -> tuple[float, ...]:
    """Engine speed over speed in each gear; those never seen lie evenly between their neighbours."""
    if not all({"gear", "engine_speed"} <= p.channels.keys() for p in pieces):
        return ()
    gear, engine, speed = (
        np.concatenate([p.channels[n] for p in pieces]) for n in ("gear", "engine_speed", "speed")
    )
    gears = np.arange(1, int(np.nanmax(gear)) + 1)
    turning = speed > 2.0
    ratio = np.log(np.where(turning, engine, 1.0) / np.where(turning, speed, 1.0))
    seen = [np.median(ratio[m]) if (m := turning & (gear == g)).any() else np.nan for g in gears]
    known = np.isfinite(seen)
    line = np.polyfit(gears[known], np.array(seen)[known], 1)
    filled = np.where(known, seen, np.polyval(line, gears))
    return tuple(float(r) for r in np.minimum.accumulate(np.exp(filled) / final))


def _windows(pieces: Sequence[Recording]) -> tuple[Array, Array, Array]:
    """RUNS stretches of SECONDS, evenly spaced over all pieces: u, w, y (runs, T, n)."""
    steps = min(round(SECONDS / pieces[0].dt), max(len(p) for p in pieces) - 1)
    starts = [(p, k) for p in pieces for k in range(0, len(p) - steps, steps // 4)]
    chosen = [starts[i] for i in np.linspace(0, len(starts) - 1, RUNS).astype(int)]

    def stack(name: str) -> Array:
        return np.stack([getattr(p, name)[k : k + steps + 1] for p, k in chosen])

    return stack("u"), stack("w"), stack("y")
