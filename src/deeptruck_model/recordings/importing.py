"""Imports a user's log (a table, a CAN log or a bag with other topics) into a bag with the project's
topics.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from deeptruck_core.arrays import Array
from deeptruck_core.errors import InputError
from deeptruck_core.formats import BAG as BAG_OF_FRAMES
from deeptruck_core.formats import Kind, kind_of, suffix_of
from deeptruck_core.imports.entry_points import registered
from deeptruck_core.signals import CHANNELS, SLOPE_FROM, TruckInterface, check_slope_source
from deeptruck_model import calls
from deeptruck_model.recordings.bag_facts import Clock
from deeptruck_model.recordings.bag_writer import write_bag
from deeptruck_model.recordings.consistency import sensors
from deeptruck_model.recordings.extract import read
from deeptruck_model.recordings.grade import with_slope
from deeptruck_model.recordings.interpolate import Series
from deeptruck_model.recordings.recording import TABLE_NOTE, Recording
from deeptruck_model.recordings.resample import count_derived, uniform
from deeptruck_model.recordings.tables.columns import Columns, load_columns
from deeptruck_model.recordings.tables.samples import read_samples
from deeptruck_model.recordings.topic_map import is_topic_map, load_yaml
from deeptruck_model.results import BAG, apart

IMPORTERS = "deeptruck.importers"
A_MAP = (
    "a bag is converted by a topic map, lines such as 'speed: {topic: /odom, field: twist.twist.linear.x}' "
    "('deeptruck-model suggest BAG' proposes one); a bag of our topics is used as it is"
)

Meaning = Mapping[str, Any] | str | Path
CanLog = tuple[dict[str, tuple[Array, Array]], dict[str, Any]]


@dataclass(frozen=True)
class Imported:
    """The result of an import: the bag and its recordings."""

    bag: Path
    recordings: list[Recording]


def import_table(
    table: str | Path,
    columns: Meaning,
    out: str | Path,
    *,
    overwrite: bool = False,
    clock: Clock | None = None,
    msg: Sequence[str | Path] = (),
    slope_from: str | None = None,
) -> Imported:
    """Convert a CSV or Parquet table, a CAN log or a bag to the rosbag2 folder `out`, as COLUMNS.yaml
    describes.

    For a bag with other topics `columns` is the topic map, and `out` holds the recordings that `read` returns
    with it and `clock`. Recordings of a table keep its rate. Where the log lacks them, acceleration is
    derived from speed, and grade from an accelerometer and an elevation, or from the one named by
    `slope_from` (see `grade.with_slope`); the bag notes it.

    A CAN log (by its suffix) is passed to the first entry point of 'deeptruck.importers', a function `(log:
    Path, columns: dict) -> (channels, interface)`: `channels` maps our channel names to (times (n,) in s,
    ascending, values (n,)) in canonical units; `interface` is the dict of a TruckInterface and may have
    `notes`, which the recordings keep. Its ValueError becomes an InputError of the same message. The channels
    are then put on one 10 Hz clock.

    `overwrite` replaces an imported bag. Raises InputError with one line for input that cannot be used;
    nothing is left behind.
    """
    table, out = calls.path(table, "a table"), calls.path(out, "out")
    if not isinstance(columns, Mapping | str | Path):
        raise InputError(f"columns must be a mapping or a YAML file, not {calls.shown(columns)}")
    check_slope_source(slope_from)
    kind, meaning = check(table, columns, out, overwrite=overwrite, clock=clock), _mapping(columns)
    slope_from = slope_from or check_slope_source(meaning.get(SLOPE_FROM))
    if kind is Kind.BAG:
        recordings = read(table, topic_map=columns, clock=clock, msg=msg)
    elif kind is Kind.FRAMES:
        recordings = _of_can_log(table, {key: value for key, value in meaning.items() if key != SLOPE_FROM})
    else:
        recordings = _of_table(table, load_columns(columns))
    recordings = _with_slope(recordings, slope_from, meaning.get("grade_window_m"))
    recordings = recordings if kind is Kind.BAG else _noted(recordings)
    recordings = _of_what_is_there(recordings)
    write_bag(out, recordings, interface=recordings[0].interface, overwrite=overwrite, kind=BAG)
    return Imported(out, recordings)


def check(
    source: Path, columns: Meaning, out: Path, *, overwrite: bool = False, clock: Clock | None = None
) -> Kind:
    """The kind of input as which `source` is read. Raises InputError if `source` and `columns` do not fit, or
    if `out` cannot be written."""
    BAG.check(out, overwrite=overwrite)
    apart(out, source)
    if not source.exists():
        raise InputError(f"{source} does not exist")
    mapping, kind = _mapping(columns), kind_of(source) or Kind.TABLE
    if kind is Kind.BAG and not is_topic_map(mapping):
        kind = Kind.FRAMES  # a single file may hold frames
        if source.is_dir() or suffix_of(source) != BAG_OF_FRAMES:
            raise InputError(f"{source} is no table: {A_MAP}")
    if kind is not Kind.BAG and clock is not None:
        raise InputError(f"'--clock {clock}' is for bags, whose messages have two times; {source} is none")
    if kind is Kind.FRAMES and "time" in mapping:
        raise InputError(
            f"{source} is read as a CAN log, but these columns describe a table (they have a 'time'); "
            f"{A_MAP}; of a CAN log 'columns' has a vehicle (docs/can_bridge.md), or nothing: {{}}"
        )
    if kind is Kind.TABLE:
        load_columns(columns)
    return kind


def is_can_log(path: Path) -> bool:
    """Whether a file holds CAN frames; a single MCAP file without a topic map does."""
    return kind_of(path) is Kind.FRAMES or (suffix_of(path) == BAG_OF_FRAMES and not path.is_dir())


def is_table(path: Path) -> bool:
    """Whether `suggest` treats a file as a table: any file whose suffix is not that of a bag.

    Raises InputError for a CAN log: its meaning is in a vehicle file.
    """
    kind = kind_of(path)
    if kind is Kind.FRAMES and path.is_file():
        raise InputError(
            f"{path} is read as a CAN log: 'truck-bridge decode' shows its signals (docs/can_bridge.md), "
            f"and 'deeptruck-model import {path} --out BAG' needs no columns; a measurement of signals is "
            "exported as .csv or .parquet"
        )
    return kind is Kind.TABLE and (path.is_file() or path.is_dir())


def _mapping(columns: Meaning) -> dict[str, Any]:
    return load_yaml(Path(columns)) if isinstance(columns, str | Path) else dict(columns)


def _of_table(path: Path, meaning: Columns) -> list[Recording]:
    samples = read_samples(path, meaning)
    account, name = samples.table.account, meaning.name or path.stem
    recordings = uniform(
        samples.series,
        name=name,
        interface=_interface(name, meaning),
        rate_hz=np.inf,  # the table's own
        cuts=samples.cuts,
        notes=[f"{TABLE_NOTE}{path.name}", *meaning.notes, *samples.notes],
        account=account,
    )
    inside = np.zeros(len(samples.time), dtype=bool)
    for start, end in account.spans:
        inside |= (samples.time >= start - recordings[0].dt) & (samples.time <= end + recordings[0].dt)
    samples.table.without(~inside, "outside the pieces, where speed is missing or has a single sample")
    return recordings


def _noted(recordings: list[Recording]) -> list[Recording]:
    """Recordings with notes on what was omitted, which the bag then contains too."""
    account = recordings[0].account
    said = [line.strip() for line in islice(account.lines(), 1, None)] if account is not None else []
    return [replace(r, notes=tuple(dict.fromkeys((*r.notes, *said)))) for r in recordings]


def _interface(name: str, meaning: Columns) -> TruckInterface:
    channels = meaning.channels
    return TruckInterface(
        name,
        engine_unit=channels["engine_command"].unit if "engine_command" in channels else "N m",
        brake_unit=channels["brake_command"].unit if "brake_command" in channels else None,
        grade="grade" in channels,
        fuel="fuel_rate" in channels,
        vehicle=meaning.vehicle,
        mass_kg=meaning.mass_kg,
        driven_by=meaning.driven_by,
    )


def _with_slope(
    recordings: list[Recording], source: str | None, window_m: float | None = None
) -> list[Recording]:
    """The recordings with a grade derived where it is not recorded, counted in their account."""
    sloped = with_slope(recordings, source, window_m)
    for before, after in zip(recordings, sloped, strict=True):
        derived = after.channels.get("grade")
        if after.account is not None and derived is not None and derived is not before.channels.get("grade"):
            count_derived(after.account, "grade", derived, before.start_s, before.dt)
    return sloped


def _of_can_log(log: Path, meaning: dict[str, Any]) -> list[Recording]:
    try:
        channels, interface_data = _can_importer()(log, meaning)
    except ValueError as error:  # the other package's own error of one line
        raise InputError(str(error)) from None
    notes = [str(note) for note in interface_data.pop("notes", [])]
    account = interface_data.pop("account", None)
    interface = TruckInterface.from_dict(interface_data)
    unknown = sorted(set(channels) - set(CHANNELS))
    if unknown:
        raise InputError(f"the importer of {log} gave unknown channels: {', '.join(unknown)}")
    first = min((float(time[0]) for time, _ in channels.values() if len(time)), default=0.0)
    series = {c: Series(np.asarray(t, float) - first, np.asarray(v, float)) for c, (t, v) in channels.items()}
    name = str(meaning.get("name", log.stem))
    return uniform(series, name=name, interface=interface, notes=notes, account=account)


def _of_what_is_there(recordings: list[Recording]) -> list[Recording]:
    """Recordings whose interface omits brake, grade or fuel rate if these were never valid.

    Raises InputError if a channel contradicts the others.
    """
    sensors.refuse(recordings)
    interface, there = recordings[0].interface, {channel for r in recordings for channel in r.channels}
    fitting = replace(
        interface,
        brake_unit=interface.brake_unit if "brake_command" in there else None,
        grade=interface.grade and "grade" in there,
        fuel=interface.fuel and "fuel_rate" in there,
    )
    return [replace(r, interface=fitting) for r in recordings]


def _can_importer() -> Callable[[Path, dict[str, Any]], CanLog]:
    for entry in registered(IMPORTERS).values():
        try:
            importer: Callable[[Path, dict[str, Any]], CanLog] = entry.load()
        except (ImportError, AttributeError) as error:
            raise InputError(f"the CAN log importer '{entry.value}' cannot be loaded: {error}") from None
        return importer
    raise InputError(f"no CAN log importer is installed (entry point group '{IMPORTERS}')")
