"""Imports a user's log (a table, a CAN log or a bag with other topics) into a bag with the project's
topics.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice, pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deeptruck_core.account import Account
from deeptruck_core.errors import InputError
from deeptruck_core.imports.entry_points import registered
from deeptruck_core.signals import CHANNELS, SLOPE_FROM, TruckInterface, check_slope_source
from deeptruck_model.checks import Clock, calls
from deeptruck_model.recordings import gated_brake, import_checks
from deeptruck_model.recordings.bag_writer import write_bag
from deeptruck_model.recordings.consistency import sensors
from deeptruck_model.recordings.extract import read
from deeptruck_model.recordings.grade import with_slope
from deeptruck_model.recordings.interpolate import GAP_PERIODS, GAP_S, HELD, LATCHED, Series, period
from deeptruck_model.recordings.recording import TABLE_NOTE, Recording
from deeptruck_model.recordings.resample import count_derived, uniform
from deeptruck_model.recordings.tables.columns import Columns, load_columns
from deeptruck_model.recordings.tables.samples import read_samples
from deeptruck_model.recordings.topic_map import stated
from deeptruck_model.results import BAG

Array = NDArray[np.float64]

IMPORTERS = "deeptruck.importers"
LEAST_RENEWALS = 20  # by which a value is seen to be held between them
EVEN = 1.5  # times their median step that samples are apart at most, where no one is missing
COARSE, SOONEST = 2.5, 0.6  # resolutions by which a coarse sensor changes; of the usual rows between renewals

CanLog = tuple[dict[str, tuple[Array, Array]], dict[str, Any]]


@dataclass(frozen=True)
class Imported:
    """The result of an import: the bag and its recordings."""

    bag: Path
    recordings: list[Recording]


def import_table(
    table: str | Path,
    columns: Mapping[str, Any] | str | Path,
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
    import_checks.check(table, columns, out, overwrite=overwrite, clock=clock)
    if import_checks.is_bag(table, columns):
        recordings = read(table, topic_map=columns, clock=clock, msg=msg)
        source = slope_from or stated(columns, SLOPE_FROM)
        recordings = _of_what_is_there(_with_slope(recordings, source, recordings[0].account))
        write_bag(out, recordings, interface=recordings[0].interface, overwrite=overwrite, kind=BAG)
        return Imported(out, recordings)
    if import_checks.is_can_log(table):
        return _import_can_log(table, columns, out, overwrite, slope_from)
    meaning = load_columns(columns)
    recordings = _of_what_is_there(_recordings(table, meaning, slope_from))
    write_bag(out, recordings, interface=recordings[0].interface, overwrite=overwrite, kind=BAG)
    return Imported(out, recordings)


def _recordings(path: Path, meaning: Columns, slope_from: str | None) -> list[Recording]:
    table = read_samples(path, meaning)
    time, values, account = table.time, table.values, table.account
    notes = [f"{TABLE_NOTE}{path.name}", *meaning.notes]
    cuts = table.begins + [
        time_of
        for channel, step in meaning.split_at.items()
        for time_of in _jumps(time, values[channel], step)
    ]
    series = {channel: _measured(channel, time, v, notes) for channel, v in values.items()}
    for channel, column in meaning.channels.items():
        if column.late_s:
            stamped = int((~np.isnan(series[channel].values)).sum())
            series[channel] = _on_time(channel, series[channel], column.late_s, _segments(time, cuts))
            lost = stamped - int((~np.isnan(series[channel].values)).sum())
            account.channel(channel).set_aside("outside their piece once put back by late_s", count=lost)
            notes.append(f"{channel} is stamped {column.late_s:g} s late and was put back")
    name = meaning.name or path.stem
    recordings = uniform(
        series,
        name=name,
        interface=_interface(name, meaning),
        rate_hz=np.inf,  # the table's own
        cuts=cuts,
        notes=notes,
        account=account,
    )
    if any(column.gates for column in meaning.channels.values()):
        recordings = [gated_brake.substituted(recording) for recording in recordings]
    recordings = _with_slope(recordings, slope_from or meaning.slope_from, account, meaning.grade_window_m)
    inside = np.zeros(len(time), dtype=bool)
    for start, end in account.spans:
        inside |= (time >= start - recordings[0].dt) & (time <= end + recordings[0].dt)
    table.set_aside(~inside, "outside the pieces, where speed is missing or has a single sample")
    return _noted(recordings, account)


def _noted(recordings: list[Recording], account: Account) -> list[Recording]:
    """Recordings with notes on what was omitted, which the bag then contains too."""
    said = [line.strip() for line in islice(account.lines(), 1, None)]
    return [replace(r, notes=tuple(dict.fromkeys((*r.notes, *said)))) for r in recordings]


def _measured(channel: str, time: Array, values: Array, notes: list[str]) -> Series:
    """The channel's samples, without the blank rows between them if a slow sensor fills only some rows.

    Samples that are evenly spaced in time lack none, whatever rows others add between them. A column that
    alternates and then stops belongs to a sensor that failed and is not treated as slow.
    """
    valid = ~np.isnan(values)
    renewed = np.zeros(0) if channel in (*HELD, *LATCHED) else renewals(values[valid])
    if len(renewed):
        rows = np.flatnonzero(valid)[renewed]
        every = round(float(np.median(np.diff(rows))))
        notes.append(
            f"{channel} is renewed every {every} rows and held between them: taken where it is renewed"
        )
        return Series(time[rows], values[rows])
    rows_apart, apart = np.diff(np.flatnonzero(valid)), np.diff(time[valid])
    most = EVEN * float(np.median(apart)) if len(apart) else 0.0
    ends = (time[valid][:1] - time[0] <= most).all() and (time[-1] - time[valid][-1:] <= most).all()
    even = len(apart) > LEAST_RENEWALS and float(apart.max()) <= most and ends
    if valid.all() or (len(rows_apart) and np.median(rows_apart) < 2.0 and not even):
        if not valid.all():
            notes.append(f"{channel} is invalid in {(~valid).sum()} rows of {len(values)}")
        return Series(time, values)
    notes.append(f"{channel} taken as sampled in the {valid.sum()} rows of {len(values)} that have it")
    return Series(time[valid], values[valid])


def renewals(values: Array) -> NDArray[np.int64]:
    """Rows (k,) at which a value that is held between them was renewed; none if it is not held.

    A sensor of coarse resolution also repeats its value, but for a varying number of rows, and then changes
    by its resolution. A value that stays for longer than usual was renewed in between with the same number.
    """
    changes = np.flatnonzero(np.diff(values, prepend=np.nan) != 0.0)
    apart = np.diff(changes[1:])
    if len(apart) < LEAST_RENEWALS or (every := int(np.median(apart))) < 2:
        return np.zeros(0, dtype=np.int64)
    off = np.abs(apart - every * np.rint(apart / every))
    regular = (off <= every // 10).mean() > 0.95
    resolution = float(np.diff(np.unique(np.round(values, 9))).min())
    coarse = float(np.median(np.abs(np.diff(values[changes])))) < COARSE * resolution
    if not regular and (coarse or (apart < SOONEST * every).mean() > 0.05):
        return np.zeros(0, dtype=np.int64)
    runs = [(i, j, max(1, round((j - i) / every))) for i, j in pairwise([*changes, len(values)])]
    return np.concatenate([i + (j - i) * np.arange(count) // count for i, j, count in runs])


def _jumps(time: Array, values: Array, step: float) -> Array:
    """Times of the samples that differ from the one before by more than `step`."""
    valid = ~np.isnan(values)
    return time[valid][1:][np.abs(np.diff(values[valid])) > step]


def _segments(time: Array, cuts: list[float]) -> Array:
    """Starts of the contiguous segments of a table, ascending, followed by infinity."""
    gap = max(GAP_S, GAP_PERIODS * period(time))
    behind_gaps = time[1:][np.diff(time) > gap]
    return np.unique(np.concatenate([time[:1], behind_gaps, cuts, [np.inf]]))


def _on_time(channel: str, series: Series, late_s: float, segments: Array) -> Series:
    """The series with corrected stamps.

    A sample that would leave its segment is not valid in the next segment and is dropped; a NaN ends every
    segment, so that no value is held into the next one. The speed's stamps are the clock of the recording,
    which ends with a segment's last row.
    """
    own = period(series.time)
    stamps, values = [np.zeros(0)], [np.zeros(0)]
    for begin, end in pairwise(segments):
        inside = (series.time >= begin) & (series.time < end)
        if not inside.any():
            continue
        clock = channel == "speed"
        moved = series.time[inside] - late_s
        stays = (moved >= begin) & ((moved <= series.time[inside][-1]) if clock else (moved < end))
        stamps += [moved[stays], *([] if clock else [np.minimum(moved[-1:] + own, end)])]
        values += [series.values[inside][stays], *([] if clock else [np.array([np.nan])])]
    return Series(np.concatenate(stamps), np.concatenate(values))


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
    recordings: list[Recording],
    source: str | None,
    account: Account | None,
    window_m: float | None = None,
) -> list[Recording]:
    """The recordings with a grade derived where it is not recorded, counted in the account."""
    sloped = with_slope(recordings, source, window_m)
    for before, after in zip(recordings, sloped, strict=True):
        derived = after.channels.get("grade")
        if account is not None and derived is not None and derived is not before.channels.get("grade"):
            count_derived(account, "grade", derived, before.start_s, before.dt)
    return sloped


def _import_can_log(
    log: Path, columns: Mapping[str, Any] | str | Path, out: Path, overwrite: bool, slope_from: str | None
) -> Imported:
    meaning = import_checks.columns_of_log(log, columns)
    source = check_slope_source(meaning.get(SLOPE_FROM)) or slope_from
    meaning = {key: entry for key, entry in meaning.items() if key != SLOPE_FROM}
    gated = gated_brake.is_asked(meaning.get("channels"), implied=(gated_brake.SWITCH,))
    if gated:
        others = {c: entry for c, entry in meaning["channels"].items() if c != gated_brake.COMMAND}
        meaning = {**meaning, "channels": others}
    try:
        channels, interface_data = _can_importer()(log, meaning)
    except ValueError as error:  # the other package's own error of one line
        raise InputError(str(error)) from None
    notes = [str(note) for note in interface_data.pop("notes", [])]
    account = interface_data.pop("account", None)
    if gated:
        if gated_brake.SWITCH not in channels:
            raise InputError(
                f"{log} holds no {gated_brake.SWITCH}, by which a brake command could be derived"
            )
        channels = {**channels, gated_brake.COMMAND: channels[gated_brake.SWITCH]}
        interface_data["brake_unit"] = gated_brake.UNIT
    interface = TruckInterface.from_dict(interface_data)
    unknown = sorted(set(channels) - set(CHANNELS))
    if unknown:
        raise InputError(f"the importer of {log} gave unknown channels: {', '.join(unknown)}")
    first = min((float(time[0]) for time, _ in channels.values() if len(time)), default=0.0)
    series = {c: Series(np.asarray(t, float) - first, np.asarray(v, float)) for c, (t, v) in channels.items()}
    name = str(meaning.get("name", log.stem))
    recordings = uniform(series, name=name, interface=interface, notes=notes, account=account)
    recordings = _with_slope(recordings, source, recordings[0].account)
    recordings = recordings if account is None else _noted(recordings, account)
    recordings = [gated_brake.substituted(r) for r in recordings] if gated else recordings
    recordings = _of_what_is_there(recordings)
    write_bag(out, recordings, interface=recordings[0].interface, overwrite=overwrite, kind=BAG)
    return Imported(out, recordings)


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
