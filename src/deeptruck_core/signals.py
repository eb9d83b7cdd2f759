"""Definition of every channel with its unit, range and sign, and of the truck interfaces.

SI throughout. Commands keep the unit of the truck interface, because a percentage of an unknown reference
torque cannot be converted to N m.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import Any, NamedTuple

from deeptruck_core.errors import InputError
from deeptruck_core.vehicle_kinds import VehicleKind, check_vehicle, vehicle_kind


@dataclass(frozen=True)
class Channel:
    """One signal. `low` to `high` is the range a truck can produce; outside it a sample is invalid."""

    name: str
    unit: str
    low: float
    high: float
    meaning: str


CHANNELS: dict[str, Channel] = {
    c.name: c
    for c in (
        Channel("speed", "m/s", -1.0, 60.0, "longitudinal speed, forward positive"),
        Channel("acceleration", "m/s^2", -15.0, 10.0, "derivative of speed, forward positive"),
        Channel(
            "specific_force",
            "m/s^2",
            -15.0,
            12.0,
            "what an accelerometer along the vehicle reads: dv/dt + g sin(slope)",
        ),
        Channel("engine_command", "interface", -6000.0, 6000.0, "engine command; negative retards"),
        Channel("brake_command", "interface", 0.0, 200.0, "service brake command; positive brakes"),
        Channel("grade", "ratio", -0.4, 0.4, "road slope rise/run, uphill positive"),
        Channel("fuel_rate", "cm^3/s", 0.0, 100.0, "fuel volume flow"),
        Channel("gear", "1", -4.0, 24.0, "engaged gear; 0 neutral, negative reverse"),
        Channel("engine_speed", "rad/s", 0.0, 700.0, "crankshaft speed"),
        Channel("engine_torque", "N m", -3000.0, 6000.0, "measured engine torque at the flywheel"),
        Channel("brake_switch", "1", 0.0, 1.0, "1: the service brake is on (SPN 597)"),
        Channel("elevation", "m", -500.0, 6000.0, "height of the road"),
        Channel("gap", "m", 0.0, 500.0, "distance to the vehicle ahead"),
        Channel("leader_speed", "m/s", -1.0, 60.0, "speed of the vehicle ahead over ground"),
        Channel("ambient_temperature", "degC", -60.0, 70.0, "outside air temperature"),
        Channel("latitude", "deg", -90.0, 90.0, "WGS84 latitude"),
        Channel("longitude", "deg", -180.0, 180.0, "WGS84 longitude"),
        Channel("fault_count", "1", 0.0, 65535.0, "codes of active faults that controllers report (DM1)"),
        Channel("fault_spn", "1", 0.0, 524287.0, "what is at fault: SPN of the newest active code; 0 none"),
        Channel("fault_fmi", "1", 0.0, 31.0, "how it is at fault: FMI of the newest active code"),
        Channel("derate_active", "1", 0.0, 1.0, "1: the engine says that it holds torque back (SPN 1569)"),
        Channel("protect_lamp", "1", 0.0, 1.0, "1: a controller wants its protect lamp on"),
        Channel("amber_warning_lamp", "1", 0.0, 1.0, "1: a controller wants the amber warning lamp on"),
        Channel("red_stop_lamp", "1", 0.0, 1.0, "1: a controller wants the red stop lamp on"),
        Channel("malfunction_lamp", "1", 0.0, 1.0, "1: a controller wants the malfunction lamp on"),
    )
}


def channel_of(name: str) -> Channel:
    """The definition of a channel: one of CHANNELS, else a channel that a log has under its own name."""
    return CHANNELS.get(name) or Channel(name, "", -math.inf, math.inf, "carried under its own name")


FAULTS = (
    "fault_count", "fault_spn", "fault_fmi", "derate_active",
    "protect_lamp", "amber_warning_lamp", "red_stop_lamp", "malfunction_lamp",
)  # fmt: skip


def printed(unit: str) -> str:
    """A unit as shown in figures and pages: m/s² for m/s^2, and %."""
    return unit.replace("^2", "²").replace("^3", "³").replace("percent", "%")


def sensible(value: float) -> str:
    """A measurement in SI units as shown on a page: three significant digits, none below a thousandth, no
    exponent."""
    for digits, least in ((0, 100.0), (1, 10.0), (2, 1.0)):
        if abs(value) >= least:
            return f"{value:.{digits}f}"
    return f"{value:.3f}".replace("-0.000", "0.000").replace("0.000", "0")


SPEED_UNITS = {"m/s": 1.0, "km/h": 3.6, "mph": 1.0 / 0.44704}
"""In which speeds may be shown, and how many are 1 m/s. All that is stored is in m/s."""


def speed_unit(unit: str) -> float:
    """The number of units of a speed in 1 m/s. Raises InputError for one that is not in SPEED_UNITS."""
    if unit not in SPEED_UNITS:
        raise InputError(f"speeds are shown in {', '.join(SPEED_UNITS)}, not in '{unit}'")
    return SPEED_UNITS[unit]


class Speed(NamedTuple):
    """A speed within a `Said`: its value in m/s, significant digits, whether its unit follows, and whether a
    plus precedes positive ones."""

    m_s: float
    digits: int = 2
    with_unit: bool = True
    sign: bool = False

    def shown_in(self, unit: str) -> str:
        x = speed_unit(unit) * self.m_s
        plus = "+" if self.sign and x > 0.0 else ""
        number = f"{x:{plus}.0f}" if abs(x) >= 10.0**self.digits else f"{x:{plus}.{self.digits}g}"
        return f"{number} {unit}" if self.with_unit else number


class Said(str):
    """A text that keeps its speeds as numbers: as a string in m/s, `shown_in` any unit of SPEED_UNITS."""

    parts: tuple[str | Speed, ...]

    def __new__(cls, *parts: str | Speed) -> Said:
        flat = [inner for part in parts for inner in (part.parts if isinstance(part, Said) else (part,))]
        self = super().__new__(cls, "".join(p if isinstance(p, str) else p.shown_in("m/s") for p in flat))
        self.parts = tuple(part for part in flat if part)
        return self

    def shown_in(self, unit: str) -> str:
        return "".join(p if isinstance(p, str) else p.shown_in(unit) for p in self.parts)

    @staticmethod
    def joined(between: str, texts: Iterable[str]) -> Said:
        """The texts with `between` in between."""
        parts = [part for text in texts for part in (between, text)]
        return Said(*parts[1:])


def shown(text: str, unit: str) -> str:
    """A text with its speeds in `unit`; one that keeps none is unchanged."""
    return text.shown_in(unit) if isinstance(text, Said) else text


ENGINE_UNITS = ("N m", "percent", "g/s", "cm^3/s")
BRAKE_UNITS = ("percent", "m/s^2", "bar")


PERSON = "person"
LATER = ("gear", "driven_by")  # keys of an interface that 0.1.0 does not know


def check_driver(driven_by: object) -> None:
    """Raises InputError for anything but PERSON, or None."""
    if driven_by not in (None, PERSON):
        raise InputError(f"driven_by is '{PERSON}' or left out, not {driven_by!r}")


ACCELEROMETER, ELEVATION = SLOPE_SOURCES = ("accelerometer", "elevation")
FELT, FELT_SD = "felt_slope", "felt_slope_sd"  # slope by the accelerometer, rise/run, and its sd
SLOPE_FROM = "slope_from"  # the key of COLUMNS and topic maps that says what a derived grade is from


def check_slope_source(source: object) -> str | None:
    """The source of a derived grade, or None. Raises InputError for one that is not in SLOPE_SOURCES."""
    if source is not None and source not in SLOPE_SOURCES:
        raise InputError(f"{SLOPE_FROM} is one of {', '.join(SLOPE_SOURCES)}, not {source!r}")
    return None if source is None else str(source)


@dataclass(frozen=True)
class TruckInterface:
    """The channels of the paper's u, w and y that a truck has, and their units.

    `engine_unit` is one of ENGINE_UNITS; `brake_unit` one of BRAKE_UNITS, or None if braking is not recorded;
    `grade` and `fuel` say whether the grade in w and the fuel output exist; `gear` that a simulator takes the
    recorded gear as a condition. `vehicle` is one of VEHICLE_KINDS, `mass_kg` its mass, and `driven_by`
    'person' if the recorded pedals were a driver's and therefore obeyed; None if not stated.
    """

    name: str
    engine_unit: str = "N m"
    brake_unit: str | None = "percent"
    grade: bool = True
    fuel: bool = True
    vehicle: str | None = None
    mass_kg: float | None = None
    gear: bool = False
    driven_by: str | None = None

    def __post_init__(self) -> None:
        if self.engine_unit not in ENGINE_UNITS:
            raise InputError(
                f"engine command unit '{self.engine_unit}' is not one of {', '.join(ENGINE_UNITS)}"
            )
        if self.brake_unit is not None and self.brake_unit not in BRAKE_UNITS:
            raise InputError(f"brake command unit '{self.brake_unit}' is not one of {', '.join(BRAKE_UNITS)}")
        check_vehicle(self.vehicle, self.mass_kg)
        check_driver(self.driven_by)

    @property
    def kind(self) -> VehicleKind:
        """Typical properties of such a vehicle."""
        return vehicle_kind(self.vehicle)

    @property
    def u(self) -> tuple[str, ...]:
        """Names of the controllable inputs, in column order."""
        return ("engine_command",) if self.brake_unit is None else ("engine_command", "brake_command")

    @property
    def w(self) -> tuple[str, ...]:
        """Names of the uncontrollable conditions, in column order: grade and recorded gear, where taken."""
        return tuple(name for name, taken in (("grade", self.grade), ("gear", self.gear)) if taken)

    @property
    def y(self) -> tuple[str, ...]:
        """Names of the responses, in column order: acceleration, speed and, where measured, fuel rate."""
        return ("acceleration", "speed", "fuel_rate") if self.fuel else ("acceleration", "speed")

    @property
    def summary(self) -> str:
        """Its name, the units of its commands, and further channels, as a short text."""
        commands = (self.engine_unit, self.brake_unit or "no brake")
        has = (("grade", self.grade), ("fuel", self.fuel), ("recorded gear", self.gear))
        also = (name for name, there in has if there)
        return f"{self.name} ({', '.join((*commands, *also))})"

    def unit(self, channel: str) -> str:
        """Unit of a channel on this truck; empty for one that is not in CHANNELS."""
        if channel == "engine_command":
            return self.engine_unit
        if channel == "brake_command":
            return self.brake_unit or "none"
        return channel_of(channel).unit

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON and bag metadata; from_dict is its inverse.

        Later additions are omitted at their defaults, so that earlier versions can read the rest.
        """
        return {name: value for name, value in asdict(self).items() if name not in LATER or value}

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> TruckInterface:
        """Inverse of to_dict. Raises InputError for unknown or missing keys, and values of another type."""
        try:
            found = cls(**data)
        except TypeError as error:
            raise InputError(f"truck interface {data!r} is not understood: {error}") from None
        if not isinstance(found.name, str) or {type(found.grade), type(found.fuel), type(found.gear)} != {
            bool
        }:
            raise InputError(
                f"truck interface {data!r} needs a name, and true or false for grade, fuel and gear"
            )
        return found


ACCELERATION, SPEED, FUEL = 0, 1, 2  # columns of y
