"""Laws with fitted constants: the kernels of names in doubt, narrowed about the constants that fit best.

A kernel that averages over a grid of constants holds only a part of what a law explains whose constants lie
between, and the rest decides between names. So for every name that may act in the place of a block that does,
the constants of its best forms are fitted, beside what else acts and alone; its kernel becomes the columns at
these constants, their derivatives by the constants (a linearised posterior of these), and the coarse kernel
at a lower prior, for what no form has. Columns alone are evaluated, and no simulator is run.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.linalg import solve_triangular
from scipy.optimize import minimize

from deeptruck_core.arrays import Array
from deeptruck_model.mismatch.mechanisms import CandidateTerm, Mechanism, candidate_term, every_variant
from deeptruck_model.mismatch.mechanisms.record import Form, Variant
from deeptruck_model.mismatch.posterior.kernels import PARAMETER, UNKNOWN, narrow
from deeptruck_model.mismatch.posterior.posterior import NO_NAME, Posterior, weights
from deeptruck_model.mismatch.posterior.regression import Regression
from deeptruck_model.mismatch.posterior.sampler import OUT, SIZES, State, gains_of, most_probable
from deeptruck_model.mismatch.residual.noise import whiten

IN_PLACE = 0.5  # of a block's gain, from which on a name may act in its place
MOST_NAMES = 12  # that are fitted, those that gain most
FORMS = 2  # of a name that are fitted
LEAST_GAIN = 3.0  # nats, of a form that is fitted
EVALUATIONS = 20  # of one form's columns
REACH = 2.0  # sds of a constant's log-normal prior between its middle and either limit
STEP, WIDE = 0.1, 0.5  # sds of that prior: of a numerical derivative; over which it is linear
COARSE = 0.5  # prior sd of the coarse kernel, which has what no form has, over its own


@dataclass(frozen=True)
class Beside:
    """The whitened residual y (m,) and columns (m, c) of what else acts, with unit prior variance."""

    regression: Regression
    ar: Array
    weight: Array
    y: Array
    X: Array
    root: Array = field(init=False)  # of the precision (c, c) of their coefficients
    onto: Array = field(init=False)

    @classmethod
    def of(cls, p: Posterior, state: State) -> Beside:
        """Beside the blocks of a state."""
        rows, weight = p.regression.rows, weights(p.regression, p.noise)
        acting = [k.features * SIZES[s] for k, s in zip(p.of, state, strict=True) if s != OUT]
        X = np.concatenate([p.always, *acting], axis=1)
        y = p.regression.series.y - p.mean
        white = [whiten(np.nan_to_num(x), p.noise.ar, rows, weight) for x in (y, X)]
        return cls(p.regression, p.noise.ar, weight, *white)

    def __post_init__(self) -> None:
        root = np.linalg.cholesky(np.eye(self.X.shape[1]) + self.X.T @ self.X)
        object.__setattr__(self, "root", root)
        object.__setattr__(self, "onto", solve_triangular(root, self.X.T @ self.y, lower=True))

    def and_(self, columns: Array) -> Beside:
        """Beside further columns (n, k) too."""
        more = whiten(columns, self.ar, self.regression.rows, self.weight)
        return replace(self, X=np.concatenate([self.X, more], axis=1))

    def products(self, columns: Array) -> tuple[Array, Array]:
        """Inner products (k, k) of columns (n, k), and of these with the residual, beside what else acts."""
        white = whiten(columns, self.ar, self.regression.rows, self.weight)
        across = solve_triangular(self.root, self.X.T @ white, lower=True)
        return white.T @ white - across.T @ across, white.T @ self.y - across.T @ self.onto


def narrowed(p: Posterior) -> Regression:
    """The regression of a posterior with the kernels of names in doubt narrowed about fitted constants, which
    are candidate terms of their mechanisms from then on. That of a learned simulator stays: its own errors,
    with which gains are compared, have no fitted laws."""
    if not p.regression.e.known_physics:
        return p.regression
    beside: dict[State, Beside] = {}
    found: dict[str, list[_Fitted]] = {}
    by_effect = {m.effect: m for m in p.regression.library}
    for name, company in _in_doubt(p):
        for state in dict.fromkeys((company, _without_names(p, company))):
            if state not in beside:
                beside[state] = Beside.of(p, state)
            found.setdefault(name, []).extend(_fits(beside[state], by_effect[name]))
    features = {n: np.concatenate([f.columns for f in fits], axis=1) for n, fits in found.items() if fits}
    terms = {name: tuple(f.term for f in fits) for name, fits in found.items()}
    return narrow(p.regression, features, terms, COARSE)


def _without_names(p: Posterior, state: State) -> State:
    """A state without the blocks of mechanisms."""
    other = [k.name in (*NO_NAME, UNKNOWN) or k.part == PARAMETER for k in p.of]
    return tuple(s if keep else OUT for keep, s in zip(other, state, strict=True))


def _in_doubt(p: Posterior) -> list[tuple[str, State]]:
    """Names that may act in the place of a block of the most probable state, those that gain most of what it
    does first, each with what else is in."""
    r, unit = p.draws.space, p.draws.unit
    state, _ = most_probable(r, unit, r.log_odds)
    library = {m.effect for m in p.regression.library}
    best: dict[str, tuple[float, State]] = {}
    for j in [j for j, s in enumerate(state) if s != OUT]:
        company = (*state[:j], OUT, *state[j + 1 :])
        gain = r.table(company).max(axis=1)
        share = gain / max(float(gain[j]), 1.0)
        for k, kernel in enumerate(p.of):
            likely = kernel.name in library and share[k] >= IN_PLACE
            if likely and share[k] > best.get(kernel.name, (0.0, state))[0]:
                best[kernel.name] = (float(share[k]), company)
    order = sorted(best, key=lambda name: -best[name][0])
    return [(name, best[name][1]) for name in order[:MOST_NAMES]]


@dataclass(frozen=True)
class _Fitted:
    """A form at fitted constants: its term, and its columns and their derivatives by the constants (n, k)."""

    term: CandidateTerm
    columns: Array


def _fits(beside: Beside, m: Mechanism) -> list[_Fitted]:
    """The forms of a mechanism that gain most, each beside those before it, at constants that fit best."""
    starts = [
        (v, form, _columns(beside, m, v))
        for v in every_variant(m, beside.regression.e)
        if isinstance(form := m.forms[v.form], Form) and not v.course.varies_in_time
    ]
    out: list[_Fitted] = []
    while starts and len(out) < FORMS:
        gains = [_gain(beside, columns) for _, _, columns in starts]
        if max(gains) < LEAST_GAIN:
            break
        v, form, _ = starts[int(np.argmax(gains))]
        out.append(_fit(beside, m, v, form.fitted))
        beside = beside.and_(out[-1].columns)
    return out


def _fit(beside: Beside, m: Mechanism, v: Variant, limits: Mapping[str, tuple[float, float]]) -> _Fitted:
    """A form at the constants of largest posterior probability within `limits`, from those of a variant."""
    names = list(limits)
    middle = np.array([0.5 * np.log(limits[n][0] * limits[n][1]) for n in names])
    sd = np.array([0.5 * np.log(limits[n][1] / limits[n][0]) / REACH for n in names])

    def at(z: Array) -> Variant:
        values = sign * np.exp(middle + sd * np.clip(z, -REACH, REACH))
        fitted = dict(zip(names, values.tolist(), strict=True))
        return replace(v, constants=tuple((dict(v.constants) | fitted).items()))

    def cost(z: Array) -> float:
        return 0.5 * float(z @ z) - _gain(beside, _columns(beside, m, at(z)))

    given = np.array([dict(v.constants)[n] for n in names])
    sign = np.sign(given)
    start = np.clip((np.log(np.abs(given)) - middle) / sd, -REACH, REACH)
    simplex = np.stack(
        [start, *(start + 0.4 * np.where(start > 0, -1.0, 1.0) * row for row in np.eye(len(start)))]
    )
    options = {"initial_simplex": simplex, "maxfev": EVALUATIONS, "fatol": 0.5, "xatol": 0.02}
    z = (
        np.clip(minimize(cost, start, method="Nelder-Mead", options=options).x, -REACH, REACH)
        if names
        else start
    )
    columns = _columns(beside, m, at(z))
    inner, pull = beside.products(columns)
    b = np.linalg.solve(inner + np.eye(len(inner)), pull)
    inwards = np.where(z < 0.0, STEP, -STEP)
    sides = [_columns(beside, m, at(z + step)) for step in np.diag(inwards)]
    slopes = [(side - columns) @ b * (WIDE / STEP) for side in sides]
    return _Fitted(candidate_term(m, at(z), beside.regression.e), np.stack([*columns.T, *slopes], axis=1))


def _columns(beside: Beside, m: Mechanism, v: Variant) -> Array:
    """Columns (n, k) of a variant with unit prior variance."""
    term = candidate_term(m, v, beside.regression.e)
    return term.columns * np.hypot(term.prior.sd, term.prior.mean)


def _gain(beside: Beside, columns: Array) -> float:
    return float(gains_of(*beside.products(columns)).max())
