"""What the held-out free runs show of the correction, beside the simulator as given and refitted parameters.

Read from `fit` of verdict.json, once, so that terminal and page cannot say two things of it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum, auto
from typing import Any

from deeptruck_model.mismatch.correction.correction import Chosen

NOTICED = 0.7  # of the error, below which other parameters are worth a word where nothing was found, and ...
NOTICED_M_S = 0.05  # by how much they must help, in free runs of 20 s


class Worth(Enum):
    """What is shown of a correction."""

    NOT_DRIVEN = auto()  # no free run could be driven
    NOT_BETTER = auto()  # not surely better than the simulator as given: it may not be applied
    PARAMETERS_ALONE = auto()  # better; it is refitted parameters and no name
    BETTER = auto()  # better, and surely better than with all parameters refitted
    AS_GOOD = auto()  # better; nobody can tell it from the simulator with all parameters refitted
    WORSE = auto()  # better, and surely worse than with all parameters refitted


@dataclass(frozen=True)
class Errors:
    """Speed errors, rms in m/s, of free runs of `horizon_s` on the held-out recordings."""

    horizon_s: float
    given: float
    refitted: float  # all parameters, and nothing else
    corrected: float


def worth(fit: Mapping[str, Any]) -> Worth:
    """What the `fit` of verdict.json shows."""
    if "after" not in fit:
        return Worth.NOT_DRIVEN
    if not fit["validated"]:
        return Worth.NOT_BETTER
    if fit["chosen"] == Chosen.PARAMETERS:
        return Worth.PARAMETERS_ALONE
    low, high = fit["improvement_over_parameters_ci95"]
    if low > 0.0:
        return Worth.BETTER
    return Worth.WORSE if high < 0.0 else Worth.AS_GOOD


def errors(fit: Mapping[str, Any]) -> Errors | None:
    """The errors in `fit`; None where no free run could be driven."""
    if "after" not in fit:
        return None
    given, refitted, corrected = (
        float(fit[name]["speed_rmse"]) for name in ("before", "parameters_only", "after")
    )
    return Errors(float(fit["horizon_s"]), given, refitted, corrected)


def refitted_is_surely_better(fit: Mapping[str, Any]) -> bool:
    """Whether refitted parameters surely drive better than the simulator after its correction."""
    beside = fit.get("improvement_over_parameters_ci95")
    return beside is not None and bool(beside[1] < 0.0)


def refitted_is_much_better(fit: Mapping[str, Any]) -> bool:
    """Whether refitted parameters help held-out drives so much that the simulator is hardly right."""
    e = errors(fit)
    return e is not None and e.refitted < min(NOTICED * e.given, e.given - NOTICED_M_S)
