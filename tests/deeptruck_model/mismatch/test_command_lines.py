"""Engine and brake on lines of their own, each with its delay."""

from __future__ import annotations

from collections import deque

import numpy as np
import pytest
from numpy.typing import NDArray

from deeptruck_model import driving_cycles, mismatch, trucks
from deeptruck_model.recordings import Recording

TRUCK = trucks.load("trucksim")
LATE_S = {"engine": 0.3, "brake": 0.8}
Array = NDArray[np.float64]


class TwoLines:
    """Hands on what each command was so long ago."""

    def __init__(self, late_s: dict[str, float]) -> None:
        self.late_s = late_s

    def reset(self, batch: int) -> None:
        self.past: dict[str, deque[Array]] = {name: deque() for name in self.late_s}

    def filter(self, u: Array, time: float, dt: float) -> Array:
        out = u.copy()
        for k, (name, late_s) in enumerate(self.late_s.items()):
            queue = self.past[name]
            queue.append(u[:, k].copy())
            out[:, k] = queue[0]
            if len(queue) > round(late_s / dt):
                queue.popleft()
        return out


def drive(seed: int, late_s: dict[str, float]) -> Recording:
    truck = TRUCK.with_forces([], [TwoLines(late_s)])
    r = driving_cycles.drive(truck, seconds=300.0, seed=seed, name=f"d{seed}")
    r.channels["speed"] += np.random.default_rng(seed).normal(0.0, 0.01, len(r))
    return r


@pytest.mark.long
def test_each_command_is_late_by_its_own() -> None:
    drives = [drive(seed, LATE_S) for seed in range(4)]
    verdict = mismatch.find_mismatch(TRUCK, drives[:3], drives[3:]).verdict
    (found,) = verdict["findings"]
    assert found["effect"] == "command_delay"
    for name, late_s in LATE_S.items():
        assert found["parameters"][f"delay_{name}"]["value"] == pytest.approx(late_s, abs=0.03)
    assert verdict["fit"]["after"]["speed_rmse"] < 0.3 * verdict["fit"]["before"]["speed_rmse"]


@pytest.mark.long
def test_a_dead_time_of_the_brake_is_a_delay_of_its_command_too() -> None:
    drives = [drive(seed, {"engine": 0.0, "brake": 0.6}) for seed in range(4)]
    (found,) = mismatch.find_mismatch(TRUCK, drives[:3], drives[3:]).verdict["findings"]
    assert {found["effect"], *found["cannot_be_told_from"]} >= {"brake_lag", "command_delay"}
