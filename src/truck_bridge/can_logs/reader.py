"""Frames out of a log: candump in both text forms by our own reader, ASC, BLF, TRC and MF4 by python-can,
rosbags by rosbags.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import can

from deeptruck_model.reading import plain
from truck_bridge import log_files
from truck_bridge.can_logs.whole import COPY, check_blf, check_file
from truck_bridge.errors import InputError

WHOLE = 8  # bytes of nearly every J1939 frame: a shorter one without a line's end may be cut
# 12 digits of seconds reach beyond any clock
_CONSOLE = re.compile(
    r"^\s*\((\d{1,12}(?:\.\d{0,12})?)\)\s+(\S+)\s+([0-9A-Fa-f]{1,8})\s+\[(\d+)\]\s*((?:[0-9A-Fa-f]{2}\s*)*)$"
)
_LOGGED = re.compile(
    r"^\s*\((\d{1,12}(?:\.\d{0,12})?)\)\s+(\S+)\s+([0-9A-Fa-f]{3,8})#((?:[0-9A-Fa-f]{2})*)\s*[RT]?\s*$"
)
_OTHER = re.compile(r"^\s*\([\d.]+\)\s+\S+\s+[0-9A-Fa-f]{1,8}(#R|##|\s+\[\d+\]\s+remote)")  # remote, CAN FD
_LATEST_S = 1e12


class Frame(NamedTuple):
    """One extended data frame of a log; time in seconds as the log has it."""

    time: float
    can_id: int
    data: bytes


def read(path: Path, notes: list[str] | None = None) -> Iterator[Frame]:
    """The extended data frames of a log, in its order. `notes` gets a line where the log is cut off.

    Of the checksums of logs see `whole`. Raises InputError where the file is missing, of an unknown kind,
    damaged, or holds no such frame.
    """
    log_files.check(path)
    check_file(path)
    remarks = [] if notes is None else notes
    text = path.is_file() and path.suffix.lower() in log_files.TEXT
    frames = _read_text(path, remarks) if text else _read_by_library(path, remarks)
    count = 0
    for count, frame in enumerate(frames, 1):  # noqa: B007 - counts what was yielded
        yield frame
    if not count:
        raise InputError(f"{path} holds no extended CAN frame; J1939 has nothing else")


def _read_text(path: Path, notes: list[str]) -> Iterator[Frame]:
    with path.open(encoding="utf-8", errors="replace") as lines:
        for number, line in enumerate(lines, 1):
            if not line.strip() or line.startswith("#") or _OTHER.match(line):
                continue
            frame = _parse(line)
            unended = number > 1 and not line.endswith("\n")
            if unended and (frame is None or len(frame.data) < WHOLE):
                notes.append(f"{path} is cut off in its last line, {number}, which is left out")
                return  # the recorder was killed in the middle of it
            if frame is None:
                raise InputError(f"{path}, line {number}: not a line of candump: {line.strip()[:60]!a}")
            if frame.can_id > 0x7FF:
                yield frame


def _parse(line: str) -> Frame | None:
    console, logged = _CONSOLE.match(line), _LOGGED.match(line)
    match = console or logged
    if match is None:
        return None
    data = bytes.fromhex(match[5] if console else match[4])
    if len(data) > 8 or (console and len(data) != int(match[4])):
        return None
    return Frame(float(match[1]), int(match[3], 16) & 0x1FFF_FFFF, data)


def _read_by_library(path: Path, notes: list[str]) -> Iterator[Frame]:
    try:
        for message in _messages(path, notes):
            if not 0 <= message.timestamp < _LATEST_S:
                raise InputError(f"{path} is damaged: a frame has the time {message.timestamp:g} s; {COPY}")
            if message.is_extended_id and not (message.is_error_frame or message.is_remote_frame):
                yield Frame(message.timestamp, message.arbitration_id, bytes(message.data)[:8])
    except InputError:
        raise
    except Exception as error:  # each of python-can's readers fails in its own way on a damaged file
        text = plain(str(error)) or type(error).__name__
        raise InputError(
            f"{path} cannot be read as a CAN log ({text}); known are {log_files.KINDS}"
        ) from None


def _messages(path: Path, notes: list[str]) -> Iterator[can.Message]:
    if path.is_dir() or path.suffix.lower() in log_files.BAGS:
        from truck_bridge.can_logs import rosbag

        yield from rosbag.read(path, notes)
    else:
        if path.suffix.lower() == ".blf":
            check_blf(path)
        with can.LogReader(path) as reader:
            yield from reader
