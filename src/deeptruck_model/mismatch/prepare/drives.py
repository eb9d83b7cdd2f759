"""Recordings to the drives of a comparison: each once, with the inputs of the simulator, aligned, sound."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import compress

import numpy as np

from deeptruck_core.arrays import Array, Mask
from deeptruck_core.errors import InputError
from deeptruck_core.json_data import HIDDEN, stored
from deeptruck_core.signals import FELT, FELT_SD, channel_of
from deeptruck_core.vehicle_kinds import IMPOSSIBLE_ACCELERATION
from deeptruck_model.mismatch.prepare.places import on_a_road_of_its_own, on_one_road, without_a_place
from deeptruck_model.mismatch.prepare.prepared import (
    BRAKE,
    BRAKING,
    STANDING,
    Prepared,
    derivative,
    forgotten,
    has_valid,
    learned,
)
from deeptruck_model.mismatch.prepare.sensors import (
    SensorFault,
    acceleration_is_measured,
    by_commands,
    check_speed_unit,
    corrected_drives,
    sensor_faults,
    speed_scale_faults,
)
from deeptruck_model.mismatch.rules import Limits, Rules
from deeptruck_model.recordings import Recording
from deeptruck_model.recordings.compatibility import how_without
from deeptruck_model.recordings.consistency import sensors
from deeptruck_model.recordings.grade import felt_slope
from deeptruck_model.recordings.not_recorded import not_recorded as lacking
from deeptruck_model.recordings.not_recorded import unrecorded_braking
from deeptruck_model.recordings.splits import refuse_shared
from deeptruck_model.simulators import Simulator
from deeptruck_model.trucks import gears

SAME_DRIVES = (
    "few recordings and no other held out: the last 30 % of each was set aside, "
    "so the result holds for the same drives only"
)


CUT = "between the parts of a drive, where it was cut or has no valid speed"
STUCK = "brake_command never moves in a drive in which the truck brakes: was it recorded?"


@dataclass(frozen=True)
class Rejection:
    """Samples rejected by one rule."""

    rule: str
    samples: int


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
    faults: tuple[SensorFault, ...]
    rejected: tuple[Rejection, ...]
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
    without: Sequence[Span] = (),
    mass_kg: float | None = None,
) -> PreparedDrives:
    """Check and align the recordings; if none is held out, some are set aside. Rows in
    `without` do not count; a `mass_kg` counts as recorded. Raises InputError if recordings do not belong to
    the simulator."""
    everything = [*recordings, *held_out]
    gears.check(simulator, everything)
    mass_known = mass_kg is not None or "mass" in simulator.parameters()
    missing = inputs(everything, mass_known=mass_known)
    doubts = sensors.of_inputs(everything, ("speed", *simulator.interface.u, *simulator.interface.w))
    split = _split(simulator, recordings, held_out)
    cleaned, rejected = clean(split.recordings)
    to_fit = [not out for out in split.held_out]
    faults, sound = _sensors(simulator, cleaned, to_fit, rejected, rules)
    compared, left_out = _comparable(simulator, sound, without)
    rejected = sorted([*rejected, *left_out], key=lambda r: -r.samples)
    lost = [NO_PLACE.format(", ".join(names))] if (names := without_a_place(compared)) else []
    lost += [OWN_ROAD.format(", ".join(names))] if (names := on_a_road_of_its_own(compared)) else []
    fitted = list(compress(compared, to_fit))
    why = unusable(fitted, rejected)
    if why is None and (share := forgotten(simulator, fitted)) > Limits.forgotten:
        why = FORGETS.format(share=share)
    return PreparedDrives(
        compared,
        split.held_out,
        tuple(faults),
        tuple(rejected),
        (*split.remarks, *lost),
        missing,
        why,
        tuple(doubts),
    )


@dataclass(frozen=True)
class _Split:
    """Recordings that the simulator can be driven along, which are held out, and remarks on others."""

    recordings: list[Recording]
    held_out: tuple[bool, ...]
    remarks: tuple[str, ...]


def _split(simulator: Simulator, recordings: Sequence[Recording], held_out: Sequence[Recording]) -> _Split:
    """The recordings with all inputs of the simulator, each once, to fit or held out."""
    (given, lacking), (judging, of_judging) = (
        with_inputs(simulator, with_felt_slope(simulator, some)) for some in (recordings, held_out)
    )
    same_signals(simulator, [*given, *judging])
    to_fit, to_hold_out, twice = each_once(given, judging)
    refuse_shared(to_fit)
    drives, flags, remarks = with_held_out(to_fit, to_hold_out, simulator.dt)
    return _Split(drives, tuple(flags), (*lacking, *of_judging, *twice, *remarks))


def _sensors(
    simulator: Simulator,
    drives: Sequence[Recording],
    to_fit: Sequence[bool],
    rejected: Sequence[Rejection],
    rules: Rules,
) -> tuple[list[SensorFault], list[Prepared]]:
    """Faults between sensors, and the drives without them."""
    measured = acceleration_is_measured(drives)
    faults = sensor_faults(drives, rules) if measured else []
    faults = by_commands(simulator, list(compress(drives, to_fit)), faults)
    sound = corrected_drives(simulator, drives, faults, measured)
    if unusable(list(compress(sound, to_fit)), rejected) is None:
        check_speed_unit(simulator, sound)
        if scaled := speed_scale_faults(simulator, sound, rules):
            faults = [*faults, *scaled]
            sound = corrected_drives(simulator, drives, faults, measured)
    return faults, sound


def _comparable(
    simulator: Simulator, drives: Sequence[Prepared], without: Sequence[Span]
) -> tuple[tuple[Prepared, ...], list[Rejection]]:
    """The drives on one road whose valid rows are those that are compared, and what was left out by each
    rule."""
    known = on_one_road([learned(simulator, p) for p in drives])
    kept = tuple(_excluding(p, without) for p in known)
    left_out = {rule: sum(p.left_out[rule] for p in drives) for rule in (STANDING, BRAKING)}
    for rule, before, after in ((OUTSIDE_TRAINING, drives, known), (LEFT_OUT, known, kept)):
        left_out[rule] = sum(int((p.valid & ~q.valid).sum()) for p, q in zip(before, after, strict=True))
    return kept, [Rejection(rule, samples) for rule, samples in left_out.items() if samples]


def _excluding(p: Prepared, spans: Sequence[Span]) -> Prepared:
    """The drive with the rows of the spans marked invalid; the simulator still runs through them."""
    time, valid = p.recording.time, p.valid
    for s in spans:
        if s.recording == p.recording.name:
            valid = valid & ~((time >= s.from_s) & (time <= s.to_s))
    return replace(p, valid=valid)


def same_signals(simulator: Simulator, recordings: Sequence[Recording]) -> None:
    if not recordings:
        raise InputError("there is no recording to compare with; give at least one bag with data in it")
    need = {*simulator.interface.u, *simulator.interface.w}
    if not any(has_valid(r, BRAKE) for r in recordings):
        need -= {BRAKE}  # not recorded at all: driven without braking, which is found where it acts
    for r in recordings:
        unknown = {n for n in need if not has_valid(r, n)}
        missing = sorted(unknown | ({"speed", "acceleration"} - r.channels.keys()))
        if missing:
            raise InputError(
                f"recording '{r.name}' has no valid {', '.join(missing)}, which the simulator needs; "
                f"record it or use another simulator{how_without(missing)}"
            )
        for name in ("engine_command", BRAKE):
            here, there = r.interface.unit(name), simulator.interface.unit(name)
            if name in need and here != there:
                raise InputError(
                    f"recording '{r.name}' has {name} in {here}, the simulator in {there}; "
                    "record it in that unit, or use another simulator"
                )
        if abs(r.dt - simulator.dt) > 1e-6:
            raise InputError(_other_rate(r, 1 / simulator.dt))


def with_inputs(simulator: Simulator, recordings: Sequence[Recording]) -> tuple[list[Recording], list[str]]:
    """The recordings, except pieces that lack an input that other pieces of their bag have, and remarks on
    these.

    Such an input is, for example, a slope derived from distance driven, where a piece stands still. The
    interface of the recordings has the conditions that the simulator takes.
    """
    need = [n for n in (*simulator.interface.u, *simulator.interface.w) if n != BRAKE]
    lacking = {id(r): [n for n in need if not has_valid(r, n)] for r in recordings}
    having = {_bag(r) for r in recordings if not lacking[id(r)]}
    left_out = [r for r in recordings if lacking[id(r)] and _bag(r) in having]
    says = [f"{r.name} is left out: it has no valid {', '.join(lacking[id(r)])}" for r in left_out]
    kept = [r for r in recordings if not lacking[id(r)] or _bag(r) not in having]
    of = simulator.interface
    return [replace(r, interface=replace(r.interface, grade=of.grade, gear=of.gear)) for r in kept], says


def with_felt_slope(simulator: Simulator, recordings: Sequence[Recording]) -> list[Recording]:
    """The recordings with the slope that their accelerometer felt and its sd, as channels FELT and FELT_SD,
    where the simulator takes no slope; each bag's pieces together, as they have one sensor."""
    if not any(has_valid(r, "specific_force") for r in recordings) or simulator.interface.grade:
        return list(recordings)
    bags: dict[str, list[Recording]] = {}
    for r in recordings:
        if has_valid(r, "specific_force"):
            bags.setdefault(_bag(r), []).append(r)
    channels: dict[int, dict[str, Array]] = {}
    for pieces in bags.values():
        if (found := felt_slope(pieces)) is not None:
            for r, s in zip(pieces, found.of, strict=True):
                channels[id(r)] = {FELT: s.grade, FELT_SD: s.sd}
    return [replace(r, channels={**r.channels, **channels.get(id(r), {})}) for r in recordings]


def _bag(r: Recording) -> str:
    """The bag of a piece: pieces are named `bag#0`, `bag#1`."""
    return r.name.partition("#")[0]


def _other_rate(r: Recording, rate_hz: float) -> str:
    """The error message for a recording at another rate than the simulator's, with the remedy."""
    own_hz = 1 / r.dt
    if own_hz > rate_hz:
        cure = f"read it with rate_hz={rate_hz:g}"
    else:
        cure = (
            f"read it with rate_hz={rate_hz:g} if it has as many; else record at {rate_hz:g} Hz, or compare "
            f"with a simulator of {own_hz:g} Hz: 'deeptruck-model train' makes one of recordings at that rate"
        )
    return f"recording '{r.name}' is at {own_hz:g} Hz, the simulator at {rate_hz:g} Hz; {cure}"


def each_once(
    fit: Sequence[Recording], held: Sequence[Recording]
) -> tuple[list[Recording], list[Recording], list[str]]:
    """Recordings to fit and to hold out, without duplicates: a drive in both is held out, even under
    different names, unless nothing would be left to fit."""
    caveats: list[str] = []
    if all(any(_same(r, h) for h in held) for r in fit):
        held = ()
        caveats = (
            ["the held-out recordings are those to be fitted and judge nothing; give other drives"]
            if fit
            else []
        )
    chosen: list[Recording] = list(held)
    kept: list[Recording] = []
    for r in fit:
        known = next((other for other in [*chosen, *kept] if _same(r, other)), None)
        if known is not None:
            use = "held out" if any(known is h for h in chosen) else "fitted"
            same = (
                f"is the same as '{known.name}', which is {use}" if r.name != known.name else "is given twice"
            )
            caveats.append(f"recording '{r.name}' {same}; it is {use} once")
        else:
            kept.append(r)
    return kept, chosen, caveats


def _same(one: Recording, other: Recording) -> bool:
    driven = ("speed", *one.interface.u)  # two cruises at one speed differ by their commands alone
    a, b = one.columns(driven), other.columns(driven)
    return (
        len(a) == len(b)
        and np.array_equal(a, b, equal_nan=True)
        and bool(np.nanmax(a[:, 0], initial=0.0) > 0)
    )


def with_held_out(
    fit: list[Recording], held: list[Recording], dt: float
) -> tuple[list[Recording], list[bool], list[str]]:
    """The recordings, and which of them are held out; if none was given, the last part is held out."""
    if held:
        return fit + held, [False] * len(fit) + [True] * len(held), []
    if len(fit) >= 4:
        count = max(1, round(Limits.held_out_share * len(fit)))
        return (
            fit,
            [False] * (len(fit) - count) + [True] * count,
            [f"no --held-out given: the last {count} of {len(fit)} pieces are kept for judging"],
        )
    pieces, flags = [], []
    for r in fit:
        cut = int(len(r) * (1 - Limits.held_out_share))
        if (len(r) - cut) * dt < Limits.least_driving_s:
            pieces.append(r)
            flags.append(False)
            continue
        pieces += [r.piece(0, cut), r.piece(cut, len(r))]
        flags += [False, True]
    return pieces, flags, [SAME_DRIVES]


def unusable(prepared: Sequence[Prepared], rejected: Sequence[Rejection]) -> str | None:
    """Why the recordings to fit cannot be used, or None."""
    seconds = sum(float(p.valid.sum()) * p.dt for p in prepared)
    if seconds < Limits.least_driving_s:
        if rejected:
            most = rejected[0]
            why = f"{most.rule} ({most.samples} samples)"
            return f"only {seconds:.0f} s of usable driving; most was set aside because: {why}"
        return f"only {seconds:.0f} s of usable driving: record at least several minutes above walking pace"
    speed = np.concatenate([p.y[p.valid, 1] for p in prepared])
    if np.std(speed) < Limits.least_speed_sd:
        return (
            "the speed is constant throughout, so no force is distinguishable from another: "
            "accelerate, brake and coast between 5 and 25 m/s"
        )
    return None


def clean(recordings: Sequence[Recording]) -> tuple[list[Recording], list[Rejection]]:
    """Recordings with impossible samples replaced by NaN, and the number of samples by rule."""
    counts: dict[str, int] = {}
    out = []
    for before, r in zip([None, *recordings], recordings, strict=False):
        if (lacking := round((r.gap_after(before) or 0.0) / r.dt) - 1) > 0:
            counts[CUT] = counts.get(CUT, 0) + lacking
        channels = {name: x.copy() for name, x in r.channels.items()}
        for name, x in channels.items():
            low, high = channel_of(name).low, channel_of(name).high
            _reject(
                x,
                (x < low) | (x > high),
                f"{name} outside {low:g} .. {high:g} {r.interface.unit(name)}",
                counts,
            )
        speed = channels["speed"]
        jump = np.abs(derivative(speed, r.dt)) > IMPOSSIBLE_ACCELERATION
        _reject(speed, jump, f"speed jumps by more than {IMPOSSIBLE_ACCELERATION:g} m/s^2", counts)
        if "brake_command" in r.interface.u:
            _reject(channels["brake_command"], unrecorded_braking(r, speed), STUCK, counts)
        for name in ("speed", *r.interface.u, *r.interface.w):
            missing = int(np.isnan(r.channels[name]).sum())
            if missing:
                counts[f"{name} missing or invalid"] = counts.get(f"{name} missing or invalid", 0) + missing
        out.append(replace(r, channels=channels))
    return out, [Rejection(rule, n) for rule, n in sorted(counts.items(), key=lambda item: -item[1])]


def _reject(x: Array, bad: Mask, rule: str, counts: dict[str, int]) -> None:
    if bad.any():
        counts[rule] = counts.get(rule, 0) + int(bad.sum())
        x[bad] = np.nan
