"""A user's own truck from its data sheet; parameters that a sheet lacks are those of a reference truck.

`Sheet` holds the entries, `specification` makes the truck. Contradictory entries are refused.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
import yaml

from deeptruck_core import reading
from deeptruck_core.errors import InputError
from deeptruck_core.reading import near
from deeptruck_core.signals import BRAKE_UNITS, ENGINE_UNITS, TruckInterface
from deeptruck_model.trucks.specification import Specification, from_pool

CLUTCH, CONVERTER = "trucksim", "freightliner"  # of the pool: whose other parameters the truck gets
CRUISE = 80.0 / 3.6  # m/s
CRUISE_RPM = (800.0, 2300.0)  # of a diesel engine of a truck in top gear at CRUISE
LEAST_START = 0.12  # slope on which a laden truck must start: Regulation (EU) 1230/2012, annex I
DRAG_COEFFICIENT = 0.55  # FASTSim 'Line Haul Conv': 0.546
ROLLING = 3.05 / np.pi  # rolling over free radius: a radial tyre rolls 3.05 outer diameters a turn (ETRTO)
INCH, RPM = 0.0254, np.pi / 30.0
TYRE = re.compile(r"\s*(\d{3})\s*/\s*(\d{2,3})\s*R\s*(\d{2}(?:\.\d)?)\s*", re.IGNORECASE)


@dataclass(frozen=True)
class Entry:
    """One number of the sheet: the question, its unit, and the range that a truck can have."""

    name: str
    asks: str
    unit: str
    low: float
    high: float


NUMBERS = (
    Entry("mass_kg", "Mass as driven", "kg", 1000.0, 250_000.0),
    Entry("axle_ratio", "Axle ratio (final drive)", "", 1.5, 10.0),
    Entry("rated_torque_nm", "Largest engine torque", "N m", 200.0, 5000.0),
    Entry("frontal_area_m2", "Frontal area", "m^2", 2.0, 13.0),
    Entry("full_braking_m_s2", "Deceleration of full braking, as driven", "m/s^2", 3.0, 9.0),
)


@dataclass(frozen=True)
class Sheet:
    """Entries of a truck's data sheet. `tyres` is a size such as 315/80R22.5, or the rolling radius, m."""

    mass_kg: float
    gear_ratios: tuple[float, ...]
    axle_ratio: float
    tyres: str | float
    rated_torque_nm: float
    frontal_area_m2: float
    full_braking_m_s2: float
    converter: bool = False
    engine_unit: str = "N m"
    brake_unit: str = "percent"

    @property
    def wheel_radius(self) -> float:
        """Rolling radius, m. Raises InputError for an invalid size."""
        return radius(self.tyres)

    @property
    def overall_ratios(self) -> tuple[float, ...]:
        """Engine speed over road speed in each gear, rad/m."""
        return tuple(r * self.axle_ratio / self.wheel_radius for r in self.gear_ratios)


def radius(tyres: str | float) -> float:
    """Rolling radius in m of a tyre size, or of a number in m. Raises InputError for anything else."""
    if isinstance(tyres, int | float) and not isinstance(tyres, bool):
        number: float | None = float(tyres)
    else:
        number = _number(str(tyres))
    if number is None:
        size = TYRE.fullmatch(str(tyres))
        if size is None:
            raise InputError(
                f"tyres are '{tyres}'; give a size such as 315/80R22.5, or the rolling radius in m (0.5)"
            )
        width, aspect, rim = (float(x) for x in size.groups())
        number = ROLLING * (rim * INCH / 2 + width / 1000 * aspect / 100)
    if not 0.25 <= number <= 0.8:
        raise InputError(f"tyres of a rolling radius of {number:g} m are none of a truck; give 0.25 to 0.8 m")
    return number


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None


def number(entry: Entry, value: Any) -> float:
    """A value of the sheet. Raises InputError if it is not a number in the entry's range."""
    found = _number(str(value)) if not isinstance(value, bool) else None
    unit = f" {entry.unit}" if entry.unit else ""
    if found is None or not np.isfinite(found):
        raise InputError(f"'{entry.name}' must be a number{f' in{unit}' if unit else ''}, not {value!r}")
    if not entry.low <= found <= entry.high:
        raise InputError(f"'{entry.name}' is {found:g}{unit}, not {entry.low:g} to {entry.high:g}")
    return found


def ratios(value: Any) -> tuple[float, ...]:
    """Gear ratios, first gear first, from a list or from '12.7, 9.3, ...'. Raises InputError for anything
    else."""
    parts = value.replace(",", " ").split() if isinstance(value, str) else value
    found = [_number(str(x)) for x in parts] if isinstance(parts, list | tuple) else []
    known = [x for x in found if x is not None]
    if not known or len(known) < len(found) or min(known) <= 0.0:
        raise InputError(f"'gear_ratios' must be numbers such as 12.69, 9.29, 1.0, not {value!r}")
    if any(b >= a for a, b in itertools.pairwise(known)):
        raise InputError("'gear_ratios' must fall from first to top gear")
    return tuple(known)


def sheet(data: Mapping[str, Any], source: str) -> Sheet:
    """A sheet from YAML. Raises InputError, which names the source, for missing, unknown or invalid
    entries."""
    names = [f.name for f in fields(Sheet)]
    for key in data:
        if key not in names:
            raise InputError(f"{source}: there is no '{key}'; {near(str(key), names)}")
    needed = [n for n in names[:7] if n not in data]
    if needed:
        raise InputError(f"{source}: lacks {', '.join(needed)}")
    with reading.of(source):
        radius(data["tyres"])
        numbers = {entry.name: number(entry, data[entry.name]) for entry in NUMBERS}
        for key, known in (("engine_unit", ENGINE_UNITS[:2]), ("brake_unit", BRAKE_UNITS[:2])):
            if data.get(key, known[0]) not in known:
                raise InputError(f"'{key}' must be {' or '.join(known)}, not {data[key]!r}")
        if not isinstance(data.get("converter", False), bool):
            raise InputError(f"'converter' must be true or false, not {data['converter']!r}")
        return Sheet(**{**data, **numbers, "gear_ratios": ratios(data["gear_ratios"])})


def contradictions(s: Sheet) -> list[str]:
    """Contradictory entries of a sheet, one line each."""
    out = []
    rpm = CRUISE * s.overall_ratios[-1] / RPM
    if not CRUISE_RPM[0] <= rpm <= CRUISE_RPM[1]:
        out.append(
            f"in top gear at 80 km/h the engine turns {rpm:.0f} rpm, a truck's {CRUISE_RPM[0]:.0f} to "
            f"{CRUISE_RPM[1]:.0f}: axle ratio, tyres or top gear are off"
        )
    start = s.rated_torque_nm * s.overall_ratios[0] / (s.mass_kg * 9.81)
    if start < LEAST_START:
        out.append(
            f"in first gear it climbs {100 * start:.0f} %, and must climb {100 * LEAST_START:.0f} %: torque, "
            "first gear or mass are off"
        )
    return out


def specification(s: Sheet, name: str, *, grade: bool = True) -> Specification:
    """The truck, with or without the slope as an input. Raises InputError with all contradictions."""
    if wrong := contradictions(s):
        raise InputError("; ".join(wrong))
    base = from_pool(CONVERTER if s.converter else CLUTCH)
    speeds, torques = base.full_load
    scale = s.rated_torque_nm / max(torques)
    v = base.values
    brakes = v["front_brake_torque"] * v["front_wheels"] + v["rear_brake_torque"] * v["rear_wheels"]
    stronger = s.full_braking_m_s2 * s.mass_kg * s.wheel_radius / brakes
    values = {
        "mass": s.mass_kg,
        "drag_area": DRAG_COEFFICIENT * s.frontal_area_m2,
        "wheel_radius": s.wheel_radius,
        "final_drive": s.axle_ratio,
        "reference_torque": v["reference_torque"] * scale,
        "clutch_capacity": v["clutch_capacity"] * scale,
        "engine_brake_torque": v["engine_brake_torque"] * scale,
        "front_brake_torque": v["front_brake_torque"] * stronger,
        "rear_brake_torque": v["rear_brake_torque"] * stronger,
        "brake_controller_mass": s.mass_kg,
        "start_gear": min(v["start_gear"], float(max(1, len(s.gear_ratios) // 3))),
        "lockup_gear": min(v["lockup_gear"], float(len(s.gear_ratios))),
    }
    interface = TruckInterface(name, s.engine_unit, s.brake_unit, grade, mass_kg=s.mass_kg)
    truck = replace(
        base,
        name=name,
        interface=interface,
        ratios=s.gear_ratios,
        full_load=(speeds, tuple(float(t * scale) for t in torques)),
    )
    return truck.with_values(values)


HEAD = """# {name}: a physics truck from its data sheet; 'truck:{file}' loads it.
# From the sheet: {sheet}
# All else is that of the reference truck {base}: air and rolling resistance, shift speeds, lags, fuel.
"""


def text(s: Sheet, truck: Specification, file: str) -> str:
    """The truck file as YAML; a comment holds its data sheet."""
    said = ", ".join(f"{f.name} {getattr(s, f.name)}" for f in fields(Sheet))
    base = CONVERTER if s.converter else CLUTCH
    head = HEAD.format(name=truck.name, file=file, sheet=said, base=base)
    plain = truck.to_dict()
    plain["interface"].pop("name", None)
    return head + yaml.safe_dump(plain, sort_keys=False, default_flow_style=None, width=100)
