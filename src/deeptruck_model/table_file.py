"""Columns out of a CSV or Parquet file, with an account of every row and cell that is no sample.

The one reader of tables: recordings, leaders and roads are read by it.
"""

from __future__ import annotations

import codecs
import csv as text_csv
import difflib
import gzip
import io
import re
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray
from pyarrow import csv, parquet

from deeptruck_model import reading
from deeptruck_model.account import Account
from deeptruck_model.errors import InputError

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

PARQUET = (".parquet", ".pq")
DELIMITERS = ",;\t|"  # one of these is found by the header where none is given
BYTE_ORDER_MARKS = {codecs.BOM_UTF8: "utf-8", codecs.BOM_UTF16_LE: "utf-16", codecs.BOM_UTF16_BE: "utf-16"}
SHOWN = 12  # columns that an error lists
SAMPLED = 100  # rows by which the number of cells of a row is found
MOST_ABOVE, MOST_BELOW = 3, 10  # rows of units above the numbers, of totals below them
MOST_WITHOUT_KEY = 0.1  # of the rows; where more have no time, the column or its unit is mistaken
MOST_BEFORE = 20  # lines in which the header of a leader or road is looked for
NUMBER = r"^[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?$"
_WITH_MARK = {mark: rf"^[+-]?\d*[{mark}]\d+([eE][+-]?\d+)?$" for mark in ",."}
LABELS = {  # in a cell of a row that sums up those above it
    "total", "totals", "sum", "mean", "average", "avg", "min", "max", "minimum", "maximum", "median", "std",
    "stdev", "count", "summe", "gesamt", "mittel", "mittelwert", "durchschnitt", "minimalwert", "maximalwert",
    "anzahl",
}  # fmt: skip
RAGGED = "with more or fewer cells than the header"
UNCLOSED = "inside a quotation mark that is not closed in its line"
BLANK = "without a filled cell"
HEADER = "that repeat the header"
ABOVE = "of units or text above the numbers"
BELOW = "of totals or text below the numbers"


@dataclass(frozen=True)
class TextTable:
    """Columns by name (blanks around names ignored), cells still as they stand in the file.

    `rows` (n,) numbers the rows as they stand in the file, from 0 below the header; `place` says where one
    of these is, such as 'line 7'. `account` counts the rows that were read, kept and set aside.
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
        """Where a row of this table stands in the file."""
        return self.place(int(self.rows[row]))

    def column(self, name: str) -> pa.ChunkedArray:
        """One column. Raises InputError, naming the nearest ones, where it is not there."""
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
        """What to mend where the name stands in a row below that which was taken for the header."""
        for row in range(min(len(self), 2 * SAMPLED)):
            if any(str(column[row]).strip() == name for column in self.columns.values()):
                return f"; '{name}' stands in {self.at(row)}: skip the lines before it by 'skip_rows'"
        return ""

    def cells(self, name: str) -> pa.ChunkedArray:
        """A column as text without blanks around it, null where there is none."""
        column = self.column(name)
        try:
            cells = pc.utf8_trim_whitespace(pc.cast(column, pa.string()))
        except pa.ArrowException:
            raise InputError(
                f"{self.path}: column '{name}' of type {column.type} holds no text or numbers"
            ) from None
        return pc.if_else(pc.equal(cells, ""), pa.scalar(None, pa.string()), cells)

    def values(self, name: str) -> tuple[Array, Mask]:
        """A column as float64 (n,), NaN for cells that are blank or no number, and which are the latter."""
        column = self.column(name)
        if pa.types.is_string(column.type):
            return floats(self.cells(name), self.decimal)
        try:
            numbers = pc.cast(column, pa.float64(), safe=False).fill_null(np.nan).to_numpy()
        except pa.ArrowException:
            raise InputError(f"{self.path}: column '{name}' of type {column.type} holds no numbers") from None
        return numbers.astype(np.float64), np.zeros(len(numbers), dtype=bool)

    def numbers(self, name: str, channel: str | None = None) -> Array:
        """A column as float64 (n,), NaN for cells that are blank or no number.

        The account counts the filled cells under `channel` (the column's name where None). Raises InputError
        where no cell is a number, or where most that are none would be by the other decimal mark.
        """
        values, strange = self.values(name)
        tally = self.account.channel(channel or name)
        tally.read += int((~np.isnan(values)).sum() + strange.sum())
        tally.used += int((~np.isnan(values)).sum())
        if strange.any():
            first = int(np.argmax(strange))
            cell = shown(self.cells(name)[first])
            tally.set_aside("no number", f"{cell} in {self.at(first)}", int(strange.sum()))
            if np.isnan(values).all():
                raise InputError(
                    f"{self.path}: column '{name}' holds no numbers; its first is {cell}"
                    f"{self._by_other_mark(name, strange) or f' in {self.at(first)}'}"
                )
            if says := self._by_other_mark(name, strange):
                raise InputError(
                    f"{self.path}: {strange.sum()} cells of '{name}' are no numbers, first {cell} in "
                    f"{self.at(first)}{says}"
                )
        if np.isnan(values).all():
            raise InputError(f"{self.path}: column '{name}' holds no numbers; all its cells are blank")
        return values

    def _by_other_mark(self, name: str, strange: Mask) -> str:
        """What to mend where most of the strange cells are numbers by the other decimal mark."""
        other = "," if self.decimal == "." else "."
        cells = self.cells(name).filter(pa.array(strange))
        if 2 * np.isfinite(floats(cells, other)[0]).sum() <= len(cells):
            return ""
        return f': set decimal: "{other}"'

    def without(self, out: Mask, reason: str, first: str = "") -> TextTable:
        """The table without the rows `out` (n,), which the account has set aside for a reason."""
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
        """The table without a few rows at its beginning that have text in a column of numbers."""
        strange = self.values(name)[1]
        above = np.arange(len(self)) < (len(self) if strange.all() else int(np.argmin(strange)))
        return self.without(above, ABOVE) if above.sum() <= MOST_ABOVE else self

    def with_key(self, known: Mask, what: str, names: Sequence[str], advice: str = "") -> TextTable:
        """The rows that have a time or distance: `known` (n,) says which.

        A few above the first are units, and a few below the last are totals. Raises InputError, ending with
        `advice`, where more than a tenth of the others have none.
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
    *,
    delimiter: str | None = None,
    encoding: str = "utf-8",
    skip_rows: int = 0,
    decimal: str = ".",
    cure: str = "set 'delimiter', or 'skip_rows' where the header comes later",
) -> TextTable:
    """A CSV file (`skip_rows` lines before the header are ignored) or a Parquet file, by its suffix.

    A byte order mark counts more than `encoding`; without a delimiter it is found in the header. Delimiters
    at the end of rows or of the header are no columns; blank rows, repeated headers and rows that sum up are
    set aside, as are those with more or fewer cells than the header. CSV has no checksum: a changed digit is
    another number. Parquet's page checksums are looked at where the file has them. Raises InputError for a
    file that is missing, empty, or not in that encoding, and, ending with `cure`, where most rows do not fit
    the header.
    """
    reading.check_file(path, "give a CSV or Parquet table")
    account = Account(str(path), "rows")
    place: Callable[[int], str] = _parquet_row
    try:
        if path.suffix.lower() in PARQUET:
            table = parquet.read_table(path, page_checksum_verification=True)
            names = list(table.column_names)
            account.total.read = table.num_rows
            rows = np.arange(table.num_rows)
        else:
            table, names, rows, place = _Csv(path, delimiter, encoding, skip_rows, account).read(cure)
    except (pa.ArrowException, UnicodeError, LookupError, OSError, text_csv.Error, EOFError) as error:
        raise InputError(f"{path} cannot be read: {_why(error, encoding)}") from None
    account.total.used = table.num_rows
    names = [name.strip() for name in names]
    columns: dict[str, pa.ChunkedArray] = {}
    for name, column in zip(names, table.columns, strict=True):
        columns.setdefault(name, _plain_type(column))
    repeated = frozenset(name for name in columns if name and names.count(name) > 1)
    found = TextTable(path, columns, rows, place, account, decimal, repeated)
    for out, reason in ((_blank, BLANK), (_repeats_header, HEADER), (_sums_up, BELOW)):
        if len(found):
            found = found.without(out(found), reason)
    if not len(found):
        raise InputError(f"{path} is empty: it has no rows below its header")
    return found


def read_curve(path: Path, over: str, of: str) -> tuple[Array, Array]:
    """A column of a table over an ascending one, such as a road's grade over distance: both (n,), n > 1.

    Lines before the header, the delimiter and the decimal mark are found. What was set aside is said on
    stderr. Raises InputError with the line where a row has no number, or where `over` does not grow.
    """
    reading.check_file(path, "give a CSV or Parquet table")
    table = read_table(
        path,
        skip_rows=_lines_before(path, over, of),
        cure=f"it needs a header with {over} and {of}, and rows of as many cells",
    )
    table = replace(table, decimal=decimal_mark(table, over, of))
    table = table.with_key(~np.isnan(table.values(over)[0]), over, (over,))
    x, y = table.values(over)[0], table.values(of)[0]
    without = ~np.isfinite(x) | ~np.isfinite(y)
    if without.any():
        at = table.at(int(np.argmax(without)))
        raise InputError(f"{path}: {at} needs a number under {over} and {of}")
    if len(x) < 2:
        raise InputError(f"{path} has one row; it needs at least two")
    if (np.diff(x) <= 0).any():
        at = table.at(int(np.argmax(np.diff(x) <= 0)) + 1)
        raise InputError(f"{path}: {over} does not grow in {at}; sort the rows and drop doubled ones")
    if table.account.total.left_out:
        print("\n".join(table.account.lines()), file=sys.stderr)
    return x, y


_THOUSANDS = r"^[-+]?[1-9]\d{0,2}(\.\d{3})+(,\d*)?$"


def floats(cells: pa.ChunkedArray, decimal: str) -> tuple[Array, Mask]:
    """Text cells as float64 (n,), NaN where null or no number, and (n,) which are filled and no number."""
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
    strange = np.zeros(len(cells), dtype=bool)
    for row, cell in zip(others, cells.take(pa.array(others)).to_pylist(), strict=True):
        word = cell.lower().lstrip("+-")
        strange[row] = word not in ("nan", "inf", "infinity")
        values[row] = np.nan if strange[row] else float(cell)
    return values, strange


def _without_thousands(cells: pa.ChunkedArray) -> pa.ChunkedArray:
    """Cells with a decimal comma, whose points can only mark thousands: 1.580 and 1.580,0 are 1580.

    A column that has points in other places and no comma has the decimal point, whatever the others have.
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
    """A cell between quotation marks, on one line and not too long."""
    text = reading.plain(str(cell))
    return f"'{text[:40]}...'" if len(text) > 43 else f"'{text}'"


class _Csv:
    """A text table: its header, and its rows with as many cells."""

    def __init__(
        self, path: Path, delimiter: str | None, encoding: str, skip_rows: int, account: Account
    ) -> None:
        self.path, self.account, self.skip_rows = path, account, skip_rows
        self.encoding = encoding
        self.data = self._utf8()
        first = self.data[:200].split(b"\n")[0].decode("utf-8", "replace").strip().strip('"')
        if skip_rows == 0 and re.fullmatch(r"sep=.", first):  # as Excel writes it
            delimiter, self.skip_rows = delimiter or first[-1], 1
        self.delimiter = delimiter or self._found_delimiter()
        self.header, self.lines, self.start = self._header(self.delimiter)

    def _utf8(self) -> bytes:
        """The file's text without a byte order mark."""
        data = self.path.read_bytes()
        if self.path.suffix.lower() == ".gz":
            data = gzip.decompress(data)
        marks = [mark for mark in BYTE_ORDER_MARKS if data.startswith(mark)]
        encoding = BYTE_ORDER_MARKS[marks[0]] if marks else self.encoding
        if codecs.lookup(encoding).name in ("utf-8", "utf-8-sig", "ascii"):
            data = data.removeprefix(codecs.BOM_UTF8)
            if b"\0" in data[:4096]:
                raise InputError(f"{self.path} is no text table but binary; export it as CSV or Parquet")
            return data
        if not encoding.lower().startswith(("utf-16", "utf-32", "utf16", "utf32")) and b"\0" in data[:4096]:
            raise InputError(f"{self.path} is no text table but binary; export it as CSV or Parquet")
        return data.decode(encoding).lstrip("\ufeff").encode()

    def _records(self, start: int, delimiter: str) -> Iterator[tuple[int, list[str]]]:
        """Records from a byte on that are not blank lines, each with its first line there, from 0."""
        text = io.TextIOWrapper(io.BytesIO(memoryview(self.data)[start:]), "utf-8", newline="")
        records = text_csv.reader(text, delimiter=delimiter)
        line = 0
        for record in records:
            if record:
                yield line, record
            line = records.line_num

    def _found_delimiter(self) -> str:
        counts = {mark: len(self._header(mark)[0]) for mark in DELIMITERS}
        return "," if counts[","] > 1 else max(counts, key=lambda mark: counts[mark])

    def _header(self, delimiter: str) -> tuple[list[str], int, int]:
        """Names, the number of lines up to them and theirs, and the byte behind them."""
        start = 0
        for _ in range(self.skip_rows):
            start = self.data.find(b"\n", start) + 1 or len(self.data)
        text = io.TextIOWrapper(io.BytesIO(self.data[start:]), "utf-8", newline="")
        taken: list[str] = []

        def lines() -> Iterator[str]:
            for line in text:
                taken.append(line)
                yield line

        header = next(filter(None, text_csv.reader(lines(), delimiter=delimiter)), [])
        return header, self.skip_rows + len(taken), start + sum(len(line.encode()) for line in taken)

    def read(self, cure: str) -> tuple[pa.Table, list[str], NDArray[np.int64], Callable[[int], str]]:
        """The rows, the names of their columns, their numbers in the file, and where those stand."""
        body = self._without_unclosed()
        names = self._names()
        if not body.strip():
            raise InputError(f"{self.path} is empty: it has no rows below its header")
        odd: list[csv.InvalidRow] = []

        def skip(row: csv.InvalidRow) -> str:
            odd.append(row)
            return "skip"

        columns = [str(k) for k in range(len(names))]
        table = csv.read_csv(
            pa.BufferReader(body),
            read_options=csv.ReadOptions(
                column_names=columns, use_threads=False, block_size=min(len(body) + 1, 2**30)
            ),
            parse_options=csv.ParseOptions(delimiter=self.delimiter, invalid_row_handler=skip),
            convert_options=csv.ConvertOptions(
                column_types=dict.fromkeys(columns, pa.string()), strings_can_be_null=True, null_values=[""]
            ),
        )
        self.account.total.read += table.num_rows + len(odd)
        place = self._places(body)
        numbers = np.setdiff1d(np.arange(table.num_rows + len(odd)), [row.number - 1 for row in odd])
        if b'"' in body:
            table, numbers = self._in_one_line(table, numbers, place)
        if not odd:
            return table, names, numbers, place
        kept, kept_numbers = self._sort_out(odd, names, place)
        if self.account.total.left_out > table.num_rows + len(kept):
            self._refuse(odd[0], cure)
        if kept:
            more = pa.table([pa.array(c, pa.string()) for c in zip(*kept, strict=True)], names=columns)
            numbers = np.concatenate([numbers, kept_numbers])
            order = np.argsort(numbers)
            table, numbers = pa.concat_tables([table, more]).take(pa.array(order)), numbers[order]
        return table, names, numbers, place

    def _without_unclosed(self) -> bytes:
        """What is below the header, with a blank line for one in which a quotation mark is left open.

        It would take all rows up to the next one for a single cell.
        """
        body = self.data[self.start :]
        lines = body.splitlines(keepends=True) if b'"' in body else []
        odd = [k for k, line in enumerate(lines) if line.count(b'"') % 2]
        if not odd:
            return body
        for k in odd:
            lines[k] = b"\n"
        self.account.total.read += len(odd)
        self.account.total.set_aside(UNCLOSED, f"line {self.lines + odd[0] + 1}", len(odd))
        body = b"".join(lines)
        self.data = self.data[: self.start] + body
        return body

    def _in_one_line(
        self, table: pa.Table, numbers: NDArray[np.int64], place: Callable[[int], str]
    ) -> tuple[pa.Table, NDArray[np.int64]]:
        """The rows none of whose cells goes on in the next line."""
        breaks = np.zeros(len(numbers), dtype=np.int64)
        for column in table.columns:
            breaks += pc.count_substring_regex(pc.fill_null(column, ""), r"\r\n|\n|\r").to_numpy()
        if not breaks.any():
            return table, numbers
        self.account.total.read += int(breaks.sum())
        lines = int(breaks.sum() + (breaks > 0).sum())
        self.account.total.set_aside(UNCLOSED, place(int(numbers[np.argmax(breaks > 0)])), lines)
        return table.filter(pa.array(breaks == 0)), numbers[breaks == 0]

    def _names(self) -> list[str]:
        """The header with as many cells as most rows have, where what one of them has more is blank."""
        lengths = [len(cells) for _, cells in islice(self._records(self.start, self.delimiter), SAMPLED)]
        usual = max(set(lengths), key=lengths.count) if lengths else len(self.header)
        least = _filled(self.header)
        named = self.header[: max(usual, least)]
        return named + [""] * (max(usual, least) - len(named)) if self._blank_beyond(usual) else self.header

    def _blank_beyond(self, usual: int) -> bool:
        records = islice(self._records(self.start, self.delimiter), SAMPLED)
        return all(_filled(cells) <= len(self.header) for _, cells in records if len(cells) == usual)

    def _sort_out(
        self, odd: list[csv.InvalidRow], names: list[str], place: Callable[[int], str]
    ) -> tuple[list[list[str | None]], list[int]]:
        """Of the rows with another number of cells those that differ in blank cells at the end only."""
        kept: list[list[str | None]] = []
        numbers = []
        for row in odd:
            text = row.text.rstrip("\r\n")
            cells = next(text_csv.reader([text], delimiter=self.delimiter), [])
            where = place(row.number - 1)
            if "\n" in text or "\r" in text:
                lines = sum(bool(line.strip()) for line in text.splitlines())
                self.account.total.read += lines - 1
                self.account.total.set_aside(UNCLOSED, where, lines)
            elif not _filled(cells):
                self.account.total.set_aside(BLANK, where)
            elif _filled(self.header) <= len(cells) and _filled(cells) <= len(names):
                kept.append([cell or None for cell in (cells + [""] * len(names))[: len(names)]])
                numbers.append(row.number - 1)
            else:
                self.account.total.set_aside(RAGGED, where)
        return kept, numbers

    def _refuse(self, odd: csv.InvalidRow, cure: str) -> None:
        """Raises InputError for a table most of whose rows do not fit its header."""
        count, read = _filled(self.header), self.account.total.read
        left = self.account.total.left_out
        few = "none" if left == read else f"only {read - left}"
        first = next(iter(self.account.total.aside.values())).first
        raise InputError(
            f"{self.path} is no table as it is read: its header has {count} cell{'s' if count != 1 else ''}, "
            f"and {few} of the {read} rows below has as many; {cure} "
            f"(first {first} with {odd.actual_columns})"
        )

    def _places(self, body: bytes) -> Callable[[int], str]:
        """Where the k-th row below the header is; by counting, unless lines are blank or cells span them."""
        first = self.lines + 1
        uneven = (b'"', b"\n\n", b"\n\r", b"\r\r")
        if not body.startswith((b"\n", b"\r")) and not any(mark in body for mark in uneven):
            return lambda row: f"line {first + row}"

        def place(row: int) -> str:
            record = next(islice(self._records(self.start, self.delimiter), row, None), (row, []))
            return f"line {first + record[0]}"

        return place


def _parquet_row(row: int) -> str:
    return f"row {row + 1}"


def _filled(cells: list[str]) -> int:
    """The number of cells up to the last that is not blank."""
    return max((k + 1 for k, cell in enumerate(cells) if cell.strip()), default=0)


def _plain_type(column: pa.ChunkedArray) -> pa.ChunkedArray:
    """Text as one type, whatever a Parquet file calls it."""
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
    """Which rows (n,) have the header's names in every cell of text."""
    same: Mask = np.ones(len(table), dtype=bool)
    for name, column in table.columns.items():
        if not pa.types.is_string(column.type):
            return np.zeros(len(table), dtype=bool)
        same &= pc.equal(pc.fill_null(table.cells(name), ""), name).to_numpy()
        if not same.any():
            break
    return same


def _sums_up(table: TextTable) -> Mask:
    """Which rows (n,) at the end have a label such as 'Total', in a column without words above it."""
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


def _lines_before(path: Path, *names: str) -> int:
    """Lines before the header with these names, 0 where none has them."""
    if path.suffix.lower() in PARQUET:
        return 0
    for lines in range(MOST_BEFORE):
        try:
            header = _Csv(path, None, "utf-8", lines, Account(str(path), "rows")).header
        except (UnicodeError, OSError, text_csv.Error, EOFError):
            return 0  # as read_table says
        if {name.strip() for name in header} >= set(names):
            return lines
    return 0


def decimal_mark(table: TextTable, *names: str) -> str:
    """A comma where a number of these columns has one and none has a point."""
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
