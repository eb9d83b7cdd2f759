"""Open-loop error statistics, as in the paper: free runs from recorded starts, their baselines and intervals.

An interval's half width is factor * sqrt(spread^2 + (floor + growth sqrt(t))^2), per channel. The spread
widens it where the members of an ensemble disagree; floor and growth are the error they share.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri, stdtrit

from deeptruck_core.errors import InputError
from deeptruck_core.signals import ACCELERATION, SPEED, TruckInterface
from deeptruck_model import trucks
from deeptruck_model.deep.data import cut, has
from deeptruck_model.recordings import Recording, compatibility
from deeptruck_model.recordings.compatibility import Given, Taken
from deeptruck_model.simulators import Array, Simulator, free_run
from deeptruck_model.trucks import PhysicsTruck

if TYPE_CHECKING:
    from deeptruck_model.deep.truck import DeepTruck


TRIALS, HORIZON_S = 90, 40.0
WITHIN = 1.5  # m/s, the paper's band for the speed error
CONSTANT = "constant speed"
ENGINE, BRAKE = ("N m", "percent"), ("percent", "m/s^2")  # what a physics truck takes
LEVEL = 0.9
RUNS = 600  # overlapping ones: fewer would throw data away


@dataclass(frozen=True)
class Trials:
    """Free runs and the recordings from which they start: u (trials, T, n_u), w, measured and modelled y
    (trials, T, n_y).

    Measured samples are NaN where the recording is invalid. Column 0 of time is the common start.
    """

    u: Array
    w: Array
    measured: Array
    modelled: Array
    dt: float
    channels: tuple[str, ...]

    @property
    def error(self) -> Array:
        """Modelled minus measured, (trials, T, n_y)."""
        return self.modelled - self.measured

    @property
    def time(self) -> Array:
        """Seconds since the start, (T,)."""
        return np.arange(self.measured.shape[1], dtype=np.float64) * self.dt


def check(simulator: Simulator, recordings: Sequence[Recording]) -> None:
    """Raises InputError if a recording has a signal of the simulator in another unit or rate, or if all lack
    it."""
    taken = Taken("the simulator", simulator.interface, simulator.dt)
    for recording in recordings:
        given = Given(
            f"'{recording.name}'",
            lambda name: not any(has(one, name) for one in recordings),
            recording.interface.unit,
            recording.dt,
        )
        for misfit in compatibility.misfits(taken, given):
            raise InputError(misfit)


def trials(
    simulator: Simulator,
    recordings: Sequence[Recording],
    count: int = TRIALS,
    horizon_s: float = HORIZON_S,
    seed: int = 0,
) -> Trials:
    """`count` free runs of `horizon_s` (shorter if no segment is that long) from random recorded starts."""
    if not simulator.dt <= horizon_s < np.inf:
        raise InputError(f"a horizon of {horizon_s:g} s is none; give seconds, such as {HORIZON_S:g}")
    check(simulator, recordings)
    pieces = [p for r in recordings for p in cut(r, simulator.interface)]
    if not pieces:
        raise InputError(
            "no segment of 3 s with valid inputs and speed in the recordings; nothing to evaluate"
        )
    dt = simulator.dt
    steps = min(round(horizon_s / dt), max(len(p) for p in pieces) - 1)
    starts = [
        (i, k)
        for i, p in enumerate(pieces)
        for k in np.flatnonzero(np.isfinite(p.channels["speed"][: max(0, len(p) - steps)]))
        if np.isfinite(p.channels["speed"][k + 1 : k + steps + 1]).any()
    ]
    rng = np.random.default_rng(seed)
    chosen = [starts[j] for j in sorted(rng.choice(len(starts), size=count, replace=len(starts) < count))]

    def stack(columns: list[Array]) -> Array:
        return np.stack([columns[i][k : k + steps + 1] for i, k in chosen])

    u, w = stack([p.u for p in pieces]), stack([p.w for p in pieces])
    measured = stack([p.y for p in pieces])
    first = measured[:, 0].copy()
    first[:, SPEED] = np.maximum(first[:, SPEED], 0.0)
    for j in range(first.shape[1]):
        column = first[:, j]
        column[np.isnan(column)] = (
            np.nanmean(measured[..., j]) if np.isfinite(measured[..., j]).any() else 0.0
        )
    modelled = free_run(simulator, u, w, first).y
    return Trials(u, w, measured, modelled, dt, simulator.interface.y)


def statistics(runs: Trials) -> dict[str, Any]:
    """Error statistics as plain numbers; each channel in its unit, `at_end` at the end of the horizon."""
    result: dict[str, Any] = {
        "schema": 1,
        "trials": len(runs.measured),
        "horizon_s": float(runs.time[-1]),
        "dt": runs.dt,
    }
    for j, name in enumerate(runs.channels):
        error = runs.error[..., j]
        if np.isfinite(error[:, 1:]).any():
            result[name] = _channel(error[:, 1:])
    outside = np.abs(runs.error[:, 1:, SPEED]) > WITHIN
    result["speed"]["trials_within_1.5"] = float(1 - outside.any(axis=1).mean())
    return result


def _channel(error: Array) -> dict[str, float | None]:
    """Statistics of an error (trials, T); those at the end are None without measurements there."""
    last = error[:, -1][np.isfinite(error[:, -1])]
    return {
        "mean": float(np.nanmean(error)),
        "mean_abs": float(np.nanmean(np.abs(error))),
        "rmse": float(np.sqrt(np.nanmean(error**2))),
        "mean_at_end": float(last.mean()) if len(last) else None,
        "sd_at_end": float(last.std()) if len(last) else None,
        "rmse_at_end": float(np.sqrt((last**2).mean())) if len(last) else None,
        "largest": float(np.nanmax(np.abs(error))),
    }


def against_time(runs: Trials) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Mean and standard deviation of the error over trials, each (T, n_y); NaN without measurements."""
    error = runs.error
    known = np.isfinite(error)
    count = known.sum(axis=0)
    safe = np.where(known, error, 0.0)
    mean = np.where(count, safe.sum(axis=0) / np.maximum(count, 1), np.nan)
    variance = np.where(known, (error - mean) ** 2, 0.0).sum(axis=0) / np.maximum(count, 1)
    return mean, np.where(count, np.sqrt(variance), np.nan)


def baselines(runs: Trials, interface: TruckInterface, simulated: object = None) -> list[dict[str, Any]]:
    """Statistics of the baselines (constant speed and physics truck) over the same runs, each with its
    'name'.

    The physics truck is the one with the smallest speed error, as published and, if the recordings state a
    mass, with that mass; none if the signals are not those of a physics truck. `simulated` is the simulator,
    which is not its own baseline.
    """
    held = np.repeat(runs.modelled[:, :1], runs.modelled.shape[1], axis=1)
    held[:, :, ACCELERATION] = 0.0
    found = [_named(CONSTANT, statistics(replace(runs, modelled=held)))]
    itself = simulated.specification.name if isinstance(simulated, PhysicsTruck) else ""
    drawn = [_physics(runs, interface, name) for name in trucks.pool() if name != itself]
    known = [x for x in drawn if x is not None]
    return [*found, *sorted(known, key=lambda x: float(x["speed"]["rmse"]))[:1]]


def _named(name: str, figures: Mapping[str, Any]) -> dict[str, Any]:
    return {"name": name, **{channel: x for channel, x in figures.items() if isinstance(x, dict)}}


def _physics(runs: Trials, interface: TruckInterface, name: str) -> dict[str, Any] | None:
    if interface.engine_unit not in ENGINE or interface.brake_unit not in BRAKE:
        return None
    specification = replace(trucks.load(name).specification, interface=interface)
    if interface.mass_kg is not None:
        specification = specification.with_values({"mass": interface.mass_kg})
    truck = PhysicsTruck(specification, dt=runs.dt)
    start = runs.modelled[:, 0].copy()
    start[:, SPEED] = np.maximum(start[:, SPEED], 0.0)
    return _named(
        f"physics truck {name}", statistics(replace(runs, modelled=free_run(truck, runs.u, runs.w, start).y))
    )


def calibrate(truck: DeepTruck, held_out: Sequence[Recording]) -> dict[str, Any]:
    """Interval factors from free runs on data that did not train the truck; lists have one entry per response
    channel.

    A few minutes of held-out data hold few independent runs; Student's t widens the intervals accordingly.
    """
    runs = trials(truck, held_out, RUNS, HORIZON_S, seed=1)
    spread = truck.spread(runs.u, runs.w, runs.modelled[:, 0])[:, 1:]
    error, time = runs.error[:, 1:], runs.time[1:]
    entries = [_interval(error[..., j], spread[..., j], time) for j in range(error.shape[2])]
    floor, growth, factor = (list(values) for values in zip(*entries, strict=True))
    independent = max(1.0, sum(len(r) * r.dt for r in held_out) / float(time[-1]))
    caution = float(stdtrit(independent, 0.5 + LEVEL / 2) / ndtri(0.5 + LEVEL / 2))
    factor = [f * caution for f in factor]
    return {"level": LEVEL, "horizon_s": float(time[-1]), "floor": floor, "growth": growth, "factor": factor}


def calibrated(truck: DeepTruck, recordings: Sequence[Recording]) -> DeepTruck:
    """The same truck with intervals from drives on which it was not trained: hours of them give better
    intervals than the part held out in training."""
    entry = {**calibrate(truck, recordings), "recordings": [r.name for r in recordings]}
    return truck.with_details({"calibration": entry})


def inside(truck: DeepTruck, runs: Trials) -> dict[str, float]:
    """Share of the measured points of free runs inside the truck's intervals, by channel."""
    predicted = truck.predict(runs.u, runs.w, runs.modelled[:, 0])
    measured, low, high = (y[:, 1:] for y in (runs.measured, predicted.low, predicted.high))
    held = (measured >= low) & (measured <= high)
    known = np.isfinite(measured)
    return {
        name: float(held[..., j][known[..., j]].mean())
        for j, name in enumerate(runs.channels)
        if known[..., j].any()
    }


def _interval(error: Array, spread: Array, time: Array) -> tuple[float, float, float]:
    """Floor, growth and factor of one channel; error and spread (runs, T)."""
    known = np.isfinite(error)
    if not known.any():
        return 0.0, 0.0, 1.0
    count = known.sum(axis=0)
    square = np.where(known, error**2 - spread**2, 0.0).sum(axis=0) / np.maximum(count, 1)
    own = np.sqrt(np.maximum(square, 0.0))
    growth, floor = np.polyfit(np.sqrt(time), own, 1, w=np.sqrt(count)) if len(time) > 1 else (0.0, own[0])
    if growth < 0 or floor < 0:
        growth, floor = max(growth, 0.0), max(floor, 0.0)
    width = np.sqrt(spread**2 + (floor + growth * np.sqrt(time)) ** 2)
    ratio = np.abs(error[known]) / np.maximum(width[known], 1e-9)
    return float(floor), float(growth), float(np.quantile(ratio, LEVEL))
