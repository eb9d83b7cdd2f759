"""Reads frames from text: the variants of candump, and Vector's ASC.

python-can would silently skip what it does not know (negative times, other columns). Here every line that is
no frame is counted in the account; a damaged frame ends the reading, unless it is a last line that was cut
off.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import suppress
from datetime import UTC, datetime
from functools import partial
from pathlib import Path

from deeptruck_core.account import Account
from truck_bridge.can_logs.frames import (
    ERROR_FLAG,
    EXTENDED_FLAG,
    EXTENDED_MASK,
    REMOTE_FLAG,
    STANDARD_MASK,
    Frame,
    Kind,
)
from truck_bridge.can_logs.whole import COPY
from truck_bridge.errors import InputError

LONGEST = 1 << 16  # characters of a line; a CAN FD frame has some 250
WHOLE = 8  # bytes of nearly every J1939 frame: a shorter one without a line's end may be cut
STANDARD_DIGITS = 3  # of an 11-bit identifier; candump writes 29 bits with 8 digits, whatever their value
_TIME = r"\s*\((?P<time>\d{1,12}(?:\.\d{0,12})?|\d{4}-\d\d-\d\d \d\d:\d\d:\d\d(?:\.\d{1,9})?)\)"
_LOGGED = re.compile(  # candump -l: (1436509052.249713) can0 18FEF100#FFFF8202 R
    _TIME + r"\s+(?P<channel>\S+)\s+(?P<id>[0-9A-Fa-f]{1,8})"
    r"#(?:(?P<remote>R)(?P<length>[0-8]?)|#(?P<flags>[0-9A-Fa-f])(?P<fd>(?:[0-9A-Fa-f]{2})*)"
    r"|(?P<data>(?:[0-9A-Fa-f]{2}){0,8}))\s*[RT]?\s*$"
)
_CONSOLE = re.compile(  # candump -t a [-x -a -e]: (1.0)  can0  RX - -  18FEF100   [8]  FF FF 82 02 ...  'abc'
    _TIME + r"\s+(?P<channel>\S+)\s+(?:[RT]X\s+[B-]\s+[E-]\s+)?(?P<id>[0-9A-Fa-f]{1,8})"
    r"\s+\[(?P<length>\d\d?)\](?P<rest>.*)$",
    re.DOTALL,
)
_OVERFLOWN = "1000000"  # microseconds, as asc2log wrote a full second before 2021
_LIKE_A_FRAME = re.compile(r"^\s*\(|[0-9A-Fa-f]{3,8}\s*(?:#|\[)")
_BYTES = re.compile(r"(?:\s*[0-9A-Fa-f]{2}(?![0-9A-Fa-f]))*")
_BEHIND = re.compile(r"\s*(?:'[^\n]*'|remote request|ERRORFRAME|::.*|//.*|#.*)?\s*$", re.DOTALL)
_ASC_TIME = re.compile(r"\s*(-?\d{1,12}\.\d{1,12})\s+(.*?)\s*$")
_ASC_FRAME = re.compile(
    r"(?P<channel>\d+)\s+(?P<id>[0-9A-Fa-f]+)(?P<extended>x?)\s+(?:Rx|Tx)\s+(?P<kind>[dr])\b\s*(?P<rest>.*)$",
    re.IGNORECASE,
)
_ASC_ERROR = re.compile(r"(?:CANFD\s+)?(?P<channel>\d+)\s+(?:(?:Rx|Tx)\s+)?ErrorFrame\b", re.IGNORECASE)
_ASC_FD = re.compile(
    r"CANFD\s+(?P<channel>\d+)\s+(?:Rx|Tx)\s+(?P<id>[0-9A-Fa-f]+)(?P<extended>x?)\s+(?:\S*[^01\s]\S*\s+)?"
    r"(?P<rate>[01])\s+(?P<passive>[01])\s+(?P<code>[0-9A-Fa-f]+)\s+(?P<length>\d+)\s*(?P<rest>.*)$",
    re.IGNORECASE,
)
_ASC_OTHER = re.compile(  # events that bear a channel's number as a frame does
    r"(?:\d+\s+)?(?:Statistic|Status|J1939TP|Log|Trigger|SV:|TFS|LIN|Fr|ETH|MOST|Flexray"
    r"|GPS|AFDX|ARINC|Comment|//|CAN \d|Begin|End|[\d ]*(?:chip|status))",
    re.IGNORECASE,
)
_ASC_REQUEST = re.compile(r"\sTxRq\s", re.IGNORECASE)  # to the controller: no frame on the bus
_ASC_START = re.compile(r"Start of measurement", re.IGNORECASE)
_NUMERIC = frozenset("-0123456789")  # how a line with a time begins
_ASC_BASE = re.compile(r"\s*base\s+(hex|dec)(?:\s+timestamps\s+(absolute|relative))?", re.IGNORECASE)

Lines = Iterator[tuple[int, str]]


def candump(path: Path, account: Account) -> Iterator[Frame]:
    """The frames of a candump log; lines of text above the first one are counted.

    Raises InputError at a damaged line.
    """
    above, decoded = 0, False
    for number, line in lines_of(path):
        if not line.strip() or line.startswith("#"):
            continue
        account.total.read += 1
        if line.startswith("\t") and account.total.read > 1:  # candump -e explains an error frame below it
            account.total.set_aside("lines that explain an error frame", f"in line {number}")
            continue
        frame = _of_candump(line)
        if frame is None and decoded and not _LIKE_A_FRAME.search(line):
            account.total.set_aside("lines of decoded text", f"in line {number}")
            continue
        decoded = "::" in line
        if frame is None and above == account.total.read - 1 and not _LIKE_A_FRAME.search(line):
            above += 1
            account.total.set_aside("lines of text above the first frame", f"in line {number}")
            continue
        if not line.endswith("\n") and _is_cut(number, frame):
            _leave_out_cut(path, number, account)
            return
        if frame is None:
            raise no_line(path, number, f"candump{_why(line)}", line)
        yield frame
    if above and above == account.total.read:
        raise InputError(f"{path}, line 1: not a line of candump, and none of its {above} lines is one")


def asc(path: Path, account: Account) -> Iterator[Frame]:
    """The frames of an ASC log; times may be negative, and relative to the line before."""
    relative, base, time = False, 16, 0.0
    for number, line in lines_of(path):
        timed = _ASC_TIME.match(line)
        if timed is None:
            if (found := _ASC_BASE.match(line)) is not None:
                base, relative = (
                    (10 if found[1].lower() == "dec" else 16),
                    (found[2] or "").lower() == "relative",
                )
                continue
            if line.lstrip()[:1] not in _NUMERIC:
                continue  # header, trigger blocks and comments have no time
        frame, event = None, line.strip()
        if timed is not None:
            event = timed[2]
            time = time + float(timed[1]) if relative else float(timed[1])
            with suppress(ValueError):  # said below, by what the line looks like
                frame = _of_asc(event, time, base)
            if frame is None and _ASC_START.match(event):
                continue  # the one line of a header that has a time
        account.total.read += 1
        if not line.endswith("\n") and _is_cut(number, frame):
            _leave_out_cut(path, number, account)
            return
        if frame is not None:
            yield frame
        elif timed and _ASC_REQUEST.search(event):
            account.total.set_aside("requests to transmit (TxRq)", f"in line {number}")
        elif timed and (_ASC_OTHER.match(event) or not event[:1].isdigit()):
            account.total.set_aside("lines of other events", f"in line {number}")
        elif event.split()[1:2] and not re.fullmatch(r"[0-9A-Fa-f]+x?", event.split()[1]):
            account.total.set_aside("lines with a name in place of an identifier", f"in line {number}")
        else:
            raise no_line(path, number, "an ASC log", line)


def no_line(path: Path, number: int, of: str, line: str) -> InputError:
    """The refusal of a line that is damaged, or that no such log has."""
    text = f"{path}, line {number}: not a line of {of}: {line.strip()[:60]!a}"
    return InputError(f"{text}; remove it where the lines around it are sound")


def lines_of(path: Path) -> Lines:
    """Number and text of each line. Raises InputError at a line longer than LONGEST, which could fill the
    memory."""
    with path.open(encoding="utf-8-sig", errors="replace") as file:
        for number, line in enumerate(iter(partial(file.readline, LONGEST), ""), 1):
            check_length(path, number, line)
            yield number, line


def check_length(path: Path, number: int, line: str | bytes) -> None:
    """Raises InputError for a line of which only LONGEST were read."""
    if len(line) >= LONGEST:
        raise InputError(f"{path}, line {number}: longer than {LONGEST} characters, as no frame is; {COPY}")


def _is_cut(number: int, frame: Frame | None) -> bool:
    """Whether a last line without its end was cut off when its recorder was killed."""
    return number > 1 and (frame is None or (frame.kind is Kind.DATA and len(frame.data) < WHOLE))


def _leave_out_cut(path: Path, number: int, account: Account) -> None:
    """Omit a line in which the recorder was killed, and count it."""
    account.total.set_aside("frame cut off at the end of the log", f"in line {number}")
    account.remarks.append(f"{path} is cut off in its last line, {number}, which is left out")


def _why(line: str) -> str:
    """The error in a line of candump, if it can be named."""
    if re.match(r"\s*\S+\s+[0-9A-Fa-f]{3,8}\s+\[\d+\]", line):
        return " with a time (record with 'candump -t a' or 'candump -l')"
    return ""


def _of_candump(line: str) -> Frame | None:
    match = _LOGGED.match(line)
    if match is None:
        return _of_console(line)
    time, channel, digits, remote, length, flags, fd, data = match.groups()
    frame = _identified(_seconds(time), channel, digits, bytes.fromhex(data or ""))
    if frame is None or data is not None:
        return frame
    if remote:
        return frame._replace(kind=Kind.REMOTE, length=int(length or 0))
    bits = int(flags, 16)
    return frame._replace(kind=Kind.FD, data=bytes.fromhex(fd), rate=bool(bits & 1), passive=bool(bits & 2))


def _of_console(line: str) -> Frame | None:
    match = _CONSOLE.match(line)
    if match is None:
        return None
    length, rest = int(match["length"]), match["rest"]
    found = _BYTES.match(rest)
    content = found[0] if found else ""
    data = bytes.fromhex(content)
    frame = _identified(_seconds(match["time"]), match["channel"], match["id"], data)
    if frame is None or not _BEHIND.match(rest, len(content)):
        return None
    if "remote request" in rest:
        return frame._replace(kind=Kind.REMOTE, length=length)
    if len(data) != length:
        return None
    if len(match["length"]) == 2 and frame.kind is Kind.DATA:  # [08]: two digits are those of CAN FD
        return frame._replace(kind=Kind.FD)
    return frame if len(data) <= 8 else None


def _identified(time: float, channel: str, digits: str, data: bytes) -> Frame | None:
    """A frame, with its class by the number of digits; None for an impossible identifier."""
    raw = int(digits, 16)
    if len(digits) <= STANDARD_DIGITS:
        return Frame(time, raw, data, channel, False) if raw <= STANDARD_MASK else None
    if raw <= EXTENDED_MASK:
        return Frame(time, raw, data, channel)
    kind = (
        Kind.ERROR if raw & ERROR_FLAG
        else Kind.REMOTE if raw & REMOTE_FLAG and raw & EXTENDED_FLAG
        else Kind.DATA
    )  # fmt: skip
    return Frame(time, raw & EXTENDED_MASK, data, channel, kind=kind)


def _seconds(text: str) -> float:
    """Time in s of a number, or of a date in the format of candump -t A (taken as UTC: only differences
    count)."""
    if text[4:5] != "-":
        whole, _, fraction = text.partition(".")
        return float(whole) + 1.0 if fraction == _OVERFLOWN else float(text)
    whole, _, fraction = text.partition(".")
    date = datetime.strptime(whole, "%Y-%m-%d %H:%M:%S").replace(tzinfo=UTC)
    return date.timestamp() + float(f"0.{fraction or 0}")


def _of_asc(event: str, time: float, base: int) -> Frame | None:
    """The frame of an ASC event; None for other events. Raises ValueError for invalid data."""
    if (found := _ASC_FRAME.match(event)) is not None:
        channel, can_id, extended, kind, rest = found.groups()
        tokens = rest.split()
        if kind in "rR":
            asked = int(tokens[0], base) if tokens and tokens[0].isalnum() and len(tokens[0]) <= 2 else 0
            return Frame(
                time, int(can_id, base), b"", channel, bool(extended), Kind.REMOTE, length=min(asked, 8)
            )
        length = min(int(tokens[0], base), 8)
        data = _bytes(tokens[1 : 1 + length], length, base)
        return Frame(time, int(can_id, base), data, channel, bool(extended))
    if (found := _ASC_ERROR.match(event)) is not None:
        return Frame(time, 0, b"", found["channel"], extended=False, kind=Kind.ERROR)
    if (found := _ASC_FD.match(event)) is not None:
        length = int(found["length"])
        return Frame(
            time,
            int(found["id"], base),
            _bytes(found["rest"].split()[:length], length, base),
            found["channel"],
            bool(found["extended"]),
            Kind.FD,
            rate=found["rate"] == "1",
            passive=found["passive"] == "1",
        )
    return None


def _bytes(tokens: list[str], length: int, base: int) -> bytes:
    if len(tokens) != length:
        raise ValueError("fewer bytes than the length says")
    return bytes([int(token, base) for token in tokens])
