"""Reads one column of a table as a function of another, for leaders and roads."""

from __future__ import annotations

import csv as text_csv
import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from deeptruck_core import reading
from deeptruck_core.account import Account
from deeptruck_core.errors import InputError
from deeptruck_model.recordings.consistency.impossible import impossible
from deeptruck_model.recordings.tables.csv_text import CsvText, Format
from deeptruck_model.recordings.tables.row_keys import key_of
from deeptruck_model.recordings.tables.table_file import is_typed, read_table

Array = NDArray[np.float64]

MOST_BEFORE = 20  # lines in which the header of a leader or road is looked for


def read_curve(path: Path, over: str, of: str) -> tuple[Array, Array]:
    """A column of a table over an ascending one, such as a road's grade over distance: both (n,), n > 1.

    Lines before the header, the delimiter and the decimal mark are detected. Omitted rows are reported on
    stderr. Raises InputError with the line if a row has no number, or if `over` does not increase.
    """
    reading.check_file(path, "give a CSV or Parquet table")
    table = read_table(
        path,
        Format(skip_rows=_lines_before(path, over, of)),
        cure=f"it needs a header with {over} and {of}, and rows of as many cells",
    )
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


def _lines_before(path: Path, *names: str) -> int:
    """Number of lines before the header with these names, 0 if there is none."""
    if is_typed(path):
        return 0
    try:
        text = CsvText(path, Format(), Account(str(path), "rows"))
        return next((k for k in range(MOST_BEFORE) if text.header_below(k) >= set(names)), 0)
    except (UnicodeError, OSError, text_csv.Error, EOFError):
        return 0  # as read_table says
