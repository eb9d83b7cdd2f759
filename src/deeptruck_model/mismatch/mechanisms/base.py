"""What a mechanism is: a piece of physics by the way it acts, not by one formula.

A mechanism says which signals drive it, in which direction it can only act, and how large it can be. It
offers a few variants with constants (time constants, thresholds, knots: whatever enters nonlinearly) from
which `build` makes columns in m/s^2 per unit coefficient, each with a prior and perhaps a sign. Variants are
chosen by evidence, coefficients are fitted.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.mismatch.expression import (
    Expression,
    Rerun,
    Signal,
    rows_of,
)
from deeptruck_model.mismatch.mechanisms.own_forms import OWN, SIZE, curve, curves
from deeptruck_model.mismatch.mechanisms.variants import (
    OwnCurve,
    Simple,
    Sum,
    Variant,
)
from deeptruck_model.mismatch.residual.effective_mass import with_effective_mass
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.residual.noise import Prior

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Column:
    """One coefficient: what it multiplies, its prior, and how it is reported (unit, factor into it)."""

    expression: Expression
    sd: float
    name: str
    unit: str = "1"
    factor: float = 1.0
    per_mass: bool = False  # the coefficient times the mass (kg) is in `unit`
    sign: int = 1  # +1: never negative; 0: free
    mean: float = 0.0
    course: tuple[tuple[str, float], ...] = ()  # of a piece of a curve: what it adds at each place, by name
    most: float = np.inf  # coefficient times factor: one that is significantly larger is none of this


@dataclass(frozen=True)
class Mechanism:
    """A named piece of physics.

    `needs` are the signals without which it cannot be tested; `depends_on` what it varies with, for people;
    `prior` is its prior probability relative to the others.
    """

    effect: str
    equation: str
    says: str
    needs: tuple[str, ...]
    depends_on: tuple[str, ...]
    source: str
    separated_by: str
    variants: Callable[[Evidence], Iterator[Variant]] = field(repr=False)
    build: Callable[[Simple], list[Column]] = field(repr=False)
    kind: str = "missing_physics"
    prior: float = 1.0
    force: bool = True  # its columns are forces per mass, and no errors of a sensor
    unlikely_with: str = ""  # a recorded signal that makes this a fifth as likely: it would show there

    def chance(self, e: Evidence) -> float:
        """Prior probability relative to the other mechanisms, given which signals were recorded."""
        return self.prior * (0.2 if self.unlikely_with and e.has(self.unlikely_with) else 1.0)


@dataclass(frozen=True)
class CandidateTerm:
    """A variant of a mechanism, evaluated: columns (n, k) and their prior."""

    mechanism: Mechanism
    variant: Variant
    parts: tuple[Column, ...]
    columns: Array
    prior: Prior
    trials: float  # how many alternatives it was picked from; paid for in evidence


def build(mechanism: Mechanism, variant: Variant) -> list[Column]:
    """The columns of a variant; those of a sum side by side."""
    columns = _forces(mechanism, variant)
    return (
        [replace(c, expression=_with_effective_mass(c.expression)) for c in columns]
        if mechanism.force
        else columns
    )


def _forces(mechanism: Mechanism, variant: Variant) -> list[Column]:
    match variant:
        case Sum(summands):
            return [c for part in summands for c in _forces(mechanism, part)]
        case OwnCurve():
            return _own_columns(mechanism.effect, variant)
        case Simple():
            return mechanism.build(variant)
    raise TypeError(f"{variant!r} is no variant of a term")


def _with_effective_mass(force: Expression) -> Expression:
    """The acceleration a force gives; what the simulator itself was asked for is one already."""
    return force if _asked(force) else with_effective_mass(force)


def _asked(x: Expression) -> bool:
    of_simulator = isinstance(x, Signal) and x.name.startswith("sensitivity:")
    return of_simulator or isinstance(x, Rerun) or any(_asked(part) for part in x.inputs)


def _own_columns(effect: str, own: OwnCurve) -> list[Column]:
    """The pieces of a curve of `own_forms`."""
    form = OWN[effect][own.index]
    names = [f"at {form.by} {x:.3g}" for x in own.at]
    return [
        Column(
            (form.carrier * (1.0 / own.scale)) * piece,
            form.sd if form.share else SIZE,
            names[0],
            "1" if form.share else "N",
            per_mass=not form.share,
            course=tuple(zip(names, values, strict=True)),
        )
        for piece, values in curve(form, own.at)
    ]


def is_time_varying(term: CandidateTerm) -> bool:
    """Whether a candidate term has knots in time or along the road, and so can follow any slow force."""
    return term.variant.varies_in_time


def merge(first: CandidateTerm, other: CandidateTerm) -> CandidateTerm:
    """One term with the columns of both: a mechanism's true form may lie between two of its terms.

    What is added starts from zero, not from the mean its own candidate term had.
    """
    prior = Prior(
        np.zeros_like(other.prior.mean), other.prior.sd + abs(other.prior.mean) / 2, other.prior.sign
    )
    return CandidateTerm(
        first.mechanism,
        Sum((*first.variant.parts, other.variant)),
        first.parts + other.parts,
        np.concatenate([first.columns, other.columns], axis=1),
        Prior.join(first.prior, prior),
        first.trials * other.trials,
    )


def every_variant(mechanism: Mechanism, e: Evidence) -> Iterator[Variant]:
    """The textbook's forms of a mechanism, and what other courses its own variables may give it."""
    return itertools.chain(mechanism.variants(e), curves(mechanism.effect, e))


def candidate_terms(mechanism: Mechanism, e: Evidence) -> list[CandidateTerm]:
    """Every candidate term of a mechanism on this evidence that is not zero throughout."""
    made = [candidate_term(mechanism, variant, e) for variant in every_variant(mechanism, e)]
    made = [s for s in made if np.abs(s.columns[e.valid]).max(initial=0.0) > 1e-6]
    count = distinct(made, e)
    return [replace(s, trials=s.trials * count) for s in made]


def distinct(made: Sequence[CandidateTerm], e: Evidence) -> float:
    """How many different forces the terms of a mechanism are: each is an alternative, and is paid for.

    Many that are nearly alike are one: the exponential of the entropy of the eigenvalues of how they
    correlate (the effective rank of Roy and Vetterli, EUSIPCO 2007), over every fifth row.
    """
    if len(made) < 2:
        return 1.0
    rows = np.flatnonzero(e.valid)[::5]
    forces = np.stack([s.columns[rows] @ (np.abs(s.prior.mean) + s.prior.sd) for s in made])
    forces /= np.linalg.norm(forces, axis=1, keepdims=True) + 1e-12
    share = np.maximum(np.linalg.eigvalsh(forces @ forces.T) / len(made), 1e-12)
    return float(np.exp(-np.sum(share * np.log(share))))


def candidate_term(mechanism: Mechanism, variant: Variant, e: Evidence) -> CandidateTerm:
    """One candidate term of a mechanism on this evidence."""
    parts = build(mechanism, variant)
    columns = np.stack(rows_of([p.expression for p in parts], e), axis=1)
    prior = Prior(*(np.array([getattr(p, f) for p in parts], dtype=float) for f in ("mean", "sd", "sign")))
    return CandidateTerm(mechanism, variant, tuple(parts), columns, prior, variant.trials)


def overall_ratio_reference(e: Evidence) -> float:
    """Median overall ratio (rad/m) while driving, so that columns in engine terms stay of order one."""
    if "ratio" not in e.signals:
        return 1.0
    ratio = e["ratio"][e.valid & np.isfinite(e["ratio"])]
    return max(float(np.median(ratio)), 1e-3) if len(ratio) else 1.0


def quantile(e: Evidence, x: Array, where: NDArray[np.bool_], q: float) -> float:
    """A quantile of x over valid rows that satisfy `where`; infinite when there are too few."""
    rows = e.valid & where & np.isfinite(x)
    return float(np.quantile(x[rows], q)) if rows.sum() > 50 else float("inf")
