"""Which samples make an observation."""

from __future__ import annotations

import math
from typing import Any

import pytest

from deeptruck_nodes.observation import SECOND, Alignment, Observation


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
