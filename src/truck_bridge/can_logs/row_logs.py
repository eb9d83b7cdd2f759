"""Reads frames from tables: those of cabana, Kvaser, SavvyCAN, CLX000 loggers, Vehicle Spy, tshark, and any
other with a time, an identifier (or the PGN and source address of J1939) and bytes.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from can.util import dlc2len

from deeptruck_core.account import Account
from deeptruck_core.constants import DAY_S
from deeptruck_core.frame_rows import FrameColumns, FrameTable
from truck_bridge.can_logs.frames import EXTENDED_MASK, Frame, Kind, of_raw
from truck_bridge.can_logs.lines import Lines
from truck_bridge.errors import InputError
from truck_bridge.j1939.ids import GLOBAL, Identifier

_PACKED = re.compile(r"(\d\d)T(\d\d):?(\d\d):?(\d\d)\.?(\d*)")
_OF_DAY = re.compile(r"(?:.*[T ])?(\d{1,2}):(\d{2}):(\d{2})(?:[.,:](\d+))?Z?")
_FILLED = r"[\s\",;|]*[^\s\",;|]"  # a row with anything in its cells
_SAMPLED = 200  # rows by which the form of numbers is found
_MICROSECONDS = 50.0  # between rows with whole numbers: more are no seconds
_MARKS = str.maketrans(",;:|_-", 6 * " ", "[]()'\"")  # between bytes, and around them
_YES = ("1", "true", "t", "yes", "y")
_EXTENDED = ("x", "xr", "ext", "extended", "eff", "29", *_YES)


def frames(path: Path, account: Account, table: FrameTable, head: str) -> Iterator[Frame]:
    """The frames of a table, of which `head` is the beginning. Raises InputError for one that lacks times,
    identifiers or bytes."""
    columns = table.columns
    if columns is None:
        raise InputError(
            f"{path} is a table of CAN frames without a column of {table.lacks}: export it with times, "
            "identifiers and bytes, or give the log that it was made from"
        )
    first = head.splitlines()[table.above + 1 :][:_SAMPLED]
    form = _Form.of(table, columns, [*csv.reader(first, delimiter=table.delimiter)])
    if form.tick < 0.0:
        account.remarks.append("times are negative and fall: they are read without their sign")
    lines = Lines(path, account, _FILLED, head=table.above + 1)
    return lines.frames(_parsed(csv.reader(lines, delimiter=table.delimiter), form))


def _parsed(rows: Iterable[list[str]], form: _Form) -> Iterator[Frame]:
    """The frames of those rows that are whole; where times of day pass midnight, the next day begins."""
    day = before = 0.0
    for row in rows:
        try:
            frame = _of_row(row, form)
        except (ValueError, IndexError):
            continue
        if form.of_day and frame.time + day < before - DAY_S / 2:
            day += DAY_S
        before = frame.time + day
        yield frame._replace(time=before) if day else frame


@dataclass(frozen=True)
class _Form:
    """The columns and the format of their numbers; `tick` is negative for unsigned times that were written as
    signed (SavvyCAN: negative and falling)."""

    columns: FrameColumns
    tick: float
    base: int
    each_base: int
    of_day: bool

    @classmethod
    def of(cls, found: FrameTable, columns: FrameColumns, some: Sequence[Sequence[str]]) -> _Form:
        def cells(column: int) -> list[str]:
            return [row[column].strip() for row in some if len(row) > column]

        stamps = [cell for cell in cells(columns.time) if cell]
        whole = all(cell.removeprefix("-").isdigit() for cell in stamps)
        numbers = [float(cell) for cell in stamps if re.fullmatch(r"-?\d+\.?\d*", cell)]
        turned = bool(numbers) and max(numbers) < 0.0 and numbers[-1] < numbers[0]
        steps = [abs(b - a) for a, b in pairwise(numbers) if (b < a if turned else b > a)]
        micro = whole and bool(steps) and sorted(steps)[len(steps) // 2] > _MICROSECONDS
        content = [cell for k in columns.each or [columns.data or 0] for cell in cells(k)]
        return cls(
            columns,
            (found.tick_s or (1e-6 if micro else 1.0)) * (-1.0 if turned else 1.0),
            found.base or _base(cells(columns.number)),
            _base([byte for cell in content for byte in cell.split()]),
            bool(stamps) and bool(_OF_DAY.fullmatch(stamps[0])),
        )


def _base(cells: Sequence[str]) -> int:
    """16 if a letter or a leading zero shows it, else 10."""
    hexadecimal = any(re.search(r"[a-fA-F]|^0x|^0\d|[hH]$", cell.rstrip("xX")) for cell in cells)
    return 16 if hexadecimal else 10


def _time(cell: str, tick: float) -> float:
    """The time of a row in s: a number of ticks, a time of day, or one behind the day of the month, as
    01T102030123."""
    if packed := _PACKED.fullmatch(cell):
        day, hours, minutes, seconds, fraction = packed.groups()
    elif packed := _OF_DAY.fullmatch(cell):
        day, (hours, minutes, seconds, fraction) = "0", packed.groups()
    else:
        return float(cell.replace(",", ".")) * tick
    of_day = 3600.0 * int(hours) + 60.0 * int(minutes) + int(seconds) + float(f"0.{fraction or 0}")
    return DAY_S * int(day) + of_day


def _of_row(cells: list[str], form: _Form) -> Frame:
    """One frame. Raises ValueError or IndexError for a damaged row."""
    columns = form.columns

    def said(what: str) -> str:
        column = columns.others.get(what)
        return cells[column].strip().lower() if column is not None and len(cells) > column else ""

    def number(text: str, otherwise: int | None = None) -> int:
        if not text and otherwise is not None:
            return otherwise
        digits = text.replace(" ", "").removeprefix("0x").removeprefix("$")
        return int(digits.removesuffix("x").removesuffix("h"), form.base)

    time = _time(cells[columns.time].strip(), form.tick)
    extended = said("extended") in _EXTENDED
    can_id = number(cells[columns.number].strip().lower())
    if columns.source is not None:
        source = number(cells[columns.source].strip().lower())
        destination, priority = number(said("destination"), GLOBAL), number(said("priority"), 6)
        can_id, extended = _of_group(can_id, source, destination, priority), True
    data = _bytes(cells, form)
    remote = said("remote") in _YES
    if (length := said("length")) and not remote:
        stated = int(length)
        data = data[:stated] if columns.each else data
        if len(data) not in (stated, dlc2len(min(stated, 15))):
            raise ValueError("another number of bytes than the length says")
    frame = of_raw(time, can_id, data, said("bus"), extended=extended)
    if remote or said("error") in _YES:
        return frame._replace(kind=Kind.REMOTE if remote else Kind.ERROR)
    if frame.kind is Kind.DATA and (said("fd") in _YES or len(data) > 8):
        return frame._replace(kind=Kind.FD)
    return frame


def _of_group(group: int, source: int, destination: int, priority: int) -> int:
    """The identifier of a PGN and addresses."""
    parts = Identifier(priority, group, destination, source)
    if not (0 <= parts.priority <= 7 and 0 <= parts.pgn <= 0x3FFFF):
        raise ValueError("a priority or PGN that cannot be")
    if max(parts.destination, parts.source) > 0xFF:
        raise ValueError("an address that cannot be")
    return parts.can_id & EXTENDED_MASK


def _bytes(cells: list[str], form: _Form) -> bytes:
    """The bytes of a row, each in its column or all in one, in hexadecimal or decimal."""
    columns = form.columns
    if columns.data is None:
        written = (cells[k].strip() for k in columns.each if len(cells) > k)
        return bytes(int(byte.removeprefix("0x"), form.each_base) for byte in written if byte)
    text = cells[columns.data].strip().removeprefix("b'").replace("0x", "").translate(_MARKS)
    if form.each_base == 10 and " " in text.strip():
        return bytes(map(int, text.split()))
    return bytes.fromhex(text)
