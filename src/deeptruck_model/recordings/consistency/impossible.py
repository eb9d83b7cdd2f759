"""What no truck can do in the samples of one channel: codes, drop-outs, spikes, values that stand still, and
changes of the zero. It is found before anything is derived, in every reader alike.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.ndimage import median_filter

from deeptruck_core.account import moment
from deeptruck_core.arrays import Array, Mask
from deeptruck_core.signals import CHANNELS
from deeptruck_core.vehicle_kinds import IMPOSSIBLE_ACCELERATION
from deeptruck_model.recordings.interpolate import GAP_PERIODS, GAP_S
from deeptruck_model.recordings.units import SPEED_RATIOS


@dataclass(frozen=True)
class Change:
    """How a channel changes from sample to sample: by at most `step` + `rate` times the seconds between, and
    at most `back` times them there and back; in units of the channel. `least` is a step that a fine sensor
    does not exceed."""

    step: float
    rate: float
    back: float
    least: float


CHANGES = {
    "speed": Change(2.0, IMPOSSIBLE_ACCELERATION, 6.0, 0.6),  # many sensors show zero below 2 m/s
    "elevation": Change(20.0, 10.0, 5.0, 4.0),
    "latitude": Change(0.01, 0.001, 0.001, 0.01),
    "longitude": Change(0.01, 0.001, 0.001, 0.01),
    "engine_speed": Change(50.0, 600.0, 300.0, 50.0),
}
NOISE = 6.0  # times the usual step of a channel: what is less may be its noise
SPIKE_S, SPIKE_SAMPLES = 2.0, 3  # that an excursion lasts at most
MOST_SPIKES = 0.2  # of the samples; more are another fault, such as two vehicles in turn
SLOW = 3.0  # m/s: below, sensors show zero or creep
FROZEN_S, FROZEN_RUNS, FROZEN_STEP = 3.0, 5.0, 3.0  # of equal values; times the usual ones, and their steps
# channels that change while a truck drives: the value up to which they may stand still, and the change per
# second with which they must go on; a speed is held by drivers, so that it must jump by more than they can
FREEZES = {"speed": (SLOW, 4.0), "elevation": (-np.inf, 0.0)}
# of a straight line in a speed: its time, and rows; how far from it in resolutions, where else it is further,
# and how many of them it rises; it is no part of the drive where most of the drive is straight
LINE_S, LINE_ROWS, ON_LINE, OFF_LINE, RISES, MOSTLY = 10.0, 20, 1.0, 5.0, 20.0, 0.5
PLACE_S, MOVED_M_S = 10.0, 3.0  # over which positions move by so much; receivers that stand drift by less
NO_SPEED = 0.05  # m/s: less is the noise of a speed that is not written
ZERO_S = 8.0  # of zero in a row, in whose halves positions move on; receivers are late by less
ZERO_SAMPLES, ZERO_SHARE = 10, 0.7  # on each side of a changed zero; of the jump that stays
NEAR_RATIO = 0.015  # relative
TENFOLD, TENFOLD_SHARE, TENFOLD_LEAST = 0.03, 0.04, 5  # of a decade; of the pairs, and the least of them
MOST_JUMPS, LEAST_JUMPS = 0.02, 10  # of the steps that no truck makes; more are no speed
NONE_SHARE, FULL_STEP = -1.0, 5.0  # percent: written for no value by some loggers; reached by such a step
PEDAL, CODES = 100.4, (101.6, 102.0)  # percent: largest of a pedal, and its codes for error and no value
ZERO_BYTE = -125.0  # percent torque of a byte of zero: no engine retards by that
LEAST_TURNS, MOST_TURNS = 40, 12  # samples to judge by, and apart that one of another sender stands
# of the usual step, that is left without another sender; resolutions that a jump to it has, and part of the
# steps that are smaller; of its samples, that are off their neighbours
SMOOTHER, JUMPS, OFTEN, MOST_OFF = 0.5, 3.0, 0.82, 0.5
# samples in whose middle the more frequent sender is; usual distances from it of another one, which are this
# many and part of all, on one side, and change from one to the next by a part of their size; least part of
# their numbers that differ
NEIGHBOURS, AWAY, LEAST_OTHERS, LEAST_SHARE, ALIKE, SLOWLY, MOVES = 11, 5.0, 20, 0.03, 0.9, 0.3, 0.3
GOES_ON = 1.5  # times the usual step that two steps are of what goes on smoothly, which is 2
DROPPED = "that jump to a number for no value and back"
UNAVAILABLE = "of a code for 'not available'"
SPIKES = "that jump away and back faster than any truck"
FROZEN = "that stand still and then jump"
HELD_S, HELD_SAMPLES, TURNED, IDLING = 3.0, 6, 0.03, 2.0  # of a held fuel rate; of engine speed; times idling
FUEL = ("fuel_rate", "engine_command")  # what an engine that changes its speed burns is never one number
STANDS = "that stand still while the engine changes"
LINE = "on one straight line for long, as written where nothing was measured"


def impossible(channel: str, unit: str, time: Array, values: Array) -> Iterator[tuple[str, Mask]]:
    """Reasons, each with the samples (n,) that certainly are no values; time (n,) in s, NaN is already
    missing.

    A code is a number that J1939 reserves for a missing value; a drop-out is a constant number at or below
    zero that is entered and left faster than a truck can change.
    """
    left = np.isfinite(values)
    finders = [_codes] if channel in ("engine_command", "brake_command") and unit == "percent" else []
    finders += [_dropped, _spikes] if channel in CHANGES else []
    finders += [_frozen] if channel in FREEZES else []
    finders += [_lines] if channel == "speed" else []
    for find in finders:
        at = np.flatnonzero(left)
        if len(at) < 3:
            return
        for reason, none in find(channel, time[at], values[at]):
            found = np.zeros(len(values), dtype=bool)
            found[at[none]] = True
            if found.any():
                left &= ~found
                yield reason, found


def _codes(channel: str, t: Array, v: Array) -> Iterator[tuple[str, Mask]]:
    coded = np.isclose(v, CODES[0], atol=1e-6) | np.isclose(v, CODES[1], atol=1e-6)
    if coded.any() and not coded.all() and v[~coded].max() <= PEDAL:
        yield UNAVAILABLE, coded
    empty = v == ZERO_BYTE
    if empty.any() and not empty.all():
        yield UNAVAILABLE, empty
    negative = (v < 0.0) & ~empty
    jumped = np.abs(np.diff(v))[negative[1:]] > FULL_STEP
    if (v[negative] == NONE_SHARE).all() and jumped.any():
        yield UNAVAILABLE, negative


def _dropped(channel: str, t: Array, v: Array) -> Iterator[tuple[str, Mask]]:
    """Runs of a code that are entered and left by jumps. At the start or end, zero counts only for a receiver
    that has a fix or not, because a truck may stand where a log starts or ends."""
    change, fix = CHANGES[channel], channel in ("elevation", "latitude", "longitude")
    least = {"speed": CHANNELS["speed"].low, "elevation": -np.inf}.get(channel, 0.0)
    codes = np.unique(v[(v <= 0.0) & (v >= least)])
    edges = [0, *(np.flatnonzero(_jumps(change, t, v)) + 1), len(v)]
    dropped = np.zeros(len(v), dtype=bool)
    for i, j in pairwise(edges) if len(edges) > 2 else ():
        within = fix or v[i] != 0.0 or (i > 0 and j < len(v))
        same = bool((v[i:j] == v[i]).all())
        dropped[i:j] = within and v[i] in codes and same and (j - i > 1 or v[i] == 0.0)
    yield DROPPED, dropped


def _jumps(change: Change, t: Array, v: Array) -> Mask:
    """Steps (n - 1,) that no truck makes."""
    return np.asarray(np.abs(np.diff(v)) > change.step + change.rate * np.diff(t))


def _spikes(channel: str, t: Array, v: Array) -> Iterator[tuple[str, Mask]]:
    """Few samples that are left and entered by jumps, between values that go on as if they were not."""
    change, step = CHANGES[channel], np.diff(t)
    size, low = np.abs(np.diff(v)), np.minimum(np.abs(v[1:]), np.abs(v[:-1]))
    fine = max(change.least, NOISE * float(np.median(size)))
    least = np.where(low < SLOW, change.step, fine) if channel == "speed" else np.full(len(size), fine)
    jumps = np.flatnonzero(size > least + change.back * step)
    longest = max(SPIKE_S, SPIKE_SAMPLES * float(np.median(step)))
    found = np.zeros(len(v), dtype=bool)
    last = -1
    for n, k in enumerate(jumps):
        if k <= last:
            continue
        for m in jumps[n + 1 :]:
            apart = t[m + 1] - t[k]
            if apart > longest + step[m]:
                break
            if abs(v[m + 1] - v[k]) <= fine + 0.5 * change.back * apart:
                found[k + 1 : m + 1], last = True, m
                break
    jumped = np.isin(np.arange(len(size)), jumps)
    if len(size) > 1:  # of the first and last sample one side is known
        found[0] |= jumped[0] and not jumped[1] and v[0] != 0.0
        found[-1] |= jumped[-1] and not jumped[-2] and v[-1] != 0.0
    if found.mean() <= MOST_SPIKES:
        yield SPIKES, found


def _frozen(channel: str, t: Array, v: Array) -> Iterator[tuple[str, Mask]]:
    """A channel that repeats one number for seconds, where it usually changes, and then jumps to where it has
    got to meanwhile; the first of them is a value."""
    least, rate = FREEZES[channel]
    starts = np.flatnonzero(np.diff(v, prepend=np.nan) != 0.0)
    ends = np.append(starts[1:], len(v))
    lasts = t[ends - 1] - t[starts]
    steps = np.abs(np.diff(v))
    usual = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else np.inf
    longest = max(FROZEN_S, FROZEN_RUNS * float(np.quantile(lasts, 0.9)))
    found = np.zeros(len(v), dtype=bool)
    for i, j in zip(starts[lasts >= longest], ends[lasts >= longest], strict=True):
        if j < len(v) and v[i] > least:
            jump = abs(float(v[j] - v[i]))
            found[i + 1 : j] = jump > FROZEN_STEP * usual and jump > rate * (t[j] - t[j - 1])
    yield FROZEN, found


def held_beside(time: Array, values: Array, others: Array, *, turning: bool) -> Mask:
    """Samples (n,) of a fuel rate that repeat one number while `others` (n,) change, the speed of the engine
    where it is `turning`, else that of the truck; the first of them is a value. Zero is an overrun, and so
    is idling beside a truck that rolls."""
    found = np.zeros(len(values), dtype=bool)
    at = np.flatnonzero(np.isfinite(values))
    t, v, beside = time[at], values[at], others[at]
    if len(v) < 3:
        return found
    starts = np.flatnonzero(np.diff(v, prepend=np.nan) != 0.0)
    ends = np.append(starts[1:], len(v))
    counts = (ends - starts)[v[starts] > 0.0]
    if not len(counts):
        return found
    least = max(HELD_SAMPLES, FROZEN_RUNS * float(np.quantile(counts, 0.9)))
    low = 0.0 if turning else IDLING * float(np.quantile(v[v > 0.0], 0.05))
    for i, j in zip(starts, ends, strict=True):
        if j - i < least or t[j - 1] - t[i] < HELD_S or not low < v[i] < v.max():
            continue
        part = beside[i:j][np.isfinite(beside[i:j])]
        if len(part) and np.ptp(part) > TURNED * max(float(part.mean()), 1.0):
            found[at[i + 1 : j]] = True
    return found


def _lines(channel: str, t: Array, v: Array) -> Iterator[tuple[str, Mask]]:
    """Samples within a straight line of LINE_S and more, which an exporter draws between the two that were
    measured; no truck's speed rises so evenly where it else does not."""
    fine = max(float(np.diff(np.unique(v)).min(initial=np.inf)), 1e-6 * float(np.abs(v).max()))
    count = max(LINE_ROWS, int(np.ceil(LINE_S / max(float(np.median(np.diff(t))), 1e-9))))
    starts = np.arange(0, len(v) - count, count)

    def away(i: int, j: int) -> float:
        """How far the samples between two are off the line between them."""
        between = np.interp(t[i : j + 1], t[[i, j]], v[[i, j]])
        return float(np.abs(v[i : j + 1] - between).max())

    off = np.array([away(i, i + count) for i in starts.tolist()])
    rising = np.abs(v[starts + count] - v[starts]) > RISES * fine if len(starts) else np.zeros(0, dtype=bool)
    straight = (off <= ON_LINE * fine) & rising
    found = np.zeros(len(v), dtype=bool)
    if 0 < straight.sum() < MOSTLY * len(straight) and np.median(off[~straight]) > OFF_LINE * fine:
        for i in starts[straight].tolist():
            a, b = i, i + count
            while a > 0 and away(a - 1, b) <= ON_LINE * fine:
                a -= 1
            while b < len(v) - 1 and away(a, b + 1) <= ON_LINE * fine:
                b += 1
            found[a + 1 : b] = True
    yield LINE, found


@dataclass(frozen=True)
class Places:
    """Positions on a plane: times (n,) in s, x and y (n,) in metres."""

    time: Array
    x: Array
    y: Array

    def pace(self, ticks: Array) -> Array:
        """The least of the mean speeds, m/s, between the ticks (k, m) of each row, (k,)."""
        known = np.isfinite(self.x) & np.isfinite(self.y)
        if known.sum() < 2:
            return np.zeros(len(ticks))
        x, y = (np.interp(ticks, self.time[known], axis[known]) for axis in (self.x, self.y))
        moved = np.hypot(np.diff(x, axis=1), np.diff(y, axis=1))
        return np.asarray((moved / np.maximum(np.diff(ticks, axis=1), 1e-9)).min(axis=1, initial=np.inf))


def moving_at_zero(time: Array, speed: Array, places: Sequence[Places]) -> Mask:
    """Samples (n,) of no speed while positions move on, before and behind: zero written for no value."""
    found = np.zeros(len(time), dtype=bool)
    zero = np.flatnonzero(np.abs(speed) < NO_SPEED)
    inside = zero[(time[zero] >= time[0] + PLACE_S) & (time[zero] <= time[-1] - PLACE_S)]
    edges = np.flatnonzero(np.diff(zero, prepend=-2, append=len(time) + 1) > 1)
    runs = [(zero[i], zero[j - 1]) for i, j in pairwise(edges)]
    runs = [
        (i, j) for i, j in runs if time[j] - time[i] >= ZERO_S
    ]  # receivers, which are late, stand by then
    for one in places:
        found[inside] |= one.pace(time[inside, None] + np.array([-PLACE_S, 0.0, PLACE_S])) > MOVED_M_S
        for i, j in runs:
            ticks = np.array([[time[i], 0.5 * (time[i] + time[j]), time[j]]])
            found[i : j + 1] |= one.pace(ticks)[0] > MOVED_M_S
    return found


def zero_changes(time: Array, height: Array, cuts: Array) -> list[tuple[int, float]]:
    """Samples of a height (n,) from which on it is counted from another zero, and by how much more; time (n,)
    in s. What jumps and stays is no hill: receivers change between ellipsoid and sea, barometers are set.
    A new piece begins at `cuts`, times, and behind gaps."""
    at = np.flatnonzero(np.isfinite(height))
    t, h = time[at], height[at]
    if len(h) < 3:
        return []
    change, steps = CHANGES["elevation"], np.diff(h)
    fine = max(change.least, NOISE * float(np.quantile(np.abs(steps), 0.75)))
    gap = max(GAP_S, GAP_PERIODS * float(np.median(np.diff(t))))
    found = []
    for k in np.flatnonzero(np.abs(steps) > fine + change.back * np.diff(t)):
        before, after = h[max(0, k + 1 - ZERO_SAMPLES) : k + 1], h[k + 1 : k + 1 + ZERO_SAMPLES]
        if t[k + 1] - t[k] > gap or ((cuts > t[k]) & (cuts <= t[k + 1])).any():
            continue  # a new piece, whose heights are compared with no others
        if (np.median(after) - np.median(before)) / steps[k] > ZERO_SHARE:
            slopes = np.r_[np.diff(before), np.diff(after)]
            usual = float(np.median(slopes)) if len(slopes) else 0.0
            found.append((int(at[k + 1]), float(steps[k]) - usual))
    return found


def lost_decimals(values: Array) -> str:
    """That numbers (n,) of something that changes slowly differ by factors of ten from one to the next, as
    where a decimal point was lost: 54.0 became 540, and 54.49 became 5449; '' if they do not."""
    v = values[np.isfinite(values) & (values > 0.0)]
    if len(v) < 2 or v.max() < 1.0:
        return ""
    decades = np.abs(np.diff(np.log10(v)))
    tenfold = (np.rint(decades) >= 1.0) & (np.abs(decades - np.rint(decades)) < TENFOLD)
    if tenfold.sum() < TENFOLD_LEAST or tenfold.mean() <= TENFOLD_SHARE:
        return ""
    k = int(np.argmax(tenfold))
    return (
        f"some numbers are ten times their neighbours ({v[k]:.6g}, {v[k + 1]:.6g}), as where decimal points "
        "were lost: no factor or unit mends that; export them anew with a point"
    )


def changed_unit(time: Array, speed: Array) -> str:
    """That the unit of a speed (n,), in any unit, changes on the way: it jumps by the ratio of two units, and
    stays; '' if it does not."""
    at = np.flatnonzero(np.isfinite(speed))
    t, v = time[at], speed[at]
    if len(v) < 2 * ZERO_SAMPLES:
        return ""
    step = np.abs(np.diff(v))
    usual = NOISE * float(np.quantile(step, 0.95))
    for k in np.flatnonzero(step > usual):
        before, after = v[max(0, k + 1 - ZERO_SAMPLES) : k + 1], v[k + 1 : k + 1 + ZERO_SAMPLES]
        if min(len(before), len(after)) < ZERO_SAMPLES or min(before.min(), after.min()) <= 0.0:
            continue
        steps = max(np.abs(np.diff(before)).max(), np.abs(np.diff(after)).max())
        ratio = float(
            (after[0] - 0.5 * (after[1] - after[0])) / (before[-1] + 0.5 * (before[-1] - before[-2]))
        )
        near = (names for names, known in SPEED_RATIOS.items() if abs(ratio / known - 1.0) < NEAR_RATIO)
        what = " to ".join(next(near, ())[::-1])
        if what and steps < step[k] / NOISE:
            return f"jumps from {v[k]:.4g} to {v[k + 1]:.4g} at {moment(t[k + 1])} and stays, as from {what}"
    return ""


def senders(values: Array) -> str:
    """Where samples (n,) of another sender stand, such as 'at every 4. sample'; '' if all are of one.

    Without the samples of one that comes in turn what is left goes on smoothly; those of one that comes at a
    rate of its own are all off their neighbours alike, and by what changes slowly."""
    v = values[np.isfinite(values)]
    if len(v) < LEAST_TURNS:
        return ""
    steps = np.abs(np.diff(v))
    fine, most = JUMPS * float(np.diff(np.unique(v)).min(initial=np.inf)), JUMPS * np.quantile(steps, 0.9)

    def rough(apart: Array) -> float:
        """The mean step, in which single spikes do not count for more than others."""
        return float(np.minimum(np.abs(apart), most).mean())

    usual = rough(steps)
    if rough(v[2:] - v[:-2]) > GOES_ON * usual:
        return ""
    if np.quantile(steps, OFTEN) > fine:
        turn = np.arange(len(v))
        left = {
            (every, k): rough(np.diff(v[turn % every != k]))
            for every in range(2, MOST_TURNS + 1)
            for k in range(every)
        }
        every, k = min(left, key=lambda one: left[one])
        off = np.abs(v[1:-1] - 0.5 * (v[2:] + v[:-2]))[turn[1:-1] % every == k]
        if left[every, k] < SMOOTHER * usual and (off > fine).mean() > MOST_OFF:
            return f"at every {every}. sample"
    off = v - median_filter(v, NEIGHBOURS, mode="nearest")
    away = np.abs(off) > max(fine, AWAY * float(np.median(np.abs(off))))
    others, count = off[away], int(away.sum())
    # numbers that repeat are codes, and no speed of another sender
    if count < max(LEAST_OTHERS, LEAST_SHARE * len(v)) or len(np.unique(v[away])) < MOVES * count:
        return ""
    alike = np.mean(np.sign(others[1:]) == np.sign(others[:-1])) > ALIKE
    slowly = np.abs(np.diff(others)).mean() < SLOWLY * np.abs(others).mean()
    return f"at {count} of {len(v)} samples" if alike and slowly else ""


def impossible_steps(channel: str, time: Array, values: Array) -> tuple[int, int]:
    """The number of steps between samples (n,) of a channel of CHANGES, and of those that no truck makes."""
    at = np.flatnonzero(np.isfinite(values))
    return max(len(at) - 1, 0), int(_jumps(CHANGES[channel], time[at], values[at]).sum())
