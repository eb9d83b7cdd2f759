"""Records a log from a bus, replays a log onto a bus, and converts logs."""

from __future__ import annotations

import itertools
import math
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import can

from deeptruck_core import files
from deeptruck_core.account import Account
from deeptruck_core.formats import BAG
from truck_bridge.bus import open_bus
from truck_bridge.can_logs.frames import Kind
from truck_bridge.can_logs.library_logs import need_asammdf
from truck_bridge.can_logs.reader import OTHER_BUSES, check_used, every, read
from truck_bridge.can_logs.rosbag import FLUSH_S, RosbagWriter
from truck_bridge.errors import InputError
from truck_bridge.j1939.ids import ADDRESS_CLAIMED, Identifier

WRITABLE = (".log", ".asc", ".trc", ".blf", ".mf4", BAG)
ENDS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
LOST = {  # frames that a form of log, or python-can's writer of it, cannot hold
    BAG: frozenset({Kind.FD}),
    ".trc": frozenset({Kind.ERROR, Kind.REMOTE, Kind.FD}),
}
COMMAND_PGNS = {0x0000, 0x0100, 0x0400, 0xEF00, ADDRESS_CLAIMED}  # TSC1, TC1, XBR, proprietary A; claims


def record(path: Path, interface: str, channel: str, duration: float | None = None) -> int:
    """Write a bus to a log until the duration, SIGINT, SIGTERM or SIGHUP. Returns the number of frames.

    The log has its final name from its first frame on, so that a kill leaves what was recorded. Raises
    InputError if the bus cannot be opened or is silent (then there is no log), or if the log exists, is of an
    unknown kind or cannot be written; what was written before a disk became full is kept.
    """
    check_new(path)
    bus = open_bus(interface, channel)
    count, end = 0, math.inf if duration is None else time.monotonic() + duration
    first: can.Message | None = None
    try:
        with _end_requested() as ended:

            def received() -> Iterator[can.Message]:
                while not ended.is_set() and (left := end - time.monotonic()) > 0:
                    if (message := bus.recv(min(left, 0.2))) is not None:
                        yield message

            messages = received()
            first = next(messages, None)
            if first is None:
                raise InputError(
                    f"nothing was received on {interface} {channel}; is it the right channel, is the bus on?"
                )
            with _writing(path, path, new=True) as write:
                for message in itertools.chain([first], messages):
                    write(message)
                    count += 1
    except can.CanError as error:
        where = f"; {count} frames are in {path}" if count else ""
        raise InputError(f"the bus is gone ({error}){where}") from None
    finally:
        bus.shutdown()
    return count


def convert(source: Path, out: Path, *, channel: str | None = None) -> Account:
    """Write a log in the format that the suffix of `out` selects: all frames, of every bus or of `channel`.

    Frames that the format cannot hold are omitted and counted. Raises InputError as `read` and `record` do;
    then nothing is left behind.
    """
    check_new(out)
    account = Account(str(source), "frames")
    lost = LOST.get(out.suffix.lower(), frozenset())
    with files.new_file(out) as draft, _writing(draft, out, new=False) as write:
        for frame in every(source, account):
            if channel is not None and frame.channel != channel:
                account.total.set_aside(OTHER_BUSES, f"on {frame.channel}")
            elif frame.kind in lost:
                account.total.set_aside(
                    f"{frame.kind.value}, which {out.suffix} cannot hold", f"at {frame.time:.3f} s"
                )
            else:
                write(frame.message)
                account.total.used += 1
        check_used(source, account, "frame to convert", channel)
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


def check_new(path: Path) -> None:
    """Raises InputError if a log cannot be created under this name; nothing is changed."""
    if path.suffix.lower() not in WRITABLE:
        raise InputError(f"{path}: a log's name ends in {', '.join(WRITABLE)}")
    need_asammdf(path)
    files.check_new(path)


@contextmanager
def _writing(path: Path, shown: Path, *, new: bool) -> Iterator[Callable[[can.Message], None]]:
    """A function that writes a frame, and flushes, so that frames older than half a second survive a kill if
    the format can be read without its end. A `new` log is created here, and never replaces another's.

    Raises InputError if the file cannot be written (any further).
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        if new:
            path.touch(exist_ok=False)
        log: Any = RosbagWriter(path) if shown.suffix.lower() == BAG else can.Logger(path)
        flushed, file = time.monotonic(), getattr(log, "file", None)

        def write(message: can.Message) -> None:
            nonlocal flushed
            log.on_message_received(message)
            if file is not None and time.monotonic() - flushed > FLUSH_S:
                file.flush()
                flushed = time.monotonic()

        try:
            yield write
        finally:
            log.stop()
    except InputError:
        raise
    except (OSError, ValueError, NotImplementedError) as error:
        says = getattr(error, "strerror", None) or str(error)
        raise InputError(f"cannot write {shown}: {says}") from None
