"""A slow force is named a road only if another pass repeats it, or by the size it needs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d
from small_drives import evidence

from deeptruck_core.arrays import Array, Mask
from deeptruck_core.constants import GRAVITY
from deeptruck_model.mismatch.mechanisms.families import UNKNOWN
from deeptruck_model.mismatch.residual.evidence import DriveRows, Evidence
from deeptruck_model.mismatch.verdict.road import SLOPE, SURFACE, RoadLock, _by_size, _tree, road, road_lock
from deeptruck_model.mismatch.verdict.slow_force import SlowForce, plain_truck, slow_force


def long(kilometres: float) -> Evidence:
    """Drives of a length."""
    e = evidence()
    third = len(e) // 3
    e.signals["distance"] = np.tile(np.linspace(0.0, 1000.0 * kilometres, third), 3)
    return e


def lock(same_km: float, other_km: float) -> RoadLock:
    return RoadLock(same_km, other_km)


def test_the_longer_a_road_comes_again_the_surer_it_is() -> None:
    p = [_tree(long(100.0), lock(0.0, km)).names[SLOPE] for km in (6.0, 18.0, 60.0)]
    assert p == sorted(p)
    assert p[-1] > 0.99


def test_the_more_was_driven_the_more_comes_again_by_chance() -> None:
    p = [_tree(long(km), lock(0.0, 18.0)).names[SLOPE] for km in (60.0, 600.0, 3000.0)]
    assert p == sorted(p, reverse=True)


def test_only_the_other_way_separates_a_slope_from_a_surface() -> None:
    one_way, both = _tree(long(60.0), lock(30.0, 0.0)), _tree(long(60.0), lock(30.0, 30.0))
    assert one_way.names[SLOPE] == one_way.names[SURFACE]
    assert both.names[SURFACE] == 0.0
    assert sum(both.names.values()) == pytest.approx(1.0)
    assert both.names[UNKNOWN] < 0.01


def test_beside_a_simulator_of_known_physics_kernels_hold_the_road() -> None:
    assert road(evidence()) is None


def test_where_nothing_comes_again_the_size_decides() -> None:
    needed = {SLOPE: 0.02, "headwind": 24.0, "torque_derate": 0.6}
    assert _by_size(needed).stated(0.9) == SLOPE
    gentle = _by_size({SLOPE: 0.01, "headwind": 2.0, "torque_derate": 0.04})
    assert max(gentle.names.values()) < 0.5


SPEED, DT, KM = 20.0, 0.2, 30
ROWS = int(KM * 1000 / SPEED / DT)


def drives(nothing_missing: Evidence, count: int) -> Evidence:
    """As many drives of 30 km each."""
    drives = tuple(DriveRows(str(k), k * ROWS, (k + 1) * ROWS, 0.0, False) for k in range(count))
    distance = np.tile(np.arange(ROWS) * DT * SPEED, count)
    known = np.ones(count * ROWS)
    return replace(
        nothing_missing,
        drives=drives,
        residual=np.zeros(count * ROWS),
        valid=known > 0,
        signals={"distance": distance, "speed": SPEED * known},
    )


def slope(seed: int) -> np.ndarray:
    """A slope's force along 30 km, smooth over some 200 m, and as a recording shows it: not quite."""
    return 0.1 * gaussian_filter1d(np.random.default_rng(seed).normal(size=ROWS), 50) * np.sqrt(100)


def seen(force: np.ndarray, seed: int) -> np.ndarray:
    return force + 0.3 * slope(1000 + seed)


def test_the_same_way_and_the_other_way_are_distinguished(nothing_missing: Evidence) -> None:
    e = drives(nothing_missing, 6)
    there, back = slope(0), -slope(0)[::-1]
    found = road_lock(e, np.concatenate([seen(there, 1), seen(back, 2), *(slope(k) for k in range(3, 7))]))
    assert found is not None
    assert found.same_way_km == 0.0 and 30.0 < found.other_way_km < 50.0
    found = road_lock(e, np.concatenate([seen(there, 1), seen(there, 2), *(slope(k) for k in range(3, 7))]))
    assert found is not None
    assert found.other_way_km == 0.0 and 30.0 < found.same_way_km < 50.0


@pytest.mark.parametrize("seed", range(4))
def test_roads_driven_once_lock_nothing(seed: int, nothing_missing: Evidence) -> None:
    e = drives(nothing_missing, 6)
    assert road_lock(e, np.concatenate([slope(10 * seed + k) for k in range(6)])) is None


def test_a_force_that_pushes_alike_both_ways_is_no_slope(nothing_missing: Evidence) -> None:
    e = drives(nothing_missing, 6)
    there = slope(0)
    found = road_lock(
        e, np.concatenate([seen(there, 1), seen(there[::-1], 2), *(slope(k) for k in range(3, 7))])
    )
    assert found is None or found.other_way_km == 0.0


def test_a_short_log_shows_nothing(nothing_missing: Evidence) -> None:
    assert road_lock(nothing_missing, np.zeros(len(nothing_missing))) is None


LINE_N, MASS, DRAG = 3600, 28000.0, 1.2e-4
PER_FUEL = 0.40 * 35.8e3 / MASS  # m/s^2 per cm^3/s, times m/s


def drive(seed: int, slope: float, grade_recorded: bool = False) -> tuple[Evidence, Array]:
    """A driver who holds a speed that changes, over hills of this slope; and the slopes, (LINE_N,)."""
    rng = np.random.default_rng(seed)
    wished = 18.0 + 4.0 * np.sin(np.arange(LINE_N) / 47.0) + 1.5 * np.sign(np.sin(np.arange(LINE_N) / 13.0))
    speed, fuel, hills = np.empty(LINE_N), np.empty(LINE_N), np.empty(LINE_N)
    v = distance = 18.0
    for k in range(LINE_N):
        hills[k] = slope * np.sin(distance / 310.0)
        needed = 0.5 * (wished[k] - v) + DRAG * v**2 + GRAVITY * (0.006 + hills[k])
        fuel[k] = np.clip(needed * v / PER_FUEL, 0.0, 18.0)
        v += PER_FUEL * fuel[k] / v - DRAG * v**2 - GRAVITY * (0.006 + hills[k]) + rng.normal(0.0, 0.02)
        speed[k] = v
        distance += v
    signals: dict[str, Array] = {
        "speed": speed,
        "fuel_rate": fuel,
        "distance": np.cumsum(speed),
    }
    if grade_recorded:
        signals["grade"] = hills
    return of_signals(signals), hills


def of_signals(signals: Mapping[str, Array]) -> Evidence:
    zero = np.zeros(LINE_N)
    valid = np.ones(LINE_N, dtype=bool)
    drives = (DriveRows("a", 0, LINE_N, 0.0, False),)
    return Evidence(1.0, drives, zero, zero, zero, valid, dict(signals), {}, MASS, lambda name, amount: zero)


@pytest.mark.parametrize("seed", [0, 1])
def test_slopes_come_back_in_shape_and_size(seed: int) -> None:
    e, hills = drive(seed, 0.015)
    line = plain_truck(e)
    assert line is not None
    known = np.isfinite(line.left)
    assert known.mean() > 0.8
    recovered = -line.left[known] / GRAVITY
    assert np.corrcoef(recovered, hills[known])[0, 1] > 0.95
    assert abs(np.polyfit(hills[known], recovered, 1)[0] - 1.0) < 0.15


def test_a_recorded_slope_is_not_recovered_again() -> None:
    recovered, _ = drive(2, 0.015, grade_recorded=True)
    flat, _ = drive(2, 0.0)
    left = [plain_truck(e) for e in (recovered, flat)]
    assert left[0] is not None and left[1] is not None
    rms = [float(np.nanstd(line.left)) for line in left if line]
    assert rms[0] < 1.5 * rms[1] + 0.01


def test_without_an_engine_there_is_no_line() -> None:
    assert plain_truck(of_signals({"speed": np.full(LINE_N, 15.0)})) is None


FORCE_N, SIGMA = 3600, 0.1
TIME = np.arange(FORCE_N, dtype=float)
SLOW = np.sin(TIME / 40.0)
WEIGHT = np.ones(FORCE_N)


def at_speed(speed: float, drag: float) -> Evidence:
    zero, valid = np.zeros(FORCE_N), np.ones(FORCE_N, dtype=bool)
    signals = {
        "speed": np.full(FORCE_N, speed),
        "drag": np.full(FORCE_N, drag),
        "engine": np.full(FORCE_N, 0.3),
    }
    drives = (DriveRows("a", 0, FORCE_N, 0.0, False),)
    return Evidence(1.0, drives, zero, zero, zero, valid, signals, {}, 2e4, lambda name, amount: zero)


def found(size: float, doubt: float = 0.0, drag: float = 0.07) -> SlowForce | None:
    """What is said of a slow force of this amplitude under noise."""
    left = size * SLOW + np.random.default_rng(3).normal(0.0, SIGMA, FORCE_N)
    return slow_force(at_speed(20.0, drag), left, WEIGHT, SIGMA, doubt)


def test_a_slow_force_is_given_as_the_size_that_each_cause_would_need() -> None:
    road = found(0.3)
    assert road is not None
    assert road.rms == pytest.approx(0.3 / np.sqrt(2.0), rel=0.1)
    assert road.needed["road_grade"] == pytest.approx(road.rms / GRAVITY)
    assert road.needed["headwind"] == pytest.approx(road.rms / (2.0 * 0.07 / 20.0), rel=0.02)
    assert np.corrcoef(road.force, SLOW)[0, 1] > 0.95


def test_where_drag_is_large_less_wind_is_needed() -> None:
    light = found(0.15, drag=0.4)
    assert light is not None and light.needed["headwind"] < 10.0


@pytest.mark.parametrize(("size", "doubt"), [(0.0, 0.0), (0.08, 0.0), (0.2, 0.2)])
def test_what_is_small_or_doubtful_is_not_said(size: float, doubt: float) -> None:
    assert found(size, doubt) is None


def test_minutes_are_too_short() -> None:
    e = at_speed(20.0, 0.07)
    few: Mask = np.arange(FORCE_N) < 240
    short = Evidence(
        e.dt, e.drives, e.residual, e.simulated, e.disagreement, few, e.signals, {}, e.mass, e.rerun
    )
    assert slow_force(short, 0.5 * SLOW, WEIGHT, SIGMA) is None


def test_where_nothing_is_known_nothing_is_identified() -> None:
    weight = WEIGHT.copy()
    weight[1000:1100] = 0.0  # braking, say
    left = np.where(weight > 0.0, 0.3 * SLOW, 9.0)
    road = slow_force(at_speed(20.0, 0.07), left, weight, 0.01)
    assert road is not None and not road.force[1030:1070].any() and road.force[:990].all()
