"""Checks of an import before the table is read: paths, COLUMNS.yaml and the output bag."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from deeptruck_core.errors import InputError
from deeptruck_core.formats import BAG as BAG_OF_FRAMES
from deeptruck_core.formats import PACKED, Kind, check_measurement, format_of, suffix_of
from deeptruck_model import checks
from deeptruck_model.checks import Clock
from deeptruck_model.recordings.tables.columns import load_columns
from deeptruck_model.recordings.tables.table_file import in_parts
from deeptruck_model.recordings.topic_map import facts, is_topic_map, load_yaml
from deeptruck_model.results import BAG, apart

A_MAP = (
    "a bag is converted by a topic map, lines such as 'speed: {topic: /odom, field: twist.twist.linear.x}' "
    "('deeptruck-model suggest BAG' proposes one); a bag of our topics is used as it is"
)

Meaning = Mapping[str, Any] | str | Path


def check(
    table: Path, columns: Meaning, out: Path, *, overwrite: bool = False, clock: Clock | None = None
) -> None:
    """Raises one InputError that lists all errors."""
    checks.every(
        *_of_source(table, columns, clock),
        lambda: BAG.check(out, overwrite=overwrite),
        lambda: apart(out, table),
    )


def _of_source(table: Path, columns: Meaning, clock: Clock | None) -> list[Callable[[], object]]:
    """The checks of a table, CAN log or bag, and of its description."""
    if is_bag(table, columns):
        return [lambda: checks.inputs(None, [table], mapped=facts(columns))]
    if clock is not None:
        raise InputError(f"'--clock {clock}' is for bags, whose messages have two times; {table} is none")
    return [
        lambda: check_table(table),
        lambda: None if in_parts(table) else check_measurement(table),
        lambda: columns_of_log(table, columns) if is_can_log(table) else load_columns(columns),
    ]


def is_bag(path: Path, columns: Meaning) -> bool:
    """Whether the input is a bag: by its name, or an .mcap file given with a topic map.

    Raises InputError for a bag with the description of a table or CAN log.
    """
    if not _is(path, Kind.BAG) or path.suffix.lower() == PACKED:
        return False
    mapped = is_topic_map(_mapping(columns))
    if not mapped and (path.is_dir() or path.suffix.lower() != ".mcap"):
        raise InputError(f"{path} is no table: {A_MAP}")
    return mapped


def is_can_log(path: Path) -> bool:
    """Whether a log holds CAN frames; a single MCAP file without a topic map does."""
    return _is(path, Kind.FRAMES) or (suffix_of(path) == BAG_OF_FRAMES and not path.is_dir())


def _is(path: Path, kind: Kind) -> bool:
    found = format_of(path)
    return found is not None and found.kind is kind


def columns_of_log(log: Path, columns: Meaning) -> dict[str, Any]:
    """COLUMNS of a CAN log, as its importer reads them. Raises InputError for the COLUMNS of a table."""
    meaning = _mapping(columns)
    if "time" in meaning:
        raise InputError(
            f"{log} is read as a CAN log, but these columns describe a table (they have a 'time'); "
            f"{A_MAP}; of a CAN log 'columns' has a vehicle (docs/can_bridge.md), or nothing: {{}}"
        )
    return meaning


def _mapping(columns: Meaning) -> dict[str, Any]:
    return load_yaml(Path(columns)) if isinstance(columns, str | Path) else dict(columns)


def is_table(path: Path) -> bool:
    """Whether `suggest` treats a file as a table: any file whose suffix is not that of a bag.

    Raises InputError for a CAN log: its meaning is in a vehicle file.
    """
    if not path.is_file() or _is(path, Kind.BAG):
        return in_parts(path)
    check_measurement(path)
    if is_can_log(path):
        raise InputError(
            f"{path} is read as a CAN log: 'truck-bridge decode' shows its signals (docs/can_bridge.md), "
            f"and 'deeptruck-model import {path} --out BAG' needs no columns; a table of signals ends on "
            ".csv or .parquet"
        )
    return True


def check_table(table: Path) -> None:
    """Raises InputError if there is no such file."""
    if not table.exists():
        raise InputError(f"{table} does not exist")
    if not table.is_file() and not in_parts(table):
        raise InputError(f"{table} is a folder; give the file of a table or CAN log")
