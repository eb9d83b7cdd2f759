"""Which samples of a channel are out of its range."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.account import Tally
from deeptruck_model.recordings.ranges import Range


def test_reversing_is_in_the_range_of_speed_down_to_15_km_h() -> None:
    speed = np.array([10.0, -14.99 / 3.6, -15.01 / 3.6])
    time: NDArray[np.float64] = np.array([0.0, 0.1, 0.2])
    masked = Range("speed", Tally()).masked(time, speed)
    np.testing.assert_array_equal(masked, [*speed[:2], np.nan])
