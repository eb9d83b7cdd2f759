"""A road that comes again: how sure its name is."""

from __future__ import annotations

import numpy as np
import pytest
from small_drives import evidence

from deeptruck_model.mismatch.mechanisms.families import UNKNOWN
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.verdict.road import SLOPE, SURFACE, RoadLock, _by_size, _tree, road


def long(kilometres: float) -> Evidence:
    """Drives of a length."""
    e = evidence()
    third = len(e) // 3
    e.signals["distance"] = np.tile(np.linspace(0.0, 1000.0 * kilometres, third), 3)
    return e


def lock(same_km: float, other_km: float) -> RoadLock:
    return RoadLock(same_km, other_km)


def test_the_longer_a_road_comes_again_the_surer_it_is() -> None:
    p = [_tree(long(100.0), lock(0.0, km)).names[SLOPE] for km in (6.0, 18.0, 60.0)]
    assert p == sorted(p)
    assert p[-1] > 0.99


def test_the_more_was_driven_the_more_comes_again_by_chance() -> None:
    p = [_tree(long(km), lock(0.0, 18.0)).names[SLOPE] for km in (60.0, 600.0, 3000.0)]
    assert p == sorted(p, reverse=True)


def test_only_the_other_way_separates_a_slope_from_a_surface() -> None:
    one_way, both = _tree(long(60.0), lock(30.0, 0.0)), _tree(long(60.0), lock(30.0, 30.0))
    assert one_way.names[SLOPE] == one_way.names[SURFACE]
    assert both.names[SURFACE] == 0.0
    assert sum(both.names.values()) == pytest.approx(1.0)
    assert both.names[UNKNOWN] < 0.01


def test_beside_a_simulator_of_known_physics_kernels_hold_the_road() -> None:
    assert road(evidence()) is None


def test_where_nothing_comes_again_the_size_decides() -> None:
    needed = {SLOPE: 0.02, "headwind": 24.0, "torque_derate": 0.6}
    assert _by_size(needed).stated(0.9) == SLOPE
    gentle = _by_size({SLOPE: 0.01, "headwind": 2.0, "torque_derate": 0.04})
    assert max(gentle.names.values()) < 0.5
