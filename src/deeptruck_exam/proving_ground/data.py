"""Seventh forms of the faults of measurement."""

from __future__ import annotations

from functools import partial
from types import SimpleNamespace

import numpy as np

from deeptruck_exam.fleet_trials.data import SIGN, add_fault
from deeptruck_exam.fleet_trials.harness import behind
from deeptruck_exam.hidden import Array, Fault

add = partial(add_fault, forms="seventh")


def _slewed_clock(p: SimpleNamespace) -> Fault:
    def spoil(channels: dict[str, Array], dt: float, rng: np.random.Generator) -> None:
        values = channels["acceleration"]
        time = np.arange(len(values)) * dt
        begins = rng.uniform(0.1, 0.6) * time[-1]
        slewed = np.maximum(time - begins, 0.0) * p.slews
        off = np.maximum(p.late_s * rng.uniform(0.8, 1.2) - slewed, 0.15)
        channels["acceleration"] = np.interp(time - np.sign(p.sign) * off, time, values)

    return spoil


def _radius_from_the_rolls(p: SimpleNamespace) -> Fault:
    def spoil(channels: dict[str, Array], dt: float, rng: np.random.Generator) -> None:
        speed = channels["speed"]
        warm = 1.0 - np.exp(-np.cumsum(speed) * dt / 2000.0)
        grows = p.grows * (speed / 25.0) ** 2 + p.warms * warm
        channels["speed"] = speed * (1.0 + np.sign(p.sign) * (p.scale - grows))

    return spoil


def _settles_after_power_up(p: SimpleNamespace) -> Fault:
    def spoil(channels: dict[str, Array], dt: float, rng: np.random.Generator) -> None:
        time = np.arange(len(channels["acceleration"])) * dt + rng.uniform(0.0, p.settles_s)
        bias = p.bias * (1.0 - p.cold * np.exp(-time / p.settles_s))
        channels["acceleration"] = channels["acceleration"] + np.sign(p.sign) * bias

    return spoil


def _barometer_in_the_wind(p: SimpleNamespace) -> Fault:
    def spoil(channels: dict[str, Array], dt: float, rng: np.random.Generator) -> None:
        speed = channels["speed"]
        # air that presses on the port is read as height, and its change as slope
        height = p.port_m * (speed / 25.0) ** 2
        slope = np.gradient(height, dt) / np.maximum(speed, 3.0)
        felt = behind(np.clip(slope, -0.05, 0.05), p.lag_s, dt)
        channels["grade"] = channels["grade"] + np.sign(p.sign) * p.bias + felt

    return spoil


add(
    "slewed_clock",
    "clock_offset",
    "Clocks that are slewed, not stepped, towards network time (RFC 5905, Network Time Protocol Version 4,"
    " on clock discipline): an offset that is there from the start melts at a constant rate once the server"
    " has answered",
    {"late_s": (0.35, 0.8), "slews": (0.0005, 0.003), **SIGN},
    _slewed_clock,
    needs=("suburban", "hills"),
)
add(
    "radius_from_the_rolls",
    "speed_scale",
    "SAE J1025, Test Procedures for Measuring Truck Tire Revolutions Per Kilometer/Mile: a constant taken on"
    " rolls is wrong on the road, and less so as the tyre grows with speed and warmth",
    {"scale": (0.05, 0.09), "grows": (0.005, 0.02), "warms": (0.002, 0.01), **SIGN},
    _radius_from_the_rolls,
)
add(
    "settles_after_power_up",
    "acceleration_bias",
    "Accelerometers drift for minutes after they are switched on, as they warm themselves (IEEE Std 1293 on"
    " turn-on transients and bias); each drive begins with a box switched on a little before",
    {"bias": (0.17, 0.38), "cold": (0.25, 0.7), "settles_s": (40.0, 150.0), **SIGN},
    _settles_after_power_up,
)
add(
    "barometer_in_the_wind",
    "grade_bias",
    "Slope from a barometer whose port lies in the wind of driving (position error of static ports: Gracey,"
    " Measurement of Aircraft Speed and Altitude, NASA RP-1046, 1980): a change of speed is read as a slope,"
    " upon a mounting error of the levelled box it is joined with",
    {"bias": (0.009, 0.022), "port_m": (2.0, 6.0), "lag_s": (0.5, 2.5), **SIGN},
    _barometer_in_the_wind,
    accepts=("rolling_resistance",),
    conceal=("elevation",),
)
