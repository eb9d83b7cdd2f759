"""The one reader of tables: the rows and columns of a CSV, Parquet or MAT file.

Recordings use it, and `curve_file` for leaders and roads. The account has each row and cell that is not used.
"""

from __future__ import annotations

import csv as text_csv
import difflib
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray
from pyarrow import parquet

from deeptruck_core import reading
from deeptruck_core.account import Account
from deeptruck_core.errors import InputError
from deeptruck_core.formats import PARQUET
from deeptruck_model.recordings.tables import mat_file
from deeptruck_model.recordings.tables.column import MOST_ABOVE, Column, decimal_mark, has_mark
from deeptruck_model.recordings.tables.csv_text import BLANK, SAMPLED, CsvText, Format, find_format

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

SHOWN = 12  # columns that an error lists
MOST_BELOW = 10  # rows of totals below the numbers
MOST_WITHOUT_KEY = 0.1  # of the rows; where more have no time, the column or its unit is mistaken
LABELS = {  # in a cell of a row that sums up those above it
    "total", "totals", "sum", "mean", "average", "avg", "min", "max", "minimum", "maximum", "median", "std",
    "stdev", "count", "summe", "gesamt", "mittel", "mittelwert", "durchschnitt", "minimalwert", "maximalwert",
    "anzahl",
}  # fmt: skip
HEADER = "that repeat the header"
ABOVE = "of units or text above the numbers"
BELOW = "of totals or text below the numbers"


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
    repeated: frozenset[str] = field(default=frozenset())  # names that several columns have

    def __len__(self) -> int:
        return len(self.rows)

    def at(self, row: int) -> str:
        """Description of a row's place in the file."""
        return self.place(int(self.rows[row]))

    def __getitem__(self, name: str) -> Column:
        """One column. Raises InputError with the nearest names if there is none."""
        name = name if name in self.columns else name.strip()
        if name in self.columns:
            if name in self.repeated:
                remark = f"several columns are named '{name}': the first is used"
                self.account.remarks += [remark] if remark not in self.account.remarks else []
            return self.columns[name]
        few = list(self.columns)[:SHOWN]
        near = difflib.get_close_matches(name, self.columns, n=3, cutoff=0.5) or few
        near = few if len(self.columns) <= SHOWN else near
        more = f", and {len(self.columns) - len(near)} more" if len(self.columns) > len(near) else ""
        there = reading.plain(", ".join(near))
        raise InputError(f"{self.path} has no column '{name}'; there is: {there}{more}{self._header(name)}")

    def _header(self, name: str) -> str:
        """Advice if the name occurs in a row below the one that was taken for the header."""
        for row in range(min(len(self), 2 * SAMPLED)):
            if any(str(column.raw[row]).strip() == name for column in self.columns.values()):
                return f"; '{name}' stands in {self.at(row)}: skip the lines before it by 'skip_rows'"
        return ""

    def numbers(self, name: str, channel: str | None = None) -> Array:
        """A column as float64 (n,), NaN for cells that are blank or not numbers.

        The account counts the filled cells under `channel` (the column's name if None). Raises InputError if
        no cell is a number.
        """
        column = self[name]
        values, unreadable = column.values, column.unreadable
        tally = self.account.channel(channel or name)
        tally.read += int((~np.isnan(values)).sum() + unreadable.sum())
        tally.used += int((~np.isnan(values)).sum())
        if unreadable.any():
            first = int(np.argmax(unreadable))
            cell = shown(column.cells[first])
            tally.set_aside("no number", f"{cell} in {self.at(first)}", int(unreadable.sum()))
            if np.isnan(values).all():
                raise InputError(
                    f"{self.path}: column '{name}' holds no numbers; its first is {cell} in {self.at(first)}"
                )
        if np.isnan(values).all():
            raise InputError(f"{self.path}: column '{name}' holds no numbers; all its cells are blank")
        return values

    @property
    def numeric(self) -> list[Column]:
        """The columns of numbers."""
        return [column for column in self.columns.values() if column.is_numbers]

    def with_units(self, units: Mapping[str, str]) -> Table:
        """The table with units that the file states elsewhere than at its columns."""
        columns = {
            name: Column(name, c.raw, c.mark, pointed=c.pointed, below=units.get(name, ""))
            for name, c in self.columns.items()
        }
        return replace(self, columns=columns)

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

    def below_units(self, name: str) -> Table:
        """The table without its first few rows if these have text in a column of numbers."""
        unreadable = self[name].unreadable
        above = np.arange(len(self)) < (len(self) if unreadable.all() else int(np.argmin(unreadable)))
        return self.without(above, ABOVE) if above.sum() <= MOST_ABOVE else self

    def filled(self, names: Iterable[str]) -> Mask:
        """Which rows (n,) have a cell in one of these columns."""
        found = np.zeros(len(self), dtype=bool)
        for name in names:
            column = self.columns[name]
            found |= pc.is_valid(column.cells if column.is_text else column.raw).to_numpy()
            if found.all():
                break
        return found

    def with_key(self, known: Mask, what: str, names: Iterable[str], advice: str = "") -> Table:
        """The rows that have a time or distance, marked by `known` (n,).

        A few rows above the first are units, and a few below the last are totals. Raises InputError, ending
        with `advice`, if more than a tenth of the others have none.
        """
        if known.all():
            return self
        place = np.arange(len(known))
        first, last = (int(place[known][0]), int(place[known][-1])) if known.any() else (len(known), -1)
        filled = self.filled([name for name in names if name in self.columns])
        above = (place < first) & filled & (first <= MOST_ABOVE)
        below = (place > last) & filled & (len(known) - 1 - last <= MOST_BELOW) & known.any()
        lost = ~known & ~above & ~below
        column = " and ".join(f"'{name}'" for name in names)
        if lost.sum() > MOST_WITHOUT_KEY * len(known):
            at = int(np.argmax(lost))
            raise InputError(
                f"{self.path}: {lost.sum()} rows have no {what} in {column}, first {self.at(at)}{advice}"
            )
        table, gone = self, np.zeros(len(known), dtype=bool)
        for rows, reason in ((above, ABOVE), (below, BELOW), (lost, f"without a {what} in {column}")):
            table = table.without(rows[~gone], reason)
            gone |= rows
        return table


def read_table(path: Path, form: Format | None = None) -> Table:
    """A CSV file or, by its suffix, a Parquet or MAT file, in a format (see Format).

    A byte order mark overrides the encoding. Trailing delimiters of rows or the header are no columns; blank
    rows, repeated headers and totals are omitted, as are rows with more or fewer cells than the header. CSV
    has no checksum, so that a changed digit is not detected. Parquet's page checksums are verified if
    present. Raises InputError for a file that is missing, empty, or not in that encoding, and if most rows do
    not fit the header.
    """
    form = form or Format()
    check_table(path)
    account = Account(str(path), "rows")
    place: Callable[[int], str] = _typed_row
    delimiter = ""
    try:
        if is_typed(path):
            if path.suffix.lower() in PARQUET or path.is_dir():
                table = parquet.read_table(path, page_checksum_verification=True)
            else:
                table, remarks = mat_file.read(path)
                account.remarks += remarks
            names = list(table.column_names)
            account.total.read = table.num_rows
            rows = np.arange(table.num_rows)
        else:
            text = CsvText(path, form, account)
            table, names, rows = text.read()
            place = text.place
            delimiter = text.delimiter
    except (pa.ArrowException, UnicodeError, LookupError, OSError, text_csv.Error, EOFError) as error:
        raise InputError(f"{path} cannot be read: {_why(error, form.encoding)}") from None
    account.total.used = table.num_rows
    names = [name.strip() for name in names]
    plain: dict[str, pa.ChunkedArray] = {}
    for name, column in zip(names, table.columns, strict=True):
        plain.setdefault(name, _plain_type(column))
    repeated = frozenset(name for name in plain if name and names.count(name) > 1)
    decimal = form.decimal or decimal_mark([*plain.values()], delimiter)
    points = [name for name, raw in plain.items() if decimal == "." and has_mark(raw, ".")]
    columns = {
        name: Column(name, raw, decimal, pointed=bool(points) and points != [name])
        for name, raw in plain.items()
    }
    found = Table(path, columns, rows, place, account, decimal, repeated)
    found = found.without(~found.filled([*columns]), BLANK)
    for out, reason in ((_repeats_header, HEADER), (_sums_up, BELOW)):
        if len(found):
            found = found.without(out(found), reason)
    if not len(found):
        raise InputError(f"{path} is empty: it has no rows below its header")
    return found


def find_form(path: Path) -> Format:
    """How a table is written. Raises InputError for a file that is missing or no table."""
    check_table(path)
    return Format() if is_typed(path) else find_format(path)


def is_typed(path: Path) -> bool:
    """Whether a table has types and no text: Parquet, also in parts below a folder, or MAT."""
    return path.suffix.lower() in (*PARQUET, mat_file.SUFFIX) or path.is_dir()


def in_parts(path: Path) -> bool:
    """Whether a path is a folder with the Parquet files of one table."""
    return path.is_dir() and any(path.rglob("*.parquet"))


def check_table(path: Path) -> None:
    """Raises InputError if there is no file that can be a table, nor a folder of its parts."""
    if not in_parts(path):
        reading.check_file(path, "give a CSV or Parquet table")


def shown(cell: object) -> str:
    """A cell in quotation marks, on one line and shortened."""
    text = reading.plain(str(cell))
    return f"'{text[:40]}...'" if len(text) > 43 else f"'{text}'"


def _typed_row(row: int) -> str:
    return f"row {row + 1}"


def _plain_type(column: pa.ChunkedArray) -> pa.ChunkedArray:
    """Text as one type, for all text types of Parquet."""
    kind = column.type
    if pa.types.is_dictionary(kind):
        column = column.cast(kind.value_type)
        kind = kind.value_type
    text = pa.types.is_large_string(kind) or pa.types.is_string_view(kind)
    return column.cast(pa.string()) if text else column


def _repeats_header(table: Table) -> Mask:
    """Which rows (n,) repeat the header's names in every text cell."""
    same: Mask = np.ones(len(table), dtype=bool)
    for name, column in table.columns.items():
        if not column.is_text:
            return np.zeros(len(table), dtype=bool)
        same &= pc.equal(pc.fill_null(column.cells, ""), name).to_numpy()
        if not same.any():
            break
    return same


def _sums_up(table: Table) -> Mask:
    """Which rows (n,) at the end have a label such as 'Total', in a column without text above it."""
    count = len(table)
    below = np.zeros(count, dtype=bool)
    for column in table.columns.values():
        if not column.is_text:
            continue
        cells = column.cells[-MOST_BELOW - 1 :].to_pylist()
        labels = next((k for k, cell in enumerate(reversed(cells)) if not _is_label(cell)), 0)
        above = cells[-labels - 1]
        if above is None or re.search(r"\d", above):
            below[count - labels :] = True
    return below


def _is_label(cell: str | None) -> bool:
    return str(cell).lower().rstrip(":.").strip() in LABELS


def _why(error: BaseException, encoding: str) -> str:
    text = reading.plain(str(error))
    if isinstance(error, UnicodeDecodeError) or "UTF8" in text or "decod" in text:
        return f"it is not in {encoding}; set 'encoding' (latin-1, for example)"
    return text
