"""Reads frames from a log, by the reader that its format names in `deeptruck_core.formats`.

`every` gives all frames of a log, `read` the extended data frames of one bus, which J1939 uses. Both count in
an Account: a frame is used, or omitted for a stated reason.
"""

from __future__ import annotations

import gzip
import importlib
import tempfile
import zlib
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import can

from deeptruck_core.account import Account
from deeptruck_core.formats import FORMATS, KINDS, PACKED, format_of
from deeptruck_core.reading import plain, why
from truck_bridge import log_files
from truck_bridge.can_logs import text_logs
from truck_bridge.can_logs.frames import Frame, Kind, of_message
from truck_bridge.can_logs.pieces import in_pieces
from truck_bridge.can_logs.whole import COPY, check_blf, check_file
from truck_bridge.errors import InputError

_LATEST_S = 1e12
STANDARD = "frames with 11-bit identifiers"


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
    log_files.check(path)
    check_file(path)
    with ExitStack() as stack:
        file = _unpacked(path, stack)
        for frame in _of_file(path, file, account):
            account.sources[frame.channel] = account.sources.get(frame.channel, 0) + 1
            yield frame


def _of_bus(path: Path, account: Account, channel: str | None) -> Iterator[Frame]:
    chosen, set_aside = channel, account.total.set_aside
    number = 0
    frames = every(path, account)
    for frame in frames:
        number += 1
        if frame.kind is not Kind.DATA or not frame.extended:
            set_aside(STANDARD if frame.kind is Kind.DATA else frame.kind.value, f"frame {number}")
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


def _unpacked(path: Path, stack: ExitStack) -> Path:
    """The log, decompressed to a temporary file if it is compressed by gzip."""
    if path.suffix.lower() != PACKED:
        return path
    folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="deeptruck-log-")))
    try:
        with gzip.open(path) as packed, (folder / path.stem).open("wb") as file:
            form = format_of(path)
            is_text = form is None or form.text
            begun = 0  # bytes of a line so far
            while chunk := packed.read(1 << 20):
                file.write(chunk)
                begun = begun + len(chunk) if b"\n" not in chunk else len(chunk) - chunk.rindex(b"\n")
                if is_text and begun > text_logs.LONGEST:
                    raise InputError(f"{path}: a line is longer than {begun} characters; {COPY}")
    except (OSError, EOFError, zlib.error) as error:
        raise InputError(f"{path} cannot be unpacked ({plain(str(error))}); {COPY}") from None
    return folder / path.stem


def _of_file(path: Path, file: Path, account: Account) -> Iterator[Frame]:
    form = format_of(file)
    if form is None and file.suffix.lower() in ("", ".txt"):
        form = next(one for one in FORMATS if ".candump" in one.suffixes)
    module, _, name = (form.reader if form else "").partition(":")
    try:
        frames = getattr(importlib.import_module(module), name) if module else by_library
        for frame in frames(file, account):
            if not (-_LATEST_S if form and form.text else 0.0) <= frame.time < _LATEST_S:
                raise InputError(f"{path} is damaged: a frame has the time {frame.time:g} s; {COPY}")
            yield frame
    except InputError as error:
        raise InputError(str(error).replace(str(file), str(path))) from None
    except Exception as error:  # each of python-can's readers fails in its own way on a damaged file
        text = why(error)
        raise InputError(f"{path} cannot be read as a CAN log ({text}); known are {KINDS}") from None


def by_library(path: Path, account: Account) -> Iterator[Frame]:
    """The frames of a log that python-can reads: BLF, MF4 and its own CSV."""
    suffix = path.suffix.lower()
    if suffix == ".blf":
        check_blf(path)
    with can.LogReader(path) as reader:
        for message in reader:
            # BLF counts buses from 1, and python-can from 0; MF4 has its own numbers
            number = message.channel
            channel = str(number + 1) if suffix == ".blf" and isinstance(number, int) else str(number or 1)
            account.total.read += 1
            yield of_message(message, channel)
