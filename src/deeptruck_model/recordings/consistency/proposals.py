"""Compares candidates of a bag or table with one another: which agree with the speed, and which are
doubtful.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from deeptruck_core.arrays import Array
from deeptruck_core.errors import InputError
from deeptruck_core.signals import TruckInterface
from deeptruck_model.recordings.candidates import OURS, Candidate, Proposal
from deeptruck_model.recordings.consistency import accelerometer, agreement, sensors
from deeptruck_model.recordings.consistency.impossible import changed_unit, lost_decimals
from deeptruck_model.recordings.consistency.windows import CORRELATED, late
from deeptruck_model.recordings.extract import SIDEWAYS
from deeptruck_model.recordings.interpolate import Series
from deeptruck_model.recordings.message_types import Role
from deeptruck_model.recordings.recording import Recording
from deeptruck_model.recordings.resample import uniform
from deeptruck_model.recordings.topic_map import Taken
from deeptruck_model.recordings.units import conversion

Values = Callable[[Candidate], tuple[Array, Array] | None]

APART_M_S = 0.5  # rms: speeds of two sources that differ by more are both named
ONE_UNIT = (0.85, 1.18)  # of a value over what others give; units differ by 1.15 (mph, knot) and more
NEAREST = 0.3  # of the next unit's misfit, in logs, that a unit may have
TOP_GEAR = 2.8  # rad of the crankshaft for a metre: fewer no road vehicle has in its highest gear
LEAST_MOVING = 30  # samples, to judge by engine speed
COMPARED = (
    "speed", "acceleration", "specific_force", "engine_command", "brake_command", "grade", "elevation",
    "engine_speed", "latitude", "longitude",
)  # fmt: skip


def settled(found: Proposal, values: Values, across: Callable[[Candidate], Candidate | None]) -> list[str]:
    """Reorder the candidates of acceleration and speed by their agreement; returns doubts about the proposal,
    one line each.

    `values` gives the times, s, and raw values, each (n,), of a candidate; `across` the other component of a
    vector, None if it is no vector.
    """
    speeds = found.candidates.get("speed", [])
    for k, one in enumerate(speeds):
        other = across(one) if one.role is not Role.COMMANDED and one.sure != OURS else None
        moved = values(other) if other is not None else None
        if moved is not None and float(np.sqrt(np.nanmean(moved[1] ** 2))) > SIDEWAYS and other is not None:
            both = [one.field.path, other.field.path]
            speeds[k] = replace(
                one,
                across=other.field.path,
                why=f"{one.why.partition(':')[0]}: {' and '.join(both)} move, as east and north: their norm",
            )
    for channel in COMPARED:
        if channel in found.candidates:
            found.candidates[channel][:] = [_possible(one, values) for one in found.candidates[channel]]
            found.candidates[channel].sort(key=lambda one: not one.unit and bool(one.needs))
    speed = found.taken("speed")
    if speed is None:
        return []
    _accelerometers(found, speed, values)
    _grades(found, speed, values)
    taken = ((channel, found.taken(channel)) for channel in COMPARED)
    proposed = {channel: one for channel, one in taken if one is not None}
    others = [other for other in speeds if other.unit and other is not speed and not across(other)]
    apart = [says for other in others if (says := _apart(speed, other, values))]
    return [*apart, *(doubt.says for doubt in sensors.doubts(_recordings(proposed, values)))]


def _possible(one: Candidate, values: Values) -> Candidate:
    """The candidate without its unit, if no truck has such numbers: a speed that is 0 all the time, or one
    whose decimal points were lost."""
    if one.sure == OURS or one.role is Role.COMMANDED:
        return one
    if one.channel == "speed" and one.field.low == one.field.high == 0.0 and not one.across:
        return replace(one, unit="", needs="another source: this one is 0 all the time")
    held = values(one) if one.channel in ("speed", "elevation", "engine_speed") else None
    needs = ""
    if held is not None and (says := lost_decimals(held[1])):
        needs = f"numbers with their decimal points: {says}"
    elif held is not None and one.channel == "speed" and (change := changed_unit(*held)):
        needs = f"one unit: it {change}"
    return replace(one, unit="", needs=needs) if needs else one


def _grades(found: Proposal, speed: Candidate, values: Values) -> None:
    """Take its unit from each candidate of grade that is no slope of the road by the other channels."""
    beside = {"speed": speed, "elevation": found.taken("elevation")}
    several = found.candidates.get("grade", [])
    for k, one in enumerate(several):
        drive = {
            c: other for c, other in {**beside, "grade": one}.items() if other is not None and other.unit
        }
        doubts = agreement.grade_doubts(_recordings(drive, values)) if one.unit and one.sure != OURS else ()
        no_slope = next((doubt.says for doubt in doubts if doubt.wrong), "")
        if no_slope:
            several[k] = replace(one, unit="", needs=f"another source: {no_slope}")
    several.sort(key=lambda one: not one.unit)


def _apart(speed: Candidate, other: Candidate, values: Values) -> str:
    """How the speed of another source differs from the one that is taken; '' if the two agree."""
    drives = [_recordings({"speed": one}, values) for one in (speed, other)]
    if not all(drives) or drives[0][0].dt != drives[1][0].dt:
        return ""
    one, two = (parts[0].channels["speed"] for parts in drives)
    late_s, at_once, shifted = late(one, two, drives[0][0].dt)
    if at_once < APART_M_S:
        return ""
    says = f"{other.label} differs from {speed.label} by {at_once:.1f} m/s rms"
    if late_s and shifted < 0.5 * at_once:
        says += f", as it is {abs(late_s):g} s {'late' if late_s > 0 else 'early'} (late_s: {late_s:g})"
    return f"{says}: {speed.label} is taken for speed"


def _accelerometers(found: Proposal, speed: Candidate, values: Values) -> None:
    """Sort the candidates of acceleration and specific force: which follow the speed, and which of the two
    they are by the data."""
    kinds = ("acceleration", "specific_force")
    every = [one for kind in kinds for one in found.candidates.get(kind, [])]
    grade = found.taken("grade")
    by_kind: dict[str, list[Candidate]] = {kind: [] for kind in kinds}
    for one in every:
        drive = {"speed": speed, one.channel: one} | ({} if grade is None else {"grade": grade})
        if one.unit and one.sure != OURS and (pieces := _recordings(drive, values)):
            one = _followed(one, accelerometer.accelerometer(pieces, one.channel), normed=bool(speed.across))
            felt = accelerometer.felt(pieces, one.channel) if one.follows else None
            if felt is not None and felt.channel not in (None, one.channel):
                one = replace(one, channel=str(felt.channel), why=f"{one.why}; {felt.by}")
            elif felt is not None and felt.channel is None and one.channel == "acceleration":
                one = replace(one, why=f"{one.why}; if a sensor measured it, call it specific_force")
        by_kind[one.channel].append(one)
    for kind, several in by_kind.items():
        several.sort(key=lambda one: (one.role, not one.follows, not one.unit))
        if several or kind in found.candidates:
            found.candidates[kind] = several


def _followed(one: Candidate, found: accelerometer.Accelerometer | None, *, normed: bool) -> Candidate:
    """The candidate with evidence for or against it; beside a speed that is the norm of two components, one
    component of the acceleration is none along the truck."""
    if found is None:
        return one
    by = f"slope {found.slope:.2f} on the derivative of speed, correlation {found.correlation:.2f}"
    partial = normed and not accelerometer.TURNED < abs(found.slope) < 1.0 / accelerometer.TURNED
    if partial or found.still < accelerometer.STILL or abs(found.correlation) < CORRELATED:
        still = "stands still" if found.still < accelerometer.STILL else "does not follow it"
        still = "is one component" if partial and abs(found.correlation) >= CORRELATED else still
        needs = f"another sensor or axis: while the speed changes this one {still} ({by})"
        return replace(one, unit="", needs=needs)
    if found.correlation < 0.0:
        turned = f"{one.why}; turned, as it has {by}"
        return replace(one, scale=-one.scale, offset=-one.offset, follows=True, why=turned)
    return replace(one, follows=True, why=f"{one.why}; {by}")


def unit_of(
    channel: str,
    options: Sequence[tuple[str, float]],
    column: Series,
    known: Mapping[str, list[tuple[str, Series]]],
) -> tuple[str, float, str]:
    """The unit and scale among `options` in which a column of speed, acceleration or grade agrees with
    columns of known units, and the reason; '' if there is none.

    `known` are the columns of other channels in SI, with their names; those of a distance travelled have
    their own.
    """
    for what, others in _partners(channel, known):
        off = {one: _off(channel, one, column, others) for one in options if one[0]}
        near = sorted((abs(np.log(factor)), one) for one, factor in off.items() if factor is not None)
        if near and (len(near) == 1 or near[0][0] < NEAREST * near[1][0]):
            unit, scale = near[0][1]
            counts = "" if scale == 1.0 else f"counts of {scale:.4g} "
            return unit, scale, f"{counts}{unit} by agreement with {what}"
    for what, engine in known.get("engine_speed", []) if channel == "speed" else ():
        moving = (column.values > 0.4 * np.nanmax(column.values)) & (engine.values > 0.0)
        left = [unit for unit, scale in options if unit != "m/s" and scale == 1.0]
        turns = engine.values[moving] / column.values[moving]
        if moving.sum() >= LEAST_MOVING and len(left) == 1 and np.quantile(turns, 0.05) < TOP_GEAR:
            return left[0], 1.0, f"no m/s by the engine speed in '{what}', so {left[0]}"
    return "", 1.0, ""


def _partners(
    channel: str, known: Mapping[str, list[tuple[str, Series]]]
) -> Iterator[tuple[str, dict[str, Series]]]:
    """What a channel can be compared with, and the columns for it."""
    speeds = known.get("speed", [])
    if channel == "speed":
        yield from ((f"'{name}'", {agreement.OTHER_SPEED: one}) for name, one in speeds)
        for name, one in known.get("acceleration", []):
            yield f"the acceleration in '{name}'", {"acceleration": one}
        for name, several in known.items():
            if agreement.metres_of(name):
                yield f"the distance in '{name}'", {name: several[0][1]}
        for north, east in zip(known.get("latitude", []), known.get("longitude", []), strict=False):
            yield f"the positions in '{north[0]}'", {"latitude": north[1], "longitude": east[1]}
    elif channel == "acceleration":
        yield from ((f"the speed in '{name}'", {"speed": one}) for name, one in speeds)
    elif channel == "grade":
        for name, height in known.get("elevation", []):
            for _, speed in speeds:
                yield f"the height in '{name}'", {"elevation": height, "speed": speed}


def _off(
    channel: str, option: tuple[str, float], column: Series, others: Mapping[str, Series]
) -> float | None:
    """The factor of a column in this unit and scale to what the others give; None if it is none of it."""
    unit, scale = option
    read = Series(column.time, conversion(channel, unit)(scale * column.values))
    try:
        drives = uniform({**others, channel: read}, name="proposed", interface=TruckInterface("proposed"))
    except InputError:
        return None
    least, most = ONE_UNIT
    return next(
        (
            one.factor
            for one in agreement.comparisons(drives, channel)
            if least < one.factor < most and not one.correlation < CORRELATED
        ),
        None,
    )


def _recordings(chosen: Mapping[str, Candidate], values: Values) -> list[Recording]:
    """The candidates read as one drive; empty if that fails."""
    series, units = {}, {"engine_command": "N m", "brake_command": "percent"}
    for channel, one in chosen.items():
        found = values(one)
        if found is None or not one.unit:
            continue
        convert = conversion(channel, one.unit)
        units[channel] = convert.unit
        with np.errstate(invalid="ignore"):
            taken = Taken(convert=convert, scale=one.scale, offset=one.offset, part=one.part)
            series[channel] = Series(found[0], taken(found[1]))
    interface = TruckInterface("proposed", units["engine_command"], units["brake_command"])
    try:
        return uniform(series, name="proposed", interface=interface)
    except InputError:
        return []
