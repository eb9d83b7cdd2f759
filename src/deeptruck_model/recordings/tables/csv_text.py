"""The text of a CSV file: how it is written, where its header is, and which lines are rows."""

from __future__ import annotations

import codecs
import csv as text_csv
import gzip
import re
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray
from pyarrow import csv

from deeptruck_core import reading
from deeptruck_core.account import Account
from deeptruck_core.errors import InputError
from deeptruck_model.recordings.tables.column import STATES, WITH_UNIT
from deeptruck_model.recordings.words import spelled

DELIMITERS = ",;\t| "  # one of these is found by the header where none is given; blanks may be several
BYTE_ORDER_MARKS = {codecs.BOM_UTF8: "utf-8", codecs.BOM_UTF16_LE: "utf-16", codecs.BOM_UTF16_BE: "utf-16"}
_OTHER_BREAKS = {"\v", "\f", "\x1c", "\x1d", "\x1e", "\x85", "\u2028", "\u2029"}  # of splitlines alone
SAMPLED = 100  # rows by which the number of cells of a row is found
RAGGED = "with more or fewer cells than the header"
UNCLOSED = "inside a quotation mark that is not closed in its line"
BLANK = "without a filled cell"
LOOKED_AT = 1000  # lines in which header and delimiter are looked for
MOST_HEAD = 2**20  # characters of those lines
NUMBER = re.compile(r"[+-]?(\d+[.,]?\d*|[.,]\d+)([eE][+-]?\d+)?%?$")
_DATE = re.compile(r".*\d{1,4}[-./]\d{1,2}[-./]\d{1,4}|.*\d{1,2}:\d{2}")
_OF_UNIT = re.compile(WITH_UNIT)


@dataclass(frozen=True)
class Format:
    """How a table is written, by the keys of COLUMNS.yaml; Parquet and MAT need none. Without a delimiter it
    is found in the header, without a decimal mark in the numbers.

    `described` has a line for each column above the header, as loggers list their channels.
    """

    delimiter: str | None = None
    encoding: str = "utf-8"
    skip_rows: int = 0
    decimal: str = ""
    described: tuple[str, ...] = ()


def content(path: Path, encoding: str | None) -> tuple[bytes, str]:
    """The text of a file as UTF-8, without a byte order mark, and its encoding: that of the mark, the given
    one, or the likely one if None. Raises InputError for a binary file."""
    try:
        data = path.read_bytes()
        data = gzip.decompress(data) if path.suffix.lower() == ".gz" else data
    except (OSError, EOFError, zlib.error) as error:
        raise InputError(f"{path} cannot be read: {reading.plain(str(error))}") from None
    marked = next((BYTE_ORDER_MARKS[mark] for mark in BYTE_ORDER_MARKS if data.startswith(mark)), None)
    encoding = marked or encoding or _likely(data)
    if codecs.lookup(encoding).name in ("utf-8", "utf-8-sig", "ascii"):
        data = data.removeprefix(codecs.BOM_UTF8)
    else:
        data = data.decode(encoding).lstrip("\ufeff").encode()
    if b"\0" in data[:4096]:
        raise InputError(f"{path} is no text table but binary; export it as CSV or Parquet")
    return data, encoding


def _likely(data: bytes) -> str:
    """The encoding of a text without a mark."""
    even, odd = (data[:4096][k::2].count(0) for k in (0, 1))
    if max(even, odd) > 4 * min(even, odd) and max(even, odd) > 0.3 * min(len(data), 4096) / 2:
        return "utf-16-le" if odd > even else "utf-16-be"
    try:
        data.decode()
        return "utf-8"
    except UnicodeDecodeError:
        return "cp1252" if re.search(rb"[\x80\x82-\x8c\x8e\x91-\x9c\x9e\x9f]", data) else "latin-1"


def find_format(path: Path) -> Format:
    """The format of a text table, by its beginning. Raises InputError for a file that is no text, or has no
    header above rows of numbers."""
    try:
        data, encoding = content(path, None)
    except UnicodeError:
        raise InputError(f"{path} is no text table but binary; export it as CSV or Parquet") from None
    if not data.strip():
        raise InputError(f"{path} is empty")
    lines = data.decode()[:MOST_HEAD].split("\n")[:LOOKED_AT]
    blanks = single_blanks("\n".join(lines).encode()).decode().split("\n")
    found = {mark: _header(blanks if mark == " " else lines, mark) for mark in DELIMITERS}
    best = max(found, key=lambda mark: (found[mark][1] > 0, mark != " ", *found[mark][:2]))
    columns, rows, header = found[best]
    if columns < 2:
        raise InputError(
            f"{path} is no table: none of its first {LOOKED_AT} lines has two cells of numbers or dates; "
            "write COLUMNS.yaml by hand (docs/recordings.md)"
        )
    if rows == 0:
        first = next((k for k, line in enumerate(lines) if len(line.split(best)) == columns), 0)
        raise InputError(
            f"{path} has no header: add a line with the columns' names above its numbers"
            f"{_listed(lines[:first], columns, best)}"
        )
    return Format(best, encoding, header, described=_described(lines[:header], columns))


def _described(above: Sequence[str], columns: int) -> tuple[str, ...]:
    """As many lines above the header as it has columns, between blank lines or [sections]; () for none."""
    block: list[str] = []
    for line in [*map(str.strip, above), ""]:
        if line and not line.startswith("["):
            block.append(line)
        elif len(block) == columns:
            return tuple(block)
        else:
            block = []
    return ()


def _listed(above: Sequence[str], columns: int, delimiter: str) -> str:
    """The header to add, if lines above the numbers list the names of the columns as 'Channel : Speed'."""
    pairs = [[part.strip() for part in line.split(":", 1)] for line in above if ":" in line]
    keys = [key for key, _ in pairs]
    for key in dict.fromkeys(keys):
        if keys.count(key) in (columns - 1, columns):
            names = [name for other, name in pairs if other == key]
            names = ["Time"] * (columns - len(names)) + names
            return f" in line {len(above) + 1}: {delimiter.join(map(reading.plain, names))}"
    return ""


def _header(lines: Sequence[str], delimiter: str) -> tuple[int, int, int]:
    """For one delimiter: cells in a row of numbers, names in the header (0 without one), lines before it."""
    rows = []
    for line in lines:
        try:
            written = next(text_csv.reader([line.rstrip("\r")], delimiter=delimiter), [])
        except text_csv.Error:
            written = []
        rows.append(without_mark([cell.strip() for cell in written]))
    first = next((k for k in range(len(rows)) if _begins(rows, k)), None)
    if first is None:
        return 0, 0, 0
    cells = len(rows[first])
    names = [
        sum(bool(cell) and not is_value(cell) for cell in row) if len(row) > 1 else 0 for row in rows[:first]
    ]
    least = max(min(2, cells - 1), min(cells, sum(map(bool, rows[first]))) // 2)
    # the nearest line above with as many cells as the rows, else the one with most names
    as_wide = [
        k for k, row in enumerate(rows[:first]) if len(row) == cells and names[k] >= max(least, cells // 2)
    ]
    most = max(names, default=0)
    header = as_wide[-1] if as_wide else names.index(most) if names else 0
    if len(as_wide) > 1 and as_wide[-2] >= header - 2 and any(map(spelled, rows[header])):
        header = as_wide[-2]  # above a row of units
    return (cells, names[header], header) if names and names[header] >= least else (cells, 0, 0)


def _begins(rows: Sequence[list[str]], first: int) -> bool:
    """Whether rows of numbers begin here."""
    if not _is_data(rows[first]):
        return False
    following = rows[first : first + 6]
    following = [row for row in following if any(row)] if len(rows) < first + 6 else following
    same = [row for row in following if _is_data(row) and abs(len(row) - len(rows[first])) <= 1]
    return 2 * len(same) > len(following)


def _is_data(row: Sequence[str]) -> bool:
    values = sum(map(is_value, row))
    return values >= 2 and 3 * values >= sum(map(bool, row))


def is_value(cell: str) -> bool:
    """Whether a cell is a number, a date or a time of day."""
    words = ("nan", "inf", *STATES)
    return cell.lower() in words or any(one.match(cell) for one in (NUMBER, _DATE, _OF_UNIT))


class CsvText:
    """A text table: its header, and its lines as rows.

    A row is a line: a quotation mark that is not closed in its line would make one cell of all that follows,
    so such a line is set aside.
    """

    def __init__(self, path: Path, form: Format, account: Account) -> None:
        self.path, self.account = path, account
        data, _ = content(path, form.encoding)
        text = (single_blanks(data) if form.delimiter == " " else data).decode()
        self.lines = text.splitlines() if not set(text) & _OTHER_BREAKS else re.split("\r\n|\n|\r", text)
        delimiter, self.skip_rows = form.delimiter, form.skip_rows
        first = self.lines[0].strip().strip('"') if self.lines else ""
        if self.skip_rows == 0 and re.fullmatch(r"sep=.", first):  # as Excel writes it
            delimiter, self.skip_rows = delimiter or first[-1], 1
        self.delimiter = delimiter or self._found_delimiter()
        self.header, self.begin = self._header(self.delimiter)

    def _found_delimiter(self) -> str:
        counts = {mark: len(self._header(mark)[0]) for mark in DELIMITERS.strip()}
        return "," if counts[","] > 1 else max(counts, key=lambda mark: counts[mark])

    def _header(self, delimiter: str) -> tuple[list[str], int]:
        """Names, and the number of lines before and in the header, whose cells may hold line breaks."""
        below = (f"{line}\n" for line in self.lines[self.skip_rows :])
        records = text_csv.reader(below, delimiter=delimiter)
        header = without_mark(next(filter(None, records), []))
        return [name.replace("\n", " ") for name in header], self.skip_rows + records.line_num

    def read(self) -> tuple[pa.Table, list[str], NDArray[np.int64]]:
        """The rows, the names of their columns, and the number of their lines, from 0 below the header."""
        if not any(line.strip() for line in self.lines[self.begin :]):
            raise InputError(f"{self.path} is empty: it has no rows below its header")
        names = self._names()
        first, kept, numbers = "", list[str](), list[int]()
        body, mark, marks = self.lines[self.begin :], self.delimiter, len(names) - 1
        self.account.total.read += sum(map(bool, body))
        for number, line in enumerate(body):
            if not line:
                continue
            if '"' in line or line.count(mark) != marks:
                cells, reason = self._cells(line, len(names))
                if reason:
                    where = f"line {self.begin + number + 1}"
                    self.account.total.set_aside(reason, where)
                    first = first or f"{where} with {len(cells)}"
                    continue
                line = mark.join('"{}"'.format(cell.replace('"', '""')) for cell in cells)
            kept.append(line)
            numbers.append(number)
        if self.account.total.left_out > len(numbers):
            self._refuse(first)
        columns = [str(k) for k in range(len(names))]
        text = dict.fromkeys(columns, pa.string())
        convert = csv.ConvertOptions(column_types=text, strings_can_be_null=True, null_values=[""])
        data = "\n".join(kept).encode()
        read = csv.ReadOptions(column_names=columns, use_threads=False, block_size=min(len(data) + 1, 2**30))
        parse = csv.ParseOptions(delimiter=mark)
        table = csv.read_csv(pa.BufferReader(data), read, parse, convert)
        return table, names, np.array(numbers, np.int64)

    def _cells(self, line: str, count: int) -> tuple[list[str], str]:
        """The cells of a row, and the reason for which it is none."""
        if '"' not in line:
            cells = line.split(self.delimiter)
        elif line.count('"') % 2:
            return [], UNCLOSED
        else:
            cells = next(text_csv.reader([line], delimiter=self.delimiter), [])
        if len(cells) == count:
            return cells, ""
        filled = _filled(cells)
        if not filled:
            return cells, BLANK
        if _filled(self.header) <= len(cells) and filled <= count:
            return (cells + [""] * count)[:count], ""
        return cells, RAGGED

    def _names(self) -> list[str]:
        """The header with as many cells as most rows have; additional cells are blank."""
        some = [line for line in self.lines[self.begin : self.begin + SAMPLED] if line]
        rows = [self._cells(line, -1)[0] for line in some]
        lengths = [len(cells) for cells in rows if cells]
        usual = max(set(lengths), key=lengths.count) if lengths else len(self.header)
        count = max(usual, _filled(self.header))
        if any(_filled(cells) > len(self.header) for cells in rows if len(cells) == usual):
            return self.header
        return (self.header + [""] * count)[:count]

    def _refuse(self, first: str) -> None:
        """Raises InputError for a table in which most rows do not fit the header."""
        cure = "set 'delimiter', or 'skip_rows' where the header comes later"
        count, read, left = _filled(self.header), self.account.total.read, self.account.total.left_out
        few = "none" if left == read else f"only {read - left}"
        if count > 2 and first.endswith(f" with {count + 1}"):  # with two columns it is a decimal comma
            cure = (
                f"a value with '{self.delimiter}' in it, such as 1,234 or 50.1,8.2, must be quoted, or {cure}"
            )
        raise InputError(
            f"{self.path} is no table as it is read: its header has {count} cell{'s' if count != 1 else ''}, "
            f"and {few} of the {read} rows below has as many; {cure} (first {first})"
        )

    def place(self, row: int) -> str:
        """The line of a row, by its number below the header."""
        return f"line {self.begin + row + 1}"


def single_blanks(data: bytes) -> bytes:
    """Text whose columns are separated by any number of blanks, converted to one blank each and none before a
    unit."""
    data = re.sub(rb" (?=[\[(][^\])\n]*[\])])", b"_", re.sub(rb"[ \t]+", b" ", data))
    return re.sub(rb"(?m)^ +| +(?=\r?$)", b"", data)


def without_mark(header: list[str]) -> list[str]:
    """A header without the '# ' that numpy's savetxt writes before it."""
    if not header or not re.match(r"\s*[#%]+(\s|$)", header[0]):
        return header
    first = header[0].strip().lstrip("#%").strip()
    return [first, *header[1:]] if first else header[1:]


def _filled(cells: list[str]) -> int:
    """The number of cells up to the last one that is not blank."""
    return max((k + 1 for k, cell in enumerate(cells) if cell.strip()), default=0)
