"""All names that a finding can have, by family: mechanisms, parameter errors, faults between sensors, and
`unknown`; and the parts of the budget, which are the families and the nonparametric terms.
"""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import get_args

from deeptruck_core.errors import InputError
from deeptruck_model.mismatch.mechanisms import LIBRARY, Mechanism
from deeptruck_model.mismatch.mechanisms.record import Family


@dataclass(frozen=True)
class Parameter:
    """A simulator parameter: its name in words, unit, and the manoeuvre that separates it from others."""

    name: str
    family: Family
    says: str
    manoeuvre: str
    unit: str = "1"
    mistaken_for: str = ""  # as of a mechanism


@dataclass(frozen=True)
class SensorError:
    """A fault visible between sensors alone: its equation, and the signals that must be recorded."""

    name: str
    family: Family
    equation: str
    needs: str


PARAMETER_ERRORS = {
    p.name: p
    for p in (
        Parameter(
            "mass", "load", "mass", "accelerate with the same torque at a low and a high speed", unit="kg"
        ),
        Parameter(
            "drag_area",
            "air_tyres_road",
            "drag area",
            "coast down from high speed on a flat road, both ways",
            unit="m^2",
        ),
        Parameter(
            "rolling_resistance",
            "air_tyres_road",
            "rolling resistance",
            "coast down at low speed on a flat road, both ways",
        ),
        Parameter(
            "torque_gain",
            "engine_driveline",
            "engine torque for a given command",
            "pull with steps of torque at one speed",
        ),
        Parameter(
            "brake_gain",
            "brakes",
            "brake force for a given command",
            "brake with steps of command from one speed",
            mistaken_for="brake",
        ),
    )
}
SENSOR_ERRORS = {
    s.name: s
    for s in (
        SensorError("acceleration_bias", "sensors", "accelerometer(t) = dv/dt + b", "acceleration, speed"),
        SensorError(
            "speed_scale", "sensors", "speed = k * true speed", "speed, and acceleration or engine_speed"
        ),
    )
}

ROOT = "mismatch"
UNKNOWN = "unknown"
FAMILIES = get_args(Family)
FAMILY: dict[str, str] = {
    **{s.name: s.family for s in SENSOR_ERRORS.values()},
    **{p.name: p.family for p in PARAMETER_ERRORS.values()},
    **{m.effect: m.family for m in LIBRARY.values()},
}
NAMES = {family: tuple(sorted(name for name in FAMILY if FAMILY[name] == family)) for family in FAMILIES}
FAMILY[UNKNOWN] = UNKNOWN


def joined(mechanisms: Sequence[Mechanism]) -> None:
    """Let the user's mechanisms be found, in the library and in the tree. Raises InputError for a name that
    the tool has."""
    for m in mechanisms:
        if m.effect in FAMILY and m.effect not in LIBRARY.own:
            raise InputError(f"'{m.effect}' is a name of the tool; choose another one for the mechanism")
    for m in mechanisms:
        LIBRARY.own[m.effect], FAMILY[m.effect] = m, m.family


LEFT_OVER, EACH_DRIVE, SLOW, PLACE, EVENT = "left_over", "each_drive", "slow", "place", "event"
SENSORS = "sensors"
HIDDEN = "unrecorded:brake"
PARTS = (*NAMES, PLACE, EACH_DRIVE, SLOW, HIDDEN, UNKNOWN, LEFT_OVER)  # of the budget
NAMED = (*LIBRARY, *PARAMETER_ERRORS, *SENSOR_ERRORS, UNKNOWN)


def check_excluded(names: Sequence[str]) -> None:
    """Raises InputError for a name that is no effect, which an examination would otherwise count
    as excluded."""
    for name in names:
        if name not in NAMED:
            near = difflib.get_close_matches(name, NAMED, 1)
            hint = f"; did you mean {near[0]}?" if near else "; docs/mismatch_effects.md lists them"
            raise InputError(f"there is no effect '{name}' to leave out{hint}")
