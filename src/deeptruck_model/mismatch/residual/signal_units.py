"""Units of the signals that mechanisms lean on, as figures and regimes write them."""

from __future__ import annotations

from collections.abc import Mapping

from deeptruck_model.signals import printed

UNITS = {
    "speed": "m/s",
    "engine": "m/s²",
    "brake": "m/s²",
    "simulated": "m/s²",
    "grade": "rise/run",
    "ratio": "rad/m",
    "lever": "rad/m",
    "engine_speed": "rad/s",
    "gap": "m",
    "elapsed": "s",
    "elevation": "m",
    "ambient_temperature": "°C",
    "engine speed": "rad/s",
    "engine force": "m/s²",
    "engine power": "W/kg",
    "torque": "N m/kg",
    "time": "s",
}
UNITS_OF = {  # of names that begin so
    "time since ": "s",
    "braking power over ": "W/kg",
    "engine over ": "m/s²",
    "engine power over ": "W/kg",
    "speed over ": "m/s",
    "acceleration over ": "m/s²",
}


def unit(name: str, commands: Mapping[str, str]) -> str:
    """The unit of a signal, of a truck with these of its commands; empty where it has none."""
    starts = (u for start, u in UNITS_OF.items() if name.startswith(start))
    return printed(commands.get(name.removeprefix("change of "), "")) or UNITS.get(name) or next(starts, "")
