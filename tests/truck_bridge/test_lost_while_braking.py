"""Radar, controller, bridge and truck in lock-step: what is lost while the truck brakes for its leader."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))  # the runs are scripts, and stand beside each other
from fault_chain import STEP, Chain, load
from fault_lies import Lie, RadarLie
from fault_table import _arrive

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
@pytest.mark.parametrize(("braking", "lost_after"), [(4.0, 1.0), (3.0, 1.0), (6.0, 1.0)])
def test_a_radar_that_vanishes_in_braking_does_not_end_it(vehicle, braking, lost_after):
    chain, hit = drive(vehicle, braking, lost_after)
    assert hit <= (HIT_M_S if (vehicle, braking) == ("volvo", 6.0) else 0.0)
    assert chain.truck.speed == 0.0
    assert chain.state == "stopping"
    assert chain.bridge.status.warning == "Take over: braking to a standstill (command refused)"


@pytest.mark.parametrize("vehicle", vehicles.NAMES)
def test_a_leader_that_vanishes_in_gentle_braking_may_have_left(vehicle):
    """The truck brakes gently and asks its driver, who has 5.5 s and more until it would hit a leader that
    braked on."""
    leader = Steps((22.0, 0.0), BRAKES_AT, 2.0)
    chain = Chain(load(vehicle), np.random.default_rng(1), leader, "baseline:acc", lambda way: 0.0)
    while chain.lane.ahead[0] > 0.0:
        chain.step()
        if chain.now == 1.0:
            assert chain.engage() == ()
        if chain.now == BRAKES_AT + 2.0:
            chain.lies.append(RadarLie("absent", ("gap", "leader_speed")))
    chain.close()
    asked = next(at for at, state in chain.states if state == "stopping")
    time, speed, _ = np.array(chain.speeds).T
    pull = (speed[:-30] - speed[30:]) / (time[30:] - time[:-30])
    assert asked < BRAKES_AT + 2.0 + 3.2 and chain.now - asked > 5.5
    assert pull[time[30:] > asked + 0.5].max() < 1.8
    assert chain.truck.speed < 9.5  # it followed at 22


def silent(chain):
    chain.ours.lies.append(Lie(chain.vehicle, "silent", ("brake_pedal",)))


def dead(chain):
    chain._send = lambda: None


@pytest.mark.parametrize(
    ("fault", "lost_after", "reason"),
    [
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


def test_a_truck_that_is_slower_than_its_leader_by_then_rolls_out():
    """A loss in the first second of braking, and the core brakes harder than is needed."""
    chain, hit = drive("trucksim", 4.0, 1.0, silent)
    states = [state for _, state in chain.states]
    assert hit == 0.0 and states[-4:] == ["stopping", "fading", "releasing", "standby"]
    assert chain.truck.speed < 2.0 and chain.lane.ahead[0] > 20.0


# who asks for the end of control while the truck brakes hard

ASKED_AT = -3.5  # m/s^2, behind a leader that brakes from 18 m/s by 5 m/s^2
TRUCKS = ["trucksim", *(pytest.param(name, marks=pytest.mark.long) for name in vehicles.NAMES[1:])]


def one_frame(signal: str, value: float) -> Callable[[Chain], object]:
    """One frame of the signal's message holds this value."""

    def ask(chain):
        lie = Lie(chain.vehicle, "value", (signal,), value)
        chain.ours.lies.append(lie)
        period = next(h.period_s for h in chain.vehicle.table.heard if signal in {s.name for s in h.signals})
        return period - STEP, lambda: chain.ours.lies.remove(lie)

    return ask


def driver(key: str, value: float, seconds: float) -> Callable[[Chain], object]:
    """What the driver does for so long."""

    def ask(chain):
        setattr(chain.truck.driver, key, value)
        return seconds, lambda: setattr(chain.truck.driver, key, 0.0)

    return ask


def abs_acts(chain):
    lie = Lie(chain.vehicle, "value", ("abs_active",), 1.0)
    chain.ours.lies.append(lie)
    return 0.3, lambda: chain.ours.lies.remove(lie)


def arrives(kind: str) -> Callable[[Chain], object]:
    return lambda chain: _arrive(chain, kind)


def clock(jump: float) -> Callable[[Chain], object]:
    return lambda chain: setattr(chain, "offset", jump)


def operator(chain):
    chain.bridge.release(chain.now + chain.offset, "released by service")


def after_a_loss(ask: Callable[[Chain], object]) -> Callable[[Chain], object]:
    def both(chain):
        chain.bridge.safety.fade(chain.now, "a loss")
        return ask(chain)

    return both


ASKS = {  # and for what control is lost; the truck brakes on
    "bus off": (arrives("bus off"), "link lost"),
    "our address used": (arrives("our address used"), "another node uses our address"),
    "address lost": (arrives("address lost"), "link lost"),
    "clock 0.05 s back": (clock(-0.05), "clock went back"),
    "clock 30 s back": (clock(-30.0), "clock went back"),
    "clock 30 s ahead": (clock(30.0), "stalled"),
    "bridge paused": (lambda chain: setattr(chain, "paused_until", chain.now + 0.3), "stalled"),
    "operator": (operator, "released by service"),
    "brake switch, a frame": (one_frame("brake_switch", 1.0), ""),
    "brake pedal, a frame": (one_frame("brake_pedal", 40.0), ""),
    "accelerator, a frame": (one_frame("accelerator", 60.0), ""),
    "cancel, a frame": (one_frame("cancel", 1.0), ""),
    "accelerator at 6 %": (driver("accelerator", 6.0, 0.15), ""),
    "cancel for 0.15 s": (driver("cancel", 1.0, 0.15), ""),
    "ABS for 0.3 s": (abs_acts, ""),
    "driver brakes by 10 %": (driver("brake_pedal", 10.0, 9.0), "driver: brake_switch"),
    "stopping, bus off": (after_a_loss(arrives("bus off")), "a loss"),
    "stopping, our address used": (after_a_loss(arrives("our address used")), "a loss"),
    "stopping, address lost": (after_a_loss(arrives("address lost")), "a loss"),
    "stopping, clock 0.05 s back": (after_a_loss(clock(-0.05)), "a loss"),
    "stopping, operator": (after_a_loss(operator), "a loss"),
}


def asked(vehicle: str, ask: Callable[[Chain], object], seconds: float = 8.0) -> tuple[Chain, float, float]:
    """The chain so long after it was asked or at a standstill, the speed of its hit, when it was asked."""
    at, hit, begin = 3.0, 0.0, math.inf
    chain = Chain(
        load(vehicle), np.random.default_rng(1), Steps((18.0, 0.0), at, 5.0), "baseline:acc", lambda way: 0.0
    )
    ends: tuple[float, Callable[[], object]] | None = None
    while chain.now < min(begin, at + 4.0) + seconds and not hit and chain.truck.speed > 0.02:
        chain.step()
        if chain.now == 0.6:
            assert chain.engage() == ()
        if math.isinf(begin) and chain.now > at and chain.truck.acceleration < ASKED_AT:
            begin, lasting = chain.now, ask(chain)
            ends = (chain.now + lasting[0], lasting[1]) if isinstance(lasting, tuple) else None
        if ends is not None and chain.now >= ends[0] - STEP / 2:
            ends[1]()
            ends = None
        if chain.lane.ahead[0] <= 0.0:
            hit = chain.truck.speed - chain.lane.ahead[1]
    chain.close()
    return chain, hit, begin


@pytest.mark.parametrize("vehicle", TRUCKS)
@pytest.mark.parametrize("ask", ASKS)
def test_whoever_asks_the_truck_stops_behind_its_leader(vehicle, ask):
    what, reason = ASKS[ask]
    chain, hit, begin = asked(vehicle, what)
    assert math.isfinite(begin) and hit == 0.0
    assert chain.lane.ahead[0] > 3.0
    assert chain.bridge.safety.reason == reason
    assert chain.bridge.engaged != bool(reason)


@pytest.mark.parametrize("vehicle", TRUCKS)
@pytest.mark.parametrize(
    ("ask", "within_s"),
    [
        (driver("accelerator", 30.0, 9.0), 0.12),  # two frames of EEC2
        (driver("cancel", 1.0, 9.0), 0.42),
        (driver("brake_pedal", 20.0, 0.5), 0.62),  # from when it is lifted, a frame of it
    ],
)
def test_a_driver_who_means_it_has_the_truck(vehicle, ask, within_s):
    chain, _, begin = asked(vehicle, ask, seconds=1.0)
    (released,) = [at for at, state in chain.states if state == "releasing"]
    assert released - begin <= within_s
    assert chain.bridge.safety.reason.startswith("driver: ")


HARDEST = {"trucksim": (4.4, 5.2), "freightliner": (5.3, 6.3), "volvo": (5.2, 6.1)}  # m/s^2, mean of 0.3 s


@pytest.mark.parametrize("vehicle", TRUCKS)
def test_the_driver_is_warned_before_the_truck_brakes_by_3(vehicle):
    """By the red stop lamp; and how hard each truck brakes in the end, as the page says."""
    chain, *_ = asked(vehicle, lambda chain: None)
    red = [at for at, can_id, data in chain.ours.sent if can_id == 0x18FECA2A and data[0] == 1 << 4]
    time, speed, _ = np.array(chain.speeds).T
    pull = (speed[:-30] - speed[30:]) / (time[30:] - time[:-30])
    assert red[0] <= time[30:][pull > 3.0][0] - 0.2
    assert red[0] > 3.0  # when the leader begins to brake
    assert HARDEST[vehicle][0] < pull.max() < HARDEST[vehicle][1]


@pytest.mark.parametrize("vehicle", TRUCKS)
def test_nobody_is_warned_of_a_leader_that_slows_gently(vehicle):
    leader = Steps((18.0, 12.0), 3.0, 1.0)
    chain = Chain(load(vehicle), np.random.default_rng(1), leader, "baseline:acc", lambda way: 0.0)
    while chain.now < 10.0:
        chain.step()
        if chain.now == 0.6:
            assert chain.engage() == ()
    chain.close()
    assert chain.bridge.engaged
    assert not [at for at, can_id, data in chain.ours.sent if can_id == 0x18FECA2A and data[0]]


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
    stopping = next(at for at, state in chain.states if state == "stopping")
    sent = [(at, data[0]) for at, can_id, data in chain.ours.sent if can_id == 0x18FECA2A]
    reports = [(at, lamps) for at, lamps in sent if at >= stopping]
    assert 0.9 < np.diff([at for at, _ in reports]).mean() < 1.1
    assert {lamps for _, lamps in reports} == {1 << 4}
    chain.truck.driver.brake_pedal = 40.0
    for _ in range(300):
        chain.step()
    assert chain.state == "standby"
    assert [data[0] for at, can_id, data in chain.ours.sent if can_id == 0x18FECA2A][-1] == 1 << 2
