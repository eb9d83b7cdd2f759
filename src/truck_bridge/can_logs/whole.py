"""Checks that a binary log is intact, by its record lengths and checksums, before a library reads it.

BLF: containers are compressed with zlib, which has a checksum; the file header with its start time has none.
MCAP: checksums of summary and chunks. ASC, TRC and candump are text without checksums: a changed digit is not
detected.
"""

from __future__ import annotations

import mmap
import os
import re
import stat
import struct
import zlib
from pathlib import Path

from truck_bridge.errors import InputError

COPY = "copy the log anew from where it was recorded"
_BLF_HEAD = struct.Struct("<4sL8xQ")  # signature, length of the head, length of the file
_BLF_OBJECT = struct.Struct("<4sHHLL")  # signature, its head's length and version, length, type
_BLF_CONTAINER, _BLF_PACKED = 10, 2
_UNFINISHED = (0, 144)  # lengths of the file in the head of a BLF whose recorder was killed
_MAGIC = b"\x89MCAP0\r\n"
_FOOTER, _FOOTER_BYTES, _HEAD = 2, 20, 9


def check_file(path: Path) -> None:
    """Raises InputError for a pipe or device, which may never end, and for an unreadable file."""
    mode = path.stat().st_mode
    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
        raise InputError(f"{path} is a pipe or device, not a file; give a CAN log that was recorded")
    if not os.access(path, os.R_OK):
        raise InputError(f"{path} may not be read; change its permissions, or give another log")


def check_blf(path: Path) -> None:
    """Raises InputError if a container is corrupt, or the file is not as long as its header states.

    In the log of a killed recorder, data after the last complete container are ignored.
    """
    size = path.stat().st_size
    if size < _BLF_HEAD.size:
        raise InputError(f"{path} is too short for a BLF file; {COPY}")
    with path.open("rb") as stream, mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as data:
        signature, at, length = _BLF_HEAD.unpack_from(data)
        if signature != b"LOGG" or at < _BLF_HEAD.size:
            raise InputError(f"{path} does not begin as a BLF file; {COPY}")
        finished = length not in _UNFINISHED
        if finished and length != size:
            raise InputError(f"{path} has {size} bytes, but {length} were written; {COPY}")
        while at < size:
            end = _object_end(data, at, size)
            if end is None and not finished:
                return
            if end is None or not _is_sound(data[at:end]):
                raise InputError(f"{path} is damaged at byte {at}; {COPY}")
            at = end + (end - at) % 4


def _object_end(data: mmap.mmap, at: int, size: int) -> int | None:
    """The end of the object at a position; None if there is no object."""
    if at + _BLF_OBJECT.size > size:
        return None
    signature, _, _, length, _ = _BLF_OBJECT.unpack_from(data, at)
    return at + length if signature == b"LOBJ" and _BLF_OBJECT.size <= length <= size - at else None


def _is_sound(one: bytes) -> bool:
    """Whether an object is no container, or a container whose content has the stated length."""
    if _BLF_OBJECT.unpack_from(one)[4] != _BLF_CONTAINER:
        return True
    if len(one) < 32:
        return False
    method, length = struct.unpack_from("<H6xL", one, _BLF_OBJECT.size)
    content = one[32:]
    try:
        content = zlib.decompress(content) if method == _BLF_PACKED else content
    except zlib.error:
        return False
    inside = (m.start() + 8 for m in re.finditer(b"LOBJ", content[: len(content) - _BLF_OBJECT.size]))
    moves = all(
        struct.unpack_from("<L", content, at)[0] for at in inside
    )  # an object of no length never ends
    return method in (0, _BLF_PACKED) and len(content) == length and moves


def check_mcap(path: Path) -> bool:
    """Whether an MCAP file was finished. Raises InputError if its records or its summary are inconsistent.

    False is the file of a killed recorder, which may end anywhere.
    """
    size = path.stat().st_size
    if size < 2 * len(_MAGIC):
        return False
    with path.open("rb") as stream, mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as data:
        if data[-len(_MAGIC) :] != _MAGIC:
            return False
        end, at, opcode = size - len(_MAGIC), len(_MAGIC), 0
        while opcode != _FOOTER and at + _HEAD <= end:
            opcode, length = struct.unpack_from("<BQ", data, at)
            at += _HEAD + length
        if opcode != _FOOTER or at != end or length != _FOOTER_BYTES:
            raise InputError(f"{path} is damaged: its records do not fit; {COPY}")
        summary, _, checksum = struct.unpack_from("<QQI", data, end - _FOOTER_BYTES)
        if summary and (summary > end or (checksum and zlib.crc32(data[summary : end - 4]) != checksum)):
            raise InputError(f"{path} is damaged: the checksum of its summary is not kept; {COPY}")
    return True
