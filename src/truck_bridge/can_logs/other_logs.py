"""Reads frames from BUSMASTER logs, SocketCAN captures (pcap, pcapng), and tables of raw frames.

Tables are those of cabana, Kvaser, SavvyCAN and loggers of the CLX000 series, and any other with a time, an
identifier (or the PGN and source address of J1939) and bytes.
"""

from __future__ import annotations

import csv
import re
import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import chain, islice, pairwise
from pathlib import Path

from can.util import dlc2len

from deeptruck_model._io.account import Account
from deeptruck_model._io.log_kinds import BYTES, COMMENT, DATA, GROUP, IDS, SOURCES, is_time, plain_name
from truck_bridge.can_logs.frames import (
    ERROR_FLAG,
    EXTENDED_FLAG,
    EXTENDED_MASK,
    REMOTE_FLAG,
    STANDARD_MASK,
    Frame,
    Kind,
)
from truck_bridge.can_logs.text_logs import lines_of
from truck_bridge.can_logs.whole import COPY
from truck_bridge.errors import InputError
from truck_bridge.j1939.ids import GLOBAL, Identifier

BUSMASTER = "***BUSMASTER"
_LINE = re.compile(
    r"(?P<h>\d+):(?P<m>\d+):(?P<s>\d+):(?P<fraction>\d{4})\s+(?:Rx|Tx)\s+(?P<channel>\d+)\s+(?P<id>\S+)\s+"
    r"(?P<kind>sr?|xr?)\s+(?P<length>\d+)\s*(?P<data>[0-9A-Fa-f\s]*)$"
)
_DAY_S = 86400.0
_PACKED = re.compile(r"(\d\d)T(\d\d):?(\d\d):?(\d\d)\.?(\d*)")
_SAMPLED = 200  # rows by which the form of numbers is found
_MICROSECONDS = 50.0  # between rows with whole numbers: more are no seconds
_CAN, _COOKED, _COOKED_2 = 227, 113, 276  # link types of captures
_PROTOCOLS = {0x000C: Kind.DATA, 0x000D: Kind.FD}  # of cooked captures
_MAGIC = {b"\xd4\xc3\xb2\xa1": ("<", 1e-6), b"\xa1\xb2\xc3\xd4": (">", 1e-6),
          b"\x4d\x3c\xb2\xa1": ("<", 1e-9), b"\xa1\xb2\x3c\x4d": (">", 1e-9)}  # fmt: skip


def busmaster(path: Path, account: Account) -> Iterator[Frame]:
    """The frames of a BUSMASTER log; time in s since midnight. Raises InputError at a damaged line."""
    base, relative, time, day = 16, False, 0.0, 0.0
    for number, line in lines_of(path):
        if line.startswith("***") or not line.strip():
            base = 10 if "***DEC***" in line else base
            relative = relative or "RELATIVE MODE" in line
            continue
        account.total.read += 1
        found = _LINE.match(line.strip())
        if found is None:
            raise InputError(f"{path}, line {number}: not a line of BUSMASTER: {line.strip()[:60]!a}")
        stamp = 3600.0 * int(found["h"]) + 60.0 * int(found["m"]) + int(found["s"])
        stamp += int(found["fraction"]) / 1e4
        if relative:
            time += stamp
        else:
            day += _DAY_S if stamp + day < time - _DAY_S / 2 else 0.0  # it passes midnight
            time = stamp + day
        length = int(found["length"])
        remote = found["kind"].endswith("r")
        data = bytes(int(byte, base) for byte in found["data"].split()[:length])
        if len(data) != length and not remote:
            raise InputError(f"{path}, line {number}: fewer bytes than the length says; {COPY}")
        yield Frame(
            time,
            int(found["id"], base),
            b"" if remote else data,
            found["channel"],
            found["kind"].startswith("x"),
            Kind.REMOTE if remote else Kind.FD if length > 8 else Kind.DATA,
            length if remote else 0,
        )


@dataclass(frozen=True)
class _Packet:
    """One packet of a capture: its time, its interface and link type, and its bytes."""

    time: float
    interface: str
    link: int
    data: bytes


def capture(path: Path, account: Account) -> Iterator[Frame]:
    """The frames of a capture. Packets of other protocols are counted. Raises InputError for another file."""
    data = path.read_bytes()
    ng = data[:4] == b"\x0a\x0d\x0d\x0a"
    if not ng and data[:4] not in _MAGIC:
        raise InputError(f"{path} does not begin as a capture (pcap or pcapng); {COPY}")
    for packet in _of_pcapng(path, data, account) if ng else _of_pcap(path, data, account):
        account.total.read += 1
        body, kind, channel = packet.data, Kind.DATA, packet.interface
        if packet.link in (_COOKED, _COOKED_2) and len(body) > 20:
            at, skip = (14, 16) if packet.link == _COOKED else (0, 20)
            known = _PROTOCOLS.get(struct.unpack_from(">H", body, at)[0])
            if packet.link == _COOKED_2:
                channel = f"can{struct.unpack_from('>I', body, 4)[0]}"
            body, kind = body[skip:], known or Kind.ERROR
            if known is None:
                account.total.set_aside("packets of other protocols", f"at {packet.time:.3f} s")
                continue
        elif packet.link != _CAN:
            account.total.set_aside("packets of other protocols", f"at {packet.time:.3f} s")
            continue
        if len(body) < 8 or len(body) < 8 + body[4]:
            raise InputError(f"{path}: a packet at {packet.time:.3f} s holds no whole CAN frame; {COPY}")
        (raw,) = struct.unpack_from(">I", body)
        content = body[8 : 8 + body[4]]
        if raw & ERROR_FLAG:
            kind = Kind.ERROR
        elif raw & REMOTE_FLAG:
            kind, content = Kind.REMOTE, b""
        elif body[4] > 8 or body[5] & 0x04:
            kind = Kind.FD
        extended = bool(raw & EXTENDED_FLAG)
        can_id = raw & (EXTENDED_MASK if extended else STANDARD_MASK)
        yield Frame(
            packet.time, can_id, content, channel, extended, kind, body[4] if kind is Kind.REMOTE else 0
        )


def _of_pcap(path: Path, data: bytes, account: Account) -> Iterator[_Packet]:
    order, tick = _MAGIC[data[:4]]
    if len(data) < 24:
        raise InputError(f"{path} is too short for a capture; {COPY}")
    link, at = struct.unpack_from(f"{order}I", data, 20)[0] & 0xFFFF, 24
    while at < len(data):
        if at + 16 > len(data):
            return _cut(path, account)
        seconds, fraction, length, _ = struct.unpack_from(f"{order}IIII", data, at)
        at += 16
        if length > 2**18:
            raise InputError(f"{path} is damaged at byte {at}; {COPY}")
        if at + length > len(data):
            return _cut(path, account)
        yield _Packet(seconds + fraction * tick, "can0", link, data[at : at + length])
        at += length
    return None


def _of_pcapng(path: Path, data: bytes, account: Account) -> Iterator[_Packet]:
    order, at = "<", 0
    links: list[tuple[int, float, str]] = []  # link type, tick and name of each interface
    while at < len(data):
        if data[at : at + 4] == b"\x0a\x0d\x0d\x0a":
            order, links = "<" if data[at + 8 : at + 12] == b"\x4d\x3c\x2b\x1a" else ">", []
        if at + 12 > len(data):
            return _cut(path, account)
        kind, length = struct.unpack_from(f"{order}II", data, at)
        if length < 12 or length % 4:
            raise InputError(f"{path} is damaged at byte {at}; {COPY}")
        if at + length > len(data):
            return _cut(path, account)
        body = data[at + 8 : at + length - 4]
        if kind == 1 and len(body) >= 8:
            options = dict(_options(body[8:], order))
            tick = options.get(9, b"\x06")[0]
            name = options.get(2, b"").rstrip(b"\0").decode("utf-8", "replace")
            links.append(
                (struct.unpack_from(f"{order}H", body)[0],
                 2.0 ** -(tick & 0x7F) if tick & 0x80 else 10.0**-tick, name or f"can{len(links)}")
            )  # fmt: skip
        elif kind == 6 and len(body) >= 20:
            interface, high, low, size = struct.unpack_from(f"{order}IIII", body)
            if interface >= len(links) or size > len(body) - 20:
                raise InputError(f"{path} is damaged at byte {at}; {COPY}")
            link, tick_s, name = links[interface]
            yield _Packet(((high << 32) | low) * tick_s, name, link, body[20 : 20 + size])
        at += length
    return None


def _options(data: bytes, order: str) -> Iterator[tuple[int, bytes]]:
    at = 0
    while at + 4 <= len(data):
        code, length = struct.unpack_from(f"{order}HH", data, at)
        if code == 0:
            return
        yield code, data[at + 4 : at + 4 + length]
        at += 4 + length + -length % 4


def _cut(path: Path, account: Account) -> None:
    """Account for a packet that is cut off at the end of a killed recorder's capture."""
    account.total.read += 1
    account.total.set_aside("frame cut off at the end of the log")
    account.remarks.append(f"{path} is cut off in its last packet, which is left out")


def table(path: Path, account: Account) -> Iterator[Frame]:
    """The frames of a table. Raises InputError at a damaged row."""
    lines = (line for _, line in lines_of(path))
    head, above = next(lines, ""), 0
    while head.startswith(COMMENT):
        head, above = next(lines, ""), above + 1
    mark = max(",;\t", key=head.count)
    names = [plain_name(cell) for cell in next(csv.reader([head.strip()], delimiter=mark))]
    rows = csv.reader(lines, delimiter=mark)
    some = list(islice(rows, _SAMPLED))
    form = _Form.of(names, some)
    if form.tick < 0.0:
        account.remarks.append("times are negative and fall: they are read without their sign")
    for number, row in enumerate(chain(some, rows), 2 + above):
        if any(row):
            yield _of_row(path, number, row, form, account)


@dataclass(frozen=True)
class _Form:
    """The meaning of the columns, and the format of their numbers; `tick` is negative for unsigned times that
    were written as signed (SavvyCAN: negative and falling)."""

    time: int
    tick: float
    number: int  # the identifier's column, or the PGN's
    parts: tuple[int | None, ...]  # beside the PGN, the columns of source, destination and priority
    base: int
    data: int | None
    each: tuple[int, ...]
    each_base: int
    bus: int | None
    extended: int | None
    length: int | None
    fd: int | None

    @classmethod
    def of(cls, names: Sequence[str], some: Sequence[Sequence[str]]) -> _Form:
        def at(*wanted: str) -> int | None:
            return next((names.index(name) for name in wanted if name in names), None)

        def cells(column: int) -> list[str]:
            return [row[column].strip() for row in some if len(row) > column]

        time = next(k for k, name in enumerate(names) if is_time(name))
        number = next(names.index(name) for name in (*IDS, GROUP) if name in names)
        parts: tuple[int | None, ...] = ()
        if names[number] == GROUP:
            parts = (at(*SOURCES), at("da", "dst", "destination"), at("priority", "prio"))
        each = tuple(k for k, name in enumerate(names) if BYTES.fullmatch(name))
        stamps = [cell for cell in cells(time) if cell]
        whole = all(cell.removeprefix("-").isdigit() for cell in stamps)
        numbers = [float(cell) for cell in stamps if re.fullmatch(r"-?\d+\.?\d*", cell)]
        turned = bool(numbers) and max(numbers) < 0.0 and numbers[-1] < numbers[0]
        steps = [abs(b - a) for a, b in pairwise(numbers) if (b < a if turned else b > a)]
        micro = whole and bool(steps) and sorted(steps)[len(steps) // 2] > _MICROSECONDS
        tick = 1e-6 if micro or names[time].endswith("us") else 1.0
        data = at(*DATA)
        content = [cell for k in ([data] if data is not None else each) for cell in cells(k)]
        return cls(
            time, -tick if turned else tick, number, parts, _base(cells(number)), data,
            each, _base([byte for cell in content for byte in cell.split()]), at("bus", "channel", "chn"),
            at("extended", "ide", "ext", "flags"), at("datalength", "length", "len", "dlc"),
            at("edl", "fdf", "fd"),
        )  # fmt: skip


def _base(cells: Sequence[str]) -> int:
    """16 if a letter or a leading zero shows it, else 10."""
    hexadecimal = any(re.search(r"[a-fA-F]|^0x|^0\d", cell.rstrip("xX")) for cell in cells)
    return 16 if hexadecimal else 10


def _time(cell: str, tick: float) -> float:
    """The time of a row in s: a number of ticks, or a time of day behind the day of the month, as
    01T102030123."""
    packed = _PACKED.fullmatch(cell.strip())
    if packed is None:
        return float(cell) * tick
    day, hours, minutes, seconds, fraction = packed.groups()
    of_day = 3600.0 * int(hours) + 60.0 * int(minutes) + int(seconds) + float(f"0.{fraction or 0}")
    return _DAY_S * int(day) + of_day


def _identifier(cells: list[str], form: _Form) -> int:
    def read(column: int | None, otherwise: int = 0) -> int:
        if column is None:
            return otherwise
        return int(cells[column].strip().rstrip("xX").removeprefix("0x"), form.base)

    if not form.parts:
        return read(form.number)
    source, destination, priority = form.parts
    parts = Identifier(read(priority, 6), read(form.number), read(destination, GLOBAL), read(source))
    if not (
        0 <= parts.priority <= 7
        and 0 <= parts.pgn <= 0x3FFFF
        and max(parts.destination, parts.source) <= 0xFF
    ):
        raise ValueError("a priority, PGN or address that cannot be")
    return parts.can_id


def _of_row(path: Path, number: int, cells: list[str], form: _Form, account: Account) -> Frame:
    account.total.read += 1
    try:
        can_id = _identifier(cells, form)
        if form.data is not None:
            text = cells[form.data].strip().removeprefix("0x")
            apart = form.each_base == 10 and " " in text
            data = bytes(map(int, text.split())) if apart else bytes.fromhex(text)
        else:
            data = bytes(
                int(cells[k], form.each_base) for k in form.each if len(cells) > k and cells[k].strip()
            )
        if form.length is not None:
            stated = int(cells[form.length])
            if form.data is None:
                data = data[:stated]
            if len(data) not in (stated, dlc2len(min(stated, 15))):
                raise ValueError("another number of bytes than the length says")
        said = cells[form.extended].strip().lower() if form.extended is not None else ""
        time = _time(cells[form.time], form.tick)
        if not 0 <= can_id <= EXTENDED_MASK or not -1e12 < time < 1e12:
            raise ValueError("an identifier or time that cannot be")
    except (ValueError, IndexError) as error:
        raise InputError(f"{path}, line {number}: not a row of CAN frames ({str(error)[:80]})") from None
    channel = cells[form.bus].strip() if form.bus is not None and len(cells) > form.bus else ""
    extended = bool(form.parts) or can_id > STANDARD_MASK or "x" in said or said in ("1", "true")
    marked = form.fd is not None and cells[form.fd].strip().lower() in ("1", "true")
    return Frame(time, can_id, data, channel, extended, Kind.FD if marked or len(data) > 8 else Kind.DATA)
