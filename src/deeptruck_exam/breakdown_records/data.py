"""Sixth forms of the faults of measurement."""

from __future__ import annotations

from functools import partial
from types import SimpleNamespace

import numpy as np
from scipy.signal import lfilter

from deeptruck_exam.fleet_trials.data import SIGN, add_fault
from deeptruck_exam.hidden import GRAVITY, Array, Fault

add = partial(add_fault, forms="sixth")


def _stamped_by_the_way(p: SimpleNamespace) -> Fault:
    def spoil(channels: dict[str, Array], dt: float, rng: np.random.Generator) -> None:
        values, speed = channels["acceleration"], channels["speed"]
        time = np.arange(len(values)) * dt
        late = np.sign(p.sign) * (p.late_s + p.metres / np.maximum(speed, 6.0))
        channels["acceleration"] = np.interp(time - late, time, values)

    return spoil


def _one_of_two_wheels(p: SimpleNamespace) -> Fault:
    def spoil(channels: dict[str, Array], dt: float, rng: np.random.Generator) -> None:
        speed = channels["speed"]
        time = np.arange(len(speed)) * dt
        turns = np.cumsum(rng.exponential(p.stays_s, 60) + 5.0)
        alone = (np.searchsorted(turns, time) + rng.integers(2)) % 2
        off = np.sign(p.sign) * p.scale * np.where(alone > 0, 1.0, p.shared)
        # the control unit fades from one to the other
        channels["speed"] = speed * (1.0 + np.convolve(np.pad(off, 10, "edge"), np.ones(21) / 21, "valid"))

    return spoil


def _moved_by_shocks(p: SimpleNamespace) -> Fault:
    def spoil(channels: dict[str, Array], dt: float, rng: np.random.Generator) -> None:
        values = channels["acceleration"]
        jerk = np.abs(np.diff(values, prepend=values[0]))
        shock = (jerk > np.quantile(jerk, 0.985)) & (jerk > 0.0)
        moves = np.cumsum(shock * rng.standard_normal(len(values)))
        moves = np.clip(p.moves * moves, -0.6, 0.6)
        channels["acceleration"] = values + np.sign(p.sign) * p.bias * (1.0 + moves)

    return spoil


def _vertical_gyro(p: SimpleNamespace) -> Fault:
    def spoil(channels: dict[str, Array], dt: float, rng: np.random.Generator) -> None:
        keep = np.exp(-dt / p.erects_s)
        felt = np.clip(channels["acceleration"], -3.0, 3.0) / GRAVITY
        horizon = lfilter([1.0 - keep], [1.0, -keep], felt)
        channels["grade"] = channels["grade"] + np.sign(p.sign) * p.bias + horizon

    return spoil


add(
    "stamped_by_the_way",
    "clock_offset",
    "Survey vans sample by pulses of the wheel, not by time (Sayers and Karamihas, The Little Book of"
    " Profiling, 1998, on distance-triggered profilers): metres between sensor and pulse are a time that"
    " falls with speed, beside a delay of the sensor; sizes are chosen here",
    {"late_s": (0.2, 0.5), "metres": (3.0, 8.0), **SIGN},
    _stamped_by_the_way,
    needs=("suburban", "hills"),
)
add(
    "one_of_two_wheels",
    "speed_scale",
    "Control units that take the mean of two wheels, and one alone while the other's sensor fails (Automotive"
    " Handbook, Bosch, on wheel speed sensors and substitute values): the one that is left has a tyre of"
    " another size; sizes and times are chosen here",
    {"scale": (0.045, 0.09), "shared": (0.45, 0.7), "stays_s": (20.0, 60.0), **SIGN},
    _one_of_two_wheels,
)
add(
    "moved_by_shocks",
    "acceleration_bias",
    "Zero-g offsets of micromachined accelerometers move with shocks (data sheets on mechanical shock and"
    " offset; IEEE Std 1293 on bias errors): a little to either side at each of the hardest jerks; sizes are"
    " chosen here",
    {"bias": (0.15, 0.38), "moves": (0.04, 0.15), **SIGN},
    _moved_by_shocks,
)
add(
    "vertical_gyro",
    "grade_bias",
    "Vertical gyros are erected slowly to the gravity they feel, so that a long acceleration tilts their"
    " horizon (Titterton and Weston, Strapdown Inertial Navigation Technology, on attitude references), upon"
    " a mounting error; sizes are chosen here",
    {"bias": (0.009, 0.023), "erects_s": (20.0, 90.0), **SIGN},
    _vertical_gyro,
    accepts=("rolling_resistance",),
    conceal=("elevation",),
)
