"""Events: forces that act only for seconds, found in the residual after the forces of the posterior are
removed.

A matched filter is applied for each leading direction of each mechanism's kernel, confined to a window, over
all windows of 3 to 60 s. The residual is whitened, clipped (an outlier is no event) and filtered back, so
that its inner products with all windows are differences of one cumulative sum per direction. A filter's gain
is divided by its squared spread over all windows of its length, so that a permanent error is no event. The
largest gain is compared with that of noise of the fitted model along the same drives.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm
from scipy.stats import t as student_t

from deeptruck_core.arrays import Array, Mask
from deeptruck_core.json_data import HIDDEN, SPARSE, stored
from deeptruck_model.mismatch.mechanisms.families import EVENT
from deeptruck_model.mismatch.posterior.fitted import narrowed
from deeptruck_model.mismatch.posterior.kernels import (
    IN_EVENTS,
    LAWS,
    UNKNOWN,
    VARYING,
    Kernel,
    kernels,
    within,
    without,
)
from deeptruck_model.mismatch.posterior.posterior import Posterior, posterior
from deeptruck_model.mismatch.posterior.regression import Regression
from deeptruck_model.mismatch.posterior.sampler import OUT, SIZES
from deeptruck_model.mismatch.residual.evidence import DriveRows, Evidence
from deeptruck_model.mismatch.residual.noise import ORDER, TAIL, Fit, Prior, Series, fit, whiten
from deeptruck_model.mismatch.rules import Limits, Rules
from deeptruck_model.trucks.compiled import entry

Rows = NDArray[np.intp]

LENGTHS_S = (3, 4, 5, 6, 7, 8, 10, 12, 15, 20, 25, 30, 40, 50, 60)
STEP_S = 1.0  # between the starts of windows
LEADING = 2  # directions of a kernel that are sought
STEADY = 0.05  # m/s^2: prior sd of a constant force, which is sought too
LARGEST = float(SIZES[-1])  # of a force, beside its kernel's prior sd
CLIP = 2.5  # of the innovations, in their own scale
POWER = float(np.mean(np.clip(student_t(TAIL).ppf((np.arange(10_000) + 0.5) / 10_000), -CLIP, CLIP) ** 2))
INFORMS = 1.0  # information of a window beside the prior's, at least, to count for a filter's spread
QUANTILES = (0.5, 0.95)  # of the windows, by which a filter's spread is judged; events are in fewer
NULLS = 40  # simulated residuals
SPREADS = 4  # of them, from which the filters' spread in noise is known
MOST = 50  # events
AT_ANY_TIME = (LAWS, VARYING)  # parts of the forces that are sought in windows
AT_A_SHIFT = (
    0.5  # of an event's rows, from which the shift is its cause: noise begins and ends an event early
)
BEHIND = 0.5  # of an event's speed change, from which a name is behind it: two cannot be
MOST_POSSIBLE = 3  # names of an event


@dataclass(frozen=True)
class Possible:
    """A name that may be behind an event: the probability that it makes most of its speed change."""

    name: str
    probability: float = field(metadata=stored(digits=2))


@dataclass(frozen=True)
class Event:
    """A force that acts from `start_s` to `end_s` of a recording, rows `start` to `stop` of the stacked
    evidence, and the speed change it causes, m/s. `probability`: that noise along all drives has no gain as
    large. `name` is stated only if it acts in several events; names are `possible` in any. In one of
    `other_shift` the simulator shifts at another moment, so that it says nothing of forces. `channels` are
    those that move otherwise than they usually do."""

    recording: str
    start_s: float = field(metadata=stored(digits=2))
    end_s: float = field(metadata=stored(digits=2))
    speed_change: float = field(metadata=stored(digits=3))
    probability: float = field(metadata=stored(digits=4))
    name: str | None
    start: int = field(default=0, metadata=HIDDEN)
    stop: int = field(default=0, metadata=HIDDEN)
    other_shift: bool = field(default=False, metadata=SPARSE)
    possible: tuple[Possible, ...] = field(default=(), metadata=SPARSE)
    channels: tuple[str, ...] = field(default=(), metadata=SPARSE)


def with_events(look: Posterior, seed: int) -> tuple[Posterior, tuple[Event, ...]]:
    """The posterior, and the events. What acts throughout is named from the rows without events, and what
    acts for seconds afterwards from these alone.

    A first `look` selects the laws whose constants are fitted, and a first posterior finds the events. Those
    too small for a finding stay rows like any others.
    """
    regression = narrowed(look)
    p = posterior(regression, seed=seed, noise=look.noise)
    found = [x for x in events(p, seed) if abs(x.speed_change) >= regression.rules.drift]
    if not found:
        return p, ()
    rows = rows_of(found, len(regression.e))
    innovations = np.where(rows, 0.0, p.noise.innovations)  # an event is no outlier
    p = posterior(without(regression, rows), seed=seed, noise=replace(p.noise, innovations=innovations))
    return in_several(p, regression, found, seed)


def in_several(
    p: Posterior, regression: Regression, found: Sequence[Event], seed: int = 0
) -> tuple[Posterior, tuple[Event, ...]]:
    """The posterior with the names that act in several events, and the events with their names; `regression`
    has their rows.

    Further draws are of the residual in events, given the mean of what acts throughout: of a force of its own
    in each, and of the laws of each mechanism in all of them. Those in which the simulator shifts at another
    moment are left out.
    """
    e, rules = regression.e, regression.rules
    if e.other_shift is not None:
        at_a_shift = [e.other_shift[x.start : x.stop].mean() >= AT_A_SHIFT for x in found]
        found = [replace(x, other_shift=bool(own)) for x, own in zip(found, at_a_shift, strict=True)]
    asked = [x for x in found if not x.other_shift]
    within_events = copy(regression)
    within_events.rows = regression.rows[rows_of(asked, len(e))[regression.rows]]
    if not len(within_events.rows):
        return p, tuple(found)
    q = p.given(within_events, _in_events(within_events, asked), seed)
    own = [j for j, k in enumerate(q.of) if k.part == IN_EVENTS]
    most = {x: np.array([_makes_most(q, j, x) for j in own]) for x in asked}  # (blocks, draws) of each
    several = np.sum(list(most.values()), axis=0) >= rules.several
    names = [q.of[j].name for j in own]
    named = (_named(x, names, most[x], several, rules) if x in most else x for x in found)
    return p.beside_given(q, own, several), tuple(named)


def _in_events(regression: Regression, asked: Sequence[Event]) -> list[Kernel]:
    """Blocks that are confined to events: a force of its own in each, which has no name, and the laws of each
    mechanism in all of them."""
    n = len(regression.e)
    anything = next(k for k in kernels(regression) if k.name == UNKNOWN)
    own = [within(replace(anything, name=EVENT, part=EVENT), rows_of([x], n), regression) for x in asked]
    each = [k for k in kernels(regression) if k.part == LAWS and k.name != UNKNOWN]
    return [*own, *(within(replace(k, part=IN_EVENTS), rows_of(asked, n), regression) for k in each)]


def _makes_most(q: Posterior, j: int, x: Event) -> Mask:
    """The draws (m,) in which a block makes most of the speed change of an event."""
    change = q.coefficients(j) @ q.of[j].features[x.start : x.stop].sum(axis=0) * q.regression.e.dt
    out: Mask = change * x.speed_change >= BEHIND * x.speed_change**2
    return out


def _named(x: Event, names: Sequence[str], most: Mask, several: Mask, rules: Rules) -> Event:
    """An event with its name and those that are possible, from the draws (names, m) in which each makes most
    of it, and of several events."""
    stated = (n for n, acts in zip(names, (most & several).mean(axis=1), strict=True) if acts >= rules.stated)
    likely = sorted(zip(most.mean(axis=1), names, strict=True), reverse=True)
    possible = tuple(Possible(n, float(p)) for p, n in likely[:MOST_POSSIBLE] if p >= Limits.least_in)
    return replace(x, name=next(stated, None), possible=possible)


def rows_of(happened: Sequence[Event], n: int) -> Mask:
    """Rows (n,) of the stacked evidence in which events act."""
    out = np.zeros(n, dtype=bool)
    for x in happened:
        out[x.start : x.stop] = True
    return out


def events(p: Posterior, seed: int = 0) -> tuple[Event, ...]:
    """The events in the residual after the posterior mean of all forces is subtracted.

    Held-out drives are searched too, after subtracting these forces with sizes fitted to each, and then its
    median, because each drive has a constant force of its own.
    """
    e = p.regression.e.everywhere()
    return find_events(_left_over(p, e), p.noise, kernels(p.regression), e.drives, e.dt, seed)


def _left_over(p: Posterior, e: Evidence) -> Series:
    """The residual of all rows less the posterior mean of all forces. A held-out drive has its own sizes of
    these forces, because a form that is not exact has others there, and its own constant."""
    series = e.series(p.noise.sigma)
    y = np.where(series.valid, p.residual(), 0.0)
    X = _most_probable_forces(p)
    prior = Prior(np.zeros(X.shape[1]), np.ones(X.shape[1]), np.zeros(X.shape[1]))
    for s in e.drives:
        known = series.valid & (e.record == e.record[s.start])
        if s.held_out and known.any():
            left = np.where(known, e.residual - p.mean, 0.0)
            left = left - X @ fit(replace(series, y=left, valid=known), X, prior, p.noise).b
            y[s.rows] = np.where(known, left - np.median(left[known]), 0.0)[s.rows]
    return replace(series, y=y)


def _most_probable_forces(p: Posterior) -> Array:
    """Columns (n, k), with unit prior variance, of the blocks that act in the state drawn most often."""
    states, count = np.unique(p.draws.states, axis=0, return_counts=True)
    state = states[int(np.argmax(count))]
    acting = [np.nan_to_num(k.features) * SIZES[s] for k, s in zip(p.of, state, strict=True) if s != OUT]
    return np.concatenate([p.always, *acting], axis=1)


def find_events(
    series: Series,
    noise: Fit,
    kernels: Sequence[Kernel],
    drives: Sequence[DriveRows],
    dt: float,
    seed: int = 0,
) -> tuple[Event, ...]:
    """The events in a residual, `series.y` (n,), m/s^2, at period `dt`, largest first.

    `noise` is that of this residual; features of the kernels are (n, k). Noise alone gives
    `series.rules.false_events` per hour.
    """
    mechanisms = [k for k in kernels if k.part in AT_ANY_TIME]
    filters = _Filters(series, noise, mechanisms, drives, dt)
    if not len(filters.first):
        return ()
    hours = float(filters.use.sum()) * dt / 3600.0
    null = _Null.of(filters, np.random.default_rng(seed))
    least = null.exceeded_by(series.rules.false_events * hours)
    psi = np.clip(filters.whitened, -CLIP, CLIP)
    scale = filters.scale(psi)
    free = np.ones(len(filters.first), dtype=bool)
    found: list[Event] = []
    while len(found) < MOST:
        sums = filters.sums(psi)
        gain, window, direction = filters.largest(sums, scale, free)
        if gain < least:
            break
        for first, last in filters.apart(sums, scale, window, direction, least):
            rows = slice(int(filters.edges[first]), int(filters.edges[last]))
            psi[rows.start : rows.stop + ORDER] = 0.0
            probability = float(np.exp(-null.expected(gain)))
            at = next((k for k, x in enumerate(found) if _go_on(x, rows, series)), len(found))
            for larger in found[at : at + 1]:  # what is left of it at an end
                rows = slice(min(rows.start, larger.start), max(rows.stop, larger.stop))
                probability = larger.probability
            drive = next(s for s in drives if s.start <= rows.start < s.stop)
            start_s, end_s = (drive.start_s + (k - drive.start) * dt for k in (rows.start, rows.stop))
            change = _speed_change(series, rows, dt)
            event = Event(drive.name, start_s, end_s, change, probability, None, rows.start, rows.stop)
            found[at : at + 1] = [event]
            free &= (filters.last <= first) | (filters.first >= last)
    return tuple(found)


def _speed_change(series: Series, rows: slice, dt: float) -> float:
    """Speed change of the residual over some rows, m/s."""
    return float(np.sum(series.y[rows][series.valid[rows]])) * dt


def _go_on(x: Event, rows: slice, series: Series) -> bool:
    """Whether the residual before or after an event has the same sign, so that the event continues there."""
    touches = rows.start == x.stop or rows.stop == x.start
    same_drive = not series.starts[max(rows.start, x.start)]
    return touches and same_drive and _speed_change(series, rows, 1.0) * x.speed_change > 0.0


def _seconds(kind: int) -> int:
    return LENGTHS_S[kind % len(LENGTHS_S)]


class _Filters:
    """Directions (n, D) that are searched in windows between `edges`. Windows (W,) have a `first` and a
    `last` edge and a `kind`: the index of their length in LENGTHS_S, plus the number of lengths for held-out
    drives, to which nothing was fitted."""

    def __init__(
        self, series: Series, noise: Fit, kernels: Sequence[Kernel], drives: Sequence[DriveRows], dt: float
    ) -> None:
        n = len(series.y)
        leading = [np.nan_to_num(k.features[:, :LEADING]) for k in kernels]
        self.directions = np.concatenate([np.full((n, 1), STEADY), *leading], axis=1)
        self.directions[~series.valid] = 0.0
        self.use = series.usable()
        self.ar = noise.ar
        self.weight = np.where(self.use, 1.0 / (series.relative * noise.sigma), 0.0)
        self.whitened = np.zeros(n)
        rows = np.flatnonzero(self.use)
        self.whitened[rows] = whiten(series.y, noise.ar, rows, self.weight[rows])
        self._step = max(1, round(STEP_S / dt))
        parts = [np.arange(s.start, s.stop + 1, self._step) for s in drives]
        self.edges: Rows = np.concatenate(parts)
        self._prepare_power()
        held_out = np.array([s.held_out for s in drives])
        self._make_windows(np.repeat(np.arange(len(parts)), [len(p) for p in parts]), held_out, dt)

    def _prepare_power(self) -> None:
        """Prepare cumulative arrays: the power of a direction between two edges is the difference of one
        array at the last and another at the first edge, if at least ORDER rows lie between, which is the
        reach of the whitening filter."""
        n, squares = len(self.use), self.weight**2
        whitening = np.concatenate([[1.0], -self.ar])
        self._to, self._from = np.zeros((2, len(self.edges), self.directions.shape[1]))
        for lag in range(ORDER + 1):
            weight = np.zeros(n)
            for j in range(ORDER + 1 - lag):
                weight[: n - j] += whitening[j] * whitening[j + lag] * squares[j:]
            product = self.directions[lag:] * self.directions[: n - lag]
            product *= ((2.0 if lag else 1.0) * weight[lag:])[:, None]
            sums = np.concatenate([np.zeros((lag + 1, product.shape[1])), np.cumsum(product, axis=0)])
            self._to += sums[self.edges]
            self._from += sums[np.minimum(self.edges + lag, n)]

    def _make_windows(self, drive: Rows, held_out: Mask, dt: float) -> None:
        used = np.concatenate([[0], np.cumsum(self.use)])[self.edges]
        first, last, kind = [], [], []
        for i, seconds in enumerate(LENGTHS_S):
            count = max(1, round(seconds / dt / self._step))
            a = np.arange(max(len(self.edges) - count, 0) if count * self._step >= ORDER else 0)
            compared = used[a + count] - used[a] >= Limits.event_compared * count * self._step
            a = a[(drive[a] == drive[a + count]) & compared]
            first.append(a)
            last.append(a + count)
            kind.append(i + len(LENGTHS_S) * held_out[drive[a]])
        self.first, self.last, self.kind = (np.concatenate(x) for x in (first, last, kind))
        self._half = self._half_variance(self.first, self.last).astype(np.float32)

    def _half_variance(self, first: Rows, last: Rows) -> Array:
        """Factor (W, D) from the square of an inner product to a gain in nats."""
        power = np.maximum(self._to[last] - self._from[first], 0.0)
        out: Array = 0.5 / (POWER * (power + LARGEST**-2))
        return out

    def sums(self, psi: Array) -> Array:
        """Inner products of innovations (n,) with the directions up to each edge, (edges, D)."""
        weighted = psi * self.weight
        back = weighted.copy()
        for k in range(1, ORDER + 1):
            back[:-k] -= self.ar[k - 1] * weighted[k:]
        return _sums(self.directions, back, self.edges)

    def scale(self, psi: Array) -> Array:
        """Factors on gains (kinds, D): the inverse square of a filter's spread over the windows of a kind
        that are informative about its direction. The spread is at least one, is the largest estimate of
        QUANTILES, and is increased if windows are few."""
        sums, spread = self.sums(psi), np.ones((2 * len(LENGTHS_S), self.directions.shape[1]))
        for i in np.unique(self.kind):
            own = self.kind == i
            off = np.abs(sums[self.last[own]] - sums[self.first[own]]) * np.sqrt(2.0 * self._half[own])
            informs = 0.5 / (POWER * self._half[own]) > (1.0 + INFORMS) * LARGEST**-2
            count = informs.sum(axis=0)
            off = np.sort(np.where(informs, off, np.inf), axis=0)
            columns = np.arange(len(count))
            few = 1.0 + 1.0 / np.sqrt(np.maximum(count * STEP_S / _seconds(i), 1.0))
            for q in QUANTILES:
                at = off[np.maximum((q * count).astype(int) - 1, 0), columns]
                widest = np.where(count > 0, at, 0.0) / norm.ppf(0.5 + q / 2.0) * few
                spread[i] = np.maximum(spread[i], widest)
        return spread**-2

    def largest(self, sums: Array, scale: Array, free: Mask) -> tuple[float, int, int]:
        """The largest gain, nats, of the windows that are free, with its window and direction."""
        gain, window, direction = _largest(sums, self.first, self.last, self.kind, self._half, scale, free)
        return float(gain), int(window), int(direction)

    def apart(
        self, sums: Array, scale: Array, window: int, direction: int, least: float
    ) -> list[tuple[int, int]]:
        """First and last edges of the events in a window. It is split if both parts gain `least` or more and
        together half of it more than the whole, because there are few ways to split one window."""
        first, last, kind = self.first[window], self.last[window], self.kind[window]
        seconds = _seconds(kind) / (last - first)  # of an edge
        shortest = max(round(LENGTHS_S[0] / seconds), -(-ORDER // self._step))
        ends, starts = np.triu_indices(last - first + 1, k=1)
        inside = (ends >= shortest) & (last - first - starts >= shortest)
        ends, starts = first + ends[inside], first + starts[inside]

        def gains(a: Rows, b: Rows) -> Array:
            half = self._half_variance(a, b)[:, direction] * scale[kind, direction]
            out: Array = half * (sums[b, direction] - sums[a, direction]) ** 2
            return out

        whole = gains(np.array([first]), np.array([last]))[0]
        before, after = gains(np.full_like(ends, first), ends), gains(starts, np.full_like(starts, last))
        together = np.where(np.minimum(before, after) >= least, before + after, 0.0)
        if together.max(initial=0.0) < whole + least / 2.0:
            return [(int(first), int(last))]
        best = int(np.argmax(together))
        return [(int(first), int(ends[best])), (int(starts[best]), int(last))]


@dataclass(frozen=True)
class _Null:
    """Distribution of the largest gain in noise: Gumbel's, nats."""

    mode: float
    width: float

    @staticmethod
    def of(filters: _Filters, rng: np.random.Generator) -> _Null:
        """From the moments over simulated innovations, with the filters' spread estimated as for a log."""
        n, free = len(filters.use), np.ones(len(filters.first), dtype=bool)

        def simulated() -> Array:
            out: Array = np.clip(rng.standard_t(TAIL, n), -CLIP, CLIP)
            return out

        scale = np.mean([filters.scale(simulated()) for _ in range(SPREADS)], axis=0)
        gains = [filters.largest(filters.sums(simulated()), scale, free)[0] for _ in range(NULLS)]
        width = float(np.std(gains)) * np.sqrt(6.0) / np.pi
        return _Null(float(np.mean(gains)) - np.euler_gamma * width, width)

    def expected(self, gain: float) -> float:
        """Expected number of larger gains in noise."""
        return float(np.exp(-(gain - self.mode) / self.width))

    def exceeded_by(self, count: float) -> float:
        """The gain that noise is expected to exceed `count` times."""
        return float(self.mode - self.width * np.log(count))


@entry
def _sums(directions: Array, psi: Array, edges: Rows) -> Array:
    out = np.zeros((len(edges), directions.shape[1]))
    total = np.zeros(directions.shape[1])
    row = 0
    for i in range(len(edges)):
        while row < edges[i]:
            for d in range(len(total)):
                total[d] += directions[row, d] * psi[row]
            row += 1
        out[i] = total
    return out


@entry
def _largest(
    sums: Array, first: Rows, last: Rows, kind: Rows, half: NDArray[np.float32], scale: Array, free: Mask
) -> tuple[float, int, int]:
    best, window, direction = -1.0, 0, 0
    for w in range(len(first)):
        if free[w]:
            a, b, i = first[w], last[w], kind[w]
            for d in range(sums.shape[1]):
                off = sums[b, d] - sums[a, d]
                gain = off * off * half[w, d] * scale[i, d]
                if gain > best:
                    best, window, direction = gain, w, d
    return best, window, direction
