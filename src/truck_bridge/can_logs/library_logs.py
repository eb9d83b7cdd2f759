"""Reads the formats that python-can reads: ASC, BLF, MF4, TRC and its own CSV.

ASC and TRC are text without checksums: a changed digit is not detected.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Iterable, Iterator
from pathlib import Path

import can

from deeptruck_core.account import Account
from deeptruck_core.formats import suffix_of
from truck_bridge.can_logs.frames import COPY, Frame, of_message
from truck_bridge.can_logs.lines import Lines
from truck_bridge.errors import InputError

NO_FILE_SIZE = (0, 144)  # in the head of a BLF whose recorder was killed


def asc(path: Path, account: Account) -> Iterator[Frame]:
    """The frames of an ASC log, whose times may be relative to the line before. A request to transmit, to the
    controller, is no frame on the bus."""
    lines = Lines(
        path,
        account,
        r"\s*-?\d+\.\d+\s+(?!Start of)",
        omit=r".*\sTxRq\s",
        omitted="requests to transmit (TxRq)",
    )
    reader = can.ASCReader(lines)
    time = 0.0
    for frame in lines.frames(of_message(message, first_bus=0) for message in reader):
        if reader.timestamps_format == "relative":
            time += frame.time
            frame = frame._replace(time=time)
        yield frame


def trc(path: Path, account: Account) -> Iterator[Frame]:
    """The frames of PEAK's TRC; lines of status and errors are no frames."""
    lines = Lines(path, account, r"\s*\d")
    return lines.frames(map(of_message, can.TRCReader(lines)))


def blf(path: Path, account: Account) -> Iterator[Frame]:
    """The frames of a BLF log, whose containers have checksums; its head has none."""
    with can.BLFReader(path) as reader:
        size = path.stat().st_size
        if reader.file_size not in (*NO_FILE_SIZE, size):
            raise InputError(f"{path} has {size} bytes, but {reader.file_size} were written; {COPY}")
        yield from _counted(reader, account, first_bus=0)


def mf4(path: Path, account: Account) -> Iterator[Frame]:
    """The frames of an MF4 log."""
    need_asammdf(path)
    with can.MF4Reader(path) as reader:
        yield from _counted(reader, account)
    if not account.total.read:
        raise InputError(
            f"{path} holds no CAN frames; a measurement of signals is exported as CSV or Parquet"
        )


def rows(path: Path, account: Account) -> Iterator[Frame]:
    """The frames of python-can's own table, with bytes in base 64."""
    with can.CSVReader(path) as reader:
        yield from _counted(reader, account)


def _counted(messages: Iterable[can.Message], account: Account, first_bus: int = 1) -> Iterator[Frame]:
    for message in messages:
        account.total.read += 1
        yield of_message(message, first_bus)


def need_asammdf(path: Path) -> None:
    """Raises InputError for an MF4 log where the extra that reads and writes it is not installed."""
    if suffix_of(path) == ".mf4" and importlib.util.find_spec("asammdf") is None:
        raise InputError(f"{path}: MF4 logs need asammdf; install it with \"pip install 'deeptruck[mf4]'\"")
