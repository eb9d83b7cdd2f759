"""JSON Schemas of COLUMNS.yaml and of topic maps, by which editors check and complete them.

They are derived from the definitions that the reader's checks use. Errors that involve several entries, such
as a step of `split_at` whose channel has no column, are found only by the reader.
"""

from __future__ import annotations

import re
from typing import Any

from deeptruck_core.signals import CHANNELS, PERSON, SLOPE_FROM, SLOPE_SOURCES
from deeptruck_core.vehicle_kinds import UNSTATED, VEHICLE_KINDS
from deeptruck_model.recordings import gated_brake, topic_map
from deeptruck_model.recordings.tables import columns
from deeptruck_model.recordings.units import TIME_UNITS, canonical_units, known_units

Schema = dict[str, Any]

DRAFT = "http://json-schema.org/draft-07/schema#"  # the one that editors know best
_POWERS = {"^2": r"(?:(?:\^|\*\*)[ ·]*2|²)", "^3": r"(?:(?:\^|\*\*)[ ·]*3|³)"}
_TEXT: Schema = {"type": "string"}
_NAME: Schema = {"type": ["string", "number"]}
_NUMBER: Schema = {"type": "number", "minimum": -topic_map.LARGEST, "maximum": topic_map.LARGEST}
_POSITIVE: Schema = {"type": "number", "exclusiveMinimum": 0, "maximum": topic_map.LARGEST}
_WITH_UNITS = ("unit", "density", "part")
_KINDS: dict[str, Schema] = {
    "column": {"type": ["string", "number", "array"]},
    "part": {"enum": [*topic_map.PARTS]},
    "topic": _TEXT,
    "field": {"anyOf": [_TEXT, {"type": "array", "items": _TEXT, "minItems": 1, "maxItems": 2}]},
    "scale": {**_NUMBER, "not": {"const": 0}},
    "offset": _NUMBER,
    "late_s": {"type": "number", "minimum": -topic_map.LATEST_S, "maximum": topic_map.LATEST_S},
    "density": {"anyOf": [{"type": "number", "minimum": m, "maximum": 10 * m} for m in (0.3, 300.0)]},
}


def of_columns() -> Schema:
    """Schema of the COLUMNS.yaml of a table."""
    least_mass = min(kind.least_mass_kg for kind in VEHICLE_KINDS.values())
    kinds = {
        "name": _NAME,
        "time": {"anyOf": _times()},
        "channels": _channels(columns.ENTRY_KEYS, ["column"], unit=True),
        "delimiter": {**_TEXT, "minLength": 1, "maxLength": 1},
        "encoding": _TEXT,
        "skip_rows": {"type": "integer", "minimum": 0},
        "decimal": _TEXT,
        "only": {"type": "object", "additionalProperties": {"type": ["string", "number"]}},
        "pivot": _mapping({"name": _NAME, "value": _NAME}, ["name", "value"]),
        "split_at": _mapping(dict.fromkeys(columns.SPLITS, _POSITIVE)),
        "extra": _extra({k: v for k, v in columns.ENTRY_KEYS.items() if k not in _WITH_UNITS}, ["column"]),
        "grade_window_m": _POSITIVE,
        "vehicle": {"enum": list(VEHICLE_KINDS)},
        "mass_kg": {"type": "number", "minimum": least_mass, "maximum": UNSTATED.most_mass_kg},
        "driven_by": {"enum": [PERSON]},
        SLOPE_FROM: {"enum": list(SLOPE_SOURCES)},
    }
    described = {key: {**kinds[key], "description": meaning} for key, meaning in columns.KEYS.items()}
    return {"$schema": DRAFT, "title": "columns of a table", **_mapping(described, ["time", "channels"])}


def of_topics() -> Schema:
    """Schema of a topic map."""
    channels = _channels(topic_map.ENTRY_KEYS, ["topic", "field"], unit=False)
    keys = {k: v for k, v in topic_map.ENTRY_KEYS.items() if k not in _WITH_UNITS}
    channels["properties"][topic_map.EXTRA] = _extra(keys, ["topic", "field"])
    for key, values in ((topic_map.DRIVEN_BY, [PERSON]), (SLOPE_FROM, list(SLOPE_SOURCES))):
        channels["properties"][key] = {"enum": values, "description": columns.KEYS[key]}
    return {"$schema": DRAFT, "title": "topic map of a bag", **channels}


def _times() -> list[Schema]:
    units = {"enum": [*TIME_UNITS, *columns.DATE_UNITS]}
    dates = {"enum": [*columns.DATE_UNITS]}
    pair = {"type": "array", "items": _NAME, "minItems": 2, "maxItems": 2}
    format_ = {**_TEXT, "pattern": "%"}
    rate = {**_POSITIVE, "maximum": columns.FASTEST_HZ}
    return [
        _mapping({"column": _NAME, "unit": units}, ["column"]),
        _mapping({"column": pair, "unit": dates}, ["column"]),
        _mapping({"column": {"anyOf": [_NAME, pair]}, "format": format_}, ["column", "format"]),
        _mapping({"rate_hz": rate}, ["rate_hz"]),
    ]


def _channels(keys: dict[str, str], required: list[str], *, unit: bool) -> Schema:
    """Entries by channel; with `unit` each must state its unit, unless dimensionless."""
    entries = {}
    for channel, of_it in CHANNELS.items():
        needed = [*required, "unit"] if unit and of_it.unit != "1" else required
        says = f"{of_it.meaning}, {' or '.join(canonical_units(channel))}"
        entries[channel] = {**_mapping(_entry(channel, keys), needed), "description": says}
    derived = {key: {"const": value} for key, value in gated_brake.ENTRY.items()}
    entries[gated_brake.COMMAND] = {"anyOf": [entries[gated_brake.COMMAND], _mapping(derived, [*derived])]}
    return _mapping(entries, ["speed"])


def _extra(keys: dict[str, str], required: list[str]) -> Schema:
    """Entries of user-defined channels, which have no unit."""
    entry = _mapping({key: {**_KINDS[key], "description": keys[key]} for key in keys}, required)
    short = [_NAME] if required == ["column"] else []
    return {
        "type": "object",
        "patternProperties": {topic_map.EXTRA_NAME: {"anyOf": [entry, *short]} if short else entry},
        "additionalProperties": False,
    }


def _mapping(properties: Schema, required: list[str] | None = None) -> Schema:
    found = {"type": "object", "properties": properties, "additionalProperties": False}
    return {**found, "required": required} if required else found


def _entry(channel: str, keys: dict[str, str]) -> Schema:
    """The schema of one channel's entry; only fuel has a density, and only pedals have parts."""
    kinds = {**_KINDS, "unit": _unit(channel)}
    of = {"density": ("fuel_rate",), "part": ("engine_command", "brake_command")}
    mine = [key for key in keys if channel in of.get(key, (channel,))]
    return {key: {**kinds[key], "description": keys[key]} for key in mine}


def _unit(channel: str) -> Schema:
    """The permitted units of a channel, in any accepted spelling."""
    spellings = known_units(channel)
    shown = dict.fromkeys((*canonical_units(channel), *spellings))
    one = [1] if "1" in spellings else []  # as YAML reads it
    return {"anyOf": [{"enum": [*shown, *one]}, {**_TEXT, "pattern": _any_spelling(spellings)}]}


def _any_spelling(spellings: list[str]) -> str:
    """A regular expression that ignores case, blanks, dots between the parts and brackets around them."""
    parts = (re.findall(r"\^[23]|.", spelling) for spelling in spellings)
    alike = "|".join("[ ·]*".join(_POWERS.get(part) or _letter(part) for part in word) for word in parts)
    return rf"^[\[\]()\s·]*(?:{alike})[\[\]()\s·]*$"


def _letter(part: str) -> str:
    return f"[{part}{part.upper()}]" if part.isalpha() else re.escape(part).replace(r"\-", "-")
