"""Reads frames from candump's text, which python-can reads in one of its forms alone.

Those are the log (candump -l), the console with any options (-t a, -x, -a, -e) and with decoded text behind
or below the frames, and consoles of other tools that print a time of day, the identifier and `[8]` bytes.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path

from deeptruck_core.account import Account
from truck_bridge.can_logs.frames import STANDARD_MASK, Frame, Kind, of_raw
from truck_bridge.can_logs.lines import Lines

STANDARD_DIGITS = 3  # of an 11-bit identifier; candump writes 29 bits with 8 digits, whatever their value
_LINE = re.compile(
    r"\s*(?:\((?P<time>\d{1,12}(?:\.\d{0,12})?|\d{4}-\d\d-\d\d \d\d:\d\d:\d\d(?:\.\d{1,9})?)\)"
    r"\s+(?P<channel>\S+)"
    r"|(?P<of_day>\d\d:\d\d:\d\d\.\d{1,9}))"
    r"\s+(?:[RT]X\s+[B-]\s+[E-]\s+)?(?P<id>[0-9A-Fa-f]{1,8})(?P<logged>#)?(?P<rest>.*)$",
    re.DOTALL,
)
_LOGGED = re.compile(
    r"(?:(?P<remote>R)(?P<length>[0-8]?)|#(?P<flags>[0-9A-Fa-f])(?P<fd>(?:[0-9A-Fa-f]{2})*)"
    r"|(?P<data>(?:[0-9A-Fa-f]{2}){0,8}))\s*[RT]?\s*$"
)
_CONSOLE = re.compile(
    r"\s+\[(?P<length>\d\d?)\](?P<data>(?:\s*[0-9A-Fa-f]{2}(?![0-9A-Fa-f]))*)"
    r"\s*(?P<behind>'[^\n]*'|remote request|ERRORFRAME|::.*|//.*|#.*)?\s*$",
    re.DOTALL,
)
_OVERFLOWN = "1000000"  # microseconds, as asc2log wrote a full second before 2021


def frames(path: Path, account: Account) -> Iterator[Frame]:
    """The frames of a candump text."""
    lines = Lines(path, account)
    return lines.frames(frame for line in lines if (frame := _of(line)) is not None)


def _of(line: str) -> Frame | None:
    """The frame of a line; None for any other text."""
    found = _LINE.match(line)
    if found is None:
        return None
    time = _seconds(found["time"] or f"1970-01-01 {found['of_day']}")
    form = (_LOGGED if found["logged"] else _CONSOLE).match(found["rest"])
    frame = _identified(time, found["channel"] or "can0", found["id"])
    if form is None or frame is None:
        return None
    return (_logged if found["logged"] else _console)(frame, form)


def _logged(frame: Frame, form: re.Match[str]) -> Frame:
    if form["remote"]:
        return frame._replace(kind=Kind.REMOTE, length=int(form["length"] or 0))
    if form["flags"]:
        bits = int(form["flags"], 16)
        data = bytes.fromhex(form["fd"])
        return frame._replace(kind=Kind.FD, data=data, rate=bool(bits & 1), passive=bool(bits & 2))
    return frame._replace(data=bytes.fromhex(form["data"]))


def _console(frame: Frame, form: re.Match[str]) -> Frame | None:
    length, data = int(form["length"]), bytes.fromhex(form["data"])
    if form["behind"] == "remote request":
        return frame._replace(kind=Kind.REMOTE, length=length)
    if len(data) != length:
        return None
    fd = len(form["length"]) == 2 and frame.kind is Kind.DATA  # [08]: two digits are those of CAN FD
    return frame._replace(data=data, kind=Kind.FD if fd else frame.kind) if fd or length <= 8 else None


def _identified(time: float, channel: str, digits: str) -> Frame | None:
    """A frame without bytes, its class by the number of digits; None for an impossible identifier."""
    raw = int(digits, 16)
    if len(digits) <= STANDARD_DIGITS:
        return Frame(time, raw, b"", channel, False) if raw <= STANDARD_MASK else None
    return of_raw(time, raw, b"", channel, extended=True)


def _seconds(text: str) -> float:
    """Time in s of a number, or of a date in the format of candump -t A (taken as UTC: only differences
    count)."""
    whole, _, fraction = text.partition(".")
    if text[4:5] != "-":
        return float(whole) + 1.0 if fraction == _OVERFLOWN else float(text)
    date = datetime.strptime(whole, "%Y-%m-%d %H:%M:%S").replace(tzinfo=UTC)
    return date.timestamp() + float(f"0.{fraction or 0}")
