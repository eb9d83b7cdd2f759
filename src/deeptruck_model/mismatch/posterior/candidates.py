"""The names worth adding to a model, each fitted in full and widened where that pays."""

from __future__ import annotations

from deeptruck_model.mismatch.mechanisms import Shape, comes_and_goes, merge
from deeptruck_model.mismatch.posterior.penalties import slow_price
from deeptruck_model.mismatch.posterior.screening import screen, screen_regimes
from deeptruck_model.mismatch.posterior.search import ONE_SIZE, Model, Search

MORE_SHAPES = 2  # further shapes a mechanism may be widened by
WORTH_A_SHAPE = 4.0  # nats a further shape of the same mechanism must gain
MOST_COLUMNS = 8  # profiles with more columns are wide enough as they are
FITTED = 8  # mechanisms that are fitted in full in each round
SECOND_SHAPES = 9  # among the first of these, more than one shape of a mechanism
LEADING = 4  # mechanisms also tried without freeing the parameters


def candidates(search: Search, base: Model) -> list[Model]:
    """Every mechanism added to `base`, fitted in full with its parameters free and held, best first.

    The noise beside `base` alone holds what is missing, and so hides some of the names for it; they are
    looked for again under the noise beside the best of the first.
    """

    def worth(model: Model) -> float:
        return model.score - slow_price(model, base)

    best = _fitted(search, base, screen(search, base), {})
    if best:
        leader = max(best.values(), key=worth)
        best = _fitted(search, base, screen(search, base, leader), best, leader)
    leading = sorted(best.values(), key=worth, reverse=True)
    for model in leading[:LEADING]:
        held = search.model(model.named, base.free, base.fit)
        if held.score > model.score:
            best[model.effects[-1]] = held
    return sorted(best.values(), key=worth, reverse=True)


def _fitted(
    search: Search,
    base: Model,
    screened: list[tuple[float, Shape]],
    best: dict[str, Model],
    leader: Model | None = None,
) -> dict[str, Model]:
    """The best model of each of the first FITTED effects that were screened, and of those in `best`; from
    the noise of the leader where there is one."""
    everything = frozenset(search.parameters)
    best, seen = dict(best), set[str]()
    for rank, (_, shape) in enumerate(screened):
        effect = shape.mechanism.effect
        if effect not in seen and len(seen) >= FITTED:
            continue
        if effect in seen and rank >= SECOND_SHAPES and not comes_and_goes(shape):
            continue
        seen.add(effect)
        named, start = (*base.named, shape), (leader or base).fit
        model = search.model(named, everything, start, again=leader is not None)
        worth = model.score - slow_price(model, base)
        if effect not in best or worth > best[effect].score - slow_price(best[effect], base):
            best[effect] = model
    return best


def enriched(search: Search, model: Model) -> Model:
    """The same explanation with its last mechanism given more freedom where that pays.

    First it may be confined to a regime of driving, then widened by more of its shapes.
    """
    last = model.named[-1]
    if last.mechanism.effect in ONE_SIZE:
        return model
    model = _confined(search, model)
    if comes_and_goes(last):
        return model
    for _ in range(MORE_SHAPES):
        *others, last = model.named
        taken = [str(part) for part in last.settings.get("parts", [last.settings])]
        options = [
            search.model((*others, merge(last, s)), model.free, model.fit)
            for s in search.shapes(last.mechanism)
            if str(s.settings) not in taken and s.columns.shape[1] <= MOST_COLUMNS
        ]
        best = max(options, key=lambda m: m.score, default=model)
        if best.score < model.score + WORTH_A_SHAPE:
            break
        model = best
    return model


def _confined(search: Search, model: Model) -> Model:
    *others, last = model.named
    base = search.model(tuple(others), model.free, model.fit)
    confined = [s for _, s in screen_regimes(search, base, _everywhere(search, last), model)]
    options = [search.model((*others, s), model.free, model.fit) for s in confined]
    best = max(options, key=lambda m: m.score, default=model)
    return best if best.score > model.score + WORTH_A_SHAPE else model


def _everywhere(search: Search, shape: Shape) -> Shape:
    """The shape that was confined to a regime, without it: its border was chosen under other noise."""
    plain = {k: v for k, v in shape.settings.items() if k != "gate"}
    return next((s for s in search.shapes(shape.mechanism) if s.settings == plain), shape)
