"""29-bit identifiers (SAE J1939-21, 5.2): priority, parameter group, destination, source."""

from __future__ import annotations

from dataclasses import dataclass

GLOBAL = 0xFF  # destination of a broadcast
NULL = 0xFE  # source address of a node that has none

REQUEST = 0xEA00
TRANSPORT_DATA = 0xEB00
TRANSPORT_CONTROL = 0xEC00
ADDRESS_CLAIMED = 0xEE00
PDU2 = 0xF0  # from this PDU format on, the low byte extends the group and the frame is a broadcast


@dataclass(frozen=True)
class Identifier:
    """The parts of an identifier. The low byte of `pgn` is zero if the frame has a destination (PDU1)."""

    priority: int
    pgn: int
    destination: int
    source: int

    @classmethod
    def of(cls, can_id: int) -> Identifier:
        """The parts of a 29-bit identifier."""
        return cls((can_id >> 26) & 7, pgn_of(can_id), destination_of(can_id), can_id & 0xFF)

    @property
    def can_id(self) -> int:
        """The 29-bit identifier."""
        low = self.destination if (self.pgn >> 8) & 0xFF < PDU2 else 0
        return self.priority << 26 | (self.pgn | low) << 8 | self.source


def pgn_of(can_id: int) -> int:
    """Parameter group number, without the destination."""
    pgn = (can_id >> 8) & 0x3FFFF
    return pgn & 0x3FF00 if (pgn >> 8) & 0xFF < PDU2 else pgn


def destination_of(can_id: int) -> int:
    """Destination address; GLOBAL for broadcasts."""
    return (can_id >> 8) & 0xFF if (can_id >> 16) & 0xFF < PDU2 else GLOBAL
