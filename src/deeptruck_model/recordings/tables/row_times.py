"""The clock of a table: which columns may be one, and the time of each row.

Whole numbers and dates stay integers until the first is subtracted: a float resolves an epoch in ns only to
256 ns.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from contextlib import suppress
from datetime import UTC, datetime, timedelta
from functools import partial
from itertools import pairwise

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from deeptruck_core.arrays import Array, Mask
from deeptruck_core.constants import APART_S, BACK_S, DAY_S, HOUR_S, RETURN_S, TRUSTED
from deeptruck_core.errors import InputError
from deeptruck_core.reading import quoted
from deeptruck_model.recordings.clocks import out_of_step
from deeptruck_model.recordings.schemas import DATE_UNITS
from deeptruck_model.recordings.tables.column import MOST_ABOVE, Column
from deeptruck_model.recordings.tables.columns import Clock
from deeptruck_model.recordings.tables.csv_text import NUMBER
from deeptruck_model.recordings.tables.table import Table
from deeptruck_model.recordings.units import TIME_UNITS
from deeptruck_model.recordings.words import NO_TIME, TIME

SHORTEST_S, LONGEST_S = 2e-4, 30.0  # between rows; beyond, a unit was mistaken
USUAL_S = (0.004, 4.0)  # between rows: in one unit alone of s, ms, us and ns
EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
EPOCHS = (  # what counts from 1970, or the days of Excel and Matlab
    (9e8, 5e9, "s"), (9e11, 5e12, "ms"), (9e14, 5e15, "us"), (9e17, 5e18, "ns"),
    (2e4, 8e4, "days"), (6e5, 8e5, "days"),
)  # fmt: skip
MOST_BACK = 0.05  # of the rows; where more go back, they are in no order
SAID = 5  # remarks on one table's clock
DATE_ALONE = re.compile(r"\d{1,4}[-./]\d{1,2}[-./]\d{1,4}")
DAY_ALONE = re.compile(r"\d{1,2}:\d{2}(:\d{2}.*)?")
OF_DAY = re.compile(r"(\d{1,2}):(\d{2})(?::(\d{2})(?:[.,](\d+))?)?")
OF_DATE = re.compile(
    r"(\d{4})[-/.](\d{1,2})[-/.](\d{1,2})(?:[T _-]+(\d{1,2}):(\d{2})(?::(\d{2})(?:[.,](\d+))?)?)?"
    r" *(Z|UTC|GMT|[+-]\d{2}:?\d{2})?"
)
USUAL = (  # formats that are proposed where one of them fits
    "%d.%m.%Y %H:%M:%S,%f", "%d.%m.%Y %H:%M:%S.%f", "%d.%m.%Y %H:%M:%S", "%d.%m.%Y %H:%M",
    "%d/%m/%Y %H:%M:%S.%f", "%m/%d/%Y %H:%M:%S.%f", "%d/%m/%Y %H:%M:%S", "%m/%d/%Y %H:%M:%S",
    "%d/%m/%Y %H:%M", "%m/%d/%Y %H:%M", "%m/%d/%Y %I:%M:%S %p", "%m/%d/%Y %I:%M:%S.%f %p",
    "%d-%m-%Y %H:%M:%S.%f", "%d-%m-%Y %H:%M:%S", "%d-%b-%Y %H:%M:%S.%f", "%d-%b-%Y %H:%M:%S",
    "%d.%m.%y %H:%M:%S", "%a %b %d %H:%M:%S GMT%z %Y", "%a %b %d %H:%M:%S %Y", "%Y%m%d %H:%M:%S",
    "%Y-%m-%d %H-%M-%S", "%Y-%m-%d_%H-%M-%S", "%H:%M:%S:%f", "%I:%M:%S %p",
    "%d.%m.%Y, %H:%M:%S", "%b %d, %Y %I:%M:%S %p", "%b %d, %Y, %I:%M:%S %p", "%b %d %Y %H:%M:%S",
    "%m/%d/%y %H:%M:%S", "%m/%d/%y %I:%M:%S %p", "%d %b %Y %H:%M:%S", "%Y%m%dT%H%M%S", "%d.%m.%y %H:%M:%S,%f",
    "%M:%S.%f", "%M:%S,%f",
)  # fmt: skip


def clocks_of(table: Table) -> Iterator[tuple[Clock, str]]:
    """The clocks that a table may have, by headers and first cells, each with the reason for it."""
    first = {name: _first(column) for name, column in table.columns.items()}
    dates = [name for name, cell in first.items() if DATE_ALONE.fullmatch(cell)]
    days = [name for name, cell in first.items() if DAY_ALONE.fullmatch(cell)]
    for date in dates:
        for day in days:
            yield from _of_dates((date, day), f"{first[date]} {first[day]}")
    for k, (name, column) in enumerate(table.columns.items()):
        words, unit = column.header.words, column.header.unit
        if column.is_temporal:
            yield Clock((name,), unit=""), f"'{name}' has the type {column.raw.type}"
        elif NUMBER.fullmatch(first[name]):
            if (words & TIME or (unit in TIME_UNITS and _even(column))) and not words & NO_TIME:
                yield from _of_numbers(column)
        elif name not in dates and (words & TIME or k == 0):
            yield from _of_dates((name,), first[name])


def _first(column: Column) -> str:
    """The first filled cell below a row of units."""
    try:
        cells = column.cells
    except InputError:
        return ""
    some = [str(cell) for cell in cells[: MOST_ABOVE + 200].to_pylist() if cell]
    return next((cell for cell in some if re.search(r"\d", cell)), "")


def _even(column: Column) -> bool:
    """Whether the numbers of a column rise from row to row by about the same step."""
    steps = np.diff(column.values)
    steps = steps[np.isfinite(steps)]
    return len(steps) > 1 and bool((steps > 0.0).all() and steps.std() < 0.5 * steps.mean())


def _of_dates(names: tuple[str, ...], cell: str) -> Iterator[tuple[Clock, str]]:
    """Clocks of dates or times of day in the format of this cell."""
    quoted_names = " and ".join(f"'{name}'" for name in names)
    why = f"{quoted_names} as {cell}"
    if OF_DAY.fullmatch(cell) or _date_us(cell) is not None:
        yield Clock(names, unit="iso"), why
        return
    for form in usual_formats(cell):
        yield Clock(names, format=form), why


def _of_numbers(column: Column) -> Iterator[tuple[Clock, str]]:
    """The clock of a column of numbers: in its unit, without marks, since 1970, or as rows are apart."""
    name, unit = column.name, column.header.unit
    values = column.values[np.isfinite(column.values)]
    step = float(np.median(np.abs(np.diff(values)))) if len(values) > 1 else np.nan
    epochs = (one for low, high, one in EPOCHS if len(values) and low <= values[0] < high)
    if unit in TIME_UNITS:
        yield Clock((name,), unit=unit), f"'{name}', {column.header.stated}"
    elif unit:
        return
    elif form := packed_format(pc.cast(column.raw, pa.string())):
        yield Clock((name,), format=form), f"'{name}' as {_first(column)}, a clock without marks"
    elif epoch := next((one for one in epochs if one != "days" or step < 1e-3), ""):
        yield Clock((name,), unit=epoch), f"'{name}' counts {epoch} by its size"
    else:
        for one in ("s", "ms", "us", "ns"):
            if USUAL_S[0] <= step * TIME_UNITS[one] < USUAL_S[1]:
                apart = f"rows {step * TIME_UNITS[one]:.4g} s apart if in {one}, which no header says: check"
                yield Clock((name,), unit=one), f"'{name}', {apart}"


def timed(table: Table, clock: Clock) -> tuple[Table, Array, list[float]]:
    """The rows that have a time, their times in s since the first, (n,), ascending, and the starts of pieces.

    Where the clock goes back permanently (a new trip, a clock that was set, the autumn change of time) a new
    piece begins APART_S after the one before. A few rows out of order by at most BACK_S are sorted, the last
    of equal stamps is used, and isolated rows stamped far from their neighbours are omitted. Raises
    InputError if times are missing in too many rows, stand still, go back again and again, or have an
    implausible step.
    """
    if clock.columns:
        seconds = _seconds(table, clock)
        known = ~np.isnan(seconds)
        lost = int(np.argmax(~known))
        wrong = table[clock.columns[0]].cells[lost].as_py()
        advice = f" with {quoted(wrong)}{_advice(clock, _joined(table, clock)[lost])}" if wrong else ""
        table, seconds = table.with_key(known, "time", clock.columns, advice), seconds[known]
    if len(table) < 2:
        raise InputError(f"{table.path} has one row; a recording needs at least two")
    if not clock.columns:
        return table, np.arange(len(table)) / clock.rate_hz, []
    time = seconds - seconds[0]
    _check(table, time, clock)
    table, time = _without_outliers(table, time)
    usual = float(np.median(np.abs(np.diff(time))))
    if says := out_of_step(time):
        raise InputError(
            f"{table.path}: {says}: export whole stamps, or set time: {{rate_hz: {1.0 / usual:.4g}}} where "
            "the rows are evenly spaced"
        )
    return _in_pieces(table, time, usual)


def _check(table: Table, time: Array, clock: Clock) -> None:
    """Raises InputError for times (n,) that are coarser than the rows, clocks without marks read as numbers,
    and steps of another unit."""
    name = " and ".join(f"'{column}'" for column in clock.columns)
    numbers = clock.format is None and clock.unit in TIME_UNITS
    starts = np.flatnonzero(np.r_[True, np.diff(time) != 0])
    if len(time) > 1.5 * len(starts) and (np.diff(time) >= 0).all():  # the log is faster than its clock
        first, rate = quoted(_joined(table, clock)[0].as_py()), "..."
        if len(starts) > 1:
            rate = f"{float(f'{len(time) / (time[-1] + np.median(np.diff(time[starts]))):.2g}'):g}"
        raise InputError(
            f"{table.path}: times in {name} repeat (the first {[*starts, len(time)][1]} rows have {first}): "
            f"drop doubled rows, export it with all its digits, or set time: {{rate_hz: {rate}}} where the "
            "rows are evenly spaced"
        )
    if numbers and (form := packed_format(_joined(table, clock))):
        raise InputError(
            f"{table.path}: the numbers in {name} jump at each full minute, as clocks without marks do; "
            f'set time: {{column: {clock.columns[0]}, format: "{form}"}}'
        )
    usual = float(np.median(np.abs(np.diff(time))))
    if usual > LONGEST_S and not numbers:
        raise InputError(
            f"{table.path}: rows are {usual:g} s apart, which is too coarse: a truck speeds up and brakes in "
            f"seconds; export it at 1 Hz or faster (at most {LONGEST_S:g} s apart)"
        )
    if not SHORTEST_S <= usual <= LONGEST_S:
        raise InputError(
            f"{table.path}: rows are {usual:g} s apart; a unit of time other than "
            f"'{clock.format or clock.unit}' is likely (between {SHORTEST_S:g} and {LONGEST_S:g} s is usual)"
        )


def _without_outliers(table: Table, time: Array) -> tuple[Table, Array]:
    """The table without the few rows with stamps far from their neighbours, after which time continues as
    before."""
    outlier = np.zeros(len(time), dtype=bool)
    steps = np.diff(time)
    jumps = np.flatnonzero((steps < -BACK_S) | (steps > RETURN_S))
    for a, b in pairwise(jumps):
        opposite = (steps[a] > 0.0) is not (steps[b] > 0.0)
        if opposite and not outlier[a] and b - a <= TRUSTED and -BACK_S <= time[b + 1] - time[a] <= RETURN_S:
            outlier[a + 1 : b + 1] = True
    return table.without(outlier, "stamped far off their neighbours"), time[~outlier]


def _in_pieces(table: Table, time: Array, usual: float) -> tuple[Table, Array, list[float]]:
    back = np.flatnonzero(np.diff(time) < -BACK_S) + 1
    if len(back) > max(1, MOST_BACK * len(time)):
        raise InputError(
            f"{table.path}: time goes back in {len(back)} of {len(time)} rows, "
            f"first {table.at(int(back[0]))}: they are in no order; "
            "export them in the order of their time, one table a vehicle"
        )
    for at in back[:SAID]:
        fall = float(time[at - 1] - time[at])
        autumn = abs(fall + usual - HOUR_S) < 2.0 * usual + 1.0
        why = "the end of summer time" if autumn else "several drives in one, or a clock that was set"
        table.account.remarks.append(
            f"time goes back by {fall:.1f} s in {table.at(int(at))} ({why}): a new piece"
        )
    if len(back) > SAID:
        table.account.remarks.append(f"time goes back {len(back) - SAID} times more")
    edges, behind = [0, *back, len(time)], 0.0
    order = np.arange(len(time))
    shifted = time.copy()
    starts: list[float] = []
    for i, j in pairwise(edges):
        order[i:j] = i + np.argsort(time[i:j], kind="stable")
        shifted[i:j] += (behind + APART_S if i else 0.0) - float(time[i:j].min()) * bool(i)
        starts += [float(shifted[i:j].min())] if i else []
        behind = float(shifted[i:j].max())
    if swapped := int((np.diff(time) < 0).sum()) - len(back):
        table.account.remarks.append(f"{swapped} rows put back in the order of their times")
        table, shifted = table.take(order), shifted[order]
    doubled = np.append(np.diff(shifted) <= 0.0, False)
    return table.without(doubled, "with a repeated time"), shifted[~doubled], starts


def _seconds(table: Table, clock: Clock) -> Array:
    """Times (n,) in s relative to some row, NaN if a row has none. Raises InputError if no row has one."""
    column = table[clock.columns[0]]
    kind = column.raw.type
    if len(clock.columns) == 1 and column.is_temporal and not pa.types.is_date(kind):
        ticks = column.raw.cast(pa.int32()) if pa.types.is_time32(kind) else column.raw
        seconds = _since_first(ticks.cast(pa.int64()), TIME_UNITS[kind.unit])
        return _over_midnight(table, seconds, DAY_S) if pa.types.is_time(kind) else seconds
    cells = _joined(table, clock)
    if pc.all(pc.is_null(cells)).as_py():
        raise InputError(f"{table.path}: column '{clock.columns[0]}' has no time; all its cells are blank")
    if clock.format is None and clock.unit in TIME_UNITS:
        return _counted(table, clock, cells)
    parse: Callable[[str], int | None] = _date_us
    over = 0.0
    if clock.format is not None:
        parse = partial(_formatted_us, str(clock.format))
        if not re.search(r"%[dejyYbBmxcDFGs]", clock.format):
            over = DAY_S if re.search(r"%[HIXT]", clock.format) else HOUR_S
    elif OF_DAY.fullmatch(cells.drop_null()[0].as_py()):
        parse, over = _of_day_us, DAY_S
    else:
        dashed = pc.replace_substring_regex(cells, r"^(\d{4})/(\d\d)/(\d\d)", r"\1-\2-\3")
        for stamp in (pa.timestamp("ns"), pa.timestamp("ns", tz="UTC")):
            with suppress(pa.ArrowInvalid):  # zones that differ, single digits, or a cell that is no date
                return _since_first(dashed.cast(stamp).cast(pa.int64()), TIME_UNITS["ns"])
    found = [None if cell is None else parse(cell) for cell in cells.to_pylist()]
    if all(one is None for one in found):
        raise _none(table, clock, cells, pc.is_valid(cells).to_numpy())
    seconds = _since_first(pa.chunked_array([found], pa.int64()), TIME_UNITS["us"])
    return _over_midnight(table, seconds, over) if over else seconds


def _joined(table: Table, clock: Clock) -> pa.ChunkedArray:
    """The time's cells as text; those of two columns joined by a blank."""
    cells = [table[name].cells for name in clock.columns]
    return cells[0] if len(cells) == 1 else pc.binary_join_element_wise(*cells, " ")


def _since_first(ticks: pa.ChunkedArray, tick_s: float) -> Array:
    """Integers minus the first of them, in s (n,); NaN for nulls."""
    known = pc.is_valid(ticks).to_numpy()
    if not known.any():
        return np.full(len(ticks), np.nan)
    whole = pc.fill_null(ticks, 0).to_numpy()
    with np.errstate(over="ignore"):
        return np.where(known, (whole - whole[known][0]).astype(np.float64) * tick_s, np.nan)


def _counted(table: Table, clock: Clock, cells: pa.ChunkedArray) -> Array:
    """Times from numbers: integers where all are whole, floats otherwise."""
    column, scale = table[clock.columns[0]], TIME_UNITS[clock.unit]
    with suppress(pa.ArrowException):
        return _since_first((cells if column.is_text else column.raw).cast(pa.int64()), scale)
    known = np.isfinite(column.values)
    if not known.any():
        raise _none(table, clock, cells, column.unreadable)
    return np.where(known, (column.values - column.values[known][0]) * scale, np.nan)


def _over_midnight(table: Table, seconds: Array, period_s: float) -> Array:
    """Times of day with a day (or hour) added at each decrease by more than half of one; noted in the
    account."""
    known = np.flatnonzero(~np.isnan(seconds))
    falls = np.r_[False, np.diff(seconds[known]) < -period_s / 2]
    if falls.any():
        what = "midnight" if period_s == DAY_S else "the full hour"
        table.account.remarks.append(
            f"the time passes {what} in {table.at(int(known[np.argmax(falls)]))}"
            + (f" and {falls.sum() - 1} times more" if falls.sum() > 1 else "")
        )
        seconds = seconds.copy()
        seconds[known] += period_s * np.cumsum(falls)
    return seconds


def _us(date: datetime) -> int:
    """Microseconds since 1970; a date without a zone is taken as UTC."""
    return (date.replace(tzinfo=date.tzinfo or UTC) - EPOCH) // timedelta(microseconds=1)


def _formatted_us(form: str, cell: str) -> int | None:
    with suppress(ValueError):
        return _us(datetime.strptime(re.sub(r"([.,:]\d{6})\d+", r"\1", cell), form))
    return None


def _of_day_us(cell: str) -> int | None:
    if (match := OF_DAY.fullmatch(cell)) is None:
        return None
    hours, minutes, seconds = (int(part or 0) for part in match.groups()[:3])
    return (hours * 3600 + minutes * 60 + seconds) * 10**6 + int((match[4] or "").ljust(6, "0")[:6])


def _date_us(cell: str) -> int | None:
    """A date of ISO 8601, also with slashes, dots, single digits or UTC behind it."""
    if match := OF_DATE.fullmatch(cell):
        year, *parts, fraction, zone = (part or "0" for part in match.groups())
        month, day, hours, minutes, seconds = (part.zfill(2) for part in parts)
        zone = {"0": "", "UTC": "Z", "GMT": "Z"}.get(zone, zone)
        cell = f"{year}-{month}-{day}T{hours}:{minutes}:{seconds}.{fraction}{zone}"
    with suppress(ValueError):
        return _us(datetime.fromisoformat(cell))
    return None


def packed_format(cells: pa.ChunkedArray) -> str:
    """The format of clocks written without separators, 095830.00 or 20260504095830; '' for plain numbers.

    Seconds and minutes never exceed 59, and the column passes a full minute, where plain numbers would jump
    by 40.
    """
    cells = cells.drop_null()
    known = pc.match_substring_regex(cells, r"^\d{5,6}(\.\d+)?$|^\d{14}(\.\d+)?$")
    if not len(cells) or not pc.all(known).as_py():
        return ""
    whole = pc.cast(pc.replace_substring_regex(cells, r"\..*", ""), pa.int64()).to_numpy()
    hours, minutes, seconds = whole // 10_000 % 100, whole // 100 % 100, whole % 100
    if hours.max() > 23 or minutes.max() > 59 or seconds.max() > 59 or np.ptp(whole) < 60:
        return ""
    dated = whole[0] > 10**13
    if dated and not 1970 <= whole[0] // 10**10 <= 2100:
        return ""
    fraction = ".%f" if pc.any(pc.match_substring(cells, ".")).as_py() else ""
    return f"{'%Y%m%d' if dated else ''}%H%M%S{fraction}"


def usual_formats(cell: str) -> list[str]:
    """The common formats in which a cell is a date or time."""
    return [form for form in USUAL if _formatted_us(form, cell) is not None]


def _none(table: Table, clock: Clock, cells: pa.ChunkedArray, unreadable: Mask) -> InputError:
    """The error that no cell is a time, with the first cell and the key to set."""
    at = int(np.argmax(unreadable))
    cell = cells[at]
    wanted = f"the format '{clock.format}'" if clock.format else f"unit '{clock.unit}'"
    name = " and ".join(f"'{column}'" for column in clock.columns)
    return InputError(
        f"{table.path}: no cell of {name} is a time of {wanted}; the first is {quoted(cell)} in "
        f"{table.at(at)}{_advice(clock, cell)}"
    )


def _advice(clock: Clock, scalar: pa.Scalar) -> str:
    """The keys that read such a cell."""
    cell = str(scalar.as_py())
    column = clock.columns[0] if len(clock.columns) == 1 else f"[{', '.join(clock.columns)}]"
    if OF_DAY.fullmatch(cell) or _date_us(cell) is not None:
        keys = ["unit: iso"] if clock.unit.lower() not in DATE_UNITS or clock.format else []
    elif re.fullmatch(r"[+-]?\d+([.,]\d+)?", cell):
        keys = [f"unit: {unit}" for unit in ("s", "ms", "us", "ns", "days")]
        keys = [] if clock.unit in TIME_UNITS and not clock.format else keys
    else:
        keys = [f'format: "{form}"' for form in usual_formats(cell) if form != clock.format]
        keys = keys or ['format: "..." (of strptime, as "%d.%m.%Y %H:%M:%S,%f"), or rate_hz in place of all']
    return f"; set time: {{column: {column}, {' or '.join(keys)}}}" if keys else ""
