"""Proposes COLUMNS.yaml for a table, from its headers, a row of units and its values."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Set
from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar

import numpy as np

from deeptruck_core.arrays import Array
from deeptruck_core.reading import plain
from deeptruck_core.signals import CHANNELS
from deeptruck_model.recordings.candidates import Candidate, Proposal, by_channel, span, yaml_text
from deeptruck_model.recordings.consistency.proposals import settled
from deeptruck_model.recordings.schemas import EXTRA
from deeptruck_model.recordings.survey import Field
from deeptruck_model.recordings.tables.column_meanings import LOOKED_AT, compared, meanings_of
from deeptruck_model.recordings.tables.csv_text import Format
from deeptruck_model.recordings.tables.row_clock import RowClock, find_clock
from deeptruck_model.recordings.tables.table import Key, Table, key_of, only, widened
from deeptruck_model.recordings.tables.table_file import find_form, read_table
from deeptruck_model.recordings.words import TIME, fits, header, named_channels, sibling

_NAMES = frozenset(
    ("field", "pid", "signal", "name", "parameter", "diagnostic", "sensor", "messwert", "measurement")
)
PEDAL_WORDS = frozenset(("pedal", "accelerator", "throttle"))
OURS_BEGINS = ["recording", "time"]  # the columns of a table that `table` wrote
_UNITS = frozenset(("unit", "units", "einheit"))
_VALUES = frozenset(("value", "values", "wert", "reading"))


@dataclass(frozen=True)
class TableSuggestion(Proposal):
    """The format of a table, its clock column, and the candidates for each channel."""

    table: Table
    form: Format
    clock: RowClock
    key: Key | None = None
    pivot: tuple[str, str] | None = None

    SOURCE: ClassVar[str] = "column"
    BLANK: ClassVar[str] = "column: COLUMN"

    @property
    def lacking(self) -> list[str]:
        """What must be filled in before `import` can read the table for training, one line each."""
        no_clock = [] if self.clock.line else [f"time has no line yet: {self.clock.why}"]
        several = [f"{self.key}: '{self.key.line}' takes the first"] if self.key else []
        return [*no_clock, *several, *super().lacking]

    def text(self) -> str:
        """COLUMNS.yaml, with the reasons for each line."""
        lines = [
            f"# Columns of {plain(str(self.table.path))}, proposed by 'deeptruck-model suggest'.",
            "# Check every line: a table does not say what its numbers mean.",
            "# What begins with '#' is not read: other candidates, and channels that were not found.",
            "# A channel may have scale and offset too: scale: -1 turns a sign.",
            f"# time: {plain(self.clock.why, 1000)}.",
            self.clock.line or "# time: {column: COLUMN, unit: s}   # or time: {rate_hz: 10}",
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
        return any(words & PEDAL_WORDS for words in named) and not any(
            "engaged" in column.header.words for column in self.table.numeric
        )

    def _extra(self) -> Iterator[str]:
        """Yield the lines of the `extra` section: the remaining numeric columns, commented out with '# '."""
        several = (*self.candidates.values(), *self.commanded.values())
        named = {one.field.path for ones in several for one in ones} | {*self.clock.columns}
        others = [column.name for column in self.table.numeric if column.name not in named]
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
        named = {one.field.path for several in self.candidates.values() for one in several}
        few = [
            plain(c.name)
            for c in self.table.numeric
            if c.header.unit and c.name not in (*named, *self.clock.columns) and fits(channel, c.header.unit)
        ]
        return [f"Is it one of these, by its unit: {', '.join(few)}?"] if few else []

    def listing(self) -> list[str]:
        """Every column with its range and the channels it may be, one line each."""
        lines = []
        for name, column in self.table.columns.items():
            said = "  time" if name in self.clock.columns else self.meant(name)
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
    """Find the columns of a CSV or Parquet table that may be channels. Raises InputError if the table is
    missing, damaged, or no table."""
    path = Path(path)
    form = find_form(path)
    table = read_table(path, form)
    described = zip(table.columns, form.described, strict=False)
    units = {name: header(text).unit for name, text in described}
    pivot = _one_value(table)
    if pivot is not None:
        units = _units_of(table, pivot[0])
        time = [name for name, column in table.columns.items() if column.header.words & TIME][:1]
        table = widened(table, *pivot, time)
    if [*table.columns][:2] == OURS_BEGINS:
        units |= {name: CHANNELS[name].unit for name in table.columns if name in CHANNELS}
    table = table.with_units(units)
    numeric = table.numeric
    key = key_of(table, [column.values for column in numeric if "speed" in column.header.words])
    if key is not None:
        table = only(table, {key.column: key.values[0]})
    meanings = meanings_of(table)
    speeds = [one for one in meanings if one.channel == "speed"]
    clock = find_clock(
        table.take(np.arange(min(len(table), LOOKED_AT))),
        [table[one.field.path].values[:LOOKED_AT] for one in speeds],
        any(one.unit for one in speeds),
    )
    meanings = compared([one for one in meanings if one.field.path not in clock.columns], clock, table)
    fullest = sorted(meanings, key=lambda one: -round(table[one.field.path].filled, 1))
    candidates, commanded = by_channel(fullest)
    found = TableSuggestion(candidates, commanded, table, form, clock, key, pivot)
    seconds, at = np.unique(clock.seconds if clock.seconds is not None else np.zeros(0), return_index=True)
    at = at[np.isfinite(seconds)]

    def values(one: Candidate) -> tuple[Array, Array] | None:
        raw = table[one.field.path].values[at]
        raw = np.hypot(raw, table[one.across].values[at]) if one.across else raw
        return (seconds[: len(at)], raw) if len(at) > 1 else None

    def across(one: Candidate) -> Candidate | None:
        other = sibling(one.field.path, [column.name for column in table.numeric])
        return replace(one, field=Field.of(other, table[other].values)) if other else None

    found.doubts.extend(settled(found, values, across))
    return found


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
