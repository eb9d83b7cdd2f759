"""What the held-out free runs say of the correction: beside the simulator as given, and beside other
parameters.

Only the first decides whether it may be applied; the second says what the names are worth beyond numbers.
"""

from __future__ import annotations

from collections.abc import Sequence

from deeptruck_model.mismatch.correction.worth import (
    Worth,
    beside_refitted,
    refitted_is_much_better,
    refitted_is_surely_better,
)
from deeptruck_model.mismatch.fit_result import Chosen, FitResult, Improvement, Interval
from deeptruck_model.mismatch.posterior.next_pass import NextPass
from deeptruck_model.mismatch.report.wording import percent, spoken

LEAST_RESAMPLED = 3  # recordings; with fewer the interval is over the free runs
ASKED = (
    "Validation asks one thing: does the corrected simulator surely have a smaller mean speed error than the "
    "one given, over free runs along recordings it was not fitted to?"
)
REFUSED = "The correction did not pass validation and is not applied."
BETTER = "So {what} worth more than other parameters."
WORSE = (
    "So on these drives the findings predict worse than refitted parameters. "
    "Free parameters can make up for what is missing, and for sizes that are not quite right. "
    "On other driving they may fail."
)
UNSTATED = (
    "Refitted parameters alone predict these drives better, though none of them is surely enough wrong to "
    "be stated: more recordings may tell."
)
EQUAL = "So these drives do not tell which of the two predicts better."
NOT_BETTER = "the corrected simulator is not surely better where it was not fitted: nothing may be applied"
STILL = (
    "along the held-out recordings the correction changes nothing: hold out drives in which what was found "
    "acts, and that tell where they are if it belongs to a place"
)
HARMS = (
    "where nobody tells it the {names}, the corrected simulator predicts held-out recordings worse than the "
    "one given ({before:.3g} -> {after:.3g} m/s): nothing may be applied"
)
UNCHANGED = (
    "no correction by what was found drove the fitted recordings better, so the simulator is as it was "
    "given: nothing may be applied"
)
EACH_ITS_OWN = (
    "what was found is each drive's own, and another one does not have its mean: nothing may be applied"
)
NOT_DRIVEN = "no held-out recording is long enough without a gap to judge by: nothing may be applied"
UNNAMED = (
    "what has no name is not in the corrected simulator; with it (--with-unnamed) the speed error of "
    "held-out free runs is {free:.3g} m/s instead of {after:.3g} m/s"
)
TUNED = (
    "with other parameters the speed error of held-out free runs is {tuned:.3g} m/s instead of "
    "{before:.3g} m/s, though none of them is surely wrong"
)
NO_NAME = (
    "{names} explained the fitted recordings, and those held out do not confirm it: something may be "
    "missing, and no name for it is sure"
)
OFTEN = (
    "in {share} of the fitted driving the simulator is off by more than noise can be, and nothing that has a "
    "name explains it"
)
FOR_DRIVING = (
    "The correction has the sizes that drive best along recordings they were not fitted to; "
    "findings tell the most probable ones."
)
HELPS = 0.9  # of the error, below which what has no name is worth asking for


def said(fit: FitResult | None) -> list[str]:
    """Sentences on what the correction does; none where there were no free runs."""
    if fit is None:
        return []
    road = [] if fit.next_pass is None else [_next_pass(fit.next_pass)]
    if fit.improvement is None:
        return road
    if fit.chosen is Chosen.NOTHING:
        more = [UNSTATED] if refitted_is_surely_better(fit) else []
        return ["Nothing was changed, so before and after are the same.", *more, *road]
    beside = _beside_parameters(fit, fit.improvement)
    sizes = [FOR_DRIVING] if fit.for_driving else []
    return [ASKED, *_passed(fit, fit.improvement), *beside, *sizes, *_refitted(fit), *road]


def _next_pass(p: NextPass) -> str:
    """What the slope of one pass is worth on another."""
    sure = "So the road is shown" if p.shown else "So the road is not shown"
    return (
        f"On {p.km:.0f} km ahead of where the road was known again, the other pass leaves {p.left:.2g} of "
        f"{p.rms:.2g} m/s^2: {_change(p.smaller_ci95)} (95 %). {sure} by another pass."
    )


def _refitted(fit: FitResult) -> list[str]:
    """By how much the parameters in the correction are moved: forces are told beside these."""
    if not fit.refitted:
        return []
    moved = [f"{spoken(name)} {100 * change:+.1f} %" for name, change in sorted(fit.refitted.items())]
    return [f"Parameters in the correction, beside which its forces act: {', '.join(moved)}."]


def _passed(fit: FitResult, improvement: Improvement) -> list[str]:
    over = _resampled(fit, improvement.recordings)
    gained = f"it is {_change(improvement.ci95)} (95 % interval over {over})"
    if fit.validated:
        return [f"Yes, {gained}.", "The correction passed validation and may be applied."]
    if harm := _harms(fit):
        return [f"It is {_change(improvement.ci95)} (95 % interval over {over}).", f"But {harm}."]
    if fit.changes_nothing:
        return [f"It is {_change(improvement.ci95)} (95 % interval over {over}).", f"But {STILL}.", REFUSED]
    return [f"No, {gained}.", REFUSED]


def _harms(fit: FitResult) -> str:
    """How the corrected simulator fails as it is handed over; else empty."""
    if fit.handed_over is None or fit.errors is None or not fit.harms_alone:
        return ""
    names = " and ".join(spoken(n) for n in fit.handed_over.without)
    return HARMS.format(names=names, before=fit.errors.before.speed, after=fit.handed_over.after)


def _beside_parameters(fit: FitResult, improvement: Improvement) -> list[str]:
    if fit.chosen is Chosen.PARAMETERS:
        return ["The correction is refitted parameters alone: they drove the fitted recordings best."]
    beside, told = improvement.over_parameters_ci95, fit.errors
    assert told is not None  # an improvement is of these
    what = "the findings and laws without a name are" if fit.chosen is Chosen.LAWS else "the findings are"
    ends = {Worth.BETTER: BETTER.format(what=what), Worth.WORSE: WORSE, Worth.AS_GOOD: EQUAL}
    other = (
        "its forces scaled, as it has no parameters" if fit.scales_forces else "all its parameters refitted"
    )
    return [
        f"Beside the simulator with {other}, the speed error of the corrected one is {_change(beside)}.",
        ends[beside_refitted(fit, told, improvement)],
    ]


def _change(ci: Interval) -> str:
    """The interval of a relative improvement in words: '3 to 74 % larger'."""
    low, high = (round(100 * x) for x in ci)
    if low == high:
        return f"{abs(low)} % {'smaller' if low >= 0 else 'larger'}"
    if ci[0] >= 0.0:
        return f"{low} to {high} % smaller"
    if ci[1] <= 0.0:
        return f"{-high} to {-low} % larger"
    return f"between {-low} % larger and {high} % smaller"


def _resampled(fit: FitResult, recordings: int) -> str:
    runs = f"free runs of {fit.horizon_s:.0f} s"
    if recordings < LEAST_RESAMPLED:
        return runs
    own = ", each driven by a fit that had not seen it" if recordings > len(fit.held_out) else ""
    return f"{recordings} recordings{own}, in {runs}"


def caveats(fit: FitResult, found: bool, of_these_drives: bool = False) -> list[str]:
    """What to know before the corrected simulator is applied; what was found may be of these drives alone."""
    e = fit.errors
    not_shown = f"{STILL}: nothing may be applied" if fit.changes_nothing else NOT_BETTER
    unchanged = EACH_ITS_OWN if of_these_drives else UNCHANGED
    no_better = unchanged if fit.chosen is Chosen.NOTHING else not_shown
    refused = _harms(fit) or (no_better if e else NOT_DRIVEN)
    out = [refused] if found and not fit.validated else []
    if e is not None and e.free_model is not None and unnamed_would_help(fit):
        out.append(UNNAMED.format(after=e.after.speed, free=e.free_model.speed))
    return out


def no_name_is_sure(withdrawn: Sequence[str]) -> str:
    """That nothing missing is no answer, where what was found was `withdrawn`; else empty."""
    names = [spoken(n) for n in dict.fromkeys(withdrawn)]
    return NO_NAME.format(names=" or ".join(names)) if names else ""


def off_without_a_name(fit: FitResult, often: float) -> str:
    """That the simulator is off though nothing was found, as other parameters help much, or as it is `often`
    (share of the time) off by more than noise; else empty."""
    if fit.errors is not None and refitted_is_much_better(fit):
        return TUNED.format(before=fit.errors.before.speed, tuned=fit.errors.parameters_only.speed)
    return OFTEN.format(share=percent(often)) if often else ""


def unnamed_would_help(fit: FitResult | None) -> bool:
    """Whether laws for what has no name would clearly help held-out drives, and are not corrected by."""
    if fit is None or fit.errors is None or fit.errors.free_model is None or fit.chosen is Chosen.LAWS:
        return False
    return fit.errors.free_model.speed < HELPS * fit.errors.after.speed
