"""Proposes a topic map for a bag of unknown topics, with the reasons for each line."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from deeptruck_core.arrays import Array
from deeptruck_core.errors import InputError
from deeptruck_core.reading import plain
from deeptruck_core.signals import TruckInterface
from deeptruck_model.recordings.candidates import (
    COMPARED,
    DEMANDS,
    FIELD,
    OURS,
    TOPIC,
    TYPE,
    Candidate,
    Proposal,
    by_channel,
    rate,
    settled,
    span,
)
from deeptruck_model.recordings.message_types import MESSAGE_TYPES, WITH_QUATERNION, Known, Role
from deeptruck_model.recordings.survey import Field, Survey, Topic, survey, values_of
from deeptruck_model.recordings.topic_map import DEFAULT_TOPICS
from deeptruck_model.recordings.units import conversion
from deeptruck_model.recordings.words import (
    COMMANDED,
    LEADER,
    UNIT_WORDS,
    named_channels,
    unit_by_range,
    words,
)

_VECTOR = re.compile(r"(^|\.)([xyzw])$")
_GENERIC = frozenset(("data", "value", "vector", "position", "point", "linear", "twist", "accel"))


@dataclass(frozen=True)
class Suggestion(Proposal):
    """The content of a bag, and the candidates for each channel."""

    survey: Survey

    def text(self) -> str:
        """The proposed topic map as YAML, with the reasons for each line."""
        head = [
            f"# Topic map for {plain(str(self.survey.bag))}, proposed by 'deeptruck-model suggest'.",
            "# Check every line: the bag does not say what its numbers mean.",
            "# What begins with '#' is not read: other candidates, and channels that were not found.",
            "# A line may have scale and offset too: scale: -1 turns a sign.",
        ]
        return "\n".join([*head, *(f"# DOUBTFUL: {line}." for line in self.doubts), *self.blocks()]) + "\n"

    def listing(self) -> list[str]:
        """Every topic and field with its range and the channels it may be, one line each."""
        lines = []
        for topic in self.survey.topics:
            lines.append("  ".join(map(plain, (topic.name, topic.msgtype, topic.why or rate(topic)))))
            for field in topic.fields:
                lines.append(f"  {plain(field.path)}  {span(field)}{self.meant(field.path, topic)}")
        return lines

    def absent(self, channel: str) -> str:
        """A remark that a quaternion is not a slope."""
        turned = [topic.name for topic in self.survey.topics if topic.msgtype in WITH_QUATERNION]
        if channel != "grade" or not turned:
            return ""
        return plain(
            f"the orientation in {', '.join(turned)} is a quaternion, of which no single field is a slope"
        )


def suggest(bag: str | Path, msg: Sequence[str | Path] = ()) -> Suggestion:
    """Find the fields of a bag that may be channels.

    Raises InputError if the bag is missing, damaged or empty.
    """
    found = survey(bag, msg)
    every = (_candidate(topic, field, found.interface) for topic in found.topics for field in topic.fields)
    candidates, commanded = by_channel(filter(None, every))
    others: set[int] = set()
    for kind in ("acceleration", "specific_force"):  # of which another axis may be along the truck
        several = candidates.get(kind, [])
        axes = [o for one in several if one.sure != OURS for axis in "yz" if (o := _along(one, axis))]
        others |= {id(one.field) for one in axes}
        several += axes
        several.sort(key=lambda one: one.order)
    proposal = Suggestion(candidates, commanded, found)
    wanted: dict[str, dict[str, None]] = {}
    for one in (one for several in candidates.values() for one in several if one.channel in COMPARED):
        for part in filter(None, (one, _along(one, "y") if one.channel == "speed" else None)):
            if part.topic is not None:
                wanted.setdefault(part.topic.name, {})[part.field.path] = None
    held = values_of(bag, {topic: [*paths] for topic, paths in wanted.items()}, msg) if wanted else {}

    def values(one: Candidate) -> tuple[Array, Array] | None:
        found = held.get((one.topic.name if one.topic else "", one.field.path))
        across = held.get((one.topic.name if one.topic else "", one.across))
        if found is None or across is None:
            return found
        return found[0], np.hypot(found[1], across[1])

    settled(proposal, values, lambda one: _along(one, "y"))
    for several in candidates.values():  # another axis only where the first was refused for it
        several[1:] = [one for one in several[1:] if id(one.field) not in others]
    return proposal


def _along(one: Candidate, axis: str) -> Candidate | None:
    """The other component of the same vector; None if it never has a number."""
    path = one.field.path
    if one.topic is None or not path.endswith("x") or path[-2:-1] not in (".", ""):
        return None
    other = next((f for f in one.topic.fields if f.path == f"{path[:-1]}{axis}"), None)
    if other is None or np.isnan(other.largest):
        return None
    return replace(one, field=other, place=one.place + 1)


def _candidate(topic: Topic, field: Field, interface: TruckInterface | None) -> Candidate | None:
    """The field as the channel that it may be, by our own topics, its type, or its words."""
    if np.isnan(field.largest):
        return None  # never a number
    for channel, source in DEFAULT_TOPICS.items():
        if (source.topic, source.field) == (topic.name, field.path):
            unit = interface.unit(channel) if interface else ""
            known = unit if unit not in ("", "none", "interface") else _unit(channel, topic, field)[0]
            return Candidate(channel, topic, field, known, "a topic of deeptruck", OURS)
    if topic.msgtype in MESSAGE_TYPES:
        return _by_type(topic, field, MESSAGE_TYPES[topic.msgtype])
    return _by_words(topic, field)


def _by_type(topic: Topic, field: Field, fields: dict[str, tuple[Known, ...]]) -> Candidate | None:
    named = words(topic.name)
    known = next((one for one in fields.get(field.path, ()) if not one.on or one.on & named), None)
    if known is None:
        return None
    channel, why, role = known.channel, known.why, known.role
    if channel == "speed" and named & LEADER:
        channel, why = "leader_speed", "a speed, on a topic named as of what drives ahead"
    if channel not in DEMANDS and named & COMMANDED:
        role = Role.COMMANDED
    unit, stated = known.unit or "", f"the type says {known.unit}"
    if not unit and not known.needs:
        unit, stated = _unit(channel, topic, field)
    return Candidate(
        channel, topic, field, unit, f"{_kind(topic)}: {why}{'' if known.needs else f'; {stated}'}", TYPE,
        role, known.scale, known.offset, [*fields].index(field.path), known.needs,
    )  # fmt: skip


def _by_words(topic: Topic, field: Field) -> Candidate | None:
    own, component = _own_words(field.path)
    around = words(topic.name)
    asked_for = COMMANDED & (around | words(field.path) | words(topic.msgtype))
    for one in named_channels(own, around):
        if component not in ("", "y" if one.asked & {"pitch"} else "x"):
            continue
        unit, stated = _unit(one.channel, topic, field)
        where = "its name" if one.asked & own else "the topic's name"
        why = f"{_kind(topic)}: '{' '.join(sorted(one.asked))}' in {where}; {stated}"
        role = Role.COMMANDED if asked_for else Role.MEASURED
        channel = "engine_command" if one.channel == "engine_torque" and asked_for else one.channel
        return Candidate(channel, topic, field, unit, why, FIELD if one.asked & own else TOPIC, role)
    return None


def _own_words(path: str) -> tuple[frozenset[str], str]:
    """The words that describe a field, without those common to all messages, and its vector component."""
    named = re.search(r"\[\w+=(.+)\]$", path)
    if named:
        return words(named[1]), ""
    part = _VECTOR.search(path)
    return words(path) - _GENERIC - {"x", "y", "z", "w"}, part[2] if part else ""


def _unit(channel: str, topic: Topic, field: Field) -> tuple[str, str]:
    """The unit and the evidence for it; '' if there is none."""
    named = words(topic.name) | words(field.path)
    for word in sorted(named & UNIT_WORDS.keys()):
        try:
            conversion(channel, UNIT_WORDS[word])
        except InputError:
            continue
        return UNIT_WORDS[word], f"its unit by '{word}' in the name"
    unit = unit_by_range(channel, named, field.largest)
    return unit, f"no unit is stated, {unit} fits its range: check" if unit else "nothing states its unit"


def _kind(topic: Topic) -> str:
    return plain(topic.msgtype.replace("/msg/", "/"))
