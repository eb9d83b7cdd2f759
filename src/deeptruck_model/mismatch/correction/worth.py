"""What the held-out free runs show of the correction, beside the simulator as given and refitted parameters.

Read from the result once, so that terminal and page cannot say two things of it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum, auto

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.mismatch.fit_result import Chosen, Compared, FitResult, Improvement
from deeptruck_model.mismatch.residual.evidence import Evidence

NOTICED = 0.7  # of the error, below which other parameters are worth a word where nothing was found
# And by how much they must help: as much as a steady acceleration of this size makes of a free run. Along
# twelve drives of 10 min of the reference truck itself with the demo's sensor noise (0.03 m/s, 0.05 m/s2,
# 0.1 % of slope), runs of 20 s err by 0.037 to 0.044 m/s, which no parameters can take away; in two the noise
# makes it shift otherwise, 0.14 and 0.19. A mass that is 1 or 2 % other was noticed in one of 48 of these.
NOTICED_M_S2 = 0.0043


class Worth(Enum):
    """What is shown of a correction."""

    NOT_DRIVEN = auto()  # no free run could be driven
    NOT_BETTER = auto()  # not surely better than the simulator as given: it may not be applied
    PARAMETERS_ALONE = auto()  # better; it is refitted parameters and no name
    BETTER = auto()  # better, and surely better than with all parameters refitted
    AS_GOOD = auto()  # better; nobody can tell it from the simulator with all parameters refitted
    WORSE = auto()  # better, and surely worse than with all parameters refitted


@dataclass(frozen=True)
class SpeedErrors:
    """Speed errors, rms in m/s, of free runs of `horizon_s` on the held-out recordings."""

    horizon_s: float
    given: float
    refitted: float  # all parameters, and nothing else
    corrected: float


def worth(fit: FitResult | None) -> Worth:
    """What the free runs show."""
    if fit is None or fit.errors is None or fit.improvement is None:
        return Worth.NOT_DRIVEN
    if not fit.validated:
        return Worth.NOT_BETTER
    if fit.chosen is Chosen.PARAMETERS:
        return Worth.PARAMETERS_ALONE
    return beside_refitted(fit, fit.errors, fit.improvement)


def beside_refitted(fit: FitResult, told: Compared, gained: Improvement) -> Worth:
    """The corrected simulator beside the one with all parameters refitted: surely better or worse over all
    that was driven unseen, and no otherwise over what was held out, whose errors are told."""
    low, high = gained.over_parameters_ci95
    if low > 0.0 and told.after.speed <= told.parameters_only.speed:
        return Worth.BETTER
    worse = high < 0.0 and told.after.speed >= told.parameters_only.speed
    return Worth.WORSE if worse else Worth.AS_GOOD


def errors(fit: FitResult | None) -> SpeedErrors | None:
    """The speed errors; None where no free run could be driven."""
    if fit is None or fit.errors is None:
        return None
    e = fit.errors
    return SpeedErrors(fit.horizon_s, e.before.speed, e.parameters_only.speed, e.after.speed)


def refitted_is_surely_better(fit: FitResult) -> bool:
    """Whether refitted parameters surely drive better than the simulator after its correction."""
    return fit.improvement is not None and fit.improvement.over_parameters_ci95[1] < 0.0


def refitted_is_much_better(fit: FitResult | None) -> bool:
    """Whether refitted parameters help held-out drives so much that the simulator is hardly right."""
    e = errors(fit)
    if e is None:
        return False
    # a steady acceleration makes a speed error that grows along the run, and its rms is 1/sqrt(3) of the last
    slow = NOTICED_M_S2 * e.horizon_s / math.sqrt(3.0)
    return e.refitted < min(NOTICED * e.given, e.given - slow)


def noticed(force: NDArray[np.float64], e: Evidence, horizon_s: float) -> bool:
    """Whether a force (n,), m/s^2, changes some free run of `horizon_s` as much as a steady acceleration that
    is noticed would."""
    rows = max(1, round(horizon_s / e.dt))
    last = [(s, max(s.stop - rows, s.start)) for s in e.stretches]
    runs = ([*range(s.start, end, rows), end] for s, end in last)
    means = [abs(float(np.mean(force[k : k + rows]))) for starts in runs for k in starts]
    return max(means, default=0.0) >= NOTICED_M_S2
