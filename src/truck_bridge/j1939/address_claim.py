"""Address claim (SAE J1939-81): 250 ms unopposed, and contention by NAME. The loser sends only cannot-claim.
An address of 0 to 127 or 248 to 253 that was ours is claimed again without the wait. Time is an argument.
"""

from __future__ import annotations

import math

from truck_bridge.j1939 import ids
from truck_bridge.j1939.ids import Identifier

UNOPPOSED_S = 0.25
_FORMATS = (ids.ADDRESS_CLAIMED >> 8, ids.REQUEST >> 8)  # of nearly all frames it is another
_REQUEST_FOR_CLAIM = ids.ADDRESS_CLAIMED.to_bytes(3, "little")


def name(identity: int, function: int = 0xFF, industry_group: int = 1, manufacturer: int = 0x7FF) -> bytes:
    """The 64-bit NAME of a node that cannot take another address (J1939-81, 4.1.1); the lower NAME wins.

    Manufacturer 0x7FF and function 0xFF are 'not available'; industry group 1 is on-highway.
    """
    word = identity | manufacturer << 21 | function << 40 | industry_group << 60
    return word.to_bytes(8, "little")


class AddressClaim:
    """One address claim. Call `start`, pass every frame to `hear`, send what `due` returns; `claimed` says
    whether frames may be sent."""

    def __init__(self, own_name: bytes, address: int) -> None:
        self._name = own_name
        self._address = address
        self._started: float | None = None
        self._pending: list[bool] = []  # claims (True) and cannot-claims (False) to send
        self._spoke_at = -math.inf  # when we claimed last, and a bus may echo it
        self._held = False  # once unopposed it stays ours, whatever the clock does
        self.lost = False

    def start(self, now: float) -> None:
        """Announce the address; also after a bus interruption."""
        waits = 128 <= self._address <= 247
        self._started, self._held, self.lost, self._pending = now, self._held and not waits, False, [True]

    def stop(self) -> None:
        """Give the address up without sending a message."""
        self._started, self._pending = None, []

    def claimed(self, now: float) -> bool:
        """Whether the claim was unopposed for 250 ms, and has not been lost since."""
        if self._started is not None and now - self._started >= UNOPPOSED_S:
            self._held = True
        return self._held and self._started is not None and not self.lost

    def hear(self, can_id: int, data: bytes, now: float) -> None:
        """Process contention and requests. Within 250 ms of our claim, our own NAME is taken as an echo;
        later it is from a duplicate node, and the address is given up."""
        if self._started is None or can_id >> 16 & 0xFF not in _FORMATS:
            return
        identifier = Identifier.of(can_id)
        echo = data == self._name and now - self._spoke_at <= UNOPPOSED_S
        if identifier.pgn == ids.ADDRESS_CLAIMED and identifier.source == self._address and not echo:
            self.lost = self.lost or int.from_bytes(data, "little") <= int.from_bytes(self._name, "little")
            self._pending.append(not self.lost)
        asked = identifier.destination in (self._address, ids.GLOBAL)
        if identifier.pgn == ids.REQUEST and asked and data[:3] == _REQUEST_FOR_CLAIM:
            self._pending.append(not self.lost)

    def due(self, now: float) -> list[tuple[int, bytes]]:
        """Identifier and data of the frames to send now."""
        pending, self._pending = self._pending, []
        self._spoke_at = now if pending else self._spoke_at
        sources = (self._address if claim else ids.NULL for claim in pending)
        return [
            (Identifier(6, ids.ADDRESS_CLAIMED, ids.GLOBAL, source).can_id, self._name) for source in sources
        ]
