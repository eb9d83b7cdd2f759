"""Fifth forms of the faults of measurement."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace

import numpy as np

from deeptruck_exam.hidden import (
    GRAVITY,
    SCENARIOS,
    Array,
    Effect,
    Fault,
    Planted,
    Setting,
    register,
)

SIGN = {"sign": (-1.0, 1.0)}


def _samples_counted(p: SimpleNamespace) -> Fault:
    def spoil(channels: dict[str, Array], dt: float, rng: np.random.Generator) -> None:
        values = channels["acceleration"]
        time = np.arange(len(values)) * dt
        losses = np.sort(rng.uniform(0.0, time[-1], int(rng.poisson(time[-1] / p.every_s)) + 1))
        each = (p.last_s - p.first_s) / len(losses)
        off = np.sign(p.sign) * (p.first_s + each * np.searchsorted(losses, time))
        channels["acceleration"] = np.interp(time - off, time, values)

    return spoil


def _two_time_bases(p: SimpleNamespace) -> Fault:
    def spoil(channels: dict[str, Array], dt: float, rng: np.random.Generator) -> None:
        values = channels["acceleration"]
        time = np.arange(len(values)) * dt
        period = p.period_s * rng.uniform(0.9, 1.1)
        ramp = ((time + rng.uniform(0.0, period)) % period) / period
        late = np.sign(p.sign) * (p.late_s + p.saw_s * (ramp - 0.5))
        channels["acceleration"] = np.interp(time - late, time, values)

    return spoil


def _handover_between_sensors(p: SimpleNamespace) -> Fault:
    def spoil(channels: dict[str, Array], dt: float, rng: np.random.Generator) -> None:
        speed = channels["speed"]
        wheel = np.clip((speed - p.from_mps) / 1.5, 0.0, 1.0)  # below it the gearbox is counted
        channels["speed"] = speed * (1.0 + np.sign(p.sign) * p.scale * wheel)

    return spoil


def _zeroed_on_a_slope(p: SimpleNamespace) -> Fault:
    def spoil(channels: dict[str, Array], dt: float, rng: np.random.Generator) -> None:
        stands = channels["speed"] < 0.05
        begins = np.flatnonzero(stands & ~np.append(False, stands[:-1]))
        bias = np.full(len(stands), np.sign(p.sign) * p.bias)
        for at in begins:
            there = np.clip(GRAVITY * channels["grade"][at], -0.25, 0.25)
            bias[at:] = np.sign(p.sign) * p.bias * rng.uniform(0.8, 1.2) + p.takes * there
        channels["acceleration"] = channels["acceleration"] + bias

    return spoil


def _sticking_pendulum(p: SimpleNamespace) -> Fault:
    def spoil(channels: dict[str, Array], dt: float, rng: np.random.Generator) -> None:
        out = channels["grade"].copy()
        for k in range(1, len(out)):
            out[k] = min(max(out[k - 1], out[k] - p.sticks), out[k] + p.sticks)
        channels["grade"] = out + np.sign(p.sign) * p.bias

    return spoil


def add_fault(
    key: str,
    name: str,
    source: str,
    ranges: dict[str, tuple[float, float]],
    fault: Callable[[SimpleNamespace], Fault],
    *,
    needs: tuple[str, ...] = SCENARIOS,
    accepts: tuple[str, ...] = (),
    conceal: tuple[str, ...] = (),
    forms: str = "fifth",
) -> None:
    """Register a fault of measurement as a hidden effect."""

    def build(setting: Setting, p: SimpleNamespace) -> Planted:
        return Planted(faults=(fault(p),), conceal=conceal)

    register(
        Effect(
            key, name, "measurement_fault", source, ranges, build, needs=needs, accepts=accepts, forms=forms
        )
    )


add_fault(
    "samples_counted",
    "clock_offset",
    "Loggers that count samples instead of stamping them: every frame that is lost or doubled moves all that"
    " follow (fleet loggers' data sheets on buffer overruns), so that the clock is off by more and more"
    " during a drive, in steps; sizes are chosen here",
    {"first_s": (0.2, 0.45), "last_s": (0.7, 1.3), "every_s": (10.0, 40.0), **SIGN},
    _samples_counted,
    needs=("suburban", "hills"),
)
add_fault(
    "two_time_bases",
    "clock_offset",
    "Two computers that meet once in a while: the time of one runs at another rate until it is set again, a"
    " saw tooth about a constant offset (Mills, Computer Network Time Synchronization, 2011); sizes are"
    " chosen here",
    {"late_s": (0.4, 1.0), "saw_s": (0.1, 0.5), "period_s": (15.0, 60.0), **SIGN},
    _two_time_bases,
    needs=("suburban", "hills"),
)
add_fault(
    "handover_between_sensors",
    "speed_scale",
    "Control units that count gearbox pulses at walking pace and wheel pulses above it, of which the second"
    " have a wrong factor (service manuals on tone rings and tachograph calibration); sizes are chosen here",
    {"scale": (0.035, 0.085), "from_mps": (2.0, 6.0), **SIGN},
    _handover_between_sensors,
)
add_fault(
    "zeroed_on_a_slope",
    "acceleration_bias",
    "Inertial units that take standstill for level: they find a new zero at every stop, with a part of the"
    " slope there, and keep a false one otherwise (zero velocity updates: Groves, Principles of GNSS,"
    " Inertial and Multisensor Navigation Systems, 2013); sizes are chosen here",
    {"bias": (0.14, 0.38), "takes": (0.3, 0.9), **SIGN},
    _zeroed_on_a_slope,
)
add_fault(
    "sticking_pendulum",
    "grade_bias",
    "Pendulum inclinometers in gearboxes: bearing friction holds the pendulum until the slope has changed"
    " enough (hysteresis in suppliers' data sheets), upon a zero taken in a yard that is not level; sizes"
    " are chosen here",
    {"bias": (0.009, 0.023), "sticks": (0.0008, 0.0035), **SIGN},
    _sticking_pendulum,
    accepts=("rolling_resistance",),
    conceal=("elevation",),
)
