"""Detects the content of a file whose name does not show it: CAN frames in a table, or a measurement.

Standard library only, because bridge and importer use it before anything heavy is loaded.
"""

from __future__ import annotations

import csv
import gzip
import re
import struct
import zlib
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from deeptruck_model.errors import InputError

IDS = ("id", "addr", "address", "arbitrationid", "canid", "identifier", "msgid", "messageid", "frameid",
       "iddec", "idhex", "canidhex", "caniddec")  # fmt: skip
GROUP, SOURCES = "pgn", ("sa", "src", "source", "sourceaddress")  # with which J1939 tools replace it
DATA = ("data", "databytes", "payload", "datahex", "payloadhex", "bytes")
BYTES = re.compile(r"(?:data|d|b|byte)(\d)")
MDF = (".mf4", ".mdf", ".dat")
SHOWN = 8  # names that a message lists
COMMENT, MOST_COMMENTS = "#", 64  # of lines above a table of frames, as loggers of the CLX000 series write
CAPTURES = (".pcap", ".pcapng")


def plain_name(cell: str) -> str:
    """A header cell in lower case, reduced to letters and digits and without its unit."""
    return re.sub(r"[^a-z0-9]", "", re.sub(r"[(\[].*?[)\]]", "", cell.lower()))


def is_frames(header: Sequence[str]) -> bool:
    """Whether a table with this header holds raw CAN frames: a time, an identifier (or PGN and source
    address) and bytes."""
    names = [plain_name(cell) for cell in header]
    data = any(name in DATA for name in names) or sum(bool(BYTES.fullmatch(name)) for name in names) >= 2
    by_group = GROUP in names and any(name in SOURCES for name in names)
    return data and (by_group or any(name in IDS for name in names)) and any(map(is_time, names))


def is_time(name: str) -> bool:
    """Whether a plain name is that of a column of times."""
    return name.startswith("time") or name in ("t", "ts", "epoch")


def holds_frames(path: Path) -> bool:
    """Whether a text table holds raw CAN frames; False if it cannot be read."""
    opened = gzip.open if path.suffix.lower() == ".gz" else open
    with suppress(OSError, EOFError, zlib.error, csv.Error), opened(path, "rb") as file:
        line = file.readline(4096).decode("utf-8-sig", "replace")
        for _ in range(MOST_COMMENTS):
            if not line.startswith(COMMENT):
                break
            line = file.readline(4096).decode("utf-8", "replace")
        return any(is_frames(next(csv.reader([line.strip()], delimiter=mark), [])) for mark in ",;\t")
    return False


def check_measurement(path: Path) -> None:
    """Raises InputError for an MDF file of signals, which is neither a bus log nor a supported table."""
    if path.suffix.lower() not in MDF or not path.is_file():
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


def _names4(data: bytes) -> list[str]:
    """Names of the channels (##CN) of an MDF 4 file, each in a text block (##TX)."""
    found = []
    for match in re.finditer(b"##CN", data):
        at = match.start()
        with suppress(struct.error):
            (link,) = struct.unpack_from("<Q", data, at + 24 + 16)
            if data[link : link + 4] == b"##TX":
                found.append(data[link + 24 : link + 24 + 256].split(b"\0")[0].decode("utf-8", "replace"))
    return found


def _names3(data: bytes) -> list[str]:
    """Short names of the channels (CN blocks of 218 to 228 bytes) of an MDF 3 file."""
    blocks = re.finditer(rb"CN[\xd0-\xe8]\x00", data)
    names = (data[m.start() + 26 : m.start() + 58].split(b"\0")[0].decode("latin-1") for m in blocks)
    return [name for name in names if name.isprintable()]
