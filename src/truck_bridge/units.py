"""Conversion of bus units to deeptruck's: value there = factor times value on the bus."""

from __future__ import annotations

import math

from truck_bridge.errors import InputError

SI: dict[str, tuple[float, str]] = {
    "km/h": (1 / 3.6, "m/s"),
    "rpm": (math.pi / 30, "rad/s"),
    "l/h": (1000 / 3600, "cm^3/s"),
}


def to_si(unit: str) -> tuple[float, str]:
    """Factor and SI unit; a unit that needs no conversion is returned unchanged."""
    return SI.get(unit, (1.0, unit))


COMMANDS: dict[str, dict[str, tuple[float, str]]] = {  # a demand to brake is below zero on the bus
    "engine_command": {
        "%": (1.0, "percent"),
        "N m": (1.0, "N m"),
        "Nm": (1.0, "N m"),
        "l/h": SI["l/h"],
        "g/s": (1.0, "g/s"),
    },
    "brake_command": {
        "%": (1.0, "percent"),
        "m/s^2": (-1.0, "m/s^2"),
        "kPa": (0.01, "bar"),
        "bar": (1.0, "bar"),
    },
}


def of_command(channel: str, unit: str) -> tuple[float, str]:
    """Factor and truck-interface unit for a command in a bus unit. Raises InputError if no interface
    has it."""
    known = COMMANDS[channel]
    if unit not in known:
        raise InputError(
            f"columns: {channel} cannot be in '{unit}'; choose a signal in {', '.join(known)}, or none"
        )
    return known[unit]
