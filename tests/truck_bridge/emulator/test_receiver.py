"""A controller's side of TSC1: hysteresis, priority, time-out, stuck senders."""

from __future__ import annotations

import math

import pytest

from truck_bridge import vehicles
from truck_bridge.emulator.receiver import Actuator, Receiver

ENGINE = vehicles.load("trucksim").transmitted["engine"]
ID = ENGINE.axis.can_id


@pytest.fixture
def receiver():
    return Receiver(ENGINE)


def bad(frame):
    return frame[:7] + bytes([frame[7] ^ 0x10])


def test_a_demand_holds_for_its_time_out_and_then_returns_without_a_step(receiver):
    receiver.hear(ID ^ 0x0F00, ENGINE.frame(60.0, 0), 1.0)  # for another node
    assert math.isnan(receiver.demand(1.0)) and receiver.controlling == 0xFF
    receiver.hear(ID, ENGINE.frame(60.0, 0), 1.0)
    assert receiver.demand(1.0) == 60.0
    assert receiver.controlling == ID & 0xFF
    assert receiver.demand(1.09) == 60.0
    falling = [receiver.demand(1.19 + 0.1 * k) for k in range(4)]
    assert falling[:2] == pytest.approx([40.0, 20.0])
    assert math.isnan(falling[-1])
    assert receiver.controlling == 0xFF


def test_mode_0_hands_back_at_once(receiver):
    receiver.hear(ID, ENGINE.frame(60.0, 0), 1.0)
    receiver.demand(1.0)
    receiver.hear(ID, ENGINE.frame(math.nan, 1), 1.02)
    assert math.isnan(receiver.demand(1.02))


def test_a_wrong_checksum_and_a_stuck_counter_are_not_obeyed(receiver):
    receiver.hear(ID, bad(ENGINE.frame(60.0, 0)), 1.0)
    assert math.isnan(receiver.demand(1.0))
    receiver.hear(ID, ENGINE.frame(60.0, 1), 1.02)
    receiver.hear(ID, ENGINE.frame(90.0, 1), 1.04)
    assert receiver.demand(1.04) == 60.0


def test_three_bad_frames_are_forgiven_after_ten_good_ones(receiver):
    for k in range(3):
        receiver.hear(ID, bad(ENGINE.frame(60.0, k)), 1.0 + 0.02 * k)
    for k in range(10):
        assert math.isnan(receiver.demand(1.06 + 0.02 * k))
        receiver.hear(ID, ENGINE.frame(60.0, k), 1.06 + 0.02 * k)
    assert receiver.demand(1.24) == 60.0


def test_the_higher_priority_wins_and_then_the_later(receiver):
    strong = dict(ENGINE.active, OverrideControlModePriority=0, RequestedTorque=10.0)
    from truck_bridge.j1939 import checksums

    other = ID & ~0xFF | 0x03
    receiver.hear(other, checksums.sign("tsc1", other, ENGINE.layout.encode(strong), 0), 1.0)
    receiver.hear(ID, ENGINE.frame(60.0, 0), 1.01)
    assert receiver.demand(1.01) == 10.0
    assert receiver.controlling == 0x03


@pytest.mark.parametrize(
    ("full", "fault", "demands", "given"),
    [
        (90.0, {}, [10.0, 20.0, math.nan], [10.0, 20.0, 0.0]),
        (90.0, {"gain": 0.5}, [10.0, 20.0], [5.0, 10.0]),
        (-5.0, {"gain": 0.0}, [-2.0, math.nan], [0.0, 0.0]),
        (90.0, {"late_s": 0.2}, [1.0, 2.0, 3.0, 4.0, 5.0], [1.0, 1.0, 1.0, 2.0, 3.0]),
        (90.0, {"drags": 0.3}, [0.0, 20.0, 40.0], [27.0, 27.0, 40.0]),
        (-90.0, {"drags": 0.3}, [0.0, -20.0, -40.0], [-27.0, -27.0, -40.0]),
    ],
)
def test_what_an_actuator_gives_at_each_step_of_0_1_s(full, fault, demands, given):
    actuator, found = Actuator(full, **fault), []
    for step, demand in enumerate(demands):
        actuator.act(demand, 0.1 * step)
        found.append(actuator.given)
    assert found == pytest.approx(given)
    actuator.stuck = 1.0
    actuator.act(80.0, 9.0)
    assert actuator.given == found[-1]
