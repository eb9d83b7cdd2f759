"""From evidence to findings: names, groups, parameter errors, what is unknown, and silence."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.mismatch.free_model import FreeModel, free_model
from deeptruck_model.mismatch.mechanisms import Shape
from deeptruck_model.mismatch.noise import Prior, fit
from deeptruck_model.mismatch.search import TEMPER, Model, Search

Array = NDArray[np.float64]

ENOUGH = 12.0  # nats a name must gain: the price of searching the library, and of noise that is not quite as modelled
ENOUGH_FREE = 25.0  # nats the free model must gain on what is left before 'unknown' is said
WIDENED = 4  # of the best names are given more freedom of form before the first is chosen
MOST = 4  # effects at once
FREE_R2 = 0.03  # and the share of held-out variance it must explain
GROUP = 9.0  # nats within which two names count as not told apart
EXPLAINS = 0.6  # share of what is explainable that a name must explain, else it is only the nearest relative
PRACTICAL_FORCE = 0.004  # m/s^2 rms over all time, or ...
PRACTICAL_WHEN_ACTING = 0.02  # m/s^2 rms over the tenth of the time when it acts most
BESIDE = 0.1  # a further name must gain this share of what the others gained: a form not quite right invites company
BENT = 0.15  # share of the main cause's gain that a parameter beside it must have
PARAMETER_PRACTICAL = 0.025  # relative


@dataclass(frozen=True)
class Cause:
    """One accepted cause: a mechanism (with its shape) or a parameter, or what no name explains (`effect` 'unknown')."""

    kind: str
    effect: str
    gain: float
    share: float
    probability: float
    force: Array  # specific force it adds to the simulator, (n,), m/s^2
    shape: Shape | None = None
    rivals: tuple[tuple[str, float], ...] = ()  # other names and by how many nats they are worse
    nearest: str | None = None


@dataclass(frozen=True)
class Explanation:
    """Everything found on one body of evidence."""

    causes: tuple[Cause, ...]
    model: Model
    parameters_only: Model
    null: Model
    left_over: FreeModel
    left_over_gain: float
    ranking: tuple[
        tuple[str, float], ...
    ]  # every name tried beside the first cause, with its gain over parameters alone


def first_guess(search: Search) -> Model:
    """Parameters alone, or with the one best mechanism: enough to see how far the parameters are off."""
    base = search.background(())
    best = max(search.candidates(base), key=lambda m: m.score, default=base)
    return best if best.score > base.score + ENOUGH else base


def explain(search: Search) -> Explanation:
    """Search, prune, group, and weigh what was found against the free model."""
    e = search.e
    null = search.model((), frozenset())
    parameters_only = search.background(())
    model, ranking = _grow(search, parameters_only)
    left = free_model(e, e.residual - _prediction(search, model), search.series.relative)
    left_gain = _free_gain(search, model, left)
    causes = _causes(search, model, null, left, left_gain)
    return Explanation(tuple(causes), model, parameters_only, null, left, left_gain, ranking)


def _grow(search: Search, base: Model) -> tuple[Model, tuple[tuple[str, float], ...]]:
    """Add the best mechanism while it is worth it; then drop those that no longer are."""
    ranking: tuple[tuple[str, float], ...] = ()
    bare = base
    while len(base.named) < MOST:
        candidates = search.candidates(base)
        if not ranking:
            ranking = tuple((m.effects[-1], m.score - base.score) for m in candidates)
        candidates = [m for m in candidates if _practical(search, m, m.named[-1])]
        candidates = [search.enriched(m) for m in candidates[:WIDENED] if m.score > base.score + ENOUGH / 2]
        best = max(candidates, key=lambda m: m.score, default=base)
        if best.score < base.score + ENOUGH + BESIDE * (base.score - bare.score):
            break
        base = search.background(best.named)
    while len(base.named) > 1:
        without = [search.background(tuple(n for n in base.named if n is not shape)) for shape in base.named]
        weakest = max(without, key=lambda m: m.score)
        if weakest.score < base.score - ENOUGH - BESIDE * (base.score - bare.score):
            break
        base = weakest
    return base, ranking


def _practical(search: Search, model: Model, shape: Shape) -> bool:
    force = shape.columns @ model.coefficients(shape.mechanism.effect)
    acting = np.sort(np.abs(force[search.e.valid]))
    rms = float(np.sqrt(np.mean(acting**2)))
    top = float(np.sqrt(np.mean(acting[-max(1, len(acting) // 10) :] ** 2)))
    return rms > PRACTICAL_FORCE or top > PRACTICAL_WHEN_ACTING


def _prediction(search: Search, model: Model) -> Array:
    X, _, _ = search.design(model)
    return X @ model.fit.b


def _free_gain(search: Search, model: Model, left: FreeModel) -> float:
    """Nats gained by adding the free model's out-of-fold prediction as a column."""
    X, prior, _ = search.design(model)
    column = Prior(np.array([0.7]), np.array([0.4]), np.array([1.0]))
    found = fit(search.series, np.column_stack([X, left.prediction]), Prior.join(prior, column), model.fit)
    return found.evidence - model.fit.evidence


def _causes(search: Search, model: Model, null: Model, left: FreeModel, left_gain: float) -> list[Cause]:
    named = [_mechanism(search, model, shape) for shape in model.named]
    tuned = [c for p in sorted(model.free) if (c := _parameter(search, model, p)) is not None]
    if named:  # a form that is not quite right bends the parameters a little; that is no finding
        most = max(c.gain for c in named)
        tuned = [c for c in tuned if c.gain > BENT * most]
    causes = named + tuned
    explained = max(model.score - null.score, 1e-9)
    unknown = left_gain > ENOUGH_FREE and left_gain > 0.15 * explained and left.r2 > FREE_R2
    total = explained + max(left_gain, 0.0)
    weight = sum(max(c.gain, 0.0) for c in causes) or 1.0
    causes = [replace(c, share=max(c.gain, 0.0) / weight * explained / total) for c in causes]
    causes.sort(key=lambda c: -c.gain)
    if unknown:
        rest = Cause("missing_physics", "unknown", left_gain, left_gain / total, 0.9, left.prediction)
        if causes and explained / total < EXPLAINS and causes[0].kind == "missing_physics":
            rest = replace(rest, nearest=causes[0].effect)
            causes = [rest, *[c for c in causes if c.kind != "missing_physics"]]
        else:
            causes.append(rest)
            causes.sort(key=lambda c: -c.share)
    return causes


def _mechanism(search: Search, model: Model, shape: Shape) -> Cause:
    """One named effect with the names that would do nearly as well in its place."""
    others = tuple(n for n in model.named if n is not shape)
    base = search.background(others)
    gain = model.score - base.score
    tried = [m for m in search.candidates(base) if m.effects[-1] != shape.mechanism.effect]
    tried = [search.enriched(m) for m in tried[: WIDENED - 1]] + tried[WIDENED - 1 :]
    rivals = [(m.effects[-1], model.score - m.score) for m in tried]
    for p in search.parameters:
        if p not in base.free:
            alone = search.model(others, base.free | {p})
            rivals.append((p, model.score - alone.score))
    rivals = sorted(((n, float(worse)) for n, worse in rivals), key=lambda item: item[1])
    odds = 1.0 + sum(np.exp(-worse / TEMPER) for _, worse in rivals) + np.exp(-gain / TEMPER)
    return Cause(
        shape.mechanism.kind,
        shape.mechanism.effect,
        gain,
        0.0,
        float(1.0 / odds),
        shape.columns @ model.coefficients(shape.mechanism.effect),
        shape,
        tuple(rivals),
    )


def _parameter(search: Search, model: Model, name: str) -> Cause | None:
    """A parameter that must move, by how much its being held would cost; None where it hardly moves."""
    held = search.model(model.named, model.free - {name})
    gain = model.score - held.score
    value = search.e.total_change(name, model.change(name))
    if abs(value) < PARAMETER_PRACTICAL or gain < (ENOUGH if model.named else ENOUGH / 2):
        return None
    rivals = []
    for p in search.parameters:
        if p not in model.free:
            rivals.append((p, model.score - search.model(model.named, model.free - {name} | {p}).score))
    probability = 1.0 / (1.0 + sum(np.exp(-w / TEMPER) for _, w in rivals) + np.exp(-gain / TEMPER))
    force = search.e.sensitivity[name] * value  # of the simulator as given, to first order
    return Cause(
        "parameter_error",
        name,
        gain,
        0.0,
        float(probability),
        force,
        None,
        tuple(sorted(rivals, key=lambda r: r[1])),
    )
