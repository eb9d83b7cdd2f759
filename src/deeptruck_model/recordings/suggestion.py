"""A topic map proposed for a bag of unknown topics, with what speaks for each line of it."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from deeptruck_model.errors import InputError
from deeptruck_model.reading import plain
from deeptruck_model.recordings.channel_words import (
    BY_WORDS,
    COMMANDED,
    LEADER,
    UNIT_WORDS,
    unit_by_range,
    words,
)
from deeptruck_model.recordings.message_types import MESSAGE_TYPES, WITH_QUATERNION, Known, Role
from deeptruck_model.recordings.survey import Field, Survey, Topic, survey
from deeptruck_model.recordings.topic_map import DEFAULT_TOPICS
from deeptruck_model.recordings.units import conversion, known_units
from deeptruck_model.signals import CHANNELS, TruckInterface

NEEDED = {
    "speed": "without it there is no recording",
    "engine_command": "needed to learn the engine",
    "brake_command": "needed to learn the brakes",
}
OURS, TYPE, FIELD, TOPIC = 4, 3, 2, 1  # what a candidate is known by, the surest highest
DEMANDS = ("engine_command", "brake_command")  # of these channels a command is a candidate
SAFE = re.compile(r"[A-Za-z_/][\w/.]*")  # what YAML reads as text without quotes
_PLAIN_TEXT = {"yes", "no", "on", "off", "true", "false", "null", "y", "n"}
_VECTOR = re.compile(r"(^|\.)([xyzw])$")
_GENERIC = frozenset(("data", "value", "vector", "position", "point", "linear", "twist", "accel"))


@dataclass(frozen=True)
class Candidate:
    """A number that may be the channel; `unit` is '' where nothing says it, `sure` one of OURS to TOPIC.

    `scale` and `offset` come before the unit. `place` is its rank among the fields of its type. `needs` says
    what must be filled in before it is of use, where that is more than a unit.
    """

    channel: str
    topic: Topic
    field: Field
    unit: str
    why: str
    sure: int
    role: Role = Role.MEASURED
    scale: float = 1.0
    offset: float = 0.0
    place: int = 0
    needs: str = ""

    @property
    def order(self) -> tuple[object, ...]:
        """The most likely first: measured, surest, then what has a unit, changes, and comes most often."""
        rate = self.topic.rate_hz
        often = -rate if np.isfinite(rate) else 0.0
        known = (-self.sure, not self.unit, self.field.still, self.place, often)
        return (self.sure != OURS, self.role, *known, self.topic.name, self.field.path)

    @property
    def line(self) -> str:
        """The line of a topic map."""
        unit = f", unit: {_yaml(self.unit or '?')}"
        if (self.scale, self.offset) != (1.0, 0.0):
            unit += f", scale: {self.scale:g}, offset: {self.offset:g}"
        return f"{self.channel}: {{topic: {_yaml(self.topic.name)}, field: {_yaml(self.field.path)}{unit}}}"

    @property
    def remark(self) -> str:
        """Why, and what the bag holds there."""
        still = "; never changes here" if self.field.still else ""
        return f"{self.why}; {span(self.field)} at {rate(self.topic)}{still}{self._beyond()}"

    def _beyond(self) -> str:
        """A warning where the values, in this unit, are none of a truck."""
        if not self.unit:
            return ""
        ends = self.scale * np.array([self.field.low, self.field.high]) + self.offset
        ends = conversion(self.channel, self.unit)(ends)
        known = CHANNELS[self.channel]
        within = known.low <= ends.min() and ends.max() <= known.high
        return (
            ""
            if within
            else f"; beyond {known.low:g} to {known.high:g}, what a truck can: is the unit right?"
        )


@dataclass(frozen=True)
class Suggestion:
    """What a bag holds, and the candidates of each channel that has some, the most likely first.

    `commanded` are set points of channels that must be measured, such as a desired speed: they are shown and
    never proposed.
    """

    survey: Survey
    candidates: dict[str, list[Candidate]]
    commanded: dict[str, list[Candidate]]

    def taken(self, channel: str) -> Candidate | None:
        """The candidate that the proposed map reads; None where there is none, or its unit is not known."""
        found = self.candidates.get(channel, [])
        return found[0] if found and found[0].unit else None

    @property
    def lacking(self) -> list[str]:
        """What must be filled in before the map serves for training, a line each."""
        return [
            f"{channel} has no line yet, {why}: "
            + ("say in which unit it is" if self.candidates.get(channel) else "no topic looks like it")
            for channel, why in NEEDED.items()
            if self.taken(channel) is None
        ]

    def text(self) -> str:
        """The proposed topic map as YAML, with what speaks for each line."""
        head = [
            f"# Topic map for {plain(str(self.survey.bag))}, proposed by 'deeptruck-model suggest'.",
            "# Check every line: the bag does not say what its numbers mean.",
            "# What begins with '#' is not read: other candidates, and channels that were not found.",
            "# A line may have scale and offset too: scale: -1 turns a sign.",
        ]
        blocks = [block for channel in CHANNELS if (block := list(self._block(channel)))]
        return "\n".join([*head, *(line for block in blocks for line in ("", *block))]) + "\n"

    def _block(self, channel: str) -> Iterator[str]:
        """The lines of one channel; none where it is not needed and has no candidate."""
        found, taken = self.candidates.get(channel, []), self.taken(channel)
        title = f"# {channel}: {CHANNELS[channel].meaning}."
        asked = [
            f"# {plain(one.topic.name)}, {plain(one.field.path)} is a command, not taken: {one.remark}."
            for one in self.commanded.get(channel, [])
        ]
        if not found:
            if channel in NEEDED:
                yield f"{title} NOT FOUND, {NEEDED[channel]}. Fill in:"
                unit = known_units(channel)[0]
                yield f"# {channel}: {{topic: /TOPIC, field: FIELD, unit: {unit}}}"
            elif channel == "grade" and (turned := self._quaternions()):
                yield f"{title} Not found; {turned} is a quaternion, of which no single field is a slope."
            elif asked:
                yield f"{title} Not found."
            yield from asked
            return
        number = f" {len(found)} candidates, the likeliest first." if len(found) > 1 else ""
        yield f"{title}{number}"
        for one in found:
            if not one.unit:
                units = ", ".join(dict.fromkeys(known_units(channel)))
                yield f"# The next line needs {one.needs or f'a unit, one of: {units}'}."
            yield f"# {one.remark}."
            yield f"{'' if one is taken else '# '}{one.line}"
        yield from asked

    def _quaternions(self) -> str:
        turned = [topic.name for topic in self.survey.topics if topic.msgtype in WITH_QUATERNION]
        return plain(f"the orientation in {', '.join(turned)}") if turned else ""


def suggest(bag: str | Path) -> Suggestion:
    """Which fields of a bag may be which channels.

    Raises InputError where it is missing, damaged or empty.
    """
    found = survey(bag)
    candidates: dict[str, list[Candidate]] = {}
    commanded: dict[str, list[Candidate]] = {}
    for topic in found.topics:
        for field in topic.fields:
            one = _candidate(topic, field, found.interface)
            if one is not None:
                set_point = one.role is Role.COMMANDED and one.channel not in DEMANDS and one.sure != OURS
                (commanded if set_point else candidates).setdefault(one.channel, []).append(one)
    for several in (*candidates.values(), *commanded.values()):
        several.sort(key=lambda one: one.order)
    return Suggestion(found, candidates, commanded)


def _candidate(topic: Topic, field: Field, interface: TruckInterface | None) -> Candidate | None:
    """The field as the one channel that it may be, by our own topics, its type, or its words."""
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
    channel: str
    for channel, rule in BY_WORDS.items():
        asked = [one for one in rule.any_of if one <= own | around and (one & own or not own)]
        spoilt = rule.none_of & (own if own and channel in NEEDED else own | around)
        spoilt |= LEADER & (own | around) if channel == "speed" else frozenset()
        if not asked or spoilt or component not in ("", "y" if asked[0] & {"pitch"} else "x"):
            continue
        unit, told = _unit(channel, topic, field)
        where = "its name" if asked[0] & own else "the topic's name"
        why = f"{_kind(topic)}: '{' '.join(sorted(asked[0]))}' in {where}; {told}"
        role = Role.COMMANDED if asked_for else Role.MEASURED
        if channel == "engine_torque" and asked_for:
            channel = "engine_command"
        return Candidate(channel, topic, field, unit, why, FIELD if asked[0] & own else TOPIC, role)
    return None


def _own_words(path: str) -> tuple[frozenset[str], str]:
    """The words that say what a field is, without those of any message, and which part of a vector it is."""
    named = re.search(r"\[\w+=(.+)\]$", path)
    if named:
        return words(named[1]), ""
    part = _VECTOR.search(path)
    return words(path) - _GENERIC - {"x", "y", "z", "w"}, part[2] if part else ""


def _unit(channel: str, topic: Topic, field: Field) -> tuple[str, str]:
    """The unit and by what it is told; '' where it is not."""
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


def span(field: Field) -> str:
    """The range of a field."""
    if np.isnan(field.largest):
        return "never a number"
    return f"{field.low:.4g} to {field.high:.4g}" if not field.still else f"{field.low:.4g}"


def rate(topic: Topic) -> str:
    """How often a topic comes."""
    return f"{topic.rate_hz:.3g} Hz" if np.isfinite(topic.rate_hz) else f"{topic.messages} messages"


def _yaml(text: str) -> str:
    """A text as a YAML value."""
    safe = SAFE.fullmatch(text) and text.lower() not in _PLAIN_TEXT
    return text if safe else json.dumps(text)
