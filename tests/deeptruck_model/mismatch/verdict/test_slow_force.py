"""A slow force is found by its size, and its name by the size each name would need."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from deeptruck_core.constants import GRAVITY
from deeptruck_model.mismatch.residual.evidence import DriveRows, Evidence
from deeptruck_model.mismatch.verdict.slow_force import SlowForce, slow_force

N, SIGMA = 3600, 0.1
TIME = np.arange(N, dtype=float)
SLOW = np.sin(TIME / 40.0)
WEIGHT = np.ones(N)


def evidence(speed: float, drag: float) -> Evidence:
    zero, valid = np.zeros(N), np.ones(N, dtype=bool)
    signals = {"speed": np.full(N, speed), "drag": np.full(N, drag), "engine": np.full(N, 0.3)}
    drives = (DriveRows("a", 0, N, 0.0, False),)
    return Evidence(1.0, drives, zero, zero, zero, valid, signals, {}, 2e4, lambda name, amount: zero)


def found(size: float, doubt: float = 0.0, drag: float = 0.07) -> SlowForce | None:
    """What is said of a slow force of this amplitude under noise."""
    left = size * SLOW + np.random.default_rng(3).normal(0.0, SIGMA, N)
    return slow_force(evidence(20.0, drag), left, WEIGHT, SIGMA, doubt)


def test_a_slow_force_is_given_as_the_size_that_each_cause_would_need() -> None:
    road = found(0.3)
    assert road is not None
    assert road.rms == pytest.approx(0.3 / np.sqrt(2.0), rel=0.1)
    assert road.needed["road_grade"] == pytest.approx(road.rms / GRAVITY)
    assert road.needed["headwind"] == pytest.approx(road.rms / (2.0 * 0.07 / 20.0), rel=0.02)
    assert np.corrcoef(road.force, SLOW)[0, 1] > 0.95


def test_where_drag_is_large_less_wind_is_needed() -> None:
    light = found(0.15, drag=0.4)
    assert light is not None and light.needed["headwind"] < 10.0


@pytest.mark.parametrize(("size", "doubt"), [(0.0, 0.0), (0.08, 0.0), (0.2, 0.2)])
def test_what_is_small_or_doubtful_is_not_said(size: float, doubt: float) -> None:
    assert found(size, doubt) is None


def test_minutes_are_too_short() -> None:
    e = evidence(20.0, 0.07)
    few: NDArray[np.bool_] = np.arange(N) < 240
    short = Evidence(
        e.dt, e.drives, e.residual, e.simulated, e.disagreement, few, e.signals, {}, e.mass, e.rerun
    )
    assert slow_force(short, 0.5 * SLOW, WEIGHT, SIGMA) is None


def test_where_nothing_is_known_nothing_is_identified() -> None:
    weight = WEIGHT.copy()
    weight[1000:1100] = 0.0  # braking, say
    left = np.where(weight > 0.0, 0.3 * SLOW, 9.0)
    road = slow_force(evidence(20.0, 0.07), left, weight, 0.01)
    assert road is not None and not road.force[1030:1070].any() and road.force[:990].all()
