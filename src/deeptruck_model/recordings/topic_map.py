"""Maps message fields to channels: the project's own topics, and users' topics by YAML."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deeptruck_model._io import reading
from deeptruck_model._io.reading import near
from deeptruck_model.checks import Mapped
from deeptruck_model.errors import InputError
from deeptruck_model.recordings import gated_brake
from deeptruck_model.recordings.units import Conversion, conversion
from deeptruck_model.signals import CHANNELS, FAULTS, SLOPE_FROM, check_driver, check_slope_source

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Taken:
    """How the numbers of a field or column become a channel."""

    convert: Conversion | None = None  # None: already canonical, commands in the interface's unit
    scale: float = 1.0
    offset: float = 0.0
    across: str = ""  # another field or column: the channel is the norm of both
    part: str = ""  # one of PARTS: what lies above or below zero, of a pedal that drives and brakes
    gates: bool = False  # a brake switch in the place of the brake command, see gated_brake

    @property
    def unit(self) -> str:
        """The canonical unit that it leads to; '' if that is the interface's."""
        return self.convert.unit if self.convert else ""

    def __call__(self, values: Array) -> Array:
        """Numbers as written, (n,), in the canonical unit."""
        if self.scale != 1.0 or self.offset != 0.0:
            values = self.scale * values + self.offset
        if self.part:
            values = np.where(np.isnan(values), np.nan, np.maximum(PARTS[self.part] * values, 0.0))
        values = gated_brake.on(values) if self.gates else values
        return values if self.convert is None else self.convert(values)


@dataclass(frozen=True)
class Source(Taken):
    """The origin of a channel: `field` of the messages on `topic`."""

    topic: str
    field: str


def _named(topic: str, *channels: str) -> dict[str, Source]:
    return {channel: Source(topic, f"position[name={channel}]") for channel in channels}


DEFAULT_TOPICS: dict[str, Source] = {
    "speed": Source("/truck/twist", "twist.linear.x"),
    "acceleration": Source("/truck/accel", "accel.linear.x"),
    "specific_force": Source("/truck/imu", "linear_acceleration.x"),
    **_named("/truck/status", "fuel_rate", "gear", "engine_speed", "engine_torque", "brake_switch", *FAULTS),
    **_named("/truck/command", "engine_command", "brake_command"),
    **_named("/road", "grade", "elevation", "ambient_temperature", "latitude", "longitude"),
    "gap": Source("/radar/range", "range"),
    "leader_speed": Source("/radar/twist", "twist.linear.x"),
}

PARTS = {"positive": 1.0, "negative": -1.0}
TopicMap = Mapping[str, Any]
NO_SPEED = "the topic map has no 'speed'; a recording needs at least that channel"
ENTRY_KEYS = {
    "topic": "its name in the bag",
    "field": "path into the message, or a list of two for the norm of a vector; data[3] is an element, "
    "position[name=gear] the value beside that name",
    "unit": "what it is written in; ours where absent",
    "scale": "factor before the unit is converted",
    "offset": "added after the factor, before the unit is converted",
    "part": "positive or negative: what lies above or below zero, of one pedal that drives and brakes",
    "density": "of the fuel, in g/cm3 or kg/m3, where its rate is by mass",
}
DRIVEN_BY = "driven_by"  # the key by which topic maps and COLUMNS say that a person drove
EXTRA = "extra"  # the key of channels under names of their own, in topic maps and in COLUMNS
EXTRA_TOPIC = "/extra"
EXTRA_NAME = r"^[A-Za-z][A-Za-z0-9_]{0,63}$"
LARGEST = 1e12  # of a factor, an offset or a time in a YAML file


def load(topic_map: TopicMap | str | Path) -> dict[str, Source]:
    """Sources by channel from a mapping, or from a YAML file of `channel: {topic, field, unit, scale,
    offset}`, or `brake_command: {derive: deceleration, gate: brake_switch}`.

    Channels left out are not read. Raises InputError for unknown channels, keys or units.
    """
    if isinstance(topic_map, str | Path):
        data = load_yaml(Path(topic_map))
        with reading.of(topic_map):
            return load(data)
    entries, gated = dict(topic_map), gated_brake.is_asked(topic_map)
    check_driver(entries.pop(DRIVEN_BY, None))
    check_slope_source(entries.pop(SLOPE_FROM, None))
    extra = extra_of(entries.pop(EXTRA, {}), "the topic map")
    if gated:
        entries[gated_brake.COMMAND] = entries[gated_brake.SWITCH]
    if unknown := [channel for channel in entries if channel not in CHANNELS]:
        raise InputError(
            f"unknown channel '{unknown[0]}' in the topic map; {near(unknown[0], list(CHANNELS))}, or put it "
            f"under '{EXTRA}'"
        )
    sources = {channel: _source(channel, entry) for channel, entry in entries.items()}
    sources |= {name: _extra(name, entry) for name, entry in extra.items()}
    if gated:
        unit = conversion(gated_brake.COMMAND, gated_brake.UNIT)
        sources[gated_brake.COMMAND] = replace(sources[gated_brake.COMMAND], convert=unit, gates=True)
    return sources


def driver(topic_map: TopicMap | str | Path) -> str | None:
    """Who drove, according to the topic map; None if it does not say. Raises InputError as `load` does."""
    data = load_yaml(Path(topic_map)) if isinstance(topic_map, str | Path) else topic_map
    found = data.get(DRIVEN_BY)
    check_driver(found)
    return None if found is None else str(found)


def slope_source(topic_map: TopicMap | str | Path) -> str | None:
    """What a derived grade is from, according to the topic map; None if it does not say."""
    data = load_yaml(Path(topic_map)) if isinstance(topic_map, str | Path) else topic_map
    return check_slope_source(data.get(SLOPE_FROM))


def facts(topic_map: TopicMap | str | Path) -> Mapped:
    """A topic map in the form that checks of bags need. Raises InputError as `load` does, and if speed is
    missing."""
    sources = load(topic_map)
    if "speed" not in sources:
        where = f"{topic_map}: " if isinstance(topic_map, str | Path) else ""
        raise InputError(f"{where}{NO_SPEED}")
    return Mapped(
        {channel: source.topic for channel, source in sources.items()},
        {channel: source.convert.unit for channel, source in sources.items() if source.convert},
    )


def is_topic_map(meaning: Mapping[str, Any]) -> bool:
    """Whether a mapping has channels with topics; descriptions of tables and CAN logs have none."""
    return any(
        isinstance(entry, Source) or (isinstance(entry, Mapping) and "topic" in entry)
        for entry in meaning.values()
    )


def load_yaml(path: Path) -> dict[str, Any]:
    """Load a YAML file that holds one mapping. Raises InputError if it is missing or holds something else."""
    return reading.yaml_mapping(path, "see docs/recordings.md for an example")


def extra_of(entries: Any, where: str) -> dict[str, Any]:
    """Additional channels under the user's names. Raises InputError for a name that is taken or empty."""
    if not isinstance(entries, Mapping):
        raise InputError(f"{EXTRA} of {where} needs names, as in {{oil_temperature: ...}}")
    for name in entries:
        if not re.match(EXTRA_NAME, str(name)):
            raise InputError(f"{EXTRA} of {where}: '{name}' is no name; use letters, digits and _")
        if name in CHANNELS or name.startswith(("driver_", "engaged")):
            raise InputError(f"{EXTRA} of {where}: '{name}' is a channel of its own; give it another name")
    return dict(entries)


def _extra(name: str, entry: Any) -> Source:
    if isinstance(entry, Mapping) and {"unit", "density"} & set(entry):
        raise InputError(f"topic map: '{name}' is carried as it is written; give it no unit")
    return _source(name, entry)


def _source(channel: str, entry: Any) -> Source:
    if isinstance(entry, Source):
        return entry
    if not isinstance(entry, Mapping) or not {"topic", "field"} <= set(entry):
        raise InputError(f"topic map: '{channel}' needs topic and field, as in {{topic: /odom, field: data}}")
    unknown = set(entry) - set(ENTRY_KEYS)
    if unknown:
        raise InputError(f"topic map: '{channel}' has unknown keys: {', '.join(sorted(map(str, unknown)))}")
    unit = entry.get("unit")
    convert = conversion(channel, unit, entry.get("density")) if unit is not None else None
    path, steps = taken(channel, entry, "field")
    return Source(str(entry["topic"]), path, convert=convert, **steps)


def taken(channel: str, entry: Mapping[str, Any], source: str) -> tuple[str, dict[str, Any]]:
    """The path or column under the key `source` of an entry, and the steps of `Taken` but for the unit.

    Raises InputError for values that leave nothing of the channel.
    """
    scale, offset = number(entry, "scale", 1.0, channel), number(entry, "offset", 0.0, channel)
    if scale == 0.0 or not math.isfinite(scale) or not math.isfinite(offset):
        raise InputError(f"channel '{channel}': scale {scale:g} and offset {offset:g} leave no values")
    part = str(entry.get("part", ""))
    if part and (part not in PARTS or channel not in ("engine_command", "brake_command")):
        raise InputError(f"part of '{channel}' must be positive or negative, of a command, not {part!r}")
    named = entry[source] if isinstance(entry[source], list) else [entry[source]]
    if not 1 <= len(named) <= 2:
        raise InputError(f"{source} of '{channel}' is one name, or two for the norm of a vector")
    across = str(named[1]) if len(named) > 1 else ""
    return str(named[0]), {"scale": scale, "offset": offset, "part": part, "across": across}


def number(entry: Mapping[str, Any], key: str, default: float, where: str) -> float:
    """A number from a YAML entry, or the default. Raises InputError if it is not a number."""
    value = entry.get(key, default)
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InputError(f"{key} of '{where}' must be a number, not {value!r}")
    if LARGEST < abs(value) < math.inf:  # an integer may have a thousand digits
        raise InputError(
            f"{key} of '{where}' must be a number of at most {LARGEST:g}, not {str(value)[:20]}..."
        )
    return float(value)
