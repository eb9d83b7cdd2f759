"""Commands and sensors a little late, as in every logger: known beside all that is searched, and not told.

Where nothing stands for it, a tenth of a second is worth hundreds of nats, and rate limits, gains and lags
make up for it.
"""

from __future__ import annotations

from dataclasses import replace

from deeptruck_model.mismatch.evidence import Evidence
from deeptruck_model.mismatch.mechanisms import LIBRARY, Shape
from deeptruck_model.mismatch.search import Model, Search
from deeptruck_model.mismatch.worth_saying import ENOUGH, enough, practical

LONGEST_S = 0.5  # of the delays tried: a share of a longer one is a path that is slow, not late
BOTH = {"all"}


def beside_it(e: Evidence) -> Evidence:
    """The evidence with the lateness of all commands together that is too small to be told; as it was where
    there is none, or one that is a finding."""
    search = Search(e)
    base = search.background(())
    tried = [search.model((s,), base.free, base.fit) for s in _small(search)]
    best = max(tried, key=lambda m: m.score, default=base)
    if best.score < base.score + enough(search) or practical(search, best, best.named[-1]):
        return e
    return replace(e, late=best.named[-1].columns)


def left_beside(e: Evidence, model: Model) -> Evidence:
    """The evidence without that lateness where the names of a model leave next to nothing of it: a brake that
    lags has a little of it, and parameters alone are to be fitted as anybody would fit them."""
    bare = replace(e, late=None)
    beside, without = (Search(x).model(model.named, model.free).score for x in (e, bare))
    return bare if beside - without < ENOUGH else e


def _small(search: Search) -> list[Shape]:
    mechanism = LIBRARY["command_delay"]
    if not search.e.has(*mechanism.needs):
        return []
    lines = [(s, s.settings["lines"]) for s in search.shapes(mechanism)]
    return [s for s, line in lines if set(line) == BOTH and line["all"] <= LONGEST_S]
