"""Records a log from a bus, replays a log onto a bus, and converts logs."""

from __future__ import annotations

import fcntl
import itertools
import math
import os
import re
import signal
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import can

from deeptruck_core import files, formats
from deeptruck_core.account import Account
from truck_bridge import log_files
from truck_bridge.bus import open_bus
from truck_bridge.can_logs.frames import Kind
from truck_bridge.can_logs.reader import every, read
from truck_bridge.errors import InputError
from truck_bridge.j1939.ids import ADDRESS_CLAIMED, Identifier

ENDS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
_LOST = {  # frames that a form of log, or python-can's writer of it, cannot hold
    formats.BAG: frozenset({Kind.FD}),
    ".trc": frozenset({Kind.ERROR, Kind.REMOTE, Kind.FD}),
}
COMMAND_PGNS = {0x0000, 0x0100, 0x0400, 0xEF00, ADDRESS_CLAIMED}  # TSC1, TC1, XBR, proprietary A; claims


def record(path: Path, interface: str, channel: str, duration: float | None = None) -> int:
    """Write a bus to a log until the duration, SIGINT, SIGTERM or SIGHUP. Returns the number of frames.

    The log has its final name from the beginning, so that a kill leaves what was recorded. Raises InputError
    if the bus cannot be opened or is silent (the log is then removed, unless another process wrote to it), or
    if the log exists, is of an unknown kind, cannot be written, or has been replaced by another file at the
    end; what was written before a disk became full is kept.
    """
    log_files.check_new(path)
    logger = _logger(path, new=True)
    bus = open_bus(interface, channel)
    count, end = 0, math.inf if duration is None else time.monotonic() + duration
    try:
        with _end_requested() as ended, _writing(logger, path) as write:
            mine = _identity(path)
            while not ended.is_set() and (left := end - time.monotonic()) > 0:
                message = bus.recv(min(left, 0.2))
                if message is not None:
                    write(message)
                    count += 1
    except can.CanError as error:
        raise InputError(f"the bus is gone ({error}); {count} frames are in {path}") from None
    finally:
        bus.shutdown()
    if _identity(path) != mine:
        raise InputError(f"{path} was moved or replaced meanwhile; the {count} frames are where it went")
    if count == 0:
        silent = f"nothing was received on {interface} {channel}; is it the right channel, does anyone speak?"
        if _outline(path) != _outline_of_silence(path):
            raise InputError(f"{silent} {path} stays, as somebody else wrote into it")
        path.unlink()
        raise InputError(silent)
    return count


def convert(source: Path, out: Path, *, channel: str | None = None) -> Account:
    """Write a log in the format that the suffix of `out` selects: all frames, of every bus or of `channel`.

    Frames that the format cannot hold are omitted and counted. Raises InputError as `read` and `record` do;
    then nothing is left behind.
    """
    log_files.check_new(out)
    account = Account(str(source), "frames")
    lost = _LOST.get(out.suffix.lower(), frozenset())
    with files.new_file(out) as draft, _writing(_logger(out, new=False), draft, out) as write:
        for frame in every(source, account):
            if channel is not None and frame.channel != channel:
                account.total.set_aside("frames of other buses", f"on {frame.channel}")
            elif frame.kind in lost:
                account.total.set_aside(
                    f"{frame.kind.value}, which {out.suffix} cannot hold", f"at {frame.time:.3f} s"
                )
            else:
                write(frame.message)
                account.total.used += 1
        if not account.total.used:
            held = f"; it has {', '.join(account.sources)}" if account.sources else ""
            raise InputError(f"{source} holds no frame to convert{f' on {channel}' if channel else ''}{held}")
    return account


def replay(
    path: Path,
    interface: str,
    channel: str,
    *,
    commands: bool = False,
    speed: float = 1.0,
    of: str | None = None,
    account: Account | None = None,
) -> int:
    """Send a log's frames with their own timing, commands to a truck only with `commands`. Returns the number
    sent.

    `of` is the bus of the log if it has several, and `account` is that of `read`. Raises InputError as `read`
    does.
    """
    frames = read(path, account, channel=of)
    first = next(frames)  # before anything is opened, so that a damaged log opens nothing
    bus = open_bus(interface, channel)
    count, start = 0, time.monotonic()
    try:
        for frame in itertools.chain([first], frames):
            if not commands and Identifier.of(frame.can_id).pgn in COMMAND_PGNS:
                continue
            time.sleep(max(0.0, start + (frame.time - first.time) / speed - time.monotonic()))
            bus.send(frame.message)
            count += 1
    except can.CanError as error:
        raise InputError(f"the bus is gone ({error}); {count} frames were sent") from None
    finally:
        bus.shutdown()
    return count


def _identity(path: Path) -> tuple[int, int] | None:
    """Device and inode of the file with this name; None if there is none."""
    try:
        found = path.stat(follow_symlinks=False)
    except OSError:
        return None
    return found.st_dev, found.st_ino


def _outline(log: Path) -> bytes | int:
    """Content of a log without its numbers and times; for a binary log, its size."""
    data = log.read_bytes()
    return re.sub(rb"\d+", b"0", data) if log.suffix in formats.LINES else len(data)


def _outline_of_silence(path: Path) -> bytes | int:
    """The outline of a log of this kind without frames."""
    with tempfile.TemporaryDirectory() as place:
        like = Path(place) / path.name
        with _writing(_logger(like, new=True), like):
            pass
        return _outline(like)


@contextmanager
def _end_requested() -> Iterator[threading.Event]:
    """An event set by the signals that end a recording; an exception during a write would leave half a
    record."""
    ended = threading.Event()
    if threading.current_thread() is not threading.main_thread():
        yield ended  # only the main thread may handle signals
        return
    heeded = [n for n in ENDS if signal.getsignal(n) != signal.SIG_IGN]
    before = {number: signal.signal(number, lambda *_: ended.set()) for number in heeded}
    try:
        yield ended
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextmanager
def _writing(
    logger: Callable[[Path], Any], path: Path, shown: Path | None = None
) -> Iterator[Callable[[can.Message], None]]:
    """A function that writes a frame. Raises InputError if the file cannot be written (any further)."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        log = logger(path)
        try:
            yield _flushing(log)
        finally:
            log.stop()
    except InputError:
        raise
    except (OSError, ValueError) as error:
        says = getattr(error, "strerror", None) or str(error)
        raise InputError(f"cannot write {shown or path}: {says}") from None


def _logger(path: Path, *, new: bool) -> Callable[[Path], Any]:
    """A function that makes a python-can listener for the kind of log in the suffix.

    A `new` one creates the file, with folders, and never replaces another's.
    """
    if path.suffix.lower() == formats.BAG:
        from truck_bridge.can_logs.rosbag import RosbagWriter

        return partial(RosbagWriter, mode="xb" if new else "wb")
    return _new_log if new else can.Logger


def _new_log(path: Path) -> Any:
    path.touch(exist_ok=False)
    log = can.Logger(path)
    if path.suffix.lower() in formats.LINES:  # what somebody else appends is never written over
        log.file.flush()
        number = log.file.fileno()
        fcntl.fcntl(number, fcntl.F_SETFL, fcntl.fcntl(number, fcntl.F_GETFL) | os.O_APPEND)
    return log


def _flushing(log: Any) -> Callable[[can.Message], None]:
    """A function that writes and flushes, so that frames older than half a second survive a kill, if the
    format can be read without its end."""
    flushed, file = time.monotonic(), getattr(log, "file", None)

    def write(message: can.Message) -> None:
        nonlocal flushed
        log.on_message_received(message)
        if file is not None and time.monotonic() - flushed > log_files.FLUSH_S:
            file.flush()
            flushed = time.monotonic()

    return write
