"""Prepares recordings for the comparison: aligned drives, faults between sensors, and rejected samples."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import compress

import numpy as np

from deeptruck_model.mismatch.data import checks, speed_unit
from deeptruck_model.mismatch.data.prepared import (
    BRAKING,
    STANDING,
    Prepared,
    each_once,
    learned,
    prepare,
    same_signals,
    unusable,
    with_felt_slope,
    with_held_out,
    with_inputs,
)
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.residual.forced import forced, forgotten
from deeptruck_model.mismatch.roads.one_road import on_a_road_of_its_own, on_one_road, without_a_place
from deeptruck_model.mismatch.rules import Limits, Rules
from deeptruck_model.mismatch.unrecorded import NotRecorded, braking, inputs
from deeptruck_model.recordings import Recording
from deeptruck_model.recordings.consistency import gears, sensors
from deeptruck_model.recordings.splits import refuse_shared
from deeptruck_model.signals import ACCELERATION
from deeptruck_model.simulators import Simulator

OWN_ROAD = "by their positions {} meet no other drive: if they did, check latitude and longitude"
NO_PLACE = "positions of {} are missing or do not fit the speed: their place on the road is not known"
LEFT_OUT = "rows that were marked"
BRAKES_ACT = "the truck is off the simulator as by brakes, which were not recorded"
OUTSIDE_TRAINING = "the simulator has learned from no driving at such speeds, commands and slopes"
OTHER_GEAR = (
    "the simulator drives in another gear than was recorded or follows from the engine speed, or is in gear "
    "where the truck rolls in neutral"
)
FORGETS = (
    "the simulator has no force() and starts anew at each recorded response, which changes its own "
    "acceleration by {share:.0%}: what it forgets would be named as what it lacks. Add force(state, y), "
    "which keeps gear, boost and brake pressure"
)
CHECK_GEAR = (
    "in the gear that was recorded: look whether gear and engine_speed are recorded in the right units, or "
    "record more in gear; neutral, which is gear 0, cannot be compared with a simulator that is in gear"
)
RECORD_BRAKE = "without braking that was not recorded: record the brake, or more driving without it"
RECORD_MORE = "that can be compared: record at least several minutes above walking pace"


@dataclass(frozen=True)
class Span:
    """Seconds `from_s` to `to_s` of a recording, from the start of its bag, excluded from the comparison."""

    recording: str
    from_s: float
    to_s: float


@dataclass(frozen=True)
class PreparedDrives:
    """The usable recordings, in their original order, the problems found, and the inputs `missing` in them.
    `useless` is the reason why nothing can be compared, or None; `doubts` are about inputs and speed, which
    must be settled before anything that follows is believed."""

    prepared: tuple[Prepared, ...]
    held_out: tuple[bool, ...]
    faults: tuple[checks.SensorFault, ...]
    rejected: tuple[checks.Rejection, ...]
    caveats: tuple[str, ...]
    missing: tuple[NotRecorded, ...]
    useless: str | None
    doubts: tuple[str, ...] = ()

    @property
    def samples(self) -> int:
        """Number of recorded samples of all drives."""
        return sum(len(p.recording) for p in self.prepared)

    def part(self, held_out: bool) -> list[Prepared]:
        """The drives that are held out, or the others."""
        return [p for p, out in zip(self.prepared, self.held_out, strict=True) if out == held_out]


def prepare_drives(
    simulator: Simulator,
    recordings: Sequence[Recording],
    held_out: Sequence[Recording],
    rules: Rules,
    *,
    sets_aside: bool = True,
    without: Sequence[Span] = (),
    mass_kg: float | None = None,
) -> PreparedDrives:
    """Check and align the recordings; if none is held out, some are set aside, unless all are to be fitted.
    Rows in `without` do not count; a `mass_kg` counts as recorded. Raises InputError if recordings do not
    belong to the simulator."""
    gears.check(simulator, [*recordings, *held_out])
    mass_known = mass_kg is not None or "mass" in simulator.parameters()
    missing = inputs([*recordings, *held_out], mass_known=mass_known)
    asked = ("speed", *simulator.interface.u, *simulator.interface.w)
    doubts = tuple(sensors.of_inputs([*recordings, *held_out], asked))
    recordings, lacking = with_inputs(simulator, with_felt_slope(simulator, recordings))
    held_out, of_held_out = with_inputs(simulator, with_felt_slope(simulator, held_out))
    lacking += of_held_out
    same_signals(simulator, [*recordings, *held_out])
    fit, held, twice = each_once(recordings, held_out)
    refuse_shared(fit)
    drives, flags, caveats = (
        with_held_out(fit, held, simulator.dt)
        if held or sets_aside
        else (fit, [False] * len(fit), list[str]())
    )
    drives, rejected = checks.clean(drives)
    measured = checks.acceleration_is_measured(drives)
    faults = checks.sensor_faults(drives, rules) if measured else []
    to_fit = [not out for out in flags]
    faults = _by_commands(simulator, list(compress(drives, to_fit)), faults)
    whole = _corrected(simulator, drives, faults, measured)
    if unusable(list(compress(whole, to_fit)), rejected) is None:
        speed_unit.check(simulator, whole)
        if scaled := speed_unit.faults(simulator, whole, rules):
            faults = [*faults, *scaled]
            whole = _corrected(simulator, drives, faults, measured)
    aligned = on_one_road([learned(simulator, p) for p in whole])
    kept = tuple(_without(p, without) for p in aligned)
    left_out = {rule: sum(p.left_out[rule] for p in whole) for rule in (STANDING, BRAKING)}
    for rule, before, after in ((OUTSIDE_TRAINING, whole, aligned), (LEFT_OUT, aligned, kept)):
        left_out[rule] = sum(int((p.valid & ~q.valid).sum()) for p, q in zip(before, after, strict=True))
    rejected += [checks.Rejection(rule, samples) for rule, samples in left_out.items() if samples]
    rejected.sort(key=lambda r: -r.samples)
    aligned = kept
    fitted = list(compress(aligned, to_fit))
    useless = unusable(fitted, rejected)
    if useless is None and (share := forgotten(simulator, fitted)) > Limits.forgotten:
        useless = FORGETS.format(share=share)
    lost = [NO_PLACE.format(", ".join(names))] if (names := without_a_place(aligned)) else []
    lost += [OWN_ROAD.format(", ".join(names))] if (names := on_a_road_of_its_own(aligned)) else []
    remarks = (*lacking, *twice, *caveats, *lost)
    return PreparedDrives(
        aligned, tuple(flags), tuple(faults), tuple(rejected), remarks, missing, useless, doubts
    )


def left_to_compare(drives: PreparedDrives, e: Evidence) -> tuple[PreparedDrives, Evidence]:
    """The evidence without rows in which an unrecorded brake acts, and the drives: samples in which the
    simulator drives in another gear count as rejected, and if too little is left, they are useless."""
    e, missing = braking(e, drives.missing)
    drives = replace(drives, missing=missing)
    if e.other_gear:
        drives = replace(drives, rejected=(*drives.rejected, checks.Rejection(OTHER_GEAR, e.other_gear)))
    braked_s = 0.0 if e.hidden is None else float(e.hidden.sum()) * e.dt
    if braked_s:
        found = checks.Rejection(BRAKES_ACT, round(braked_s / drives.prepared[0].dt))
        drives = replace(drives, rejected=(*drives.rejected, found))
    seconds = float((e.valid & ~e.held_out).sum()) * e.dt
    if seconds < Limits.least_driving_s:
        lost = {CHECK_GEAR: e.other_gear * drives.prepared[0].dt, RECORD_BRAKE: braked_s}
        why = max(lost, key=lambda cure: lost[cure]) if any(lost.values()) else RECORD_MORE
        drives = replace(drives, useless=f"only {seconds:.0f} s of driving {why}")
    return drives, e


def _without(p: Prepared, spans: Sequence[Span]) -> Prepared:
    """The drive with the rows of the spans marked invalid; the simulator still runs through them."""
    time, valid = p.recording.time, p.valid
    for s in spans:
        if s.recording == p.recording.name:
            valid = valid & ~((time >= s.from_s) & (time <= s.to_s))
    return replace(p, valid=valid)


def _by_commands(
    simulator: Simulator, drives: Sequence[Recording], faults: Sequence[checks.SensorFault]
) -> list[checks.SensorFault]:
    """The faults; a lag or scale between speed and acceleration is attributed to the sensor whose correction
    reduces the residual more, because the two sensors alone do not show which is wrong."""
    chosen = list(faults)
    for i, fault in enumerate(faults):
        if (other := fault.elsewhere()) is not None:
            flipped = [*chosen[:i], other, *chosen[i + 1 :]]
            own, others = _misfits(simulator, drives, (chosen, flipped))
            chosen = flipped if others < own else chosen
    return chosen


def _misfits(
    simulator: Simulator, drives: Sequence[Recording], each: Sequence[Sequence[checks.SensorFault]]
) -> list[float]:
    """Sum of squared residuals in rows valid in all variants, for the drives corrected by each list of
    faults."""
    prepared = [_corrected(simulator, drives, faults, measured=True) for faults in each]
    rows = np.all([np.concatenate([p.valid for p in one]) for one in prepared], axis=0)
    out = []
    for one in prepared:
        runs = forced(simulator, one, [p.u for p in one])
        off = [p.observed - run.y[0, :, ACCELERATION] for p, run in zip(one, runs, strict=True)]
        out.append(float(np.sum(np.concatenate(off)[rows] ** 2)))
    return out


def _corrected(
    simulator: Simulator, drives: Sequence[Recording], faults: Sequence[checks.SensorFault], measured: bool
) -> list[Prepared]:
    return [prepare(checks.corrected(r, faults), measured, simulator.interface) for r in drives]
