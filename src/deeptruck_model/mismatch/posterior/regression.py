"""The linear model of the residual: its rows, their noise, the library's terms on them, and what is beside
any name: the simulator's own parameters and what ordinary sensors do.
"""

from __future__ import annotations

from collections.abc import Iterable
from copy import copy
from dataclasses import replace

import numpy as np

from deeptruck_core.arrays import Array, Indices, Mask
from deeptruck_model.mismatch.mechanisms import LIBRARY, CandidateTerm, Mechanism, candidate_terms
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.residual.noise import Prior, Series, fit
from deeptruck_model.mismatch.residual.timing import sensor_terms

LARGEST_SLOPE = 0.75  # what four times the mass does
HELD = 0.01
BLOCK_S = 30.0  # of driving, whose errors are taken as independent
FREE = {"mass": 0.3, "drag_area": 0.3, "rolling_resistance": 0.4, "torque_gain": 0.15, "brake_gain": 0.25}


def changed_by(parameter: str, slope: float, gain: float = 1.0) -> float:
    """The relative change whose effect is the linear one of `slope`: forces act by one over the mass, of
    which a share of `gain` is the truck's and the rest is rotating inertia."""
    return slope / (1.0 - gain * min(slope, LARGEST_SLOPE / gain)) if parameter == "mass" else slope


class Regression:
    """One body of evidence as a linear model, with the terms of every mechanism on it."""

    def __init__(self, evidence: Evidence, *, exclude: Iterable[str] = ()) -> None:
        self.e, self.rules = evidence, evidence.rules
        self.parameters = tuple(evidence.sensitivity)
        self.lateness, self._lateness_prior = sensor_terms(evidence)
        self.weigh(fit(evidence.series(1e9), *self.design(free=True)).sigma)
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

    def weigh(self, sigma: float) -> None:
        """Weigh the rows by a noise of `sigma`, m/s^2."""
        self.sigma = sigma
        self.series: Series = self.e.series(sigma)
        self.rows = np.flatnonzero(self.series.usable())

    def without(self, rows: Mask) -> Regression:
        """The same regression without some rows (n,), which `everywhere` still has."""
        other = copy(self)
        other.e = replace(self.e, valid=self.e.valid & ~rows, whole=self.e.everywhere().valid)
        other.series = replace(self.series, valid=self.series.valid & ~rows)
        other.rows = np.flatnonzero(other.series.usable())
        return other

    def blocks(self) -> Indices:
        """The block of BLOCK_S of driving that each of the rows that count (m,) is in, in their order."""
        starts = np.array([s.start for s in self.e.drives])[self.e.record[self.rows]]
        of_drive = (self.rows - starts) // round(BLOCK_S / self.e.dt)
        return np.unique(of_drive + len(self.e) * self.e.record[self.rows], return_inverse=True)[1]

    def candidate_terms(self, mechanism: Mechanism) -> list[CandidateTerm]:
        """All candidate terms of a mechanism on this evidence, computed once."""
        if mechanism.effect not in self._candidate_terms:
            fitted = self.fitted.get(mechanism.effect, ())
            self._candidate_terms[mechanism.effect] = [*candidate_terms(mechanism, self.e), *fitted]
        return self._candidate_terms[mechanism.effect]

    def design(self, *, free: bool = False) -> tuple[Array, Prior]:
        """Columns (n, k) and prior of parameters, held near their values or `free`, and of what ordinary
        sensors do."""
        columns = [np.zeros((len(self.e), 0)), *(self.e.sensitivity[p][:, None] for p in self.parameters)]
        sd = np.array([FREE[p] if free else HELD for p in self.parameters])
        as_given = np.array([1.0 / (1.0 + self.e.moved.get(p, 0.0)) - 1.0 for p in self.parameters])
        prior = Prior.join(Prior(as_given, sd, np.zeros(len(sd))), self._lateness_prior)
        return np.concatenate([*columns, self.lateness], axis=1), prior
