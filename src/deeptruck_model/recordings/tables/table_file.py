"""The one reader of tables: the rows and columns of a CSV, Parquet or MAT file, for recordings, leaders and
roads. pyarrow parses; the account has each row and cell that is not used.
"""

from __future__ import annotations

import csv as text_csv
import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray
from pyarrow import parquet

from deeptruck_core import reading
from deeptruck_core.account import Account
from deeptruck_core.arrays import Array
from deeptruck_core.errors import InputError
from deeptruck_core.formats import PARQUET
from deeptruck_model.recordings.consistency.impossible import impossible
from deeptruck_model.recordings.tables.column import Column, decimal_mark, has_mark
from deeptruck_model.recordings.tables.csv_text import BLANK, Format, find_format, read_csv
from deeptruck_model.recordings.tables.table import Table, key_of

MAT = ".mat"
MOST_IN_A_MATRIX = 64  # columns of a matrix
CLOCKS = ("time", "t", "timestamp", "tout")  # fields of a structure that are the time of the others

Vectors = dict[str, NDArray[Any]]


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
                table, remarks = read_mat(path)
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
    return path.suffix.lower() in (*PARQUET, MAT) or path.is_dir()


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


def read_mat(path: Path) -> tuple[pa.Table, list[str]]:
    """The vectors of a file of version 4 to 7, those of structures as STRUCTURE.FIELD, and remarks.

    Structures with a time of their own (Structure With Time of Simulink, exported timeseries, groups of a
    logger) share one column `time`, the union of theirs; a signal is blank in rows that are not its own.
    Without such, vectors of the most frequent length are used. Raises InputError for a file of version 7.3
    (which is HDF5), a damaged one, and one without numeric vectors.
    """
    from scipy.io import loadmat

    try:
        held = loadmat(path, squeeze_me=True, struct_as_record=False)
    except Exception as error:  # whatever a damaged byte leads the library to
        raise InputError(
            f"{path} cannot be read as a MAT file ({reading.plain(str(error), 120)}); save it with '-v7', or "
            "as CSV"
        ) from None
    timed: list[tuple[NDArray[Any], Vectors]] = []
    others: Vectors = {}
    for key, value in held.items():
        if not key.startswith("__"):
            others |= _vectors_of(key, value, timed)
    if not timed and not others:
        raise InputError(f"{path} holds no vector of numbers; save time and signals as vectors")
    columns: Vectors = {}
    lengths = [len(values) for values in others.values()]
    rows = max(set(lengths), key=lambda length: (lengths.count(length), length)) if lengths else 0
    if timed:
        columns["time"] = np.unique(np.concatenate([time for time, _ in timed]))
        rows = len(columns["time"])
    for time, vectors in timed:
        for name, values in vectors.items():
            columns[name] = np.full(rows, np.nan)
            columns[name][np.searchsorted(columns["time"], time)] = values
    columns |= {name: values for name, values in others.items() if len(values) == rows}
    table = pa.table({name: pa.array(values, from_pandas=True) for name, values in columns.items()})
    left_out = [name for name in others if name not in columns]
    return table, [f"of another length than the others, left out: {', '.join(left_out)}"] if left_out else []


def _vectors_of(name: str, value: Any, timed: list[tuple[NDArray[Any], Vectors]]) -> Vectors:
    """The vectors of a variable that have no time of their own; those that have are added to `timed`."""
    found: Vectors = {}
    if isinstance(value, np.ndarray) and value.dtype == object:  # an array of structures
        for k, one in enumerate(value.ravel()):
            label = getattr(one, "name", "")
            found |= _vectors_of(f"{name}.{label if isinstance(label, str) and label else k + 1}", one, timed)
        return found
    if not hasattr(value, "_fieldnames"):
        return dict(_vectors(name, value))
    for inner in value._fieldnames:
        found |= _vectors_of(f"{name}.{inner}", getattr(value, inner), timed)
    clocks = {f"{name}.{clock}".lower() for clock in CLOCKS}
    clock = next((one for one in found if one.lower() in clocks), "")
    if not clock or not (np.diff(time := found[clock].astype(float)) > 0.0).all():
        return found
    timed.append(
        (np.round(time, 9), {one: x for one, x in found.items() if one != clock and len(x) == len(time)})
    )
    return {one: x for one, x in found.items() if one != clock and len(x) != len(time)}


def _vectors(name: str, value: Any) -> Iterator[tuple[str, NDArray[Any]]]:
    if not isinstance(value, np.ndarray) or value.dtype.kind not in "biuf":
        return
    if value.ndim == 1 and len(value) > 1:
        yield name, value
    elif value.ndim == 2:
        yield from ((f"{name}[{k + 1}]", value[:, k]) for k in range(min(value.shape[1], MOST_IN_A_MATRIX)))
