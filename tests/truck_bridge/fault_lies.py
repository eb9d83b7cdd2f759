"""What a node, a gateway or a broken sensor may make of frames and readings.

A lie is a line: kind, signals of the vehicle's table (or `all`), size. It is told from its first frame on.
"""

from __future__ import annotations

import math
from collections import Counter, defaultdict, deque
from collections.abc import Iterator
from dataclasses import dataclass, field

import can

from truck_bridge.j1939 import checksums
from truck_bridge.safety import Heard, Measured
from truck_bridge.vehicles import Vehicle

SPREAD = {  # a change that matters, in the signal's unit
    "speed": 4.0, "second_speed": 4.0, "engine_speed": 50.0, "gear_ratio": 1.0, "engine_percent": 40.0,
    "retarder_percent": 40.0, "accelerator": 4.0, "brake_pedal": 2.0, "pitch": 3.0, "gap": 10.0,
    "leader_speed": 4.0,
}  # fmt: skip
KINDS = {  # size: what it means
    "freeze": "nothing: the last frame is repeated for ever",
    "hold": "nothing: the last value is repeated, the frame around it lives",
    "value": "the value that is told",
    "scale": "factor",
    "offset": "in units of SPREAD",
    "drift": "in units of SPREAD a second",
    "spike": "in units of SPREAD, in every tenth frame",
    "reorder": "every so manieth frame comes after the next one",
    "error": "nothing: the sentinel 'error'",
    "absent": "nothing: the sentinel 'not available'",
    "beyond": "nothing: the greatest number that the field holds",
    "second": "source address of a second sender that tells half of the value beside the true frame",
    "double": "nothing: the same address sends twice, every second frame with half of the value",
    "again": "nothing: every frame comes twice",
    "seldom": "one frame in so many comes",
    "late": "s that each frame is late",
    "silent": "nothing: the message does not come",
}


@dataclass
class Lie:
    """What becomes of a vehicle's frames."""

    vehicle: Vehicle
    kind: str
    signals: tuple[str, ...]
    size: float = math.nan
    _since: float = math.nan
    _kept: dict[int, bytes] = field(default_factory=dict)
    _late: dict[int, deque[tuple[float, bytes]]] = field(default_factory=lambda: defaultdict(deque))
    _count: Counter[int | str] = field(default_factory=Counter)

    def __post_init__(self) -> None:
        assert self.kind in KINDS
        if self.signals == ("all",):
            self.signals = tuple(s.name for heard in self.vehicle.table.heard for s in heard.signals)
        self._heard = {
            heard.key: heard
            for heard in self.vehicle.table.heard
            if any(signal.name in self.signals for signal in heard.signals)
        }
        assert self._heard, f"no signal {self.signals} in {self.vehicle.name}"

    def messages(self, message: can.Message, now: float) -> Iterator[can.Message]:
        """What arrives in place of a frame."""
        heard = self._heard.get(message.arbitration_id & 0x03FF_FFFF)
        if heard is None:
            yield message
            return
        self._since = now if math.isnan(self._since) else self._since
        for can_id, data in self._frames(heard, message.arbitration_id, bytes(message.data), now):
            yield can.Message(arbitration_id=can_id, data=data, is_extended_id=True)

    def _frames(self, heard: Heard, can_id: int, data: bytes, now: float) -> Iterator[tuple[int, bytes]]:
        kept = self._kept.setdefault(heard.key, data)
        if self.kind == "silent":
            return
        if self.kind == "freeze":
            yield can_id, kept
        elif self.kind == "again":
            yield from ((can_id, data), (can_id, data))
        elif self.kind == "seldom":
            self._count[heard.key] += 1
            if self._count[heard.key] % self.size == 1:
                yield can_id, data
        elif self.kind == "reorder":
            self._count[heard.key] += 1
            waits = self._late[heard.key]
            if self._count[heard.key] % self.size == 0:
                waits.append((now, data))
                return
            yield can_id, data
            while waits:
                yield can_id, waits.popleft()[1]
        elif self.kind == "late":
            late = self._late[heard.key]
            late.append((now, data))
            while late and now - late[0][0] >= self.size - 1e-9:
                yield can_id, late.popleft()[1]
        elif self.kind in ("second", "double"):
            yield can_id, data
            other = can_id & ~0xFF | int(self.size) if self.kind == "second" else can_id
            yield other, self._bent(heard, other, data, kept, now)
        else:
            yield can_id, self._bent(heard, can_id, data, kept, now)

    def _bent(self, heard: Heard, can_id: int, data: bytes, kept: bytes, now: float) -> bytes:
        word, then = int.from_bytes(data, "little"), int.from_bytes(kept, "little")
        for signal in heard.signals:
            if signal.name in self.signals:
                raw = self._raw(signal, word, then, now - self._since)
                word = word & ~signal.field.mask | raw << signal.field.start
        bent = word.to_bytes(8, "little")
        return bent if heard.check == "none" else checksums.sign(heard.check, can_id, bent, data[7] & 0x0F)

    def _raw(self, signal: Measured, word: int, then: int, elapsed: float) -> int:
        f = signal.field
        raw, top = (word & f.mask) >> f.start, (1 << f.bits) - 1
        value = f.offset + f.scale * raw
        match self.kind:
            case "hold":
                return (then & f.mask) >> f.start
            case "error":
                return top - (1 << max(f.bits - 8, 0)) if f.bits >= 8 else top - 1
            case "absent":
                return top
            case "beyond":
                return f.last
            case "value":
                value = self.size
            case "scale":
                value *= self.size
            case "offset":
                value += self.size * SPREAD[signal.name]
            case "drift":
                value += self.size * SPREAD[signal.name] * elapsed
            case "spike":
                self._count[signal.name] += 1
                value += self.size * SPREAD[signal.name] * (self._count[signal.name] % 10 == 0)
            case "second" | "double":
                value *= 0.5
        return min(max(round((value - f.offset) / f.scale), 0), f.last)


RADAR_KINDS = {  # of gap, m, and the leader's speed, m/s; as above, and
    "absent": "nothing: NaN",
    "beyond": "nothing: 250 m, 130 m/s",
    "error": "nothing: -1",
    "other": "every second reading is of another object, at this share of the value",
    "ghost": "s for which one object at half the distance is seen, once in 3 s",
    "past": "s that stamps are old",
    "future": "s that stamps are ahead",
}


@dataclass
class RadarLie:
    """What becomes of a radar's readings."""

    kind: str
    signals: tuple[str, ...]
    size: float = math.nan
    _since: float = math.nan
    _kept: tuple[float, float] | None = None
    _past: list[tuple[float, float]] = field(default_factory=list)

    def readings(self, now: float, gap: float, speed: float) -> list[tuple[float, float, float]]:
        """Gap, speed and age of the stamp of what arrives in place of a reading."""
        self._since = now if math.isnan(self._since) else self._since
        true, elapsed = (gap, speed), now - self._since
        self._kept = self._kept or true
        self._past.append(true)
        count = len(self._past)
        if self.kind == "silent" or (self.kind == "seldom" and count % self.size != 1):
            return []
        told = tuple(
            self._bent(n, elapsed) if name in self.signals else true[n]
            for n, name in enumerate(("gap", "leader_speed"))
        )
        age = {"past": self.size, "future": -self.size}.get(self.kind, 0.0)
        if self.kind == "reorder":  # the newest stamp, and then the one before again
            age = 0.15 if count % self.size == 0 else 0.0
        return [(told[0], told[1], age)] * (2 if self.kind == "again" else 1)

    def _bent(self, n: int, elapsed: float) -> float:
        assert self._kept is not None
        count, value = len(self._past), self._past[-1][n]
        size = self.size * (SPREAD["gap"], SPREAD["leader_speed"])[n]
        match self.kind:
            case "hold":
                return self._kept[n]
            case "value":
                return self.size
            case "error":
                return -1.0
            case "beyond":
                return (250.0, 130.0)[n]
            case "absent":
                return math.nan
            case "scale":
                return value * self.size
            case "offset":
                return value + size
            case "drift":
                return value + size * elapsed
            case "spike":
                return value + size * (count % 10 == 0)
            case "late":
                return self._past[max(count - 1 - round(10 * self.size), 0)][n]
            case "other":
                return value * self.size if count % 2 else value
            case "ghost":
                return value * (0.5, 1.0)[n] if elapsed % 3.0 < self.size - 0.05 else value
        return value
