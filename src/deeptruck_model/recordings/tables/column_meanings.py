"""What the columns of a table may mean: the channel by words and units of the header, the unit also by the
range of the numbers or by agreement with other columns.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deeptruck_core.arrays import Array
from deeptruck_core.reading import plain
from deeptruck_model.recordings.candidates import DEMANDS, FIELD, TOPIC, Candidate
from deeptruck_model.recordings.consistency.agreement import metres_of
from deeptruck_model.recordings.consistency.proposals import unit_of
from deeptruck_model.recordings.interpolate import Series
from deeptruck_model.recordings.message_types import Role
from deeptruck_model.recordings.ranges import RAW_TORQUE
from deeptruck_model.recordings.schemas import PARTS
from deeptruck_model.recordings.survey import Field
from deeptruck_model.recordings.tables.column import RARE, Column
from deeptruck_model.recordings.tables.row_clock import RowClock
from deeptruck_model.recordings.tables.table import Table
from deeptruck_model.recordings.units import conversion, metres_per_degree
from deeptruck_model.recordings.words import (
    BY_WORDS,
    COMMANDED,
    IMPERIAL,
    LEADER,
    METRIC,
    fits,
    named_channels,
    sibling,
    units_by_range,
)

LOOKED_AT = 100_000  # rows by which the clock is found and units are compared
SIGNED = 0.02  # of the largest value: below minus this a pedal does brake
_LAST = 10  # place behind all others: receivers report a speed a second or two late
_SATELLITES = frozenset(("gps", "gnss"))
_TORQUE = frozenset(("torque", "engine"))
_DRIVES = frozenset(("acceleration", "accelerator", "accel", "throttle", "gas", "pedal"))
_AVERAGE = frozenset(("avg", "average", "mean"))
_TELLING = {  # units by which a column is known without a word
    "speed": ("km/h", "mph", "m/s"), "engine_speed": ("rpm",), "engine_torque": ("N m", "Nm"),
    "fuel_rate": ("l/h", "g/h", "kg/h", "g/s", "ml/min"),
}  # fmt: skip
_COUNTS = {  # counts of J1939 and of loggers without floats
    "speed": (("km/h", 0.1), ("km/h", 1 / 256), ("km/h", 0.01), ("m/s", 0.01), ("m/s", 0.001)),
    "engine_command": (("percent", 0.4), ("percent", 0.1)),
    "brake_command": (("percent", 0.4), ("percent", 0.1)),
    "engine_speed": (("rpm", 0.125),),
}
SWITCH = "a measured value: this one is on or off only"
_OF_OTHERS = {"metric": ("mph", "ft", "degF", "psi"), "imperial": ("km/h",)}  # units that the others rule out
PLACE_WORDS = frozenset(("x", "pos", "position", "vehicle", "utm", "local", "odom", "map", "m", "easting"))


def meanings_of(table: Table) -> list[Candidate]:
    """What the columns of numbers may mean, each with its possible units; of a VBO file with those of its
    places."""
    columns, vbo = table.numeric, table.path.suffix.lower() == ".vbo"
    system = _system(table)
    found = [one for column in columns for one in _of_column(column, system)]
    found = [_of_vbo(one) for one in found] if vbo else found
    return _pedals_alike([*found, *_by_unit(columns, found)])


def _system(table: Table) -> str:
    """'metric' or 'imperial' by all units and the language of the headers; '' if both or none occur."""
    headers = [column.header for column in table.columns.values()]
    units = {one.unit.lower() for one in headers}
    metric = bool(units & METRIC) or any(one.german for one in headers)
    imperial = bool(units & IMPERIAL)
    return "" if metric == imperial else "metric" if metric else "imperial"


def _of_column(column: Column, system: str) -> list[Candidate]:
    """The first channel that matches the words of the header and can have its unit; both commands for one
    pedal that drives above zero and brakes below."""
    words, unit, values = column.header.words, column.header.unit, column.values
    for named in named_channels(words, frozenset()):
        channel = named.channel
        percent = channel == "engine_torque" and bool(unit) and not fits(channel, unit)
        if channel == "engine_torque" and (percent or words & COMMANDED):
            channel = "engine_command"  # a torque in percent is what a demand is in
        if channel == "speed" and "wheel" in words and unit == "rpm":
            needs = "the rolling radius r of the wheel: scale is 0.1047 r, here for 0.5 m"
            turns = _candidate(column, channel, named.asked, [], "turns of a wheel", place=_LAST)
            return [replace(turns, scale=0.05236, guess="m/s", needs=needs)]
        driven = channel == "gap" and (unit in ("km", "mi") or _grows(values))
        if driven or (unit and not fits(channel, unit)):
            continue
        units, said = [unit], f"its unit by {column.header.stated}"
        if not unit:
            units = units_by_range(channel, words, column.largest)
            units = [one for one in units if one not in _OF_OTHERS.get(system, ())]
            if channel == "engine_command" and not words & _TORQUE:
                units = [one for one in units if one != "N m"]
            known = len(units) == 1 and units[0]
            said = (
                f"no unit is stated, {units[0]} alone fits its range: check" if known else "no unit is stated"
            )
        role = Role.COMMANDED if words & COMMANDED else Role.MEASURED
        place = named.place + (1 if percent else 0)  # an output, behind the pedal that demands it
        place += _LAST if channel == "speed" and words & _SATELLITES else 0
        if channel in DEMANDS and words & _DRIVES and (values < -SIGNED * column.largest).mean() > RARE:
            says = f"{said}; one column that drives above zero and brakes below"
            units = [unit] if unit else units_by_range("engine_command", frozenset(), column.largest)
            one = _candidate(column, channel, named.asked, units, says, place=place, role=role)
            return [replace(one, channel=c, part=part) for c, part in zip(DEMANDS, PARTS, strict=True)]
        one = _candidate(column, channel, named.asked, units, said, place=place, role=role)
        one = _of_counts(one, column)
        switch = channel in DEMANDS and {*np.unique(values[:LOOKED_AT])} == {0.0, 1.0}
        return [replace(one, unit="", units=(), needs=SWITCH) if switch else one]
    return []


def _candidate(
    column: Column, channel: str, asked: frozenset[str], units: list[str], stated: str, **more: Any
) -> Candidate:
    """A column as a channel, by words of its name; a unit that the header states is the surest."""
    why = f"by its name ({' '.join(sorted(asked))})" if asked else ""
    sure, unit = FIELD if column.header.unit else TOPIC, units[0] if len(units) == 1 else ""
    more |= {"stated": stated, "units": () if unit else tuple(units)}
    return Candidate(channel, None, Field.of(column.name, column.values), unit, why, sure, **more)


def _of_vbo(one: Candidate) -> Candidate:
    """Places of a VBO file are in minutes, and longitude is positive to the west."""
    if one.channel not in ("latitude", "longitude"):
        return one
    west = one.channel == "longitude"
    said = f"in minutes{', positive to the west,' if west else ''} as VBO files have it"
    return replace(one, unit="arcmin", units=(), scale=-1.0 if west else 1.0, stated=said)


def _of_counts(one: Candidate, column: Column) -> Candidate:
    """The candidate with the scale and offset of J1939, or of another logger, where the numbers are as on the
    bus: proposed for a torque in percent, else asked for."""
    low, most = float(np.nanmin(column.values)), column.largest
    if one.channel == "engine_command" and one.unit in ("%", "percent"):
        zero, largest = RAW_TORQUE
        if column.header.words & _TORQUE and zero < most <= largest and low > 0.5 * zero:
            said = (
                f"{one.stated}; percent torque of J1939 without its offset, as more than {zero:g} % is none"
            )
            return replace(one, offset=-zero, stated=said)
    if one.unit or one.units:
        return one
    fitting = [
        (unit, scale)
        for unit, scale in _COUNTS.get(one.channel, ())
        if unit in units_by_range(one.channel, column.header.words, scale * most)
    ]
    if not fitting:
        return one
    unit, scale = max(fitting, key=lambda count: conversion(one.channel, count[0]).factor * count[1])
    counts = " or ".join(f"{scale:.4g} {unit}" for unit, scale in fitting)
    needs = f"a check: are its numbers counts of {counts}? Else its unit"
    return replace(one, scale=scale, guess=unit, needs=needs, counts=tuple(fitting))


def _pedals_alike(found: list[Candidate]) -> list[Candidate]:
    """The candidates without the unit of a pedal that states none, where the other pedal is in counts."""
    pedals = [one for one in found if one.channel in DEMANDS and one.sure == TOPIC]
    if not any(one.counts for one in pedals):
        return found
    needs = "a check: the other pedal is in counts; is this one in {}?"
    return [
        replace(one, unit="", guess=one.unit, needs=needs.format(one.unit))
        if one.unit and one in pedals
        else one
        for one in found
    ]


def _by_unit(columns: list[Column], known: list[Candidate]) -> list[Candidate]:
    """Channels that no header names, by the only column in a unit that nothing else on a truck has."""
    found = []
    for channel, units in _TELLING.items():
        if any(one.channel == channel and one.role is Role.MEASURED for one in known):
            continue
        none_of = (BY_WORDS[channel].none_of | COMMANDED | LEADER) - _AVERAGE
        few = [c for c in columns if c.header.unit in units and not c.header.words & none_of]
        few = [c for c in few if "engine" in c.header.words] or few if channel == "engine_torque" else few
        across = sibling(few[0].name, [c.name for c in few]) if few else ""
        if len(few) == 1 or across:
            unit = few[0].header.unit
            said = f"{'columns' if across else 'the only column'} in {unit}: check; by {few[0].header.stated}"
            found.append(_candidate(few[0], channel, frozenset(), [unit], said))
    return found


def _on_a_plane(columns: list[Column], at: NDArray[np.int64]) -> Iterator[tuple[str, list[Array]]]:
    """Columns x and y of positions in metres, (n,) each, as latitude and longitude near the equator."""
    named = {c.name: c for c in columns if c.header.words & {"x"} and c.header.words <= PLACE_WORDS}
    metres = metres_per_degree(0.0)[::-1]  # of latitude and of longitude
    for name, x in named.items():
        y = next((c for c in columns if c.name == sibling(name, [other.name for other in columns])), None)
        if y is not None and x.header.unit in ("", "m"):
            axes = zip((y.values[at], x.values[at]), metres, strict=True)
            yield plain(name), [(axis - np.nanmean(axis)) / metre for axis, metre in axes]


def _grows(values: Array) -> bool:
    """Whether values never decrease, as those of an odometer."""
    steps = np.diff(values[np.isfinite(values)])
    return bool((steps >= 0.0).all() and (steps > 0.0).any())


def compared(found: list[Candidate], clock: RowClock, table: Table) -> list[Candidate]:
    """Candidates whose unit was undecided, with the one that agrees with columns of known units."""
    if clock.seconds is None:
        return found
    columns = table.numeric
    seconds, at = np.unique(clock.seconds, return_index=True)
    at = at[np.isfinite(seconds)]
    seconds = seconds[: len(at)]

    def column(name: str) -> Series:
        return Series(seconds, table[name].values[at])

    travelled = {c.name: [(plain(c.name), column(c.name))] for c in columns if metres_of(c.name)}
    for name, axes in _on_a_plane(columns, at):
        for channel, axis in zip(("latitude", "longitude"), axes, strict=True):
            travelled.setdefault(channel, []).append((name, Series(seconds, axis)))
    for channel in ("speed", "acceleration", "speed", "grade"):  # each by those before
        known = dict(travelled)
        for one in found:
            if one.unit and one.role is Role.MEASURED:
                values = conversion(one.channel, one.unit)(column(one.field.path).values)
                known[one.channel] = [(one.label, Series(seconds, values)), *known.get(one.channel, [])]
        for k, one in enumerate(found):
            if one.channel != channel or one.unit:
                continue
            options = [(unit, 1.0) for unit in one.units] or list(one.counts)
            unit, scale, why = unit_of(channel, options, column(one.field.path), known)
            if unit:
                stated = f"no unit is stated, {why}: check"
                found[k] = replace(one, unit=unit, scale=scale, stated=stated, guess="", needs="")
    speeds = {one.unit for one in found if one.channel == "speed" and one.unit}
    return [_beside_speed(one, speeds) for one in found]


def _beside_speed(one: Candidate, speeds: set[str]) -> Candidate:
    """A height of no stated unit in the system of units of the speed."""
    if one.channel != "elevation" or not one.units or len(speeds) != 1:
        return one
    unit = "ft" if speeds == {"mph"} else "m"
    return replace(one, unit=unit, stated=f"no unit is stated, {unit} beside a speed in {min(speeds)}: check")
