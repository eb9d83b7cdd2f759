"""Evaluates the records of mechanisms on recordings, as candidate terms."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from operator import mul
from typing import Any

import numpy as np

from deeptruck_core.arrays import Array
from deeptruck_model.mismatch.mechanisms.courses import ALWAYS, Course, EachDrive, FromMoment, Spline, Where
from deeptruck_model.mismatch.mechanisms.record import Column, Curve, Form, Mechanism, Variant
from deeptruck_model.mismatch.residual.effective_mass import with_effective_mass
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.residual.expression import Expression, Interpolated, Rerun, Signal, rows_of
from deeptruck_model.mismatch.residual.noise import Prior

ACTING = 0.1  # of the carrier's largest: where it says little no knot is worth having
NEAREST = 0.04  # of the whole way, between knots
LEAST_ROWS = 50
SIZE = 0.1  # m/s^2 sd of a force that is no share of another


@dataclass(frozen=True)
class CandidateTerm:
    """One or several variants of a mechanism, evaluated: columns (n, k) and their prior."""

    mechanism: Mechanism
    variants: tuple[Variant, ...]
    parts: tuple[Column, ...]
    columns: Array
    prior: Prior

    @property
    def varies_in_time(self) -> bool:
        """Whether it has knots in time or along the road, and can therefore represent any slow force."""
        return any(v.course.varies_in_time for v in self.variants)

    @property
    def general(self) -> bool:
        """Whether it has no coefficient that is specific to one drive or time."""
        return all(v.course.general for v in self.variants)

    @property
    def reruns(self) -> bool:
        """Whether it is the effect of changed commands, and no force."""
        return any(isinstance(part.expression, Rerun) for part in self.parts)

    def settings(self) -> Iterator[tuple[str, float, str]]:
        """Constants that a finding reports: name, value, unit."""
        for v in self.variants:
            form, values = self.mechanism.forms[v.form], dict(v.constants)
            if isinstance(form, Form):
                yield from ((name, values[name], unit) for name, unit in form.units.items())
            if isinstance(v.course, FromMoment):
                yield "after_s", v.course.after_s, "s"


def every_variant(mechanism: Mechanism, e: Evidence) -> Iterator[Variant]:
    """The variants of a mechanism that these recordings can show.

    Curves are omitted for a learned simulator, because its training errors also have the shape of curves.
    """
    for name, form in mechanism.forms.items():
        if isinstance(form, Form):
            for constants, course in form.tried(e):
                yield Variant(name, tuple(constants.items()), course)
        elif e.model_discrepancy == 0 and e.has(*form.needs) and (constants := _knots_of(form, e)):
            yield Variant(name, tuple(constants.items()))


def build(mechanism: Mechanism, variants: Sequence[Variant]) -> list[Column]:
    """The columns of several variants: the accelerations that their forces cause."""
    columns = [c for v in variants for c in _columns(mechanism.forms[v.form], v)]
    return [_with(c, _acceleration) for c in columns]


def _with(c: Column, change: Callable[[Expression], Expression]) -> Column:
    """A column with a linear change of its force."""
    exact = c.exact
    return replace(
        c,
        expression=change(c.expression),
        exact=None if exact is None else lambda size: change(exact(size)),
    )


def _acceleration(force: Expression) -> Expression:
    """The acceleration that a force causes; expressions of reruns and sensitivities are accelerations and
    stay as they are."""
    return force if _asked(force) else with_effective_mass(force)


def _asked(x: Expression) -> bool:
    of_simulator = isinstance(x, Signal) and x.name.startswith("sensitivity:")
    return of_simulator or isinstance(x, Rerun) or any(_asked(part) for part in x.inputs)


def _columns(form: Form | Curve, v: Variant) -> list[Column]:
    constants, course = dict(v.constants), v.course
    made = _of_curve(form, **constants) if isinstance(form, Curve) else form.made(constants)
    if course == ALWAYS:
        return made
    varying = [varied for c in made for varied in _varied(c, course)]
    if not isinstance(course, Spline) or isinstance(form, Curve):
        return varying
    if form.level is not None:
        each = EachDrive(course.names, 1.0 / len(course.names))
        return _varied(form.level(**constants), each) + varying
    return [replace(c, sd=2.0 * course.size) for c in made if form.steady] + varying


def _varied(c: Column, course: Course) -> list[Column]:
    """A column for each coefficient of a course."""
    return [
        replace(_with(c, partial(mul, factor)), name=c.name + suffix, sd=course.sd or c.sd)
        for suffix, factor in course.factors()
    ]


def _of_curve(curve: Curve, at: Sequence[float], scale: float) -> list[Column]:
    """The basis columns of a curve with knots `at`; `scale` is the carrier's rms, or one."""
    names = [f"at {curve.by} {x:.3g}" for x in at]
    return [
        Column(
            (curve.carrier * (1.0 / scale)) * piece,
            curve.sd if curve.share else SIZE,
            names[0],
            "1" if curve.share else "N",
            per_mass=not curve.share,
            course=tuple(zip(names, values, strict=True)),
        )
        for piece, values in pieces(curve, at)
    ]


def pieces(curve: Curve, at: Sequence[float]) -> Iterator[tuple[Expression, list[float]]]:
    """Basis functions of a curve, with coefficients that must not be negative, and the values of each at the
    knots."""
    values = np.eye(len(at)) if curve.trend == "any" else np.triu(np.ones((len(at), len(at))))
    if curve.trend == "falling":
        values = 1.0 - values + np.eye(len(at))
    for row in values:
        if curve.trend == "any" or curve.level or not row.all():
            yield Interpolated((curve.of,), tuple(at), tuple(row.tolist())), row.tolist()


def _knots_of(curve: Curve, e: Evidence) -> dict[str, Any]:
    """Knots and scale of a curve; empty if its carrier or its variable hardly varies."""
    carrier, x = np.abs(curve.carrier.rows(e)), curve.of.rows(e)
    acts = e.valid & (carrier > ACTING * float(np.quantile(carrier[e.valid], 0.98))) & (carrier > 0)
    if acts.sum() < LEAST_ROWS:
        return {}
    at = apart(knots(x[acts], curve.knots))
    scale = 1.0 if curve.share else float(np.sqrt(np.mean(carrier[acts] ** 2)))
    return {"at": at, "scale": scale} if len(at) > 1 else {}


def knots(x: Array, quantiles: tuple[float, ...]) -> Array:
    """Quantiles of x (n,); if most of x is at its limit, quantiles of the rest, and the limit."""
    limit = float(x.max())
    below = x[x < limit]
    if len(below) < LEAST_ROWS or len(below) > 0.5 * len(x):
        return np.asarray(np.quantile(x, quantiles))
    return np.append(np.quantile(below, quantiles), limit)


def apart(at: Array) -> tuple[float, ...]:
    """Ascending knots, without those too close to the one before, between which a curve would fit noise."""
    out = [float(at[0])]
    for x in at[1:]:
        if x - out[-1] > NEAREST * (at[-1] - at[0]):
            out.append(float(x))
    return tuple(out)


def merge(first: CandidateTerm, other: CandidateTerm) -> CandidateTerm:
    """One term with the columns of both: a mechanism's true form may lie between two candidate terms.

    The coefficients that are added have prior mean zero instead of that of their candidate term.
    """
    prior = Prior(
        np.zeros_like(other.prior.mean), other.prior.sd + abs(other.prior.mean) / 2, other.prior.sign
    )
    return CandidateTerm(
        first.mechanism,
        first.variants + other.variants,
        first.parts + other.parts,
        np.concatenate([first.columns, other.columns], axis=1),
        Prior.join(first.prior, prior),
    )


def candidate_terms(mechanism: Mechanism, e: Evidence) -> list[CandidateTerm]:
    """Every candidate term of a mechanism on this evidence, except those that are zero throughout. Terms that
    differ only in the size of their knots share their columns."""
    known: dict[Variant, Array] = {}
    made = []
    for v in every_variant(mechanism, e):
        course = replace(v.course, size=1.0) if isinstance(v.course, Spline) else v.course
        key = replace(v, course=course)
        made.append(candidate_term(mechanism, v, e, known.get(key)))
        known[key] = made[-1].columns
    return [s for s in made if np.abs(s.columns[e.valid]).max(initial=0.0) > 1e-6]


def candidate_term(
    mechanism: Mechanism, variant: Variant, e: Evidence, columns: Array | None = None
) -> CandidateTerm:
    """One candidate term of a mechanism on this evidence; its `columns` (n, k) where they are known."""
    parts = build(mechanism, (variant,))
    if columns is None:
        columns = np.stack(rows_of([p.expression for p in parts], e), axis=1)
    prior = Prior(*(np.array([getattr(p, f) for p in parts], dtype=float) for f in ("mean", "sd", "sign")))
    return CandidateTerm(mechanism, (variant,), tuple(parts), columns, prior)


def confined(term: CandidateTerm, where: Where, e: Evidence) -> CandidateTerm:
    """A term whose coefficients are constant, in one condition only."""
    factor = where.expression
    return replace(
        term,
        variants=tuple(replace(v, course=where) for v in term.variants),
        parts=tuple(replace(part, expression=part.expression * factor) for part in term.parts),
        columns=term.columns * factor.rows(e)[:, None],
    )
