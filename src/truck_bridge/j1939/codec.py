"""Converts messages to numbers and back; invalid values are flagged. cantools reads the DBC.

J1939-71 table 1 reserves the top of every range: of one byte 0xFE says error, 0xFF not available, 0xFB..0xFD
nothing that is a number; of two bytes 0xFExx and 0xFFxx. All of them become NaN with a flag, and so does any
raw value above the range in the DBC.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from importlib import resources
from pathlib import Path
from typing import NamedTuple

import cantools.database
from cantools.database.can import Message

from deeptruck_core.reading import plain
from truck_bridge.errors import InputError
from truck_bridge.j1939.ids import Identifier, pgn_of

ERROR, NOT_AVAILABLE, OUT_OF_RANGE = "error", "not available", "out of range"


@dataclass(frozen=True)
class Signal:
    """Position and scaling of a number: value = offset + scale raw, raw = (word >> start) & mask, with the
    word little endian."""

    name: str
    start: int
    bits: int
    scale: float
    offset: float
    last: int  # highest raw value that is a number
    unit: str
    spn: int

    @property
    def mask(self) -> int:
        return (1 << self.bits) - 1

    def flag(self, raw: int) -> str:
        """The reason why a raw value above `last` is not a number."""
        top = raw >> (self.bits - 8) if self.bits >= 8 else raw | (0xFF << self.bits) & 0xFF
        return {0xFF: NOT_AVAILABLE, 0xFE: ERROR}.get(top, OUT_OF_RANGE)

    def value(self, raw: int) -> float:
        """The number, or NaN if the raw value does not stand for one."""
        return self.offset + self.scale * raw if raw <= self.last else math.nan

    def raw(self, value: float) -> int:
        """Nearest raw value; NaN becomes 'not available'. Raises ValueError outside the range."""
        if math.isnan(value):
            return self.mask
        raw = round((value - self.offset) / self.scale)
        if not 0 <= raw <= self.last:
            low, high = self.offset, self.offset + self.scale * self.last
            raise ValueError(f"{self.name} = {value} {self.unit} is outside {low:g}..{high:g}")
        return raw


class Decoded(NamedTuple):
    """One decoded message: numbers by signal name (NaN if invalid), and the reasons for NaN."""

    name: str
    source: int
    values: dict[str, float]
    flags: dict[str, str]


class Layout:
    """One message of the DBC, prepared for fast decoding."""

    def __init__(self, message: Message) -> None:
        self.name: str = message.name
        self.pgn = pgn_of(message.frame_id)
        self.priority = (message.frame_id >> 26) & 7
        self.period_s: float | None = message.cycle_time / 1000 if message.cycle_time else None
        self.signals = {s.name: _signal(s) for s in message.signals}
        self._fast = [(s.name, s.start, s.mask, s.last, s.scale, s.offset, s) for s in self.signals.values()]
        self._slots = {s.name: (s, s.start, ~(s.mask << s.start)) for s in self.signals.values()}

    def decode(self, data: bytes, source: int = 0) -> Decoded:
        """Decode eight bytes. A short frame is filled with 0xFF, which makes the missing signals not
        available."""
        if len(data) < 8:
            data = bytes(data) + b"\xff" * (8 - len(data))
        word = int.from_bytes(data, "little")
        values, flags = {}, {}
        for name, start, mask, last, scale, offset, signal in self._fast:
            raw = (word >> start) & mask
            if raw <= last:
                values[name] = offset + scale * raw
            else:
                values[name] = math.nan
                flags[name] = signal.flag(raw)
        return Decoded(self.name, source, values, flags)

    def encode(self, values: Mapping[str, float]) -> bytes:
        """Encode numbers to eight bytes; unnamed signals are not available. Raises ValueError for values out
        of range."""
        word = (1 << 64) - 1
        for name, value in values.items():
            signal, start, others = self._slots[name]
            word = word & others | signal.raw(value) << start
        return word.to_bytes(8, "little")

    def can_id(self, source: int, destination: int = 0xFF) -> int:
        """Identifier of this message between two addresses."""
        return Identifier(self.priority, self.pgn, destination, source).can_id


class Codec:
    """All messages of the DBC, by parameter group and by name; later files replace earlier messages."""

    def __init__(self, layouts: Iterable[Layout]) -> None:
        self.by_name = {layout.name: layout for layout in layouts}
        self.by_pgn = {layout.pgn: layout for layout in self.by_name.values()}

    def decode(self, can_id: int, data: bytes) -> Decoded | None:
        """Numbers of one frame, or None for a parameter group that is not in the DBC."""
        layout = self.by_pgn.get(pgn_of(can_id))
        return None if layout is None else layout.decode(data, can_id & 0xFF)

    def __getitem__(self, name: str) -> Layout:
        try:
            return self.by_name[name]
        except KeyError:
            raise InputError(f"no message '{name}'; known: {', '.join(self.by_name)}") from None


def _signal(signal: cantools.database.can.Signal) -> Signal:
    if signal.byte_order != "little_endian" or signal.is_signed or signal.maximum is None:
        raise InputError(
            f"signal {signal.name}: J1939 wants little endian, unsigned, with a range; mend it in the DBC"
        )
    scale, offset = float(signal.scale), float(signal.offset)
    return Signal(
        signal.name,
        signal.start,
        signal.length,
        scale,
        offset,
        round((float(signal.maximum) - offset) / scale),
        signal.unit or "",
        signal.spn or 0,
    )


@cache
def load(*extra: Path) -> Codec:
    """The codec of our own DBC, with messages of the user's DBC files added or replaced.

    Raises InputError if a file is missing or is not a DBC.
    """
    texts = [(resources.files(__package__).joinpath("j1939.dbc").read_text(), "j1939.dbc")]
    for path in extra:
        if path.exists() and not path.is_file():  # a pipe would never answer
            raise InputError(f"cannot read {path}: it is no file; name a DBC file")
        try:
            texts.append((path.read_text(encoding="cp1252"), str(path)))
        except (OSError, UnicodeDecodeError) as error:
            raise InputError(f"cannot read {path}: {plain(str(error))}; name a DBC file") from None
    layouts: list[Layout] = []
    for text, name in texts:
        try:
            database = cantools.database.load_string(text, "dbc")
            layouts += [Layout(message) for message in database.messages]
        except (
            Exception
        ) as error:  # cantools fails in many ways on a damaged file, and so do its numbers here
            raise InputError(
                f"{name} is not a DBC file: {plain(str(error)) or type(error).__name__}"
            ) from None
    return Codec(layouts)
