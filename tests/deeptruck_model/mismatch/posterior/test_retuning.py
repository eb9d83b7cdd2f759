"""Parameters that are far off: found where they are, and nothing is made up for them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from deeptruck_model import driving_cycles, mismatch, trucks
from deeptruck_model.mismatch.posterior.search import changed_by
from deeptruck_model.recordings import Recording

TRUCK = trucks.load("trucksim")
MASS = TRUCK.parameters()["mass"]


def drives(truck: trucks.PhysicsTruck, count: int = 3, seconds: float = 240.0) -> list[Recording]:
    return [
        _measured(driving_cycles.drive(truck, seconds=seconds, seed=10 + k, name=f"d{k}"), k)
        for k in range(count)
    ]


def _measured(r: Recording, seed: int) -> Recording:
    rng, n = np.random.default_rng(seed), len(r)
    noise = {"acceleration": 0.05, "grade": 0.001}
    out = {name: r.channels[name] + sd * rng.standard_normal(n) for name, sd in noise.items()}
    out["speed"] = np.maximum(r.channels["speed"] + 0.02 * rng.standard_normal(n), 0.0)
    return replace(r, channels=r.channels | out)


def compared(recorded: list[Recording]) -> Mapping[str, Any]:
    """The verdict on all but the last drive, which is held out."""
    return mismatch.find_mismatch(TRUCK, recorded[:-1], recorded[-1:]).verdict


@pytest.mark.long
@pytest.mark.parametrize("share", [0.7, 1.3, 1.8])
def test_another_mass_is_a_mass_and_nothing_else(share: float) -> None:
    heavy = TRUCK.with_parameters({"mass": share * MASS})
    recorded = drives(heavy)
    verdict = compared(recorded)
    (found,) = verdict["findings"]
    assert verdict["verdict"] == "parameter_error" and found["effect"] == "mass"
    assert found["parameters"]["mass"]["value"] == pytest.approx(share * MASS, rel=0.025)
    assert verdict["fit"]["after"]["speed_rmse"] < 0.2 * verdict["fit"]["before"]["speed_rmse"]


def test_forces_act_by_one_over_the_mass() -> None:
    for share in (0.5, 0.8, 1.0, 1.5):
        slope = 1.0 - 1.0 / share  # of the acceleration, which is all that a first look tells
        assert changed_by("mass", slope) == pytest.approx(share - 1.0)
        assert changed_by("drag_area", slope) == slope


@pytest.mark.long
def test_a_tenth_of_the_drag_is_told_where_held_out_drives_show_it() -> None:
    """The smaller the error, the more driving it takes: two fitted drives of four minutes do not tell it."""
    own = TRUCK.parameters()["drag_area"]
    verdict = compared(drives(TRUCK.with_parameters({"drag_area": 0.9 * own}), 5, 360.0))
    (found,) = verdict["findings"]
    assert found["effect"] == "drag_area"
    assert found["parameters"]["drag_area"]["value"] == pytest.approx(0.9 * own, rel=0.03)
    assert verdict["fit"]["validated"]


@pytest.mark.long
def test_the_zero_of_a_slope_sensor_is_no_rolling_resistance() -> None:
    recorded = drives(TRUCK)
    for r in recorded:
        r.channels["grade"] += 0.0006
    verdict = compared(recorded)
    assert verdict["findings"] == [] and verdict["verdict"] == "undetermined"  # other parameters help much


class Wind:
    """A steady headwind of 6 m/s on a drag area of 6 m^2."""

    def reset(self, batch: int) -> None:
        """It remembers nothing."""

    def force(self, view: trucks.View, dt: float) -> np.ndarray:
        return -3.6 * ((view.speed + 6.0) ** 2 - view.speed**2) * (view.speed > 0.5)


@pytest.mark.long
@pytest.mark.timeout(900)  # four drives of ten minutes
def test_brakes_too_strong_get_too_hot_in_the_simulator_which_is_no_other_fade() -> None:
    other = TRUCK.with_parameters({"mass": 1.3 * MASS, "brake_gain": 0.75}).with_forces([Wind()])
    verdict = compared(drives(other, 4, 600.0))
    sizes = {f["effect"]: f["parameters"] for f in verdict["findings"]}
    assert set(sizes) == {"mass", "brake_gain", "headwind"}
    assert sizes["mass"]["mass"]["value"] == pytest.approx(1.3 * MASS, rel=0.02)
    assert sizes["brake_gain"]["brake_gain"]["value"] == pytest.approx(0.75, rel=0.02)
    low, high = sizes["headwind"]["wind"]["ci95"]
    assert low < 6.0 < high < 8.0
    errors = {name: verdict["fit"][name]["speed_rmse"] for name in ("before", "parameters_only", "after")}
    assert errors["after"] < 0.05 * errors["before"]
