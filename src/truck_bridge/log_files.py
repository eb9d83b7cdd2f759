"""Which CAN logs can be read and written here, said before they are."""

from __future__ import annotations

import importlib.util
from pathlib import Path

from deeptruck_core import files
from deeptruck_core.errors import InputError
from deeptruck_core.formats import KINDS, WRITABLE, Kind, check_measurement, format_of, suffix_of
from deeptruck_core.reading import typed

MF4 = ".mf4"
FLUSH_S = 0.5  # what a recorder took before survives a kill -9


def check(path: Path) -> None:
    """Raises InputError if there is no log to read, or its kind cannot be read here."""
    if not path.exists():
        raise InputError(f"{path} does not exist; give a CAN log: {KINDS}")
    if path.is_dir() and not (path / "metadata.yaml").is_file():
        raise InputError(f"{path} is a folder without a rosbag's metadata.yaml; give a CAN log: {KINDS}")
    form = format_of(path)
    if form is not None and form.kind is Kind.TABLE:
        raise InputError(
            f"{path} is a table, not a CAN log: 'deeptruck-model import {typed(path)} --columns COLUMNS.yaml "
            f"--out BAG' reads tables of signals; give a CAN log here: {KINDS}"
        )
    check_measurement(path)
    _check_mf4(path)


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


def _check_mf4(path: Path) -> None:
    if suffix_of(path) == MF4 and importlib.util.find_spec("asammdf") is None:
        raise InputError(f"{path}: MF4 logs need asammdf; install it with \"pip install 'deeptruck[mf4]'\"")
