"""Ten sensor faults: functions that corrupt one recording's channels in place."""

from __future__ import annotations

import numpy as np

from deeptruck_core.arrays import Array
from deeptruck_exam.laws.catalogue import SIGN, fault, sizes
from deeptruck_exam.laws.law import Channels, Sizes
from deeptruck_exam.laws.series import lagged, ou_series


@fault("acceleration_bias")
@sizes(bias=(0.12, 0.40), drift=(0.0, 0.03), sign=SIGN)
def mounting_pitch(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """The accelerometer is pitched by 1 to 2 degrees, and drifts with temperature.
    Source: Woodman, An Introduction to Inertial Navigation, UCAM-CL-TR-696 (2007)."""
    drift = p.drift * ou_series(rng, (1, len(channels["acceleration"])), dt, 120.0)[0]
    channels["acceleration"] = channels["acceleration"] + np.sign(p.sign) * (p.bias + drift)


@fault("acceleration_bias")
@sizes(bias=(0.12, 0.35), cold=(-0.4, 0.6), warm_s=(50.0, 150.0), sign=SIGN)
def turn_on_drift(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """A bias that settles as the sensor warms up.
    Source: Groves, Principles of GNSS, Inertial and Multisensor Navigation (2013), ch. 4."""
    time = np.arange(len(channels["acceleration"])) * dt
    warm = 1.0 + p.cold * np.exp(-time / p.warm_s)
    channels["acceleration"] = channels["acceleration"] + np.sign(p.sign) * p.bias * warm


@fault("clock_offset", "suburban hills")
@sizes(late_s=(0.35, 1.2), drift_ppm=(-80.0, 80.0), sign=SIGN)
def late_accelerometer(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """The accelerometer is logged by another computer, whose clock has an offset and drifts.
    Source: SAE J1939-21 has no time stamps; crystals drift by tens of ppm."""
    late = np.sign(p.sign) * p.late_s
    n = np.arange(len(channels["acceleration"])) * dt
    channels["acceleration"] = np.interp(n - late - 1e-6 * p.drift_ppm * n, n, channels["acceleration"])


def _shift(values: Array, dt: float, late_s: float) -> Array:
    n = np.arange(len(values)) * dt
    return np.interp(n - late_s, n, values)


@fault("clock_offset", "suburban hills", accepts="command_delay")
@sizes(late_s=(0.35, 1.0))
def late_responses(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """The stamps of all responses are late relative to the commands, as with a gateway that buffers.
    Source: SAE J1939-21 has no time stamps."""
    for name in ("acceleration", "speed", "fuel_rate", "gear", "engine_speed", "engine_torque"):
        if name in channels:
            channels[name] = _shift(channels[name], dt, p.late_s)


@fault("clock_offset", "suburban hills")
@sizes(late_s=(0.4, 1.1), spread=(0.05, 0.3), sign=SIGN)
def clock_set_daily(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """The logger sets its clock at power-on from a coarse time message, so that the accelerometer has another
    time offset in each drive.
    Source: SAE J1939-71, Time/Date, which counts in quarters of a second."""
    late = np.sign(p.sign) * p.late_s * rng.uniform(1.0 - p.spread, 1.0 + p.spread)
    channels["acceleration"] = _shift(channels["acceleration"], dt, late)


@fault("grade_bias", accepts="rolling_resistance", withheld="elevation")
@sizes(bias=(0.008, 0.025), sign=SIGN)
def tilted_inclinometer(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """The inclinometer is tilted by 0.5 to 1.5 degrees.
    Source: Vahidi, Stefanopoulou and Peng, Vehicle System Dynamics 43 (2005), on estimating grade and mass.
    """
    channels["grade"] = channels["grade"] + np.sign(p.sign) * p.bias


@fault("grade_bias", accepts="rolling_resistance", withheld="elevation")
@sizes(bias=(0.009, 0.024), pitch=(0.0005, 0.002), sign=SIGN)
def pitching_inclinometer(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """A tilted inclinometer that also pitches with the cab: squat under traction and dive under braking.
    Source: Gillespie, Fundamentals of Vehicle Dynamics (1992), on anti-dive."""
    width = max(1, round(1.0 / dt))
    felt = np.convolve(channels["acceleration"], np.ones(width) / width, mode="same")
    channels["grade"] = channels["grade"] + np.sign(p.sign) * p.bias + p.pitch * felt


@fault("grade_bias", accepts="rolling_resistance", withheld="elevation")
@sizes(bias=(0.009, 0.022), port_m=(2.0, 6.0), lag_s=(0.5, 2.5), sign=SIGN)
def barometer_slope(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Slope from a barometer whose port is exposed to the airflow, so that a change of speed is read as a
    slope.
    Source: Gracey, Measurement of Aircraft Speed and Altitude, NASA RP-1046 (1980), on position error."""
    speed = channels["speed"]
    # air that presses on the port is read as height, and its change as slope
    height = p.port_m * (speed / 25.0) ** 2
    slope = np.gradient(height, dt) / np.maximum(speed, 3.0)
    felt = lagged(np.clip(slope, -0.05, 0.05), p.lag_s, dt)
    channels["grade"] = channels["grade"] + np.sign(p.sign) * p.bias + felt


@fault("speed_scale")
@sizes(scale=(0.03, 0.09), sign=SIGN)
def tyre_factor(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """A wrong tyre factor or a worn tyre.
    Source: SAE J1025, tire revolutions per kilometre."""
    channels["speed"] = channels["speed"] * (1.0 + np.sign(p.sign) * p.scale)


@fault("speed_scale")
@sizes(scale=(0.035, 0.085), growth=(0.002, 0.012), sign=SIGN)
def growing_tyre(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """A wrong tyre factor, and a radius that grows with speed squared.
    Source: Wong, Theory of Ground Vehicles, on the rolling radius of tyres."""
    speed = channels["speed"]
    grown = 1.0 - p.growth * (speed / 25.0) ** 2  # a larger tyre turns slower
    channels["speed"] = speed * (1.0 + np.sign(p.sign) * p.scale) * grown
