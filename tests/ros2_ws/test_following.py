"""The controller's core before trucks that `deeptruck-model new` makes, with a noisy radar and drop-outs."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from deeptruck_cacc.controllers.scaling import ActionScale
from deeptruck_cacc.safety.assumptions import GOES_ON_S
from deeptruck_cacc.safety.guard import load_controller
from deeptruck_model.trucks import PhysicsTruck, load, own_truck
from deeptruck_nodes import leaders
from deeptruck_nodes.following import Following
from deeptruck_nodes.observation import SECOND, Alignment, Observation
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
    farther = gaps - drive(truck, leader, 60.0, 1, RadarErrors())[1]
    assert farther.min() > -0.5 and farther.max() < 2.5  # it sees 0.2 s later that the leader brakes no more
    # the shield takes the engine back at the first readings that show the leader brake: a jolt of 0.17 m/s^2
    assert np.abs(np.diff(engines)).max() < 0.35 * ActionScale.of(truck).engine_high
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


def test_before_anything_was_seen_the_driver_is_not_warned_of_it() -> None:
    """The guard brakes fully until then, by a command that is not sent."""
    following = Following(load_controller("baseline:acc", load("trucksim").interface), 2.0, 3.0)
    following.take(Observation(SECOND, 20.0, math.nan, math.nan, 0.0))
    assert math.isnan(following.held[1]) and following.needed_braking == 0.0


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
    goes_on = round(GOES_ON_S / 0.1)  # from then on it may have left
    assert all(mild < hold <= full for _, hold in braked[: goes_on - 1])
    assert all(hold == pytest.approx(mild) for _, hold in braked[goes_on + 1 : first + 1])
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


# Which samples make an observation


def fill(samples: Alignment, stamp: int, gap: float = 40.0, leader_speed: float = 21.0) -> list[Any]:
    values = {"engaged": 1.0, "grade": 0.01, "speed": 20.0, "gap": gap, "leader_speed": leader_speed}
    return [samples.put(name, stamp, value) for name, value in values.items()]


def test_lockstep_waits_for_all_in_any_order() -> None:
    samples = Alignment(strict=True, uses_grade=True, stale_after_s=0.3)
    for name, value in (("leader_speed", 21.0), ("engaged", 1.0), ("gap", 40.0), ("grade", 0.01)):
        assert samples.put(name, 100, value) is None
    assert samples.put("speed", 100, 20.0) == Observation(100, 20.0, 40.0, 21.0, 0.01)


def test_an_observation_comes_once() -> None:
    samples = Alignment(strict=True, uses_grade=True, stale_after_s=0.3)
    assert [bool(o) for o in fill(samples, 100)] == [False, False, False, False, True]
    assert not any(fill(samples, 100))


def test_nobody_waits_for_a_road_that_is_not_sensed_and_an_invalid_grade_is_flat() -> None:
    samples = Alignment(strict=True, uses_grade=False, stale_after_s=0.3)
    for name, value in (("speed", 20.0), ("engaged", 0.0), ("gap", 40.0)):
        samples.put(name, 5, value)
    assert samples.put("leader_speed", 5, 21.0) == Observation(5, 20.0, 40.0, 21.0, 0.0)
    sensed = Alignment(strict=False, uses_grade=True, stale_after_s=0.3)
    for name, value in (("grade", math.nan), ("speed", 20.0), ("gap", 40.0)):
        sensed.put(name, 1, value)
    seen = sensed.put("leader_speed", 1, 21.0)
    assert seen is not None and seen.grade == 0.0


def test_in_real_time_a_radar_sample_takes_the_newest_speed_but_its_own_two_halves_must_match() -> None:
    samples = Alignment(strict=False, uses_grade=True, stale_after_s=0.3)
    samples.put("speed", 90, 19.0)
    samples.put("gap", 100, 40.0)
    assert samples.put("leader_speed", 99, 21.0) is None
    seen = samples.put("leader_speed", 100, 21.5)
    assert seen is not None and (seen.speed, seen.leader_speed) == (19.0, 21.5)


def test_a_dropout_is_nan_and_half_a_reading_is_one() -> None:
    samples = Alignment(strict=True, uses_grade=True, stale_after_s=0.3)
    for stamp, (gap, leader) in enumerate([(math.inf, math.nan), (40.0, math.nan), (math.inf, 20.0)]):
        lost = fill(samples, stamp, gap, leader)[-1]
        assert math.isnan(lost.gap) and math.isnan(lost.leader_speed)


def test_a_radar_that_is_late_is_none_in_real_time() -> None:
    samples = Alignment(strict=False, uses_grade=True, stale_after_s=0.3)
    samples.put("speed", SECOND, 20.0, SECOND)
    for late, is_taken in ((0.31, False), (0.29, True)):
        stamp = round((1.0 - late) * SECOND)
        samples.put("gap", stamp, 40.0, SECOND)
        assert (samples.put("leader_speed", stamp, 21.0, SECOND) is not None) is is_taken


class Sensors:
    """Truck and radar at 10 Hz, received after 20 ms; stamps in s may be set."""

    def __init__(self) -> None:
        self.samples, self._step = Alignment(strict=False, uses_grade=False, stale_after_s=0.3), 0

    def send(self, *, truck: float = 0.0, radar: float = 0.0) -> bool:
        """One message of each, with a stamp off by so many s; whether an observation came of it."""
        self._step += 1
        received = self._step * SECOND // 10
        stamp = received - SECOND // 50
        off = {"speed": truck, "gap": radar, "leader_speed": radar}
        found = [
            self.samples.put(name, stamp + round(by * SECOND), 20.0, received) for name, by in off.items()
        ]
        return any(found)


@pytest.mark.parametrize("truck", [0.0, 3600.0, -60.0])
@pytest.mark.parametrize("radar", [3600.0, -60.0, 1.0])
def test_one_false_stamp_is_refused_and_the_next_true_message_is_used(truck: float, radar: float) -> None:
    sensors = Sensors()
    assert all(sensors.send() for _ in range(5))
    assert not sensors.send(truck=truck, radar=radar)
    assert all(sensors.send() for _ in range(5))
    says = "stamped in the past" if radar < 0 else "stamped in the future"
    assert sensors.samples.refused[f"radar range {says}"] == 1


@pytest.mark.parametrize("by", [3600.0, -60.0])
def test_a_clock_that_was_set_is_noticed_and_its_second_message_used(by: float) -> None:
    sensors = Sensors()
    assert all(sensors.send() for _ in range(5))
    assert [sensors.send(truck=by, radar=by) for _ in range(4)] == [False, True, True, True]
    assert sensors.samples.refused["the clock of the truck speed was set"] == 1
    assert [sensors.send() for _ in range(4)] == [False, True, True, True]


def test_a_radar_whose_clock_is_not_that_of_the_truck_is_refused_and_counted() -> None:
    sensors = Sensors()
    assert not any(sensors.send(radar=3600.0) for _ in range(5))
    assert sensors.samples.refused == {"radar newer than the truck speed": 5}
    assert [sensors.send() for _ in range(3)] == [False, True, True]


def test_messages_that_waited_are_no_clock_that_was_set() -> None:
    samples = Alignment(strict=False, uses_grade=False, stale_after_s=0.3)
    for step in range(30):
        stamp = step * SECOND // 10
        received = max(stamp, 2 * SECOND) if step > 5 else stamp  # nothing was taken from 0.6 s to 2 s
        for name in ("speed", "gap", "leader_speed"):
            samples.put(name, stamp, 20.0, received)
    assert not samples.refused
