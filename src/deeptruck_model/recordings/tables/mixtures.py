"""Tables that mix several things: rows of more than one vehicle, one value per row, or rows written again."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from deeptruck_core.arrays import Array, Mask
from deeptruck_core.errors import InputError
from deeptruck_core.reading import plain
from deeptruck_model.recordings.tables.column import Column, floats
from deeptruck_model.recordings.tables.table import Table

NUMBERS = frozenset(("id", "device", "source", "number", "nr", "no", "unit"))
COPIED = 20  # rows in a row that make a copy
MOST_KEYS = 200  # values of a key column
LEAST_CHANGES = 0.05  # of the rows, from one value of the key to another where their rows are interleaved
SMOOTHER = 0.3  # a speed varies so much less within the rows of one vehicle than from row to row
NAMES = frozenset(("vehicle", "truck", "vin", "fleet", "fahrzeug", "veh", "kennzeichen", "plate"))


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


def settled(table: Table, time: Sequence[str]) -> Table:
    """The table without rows that have a `time` (names of columns) and nothing else, and without copies; rows
    of one time that fill other columns are made one."""
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
