"""Every format of a log that is read: its suffixes, how the file shows it, and what opens it.

To add a CAN log, write its reader and give it a line in FORMATS. Standard library only, because bridge and
importer use it before anything heavy is loaded.
"""

from __future__ import annotations

import enum
import gzip
import io
import re
import struct
import zlib
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from deeptruck_core import frame_rows
from deeptruck_core.errors import InputError

PACKED = ".gz"  # of any file
HEAD = 1 << 18  # bytes by which a format is recognised
PARQUET = (".parquet", ".pq")
WRITTEN = (".csv", ".parquet")  # tables that are written
SHOWN = 8  # names that a message lists
_FRAME_OF_CANDUMP = re.compile(
    rb"(?m)^\s*\([\d.: -]+\)\s+\S+\s+(?:[RT]X\s.{0,8}\s)?[0-9A-Fa-f]{3,8}(?:#|\s+\[)"
)


class Kind(enum.Enum):
    """What a log holds."""

    TABLE = "a table of signals"
    FRAMES = "a CAN log"
    BAG = "a bag"


@dataclass(frozen=True)
class LogFormat:
    """One format. `shows` recognises it by the beginning of a file, where the suffix does not suffice.

    `reader` is 'module:function' of CAN frames, called with a path and an Account. `text` says that it is
    written in lines, `written` that the bridge can write it.
    """

    kind: Kind
    suffixes: tuple[str, ...]
    reader: str = ""
    shows: Callable[[bytes], bool] | None = None
    text: bool = False
    written: bool = False


def _frames(head: bytes) -> bool:
    lines = io.StringIO(head.decode("utf-8-sig", "replace"))
    return frame_rows.find(lines) is not None


def _by_library_csv(head: bytes) -> bool:
    return head.startswith(b"timestamp,arbitration_id,")  # of python-can, with bytes in base 64


def _is_busmaster(head: bytes) -> bool:
    return head.startswith(b"***BUSMASTER")


def _is_candump(head: bytes) -> bool:
    return bool(_FRAME_OF_CANDUMP.search(head))


_ROOM = "truck_bridge.can_logs"
FORMATS = (  # the first that fits is taken
    LogFormat(Kind.FRAMES, (".log", ".txt", ""), f"{_ROOM}.other_logs:busmaster", _is_busmaster, text=True),
    LogFormat(Kind.FRAMES, (".csv",), f"{_ROOM}.reader:by_library", _by_library_csv, text=True),
    LogFormat(Kind.FRAMES, (".log", ".txt", ""), f"{_ROOM}.text_logs:candump", _is_candump, text=True),
    LogFormat(Kind.FRAMES, (".csv", ".tsv", ".txt", ".log"), f"{_ROOM}.row_logs:frames", _frames, text=True),
    LogFormat(Kind.FRAMES, (".log",), f"{_ROOM}.text_logs:candump", text=True, written=True),
    LogFormat(Kind.FRAMES, (".candump",), f"{_ROOM}.text_logs:candump", text=True),
    LogFormat(Kind.FRAMES, (".asc",), f"{_ROOM}.text_logs:asc", text=True, written=True),
    LogFormat(Kind.FRAMES, (".trc",), f"{_ROOM}.trc_logs:trc", text=True, written=True),
    LogFormat(Kind.FRAMES, (".blf", ".mf4"), f"{_ROOM}.reader:by_library", written=True),
    LogFormat(Kind.FRAMES, (".pcap", ".pcapng"), f"{_ROOM}.other_logs:capture"),
    LogFormat(Kind.BAG, (".mcap", ".db3", ".bag"), f"{_ROOM}.rosbag:frames"),
    LogFormat(Kind.TABLE, (*PARQUET, ".mat", ".xlsx")),
    LogFormat(Kind.TABLE, (".csv", ".tsv"), text=True),
)  # fmt: skip
KINDS = (
    "candump or BUSMASTER text (.log), ASC, BLF, TRC, MF4, a capture of SocketCAN (.pcap, .pcapng), a CSV "
    "table of raw frames, or a rosbag with them"
)
BAG = ".mcap"  # the one kind of rosbag that is written
WRITABLE = (*(suffix for one in FORMATS if one.written for suffix in one.suffixes), BAG)
LINES = {suffix for one in FORMATS if one.written and one.text for suffix in one.suffixes}


def suffix_of(path: Path) -> str:
    """The suffix in lower case, that of the file within for one compressed by gzip."""
    name = path.with_suffix("") if path.suffix.lower() == PACKED else path
    return name.suffix.lower()


def format_of(path: Path) -> LogFormat | None:
    """The format of a file, by its suffix and, where several have that, by its beginning; None if none has
    the suffix. A folder is a bag, or a table in parts."""
    if path.is_dir():
        bag = any(any(path.glob(name)) for name in ("metadata.yaml", "*.mcap", "*.db3"))
        kind = Kind.BAG if bag else Kind.TABLE if any(path.rglob("*.parquet")) else None
        return next((one for one in FORMATS if one.kind is kind), None)
    suffix, head = suffix_of(path), None
    for one in FORMATS:
        if suffix not in one.suffixes:
            continue
        if one.shows is None:
            return one
        head = head_of(path) if head is None else head
        if one.shows(head):
            return one
    return None


def head_of(path: Path) -> bytes:
    """The beginning of a file, unpacked; nothing of one that cannot be read, or of a pipe, which may never
    end."""
    if not path.is_file():
        return b""
    opened = gzip.open if path.suffix.lower() == PACKED else open
    with suppress(OSError, EOFError, zlib.error), opened(path, "rb") as file:
        return bytes(file.read(HEAD))
    return b""


def check_measurement(path: Path) -> None:
    """Raises InputError for an MDF file of signals, which is neither a bus log nor a supported table."""
    if path.suffix.lower() not in (".mf4", ".mdf", ".dat") or not path.is_file():
        return
    data = path.read_bytes()
    if not data.startswith(b"MDF") or b"CAN_DataFrame" in data:
        return
    names = dict.fromkeys(name for name in (_names4(data) if data[8:9] == b"4" else _names3(data)) if name)
    if not names:
        return  # damaged, as its reader says
    clocks = ("t", "time", "timestamp", "timestamps")
    named = [name for name in names if name.lower() not in clocks]
    more = f" and {len(named) - SHOWN} more" if len(named) > SHOWN else ""
    raise InputError(
        f"{path} is a measurement of signals ({', '.join(named[:SHOWN])}{more}), neither a bus "
        "log nor a table: export it as CSV or Parquet, all signals on one time"
    )


def _names4(data: bytes) -> Iterator[str]:
    """Names of the channels (##CN) of an MDF 4 file, each in a text block (##TX)."""
    for match in re.finditer(b"##CN", data):
        with suppress(struct.error):
            (link,) = struct.unpack_from("<Q", data, match.start() + 24 + 16)
            if data[link : link + 4] == b"##TX":
                yield data[link + 24 : link + 24 + 256].split(b"\0")[0].decode("utf-8", "replace")


def _names3(data: bytes) -> Iterator[str]:
    """Short names of the channels (CN blocks of 218 to 228 bytes) of an MDF 3 file."""
    blocks = re.finditer(rb"CN[\xd0-\xe8]\x00", data)
    names = (data[m.start() + 26 : m.start() + 58].split(b"\0")[0].decode("latin-1") for m in blocks)
    return (name for name in names if name.isprintable())
