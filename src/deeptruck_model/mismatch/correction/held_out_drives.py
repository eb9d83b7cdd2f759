"""What weak findings must show on drives they were not fitted to, to be told at all."""

from __future__ import annotations

from typing import Any

from deeptruck_model.mismatch.mechanisms import Shape, comes_and_goes
from deeptruck_model.mismatch.posterior.causes import Cause, Explanation
from deeptruck_model.mismatch.posterior.penalties import ENOUGH

WEAK = 60.0  # nats; a stronger cause is told also where no held-out drive shows it
CLEAR = 120.0  # the same for what acts on other drives too, and for what comes and goes: knots follow a drift
STRONG_LEARNED = 150.0  # nats; beside a learned simulator a stronger one is told also where drives are worse
OF_RECORDINGS = frozenset({"when", "each", "recordings", "first"})  # settings
CLEARLY = 0.6  # of the error as given, at which a parameter is told by few nats
ROAD = "road_grade"
NO_BETTER = 0.97  # of the error with other parameters alone, or as given


def in_vain(
    x: Explanation, fit: dict[str, Any], *, learned: bool = False, slopes_recorded: bool = True
) -> bool:
    """Whether little was found, and corrected by it the simulator drives worse on recordings held out, or the
    others best with nothing corrected, or with all parameters and no name; or no better than one with other
    parameters, where laws were found or parameters beside a name, which hold on other drives too, or where it
    is a learned simulator, whose own error may be found. Of what has no name the laws must help these drives.

    A road helps other drives no more than another road does; where no slopes are recorded it is there.
    """
    if not x.causes or any(c.needed is not None for c in x.causes) or "after" not in fit:
        return False
    before, tuned, after = (fit[name]["speed_rmse"] for name in ("before", "parameters_only", "after"))
    most = max(c.gain for c in x.causes)
    if learned and most < STRONG_LEARNED and after > before:
        return True
    if most < ENOUGH and all(c.kind == "parameter_error" for c in x.causes):
        return bool(after > CLEARLY * before)
    physics = [c for c in x.causes if c.kind != "parameter_error"]
    names = [c.shape for c in x.causes if c.shape is not None]
    if most < CLEAR and physics and all(c.predictable for c in physics) and _laws_drive_no_better(fit):
        return True
    if most < CLEAR and physics and all(_asked_of_other_drives(c, slopes_recorded) for c in physics):
        if after > NO_BETTER * before:
            return True
        enough = WEAK if any(_comes_and_goes(c) for c in physics) else CLEAR
        if most < enough and after == tuned:
            return True  # all parameters went in instead
    if most >= WEAK:
        return False
    lasting = any(_lasting(shape) for shape in names) or 0 < len(names) < len(x.causes)
    left_out = after == before and not any("when" in shape.settings for shape in names)
    return bool(left_out or after > before or ((learned or lasting) and after > NO_BETTER * tuned))


def _laws_drive_no_better(fit: dict[str, Any]) -> bool:
    """Whether laws without a name, which nothing is corrected by, would help no held-out drive."""
    if "free_model" not in fit:
        return False
    others = min(fit[name]["speed_rmse"] for name in ("before", "parameters_only"))
    return bool(fit["free_model"]["speed_rmse"] > NO_BETTER * others)


def _asked_of_other_drives(cause: Cause, slopes_recorded: bool) -> bool:
    """Whether it must help them: a law, or what comes and goes but a road that is surely there."""
    law = cause.shape is not None and _lasting(cause.shape)
    return law or (_comes_and_goes(cause) and (slopes_recorded or cause.effect != ROAD))


def _comes_and_goes(cause: Cause) -> bool:
    return cause.lawless or (cause.shape is not None and comes_and_goes(cause.shape))


def _lasting(shape: Shape) -> bool:
    """Whether it is a law, and neither bound to recordings nor to a while."""
    parts = shape.settings.get("parts", [shape.settings])
    return not any(
        part.get("knots") or not OF_RECORDINGS.isdisjoint(part) for part in [shape.settings, *parts]
    )
