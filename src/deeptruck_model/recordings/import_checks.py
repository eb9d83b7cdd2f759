"""What of an import can be said before the table is read: paths, COLUMNS.yaml and the place of the bag."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from deeptruck_model import checks, files
from deeptruck_model.errors import InputError
from deeptruck_model.recordings.columns import load_columns
from deeptruck_model.recordings.topic_map import load_yaml
from deeptruck_model.results import BAG, apart

CAN_SUFFIXES = (".log", ".asc", ".blf", ".mf4", ".candump", ".trc", ".mcap")
BAG_SUFFIXES = (".db3", ".bag")
USE_THE_BAG = "a bag is not imported but used as it is ('deeptruck-model coverage BAG')"

Meaning = Mapping[str, Any] | str | Path


def check(table: Path, columns: Meaning, out: Path, *, overwrite: bool = False) -> None:
    """Raises one InputError with every misfit."""
    checks.every(
        lambda: _check_table(table),
        lambda: columns_of_log(table, columns) if is_can_log(table) else load_columns(columns),
        lambda: BAG.check(out, overwrite=overwrite),
        lambda: apart(out, table),
        lambda: files.check_new(sealed(out)),
    )


def sealed(out: Path) -> Path:
    """The file beside the bag that gets the concealed channels."""
    return out.with_name(out.name + ".sealed.csv")


def is_can_log(path: Path) -> bool:
    """Whether a log holds CAN frames, by its suffix."""
    return path.suffix.lower() in CAN_SUFFIXES


def columns_of_log(log: Path, columns: Meaning) -> dict[str, Any]:
    """COLUMNS for a CAN log, as its importer reads them. Raises InputError for those of a table."""
    meaning = load_yaml(Path(columns)) if isinstance(columns, str | Path) else dict(columns)
    if "time" in meaning:
        raise InputError(
            f"{log} is read as a CAN log, for its suffix, but these columns describe a table (they have a "
            f"'time'); {USE_THE_BAG}, and a table needs another suffix, such as .csv"
        )
    return meaning


def _check_table(table: Path) -> None:
    if table.suffix.lower() in BAG_SUFFIXES or (table / checks.METADATA).exists():
        raise InputError(f"{table} is no table: {USE_THE_BAG}")
    if not table.exists():
        raise InputError(f"{table} does not exist")
    if not table.is_file():
        raise InputError(f"{table} is a folder; give the file of a table or CAN log")
