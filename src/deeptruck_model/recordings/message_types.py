"""Fields of known message types from message_types.yaml: channel, unit, and whether measured or commanded."""

from __future__ import annotations

import enum
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from deeptruck_core.reading import package_yaml


class Role(enum.IntEnum):
    """Origin of a number; among several candidates the one of lowest role is proposed."""

    MEASURED = 0
    DRIVER = 1  # what the driver demands, where an actuator's output is measured too
    COMMANDED = 2  # a set point or request, whether it was obeyed or not


@dataclass(frozen=True)
class Known:
    """A field of a known message type. `scale` and `offset` are applied before the unit, as in a topic map.

    `on`: words, one of which must occur in the topic's name. `needs`: what the user must fill in.
    """

    channel: str
    unit: str | None
    why: str
    role: Role = Role.MEASURED
    scale: float = 1.0
    offset: float = 0.0
    on: frozenset[str] = frozenset()
    needs: str = ""


WITH_QUATERNION = ("sensor_msgs/msg/Imu", "nav_msgs/msg/Odometry")


def _known(
    channel: str,
    why: str,
    unit: str | None = None,
    role: str = "measured",
    topic_words: list[str] | None = None,
    **more: Any,
) -> Known:
    return Known(channel, unit, why, Role[role.upper()], on=frozenset(topic_words or ()), **more)


def _types() -> Iterator[tuple[str, dict[str, tuple[Known, ...]]]]:
    """Each message type with its known fields."""
    for entry in package_yaml(__package__, "message_types.yaml"):
        fields: dict[str, tuple[Known, ...]] = {}
        for one in entry["fields"]:
            field = one.pop("field")
            fields[field] = (*fields.get(field, ()), _known(**one))
        yield from ((f"{package}/msg/{entry['type']}", fields) for package in entry["packages"])


MESSAGE_TYPES: dict[str, dict[str, tuple[Known, ...]]] = dict(_types())
