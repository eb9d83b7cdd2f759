"""Coast-down coefficients: the road load of a truck in neutral on a level road, F = A + B v + C v^2.

They are measured by coast-down tests (SAE J1263 or J2263) and printed in certificates.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from deeptruck_core.errors import InputError

LBF, MPH, KMH = 4.4482216152605, 0.44704, 1.0 / 3.6  # in N and m/s: NIST SP 811
UNITS = {"N, m/s": (1.0, 1.0), "N, km/h": (1.0, KMH), "lbf, mph": (LBF, MPH)}
KEY = "coast_down"
REPLACES = ("drag_area", "rolling_resistance", "rolling_resistance_speed")
EXAMPLE = "{a: 900, b: 3.5, c: 0.28, unit: 'N, km/h'}"


@dataclass(frozen=True)
class CoastDown:
    """A in N, B in N/(m/s), C in N/(m/s)^2."""

    a: float
    b: float
    c: float

    @staticmethod
    def of(values: Mapping[str, float]) -> CoastDown:
        """Coefficients from a physics truck's parameters. Losses between gearbox and wheels are not
        included."""
        weight = values["mass"] * values["gravity"]
        return CoastDown(
            values["rolling_resistance"] * weight,
            values["rolling_resistance_speed"] * weight,
            0.5 * values["air_density"] * values["drag_area"],
        )

    @staticmethod
    def read(entry: Any, source: str) -> CoastDown:
        """Coefficients from a table such as EXAMPLE. Raises InputError."""
        if not isinstance(entry, Mapping) or set(entry) != {"a", "b", "c", "unit"}:
            raise InputError(f"{source}: '{KEY}' needs a, b, c and unit, such as {EXAMPLE}")
        if entry["unit"] not in UNITS:
            known = ", ".join(f"'{unit}'" for unit in UNITS)
            raise InputError(f"{source}: '{KEY}' has the unit {entry['unit']!r}; choose from {known}")
        force, speed = UNITS[entry["unit"]]
        try:
            a, b, c = (float(entry[name]) for name in "abc")
        except (TypeError, ValueError):
            raise InputError(f"{source}: a, b and c of '{KEY}' must be numbers") from None
        if not np.isfinite([a, b, c]).all() or min(a, b, c) < 0.0:
            raise InputError(
                f"{source}: a, b and c of '{KEY}' must be finite and not below zero; fit them again with b "
                "held at zero where it came out negative"
            )
        return CoastDown(a * force, b * force / speed, c * force / speed**2)

    def printed(self, unit: str) -> tuple[float, float, float]:
        """A, B and C in the given one of UNITS."""
        force, speed = UNITS[unit]
        return self.a / force, self.b * speed / force, self.c * speed**2 / force

    def parameters(self, values: Mapping[str, float]) -> dict[str, float]:
        """Values of the parameters REPLACES that give this road load to a truck with the other `values`."""
        weight = values["mass"] * values["gravity"]
        found = (2.0 * self.c / values["air_density"], self.a / weight, self.b / weight)
        return dict(zip(REPLACES, found, strict=True))
