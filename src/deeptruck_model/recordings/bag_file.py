"""Checks that a bag file is intact, by its record lengths and checksums, before it is parsed.

A damaged size field can hold any number up to 2**64, so it must be checked before memory is allocated or the
file is searched by it. MCAP's checksums of the summary and the data section are verified here, those of
chunks when they are read. ROS 1 and sqlite bags have no checksums: a changed number in them is not detected.
"""

from __future__ import annotations

import mmap
import os
import struct
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from mcap.opcode import Opcode

MAGIC = b"\x89MCAP0\r\n"
RECORD_HEAD = 9  # opcode and length
_FOOTER = struct.Struct("<QQI")  # summary start, summary offset start, checksum of the summary
_FIRST_LINE = 64  # bytes, of which '#ROSBAG V2.0' are the first
_PIECE = 2**22  # bytes of which a checksum is taken at a time


class DamagedError(Exception):
    """A bag whose bytes are corrupt; the message says where."""


class TornError(DamagedError):
    """An MCAP file whose records or end do not fit: what comes before can be kept by 'repair'."""


@dataclass(frozen=True)
class Records:
    """Offsets of the records that readers look up, and the end of the data section."""

    data_end: int  # of the data section, where the summary (or the footer) begins
    metadata: tuple[tuple[int, int], ...]  # (start, length) of the content of each Metadata record


def check_ros1(file: Path) -> None:
    """Check the records that the index of a ROS 1 bag leads to; other bytes are not checked.

    Raises DamagedError if a record is longer than the file, or if there is no index.
    """
    with file.open("rb") as stream:
        size = stream.seek(0, os.SEEK_END)
        stream.seek(0)
        stream.readline(_FIRST_LINE)
        begin = _ros1_record(stream, size)
        at = int.from_bytes(begin.get(b"index_pos", b""), "little")
        if not 0 < at < size:
            raise DamagedError(
                "it has no index, as its recorder was killed or its end is missing: "
                "'rosbag reindex' of ROS 1 makes one"
            )
        stream.seek(at)
        while stream.tell() < size:
            info = _ros1_record(stream, size)
            if info.get(b"op") != b"\x06":  # no chunk info record
                continue
            back = stream.tell()
            stream.seek(int.from_bytes(info.get(b"chunk_pos", b""), "little"))
            for _ in range(1 + int.from_bytes(info.get(b"count", b""), "little")):
                _ros1_record(stream, size)  # the chunk, and an index record for each of its connections
            stream.seek(back)


def _ros1_record(stream: BinaryIO, size: int) -> dict[bytes, bytes]:
    """The header fields of the present record; the stream is advanced to the next one."""
    found, parts = b"", []
    for part in ("head", "content"):
        length = int.from_bytes(stream.read(4), "little")
        if stream.tell() + length > size or (part == "head" and not length):
            raise DamagedError(f"the {part} of a record is longer than the file")
        if part == "head":
            found = stream.read(length)
        else:
            stream.seek(length, os.SEEK_CUR)
    while found:
        length = int.from_bytes(found[:4], "little")
        parts.append(found[4 : 4 + length].partition(b"=")[::2])
        found = found[4 + length :]
    return dict(parts)


def check_mcap(file: Path) -> Records:
    """Check every record of an MCAP file. Raises TornError if a record does not fit, DamagedError for a
    wrong checksum or a file that is none."""
    size = file.stat().st_size
    if not size:
        raise DamagedError("it is empty")
    if size < 2 * len(MAGIC) + RECORD_HEAD + _FOOTER.size:
        raise TornError("it is too short for an MCAP file")
    with file.open("rb") as stream, mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as data:
        if data[: len(MAGIC)] != MAGIC:
            raise DamagedError("it does not begin as an MCAP file")
        if data[-len(MAGIC) :] != MAGIC:
            raise TornError("its end is missing")
        return _walk(data, size - len(MAGIC))


def _walk(data: mmap.mmap, end: int) -> Records:
    at, opcode, length, behind_data = len(MAGIC), 0, 0, 0
    data_end, checksum, metadata = end, 0, []
    while opcode != Opcode.FOOTER:
        if at + RECORD_HEAD > end:
            raise TornError("it has no footer")
        opcode, length = struct.unpack_from("<BQ", data, at)
        content = at + RECORD_HEAD
        if content + length > end:
            raise TornError(f"its record at byte {at} is longer than the file")
        if opcode == Opcode.METADATA:
            metadata.append((content, length))
        elif opcode == Opcode.DATA_END and length >= 4:
            data_end, checksum = at, int.from_bytes(data[content : content + 4], "little")
            behind_data = content + length
        at = content + length
    if at != end or length != _FOOTER.size:
        raise TornError("its footer is not at its end")
    if checksum and checksum != _crc(data, 0, data_end):  # 0: none was written
        raise DamagedError("the checksum of its data is not kept")
    _check_summary(data, end, behind_data)
    return Records(data_end, tuple(metadata))


def _check_summary(data: mmap.mmap, end: int, behind_data: int) -> None:
    summary, _, checksum = _FOOTER.unpack_from(data, end - _FOOTER.size)
    if summary not in (0, behind_data):
        raise TornError("its summary is not where its footer says")
    if summary and checksum and checksum != _crc(data, summary, end - 4):
        raise DamagedError("the checksum of its summary is not kept")


def _crc(data: mmap.mmap, start: int, end: int) -> int:
    found = 0
    for at in range(start, end, _PIECE):
        found = zlib.crc32(data[at : min(at + _PIECE, end)], found)
    return found
