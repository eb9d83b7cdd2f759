"""Prepares recordings for a simulator: checks that they belong together, that the data suffice, and what is
held out.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from deeptruck_core.constants import GRAVITY
from deeptruck_core.errors import InputError
from deeptruck_core.signals import FELT, FELT_SD, SPEED, TruckInterface
from deeptruck_core.vehicle_kinds import LEAST_SPEED, NO_COASTING
from deeptruck_model.checks.compatibility import how_without
from deeptruck_model.mismatch.prepare import checks
from deeptruck_model.mismatch.prepare.checks import noise_of, observed_acceleration
from deeptruck_model.mismatch.rules import Limits
from deeptruck_model.recordings import Recording
from deeptruck_model.recordings.grade import felt_slope
from deeptruck_model.simulators import Simulator

BRAKE = "brake_command"
SAME_DRIVES = (
    "few recordings and no other held out: the last 30 % of each was set aside, "
    "so the result holds for the same drives only"
)


def same_signals(simulator: Simulator, recordings: Sequence[Recording]) -> None:
    if not recordings:
        raise InputError("there is no recording to compare with; give at least one bag with data in it")
    need = {*simulator.interface.u, *simulator.interface.w}
    if not any(_valid(r, BRAKE) for r in recordings):
        need -= {BRAKE}  # not recorded at all: driven without braking, which is found where it acts
    for r in recordings:
        unknown = {n for n in need if not _valid(r, n)}
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
                    "import it with the simulator's unit"
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
    lacking = {id(r): [n for n in need if not _valid(r, n)] for r in recordings}
    having = {_bag(r) for r in recordings if not lacking[id(r)]}
    left_out = [r for r in recordings if lacking[id(r)] and _bag(r) in having]
    says = [f"{r.name} is left out: it has no valid {', '.join(lacking[id(r)])}" for r in left_out]
    kept = [r for r in recordings if not lacking[id(r)] or _bag(r) not in having]
    of = simulator.interface
    return [replace(r, interface=replace(r.interface, grade=of.grade, gear=of.gear)) for r in kept], says


def with_felt_slope(simulator: Simulator, recordings: Sequence[Recording]) -> list[Recording]:
    """The recordings with the slope that their accelerometer felt and its sd, as channels FELT and FELT_SD,
    where the simulator takes no slope; each bag's pieces together, as they have one sensor."""
    if not any(_valid(r, "specific_force") for r in recordings) or simulator.interface.grade:
        return list(recordings)
    bags: dict[str, list[Recording]] = {}
    for r in recordings:
        if _valid(r, "specific_force"):
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


def _valid(r: Recording, channel: str) -> bool:
    return channel in r.channels and bool(np.isfinite(r.channels[channel]).any())


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


def unusable(prepared: Sequence[Prepared], rejected: Sequence[checks.Rejection]) -> str | None:
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


Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

STANDING = "the truck stands or rolls too slowly to be compared"
BRAKING = "the truck slows as by brakes, which were not recorded"
RECOVERY_S = 1.0  # in which a learned simulator recovers from driving outside its training domain


@dataclass(frozen=True)
class Prepared:
    """A recording prepared for a simulator: without NaN, with speed smoothed as little as its noise
    permits."""

    recording: Recording
    u: Array
    w: Array
    y: Array
    observed: Array  # acceleration, (n,)
    valid: Mask
    speed_noise: float
    measured_acceleration: bool
    road: Array | None = None  # metres along the roads that all drives share (n,), by positions
    left_out: Mapping[str, int] = field(default_factory=dict)  # samples by reason, but for invalid ones

    @property
    def dt(self) -> float:
        return self.recording.dt

    def distance(self) -> Array:
        """Distance since its start, m, (n,)."""
        return np.cumsum(self.y[:, SPEED]) * self.dt

    def place(self) -> Array:
        """Position along the road (n,), m; drives without recorded positions all start at one place."""
        return self.distance() if self.road is None else self.road


def prepare(
    recording: Recording,
    measured_acceleration: bool,
    interface: TruckInterface | None = None,
) -> Prepared:
    """Fill missing samples, mark them invalid for as long as they can disturb, and estimate acceleration.

    `interface` is the simulator's, else the recording's; a response in it that the recording lacks, such as
    fuel, is NaN, and an unrecorded brake is zero.
    """
    if recording.interface.brake_unit is not None and not _valid(recording, BRAKE):
        recording = replace(recording, interface=replace(recording.interface, brake_unit=None))
    interface = interface or recording.interface
    dt = recording.dt
    needed = (*recording.interface.u, *recording.interface.w, "speed")
    bad = ~np.isfinite(recording.columns(needed).sum(axis=1))
    recorded = {n for n in recording.interface.y if np.isfinite(recording.channels.get(n, np.nan)).any()}
    filled = {name: fill(recording.channels[name]) for name in {*needed, *recorded}}
    speed = filled["speed"]
    noise = noise_of(recording.channels["speed"])
    width = float(np.clip(noise / 0.02, 0.0, 3.0)) * 0.15 / dt if dt < 0.5 else 0.0
    smooth = gaussian_filter1d(speed, width, mode="reflect") if width > 0.3 else speed
    accelerometer = recording.channels["acceleration"] if measured_acceleration else None
    observed = observed_acceleration(speed, accelerometer, dt)
    filled |= {"speed": smooth, "acceleration": observed}
    dead = widen(bad, round(0.3 / dt), round(2.0 / dt)) | (smooth < LEAST_SPEED)
    braking = np.zeros_like(dead)
    if recording.interface.brake_unit is None:
        slows = gaussian_filter1d(observed + _along_gravity(recording), max(1.0, 1.0 / dt)) < NO_COASTING
        unasked = filled["engine_command"] >= 0.0  # below, the motor is asked to slow the truck
        braking = widen(slows & unasked, round(2.0 / dt), round(3.0 / dt)) & ~dead
        dead |= braking
    dead[: round(Limits.settle_s / dt)] = True
    dead[len(dead) - round(1.0 / dt) :] = True
    whole = replace(recording, channels=filled)
    unknown = np.full(len(recording), np.nan)
    y = np.stack([filled.get(n, unknown) for n in interface.y], axis=1)
    u = whole.u
    if BRAKE in interface.u and recording.interface.brake_unit is None:
        u = np.column_stack([u, np.zeros(len(recording))])
    standing = smooth < LEAST_SPEED
    return Prepared(
        recording, u, whole.w, y, observed, ~dead, noise, measured_acceleration,
        left_out={STANDING: int(standing.sum()), BRAKING: int(braking.sum())},
    )  # fmt: skip


def _along_gravity(r: Recording) -> Array:
    """Deceleration by the slope of the road (n,), m/s^2, as recorded or felt; 0 where unknown."""
    unknown = np.full(len(r), np.nan)
    slope = r.channels.get("grade", unknown)
    return GRAVITY * np.nan_to_num(np.where(np.isfinite(slope), slope, r.channels.get(FELT, unknown)))


def learned(simulator: Simulator, p: Prepared) -> Prepared:
    """The recording with samples outside a learned simulator's training domain marked invalid."""
    driven = getattr(simulator, "driven", None)
    if driven is None:
        return p
    outside = ~driven.covers(p.y[:, SPEED], p.u, p.w)
    return replace(p, valid=p.valid & ~widen(outside, 0, round(RECOVERY_S / p.dt)))


def quantum(x: Array) -> float:
    """The quantisation step of a channel: its smallest common difference, at most 2 % of its range."""
    steps = np.abs(np.diff(x))
    steps = steps[steps > 1e-12]
    if len(steps) < 20:
        return 0.0
    return float(min(np.quantile(steps, 0.02), 0.02 * np.ptp(x)))


def fill(x: Array) -> Array:
    ok = np.isfinite(x)
    if ok.all():
        return x
    if not ok.any():
        return np.zeros_like(x)
    index = np.arange(len(x))
    return np.interp(index, index[ok], x[ok])


def widen(bad: Mask, before: int, after: int) -> Mask:
    if not bad.any():
        return bad
    kernel = np.ones(before + after + 1)
    full = np.convolve(bad.astype(float), kernel)
    return full[before : before + len(bad)] > 0.5
