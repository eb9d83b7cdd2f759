"""The one reader of tables: every row and column of a CSV, Parquet or MAT file, parsed once.

Recordings use it, and `curve_file` for leaders and roads. The account has each row and cell that is not used.
"""

from __future__ import annotations

import csv as text_csv
import difflib
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray
from pyarrow import parquet

from deeptruck_model._io import reading
from deeptruck_model._io.account import Account
from deeptruck_model._io.formats import PARQUET
from deeptruck_model.errors import InputError
from deeptruck_model.recordings import units
from deeptruck_model.recordings.tables import mat_file
from deeptruck_model.recordings.tables.csv_text import BLANK, SAMPLED, CsvText, Format
from deeptruck_model.recordings.tables.header_words import spelled

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

SHOWN = 12  # columns that an error lists
MOST_ABOVE, MOST_BELOW = 3, 10  # rows of units above the numbers, of totals below them
MOST_WITHOUT_KEY = 0.1  # of the rows; where more have no time, the column or its unit is mistaken
LOOKED_AT = 5000  # rows by which the decimal mark is found
NUMBER = r"^[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?$"
WITH_UNIT = r"^(?P<number>[+-]?(?:\d[\d.,]*|[.,]\d+)(?:[eE][+-]?\d+)?)\s*(?P<unit>[^\d\s.,:/+-]\D*\d?)$"
IN_UNITS = 0.9  # of the filled cells; fewer with a unit behind their number are notes
STATES = {  # words of switches
    **dict.fromkeys(("true", "on", "yes", "pressed", "active", "ein", "an", "ja", "wahr"), 1.0),
    **dict.fromkeys(("false", "off", "no", "released", "inactive", "aus", "nein", "falsch"), 0.0),
}
GEARS = {"n": 0.0, "neutral": 0.0, "r": -1.0, "reverse": -1.0}  # letters of gears that are numbers, too
MOST_GEARS = 24
_WITH_MARK = {mark: rf"^[+-]?\d*[{mark}]\d+([eE][+-]?\d+)?$" for mark in ",."}
_GROUPED = r"^\s*[-+]?[1-9]\d{0,2}(,\d{3})+(\.\d*)?\s*$"  # 1,300 and 1,300.5
_THOUSANDS = r"^[-+]?[1-9]\d{0,2}(\.\d{3})+(,\d*)?$"
LABELS = {  # in a cell of a row that sums up those above it
    "total", "totals", "sum", "mean", "average", "avg", "min", "max", "minimum", "maximum", "median", "std",
    "stdev", "count", "summe", "gesamt", "mittel", "mittelwert", "durchschnitt", "minimalwert", "maximalwert",
    "anzahl",
}  # fmt: skip
HEADER = "that repeat the header"
ABOVE = "of units or text above the numbers"
BELOW = "of totals or text below the numbers"


@dataclass(frozen=True)
class Parsed:
    """The numbers of a column (n,), NaN for blank cells and text; which rows (n,) are such text; and the unit
    written behind the numbers, '' if there is none."""

    values: Array
    unreadable: Mask
    unit: str = ""


class Column:
    """One column, parsed at its first use: decimal mark, thousands, units in cells, states and gears.

    `raw` (n,) are the cells as in the file; `mark` is the table's decimal mark, and `pointed` says that other
    columns have decimal points, so that commas in this one separate thousands.
    """

    def __init__(self, name: str, raw: pa.ChunkedArray, mark: str = ".", *, pointed: bool = False) -> None:
        self.name, self.raw, self.mark, self.pointed = name, raw, mark, pointed

    @property
    def is_text(self) -> bool:
        """Whether it has cells of text, as all columns of CSV have."""
        return bool(pa.types.is_string(self.raw.type))

    @property
    def is_temporal(self) -> bool:
        """Whether it has a type of time, as columns of Parquet may have."""
        return bool(pa.types.is_temporal(self.raw.type))

    @cached_property
    def cells(self) -> pa.ChunkedArray:
        """Text without surrounding blanks, null if empty."""
        try:
            cells = pc.utf8_trim_whitespace(pc.cast(self.raw, pa.string()))
        except pa.ArrowException:
            raise InputError(
                f"column '{self.name}' of type {self.raw.type} holds no text or numbers"
            ) from None
        return pc.if_else(pc.equal(cells, ""), pa.scalar(None, pa.string()), cells)

    @property
    def values(self) -> Array:
        """The numbers (n,), NaN for blank cells and text."""
        return self._parsed.values

    @property
    def unreadable(self) -> Mask:
        """Which rows (n,) have text that is no number."""
        return self._parsed.unreadable

    @property
    def unit(self) -> str:
        """The unit behind the numbers of its cells, as in '54 km/h'; '' if there is none."""
        return self._parsed.unit

    @cached_property
    def _parsed(self) -> Parsed:
        if not self.is_text:
            try:
                numbers = pc.cast(self.raw, pa.float64(), safe=False).fill_null(np.nan).to_numpy()
            except pa.ArrowException:
                raise InputError(f"column '{self.name}' of type {self.raw.type} holds no numbers") from None
            return Parsed(numbers.astype(np.float64), np.zeros(len(numbers), dtype=bool))
        values, unreadable = floats(self.cells, self.mark)
        if unreadable.any() and self.mark == "." and self.pointed and self._grouped():
            values, unreadable = floats(pc.replace_substring(self.cells, ",", ""), self.mark)
        if not unreadable.any():
            return Parsed(values, unreadable)
        return self._with_units() or self._with_words(values, unreadable)

    def _grouped(self) -> bool:
        """Whether all commas are as in 1,300."""
        commas = pc.match_substring(self.cells, ",")
        return bool(pc.all(pc.equal(commas, pc.match_substring_regex(self.cells, _GROUPED))).as_py())

    def _with_units(self) -> Parsed | None:
        """Numbers with their unit behind them, each cell read in its own and given in the most frequent one;
        None if nearly all cells have no unit."""
        parts = pc.extract_regex(self.cells, WITH_UNIT)
        written = pc.dictionary_encode(pc.struct_field(parts, "unit")).combine_chunks()
        of = written.indices.fill_null(-1).to_numpy(zero_copy_only=False)
        if (of >= 0).sum() <= IN_UNITS * pc.sum(pc.is_valid(self.cells)).as_py():
            return None
        names = written.dictionary.to_pylist()
        usual = names[int(np.argmax(np.bincount(of[of >= 0])))]
        values, unreadable = floats(pc.coalesce(pc.struct_field(parts, "number"), self.cells), self.mark)
        for code, name in enumerate(names):
            into = units.between(spelled(name, self.name), spelled(usual, self.name))
            if name != usual and into is not None:
                values = np.where(of == code, into[0] * values + into[1], values)
            elif name != usual and (of == code).mean() > 0:
                unreadable = unreadable | (of == code)
        return Parsed(np.where(unreadable, np.nan, values), unreadable, usual)

    def _with_words(self, values: Array, unreadable: Mask) -> Parsed:
        """Words of switches as 1 and 0 in a column without numbers, and letters of gears beside numbers of
        gears."""
        known = values[np.isfinite(values)]
        gears = bool((known == np.rint(known)).all() and np.abs(known).max(initial=0.0) <= MOST_GEARS)
        words = STATES | GEARS if not len(known) else GEARS if gears else {}
        index = pc.index_in(pc.utf8_lower(self.cells), pa.array([*words], pa.string()))
        found = pc.is_valid(index).to_numpy()
        of = pc.take(pa.array([*words.values()], pa.float64()), index.combine_chunks())
        numbers = of.fill_null(np.nan).to_numpy(zero_copy_only=False)
        return Parsed(np.where(found, numbers, values), unreadable & ~found)

    def take(self, rows: NDArray[np.int64]) -> Column:
        """The column with these of its rows; what was parsed stays."""
        other = Column(self.name, self.raw.take(pa.array(rows)), self.mark, pointed=self.pointed)
        if parsed := self.__dict__.get("_parsed"):
            other.__dict__["_parsed"] = Parsed(parsed.values[rows], parsed.unreadable[rows], parsed.unit)
        return other


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

    def filled(self, names: Sequence[str]) -> Mask:
        """Which rows (n,) have a cell in one of these columns."""
        found = np.zeros(len(self), dtype=bool)
        for name in names:
            column = self.columns[name]
            found |= pc.is_valid(column.cells if column.is_text else column.raw).to_numpy()
            if found.all():
                break
        return found

    def with_key(self, known: Mask, what: str, names: Sequence[str], advice: str = "") -> Table:
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


def read_table(
    path: Path,
    form: Format | None = None,
    cure: str = "set 'delimiter', or 'skip_rows' where the header comes later",
) -> Table:
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
            table, names, rows = text.read(cure)
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
    decimal = form.decimal or _decimal_mark([*plain.values()], delimiter)
    points = [name for name, raw in plain.items() if decimal == "." and _has_mark(raw, ".")]
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


def _decimal_mark(columns: Sequence[pa.ChunkedArray], delimiter: str) -> str:
    """A comma if cells have one and none has a point. Between commas, where every such cell could be of
    thousands (1,300), it stays a point."""
    texts = [column for column in columns if pa.types.is_string(column.type)]
    if any(_has_mark(column, ".") for column in texts):
        return "."
    commas = [column for column in texts if _has_mark(column, ",")]
    alike = rf"{_GROUPED}|^[^,]*$"
    grouped = [pc.all(pc.match_substring_regex(c.drop_null(), alike)).as_py() for c in commas]
    return "," if commas and (delimiter != "," or not all(grouped)) else "."


def _has_mark(column: pa.ChunkedArray, mark: str) -> bool:
    """Whether a number in a column of text has this decimal mark, or one with a unit behind it."""
    if not pa.types.is_string(column.type):
        return False
    for part in (column.slice(0, LOOKED_AT), column.slice(LOOKED_AT)):
        some = part.filter(pc.match_substring(part, mark))
        some = pc.utf8_trim_whitespace(some)
        some = pc.coalesce(pc.struct_field(pc.extract_regex(some, WITH_UNIT), "number"), some)
        if pc.any(pc.match_substring_regex(some, _WITH_MARK[mark])).as_py():
            return True
    return False


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
