"""What a finding cannot be told from, and what decided for it nevertheless."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from deeptruck_model.mismatch.mechanisms import LIBRARY
from deeptruck_model.mismatch.posterior.causes import SURE
from deeptruck_model.mismatch.posterior.penalties import ENOUGH
from deeptruck_model.mismatch.report.page_words import opened, percent, spoken

IN_PLACE = (  # the bars of the figure are another comparison, and have other numbers
    "These nats are of the one put in place of the other in the whole explanation. The figure of names below "
    "tries each alone."
)
UNDECIDED = f"So little decides nothing (below {ENOUGH:.0f} nats), and the probability is shared."
REFITTED = (
    "Beside all parameters refitted none of them gained what a name needs at a size it can have, so that the "
    "parameter is told."
)
LIMIT = (
    "The fit alone would be surer. The probability is {} at most, with which such names proved right: a "
    "truck may hold a force unlike every form that was tried."
)


def apart(f: dict[str, Any]) -> str:
    """What it cannot be told from and what decided; empty where there was no rival."""
    worse = {r["effect"]: float(r["worse_by_nats"]) for r in f.get("rivals", [])}
    group = f["cannot_be_told_from"]
    if not group:
        return " ".join(filter(None, [_beats_all(worse), *_at_the_limit(f)]))
    better = [n for n in group if worse.get(n, 0.0) < 0.0]
    others = [n for n in group if n not in better]
    said = [f"It cannot be told from {', '.join(spoken(n) for n in group)}."]
    if better:
        said.append(_does_better(f["effect"], better, worse))
        said += [REFITTED] if f["kind"] == "parameter_error" else []
    if others:
        first, *more = (_decided(f["effect"], n, worse.get(n)) for n in others)
        said.append(f"What decided{' against the others' if better else ''}: {first}.")
        said += [opened(f"{one}.") for one in more]
    in_place = [IN_PLACE] if " nats" in " ".join(said) else []
    return " ".join([*said, *in_place, *_at_the_limit(f)])


def _beats_all(worse: dict[str, float]) -> str:
    """That it is told from all others, and by how much from the next best."""
    nearest = min(worse, key=lambda n: worse[n], default=None)
    if nearest is None:
        return ""
    lead = f"{worse[nearest]:.0f} nats"
    return f"It is told from every other name; the next best, {spoken(nearest)}, is {lead} worse."


def _at_the_limit(f: dict[str, Any]) -> list[str]:
    """Why a name is no surer than it is."""
    most = SURE[min(len(f["cannot_be_told_from"]), len(SURE) - 1)]
    limited = f["kind"] == "missing_physics" and f["probability"] == most
    return [LIMIT.format(percent(most))] if limited else []


def _does_better(name: str, better: Sequence[str], worse: dict[str, float]) -> str:
    """That the data speak for other names in its place: a low probability is then no slip."""
    each = [f"{spoken(n)} by {-worse[n]:.1f} nats" for n in better]
    listed = " and ".join(filter(None, [", ".join(each[:-1]), each[-1]]))
    said = opened(f"in place of {spoken(name)}, these fit the data better than it does: {listed}.")
    little = max(-worse[n] for n in better) < ENOUGH
    return f"{said} {UNDECIDED}" if little else said


def _decided(name: str, rival: str, worse: float | None) -> str:
    """How much of a lead comes from data and how much from what is plausible beforehand."""
    if rival == "unknown" and worse is None:
        return f"its signals, by which {spoken(name)} acts too; its form is another"
    if rival == "unknown" and worse == 0.0:
        return "nothing: a force without a name may do as well, and none of these drives tells"
    if rival == "unknown":
        return f"against a force without a name that comes and goes likewise the data, by {worse:.1f} nats"
    if not worse:
        return f"against {spoken(rival)} nothing: it may do as well"
    prior = math.log(LIBRARY[name].prior / LIBRARY[rival].prior) if {name, rival} <= set(LIBRARY) else 0.0
    data = worse - prior
    if data > abs(prior):
        return f"against {spoken(rival)} the data, by {data:.1f} nats"
    return f"against {spoken(rival)} prior plausibility ({prior:.1f} of {worse:.1f} nats), hardly the data"
