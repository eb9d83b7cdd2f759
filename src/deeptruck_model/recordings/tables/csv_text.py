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
from typing import NamedTuple

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
SAMPLED = 100  # rows by which the number of cells of a row is found
RAGGED = "with more or fewer cells than the header"
UNCLOSED = "inside a quotation mark that is not closed in its line"
BLANK = "without a filled cell"
LOOKED_AT = 1000  # lines in which header and delimiter are looked for
FEW = 0.2  # of the rows: so many different cells at most are codes
MOST_HEAD = 2**20  # characters of those lines
NUMBER = re.compile(r"[+-]?(\d+[.,]?\d*|[.,]\d+)([eE][+-]?\d+)?%?$")
_DATE = re.compile(r".*\d{1,4}[-./]\d{1,2}[-./]\d{1,4}|.*\d{1,2}:\d{2}")
_OF_UNIT = re.compile(WITH_UNIT)


@dataclass(frozen=True)
class Format:
    """How a table is written, by the keys of COLUMNS.yaml; Parquet and MAT need none. Without a delimiter it
    is found in the header, without a decimal mark in the numbers."""

    delimiter: str | None = None
    encoding: str = "utf-8"
    skip_rows: int = 0
    decimal: str = ""


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
        if codes := _codes(lines, best) if columns == 2 else "":
            raise InputError(
                f"{path} has a code and a value in each row ({codes}), and none has a time: write a table of "
                "time, name and value, with these words as its first line, the time in each row, and a name "
                "such as 'Speed (km/h)' for each code"
            )
        first = next((k for k, line in enumerate(lines) if len(line.split(best)) == columns), 0)
        raise InputError(
            f"{path} has no header: add a line with the columns' names above its numbers"
            f"{_listed(lines[:first], columns, best)}"
        )
    return Format(best, encoding, header)


def _codes(lines: Sequence[str], delimiter: str) -> str:
    """The first cells of rows where these are a few codes that come again; '' if they are not."""
    first = [line.split(delimiter)[0].strip() for line in lines if line]
    found = list(dict.fromkeys(first))
    return ", ".join(map(reading.plain, found[:4])) if len(found) < FEW * len(first) else ""


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


class Rows(NamedTuple):
    """The rows of a text table, cells as text; the names of their columns; the number (n,) of each row's
    line, from 0 on below the `begin` lines before and in the header; and what parts the cells."""

    table: pa.Table
    names: list[str]
    numbers: NDArray[np.int64]
    begin: int
    delimiter: str


def read_csv(path: Path, form: Format, account: Account) -> Rows:
    """The rows of a text table, which `account` counts.

    A row is a line. What has another number of cells than the header is omitted and counted; a quotation mark
    that is not closed in its line would make one cell of all that follows, so such a line is omitted too.
    Raises InputError for a table without rows, and if most do not fit the header.
    """
    data, _ = content(path, form.encoding)
    data = single_blanks(data) if form.delimiter == " " else data
    text = data.decode().replace("\r\n", "\n").replace("\r", "\n")
    lines = text.split("\n")
    delimiter, skipped = form.delimiter, form.skip_rows
    marked = re.fullmatch(r"sep=(.)", lines[0].strip().strip('"')) if not skipped else None
    if marked:  # as Excel writes it
        delimiter, skipped = delimiter or marked[1], 1
    if delimiter is None:
        counts = {mark: len(_names(lines, skipped, mark)[0]) for mark in DELIMITERS.strip()}
        delimiter = "," if counts[","] > 1 else max(counts, key=lambda mark: counts[mark])
    header, begin = _names(lines, skipped, delimiter)
    body = lines[begin:]
    if not any(map(str.strip, body)):
        raise InputError(f"{path} is empty: it has no rows below its header")
    count = _cells_in_a_row(header, body, delimiter)
    omitted: list[tuple[int, str, int]] = []  # row, reason, cells
    for k, line in enumerate(body) if '"' in text else ():
        if line.count('"') % 2:
            omitted.append((k, UNCLOSED, 0))
            body[k] = ""
        elif '"' in line:
            body[k] = _line(next(text_csv.reader([line], delimiter=delimiter)), delimiter)
    table, others = _parsed(body, count, delimiter)
    trailing = {k: c for k, c in others.items() if 0 < _filled(c) <= count and len(c) >= _filled(header)}
    if trailing:  # delimiters behind the last cell, in some rows only
        for k, cells in trailing.items():
            body[k] = _line([*cells, *[""] * count][:count], delimiter)
        table, others = _parsed(body, count, delimiter)
    omitted += [(k, RAGGED if _filled(cells) else BLANK, len(cells)) for k, cells in others.items()]
    filled = np.flatnonzero([bool(line) for line in body])
    account.total.read += table.num_rows + len(omitted)
    for row, reason, _ in sorted(omitted):
        account.total.set_aside(reason, f"line {begin + row + 1}")
    if len(omitted) > table.num_rows:
        row, _, width = min(omitted)
        raise _no_rows(path, _filled(header), width, begin + row + 1, account, delimiter)
    rows = filled[~np.isin(filled, [row for row, _, _ in omitted])]
    return Rows(table, (header + [""] * count)[:count], rows, begin, delimiter)


def _parsed(body: Sequence[str], count: int, delimiter: str) -> tuple[pa.Table, dict[int, list[str]]]:
    """The rows of so many cells, as text, and the cells of the others by their lines."""
    filled = np.flatnonzero([bool(line) for line in body])
    others: dict[int, list[str]] = {}

    def other(row: csv.InvalidRow) -> str:
        others[int(filled[row.number - 1])] = next(text_csv.reader([row.text], delimiter=delimiter), [])
        return "skip"

    columns = [str(k) for k in range(count)]
    convert = csv.ConvertOptions(
        column_types=dict.fromkeys(columns, pa.string()), strings_can_be_null=True, null_values=[""]
    )
    text = "\n".join(body).encode()
    read = csv.ReadOptions(column_names=columns, use_threads=False, block_size=min(len(text) + 1, 2**30))
    parse = csv.ParseOptions(delimiter=delimiter, invalid_row_handler=other)
    return csv.read_csv(pa.BufferReader(text), read, parse, convert), others


def _line(cells: Sequence[str], delimiter: str) -> str:
    return delimiter.join('"{}"'.format(cell.replace('"', '""')) for cell in cells)


def _names(lines: Sequence[str], skipped: int, delimiter: str) -> tuple[list[str], int]:
    """Names of the header, and the number of lines before and in it, whose cells may hold line breaks."""
    records = text_csv.reader((f"{line}\n" for line in lines[skipped:]), delimiter=delimiter)
    header = without_mark(next(filter(None, records), []))
    return [name.replace("\n", " ") for name in header], skipped + records.line_num


def _cells_in_a_row(header: list[str], body: Sequence[str], delimiter: str) -> int:
    """As many as most rows have, where those beyond the header are blank; at least those of the header."""
    some = text_csv.reader([line for line in body[:SAMPLED] if line.count('"') % 2 == 0], delimiter=delimiter)
    rows = [row for row in some if row]
    lengths = [len(row) for row in rows]
    usual = max(set(lengths), key=lengths.count) if lengths else len(header)
    if any(_filled(row) > len(header) for row in rows if len(row) == usual):
        return len(header)
    return max(usual, _filled(header))


def _no_rows(path: Path, count: int, cells: int, line: int, account: Account, mark: str) -> InputError:
    """The error that most rows do not fit the header."""
    cure = "set 'delimiter', or 'skip_rows' where the header comes later"
    read, left = account.total.read, account.total.left_out
    few = "none" if left == read else f"only {read - left}"
    if count > 2 and cells == count + 1:  # with two columns it is a decimal comma
        cure = f"a value with '{mark}' in it, such as 1,234 or 50.1,8.2, must be quoted, or {cure}"
    return InputError(
        f"{path} is no table as it is read: its header has {count} cell{'s' if count != 1 else ''}, and "
        f"{few} of the {read} rows below has as many; {cure} (first line {line} with {cells})"
    )


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
