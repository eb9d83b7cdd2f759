"""Units used in logs, and their conversion to the canonical units (SI, see signals.CHANNELS)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from deeptruck_core.arrays import Array
from deeptruck_core.constants import GRAVITY
from deeptruck_core.errors import InputError
from deeptruck_core.reading import near
from deeptruck_core.signals import BRAKE_UNITS, CHANNELS, ENGINE_UNITS

AXIS_M, ECCENTRICITY_SQUARED = 6378137.0, 0.00669437999  # half the long axis of WGS84
DIESEL_DENSITY = 0.832  # g/cm^3 at 15 degC, middle of EN 590's 0.820 to 0.845

TIME_UNITS = {
    "s": 1.0, "sec": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0,
    "days": 86400.0, "d": 86400.0,
}  # fmt: skip
# canonical unit -> spelling (lower case, no blanks) -> (factor, offset): canonical = factor * value + offset
_LINEAR: dict[str, dict[str, tuple[float, float]]] = {
    "m/s": {
        "m/s": (1.0, 0.0), "mps": (1.0, 0.0), "km/h": (1 / 3.6, 0.0), "kph": (1 / 3.6, 0.0),
        "kmh": (1 / 3.6, 0.0), "cm/s": (0.01, 0.0), "mm/s": (1e-3, 0.0),
        "mph": (0.44704, 0.0), "mi/h": (0.44704, 0.0), "ft/s": (0.3048, 0.0),
        "knot": (1852 / 3600, 0.0), "kn": (1852 / 3600, 0.0),
    },
    "m/s^2": {
        "m/s^2": (1.0, 0.0), "m/s2": (1.0, 0.0), "g": (GRAVITY, 0.0), "ft/s^2": (0.3048, 0.0),
        "ft/s2": (0.3048, 0.0),
    },
    "N m": {
        "nm": (1.0, 0.0), "n*m": (1.0, 0.0), "n-m": (1.0, 0.0), "knm": (1000.0, 0.0),
        "lbft": (1.3558179483, 0.0), "ftlb": (1.3558179483, 0.0), "lb-ft": (1.3558179483, 0.0),
        "ft-lb": (1.3558179483, 0.0),
    },
    "percent": {
        "percent": (1.0, 0.0), "%": (1.0, 0.0), "ratio": (100.0, 0.0), "fraction": (100.0, 0.0),
        "1": (100.0, 0.0),
    },
    "bar": {
        "bar": (1.0, 0.0), "kpa": (0.01, 0.0), "mpa": (10.0, 0.0), "pa": (1e-5, 0.0),
        "psi": (0.0689475729, 0.0),
    },
    "g/s": {
        "g/s": (1.0, 0.0), "kg/h": (1 / 3.6, 0.0), "g/h": (1 / 3600, 0.0), "kg/s": (1000.0, 0.0),
        "mg/s": (1e-3, 0.0),
    },
    "cm^3/s": {
        "cm^3/s": (1.0, 0.0), "cm3/s": (1.0, 0.0), "cc/s": (1.0, 0.0), "ml/s": (1.0, 0.0),
        "l/h": (1 / 3.6, 0.0), "l/s": (1000.0, 0.0), "ml/min": (1 / 60, 0.0), "l/min": (1000 / 60, 0.0),
        "gal/h": (3785.411784 / 3600, 0.0), "gph": (3785.411784 / 3600, 0.0),
    },
    "1": {"1": (1.0, 0.0), "": (1.0, 0.0), "gear": (1.0, 0.0)},
    "rad/s": {
        "rad/s": (1.0, 0.0), "rpm": (math.pi / 30, 0.0), "1/min": (math.pi / 30, 0.0),
        "rev/min": (math.pi / 30, 0.0), "hz": (2 * math.pi, 0.0), "rev/s": (2 * math.pi, 0.0),
    },
    "m": {
        "m": (1.0, 0.0), "ft": (0.3048, 0.0), "feet": (0.3048, 0.0), "km": (1000.0, 0.0),
        "cm": (0.01, 0.0), "mm": (1e-3, 0.0),
    },
    "degC": {
        "degc": (1.0, 0.0), "°c": (1.0, 0.0), "c": (1.0, 0.0), "celsius": (1.0, 0.0), "k": (1.0, -273.15),
        "kelvin": (1.0, -273.15), "degf": (5 / 9, -160 / 9), "°f": (5 / 9, -160 / 9),
        "f": (5 / 9, -160 / 9),
    },
    "deg": {"deg": (1.0, 0.0), "°": (1.0, 0.0), "rad": (180 / math.pi, 0.0), "arcmin": (1 / 60, 0.0)},
    "ratio": {
        "ratio": (1.0, 0.0), "1": (1.0, 0.0), "m/m": (1.0, 0.0), "percent": (0.01, 0.0), "%": (0.01, 0.0),
        "permille": (0.001, 0.0),
    },
}  # fmt: skip
_NEAR = {  # units that a column without one may be in, and by how much its factor may be off, relative
    "speed": (0.04, ("m/s", "km/h", "mph", "ft/s", "knot", "cm/s", "mm/s")),
    "acceleration": (0.2, ("m/s^2", "g", "ft/s^2")),
    "grade": (0.25, ("ratio", "percent", "deg")),
}
_CLEARLY = 3.0  # times further off that the next unit is
_CONFUSED = (("km/h", "m/s"), ("km/h", "mph"), ("mph", "m/s"), ("knot", "km/h"), ("knot", "m/s"))
SPEED_RATIOS = {  # of a speed in one unit to the same in another, of units that are taken for one another
    (one, other): _LINEAR["m/s"][other][0] / _LINEAR["m/s"][one][0]
    for pair in _CONFUSED
    for one, other in (pair, pair[::-1])
}
_ANGLES = {"deg": math.pi / 180, "°": math.pi / 180, "rad": 1.0}  # grade as an angle: slope is its tangent


@dataclass(frozen=True)
class Conversion:
    """From a logged number to the canonical unit: `factor * value + offset`, or the tangent of an angle."""

    unit: str  # the canonical unit it leads to
    factor: float
    offset: float = 0.0
    angle: bool = False

    def __call__(self, values: Array) -> Array:
        if self.angle:
            return np.tan(self.factor * values)
        if self.factor == 1.0 and self.offset == 0.0:
            return values
        return self.factor * values + self.offset


def conversion(channel: str, unit: str | None, density: float | None = None) -> Conversion:
    """The conversion of values of `channel` in `unit` to the canonical unit; None stands for the canonical
    unit.

    Commands become one of signals.ENGINE_UNITS or BRAKE_UNITS, the one to which the unit belongs. A fuel rate
    by mass needs the fuel's density (g/cm^3 or kg/m^3, distinguished by its magnitude). Raises InputError for
    a unit that does not fit the channel.
    """
    if channel not in CHANNELS:
        raise InputError(f"unknown channel '{channel}'; {near(channel, list(CHANNELS))}")
    candidates = canonical_units(channel)
    if unit is None:
        if len(candidates) > 1:
            raise InputError(f"channel '{channel}' needs a unit: one of {', '.join(candidates)}")
        return Conversion(candidates[0], 1.0)
    spelling = _spelling(unit)
    if channel == "grade" and spelling in _ANGLES:
        return Conversion("ratio", _ANGLES[spelling], angle=True)
    for canonical in candidates:
        if spelling in _LINEAR[canonical]:
            factor, offset = _LINEAR[canonical][spelling]
            return Conversion(canonical, factor, offset)
    if channel == "fuel_rate" and spelling in _LINEAR["g/s"]:
        return Conversion("cm^3/s", _LINEAR["g/s"][spelling][0] / _density(density))
    known = ", ".join(known_units(channel))
    raise InputError(f"unit '{unit}' does not fit channel '{channel}'; use one of: {known}")


def fits(channel: str, unit: str) -> bool:
    """Whether a channel can have this unit."""
    try:
        conversion(channel, unit)
    except InputError:
        return False
    return True


def between(unit: str, other: str) -> tuple[float, float] | None:
    """Factor and offset from numbers in one unit to those in another; None if they measure different
    things."""
    one, two = _spelling(unit), _spelling(other)
    for known in _LINEAR.values():
        if one in known and two in known:
            (a, b), (c, d) = known[one], known[two]
            return a / c, (b - d) / c
    return None


def unit_of_factor(channel: str, factor: float) -> str:
    """The unit that turns numbers into the canonical unit by about this factor; '' if none does, or if
    another one is not much further off (km/h and ft/s are 9 % apart)."""
    near, units = _NEAR[channel]
    if not factor > 0.0:
        return ""
    off = sorted((abs(math.log(factor / conversion(channel, unit).factor)), unit) for unit in units)
    return off[0][1] if off[0][0] < min(near, off[1][0] / _CLEARLY) else ""


def metres_per_degree(latitude: Array | float) -> tuple[Array, Array]:
    """Metres per degree of longitude and of latitude, at latitudes (n,) in degrees, on the ellipsoid WGS84; a
    sphere is wrong by up to half a percent."""
    radians = np.radians(latitude)
    left = 1.0 - ECCENTRICITY_SQUARED * np.sin(radians) ** 2
    east, north = AXIS_M * np.cos(radians) / left**0.5, AXIS_M * (1.0 - ECCENTRICITY_SQUARED) / left**1.5
    return np.radians(east), np.radians(north)


def known_units(channel: str) -> list[str]:
    """Every accepted spelling of a channel's units."""
    spellings = [name for unit in canonical_units(channel) for name in _LINEAR[unit] if name]
    if channel == "grade":
        spellings += list(_ANGLES)
    if channel == "fuel_rate":
        spellings += list(_LINEAR["g/s"])
    return spellings


def canonical_units(channel: str) -> tuple[str, ...]:
    """The canonical unit of a channel; several if the truck interface decides which."""
    if channel == "engine_command":
        return ENGINE_UNITS
    return BRAKE_UNITS if channel == "brake_command" else (CHANNELS[channel].unit,)


def _spelling(unit: str) -> str:
    text = str(unit).strip().lower().replace("²", "^2").replace("³", "^3").replace("**", "^")
    return text.replace("·", "").replace(" ", "").strip("[]()")


def _density(density: float | None) -> float:
    """Density in g/cm^3 from a number in g/cm^3 or kg/m^3."""
    if density is None:
        return DIESEL_DENSITY
    if isinstance(density, bool) or not isinstance(density, int | float):
        raise InputError(f"density must be a number in g/cm^3 or kg/m^3, not {density!r}")
    if 0.3 <= density <= 3.0:
        return float(density)
    if 300.0 <= density <= 3000.0:
        return density / 1000.0
    raise InputError(f"density {density} is neither in g/cm^3 (about 0.83) nor in kg/m^3 (about 830)")
