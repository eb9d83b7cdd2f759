"""Prepares recordings for the comparison: aligned drives, faults between sensors, and rejected samples."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import compress

import numpy as np

from deeptruck_core.json_data import HIDDEN, stored
from deeptruck_core.signals import ACCELERATION
from deeptruck_model.mismatch.prepare import checks, speed_unit
from deeptruck_model.mismatch.prepare.one_road import on_a_road_of_its_own, on_one_road, without_a_place
from deeptruck_model.mismatch.prepare.prepared import (
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
from deeptruck_model.mismatch.prepare.runs import forced, forgotten
from deeptruck_model.mismatch.rules import Limits, Rules
from deeptruck_model.recordings import Recording
from deeptruck_model.recordings.consistency import gears, sensors
from deeptruck_model.recordings.not_recorded import not_recorded as lacking
from deeptruck_model.recordings.splits import refuse_shared
from deeptruck_model.simulators import Simulator

OWN_ROAD = "by their positions {} meet no other drive: if they did, check latitude and longitude"
NO_PLACE = "positions of {} are missing or do not fit the speed: their place on the road is not known"
LEFT_OUT = "rows that were marked"
OUTSIDE_TRAINING = "the simulator has learned from no driving at such speeds, commands and slopes"
FORGETS = (
    "the simulator has no force() and starts anew at each recorded response, which changes its own "
    "acceleration by {share:.0%}: what it forgets would be named as what it lacks. Add force(state, y), "
    "which keeps gear, boost and brake pressure"
)


@dataclass(frozen=True)
class Span:
    """Seconds `from_s` to `to_s` of a recording, from the start of its bag, excluded from the comparison."""

    recording: str
    from_s: float
    to_s: float


@dataclass(frozen=True)
class NotRecorded:
    """An input that was not recorded or not obeyed: what it `hides`, the `signal` to record, the share of the
    compared time in which it acts (None if not searched), and the gain in nats."""

    input: str
    hides: str
    signal: str
    share_of_time: float | None = field(default=None, metadata=stored(digits=4, sparse=True))
    gain: float = field(default=0.0, metadata=HIDDEN)


def inputs(recordings: Sequence[Recording], *, mass_known: bool = False) -> tuple[NotRecorded, ...]:
    """Inputs that at least one recording lacks; a mass that the simulator or the user states counts as
    recorded."""
    return tuple(
        NotRecorded(m.input.name, m.input.hides, m.signal)
        for m in lacking(recordings)
        if not (mass_known and m.input.name == "mass")
    )


@dataclass(frozen=True)
class PreparedDrives:
    """The usable recordings, in their original order, the problems found, and the inputs `missing` in them.
    `unusable_because` is the reason why nothing can be compared, or None; `doubts` are about inputs and
    speed, which must be settled before anything that follows is used."""

    prepared: tuple[Prepared, ...]
    held_out: tuple[bool, ...]
    faults: tuple[checks.SensorFault, ...]
    rejected: tuple[checks.Rejection, ...]
    caveats: tuple[str, ...]
    missing: tuple[NotRecorded, ...]
    unusable_because: str | None
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
    everything = [*recordings, *held_out]
    gears.check(simulator, everything)
    mass_known = mass_kg is not None or "mass" in simulator.parameters()
    missing = inputs(everything, mass_known=mass_known)
    doubts = sensors.of_inputs(everything, ("speed", *simulator.interface.u, *simulator.interface.w))
    split = _split(simulator, recordings, held_out, sets_aside=sets_aside)
    cleaned, rejected = checks.clean(split.recordings)
    to_fit = [not out for out in split.held_out]
    faults, sound = _sensors(simulator, cleaned, to_fit, rejected, rules)
    compared, left_out = _comparable(simulator, sound, without)
    rejected = sorted([*rejected, *left_out], key=lambda r: -r.samples)
    lost = [NO_PLACE.format(", ".join(names))] if (names := without_a_place(compared)) else []
    lost += [OWN_ROAD.format(", ".join(names))] if (names := on_a_road_of_its_own(compared)) else []
    return PreparedDrives(
        compared,
        split.held_out,
        tuple(faults),
        tuple(rejected),
        (*split.remarks, *lost),
        missing,
        _unusable(simulator, list(compress(compared, to_fit)), rejected),
        tuple(doubts),
    )


@dataclass(frozen=True)
class _Split:
    """Recordings that the simulator can be driven along, which are held out, and remarks on others."""

    recordings: list[Recording]
    held_out: tuple[bool, ...]
    remarks: tuple[str, ...]


def _split(
    simulator: Simulator, recordings: Sequence[Recording], held_out: Sequence[Recording], *, sets_aside: bool
) -> _Split:
    """The recordings with all inputs of the simulator, each once, to fit or held out."""
    (given, lacking), (judging, of_judging) = (
        with_inputs(simulator, with_felt_slope(simulator, some)) for some in (recordings, held_out)
    )
    same_signals(simulator, [*given, *judging])
    to_fit, to_hold_out, twice = each_once(given, judging)
    refuse_shared(to_fit)
    drives, flags, remarks = to_fit, [False] * len(to_fit), list[str]()
    if to_hold_out or sets_aside:
        drives, flags, remarks = with_held_out(to_fit, to_hold_out, simulator.dt)
    return _Split(drives, tuple(flags), (*lacking, *of_judging, *twice, *remarks))


def _sensors(
    simulator: Simulator,
    drives: Sequence[Recording],
    to_fit: Sequence[bool],
    rejected: Sequence[checks.Rejection],
    rules: Rules,
) -> tuple[list[checks.SensorFault], list[Prepared]]:
    """Faults between sensors, and the drives without them."""
    measured = checks.acceleration_is_measured(drives)
    faults = checks.sensor_faults(drives, rules) if measured else []
    faults = by_commands(simulator, list(compress(drives, to_fit)), faults)
    sound = corrected_drives(simulator, drives, faults, measured)
    if unusable(list(compress(sound, to_fit)), rejected) is None:
        speed_unit.check_speed_unit(simulator, sound)
        if scaled := speed_unit.speed_scale_faults(simulator, sound, rules):
            faults = [*faults, *scaled]
            sound = corrected_drives(simulator, drives, faults, measured)
    return faults, sound


def _comparable(
    simulator: Simulator, drives: Sequence[Prepared], without: Sequence[Span]
) -> tuple[tuple[Prepared, ...], list[checks.Rejection]]:
    """The drives on one road whose valid rows are those that are compared, and what was left out by each
    rule."""
    known = on_one_road([learned(simulator, p) for p in drives])
    kept = tuple(_excluding(p, without) for p in known)
    left_out = {rule: sum(p.left_out[rule] for p in drives) for rule in (STANDING, BRAKING)}
    for rule, before, after in ((OUTSIDE_TRAINING, drives, known), (LEFT_OUT, known, kept)):
        left_out[rule] = sum(int((p.valid & ~q.valid).sum()) for p, q in zip(before, after, strict=True))
    return kept, [checks.Rejection(rule, samples) for rule, samples in left_out.items() if samples]


def _unusable(
    simulator: Simulator, to_fit: Sequence[Prepared], rejected: Sequence[checks.Rejection]
) -> str | None:
    """Why nothing can be compared, or None."""
    why = unusable(to_fit, rejected)
    if why is None and (share := forgotten(simulator, to_fit)) > Limits.forgotten:
        why = FORGETS.format(share=share)
    return why


def _excluding(p: Prepared, spans: Sequence[Span]) -> Prepared:
    """The drive with the rows of the spans marked invalid; the simulator still runs through them."""
    time, valid = p.recording.time, p.valid
    for s in spans:
        if s.recording == p.recording.name:
            valid = valid & ~((time >= s.from_s) & (time <= s.to_s))
    return replace(p, valid=valid)


def by_commands(
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
    prepared = [corrected_drives(simulator, drives, faults, measured=True) for faults in each]
    rows = np.all([np.concatenate([p.valid for p in one]) for one in prepared], axis=0)
    out = []
    for one in prepared:
        runs = forced(simulator, one, [p.u for p in one])
        off = [p.observed - run.y[0, :, ACCELERATION] for p, run in zip(one, runs, strict=True)]
        out.append(float(np.sum(np.concatenate(off)[rows] ** 2)))
    return out


def corrected_drives(
    simulator: Simulator, drives: Sequence[Recording], faults: Sequence[checks.SensorFault], measured: bool
) -> list[Prepared]:
    return [prepare(checks.corrected(r, faults), measured, simulator.interface) for r in drives]
