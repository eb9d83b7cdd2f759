"""Reads frames from BUSMASTER logs and SocketCAN captures (pcap, pcapng)."""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from deeptruck_core.account import Account
from deeptruck_core.constants import DAY_S
from truck_bridge.can_logs.frames import EXTENDED_MASK, Frame, Kind, of_raw
from truck_bridge.can_logs.text_logs import lines_of, no_line
from truck_bridge.can_logs.whole import COPY
from truck_bridge.errors import InputError

_LINE = re.compile(
    r"(?P<h>\d+):(?P<m>\d+):(?P<s>\d+):(?P<fraction>\d{4})\s+(?:Rx|Tx)\s+(?P<channel>\d+)\s+(?P<id>\S+)\s+"
    r"(?P<kind>sr?|xr?)\s+(?P<length>\d+)\s*(?P<data>[0-9A-Fa-f\s]*)$"
)
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
            raise no_line(path, number, "BUSMASTER", line)
        stamp = 3600.0 * int(found["h"]) + 60.0 * int(found["m"]) + int(found["s"])
        stamp += int(found["fraction"]) / 1e4
        if relative:
            time += stamp
        else:
            day += DAY_S if stamp + day < time - DAY_S / 2 else 0.0  # it passes midnight
            time = stamp + day
        length = int(found["length"])
        remote = found["kind"].endswith("r")
        data = bytes(int(byte, base) for byte in found["data"].split()[:length])
        if len(data) != length and not remote:
            raise InputError(f"{path}, line {number}: fewer bytes than the length says; {COPY}")
        yield Frame(
            time,
            int(found["id"], base) & EXTENDED_MASK,
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
        body, channel = packet.data, packet.interface
        kind: Kind | None = Kind.DATA
        if packet.link in (_COOKED, _COOKED_2) and len(body) > 20:
            at, skip = (14, 16) if packet.link == _COOKED else (0, 20)
            known = _PROTOCOLS.get(struct.unpack_from(">H", body, at)[0])
            if packet.link == _COOKED_2:
                channel = f"can{struct.unpack_from('>I', body, 4)[0]}"
            body, kind = body[skip:], known
        if kind is None or packet.link not in (_CAN, _COOKED, _COOKED_2):
            account.total.set_aside("packets of other protocols", f"at {packet.time:.3f} s")
            continue
        if len(body) < 8 or len(body) < 8 + body[4]:
            raise InputError(f"{path}: a packet at {packet.time:.3f} s holds no whole CAN frame; {COPY}")
        (raw,) = struct.unpack_from(">I", body)
        content = body[8 : 8 + body[4]]
        frame = of_raw(packet.time, raw, content, channel)
        if frame.kind is Kind.REMOTE:
            frame = frame._replace(length=body[4])
        elif frame.kind is Kind.DATA and (kind is Kind.FD or body[4] > 8 or body[5] & 0x04):
            frame = frame._replace(kind=Kind.FD)
        yield frame


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
