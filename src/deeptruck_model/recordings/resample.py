"""From channels at their own times to recordings: one uniform clock, cut into contiguous pieces.

The clock follows the speed samples. Samples may come in parts, in time order within a channel, so that a
bag of any length needs the memory of minutes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.errors import InputError
from deeptruck_model.recordings.interpolate import GAP_PERIODS, GAP_S, SNAP, at_ticks, period
from deeptruck_model.recordings.recording import Recording
from deeptruck_model.signals import CHANNELS, TruckInterface

Array = NDArray[np.float64]

MARGIN_S = 60.0  # samples this far around a tick are at hand when it is computed
_SLOW_S = 1.0  # channels with longer periods reach further than that; they are few and stay in memory


@dataclass(frozen=True)
class Series:
    """One channel as it came: time (n,) in s since the start of the source, ascending; values (n,)."""

    time: Array
    values: Array

    def between(self, after: float, before: float) -> Series:
        """The samples strictly between two times."""
        inside = slice(np.searchsorted(self.time, after, side="right"), np.searchsorted(self.time, before))
        return Series(self.time[inside], self.values[inside])


def uniform(
    series: dict[str, Series],
    *,
    name: str,
    interface: TruckInterface,
    rate_hz: float = 10.0,
    cuts: Sequence[float] = (),
    notes: Sequence[str] = (),
) -> list[Recording]:
    """Recordings on one clock at `rate_hz`, or at the speed channel's own rate where that is slower.

    Cut where speed is missing for more than max(GAP_S, GAP_PERIODS native periods), and before every time
    in `cuts`. Samples outside the channel's range become NaN. Raises InputError without speed, or where
    so much is out of range that the unit must be wrong.
    """
    resampler = Resampler(name, rate_hz=rate_hz, cuts=cuts)
    for channel, one in series.items():
        resampler.add(channel, one)
    resampler.advance(np.inf)
    return resampler.finish(interface, notes)


class Resampler:
    """`uniform`, fed in parts: `add` what came, `advance` to where it is complete, at the end `finish`."""

    def __init__(self, name: str, *, rate_hz: float = 10.0, cuts: Sequence[float] = ()) -> None:
        if not rate_hz > 0:
            raise InputError(f"rate_hz must be positive, not {rate_hz}")
        self.name, self.rate_hz, self.cuts = name, rate_hz, np.asarray(cuts, dtype=np.float64)
        self.dt = 0.0  # known once speed samples are there
        self._gap = 0.0
        self._ranges: dict[str, _Range] = {}
        self._parts: dict[str, list[Series]] = {}
        self._periods: dict[str, float] = {}
        self._pieces: list[_Piece] = []  # the last one may still grow
        self._short = 0  # speed samples in pieces of fewer than two ticks
        self._late = 0
        self._done = -np.inf  # ticks before this are computed
        self._closed = -np.inf  # time of the last speed sample of a closed piece

    def add(self, channel: str, part: Series) -> None:
        """Samples of one channel, later than those added before."""
        self._late += int(np.searchsorted(part.time, self._done - MARGIN_S))
        values = self._ranges.setdefault(channel, _Range(channel)).masked(part.values)
        self._parts.setdefault(channel, []).append(Series(part.time, values))

    def advance(self, until: float) -> None:
        """Compute all ticks before `until`; every sample up to MARGIN_S later must have been added."""
        series = {channel: _joined(parts) for channel, parts in self._parts.items()}
        if "speed" not in series or len(series["speed"].time) < 2 or (until < np.inf and until <= self._done):
            return
        if not self.dt:
            clock = series["speed"].time
            native = period(clock)
            self.dt, self._gap = _step(clock, native, self.rate_hz), max(GAP_S, GAP_PERIODS * native)
        series["speed"] = _without_long_nan(series["speed"], self._gap)
        clock = series["speed"].time
        for channel, one in series.items():
            if channel not in self._periods and (len(one.time) >= 10 or until == np.inf):
                self._periods[channel] = period(one.time)
        if until < np.inf and period(clock) > _SLOW_S:
            return
        for i, j in self._stretches(clock):
            self._stretch(series, clock, i, j, until)
        self._done = until
        for channel, one in series.items():
            slow = self._periods.get(channel, np.inf) > _SLOW_S
            self._parts[channel] = [one if slow else one.between(until - MARGIN_S, np.inf)]

    @property
    def measured(self) -> set[str]:
        """Channels of which at least one valid sample came."""
        return {channel for channel, r in self._ranges.items() if r.measured > r.outside}

    def finish(self, interface: TruckInterface, notes: Sequence[str] = ()) -> list[Recording]:
        """The recordings. Raises InputError where there are none or a unit must be wrong."""
        notes = [*notes, *(note for r in self._ranges.values() if (note := r.note(self.name)))]
        if self._short:
            step = f"a step of {self.dt:g} s"
            notes.append(f"left out {self._short} speed samples between gaps, in pieces shorter than {step}")
        if self._late:
            notes.append(f"left out {self._late} samples stamped over a minute before the speed beside them")
        if not self._pieces:
            raise InputError(
                f"'{self.name}' has no two speed samples in a row: nothing to make a recording of"
            )
        names = (
            [self.name] if len(self._pieces) == 1 else [f"{self.name}#{k}" for k in range(len(self._pieces))]
        )
        return [
            piece.recording(name, self.dt, interface, notes)
            for name, piece in zip(names, self._pieces, strict=True)
        ]

    def _stretches(self, clock: Array) -> list[tuple[int, int]]:
        """Index ranges of the speed samples between gaps and cuts, without those of closed pieces."""
        starts = {*(np.flatnonzero(np.diff(clock) > self._gap) + 1), *np.searchsorted(clock, self.cuts)}
        edges = sorted({0, len(clock)} | {int(s) for s in starts if 0 < s < len(clock)})
        return [(i, j) for i, j in pairwise(edges) if clock[j - 1] > self._closed]

    def _stretch(self, series: dict[str, Series], clock: Array, i: int, j: int, until: float) -> None:
        """Compute a stretch's missing ticks before `until`; close it where it ends before."""
        end = clock[j - 1]
        complete = end < until
        if clock[i] >= until or (complete and clock[i] == end):
            self._short += int(complete)
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
        piece.growing = not complete
        if complete:
            self._closed = end
            if piece.count < 2:  # no step, so no acceleration: not a drive
                self._short += j - i
                self._pieces.pop()

    def _at(self, channel: str, series: Series, ticks: Array, first: bool) -> Array:
        own = self._periods.get(channel, period(series.time))
        return at_ticks(channel, series.time, series.values, ticks, self.dt, own, first=first)


class _Piece:
    """One contiguous stretch of ticks, growing block by block."""

    def __init__(self, start: float) -> None:
        self.start, self.count, self.growing = start, 0, True
        self._blocks: dict[str, list[Array]] = {}

    def add(self, block: dict[str, Array], count: int) -> None:
        for channel, values in block.items():
            missed = self.count - sum(map(len, self._blocks.get(channel, [])))
            blank = [np.full(missed, np.nan)] if missed else []  # the channel begins only now
            self._blocks.setdefault(channel, []).extend([*blank, values])
        self.count += count

    def recording(self, name: str, dt: float, interface: TruckInterface, notes: list[str]) -> Recording:
        needed = {*interface.u, *interface.w, *interface.y}  # stay, as NaN, where another piece has them
        joined = {channel: np.concatenate(blocks) for channel, blocks in self._blocks.items()}
        channels = {c: v for c, v in joined.items() if c in needed or not np.isnan(v).all()}
        if "acceleration" not in channels or np.isnan(channels["acceleration"]).all():
            channels["acceleration"] = derive_acceleration(channels["speed"], dt)
            notes = [*notes, "acceleration derived from speed"]
        return Recording(name, dt, channels, interface, self.start, tuple(dict.fromkeys(notes)))


class _Range:
    """Counts the samples of a channel that no truck can produce."""

    def __init__(self, channel: str) -> None:
        self.channel, self.low, self.high = channel, CHANNELS[channel].low, CHANNELS[channel].high
        self.measured = self.outside = 0
        self.worst = 0.0

    def masked(self, values: Array) -> Array:
        """The values with NaN for those out of range."""
        with np.errstate(invalid="ignore"):
            outside = (values < self.low) | (values > self.high)
        self.measured += int((~np.isnan(values)).sum())
        if not outside.any():
            return values
        self.outside += int(outside.sum())
        self.worst = max(self.worst, float(values[outside].max()), float(values[outside].min()), key=abs)
        return np.where(outside, np.nan, values)

    def note(self, name: str) -> str | None:
        """What was done. Raises InputError where it is so much that the unit must be wrong."""
        if not self.outside:
            return None
        limits = f"{self.low:g}..{self.high:g} {CHANNELS[self.channel].unit}"
        if self.outside > (0.01 if self.channel == "speed" else 0.2) * self.measured:
            raise InputError(
                f"'{name}': {self.outside} of {self.measured} samples of '{self.channel}' are outside "
                f"{limits} (for example {self.worst:g}): is its unit right?"
            )
        return f"{self.outside} samples of {self.channel} outside {limits} made invalid"


def derive_acceleration(speed: Array, dt: float) -> Array:
    """Mean acceleration over each step, a(k+1) = (v(k+1) - v(k)) / dt, (n,); the first repeats the second."""
    acceleration = np.zeros_like(speed)
    acceleration[1:] = np.diff(speed) / dt
    acceleration[:1] = acceleration[1:2]
    return acceleration


def _without_long_nan(series: Series, gap: float) -> Series:
    """The series without runs of NaN longer than a gap: not measuring for that long is a gap too."""
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
    """The recording's dt: that of rate_hz, or the source's own where it is slower by more than 5 %."""
    if native <= 1.05 / rate_hz:
        return 1.0 / rate_hz
    steps = np.diff(clock)
    mean = float(steps[(steps > 0.5 * native) & (steps < 1.5 * native)].mean())
    neat = round(mean, 3)
    return neat if abs(neat - mean) < 5e-4 * mean else mean
