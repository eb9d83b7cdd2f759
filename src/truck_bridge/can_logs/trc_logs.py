"""Reads frames from PEAK's TRC by python-can, and counts the lines that it skips."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import can

from deeptruck_core.account import Account
from truck_bridge.can_logs.frames import Frame, of_message
from truck_bridge.can_logs.text_logs import LONGEST, check_length
from truck_bridge.can_logs.whole import COPY
from truck_bridge.errors import InputError

STATUS = {"ST", "EC", "ER", "EV", "Error", "Warng"}  # types of lines that are no frame (PEAK, TRC 1.1 to 2.1)
_LOGGER = "can.io.trc"  # where python-can says which lines it passed over


def trc(path: Path, account: Account) -> Iterator[Frame]:
    """The frames of a TRC log. Raises InputError at a damaged line; a last line that was cut off is
    omitted."""
    last, open_ended = _end(path)
    halved = False  # the last line, within a byte
    with _passed_over() as said, can.TRCReader(path) as reader:
        held: can.Message | None = None
        try:
            for message in reader:
                if held is not None:
                    yield _whole(path, held, account)
                held = message
        except ValueError:
            halved = open_ended and not reader.file.read()
            if not halved:
                raise
    unreadable = [text for text in said if text not in STATUS]
    short = open_ended and held is not None and _is_short(held)
    if held is not None and not short:
        yield _whole(path, held, account)
    cut = halved or short or (open_ended and bool(unreadable))
    if unreadable[:-1] or (unreadable and not cut):
        raise InputError(f"{path}: not a line of a TRC log: {unreadable[0][:60]!a}")
    if cut:
        account.total.read += 1
        account.total.set_aside("frame cut off at the end of the log", f"in line {last}")
        account.remarks.append(f"{path} is cut off in its last line, {last}, which is left out")
    status = len(said) - len(unreadable)
    account.total.read += status
    account.total.set_aside("lines of status or errors", count=status)


def _whole(path: Path, message: can.Message, account: Account) -> Frame:
    if _is_short(message):
        raise InputError(
            f"{path}: frame {account.total.read + 1}, at {message.timestamp:.3f} s, has {len(message.data)} "
            f"bytes where {message.dlc} are stated; {COPY}"
        )
    account.total.read += 1
    return of_message(message, str(message.channel or 1))


def _is_short(message: can.Message) -> bool:
    return not (message.is_remote_frame or message.is_fd) and len(message.data) != message.dlc


def _end(path: Path) -> tuple[int, bool]:
    """The number of a log's last line, and whether its line break is missing."""
    number, line = 0, b"\n"
    with path.open("rb") as file:
        for number, line in enumerate(iter(partial(file.readline, LONGEST), b""), 1):
            check_length(path, number, line)
    return number, not line.endswith(b"\n")


@contextmanager
def _passed_over() -> Iterator[list[str]]:
    """Yield a list that collects the line types, or lines, that python-can skips with only a log message."""
    found: list[str] = []

    class Kept(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            if isinstance(record.args, tuple) and record.args:
                found.append(str(record.args[0]))
            elif "bus info" in record.msg:
                found.append("ST")

    logger, handler = logging.getLogger(_LOGGER), Kept(logging.INFO)
    before = logger.level, logger.propagate
    logger.addHandler(handler)
    logger.setLevel(logging.INFO)
    logger.propagate = False
    try:
        yield found
    finally:
        logger.removeHandler(handler)
        logger.setLevel(before[0])
        logger.propagate = before[1]
