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
from deeptruck_core.signals import SLOPE_FROM, check_driver, check_slope_source
from deeptruck_core.vehicle_kinds import check_vehicle
from deeptruck_model.recordings import topic_map
from deeptruck_model.recordings.tables.csv_text import Format
from deeptruck_model.recordings.topic_map import EXTRA, Entries, Source, check_keys, load_yaml, number
from deeptruck_model.recordings.units import DIESEL_DENSITY, TIME_UNITS, conversion

DATE_UNITS = ("iso", "iso8601", "datetime")

KEYS = {
    "name": "of the truck interface; the file's name where absent",
    "time": "the column with the time and its unit or format, or rate_hz where the file has no clock",
    "channels": "what each column means; speed is needed, all others are optional",
    "delimiter": "one character between the cells; found in the header where absent",
    "encoding": "of the text; utf-8 where absent",
    "skip_rows": "lines before the header",
    "decimal": "the decimal mark; found in the numbers where absent",
    "only": "rows of one vehicle, where a table has several: a column, and its text in the rows to take",
    "pivot": "where each row has one value: the column with the names, and the column with the values",
    "split_at": "steps in SI units; a larger jump starts a new piece",
    "extra": "further columns of numbers, carried under names of their own",
    "grade_window_m": "smoothing of a grade derived from elevation, m",
    SLOPE_FROM: "what a derived grade is from: accelerometer (fused with elevation) or elevation",
    "vehicle": "what drove: truck, bus, van or car",
    "mass_kg": "what it weighed on these drives, kg; forces are then given in newtons",
    "driven_by": "person where a driver's pedals were recorded: then they were obeyed",
}
ENTRY_KEYS = {
    "column": "its name in the header, or a list of two for the norm of a vector",
    **{key: says for key, says in topic_map.ENTRY_KEYS.items() if key not in ("topic", "field")},
    "unit": "what it is written in",
    "late_s": "how late it is stamped, s; negative: how early",
}
FASTEST_HZ = 5000.0  # of a table without a clock
SPLITS = {"speed_step": "speed", "elevation_step": "elevation"}
_COLUMNS = Entries("COLUMNS", ENTRY_KEYS, ("column",), "{column: v, unit: m/s}", units=True)


@dataclass(frozen=True)
class Clock:
    """How the time of a row is stored: in `columns`, as numbers of a unit, as ISO dates (unit 'iso'), or as
    dates of a strptime `format`. Without columns, rows come at `rate_hz`."""

    columns: tuple[str, ...] = ()
    unit: str = "s"
    format: str | None = None
    rate_hz: float = 1.0


@dataclass(frozen=True)
class Columns:
    """A checked COLUMNS.yaml. `split_at` maps a channel to the step (SI) at which a new piece begins."""

    channels: dict[str, Source]
    time: Clock
    form: Format
    split_at: dict[str, float] = field(default_factory=dict)
    name: str | None = None
    grade_window_m: float | None = None
    notes: tuple[str, ...] = ()
    vehicle: str | None = None
    mass_kg: float | None = None
    driven_by: str | None = None
    only: Mapping[str, str] = field(default_factory=dict)
    pivot: tuple[str, str] | None = None
    slope_from: str | None = None


def load_columns(columns: Mapping[str, Any] | str | Path) -> Columns:
    """Check a COLUMNS.yaml (or its content). Raises InputError with one line for each entry that is not
    understood."""
    if isinstance(columns, str | Path):
        data = load_yaml(Path(columns))
        with reading.of(columns):
            return load_columns(data)
    data = dict(columns)
    check_keys(data, KEYS, "COLUMNS")
    channels = data.get("channels")
    parsed = _COLUMNS.channels(channels if isinstance(channels, Mapping) else {}, data.get(EXTRA, {}))
    if "speed" not in parsed:
        raise InputError("COLUMNS needs 'channels' with at least 'speed: {column: ..., unit: m/s}'")
    delimiter = data.get("delimiter")
    if delimiter is not None and len(str(delimiter)) != 1:
        raise InputError(f"delimiter must be one character, not {delimiter!r}")
    window = number(data, "grade_window_m", 0.0, "COLUMNS") if "grade_window_m" in data else None
    if window is not None and window <= 0:
        raise InputError("grade_window_m must be positive")
    check_vehicle(data.get("vehicle"), data.get("mass_kg"))
    check_driver(data.get("driven_by"))
    return Columns(
        channels=parsed,
        time=_time(data.get("time")),
        form=Format(
            delimiter=None if delimiter is None else str(delimiter),
            encoding=str(data.get("encoding", "utf-8")),
            skip_rows=_rows(data.get("skip_rows", 0)),
            decimal=str(data.get("decimal", "")),
        ),
        split_at=_splits(data.get("split_at") or {}, parsed),
        name=str(data["name"]) if "name" in data else None,
        grade_window_m=window,
        notes=_assumed(channels),
        vehicle=data.get("vehicle"),
        mass_kg=data.get("mass_kg"),
        driven_by=data.get("driven_by"),
        only=_only(data.get("only") or {}),
        pivot=_pivot(data.get("pivot")),
        slope_from=check_slope_source(data.get(SLOPE_FROM)),
    )


def _assumed(channels: Any) -> tuple[str, ...]:
    """A note if the fuel is given by volume without its density."""
    fuel = channels.get("fuel_rate")
    if not isinstance(fuel, Mapping) or "density" in fuel:
        return ()
    of_water = conversion("fuel_rate", str(fuel["unit"]), 1.0)
    if conversion("fuel_rate", str(fuel["unit"])) == of_water:
        return ()
    return (f"fuel_rate by volume with diesel's {DIESEL_DENSITY} g/cm^3, as no density is given",)


def _only(entry: Any) -> dict[str, str]:
    if not isinstance(entry, Mapping):
        raise InputError("only needs a column and its text in the rows to take, as in {Vehicle: T-101}")
    return {str(column): str(text) for column, text in entry.items()}


def _pivot(entry: Any) -> tuple[str, str] | None:
    if entry is None:
        return None
    if not isinstance(entry, Mapping) or set(entry) != {"name", "value"}:
        raise InputError("pivot needs two columns, as in {name: Signal, value: Value}")
    return str(entry["name"]), str(entry["value"])


def _time(entry: Any) -> Clock:
    if isinstance(entry, Mapping):
        check_keys(entry, {"column", "unit", "format", "rate_hz"}, "'time' of COLUMNS")
    if isinstance(entry, Mapping) and set(entry) == {"rate_hz"}:
        rate = number(entry, "rate_hz", 0.0, "time")
        if not 0 < rate <= FASTEST_HZ:
            raise InputError(f"rate_hz of 'time' must be positive and at most {FASTEST_HZ:g}, not {rate:g}")
        return Clock(rate_hz=rate)
    if not isinstance(entry, Mapping) or "column" not in entry or "rate_hz" in entry:
        raise InputError(
            "COLUMNS needs 'time: {column: t, unit: s}', or 'time: {rate_hz: 1.0}' without a clock"
        )
    named = entry["column"] if isinstance(entry["column"], list) else [entry["column"]]
    if not 1 <= len(named) <= 2:
        raise InputError("'time' needs one column, or those of date and time of day, as in [Date, Time]")
    columns = tuple(str(name) for name in named)
    if "format" in entry:
        if "unit" in entry:
            raise InputError("'time' has a unit and a format; leave one of them out")
        return Clock(columns, format=_format(entry["format"]))
    unit = str(entry.get("unit", "s" if len(columns) == 1 else "iso")).strip()
    unit = "days" if unit == "day" else unit
    if unit not in TIME_UNITS and unit.lower() not in DATE_UNITS:
        raise InputError(
            f"unit '{unit}' of 'time' is not one of {', '.join((*TIME_UNITS, *DATE_UNITS))}; dates of "
            'another form have a format, as in format: "%d.%m.%Y %H:%M:%S,%f"'
        )
    if len(columns) == 2 and unit in TIME_UNITS:
        raise InputError("two columns of 'time' are a date and a time of day: give a format, or unit: iso")
    return Clock(columns, unit=unit)


def _format(value: Any) -> str:
    """A format of strptime. Raises InputError for an unknown directive."""
    if not isinstance(value, str) or "%" not in value:
        raise InputError(f"format of 'time' must be such as \"%d.%m.%Y %H:%M:%S,%f\", not {value!r}")
    try:
        datetime.strptime("", value)
    except (ValueError, re.error) as error:
        if "does not match" not in str(error):
            raise InputError(f"format '{value}' of 'time' cannot be used: {error}") from None
    return value


def _rows(value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or value < 0:
        raise InputError(f"skip_rows must be a number of lines, not {value!r}")
    return value


def _splits(entry: Any, channels: Mapping[str, Source]) -> dict[str, float]:
    if not isinstance(entry, Mapping):
        raise InputError("split_at needs steps, as in {speed_step: 2.5, elevation_step: 4.0}")
    check_keys(entry, SPLITS, "split_at")
    for step, channel in SPLITS.items():
        if step in entry and channel not in channels:
            raise InputError(f"split_at has {step}, but no column is named for '{channel}'")
        if step in entry and not number(entry, step, 0.0, "split_at") > 0:
            raise InputError(f"{step} of split_at must be positive")
    return {SPLITS[step]: float(entry[step]) for step in entry}
