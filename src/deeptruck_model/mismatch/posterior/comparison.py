"""What a comparison of a simulator with drives has shown, before any correction."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from deeptruck_model.mismatch.posterior.budget import Budget
from deeptruck_model.mismatch.posterior.events import Event, rows_of
from deeptruck_model.mismatch.posterior.names import Names
from deeptruck_model.mismatch.posterior.posterior import Posterior
from deeptruck_model.mismatch.posterior.regression import Regression
from deeptruck_model.mismatch.prepare.drives import PreparedDrives
from deeptruck_model.mismatch.residual.evidence import Evidence


@dataclass(frozen=True)
class Compared:
    """A comparison: the simulator's own `parameters`, the drives, the evidence of the simulator as given, the
    posterior (perhaps linearised at refitted parameters), names, budget, events, and remarks (`caveats`)."""

    parameters: Mapping[str, float]
    drives: PreparedDrives
    given: Evidence
    posterior: Posterior
    names: Names
    budget: Budget
    events: tuple[Event, ...] = ()
    caveats: tuple[str, ...] = ()

    @property
    def search(self) -> Regression:
        """The regression on which all names are compared."""
        return self.posterior.search

    @property
    def share_compared(self) -> float:
        """The share of rows that are compared, in fitted and held-out drives."""
        return float(self.search.e.everywhere().valid.mean())

    @property
    def fitted(self) -> Evidence:
        """The evidence of the fitted drives, with what their fit leaves out because it acts for seconds."""
        e = self.search.e
        rows = rows_of(self.events, len(e))
        return replace(e, valid=e.valid | (rows & e.everywhere().valid & ~e.held_out))
