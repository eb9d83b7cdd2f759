"""The text of a CSV file: its header, its delimiter, and which lines are rows.

pyarrow parses the rows. Errors that it would not report are found here: unclosed quotation marks, rows with a
wrong number of cells, and the line of each row.
"""

from __future__ import annotations

import codecs
import csv as text_csv
import gzip
import io
import re
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from itertools import islice
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray
from pyarrow import csv

from deeptruck_model._io import reading
from deeptruck_model._io.account import Account
from deeptruck_model.errors import InputError

DELIMITERS = ",;\t| "  # one of these is found by the header where none is given; blanks may be several
BYTE_ORDER_MARKS = {codecs.BOM_UTF8: "utf-8", codecs.BOM_UTF16_LE: "utf-16", codecs.BOM_UTF16_BE: "utf-16"}
SAMPLED = 100  # rows by which the number of cells of a row is found
RAGGED = "with more or fewer cells than the header"
UNCLOSED = "inside a quotation mark that is not closed in its line"
BLANK = "without a filled cell"


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


class CsvText:
    """A text table: its header, and the rows with the same number of cells."""

    def __init__(self, path: Path, form: Format, account: Account) -> None:
        self.path, self.account = path, account
        self.data, _ = content(path, form.encoding)
        if form.delimiter == " ":
            self.data = single_blanks(self.data)
        delimiter, self.skip_rows = form.delimiter, form.skip_rows
        first = self.data[:200].split(b"\n")[0].decode("utf-8", "replace").strip().strip('"')
        if self.skip_rows == 0 and re.fullmatch(r"sep=.", first):  # as Excel writes it
            delimiter, self.skip_rows = delimiter or first[-1], 1
        self.delimiter = delimiter or self._found_delimiter()
        self.header, self.lines, self.start = self._header(self.delimiter)

    def _records(self, start: int, delimiter: str) -> Iterator[tuple[int, list[str]]]:
        """Records from a byte position on that are not blank, each with the number of its first line from
        there, from 0."""
        text = io.TextIOWrapper(io.BytesIO(memoryview(self.data)[start:]), "utf-8", newline="")
        records = text_csv.reader(text, delimiter=delimiter)
        line = 0
        for record in records:
            if record:
                yield line, record
            line = records.line_num

    def _found_delimiter(self) -> str:
        counts = {mark: len(self._header(mark)[0]) for mark in DELIMITERS.strip()}
        return "," if counts[","] > 1 else max(counts, key=lambda mark: counts[mark])

    def _header(self, delimiter: str) -> tuple[list[str], int, int]:
        """Names, the number of lines before and in the header, and the byte position after it."""
        start = 0
        for _ in range(self.skip_rows):
            start = self.data.find(b"\n", start) + 1 or len(self.data)
        text = io.TextIOWrapper(io.BytesIO(self.data[start:]), "utf-8", newline="")
        taken: list[str] = []

        def lines() -> Iterator[str]:
            for line in text:
                taken.append(line)
                yield line

        header = without_mark(next(filter(None, text_csv.reader(lines(), delimiter=delimiter)), []))
        return header, self.skip_rows + len(taken), start + sum(len(line.encode()) for line in taken)

    def read(self, cure: str) -> tuple[pa.Table, list[str], NDArray[np.int64], Callable[[int], str]]:
        """The rows, the names of their columns, their numbers in the file, and a function from these to
        lines."""
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
        """The text below the header, with each line that has an unclosed quotation mark replaced by a blank
        one.

        Otherwise all rows up to the next quotation mark would become one cell.
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
        """The rows in which no cell continues on the next line."""
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
        """The header with as many cells as most rows have; additional cells are blank."""
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
        """Among rows with a wrong number of cells, those that differ only in blank cells at the end."""
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
        """Raises InputError for a table in which most rows do not fit the header."""
        count, read = _filled(self.header), self.account.total.read
        left = self.account.total.left_out
        few = "none" if left == read else f"only {read - left}"
        first = next(iter(self.account.total.aside.values())).first
        if count > 2 and odd.actual_columns == count + 1:  # with two columns it is a decimal comma
            cure = (
                f"a value with '{self.delimiter}' in it, such as 1,234 or 50.1,8.2, must be quoted, or {cure}"
            )
        raise InputError(
            f"{self.path} is no table as it is read: its header has {count} cell{'s' if count != 1 else ''}, "
            f"and {few} of the {read} rows below has as many; {cure} "
            f"(first {first} with {odd.actual_columns})"
        )

    def _places(self, body: bytes) -> Callable[[int], str]:
        """A function that returns the line in the file of the k-th row below the header, as 'line N'.

        Rows are lines, unless lines are blank or quoted cells may span lines; then the records are read.
        """
        first = self.lines + 1
        uneven = (b'"', b"\n\n", b"\n\r", b"\r\r")
        if not body.startswith((b"\n", b"\r")) and not any(mark in body for mark in uneven):
            return lambda row: f"line {first + row}"

        @cache
        def lines() -> list[int]:
            return [line for line, _ in self._records(self.start, self.delimiter)]

        return lambda row: f"line {first + (lines()[row] if row < len(lines()) else row)}"


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
