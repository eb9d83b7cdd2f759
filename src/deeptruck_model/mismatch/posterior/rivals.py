"""Each name beside those that would do nearly as well in its place."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from deeptruck_model.mismatch.mechanisms import LIBRARY, UNNAMED, CandidateTerm, Constants, is_time_varying
from deeptruck_model.mismatch.mechanisms.brakes import DEAD_TIME, BrakeLag
from deeptruck_model.mismatch.posterior import by_place, windows
from deeptruck_model.mismatch.posterior.candidates import candidates, enriched, screen, screen_terms
from deeptruck_model.mismatch.posterior.causes import Cause
from deeptruck_model.mismatch.posterior.penalties import (
    discrepancy_penalty,
    enough,
    large_enough,
    practical,
    time_varying_penalty,
)
from deeptruck_model.mismatch.posterior.search import Model, Search
from deeptruck_model.mismatch.posterior.stepwise import WIDENED
from deeptruck_model.mismatch.residual.noise import Z95

Array = NDArray[np.float64]

ALTERNATIVES = 3  # rivals whose whole explanation is kept, to be driven against each other
INSTEAD = 4  # mechanisms tried in place of each parameter
SLOPE = "road_grade"  # a force that goes by nothing but its time is what a slope, or its sensor, is off by
SLOW_S = 8.0  # smoothing of a slow force where it has no knots of its own


def named_cause(search: Search, model: Model, term: CandidateTerm) -> Cause:
    """One named effect with the names that would do nearly as well in its place."""
    rules = search.rules
    base = search.background(tuple(n for n in model.named if n is not term))
    gain = model.score - base.score
    instead = _instead_of(search, base, term)
    own = model.score - (max(rules.least_gain, rules.form_share * gain) if is_time_varying(term) else 0.0)
    own -= discrepancy_penalty(search, search.model((*base.named, term), base.free | model.free, model.fit))
    rivals = sorted(((n, own - _paid(search, base, m, own)) for n, m in instead), key=lambda rival: rival[1])
    unnamed_model = _unnamed_time_varying(search, model, term)
    if unnamed_model is not None and unnamed_model.score > model.score + max(
        rules.least_gain, rules.form_share * gain
    ):
        force = unnamed_model.named[-1].columns @ unnamed_model.coefficients(UNNAMED.effect)
        more = gain + unnamed_model.score - model.score
        alike = tuple((m.effect, 0.0) for m in search.library if m.effect == SLOPE)
        return Cause(
            "missing_physics", "unknown", more, 0.0, force,
            rivals=alike, nearest=term.mechanism.effect, time_varying=True, rules=rules,
        )  # fmt: skip
    if unnamed_model is not None:  # perhaps something else is time-varying
        unnamed = (UNNAMED.effect, max(model.score - unnamed_model.score, 0.0))
        rivals = sorted([*rivals, unnamed], key=lambda rival: rival[1])
    if _is_dead_time(term.variant.constants) and any(m.effect == "command_delay" for m in search.library):
        rivals = [("command_delay", 0.0), *((n, worse) for n, worse in rivals if n != "command_delay")]
    return Cause(
        term.mechanism.kind,
        term.mechanism.effect,
        gain,
        0.0,
        force_of(search, model, term),
        term,
        tuple(rivals),
        alternatives=tuple(instead[:ALTERNATIVES]),
        rules=rules,
    )


def _paid(search: Search, base: Model, rival: Model, own: float) -> float:
    """The score of a rival without what its last name has to gain at least. What a learned simulator's own
    error gives takes long to know, and matters only where a rival does better than `own`."""
    if len(rival.named) <= len(base.named):
        return rival.score
    score = rival.score - time_varying_penalty(rival, base)
    return score - discrepancy_penalty(search, rival) if score > own else score


def _instead_of(search: Search, base: Model, term: CandidateTerm) -> list[tuple[str, Model]]:
    """The best model with each other possible name, or one more parameter, in place of a candidate term; best
    first."""
    if term.variant.acts_in_windows:
        spans = list(term.variant.spans)
        tried = windows.candidates(search, base, spans)
    else:
        tried = candidates(search, base)
        tried = [enriched(search, m) for m in tried[:WIDENED]] + tried[WIDENED:]
    tried += by_place.instead(search, base, term)
    tried = [m for m in tried if practical(search, m, m.named[-1])]
    instead = [(m.effects[-1], m) for m in tried if m.effects[-1] != term.mechanism.effect]
    biased = [p for p in search.parameters if p not in base.free]
    return _best_of_each_name(instead + [(p, search.model(base.named, base.free | {p})) for p in biased])


def _best_of_each_name(models: list[tuple[str, Model]]) -> list[tuple[str, Model]]:
    """Best first; a drag area that changes and a wrong one bear the same name."""
    best: dict[str, Model] = {}
    for name, model in sorted(models, key=lambda item: -item[1].score):
        best.setdefault(name, model)
    return list(best.items())


def _unnamed_time_varying(search: Search, model: Model, term: CandidateTerm) -> Model | None:
    """The same model with an unnamed force in place of one that is time-varying; None for a law.

    A name for such a force says how it acts, with speed squared or with the pull; one that acts otherwise is
    told by this alone.
    """
    if search.e.model_discrepancy > 0:
        return None  # a learned truck follows slow forces in part, so that none of them acts as it should
    others = tuple(n for n in model.named if n is not term)
    if term.variant.acts_in_windows:
        spans = list(term.variant.spans)
        return search.model((*others, windows.unnamed(search, spans)), model.free, model.fit)
    if not is_time_varying(term):
        return None
    base = search.model(others, model.free, model.fit)
    scored = screen_terms(search, base, search.candidate_terms(UNNAMED))[:2]
    options = [enriched(search, search.model((*others, s), model.free, model.fit)) for _, s in scored]
    return max(options, key=lambda m: m.score, default=None)


def _is_dead_time(constants: Constants) -> bool:
    """Whether it is a dead time of the brake: the same force as a delay of its command."""
    return isinstance(constants, BrakeLag) and constants.side == DEAD_TIME


def force_of(search: Search, model: Model, term: CandidateTerm) -> Array:
    """What a mechanism adds, (n,). A profile whose knots did not reach every recording goes on as a smooth
    residual."""
    e = search.e
    force = term.columns @ model.coefficients(term.mechanism.effect)
    if term.mechanism.effect != "road_grade" or term.variant.comes_again:
        return force
    left = np.where(e.valid, e.residual - search.prediction(model) + force, 0.0)
    weight = e.valid / search.series.relative**2
    width = SLOW_S / e.dt
    smooth = gaussian_filter1d(left * weight, width) / np.maximum(gaussian_filter1d(weight, width), 1e-3)
    reached = np.zeros(len(e), dtype=bool)
    for i in np.unique(e.record[np.abs(term.columns).max(axis=1) > 0]):
        reached |= e.record == i
    return np.where(reached, force, smooth)


def tuned_causes(search: Search, model: Model) -> list[Cause]:
    """The free parameters in the order in which each helps most, and what each adds to those before it.

    Judged one by one at the end they would hide behind each other: mass can be mimicked by three gains
    together.
    """
    grown, out = search.model(model.named, frozenset()), []
    while grown.free < model.free:
        options = [
            search.model(model.named, grown.free | {p}, model.fit) for p in sorted(model.free - grown.free)
        ]
        options = sorted((m for m in options if m.free > grown.free), key=lambda m: -m.score)
        if not options:
            break
        others = [(next(iter(m.free - grown.free)), m) for m in options[1:]]
        others += [(m.effects[-1], m) for m in _instead(search, grown)]
        cause = _parameter(search, model, grown, options[0], _best_of_each_name(others))
        if cause is not None:
            out.append(cause)
        grown = options[0]
    return out


def _instead(search: Search, model: Model) -> list[Model]:
    """The best mechanisms in place of one more parameter: what grows with speed may be drag or tyres."""
    best: dict[str, CandidateTerm] = {}
    for _, term in screen(search, model):
        best.setdefault(term.mechanism.effect, term)
    tried = [
        search.model((*model.named, term), model.free, model.fit) for term in list(best.values())[:INSTEAD]
    ]
    return sorted(tried, key=lambda m: -m.score)


def _clear_beside_as_given(search: Search, model: Model, before: Model, after: Model) -> bool:
    """Whether a parameter explains enough beside one that is just as given, and nothing else is missing. What
    is held may move a little, which hides small errors; held-out drives then have to show them clearly."""
    if model.named or search.e.model_discrepancy > 0.0:
        return False
    name = next(iter(after.free - before.free))
    given = search.model(before.named, before.free, before.fit, pinned=name)
    return after.score - given.score > search.rules.least_gain


def _a_slope_sensors_zero(search: Search, before: Model, after: Model) -> float:
    """The zero that would do nearly as well, rise over run; infinite where none would. Held-out drives have
    the same one, so that they show nothing."""
    (zero,) = search.candidate_terms(LIBRARY["grade_bias"])
    instead = search.model((*before.named, zero), before.free, before.fit)
    if instead.score < after.score - search.rules.least_gain:
        return float("inf")
    return float(np.abs(instead.coefficients("grade_bias")).max())


def _beyond_its_own(search: Search, free: frozenset[str], name: str, value: float) -> bool:
    """Whether a learned simulator is off by more, in this parameter, than on the recordings it keeps.

    What it learned imperfectly changes from second to second, and a steady force stands out of that by its
    steadiness long before it does by its size.
    """
    if search.own is None:
        return False
    own = search.own.model((), free)
    usual = search.rules.allowance * abs(own.moved(name)) + Z95 * own.moved_sd(name)
    return abs(value) > usual


def _parameter(
    search: Search, model: Model, before: Model, after: Model, others: list[tuple[str, Model]]
) -> Cause | None:
    """The parameter that `after` frees beyond `before`; None where it hardly moves or hardly matters."""
    rules = search.rules
    name = next(iter(after.free - before.free))
    gain = after.score - before.score
    value = search.e.total_change(name, model.moved(name))
    least = enough(search) + search.e.tolerance.get(f"parameter:{name}", 0.0)
    force = search.e.sensitivity[name] * value  # of the simulator as given, to first order
    unsure = abs(value) < rules.nearly_right + Z95 * model.moved_sd(name)
    if unsure:
        return None
    large = large_enough(search.e, force) or _beyond_its_own(search, after.free, name, value)
    if gain < least or not large:
        if not _clear_beside_as_given(search, model, before, after):
            return None
        if not large and np.isfinite(_a_slope_sensors_zero(search, before, after)):
            return None
        gain = rules.told_gain
    if gain < rules.slope_zero_gain and _a_slope_sensors_zero(search, before, after) < rules.slope_zero:
        return None
    rivals = tuple((n, after.score - m.score) for n, m in others)
    return Cause(
        "parameter_error",
        name,
        gain,
        0.0,
        force,
        None,
        rivals,
        alternatives=tuple(others[:ALTERNATIVES]),
        whole=after,
        rules=rules,
    )
