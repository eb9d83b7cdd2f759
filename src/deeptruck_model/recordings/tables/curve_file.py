"""Reads one column of a table as a function of another, for leaders and roads."""

from __future__ import annotations

import sys
from contextlib import suppress
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from deeptruck_core.errors import InputError
from deeptruck_model.recordings.consistency.impossible import impossible
from deeptruck_model.recordings.tables.row_keys import key_of
from deeptruck_model.recordings.tables.table_file import Table, find_form, read_table

Array = NDArray[np.float64]


def read_curve(path: Path, over: str, of: str) -> tuple[Array, Array]:
    """A column of a table over an ascending one, such as a road's grade over distance: both (n,), n > 1.

    Lines before the header, the delimiter and the decimal mark are detected. Omitted rows are reported on
    stderr. Raises InputError with the line if a row has no number, or if `over` does not increase.
    """
    table = _table(path, over, of)
    if key := key_of(table, [table[of].values]):
        raise InputError(f"{path}: {key}; give a table of one of them")
    table = table.with_key(~np.isnan(table[over].values), over, (over,))
    x, y = table[over].values, table[of].values
    without = ~np.isfinite(x) | ~np.isfinite(y)
    if without.any():
        at = table.at(int(np.argmax(without)))
        raise InputError(f"{path}: {at} needs a number under {over} and {of}")
    if of == "speed":
        for reason, none in impossible("speed", "m/s", x, y):
            first = f"at {x[int(np.argmax(none))]:g} s ({y[int(np.argmax(none))]:g})"
            table = table.without(none, f"{reason}, bridged", f", {first}")
            x, y = x[~none], y[~none]
    if len(x) < 2:
        raise InputError(f"{path} has one row; it needs at least two")
    if (np.diff(x) <= 0).any():
        at = table.at(int(np.argmax(np.diff(x) <= 0)) + 1)
        raise InputError(f"{path}: {over} does not grow in {at}; sort the rows and drop doubled ones")
    if table.account.total.left_out:
        print("\n".join(table.account.lines()), file=sys.stderr)
    return x, y


def _table(path: Path, *names: str) -> Table:
    """The table, whose header is its first line or is looked for."""
    with suppress(InputError):
        table = read_table(path)
        if set(names) <= table.columns.keys():
            return table
    return read_table(path, find_form(path))
