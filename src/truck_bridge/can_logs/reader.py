"""Frames out of a log: candump in both text forms by our own reader, ASC, BLF, TRC and MF4 by python-can,
rosbags by rosbags.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import can

from truck_bridge.can_logs import rosbag
from truck_bridge.can_logs.whole import COPY, check_blf, check_file
from truck_bridge.errors import InputError, plain

TEXT = (".log", ".candump", ".txt", "")
KINDS = "candump text (.log), ASC, BLF, TRC, MF4, or a rosbag with raw frames"
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


def read(path: Path) -> Iterator[Frame]:
    """The extended data frames of a log, in its order. Of their checksums see `whole`.

    Raises InputError where the file is missing, of an unknown kind, damaged, or holds no such frame.
    """
    if not path.exists():
        raise InputError(f"{path} does not exist; give a CAN log: {KINDS}")
    check_file(path)
    if path.is_dir() and not (path / "metadata.yaml").is_file():
        raise InputError(f"{path} is a folder without a rosbag's metadata.yaml; give a CAN log: {KINDS}")
    text = path.is_file() and path.suffix.lower() in TEXT
    frames = _read_text(path) if text else _read_by_library(path)
    count = 0
    for count, frame in enumerate(frames, 1):  # noqa: B007 - counts what was yielded
        yield frame
    if not count:
        raise InputError(f"{path} holds no extended CAN frame; J1939 has nothing else")


def _read_text(path: Path) -> Iterator[Frame]:
    with path.open(encoding="utf-8", errors="replace") as lines:
        for number, line in enumerate(lines, 1):
            if not line.strip() or line.startswith("#") or _OTHER.match(line):
                continue
            frame = _parse(line)
            if frame is None and number > 1 and not line.endswith("\n"):
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


def _read_by_library(path: Path) -> Iterator[Frame]:
    if path.suffix.lower() == ".mf4":
        need_asammdf()
    try:
        for message in _messages(path):
            if not 0 <= message.timestamp < _LATEST_S:
                raise InputError(f"{path} is damaged: a frame has the time {message.timestamp:g} s; {COPY}")
            if message.is_extended_id and not (message.is_error_frame or message.is_remote_frame):
                yield Frame(message.timestamp, message.arbitration_id, bytes(message.data)[:8])
    except InputError:
        raise
    except Exception as error:  # each of python-can's readers fails in its own way on a damaged file
        text = plain(str(error)) or type(error).__name__
        raise InputError(f"{path} cannot be read as a CAN log ({text}); known are {KINDS}") from None


def _messages(path: Path) -> Iterator[can.Message]:
    if path.is_dir() or path.suffix.lower() in rosbag.SUFFIXES:
        yield from rosbag.read(path)
    else:
        if path.suffix.lower() == ".blf":
            check_blf(path)
        with can.LogReader(path) as reader:
            yield from reader


def need_asammdf() -> None:
    """Raises InputError where MF4 cannot be had."""
    try:
        import asammdf  # type: ignore[import-not-found]  # noqa: F401
    except ImportError:
        raise InputError("MF4 logs need asammdf; install it with 'pip install asammdf'") from None
