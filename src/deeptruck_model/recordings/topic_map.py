"""Maps message fields to channels: the project's own topics, and users' topics by YAML."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deeptruck_core import reading
from deeptruck_core.errors import InputError
from deeptruck_core.reading import near
from deeptruck_core.signals import CHANNELS, FAULTS, SLOPE_FROM, check_driver, check_slope_source
from deeptruck_model.checks import Mapped
from deeptruck_model.recordings import gated_brake
from deeptruck_model.recordings.units import Conversion, conversion

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
    """The origin of a channel: `field` of the messages on `topic`, or that column of a table, whose stamps
    are `late_s` late."""

    topic: str
    field: str
    late_s: float = 0.0


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
    "position[name=gear] the value of that name",
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
LATEST_S = 10.0  # later than this a column is not late but of another drive
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
    named = dict(topic_map)
    check_driver(named.pop(DRIVEN_BY, None))
    check_slope_source(named.pop(SLOPE_FROM, None))
    extra = named.pop(EXTRA, {})
    return _TOPICS.channels(named, extra)


def stated(topic_map: TopicMap | str | Path, key: str) -> str | None:
    """What a topic map that `load` took says under DRIVEN_BY or SLOPE_FROM; None if it does not say."""
    data = load_yaml(Path(topic_map)) if isinstance(topic_map, str | Path) else topic_map
    return None if data.get(key) is None else str(data[key])


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


@dataclass(frozen=True)
class Entries:
    """The entries of channels in one kind of file: their keys, those that are `needed`, as the `example`
    shows, and whether each must state its unit."""

    where: str
    keys: Mapping[str, str]
    needed: tuple[str, ...]
    example: str
    units: bool

    def channels(self, named: Mapping[str, Any], extra: Any) -> dict[str, Source]:
        """The channels, and those of `extra` under the user's own names. Raises InputError for names, keys
        or units that are not known, and for an entry that leaves nothing of its channel."""
        gated = gated_brake.is_asked(named)
        found = {
            channel: self._one(channel, entry)
            for channel, entry in named.items()
            if not (gated and channel == gated_brake.COMMAND)
        }
        if gated:
            unit = conversion(gated_brake.COMMAND, gated_brake.UNIT)
            found[gated_brake.COMMAND] = replace(found[gated_brake.SWITCH], convert=unit, gates=True)
        return found | self._extra(extra)

    def _one(self, channel: str, entry: Any) -> Source:
        if channel not in CHANNELS:
            known = near(channel, list(CHANNELS))
            raise InputError(
                f"unknown channel '{channel}' in {self.where}; {known}, or put it under '{EXTRA}'"
            )
        if isinstance(entry, Source):
            return entry  # of a topic map that was loaded before
        self._check(channel, entry)
        unit = entry.get("unit")
        if unit is None and self.units and CHANNELS[channel].unit != "1":
            raise InputError(
                f"'{channel}' of {self.where} needs a unit, as in {{column: {entry['column']}, unit: ...}}"
            )
        convert = None
        if unit is not None or self.units:
            convert = conversion(channel, None if unit is None else str(unit), entry.get("density"))
        return self._made(channel, entry, convert)

    def _extra(self, entries: Any) -> dict[str, Source]:
        """Channels under the user's names, which are carried as they are written."""
        if not isinstance(entries, Mapping):
            raise InputError(f"{EXTRA} of {self.where} needs names, as in {{oil_temperature: ...}}")
        found = {}
        for name, entry in entries.items():
            if not re.match(EXTRA_NAME, str(name)):
                raise InputError(f"{EXTRA} of {self.where}: '{name}' is no name; use letters, digits and _")
            if name in CHANNELS or name.startswith(("driver_", "engaged")):
                raise InputError(
                    f"{EXTRA} of {self.where}: '{name}' is a channel of its own; give it another name"
                )
            if len(self.needed) == 1 and not isinstance(entry, Mapping):
                entry = {self.needed[0]: entry}
            if isinstance(entry, Mapping) and (unit := {"unit", "density"} & set(entry)):
                raise InputError(
                    f"{EXTRA} of {self.where}: '{name}' is carried as it is written; give it no {unit.pop()}"
                )
            self._check(name, entry)
            found[name] = self._made(name, entry, None)
        return found

    def _check(self, channel: str, entry: Any) -> None:
        if isinstance(entry, Mapping):  # first: a misspelt key is what makes another missing
            check_keys(entry, self.keys, f"'{channel}' of {self.where}")
        if not isinstance(entry, Mapping) or not set(self.needed) <= set(entry):
            raise InputError(
                f"'{channel}' of {self.where} needs {' and '.join(self.needed)}, as in {self.example}"
            )

    def _made(self, channel: str, entry: Mapping[str, Any], convert: Conversion | None) -> Source:
        scale, offset = number(entry, "scale", 1.0, channel), number(entry, "offset", 0.0, channel)
        if scale == 0.0 or not math.isfinite(scale) or not math.isfinite(offset):
            raise InputError(f"channel '{channel}': scale {scale:g} and offset {offset:g} leave no values")
        part = str(entry.get("part", ""))
        if part and (part not in PARTS or channel not in ("engine_command", "brake_command")):
            raise InputError(f"part of '{channel}' must be positive or negative, of a command, not {part!r}")
        source = self.needed[-1]
        named = entry[source] if isinstance(entry[source], list) else [entry[source]]
        if not 1 <= len(named) <= 2:
            raise InputError(f"{source} of '{channel}' is one name, or two for the norm of a vector")
        late_s = number(entry, "late_s", 0.0, channel)
        if not abs(late_s) <= LATEST_S:
            raise InputError(
                f"late_s of '{channel}' must be at most {LATEST_S:g} s either way, not {late_s:g}"
            )
        return Source(
            str(entry.get("topic", "")),
            str(named[0]),
            late_s,
            convert=convert,
            scale=scale,
            offset=offset,
            across=str(named[1]) if len(named) > 1 else "",
            part=part,
        )


_TOPICS = Entries("the topic map", ENTRY_KEYS, ("topic", "field"), "{topic: /odom, field: data}", units=False)


def check_keys(data: Mapping[str, Any], keys: Iterable[str], where: str) -> None:
    """Raises InputError, with the nearest known key, for an unknown one."""
    unknown = sorted(str(key) for key in set(data) - set(keys))
    if unknown:
        raise InputError(f"{where} has unknown keys: {', '.join(unknown)}; {near(unknown[0], sorted(keys))}")


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
