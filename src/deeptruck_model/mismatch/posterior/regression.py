"""The linear model of the residual: terms beside the simulator's parameters and what sensors make of it.

A model is a set of terms beside the simulator's own parameters, which are either held (they may move by
HELD) or free (by the FREE share that is physically plausible). Log evidence is the sum of the log
probabilities with which each part of the data is predicted from the rest, so it ranks by prediction and
penalises every coefficient.
"""

from __future__ import annotations

from collections.abc import Iterable
from copy import copy
from dataclasses import dataclass, field, replace

import numpy as np

from deeptruck_core.arrays import Array, Mask
from deeptruck_model.mismatch.mechanisms import LIBRARY, CandidateTerm, Mechanism, candidate_terms
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.residual.noise import Fit, Prior, Series, fit
from deeptruck_model.mismatch.residual.timing import sensor_terms
from deeptruck_model.mismatch.rules import Rules

LARGEST_SLOPE = 0.75  # what four times the mass does
HELD = 0.01
FREE = {"mass": 0.3, "drag_area": 0.3, "rolling_resistance": 0.4, "torque_gain": 0.15, "brake_gain": 0.25}


@dataclass(frozen=True)
class Model:
    """A fitted explanation. `free`: simulator parameters that were fitted freely; `score`: evidence with
    priors, in nats."""

    named: tuple[CandidateTerm, ...]
    free: frozenset[str]
    fit: Fit
    score: float
    layout: tuple[tuple[str, slice], ...] = field(default=())
    rules: Rules = field(default_factory=Rules)
    mass_gain: float = 1.0  # of the mass that is accelerated, the share that does not turn

    @property
    def effects(self) -> tuple[str, ...]:
        return tuple(n.mechanism.effect for n in self.named)

    def coefficients(self, name: str) -> Array:
        """Posterior mean of the coefficients of an effect."""
        return self.fit.b[dict(self.layout)[name]]

    def change(self, parameter: str) -> float:
        """Relative change of a parameter from the simulator that was run."""
        return float(self.coefficients(f"parameter:{parameter}")[0])

    def change_sd(self, parameter: str) -> float:
        """Posterior sd of `change`."""
        return float(np.sqrt(self.covariance(f"parameter:{parameter}")[0, 0]))

    def moved(self, parameter: str) -> float:
        """Relative change of a parameter that has the same effect as the linear `change`."""
        return changed_by(parameter, self.change(parameter), self.mass_gain)

    def moved_sd(self, parameter: str) -> float:
        """Posterior sd of `moved`, to first order, and the error of the linearisation at that distance: half
        of the second-order term."""
        moved = self.moved(parameter)
        steeper = (1.0 + self.mass_gain * moved) ** 2 if parameter == "mass" else 1.0
        return float(np.hypot(steeper * self.change_sd(parameter), 0.5 * moved**2))

    def covariance(self, name: str) -> Array:
        """Posterior covariance of the coefficients of an effect, at the evidence temperature, or the spread
        over recordings if that is larger."""
        part = dict(self.layout)[name]
        own = self.rules.evidence_temperature * self.fit.covariance[part, part]
        sd = np.sqrt(np.diag(own))
        wider = np.maximum(self.fit.between[part] / np.maximum(sd, 1e-12), 1.0)
        out: Array = own * np.outer(wider, wider)
        return out


def changed_by(parameter: str, slope: float, gain: float = 1.0) -> float:
    """The relative change whose effect is the linear one of `slope`: forces act by one over the mass, of
    which a share of `gain` is the truck's and the rest is rotating inertia."""
    return slope / (1.0 - gain * min(slope, LARGEST_SLOPE / gain)) if parameter == "mass" else slope


class Regression:
    """Fits models to one body of evidence and caches them."""

    def __init__(
        self,
        evidence: Evidence,
        *,
        exclude: Iterable[str] = (),
        only: Mask | None = None,
        sigma: float | None = None,
    ) -> None:
        """`only` of its rows (n,); `sigma`, m/s^2, is the noise by which rows are weighed, else measured."""
        self.e, self.rules = evidence, evidence.rules
        self.parameters = tuple(evidence.sensitivity)
        self.lateness, self._lateness_prior = sensor_terms(evidence)
        self.series: Series = evidence.series(1e9, only)
        if sigma is None:
            sigma = fit(self.series, *self._design((), frozenset(self.parameters))[:2]).sigma
        self.sigma = sigma
        self.series = evidence.series(sigma, only)
        self.rows = np.flatnonzero(self.series.usable())
        self.library = [
            m
            for m in (*LIBRARY.values(), *evidence.user_mechanisms)
            if m.effect not in set(exclude) and evidence.has(*m.needs)
        ]
        gain = evidence.signals.get("effective_mass_gain", np.ones(len(evidence)))[evidence.valid]
        self.mass_gain = float(np.median(gain)) if len(gain) else 1.0
        self.reference = Regression(evidence.reference) if evidence.reference is not None else None
        self.fitted: dict[str, tuple[CandidateTerm, ...]] = {}  # at constants that fit these data
        self._candidate_terms: dict[str, list[CandidateTerm]] = {}
        self._models: dict[tuple[object, ...], Model] = {}

    def without(self, rows: Mask) -> Regression:
        """The same regression without some rows (n,), which `everywhere` still has."""
        other = copy(self)
        other.e = replace(self.e, valid=self.e.valid & ~rows, whole=self.e.everywhere().valid)
        other.series = replace(self.series, valid=self.series.valid & ~rows)
        other.rows = np.flatnonzero(other.series.usable())
        other._models = {}
        return other

    def candidate_terms(self, mechanism: Mechanism) -> list[CandidateTerm]:
        """All candidate terms of a mechanism on this evidence, computed once."""
        if mechanism.effect not in self._candidate_terms:
            fitted = self.fitted.get(mechanism.effect, ())
            self._candidate_terms[mechanism.effect] = [*candidate_terms(mechanism, self.e), *fitted]
        return self._candidate_terms[mechanism.effect]

    def model(
        self, named: tuple[CandidateTerm, ...], free: frozenset[str], start: Fit | None = None
    ) -> Model:
        """Fit one explanation, starting from the noise of `start`. Parameters that are not free are held near
        their given values, and so is one that would otherwise leave the physically possible range."""
        key = (tuple((n.mechanism.effect, id(n)) for n in named), free)
        if key not in self._models:
            X, prior, layout = self._design(named, free)
            found = fit(self.series, X, prior, start)
            chances = sum(np.log(n.mechanism.chance(self.e)) for n in named)
            score = found.evidence + float(self.rules.evidence_temperature * chances)
            model = Model(named, free, found, score, layout, self.rules, self.mass_gain)
            beyond = {p for p in free if not self.possible(p, model)}
            self._models[key] = self.model(named, free - beyond, start) if beyond else model
        return self._models[key]

    def possible(self, parameter: str, model: Model) -> bool:
        """Whether a parameter stays physically possible: rolling resistance, for example, is not negative.

        The bounds also keep all parameters from shrinking together, which hardly changes the motion but would
        compensate any effect that is not scaled with them.
        """
        low, high = self.e.vehicle.possible(parameter)
        change = model.moved(parameter)
        return low < self.e.total_change(parameter, change) < high

    def background(self, named: tuple[CandidateTerm, ...]) -> Model:
        """The best model with these mechanisms and any set of free parameters that a greedy search finds."""
        best = self.model(named, frozenset())
        everything = self.model(named, frozenset(self.parameters))
        grown = best
        while True:
            options = [
                self.model(named, grown.free | {p}, grown.fit) for p in self.parameters if p not in grown.free
            ]
            step = max(options, key=lambda m: m.score, default=grown)
            if step.score < grown.score + self.rules.evidence_temperature:
                break
            grown = step
        return max((best, grown, everything), key=lambda m: m.score)

    def design(self, model: Model) -> tuple[Array, Prior, tuple[tuple[str, slice], ...]]:
        """Design matrix (n, k), prior and column layout of a model."""
        return self._design(model.named, model.free)

    def _design(
        self, named: tuple[CandidateTerm, ...], free: frozenset[str]
    ) -> tuple[Array, Prior, tuple[tuple[str, slice], ...]]:
        blocks = [n.columns for n in named] + [self.e.sensitivity[p][:, None] for p in self.parameters]
        blocks.append(self.lateness)
        names = (
            [n.mechanism.effect for n in named] + [f"parameter:{p}" for p in self.parameters] + ["sensor lag"]
        )
        sd = np.array([FREE[p] if p in free else HELD for p in self.parameters])
        as_given = np.array([1.0 / (1.0 + self.e.moved.get(p, 0.0)) - 1.0 for p in self.parameters])
        prior = Prior.join(
            *(n.prior for n in named), Prior(as_given, sd, np.zeros(len(sd))), self._lateness_prior
        )
        ends = np.cumsum([block.shape[1] for block in blocks]).tolist()
        layout = [(name, slice(a, b)) for name, a, b in zip(names, [0, *ends], ends, strict=False)]
        return np.concatenate(blocks, axis=1), prior, tuple(layout)
