"""Which samples of a channel are out of its range."""

from __future__ import annotations

import numpy as np
import pytest

from deeptruck_core.account import Tally
from deeptruck_core.arrays import Array
from deeptruck_core.errors import InputError
from deeptruck_core.signals import TruckInterface
from deeptruck_model.recordings.ranges import Range


def test_reversing_is_in_the_range_of_speed_down_to_15_km_h() -> None:
    speed = np.array([10.0, -14.99 / 3.6, -15.01 / 3.6])
    time: Array = np.array([0.0, 0.1, 0.2])
    masked = Range("speed", Tally()).masked(time, speed)
    np.testing.assert_array_equal(masked, [*speed[:2], np.nan])


def test_a_grade_in_percent_is_no_ratio_and_a_faulty_one_is() -> None:
    time = 0.1 * np.arange(3000)
    slope = 0.03 * np.sin(time / 20.0)
    interface = TruckInterface("truck", "percent", "percent")
    percent, faulty = Range("grade", Tally(), "ratio"), Range("grade", Tally(), "ratio")
    percent.masked(time, 100.0 * slope)
    with pytest.raises(InputError, match=r"grade is 100 times too large: percent\? .* 'scale: 0\.01'"):
        percent.check("drive", interface, lambda channel: None)
    faulty.masked(time, np.where(time > 290.0, 3.0, slope))
    faulty.check("drive", interface, lambda channel: None)


@pytest.mark.parametrize("largest", [100.0, 40.0])
def test_a_pedal_in_percent_that_is_given_as_a_ratio_is_refused(largest: float) -> None:
    """It arrives as percent a hundred times too large; most of the time it is pressed by a few percent."""
    rng = np.random.default_rng(0)
    pedal = np.where(rng.random(3000) < 0.2, rng.uniform(0.0, largest, 3000), rng.uniform(0.0, 6.0, 3000))
    own = Range("engine_command", Tally(), "percent")
    own.masked(0.1 * np.arange(3000), 100.0 * pedal)
    with pytest.raises(InputError, match=r"engine_command is 100 times too large.* 'scale: 0\.01'"):
        own.check("drive", TruckInterface("truck", "percent", "percent"), lambda channel: None)
