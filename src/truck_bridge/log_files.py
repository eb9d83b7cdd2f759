"""Kinds of CAN logs by their file names, and which can be read and written here."""

from __future__ import annotations

import gzip
import importlib.util
import zlib
from contextlib import suppress
from pathlib import Path

from deeptruck_model import files
from deeptruck_model._io.log_kinds import check_measurement, holds_frames
from deeptruck_model._io.reading import typed
from deeptruck_model.errors import InputError

TEXT = (".log", ".candump", ".txt", "")
PACKED = ".gz"  # of any kind but a folder
BAGS = (".mcap", ".db3", ".bag")
BAG = ".mcap"  # the one kind of rosbag that is written
LINES = {".log", ".asc", ".trc"}  # text, written line behind line
MF4 = ".mf4"
WRITABLE = (".log", ".asc", ".blf", MF4, ".trc", BAG)
FLUSH_S = 0.5  # what a recorder took before survives a kill -9
TABLES = (".csv", ".tsv", ".parquet", ".xlsx")  # of signals, not frames
FRAMES_AS_CSV = b"timestamp,arbitration_id,"  # how a CSV log of python-can begins
KINDS = (
    "candump or BUSMASTER text (.log), ASC, BLF, TRC, MF4, a capture of SocketCAN (.pcap, .pcapng), a CSV "
    "table of raw frames, or a rosbag with them"
)


def check(path: Path) -> None:
    """Raises InputError if there is no log to read, or its kind cannot be read here."""
    if not path.exists():
        raise InputError(f"{path} does not exist; give a CAN log: {KINDS}")
    if path.is_dir() and not (path / "metadata.yaml").is_file():
        raise InputError(f"{path} is a folder without a rosbag's metadata.yaml; give a CAN log: {KINDS}")
    _check_frames(path)
    check_measurement(path)
    _check_mf4(_unpacked(path))


def _unpacked(path: Path) -> Path:
    """The name without the gzip suffix."""
    return path.with_suffix("") if path.suffix.lower() == PACKED else path


def check_new(path: Path) -> None:
    """Raises InputError if a log cannot be created under this name; nothing is changed."""
    if path.suffix.lower() not in WRITABLE:
        raise InputError(f"{path}: a log's name ends in {', '.join(WRITABLE)}")
    files.check_new(path)
    _check_mf4(path)


def check_new_table(path: Path | None) -> None:
    """Raises InputError if a CSV table cannot be written under this name; nothing is changed."""
    if path is None:
        return
    if path.suffix.lower() != ".csv":
        raise InputError(f"{path}: the table is CSV; give a name that ends in .csv")
    files.check_new(path)


def _check_frames(path: Path) -> None:
    """Raises InputError for a table of signals, which 'deeptruck-model import' reads."""
    suffix = _unpacked(path).suffix.lower()
    if path.is_dir() or suffix not in TABLES:
        return
    if suffix in (".csv", ".tsv") and (of_python_can(path) or holds_frames(path)):
        return
    raise InputError(
        f"{path} is a table, not a CAN log: 'deeptruck-model import {typed(path)} --columns COLUMNS.yaml "
        f"--out BAG' reads tables of signals; give a CAN log here: {KINDS}"
    )


def of_python_can(path: Path) -> bool:
    """Whether a table is a CSV log of python-can, which encodes bytes in base 64."""
    opened = gzip.open if path.suffix.lower() == PACKED else open
    with suppress(OSError, EOFError, zlib.error), opened(path, "rb") as file:  # damage is said by the reader
        return file.read(len(FRAMES_AS_CSV)) == FRAMES_AS_CSV
    return False


def _check_mf4(path: Path) -> None:
    if path.suffix.lower() == MF4 and importlib.util.find_spec("asammdf") is None:
        raise InputError(f"{path}: MF4 logs need asammdf; install it with \"pip install 'deeptruck[mf4]'\"")
