"""Checksums and counters of the command messages; they differ by maker and are part of the vehicle.

TSC1 (SPN 4206, 4207): counter 0..7, 15 = not available; the sum of bytes 1 to 7, the counter and the four
bytes of the identifier, folded to three bits (PACCAR PEC017; J1939-71). XBR (SPN 3189, 3188): counter 0..15,
the same sum folded to four bits. Both sit in byte 8: counter low, checksum high nibble.
"""

from __future__ import annotations

NONE, TSC1, XBR = "none", "tsc1", "xbr"
KINDS = (NONE, TSC1, XBR)
COUNTERS = {NONE: 0, TSC1: 8, XBR: 16}  # how many values the counter takes


def checksum(kind: str, can_id: int, data: bytes) -> int:
    """Checksum nibble of a frame whose counter is already in place."""
    total = sum(data[:7]) + (data[7] & 0x0F) + sum(can_id.to_bytes(4, "big"))
    if kind == TSC1:
        return (((total >> 6) & 0x03) + (total >> 3) + total) & 0x07
    if kind == XBR:
        return ((total >> 4) + total) & 0x0F
    return 0x0F


def sign(kind: str, can_id: int, data: bytes, count: int) -> bytes:
    """The frame with counter and checksum in byte 8; both 'not available' where the maker uses none."""
    if kind == NONE:
        return data[:7] + b"\xff"
    counted = data[:7] + bytes([count % COUNTERS[kind]])
    return data[:7] + bytes([counted[7] | checksum(kind, can_id, counted) << 4])


def verify(kind: str, can_id: int, data: bytes) -> bool:
    """True when the checksum nibble of the frame is right; always for NONE."""
    return kind == NONE or data[7] >> 4 == checksum(kind, can_id, data)
