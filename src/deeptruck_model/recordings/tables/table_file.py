"""The one reader of tables: the rows and columns of a CSV, Parquet or MAT file, for recordings, leaders and
roads. pyarrow parses; the account has each row and cell that is not used.
"""

from __future__ import annotations

import csv as text_csv
import sys
from contextlib import suppress
from pathlib import Path

import numpy as np
import pyarrow as pa
from pyarrow import parquet

from deeptruck_core import reading
from deeptruck_core.account import Account
from deeptruck_core.arrays import Array
from deeptruck_core.errors import InputError
from deeptruck_core.formats import PARQUET
from deeptruck_model.recordings.consistency.impossible import impossible
from deeptruck_model.recordings.tables import mat_file
from deeptruck_model.recordings.tables.column import Column, decimal_mark, has_mark
from deeptruck_model.recordings.tables.csv_text import BLANK, Format, find_format, read_csv
from deeptruck_model.recordings.tables.mixtures import key_of
from deeptruck_model.recordings.tables.table import Table


def read_table(path: Path, form: Format | None = None) -> Table:
    """A CSV file or, by its suffix, a Parquet or MAT file, in a format (see Format).

    A byte order mark overrides the encoding. Trailing delimiters of rows or the header are no columns; blank
    rows are omitted, as are rows with more or fewer cells than the header. Parquet's page checksums are
    verified if present. Raises InputError for a file that is missing, empty, or not in that encoding, and if
    most rows do not fit the header.
    """
    form = form or Format()
    check_table(path)
    account, begin, delimiter, place = Account(str(path), "rows"), 0, "", "row"
    try:
        if is_typed(path):
            if path.suffix.lower() in PARQUET or path.is_dir():
                table = parquet.read_table(path, page_checksum_verification=True)
            else:
                table, remarks = mat_file.read(path)
                account.remarks += remarks
            names, rows = list(table.column_names), np.arange(table.num_rows)
            account.total.read = table.num_rows
        else:
            table, names, rows, begin, delimiter = read_csv(path, form, account)
            place = "line"
    except (pa.ArrowException, UnicodeError, LookupError, OSError, text_csv.Error, EOFError) as error:
        raise InputError(f"{path} cannot be read: {_why(error, form.encoding)}") from None
    account.total.used = table.num_rows
    names = [name.strip() for name in names]
    raw: dict[str, pa.ChunkedArray] = {}
    for name, column in zip(names, table.columns, strict=True):
        raw.setdefault(name, _plain_type(column))
    account.remarks += [
        f"several columns are named '{n}': the first is used" for n in raw if n and names.count(n) > 1
    ]
    decimal = form.decimal or decimal_mark([*raw.values()], delimiter)
    points = [name for name, cells in raw.items() if decimal == "." and has_mark(cells, ".")]
    columns = {
        name: Column(name, cells, decimal, pointed=bool(points) and points != [name])
        for name, cells in raw.items()
    }
    found = Table(path, columns, rows, lambda row: f"{place} {begin + row + 1}", account, decimal)
    found = found.without(~found.filled([*columns]), BLANK)
    if not len(found):
        raise InputError(f"{path} is empty: it has no rows below its header")
    return found


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


def find_form(path: Path) -> Format:
    """How a table is written. Raises InputError for a file that is missing or no table."""
    check_table(path)
    return Format() if is_typed(path) else find_format(path)


def is_typed(path: Path) -> bool:
    """Whether a table has types and no text: Parquet, also in parts below a folder, or MAT."""
    return path.suffix.lower() in (*PARQUET, mat_file.SUFFIX) or path.is_dir()


def check_table(path: Path) -> None:
    """Raises InputError if there is no file that can be a table, nor a folder of its parts."""
    if not (path.is_dir() and any(path.rglob("*.parquet"))):
        reading.check_file(path, "give a table or a CAN log, or the folder of a bag or of Parquet files")


def _plain_type(column: pa.ChunkedArray) -> pa.ChunkedArray:
    """Text as one type, for all text types of Parquet."""
    kind = column.type
    if pa.types.is_dictionary(kind):
        column = column.cast(kind.value_type)
        kind = kind.value_type
    text = pa.types.is_large_string(kind) or pa.types.is_string_view(kind)
    return column.cast(pa.string()) if text else column


def _why(error: BaseException, encoding: str) -> str:
    text = reading.plain(str(error))
    if isinstance(error, UnicodeDecodeError) or "UTF8" in text or "decod" in text:
        return f"it is not in {encoding}; set 'encoding' (latin-1, for example)"
    return text
