"""Drives with nothing missing, along which forces of known names are added, to train the classifier on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.mismatch.data.prepared import prepare
from deeptruck_model.mismatch.mechanisms import LIBRARY
from deeptruck_model.mismatch.posterior.kernel_evidence import KernelEvidence
from deeptruck_model.mismatch.posterior.kernel_features import KernelFeatures
from deeptruck_model.mismatch.posterior.regression import Regression
from deeptruck_model.mismatch.residual.gather import gather
from deeptruck_model.mismatch.rules import Rules
from deeptruck_model.recordings import Recording
from deeptruck_model.simulators import Simulator

Array = NDArray[np.float64]


class CleanDrives:
    """Recordings of a truck that its simulator has right. `residual` (n,), m/s^2, is noise alone, zero where
    a row does not count; `sensitivity` has a column (n,) for a change of each parameter by its own size."""

    def __init__(self, simulator: Simulator, recordings: Sequence[Recording], fit: int) -> None:
        """The first `fit` recordings are fitted, the others held out."""
        rules = Rules()
        held_out = [k >= fit for k in range(len(recordings))]
        drives = [prepare(r, True, simulator.interface) for r in recordings]
        e = gather(simulator, drives, held_out, rules=rules).to_fit()
        self._search = Regression(e)
        self._kernels = KernelEvidence(self._search, self._search.background(()))
        self._valid = e.valid
        self.residual: Array = np.where(e.valid, e.residual, 0.0)
        self.sensitivity: Mapping[str, Array] = {n: np.nan_to_num(s) for n, s in e.sensitivity.items()}
        self._quiet = self._kernels.squares(self.residual)

    def fault(self, name: str, rng: np.random.Generator) -> Array | None:
        """What a sensor's fault that is a force to the tool does, (n,), of a size drawn from its prior.

        None where these drives cannot have it."""
        mechanism = next((m for m in self._search.library if m is LIBRARY.get(name)), None)
        if mechanism is None:
            return None
        terms = self._search.candidate_terms(mechanism)
        term = terms[rng.integers(len(terms))]
        size = term.prior.mean + rng.standard_normal(term.columns.shape[1]) * term.prior.sd
        out: Array = np.nan_to_num(term.columns) @ size
        return out

    def kernel_features(self, residuals: Array, beside: Sequence[str] = ()) -> KernelFeatures:
        """Of residuals (n, N), beside names that are known."""
        return self._kernels.of(np.where(self._valid[:, None], residuals, 0.0), beside, self._quiet)
