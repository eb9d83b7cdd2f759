"""Moments and places of two sides that belong together."""

from __future__ import annotations

import numpy as np
import pytest

from deeptruck_model.compare.alignment import Road, road
from deeptruck_model.compare.sides import Side
from deeptruck_model.recordings.units import metres_per_degree


def _north(east_m: float) -> Side:
    """A minute at 20 m/s over the equator along a meridian, this far east of the one at 9 degrees."""
    n = np.arange(600)
    speed = np.full(len(n), 20.0)
    east_m_per_degree, north_m_per_degree = metres_per_degree(0.0)
    columns = {
        "speed": speed,
        "latitude": (2.0 * n - 600.0) / north_m_per_degree,
        "longitude": np.full(len(n), 9.0 + east_m / east_m_per_degree),
    }
    return Side("side", 0.1, columns, {})


@pytest.mark.parametrize("east_m", [-29.9, 0.0, 29.9])
def test_places_within_30_m_are_on_one_road(east_m: float) -> None:
    found = road(_north(0.0), _north(east_m))
    assert isinstance(found, Road) and found.by == "positions"
    np.testing.assert_allclose(found.place, _north(0.0).distance, atol=2.0)
    assert found.shared_m == pytest.approx(599 * 2.0)


@pytest.mark.parametrize("east_m", [-30.1, 30.1])
def test_places_farther_apart_are_on_no_shared_road(east_m: float) -> None:
    assert road(_north(0.0), _north(east_m)) == "No shared road: less than 500 m by positions"
