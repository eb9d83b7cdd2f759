"""The road beside a learned truck: slopes planted where a driver answers them with the engine."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest
from numpy.typing import NDArray

from deeptruck_core.constants import GRAVITY
from deeptruck_model.mismatch.residual.evidence import DriveRows, Evidence
from deeptruck_model.mismatch.verdict.slow_force import plain_truck

N, MASS, DRAG = 3600, 28000.0, 1.2e-4
PER_FUEL = 0.40 * 35.8e3 / MASS  # m/s^2 per cm^3/s, times m/s


def drive(seed: int, slope: float, grade_recorded: bool = False) -> tuple[Evidence, NDArray[np.float64]]:
    """A driver who holds a speed that changes, over hills of this slope; and the slopes, (N,)."""
    rng = np.random.default_rng(seed)
    wished = 18.0 + 4.0 * np.sin(np.arange(N) / 47.0) + 1.5 * np.sign(np.sin(np.arange(N) / 13.0))
    speed, fuel, hills = np.empty(N), np.empty(N), np.empty(N)
    v = distance = 18.0
    for k in range(N):
        hills[k] = slope * np.sin(distance / 310.0)
        needed = 0.5 * (wished[k] - v) + DRAG * v**2 + GRAVITY * (0.006 + hills[k])
        fuel[k] = np.clip(needed * v / PER_FUEL, 0.0, 18.0)
        v += PER_FUEL * fuel[k] / v - DRAG * v**2 - GRAVITY * (0.006 + hills[k]) + rng.normal(0.0, 0.02)
        speed[k] = v
        distance += v
    signals: dict[str, NDArray[np.float64]] = {
        "speed": speed,
        "fuel_rate": fuel,
        "distance": np.cumsum(speed),
    }
    if grade_recorded:
        signals["grade"] = hills
    return evidence(signals), hills


def evidence(signals: Mapping[str, NDArray[np.float64]]) -> Evidence:
    zero = np.zeros(N)
    valid = np.ones(N, dtype=bool)
    drives = (DriveRows("a", 0, N, 0.0, False),)
    return Evidence(1.0, drives, zero, zero, zero, valid, dict(signals), {}, MASS, lambda name, amount: zero)


@pytest.mark.parametrize("seed", [0, 1])
def test_slopes_come_back_in_shape_and_size(seed: int) -> None:
    e, hills = drive(seed, 0.015)
    line = plain_truck(e)
    assert line is not None
    known = np.isfinite(line.left)
    assert known.mean() > 0.8
    recovered = -line.left[known] / GRAVITY
    assert np.corrcoef(recovered, hills[known])[0, 1] > 0.95
    assert abs(np.polyfit(hills[known], recovered, 1)[0] - 1.0) < 0.15


def test_a_recorded_slope_is_not_recovered_again() -> None:
    recovered, _ = drive(2, 0.015, grade_recorded=True)
    flat, _ = drive(2, 0.0)
    left = [plain_truck(e) for e in (recovered, flat)]
    assert left[0] is not None and left[1] is not None
    rms = [float(np.nanstd(line.left)) for line in left if line]
    assert rms[0] < 1.5 * rms[1] + 0.01


def test_without_an_engine_there_is_no_line() -> None:
    assert plain_truck(evidence({"speed": np.full(N, 15.0)})) is None
