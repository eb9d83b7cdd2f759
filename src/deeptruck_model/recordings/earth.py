"""Metres per degree on the WGS84 ellipsoid; a sphere is wrong by up to half a percent."""

from __future__ import annotations

import numpy as np

from deeptruck_core.arrays import Array

AXIS_M, ECCENTRICITY_SQUARED = 6378137.0, 0.00669437999  # half the long axis of WGS84


def metres_per_degree(latitude: Array | float) -> tuple[Array, Array]:
    """Metres per degree of longitude and of latitude, at latitudes (n,) in degrees."""
    radians = np.radians(latitude)
    left = 1.0 - ECCENTRICITY_SQUARED * np.sin(radians) ** 2
    east, north = AXIS_M * np.cos(radians) / left**0.5, AXIS_M * (1.0 - ECCENTRICITY_SQUARED) / left**1.5
    return np.radians(east), np.radians(north)
