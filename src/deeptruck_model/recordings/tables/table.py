"""A table: its columns by name and its rows, each with its place in the file and what became of it; and which
rows are of one vehicle, one value each, or written again.
"""

from __future__ import annotations

import difflib
import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from deeptruck_core.account import Account
from deeptruck_core.arrays import Array, Mask
from deeptruck_core.errors import InputError
from deeptruck_core.reading import plain, quoted
from deeptruck_model.recordings.tables.column import MOST_ABOVE, Column, floats

SHOWN = 12  # columns that an error lists
MOST_WITHOUT_KEY = 0.1  # of the rows; where more have no time, the column or its unit is mistaken
ABOVE = "of units or text above the numbers"
NUMBERS = frozenset(("id", "device", "source", "number", "nr", "no", "unit"))
COPIED = 20  # rows in a row that make a copy
MOST_KEYS = 200  # values of a key column
LEAST_CHANGES = 0.05  # of the rows, from one value of the key to another where their rows are interleaved
SMOOTHER = 0.3  # a speed varies so much less within the rows of one vehicle than from row to row
NAMES = frozenset(("vehicle", "truck", "vin", "fleet", "fahrzeug", "veh", "kennzeichen", "plate"))


@dataclass(frozen=True)
class Table:
    """Columns by name (blanks around names ignored).

    `rows` (n,) are the row numbers in the file, from 0 below the header; `place` describes one of them, such
    as 'line 7'. `account` counts the rows read, kept and omitted.
    """

    path: Path
    columns: dict[str, Column]
    rows: NDArray[np.int64]
    place: Callable[[int], str]
    account: Account
    decimal: str = "."

    def __len__(self) -> int:
        return len(self.rows)

    def at(self, row: int) -> str:
        """Description of a row's place in the file."""
        return self.place(int(self.rows[row]))

    def __getitem__(self, name: str) -> Column:
        """One column. Raises InputError with the nearest names if there is none."""
        name = name if name in self.columns else name.strip()
        if name in self.columns:
            return self.columns[name]
        few = list(self.columns)[:SHOWN]
        near = difflib.get_close_matches(name, self.columns, n=3, cutoff=0.5) or few
        near = few if len(self.columns) <= SHOWN else near
        more = f", and {len(self.columns) - len(near)} more" if len(self.columns) > len(near) else ""
        raise InputError(f"{self.path} has no column '{name}'; there is: {plain(', '.join(near))}{more}")

    def numbers(self, name: str, channel: str, across: str = "") -> Array:
        """A column, or the norm with the one `across`, as float64 (n,), NaN for cells that are blank or not
        numbers.

        The account counts its filled cells under `channel`. Raises InputError if no cell is a number.
        """
        column = self[name]
        values, unreadable = column.values, column.unreadable
        if across:
            alone = np.isnan(values) != np.isnan(self[across].values)
            values = np.hypot(values, self[across].values)
            unreadable = unreadable | self[across].unreadable | alone
        known, first = ~np.isnan(values), int(np.argmax(unreadable))
        tally = self.account.channel(channel)
        tally.read += int(known.sum() + unreadable.sum())
        tally.used += int(known.sum())
        cell = f"{quoted(column.cells[first])} in {self.at(first)}" if unreadable.any() else ""
        tally.set_aside("no number", cell, int(unreadable.sum()))
        if not known.any():
            why = f"its first is {cell}" if cell else "all its cells are blank"
            raise InputError(f"{self.path}: column '{name}' holds no numbers; {why}")
        return values

    @property
    def numeric(self) -> list[Column]:
        """The columns of numbers."""
        return [column for column in self.columns.values() if column.is_numbers]

    def take(self, rows: NDArray[np.int64]) -> Table:
        """The table with these of its rows, in this order."""
        columns = {name: column.take(rows) for name, column in self.columns.items()}
        return replace(self, columns=columns, rows=self.rows[rows])

    def without(self, out: Mask, reason: str, first: str = "") -> Table:
        """The table without the rows `out` (n,), which the account counts as omitted for a reason."""
        if not out.any():
            return self
        at = int(np.argmax(out))
        self.account.total.set_aside(reason, f"{self.at(at)}{first}", int(out.sum()))
        left = self.take(np.flatnonzero(~out))
        self.account.total.used = len(left)
        return left

    def filled(self, names: Iterable[str]) -> Mask:
        """Which rows (n,) have a cell in one of these columns."""
        found = np.zeros(len(self), dtype=bool)
        for name in names:
            found |= self.columns[name].has_cell
            if found.all():
                break
        return found

    def without_text_above(self, known: Mask) -> Table:
        """The table without its first few rows if these are not `known` (n,): units or text."""
        above = int(np.argmax(known)) if known.any() else len(self)
        return self.without(np.arange(len(self)) < above, ABOVE) if above <= MOST_ABOVE else self

    def with_key(self, known: Mask, what: str, names: Iterable[str], advice: str = "") -> Table:
        """The rows that have a time or distance, marked by `known` (n,).

        Raises InputError, ending with `advice`, if more than a tenth of the rows below units and text have
        none.
        """
        table = self.without_text_above(known)
        known = known[len(known) - len(table) :]
        column = " and ".join(f"'{name}'" for name in names)
        if (~known).sum() > MOST_WITHOUT_KEY * len(known):
            at = table.at(int(np.argmin(known)))
            raise InputError(
                f"{self.path}: {(~known).sum()} rows have no {what} in {column}, first {at}{advice}"
            )
        return table.without(~known, f"without a {what} in {column}")


@dataclass(frozen=True)
class Key:
    """A column that assigns rows to several vehicles, and its values in the order of their first rows."""

    column: str
    values: tuple[str, ...]
    interleaved: bool

    @property
    def line(self) -> str:
        """The line of COLUMNS.yaml that selects the first of them."""
        column, value = (json.dumps(text, ensure_ascii=False) for text in (self.column, self.values[0]))
        return f"only: {{{column}: {value}}}"

    def __str__(self) -> str:
        some = ", ".join(plain(value, 40) for value in self.values[:4])
        more = f" and {len(self.values) - 4} more" if len(self.values) > 4 else ""
        how = ", whose rows are interleaved" if self.interleaved else ""
        return f"column '{plain(self.column)}' has {len(self.values)} values ({some}{more}){how}"


def only(table: Table, wanted: Mapping[str, str]) -> Table:
    """The rows in which the columns have these texts. Raises InputError if there are none."""
    for column, value in wanted.items():
        cells = table[column].cells
        other = ~pc.fill_null(pc.equal(cells, str(value)), False).to_numpy()
        if other.all():
            known = ", ".join(plain(str(v), 40) for v in pc.unique(cells.drop_null()).to_pylist()[:8])
            raise InputError(f"{table.path}: no row has '{value}' in column '{column}'; there is: {known}")
        table = table.without(other, f"of others than '{value}' in '{column}'")
    return table


def of_one(table: Table, wanted: Mapping[str, str], speed: str) -> Table:
    """The rows of one vehicle: the `wanted` ones, or all. Raises InputError if these are of several, by how
    the column `speed` changes from row to row."""
    if not wanted and (key := key_of(table, [table[speed].values])):
        raise InputError(f"{table.path}: {key}: take one by {key.line}")
    return only(table, wanted)


def key_of(table: Table, speeds: Sequence[Array]) -> Key | None:
    """The column that assigns rows to vehicles; None if there is only one vehicle.

    `speeds`, each (n,), are columns of a speed. If vehicles alternate, a speed varies much less within the
    rows of one vehicle than from row to row.
    """
    for name, column in table.columns.items():
        named = column.header.words
        if column.is_temporal or not _names(column, named):
            continue
        codes = pc.dictionary_encode(column.cells).combine_chunks()
        values, of = codes.dictionary.to_pylist(), codes.indices.fill_null(-1).to_numpy(zero_copy_only=False)
        if not 2 <= len(values) <= min(MOST_KEYS, len(table) // 5):
            continue
        of = of[of >= 0] if not speeds else of
        changes = int((np.diff(of) != 0).sum())
        key = Key(name, tuple(map(str, values)), changes >= LEAST_CHANGES * len(of))
        if key.interleaved and any(_smoother(of, speed) for speed in speeds):
            return key
        if named & NAMES and (key.interleaved or changes == len(values) - 1):
            return key
    return None


def _names(column: Column, named: frozenset[str]) -> bool:
    """Whether a column may name vehicles: text, or whole numbers under a header that says so."""
    if column.is_text and not np.isfinite(column.values).any():
        return True
    known = column.values[np.isfinite(column.values)]
    says = bool(named & NUMBERS) or (bool(named) and named <= NAMES)
    return says and bool((known == np.rint(known)).all())


def _smoother(of: NDArray[np.int64], speed: Array) -> bool:
    known = np.isfinite(speed) & (of >= 0)
    v, of = speed[known], of[known]
    order = np.argsort(of, kind="stable")
    same = np.diff(of[order]) == 0
    across = float(np.abs(np.diff(v)).sum())
    return across > 0.0 and float(np.abs(np.diff(v[order]))[same].sum()) < SMOOTHER * across


def widened(table: Table, name: str, value: str, time: Sequence[str]) -> Table:
    """Converts a table with one value per row to one with a column for each name, blank where a row has
    another.

    Consecutive rows with the same `time` (names of columns) become one. The account counts the resulting
    rows, and a remark gives the number of original ones.
    """
    stamps = [pc.fill_null(pc.cast(table[one].raw, pa.string()), "") for one in time]
    joined = pc.binary_join_element_wise(*stamps, " ") if stamps else None
    names = pc.fill_null(table[name].cells, "")
    if joined is not None and (order := _by_time(joined, names)) is not None:
        table, joined, names = table.take(order), joined.take(pa.array(order)), names.take(pa.array(order))
    fresh = np.ones(len(table), dtype=bool)
    if joined is not None:
        same = joined.combine_chunks()
        fresh[1:] = pc.not_equal(same[1:], same[:-1]).to_numpy(zero_copy_only=False)
    codes = pc.dictionary_encode(names).combine_chunks()
    of, row = codes.indices.to_numpy(), np.cumsum(fresh) - 1
    again = _again(row, of, len(codes.dictionary))
    row = row if not again.any() else np.cumsum(fresh | again) - 1
    fresh = fresh | again
    cells = table[value].cells.combine_chunks()
    first = np.flatnonzero(fresh)
    columns = {one: table[one].take(first) for one in table.columns if one not in (name, value)}
    for code, label in enumerate(codes.dictionary.to_pylist()):
        at = np.full(int(fresh.sum()), -1)
        at[row[of == code]] = np.flatnonzero(of == code)
        taken = cells.take(pa.array(at, mask=at < 0))
        label = label or "(no name)"
        columns[label] = Column(label, pa.chunked_array([taken]), table.decimal)
    total = table.account.total
    total.read += len(first) - len(table)
    total.used = len(first)
    table.account.remarks.append(
        f"{len(table)} rows with one value each made {len(first)} of {len(codes.dictionary)} columns"
    )
    return replace(table, columns=columns, rows=table.rows[fresh])


def _by_time(stamps: pa.ChunkedArray, names: pa.ChunkedArray) -> NDArray[np.int64] | None:
    """The order of rows by their stamps, where the rows of each name stand together and begin again; None
    where they are in that order."""
    codes = pc.dictionary_encode(names).combine_chunks().indices.to_numpy()
    if (np.diff(codes) != 0).sum() > LEAST_CHANGES * len(codes):
        return None
    numbers = floats(stamps, ".")[0]
    order = np.argsort(numbers if np.isfinite(numbers).all() else stamps.to_numpy(), kind="stable")
    return order.astype(np.int64)


def _again(row: NDArray[np.int64], of: NDArray[np.int64], names: int) -> Mask:
    """Rows whose name has already occurred with the same stamp."""
    pair = row * names + of
    order = np.argsort(pair, kind="stable")
    repeated = np.zeros(len(pair), dtype=bool)
    repeated[order[1:]] = np.diff(pair[order]) == 0
    return repeated


def without_copies(table: Table, time: Sequence[str]) -> Table:
    """The table without rows that have a `time` (names of columns) and nothing else, and without copies; rows
    of one time that fill other columns are made one. As it is where rows are the clock."""
    if not time:
        return table
    others = [name for name in table.columns if name not in time]
    table = table.without(~table.filled(others), "with a time and nothing else")
    return _merged(table.without(_copies(table, time), "that repeat earlier rows"), time)


def _copies(table: Table, time: Sequence[str]) -> Mask:
    """Rows (n,) that are written again: COPIED rows and more in the order of earlier ones, or every row.

    Equal rows of a truck that stands, under a clock in whole seconds, are no copies.
    """
    row, codes = np.arange(len(table)), _codes(table, [*table.columns])
    first = np.unique(codes, return_index=True)[1][codes]
    others = _codes(table, [name for name in table.columns if name not in time])
    varied = np.diff(others[np.unique(first)]) != 0
    if (np.bincount(codes) > 1).all() and 2 * varied.sum() > len(varied) > 0:
        return first < row
    edges = np.flatnonzero(np.diff(row - first, prepend=-1, append=-1))
    found = np.zeros(len(row), dtype=bool)
    for i, j in pairwise(edges):
        found[i:j] = min(j - i, i - first[i]) >= COPIED
    return found


def _merged(table: Table, time: Sequence[str]) -> Table:
    """The table with rows of one stamp made one, where each fills columns that the others leave blank, as
    when a table was put together from several sensors."""
    stamps = _codes(table, time)
    fresh = np.diff(stamps, prepend=-1) != 0
    if fresh.all():
        return table
    of = np.cumsum(fresh) - 1
    count = int(of[-1]) + 1
    taken: dict[str, Column] = {}
    for name, column in table.columns.items():
        filled = column.has_cell
        if name not in time and (np.bincount(of[filled], minlength=count) > 1).any():
            return table
        row = np.full(count, -1)
        row[of[filled][::-1]] = np.flatnonzero(filled)[::-1]
        taken[name] = Column(name, column.raw.take(pa.array(row, mask=row < 0)), column.mark)
    table.account.total.set_aside(
        "merged with one of the same time that fills other columns", count=len(of) - count
    )
    table.account.total.used = count
    return replace(table, columns=taken, rows=table.rows[fresh])


def _codes(table: Table, names: Sequence[str]) -> NDArray[np.int64]:
    """A number for the cells of each row, (n,), from 0 on; equal rows have equal ones."""
    codes = np.zeros(len(table), dtype=np.int64)
    for name in names:
        cells = pc.dictionary_encode(table[name].raw, null_encoding="encode").combine_chunks()
        codes = codes * len(cells.dictionary) + cells.indices.to_numpy()
        codes = np.unique(codes, return_inverse=True)[1]
    return codes
