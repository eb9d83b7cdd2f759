"""Counter and checksum of a frame, restated for the core (J1939-71, SPN 4207 and SPN 3188)."""

from __future__ import annotations

COUNTS = {"tsc1": 8, "xbr": 16}


def checksum_ok(kind: str, can_id: int, word: int) -> bool:
    """True when byte 8 fits the other seven, the counter and the identifier."""
    counter, found = (word >> 56) & 0xF, (word >> 60) & 0xF
    if kind == "none":
        return counter == 0xF and found == 0xF
    total = sum(word.to_bytes(8, "little")[:7]) + counter + sum(can_id.to_bytes(4, "big"))
    if kind == "tsc1":
        return found == ((((total >> 6) & 3) + (total >> 3) + total) & 7)
    return found == (((total >> 4) + total) & 15)


def counter_ok(kind: str, word: int, before: int | None) -> bool:
    """True when the counter follows the one before; any valid one does at the start."""
    if kind == "none":
        return True
    counter = (word >> 56) & 0xF
    if counter >= COUNTS[kind]:
        return False
    return before is None or counter == (before + 1) % COUNTS[kind]
