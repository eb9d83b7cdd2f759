"""Reads columns from a CSV or Parquet file, with an account of every row and cell that is not used.

The only reader of tables: recordings use it, and `curve_file` for leaders and roads.
"""

from __future__ import annotations

import csv as text_csv
import difflib
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray
from pyarrow import parquet

from deeptruck_model._io import reading
from deeptruck_model._io.account import Account
from deeptruck_model.errors import InputError
from deeptruck_model.recordings.tables.csv_text import BLANK, SAMPLED, CsvText, Format

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

PARQUET, MAT = (".parquet", ".pq"), ".mat"
MOST_IN_A_MATRIX = 64  # columns of a MAT file's matrix
SHOWN = 12  # columns that an error lists
MOST_ABOVE, MOST_BELOW = 3, 10  # rows of units above the numbers, of totals below them
MOST_WITHOUT_KEY = 0.1  # of the rows; where more have no time, the column or its unit is mistaken
NUMBER = r"^[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?$"
WITH_UNIT = r"^(?P<number>[+-]?(?:\d[\d.,]*|[.,]\d+)(?:[eE][+-]?\d+)?)\s*(?P<unit>[^\d\s.,:/+-]\D*\d?)$"
STATES = {  # words of switches
    **dict.fromkeys(("true", "on", "yes", "pressed", "active", "ein", "an", "ja", "wahr"), 1.0),
    **dict.fromkeys(("false", "off", "no", "released", "inactive", "aus", "nein", "falsch"), 0.0),
}
GEARS = {"n": 0.0, "neutral": 0.0, "r": -1.0, "reverse": -1.0}  # letters of gears that are numbers, too
_WITH_MARK = {mark: rf"^[+-]?\d*[{mark}]\d+([eE][+-]?\d+)?$" for mark in ",."}
LABELS = {  # in a cell of a row that sums up those above it
    "total", "totals", "sum", "mean", "average", "avg", "min", "max", "minimum", "maximum", "median", "std",
    "stdev", "count", "summe", "gesamt", "mittel", "mittelwert", "durchschnitt", "minimalwert", "maximalwert",
    "anzahl",
}  # fmt: skip
HEADER = "that repeat the header"
ABOVE = "of units or text above the numbers"
BELOW = "of totals or text below the numbers"


@dataclass(frozen=True)
class TextTable:
    """Columns by name (blanks around names ignored), with cells as in the file.

    `rows` (n,) are the row numbers in the file, from 0 below the header; `place` describes one of them, such
    as 'line 7'. `account` counts the rows read, kept and omitted.
    """

    path: Path
    columns: dict[str, pa.ChunkedArray]
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

    def column(self, name: str) -> pa.ChunkedArray:
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
            if any(str(column[row]).strip() == name for column in self.columns.values()):
                return f"; '{name}' stands in {self.at(row)}: skip the lines before it by 'skip_rows'"
        return ""

    def cells(self, name: str) -> pa.ChunkedArray:
        """A column as text without surrounding blanks, null if empty."""
        column = self.column(name)
        try:
            cells = pc.utf8_trim_whitespace(pc.cast(column, pa.string()))
        except pa.ArrowException:
            raise InputError(
                f"{self.path}: column '{name}' of type {column.type} holds no text or numbers"
            ) from None
        return pc.if_else(pc.equal(cells, ""), pa.scalar(None, pa.string()), cells)

    def values(self, name: str) -> tuple[Array, Mask]:
        """A column as float64 (n,), with NaN for blank cells and for text, and which rows (n,) are
        such text."""
        column = self.column(name)
        if pa.types.is_string(column.type):
            cells = self.cells(name)
            values, unreadable = floats(cells, self.decimal)
            if unreadable.any() and self._has_thousands(name):
                values, unreadable = floats(pc.replace_substring(cells, ",", ""), self.decimal)
            if unreadable.any() and (self.unit_in_cells(name) or not np.isfinite(values).any()):
                return self._beside_numbers(cells)
            return values, unreadable
        try:
            numbers = pc.cast(column, pa.float64(), safe=False).fill_null(np.nan).to_numpy()
        except pa.ArrowException:
            raise InputError(f"{self.path}: column '{name}' of type {column.type} holds no numbers") from None
        return numbers.astype(np.float64), np.zeros(len(numbers), dtype=bool)

    def _has_thousands(self, name: str) -> bool:
        """Whether commas in a column can only separate thousands: its cells are as '1,300', and another
        column has a decimal point."""
        cells = self.cells(name)
        commas = pc.match_substring(cells, ",")
        grouped = pc.match_substring_regex(cells, _GROUPED)
        if self.decimal != "." or not pc.all(pc.equal(commas, grouped)).as_py():
            return False
        texts = [c for other, c in self.columns.items() if other != name and pa.types.is_string(c.type)]
        return any(pc.any(pc.match_substring_regex(c, r"^\s*[-+]?\d+\.\d+\s*$")).as_py() for c in texts)

    def unit_in_cells(self, name: str) -> str:
        """The unit after the numbers in nearly all cells of a column, as in '54 km/h'; '' if there is
        none."""
        if not pa.types.is_string(self.column(name).type):
            return ""
        filled = self.cells(name).drop_null()
        parts = pc.extract_regex(filled, WITH_UNIT).drop_null()
        units = pc.value_counts(pc.struct_field(parts, "unit")).to_pylist() if len(parts) else []
        count, unit = max(((int(one["counts"]), str(one["values"])) for one in units), default=(0, ""))
        return unit if count > 0.9 * len(filled) else ""

    def _beside_numbers(self, cells: pa.ChunkedArray) -> tuple[Array, Mask]:
        """Numbers followed by their unit, and words of switches as 1 and 0."""
        words = pc.utf8_lower(cells)
        states = pa.array([*STATES]), pa.array([*STATES.values()])
        index = pc.index_in(words, states[0])
        known = pc.is_valid(index)
        number = pc.struct_field(pc.extract_regex(cells, WITH_UNIT), "number")
        values, unreadable = floats(pc.coalesce(number, cells), self.decimal)
        of_words = pc.take(states[1], index.combine_chunks()).fill_null(np.nan).to_numpy(zero_copy_only=False)
        return np.where(known.to_numpy(), of_words, values), unreadable & ~known.to_numpy()

    def numbers(self, name: str, channel: str | None = None) -> Array:
        """A column as float64 (n,), NaN for cells that are blank or not numbers.

        The account counts the filled cells under `channel` (the column's name if None). Raises InputError if
        no cell is a number, or if most others would be numbers with the other decimal mark.
        """
        values, unreadable = self.values(name)
        if channel == "gear" and unreadable.any():
            for row in np.flatnonzero(unreadable):
                letter = str(self.cells(name)[int(row)]).lower()
                values[row], unreadable[row] = GEARS.get(letter, np.nan), letter not in GEARS
        tally = self.account.channel(channel or name)
        tally.read += int((~np.isnan(values)).sum() + unreadable.sum())
        tally.used += int((~np.isnan(values)).sum())
        if unreadable.any():
            first = int(np.argmax(unreadable))
            cell = shown(self.cells(name)[first])
            tally.set_aside("no number", f"{cell} in {self.at(first)}", int(unreadable.sum()))
            if np.isnan(values).all():
                raise InputError(
                    f"{self.path}: column '{name}' holds no numbers; its first is {cell}"
                    f"{self._by_other_mark(name, unreadable) or f' in {self.at(first)}'}"
                )
            if says := self._by_other_mark(name, unreadable):
                raise InputError(
                    f"{self.path}: {unreadable.sum()} cells of '{name}' are no numbers, first {cell} in "
                    f"{self.at(first)}{says}"
                )
        if np.isnan(values).all():
            raise InputError(f"{self.path}: column '{name}' holds no numbers; all its cells are blank")
        return values

    def _by_other_mark(self, name: str, unreadable: Mask) -> str:
        """Advice if most unreadable cells are numbers with the other decimal mark."""
        other = "," if self.decimal == "." else "."
        cells = self.cells(name).filter(pa.array(unreadable))
        if 2 * np.isfinite(floats(cells, other)[0]).sum() <= len(cells):
            return ""
        return f': set decimal: "{other}"'

    def without(self, out: Mask, reason: str, first: str = "") -> TextTable:
        """The table without the rows `out` (n,), which the account counts as omitted for a reason."""
        if not out.any():
            return self
        at = int(np.argmax(out))
        self.account.total.set_aside(reason, f"{self.at(at)}{first}", int(out.sum()))
        kept = pa.array(~out)
        columns = {name: column.filter(kept) for name, column in self.columns.items()}
        left = replace(self, columns=columns, rows=self.rows[~out])
        self.account.total.used = len(left)
        return left

    def below_units(self, name: str) -> TextTable:
        """The table without its first few rows if these have text in a column of numbers."""
        unreadable = self.values(name)[1]
        above = np.arange(len(self)) < (len(self) if unreadable.all() else int(np.argmin(unreadable)))
        return self.without(above, ABOVE) if above.sum() <= MOST_ABOVE else self

    def with_key(self, known: Mask, what: str, names: Sequence[str], advice: str = "") -> TextTable:
        """The rows that have a time or distance, marked by `known` (n,).

        A few rows above the first are units, and a few below the last are totals. Raises InputError, ending
        with `advice`, if more than a tenth of the others have none.
        """
        if known.all():
            return self
        place = np.arange(len(known))
        first, last = (int(place[known][0]), int(place[known][-1])) if known.any() else (len(known), -1)
        filled = np.zeros(len(known), dtype=bool)
        for name in names:
            filled |= pc.is_valid(self.cells(name)).to_numpy()
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


def read_table(
    path: Path,
    form: Format | None = None,
    cure: str = "set 'delimiter', or 'skip_rows' where the header comes later",
) -> TextTable:
    """A CSV file or, by its suffix, a Parquet or MAT file, in a format (see Format).

    A byte order mark overrides the encoding. Trailing delimiters of rows or the header are no columns; blank
    rows, repeated headers and totals are omitted, as are rows with more or fewer cells than the header. CSV
    has no checksum, so that a changed digit is not detected. Parquet's page checksums are verified if
    present. Raises InputError for a file that is missing, empty, or not in that encoding, and, ending with
    `cure`, if most rows do not fit the header.
    """
    form = form or Format()
    check_table(path)
    account = Account(str(path), "rows")
    place: Callable[[int], str] = _parquet_row
    try:
        if is_typed(path):
            table, left_out = _mat(path) if path.suffix.lower() == MAT else (_parquet(path), [])
            if left_out:
                account.remarks.append(f"of another length than the others, left out: {', '.join(left_out)}")
            names = list(table.column_names)
            account.total.read = table.num_rows
            rows = np.arange(table.num_rows)
        else:
            table, names, rows, place = CsvText(path, form, account).read(cure)
    except (pa.ArrowException, UnicodeError, LookupError, OSError, text_csv.Error, EOFError) as error:
        raise InputError(f"{path} cannot be read: {_why(error, form.encoding)}") from None
    account.total.used = table.num_rows
    names = [name.strip() for name in names]
    columns: dict[str, pa.ChunkedArray] = {}
    for name, column in zip(names, table.columns, strict=True):
        columns.setdefault(name, _plain_type(column))
    repeated = frozenset(name for name in columns if name and names.count(name) > 1)
    found = TextTable(path, columns, rows, place, account, form.decimal, repeated)
    for out, reason in ((_blank, BLANK), (_repeats_header, HEADER), (_sums_up, BELOW)):
        if len(found):
            found = found.without(out(found), reason)
    if not len(found):
        raise InputError(f"{path} is empty: it has no rows below its header")
    return found


def is_typed(path: Path) -> bool:
    """Whether a table has types and no text: Parquet, also in parts below a folder, or MAT."""
    return path.suffix.lower() in (*PARQUET, MAT) or path.is_dir()


def in_parts(path: Path) -> bool:
    """Whether a path is a folder with the Parquet files of one table."""
    return path.is_dir() and any(path.rglob("*.parquet"))


def check_table(path: Path) -> None:
    """Raises InputError if there is no file that can be a table, nor a folder of its parts."""
    if not in_parts(path):
        reading.check_file(path, "give a CSV or Parquet table")


def _parquet(path: Path) -> pa.Table:
    return parquet.read_table(path, page_checksum_verification=True)


def _mat(path: Path) -> tuple[pa.Table, list[str]]:
    """The vectors of a file of version 4 to 7 as columns, those of structures as STRUCTURE.FIELD, and the
    names of vectors that are left out.

    Structures with a `time` of their own (Structure With Time of Simulink, exported timeseries) share one
    column `time`, the union of theirs; a signal is blank in rows that are not its own. Without such, vectors
    of the most frequent length are used. Raises InputError for a file of version 7.3 (which is HDF5), a
    damaged one, and one without numeric vectors.
    """
    from scipy.io import loadmat

    try:
        held = loadmat(path, squeeze_me=True, struct_as_record=False)
    except Exception as error:  # whatever a damaged byte leads the library to
        raise InputError(
            f"{path} cannot be read as a MAT file ({reading.plain(str(error), 120)}); save it with '-v7', or "
            "as CSV"
        ) from None
    of_time: list[tuple[NDArray[Any], dict[str, NDArray[Any]]]] = []
    others: dict[str, NDArray[Any]] = {}
    for key, value in held.items():
        vectors = {} if key.startswith("__") else dict(_vectors(key, value))
        clock = next((name for name in vectors if name.lower() == f"{key}.time".lower()), "")
        if clock:
            of_time.append((vectors.pop(clock).astype(float), vectors))
        else:
            others |= vectors
    if not of_time and not others:
        raise InputError(f"{path} holds no vector of numbers; save time and signals as vectors")
    columns: dict[str, NDArray[Any]] = {}
    lengths = [len(values) for values in others.values()]
    rows = max(set(lengths), key=lambda length: (lengths.count(length), length)) if lengths else 0
    if of_time:
        columns["time"] = np.unique(np.concatenate([time for time, _ in of_time]))
        rows = len(columns["time"])
    for time, vectors in of_time:
        for name, values in vectors.items():
            if len(values) == len(time):
                columns[name] = np.full(rows, np.nan)
                columns[name][np.searchsorted(columns["time"], time)] = values
    columns |= {name: values for name, values in others.items() if len(values) == rows}
    names = [*others, *(name for _, vectors in of_time for name in vectors)]
    table = pa.table({name: pa.array(values, from_pandas=True) for name, values in columns.items()})
    return table, [name for name in names if name not in columns]


def _vectors(name: str, value: Any) -> Iterator[tuple[str, NDArray[Any]]]:
    if hasattr(value, "_fieldnames"):
        for inner in value._fieldnames:
            yield from _vectors(f"{name}.{inner}", getattr(value, inner))
    elif not isinstance(value, np.ndarray) or value.dtype.kind not in "biuf":
        return
    elif value.ndim == 1 and len(value) > 1:
        yield name, value
    elif value.ndim == 2:
        yield from ((f"{name}[{k + 1}]", value[:, k]) for k in range(min(value.shape[1], MOST_IN_A_MATRIX)))


_GROUPED = r"^\s*[-+]?[1-9]\d{0,2}(,\d{3})+(\.\d*)?\s*$"  # 1,300 and 1,300.5
_THOUSANDS = r"^[-+]?[1-9]\d{0,2}(\.\d{3})+(,\d*)?$"


def floats(cells: pa.ChunkedArray, decimal: str) -> tuple[Array, Mask]:
    """Text cells as float64 (n,), NaN if null or not a number, and (n,) which cells are filled but not
    numbers."""
    if decimal != ".":
        cells = pc.replace_substring(_without_thousands(cells), decimal, ".")
    try:
        values: Array = cells.cast(pa.float64()).fill_null(np.nan).to_numpy().astype(np.float64)
        return values, np.zeros(len(cells), dtype=bool)
    except pa.ArrowInvalid:
        pass  # some cell is no number
    plain = pc.fill_null(pc.match_substring_regex(cells, NUMBER), False)
    numbers = pc.if_else(plain, cells, pa.scalar(None, pa.string()))
    values = numbers.cast(pa.float64()).fill_null(np.nan).to_numpy().astype(np.float64)
    others = np.flatnonzero(pc.and_(pc.is_valid(cells), pc.invert(plain)).to_numpy())
    unreadable = np.zeros(len(cells), dtype=bool)
    for row, cell in zip(others, cells.take(pa.array(others)).to_pylist(), strict=True):
        word = cell.lower().lstrip("+-")
        unreadable[row] = word not in ("nan", "inf", "infinity")
        values[row] = np.nan if unreadable[row] else float(cell)
    return values, unreadable


def _without_thousands(cells: pa.ChunkedArray) -> pa.ChunkedArray:
    """Cells with a decimal comma, in which points can only separate thousands: 1.580 and 1.580,0 are 1580.

    A column that has points in other positions and no comma has a decimal point, whatever the others have.
    """
    points = pc.match_substring(cells, ".")
    if not pc.any(points).as_py():
        return cells
    marked = pc.match_substring_regex(cells, _THOUSANDS)
    commas = pc.any(pc.match_substring(cells, ",")).as_py()
    others = pc.and_(points, pc.invert(marked))
    if pc.any(others).as_py() and not commas:
        return cells
    cells = pc.if_else(marked, pc.replace_substring(cells, ".", ""), cells)
    return pc.if_else(others, pc.binary_join_element_wise(cells, pa.scalar("?"), ""), cells)  # is no number


def shown(cell: object) -> str:
    """A cell in quotation marks, on one line and shortened."""
    text = reading.plain(str(cell))
    return f"'{text[:40]}...'" if len(text) > 43 else f"'{text}'"


def _parquet_row(row: int) -> str:
    return f"row {row + 1}"


def _plain_type(column: pa.ChunkedArray) -> pa.ChunkedArray:
    """Text as one type, for all text types of Parquet."""
    kind = column.type
    if pa.types.is_dictionary(kind):
        column = column.cast(kind.value_type)
        kind = kind.value_type
    text = pa.types.is_large_string(kind) or pa.types.is_string_view(kind)
    return column.cast(pa.string()) if text else column


def _blank(table: TextTable) -> Mask:
    filled = np.zeros(len(table), dtype=bool)
    for name, column in table.columns.items():
        kept = table.cells(name) if pa.types.is_string(column.type) else column
        filled |= pc.is_valid(kept).to_numpy()
        if filled.all():
            break
    return ~filled


def _repeats_header(table: TextTable) -> Mask:
    """Which rows (n,) repeat the header's names in every text cell."""
    same: Mask = np.ones(len(table), dtype=bool)
    for name, column in table.columns.items():
        if not pa.types.is_string(column.type):
            return np.zeros(len(table), dtype=bool)
        same &= pc.equal(pc.fill_null(table.cells(name), ""), name).to_numpy()
        if not same.any():
            break
    return same


def _sums_up(table: TextTable) -> Mask:
    """Which rows (n,) at the end have a label such as 'Total', in a column without text above it."""
    count = len(table)
    below = np.zeros(count, dtype=bool)
    for name, column in table.columns.items():
        if not pa.types.is_string(column.type):
            continue
        cells = table.cells(name)[-MOST_BELOW - 1 :].to_pylist()
        labels = next((k for k, cell in enumerate(reversed(cells)) if not _is_label(cell)), 0)
        above = cells[-labels - 1]
        if above is None or re.search(r"\d", above):
            below[count - labels :] = True
    return below


def _is_label(cell: str | None) -> bool:
    return str(cell).lower().rstrip(":.").strip() in LABELS


def decimal_mark(table: TextTable, *names: str) -> str:
    """A comma if any number of these columns has one and none has a point."""
    found = set()
    for name in names:
        if pa.types.is_string(table.column(name).type):
            cells = table.cells(name)
            found |= {m for m in ",." if pc.any(pc.match_substring_regex(cells, _WITH_MARK[m])).as_py()}
    return "," if found == {","} else "."


def _why(error: BaseException, encoding: str) -> str:
    text = reading.plain(str(error))
    if isinstance(error, UnicodeDecodeError) or "UTF8" in text or "decod" in text:
        return f"it is not in {encoding}; set 'encoding' (latin-1, for example)"
    return text
