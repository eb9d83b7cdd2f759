"""A name as a kernel, which covers all forces that its physics permits and not only its best candidate term.

A name's kernel is the prior covariance of its force, averaged over its candidate terms: it permits any
mixture of them, so that a law between two of the library's forms loses little (a Gaussian process in a
truncated basis). No law is exact: its force times smooth functions of common signals belongs to the name too,
a model discrepancy (Kennedy and O'Hagan, J. R. Stat. Soc. B 63, 2001) in proportion to what the name does.
What a law leaves of its own force thus needs no second name.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from deeptruck_core.arrays import Array
from deeptruck_model.mismatch.mechanisms import CandidateTerm, Mechanism, candidate_terms
from deeptruck_model.mismatch.posterior.regression import FREE, Regression
from deeptruck_model.mismatch.rules import Limits

UNKNOWN = "unknown"
LAW, WITH_ERROR, IN_TIME, WITHIN, UNNAMED = 16, 32, 48, 5, 40  # leading directions kept of a kernel
LAWS, VARYING, IN_EVENTS, PARAMETER = "law", "in time", "in events", "parameter"  # parts of a name's forces
FORCES = ("brakes", "engine_driveline", "air_tyres_road")  # families whose laws are off in proportion
LEADING = 5  # directions of a law that may be off
OFF = 0.3  # prior sd of the factor by which they are
CARRIERS = {
    "engine": 0.15,
    "brake": 0.15,
    "drag": 0.5,
    "simulated": 0.1,
}  # share of each that no name explains
ALL_THE_TIME = 0.05  # m/s^2, and a force that acts always
STATES = ("speed", "grade", "engine", "elapsed", "ratio")  # whose functions times its force a law is off by
VARIABLES = (*STATES, "brake")  # of which the shares are functions
CHUNK = 4096  # rows that are multiplied at once
TINY = 1e-7  # of the largest power: a direction that has less is rounding


@dataclass(frozen=True)
class Kernel:
    """The features (n, k) of a name, in m/s^2, whose coefficients are N(0, 1). `sign` (n,) is a typical force
    of a name whose force can have no other sign; `chance` a factor on the name's prior odds."""

    name: str
    features: Array
    sign: Array | None = None
    chance: float = 1.0
    part: str = LAWS  # which of the name's forces it holds: its laws, those not always there, a parameter's


_made: WeakKeyDictionary[Regression, tuple[Kernel, ...]] = (
    WeakKeyDictionary()
)  # no longer than the regression


def kernels(regression: Regression) -> tuple[Kernel, ...]:
    """Kernels of every name in the library, of the nonparametric term and of every parameter;
    computed once."""
    if regression not in _made:
        _made[regression] = _kernels(regression)
    return _made[regression]


def without(regression: Regression, rows: NDArray[np.bool_]) -> Regression:
    """The same regression with the same kernels, but without some rows (n,)."""
    other = regression.without(rows)
    _made[other] = kernels(regression)
    return other


def within(k: Kernel, rows: NDArray[np.bool_], regression: Regression) -> Kernel:
    """A kernel that acts in some rows (n,) alone."""
    features = _thin(np.where(rows[:, None], k.features, 0.0), regression, WITHIN)
    return replace(k, features=features, sign=None if k.sign is None else np.where(rows, k.sign, 0.0))


def narrow(
    regression: Regression,
    features: Mapping[str, Array],
    terms: Mapping[str, tuple[CandidateTerm, ...]],
    coarse: float,
) -> Regression:
    """The same regression, whose kernels of the laws of some names are `features` (n, k) and the kernel as it
    was at the prior `coarse`; the fitted `terms` are candidate terms of their mechanisms."""
    other = copy(regression)
    other.fitted, other._candidate_terms = dict(terms), {}
    off = _factors(regression)
    made: list[Kernel] = []
    for k in kernels(regression):
        if k.name in features and k.part == LAWS:
            law = replace(k, features=np.concatenate([features[k.name], k.features * coarse], axis=1))
            own = next(m for m in regression.library if m.effect == k.name)
            law = replace(law, features=_thin(law.features, regression, WITH_ERROR))
            k = _with_error(regression, law, own, off)
        made.append(k)
    _made[other] = tuple(made)
    return other


def _kernels(regression: Regression) -> tuple[Kernel, ...]:
    off = _factors(regression)
    found = [
        k for m in regression.library for k in _of_terms(regression, candidate_terms(m, regression.e), off)
    ]
    unknown = Kernel(UNKNOWN, _thin(_anything(regression), regression, UNNAMED), chance=Limits.nameless)
    sensitivity = {p: regression.e.sensitivity[p][:, None] * FREE[p] for p in regression.parameters}
    return (*found, unknown, *(Kernel(p, x, part=PARAMETER) for p, x in sensitivity.items()))


def _of_terms(regression: Regression, terms: Sequence[CandidateTerm], off: Array) -> list[Kernel]:
    """One kernel of a name's constant terms with their error, and one of its terms that vary in time; terms
    may be in any order, `off` is that of `_factors`."""
    terms = sorted(terms, key=lambda t: repr(t.variants))
    laws = [t for t in terms if not t.varies_in_time]
    varying = [t for t in terms if t.varies_in_time]
    out = []
    if laws:
        out.append(_with_error(regression, _kernel(regression, laws, LAW), laws[0].mechanism, off))
    if varying:
        own = _kernel(regression, varying, IN_TIME)
        out.append(replace(own, chance=own.chance * Limits.not_always, part=VARYING))
    return out


def _factors(regression: Regression) -> Array:
    """Functions (n, f) of common signals, by whose sum times OFF a law may be off."""
    off = np.stack(_functions_of(STATES, regression), axis=1)
    off *= OFF / np.sqrt(np.mean(np.sum(off[regression.rows] ** 2, axis=1)))
    return off.astype(np.float32)


def _with_error(regression: Regression, law: Kernel, m: Mechanism, off: Array) -> Kernel:
    """The kernel of a law, and its leading directions times the factors `off`. Beside a learned simulator
    laws alone are compared, because its own errors have such shapes too."""
    if m.family not in FORCES or regression.e.model_discrepancy != 0:
        return law
    products = law.features[:, :LEADING, None] * off[:, None, :]
    both = np.concatenate([law.features, products.reshape(len(off), -1)], axis=1)
    return replace(law, features=_thin(both, regression, WITH_ERROR))


def _kernel(regression: Regression, terms: Sequence[CandidateTerm], most: int) -> Kernel:
    # of the same columns, which several terms have at other sizes
    power: dict[int, Array] = {}
    first: dict[int, CandidateTerm] = {}
    typical = np.zeros(len(regression.e))
    for t in terms:
        key = id(t.columns)
        first.setdefault(key, t)
        power[key] = power.get(key, 0.0) + (t.prior.sd**2 + t.prior.mean**2) / len(terms)
        typical += t.columns.sum(axis=1)
    ends = np.cumsum([t.columns.shape[1] for t in first.values()])
    features = np.empty((len(regression.e), ends[-1]), dtype=np.float32)
    for end, (key, t) in zip(ends, first.items(), strict=True):
        features[:, end - t.columns.shape[1] : end] = t.columns * np.sqrt(power[key])
    signed = all((t.prior.sign > 0).all() for t in terms)
    mechanism = terms[0].mechanism
    sign = typical if signed else None
    return Kernel(mechanism.effect, _thin(features, regression, most), sign, mechanism.chance(regression.e))


def _thin(features: NDArray[Any], regression: Regression, most: int) -> NDArray[Any]:
    """The leading directions of a kernel over the rows that count, (n, at most `most`), in single precision:
    of hours of driving they need the most memory by far."""
    gram = np.zeros((features.shape[1], features.shape[1]))
    for begin in range(0, len(regression.rows), CHUNK):
        part = features[regression.rows[begin : begin + CHUNK]].astype(np.float64)
        gram += part.T @ part
    power, directions = np.linalg.eigh(gram)
    kept = np.argsort(power)[::-1][:most]
    kept = kept[power[kept] > TINY * power.max(initial=0.0)]
    out = np.empty((len(features), len(kept)), dtype=np.float32)
    for begin in range(0, len(features), CHUNK):
        out[begin : begin + CHUNK] = features[begin : begin + CHUNK] @ directions[:, kept]
    return out


def _anything(regression: Regression) -> Array:
    """Shares of the known forces that are smooth functions of common signals, as no single name has them."""
    e = regression.e
    known = [np.nan_to_num(e[n]) * share for n, share in CARRIERS.items() if n in e.signals]
    carriers = np.stack([np.full(len(e), ALL_THE_TIME), *known], axis=1)
    over = np.stack(_functions_of(VARIABLES, regression), axis=1)
    products = (carriers[:, :, None] * over[:, None, :]).reshape(len(e), -1)
    out = np.concatenate([carriers, products], axis=1) / 2.0
    if regression.parameters:  # whose forces have names
        own = np.nan_to_num(np.stack([e.sensitivity[p] for p in regression.parameters], axis=1))
        out -= own @ np.linalg.lstsq(own[regression.rows], out[regression.rows], rcond=None)[0]
    return out


def _functions_of(names: Sequence[str], regression: Regression) -> list[Array]:
    return [
        f for n in names if n in regression.e.signals for f in _functions(regression.e[n], regression.rows)
    ]


def _functions(x: Array, rows: NDArray[np.intp]) -> list[Array]:
    """A linear function of one signal, and a bump at each end of its range."""
    x = np.nan_to_num(x, nan=float(np.nanmedian(x[rows])) if np.isfinite(x[rows]).any() else 0.0)
    low, middle, high = np.quantile(x[rows], [0.1, 0.5, 0.9])
    width = max(high - low, 1e-6) / 2.0
    made = [np.tanh((x - middle) / width), *(np.exp(-(((x - end) / width) ** 2)) for end in (low, high))]
    return [f - f[rows].mean() for f in made]
