"""A table as series of channels: its rows, clock and units settled once, with an account of what was left
out.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from deeptruck_core.arrays import Array
from deeptruck_core.errors import InputError
from deeptruck_model.recordings.extract import SIDEWAYS
from deeptruck_model.recordings.interpolate import GAP_PERIODS, GAP_S, HELD, Series, period
from deeptruck_model.recordings.tables.columns import Columns
from deeptruck_model.recordings.tables.csv_text import RAGGED
from deeptruck_model.recordings.tables.row_times import timed
from deeptruck_model.recordings.tables.table import Table, of_one, widened, without_copies
from deeptruck_model.recordings.tables.table_file import read_table
from deeptruck_model.recordings.topic_map import Source
from deeptruck_model.recordings.units import conversion, fits
from deeptruck_model.recordings.words import sibling

# times their median step that samples are apart at most, where no one is missing; the least of such steps
EVEN, LEAST_EVEN = 1.5, 20


@dataclass(frozen=True)
class Samples:
    """The channels of a `table` as series in canonical units; `time` (n,) are the times of its rows, s since
    the first, ascending; a new piece begins at each of `cuts`; `notes` say how it was read."""

    table: Table
    time: Array
    series: dict[str, Series]
    cuts: list[float]
    notes: list[str]


def read_samples(path: Path, meaning: Columns) -> Samples:
    """Read a table as its COLUMNS.yaml says. Raises InputError for rows of several vehicles, for what is no
    clock, and for columns that cannot be what they are given for."""
    table = read_table(path, meaning.form)
    if meaning.pivot:
        table = widened(table, *meaning.pivot, meaning.time.columns)
    speed = meaning.channels["speed"].field
    table = of_one(table, meaning.only, speed)
    if not meaning.time.columns:
        table = table.without_text_above(~table[speed].unreadable)
        if RAGGED in table.account.total.aside:
            table.account.remarks.append(
                "rows are the clock: what lies behind one that was left out is too early"
            )
    table, time, cuts = timed(without_copies(table, meaning.time.columns), meaning.time)
    values = {channel: _values(table, channel, column) for channel, column in meaning.channels.items()}
    _check_pedals(table, meaning)
    for channel, step in meaning.split_at.items():
        known = ~np.isnan(values[channel])
        cuts = [*cuts, *time[known][1:][np.abs(np.diff(values[channel][known])) > step]]
    notes: list[str] = []
    series = {channel: _measured(table, channel, time, v, notes) for channel, v in values.items()}
    for channel, column in meaning.channels.items():
        if column.late_s:
            stamped = len(series[channel].valid.time)
            series[channel] = _on_time(channel, series[channel], column.late_s, _segments(time, cuts))
            lost = stamped - len(series[channel].valid.time)
            table.account.channel(channel).set_aside(
                "outside their piece once put back by late_s", count=lost
            )
            notes.append(f"{channel} is stamped {column.late_s:g} s late and was put back")
    return Samples(table, time, series, cuts, notes)


def _check_pedals(table: Table, meaning: Columns) -> None:
    """Raises InputError if one column is given for both commands, drives above zero and brakes below."""
    engine, brake = (meaning.channels.get(name) for name in HELD)
    if engine is None or brake is None or engine.field != brake.field or engine.part or brake.part:
        return
    raw = table[engine.field].values
    if np.nanmin(raw) < 0.0 < np.nanmax(raw):
        raise InputError(
            f"{table.path}: '{engine.field}' drives above zero and brakes below: give engine_command "
            "'part: positive' and brake_command 'part: negative', without 'scale: -1'"
        )


def _values(table: Table, channel: str, column: Source) -> Array:
    """The channel (n,) in its canonical unit. Raises InputError for cells of another unit, and for one
    component of a velocity in place of the whole."""
    values = table.numbers(column.field, channel, column.across)
    if channel == "speed" and not column.across and (other := sibling(column.field, table.columns)):
        sideways = column(table[other].values)
        if np.isfinite(sideways).any() and (rms := float(np.sqrt(np.nanmean(sideways**2)))) > SIDEWAYS:
            raise InputError(
                f"{table.path}: '{column.field}' is given for speed, but '{other}' moves too "
                f"({rms:.1f} m/s): it is one component; take the norm of both by "
                f"'column: [{column.field}, {other}]'"
            )
    written = table[column.field].unit
    if written and fits(channel, written) and conversion(channel, written) != column.convert:
        raise InputError(
            f"{table.path}: cells of '{column.field}' are in {written}, and COLUMNS has another unit for "
            f"{channel}: give it unit: {written}"
        )
    stated, taken = table[column.field].header.unit, column.convert.unit if column.convert else ""
    if stated and taken and fits(channel, stated) and conversion(channel, stated).unit != taken:
        table.account.remarks.append(
            f"{channel} is taken in {taken}, but '{column.field}' states {stated}, which no "
            "factor turns into it"
        )
    return column(values)


def _measured(table: Table, channel: str, time: Array, values: Array, notes: list[str]) -> Series:
    """The channel's samples, without the blank rows between them if a slow sensor fills only some rows.

    Samples that are evenly spaced in time lack none, whatever rows others add between them. A column that
    alternates and then stops belongs to a sensor that failed and is not treated as slow.
    """
    valid = ~np.isnan(values)
    rows_apart, apart = np.diff(np.flatnonzero(valid)), np.diff(time[valid])
    most = EVEN * float(np.median(apart)) if len(apart) else 0.0
    ends = (time[valid][:1] - time[0] <= most).all() and (time[-1] - time[valid][-1:] <= most).all()
    even = len(apart) > LEAST_EVEN and float(apart.max()) <= most and ends
    if valid.all() or (len(rows_apart) and np.median(rows_apart) < 2.0 and not even):
        if not valid.all():
            notes.append(f"{channel} is invalid in {(~valid).sum()} rows of {len(values)}")
        return Series(time, values)
    notes.append(f"{channel} taken as sampled in the {valid.sum()} rows of {len(values)} that have it")
    return Series(time[valid], values[valid])


def _segments(time: Array, cuts: list[float]) -> Array:
    """Starts of the contiguous segments of a table, ascending, followed by infinity."""
    gap = max(GAP_S, GAP_PERIODS * period(time))
    behind_gaps = time[1:][np.diff(time) > gap]
    return np.unique(np.concatenate([time[:1], behind_gaps, cuts, [np.inf]]))


def _on_time(channel: str, series: Series, late_s: float, segments: Array) -> Series:
    """The series with corrected stamps.

    A sample that would leave its segment is not valid in the next segment and is dropped; a NaN ends every
    segment, so that no value is held into the next one. The speed's stamps are the clock of the recording,
    which ends with a segment's last row.
    """
    own = period(series.time)
    stamps, values = [np.zeros(0)], [np.zeros(0)]
    for begin, end in pairwise(segments):
        inside = (series.time >= begin) & (series.time < end)
        if not inside.any():
            continue
        clock = channel == "speed"
        moved = series.time[inside] - late_s
        stays = (moved >= begin) & ((moved <= series.time[inside][-1]) if clock else (moved < end))
        stamps += [moved[stays], *([] if clock else [np.minimum(moved[-1:] + own, end)])]
        values += [series.values[inside][stays], *([] if clock else [np.array([np.nan])])]
    return Series(np.concatenate(stamps), np.concatenate(values))
