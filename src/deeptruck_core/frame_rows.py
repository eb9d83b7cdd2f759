"""Which columns of a table are those of CAN frames: a time, an identifier and bytes.

Standard library only, because bridge and importer use it before anything heavy is loaded.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice

DELIMITERS = ",;\t|"
MOST_ABOVE = 256  # lines of text above the header of a table of frames
LOOKED_AT = 5  # rows by which a table without a header is recognised
LEAST_BYTES = 8  # columns of single bytes that show frames

_TIME = re.compile(r"t|ts|epoch|.*time.*|zeit.*")
_UNIT = re.compile(r"[(\[_ ]?(?<![a-z])(ns|us|µs|ms|s|sec|seconds)[)\]]?$")
TICKS_S = {"ns": 1e-9, "us": 1e-6, "µs": 1e-6, "ms": 1e-3, "s": 1.0, "sec": 1.0, "seconds": 1.0}
_RELATIVE = re.compile(r".*(rel|delta|diff|gap|since|cycle).*")
_ID = re.compile(
    r"(can|arb|arbitration|msg|message|frame|packet|raw|j1939)*(id|identifier|addr|address)(hex|dec|canid)?"
)
_DATA = re.compile(r"(can|msg|message|frame|raw)*(data|daten|payload|bytes)+(field|hex|dec|bytes|raw|data)*")
_BYTE = re.compile(r"(?:data|d|b|byte|databyte)_?(\d{1,2})")
_SOURCE = ("sa", "src", "source", "sourceaddress")  # with which a PGN stands for the identifier
_OTHERS = {
    "destination": ("da", "dst", "destination", "destinationaddress"),
    "priority": ("priority", "prio", "p"),
    "bus": ("bus", "buschannel", "channel", "chn", "network", "interface"),
    "extended": ("extended", "ide", "ext", "xtd", "flags", "flagsxtd", "canflagsxtd", "idtype"),
    "length": ("datalength", "length", "len", "dlc", "canlen", "size", "databytelength"),
    "fd": ("edl", "fdf", "fd"),
    "remote": ("remote", "rtr", "canflagsrtr"),
    "error": ("er", "err", "error", "errorframe", "canflagserr"),
}


@dataclass(frozen=True)
class FrameColumns:
    """Columns by what they hold. `number` is that of the identifier, or of the PGN where there is a `source`;
    bytes are in one column, `data`, or `each` in its own."""

    time: int
    number: int
    data: int | None
    each: tuple[int, ...]
    source: int | None = None
    others: Mapping[str, int] = field(default_factory=dict, compare=False)  # by the keys of _OTHERS


@dataclass(frozen=True)
class FrameTable:
    """A table of frames: the number of lines above its header, its delimiter and its columns. `lacks` is what
    it has not, such as 'times'; '' if it has all."""

    above: int
    delimiter: str
    columns: FrameColumns | None
    lacks: str = ""
    tick_s: float | None = None  # the unit of its times, if the header states it
    base: int | None = None  # of its identifiers, if the header states it


def plain_name(cell: str) -> str:
    """A header cell in lower case, reduced to letters and digits and without its unit."""
    return re.sub(r"[^a-z0-9]", "", re.sub(r"[(\[].*?[)\]]", "", cell.lower()))


def find(lines: Iterable[str]) -> FrameTable | None:
    """The header of a table of frames among the first lines of a text; None for any other text.

    A header that has bytes in columns of their own, but no time or no identifier, is one that lacks it.
    """
    lacking = None
    lines = list(islice(lines, MOST_ABOVE))
    for above, line in enumerate(lines):
        for mark in DELIMITERS:
            if mark not in line:
                continue
            try:
                cells = next(csv.reader([line.strip().lstrip("#")], delimiter=mark), [])
            except csv.Error:
                continue
            columns, lacks = _columns([plain_name(cell) for cell in cells])
            if columns is not None:
                unit = _UNIT.search(cells[columns.time].strip().lower())
                number = cells[columns.number].lower()
                base = 16 if "hex" in number else 10 if "dec" in number else None
                return FrameTable(above, mark, columns, "", TICKS_S[unit[1]] if unit else None, base)
            lacking = lacking or (FrameTable(above, mark, None, lacks) if lacks else None)
    return lacking or _without_header(lines)


def _without_header(lines: Sequence[str]) -> FrameTable | None:
    """A table that begins with rows of frames: a time, an identifier of 8 digits and 8 bytes."""
    for mark in DELIMITERS:
        if not lines:
            return None
        rows = [[cell.strip() for cell in line.split(mark)] for line in lines[:LOOKED_AT]]
        found = {_columns_of_row(row) for row in rows}
        columns = found.pop()
        if not found and columns is not None:
            return FrameTable(-1, mark, columns)
    return None


def _columns_of_row(row: Sequence[str]) -> FrameColumns | None:
    time = next((k for k, cell in enumerate(row) if re.fullmatch(r"\d+\.\d+", cell)), None)
    number = next(
        (k for k, cell in enumerate(row) if re.fullmatch(r"(0x)?[0-9A-Fa-f]{7,8}[xh]?", cell)), None
    )
    data = next((k for k, cell in enumerate(row) if re.fullmatch(r"([0-9A-Fa-f]{2} ?){8}", cell)), None)
    each = tuple(k for k, cell in enumerate(row) if re.fullmatch(r"[0-9A-Fa-f]{2}", cell))[-8:]
    if time is None or number is None or (data is None and len(each) < LEAST_BYTES):
        return None
    return FrameColumns(time, number, data, () if data is not None else each)


def _columns(names: Sequence[str]) -> tuple[FrameColumns | None, str]:
    """The columns of frames, and what they lack if they are."""
    times = [k for k, name in enumerate(names) if _TIME.fullmatch(name)]
    times.sort(key=lambda k: bool(_RELATIVE.match(names[k])))
    each = tuple(k for k, name in enumerate(names) if _BYTE.fullmatch(name))
    data = next((k for k, name in enumerate(names) if _DATA.fullmatch(name)), None)
    source = next((names.index(one) for one in _SOURCE if one in names), None)
    ids = [k for k, name in enumerate(names) if _ID.fullmatch(name)]
    if not ids and "pgn" in names and source is not None:
        ids = [names.index("pgn")]
    else:
        source = None
    has_bytes = data is not None or len(each) >= 2
    if times and ids and has_bytes:
        used = {times[0], ids[0], data}
        others = {
            what: names.index(one)
            for what, known in _OTHERS.items()
            for one in known[::-1]  # the first of them stays
            if one in names and names.index(one) not in used
        }
        return FrameColumns(times[0], ids[0], None if len(each) >= 2 else data, each, source, others), ""
    if {"protocol", "info"} <= {*names}:  # a list of packets, as Wireshark exports it
        return None, "identifiers and bytes"
    if times and ids and not has_bytes and "dlc" in names:
        return None, "bytes"
    if len(each) < LEAST_BYTES or not (times or ids):
        return None, ""
    return None, "identifiers" if not ids else "times"
