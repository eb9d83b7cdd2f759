"""What is missing only now and then: first where, then what.

A valve that sticks twice an hour is lost among hours in which it does not. So short windows are sought in
which the simulator is plainly wrong, and mechanisms are fitted as if they acted in those windows alone.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.mismatch.evidence import Evidence
from deeptruck_model.mismatch.mechanisms import Mechanism, Shape, build, comes_and_goes, held_steady
from deeptruck_model.mismatch.screening import screen_shapes
from deeptruck_model.mismatch.search import TEMPER, Model, Search

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Span = tuple[int, float, float]  # recording, from and to in s since its start

LENGTHS_S = (0.6, 2.0, 6.0)
PLAIN = 6.5  # sd by which the mean over a window must be off
LARGEST = 6.0  # a single sample counts as no more than this
AROUND_S = 1.5
CREEPING = 2.5  # m/s: slower, idling engines and slipping clutches turn on a hair of speed
MOST = 0.06  # share of the time; beyond, it is no exception
PER_WINDOW = 6.0  # nats: the price of having looked for it
FITTED = 6
ALWAYS = ("clock_offset", "grade_bias")  # a clock or a sensor is off always or not at all


def windows(e: Evidence, model: Model) -> list[Span]:
    """Spans in which the innovations of a model are off together; none where they are no exception."""
    z = np.clip(np.nan_to_num(model.fit.innovations), -LARGEST, LARGEST)
    known = np.isfinite(model.fit.innovations)
    off = np.zeros(len(e), dtype=bool)
    for length_s in LENGTHS_S:
        width = max(2, round(length_s / e.dt))
        kernel = np.ones(width)
        count = np.maximum(np.convolve(known, kernel, mode="same"), 1.0)
        off |= (np.abs(np.convolve(z, kernel, mode="same")) > PLAIN * np.sqrt(count)) & (count >= width / 2)
    off &= ~_near_other_gear(e) & (e["speed"] > CREEPING)
    near = np.convolve(off, np.ones(2 * round(AROUND_S / e.dt) + 1), mode="same") > 0.5
    if not off.any() or near[e.valid].mean() > MOST:
        return []
    return _spans(e, near)


def _near_other_gear(e: Evidence) -> Mask:
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


def during(shape: Shape, spans: list[Span], e: Evidence) -> Shape:
    """The shape confined to the spans."""
    record, elapsed = e.record, e["elapsed"]
    inside = np.zeros(len(e))
    for i, first, last in spans:
        inside[(record == i) & (elapsed >= first) & (elapsed <= last)] = 1.0
    settings = shape.settings | {"when": [list(span) for span in spans]}
    parts = tuple(build(shape.mechanism, settings))
    trials = shape.trials * float(np.exp(PER_WINDOW / TEMPER * len(spans)))
    return replace(
        shape, settings=settings, parts=parts, columns=shape.columns * inside[:, None], trials=trials
    )


def _steady(search: Search, mechanism: Mechanism) -> list[Shape]:
    """The shapes of a mechanism that few windows can show; of what only comes and goes, its mean."""
    shapes = search.shapes(mechanism)
    plain = [s for s in shapes if not {"each", "recordings", "own"} & set(s.settings)]
    lasting = [s for s in plain if not comes_and_goes(s)]
    return lasting or [held_steady(s, search.e) for s in plain[:1]]


def candidates(search: Search, base: Model, spans: list[Span]) -> list[Model]:
    """Every mechanism as if it acted in the spans alone, added to `base` and fitted, best first.

    What has a size of its own in every recording, or a curve of its own, is too free for a few windows.
    """
    best: dict[str, Model] = {}
    options = [
        during(s, spans, search.e)
        for mechanism in search.library
        if mechanism.effect not in (*base.effects, *ALWAYS)
        for s in _steady(search, mechanism)
    ]
    seen = [s for s in options if np.abs(s.columns[search.e.valid]).max(initial=0.0) > 1e-6]
    for _, shape in screen_shapes(search, base, seen):
        effect = shape.mechanism.effect
        if effect in best or len(best) < FITTED:
            model = search.model((*base.named, shape), base.free, base.fit)
            if effect not in best or model.score > best[effect].score:
                best[effect] = model
        if len(best) == FITTED:
            break
    return sorted(best.values(), key=lambda m: -m.score)
