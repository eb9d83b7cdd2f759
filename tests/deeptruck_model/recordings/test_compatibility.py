"""Whether a recording can drive a simulator: its step, channels and units."""

from __future__ import annotations

import numpy as np
import pytest

from deeptruck_core.errors import InputError
from deeptruck_core.signals import TruckInterface
from deeptruck_model.recordings import Recording
from deeptruck_model.recordings.compatibility import Taken
from deeptruck_model.recordings.several import check_fit

TRUCK = TruckInterface("trucksim")


def test_a_recording_that_cannot_drive_a_simulator_is_one_line() -> None:
    taken = Taken("the truck", TRUCK, 0.1)
    channels = {"speed": np.zeros(9), "engine_command": np.zeros(9), "brake_command": np.zeros(9)}
    drive = Recording("monday", 0.1, {**channels, "grade": np.zeros(9)}, TRUCK)
    check_fit([drive], taken)
    percent = TruckInterface("p", engine_unit="percent", brake_unit="bar", grade=False)
    with pytest.raises(InputError) as caught:
        check_fit([drive, Recording("friday", 0.2, channels, percent)], taken)
    for words in (
        "'friday' is sampled every 0.2 s, the truck steps 0.1 s",
        "'friday' has no grade, which the truck needs",
        "'friday' has engine_command in percent, the truck takes N m",
        "'friday' has brake_command in bar, the truck takes percent",
    ):
        assert words in str(caught.value)
    assert "\n" not in str(caught.value)
