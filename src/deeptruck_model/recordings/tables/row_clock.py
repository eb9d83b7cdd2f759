"""Finds the clock column of a table and its format, by trying the reader of row times on each candidate."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from deeptruck_core.account import Account
from deeptruck_core.arrays import Array
from deeptruck_core.errors import InputError
from deeptruck_model.recordings.candidates import yaml_text
from deeptruck_model.recordings.tables.column import MOST_ABOVE, Column
from deeptruck_model.recordings.tables.columns import Clock
from deeptruck_model.recordings.tables.csv_text import NUMBER
from deeptruck_model.recordings.tables.row_times import OF_DAY, is_iso, packed_format, timed, usual_formats
from deeptruck_model.recordings.tables.table import Table
from deeptruck_model.recordings.units import TIME_UNITS
from deeptruck_model.recordings.words import NO_TIME, TIME

COUNTED = 2.0  # times that where the unit of speed is not known either
UNITS = {  # tried where none is stated, and by how much of a log ratio each is less usual
    "s": 0.0, "ms": 1.0, "us": 1.0, "ns": 1.0, "min": 3.0, "h": 3.0, "days": 3.0,
}  # fmt: skip
EPOCHS = (  # what counts from 1970, or the days of Excel and Matlab
    (9e8, 5e9, "s"), (9e11, 5e12, "ms"), (9e14, 5e15, "us"), (9e17, 5e18, "ns"),
    (2e4, 8e4, "days"), (6e5, 8e5, "days"),
)  # fmt: skip
USUAL_ACCELERATION = 3.0  # in units of a speed, in a second: in km/h about 0.8 m/s^2
DATE_ALONE = re.compile(r"\d{1,4}[-./]\d{1,2}[-./]\d{1,4}")
DAY_ALONE = re.compile(r"\d{1,2}:\d{2}(:\d{2}.*)?")


@dataclass(frozen=True)
class RowClock:
    """The clock of a table: the line `time:` of COLUMNS.yaml ('' without a clock), the reason for it, and
    `seconds` (n,), the times of the rows, NaN where a row has none."""

    line: str
    why: str
    columns: tuple[str, ...] = ()
    seconds: Array | None = None


@dataclass(frozen=True)
class _Trial:
    clock: Clock
    why: str
    sure: bool = True  # the unit is stated


def find_clock(table: Table, speeds: Sequence[Array], known: bool = True) -> RowClock:
    """The clock of a table, found by its headers and cells.

    `speeds`, each (n,), are columns of a speed in any unit, which is `known` or not: their rates of change
    decide between units of time. Of several clocks the one with fractions of a second is preferred, then date
    with time of day, then one that never goes back (a time of the lap does), then the plainest name.
    """
    found: list[tuple[tuple[object, ...], RowClock]] = []
    refused, places = "", {name: k for k, name in enumerate(table.columns)}
    for trial in _trials(table):
        fresh = replace(table, account=Account(str(table.path), "rows"))
        try:
            kept, time, _ = timed(fresh, trial.clock)
        except InputError as error:
            refused = refused or (str(error).removeprefix(f"{table.path}: ") if trial.sure else "")
            continue
        seconds = np.full(len(table), np.nan)
        seconds[np.searchsorted(table.rows, np.sort(kept.rows))] = time[np.argsort(kept.rows)]
        columns = trial.clock.columns
        extra = len(frozenset().union(*(table[name].header.words for name in columns)) - TIME)
        unusual = UNITS.get(trial.clock.unit, 0.0) * (1.0 if known else COUNTED)
        off = time[-1] if trial.sure else unusual + _unlikely(seconds, speeds)
        whole = not trial.sure or bool(np.allclose(time, np.rint(time)))
        order = (whole, -len(columns), _falls(table, columns), extra, places[columns[0]], off)
        found.append((order, RowClock(_line(trial.clock), trial.why, columns, seconds)))
    if found:
        return min(found, key=lambda one: one[0])[1]
    return RowClock("", refused or "no column looks like a clock")


def _falls(table: Table, columns: tuple[str, ...]) -> bool:
    """Whether a clock of plain numbers goes back."""
    if len(columns) > 1 or table[columns[0]].is_temporal:
        return False
    values = table[columns[0]].values
    return bool((np.diff(values[np.isfinite(values)]) < 0.0).any())


def _line(clock: Clock) -> str:
    names = [yaml_text(name) for name in clock.columns]
    column = names[0] if len(names) == 1 else f"[{', '.join(names)}]"
    how = f', format: "{clock.format}"' if clock.format else f", unit: {clock.unit}" if clock.unit else ""
    return f"time: {{column: {column}{how}}}"


def _trials(table: Table) -> Iterator[_Trial]:
    first = {name: _first(column) for name, column in table.columns.items()}
    dates = [name for name, cell in first.items() if DATE_ALONE.fullmatch(cell)]
    days = [name for name, cell in first.items() if DAY_ALONE.fullmatch(cell)]
    for date in dates:
        for day in days:
            yield from _dated((date, day), f"{first[date]} {first[day]}")
    for k, (name, column) in enumerate(table.columns.items()):
        words, unit = column.header.words, column.header.unit
        if column.is_temporal:
            yield _Trial(Clock((name,), unit=""), f"'{name}' has the type {column.raw.type}")
        elif NUMBER.fullmatch(first[name]):
            if (words & TIME or (unit in TIME_UNITS and _even(column))) and not words & NO_TIME:
                yield from _numbers(column)
        elif name not in dates and (words & TIME or k == 0):
            yield from _dated((name,), first[name])


def _even(column: Column) -> bool:
    """Whether the numbers of a column rise from row to row by about the same step."""
    steps = np.diff(column.values)
    steps = steps[np.isfinite(steps)]
    return len(steps) > 1 and bool((steps > 0.0).all() and steps.std() < 0.5 * steps.mean())


def _dated(names: tuple[str, ...], cell: str) -> Iterator[_Trial]:
    """Clocks of dates or times of day in the format of this cell."""
    what = " and ".join(f"'{name}'" for name in names)
    if OF_DAY.fullmatch(cell) or is_iso(cell):
        yield _Trial(Clock(names, unit="iso"), f"{what} as {cell}")
        return
    for form in usual_formats(cell):
        yield _Trial(Clock(names, format=form), f"{what} as {cell}")


def _numbers(column: Column) -> Iterator[_Trial]:
    """Clocks of a column of numbers in its unit, without marks, by its size, or in every unit."""
    name, unit = column.name, column.header.unit
    values = column.values[np.isfinite(column.values)]
    step = float(np.median(np.diff(values))) if len(values) > 1 else np.nan
    epochs = (
        epoch for low, high, epoch in EPOCHS
        if len(values) and low <= values[0] < high and (epoch != "days" or step < 1e-3)
    )  # fmt: skip
    if unit in TIME_UNITS:
        yield _Trial(Clock((name,), unit=unit), f"'{name}', {column.header.stated}")
    elif unit:
        return
    elif form := packed_format(pc.cast(column.raw, pa.string())):
        yield _Trial(Clock((name,), format=form), f"'{name}' as {_first(column)}, a clock without marks")
    elif epoch := next(epochs, ""):
        yield _Trial(Clock((name,), unit=epoch), f"'{name}' counts {epoch} by its size")
    else:
        for one in UNITS:
            apart = f"rows {step * TIME_UNITS[one]:.4g} s apart if in {one}, which no header says: check"
            yield _Trial(Clock((name,), unit=one), f"'{name}', {apart}", sure=False)


def _unlikely(seconds: Array, speeds: Sequence[Array]) -> float:
    """Magnitude of the log ratio of the speeds' acceleration (95 % quantile) to a vehicle's usual one, the
    largest over `speeds`. A wrong unit of time changes the ratio by a factor of 60 or more."""
    worst = 0.0
    for speed in speeds:
        filled = np.isfinite(seconds) & np.isfinite(speed)
        t, v = seconds[filled], speed[filled]
        k = max(1, len(t) // 1000)
        if len(t) > 10 and v.max() > v.min():
            steep = float(np.quantile(np.abs((v[k:] - v[:-k]) / (t[k:] - t[:-k])), 0.95))
            worst = max(worst, abs(np.log(max(steep, 1e-12) / USUAL_ACCELERATION)))
    return worst


def _first(column: Column) -> str:
    """The first filled cell below a row of units."""
    try:
        cells = column.cells
    except InputError:
        return ""
    some = [str(cell) for cell in cells[: MOST_ABOVE + 200].to_pylist() if cell]
    return next((cell for cell in some if re.search(r"\d", cell)), "")
