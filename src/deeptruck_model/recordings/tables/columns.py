"""COLUMNS.yaml: what the columns of a table mean. Its keys are a contract with other programs
(docs/recordings.md).
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any

from deeptruck_core import reading
from deeptruck_core.errors import InputError
from deeptruck_core.schema import check
from deeptruck_core.vehicle_kinds import check_vehicle
from deeptruck_model.recordings import schemas
from deeptruck_model.recordings.candidates import yaml_text
from deeptruck_model.recordings.schemas import DATE_UNITS, EXTRA, SPLITS
from deeptruck_model.recordings.tables.csv_text import Format
from deeptruck_model.recordings.topic_map import Source, load_yaml, sources
from deeptruck_model.recordings.units import DIESEL_DENSITY, conversion


@dataclass(frozen=True)
class Clock:
    """How the time of a row is stored: in `columns`, as numbers of a unit, as ISO dates (unit 'iso'), or as
    dates of a strptime `format`. Without columns, rows come at `rate_hz`."""

    columns: tuple[str, ...] = ()
    unit: str = "s"
    format: str | None = None
    rate_hz: float = 1.0

    @property
    def line(self) -> str:
        """The line `time:` of COLUMNS.yaml."""
        names = [yaml_text(name) for name in self.columns]
        column = names[0] if len(names) == 1 else f"[{', '.join(names)}]"
        how = f', format: "{self.format}"' if self.format else f", unit: {self.unit}" if self.unit else ""
        return f"time: {{column: {column}{how}}}"


@dataclass(frozen=True)
class Columns:
    """A checked COLUMNS.yaml. `split_at` maps a channel to the step (SI) at which a new piece begins."""

    channels: dict[str, Source]
    time: Clock
    form: Format
    split_at: dict[str, float] = field(default_factory=dict)
    name: str | None = None
    notes: tuple[str, ...] = ()
    vehicle: str | None = None
    mass_kg: float | None = None
    driven_by: str | None = None
    only: Mapping[str, str] = field(default_factory=dict)
    pivot: tuple[str, str] | None = None


def load_columns(columns: Mapping[str, Any] | str | Path) -> Columns:
    """Check a COLUMNS.yaml (or its content). Raises InputError with one line for each entry that is not
    understood."""
    if isinstance(columns, str | Path):
        data = load_yaml(Path(columns))
        with reading.of(columns):
            return load_columns(data)
    check(columns, schemas.columns(), "COLUMNS")
    check_vehicle(columns.get("vehicle"), columns.get("mass_kg"))
    found = sources(columns["channels"], columns.get(EXTRA, {}), "column")
    pivot = columns.get("pivot")
    return Columns(
        channels=found,
        time=_clock(columns["time"]),
        form=Format(
            delimiter=columns.get("delimiter"),
            encoding=columns.get("encoding", "utf-8"),
            skip_rows=columns.get("skip_rows", 0),
            decimal=columns.get("decimal", ""),
        ),
        split_at=_splits(columns.get("split_at", {}), found),
        name=str(columns["name"]) if "name" in columns else None,
        notes=_assumed(columns["channels"]),
        vehicle=columns.get("vehicle"),
        mass_kg=columns.get("mass_kg"),
        driven_by=columns.get("driven_by"),
        only={str(column): str(text) for column, text in columns.get("only", {}).items()},
        pivot=None if pivot is None else (str(pivot["name"]), str(pivot["value"])),
    )


def _assumed(channels: Mapping[str, Any]) -> tuple[str, ...]:
    """A note if the fuel is given by volume without its density."""
    fuel = channels.get("fuel_rate")
    if fuel is None or "density" in fuel:
        return ()
    of_water = conversion("fuel_rate", str(fuel["unit"]), 1.0)
    if conversion("fuel_rate", str(fuel["unit"])) == of_water:
        return ()
    return (f"fuel_rate by volume with diesel's {DIESEL_DENSITY} g/cm^3, as no density is given",)


def _clock(entry: Mapping[str, Any]) -> Clock:
    if "rate_hz" in entry:
        return Clock(rate_hz=float(entry["rate_hz"]))
    named = entry["column"] if isinstance(entry["column"], list) else [entry["column"]]
    columns = tuple(str(name) for name in named)
    if "format" in entry:
        return Clock(columns, format=_format(entry["format"]))
    unit = entry.get("unit", "s" if len(columns) == 1 else "iso")
    if len(columns) == 2 and unit.lower() not in DATE_UNITS:
        raise InputError("two columns of 'time' are a date and a time of day: give a format, or unit: iso")
    return Clock(columns, unit="days" if unit == "day" else unit)


def _format(value: str) -> str:
    """A format of strptime. Raises InputError for an unknown directive."""
    try:
        datetime.strptime("", value)
    except (ValueError, re.error) as error:
        if "does not match" not in str(error):
            raise InputError(f"format '{value}' of 'time' cannot be used: {error}") from None
    return value


def _splits(steps: Mapping[str, float], channels: Mapping[str, Source]) -> dict[str, float]:
    for step in steps:
        if SPLITS[step] not in channels:
            raise InputError(f"split_at has {step}, but no column is named for '{SPLITS[step]}'")
    return {SPLITS[step]: float(value) for step, value in steps.items()}
