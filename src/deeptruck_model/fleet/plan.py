"""The input of a fleet analysis: truck and date of every file, class and simulator of every truck."""

from __future__ import annotations

import csv
import io
import posixpath
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import date
from pathlib import Path
from typing import Any

from deeptruck_core import reading
from deeptruck_core.errors import InputError
from deeptruck_model import checks
from deeptruck_model.fleet.storage import Place, Stored

NO_DATE = "undated"
ONE_CLASS = "all"
YES, NO = ("yes", "true", "1"), ("no", "false", "0")


@dataclass(frozen=True)
class Drive:
    """A file of the source: its `truck`, and its `date` from the path, or NO_DATE."""

    file: Stored
    truck: str
    date: str

    @property
    def name(self) -> str:
        """The name of its recordings, unique among the drives of the truck."""
        return f"{self.date}/{posixpath.basename(self.file.path).partition('.')[0]}"


@dataclass(frozen=True)
class Truck:
    """A row of trucks.csv: `kind` is the truck's class; `sound` is None if not stated; `traits` are the other
    columns, such as build or load."""

    name: str
    kind: str = ONE_CLASS
    sound: bool | None = None
    traits: Mapping[str, str] = field(default_factory=dict)


def drives(source: Place, layout: str) -> list[Drive]:
    """The files that match a layout such as '{truck}/{date}/*.mcap', by name.

    `*` stands for any part of a name, `**` for any folders, and `{other}` for a name that is not used. Raises
    InputError for a layout without {truck}, and one without matches.
    """
    pattern = _pattern(layout)
    listed = source.list()
    found = [
        Drive(file, match["truck"], match.groupdict().get("date") or NO_DATE)
        for file in listed
        if (match := pattern.fullmatch(file.path))
    ]
    if not found:
        there = f"{len(listed)} files there, such as {listed[0].path}" if listed else "there is no file"
        raise InputError(f"--layout '{layout}' matches nothing in {source.name}: {there}")
    return found


def _pattern(layout: str) -> re.Pattern[str]:
    parts = re.split(r"(\{\w+\}|\*\*/?|\*)", layout.strip("/"))
    text, known = "", set[str]()
    for part in parts:
        if part.startswith("{"):
            name = part[1:-1]
            text += f"(?P={name})" if name in known else f"(?P<{name}>[^/]+)"
            known.add(name)
        elif part.startswith("**"):
            text += ".*"
        else:
            text += "[^/]*" if part == "*" else re.escape(part)
    if "truck" not in known:
        raise InputError(f"--layout '{layout}' has no {{truck}}; write it as '{{truck}}/{{date}}/*.mcap'")
    try:
        return re.compile(text)
    except re.error:
        raise InputError(
            f"--layout '{layout}' is not understood; write '{{truck}}/{{date}}/*.mcap'"
        ) from None


def week(day: str) -> str | None:
    """The ISO week of a date such as 2026-03-31 or 20260331, as '2026-W14'; None for an invalid date."""
    try:
        year, number, _ = date.fromisoformat(day).isocalendar()
    except ValueError:
        return None
    return f"{year}-W{number:02d}"


def trucks(table: Path | None) -> dict[str, Truck]:
    """The rows of trucks.csv by truck. Its columns are `truck`, optionally `class` and `sound` (yes or no, by
    inspection), and any others. Raises InputError for an invalid table."""
    if table is None:
        return {}
    cure = "give a CSV file with a column 'truck'"
    rows = list(csv.DictReader(io.StringIO(reading.text(table, cure))))
    if not rows or "truck" not in rows[0]:
        raise InputError(f"{table} has no rows with a 'truck'; {cure}")
    found: dict[str, Truck] = {}
    for number, row in enumerate(rows, 2):
        if None in row or None in row.values():
            raise InputError(f"{table}, line {number}: it has not as many cells as the header")
        name = row.pop("truck").strip()
        if not name or name in found:
            raise InputError(f"{table}, line {number}: truck '{name}' stands there twice or has no name")
        said = (row.pop("sound", None) or "").strip().lower()
        if said and said not in (*YES, *NO):
            raise InputError(f"{table}, line {number}: sound is yes, no or empty, not '{said}'")
        sound = None if not said else said in YES
        kind = (row.pop("class", None) or ONE_CLASS).strip()
        found[name] = Truck(name, kind, sound, {k: v.strip() for k, v in row.items() if v.strip()})
    return found


def simulators(text: str, kinds: Sequence[str]) -> dict[str, str]:
    """The simulator of each class: one for all, or from a YAML file with lines `class: SIM`. Raises
    InputError if a class has none, or if a simulator does not exist."""
    if ":" in text or Path(text).suffix not in (".yaml", ".yml"):
        checks.simulator(text)
        return dict.fromkeys(kinds, text)
    by_class = {str(k): str(v) for k, v in reading.yaml_mapping(Path(text), "write 'class: SIM'").items()}
    lacking = sorted(set(kinds) - set(by_class))
    if lacking:
        raise InputError(f"{text} has no simulator for class {', '.join(lacking)}")
    for kind in kinds:
        checks.simulator(by_class[kind])
    return {kind: by_class[kind] for kind in kinds}


def mapping(path: Path | None, columns: bool) -> dict[str, Any] | None:
    """A topic map or COLUMNS.yaml, checked, in the form sent to workers. Raises InputError for an invalid
    one."""
    if path is None:
        return None
    from deeptruck_model.recordings.tables.columns import load_columns
    from deeptruck_model.recordings.topic_map import is_topic_map, load, load_yaml

    data = load_yaml(path)
    with reading.of(path):
        if columns and not is_topic_map(data) and "channels" in data:
            load_columns(data)
        elif not columns:
            load(data)
    return data
