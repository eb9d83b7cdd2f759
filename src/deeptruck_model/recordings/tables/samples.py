"""A table as arrays: its rows, clock and units settled once, with an account of what was left out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from deeptruck_core.account import Account
from deeptruck_core.errors import InputError
from deeptruck_model.recordings.extract import SIDEWAYS
from deeptruck_model.recordings.interpolate import HELD
from deeptruck_model.recordings.tables.columns import Columns
from deeptruck_model.recordings.tables.csv_text import RAGGED
from deeptruck_model.recordings.tables.header_words import fits, sibling, spelled
from deeptruck_model.recordings.tables.row_keys import key_of, only, take_turns, widened
from deeptruck_model.recordings.tables.row_times import timed
from deeptruck_model.recordings.tables.table_file import Table, read_table
from deeptruck_model.recordings.topic_map import Source
from deeptruck_model.recordings.units import conversion

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Samples:
    """The channels of a table: `time` (n,) in s since the first row, ascending, `values` (n,) of each channel
    in its canonical unit, NaN where a row has none, and `begins`, the times at which a new piece begins.

    `place` describes the row of a sample in the file, such as 'line 7'.
    """

    time: Array
    values: dict[str, Array]
    begins: list[float]
    account: Account
    place: Callable[[int], str]

    def set_aside(self, out: NDArray[np.bool_], reason: str) -> None:
        """Count the rows `out` (n,) as not used."""
        if out.any():
            self.account.total.set_aside(reason, self.place(int(np.argmax(out))), int(out.sum()))
            self.account.total.used = int((~out).sum())


def read_samples(path: Path, meaning: Columns) -> Samples:
    """Read a table as its COLUMNS.yaml says. Raises InputError for rows of several vehicles, for what is no
    clock, and for columns that cannot be what they are given for."""
    table = read_table(path, meaning.form)
    if meaning.pivot:
        table = widened(table, *meaning.pivot, meaning.time.columns)
    table = only(table, meaning.only)
    for name in meaning.time.columns:
        _ = table[name]
    if not meaning.only:
        speeds = [table[meaning.channels["speed"].field].values]
        if key := key_of(table, speeds):
            raise InputError(f"{path}: {key}: take one by {key.line}")
        if take_turns(speeds[0]):
            raise InputError(
                f"{path}: speed goes back and forth from row to row, as where rows of several vehicles take "
                "turns: export a column that says of which one a row is, and take one by 'only'"
            )
    if not meaning.time.columns:
        table = table.below_units(meaning.channels["speed"].field)
        if RAGGED in table.account.total.aside:
            table.account.remarks.append(
                "rows are the clock: what lies behind one that was left out is too early"
            )
    table, time, begins = timed(table, meaning.time)
    values = {channel: _values(table, channel, column) for channel, column in meaning.channels.items()}
    _check_pedals(table, meaning)
    return Samples(time, values, begins, table.account, table.at)


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
    values = table.numbers(column.field, channel)
    if column.across:
        values = np.hypot(values, table.numbers(column.across, channel))
    elif channel == "speed" and (other := sibling(column.field, table.columns)):
        sideways = column(table[other].values)
        if np.isfinite(sideways).any() and (rms := float(np.sqrt(np.nanmean(sideways**2)))) > SIDEWAYS:
            raise InputError(
                f"{table.path}: '{column.field}' is given for speed, but '{other}' moves too "
                f"({rms:.1f} m/s): it is one component; take the norm of both by "
                f"'column: [{column.field}, {other}]'"
            )
    written = spelled(table[column.field].unit, column.field)
    if written and fits(channel, written) and conversion(channel, written) != column.convert:
        raise InputError(
            f"{table.path}: cells of '{column.field}' are in {written}, and COLUMNS has another unit for "
            f"{channel}: give it unit: {written}"
        )
    return column(values)
