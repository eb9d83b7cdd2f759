"""Resamples channels from their own times to recordings on one uniform clock, cut into contiguous pieces.

The clock follows the speed samples. Samples may be passed in parts, in time order within a channel, so that a
bag of any length needs the memory of a few minutes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from deeptruck_core.account import Account, Tally, moment
from deeptruck_core.arrays import Array
from deeptruck_core.errors import InputError
from deeptruck_core.signals import CHANNELS, TruckInterface
from deeptruck_model.recordings.consistency import accelerometer, agreement
from deeptruck_model.recordings.consistency.impossible import Places, moving_at_zero
from deeptruck_model.recordings.consistency.sensors import doubts
from deeptruck_model.recordings.interpolate import (
    GAP_PERIODS,
    GAP_S,
    HELD,
    LATCHED,
    SNAP,
    Series,
    at_ticks,
    period,
)
from deeptruck_model.recordings.ranges import NEEDED, REVERSING, Range, Seen, reversing
from deeptruck_model.recordings.recording import FROM_SPEED, Recording
from deeptruck_model.recordings.units import metres_per_degree

MARGIN_S = 60.0  # samples this far around a tick are at hand when it is computed
NO_SPEED = "recorded while there was no speed"
DERIVED = "derived where there is no speed"
JUMPED = "derived where it jumps faster than any truck"
UNMOVED = "zero while positions move on"
BURSTS, LARGEST_BURST = 5, 20  # that are seen at least; samples in one
BURST_PAUSE = 5.0  # times that a pause between bursts is longer than the step within
_SLOW_S = 1.0  # channels with longer periods reach further than that; they are few and stay in memory


def uniform(
    series: dict[str, Series],
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
    resampler = Resampler(name, rate_hz=rate_hz, cuts=cuts, account=account, units=units)
    for channel, one in series.items():
        resampler.add(channel, one)
    resampler.advance(np.inf)
    return resampler.finish(interface, notes)


class Resampler:
    """`uniform` in parts: `add` samples, `advance` to the time up to which they are complete, at the end
    `finish`."""

    def __init__(
        self,
        name: str,
        *,
        rate_hz: float = 10.0,
        cuts: Sequence[float] = (),
        account: Account | None = None,
        units: Mapping[str, str] | None = None,
    ) -> None:
        if not rate_hz > 0:
            raise InputError(f"rate_hz must be positive, not {rate_hz}")
        self.name, self.rate_hz, self.cuts = name, rate_hz, np.asarray(cuts, dtype=np.float64)
        self.dt = 0.0  # known once speed samples are there
        self._units = units or {}  # of commands
        self._account = account
        self._tallies: dict[str, Tally] = {}  # of the samples that were added
        self._gap = 0.0
        self._ranges: dict[str, Range] = {}
        self._parts: dict[str, list[Series]] = {}
        self._periods: dict[str, float] = {}
        self._poses: list[tuple[Array, Array, Array]] = []
        self._pieces: list[_Piece] = []  # the last one may still grow
        self._done = -np.inf  # ticks before this are computed
        self._settled = -np.inf  # samples up to this are counted, and at hand no more
        self._closed = -np.inf  # time of the last speed sample of a closed piece

    def add(self, channel: str, part: Series) -> None:
        """Add samples of one channel, later than those added before; NaN is a missing sample."""
        tally = self._tallies.setdefault(channel, Tally())
        tally.read += int((~np.isnan(part.values)).sum())
        late = int(np.searchsorted(part.time, self._settled, side="right"))
        if late:
            first, count = f"at {moment(part.time[0])}", int((~np.isnan(part.values[:late])).sum())
            tally.set_aside("stamped over a minute before the speed beside them", first, count)
        time, values = one_per_burst(channel, part.time[late:], part.values[late:])
        values = self._range(channel, tally).masked(time, values)
        self._parts.setdefault(channel, []).append(Series(time, values))

    def _range(self, channel: str, tally: Tally) -> Range:
        if channel not in self._ranges:
            unit = self._units.get(channel, "")
            self._ranges[channel] = Range(channel, tally, unit, self.cuts)
        return self._ranges[channel]

    def advance(self, until: float) -> None:
        """Compute all ticks before `until`; every sample up to MARGIN_S later must have been added."""
        series = {channel: _joined(parts) for channel, parts in self._parts.items()}
        if "speed" not in series or len(series["speed"].time) < 2 or (until < np.inf and until <= self._done):
            return
        speed = series["speed"]
        if not self.dt:
            native = period(speed.time)
            self.dt, self._gap = _step(speed.time, native, self.rate_hz), max(GAP_S, GAP_PERIODS * native)
        backward = reversing(speed.time, speed.values, self._gear_at(speed.time, series))
        below = ~backward & (speed.values < CHANNELS["speed"].low)
        unmoved = moving_at_zero(speed.time, speed.values, self._places(series))
        forward = Series(speed.time, np.where(backward | below | unmoved, np.nan, speed.values))
        clock = (kept := _without_long_nan(forward, self._gap)).time
        for channel, one in series.items():
            if channel not in self._periods and (len(one.time) >= 10 or until == np.inf):
                self._periods[channel] = period(clock if channel == "speed" else one.time)
        if until < np.inf and period(clock) > _SLOW_S:
            return
        for i, j in self._segments(clock):
            self._segment({**series, "speed": kept}, clock, i, j, until)
        now = slice(*np.searchsorted(speed.time, [self._settled, until - MARGIN_S], side="right"))
        out = ((REVERSING, backward), (self._ranges["speed"].reason, below), (UNMOVED, unmoved))
        for reason, these in out:
            self._ranges["speed"].set_aside(reason, speed.time[now], speed.values[now], these[now])
        for channel, one in {**series, "speed": forward}.items():
            self._settle(channel, one, until - MARGIN_S)
        self._done, self._settled = until, until - MARGIN_S
        for channel, one in series.items():
            slow = self._periods.get(channel, np.inf) > _SLOW_S
            self._parts[channel] = [one if slow else one.between(self._settled, np.inf)]

    def add_places(self, time: Array, x_m: Array, y_m: Array) -> None:
        """Add positions in metres, (n,) each, of which a bag has no channel: the pose of an odometry."""
        self._poses.append((time, x_m, y_m))

    def _places(self, series: Mapping[str, Series]) -> list[Places]:
        """Positions over time: the poses, and latitude and longitude."""
        found = []
        if self._poses:
            found.append(Places(*(np.concatenate(part) for part in zip(*self._poses, strict=True))))
        if {"latitude", "longitude"} <= series.keys():
            latitude, longitude = (series[c].valid for c in ("latitude", "longitude"))
            if len(latitude.time) and len(longitude.time):
                lon = np.interp(latitude.time, longitude.time, longitude.values)
                east_m, north_m = metres_per_degree(latitude.values[:1])
                found.append(Places(latitude.time, lon * east_m, latitude.values * north_m))
        return found

    def _gear_at(self, time: Array, series: dict[str, Series]) -> Array:
        if "gear" not in series:
            return np.full(len(time), np.nan)
        gear = series["gear"]
        return at_ticks("gear", gear.time, gear.values, time, self.dt, period(gear.time))

    def _settle(self, channel: str, series: Series, until: float) -> None:
        """Count the channel's samples inside and outside of pieces, up to a time."""
        now = slice(*np.searchsorted(series.time, [self._settled, until], side="right"))
        time = series.time[now][~np.isnan(series.values[now])]
        beyond = 0.0 if channel == "speed" else self._gap  # commands are held, others are interpolated
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
        """Channels with at least one valid sample; speed and commands with any sample, since `finish` reports
        what is wrong with them."""
        return {
            channel
            for channel, r in self._ranges.items()
            if r.measured > (0 if channel in NEEDED else r.outside + r.none)
        }

    def finish(
        self, interface: TruckInterface, notes: Sequence[str] = (), *, ours: bool = False
    ) -> list[Recording]:
        """The recordings; an accelerometer that a log calls acceleration becomes the specific force, unless
        the topics are `ours`, which say what it is. Raises InputError if there are none, or if the unit of a
        required channel must be wrong."""
        for one in self._ranges.values():
            one.check(self.name, interface, self._measured)
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
        return f"{nothing} (of {speed.read}, {', '.join(reasons)}{unit})" if reasons else nothing

    def _segments(self, clock: Array) -> list[tuple[int, int]]:
        """Index ranges of the speed samples between gaps and cuts, without those of closed pieces."""
        starts = {*(np.flatnonzero(np.diff(clock) > self._gap) + 1), *np.searchsorted(clock, self.cuts)}
        edges = sorted({0, len(clock)} | {int(s) for s in starts if 0 < s < len(clock)})
        return [(i, j) for i, j in pairwise(edges) if clock[j - 1] > self._closed]

    def _segment(self, series: dict[str, Series], clock: Array, i: int, j: int, until: float) -> None:
        """Compute a segment's missing ticks before `until`; close the segment if it ends before."""
        end = clock[j - 1]
        complete = end < until
        if clock[i] >= until or (complete and clock[i] == end):
            self._closed = end if complete else self._closed
            return
        growing = bool(self._pieces) and self._pieces[-1].growing
        piece = self._pieces[-1] if growing else _Piece(float(clock[i]))
        if not growing:
            self._pieces.append(piece)
        span = (end - piece.start) / self.dt + SNAP if complete else (until - piece.start) / self.dt - 1.0
        ticks: Array = piece.start + self.dt * np.arange(piece.count, int(span) + 1, dtype=np.float64)
        before = max(self._closed, clock[i - 1] if i else -np.inf)
        after = clock[j] if j < len(clock) else np.inf
        if len(ticks):
            near = {channel: one.between(before, after) for channel, one in series.items()}
            piece.add({c: self._at(c, one, ticks, piece.count == 0) for c, one in near.items()}, len(ticks))
        piece.growing, piece.end = not complete, min(end, until)
        if complete:
            self._closed = end
            if piece.count < 2:  # no step, so no acceleration: not a drive
                self._pieces.pop()

    def _at(self, channel: str, series: Series, ticks: Array, first: bool) -> Array:
        own = self._periods.get(channel, period(series.time))
        return at_ticks(channel, series.time, series.values, ticks, self.dt, own, first=first)


class _Piece:
    """One contiguous segment of ticks, growing block by block."""

    def __init__(self, start: float) -> None:
        self.start, self.end, self.count, self.growing = start, start, 0, True
        self._blocks: dict[str, list[Array]] = {}

    def add(self, block: dict[str, Array], count: int) -> None:
        for channel, values in block.items():
            missed = self.count - sum(map(len, self._blocks.get(channel, [])))
            blank = [np.full(missed, np.nan)] if missed else []  # the channel begins only now
            self._blocks.setdefault(channel, []).extend([*blank, values])
        self.count += count

    def valid(self) -> set[str]:
        """The channels with a valid sample."""
        return {c for c, blocks in self._blocks.items() if not all(np.isnan(v).all() for v in blocks)}

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
        joined = {channel: np.concatenate(blocks) for channel, blocks in self._blocks.items()}
        channels = {c: v for c, v in joined.items() if c in needed or not np.isnan(v).all()}
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


def one_per_burst(channel: str, time: Array, values: Array) -> tuple[Array, Array]:
    """The mean of each burst, at its mean time, (k,), or the first value of a command or state; all samples
    if they do not come in bursts.

    Loggers that save memory record a few samples close together every second or so. Their rate is that of
    the bursts.
    """
    steps = np.diff(time)
    if len(steps) < BURSTS:
        return time, values
    apart = BURST_PAUSE * float(np.median(steps))
    starts = np.r_[0, np.flatnonzero(steps > apart) + 1]
    sizes = np.diff(np.r_[starts, len(time)])
    pauses = np.diff(time[starts])
    usual = float(np.median(pauses)) if len(pauses) else 0.0
    if len(starts) < BURSTS or sizes.max() > LARGEST_BURST or (pauses > 2.0 * usual).mean() > 0.1:
        return time, values
    if channel in (*HELD, *LATCHED):
        return time[starts], values[starts]
    known = np.isfinite(values)
    sums = np.add.reduceat(np.where(known, values, 0.0), starts)
    with np.errstate(invalid="ignore"):
        means = sums / np.add.reduceat(known.astype(float), starts)
    return np.add.reduceat(time, starts) / sizes, means


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
    for reason, these in ((DERIVED, none & steps), (JUMPED, none & ~steps)):
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


def _joined(parts: list[Series]) -> Series:
    if len(parts) == 1:
        return parts[0]
    return Series(np.concatenate([p.time for p in parts]), np.concatenate([p.values for p in parts]))


def _step(clock: Array, native: float, rate_hz: float) -> float:
    """The recording's dt: that of rate_hz, or the source's own if that is longer by more than 5 %."""
    if native <= 1.05 / rate_hz:
        return 1.0 / rate_hz
    steps = np.diff(clock)
    mean = float(steps[(steps > 0.5 * native) & (steps < 1.5 * native)].mean())
    neat = round(mean, 3)
    return neat if abs(neat - mean) < 5e-4 * mean else mean
