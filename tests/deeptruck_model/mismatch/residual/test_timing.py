"""A sensor's filter is known beside all that is searched, and nothing else makes up for it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d
from small_drives import loss

from deeptruck_core.constants import GRAVITY
from deeptruck_model.mismatch.posterior.posterior import gains
from deeptruck_model.mismatch.posterior.regression import Regression
from deeptruck_model.mismatch.residual import timing
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.residual.noise import Fit, fit
from deeptruck_model.mismatch.residual.timing import sensor_terms

FILTER_S = 0.2  # sd of what a sensor smooths


def fitted(search: Regression) -> Fit:
    """The fit of parameters and of what sensors do."""
    return fit(search.series, *search.design(free=True))


@pytest.fixture(scope="module")
def smoothed(nothing_missing: Evidence) -> Evidence:
    """A truck that shifts, so that its acceleration jumps, as a sensor shows it that smooths."""
    e = nothing_missing
    pull = np.where(np.arange(len(e)) % 60 < 10, 0.0, 1.0)  # a shift every 12 s
    smooth = gaussian_filter1d(pull, FILTER_S / e.dt)
    signals = e.signals | {"simulated": pull, "acceleration": pull, "engine": pull}
    return replace(e, signals=signals, simulated=pull, residual=e.residual + smooth - pull)


def test_nothing_makes_up_for_it(smoothed: Evidence, monkeypatch: pytest.MonkeyPatch) -> None:
    """Loads that slosh and engines that rub had been found in trucks in which nothing was missing."""
    beside = Regression(smoothed)
    monkeypatch.setattr(timing, "REACH_S", 0.0)
    without = Regression(smoothed)
    without.weigh(beside.sigma)  # alike
    assert loss(fitted(beside)) < loss(fitted(without)) - 100.0
    assert _most(without) > 20.0 > _most(beside)


@pytest.mark.parametrize(("dt", "shares"), [(0.2, 6), (0.5, 2), (1.0, 0)])
def test_it_reaches_as_far_as_a_sensors_filter(nothing_missing: Evidence, dt: float, shares: int) -> None:
    columns, prior = sensor_terms(replace(nothing_missing, dt=dt))
    assert columns.shape == (len(nothing_missing), 2 + shares)
    assert len(prior.mean) == 2 + shares


def test_it_does_not_reach_into_another_drive(nothing_missing: Evidence) -> None:
    e = nothing_missing
    where = e.record.astype(float)  # the same all along each drive
    columns, _ = sensor_terms(replace(e, simulated=where))
    assert len(e.drives) > 1
    assert np.abs(columns[:, 2:]).max() == 0.0


@pytest.mark.parametrize("late_s", [0.6, -0.4])
def test_a_slope_that_is_recorded_late_or_early_is_no_finding(
    nothing_missing: Evidence, late_s: float
) -> None:
    """Where a road turned over within seconds, a late sensor's slope had been a finding."""
    e = nothing_missing
    seconds = e["elapsed"]
    road = 0.05 * np.tanh(3.0 * np.sin(2.0 * np.pi * seconds / 60.0))
    recorded = 0.05 * np.tanh(3.0 * np.sin(2.0 * np.pi * (seconds - late_s) / 60.0))
    hidden = e.residual - GRAVITY * (road - recorded)
    search = Regression(replace(e, signals=e.signals | {"grade": recorded}, residual=hidden))
    found = fitted(search)
    lateness = found.b[len(search.parameters) + 2]
    assert lateness == pytest.approx(late_s, abs=0.1)
    level = Regression(replace(search.e, signals=search.e.signals | {"grade": np.zeros(len(e))}))
    assert loss(found) < loss(fitted(level)) - 100.0  # it had to be made up for
    assert _most(search) < 20.0


def _most(search: Regression) -> float:
    """Nats that the best kernel gains."""
    return max(gains(search).values())


def test_a_hole_in_the_recorded_slope_is_no_turn_of_the_road(nothing_missing: Evidence) -> None:
    grade = np.full(len(nothing_missing), 0.05)
    grade[200:230] = np.nan
    whole = replace(nothing_missing, signals=nothing_missing.signals | {"grade": grade})
    columns, _ = sensor_terms(whole)
    assert np.abs(columns[:, 2]).max() < 1e-9


def test_shifts_a_little_sooner_are_known_beside_all_else(nothing_missing: Evidence) -> None:
    """A truck that steps finer than its simulator shifts a little before it, and interruptions of shifts,
    loads that slosh and late commands had been found in its drives."""
    pull = np.where(np.arange(len(nothing_missing)) % 60 < 5, 0.0, 1.0)  # a shift every 12 s
    sooner = np.roll(pull, -1) - pull
    e = replace(nothing_missing, residual=nothing_missing.residual + 0.7 * sooner)
    beside = Regression(replace(e, sooner=sooner))
    without = Regression(e)
    without.weigh(beside.sigma)  # alike
    found = fitted(beside)
    assert loss(found) < loss(fitted(without)) - 100.0
    assert found.b[-1] == pytest.approx(0.7, abs=0.05)
    assert _most(beside) < 20.0
