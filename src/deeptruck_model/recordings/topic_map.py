"""Maps message fields to channels: the project's own topics, and users' topics by YAML."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from deeptruck_core import reading
from deeptruck_core.arrays import Array
from deeptruck_core.schema import check
from deeptruck_core.signals import CHANNELS, FAULTS, SLOPE_FROM
from deeptruck_model.recordings import schemas
from deeptruck_model.recordings.schemas import DRIVEN_BY, EXTRA, PARTS
from deeptruck_model.recordings.units import Conversion, conversion


@dataclass(frozen=True, kw_only=True)
class Taken:
    """How the numbers of a field or column become a channel."""

    convert: Conversion | None = None  # None: already canonical, commands in the interface's unit
    scale: float = 1.0
    offset: float = 0.0
    across: str = ""  # another field or column: the channel is the norm of both
    part: str = ""  # one of PARTS: what lies above or below zero, of a pedal that drives and brakes

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

TopicMap = Mapping[str, Any]
EXTRA_TOPIC = "/extra"


def load(topic_map: TopicMap | str | Path) -> dict[str, Source]:
    """Sources by channel from a mapping, or from a YAML file of `channel: {topic, field, unit, scale,
    offset}`.

    Channels left out are not read. Raises InputError for unknown channels, keys or units.
    """
    if isinstance(topic_map, str | Path):
        data = load_yaml(Path(topic_map))
        with reading.of(topic_map):
            return load(data)
    check(topic_map, schemas.topics(), "topic map")
    named = {key: entry for key, entry in topic_map.items() if key not in (DRIVEN_BY, SLOPE_FROM, EXTRA)}
    return sources(named, topic_map.get(EXTRA, {}), "field")


def sources(named: Mapping[str, Any], extra: Mapping[str, Any], key: str) -> dict[str, Source]:
    """The sources of entries that fit their schema, in which the field or column is under `key`."""
    return {
        channel: _source(channel, entry if isinstance(entry, Mapping) else {key: entry}, key)
        for channel, entry in {**named, **extra}.items()
    }


def _source(channel: str, entry: Mapping[str, Any], key: str) -> Source:
    unit, names = entry.get("unit"), entry[key]
    convert = None  # as it is written: under a name of the user's, or of a topic that has our unit
    if channel in CHANNELS and (unit is not None or key == "column"):
        convert = conversion(channel, None if unit is None else str(unit), entry.get("density"))
    first, *across = map(str, names if isinstance(names, list) else [names])
    return Source(
        str(entry.get("topic", "")),
        first,
        float(entry.get("late_s", 0.0)),
        convert=convert,
        scale=float(entry.get("scale", 1.0)),
        offset=float(entry.get("offset", 0.0)),
        across="".join(across),
        part=str(entry.get("part", "")),
    )


def stated(topic_map: TopicMap | str | Path, key: str) -> str | None:
    """What a topic map that `load` took says under DRIVEN_BY or SLOPE_FROM; None if it does not say."""
    data = load_yaml(Path(topic_map)) if isinstance(topic_map, str | Path) else topic_map
    return None if data.get(key) is None else str(data[key])


def is_topic_map(meaning: Mapping[str, Any]) -> bool:
    """Whether a mapping has channels with topics; descriptions of tables and CAN logs have none."""
    return any(isinstance(entry, Mapping) and "topic" in entry for entry in meaning.values())


def load_yaml(path: Path) -> dict[str, Any]:
    """Load a YAML file that holds one mapping. Raises InputError if it is missing or holds something else."""
    return reading.yaml_mapping(path, "see docs/recordings.md for an example")
