"""Units of the bus to SI: value in SI = factor times value on the bus."""

from __future__ import annotations

import math

SI: dict[str, tuple[float, str]] = {
    "km/h": (1 / 3.6, "m/s"),
    "rpm": (math.pi / 30, "rad/s"),
    "l/h": (1000 / 3600, "cm^3/s"),
}


def to_si(unit: str) -> tuple[float, str]:
    """Factor and SI unit; units that need no change come back as they are."""
    return SI.get(unit, (1.0, unit))
