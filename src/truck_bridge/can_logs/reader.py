"""Reads frames from a log: READERS has the reader of each suffix, most of them python-can's.

To add a format, write a function of a path and an Account that gives frames, a line in READERS, and its
suffix in FRAMES of `deeptruck_core.formats`, by which commands know a CAN log.

`every` gives all frames of a log, `read` the extended data frames of one bus, which J1939 uses. Both count
in an Account: a frame is used, or set aside for a stated reason. ASC, TRC and candump are text without
checksums: a changed digit is not detected.
"""

from __future__ import annotations

import gzip
import importlib.util
import shutil
import tempfile
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import can

from deeptruck_core.account import Account
from deeptruck_core.formats import (
    BAGS,
    FRAME_OF_CANDUMP,
    PACKED,
    PARQUET,
    TEXTS,
    Kind,
    head_of,
    holds_frames,
    kind_of,
    suffix_of,
)
from deeptruck_core.reading import plain, typed, why
from truck_bridge.can_logs import candump, rosbag, row_logs
from truck_bridge.can_logs.frames import COPY, Frame, of_message
from truck_bridge.can_logs.frames import Kind as FrameKind
from truck_bridge.can_logs.lines import ForLibrary
from truck_bridge.can_logs.pieces import in_pieces
from truck_bridge.errors import InputError

KINDS = (
    "candump text (.log), ASC, BLF, TRC, MF4, a CSV table of raw frames, or a rosbag with them "
    "(python-can and Wireshark convert others to these)"
)
STANDARD = "frames with 11-bit identifiers"
SHORT = "frames with fewer bytes than their length says"
LATEST_S = 1e12
TABLES_OF_FRAMES = (".csv", ".tsv")
NO_FILE_SIZE = (0, 144)  # in the head of a BLF whose recorder was killed


def read(
    path: Path, account: Account | None = None, *, channel: str | None = None, ascending: bool = False
) -> Iterator[Frame]:
    """The extended data frames of one bus, in the log's order, except those with wrong stamps.

    `account` is filled during iteration. `channel` names the bus if the log has several. With `ascending`,
    sessions whose clock restarts are placed one after another (see `pieces`). Raises InputError if the file
    is missing, of an unknown kind, damaged, holds no such frame, or holds several buses and none is chosen.
    """
    account = Account(str(path), "frames") if account is None else account
    count = 0
    for frame in in_pieces(_of_bus(path, account, channel), account, ascending=ascending):
        count += 1
        account.total.used += 1
        yield frame
    if not count:
        of = f" on {channel}" if channel is not None else ""
        raise InputError(f"{path} holds no extended CAN frame{of}; J1939 has nothing else{_listed(account)}")


def every(path: Path, account: Account) -> Iterator[Frame]:
    """All frames of a log, of every class and bus; `account` counts them as read, and buses as sources.

    Raises InputError as `read` does, except for missing frames or several buses.
    """
    if path.suffix.lower() == PACKED and path.is_file():
        with tempfile.TemporaryDirectory(prefix="deeptruck-log-") as folder:
            yield from _counted(path, _unpacked(path, Path(folder)), account)
    else:
        yield from _counted(path, path, account)


def by_library(path: Path, account: Account, **options: Any) -> Iterator[Frame]:
    """The frames of a log that python-can reads."""
    with can.LogReader(path, **options) as reader:
        for message in reader:
            account.total.read += 1
            yield of_message(message, str(message.channel or 1))


def asc(path: Path, account: Account) -> Iterator[Frame]:
    """The frames of an ASC log, whose times may be relative to the line before. A request to transmit, to the
    controller, is no frame on the bus."""
    lines = ForLibrary(
        path,
        account,
        r"\s*-?\d+\.\d+\s+(?!Start of)",
        omit=r"\sTxRq\s",
        omitted="requests to transmit (TxRq)",
    )
    reader = can.ASCReader(lines)
    time = 0.0
    for frame in lines.frames(reader, first_bus=0):
        if reader.timestamps_format == "relative":
            time += frame.time
            frame = frame._replace(time=time)
        yield frame


def trc(path: Path, account: Account) -> Iterator[Frame]:
    """The frames of PEAK's TRC; lines of status and errors are no frames."""
    lines = ForLibrary(path, account, r"\s*\d")
    yield from lines.frames(can.TRCReader(lines), first_bus=1)


def blf(path: Path, account: Account) -> Iterator[Frame]:
    """The frames of a BLF log, whose containers have checksums; its head has none."""
    with can.BLFReader(path) as reader:
        size = path.stat().st_size
        if reader.file_size not in (*NO_FILE_SIZE, size):
            raise InputError(f"{path} has {size} bytes, but {reader.file_size} were written; {COPY}")
        for message in reader:
            account.total.read += 1
            yield of_message(message, str(message.channel + 1 if isinstance(message.channel, int) else 1))


def mf4(path: Path, account: Account) -> Iterator[Frame]:
    """The frames of an MF4 log."""
    need_asammdf(path)
    yield from by_library(path, account)
    if not account.total.read:
        raise InputError(
            f"{path} holds no CAN frames; a measurement of signals is exported as CSV or Parquet"
        )


def need_asammdf(path: Path) -> None:
    """Raises InputError for an MF4 log where the extra that reads and writes it is not installed."""
    if suffix_of(path) == ".mf4" and importlib.util.find_spec("asammdf") is None:
        raise InputError(f"{path}: MF4 logs need asammdf; install it with \"pip install 'deeptruck[mf4]'\"")


def text(path: Path, account: Account) -> Iterator[Frame]:
    """The frames of a text: a table of them, or candump's."""
    head = head_of(path)
    if head.startswith("timestamp,arbitration_id,"):  # python-can's own, with bytes in base 64
        return by_library(path, account)
    if suffix_of(path) in TABLES_OF_FRAMES or (not FRAME_OF_CANDUMP.search(head) and holds_frames(head)):
        return row_logs.frames(path, account)
    return candump.frames(path, account)


READERS: dict[str, Callable[[Path, Account], Iterator[Frame]]] = {
    ".asc": asc,
    ".blf": blf,
    ".candump": candump.frames,
    ".mf4": mf4,
    ".trc": trc,
    **dict.fromkeys(TEXTS, text),
    **dict.fromkeys(BAGS, rosbag.frames),
}


def _reader(path: Path) -> Callable[[Path, Account], Iterator[Frame]]:
    """The reader of a log. Raises InputError if there is nothing to read, or nothing that is read here."""
    if not path.exists():
        raise InputError(f"{path} does not exist; give a CAN log: {KINDS}")
    if path.is_dir():
        if kind_of(path) is not Kind.BAG:
            raise InputError(f"{path} is a folder without a rosbag; give a CAN log: {KINDS}")
        return rosbag.frames
    if not path.is_file():
        raise InputError(f"{path} is a pipe or device, not a file; give a CAN log that was recorded")
    reader = READERS.get(suffix_of(path))
    if suffix_of(path) in (*TABLES_OF_FRAMES, *PARQUET) and kind_of(path) is Kind.TABLE:
        raise InputError(
            f"{path} is a table, not a CAN log: 'deeptruck-model import {typed(path)} --columns COLUMNS.yaml "
            f"--out BAG' reads tables of signals; give a CAN log here: {KINDS}"
        )
    if reader is None:
        raise InputError(f"{path} is no CAN log that can be read here: {KINDS}")
    return reader


def _unpacked(path: Path, folder: Path) -> Path:
    """The log of a file that is compressed by gzip."""
    try:
        with gzip.open(path) as packed, (folder / path.stem).open("wb") as file:
            shutil.copyfileobj(packed, file, 1 << 20)
    except (OSError, EOFError, zlib.error) as error:
        raise InputError(f"{path} cannot be unpacked ({plain(str(error))}); {COPY}") from None
    return folder / path.stem


def _counted(path: Path, file: Path, account: Account) -> Iterator[Frame]:
    """The whole frames of a file, counted by bus. What a reader cannot read is one line about `path`."""
    try:
        for frame in _reader(file)(file, account):
            if not -LATEST_S <= frame.time < LATEST_S:
                raise InputError(f"{path} is damaged: a frame has the time {frame.time:g} s; {COPY}")
            if frame.is_short:
                account.total.set_aside(SHORT, f"at {frame.time:.3f} s")
                continue
            account.sources[frame.channel] = account.sources.get(frame.channel, 0) + 1
            yield frame
    except InputError as error:
        raise InputError(str(error).replace(str(file), str(path))) from None
    except Exception as error:  # each of python-can's readers fails in its own way on a damaged file
        raise InputError(f"{path} cannot be read as a CAN log ({why(error)}); known are {KINDS}") from None


def _of_bus(path: Path, account: Account, channel: str | None) -> Iterator[Frame]:
    chosen, set_aside = channel, account.total.set_aside
    number = 0
    frames = every(path, account)
    for frame in frames:
        number += 1
        if frame.kind is not FrameKind.DATA or not frame.extended:
            set_aside(STANDARD if frame.kind is FrameKind.DATA else frame.kind.value, f"frame {number}")
            continue
        if chosen is None:
            chosen = frame.channel
        if frame.channel == chosen:
            yield frame
        elif channel is not None:
            set_aside("frames of other buses", f"frame {number} on {frame.channel}")
        else:
            for _ in frames:
                pass  # to count them all
            raise InputError(
                f"{path} holds several buses{_listed(account)}, which may not be one truck's; choose one "
                "with --channel NAME (import: 'channel: NAME' in the columns file; "
                "replay: --log-channel NAME)"
            )


def _listed(account: Account) -> str:
    """The buses of a log with their frames."""
    buses = ", ".join(f"{name} with {count} frames" for name, count in account.sources.items())
    return f" ({buses})" if buses else ""
