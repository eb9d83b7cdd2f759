"""What is missing only now and then: first where, then what.

A valve that sticks twice an hour is lost among hours in which it does not. So short windows are sought in
which the simulator is plainly wrong, and mechanisms are fitted as if they acted in those windows alone.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.mismatch.mechanisms import (
    UNNAMED,
    CandidateTerm,
    Mechanism,
    build,
    candidate_term,
    held_steady,
    is_time_varying,
)
from deeptruck_model.mismatch.mechanisms.variants import OwnCurve, Span, Spline, Sum, Windowed
from deeptruck_model.mismatch.posterior.candidates import screen_terms
from deeptruck_model.mismatch.posterior.causes import Cause
from deeptruck_model.mismatch.posterior.penalties import large_enough
from deeptruck_model.mismatch.posterior.search import Model, Search
from deeptruck_model.mismatch.posterior.slow_force import LINE_S
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.vehicle_kinds import CLUTCH_CLOSED

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

LENGTHS_S = (0.6, 2.0, 6.0)
LARGEST = 6.0  # a single sample counts as no more than this
AROUND_S = 1.5
WINDOWS_MOST = 0.2  # of the time, all windows together: what acts for longer is not rare
FITTED, FORMS = 6, 3  # names, and forms of each, that are fitted in full
ENDS = 2.0  # of a window, each a choice that costs a tempered nat
LARGEST_LOG = 600.0  # of trials, which hundreds of windows would take beyond what a float holds
SUDDEN = 0.5  # m/s^2, prior sd of a force without a name


def windows(e: Evidence, model: Model) -> list[Span]:
    """Spans in which the innovations of a model are off together; none where they are no exception."""
    near, share = _off(e, model)
    return _spans(e, near) if 0.0 < share <= WINDOWS_MOST else []


def often_off(e: Evidence, model: Model) -> float:
    """The share of the fitted time in which a model is off as no noise is, where that is no exception; else
    0."""
    share = _off(e, model)[1]
    return share if share > WINDOWS_MOST and e.model_discrepancy == 0.0 else 0.0


def _off(e: Evidence, model: Model) -> tuple[Mask, float]:
    """Rows (n,) around which the innovations of a model are off together, and their share."""
    z = np.clip(np.nan_to_num(model.fit.innovations), -LARGEST, LARGEST)
    known = np.isfinite(model.fit.innovations)
    off = np.zeros(len(e), dtype=bool)
    for length_s in LENGTHS_S:
        width = max(2, round(length_s / e.dt))
        kernel = np.ones(width)
        count = np.maximum(np.convolve(known, kernel, mode="same"), 1.0)
        off |= (np.abs(np.convolve(z, kernel, mode="same")) > e.rules.stands_out * np.sqrt(count)) & (
            count >= width / 2
        )
    off &= ~near_other_gear(e) & (e["speed"] > CLUTCH_CLOSED)
    near = np.convolve(off, np.ones(2 * round(AROUND_S / e.dt) + 1), mode="same") > 0.5
    return near, float(near[known].mean()) if known.any() else 0.0


def near_other_gear(e: Evidence) -> Mask:
    """A shift that comes a little sooner or later is off too, and nothing that sticks."""
    apart = e.signals.get("gear apart", np.zeros(len(e))) > 0
    near: Mask = np.convolve(apart, np.ones(2 * round(2 * AROUND_S / e.dt) + 1), mode="same") > 0.5
    return near


def _spans(e: Evidence, inside: Mask) -> list[Span]:
    out: list[Span] = []
    for i, s in enumerate(e.stretches):
        edges = np.flatnonzero(np.diff(np.concatenate([[0], inside[s.rows].astype(int), [0]])))
        elapsed = e["elapsed"][s.rows]
        for first, last in zip(edges[::2], edges[1::2], strict=True):
            out.append((i, float(elapsed[first]), float(elapsed[last - 1])))
    return out


def narrowed(search: Search, model: Model, spans: list[Span]) -> list[Span]:
    """The spans without what is around them: where what the model leaves is off from one step to another.

    What sets in and lets go at once tells its name by how it acts in between; steps that come late hide it.
    """
    e = search.e
    left = np.where(e.valid, e.residual - search.prediction(model), 0.0) / search.series.relative
    left /= max(1.4826 * float(np.median(np.abs(left[e.valid]))), 1e-9)
    inside = np.zeros(len(e), dtype=bool)
    for i, first, last in spans:
        rows = np.flatnonzero((e.record == i) & (e["elapsed"] >= first) & (e["elapsed"] <= last))
        long = last - first > LINE_S
        for begin, end in [(0, len(rows))] if long else steps(left[rows], search.rules.stands_out):
            inside[rows[begin:end]] = True
    return _spans(e, inside)


def steps(left: Array, off: float) -> list[tuple[int, int]]:
    """Pieces [begin, end) of a series (n,) in units of its noise whose sums stand out most, by `off` sd at
    least: one, then others before and after it (circular binary segmentation, Olshen et al., Biostatistics 5,
    2004, in its simplest form)."""
    if len(left) < 2:
        return []
    total = np.concatenate([[0.0], np.cumsum(left)])
    count = np.arange(len(total))
    width = np.maximum(count[None, :] - count[:, None], 1)
    stands_out = np.triu(np.abs(total[None, :] - total[:, None]) / np.sqrt(width), 2)
    begin, end = (int(k) for k in np.unravel_index(np.argmax(stands_out), stands_out.shape))
    if stands_out[begin, end] < off:
        return []
    after = [(end + b, end + c) for b, c in steps(left[end:], off)]
    return [*steps(left[:begin], off), *_without_pauses(left, begin, end, off), *after]


def _without_pauses(left: Array, begin: int, end: int, off: float) -> list[tuple[int, int]]:
    """The piece [begin, end) without those parts of it in which less than half of it is left."""
    inside = left[begin:end]
    mean = float(inside.mean())
    pauses = [
        (b, c) for b, c in steps(inside - mean, off) if np.sign(mean) * inside[b:c].mean() < abs(mean) / 2
    ]
    edges = [begin, *(begin + k for pause in pauses for k in pause), end]
    return [(b, c) for b, c in zip(edges[::2], edges[1::2], strict=True) if c - b > 1]


def within(spans: list[Span], e: Evidence) -> Mask:
    """Which rows (n,) lie in the spans."""
    inside = np.zeros(len(e), dtype=bool)
    for i, first, last in spans:
        inside |= (e.record == i) & (e["elapsed"] >= first) & (e["elapsed"] <= last)
    return inside


def during(given: CandidateTerm, spans: list[Span], e: Evidence) -> CandidateTerm:
    """The candidate term confined to the spans."""
    variant = Windowed(given.variant, tuple(spans))
    parts = tuple(build(given.mechanism, variant))
    trials = given.trials * float(np.exp(min(ENDS * len(spans), LARGEST_LOG)))  # each end was looked for
    return replace(
        given,
        variant=variant,
        parts=parts,
        columns=given.columns * within(spans, e)[:, None],
        trials=trials,
    )


def unnamed(search: Search, spans: list[Span]) -> CandidateTerm:
    """A force without a name in the spans alone, of any size and sign in each."""
    steady = held_steady(search.candidate_terms(UNNAMED)[0], search.e)
    each = Sum(tuple(Windowed(steady.variant, (span,)) for span in spans))
    made = during(candidate_term(UNNAMED, each, search.e), spans, search.e)
    return replace(made, prior=replace(made.prior, sd=np.full(len(spans), SUDDEN)))


def steady(search: Search, mechanism: Mechanism) -> list[CandidateTerm]:
    """The candidate terms of a mechanism that few windows can show; of what is time-varying, its mean."""
    terms = search.candidate_terms(mechanism)
    plain = [s for s in terms if not (s.variant.per_recording or isinstance(s.variant, OwnCurve))]
    lasting = [s for s in plain if not isinstance(s.variant, Spline)]
    varying = [s for s in plain if is_time_varying(s)]
    return [*lasting, *(held_steady(s, search.e) for s in varying[:1])]


def candidates(search: Search, base: Model, spans: list[Span]) -> list[Model]:
    """Every mechanism as if it acted in the spans alone, added to `base` and fitted, best first.

    What has a size of its own in every recording, or a curve of its own, is too free for a few windows.
    """
    options = [
        during(s, spans, search.e)
        for mechanism in search.library
        if mechanism.comes_and_goes and mechanism.effect not in base.effects
        for s in steady(search, mechanism)
    ]
    seen = [s for s in options if np.abs(s.columns[search.e.valid]).max(initial=0.0) > 1e-6]
    best = _fitted(search, base, seen, {}, None)
    if best:  # noise that has swallowed the windows hides names for them
        best = _fitted(search, base, seen, best, max(best.values(), key=lambda m: m.score))
    return sorted(best.values(), key=lambda m: -m.score)


def _fitted(
    search: Search, base: Model, options: list[CandidateTerm], best: dict[str, Model], leader: Model | None
) -> dict[str, Model]:
    """The best model of each of the first FITTED names in its first FORMS, and of those in `best`; from the
    noise of the leader where there is one."""
    best, tried = dict(best), Counter[str]()
    for _, option in screen_terms(search, base, options, leader):
        effect = option.mechanism.effect
        if tried[effect] == FORMS or (effect not in tried and len(tried) >= FITTED):
            continue
        tried[effect] += 1
        model = search.model((*base.named, option), base.free, (leader or base).fit, again=leader is not None)
        if effect not in best or model.score > best[effect].score:
            best[effect] = model
    return best


def bursts(search: Search, model: Model) -> Cause | None:
    """What a model leaves over in short windows, of any size and sign in each.

    None where it is little, or the simulator a learned one, whose model discrepancy comes in bursts too.
    """
    e = search.e
    spans = windows(e, model) if e.model_discrepancy == 0 else []
    spans = narrowed(search, model, spans)
    if not spans:
        return None
    noisy = search.model((*model.named, unnamed(search, spans)), model.free, model.fit)
    gain = noisy.score - model.score
    force = noisy.named[-1].columns @ noisy.coefficients(UNNAMED.effect)
    if gain < search.rules.clear or not large_enough(e, force):
        return None
    return Cause("missing_physics", UNNAMED.effect, gain, 1.0, force, time_varying=True, rules=e.rules)
