"""From evidence to findings: names, groups, parameter errors, what is unknown, and silence."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from deeptruck_model.mismatch import intermittent
from deeptruck_model.mismatch.evidence import Evidence
from deeptruck_model.mismatch.free_model import FreeModel, free_model
from deeptruck_model.mismatch.mechanisms import UNNAMED, Shape, comes_and_goes
from deeptruck_model.mismatch.plain_truck import plain_truck
from deeptruck_model.mismatch.search import TEMPER, Model, Search
from deeptruck_model.mismatch.slow_force import SlowForce, slow_force

Array = NDArray[np.float64]

ENOUGH = 20.0  # nats a name must gain: the price of the search, and of noise not quite as modelled
ENOUGH_LEARNED = 40.0  # the same for a learned simulator, whose own error is never quite known
ENOUGH_FREE = 40.0  # nats the free model must gain on what is left before 'unknown' is said
WIDENED = 4  # of the best names are given more freedom of form before the first is chosen
MOST = 4  # effects at once
EXCHANGES = 3
WORTH_AN_EXCHANGE = 3.0  # nats
INSTEAD = 4  # mechanisms tried in place of each parameter
FREE_R2 = 0.06  # and the share of held-out variance it must explain
GROUP = 9.0  # nats within which two names count as not told apart, or ...
GROUP_SHARE = 0.12  # of the gain: no form is quite right, and the larger an effect the more nats that costs
EXPLAINS = 0.6  # share of what is explainable that a name must explain, else it is only the nearest relative
PRACTICAL_FORCE = 0.012  # m/s^2 rms over all time, what a slope sensor 0.1 % off makes, or ...
IMPOSSIBLE = 4.0  # prior sd; priors say what is physically possible
PRACTICAL_WHEN_ACTING = 0.02  # m/s^2 rms over the tenth of the time when it acts most
BESIDE = 0.2  # a further name must gain this share of the others' gain: a form not quite right invites more
TRIFLE = 0.03  # a cause with a smaller share of what is explained is as likely a bend in the form of another
BENT = 0.15  # share of the main cause's gain that a parameter beside it must have
BEFORE_PARAMETERS = 0.25  # of the largest share, below which physics is told after parameters
SLOW_S = 8.0  # smoothing of a slow force where it has no knots of its own
SLOW_NAMES = {"road_grade", "road_surface", "headwind", "payload_change"}
# Beyond what sensor filters and message periods make late.
PRACTICAL_S = {"delay": 0.15, "time_constant": 0.1}
LEARNABLE = 0.05  # m/s^2 rms; a well-trained simulator's own error is smaller
PARAMETER_PRACTICAL = 0.025  # relative


@dataclass(frozen=True)
class Cause:
    """One accepted cause: a mechanism (with its shape), a parameter, or what no name explains (`unknown`)."""

    kind: str
    effect: str
    gain: float
    share: float
    probability: float
    force: Array  # specific force it adds to the simulator, (n,), m/s^2
    shape: Shape | None = None
    rivals: tuple[tuple[str, float], ...] = ()  # other names and by how many nats they are worse
    nearest: str | None = None
    needed: dict[str, float] | None = None  # for a slow force: the size each possible name would need
    lawless: bool = False  # an unknown force that comes and goes, and not one that the signals predict

    @property
    def predictable(self) -> bool:
        """Whether it is unknown, but the signals predict it: it has a shape over them, and perhaps a
        formula."""
        return self.effect == "unknown" and not self.lawless and self.needed is None

    @property
    def not_told_from(self) -> list[str]:
        """Names that do nearly as well."""
        near = max(GROUP, GROUP_SHARE * self.gain)
        return [name for name, worse in self.rivals if worse < near and name != self.effect]


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
    return best if best.score > base.score + _enough(search) + _price(search, best) else base


def explain(search: Search) -> Explanation:
    """Search, prune, group, and weigh what was found against the free model."""
    e = search.e
    null = search.model((), frozenset())
    parameters_only = search.background(())
    model, ranking = _grow(search, parameters_only)
    left = free_model(e, e.residual - search.prediction(model), search.series.relative)
    left_gain = search.gain_of(model, left.prediction) if left.r2 > 0 else 0.0
    causes = _causes(search, model, null, left, left_gain)
    causes = _with_slow_force(search, model, left, causes)
    return Explanation(tuple(causes), model, parameters_only, null, left, left_gain, ranking)


def _grow(search: Search, base: Model) -> tuple[Model, tuple[tuple[str, float], ...]]:
    """Add the best mechanism while it is worth it; then drop those that no longer are."""
    ranking: tuple[tuple[str, float], ...] = ()
    bare = search.model((), frozenset()) if search.e.own_error > 0 else base
    while len(base.named) < MOST:
        candidates = search.candidates(base)
        if not ranking:
            ranking = tuple((m.effects[-1], m.score - base.score) for m in candidates)
        candidates = [m for m in candidates if _practical(search, m, m.named[-1])]
        candidates = [search.enriched(m) for m in candidates[:WIDENED] if m.score > base.score + ENOUGH / 2]
        best = max(candidates, key=lambda m: m.score - _price(search, m), default=base)
        if best.score < base.score + _price(search, best) + _enough(search) + BESIDE * (
            base.score - bare.score
        ):
            break
        base = search.background(best.named)
    while len(base.named) > 1:
        without = [search.background(tuple(n for n in base.named if n is not shape)) for shape in base.named]
        weakest = max(without, key=lambda m: m.score)
        if weakest.score < base.score - _enough(search) - BESIDE * (base.score - bare.score):
            break
        base = weakest
    base = _exchanged(search, base)
    return _now_and_then(search, base), ranking


def _now_and_then(search: Search, base: Model) -> Model:
    """Add a mechanism that acts in a few windows alone, where one explains them."""
    spans = intermittent.windows(search.e, base) if search.e.own_error == 0 else []
    if not spans:
        return base
    tried = [m for m in intermittent.candidates(search, base, spans) if _practical(search, m, m.named[-1])]
    best = max(tried, key=lambda m: m.score, default=base)
    return best if best.score > base.score + ENOUGH else base


def _exchanged(search: Search, model: Model) -> Model:
    """Each mechanism in turn gives way to one that does better beside the others: the first was chosen
    alone."""
    for _ in range(EXCHANGES):
        before = model
        for shape in model.named:
            others = tuple(n for n in model.named if n is not shape)
            options = [
                search.enriched(m)
                for m in search.candidates(search.background(others))[:WIDENED]
                if _practical(search, m, m.named[-1])
            ]
            best = max(options, key=lambda m: m.score - _price(search, m), default=model)
            better = search.background(best.named)
            if better.score > model.score + WORTH_AN_EXCHANGE:
                model = better
                break
        if model is before:
            break
    return model


def _enough(search: Search) -> float:
    return ENOUGH_LEARNED if search.e.own_error > 0 else ENOUGH


def _price(search: Search, model: Model) -> float:
    """Nats the last name of a model would gain from the simulator's own error alone."""
    if not model.named:
        return 0.0
    last = model.named[-1]
    force = last.columns @ model.coefficients(last.mechanism.effect)
    if _beyond_learning(search.e, last, force):
        return 0.0
    return search.e.tolerance.get(last.mechanism.effect, 0.0)


def _practical(search: Search, model: Model, shape: Shape) -> bool:
    b = model.coefficients(shape.mechanism.effect)
    for name, enough in PRACTICAL_S.items():
        times = [value * part.factor for part, value in zip(shape.parts, b, strict=True) if part.name == name]
        if times and abs(sum(times)) < enough:
            return False
    if not comes_and_goes(shape) and (np.abs(b - shape.prior.mean) > IMPOSSIBLE * shape.prior.sd).any():
        return False
    force = shape.columns @ b
    return _beyond_learning(search.e, shape, force) or _large_enough(search.e, force)


def _beyond_learning(e: Evidence, shape: Shape, force: Array) -> bool:
    """Whether the force has a driver that the simulator cannot see and is larger than what is imperfectly
    learned.

    It cannot have been absorbed, so meeting it on the simulator's own recordings too only says that it was
    missing there.
    """
    if shape.columns.shape[1] < 3 and shape.mechanism.effect in (
        "headwind",
        "accessory_load",
        "dragging_brake",
    ):
        return False  # always the same at the same speed, so it would have been learned
    return shape.mechanism.hidden and float(np.sqrt(np.mean(force[e.valid] ** 2))) > LEARNABLE


def _large_enough(e: Evidence, force: Array) -> bool:
    """Whether a force matters on the road and stands out of what the simulator itself learned imperfectly."""
    acting = np.sort(np.abs(force[e.valid]))
    rms = float(np.sqrt(np.mean(acting**2)))
    top = float(np.sqrt(np.mean(acting[-max(1, len(acting) // 10) :] ** 2)))
    return rms > max(PRACTICAL_FORCE, e.own_error) or top > max(PRACTICAL_WHEN_ACTING, 2.0 * e.own_error)


def _causes(search: Search, model: Model, null: Model, left: FreeModel, left_gain: float) -> list[Cause]:
    named = [_mechanism(search, model, shape) for shape in model.named]
    named = [
        c for c in named if not c.rivals or c.rivals[0][1] > -ENOUGH
    ]  # a name that another beats is no name
    tuned = _parameters(search, model)
    if named or tuned:  # a form that is not quite right bends the parameters a little; that is no finding
        most = max(c.gain for c in named + tuned)
        tuned = [c for c in tuned if c.gain > BENT * most]
    causes = named + tuned
    explained = max(model.score - null.score, 1e-9)
    price = search.e.tolerance.get("unknown", 0.0)
    unknown = (
        left_gain > ENOUGH_FREE + price
        and _large_enough(search.e, left.prediction)
        and left_gain > 0.15 * explained
        and left.r2 > FREE_R2
    )
    total = explained + max(left_gain, 0.0)
    weight = sum(max(c.gain, 0.0) for c in causes) or 1.0
    causes = [replace(c, share=max(c.gain, 0.0) / weight * explained / total) for c in causes]
    causes = [c for c in causes if c.share > TRIFLE]
    if unknown:
        rest = Cause("missing_physics", "unknown", left_gain, left_gain / total, 0.9, left.prediction)
        if causes and explained / total < EXPLAINS and causes[0].kind == "missing_physics":
            rest = replace(rest, nearest=causes[0].effect)
            causes = [rest, *[c for c in causes if c.kind != "missing_physics"]]
        else:
            causes.append(rest)
    return _in_order(causes)


def _in_order(causes: list[Cause]) -> list[Cause]:
    """By share, but what was left out before parameters: these moved to make up for it."""
    most = max((c.share for c in causes), default=0.0)

    def rank(c: Cause) -> tuple[bool, float]:
        return c.kind == "parameter_error" or c.share < BEFORE_PARAMETERS * most, -c.share

    return sorted(causes, key=rank)


def _with_slow_force(search: Search, model: Model, left: FreeModel, causes: list[Cause]) -> list[Cause]:
    """Add a slow force that only its size tells from noise, unless a name already stands for one."""
    e = search.e
    if any(c.effect in SLOW_NAMES or c.lawless for c in causes):
        return causes
    residual = e.residual - search.prediction(model) - left.prediction
    found = _beside_a_learned_truck(e) if e.own_error > 0 else None
    if found is None:
        sigma = float(1.4826 * np.median(np.abs(residual[e.valid])))
        found = slow_force(e, residual, 1.0 / search.series.relative**2, sigma)
    if found is None:
        return causes
    known = {m.effect for m in search.library}
    possible = [n for n in found.possible if n in known and (n != "road_grade" or not e.has("grade"))]
    effect = possible[0] if possible else "unknown"
    if "road_grade" in possible:
        effect = "road_grade"  # where slope is not recorded it is there, and the other two only may be
    share = float(np.sum(found.force[e.valid] ** 2) / np.sum(residual[e.valid] ** 2))
    rivals = tuple((n, 0.0) for n in possible if n != effect)
    cause = Cause(
        "missing_physics",
        effect,
        0.0,
        min(share, 1.0),
        round(1.0 / (1.0 + 0.5 * len(rivals)), 2),
        found.force,
        rivals=rivals,
        needed=found.needed,
    )
    rest = [
        replace(c, share=c.share * (1 - cause.share))
        for c in causes
        if c.effect != "unknown" or effect != "unknown"
    ]
    return _in_order([*rest, cause])


def _beside_a_learned_truck(e: Evidence) -> SlowForce | None:
    """A slow force that a learned truck follows and a line through the recordings does not."""
    line = plain_truck(e)
    if line is None:
        return None
    known = np.isfinite(line.left)
    sigma = float(1.4826 * np.median(np.abs(line.left[known])))
    return slow_force(e, np.where(known, line.left, 0.0), known.astype(float), sigma, line.doubt)


def _mechanism(search: Search, model: Model, shape: Shape) -> Cause:
    """One named effect with the names that would do nearly as well in its place."""
    others = tuple(n for n in model.named if n is not shape)
    base = search.background(others)
    gain = model.score - base.score
    if "when" in shape.settings:
        spans = [(int(i), first, last) for i, first, last in shape.settings["when"]]
        tried = intermittent.candidates(search, base, spans)
    else:
        tried = search.candidates(base)
        tried = [search.enriched(m) for m in tried[:WIDENED]] + tried[WIDENED:]
    tried = [m for m in tried if m.effects[-1] != shape.mechanism.effect]
    rivals = [(m.effects[-1], model.score - m.score) for m in tried]
    for p in search.parameters:
        if p not in base.free:
            alone = search.model(others, base.free | {p})
            rivals.append((p, model.score - alone.score))
    rivals = sorted(((n, float(worse)) for n, worse in rivals), key=lambda item: item[1])
    odds = 1.0 + sum(np.exp(-worse / TEMPER) for _, worse in rivals) + np.exp(-gain / TEMPER)
    lawless = _lawless(search, model, shape, gain)
    if lawless is not None:
        force = lawless.named[-1].columns @ lawless.coefficients(UNNAMED.effect)
        more = gain + lawless.score - model.score
        return Cause(
            "missing_physics", "unknown", more, 0.0, 0.9, force, nearest=shape.mechanism.effect, lawless=True
        )
    return Cause(
        shape.mechanism.kind,
        shape.mechanism.effect,
        gain,
        0.0,
        float(1.0 / odds),
        _force(search, model, shape),
        shape,
        tuple(rivals),
    )


def _lawless(search: Search, model: Model, shape: Shape, gain: float) -> Model | None:
    """The same model with an unnamed force in place of one that comes and goes, where that is far better.

    A name for such a force says how it acts, with speed squared or with the pull; one that acts otherwise is
    told by this alone.
    """
    if not comes_and_goes(shape) or search.e.own_error > 0:
        return None  # a learned truck follows slow forces in part, so that none of them acts as it should
    others = tuple(n for n in model.named if n is not shape)
    base = search.model(others, model.free, model.fit)
    scored = search.screen_shapes(base, search.shapes(UNNAMED))[:2]
    options = [search.enriched(search.model((*others, s), model.free, model.fit)) for _, s in scored]
    best = max(options, key=lambda m: m.score, default=model)
    return best if best.score > model.score + max(ENOUGH, GROUP_SHARE * gain) else None


def _force(search: Search, model: Model, shape: Shape) -> Array:
    """What a mechanism adds, (n,). A profile whose knots did not reach every recording goes on as a smooth
    residual."""
    e = search.e
    force = shape.columns @ model.coefficients(shape.mechanism.effect)
    if shape.mechanism.effect != "road_grade":
        return force
    left = np.where(e.valid, e.residual - search.prediction(model) + force, 0.0)
    weight = e.valid / search.series.relative**2
    width = SLOW_S / e.dt
    smooth = gaussian_filter1d(left * weight, width) / np.maximum(gaussian_filter1d(weight, width), 1e-3)
    reached = np.zeros(len(e), dtype=bool)
    for i in np.unique(e.record[np.abs(shape.columns).max(axis=1) > 0]):
        reached |= e.record == i
    return np.where(reached, force, smooth)


def _parameters(search: Search, model: Model) -> list[Cause]:
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
        name = next(iter(options[0].free - grown.free))
        others = [(next(iter(m.free - grown.free)), options[0].score - m.score) for m in options[1:]]
        others += [(m.effects[-1], options[0].score - m.score) for m in _instead(search, grown)]
        cause = _parameter(search, model, name, options[0].score - grown.score, others)
        if cause is not None:
            out.append(cause)
        grown = options[0]
    return out


def _instead(search: Search, model: Model) -> list[Model]:
    """The best mechanisms in place of one more parameter: what grows with speed may be drag or tyres."""
    best: dict[str, Shape] = {}
    for _, shape in search.screen(model):
        best.setdefault(shape.mechanism.effect, shape)
    tried = [
        search.model((*model.named, shape), model.free, model.fit) for shape in list(best.values())[:INSTEAD]
    ]
    return sorted(tried, key=lambda m: -m.score)


def _parameter(
    search: Search, model: Model, name: str, gain: float, others: list[tuple[str, float]]
) -> Cause | None:
    """A parameter that must move; None where it hardly moves or hardly matters."""
    value = search.e.total_change(name, model.change(name))
    enough = _enough(search) + search.e.tolerance.get(f"parameter:{name}", 0.0)
    force = search.e.sensitivity[name] * value  # of the simulator as given, to first order
    if abs(value) < PARAMETER_PRACTICAL or not _large_enough(search.e, force) or gain < enough:
        return None
    odds = 1.0 + sum(np.exp(-max(w, 0.0) / TEMPER) for _, w in others) + np.exp(-gain / TEMPER)
    rivals = tuple(sorted(others, key=lambda item: item[1]))
    return Cause("parameter_error", name, gain, 0.0, float(1.0 / odds), force, None, rivals)
