"""Radar, controller, bridge and truck in lock-step: actuators that fail, set speed, standing, slopes."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))  # the runs are scripts, and stand beside each other
import sys
from pathlib import Path

from fault_chain import Chain, load

from deeptruck_nodes.following import Following
from deeptruck_nodes.leaders import Steps
from deeptruck_nodes.observation import SECOND, Observation
from truck_bridge import vehicles

ONE_FOR_ALL = [
    vehicles.NAMES[0],
    *(pytest.param(name, marks=pytest.mark.long) for name in vehicles.NAMES[1:]),
]
AT = 6.0  # s, when leader or actuator change
STEADY, BRAKING = Steps((18.0, 18.0), AT, 1.0), Steps((20.0, 0.0), AT, 2.0)


def drive(
    vehicle: str,
    leader: Steps,
    seconds: float,
    slope: float = 0.0,
    act: Callable[[Chain], object] = lambda chain: None,
    until: Callable[[Chain], bool] = lambda chain: False,
) -> Chain:
    """Engaged after 1 s; `act` is called in each step."""
    chain = Chain(load(vehicle), np.random.default_rng(1), leader, "baseline:acc", lambda way: slope)
    while chain.now < seconds and not until(chain):
        chain.step()
        if chain.now == 1.0:
            assert chain.engage() == ()
        act(chain)
    chain.close()
    return chain


@pytest.mark.parametrize("vehicle", ONE_FOR_ALL)
@pytest.mark.parametrize(
    ("leader", "axis", "fault", "value", "within_s", "reason"),
    [
        (BRAKING, "brake", "lost", 1.0, 4.0, "implausible: the brake does not answer"),
        (STEADY, "brake", "drags", 0.3, 3.0, "implausible: slows without our demand"),
        (STEADY, "engine", "lost", 1.0, 3.0, "implausible: engine_obeys is 0"),
        (STEADY, "engine", "gain", 0.0, 3.0, "implausible: engine_percent far below our demand"),
    ],
)
def test_an_actuator_that_does_not_do_what_is_demanded_is_said(
    vehicle, leader, axis, fault, value, within_s, reason
):
    def breaks(chain):
        chain.guard.shield.brakes.fails_below = 0.0  # the core alone
        if chain.now == AT:
            setattr(chain.truck.actuators[axis], fault, value)

    chain = drive(
        vehicle, leader, AT + within_s, act=breaks, until=lambda c: c.now > AT and c.state != "engaged"
    )
    assert chain.bridge.safety.reason == reason
    assert chain.state == ("stopping" if axis == "brake" and leader is BRAKING else "fading")


@pytest.mark.parametrize("vehicle", ONE_FOR_ALL)
def test_nobody_is_followed_faster_than_the_set_speed(vehicle):
    fastest = []

    def look(chain):
        chain.guard.set_speed = chain.vehicle.set_speed
        fastest.append(chain.truck.speed)

    chain = drive(vehicle, Steps((24.0, 33.0), AT, 1.0), 26.0, act=look)
    assert 24.5 < max(fastest) < 25.2
    assert chain.state == "engaged"


@pytest.mark.parametrize(("gap", "needs"), [(2.0, True), (10.0, True), (40.0, False)])
def test_too_near_its_leader_the_truck_is_not_engaged(gap, needs):
    chain = drive("volvo", STEADY, 0.9)
    following = Following(chain.guard, 2.0, 3.0)
    following.take(Observation(SECOND, 20.0, gap, 20.0, 0.0))
    room, needed = following.room
    assert room + needed == pytest.approx(gap)
    assert 10.0 < needed < 30.0
    chain.bridge.command(0.0, 0.0, chain.now, engaged=False, gap=(room + needed, needed))
    why = chain.engage()
    assert why == ((f"too near the vehicle ahead: {gap:.0f} m, needs {needed:.0f} m",) if needs else ())


@pytest.mark.parametrize("vehicle", ONE_FOR_ALL)
def test_a_leader_that_stood_for_long_drives_off_and_the_truck_asks(vehicle):
    """It stands for 3 s before its leader drives off again, and drives on once a person has engaged it."""
    asked = []

    def engage(chain):
        if chain.now == 30.0:
            asked.extend([chain.state, chain.truck.speed])
            assert chain.engage() == ()

    chain = drive(vehicle, Steps((8.0, 0.0, 8.0), 14.0, 2.0), 35.0, act=engage)
    assert asked == ["holding", 0.0]
    assert chain.state == "engaged"
    assert chain.truck.speed > 1.0


@pytest.mark.parametrize(
    ("vehicle", "slope"),  # these feel the slope
    [
        ("trucksim", -0.06), ("volvo", 0.06),
        *(pytest.param(*one, marks=pytest.mark.long) for one in (("trucksim", 0.06), ("volvo", -0.06))),
    ],
)  # fmt: skip
def test_on_a_slope_the_truck_stops_softly_and_is_held_by_the_brake(vehicle, slope):
    pulls, jerks = [], []

    def look(chain):
        pulls.append(chain.truck.acceleration)
        if len(pulls) > 60 and chain.truck.speed < 1.0 and chain.now > 12.0:
            jerks.append((np.mean(pulls[-30:]) - np.mean(pulls[-60:-30])) / 0.3)
        engine, brake = chain.truck.command
        assert not stands(100) or (engine == 0.0 and brake > 0.0)

    def stands(steps):
        return len(pulls) > steps + 50 and not any(pulls[-steps:])

    chain = drive(vehicle, Steps((12.0, 0.0), 4.0, 1.0), 35.0, slope, look, lambda _: stands(400))
    assert chain.state == "holding"
    assert chain.truck.speed == 0.0
    # trucksim down the slope: its nominal pedal map brakes too little, and the shield's limit the rest
    assert max(map(abs, jerks)) < (6.0 if (vehicle, slope) == ("trucksim", -0.06) else 3.0)
