"""Which of two sensors is wrong is decided by the commands, even where the simulator is wrong."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from small_drives import TRUCK, LazyBrake, drives

from deeptruck_model.mismatch.data import checks
from deeptruck_model.mismatch.prepare import prepared
from deeptruck_model.mismatch.rules import Rules
from deeptruck_model.recordings import Recording
from deeptruck_model.trucks import PhysicsTruck

HEAVIER = TRUCK.with_parameters({"mass": 1.2 * TRUCK.parameters()["mass"]})
LAZY = TRUCK.with_forces([], [LazyBrake()])


def shifted(r: Recording, channel: str, late_s: float) -> Recording:
    n = np.arange(len(r), dtype=float)
    late = np.interp(n - late_s / r.dt, n, r.channels[channel])
    return replace(r, channels=r.channels | {channel: late})


@pytest.mark.parametrize("truck", [HEAVIER, LAZY])
@pytest.mark.parametrize("channel", ["speed", "acceleration"])
def test_the_late_sensor_is_found_though_the_simulator_is_wrong(truck: PhysicsTruck, channel: str) -> None:
    recorded = [shifted(r, channel, 0.6) for r in drives(truck, 2)]
    found = prepared(TRUCK, recorded, [], Rules())
    (lag,) = (f for f in found.faults if f.is_lag)
    assert lag.channel == channel
    sign = 1.0 if channel == "acceleration" else -1.0
    assert sign * lag.value == pytest.approx(0.6, abs=0.1)


@pytest.mark.parametrize("truck", [HEAVIER, LAZY])
@pytest.mark.parametrize("channel", ["speed", "acceleration"])
def test_the_scaled_sensor_is_found_though_the_simulator_is_wrong(truck: PhysicsTruck, channel: str) -> None:
    recorded = [
        replace(r, channels=r.channels | {channel: 1.05 * r.channels[channel]}) for r in drives(truck, 2)
    ]
    found = prepared(TRUCK, recorded, [], Rules())
    (scale,) = (f for f in found.faults if f.is_scale)
    assert scale.channel == channel
    assert scale.value == pytest.approx(1.05 if channel == "speed" else 1 / 1.05, abs=0.01)
    assert not checks.sensor_faults([p.recording for p in found.prepared], Rules())


def test_a_sensor_on_time_has_no_lag() -> None:
    assert not prepared(TRUCK, drives(LAZY, 2), [], Rules()).faults
