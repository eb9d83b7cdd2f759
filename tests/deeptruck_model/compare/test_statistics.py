"""What a drive was like in numbers."""

from __future__ import annotations

import numpy as np

from deeptruck_model.compare import statistics
from deeptruck_model.compare.sides import Side


def test_time_gaps_are_gap_over_speed_where_the_truck_rolls_and_the_gap_is_known() -> None:
    """Time gaps of 4, 2 and 3 s; at 1 m/s the truck does not roll."""
    columns = {
        "speed": np.array([10.0, 10.0, 10.0, 10.0, 1.0]),
        "gap": np.array([40.0, 20.0, 30.0, np.nan, 0.5]),
    }
    found = statistics.of(Side("drive", 0.1, columns, {}))
    assert found.median_time_gap_s == 3.0 and found.least_time_gap_s == 2.0
