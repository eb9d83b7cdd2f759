"""Fault reports of controllers (DM1, J1939-73) and the vehicle identification number (VIN, J1939-71).

DM1 is sent once a second: two bytes of lamps, then four bytes per code; two or more codes need several frames
(see `transport`). A code in one of the three old layouts is marked as old, but its layout is not known.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

from truck_bridge.j1939 import ids
from truck_bridge.j1939.transport import Message

DM1, VIN = 0xFECA, 0xFEEC
GROUPS = {DM1: "DM1", VIN: "VIN"}
LAMPS = {  # where each sits in byte 1: SPN 987, 624, 623 and 1213
    "protect_lamp": 0,
    "amber_warning_lamp": 2,
    "red_stop_lamp": 4,
    "malfunction_lamp": 6,
}
OFF, ON = 0, 1
DERATE = 1569  # SPN of the code that says so: engine protection torque derate
NO_SPN = (0, 0x7FFFF)  # of the code that stands for none, new and old
NO_COUNT = 127
WHOLE = 8  # bytes of a frame
_NUMBER = re.compile(rb"[0-9A-Z]{1,200}")


class Code(NamedTuple):
    """One code: the faulty part (SPN) and the kind of fault (FMI). `others` are the SPNs that it has in the
    old layouts."""

    spn: int
    fmi: int
    others: tuple[int, ...] = ()

    @property
    def readings(self) -> tuple[int, ...]:
        """Every SPN that it may mean."""
        return (self.spn, *self.others)

    def __str__(self) -> str:
        doubt = f" (old layout: may be {' or '.join(map(str, self.others))})" if self.others else ""
        return f"SPN {self.spn} FMI {self.fmi}{doubt}"


@dataclass(frozen=True)
class Report:
    """One DM1. `lamps` holds those reported on or off; `counts` the occurrences of each code, -1 if
    unknown."""

    lamps: dict[str, bool]
    counts: dict[Code, int]

    @property
    def active(self) -> list[Code | str]:
        """Codes and lamps that are on."""
        return [*self.counts, *(lamp for lamp, on in self.lamps.items() if on)]

    def only(self, wanted: Callable[[Code | str], bool]) -> Report:
        """The report with the codes and lamps that are wanted."""
        return Report(
            {lamp: on for lamp, on in self.lamps.items() if wanted(lamp)},
            {code: count for code, count in self.counts.items() if wanted(code)},
        )


def single(can_id: int, data: bytes) -> Message | None:
    """A DM1 or VIN that fits into one frame, as a message."""
    pgn = ids.pgn_of(can_id)
    return Message(pgn, can_id & 0xFF, ids.GLOBAL, bytes(data)) if pgn in GROUPS else None


def report(data: bytes) -> Report | None:
    """A DM1's content; None if the bytes are not lamps and complete codes. Padding is ignored."""
    codes, rest = divmod(len(data) - 2, 4)
    padded = len(data) <= WHOLE or all(byte == 0xFF for byte in data[len(data) - rest :])
    if codes < 1 or not padded:
        return None
    counts = {}
    for at in range(2, 2 + 4 * codes, 4):
        four = data[at : at + 4]
        if (code := _code(four)).spn not in NO_SPN:
            count = four[3] & 0x7F
            counts[code] = -1 if count == NO_COUNT else count
    lamps = {name: (data[0] >> bit) & 3 for name, bit in LAMPS.items()}
    return Report({name: state == ON for name, state in lamps.items() if state in (OFF, ON)}, counts)


def frame(spn: int, fmi: int, lamp: str = "") -> bytes:
    """A DM1 with one code and at most one lamp that is on; without a lamp, that nothing is active."""
    lamps = sum((ON if name == lamp else OFF) << bit for name, bit in LAMPS.items())
    code = (spn & 0xFFFF) | (spn >> 16 << 5 | fmi) << 16 | NO_COUNT << 24 if lamp else 0
    return bytes([lamps, 0xFF]) + code.to_bytes(4, "little") + b"\xff\xff"


def _code(four: bytes) -> Code:
    """SPN of 19 bits, the highest three in byte 3 above the FMI; the old layouts in order 3, 1, 2."""
    first, second, third, last = four
    spn, fmi = first | second << 8 | third >> 5 << 16, third & 0x1F
    if not last & 0x80:
        return Code(spn, fmi)
    old = (first << 11 | second << 3 | third >> 5, second << 11 | first << 3 | third >> 5)
    return Code(spn, fmi, tuple(other for other in dict.fromkeys(old) if other != spn))


def vehicle_number(data: bytes) -> str | None:
    """The VIN up to its '*', or 17 characters without one; None if the bytes are no VIN."""
    number, star, _ = data.partition(b"*")
    number = number.strip(b" \0\xff")
    if not _NUMBER.fullmatch(number) or not (star or len(number) == 17):
        return None
    return number.decode("ascii")
