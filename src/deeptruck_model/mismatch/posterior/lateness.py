"""Commands and sensors a little late, as in every logger: known beside all that is searched, and not told.

Where nothing stands for it, a tenth of a second is worth hundreds of nats, and rate limits, gains and lags
make up for it.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from deeptruck_model.mismatch.mechanisms import LIBRARY, Shape
from deeptruck_model.mismatch.posterior.penalties import ENOUGH, enough, practical
from deeptruck_model.mismatch.posterior.screening import screen_shapes
from deeptruck_model.mismatch.posterior.search import Model, Search
from deeptruck_model.mismatch.residual import sensor_filter
from deeptruck_model.mismatch.residual.evidence import Evidence

LONGEST_S = 0.5  # of the delays tried: a share of a longer one is a path that is slow, not late
BOTH = {"all"}
FITTED = 2  # of them in full


def beside_it(search: Search, exclude: Iterable[str] = ()) -> Search:
    """The same search beside the lateness of all commands together that is too small to be told; as it was
    where there is none, or one that is a finding."""
    base = search.background(())
    small = [shape for _, shape in screen_shapes(search, base, _small(search))[:FITTED]]
    tried = [search.model((s,), base.free, base.fit) for s in small]
    best = max(tried, key=lambda m: m.score, default=base)
    if best.score < base.score + enough(search) or practical(search, best, best.named[-1]):
        return search
    return Search(replace(search.e, late=best.named[-1].columns), exclude=exclude)


def left_beside(e: Evidence, model: Model) -> Evidence:
    """The evidence without that lateness, and without a sensor's filter, where the names of a model leave
    next to nothing of it: a brake that lags has a little of both, and parameters alone are to be fitted as
    anybody would fit them."""
    if e.late is not None and _worth(e, replace(e, late=None), model) < ENOUGH:
        e = replace(e, late=None)
    if sensor_filter.rows(e) and _worth(e, replace(e, filtered=False), model) < ENOUGH:
        e = replace(e, filtered=False)
    return e


def _worth(e: Evidence, bare: Evidence, model: Model) -> float:
    """Nats by which a model is better beside what is known of `e`, and not of `bare`."""
    beside = Search(e)
    without = Search(bare, sigma=beside.sigma)  # rows weigh alike in both
    return beside.model(model.named, model.free).score - without.model(model.named, model.free).score


def _small(search: Search) -> list[Shape]:
    mechanism = LIBRARY["command_delay"]
    if not search.e.has(*mechanism.needs):
        return []
    lines = [(s, s.settings["lines"]) for s in search.shapes(mechanism)]
    return [s for s, line in lines if set(line) == BOTH and line["all"] <= LONGEST_S]
