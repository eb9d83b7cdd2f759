"""Where findings act, and which channels predict what has no name."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from small_drives import TRUCK, drives, evidence

from deeptruck_model.mismatch.find import compared
from deeptruck_model.mismatch.mechanisms.families import SLOW
from deeptruck_model.mismatch.posterior.events import Event
from deeptruck_model.mismatch.posterior.names import Compared
from deeptruck_model.mismatch.prepare.prepared import Prepared
from deeptruck_model.mismatch.verdict import where
from deeptruck_model.mismatch.verdict.where import witnesses
from deeptruck_model.recordings import Recording
from deeptruck_model.trucks import View


@pytest.mark.parametrize(("border", "printed"), [(2e-5, 0.0), (-2e-5, 0.0), (0.01, 0.01)])
def test_a_border_is_at_zero_where_it_is_that_near_to_it(border: float, printed: float) -> None:
    e = evidence()
    step = 1e-5 * np.where(np.arange(len(e)) % 2, 1.0, -1.0)  # the nearest slopes on both sides of the border
    slopes = 0.03 * np.sin(np.arange(len(e)) / 50.0)
    grade = border + np.where(np.abs(slopes) < 0.005, step, slopes)
    (regime,) = where.regimes(
        replace(e, signals=e.signals | {"grade": grade}), (grade > border).astype(float)
    )
    (bound,) = regime.bounds
    assert (bound.signal, bound.high) == ("grade", np.inf)
    assert bound.low == pytest.approx(printed, abs=1e-9)
    assert (bound.low == 0.0) is (printed == 0.0)


def test_a_regime_is_the_corner_in_which_the_error_is_and_none_is_smaller_than_allowed() -> None:
    e, rng = evidence(), np.random.default_rng(0)
    gear = rng.integers(1, 13, len(e)).astype(float)
    gap = np.where(np.arange(len(e)) % 7, rng.normal(40.0, 5.0, len(e)), np.nan)
    e = replace(e, signals=e.signals | {"gear": gear, "gap": gap})
    hot = (e["speed"] > 16.0) & (gear > 4) & (gear < 8)
    found = where.regimes(e, np.where(hot, 3.0, 1.0))
    bounds = {b.signal: (b.low, b.high) for b in found[0].bounds}
    assert bounds == {"speed": (pytest.approx(16.0, abs=0.1), np.inf), "gear": (4.5, 7.5)}
    rare = where.regimes(e, np.where(gap > np.nanquantile(gap, 0.995), 3.0, 1.0))
    assert all(r.share_of_time >= 0.01 for r in rare)
    assert where.regimes(e, np.ones(len(e))) == []


def test_an_event_has_the_channels_that_move_in_it_as_they_seldom_do() -> None:
    """A command that is pressed, a gear that changes, and a slope that is frozen."""
    n = 3000
    command = np.where((np.arange(n) // 5) % 2, 0.3, 0.31)
    gear, grade = np.full(n, 8.0), np.sin(np.arange(n))
    command[1010], gear[1005:1020], grade[990:1040] = 0.9, 7.0, 0.0
    channels = {"engine_command": command, "gear": gear, "grade": grade, "speed": np.full(n, 20.0)}
    recording = Recording("b", 0.1, channels, TRUCK.interface)
    prepared = cast("Prepared", SimpleNamespace(recording=recording))
    event = Event("b", 100.0, 103.0, -0.5, 1.0, None)
    (seen, other) = where.with_channels([prepared], [event, replace(event, start_s=200.0, end_s=203.0)])
    assert seen.channels == ("engine_command", "gear", "grade")
    assert not other.channels


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
    c = compared(TRUCK, fit)
    assert isinstance(c, Compared)
    assert c.budget.share(SLOW) > 0.3
    seen = [w for w in witnesses(c.regression, c.drives.prepared, c.budget) if w.part == SLOW]
    assert seen[0].channel == "anemometer" and seen[0].share > 0.5
    assert "cabin_noise" not in [w.channel for w in seen]
