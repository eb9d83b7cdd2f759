"""Detects the format of a text table from its beginning: encoding, delimiter, lines before the header."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from pathlib import Path

from deeptruck_core import reading
from deeptruck_core.errors import InputError
from deeptruck_core.formats import check_measurement
from deeptruck_model.recordings.tables.column import STATES
from deeptruck_model.recordings.tables.column import WITH_UNIT as OF_UNIT
from deeptruck_model.recordings.tables.csv_text import (
    DELIMITERS,
    Format,
    content,
    single_blanks,
    without_mark,
)
from deeptruck_model.recordings.tables.table_file import check_table, is_typed

LOOKED_AT = 1000  # lines in which header and delimiter are looked for
MOST_HEAD = 2**20  # characters of those lines
NUMBER = re.compile(r"[+-]?(\d+[.,]?\d*|[.,]\d+)([eE][+-]?\d+)?%?")
DATE = re.compile(r".*\d{1,4}[-./]\d{1,2}[-./]\d{1,4}.*|.*\d{1,2}:\d{2}.*|\d{4}-\d{2}-\d{2}T.*")
WITH_UNIT = re.compile(OF_UNIT)
BY_HAND = "write COLUMNS.yaml by hand (docs/recordings.md)"


def find_form(path: Path) -> Format:
    """The format of a text table. Raises InputError for a file that is missing, is no text, or has no header
    above rows of numbers."""
    check_table(path)
    if is_typed(path):
        return Format()
    check_measurement(path)
    try:
        data, encoding = content(path, None)
    except UnicodeError:
        raise InputError(f"{path} is no text table but binary; export it as CSV or Parquet") from None
    if not data.strip():
        raise InputError(f"{path} is empty")
    text = data.decode()
    lines = text[:MOST_HEAD].split("\n")[:LOOKED_AT]
    blanks = single_blanks("\n".join(lines).encode()).decode().split("\n")
    found = {mark: _header(blanks if mark == " " else lines, mark) for mark in DELIMITERS}
    best = max(found, key=lambda mark: (found[mark][1] > 0, mark != " ", *found[mark][:2]))
    columns, rows, header = found[best]
    if columns < 2:
        raise InputError(
            f"{path} is no table: none of its first {LOOKED_AT} lines has two cells of numbers or dates; "
            f"{BY_HAND}"
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
            written = next(csv.reader([line.rstrip("\r")], delimiter=delimiter), [])
        except csv.Error:
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
    header = _below_units(rows, as_wide) if as_wide else names.index(most) if names else 0
    return (cells, names[header], header) if names and names[header] >= least else (cells, 0, 0)


def _below_units(rows: Sequence[list[str]], as_wide: Sequence[int]) -> int:
    """Index of the header among lines as wide as the rows: the last, or the one before if the last holds
    units."""
    *others, last = as_wide
    if others and others[-1] >= last - 2 and any(_is_unit(cell) for cell in rows[last]):
        return others[-1]
    return last


def _is_unit(cell: str) -> bool:
    from deeptruck_model.recordings.tables.header_words import spelled

    return bool(spelled(cell))


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
    return bool(NUMBER.fullmatch(cell) or DATE.fullmatch(cell) or WITH_UNIT.match(cell)) or cell.lower() in (
        "nan",
        "inf",
        *STATES,
    )
