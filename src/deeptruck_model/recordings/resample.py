"""Resamples channels from their own times to recordings on one uniform clock, cut into contiguous pieces.

The clock follows the speed samples.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from deeptruck_core.account import Account, Tally, moment
from deeptruck_core.arrays import Array
from deeptruck_core.errors import InputError
from deeptruck_core.signals import CHANNELS, TruckInterface
from deeptruck_model.recordings.consistency import accelerometer, agreement
from deeptruck_model.recordings.consistency.impossible import (
    FUEL,
    STANDS,
    Places,
    held_beside,
    moving_at_zero,
    senders,
)
from deeptruck_model.recordings.consistency.sensors import doubts
from deeptruck_model.recordings.interpolate import (
    GAP_PERIODS,
    GAP_S,
    SNAP,
    Series,
    at_ticks,
    period,
)
from deeptruck_model.recordings.ranges import NEEDED, REVERSING, Range, Seen, reversing
from deeptruck_model.recordings.recording import FROM_SPEED, Recording
from deeptruck_model.recordings.renewals import one_per_burst, renewed
from deeptruck_model.recordings.units import metres_per_degree

FUEL_UNITS = ("g/s", "cm^3/s")  # of an engine command that is a fuel rate
NO_SPEED = "recorded while there was no speed"
DERIVED, WITHOUT = "derived where there is no speed", "derived where there is nothing to derive it from"
JUMPED = "derived where it jumps faster than any truck"
UNMOVED = "zero while positions move on"


def uniform(
    series: Mapping[str, Series],
    *,
    name: str,
    interface: TruckInterface,
    rate_hz: float = 10.0,
    cuts: Sequence[float] = (),
    notes: Sequence[str] = (),
    account: Account | None = None,
) -> list[Recording]:
    """Recordings on one clock at `rate_hz`, or at the speed channel's own rate if that is slower.

    Cut where speed is missing for more than max(GAP_S, GAP_PERIODS native periods), and before every time in
    `cuts`. Samples outside the channel's range and those of reversing become NaN; `account` gets the sample
    counts and the time spans of each channel. Raises InputError without speed, or if the unit of speed or of
    a command must be wrong.
    """
    units = {command: interface.unit(command) for command in ("engine_command", "brake_command")}
    resampled = Resampled(name, series, rate_hz=rate_hz, cuts=cuts, account=account, units=units)
    return resampled.recordings(interface, notes)


class Resampled:
    """Channels on one clock, in pieces; `series` by channel, each in the order of time, NaN where a sample is
    missing. `poses` are positions in metres, (time, x, y) each (n,), of which there is no channel: the pose
    of an odometry. `units` are those of commands.
    """

    def __init__(
        self,
        name: str,
        series: Mapping[str, Series],
        *,
        rate_hz: float = 10.0,
        cuts: Sequence[float] = (),
        account: Account | None = None,
        units: Mapping[str, str] | None = None,
        poses: Sequence[tuple[Array, Array, Array]] = (),
    ) -> None:
        if not rate_hz > 0:
            raise InputError(f"rate_hz must be positive, not {rate_hz}")
        self.name, self.dt = name, 1.0 / rate_hz
        self._account = account
        self._tallies = {c: Tally(read=int((~np.isnan(one.values)).sum())) for c, one in series.items()}
        cut_at = np.asarray(cuts, dtype=np.float64)
        units = units or {}
        self._ranges = {c: Range(c, tally, units.get(c, ""), cut_at) for c, tally in self._tallies.items()}
        self._pieces: list[_Piece] = []
        self._against_poses: list[str] = []  # doubts by which a speed is refused
        known: dict[str, Series] = {}
        self._turns = senders(series["speed"].values) if "speed" in series else ""
        for channel, one in series.items():
            time, values = one_per_burst(channel, *renewed(channel, one, self._tallies[channel]))
            known[channel] = Series(time, self._ranges[channel].masked(time, values))
        for channel in FUEL:
            if channel in known and (channel == "fuel_rate" or self._ranges[channel].unit in FUEL_UNITS):
                known[channel] = self._moving(channel, known)
        if "speed" in known and len(known["speed"].time) > 1:
            self._compute(known, rate_hz, cut_at, poses)

    def _moving(self, channel: str, series: Mapping[str, Series]) -> Series:
        """A fuel rate without samples that stand still while the engine, or else the truck, changes its
        speed."""
        time, values = series[channel].time, series[channel].values
        turning = "engine_speed" in series
        beside = series.get("engine_speed", series.get("speed", Series(time[:0], time[:0]))).valid
        if not len(beside.time):
            return series[channel]
        others = np.interp(time, beside.time, beside.values, left=np.nan, right=np.nan)
        stands = held_beside(time, values, others, turning=turning)
        self._ranges[channel].set_aside(STANDS, time, values, stands)
        return Series(time, np.where(stands, np.nan, values))

    def _compute(
        self,
        series: dict[str, Series],
        rate_hz: float,
        cuts: Array,
        poses: Sequence[tuple[Array, Array, Array]],
    ) -> None:
        speed = series["speed"]
        for pose in poses:
            self._against_poses += agreement.against_pose(speed, *pose)
        native = period(speed.time)
        self.dt, gap = _step(speed.time, native, rate_hz), max(GAP_S, GAP_PERIODS * native)
        out = {
            REVERSING: reversing(speed.time, speed.values, _gear_at(speed.time, series, self.dt)),
            UNMOVED: moving_at_zero(speed.time, speed.values, _places(series, poses)),
        }
        out[self._ranges["speed"].reason] = ~out[REVERSING] & (speed.values < CHANNELS["speed"].low)
        for reason, these in out.items():
            self._ranges["speed"].set_aside(reason, speed.time, speed.values, these)
        forward = Series(speed.time, np.where(np.any([*out.values()], axis=0), np.nan, speed.values))
        kept = _without_long_nan(forward, gap)
        clock = kept.time
        sampled = {**series, "speed": kept}
        periods = {c: period(one.time) for c, one in sampled.items()}
        starts = {*(np.flatnonzero(np.diff(clock) > gap) + 1), *np.searchsorted(clock, cuts)}
        edges = sorted({0, len(clock)} | {int(s) for s in starts if 0 < s < len(clock)})
        for i, j in pairwise(edges):
            start, end = float(clock[i]), float(clock[j - 1])
            ticks: Array = start + self.dt * np.arange(int((end - start) / self.dt + SNAP) + 1, dtype=float)
            if len(ticks) < 2:  # no step, so no acceleration: not a drive
                continue
            before, after = clock[i - 1] if i else -np.inf, clock[j] if j < len(clock) else np.inf
            near = {c: one.between(before, after) for c, one in sampled.items()}
            channels = {
                c: at_ticks(c, one.time, one.values, ticks, self.dt, periods[c], first=True)
                for c, one in near.items()
            }
            self._pieces.append(_Piece(start, end, channels))
        for channel, one in {**series, "speed": forward}.items():
            self._count(channel, one, 0.0 if channel == "speed" else gap)

    def _count(self, channel: str, series: Series, beyond: float) -> None:
        """Count the channel's samples inside and outside of pieces, and so far `beyond` them, s: commands are
        held there, others are interpolated."""
        time = series.time[~np.isnan(series.values)]
        starts = np.array([piece.start - beyond for piece in self._pieces])
        ends = np.array([-np.inf, *(piece.end + beyond for piece in self._pieces)])
        within = time <= ends[np.searchsorted(starts, time, side="right")]
        tally = self._tallies[channel]
        tally.used += int(within.sum())
        if not within.all():
            why = f"between gaps, in pieces shorter than a step of {self.dt:g} s"
            first = f"at {moment(time[int(np.argmin(within))])}"
            tally.set_aside(why if channel == "speed" else NO_SPEED, first, int((~within).sum()))

    @property
    def measured(self) -> set[str]:
        """Channels with at least one valid sample; speed and commands with any sample, since `recordings`
        reports what is wrong with them."""
        return {
            channel
            for channel, r in self._ranges.items()
            if r.measured > (0 if channel in NEEDED else r.outside + r.none)
        }

    def recordings(
        self, interface: TruckInterface, notes: Sequence[str] = (), *, ours: bool = False
    ) -> list[Recording]:
        """The recordings; an accelerometer that a log calls acceleration becomes the specific force, unless
        the topics are `ours`, which say what it is. Raises InputError if there are none, or if the unit of a
        required channel must be wrong."""
        for one in self._ranges.values():
            one.check(self.name, interface, self._measured)
        if self._turns:
            raise InputError(
                f"'{self.name}': speed jumps {self._turns} and back, as where two senders or vehicles write "
                "into one column or topic: export a column that says which one a row is of, and take one by "
                "'only', or take a source of one sender"
            )
        for says in self._against_poses:
            raise InputError(f"'{self.name}': {says}")
        if not self._pieces:
            raise InputError(self._nothing())
        account = self._accounted()
        notes = [*notes, *account.channel_lines()]
        names = (
            [self.name] if len(self._pieces) == 1 else [f"{self.name}#{k}" for k in range(len(self._pieces))]
        )
        valid = set().union(*(piece.valid() for piece in self._pieces))
        for channel, tally in self._tallies.items():
            if tally.read and channel not in valid:
                account.remarks.append(f"{channel}: left out, as no sample of it is valid in a piece")
        needed = valid & {*interface.u, *interface.w, *interface.y}
        found = [
            piece.recording(name, self.dt, interface, needed, notes, account)
            for name, piece in zip(names, self._pieces, strict=True)
        ]
        found = found if ours else _gravity_apart(found, account)
        account.remarks += [line for one in self._ranges.values() for line in one.remarks]
        account.remarks += [doubt.says for doubt in doubts(found)]
        return found

    def _measured(self, channel: str) -> Seen | None:
        """The factor of a channel's numbers to what the others say."""
        heads = {c: Series(*one.head) for c, one in self._ranges.items()}
        return agreement.measured(channel, {c: one for c, one in heads.items() if len(one.time) > 1})

    def _accounted(self) -> Account:
        """The account with spans and channels, from the samples added here."""
        account = self._account or Account(self.name, "samples")
        account.spans = [(piece.start, piece.end) for piece in self._pieces]
        usual = {channel: k for k, channel in enumerate(CHANNELS)}
        for channel in sorted(self._tallies, key=lambda c: (usual.get(c, len(usual)), c)):
            own, tally = self._tallies[channel], account.channels.setdefault(channel, Tally())
            tally.read, tally.used = tally.read or own.read, own.used
            for reason, entry in own.aside.items():
                tally.set_aside(reason, entry.first, entry.count)
        if self._account is None:
            tallies = self._tallies.values()
            account.total = Tally(sum(t.read for t in tallies), sum(t.used for t in tallies))
            account.total.set_aside("by channel, as follows", count=sum(t.left_out for t in tallies))
        return account

    def _nothing(self) -> str:
        """The reason why there is no recording."""
        nothing = f"'{self.name}' has no two speed samples in a row: nothing to make a recording of"
        speed = self._tallies.get("speed", Tally())
        reasons = [
            f"{entry.count} are {reason}, first {entry.first}" for reason, entry in speed.aside.items()
        ]
        unit = "; is its unit right?" if any(reason.startswith("outside") for reason in speed.aside) else ""
        cure = "; take another speed" if UNMOVED in speed.aside else unit
        return f"{nothing} (of {speed.read}, {', '.join(reasons)}{cure})" if reasons else nothing


@dataclass(frozen=True)
class _Piece:
    """One contiguous segment: times of its first and last speed sample, s, and its channels (n,)."""

    start: float
    end: float
    channels: dict[str, Array]

    def valid(self) -> set[str]:
        """The channels with a valid sample."""
        return {c for c, values in self.channels.items() if not np.isnan(values).all()}

    def recording(
        self,
        name: str,
        dt: float,
        interface: TruckInterface,
        needed: set[str],
        notes: list[str],
        account: Account,
    ) -> Recording:
        """The piece as a recording; channels of `needed`, which another piece may have, are kept as NaN."""
        channels = {c: v for c, v in self.channels.items() if c in needed or not np.isnan(v).all()}
        if "acceleration" not in channels or np.isnan(channels["acceleration"]).all():
            speed = channels["speed"]
            channels["acceleration"] = derive_acceleration(speed, dt)
            notes = [*notes, FROM_SPEED]
            count_derived(account, "acceleration", channels["acceleration"], self.start, dt, speed)
        return Recording(name, dt, channels, interface, self.start, tuple(dict.fromkeys(notes)), account)


def _gravity_apart(recordings: list[Recording], account: Account) -> list[Recording]:
    """The recordings with a measured acceleration, or specific force, as what the data show that it is; the
    account says so, and asks where they do not."""
    meant = {"acceleration": "dv/dt", "specific_force": "what an accelerometer reads, gravity in it"}
    for name, other in (("acceleration", "specific_force"), ("specific_force", "acceleration")):
        if any(name not in r.channels for r in recordings) or name not in account.channels:
            continue
        felt = accelerometer.felt(recordings, name)
        if felt is None or felt.channel == name:
            continue
        if felt.channel is None:
            if name == "acceleration":
                account.remarks.append(
                    f"acceleration is taken for {meant[name]}; if a sensor measured it, call it {other}: "
                    f"the drive does not show which it is ({felt.by})"
                )
            continue
        if any(other in r.channels and FROM_SPEED not in r.notes for r in recordings):  # both were recorded
            account.remarks.append(f"{name} looks like {meant[other]}: {felt.by}; is it {other}?")
            continue
        account.remarks.append(f"{name} is taken as {other}, {meant[other]}: {felt.by}; call it {other}")
        account.channels[other] = account.channels.pop(name)
        recordings = [_renamed(r, name, other) for r in recordings]
        if name == "acceleration":
            for r in recordings:
                count_derived(account, name, r.channels[name], r.start_s, r.dt, r.channels["speed"])
        return recordings
    return recordings


def _renamed(r: Recording, name: str, other: str) -> Recording:
    """The recording with a channel under another name, and acceleration derived from speed without one."""
    channels = {c: values for c, values in r.channels.items() if c != name} | {other: r.channels[name]}
    if other == "acceleration":
        return replace(r, channels=channels, notes=tuple(n for n in r.notes if n != FROM_SPEED))
    channels["acceleration"] = derive_acceleration(r.channels["speed"], r.dt)
    return replace(r, channels=channels, notes=(*r.notes, FROM_SPEED))


def count_derived(
    account: Account, channel: str, values: Array, start: float, dt: float, speed: Array | None = None
) -> None:
    """Count the samples (n,) of a derived channel, and those that could not be derived, for lack of a speed
    or because the `speed` (n,), of which it is the derivative, jumps there."""
    tally, none = account.channel(channel), np.isnan(values)
    tally.read += len(values)
    tally.used += int((~none).sum())
    steps = none if speed is None else np.isnan(np.diff(speed, prepend=np.nan))
    steps[:1] = steps[1:2]  # the first repeats the second
    missing = DERIVED if speed is not None else WITHOUT
    for reason, these in ((missing, none & steps), (JUMPED, none & ~steps)):
        tally.set_aside(reason, f"at {moment(start + dt * int(np.argmax(these)))}", int(these.sum()))


def derive_acceleration(speed: Array, dt: float) -> Array:
    """Mean acceleration over each step, a(k+1) = (v(k+1) - v(k)) / dt, (n,); the first repeats the second.
    NaN beyond what a truck can, as where speed jumps."""
    acceleration = np.zeros_like(speed)
    acceleration[1:] = np.diff(speed) / dt
    acceleration[:1] = acceleration[1:2]
    known = CHANNELS["acceleration"]
    with np.errstate(invalid="ignore"):
        possible = (acceleration >= known.low) & (acceleration <= known.high)
    return np.where(possible, acceleration, np.nan)


def _without_long_nan(series: Series, gap: float) -> Series:
    """The series without runs of NaN longer than a gap, which count as gaps."""
    valid = np.flatnonzero(~np.isnan(series.values))
    if len(valid) in (0, len(series.time)):
        return series.between(np.inf, np.inf) if not len(valid) else series
    keep = np.zeros(len(series.time), dtype=bool)
    keep[valid] = True
    ends = np.append(series.time[valid], series.time[-1])  # a run at the end counts from its last sample
    for k in np.flatnonzero(np.diff(valid, append=len(series.time)) > 1):
        if ends[k + 1] - ends[k] <= gap:
            keep[valid[k] : valid[k + 1] if k + 1 < len(valid) else len(keep)] = True
    return Series(series.time[keep], series.values[keep])


def _gear_at(time: Array, series: Mapping[str, Series], dt: float) -> Array:
    if "gear" not in series:
        return np.full(len(time), np.nan)
    gear = series["gear"]
    return at_ticks("gear", gear.time, gear.values, time, dt, period(gear.time))


def _places(series: Mapping[str, Series], poses: Sequence[tuple[Array, Array, Array]]) -> list[Places]:
    """Positions over time: the poses, and latitude and longitude."""
    found = [Places(*pose) for pose in poses]
    if {"latitude", "longitude"} <= series.keys():
        latitude, longitude = (series[c].valid for c in ("latitude", "longitude"))
        if len(latitude.time) and len(longitude.time):
            lon = np.interp(latitude.time, longitude.time, longitude.values)
            east_m, north_m = metres_per_degree(latitude.values[:1])
            found.append(Places(latitude.time, lon * east_m, latitude.values * north_m))
    return found


def _step(clock: Array, native: float, rate_hz: float) -> float:
    """The recording's dt: that of rate_hz, or the source's own if that is longer by more than 5 %."""
    if native <= 1.05 / rate_hz:
        return 1.0 / rate_hz
    steps = np.diff(clock)
    mean = float(steps[(steps > 0.5 * native) & (steps < 1.5 * native)].mean())
    neat = round(mean, 3)
    return neat if abs(neat - mean) < 5e-4 * mean else mean
