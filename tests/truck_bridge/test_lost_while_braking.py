"""Radar, controller, bridge and truck in lock-step: what is lost while the truck brakes for its leader."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))  # the runs are scripts, and stand beside each other
from fault_chain import Chain, load
from fault_lies import Lie, RadarLie

from deeptruck_nodes.leaders import Steps
from truck_bridge import vehicles

BRAKES_AT = 6.0  # s, when the truck follows at its time gap
STOOD = 100  # steps at rest, after which nothing moves any more
HIT_M_S = 3.5  # `volvo` behind -6 m/s^2: the shield expects less of a leader that it does not see (its page)


class OppositeSign:
    """A radar whose relative speed has the wrong sign."""

    def __init__(self, chain: Chain) -> None:
        self._truck = chain.truck

    def readings(self, elapsed: float, gap: float, speed: float) -> list[tuple[float, float, float]]:
        return [(gap, 2 * self._truck.speed - speed, 0.0)]


def drive(
    vehicle: str, braking: float, lost_after: float, fault: Callable[[Chain], object] | None = None
) -> tuple[Chain, float]:
    """Behind a leader that brakes from 22 m/s to a standstill, with a fault `lost_after` s later, else a
    radar that sees nothing, until the truck stands. The chain then, and by how much the truck was faster when
    it hit."""
    leader = Steps((22.0, 0.0), BRAKES_AT, braking)
    chain, hit = Chain(load(vehicle), np.random.default_rng(1), leader, "baseline:acc", lambda way: 0.0), 0.0
    stood = 0
    while chain.now < BRAKES_AT + 20.0 and stood < STOOD:
        chain.step()
        stood = stood + 1 if chain.truck.speed == 0.0 else 0
        if chain.now == 1.0:
            assert chain.engage() == ()
        if chain.now == BRAKES_AT + lost_after:
            if fault is None:
                chain.lies.append(RadarLie("absent", ("gap", "leader_speed")))
            else:
                fault(chain)
        if chain.lane.ahead[0] <= 0.0:
            hit = hit or chain.truck.speed - chain.lane.ahead[1]
    chain.close()
    return chain, hit


@pytest.mark.parametrize("vehicle", vehicles.NAMES)
@pytest.mark.parametrize(("braking", "lost_after"), [(4.0, 1.0), (3.0, 1.0), (6.0, 1.0), (2.0, 2.0)])
def test_a_radar_that_vanishes_in_braking_does_not_end_it(vehicle, braking, lost_after):
    chain, hit = drive(vehicle, braking, lost_after)
    assert hit <= (HIT_M_S if (vehicle, braking) == ("volvo", 6.0) else 0.0)
    assert chain.truck.speed == 0.0
    assert chain.state == "stopping"
    assert chain.bridge.status.warning == "Take over: braking to a standstill (command refused)"


def silent(chain):
    chain.ours.lies.append(Lie(chain.vehicle, "silent", ("brake_pedal",)))


def dead(chain):
    chain._send = lambda: None


@pytest.mark.parametrize(
    ("fault", "lost_after", "reason"),
    [
        (silent, 1.0, "EBC1 stale"),  # while the truck brakes little; the controller goes on
        (silent, 4.0, "EBC1 stale"),
        (dead, 1.0, "controller lost"),
        (dead, 4.0, "controller lost"),
        (lambda chain: chain.lies.append(OppositeSign(chain)), 1.0, None),
    ],
)
def test_whatever_else_is_lost_in_braking_does_not_end_it_either(fault, lost_after, reason):
    chain, hit = drive("trucksim", 3.0, lost_after, fault)
    assert hit == 0.0
    assert chain.truck.speed == 0.0
    assert chain.state == "stopping"
    assert chain.bridge.status.acts_alone
    assert reason in (None, chain.bridge.safety.reason)


def test_a_radar_that_vanishes_behind_a_steady_leader_lets_the_truck_roll_out():
    leader = Steps((22.0, 22.0), BRAKES_AT, 1.0)
    chain = Chain(load("volvo"), np.random.default_rng(1), leader, "baseline:acc", lambda way: 0.0)
    for _ in range(1600):
        chain.step()
        if chain.now == 1.0:
            assert chain.engage() == ()
        if chain.now == BRAKES_AT:
            chain.lies.append(RadarLie("absent", ("gap", "leader_speed")))
    chain.close()
    assert chain.state == "standby"
    assert chain.truck.speed > 15.0


def test_the_lamp_says_so_until_the_driver_has_it():
    """DM1 of the bridge: red while it brakes to a standstill, amber from then on, off when engaged again."""
    chain, _ = drive("trucksim", 4.0, 1.0)
    reports = [(at, data[0]) for at, can_id, data in chain.ours.sent if can_id == 0x18FECA2A]
    assert 0.9 < np.diff([at for at, _ in reports]).mean() < 1.1
    assert {lamps for _, lamps in reports} == {1 << 4}
    chain.truck.driver.brake_pedal = 40.0
    for _ in range(300):
        chain.step()
    assert chain.state == "standby"
    assert [data[0] for at, can_id, data in chain.ours.sent if can_id == 0x18FECA2A][-1] == 1 << 2
