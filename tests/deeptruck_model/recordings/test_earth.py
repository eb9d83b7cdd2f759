"""Metres per degree against arcs of the meridian and of a parallel on the ellipsoid WGS84."""

from __future__ import annotations

import numpy as np
import pytest

from deeptruck_model.recordings.earth import metres_per_degree


@pytest.mark.parametrize(
    ("latitude", "east_m", "north_m"),
    # a degree of longitude and of latitude, as tables of WGS84 give it
    [(0.0, 111319.5, 110574.3), (45.0, 78846.8, 111131.8), (60.0, 55800.0, 111412.3)],
)
def test_a_degree_has_the_metres_of_the_ellipsoid(latitude: float, east_m: float, north_m: float) -> None:
    east, north = metres_per_degree(latitude)
    assert float(east) == pytest.approx(east_m, rel=2e-6) and float(north) == pytest.approx(north_m, rel=2e-6)
    assert metres_per_degree(np.full(3, latitude))[1].shape == (3,)
