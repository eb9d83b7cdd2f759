"""A recorded channel that predicts a part of the budget."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from small_drives import TRUCK, drives

from deeptruck_model.mismatch.find import compared
from deeptruck_model.mismatch.mechanisms.families import SLOW
from deeptruck_model.mismatch.posterior.names import Compared
from deeptruck_model.mismatch.verdict.where import witnesses
from deeptruck_model.recordings import Recording
from deeptruck_model.trucks import View

PERIOD_S, FORCE_N = 90.0, 2500.0


class Swell:
    """A force that no signal of the truck carries."""

    def reset(self, batch: int) -> None:
        """It has no state."""

    def force(self, view: View, dt: float) -> np.ndarray:
        """Newtons, positive forward."""
        return np.full_like(view.speed, FORCE_N * np.sin(2.0 * np.pi * view.time / PERIOD_S))


def with_channels(r: Recording, seed: int) -> Recording:
    """With two channels of a user's own: one follows the force, one does not."""
    rng = np.random.default_rng(seed)
    along = np.sin(2.0 * np.pi * r.time / PERIOD_S) + rng.normal(0.0, 0.3, len(r))
    idle = np.cumsum(rng.normal(0.0, 1.0, len(r)))
    return replace(r, channels={**r.channels, "anemometer": along, "cabin_noise": idle})


def test_the_channel_that_follows_a_slow_force_is_its_witness() -> None:
    fit = [with_channels(r, k) for k, r in enumerate(drives(TRUCK.with_forces([Swell()], []), 3, 270.0))]
    c = compared(TRUCK, fit, sets_aside=False)
    assert isinstance(c, Compared)
    assert c.budget.share(SLOW) > 0.3
    seen = [w for w in witnesses(c.search, c.drives.prepared, c.budget) if w.part == SLOW]
    assert seen[0].channel == "anemometer" and seen[0].share > 0.5
    assert "cabin_noise" not in [w.channel for w in seen]
