"""Second forms of the faults of measurement: each varies as the constants of effects_data.py do not."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from deeptruck_exam.hidden import Array, Effect, Planted, Setting, register

SIGN = {"sign": (-1.0, 1.0)}


def _clock_set_daily(setting: Setting, p: SimpleNamespace) -> Planted:
    def spoil(channels: dict[str, Array], dt: float, rng: np.random.Generator) -> None:
        late = np.sign(p.sign) * p.late_s * rng.uniform(1.0 - p.spread, 1.0 + p.spread)
        time = np.arange(len(channels["acceleration"])) * dt
        channels["acceleration"] = np.interp(time - late, time, channels["acceleration"])

    return Planted(faults=(spoil,))


def _growing_tyre(setting: Setting, p: SimpleNamespace) -> Planted:
    def spoil(channels: dict[str, Array], dt: float, rng: np.random.Generator) -> None:
        speed = channels["speed"]
        grown = 1.0 - p.growth * (speed / 25.0) ** 2  # a larger tyre turns slower
        channels["speed"] = speed * (1.0 + np.sign(p.sign) * p.scale) * grown

    return Planted(faults=(spoil,))


def _warming_accelerometer(setting: Setting, p: SimpleNamespace) -> Planted:
    def spoil(channels: dict[str, Array], dt: float, rng: np.random.Generator) -> None:
        time = np.arange(len(channels["acceleration"])) * dt
        warm = 1.0 + p.cold * np.exp(-time / p.warm_s)
        channels["acceleration"] = channels["acceleration"] + np.sign(p.sign) * p.bias * warm

    return Planted(faults=(spoil,))


def _pitching_inclinometer(setting: Setting, p: SimpleNamespace) -> Planted:
    def spoil(channels: dict[str, Array], dt: float, rng: np.random.Generator) -> None:
        width = max(1, round(1.0 / dt))
        felt = np.convolve(channels["acceleration"], np.ones(width) / width, mode="same")
        channels["grade"] = channels["grade"] + np.sign(p.sign) * p.bias + p.pitch * felt

    return Planted(faults=(spoil,), conceal=("elevation",))


register(
    Effect(
        "clock_set_daily",
        "clock_offset",
        "measurement_fault",
        "A logger that sets its clock at power-on from a coarse time message (SAE J1939-71 Time/Date counts"
        " in quarters of a second): the accelerometer is late or early by another amount each drive",
        {"late_s": (0.4, 1.1), "spread": (0.05, 0.3), **SIGN},
        _clock_set_daily,
        needs=("suburban", "hills"),
        forms="second",
    )
)
register(
    Effect(
        "growing_tyre",
        "speed_scale",
        "measurement_fault",
        "Rolling radius grows with speed squared (Wong, Theory of Ground Vehicles, on radial tyres; a per"
        " cent at motorway speed) upon a wrong tyre factor; sizes chosen here",
        {"scale": (0.035, 0.085), "growth": (0.002, 0.012), **SIGN},
        _growing_tyre,
        forms="second",
    )
)
register(
    Effect(
        "warming_accelerometer",
        "acceleration_bias",
        "measurement_fault",
        "Turn-on transient of a MEMS bias as the box warms (Groves, Principles of GNSS, Inertial and"
        " Multisensor Navigation, 2013, ch. 4, on inertial errors); time constant and size chosen here",
        {"bias": (0.12, 0.35), "cold": (-0.4, 0.6), "warm_s": (50.0, 150.0), **SIGN},
        _warming_accelerometer,
        forms="second",
    )
)
register(
    Effect(
        "pitching_inclinometer",
        "grade_bias",
        "measurement_fault",
        "An inclinometer on the cab pitches with it, squat under traction and dive under braking (Gillespie,"
        " Fundamentals of Vehicle Dynamics, on anti-dive), upon its mounting error; sizes chosen here",
        {"bias": (0.009, 0.024), "pitch": (0.0005, 0.002), **SIGN},
        _pitching_inclinometer,
        accepts=("rolling_resistance",),
        forms="second",
    )
)
