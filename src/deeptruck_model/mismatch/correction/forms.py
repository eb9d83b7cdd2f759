"""Forms of mechanisms that stand for forces of the draws: findings state them, and a correction adds them.

A kernel permits any mixture of a mechanism's forms; a truck needs a few of them, which run step by step.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Iterator, Sequence, Set
from dataclasses import dataclass, replace

import numpy as np

from deeptruck_core.arrays import Array, Indices
from deeptruck_model.mismatch.mechanisms import CandidateTerm, candidate_term, confined, merge
from deeptruck_model.mismatch.mechanisms.courses import ALWAYS, Where, conditions
from deeptruck_model.mismatch.mechanisms.families import UNKNOWN
from deeptruck_model.mismatch.mechanisms.record import Mechanism
from deeptruck_model.mismatch.posterior.names import Named
from deeptruck_model.mismatch.posterior.posterior import Posterior
from deeptruck_model.mismatch.posterior.regression import Regression
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.residual.noise import Prior
from deeptruck_model.mismatch.rules import Limits

SIZE_SD = 0.3  # relative, at least, by which sizes may differ from the mean of the draws


@dataclass(frozen=True)
class NamedForce:
    """The force of one name in the draws, as forms that apply to any drive: a `term` whose prior has the mean
    sizes of the draws."""

    term: CandidateTerm

    def factor(self, sizes: Array) -> float:
        """How much larger the force is with these sizes (k,) than in the draws."""
        columns = self.term.columns
        drawn = columns @ self.term.prior.mean
        return float(drawn @ (columns @ sizes)) / max(float(drawn @ drawn), 1e-12)


def named_forces(p: Posterior, found: Sequence[Named], e: Evidence) -> dict[str, NamedForce]:
    """The force of each accepted name that forms carry to other drives, on evidence `e`; none of what is a
    parameter, or specific to one drive, time or place."""
    library = {m.effect: m for m in p.regression.library}
    out = {}
    for named in found:
        name = named.name
        if not (named.accepted and named.lasts and name in library) or p.is_parameter(name):
            continue
        force = named.force
        options = _options(p, library[name], force, general=True)
        if not options:
            continue
        term = functools.reduce(merge, _forms(p.regression, options, force))
        drawn = p.on_columns(name, term.columns, named.given)
        sizes, rows = drawn.mean(axis=0), p.regression.rows
        left = force[rows] - term.columns[rows] @ sizes
        if float(left @ left) <= (1.0 - Limits.least_carried) * float(force[rows] @ force[rows]):
            sd = np.maximum(drawn.std(axis=0), SIZE_SD * np.abs(sizes)) + 1e-9
            prior = Prior(sizes, sd, term.prior.sign)
            out[name] = NamedForce(replace(anew(term, e), prior=prior))
    return out


def nameless_terms(p: Posterior, stated: Set[str], e: Evidence) -> list[CandidateTerm]:
    """Forms of mechanisms, on evidence `e`, that add up to what may act beside the `stated` names: rivals of
    these, and what follows no mechanism."""
    picked: list[CandidateTerm] = []
    library = [m for m in p.regression.library if m.effect not in stated]
    for m in library:
        if p.inside(m.effect).mean() >= Limits.least_in:
            force = p.force(m.effect, p.inside(m.effect))
            if options := _options(p, m, force, general=True):
                picked += _forms(p.regression, options, force)
    if p.inside(UNKNOWN).mean() >= Limits.least_in:
        force = p.force(UNKNOWN, p.inside(UNKNOWN))
        each = ([t for t in p.regression.candidate_terms(m) if t.general] for m in library)
        best = [t for own in each if own for t in _forms(p.regression, own, force)]
        known = {id(t) for t in picked}
        picked += [t for t in _forms(p.regression, best, force) if id(t) not in known] if best else []
    return [anew(t, e) for t in _by_mechanism(picked)]


def simplest_terms(p: Posterior, e: Evidence) -> list[CandidateTerm]:
    """For every mechanism that may act, the one form, perhaps of single drives, whose sizes a finding states,
    on evidence `e`."""
    picked = []
    for m in p.regression.library:
        if p.inside(m.effect).mean() >= Limits.least_in:
            force = p.force(m.effect, p.inside(m.effect))
            if options := _options(p, m, force, general=False):
                picked.append(_simplest(p.regression, options, force))
    return [anew(t, e) for t in picked]


def anew(term: CandidateTerm, e: Evidence) -> CandidateTerm:
    """A term on other evidence."""
    first, *others = (candidate_term(term.mechanism, v, e) for v in term.variants)
    return functools.reduce(merge, others, first)


def _by_mechanism(picked: Sequence[CandidateTerm]) -> Iterator[CandidateTerm]:
    """One term of each mechanism."""
    of: dict[str, list[CandidateTerm]] = {}
    for term in picked:
        of.setdefault(term.mechanism.effect, []).append(term)
    for terms in of.values():
        yield functools.reduce(merge, terms)


def _options(p: Posterior, m: Mechanism, force: Array, *, general: bool) -> list[CandidateTerm]:
    """Candidate terms of a mechanism, or those alone that apply to any drive; where none of them is nearly
    its force (n,), each of its laws in every condition too. Beside a learned simulator there are no
    conditions, on which its own errors depend as well."""
    out = [t for t in p.regression.candidate_terms(m) if not general or t.general]
    if out and p.regression.e.model_discrepancy == 0:
        left, squares = _left(p.regression, out, force)
        if left.min() > Limits.simpler * squares:
            laws = [t for t in out if t.variants[0].course == ALWAYS and not t.reruns]
            out += [confined(t, where, p.regression.e) for t in laws for where in conditions(p.regression.e)]
    return out


def _left(regression: Regression, options: Sequence[CandidateTerm], force: Array) -> tuple[Array, float]:
    """Sums of squares (terms,) of a force (n,) that each term leaves, and its own."""
    gram, pull, squares, own = _products(regression, options, force)
    return np.array([squares - _explained(gram, pull, a) for a in own]), squares


def _simplest(regression: Regression, options: Sequence[CandidateTerm], force: Array) -> CandidateTerm:
    """The candidate term with the fewest coefficients, among those that explain a force (n,) nearly as well
    as the best one, and of these one that acts always and whose coefficients are nearest their prior;
    findings state its sizes."""
    gram, pull, squares, own = _products(regression, options, force)
    left = np.array([squares - _explained(gram, pull, a) for a in own])
    good = np.flatnonzero(left <= left.min() + Limits.simpler * squares)

    def far(k: int) -> tuple[bool, float]:
        off = (_solved(gram, pull, own[k]) - options[k].prior.mean) / np.maximum(options[k].prior.sd, 1e-12)
        return isinstance(options[k].variants[0].course, Where), float(off @ off)

    return options[min(good, key=lambda k: (len(own[k]), far(k)))]


def _products(
    regression: Regression, options: Sequence[CandidateTerm], force: Array
) -> tuple[Array, Array, float, list[Indices]]:
    """Inner products of all columns of some terms, and of these with a force (n,); the force's sum of
    squares; and the columns of each term."""
    rows = regression.rows
    widths = np.cumsum([0, *(t.columns.shape[1] for t in options)])
    X = np.concatenate([t.columns[rows] for t in options], axis=1)
    own = [np.arange(a, b) for a, b in itertools.pairwise(widths)]
    return X.T @ X, X.T @ force[rows], float(force[rows] @ force[rows]), own


def _forms(regression: Regression, options: Sequence[CandidateTerm], force: Array) -> list[CandidateTerm]:
    """The few candidate terms that together explain most of a force (n,), by greedy selection."""
    gram, pull, squares, own = _products(regression, options, force)
    taken: list[int] = []
    left = squares
    while len(taken) < Limits.most_forms and left > Limits.form_left * squares:
        errors = [
            squares - _explained(gram, pull, np.concatenate([own[i] for i in (*taken, k)]))
            for k in range(len(own))
        ]
        best = int(np.argmin(errors))
        if errors[best] > (1.0 - Limits.form_left) * left:
            break
        taken.append(best)
        left = errors[best]
    return [options[k] for k in taken]


def _explained(gram: Array, pull: Array, at: Indices) -> float:
    """Explained sum of squares for some columns."""
    b = _solved(gram, pull, at)
    return float(2.0 * b @ pull[at] - b @ gram[np.ix_(at, at)] @ b)


def _solved(gram: Array, pull: Array, at: Indices) -> Array:
    """Coefficients of some columns, with a small ridge."""
    H = gram[np.ix_(at, at)]
    out: Array = np.linalg.solve(H + np.eye(len(H)) * (1e-6 * np.trace(H) / len(H) + 1e-12), pull[at])
    return out
