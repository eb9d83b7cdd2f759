"""Byte offsets of the numbers in serialised messages, so that numpy can read thousands of messages at once.

One message is decoded byte by byte by its definition (XCDR1, or the ROS 1 form); messages with the same
lengths and names share its layout and are read as columns. Byte order and alignment: OMG DDS-XTypes 1.3,
7.4.1.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deeptruck_core.arrays import Array
from deeptruck_core.errors import InputError

Bytes = NDArray[np.uint8]
Index = NDArray[np.int64]

_SIZES = {
    **dict.fromkeys(("bool", "byte", "char", "octet", "int8", "uint8"), 1),
    **dict.fromkeys(("int16", "uint16"), 2),
    **dict.fromkeys(("int32", "uint32", "float32"), 4),
    **dict.fromkeys(("int64", "uint64", "float64"), 8),
}
_CODES = {"bool": "u1", "byte": "u1", "char": "u1", "octet": "u1", "float32": "f4", "float64": "f8"}
_NAMED = re.compile(r"^(?P<values>.*?)\[(?P<names>\w+)=(?P<wanted>.+)\]$")
_BRACKETS = re.compile(r"\[[^\]]*\]")
_NUMBERED = re.compile(r"^(?P<values>.*?)\[(?P<index>\d+)\]$")

HEADER = 4  # bytes of the encapsulation before a message, from whose end on values are aligned; ROS 1: none
LENGTH = 4  # bytes of the length, a uint32, before a sequence or a text
PADDING = 3  # bytes: RTPS fills up to a multiple of four
STAMP = ("header.stamp.sec", "header.stamp.nanosec")


@dataclass
class Layout:
    """Offsets in one message: number arrays by path as (offset, count, dtype), texts, and the bytes on which
    the offsets depend. `lists` are the paths that are arrays or sequences."""

    size: int
    numbers: dict[str, tuple[int, int, str]] = field(default_factory=dict)
    texts: dict[str, list[str]] = field(default_factory=dict)
    fixed: list[tuple[int, bytes]] = field(default_factory=list)
    lists: set[str] = field(default_factory=set)

    def locate(self, path: str) -> tuple[int, str] | None:
        """(offset, dtype) of `twist.linear.x`, `data[3]` or `position[name=gear]`; None if the path does not
        exist."""
        index = 0
        if match := _NAMED.match(path):
            values = match["values"]
            siblings = self.texts.get(f"{values.rpartition('.')[0]}.{match['names']}".lstrip("."), [])
            if match["wanted"] not in siblings:
                return None
            path, index = values, siblings.index(match["wanted"])
        elif match := _NUMBERED.match(path):
            path, index = match["values"], int(match["index"])
        offset, count, dtype = self.numbers.get(path, (0, 0, "u1"))
        return (offset + index * np.dtype(dtype).itemsize, dtype) if index < count else None


class Walker:
    """Decodes messages of one bag. `definitions`: fields by type name as in rosbags' typestore; `ros1`: the
    ROS 1 serialisation; `bag`: its name in error messages."""

    def __init__(self, definitions: Mapping[str, Any], *, ros1: bool = False, bag: str = "the bag") -> None:
        self.definitions = definitions
        self.ros1 = ros1
        self.bag = bag

    def has(self, msgtype: str, path: str) -> bool:
        """Whether a type defines this path; indices and names inside brackets are ignored."""
        name, _, rest = _BRACKETS.sub("", path).partition(".")
        fields = dict(self.definitions[msgtype][1]) if msgtype in self.definitions else {}
        if name not in fields:
            return False
        kind, detail = fields[name]
        if kind.name in ("ARRAY", "SEQUENCE"):
            kind, detail = detail[0]
        if kind.name == "NAME":
            return bool(rest) and self.has(detail, rest)
        return not rest and detail[0] not in ("string", "wstring")

    def walk(self, msgtype: str, message: bytes) -> Layout:
        """The layout of one message. Raises InputError if the bytes do not fit the definition."""
        layout = Layout(len(message))
        start = 0 if self.ros1 else HEADER
        order = "<" if self.ros1 or (len(message) > 1 and message[1] & 1) else ">"
        if not self.ros1:
            layout.fixed.append((0, message[:2]))
        try:
            if len(message) < start:
                raise IndexError("it has no head")
            end = self._struct(msgtype, "", message, start, order, layout)
            if len(message) - end > (0 if self.ros1 else PADDING):
                raise IndexError(f"{len(message) - end} bytes are left over")
        except (struct.error, IndexError, KeyError, UnicodeDecodeError, RecursionError) as error:
            raise InputError(
                f"{self.bag}: a message of type {msgtype} does not fit its definition ({error}); the bag is "
                "damaged (copy it anew from where it was recorded), or a .msg file is of another version"
            ) from None
        return layout

    def _struct(self, msgtype: str, prefix: str, data: bytes, at: int, order: str, layout: Layout) -> int:
        for name, (kind, detail) in self.definitions[msgtype][1]:
            path = f"{prefix}{name}"
            if kind.name == "BASE":
                at = self._values(detail[0], path, 1, False, data, at, order, layout)
            elif kind.name == "NAME":
                at = self._struct(detail, f"{path}.", data, at, order, layout)
            else:
                (element, inner), count = detail
                if kind.name == "SEQUENCE":
                    at = self._aligned(at, LENGTH)
                    (count,) = struct.unpack_from(f"{order}I", data, at)
                    layout.fixed.append((at, data[at : at + LENGTH]))
                    at += LENGTH
                if element.name == "BASE":
                    at = self._values(inner[0], path, count, True, data, at, order, layout)
                else:
                    if count > len(data):
                        raise IndexError(f"{path} ends behind the message")
                    for k in range(count):
                        at = self._struct(inner, f"{path}[{k}].", data, at, order, layout)
        return at

    def _values(
        self, base: str, path: str, count: int, listed: bool, data: bytes, at: int, order: str, layout: Layout
    ) -> int:
        if listed:
            layout.lists.add(path)
        if base in ("string", "wstring"):
            return self._texts(path, count, listed, data, at, order, layout)
        size = _SIZES[base]
        at = self._aligned(at, size) if count else at
        code = _CODES.get(base, f"{'u' if base[0] == 'u' else 'i'}{size}")
        layout.numbers[path] = (at, count, f"{order}{code}")
        if at + size * count > len(data):
            raise IndexError(f"{path} ends behind the message")
        return at + size * count

    def _texts(
        self, path: str, count: int, listed: bool, data: bytes, at: int, order: str, layout: Layout
    ) -> int:
        texts = layout.texts.setdefault(path, [])
        for _ in range(count):
            at = self._aligned(at, LENGTH)
            (length,) = struct.unpack_from(f"{order}I", data, at)
            if at + LENGTH + length > len(data):
                raise IndexError(f"{path} ends behind the message")
            texts.append(data[at + LENGTH : at + LENGTH + length].rstrip(b"\0").decode())
            # listed names decide which value is whose; a lone text only shifts what follows it
            layout.fixed.append((at, data[at : at + LENGTH + (length if listed else 0)]))
            at += LENGTH + length
        return at

    def _aligned(self, at: int, size: int) -> int:
        return at if self.ros1 else at + (HEADER - at) % size


class Columns:
    """Reads selected fields of one topic's messages as columns, and stores the layouts found."""

    def __init__(self, walker: Walker, msgtype: str, paths: tuple[str, ...]) -> None:
        self.walker, self.msgtype, self.paths = walker, msgtype, paths
        self.stamped = all(walker.has(msgtype, part) for part in STAMP)
        self.clocked = False  # whether a message had a stamp
        self._layouts: dict[int, list[Layout]] = {}

    def read(self, buffer: Bytes, starts: Index, sizes: Index, log_ns: Index) -> tuple[Index, list[Array]]:
        """Stamps (n,) in ns (log times if there are none) and one float64 column (n,) for each path."""
        stamps = np.zeros(len(starts), np.int64)
        columns = [np.full(len(starts), np.nan) for _ in self.paths]
        for size in np.unique(sizes):
            rest = np.flatnonzero(sizes == size)
            for layout in self._layouts.setdefault(int(size), []):
                rest = self._take(layout, buffer, starts, rest, stamps, columns)
            while len(rest):
                begin = int(starts[rest[0]])
                layout = self.walker.walk(self.msgtype, buffer[begin : begin + int(size)].tobytes())
                if len(self._layouts[int(size)]) < 64:  # a bag whose names keep changing is read one by one
                    self._layouts[int(size)].append(layout)
                rest = self._take(layout, buffer, starts, rest, stamps, columns)
        # a clock may start at zero, but one that stays there was never set
        self.clocked = self.clocked or bool(stamps.any())
        return (stamps if self.clocked else log_ns), columns

    def _take(
        self, layout: Layout, buffer: Bytes, starts: Index, rest: Index, stamps: Index, columns: list[Array]
    ) -> Index:
        """Read those of the messages `rest` that have this layout; returns the others."""
        if not len(rest):
            return rest
        same = np.ones(len(rest), dtype=bool)
        at = starts[rest]
        for offset, content in layout.fixed:
            expected = np.frombuffer(content, np.uint8)
            same &= (_rows(buffer, at + offset, len(content)) == expected).all(axis=1)
        mine, at = rest[same], at[same]
        for path, column in zip(self.paths, columns, strict=True):
            place = layout.locate(path)
            if place is not None:
                column[mine] = _numbers(buffer, at + place[0], place[1])
        if self.stamped:
            (sec, kind), (nano, nano_kind) = layout.locate(STAMP[0]), layout.locate(STAMP[1])  # type: ignore[misc]
            total = _numbers(buffer, at + sec, kind).astype(np.int64) * 1_000_000_000
            total += _numbers(buffer, at + nano, nano_kind).astype(np.int64)
            stamps[mine] = total
        return rest[~same]


def _rows(buffer: Bytes, starts: Index, width: int) -> NDArray[np.uint8]:
    return np.lib.stride_tricks.sliding_window_view(buffer, width)[starts]


def _numbers(buffer: Bytes, starts: Index, dtype: str) -> NDArray[Any]:
    return np.ascontiguousarray(_rows(buffer, starts, np.dtype(dtype).itemsize)).view(dtype)[:, 0]
