"""From evidence to findings: names, groups, parameter errors, what is unknown, and silence."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.mismatch.mechanisms import is_time_varying
from deeptruck_model.mismatch.mechanisms.road import BOTH
from deeptruck_model.mismatch.posterior.causes import Cause, Explanation
from deeptruck_model.mismatch.posterior.free_law import FreeModel, LeftOver, left_over
from deeptruck_model.mismatch.posterior.naming import asked_for, renamed, with_the_rest
from deeptruck_model.mismatch.posterior.penalties import discrepancy_penalty, large_enough
from deeptruck_model.mismatch.posterior.rivals import named_cause, tuned_causes
from deeptruck_model.mismatch.posterior.road_lock import road_lock
from deeptruck_model.mismatch.posterior.search import Model, Search
from deeptruck_model.mismatch.posterior.slow_force import SlowForce, plain_truck, slow_force
from deeptruck_model.mismatch.posterior.stepwise import grow
from deeptruck_model.mismatch.posterior.windows import bursts
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.rules import Rules

Array = NDArray[np.float64]

SLOW_NAMES = {*BOTH, "headwind", "payload_change"}


def explain(search: Search) -> Explanation:
    """Search, prune, group, and weigh what was found against the free model."""
    null = search.model((), frozenset())
    parameters_only = search.background(())
    model, ranking = grow(search, parameters_only)
    model = renamed(search, asked_for(search, _fewest_parameters(search, model, null)))
    left = _beyond_its_own(search, left_over(search, model))
    causes = _causes(search, model, null, left)
    rest = next((c for c in causes if c.predictable and not c.nearest), None)
    wider = model if rest is None else with_the_rest(search, model, rest.force)
    if wider is not model:
        model, left = wider, _beyond_its_own(search, left_over(search, wider))
        causes = _causes(search, model, null, left)
    causes = _with_slow_force(search, model, left.free, causes)
    if all(c.kind != "missing_physics" for c in causes):
        causes = _with_bursts(search, model, causes)
    causes = _one_unknown(causes)
    if search.torque is not None:
        causes = [replace(c, reported=search.torque.shows(c.force, search.rules.told_gain)) for c in causes]
    return Explanation(
        tuple(causes), model, parameters_only, null, left.free, left.gain, left.lawful, ranking
    )


def _fewest_parameters(search: Search, model: Model, null: Model) -> Model:
    """Beside a learned simulator, the model with no more free parameters than it needs.

    A physics truck answers exactly what another mass does. Of a learned one it is known as roughly as its
    forces are split from its acceleration. So what a further parameter gains within that coarseness tells
    nothing, and takes from what is known of the first: a mass, or a mass and a gain, say the same.
    """
    if search.e.model_discrepancy == 0.0:
        return model
    rules = search.rules
    nearly = model.score - max(rules.temper, rules.coarse * (model.score - null.score))
    fewest = search.model(model.named, frozenset(), model.fit)
    while fewest.score < nearly and fewest.free < model.free:
        more = [search.model(model.named, fewest.free | {p}, model.fit) for p in model.free - fewest.free]
        fewest = max(more, key=lambda m: m.score)
    return fewest if fewest.score >= nearly else model


def _beyond_its_own(search: Search, left: LeftOver) -> LeftOver:
    """What is left over without the nats that a learned simulator's model discrepancy gives for it."""
    own = discrepancy_penalty(search, left.lawful) if left.lawful else search.e.tolerance.get("unknown", 0.0)
    return replace(left, gain=max(left.gain - own, 0.0)) if own > 0.0 else left


def _causes(search: Search, model: Model, null: Model, left: LeftOver) -> list[Cause]:
    named = [named_cause(search, model, term) for term in model.named]
    if search.e.model_discrepancy > 0.0:  # a name that another beats is no name
        named = [c for c in named if not c.rivals or c.rivals[0][1] > -search.rules.least_gain]
    explained = max(model.score - null.score, 1e-9)
    names = sum(c.gain for c in named)
    unknown = _worth_calling_unknown(search.e, left, explained, names)
    tuned = tuned_causes(search, left.lawful if unknown and left.lawful else model)
    if named or tuned:  # a form that is not quite right biases the parameters a little; that is no finding
        most = max([c.gain for c in named + tuned] + ([left.gain] if unknown else []))
        tuned = [c for c in tuned if c.gain > search.rules.form_share * most]
    causes = named + tuned
    total = explained + max(left.gain, 0.0)
    weight = sum(max(c.gain, 0.0) for c in causes) or 1.0
    causes = [replace(c, share=max(c.gain, 0.0) / weight * explained / total) for c in causes]
    causes = _unverified(search.e, causes)
    if not unknown:
        return _in_order(causes, search.rules)
    rest = Cause(
        "missing_physics",
        "unknown",
        left.gain,
        left.gain / total,
        left.free.prediction,
        rules=search.rules,
    )
    physics = [c for c in causes if c.kind == "missing_physics"]
    main = max(physics, key=lambda c: c.gain, default=rest)
    if (
        names > search.rules.other_share * (names + left.gain)
        and main.term
        and left.is_form_of(main.term, search.e)
    ):
        whole = replace(main, share=main.share + rest.share, force=main.force + rest.force, other_form=True)
        return _in_order([whole, *[c for c in causes if c is not main]], search.rules)
    if physics and names < 0.5 * (names + left.gain):
        rest = replace(rest, nearest=main.effect)
        return [rest, *_in_order([c for c in causes if c not in physics], search.rules)]
    return _in_order([*causes, rest], search.rules)


def _one_unknown(causes: list[Cause]) -> list[Cause]:
    """The causes, where what is time-varying without a name and what the signals predict are one finding: the
    one that gained more, with both forces."""
    unknown = sorted((c for c in causes if c.effect == "unknown"), key=lambda c: -c.gain)
    if len(unknown) < 2:
        return causes
    force = np.sum([c.force for c in unknown], axis=0)
    whole = replace(unknown[0], share=sum(c.share for c in unknown), force=force)
    return _in_order([whole, *(c for c in causes if c.effect != "unknown")], whole.rules)


def _unverified(e: Evidence, causes: list[Cause]) -> list[Cause]:
    """The causes; beside a recorded slope, a road that is time-varying and was driven once may as well be
    nothing that has a name. One that comes again was not."""

    def once(c: Cause) -> bool:
        if c.term is None or c.term.variant.comes_again or c.effect not in BOTH or not e.has("grade"):
            return False
        return _follows_anything_slow(c) and road_lock(e, c.force) is None

    return [_perhaps_unknown(c) if once(c) else c for c in causes]


def _perhaps_unknown(c: Cause) -> Cause:
    """The cause with 'unknown' as likely as its name."""
    others = (rival for rival in c.rivals if rival[0] != "unknown")
    return replace(c, rivals=(*others, ("unknown", 0.0)))


def _worth_calling_unknown(e: Evidence, left: LeftOver, explained: float, names: float) -> bool:
    """Whether what is left over is a finding, and not omitted-variable bias of a form not quite right.

    `explained` are the nats of all that was found, `names` those of missing physics with a name.
    """
    force = left.free.prediction[e.valid]
    return (
        left.gain > e.rules.weak
        and large_enough(e, left.free.prediction)
        and float(np.sqrt(np.mean(force**2))) > e.rules.allowance * e.model_discrepancy
        and left.gain > (e.rules.other_share * names if names else e.rules.coarse * explained)
    )


def _in_order(causes: list[Cause], rules: Rules) -> list[Cause]:
    """By share, but what was left out before parameters: these moved to make up for it."""
    most = max((c.share for c in causes), default=0.0)

    def rank(c: Cause) -> tuple[bool, float]:
        return c.kind == "parameter_error" or c.share < rules.other_share * most, -c.share

    return sorted(causes, key=rank)


def _with_slow_force(search: Search, model: Model, left: FreeModel, causes: list[Cause]) -> list[Cause]:
    """Add a slow force that only its size tells from noise, unless a name already stands for one."""
    e = search.e
    if any(c.effect in SLOW_NAMES or c.time_varying or _follows_anything_slow(c) for c in causes):
        return causes
    if e.model_discrepancy > 0 and e.has("grade"):
        return causes  # it has slopes as an input: what is slow and left is its model discrepancy as likely
    found = slow_beside(search, model, left)
    if found is None:
        return causes
    known = {m.effect for m in search.library}
    possible = [n for n in found.possible if n in known and (n != "road_grade" or not e.has("grade"))]
    if not possible and e.model_discrepancy > 0:
        return causes  # larger than any it can be, it is the learned truck's own
    effect = possible[0] if possible else "unknown"
    if any(c.effect == effect for c in causes):
        return causes  # what is left of it is the omitted-variable bias of its form
    if "road_grade" in possible:
        effect = "road_grade"  # where slope is not recorded it is there, and the other two only may be
    road = road_lock(e, found.force)
    if effect == "road_grade" and road is not None and road.other_way_km > 0:
        # no wind and no gain turns its sign where a stretch is driven the other way
        possible = ["road_grade"]
    slow = float(np.sum(found.force[e.valid] ** 2))
    share = slow / (slow + sum(float(np.sum(c.force[e.valid] ** 2)) for c in causes)) if causes else 1.0
    if share < e.rules.other_share:
        return causes  # what a form that is not quite right leaves over is slow too
    residual = _not_explained(search, model, left)
    share = min(share, slow / float(np.sum(residual[e.valid] ** 2)))
    rivals = tuple((n, 0.0) for n in possible if n != effect)
    cause = Cause(
        "missing_physics",
        effect,
        0.0,
        min(share, 1.0),
        found.force,
        rivals=rivals,
        needed=found.needed,
        road=road,
        rules=e.rules,
    )
    rest = [
        replace(c, share=c.share * (1 - cause.share))
        for c in causes
        if c.effect != "unknown" or effect != "unknown"
    ]
    return _in_order([*rest, cause], e.rules)


def slow_beside(search: Search, model: Model, left: FreeModel) -> SlowForce | None:
    """What is slow beside a model and what the signals predict, along all rows that are valid."""
    e = search.e
    found = _beside_a_learned_truck(e) if e.model_discrepancy > 0 else None
    if found is not None:
        return found
    residual = _not_explained(search, model, left)
    sigma = float(1.4826 * np.median(np.abs(residual[e.valid])))
    return slow_force(e, residual, 1.0 / search.series.relative**2, sigma)


def _not_explained(search: Search, model: Model, left: FreeModel) -> Array:
    out: Array = search.e.residual - search.prediction(model) - left.prediction
    return out


def _with_bursts(search: Search, model: Model, causes: list[Cause]) -> list[Cause]:
    """Beside parameters, what acts in bursts as nothing does that has a name."""
    found = bursts(search, model)
    if found is None:
        return causes
    share = found.gain / (found.gain + sum(c.gain for c in causes))
    rest = [replace(c, share=c.share * (1 - share)) for c in causes]
    return _in_order([*rest, replace(found, share=share)], search.rules)


def _follows_anything_slow(cause: Cause) -> bool:
    return cause.term is not None and is_time_varying(cause.term)


def _beside_a_learned_truck(e: Evidence) -> SlowForce | None:
    """A slow force that a learned truck follows and a line through the recordings does not."""
    line = plain_truck(e)
    if line is None:
        return None
    known = np.isfinite(line.left)
    sigma = float(1.4826 * np.median(np.abs(line.left[known])))
    return slow_force(e, np.where(known, line.left, 0.0), known.astype(float), sigma, line.doubt)
