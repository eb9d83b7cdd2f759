"""Third forms of the faults of measurement."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace

import numpy as np

from deeptruck_exam.hidden import (
    GRAVITY,
    Array,
    Effect,
    Fault,
    Kind,
    Planted,
    Setting,
    register,
)

SIGN = {"sign": (-1.0, 1.0)}


def _clock_set_again(p: SimpleNamespace) -> Fault:
    def spoil(channels: dict[str, Array], dt: float, rng: np.random.Generator) -> None:
        time = np.arange(len(channels["acceleration"])) * dt
        since = (time + rng.uniform(0.0, p.every_s)) % p.every_s / p.every_s
        late = np.sign(p.sign) * (p.least_s + (p.most_s - p.least_s) * since)
        channels["acceleration"] = np.interp(time - late, time, channels["acceleration"])

    return spoil


def _commands_from_another_clock(p: SimpleNamespace) -> Fault:
    def spoil(channels: dict[str, Array], dt: float, rng: np.random.Generator) -> None:
        for name in ("engine_command", "brake_command"):
            time = np.arange(len(channels[name])) * dt
            channels[name] = np.interp(time - p.late_s, time, channels[name])

    return spoil


def _driven_wheel_speed(p: SimpleNamespace) -> Fault:
    def spoil(channels: dict[str, Array], dt: float, rng: np.random.Generator) -> None:
        felt = channels["acceleration"] + GRAVITY * channels.get("grade", np.zeros(1))
        width = max(1, round(0.6 / dt))
        pull = np.convolve(felt, np.ones(width) / width, mode="same")
        slip = np.clip(p.per_mps2 * pull, -0.02, 0.02)
        channels["speed"] = channels["speed"] * (1.0 + np.sign(p.sign) * p.scale + slip)

    return spoil


def _shaken_accelerometer(p: SimpleNamespace) -> Fault:
    def spoil(channels: dict[str, Array], dt: float, rng: np.random.Generator) -> None:
        shaken = p.at_rest + (1.0 - p.at_rest) * np.clip(channels["speed"] / 20.0, 0.0, 1.5) ** 2
        channels["acceleration"] = channels["acceleration"] + np.sign(p.sign) * p.bias * shaken

    return spoil


def _sinking_air_spring(p: SimpleNamespace) -> Fault:
    def spoil(channels: dict[str, Array], dt: float, rng: np.random.Generator) -> None:
        part = np.linspace(0.0, 1.0, len(channels["grade"])) - 0.5
        bias = p.bias * (1.0 + rng.uniform(-0.2, 0.2) + p.sinks * part)
        channels["grade"] = channels["grade"] + np.sign(p.sign) * bias

    return spoil


def _add(
    key: str,
    name: str,
    source: str,
    ranges: dict[str, tuple[float, float]],
    fault: Callable[[SimpleNamespace], Fault],
    needs: tuple[str, ...] = ("highway", "suburban", "hills", "descent"),
    accepts: tuple[str, ...] = (),
    conceal: tuple[str, ...] = (),
) -> None:
    def build(setting: Setting, p: SimpleNamespace) -> Planted:
        return Planted(faults=(fault(p),), conceal=conceal)

    kind: Kind = "measurement_fault"
    register(Effect(key, name, kind, source, ranges, build, needs=needs, accepts=accepts, forms="third"))


_add(
    "clock_set_again",
    "clock_offset",
    "A clock that runs away and is stepped back at intervals, as the Network Time Protocol does (RFC 5905):"
    " the accelerometer's delay is a saw tooth; rate and interval are chosen here",
    {"least_s": (0.25, 0.5), "most_s": (0.7, 1.4), "every_s": (40.0, 110.0), **SIGN},
    _clock_set_again,
    needs=("suburban", "hills"),
)
_add(
    "commands_from_another_clock",
    "clock_offset",
    "Commands stamped on arrival at a slow gateway (SAE J1939-21 messages carry no time), so that the truck"
    " seems to answer before it is asked; sizes chosen here",
    {"late_s": (0.35, 0.9)},
    _commands_from_another_clock,
    needs=("suburban", "hills"),
)
_add(
    "driven_wheel_speed",
    "speed_scale",
    "Speed from the gearbox's output shaft with a wrong factor: driven wheels slip in proportion to their"
    " pull (Wong, Theory of Ground Vehicles, on longitudinal stiffness); sizes chosen here",
    {"scale": (0.035, 0.085), "per_mps2": (0.003, 0.010), **SIGN},
    _driven_wheel_speed,
)
_add(
    "shaken_accelerometer",
    "acceleration_bias",
    "Vibration rectification (IEEE Std 1293): the bias grows with the square of the shaking, and that with"
    " road speed; sizes of a loose bracket, chosen here",
    {"bias": (0.16, 0.42), "at_rest": (0.3, 0.7), **SIGN},
    _shaken_accelerometer,
)
_add(
    "sinking_air_spring",
    "grade_bias",
    "An inclinometer on a frame whose air spring leaks: pitch by ride height over wheelbase (Gillespie,"
    " Fundamentals of Vehicle Dynamics, 1992, on suspensions); height and leak are chosen here",
    {"bias": (0.009, 0.024), "sinks": (0.2, 0.8), **SIGN},
    _sinking_air_spring,
    accepts=("rolling_resistance",),
    conceal=("elevation",),
)
