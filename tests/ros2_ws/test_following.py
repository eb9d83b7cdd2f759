"""The controller's core before trucks that `deeptruck-model new` makes, with a noisy radar and drop-outs."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from deeptruck_cacc.controllers.scaling import ActionScale
from deeptruck_cacc.safety.guard import load_controller
from deeptruck_model.trucks import PhysicsTruck, load, own_truck
from deeptruck_nodes import leaders
from deeptruck_nodes.following import Following
from deeptruck_nodes.observation import SECOND, Observation
from deeptruck_nodes.plant import Plant
from deeptruck_nodes.radar import Gap, Radar, RadarErrors
from deeptruck_nodes.roads import parse as parse_road

NOISY = RadarErrors(range_noise=0.1, speed_noise=0.05, dropout_rate=0.2)
TEN = [12.69, 9.29, 6.75, 4.90, 3.62, 2.59, 1.90, 1.38, 1.00, 0.74]
SHEETS: dict[str, dict[str, Any]] = {
    "heavy and weak": {
        "mass_kg": 60_000, "gear_ratios": TEN, "axle_ratio": 3.7, "tyres": 0.5, "rated_torque_nm": 2600,
        "frontal_area_m2": 10, "full_braking_m_s2": 3.5,
    },
    "bus with a converter": {
        "mass_kg": 12_000, "gear_ratios": [3.49, 1.86, 1.41, 1.0, 0.75, 0.65], "axle_ratio": 4.6,
        "tyres": "275/70R22.5", "rated_torque_nm": 1100, "frontal_area_m2": 7.5, "full_braking_m_s2": 6,
        "converter": True, "brake_unit": "m/s^2",
    },
}  # fmt: skip


@pytest.mark.parametrize(
    ("sheet", "leader", "often"),
    [("heavy and weak", "sine:speed=20", 0.05), ("bus with a converter", "constant:speed=20", 0.005)],
)
def test_acc_drives_a_truck_of_a_data_sheet_smoothly(sheet: str, leader: str, often: float) -> None:
    """No step of the engine command by over 80 % of its range, and by over 30 % `often` at most."""
    made = own_truck.specification(own_truck.sheet(SHEETS[sheet], sheet), "mine")
    truck = PhysicsTruck(made)
    steps, gaps = drive(truck, leader, 60.0)
    scale = ActionScale.of(truck)
    jumps = np.abs(np.diff(steps)) / (scale.engine_high - scale.engine_low)
    assert jumps.max() <= 0.8 and (jumps > 0.3).mean() <= often
    assert min(gaps) > 35.0


@pytest.mark.parametrize("every", [pytest.param(2, marks=pytest.mark.long), 3])
def test_behind_a_slower_radar_it_drives_as_behind_one_of_ten_readings_a_second(every: int) -> None:
    """5 and 3.3 readings a second: a leader that brakes by 2 m/s^2, and drop-outs of 6 s."""
    truck, leader = load("trucksim"), "steps:speeds=20/12,every=30,acceleration=2"
    lost = RadarErrors(dropout_rate=0.03, dropout_s=6.0)
    engines, gaps = (np.array(x) for x in drive(truck, leader, 60.0, every, RadarErrors()))
    assert np.abs(gaps - drive(truck, leader, 60.0, 1, RadarErrors())[1]).max() < 0.5
    # the shield cuts the engine at the first reading that shows the leader brake: a jolt of 0.13 m/s^2
    assert np.abs(np.diff(engines)).max() < 0.25 * ActionScale.of(truck).engine_high
    fast, slow = (drive(truck, "constant:speed=20", 60.0, n, lost) for n in (1, every))
    assert min(slow[1]) > min(fast[1]) - 0.5


@pytest.mark.parametrize("period_s", [0.05, 0.077, 0.1, 0.2, 0.3])
def test_a_leader_is_lost_after_the_same_time_whatever_the_rate_of_the_radar(period_s: float) -> None:
    following = Following(load_controller("baseline:acc", load("trucksim").interface), 2.0, 3.0)
    for k in range(round(9.0 / period_s)):
        t = k * period_s
        gap, speed = (60.0, 20.0) if t < 3.0 else (math.nan, math.nan)
        following.take(Observation(round((1.0 + t) * SECOND), 20.0, gap, speed, 0.0))
        assert following.leads == (t < 6.0) or abs(t - 6.0) < 0.35
    assert math.isnan(following.held[0])


def drive(
    truck: PhysicsTruck, leader: str, seconds: float, every: int = 1, errors: RadarErrors = NOISY
) -> tuple[list[float], list[float]]:
    """Engine command and true gap (m) of each step, at 2 s; a reading `every` so many steps."""
    plant = Plant(truck, parse_road("flat"), 20.0)
    following = Following(load_controller("baseline:acc", truck.interface), 2.0, 3.0)
    profile = leaders.parse(leader)
    ahead, radar = Gap(profile, 0.0, 2.0), Radar(errors, 3)
    engines, gaps = [], []
    for k in range(round(seconds / plant.dt)):
        ahead.update(k * plant.dt, plant.speed)
        gap, speed = radar.sense(k * plant.dt, ahead.gap, ahead.leader_speed)
        gap = gap if math.isfinite(gap) else math.nan
        stamp = round((1.0 + k * plant.dt) * SECOND)
        if k % every == 0:
            following.take(Observation(stamp, plant.speed, gap, speed, 0.0))
        command = following.held if math.isfinite(sum(following.held)) else (0.0, 0.0)
        plant.step(*command)
        engines.append(command[0])
        gaps.append(ahead.gap)
    return engines, gaps


def lost(gap: float, speed: float, leader_speed: float, braking: float) -> list[tuple[float, float]]:
    """Brake commands, and those to go on with, from the loss of a leader on, that was seen for 3 s and braked
    in the last."""
    following = Following(load_controller("baseline:acc", load("freightliner").interface), 2.0, 3.0)
    commands = []
    for k in range(65):
        seen = k < 30
        now = leader_speed - braking * max(0.1 * k - 2.0, 0.0)
        reading = (gap, now) if seen else (math.nan, math.nan)
        following.take(Observation((10 + k) * SECOND // 10, speed, *reading, 0.0))
        commands += [] if seen else [(following.held[1], following.hold_brake)]
    return commands


def test_behind_a_leader_that_braked_it_says_how_to_go_on_braking_and_else_does_not() -> None:
    guard = load_controller("baseline:acc", load("freightliner").interface)
    assert guard.shield is not None
    assumed, full = guard.shield.assumed, ActionScale.of(guard).brake_high
    mild = (assumed.bite + 1.5 / assumed.brake_gain) * full  # what bridge and truck go on with
    steady, braked = lost(60.0, 20.0, 20.0, 0.0), lost(60.0, 20.0, 20.0, 2.0)
    assert all(math.isnan(hold) for _, hold in steady)
    first = next(k for k, (brake, _) in enumerate(braked) if math.isnan(brake))
    assert 28 <= first <= 32  # 3 s
    assert all(mild < hold <= full for _, hold in braked[: first + 1])  # and with the first that is none
    assert all(math.isnan(brake) and math.isnan(hold) for brake, hold in braked[first + 1 :])


@pytest.mark.parametrize(("leader_speed", "named"), [(0.0, True), (5.0, False)])
def test_rolling_out_ends_at_what_stands_and_not_at_what_drives(leader_speed: float, named: bool) -> None:
    """0.4 m/s^2 are needed: less than a truck that rolls out has, until its engine idles."""
    following = Following(load_controller("baseline:acc", load("trucksim").interface), 2.0, 3.0)
    closing = 4.0
    for k in range(20):
        gap = 25.0 + closing * 0.1 * (19 - k)
        seen = Observation((10 + k) * SECOND // 10, leader_speed + closing, gap, leader_speed, 0.0)
        following.take(seen)
    assert math.isfinite(following.hold_brake) == named
