"""What the held-out free runs say of the correction: beside the simulator as given, and beside other
parameters.

Only the first decides whether it may be applied; the second says what the names are worth beyond numbers.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

LEAST_RESAMPLED = 3  # recordings; with fewer the interval is over the free runs
ASKED = (
    "Validation asks one thing: is the speed error of the corrected simulator surely smaller than that of "
    "the simulator as it was given, on recordings it was not fitted to?"
)
BETTER = "So {what} worth more than other parameters."
WORSE = (
    "So on these drives the findings predict worse than refitted parameters, whatever they explain: free "
    "parameters can bend to make up for anything that is missing, and for sizes that the findings have not "
    "quite right. On other driving, what they bent for may be another."
)
UNSTATED = (
    "Refitted parameters alone do predict these drives better, though none of them is surely enough wrong to "
    "be stated: more recordings may tell."
)
EQUAL = "So these drives do not tell which of the two predicts better."
NOT_BETTER = "the corrected simulator does not predict the held-out recordings better: nothing may be applied"
NOT_DRIVEN = "no held-out recording has 40 s without a gap to judge by: nothing may be applied"
UNNAMED = (
    "what has no name is not in the corrected simulator; with it (--with-unnamed) the speed error of "
    "held-out free runs is {free:.3g} m/s instead of {after:.3g} m/s"
)
TUNED = (
    "with other parameters the speed error of held-out free runs is {tuned:.3g} m/s instead of "
    "{before:.3g} m/s, though none of them is surely wrong"
)
NOTICED = 0.7  # of the error, below which other parameters are worth a word where nothing was found, and ...
NOTICED_M_S = 0.1  # by how much they must help
HELPS = 0.9  # of the error, below which what has no name is worth asking for


def said(fit: dict[str, Any]) -> list[str]:
    """Sentences on the `fit` of verdict.json; none where there were no free runs."""
    if "after" not in fit:
        return []
    if all(math.isclose(fit["after"][k], x, rel_tol=1e-6) for k, x in fit["before"].items()):
        more = [UNSTATED] if worse_than_parameters(fit) else []
        return ["Nothing was changed, so before and after are the same.", *more]
    return [ASKED, _passed(fit), *_beside_parameters(fit)]


def worse_than_parameters(fit: dict[str, Any]) -> bool:
    """Whether re-tuned parameters alone predict the held-out recordings surely better than the correction."""
    beside = fit.get("improvement_over_parameters_ci95")
    return beside is not None and bool(beside[1] < 0.0)


def parameters_alone(fit: dict[str, Any]) -> bool:
    """Whether the correction is refitted parameters and nothing else."""
    beside = fit.get("improvement_over_parameters_ci95")
    return beside is not None and not any(beside)


def parameters_may_do_as_well(fit: dict[str, Any]) -> bool:
    """Whether the held-out recordings do not surely show more than that parameters needed tuning."""
    beside = fit.get("improvement_over_parameters_ci95")
    return beside is not None and beside[0] <= 0.0 and any(beside)


def _passed(fit: dict[str, Any]) -> str:
    gained = f"it is {_change(fit['improvement_ci95'])} (95 % interval over {_resampled(fit)})"
    if fit["validated"]:
        return f"Yes, {gained}: the correction passed validation and may be applied."
    return f"No, {gained}: the correction did not pass validation and is not applied."


def _beside_parameters(fit: dict[str, Any]) -> list[str]:
    beside = fit.get("improvement_over_parameters_ci95")
    if not beside:
        return []
    if parameters_alone(fit):
        return ["The correction is refitted parameters alone: they drove the fitted recordings best."]
    what = "the findings and laws without a name are" if fit.get("with_unnamed") else "the findings are"
    better = BETTER.format(what=what)
    end = better if beside[0] > 0.0 else WORSE if worse_than_parameters(fit) else EQUAL
    return [
        "Beside the simulator with all its parameters refitted, the speed error of the corrected one is "
        f"{_change(beside)}. {end}"
    ]


def _change(ci: Sequence[float]) -> str:
    """The interval of a relative improvement in words: '3 to 74 % larger'."""
    low, high = (round(100 * x) for x in ci)
    if low == high:
        return f"{abs(low)} % {'smaller' if low >= 0 else 'larger'}"
    if ci[0] >= 0.0:
        return f"{low} to {high} % smaller"
    if ci[1] <= 0.0:
        return f"{-high} to {-low} % larger"
    return f"between {-low} % larger and {high} % smaller"


def _resampled(fit: dict[str, Any]) -> str:
    runs = f"free runs of {fit['improvement_horizon_s']:.0f} s"
    recordings = fit["improvement_recordings"]
    if recordings < LEAST_RESAMPLED:
        return runs
    own = ", each driven by a fit that had not seen it" if recordings > len(fit["held_out"]) else ""
    return f"{recordings} recordings{own}, in {runs}"


def others_drive_much_better(fit: dict[str, Any]) -> bool:
    """Whether other parameters help held-out drives so much that the simulator is hardly right."""
    if "parameters_only" not in fit:
        return False
    before, tuned = fit["before"]["speed_rmse"], fit["parameters_only"]["speed_rmse"]
    return bool(tuned < min(NOTICED * before, before - NOTICED_M_S))


def caveats(fit: dict[str, Any], found: bool, with_unnamed: bool) -> list[str]:
    """What to know before the corrected simulator is applied."""
    refused = NOT_BETTER if fit.get("windows") else NOT_DRIVEN
    out = [refused] if found and not fit["validated"] else []
    if not found and others_drive_much_better(fit):
        before, tuned = fit["before"], fit["parameters_only"]
        out.append(TUNED.format(before=before["speed_rmse"], tuned=tuned["speed_rmse"]))
    free, after = fit.get("free_model"), fit.get("after")
    if free and after and not with_unnamed and free["speed_rmse"] < HELPS * after["speed_rmse"]:
        out.append(UNNAMED.format(after=after["speed_rmse"], free=free["speed_rmse"]))
    return out
