"""What a log is: a table of signals, CAN frames or a bag; by its suffix, and a text by its beginning.

Standard library only, because commands look before anything heavy is loaded.
"""

from __future__ import annotations

import enum
import gzip
import io
import re
import zlib
from contextlib import suppress
from pathlib import Path

from deeptruck_core import frame_rows

PACKED = ".gz"  # of any file
HEAD = 1 << 18  # bytes by which a text is recognised
PARQUET = (".parquet", ".pq")
WRITTEN = (".csv", ".parquet")  # tables that are written
BAG = ".mcap"  # the one kind of rosbag that is written
BAGS = (BAG, ".db3", ".bag")
FRAMES = (".asc", ".blf", ".candump", ".log", ".mf4", ".trc")
TEXTS = (".csv", ".tsv", ".txt", ".log", "")  # which hold signals or frames
FRAME_OF_CANDUMP = re.compile(
    r"(?m)^\s*(?:\([\d.: -]+\)\s+\S+|\d\d:\d\d:\d\d\.\d+)\s+(?:[RT]X\s.{0,8}\s)?[0-9A-Fa-f]{3,8}(?:#|\s+\[)"
)


class Kind(enum.Enum):
    """What a log holds."""

    TABLE = "a table of signals"
    FRAMES = "a CAN log"
    BAG = "a bag"


def kind_of(path: Path) -> Kind | None:
    """What a file or folder holds, a table where nothing else is known; None for a folder with neither a bag
    nor Parquet files."""
    if path.is_dir():
        if any(any(path.glob(name)) for name in ("metadata.yaml", "*.mcap", "*.db3")):
            return Kind.BAG
        return Kind.TABLE if any(path.rglob("*.parquet")) else None
    suffix = suffix_of(path)
    if suffix in BAGS:
        return Kind.BAG
    if suffix in FRAMES or (suffix in TEXTS and holds_frames(head_of(path))):
        return Kind.FRAMES
    return Kind.TABLE


def holds_frames(head: str) -> bool:
    """Whether a text that begins like this holds frames, as candump writes them or as rows of a table."""
    return bool(FRAME_OF_CANDUMP.search(head)) or frame_rows.find(io.StringIO(head)) is not None


def suffix_of(path: Path) -> str:
    """The suffix in lower case, that of the file within for one compressed by gzip."""
    name = path.with_suffix("") if path.suffix.lower() == PACKED else path
    return name.suffix.lower()


def head_of(path: Path) -> str:
    """The beginning of a text, unpacked; nothing of one that cannot be read, or of a pipe, which may never
    end."""
    if not path.is_file():
        return ""
    opened = gzip.open if path.suffix.lower() == PACKED else open
    with suppress(OSError, EOFError, zlib.error), opened(path, "rb") as file:
        return bytes(file.read(HEAD)).decode("utf-8-sig", "replace")
    return ""
