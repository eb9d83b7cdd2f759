"""Numbers of a bag or table that may be channels, checked against one another by the rules of import, and the
YAML that proposes the most probable one for each.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np

from deeptruck_core.arrays import Array
from deeptruck_core.errors import InputError
from deeptruck_core.reading import plain
from deeptruck_core.signals import CHANNELS, TruckInterface
from deeptruck_model.recordings.consistency import agreement, sensors
from deeptruck_model.recordings.extract import SIDEWAYS
from deeptruck_model.recordings.interpolate import Series
from deeptruck_model.recordings.message_types import Role
from deeptruck_model.recordings.recording import Recording
from deeptruck_model.recordings.resample import uniform
from deeptruck_model.recordings.survey import Field, Topic
from deeptruck_model.recordings.topic_map import Taken
from deeptruck_model.recordings.units import conversion, known_units, unit_of_factor

NEEDED = {
    "speed": "without it there is no recording",
    "engine_command": "needed to learn the engine",
    "brake_command": "needed to learn the brakes",
}
OURS, TYPE, FIELD, TOPIC = 4, 3, 2, 1  # what a candidate is known by, the surest highest
DEMANDS = ("engine_command", "brake_command")  # of these channels a command is a candidate
SAFE = re.compile(r"[A-Za-z_/][\w/.]*")  # what YAML reads as text without quotes
COMPARED = (  # channels that others give too, in the order in which they are checked
    "speed", "latitude", "longitude", "elevation", "acceleration", "specific_force", "grade", "engine_speed",
    "engine_command", "brake_command",
)  # fmt: skip
BESIDE = ("latitude", "longitude", "acceleration", "specific_force")  # what gives a speed
_PLAIN_TEXT = {"yes", "no", "on", "off", "true", "false", "null", "y", "n"}


@dataclass(frozen=True)
class Candidate:
    """A number that may be the channel. `unit` is '' if nothing states it; `sure`, from OURS to TOPIC, says
    what the match rests on.

    `topic` is None for a column of a table. `scale` and `offset` are applied before the unit. `place` is its
    rank among the fields of its type or the words for its channel. `needs` lists what the user must fill in,
    apart from a unit.
    """

    channel: str
    topic: Topic | None
    field: Field
    unit: str
    why: str
    sure: int
    role: Role = Role.MEASURED
    scale: float = 1.0
    offset: float = 0.0
    place: int = 0
    needs: str = ""
    across: str = ""  # another field of which the norm is taken with this one
    part: str = ""  # of a pedal that drives and brakes: see topic_map.PARTS

    @property
    def order(self) -> tuple[object, ...]:
        """Sort key: measured before commanded, then certainty, known unit, change and rate."""
        often = -self.topic.rate_hz if self.topic and np.isfinite(self.topic.rate_hz) else 0.0
        known = (-self.sure, not self.unit, self.field.still, self.place, often)
        names = (self.topic.name, self.field.path) if self.topic else ()
        return (self.sure != OURS, self.role, *known, *names)

    @property
    def label(self) -> str:
        """Its topic and field, or its column, as shown to the user."""
        return plain(f"{self.topic.name}, {self.field.path}" if self.topic else self.field.path)

    @property
    def line(self) -> str:
        """The line of a topic map or of the channels in COLUMNS.yaml."""
        name = yaml_text(self.field.path)
        name = f"[{name}, {yaml_text(self.across)}]" if self.across else name
        source = f"topic: {yaml_text(self.topic.name)}, field: {name}" if self.topic else f"column: {name}"
        unit = f", unit: {yaml_text(self.unit or '?')}"
        unit += f", scale: {self.scale:g}" if self.scale != 1.0 else ""
        unit += f", offset: {self.offset:g}" if self.offset else ""
        unit += f", part: {self.part}" if self.part else ""
        return f"{self.channel}: {{{source}{unit}}}"

    @property
    def remark(self) -> str:
        """The reason, and the range of values."""
        at = f" at {rate(self.topic)}" if self.topic else ""
        still = "; never changes here" if self.field.still else ""
        return f"{self.why}; {span(self.field)}{at}{still}{self.beyond}"

    @property
    def beyond(self) -> str:
        """A warning if the values in this unit are impossible for a truck; none for a vector, because the
        range is that of one component."""
        if not self.unit or self.across or self.part:
            return ""
        ends = self.scale * np.array([self.field.low, self.field.high]) + self.offset
        ends = conversion(self.channel, self.unit)(ends)
        known = CHANNELS[self.channel]
        if known.low <= ends.min() and ends.max() <= known.high:
            return ""
        return f"; beyond {known.low:g} to {known.high:g}, what a truck can: is the unit right?"


@dataclass(frozen=True)
class Proposal:
    """The candidates of each channel that has any, most probable first.

    `commanded` holds set points of channels that must be measured, such as a desired speed: they are listed
    but never proposed.
    """

    candidates: dict[str, list[Candidate]]
    commanded: dict[str, list[Candidate]]
    doubts: list[str] = field(default_factory=list, kw_only=True)  # in what is proposed, a line each

    SOURCE: ClassVar[str] = "topic"
    BLANK: ClassVar[str] = "topic: /TOPIC, field: FIELD"

    def meant(self, path: str, topic: Topic | None = None) -> str:
        """What a field or column is listed as, behind its name and range; '' for nothing."""
        known, set_points = (
            [
                one
                for several in kind.values()
                for one in several
                if one.topic is topic and one.field.path == path
            ]
            for kind in (self.candidates, self.commanded)
        )
        if set_points:
            return f"  commanded {set_points[-1].channel}"
        if not known:
            return ""
        return f"  {known[-1].channel}, {known[-1].unit or 'unit not known'}{known[-1].beyond}"

    def taken(self, channel: str) -> Candidate | None:
        """The proposed candidate; None if there is none, or if its unit is not known."""
        found = self.candidates.get(channel, [])
        return found[0] if found and found[0].unit else None

    @property
    def lacking(self) -> list[str]:
        """What must be filled in before the proposal can be used for training, one line each."""
        return [
            f"{channel} has no line yet, {why}: {self._why_not(channel)}"
            for channel, why in NEEDED.items()
            if self.taken(channel) is None
        ]

    def _why_not(self, channel: str) -> str:
        """Why nothing is proposed for a channel."""
        found = self.candidates.get(channel, [])
        if not found:
            return f"no {self.SOURCE} looks like it"
        return f"{found[0].label} needs {found[0].needs}" if found[0].needs else "say in which unit it is"

    def blocks(self) -> Iterator[str]:
        """The lines of all channels, each below the reasons for it and after a blank line."""
        for channel in CHANNELS:
            block = list(self._block(channel))
            yield from ("", *block) if block else ()

    def _block(self, channel: str) -> Iterator[str]:
        """The lines of one channel; none if it is optional and has no candidate."""
        found, taken = self.candidates.get(channel, []), self.taken(channel)
        title = f"# {channel}: {CHANNELS[channel].meaning}."
        asked = [
            f"# {one.label} is a command, not taken: {one.remark}." for one in self.commanded.get(channel, [])
        ]
        if not found:
            if channel in NEEDED:
                yield f"{title} NOT FOUND, {NEEDED[channel]}. Fill in:"
                unit = known_units(channel)[0]
                yield from (f"# {line}" for line in self.by_unit(channel))
                yield f"# {channel}: {{{self.BLANK}, unit: {unit}}}"
                if channel == "engine_command" and (fuel := self.taken("fuel_rate")):
                    yield "# The fuel rate may stand in where no torque was recorded:"
                    yield f"# {replace(fuel, channel=channel).line}"
            elif absent := self.absent(channel):
                yield f"{title} Not found; {absent}."
            elif asked:
                yield f"{title} Not found."
            yield from asked
            return
        number = f" {len(found)} candidates, the most probable first." if len(found) > 1 else ""
        yield f"{title}{number}"
        for one in found:
            if not one.unit:
                units = ", ".join(dict.fromkeys(known_units(channel)))
                yield f"# The next line needs {one.needs or f'a unit, one of: {units}'}."
            yield f"# {one.remark}."
            yield f"{'' if one is taken else '# '}{one.line}"
        yield from asked

    def by_unit(self, channel: str) -> list[str]:
        """What may be a channel by its unit alone, one line each."""
        return []

    def absent(self, channel: str) -> str:
        """A remark on why an optional channel has no candidate, if there is anything to say."""
        return ""


def by_channel(ones: Iterable[Candidate]) -> tuple[dict[str, list[Candidate]], dict[str, list[Candidate]]]:
    """Candidates of each channel, most probable first, and set points of those that must be measured."""
    candidates: dict[str, list[Candidate]] = {}
    commanded: dict[str, list[Candidate]] = {}
    for one in ones:
        set_point = one.role is Role.COMMANDED and one.channel not in DEMANDS and one.sure != OURS
        (commanded if set_point else candidates).setdefault(one.channel, []).append(one)
    for several in (*candidates.values(), *commanded.values()):
        several.sort(key=lambda one: one.order)
    return candidates, commanded


Values = Callable[[Candidate], tuple[Array, Array] | None]


def settled(found: Proposal, values: Values, across: Callable[[Candidate], Candidate | None]) -> None:
    """Check what is proposed as import would, against what was proposed before it; a candidate that import
    would refuse is proposed no more, for the same reason, and the next one is tried.

    `values` gives the times, s, and raw values, each (n,), of a candidate; `across` the other component of a
    vector, None if it is no vector. A unit that nothing states is proposed where another channel confirms it.
    """
    drive: dict[str, Candidate] = {}
    for channel in COMPARED:
        several = found.candidates.get(channel, [])
        others = {c: one for c in BESIDE if (one := found.taken(c))} if channel == "speed" else drive
        for k, one in enumerate(several):
            if one.sure != OURS and one.role is not Role.COMMANDED:
                one = _normed(one, across, values) if channel == "speed" else one
                several[k] = _with_unit(one, others, values)
        several.sort(key=lambda one: one.order)
        while (taken := found.taken(channel)) is not None and (wrong := _refused(taken, drive, values)):
            several[0] = wrong
            several.sort(key=lambda one: not one.unit)
        if taken is not None:
            drive[channel] = taken
    try:
        found.doubts.extend(doubt.says for doubt in sensors.doubts(_read(drive, values)))
    except InputError as error:
        found.doubts.append(str(error))


def _normed(one: Candidate, across: Callable[[Candidate], Candidate | None], values: Values) -> Candidate:
    """The norm of both components of a velocity, where the other one moves too."""
    other = across(one)
    moved = values(other) if other is not None else None
    if other is None or moved is None or not np.sqrt(np.nanmean(moved[1] ** 2)) > SIDEWAYS:
        return one
    both = f"{one.field.path} and {other.field.path} move, as east and north: their norm"
    return replace(one, across=other.field.path, why=f"{one.why.partition(':')[0]}: {both}")


def _with_unit(one: Candidate, drive: Mapping[str, Candidate], values: Values) -> Candidate:
    """The candidate in the unit in which it agrees with the channels of a drive, where none is stated."""
    held = values(one)
    if one.unit or one.needs or held is None or one.channel not in agreement.MEASURED:
        return one
    seen = agreement.measured(one.channel, {**_series(drive, values), one.channel: Series(*held)})
    unit = unit_of_factor(one.channel, 1.0 / seen.factor) if seen is not None else ""
    return (
        replace(one, unit=unit, why=f"{one.why}, {unit} is what {seen.by}: check") if unit and seen else one
    )


def _refused(one: Candidate, drive: Mapping[str, Candidate], values: Values) -> Candidate | None:
    """The candidate as it has to be, if import refuses it in this drive: without its unit or, where that is
    all, with its sign changed. None if import takes it."""
    if one.sure == OURS or (one.channel != "speed" and "speed" not in drive):
        return None
    if one.channel == "speed" and one.field.low == one.field.high == 0.0 and not one.across:
        return replace(one, unit="", needs="another source: this one is 0 all the time")
    try:
        doubts = sensors.doubts(_read({**drive, one.channel: one}, values))
    except InputError as error:
        return replace(one, unit="", needs=f"another source: {str(error).partition(': ')[2] or error}")
    wrong = next((doubt for doubt in doubts if doubt.wrong and doubt.channel == one.channel), None)
    if wrong is None:
        return None
    if wrong.factor == -1.0 and one.scale > 0.0:
        return replace(one, scale=-one.scale, offset=-one.offset, why=f"{one.why}; its sign is turned")
    return replace(one, unit="", needs=f"another source: {wrong.says}")


def _series(drive: Mapping[str, Candidate], values: Values) -> dict[str, Series]:
    """The samples of candidates in canonical units."""
    series = {}
    for channel, one in drive.items():
        if (found := values(one)) is not None and one.unit:
            convert = conversion(channel, one.unit)
            taken = Taken(convert=convert, scale=one.scale, offset=one.offset, part=one.part)
            with np.errstate(invalid="ignore"):
                series[channel] = Series(found[0], taken(found[1]))
    return series


def _read(drive: Mapping[str, Candidate], values: Values) -> list[Recording]:
    """A drive as import reads it; empty without a speed. Raises InputError as import does."""
    series = _series(drive, values)
    units = {c: conversion(c, drive[c].unit).unit for c in DEMANDS if c in series}
    interface = TruckInterface("proposed", units.get(DEMANDS[0], "N m"), units.get(DEMANDS[1]))
    return uniform(series, name="proposed", interface=interface) if "speed" in series else []


def span(field: Field) -> str:
    """Smallest and largest value of a field, as text."""
    if np.isnan(field.largest):
        return "never a number"
    return f"{field.low:.4g} to {field.high:.4g}" if not field.still else f"{field.low:.4g}"


def rate(topic: Topic) -> str:
    """The message rate of a topic, as text."""
    return f"{topic.rate_hz:.3g} Hz" if np.isfinite(topic.rate_hz) else f"{topic.messages} messages"


def yaml_text(text: str) -> str:
    """A text quoted as a YAML value where necessary."""
    safe = SAFE.fullmatch(text) and text.lower() not in _PLAIN_TEXT
    return text if safe else json.dumps(text, ensure_ascii=False)
