"""The evidence of a name as a kernel: all that its physics may do, in place of its best candidate term.

A name's kernel is the prior covariance of its force, averaged over its candidate terms: any mixture of them,
so that a law between two of the library's forms loses little. Log evidence needs inner products of whitened
features alone (a Gaussian process in a truncated basis): another name costs milliseconds.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_solve, solve_triangular
from scipy.special import log_ndtr, logsumexp

from deeptruck_model.mismatch.mechanisms import CandidateTerm, is_time_varying
from deeptruck_model.mismatch.posterior.causes import Explanation
from deeptruck_model.mismatch.posterior.search import ENGINE_GAIN, FREE, GAIN_REPORTED, Model, Search
from deeptruck_model.mismatch.residual.noise import TAIL, whiten

Array = NDArray[np.float64]

UNKNOWN = "unknown"
SIZES = (0.05, 0.15, 0.4, 1.0, 2.5)  # of a kernel beside its prior sd, equally likely
LAW, IN_TIME, UNNAMED = 24, 60, 40  # leading directions that are kept of a kernel
TIME_VARYING = 0.3  # prior odds that a name which may be time-varying is
CARRIERS = {
    "engine": 0.15,
    "brake": 0.15,
    "drag": 0.5,
    "simulated": 0.1,
}  # share of each that no name explains
ALL_THE_TIME = 0.05  # m/s^2, and a force that acts always
VARIABLES = ("speed", "grade", "engine", "brake", "elapsed", "ratio")  # of which the shares are functions
SIGNED_ROWS = 150  # at which a sign is looked at, where the force is ...
ACTING = 0.2  # ... of its largest, or more; and it tells nothing by ...
FEW_ROWS = 20  # ... fewer
TINY = 1e-7  # of the largest power: a direction that has less is rounding


@dataclass(frozen=True)
class Kernel:
    """The features (n, k) of a name, in m/s^2, whose coefficients are N(0, 1). `sign` (n,) is that of a force
    which can have no other; `chance` the prior probability of the name; `reported` that of the engine's
    recorded torque to show its force."""

    name: str
    features: Array
    sign: Array | None = None
    chance: float = 1.0
    reported: float = 0.0


def kernels(search: Search) -> tuple[Kernel, ...]:
    """Of every name in the search's library, of what has none, and of every parameter."""
    found = [k for m in search.library for k in _of_terms(search, search.candidate_terms(m))]
    parameters = [
        Kernel(
            p,
            search.e.sensitivity[p][:, None] * FREE[p],
            reported=GAIN_REPORTED if p == ENGINE_GAIN else 0.0,
        )
        for p in search.parameters
    ]
    return (*found, Kernel(UNKNOWN, _thin(_anything(search), search, UNNAMED)), *parameters)


def _of_terms(search: Search, terms: Sequence[CandidateTerm]) -> list[Kernel]:
    """One kernel of the laws among a name's terms, and one of those that vary in time."""
    laws = [t for t in terms if not is_time_varying(t)]
    varying = [t for t in terms if is_time_varying(t)]
    parts = ((laws, LAW, 1.0), (varying, IN_TIME, TIME_VARYING))
    return [_kernel(search, part, most, odds) for part, most, odds in parts if part]


def _kernel(search: Search, terms: Sequence[CandidateTerm], most: int, odds: float) -> Kernel:
    sizes = [np.sqrt(t.prior.sd**2 + t.prior.mean**2) / math.sqrt(len(terms)) for t in terms]
    columns = [np.nan_to_num(t.columns) for t in terms]
    features = np.concatenate([c * size for c, size in zip(columns, sizes, strict=True)], axis=1)
    signed = all((t.prior.sign > 0).all() for t in terms)
    typical = np.sum([c.sum(axis=1) for c in columns], axis=0)
    mechanism = terms[0].mechanism
    return Kernel(
        mechanism.effect,
        _thin(features, search, most),
        typical if signed else None,
        mechanism.chance(search.e) * odds,
        mechanism.reported,
    )


def _thin(features: Array, search: Search, most: int) -> Array:
    """The leading directions of a kernel over the rows that count, (n, at most `most`)."""
    part = features[search.rows]
    power, directions = np.linalg.eigh(part.T @ part)
    kept = np.argsort(power)[::-1][:most]
    kept = kept[power[kept] > TINY * power.max(initial=0.0)]
    out: Array = features @ directions[:, kept]
    return out


def _anything(search: Search) -> Array:
    """Shares of the known forces that are smooth functions of common signals: no name's own."""
    e = search.e
    known = [np.nan_to_num(e[n]) * share for n, share in CARRIERS.items() if n in e.signals]
    carriers = np.stack([np.full(len(e), ALL_THE_TIME), *known], axis=1)
    over = np.stack([f for n in VARIABLES if n in e.signals for f in _functions(e[n], search.rows)], axis=1)
    products = (carriers[:, :, None] * over[:, None, :]).reshape(len(e), -1)
    return np.concatenate([carriers, products], axis=1) / 2.0


def _functions(x: Array, rows: NDArray[np.intp]) -> list[Array]:
    """A slope, and a bump at either end, of one signal."""
    x = np.nan_to_num(x, nan=float(np.nanmedian(x[rows])) if np.isfinite(x[rows]).any() else 0.0)
    low, middle, high = np.quantile(x[rows], [0.1, 0.5, 0.9])
    width = max(high - low, 1e-6) / 2.0
    made = [np.tanh((x - middle) / width), *(np.exp(-(((x - end) / width) ** 2)) for end in (low, high))]
    return [f - f[rows].mean() for f in made]


@dataclass(frozen=True)
class Part:
    """A kernel in a sum of them: its place among the kernels, and its size."""

    place: int
    size: float


class KernelEvidence:
    """Log evidence of sums of kernels beside sensors and held parameters, under the noise of a
    model."""

    def __init__(self, search: Search, model: Model) -> None:
        self.kernels = kernels(search)
        X, prior, _ = search.design(search.model((), frozenset()))
        blocks = [X * prior.sd, *(k.features for k in self.kernels)]
        ends = np.cumsum([b.shape[1] for b in blocks])
        self._of = [np.arange(end - b.shape[1], end) for end, b in zip(ends, blocks, strict=True)]
        rows, fit = search.rows, model.fit
        weight = np.sqrt((TAIL + 1) / (TAIL + fit.innovations[rows] ** 2))
        weight /= search.series.relative[rows] * fit.sigma
        A = whiten(np.concatenate(blocks, axis=1), fit.ar, rows, weight)
        y = whiten(search.series.y - X @ prior.mean, fit.ar, rows, weight)
        self._gram, self._onto = A.T @ A, A.T @ y
        self._signed = [_where_signed(k, rows) for k in self.kernels]
        self._torque = search.torque

    def _columns(self, parts: Sequence[Part]) -> tuple[NDArray[np.intp], Array]:
        """Places of the features of some parts, after those of sensors; and what each is multiplied by."""
        places = [self._of[0], *(self._of[1 + p.place] for p in parts)]
        scale = [np.ones(len(places[0])), *(np.full(len(self._of[1 + p.place]), p.size) for p in parts)]
        return np.concatenate(places), np.concatenate(scale)

    def _posterior(self, parts: Sequence[Part]) -> tuple[Array, Array]:
        """The Cholesky factor of the precision of the coefficients, and what they are pulled by."""
        at, scale = self._columns(parts)
        precision = self._gram[np.ix_(at, at)] * np.outer(scale, scale)
        precision[np.diag_indices_from(precision)] += 1.0
        return np.linalg.cholesky(precision), self._onto[at] * scale

    def evidence(self, parts: Sequence[Part]) -> float:
        """Nats, beside noise alone."""
        root, pull = self._posterior(parts)
        white = solve_triangular(root, pull, lower=True, check_finite=False)
        return float(0.5 * white @ white - np.log(np.diag(root)).sum())

    def sign(self, parts: Sequence[Part]) -> float:
        """Nats that the sign of the last part is worth: the share of its posterior that has it, by the rows
        where it acts, for as many directions as the data tell."""
        last = parts[-1]
        signed = self._signed[last.place]
        if signed is None:
            return 0.0
        root, pull = self._posterior(parts)
        own = len(self._of[1 + last.place])
        covariance = cho_solve((root, True), np.eye(len(pull)))
        mean, covariance = (covariance @ pull)[-own:], covariance[-own:, -own:]
        features = signed * last.size
        sd = np.sqrt(np.einsum("ij,jk,ik->i", features, covariance, features)) + 1e-9
        told = max(own - float(np.trace(covariance)), 1.0)
        return told * float(np.mean(log_ndtr(features @ mean / sd) - math.log(0.5)))

    def names(self, beside: Sequence[str]) -> dict[str, float]:
        """Nats by which each name explains what the names `beside` it do not; its prior is in it."""
        given = self._given(beside)
        nothing = self.evidence(given)
        found: dict[str, list[float]] = {}
        for place, kernel in enumerate(self.kernels):
            if kernel.name not in beside:
                found.setdefault(kernel.name, []).append(self._gain(given, place) - nothing)
        return {name: float(logsumexp(nats)) for name, nats in found.items()}

    def _given(self, names: Sequence[str]) -> list[Part]:
        """The kernel of each name, and its size, that explain most beside those before it."""
        given: list[Part] = []
        for name in names:
            own = [Part(i, s) for i, k in enumerate(self.kernels) if k.name == name for s in SIZES]
            nats = [self.evidence([*given, part]) for part in own]
            given += [own[int(np.argmax(nats))]] if own else []
        return given

    def _gain(self, given: list[Part], place: int) -> float:
        """Log evidence of one more kernel, of whatever size, with its sign and its prior."""
        nats = [self.evidence([*given, Part(place, size)]) for size in SIZES]
        best = Part(place, SIZES[int(np.argmax(nats))])
        chance = math.log(self.kernels[place].chance)
        told = self.sign([*given, best]) + self._reported([*given, best])
        return float(logsumexp(nats)) - math.log(len(SIZES)) + told + chance

    def _reported(self, parts: Sequence[Part]) -> float:
        """Nats by which the engine's recorded torque speaks for the force of the last part."""
        last = parts[-1]
        kernel = self.kernels[last.place]
        if self._torque is None or not kernel.reported:
            return 0.0
        root, pull = self._posterior(parts)
        mean = cho_solve((root, True), pull)[-kernel.features.shape[1] :]
        return self._torque.gain(kernel.features @ mean * last.size, kernel.reported)


def _where_signed(kernel: Kernel, rows: NDArray[np.intp]) -> Array | None:
    """Features (m, k) at some rows where the name acts, times the sign that its force has there."""
    if kernel.sign is None:
        return None
    size = np.abs(kernel.sign[rows])
    acting = rows[size > ACTING * np.quantile(size, 0.98)]
    if len(acting) < FEW_ROWS:
        return None
    some = acting[np.linspace(0, len(acting) - 1, SIGNED_ROWS).astype(int)]
    out: Array = np.sign(kernel.sign[some])[:, None] * kernel.features[some]
    return out


def weighed(search: Search, found: Explanation) -> Explanation:
    """The explanation, each name of missing physics weighed against all others by their kernels too.

    Beside a learned simulator names are as they were: its model discrepancy is like any kernel.
    """
    physics = [c for c in found.causes if c.kind == "missing_physics" and c.needed is None]
    if not physics or search.e.model_discrepancy > 0.0:
        return found
    by = KernelEvidence(search, found.model)
    others = {id(c): [o.effect for o in found.causes if o is not c and o.effect != c.effect] for c in physics}
    told = {id(c): replace(c, kernels=tuple(by.names(others[id(c)]).items())) for c in physics}
    return replace(found, causes=tuple(told.get(id(c), c) for c in found.causes))
