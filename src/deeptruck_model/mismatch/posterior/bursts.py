"""Bursts of a force that no name explains: a connector that drops out, a coupling that sticks and lets go."""

from __future__ import annotations

from deeptruck_model.mismatch.mechanisms import UNNAMED
from deeptruck_model.mismatch.posterior import intermittent
from deeptruck_model.mismatch.posterior.causes import Cause
from deeptruck_model.mismatch.posterior.penalties import large_enough
from deeptruck_model.mismatch.posterior.search import Model, Search

ENOUGH_BURSTS = 120.0  # nats beyond the price of each window; sizes follow the noise of each


def bursts(search: Search, model: Model) -> Cause | None:
    """What a model leaves over in short windows, of any size and sign in each.

    None where it is little, or the simulator a learned one, whose own error comes in bursts too.
    """
    e = search.e
    spans = intermittent.windows(e, model, intermittent.MOST) if e.own_error == 0 else []
    spans = intermittent.narrowed(search, model, spans)
    if not spans:
        return None
    noisy = search.model((*model.named, intermittent.unnamed(search, spans)), model.free, model.fit)
    gain = noisy.score - model.score
    force = noisy.named[-1].columns @ noisy.coefficients(UNNAMED.effect)
    if gain < ENOUGH_BURSTS or not large_enough(e, force):
        return None
    return Cause("missing_physics", UNNAMED.effect, gain, 1.0, 0.9, force, lawless=True)
