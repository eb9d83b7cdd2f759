"""Messages of more than eight bytes (J1939-21, 5.10), reassembled from a log or a bus: broadcasts (BAM) and
transfers between two nodes (RTS/CTS). It sends nothing. Time is an argument.

A sender announces a message and numbers its packets of seven bytes. The receiver of a transfer requests
packets by CTS, and may request some again; the packets of a broadcast must arrive in order.
"""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, field
from typing import NamedTuple

from truck_bridge.j1939 import ids
from truck_bridge.j1939.ids import Identifier

RTS, CTS, END_OF_MESSAGE, BAM, ABORT = 16, 17, 19, 32, 255  # byte 1 of TP.CM
FORMATS = (ids.TRANSPORT_CONTROL >> 8, ids.TRANSPORT_DATA >> 8)
T1_S, T2_S, T3_S, T4_S = 0.75, 1.25, 1.25, 1.05  # J1939-21, 5.10.2.4
MOST = 200  # transfers under way, and different messages counted as broken
SMALLEST, LARGEST, PACKET = 9, 1785, 7  # bytes of a message, and of it in one packet
ENGINE_CONFIGURATION = 0xFEE3  # EC1; bytes 20-21 are SPN 544, the engine reference torque, 1 N m a bit


OTHERS = -1


class Message(NamedTuple):
    """One complete message; `destination` is ids.GLOBAL for a broadcast."""

    pgn: int
    source: int
    destination: int
    data: bytes


class Broken(NamedTuple):
    """A message that was announced but not completed; `pgn` is OTHERS beyond MOST different ones."""

    pgn: int
    source: int
    why: str


@dataclass
class _Session:
    """State of one message under way."""

    pgn: int
    size: int
    received: float  # when a frame of it came last
    patience: float  # how long the next one may take, s
    parts: list[bytes] = field(default_factory=list)
    asked: int = 0  # last packet that the receiver has requested
    missed: bool = False  # a packet: nothing counts until the receiver asks again

    @property
    def packets(self) -> int:
        return -(-self.size // PACKET)


class Transport:
    """Pass every frame to `hear`. `broken` counts incomplete messages; `finish` ends a log."""

    def __init__(self) -> None:
        self._open: dict[tuple[int, int], _Session] = {}  # by source and destination
        self._swept = -math.inf
        self.broken: Counter[Broken] = Counter()

    def hear(self, can_id: int, data: bytes, now: float) -> Message | None:
        """Process one frame; returns the message that it completes, if any."""
        if (can_id >> 16) & 0xFF not in FORMATS:
            return None
        pgn = ids.pgn_of(can_id)
        if pgn not in (ids.TRANSPORT_CONTROL, ids.TRANSPORT_DATA) or len(data) != 8:
            return None
        identifier = Identifier.of(can_id)
        if pgn == ids.TRANSPORT_DATA:
            return self._packet((identifier.source, identifier.destination), data, now)
        self._control(identifier, data, now)
        return None

    def finish(self) -> Counter[Broken]:
        """End the log; returns all incomplete messages, those under way included."""
        for key in list(self._open):
            self._break(key, "cut off")
        return self.broken

    def _control(self, identifier: Identifier, data: bytes, now: float) -> None:
        here, there = identifier.source, identifier.destination
        kind, pgn = data[0], int.from_bytes(data[5:8], "little")
        if kind == (BAM if there == ids.GLOBAL else RTS):
            self._begin((here, there), pgn, data, now)
        elif kind == CTS:
            self._ask((there, here), pgn, data, now)
        elif kind == END_OF_MESSAGE:
            self._close((there, here), pgn, "a packet was not received", now)
        elif kind == ABORT:  # by the sender or by the receiver
            self._close((here, there), pgn, "aborted", now)
            self._close((there, here), pgn, "aborted", now)

    def _begin(self, key: tuple[int, int], pgn: int, data: bytes, now: float) -> None:
        if now - self._swept > T2_S:
            self._sweep(now)
        size, packets = int.from_bytes(data[1:3], "little"), data[3]
        session = _Session(pgn, size, now, T1_S if key[1] == ids.GLOBAL else T3_S)
        before = self._open.get(key)
        if before is not None and (before.parts or (before.pgn, before.size) != (pgn, size)):
            self._break(key, "begun anew")
        if SMALLEST <= size <= LARGEST and packets == session.packets and pgn <= 0x3FFFF:
            if len(self._open) >= MOST and key[1] != ids.GLOBAL and key not in self._open:
                self._count(pgn, key[0], "one of too many at once")
                return
            self._open[key] = session
        else:
            self._open.pop(key, None)
            self._count(pgn, key[0], "wrong size")

    def _ask(self, key: tuple[int, int], pgn: int, data: bytes, now: float) -> None:
        """The receiver requests packets, or (no packets at once) more time."""
        session = self._alive(key, now)
        if session is None or session.pgn != pgn:
            return
        count, first = data[1], data[2]
        session.received, session.patience = now, T2_S if count else T4_S
        if count and not 1 <= first <= len(session.parts) + 1:
            self._break(key, "a packet was not received")
        elif count:
            del session.parts[first - 1 :]
            session.asked, session.missed = first - 1 + count, False

    def _packet(self, key: tuple[int, int], data: bytes, now: float) -> Message | None:
        session = self._alive(key, now)
        if session is None:
            return None
        number, part = data[0], data[1:]
        if session.parts and number == len(session.parts) and part == session.parts[-1]:
            return None  # received twice, as where a log holds two channels of one bus
        if session.missed or number != len(session.parts) + 1:
            session.missed = True
            if key[1] == ids.GLOBAL:
                self._break(key, "out of sequence")
            return None
        session.parts.append(part)
        more = key[1] == ids.GLOBAL or number < session.asked
        session.received, session.patience = now, T1_S if more else T3_S
        if number < session.packets:
            return None
        del self._open[key]
        return Message(session.pgn, *key, b"".join(session.parts)[: session.size])

    def _alive(self, key: tuple[int, int], now: float) -> _Session | None:
        """The session, unless it has timed out or the clock was set back."""
        session = self._open.get(key)
        if session is not None and abs(now - session.received) > session.patience:
            self._break(key, "timed out")
            return None
        return session

    def _close(self, key: tuple[int, int], pgn: int, why: str, now: float) -> None:
        session = self._alive(key, now)
        if session is not None and session.pgn == pgn:
            self._break(key, why)

    def _break(self, key: tuple[int, int], why: str) -> None:
        self._count(self._open.pop(key).pgn, key[0], why)

    def _count(self, pgn: int, source: int, why: str) -> None:
        broken = Broken(pgn, source, why)
        known = broken in self.broken or len(self.broken) < MOST
        self.broken[broken if known else Broken(OTHERS, ids.NULL, "of further kinds")] += 1

    def _sweep(self, now: float) -> None:
        """End what has timed out."""
        self._swept = now
        for key in list(self._open):
            self._alive(key, now)


def reference_torque(pgn: int, data: bytes) -> float | None:
    """Engine reference torque, N m, if the message is an engine configuration that contains it."""
    if pgn != ENGINE_CONFIGURATION or len(data) < 21:
        return None
    raw = int.from_bytes(data[19:21], "little")
    return float(raw) if raw <= 0xFAFF else None
