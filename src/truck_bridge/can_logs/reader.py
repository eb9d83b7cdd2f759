"""Reads frames from a log: READERS has the reader of each suffix, most of them python-can's.

To add a format, write a function of a path and an Account that gives frames, a line in READERS, and its
suffix in FRAMES of `deeptruck_core.formats`, by which commands know a CAN log.

`every` gives all frames of a log, `read` the extended data frames of one bus, which J1939 uses. Both count
in an Account: a frame is used, or set aside for a stated reason.
"""

from __future__ import annotations

import gzip
import io
import shutil
import tempfile
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path

from deeptruck_core import frame_rows
from deeptruck_core.account import Account
from deeptruck_core.formats import BAGS, FRAME_OF_CANDUMP, PACKED, PARQUET, TEXTS, head_of, suffix_of
from deeptruck_core.reading import check_file, plain, typed, why
from truck_bridge.can_logs import candump, library_logs, rosbag, row_logs
from truck_bridge.can_logs.frames import COPY, Frame, Kind
from truck_bridge.can_logs.lines import NO_FRAME
from truck_bridge.can_logs.pieces import in_pieces
from truck_bridge.errors import InputError

KINDS = (
    "candump text (.log), ASC, BLF, TRC, MF4, a CSV table of raw frames, or a rosbag with them "
    "(python-can and Wireshark convert others to these)"
)
STANDARD = "frames with 11-bit identifiers"
SHORT = "frames with fewer bytes than their length says"
OTHER_BUSES = "frames of other buses"
LATEST_S = 1e12
TABLES = (".csv", ".tsv", *PARQUET)


def read(
    path: Path, account: Account | None = None, *, channel: str | None = None, ascending: bool = False
) -> Iterator[Frame]:
    """The extended data frames of one bus, in the log's order, except those with wrong stamps.

    `account` is filled during iteration. `channel` names the bus if the log has several. With `ascending`,
    sessions whose clock restarts are placed one after another (see `pieces`). Raises InputError if the file
    is missing, of an unknown kind, damaged, holds no such frame, or holds several buses and none is chosen.
    """
    account = Account(str(path), "frames") if account is None else account
    for frame in in_pieces(_of_bus(path, account, channel), account, ascending=ascending):
        account.total.used += 1
        yield frame
    check_used(path, account, "extended CAN frame, and J1939 has nothing else", channel)


def check_used(path: Path, account: Account, what: str, channel: str | None) -> None:
    """Raises InputError if no frame of a log was used, with what it holds instead."""
    if account.total.used:
        return
    said = "; ".join(line.strip() for line in account.total.lines(account.items))
    no_frame = NO_FRAME in account.total.aside and suffix_of(path) not in TABLES
    cure = "; a frame needs a time (candump -t a or -l writes it)" if no_frame else ""
    on = f" on {channel}" if channel is not None else ""
    raise InputError(f"{path} holds no {what}{on}: {said}{_buses(account)}{cure}")


def every(path: Path, account: Account) -> Iterator[Frame]:
    """All frames of a log, of every class and bus; `account` counts them as read, and buses as sources.

    Raises InputError as `read` does, except for missing frames or several buses.
    """
    if not path.is_dir():
        check_file(path, f"give a CAN log: {KINDS}")
    if path.suffix.lower() != PACKED or path.is_dir():
        yield from _whole(path, path, account)
        return
    with tempfile.TemporaryDirectory(prefix="deeptruck-log-") as folder:
        yield from _whole(path, _unpacked(path, Path(folder)), account)


def _text(path: Path, account: Account) -> Iterator[Frame]:
    """The frames of a text: a table of them, or candump's."""
    head = head_of(path)
    if head.startswith("timestamp,arbitration_id,"):
        return library_logs.rows(path, account)
    if not FRAME_OF_CANDUMP.search(head):
        table = frame_rows.find(io.StringIO(head))
        if table is not None:
            return row_logs.frames(path, account, table, head)
        if suffix_of(path) in TABLES:
            return _table(path, account)
    return candump.frames(path, account)


def _table(path: Path, account: Account) -> Iterator[Frame]:
    raise InputError(
        f"{path} is a table, not a CAN log: 'deeptruck-model import {typed(path)} --columns COLUMNS.yaml "
        f"--out BAG' reads tables of signals; give a CAN log here: {KINDS}"
    )


READERS: dict[str, Callable[[Path, Account], Iterator[Frame]]] = {
    ".asc": library_logs.asc,
    ".blf": library_logs.blf,
    ".candump": candump.frames,
    ".mf4": library_logs.mf4,
    ".trc": library_logs.trc,
    **dict.fromkeys(PARQUET, _table),
    **dict.fromkeys(TEXTS, _text),
    **dict.fromkeys(BAGS, rosbag.frames),
}


def _unpacked(path: Path, folder: Path) -> Path:
    """The log of a file that is compressed by gzip."""
    try:
        with gzip.open(path) as packed, (folder / path.stem).open("wb") as file:
            shutil.copyfileobj(packed, file, 1 << 20)
    except (OSError, EOFError, zlib.error) as error:
        raise InputError(f"{path} cannot be unpacked ({plain(str(error))}); {COPY}") from None
    return folder / path.stem


def _whole(path: Path, file: Path, account: Account) -> Iterator[Frame]:
    """The whole frames of a file, counted by bus. What a reader cannot read is one line about `path`."""
    reader = rosbag.frames if file.is_dir() else READERS.get(suffix_of(file))
    if reader is None:
        raise InputError(f"{path} is no CAN log that can be read here: {KINDS}")
    try:
        for frame in reader(file, account):
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
    """The extended data frames of one bus; what others there are is counted."""
    chosen, set_aside = channel, account.total.set_aside
    frames = every(path, account)
    for number, frame in enumerate(frames, 1):
        if frame.kind is not Kind.DATA or not frame.extended:
            set_aside(STANDARD if frame.kind is Kind.DATA else frame.kind.value, f"frame {number}")
            continue
        if chosen is None:
            chosen = frame.channel
        if frame.channel == chosen:
            yield frame
        elif channel is not None:
            set_aside(OTHER_BUSES, f"frame {number} on {frame.channel}")
        else:
            for _ in frames:
                pass  # to count them all
            raise InputError(
                f"{path} holds several buses{_buses(account)}, which may not be one truck's; choose one "
                "with --channel NAME (import: 'channel: NAME' in the columns file; "
                "replay: --log-channel NAME)"
            )


def _buses(account: Account) -> str:
    """The buses of a log with their frames."""
    buses = ", ".join(f"{name} with {count} frames" for name, count in account.sources.items())
    return f" ({buses})" if buses else ""
