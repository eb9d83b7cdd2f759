"""One posterior from which names, budget and correction are read.

The residual is a sum of blocks: every mechanism's kernels, parameters, what no mechanism would do,
constants of drives, slow drift and road positions. Each is in or out, with a size (`sampler`); effects of
sensors are always in, and the noise is fitted again given what is in.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from deeptruck_core.arrays import Array
from deeptruck_core.constants import GRAVITY
from deeptruck_core.signals import FELT, FELT_SD
from deeptruck_model.mismatch.mechanisms import LIBRARY
from deeptruck_model.mismatch.mechanisms.air_tyres_road import HILLY
from deeptruck_model.mismatch.mechanisms.courses import FINE_M, SLOW_KNOT_S
from deeptruck_model.mismatch.mechanisms.families import EACH_DRIVE, EVENT, PLACE, SLOW, UNKNOWN
from deeptruck_model.mismatch.posterior.kernels import (
    IN_EVENTS,
    LAWS,
    PARAMETER,
    VARYING,
    Kernel,
    kernels,
)
from deeptruck_model.mismatch.posterior.regression import FREE, Regression, changed_by
from deeptruck_model.mismatch.posterior.sampler import OUT, SIZES, SWEEPS, Blocks, Draws, Reduced, sample
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.residual.noise import ORDER, TAIL, Fit, Prior, Series, fit, ridge, whiten
from deeptruck_model.mismatch.rules import Limits

SLOW_S = SLOW_KNOT_S[0]  # spacing of the knots in time: as fine as those of mechanisms
MOST_KNOTS = 240  # wider apart where there would be more
COARSE_M = 1000.0  # of the coarser knots of a slope that was not recorded
PLACE_M, MOST_PLACES = 200.0, 160
DRIFT = 0.05  # m/s^2, prior sd of what is slow, of a place, and of a constant per drive
RIDGE = 1e-6  # of the mean square of columns, so that copies share a force
# Draws, beside whose mean the noise is fitted, and how often at most: it is steady at once beside known
# physics, and not where most of a residual is forces.
KNOWN, LEARNED, STEADY = (12, 1), (40, 8), 0.02
CHUNK = 4096  # rows that are whitened at once
DRIFT_ODDS = 0.3  # prior odds of each of these, mostly slopes, and of a slope: hardly two drives are alike
LASTING = 3  # rows, which noise does not outlast
NO_COLUMNS = Prior(np.zeros(0), np.zeros(0), np.zeros(0))
SLOPE = "slope"  # part of the kernel of a slope that was not recorded: hardly a road has none
NO_NAME = (SLOW, PLACE, EACH_DRIVE, EVENT)  # blocks that are no mechanism


@dataclass(frozen=True)
class Posterior:
    """Posterior draws of which blocks act, and of their coefficients; blocks are in the order of `of`."""

    regression: Regression
    of: tuple[Kernel, ...]
    at: tuple[NDArray[np.intp], ...]
    draws: Draws
    always: Array  # (n, k) columns that are always in: parameters near their values, sensors, form error
    form_error: int  # how many of these, the last, are what the forms of mechanisms may be off by
    mean: Array  # (n,) m/s^2, what the prior means of these are
    noise: Fit
    prior: Prior

    def lasts(self, name: str) -> NDArray[np.bool_]:
        """The draws (m,) in which a block of this name acts that is not confined to events."""
        own = [j for j, k in enumerate(self.of) if k.name == name and k.part != IN_EVENTS]
        return np.asarray(self.draws.inside[:, own].any(axis=1), dtype=bool)

    def inside(self, name: str) -> NDArray[np.bool_]:
        """The draws (m,) in which a block of this name acts."""
        own = [j for j, k in enumerate(self.of) if k.name == name]
        return np.asarray(self.draws.inside[:, own].any(axis=1), dtype=bool)

    def coefficients(self, j: int) -> Array:
        """Coefficients of block `j` in each draw, (m, k)."""
        return self.draws.coefficients[:, self.at[j]]

    def probability(self, name: str) -> float:
        """Probability that a name acts; zero if there is no such block."""
        return float(self.inside(name).mean()) if any(k.name == name for k in self.of) else 0.0

    def nameless(self) -> float:
        """Probability that no mechanism and no parameter acts."""
        named = [j for j, k in enumerate(self.of) if k.name not in (*NO_NAME, UNKNOWN)]
        return float((~self.draws.inside[:, named].any(axis=1)).mean())

    def is_parameter(self, name: str) -> bool:
        """Whether the parameter of a name acts more often than its other forces."""
        inside = self.draws.inside
        own = {k.part: float(inside[:, j].mean()) for j, k in enumerate(self.of) if k.name == name}
        parameter = own.pop(PARAMETER, 0.0)
        return parameter > 0.0 and parameter >= max(own.values(), default=0.0)

    def change(self, parameter: str, given: NDArray[np.bool_]) -> tuple[float, float]:
        """Mean and standard deviation of a parameter's relative change from the simulator as given, over the
        `given` draws (m,)."""
        s, i = self.regression, self.regression.parameters.index(parameter)
        j = next(j for j, k in enumerate(self.of) if k.name == parameter and k.part == PARAMETER)
        b = self.draws.coefficients[given]
        slope = self.prior.mean[i] + self.prior.sd[i] * b[:, i] + FREE[parameter] * b[:, self.at[j][0]]
        gain = s.mass_gain if parameter == "mass" else 1.0
        moved = np.array([changed_by(parameter, float(x), gain) for x in slope])
        mean = float(moved.mean())
        sd = float(np.hypot(moved.std(), 0.5 * min(mean**2, abs(mean))))  # of the linearisation
        further = s.e.moved.get(parameter, 0.0)
        return s.e.total_change(parameter, mean), (1.0 + further) * sd

    def gain(self, name: str) -> float:
        """Log evidence of a name's best block alone, averaged over sizes, nats."""
        own = [j for j, k in enumerate(self.of) if k.name == name]
        return float((logsumexp(self.draws.alone[own], axis=1) - np.log(len(SIZES))).max())

    def force(self, name: str, given: NDArray[np.bool_] | None = None) -> Array:
        """Posterior mean (n,) of a name's force, m/s^2, over all draws or the given ones."""
        out = np.zeros(len(self.regression.e))
        for j, k in enumerate(self.of):
            if k.name == name:
                b = self.coefficients(j) if given is None else self.coefficients(j)[given]
                if len(b) and np.abs(b).max(initial=0.0) > 0.0:
                    out += k.features @ b.mean(axis=0)
        return out

    def residual(self) -> Array:
        """The residual (n,) of all rows less the mean of all forces, m/s^2."""
        b = self.draws.coefficients.mean(axis=0)
        out = self.regression.e.residual - self.mean - self.always @ b[: self.always.shape[1]]
        for k, a in zip(self.of, self.at, strict=True):
            if np.abs(b[a]).max(initial=0.0) > 0:
                out = out - np.nan_to_num(k.features) @ b[a]
        return np.asarray(out)

    def left_over(self) -> Series:
        """The residual less the mean of all forces, of the rows that count."""
        series = self.regression.series
        return replace(series, y=np.where(series.valid, self.residual(), 0.0))

    def given(self, regression: Regression, of: Sequence[Kernel], seed: int) -> Posterior:
        """As many draws of other blocks `of` what the mean of this posterior leaves, in the rows of a
        regression."""
        blocks = _blocks(regression, of, self.always, self.residual(), self.noise)
        first = np.arange(self.always.shape[1])
        draws = sample(
            blocks, first, regression.rules.evidence_temperature, seed=seed, sweeps=len(self.draws.states)
        )
        return replace(self, regression=regression, of=tuple(of), at=tuple(blocks.at), draws=draws)

    def beside_given(self, q: Posterior, own: Sequence[int], acts: NDArray[np.bool_]) -> Posterior:
        """This posterior with blocks of another whose draws are given its mean: `own` are these blocks, and
        `acts` (blocks, m) the draws in which each counts."""
        states = np.where(acts.T, q.draws.states[:, own], OUT)
        coefficients = [q.coefficients(j) * a[:, None] for j, a in zip(own, acts, strict=True)]
        whole = np.concatenate([self.draws.coefficients, *coefficients], axis=1)
        ends = np.cumsum([self.draws.coefficients.shape[1], *(x.shape[1] for x in coefficients)])
        draws = replace(
            self.draws,
            states=np.concatenate([self.draws.states, states], axis=1),
            coefficients=whole,
            alone=np.concatenate([self.draws.alone, q.draws.alone[own]]),
        )
        at = (*self.at, *(np.arange(a, b) for a, b in itertools.pairwise(ends)))
        return replace(self, of=(*self.of, *(q.of[j] for j in own)), at=at, draws=draws)

    def beside(self, more: Sequence[Kernel]) -> Reduced:
        """The blocks of this posterior with `more` of them behind, without draws."""
        y = self.regression.series.y - self.mean
        blocks = _blocks(self.regression, (*self.of, *more), self.always, y, self.noise)
        return Reduced(blocks, np.arange(self.always.shape[1]))

    def on_columns(self, name: str, columns: Array, given: NDArray[np.bool_]) -> Array:
        """Coefficients (g, k) of columns (n, k) whose force is nearest to the name's in each of the `given`
        draws (m,)."""
        X = np.nan_to_num(columns[self.regression.rows])
        H = X.T @ X
        H += np.eye(len(H)) * (RIDGE * np.trace(H) / max(len(H), 1) + 1e-12)
        out = np.zeros((int(given.sum()), len(H)))
        for j, k in enumerate(self.of):
            if k.name == name:
                onto = X.T @ np.nan_to_num(k.features[self.regression.rows])
                out += self.coefficients(j)[given] @ np.linalg.solve(H, onto).T
        return out


def posterior(
    regression: Regression, *, seed: int = 0, sweeps: int = SWEEPS, noise: Fit | None = None
) -> Posterior:
    """Draws from the posterior of all blocks of a regression; beside `noise` that is known, else that of
    `first_look`."""
    if noise is None:
        noise = first_look(regression, seed=seed).noise
    return _drawn(regression, seed, sweeps, noise)


def first_look(regression: Regression, *, seed: int = 0) -> Posterior:
    """A few draws from the posterior, and the noise that is fitted beside their mean forces."""
    X, prior = regression.design(free=True)
    noise = fit(regression.series, X, prior)
    few, rounds = KNOWN if regression.e.known_physics else LEARNED
    for _ in range(rounds):
        p, before = _drawn(regression, seed, few, noise), noise.sigma
        noise = fit(p.left_over(), np.zeros((len(regression.e), 0)), NO_COLUMNS, noise)
        if abs(noise.sigma - before) < STEADY * before:
            break
    return replace(p, noise=noise)


def _drawn(regression: Regression, seed: int, sweeps: int, noise: Fit) -> Posterior:
    X, prior = regression.design()
    of = (*kernels(regression), *_drift(regression))
    error = _form_error(regression)
    always = np.concatenate([X * prior.sd, error], axis=1)
    mean = X @ prior.mean
    blocks = _blocks(regression, of, always, regression.series.y - mean, noise)
    first = np.arange(always.shape[1])
    draws = sample(
        blocks, first, regression.rules.evidence_temperature, Limits.law_error, seed, sweeps=sweeps
    )
    at = tuple(blocks.at)
    return Posterior(regression, of, at, draws, always, error.shape[1], mean, noise, prior)


def _places_of(always: Array, of: Sequence[Kernel]) -> tuple[NDArray[np.intp], ...]:
    """The columns of every block, behind those that are always in."""
    ends = np.cumsum([always.shape[1], *(k.features.shape[1] for k in of)])
    return tuple(np.arange(a, b) for a, b in itertools.pairwise(ends))


def _blocks(regression: Regression, of: Sequence[Kernel], always: Array, y: Array, noise: Fit) -> Blocks:
    """Inner products of all blocks, given the noise."""
    gram, pull = _products(regression, [always, *(k.features for k in of)], y, noise)
    nameless = regression.rules.odds if regression.e.has(FELT) else DRIFT_ODDS
    each = {**dict.fromkeys(NO_NAME, nameless), SLOPE: DRIFT_ODDS, EVENT: DRIFT_ODDS}
    odds = np.log([each.get(k.part, regression.rules.odds) * k.chance for k in of])
    signed = [None if k.sign is None else _signed(k, regression) for k in of]
    law = np.array([k.part in (LAWS, VARYING, IN_EVENTS) for k in of])
    return Blocks(gram, pull, _places_of(always, of), odds, signed, law)


def _form_error(regression: Regression) -> Array:
    """Model-form error (n, k): what the equations of mechanisms may be wrong by, as functions of common
    signals with a share of the residual's lasting standard deviation (model discrepancy as in Kennedy and
    O'Hagan, J. R. Stat. Soc. B 63, 2001). Without it the larger an effect is, the more probable would be what
    merely resembles it."""
    anything = next(k.features for k in kernels(regression) if k.name == UNKNOWN)
    rows = regression.rows
    own = float(np.sqrt(np.mean(np.sum(anything[rows] ** 2, axis=1)))) if len(rows) else 0.0
    size = Limits.form_error * _lasting(regression)
    out: Array = np.nan_to_num(anything) * (size / max(own, 1e-12))
    return out


def _lasting(regression: Regression) -> float:
    """Standard deviation (m/s^2) of what of the residual outlasts LASTING rows: the root of its
    autocovariance."""
    known = np.zeros(len(regression.e), dtype=bool)
    known[regression.rows] = True
    both = known[LASTING:] & known[:-LASTING]
    y = regression.e.residual - (regression.e.residual[known].mean() if known.any() else 0.0)
    return float(np.sqrt(max(np.mean((y[LASTING:] * y[:-LASTING])[both]), 0.0))) if both.any() else 0.0


def gains(regression: Regression) -> dict[str, float]:
    """Log evidence of each name alone over no effect, nats, along the drives of a regression."""
    p = posterior(regression, sweeps=1)
    return {name: p.gain(name) for name in dict.fromkeys(k.name for k in p.of) if name not in NO_NAME}


def weights(regression: Regression, noise: Fit) -> Array:
    """Weights (m,) of the rows that count, by which whitened columns are multiplied."""
    rows = regression.rows
    heavy: Array = np.sqrt((TAIL + 1) / (TAIL + noise.innovations[rows] ** 2))
    return heavy / (regression.series.relative[rows] * noise.sigma)


def _products(regression: Regression, columns: Sequence[Array], y: Array, noise: Fit) -> tuple[Array, Array]:
    """Inner products of whitened columns, and of these with y; rows are whitened in chunks to save memory."""
    rows, weight = regression.rows, weights(regression, noise)
    k = sum(c.shape[1] for c in columns)
    gram, pull = np.zeros((k, k)), np.zeros(k)
    for begin in range(0, len(rows), CHUNK):
        part = slice(begin, begin + CHUNK)
        some, w = rows[part], weight[part]
        near = slice(some[0] - ORDER, some[-1] + 1)  # all that their whitening reads
        at = some - near.start
        F = np.concatenate([whiten(np.nan_to_num(c[near]), noise.ar, at, w) for c in columns], axis=1)
        gram += F.T @ F
        pull += F.T @ whiten(y[near], noise.ar, at, w)
    return gram, pull


def _signed(k: Kernel, regression: Regression) -> Array:
    assert k.sign is not None
    rows = regression.rows
    out: Array = np.nan_to_num(k.features[rows]).T @ k.sign[rows]
    return out / max(float(np.linalg.norm(out)), 1e-12)


def _drift(regression: Regression) -> list[Kernel]:
    """Blocks that are no mechanism: slow in time, dependent on road position, constant in a drive; and an
    unrecorded slope."""
    e, rows = regression.e, regression.rows
    fitted = [i for i, s in enumerate(e.drives) if not s.held_out]
    drive = np.stack([e.record == i for i in fitted], axis=1).astype(float)
    place = _places(regression)
    out = [Kernel(SLOW, DRIFT * _knots(regression), part=SLOW)]
    if not e.has("grade") and LIBRARY.of_input("grade") in regression.library:
        out.append(_slope(regression))
    if place is not None:
        out.append(Kernel(PLACE, DRIFT * place, part=PLACE))
    if len(fitted) > 1:
        out.append(Kernel(EACH_DRIVE, DRIFT * (drive - drive[rows].mean(axis=0)), part=EACH_DRIVE))
    return out


def _slope(regression: Regression) -> Kernel:
    """A slope that the simulator is not given: splines over distance within each drive, fine and coarse.

    An accelerometer is one more channel of the evidence. Of all forces only slopes part it from dv/dt, so
    that given its reading a slope is N(felt, sd^2) in the place of N(0, HILLY^2): a slow force that it did
    not feel is wind, drag or load.
    """
    e = regression.e
    along, unknown = np.nan_to_num(e["distance"]), np.full(len(e), np.nan)
    hills = np.concatenate([_splines(regression, along, knot) for knot in (FINE_M, COARSE_M)], axis=1)
    gain = e.signals.get("effective_mass_gain", np.ones(len(e)))
    sd = e.signals.get(FELT_SD, unknown)
    columns = (GRAVITY * gain * np.where(np.isfinite(sd), sd, HILLY))[:, None] * hills
    if e.has(FELT):
        felt = (GRAVITY * gain * np.nan_to_num(e[FELT]))[:, None].astype(np.float32)
        columns = np.concatenate([felt, columns.astype(np.float32)], axis=1)
    return Kernel(LIBRARY.of_input("grade").effect, columns, part=SLOPE)


def _knots(regression: Regression) -> Array:
    """A linear spline over time within each drive, (n, k)."""
    e = regression.e
    return _splines(regression, np.arange(len(e), dtype=np.float64) * e.dt, SLOW_S)


def _splines(regression: Regression, along: Array, least: float) -> Array:
    """A linear spline over `along` (n,), which increases within each drive, with knots `least` apart, or
    farther if MOST_KNOTS would be exceeded, (n, k)."""
    e = regression.e
    fitted = [s for s in e.drives if not s.held_out]
    spacing = max(least, sum(float(np.ptp(along[s.rows])) for s in fitted) / MOST_KNOTS)
    parts = []
    for s in fitted:
        x = along[s.rows] - along[s.start]
        knots = np.arange(0.0, x[-1] + spacing, spacing)
        part = np.zeros((len(e), len(knots)), dtype=np.float32)
        part[s.rows] = np.maximum(1.0 - np.abs(x[:, None] - knots) / spacing, 0.0)
        parts.append(part)
    return np.concatenate(parts, axis=1)


def _places(regression: Regression) -> Array | None:
    """A linear spline over road positions that more than one drive passes, (n, k); None if hardly any of the
    road is driven twice."""
    e = regression.e
    known = e.valid & (e["place"] >= 0.0)
    if not known.any() or np.array_equal(e["place"], e["distance"]):  # positions were not recorded
        return None
    bins = (e["place"][known] / PLACE_M).astype(int)
    passes = {b: len(np.unique(e.record[known][bins == b])) for b in np.unique(bins)}
    again = np.array([passes[b] > 1 for b in bins])
    if again.mean() < Limits.driven_again:
        return None
    last = float(e["place"][known].max())
    spacing = max(PLACE_M, last / MOST_PLACES)
    knots = np.arange(0.0, last + spacing, spacing)
    out = np.maximum(1.0 - np.abs(e["place"][:, None] - knots) / spacing, 0.0)
    out[e["place"] < 0.0] = 0.0
    return out


def without_roads(e: Evidence) -> Evidence:
    """The evidence without the force of slopes that the simulator is not given, estimated beside what is
    slow: by the accelerometer, or else as a spline over distance."""
    if e.has("grade"):
        return e
    regression = Regression(e)
    road, slow = _slope(regression).features, DRIFT * _knots(regression)
    X = np.nan_to_num(np.concatenate([road, slow], axis=1).astype(np.float64))
    y = np.where(e.valid, e.residual, 0.0)
    white = 1.4826 * float(np.median(np.abs(np.diff(y[e.valid])))) / np.sqrt(2.0)
    precision = e.valid / max(white, e.rules.noise_floor) ** 2
    k = X.shape[1]
    b = ridge(y, X, precision, Prior(np.zeros(k), np.ones(k), np.zeros(k)))
    return replace(e, residual=e.residual - X[:, : road.shape[1]] @ b[: road.shape[1]])
