"""Proposes COLUMNS.yaml for a table: its clock, and the channels by words and units of the headers.

What numbers are is never guessed from their values: a unit that no header states is proposed where another
channel confirms it, or where no other fits; elsewhere the user has to state it.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Set
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from deeptruck_core.account import Account
from deeptruck_core.arrays import Array
from deeptruck_core.errors import InputError
from deeptruck_core.reading import plain
from deeptruck_core.signals import CHANNELS
from deeptruck_model.recordings.candidates import (
    DEMANDS,
    FIELD,
    TOPIC,
    Candidate,
    Proposal,
    by_channel,
    settled,
    span,
    yaml_text,
)
from deeptruck_model.recordings.message_types import Role
from deeptruck_model.recordings.schemas import EXTRA, PARTS
from deeptruck_model.recordings.survey import Field
from deeptruck_model.recordings.tables.column import Column
from deeptruck_model.recordings.tables.columns import Clock
from deeptruck_model.recordings.tables.csv_text import Format
from deeptruck_model.recordings.tables.row_times import clocks_of, timed
from deeptruck_model.recordings.tables.table import Key, Table, key_of, only, widened, without_copies
from deeptruck_model.recordings.tables.table_file import find_form, read_table
from deeptruck_model.recordings.units import fits
from deeptruck_model.recordings.words import (
    BY_WORDS,
    COMMANDED,
    LEADER,
    TIME,
    header,
    named_channels,
    sibling,
    units_by_range,
)

LOOKED_AT = 100_000  # rows by which the clock is found and columns are compared
# below minus this part of the largest value, in more of the rows: it brakes
SIGNED, SIGNED_SHARE = 0.02, 0.002
# the first columns, by which the writer of a table is known, and the units that it documents
WRITERS: dict[tuple[str, ...], dict[str, str]] = {
    ("recording", "time"): {name: channel.unit for name, channel in CHANNELS.items()},  # `table` wrote it
    ("timestep_time", "vehicle_angle"): {  # SUMO's trajectories, by its xml2csv
        "vehicle_speed": "m/s",
        "vehicle_acceleration": "m/s^2",
        "vehicle_slope": "deg",
    },
}
_LATE = 10  # places behind all others: receivers report a speed a second or two late
_SATELLITES, _TORQUE = frozenset(("gps", "gnss")), frozenset(("torque", "engine"))
_PEDAL = frozenset(("pedal", "accelerator", "throttle"))
_DRIVES = _PEDAL | {"acceleration", "accel", "gas"}
_AVERAGE = frozenset(("avg", "average", "mean"))
_TELLING = {  # units by which a column is known without a word
    "speed": ("km/h", "mph", "m/s"), "engine_speed": ("rpm",), "engine_torque": ("N m", "Nm"),
    "fuel_rate": ("l/h", "g/h", "kg/h", "g/s", "ml/min"),
}  # fmt: skip
_NAMES = frozenset(
    ("field", "pid", "signal", "name", "parameter", "diagnostic", "sensor", "messwert", "measurement")
)
_UNITS, _VALUES = frozenset(("unit", "units", "einheit")), frozenset(("value", "values", "wert", "reading"))
SWITCH = "a measured value: this one is on or off only"


@dataclass(frozen=True)
class TableSuggestion(Proposal):
    """The format of a table, its clock (None if it has none, for the reason `clock_why`), and the candidates
    for each channel."""

    table: Table
    form: Format
    clock: Clock | None
    clock_why: str
    key: Key | None = None
    pivot: tuple[str, str] | None = None

    SOURCE: ClassVar[str] = "column"
    BLANK: ClassVar[str] = "column: COLUMN"

    @property
    def lacking(self) -> list[str]:
        """What must be filled in before `import` can read the table for training, one line each."""
        no_clock = [] if self.clock else [f"time has no line yet: {self.clock_why}"]
        several = [f"{self.key}: '{self.key.line}' takes the first"] if self.key else []
        return [*no_clock, *several, *super().lacking]

    def text(self) -> str:
        """COLUMNS.yaml, with the reasons for each line."""
        clock = (
            self.clock.line if self.clock else "# time: {column: COLUMN, unit: s}   # or time: {rate_hz: 10}"
        )
        lines = [
            f"# Columns of {plain(str(self.table.path))}, proposed by 'deeptruck-model suggest'.",
            "# Check every line: a table does not say what its numbers mean.",
            "# What begins with '#' is not read: other candidates, and channels that were not found.",
            "# A channel may have scale and offset too: scale: -1 turns a sign.",
            f"# time: {plain(self.clock_why, 1000)}.",
            clock,
        ]
        if self.form.delimiter not in (None, ","):
            lines.append(f"delimiter: {json.dumps(self.form.delimiter)}")
        if self.form.encoding != "utf-8":
            lines.append(f"encoding: {self.form.encoding}")
        if self.form.skip_rows:
            lines.append(f"skip_rows: {self.form.skip_rows}")
        if self.pivot:
            lines.append("# Each row has one value: each name becomes a column.")
            lines.append(f"pivot: {{name: {yaml_text(self.pivot[0])}, value: {yaml_text(self.pivot[1])}}}")
        if self.key:
            lines += [f"# {self.key}: choose one.", self.key.line]
        lines += [f"# DOUBTFUL: {line}." for line in self.doubts]
        if self.table.decimal != ".":
            lines.append(f'decimal: "{self.table.decimal}"')
        if self._by_pedal:
            lines.append(
                "# The engine command is a pedal: if a person drove, it was obeyed. Else remove this."
            )
            lines.append("driven_by: person")
        blocks = (f"  {line}" if line else "" for line in self.blocks())
        return "\n".join([*lines, "channels:", *blocks, *self._extra()]) + "\n"

    @property
    def _by_pedal(self) -> bool:
        """Whether the engine command is a pedal, and no column says whether a controller was engaged."""
        named = [header(one.field.path).words for one in self.candidates.get("engine_command", [])[:1]]
        return any(words & _PEDAL for words in named) and not any(
            "engaged" in column.header.words for column in self.table.numeric
        )

    def _left(self) -> list[Column]:
        """The columns of numbers that are neither the clock nor a candidate."""
        several = (*self.candidates.values(), *self.commanded.values())
        named = {one.field.path for ones in several for one in ones}
        named |= {*self.clock.columns} if self.clock else set()
        return [column for column in self.table.numeric if column.name not in named]

    def _extra(self) -> Iterator[str]:
        """The lines of the `extra` section: the remaining numeric columns, commented out with '# '."""
        others = [column.name for column in self._left()]
        if not others:
            return
        yield ""
        yield "# Other columns of numbers, carried as they are written. To take some,"
        yield "# remove '# ' from the next line and from theirs."
        yield f"# {EXTRA}:"
        taken = set[str]()
        for column in others:
            name = _extra_name(column, taken)
            taken.add(name)
            yield f"#   {name}: {yaml_text(column)}"

    def by_unit(self, channel: str) -> list[str]:
        """The columns that nobody has named and that have one of the channel's units."""
        few = [plain(c.name) for c in self._left() if c.header.unit and fits(channel, c.header.unit)]
        return [f"Is it one of these, by its unit: {', '.join(few)}?"] if few else []

    def listing(self) -> list[str]:
        """Every column with its range and the channels it may be, one line each."""
        lines = []
        for name, column in self.table.columns.items():
            said = "  time" if self.clock and name in self.clock.columns else self.meant(name)
            values = column.values if column.is_numbers else np.zeros(0)
            lines.append(f"{plain(name) or '(no name)'}  {span(Field.of(name, values))}{said}")
        return lines


def _extra_name(column: str, taken: Set[str]) -> str:
    """A name under `extra` for a column: its letters and digits, and a number if another has the same."""
    stem = re.sub(r"\W+", "_", column, flags=re.ASCII).strip("_").lower()[:50]
    stem = stem if re.match(r"[a-z]", stem) else f"column_{stem}".rstrip("_")
    stem = f"{stem}_column" if stem in CHANNELS or stem.startswith(("driver_", "engaged")) else stem
    names = (stem, *(f"{stem}_{number}" for number in range(2, len(taken) + 3)))
    return next(name for name in names if name not in taken)


def suggest_columns(path: str | Path) -> TableSuggestion:
    """Find the columns of a CSV, Parquet or MAT table that may be channels. Raises InputError if the table is
    missing, damaged, or no table."""
    path = Path(path)
    form = find_form(path)
    table = read_table(path, form)
    pivot, units = _one_value(table), dict[str, str]()
    if pivot is not None:
        units = _units_of(table, pivot[0])
        time = [name for name, column in table.columns.items() if column.header.words & TIME][:1]
        table = widened(table, *pivot, time)
    for begin, known in WRITERS.items():
        units |= known if (*table.columns,)[: len(begin)] == begin else {}
    columns = {name: replace(c, below=units.get(name, "")) for name, c in table.columns.items()}
    table = replace(table, columns=columns)
    key = key_of(table, [column.values for column in table.numeric if "speed" in column.header.words])
    if key is not None:
        table = only(table, {key.column: key.values[0]})
    clock, why, seconds = _clock(table.take(np.arange(min(len(table), LOOKED_AT))))
    meanings = meanings_of(table, clock.columns if clock else ())
    candidates, commanded = by_channel(
        sorted(meanings, key=lambda one: -round(table[one.field.path].filled, 1))
    )
    found = TableSuggestion(candidates, commanded, table, form, clock, why, key, pivot)
    seconds, at = np.unique(seconds, return_index=True)
    at = at[np.isfinite(seconds)]
    numeric = [column.name for column in table.numeric]

    def values(one: Candidate) -> tuple[Array, Array] | None:
        raw = table[one.field.path].values[at]
        raw = np.hypot(raw, table[one.across].values[at]) if one.across else raw
        return (seconds[: len(at)], raw) if len(at) > 1 and np.isfinite(raw).any() else None

    def across(one: Candidate) -> Candidate | None:
        other = sibling(one.field.path, numeric)
        return replace(one, field=Field.of(other, table[other].values)) if other else None

    settled(found, values, across)
    return found


def _clock(table: Table) -> tuple[Clock | None, str, Array]:
    """The clock of a table, how it was found, and the times of its rows, (n,), NaN where a row has none. Of
    several the one with fractions of a second is preferred, then one of date and time, then the plainest
    name."""
    found: list[tuple[tuple[object, ...], Clock, str, Array]] = []
    refused = ""
    for place, (clock, why) in enumerate(clocks_of(table)):
        try:
            tried = replace(table, account=Account(str(table.path), "rows"))
            kept, time, _ = timed(without_copies(tried, clock.columns), clock)
        except InputError as error:
            refused = refused or str(error).removeprefix(f"{table.path}: ")
            continue
        seconds = np.full(len(table), np.nan)
        seconds[np.searchsorted(table.rows, np.sort(kept.rows))] = time[np.argsort(kept.rows)]
        more = len(frozenset().union(*(table[name].header.words for name in clock.columns)) - TIME)
        raw = table[clock.columns[0]]
        back = len(clock.columns) == 1 and not raw.is_temporal and bool((np.diff(raw.values) < 0.0).any())
        whole = bool(np.allclose(time, np.rint(time)))
        order = (whole, -len(clock.columns), back, more, float(time[-1]), place)
        found.append((order, clock, why, seconds))
    if found:
        return min(found, key=lambda one: one[0])[1:]
    return None, refused or "no column looks like a clock", np.zeros(0)


def meanings_of(table: Table, clock: tuple[str, ...]) -> list[Candidate]:
    """What the columns of numbers may mean by their headers."""
    columns = [column for column in table.numeric if column.name not in clock]
    found = [one for column in columns for one in _of_column(column)]
    for channel, units in _TELLING.items():  # what no header names: the only column in a unit of the channel
        if any(one.channel == channel and one.role is Role.MEASURED for one in found):
            continue
        none_of = (BY_WORDS[channel].none_of | COMMANDED | LEADER) - _AVERAGE
        few = [c for c in columns if c.header.unit in units and not c.header.words & none_of]
        few = [c for c in few if "engine" in c.header.words] or few if channel == "engine_torque" else few
        if len(few) == 1 or (few and sibling(few[0].name, [c.name for c in few])):
            why = f"the only column in {few[0].header.unit}, by {few[0].header.stated}: check"
            found.append(_candidate(few[0], channel, few[0].header.unit, why))
    return found


def _of_column(column: Column) -> list[Candidate]:
    """The first channel that matches the words of the header and can have its unit; both commands for one
    pedal that drives above zero and brakes below."""
    words, unit, values = column.header.words, column.header.unit, column.values
    for named in named_channels(words, frozenset()):
        channel, place = named.channel, named.place
        percent = channel == "engine_torque" and bool(unit) and not fits(channel, unit)
        if channel == "engine_torque" and (percent or words & COMMANDED):
            channel, place = "engine_command", place + percent  # behind the pedal that demands it
        driven = channel == "gap" and (unit in ("km", "mi") or _grows(values))
        if driven or (unit and not fits(channel, unit)):
            continue
        why = f"by its name ({' '.join(sorted(named.asked))}); "
        units = [unit] if unit else units_by_range(channel, words, column.largest)
        if channel == "engine_command" and not unit and not words & _TORQUE:
            units = [one for one in units if one != "N m"]
        only_one = units[0] if len(units) == 1 else ""
        why += f"its unit by {column.header.stated}" if unit else "no unit is stated"
        why += f", {only_one} alone fits its range: check" if only_one and not unit else ""
        place += _LATE if channel == "speed" and words & _SATELLITES else 0
        role = Role.COMMANDED if words & COMMANDED else Role.MEASURED
        one = _candidate(column, channel, only_one, why, place=place, role=role)
        if (
            channel in DEMANDS
            and words & _DRIVES
            and (values < -SIGNED * column.largest).mean() > SIGNED_SHARE
        ):
            units = [unit] if unit else units_by_range("engine_command", frozenset(), column.largest)
            says = f"{why}; one column that drives above zero and brakes below"
            both = replace(one, unit=units[0] if len(units) == 1 else "", why=says)
            return [replace(both, channel=c, part=part) for c, part in zip(DEMANDS, PARTS, strict=True)]
        if channel in DEMANDS and {*np.unique(values[:LOOKED_AT])} == {0.0, 1.0}:
            return [replace(one, unit="", needs=SWITCH)]
        return [one]
    return []


def _candidate(column: Column, channel: str, unit: str, why: str, **more: Any) -> Candidate:
    sure = FIELD if column.header.unit else TOPIC
    return Candidate(channel, None, Field.of(column.name, column.values), unit, why, sure, **more)


def _grows(values: Array) -> bool:
    """Whether values never decrease, as those of an odometer."""
    steps = np.diff(values[np.isfinite(values)])
    return bool((steps >= 0.0).all() and (steps > 0.0).any())


def _units_of(table: Table, names: str) -> dict[str, str]:
    """The unit of each name, if there is a column of units next to names and values."""
    units = next((name for name, column in table.columns.items() if column.header.words & _UNITS), None)
    if units is None:
        return {}
    pairs = zip(table[names].cells.to_pylist(), table[units].cells.to_pylist(), strict=True)
    return {name: unit for name, unit in dict.fromkeys(pairs) if name and unit}


def _one_value(table: Table) -> tuple[str, str] | None:
    """The columns of names and of values if each row has one value; None if rows have several."""
    named = {name: column.header.words for name, column in table.columns.items()}
    name = next((c for c, found in named.items() if found & _NAMES), None)
    values = [c for c, found in named.items() if found & _VALUES]
    value = next(iter(sorted(values, key=lambda c: bool(named[c] & {"raw", "hex"}))), None)
    if name is None or value is None or not table[name].is_text:
        return None
    labels = (header(str(label)).words for label in table[name].raw.unique().to_pylist())
    known = any(next(named_channels(words, frozenset()), None) for words in labels)
    return (name, value) if known else None
