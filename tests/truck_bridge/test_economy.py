"""The planner that saves fuel over CAN, in lock-step: what it knows of the road reaches its demands."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from deeptruck_cacc.controllers.economy import BAND_S
from deeptruck_cacc.controllers.road_ahead import AHEAD, AHEAD_M
from deeptruck_nodes import roads
from deeptruck_nodes.leaders import Steps
from deeptruck_nodes.observation import SECOND, Alignment
from truck_bridge import vehicles
from truck_bridge.emulator.ecus import EcuEmulator

sys.path.insert(0, str(Path(__file__).parent))  # the runs are scripts, and stand beside each other
from fault_chain import STALE_S, Chain

SPEED, SECONDS = 20.0, 90.0
HILLS = roads.Sine(grade=0.03, length=800.0)


class OverHills(Chain):
    """A chain over HILLS, of which its controller has a map, as node `road_map` publishes it."""

    def __init__(self, policy: str) -> None:
        vehicle, rng = vehicles.load("trucksim"), np.random.default_rng(0)
        super().__init__(vehicle, rng, Steps((SPEED, SPEED)), policy)
        self.truck = EcuEmulator(vehicle, self.trucks, speed=SPEED, grade=lambda way: HILLS.at(way)[0])
        self._samples = Alignment(False, vehicle.interface["grade"], STALE_S, True)
        self.fuel_l, self.braked_s, self.time_gaps = 0.0, 0.0, list[float]()

    def step(self) -> None:
        super().step()
        if round(self.now * 100) % 10 == 0:
            ahead = [HILLS.at(self.truck.distance + AHEAD_M * k)[0] for k in range(AHEAD)]
            self._samples.put_map(round(self.now * SECOND), ahead)
        if self.state == "engaged":
            self.fuel_l += self.truck.fuel_rate * 1e-5
            self.braked_s += 0.01 * (self.following.held[1] > 0)
            self.time_gaps.append(self.lane.ahead[0] / self.truck.speed)


def driven(policy: str) -> OverHills:
    chain = OverHills(policy)
    while chain.now < SECONDS:
        chain.step()
        if chain.state != "engaged" and round(chain.now * 100) == 200:
            assert chain.engage() == ()
    assert chain.state == "engaged"
    chain.close()
    return chain


@pytest.mark.long  # 180 s of driving, 10 ms a step
def test_over_can_the_economy_lets_the_truck_run_where_acc_brakes() -> None:
    plain, thrifty = driven("baseline:acc"), driven("planner:truck:trucksim?economy")
    assert thrifty.following.counts["shield_acted"] == 0
    assert BAND_S[0] < min(thrifty.time_gaps) and max(thrifty.time_gaps) < BAND_S[1]
    assert np.ptp(thrifty.time_gaps) > 0.3 > np.ptp(plain.time_gaps)
    assert plain.braked_s > 20.0 > 2.0 > thrifty.braked_s
    assert thrifty.fuel_l < 0.95 * plain.fuel_l
