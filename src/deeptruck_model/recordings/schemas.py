"""JSON Schemas of COLUMNS.yaml and of topic maps: what the reader checks and what editors know.

Errors that involve several entries, such as a step of `split_at` whose channel has no column, are found by
the reader only.
"""

from __future__ import annotations

import functools
import re

from deeptruck_core.schema import DRAFT, NAME, TEXT, Schema, keys, mapping, means, number
from deeptruck_core.signals import CHANNELS, PERSON, SLOPE_FROM, SLOPE_SOURCES
from deeptruck_core.vehicle_kinds import UNSTATED, VEHICLE_KINDS
from deeptruck_model.recordings.units import TIME_UNITS, canonical_units, known_units

LARGEST = 1e12  # of a factor, an offset or a time
LATEST_S = 10.0  # later than this a column is not late but of another drive
FASTEST_HZ = 5000.0  # of a table without a clock
DATE_UNITS = ("iso", "iso8601", "datetime")
PARTS = {"positive": 1.0, "negative": -1.0}
SPLITS = {"speed_step": "speed", "elevation_step": "elevation"}
EXTRA = "extra"  # the key of channels under names of their own, in topic maps and in COLUMNS
DRIVEN_BY = "driven_by"  # the key by which topic maps and COLUMNS say that a person drove
_POWERS = {"^2": r"(?:(?:\^|\*\*)[ ·]*2|²)", "^3": r"(?:(?:\^|\*\*)[ ·]*3|³)"}


_FACTOR = number(-LARGEST, LARGEST)
_POSITIVE: Schema = {"type": "number", "exclusiveMinimum": 0, "maximum": LARGEST}
_SOURCE: Schema = {"type": ["string", "number", "array"], "items": NAME, "minItems": 1, "maxItems": 2}
_MADE = {
    "scale": means("factor before the unit is converted", {**_FACTOR, "not": {"const": 0}}),
    "offset": means("added after the factor, before the unit is converted", _FACTOR),
}
_LATE = {"late_s": means("how late it is stamped, s; negative: how early", number(-LATEST_S, LATEST_S))}
_PART = means(
    "positive or negative: what lies above or below zero, of one pedal that drives and brakes",
    {"enum": [*PARTS]},
)
_DENSITY = means(
    "of the fuel, in g/cm3 or kg/m3, where its rate is by mass",
    {"anyOf": [number(0.3, 3.0), number(300.0, 3000.0)]},
    "give g/cm^3 (about 0.83) or kg/m^3 (about 830)",
)
_ONLY = {"density": ("fuel_rate",), "part": ("engine_command", "brake_command")}
_STATED = {
    SLOPE_FROM: means(
        "what a derived grade is from: accelerometer (fused with elevation) or elevation",
        {"enum": [*SLOPE_SOURCES]},
    ),
    DRIVEN_BY: means(
        "person where a driver's pedals were recorded: then they were obeyed", {"enum": [PERSON]}
    ),
}
_MASS = number(min(kind.least_mass_kg for kind in VEHICLE_KINDS.values()), UNSTATED.most_mass_kg)


@functools.cache
def columns() -> Schema:
    """Schema of the COLUMNS.yaml of a table."""
    source = {"column": means("its name in the header, or a list of two for the norm of a vector", _SOURCE)}
    needed = {
        "time": _time(),
        "channels": means(
            "what each column means; speed is needed, all others are optional",
            _channels(source, _LATE, "{column: v, unit: m/s}", units=True),
        ),
    }
    optional = {
        "name": means("of the truck interface; the file's name where absent", NAME),
        "delimiter": means(
            "one character between the cells; found in the header where absent",
            {**TEXT, "minLength": 1, "maxLength": 1},
            "it must be one character",
        ),
        "encoding": means("of the text; utf-8 where absent", TEXT),
        "skip_rows": means("lines before the header", {"type": "integer", "minimum": 0}),
        "decimal": means("the decimal mark; found in the numbers where absent", TEXT),
        "only": means(
            "rows of one vehicle, where a table has several: a column, and its text in the rows to take",
            mapping(NAME),
            "give a column and its text, as in {Vehicle: T-101}",
        ),
        "pivot": means(
            "where each row has one value: the column with the names, and the column with the values",
            keys({"name": NAME, "value": NAME}, cure="give two columns, as in {name: Signal, value: Value}"),
        ),
        "split_at": means(
            "steps in SI units; a larger jump starts a new piece", keys({}, dict.fromkeys(SPLITS, _POSITIVE))
        ),
        EXTRA: _extra(source, _LATE, short=True),
        "grade_window_m": means("smoothing of a grade derived from elevation, m", _POSITIVE),
        "vehicle": means("what drove: truck, bus, van or car", {"enum": [*VEHICLE_KINDS]}),
        "mass_kg": means("what it weighed on these drives, kg; forces are then given in newtons", _MASS),
    }
    return {"$schema": DRAFT, "title": "columns of a table", **keys(needed, optional | _STATED)}


@functools.cache
def topics() -> Schema:
    """Schema of a topic map."""
    source = {
        "topic": means("its name in the bag", TEXT),
        "field": means(
            "path into the message, or a list of two for the norm of a vector; data[3] is an element, "
            "position[name=gear] the value of that name",
            _SOURCE,
        ),
    }
    found = _channels(source, {}, "{topic: /odom, field: data}", units=False)
    found["properties"] |= {EXTRA: _extra(source, {}, short=False), **_STATED}
    return {"$schema": DRAFT, "title": "topic map of a bag", **found}


def _time() -> Schema:
    column = {"type": ["string", "number", "array"], "items": NAME, "minItems": 1, "maxItems": 2}
    units = [*TIME_UNITS, "day", *DATE_UNITS, *map(str.upper, DATE_UNITS)]
    entry = keys(
        {},
        {
            "column": means("its name, or those of date and time of day", column),
            "unit": {"enum": units, "errorMessage": 'other dates need a format: "%d.%m.%Y %H:%M:%S,%f"'},
            "format": {**TEXT, "pattern": "%", "errorMessage": 'such as "%d.%m.%Y %H:%M:%S,%f"'},
            "rate_hz": {"type": "number", "exclusiveMinimum": 0, "maximum": FASTEST_HZ},
        },
    )
    twice = {"anyOf": [{"required": ["rate_hz"]}, {"required": ["unit", "format"]}]}
    forms = [{"required": ["column"], "not": twice}, {"required": ["rate_hz"], "maxProperties": 1}]
    return means(
        "the column with the time and its unit or format, or rate_hz where the file has no clock",
        {**entry, "anyOf": forms},
        "give {column: t, unit: s}, a format instead of the unit, or {rate_hz: 1.0} without a clock",
    )


def _channels(source: Schema, more: Schema, example: str, *, units: bool) -> Schema:
    """Entries by channel; with `units` each must state its unit, unless dimensionless."""
    entries = {}
    for channel, of_it in CHANNELS.items():
        unit = {"unit": _unit(channel, "what it is written in" + ("" if units else "; ours where absent"))}
        optional = {**unit, **_MADE, "part": _PART, "density": _DENSITY, **more}
        needed = {**source, **unit} if units and of_it.unit != "1" else source
        mine = {key: says for key, says in optional.items() if channel in _ONLY.get(key, (channel,))}
        cure = f"it needs {' and '.join(needed)}, as in {example}"
        says = f"{of_it.meaning}, {' or '.join(canonical_units(channel))}"
        entries[channel] = means(says, keys(needed, mine, cure))
    speed, others = {"speed": entries.pop("speed")}, f"other names go under '{EXTRA}'"
    return keys(speed, entries, f"a recording needs at least 'speed: {example}'; {others}")


def _extra(source: Schema, more: Schema, *, short: bool) -> Schema:
    """Entries under names of the user's own, which have no unit."""
    entry = keys(source, {**_MADE, **more}, f"it needs {' and '.join(source)}, and is carried without a unit")
    names: Schema = {
        **TEXT,
        "pattern": r"^(?!driver_|engaged)[A-Za-z][A-Za-z0-9_]{0,63}$",
        "not": {"enum": [*CHANNELS]},
        "errorMessage": "use letters, digits and _, and no name of a channel",
    }
    return means(
        "further columns of numbers, carried under names of their own",
        {**mapping({"anyOf": [entry, NAME]} if short else entry), "propertyNames": names},
    )


def _unit(channel: str, says: str) -> Schema:
    """The permitted units of a channel, in any accepted spelling."""
    spellings = known_units(channel)
    shown = dict.fromkeys((*canonical_units(channel), *spellings))
    one = [1] if "1" in spellings else []  # as YAML reads it
    forms = [{"enum": [*shown, *one]}, {**TEXT, "pattern": _any_spelling(spellings)}]
    return means(says, {"anyOf": forms}, f"use one of: {', '.join(spellings)}")


def _any_spelling(spellings: list[str]) -> str:
    """A regular expression that ignores case, blanks, dots between the parts and brackets around them."""
    parts = (re.findall(r"\^[23]|.", spelling) for spelling in spellings)
    alike = "|".join("[ ·]*".join(_POWERS.get(part) or _letter(part) for part in word) for word in parts)
    return rf"^[\[\]()\s·]*(?:{alike})[\[\]()\s·]*$"


def _letter(part: str) -> str:
    return f"[{part}{part.upper()}]" if part.isalpha() else re.escape(part).replace(r"\-", "-")
