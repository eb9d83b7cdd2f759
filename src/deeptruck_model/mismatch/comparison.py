"""Types for a comparison of a simulator with drives, before any correction; the input of `conclude`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.mismatch.budget import Budget
from deeptruck_model.mismatch.events import Event
from deeptruck_model.mismatch.names import Names
from deeptruck_model.mismatch.posterior.posterior import Posterior
from deeptruck_model.mismatch.posterior.regression import Regression
from deeptruck_model.mismatch.prepare import Drives
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.unrecorded import NotRecorded


@dataclass(frozen=True)
class Uncompared:
    """Drives of which nothing can be compared, with the reason `drives.useless`, and the missing inputs."""

    drives: Drives
    missing: tuple[NotRecorded, ...]


@dataclass(frozen=True)
class Compared:
    """A comparison: the simulator's given `parameters`, the drives, the missing inputs, the `residual` (n,),
    m/s^2, of the simulator as given, the posterior (perhaps linearised at refitted parameters), names and
    budget, the missing input behind each name that it may explain, and events."""

    parameters: Mapping[str, float]
    drives: Drives
    missing: tuple[NotRecorded, ...]
    residual: NDArray[np.float64]
    posterior: Posterior
    names: Names
    budget: Budget
    behind: Mapping[str, str]
    events: tuple[Event, ...] = ()

    @property
    def search(self) -> Regression:
        """The regression on which all names are compared."""
        return self.posterior.search

    @property
    def fitted(self) -> Evidence:
        """The evidence of the fitted drives, with what their fit leaves out because it acts for seconds."""
        e = self.search.e
        rows = np.zeros(len(e), dtype=bool)
        for x in self.events:
            rows[x.start : x.stop] = True
        return replace(e, valid=e.valid | (rows & e.everywhere().valid & ~e.held_out))
