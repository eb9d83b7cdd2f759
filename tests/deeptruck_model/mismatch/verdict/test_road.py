"""A learned simulator's slope is what a plain truck's forces leave, by the size that each cause needs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from deeptruck_core.arrays import Array
from deeptruck_core.constants import GRAVITY
from deeptruck_model.mismatch.posterior.regression import Regression
from deeptruck_model.mismatch.residual.evidence import DriveRows, Evidence
from deeptruck_model.mismatch.verdict.road import plain_truck, road

N, MASS, DRAG = 1200, 28000.0, 1.2e-4
PER_FUEL = 0.40 * 35.8e3 / MASS  # m/s^2 per cm^3/s, times m/s


def drive(seed: int, slope: float = 0.0, wind_m_s: float = 0.0) -> tuple[Evidence, Array]:
    """A driver who holds a speed that changes, over hills of this slope and against a wind that turns slowly;
    and the slopes, (N,)."""
    rng = np.random.default_rng(seed)
    time = np.arange(N)
    wished = 18.0 + 4.0 * np.sin(time / 47.0) + 1.5 * np.sign(np.sin(time / 13.0))
    wind = wind_m_s * np.sin(time / 200.0)
    speed, fuel, hills = np.empty(N), np.empty(N), np.empty(N)
    v = distance = 18.0
    for k in range(N):
        hills[k] = slope * np.sin(distance / 310.0)
        resists = DRAG * (v + wind[k]) ** 2 + GRAVITY * (0.006 + hills[k])
        fuel[k] = np.clip((0.5 * (wished[k] - v) + resists) * v / PER_FUEL, 0.0, 18.0)
        v += PER_FUEL * fuel[k] / v - resists + rng.normal(0.0, 0.02)
        speed[k] = v
        distance += v
    signals: dict[str, Array] = {
        "speed": speed,
        "fuel_rate": fuel,
        "distance": np.cumsum(speed),
        "place": np.cumsum(speed),
        "elapsed": time.astype(float),
        "drag": DRAG * speed**2,
        "rolling": np.full(N, 0.006 * GRAVITY),
    }
    zero, drives = np.zeros(N), (DriveRows("a", 0, N, 0.0, False),)
    e = Evidence(1.0, drives, zero, zero, zero, zero == 0, signals, {}, MASS, lambda name, amount: zero)
    return replace(e, known_physics=False), hills


def test_slopes_come_back_in_shape_and_size() -> None:
    e, hills = drive(0, 0.015)
    found = road(Regression(e))
    assert found is not None and found.tree.stated(e.rules.stated) == "road_grade"
    recovered = -found.force / GRAVITY
    assert np.corrcoef(recovered, hills)[0, 1] > 0.95
    assert abs(np.polyfit(hills, recovered, 1)[0] - 1.0) < 0.15


@pytest.mark.parametrize(("slope", "wind_m_s"), [(0.0, 6.0), (0.004, 0.0)])
def test_wind_and_what_is_small_are_no_slope(slope: float, wind_m_s: float) -> None:
    assert road(Regression(drive(1, slope, wind_m_s)[0])) is None


def test_where_drag_is_large_less_wind_is_needed() -> None:
    heavy, _ = drive(1, 0.015)
    found = road(Regression(replace(heavy, signals=heavy.signals | {"drag": 5.0 * heavy["drag"]})))
    assert found is not None and found.tree.names["headwind"] > 0.2


def test_a_name_that_is_excluded_is_none() -> None:
    found = road(Regression(drive(0, 0.015)[0], exclude=["road_grade"]))
    assert found is not None and "road_grade" not in found.tree.names


def test_what_has_a_slope_or_known_physics_is_not_asked() -> None:
    e, hills = drive(2, 0.015)
    assert road(Regression(replace(e, known_physics=True))) is None
    assert road(Regression(replace(e, signals=e.signals | {"grade": hills}))) is None


def test_no_plain_truck_explains_minutes_or_a_drive_without_an_engine_signal() -> None:
    e, _ = drive(3, 0.015)
    assert plain_truck(e) is not None
    assert plain_truck(replace(e, valid=np.arange(N) < 240)) is None
    silent = {name: x for name, x in e.signals.items() if name != "fuel_rate"}
    assert plain_truck(replace(e, signals=silent)) is None


def test_while_it_brakes_nothing_is_known() -> None:
    e, _ = drive(0, 0.015)
    brake = np.where((np.arange(N) >= 500) & (np.arange(N) < 600), 1.0, 0.0)
    found = road(Regression(replace(e, signals=e.signals | {"brake_command": brake})))
    assert found is not None and not found.force[530:570].any() and found.force[:490].all()
