"""A slope comes again where its road does, and turns its sign where that is driven the other way."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from deeptruck_model.mismatch.residual.evidence import DriveRows, Evidence
from deeptruck_model.mismatch.verdict.road import road_lock

SPEED, DT, KM = 20.0, 0.2, 30
ROWS = int(KM * 1000 / SPEED / DT)


def drives(nothing_missing: Evidence, count: int) -> Evidence:
    """As many drives of 30 km each."""
    drives = tuple(DriveRows(str(k), k * ROWS, (k + 1) * ROWS, 0.0, False) for k in range(count))
    distance = np.tile(np.arange(ROWS) * DT * SPEED, count)
    known = np.ones(count * ROWS)
    return replace(
        nothing_missing,
        drives=drives,
        residual=np.zeros(count * ROWS),
        valid=known > 0,
        signals={"distance": distance, "speed": SPEED * known},
    )


def road(seed: int) -> np.ndarray:
    """A slope's force along 30 km, smooth over some 200 m, and as a recording shows it: not quite."""
    return 0.1 * gaussian_filter1d(np.random.default_rng(seed).normal(size=ROWS), 50) * np.sqrt(100)


def seen(force: np.ndarray, seed: int) -> np.ndarray:
    return force + 0.3 * road(1000 + seed)


def test_the_same_way_and_the_other_way_are_distinguished(nothing_missing: Evidence) -> None:
    e = drives(nothing_missing, 6)
    there, back = road(0), -road(0)[::-1]
    found = road_lock(e, np.concatenate([seen(there, 1), seen(back, 2), *(road(k) for k in range(3, 7))]))
    assert found is not None
    assert found.same_way_km == 0.0 and 30.0 < found.other_way_km < 50.0
    found = road_lock(e, np.concatenate([seen(there, 1), seen(there, 2), *(road(k) for k in range(3, 7))]))
    assert found is not None
    assert found.other_way_km == 0.0 and 30.0 < found.same_way_km < 50.0


@pytest.mark.parametrize("seed", range(4))
def test_roads_driven_once_lock_nothing(seed: int, nothing_missing: Evidence) -> None:
    e = drives(nothing_missing, 6)
    assert road_lock(e, np.concatenate([road(10 * seed + k) for k in range(6)])) is None


def test_a_force_that_pushes_alike_both_ways_is_no_slope(nothing_missing: Evidence) -> None:
    e = drives(nothing_missing, 6)
    there = road(0)
    found = road_lock(
        e, np.concatenate([seen(there, 1), seen(there[::-1], 2), *(road(k) for k in range(3, 7))])
    )
    assert found is None or found.other_way_km == 0.0


def test_a_short_log_shows_nothing(nothing_missing: Evidence) -> None:
    assert road_lock(nothing_missing, np.zeros(len(nothing_missing))) is None
