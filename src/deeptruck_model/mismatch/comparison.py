"""A simulator compared with drives: the input of `decide`, before any correction."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.mismatch.budget import Budget
from deeptruck_model.mismatch.events import Event
from deeptruck_model.mismatch.names import Names
from deeptruck_model.mismatch.posterior.posterior import Posterior
from deeptruck_model.mismatch.posterior.regression import Regression
from deeptruck_model.mismatch.prepare import Drives
from deeptruck_model.mismatch.unrecorded import NotRecorded


@dataclass(frozen=True)
class Uncompared:
    """Drives with which nothing can be compared, as `drives.useless` says, and what was not recorded."""

    drives: Drives
    missing: tuple[NotRecorded, ...]


@dataclass(frozen=True)
class Compared:
    """The simulator's own `parameters`, the drives, what was not recorded, the `residual` (n,), m/s^2, of the
    simulator as given, the posterior, which may be about refitted parameters, the names and the budget, the
    missing input by the names that it may explain as well, and what acts for seconds."""

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
        """The regression that all is compared on."""
        return self.posterior.search
