"""The promise: "Whoever takes control away, braking that a known hazard needs goes on until the hazard is
no longer assumed, or the driver takes over."
"""

from __future__ import annotations

import math
from itertools import pairwise

import pytest

from truck_bridge.safety import State
from truck_bridge.safety.ending import BrakeHold

HARD = 1.6  # of the bench: times `holds_beyond`
CYCLE = 0.005

FIRM = {
    "accelerator": (24.0, 0.04),
    "brake_pedal": (2.8, 0.28),
    "brake_switch": (1.0, 0.28),
    "cancel": (1.0, 0.28),
}
BRAKES = {"brake_pedal", "brake_switch"}


def clock_back(bench):
    bench.now -= 0.05
    bench.due.clear()
    bench.safety.tick(bench.now)


def pause(bench):
    bench.now += 0.15
    bench.due.clear()
    bench.safety.tick(bench.now)


ASKS = {  # who asks for the end of control, and what the core does in driving without a hazard
    "operator": (lambda b: b.safety.release(b.now, "released by service"), State.RELEASING),
    "loss": (lambda b: b.safety.fade(b.now, "loss"), State.FADING),
    "pause": (pause, State.RELEASING),
    "clock": (clock_back, State.RELEASING),
    "twin": (lambda b: b.safety.rx_hook(0x18FEF100 | b.table.address, bytes(8), b.now), State.RELEASING),
    "link": (lambda b: b.safety.link(False), State.STANDBY),
}


@pytest.mark.parametrize("ask", ASKS)
@pytest.mark.parametrize("stopping", [False, True])
def test_whoever_asks_a_braking_that_a_known_hazard_needs_goes_on(bench, ask, stopping):
    bench = bench.hard()
    if stopping:
        bench.safety.fade(bench.now, "first")
    bench.commanding = not stopping
    ASKS[ask][0](bench)
    bench.safety.link(True)
    assert bench.safety.state is State.STOPPING
    bench.left.clear()
    bench.slows(4.0)
    assert bench.safety.state is State.STOPPING
    least = HARD * abs(bench.axis("brake").holds_beyond) - 1.01 * bench.axis("brake").demand.scale
    assert min(bench.brake_demands()) >= least
    assert sum(bench.safety.losses.values()) == 1
    assert bench.safety.warning == f"Take over: braking to a standstill ({bench.safety.reason})"


@pytest.mark.parametrize("ask", ASKS)
def test_from_other_driving_each_ends_it_as_the_page_says(bench, ask):
    bench = bench.hard(0.9)
    what, state = ASKS[ask]
    what(bench)
    assert bench.safety.state is state
    bench.safety.link(True)
    bench.commanding = False
    bench.run_until(State.STANDBY, 5.0)


@pytest.mark.parametrize("ask", ASKS)
def test_a_truck_that_is_held_at_rest_is_let_go_by_a_person_alone(bench, ask):
    held = bench.standing()
    held.run_until(State.HOLDING)
    ASKS[ask][0](held)
    held.safety.link(True)
    held.run(0.2)
    assert held.safety.state is (State.RELEASING if ask == "operator" else State.HOLDING)
    assert held.safety.losses == ({"released by service": 1} if ask == "operator" else {})


def test_a_truck_that_stopped_for_a_hazard_is_let_go_by_a_person(bench):
    stopped = bench.hard()
    stopped.safety.release(stopped.now)
    stopped.slows(6.0)
    stopped.run(21.0)
    assert stopped.safety.state is State.STOPPING
    stopped.safety.release(stopped.now, "released by service")
    assert stopped.safety.state is State.RELEASING


# the driver


def press(bench, name, value, seconds):
    """Let the driver press for so long, frame by frame of its message."""
    bench.signals[name] = value
    bench.slows(seconds)


def frames_of(bench, name):
    return next(heard for heard in bench.table.heard if name in {signal.name for signal in heard.signals})


def test_the_firm_thresholds_are_stated_for_every_vehicle(bench):
    found = {act.name: (act.firm, act.held_s) for act in bench.table.override}
    assert found == FIRM
    assert {act.name for act in bench.table.override if act.brakes} == BRAKES


@pytest.mark.parametrize("name", FIRM)
@pytest.mark.parametrize("stopping", [False, True])
def test_who_means_it_takes_over_from_hard_braking_and_a_single_frame_is_none(bench, name, stopping):
    """By frames: of a switch for 0.3 s, of the accelerator two beyond its firm threshold."""
    firm, held_s = FIRM[name]
    heard = frames_of(bench, name)
    scale = next(signal.field.scale for signal in heard.signals if signal.name == name)
    for value, count in ((firm, 1), (firm - scale, 8), (firm, math.ceil(held_s / heard.period_s) + 1)):
        driven = bench.hard()
        if stopping:
            driven.safety.fade(driven.now, "first")
        before = driven.safety.state
        for n in range(count):
            assert driven.safety.state is before
            driven.signals[name] = value
            driven.hear(heard.name)
            if n < count - 1:
                driven.wait(heard.period_s + 1e-6)
        means_it = value == firm and count > 1
        if name in BRAKES:
            assert driven.safety.state is (State.STOPPING if means_it else before)
        else:
            assert driven.safety.state is (State.RELEASING if means_it else before)
        assert (driven.safety.reason == f"driver: {name}") == (means_it and not (stopping and name in BRAKES))
        if not means_it:
            driven.signals[name] = 0.0
            driven.wait(heard.period_s + 1e-6)
            assert driven.safety.state is before


def test_a_pedal_that_is_pressed_again_and_again_counts_anew(bench):
    driven = bench.hard()
    for _ in range(5):
        press(driven, "cancel", 1.0, 0.2)
        press(driven, "cancel", 0.0, 0.2)
    assert driven.safety.state is State.ENGAGED


def test_a_signal_that_is_no_more_heard_does_not_last(bench):
    driven = bench.hard()
    driven.signals["accelerator"] = 40.0
    driven.run(0.05)
    driven.silent.add("EEC2")
    driven.run(0.2)
    assert driven.safety.state is State.ENGAGED


@pytest.mark.parametrize("name", sorted(BRAKES))
def test_beneath_a_driver_who_brakes_ours_goes_on_until_the_foot_is_lifted(bench, name):
    driven = bench.hard()
    driven.left.clear()
    press(driven, name, 40.0 if name == "brake_pedal" else 1.0, 1.0)
    assert driven.safety.state is State.STOPPING
    assert driven.safety.reason == f"driver: {name}"
    demands = driven.brake_demands()
    assert min(demands) >= demands[0] - 1.01 * driven.axis("brake").demand.scale
    driven.left.clear()
    driven.signals[name] = 0.0
    driven.hear()
    assert driven.safety.state is State.RELEASING
    lifted = driven.now
    driven.run_until(State.STANDBY)
    first = next(time for time, axis, _ in driven.left if axis == "brake")
    assert first - lifted <= 0.020 + 1e-9
    assert all(math.isnan(demand) for _, _, demand in driven.left)


def test_a_touch_of_the_brake_is_no_lifted_foot(bench):
    driven = bench.hard()
    press(driven, "brake_pedal", 40.0, 0.2)
    press(driven, "brake_pedal", 0.0, 0.5)
    assert driven.safety.state is State.ENGAGED


@pytest.mark.parametrize("name", FIRM)
def test_what_other_driving_asks_for_is_let_go_at_once_though_a_hazard_needs_it(bench, name):
    """Up to the stated demand; also of a truck that goes on braking, and of one that stands."""
    act = next(act for act in bench.table.override if act.name == name)
    for share, stopping, speed in ((1.0, False, 15.0), (1.0, True, 15.0), (HARD, True, 0.0)):
        driven = bench.hard(0.5)
        driven.demands = driven.needs = {"brake": share * driven.axis("brake").holds_beyond}
        driven.run(1.0)
        if stopping:
            driven.safety.fade(driven.now, "first")
        driven.signals |= {"speed": speed, "driveline": 0.0}
        driven.run(0.2)
        assert driven.safety.state is (State.STOPPING if stopping else State.ENGAGED)
        driven.signals[name] = act.least
        driven.hear()
        assert driven.safety.state is State.RELEASING


def test_a_driver_who_acts_when_the_hazard_is_over_takes_over_then(bench):
    driven = bench.hard()
    press(driven, "accelerator", 10.0, 1.0)
    assert driven.safety.state is State.ENGAGED
    driven.needs = {}
    driven.run(0.1)
    assert driven.safety.reason == "driver: accelerator"


# for how long a hazard is assumed


def believing(bench, seconds):
    """A bench whose controller is gone, and that goes on braking for a hazard assumed for so long."""
    bench = bench.hard()
    bench.assumed_s = seconds
    bench.command()
    bench.commanding = False
    bench.safety.fade(bench.now, "first")
    return bench


def test_once_the_hazard_is_assumed_no_more_the_truck_rolls_out(bench):
    bench = believing(bench, 2.0)
    assert bench.run_until(State.FADING, 3.0) == pytest.approx(2.0, abs=2 * CYCLE)
    assert bench.safety.warning == "Take over: control was handed back (first)"
    bench.left.clear()
    bench.run_until(State.STANDBY, 5.0)
    demands, axis = bench.brake_demands(), bench.axis("brake")
    most = axis.limits.fade * axis.period_s + 1.01 * axis.demand.scale
    assert max(a - b for a, b in pairwise(demands)) <= most
    assert bench.safety.losses == {"first": 1}


def test_a_truck_that_stands_by_then_is_held(bench):
    bench = believing(bench, 6.0)
    bench.slows(5.0)
    bench.silent = {"CCVS1"}
    bench.run(20.0)
    assert bench.safety.state is State.STOPPING


def test_no_hazard_is_assumed_for_ever(bench):
    bench = believing(bench, math.inf)
    assert bench.run_until(State.FADING, 25.0) == pytest.approx(bench.table.timing.assumed, abs=2 * CYCLE)


def test_a_controller_that_is_alive_takes_a_hazard_back_and_a_refused_command_does_not(bench):
    for refused, state in ((False, State.FADING), (True, State.STOPPING)):
        stopping = bench.hard()
        stopping.safety.fade(stopping.now, "first")
        stopping.needs, stopping.demands = {}, {"engine": math.nan} if refused else {}
        stopping.run(0.1)
        assert stopping.safety.state is state
    stopping.needs = {"brake": stopping.axis("brake").holds_beyond}  # which a refused command may name
    stopping.assumed_s = 1.0
    assert stopping.run_until(State.STOPPING, 0.1) <= CYCLE
    stopping.run(1.5)
    assert stopping.safety.state is State.STOPPING


@pytest.mark.parametrize("jump", [-30.0, 30.0])
def test_a_clock_that_was_set_changes_nothing_of_what_is_assumed(bench, jump):
    bench = believing(bench, 3.0)
    bench.run(1.0)
    bench.now += jump
    bench.due.clear()
    assert bench.run_until(State.FADING, 3.0) == pytest.approx(2.0, abs=3 * CYCLE)


# a link that is broken


def test_a_broken_link_is_said_and_one_that_comes_back_in_time_finds_the_braking(bench):
    for seconds, state in ((1.9, State.STOPPING), (2.1, State.STANDBY)):
        cut = bench.hard()
        held = abs(cut.demand("brake")) if cut.left else HARD * abs(cut.axis("brake").holds_beyond)
        cut.safety.link(False)
        assert cut.safety.warning == "Take over: no brake demand reaches the truck (link lost)"
        assert not cut.safety.linked
        cut.wait(seconds)
        assert cut.safety.state is state
        cut.safety.link(True)
        cut.left.clear()
        cut.due.clear()
        cut.run(0.5)
        assert cut.safety.state is state
        demands = cut.brake_demands()
        assert (min(demands, default=0.0) >= held - 1.01 * cut.axis("brake").demand.scale) == bool(demands)
        assert bool(demands) == (state is State.STOPPING)
        stays = "braking to a standstill" if demands else "no brake demand reaches the truck"
        assert cut.safety.warning == f"Take over: {stays} (link lost)"


def test_a_clock_that_is_set_back_does_not_lengthen_an_outage(bench):
    cut = bench.hard()
    cut.safety.link(False)
    cut.wait(1.0)
    cut.now -= 50.0
    cut.due.clear()
    cut.wait(1.1)
    assert cut.safety.state is State.STANDBY


def test_a_hold_takes_the_strongest_of_each_axis():
    hold = BrakeHold({"brake": -1.5, "retarder": math.inf})
    assert not hold.knows(0.0)
    hold.know({"brake": 0.0}, 5.0)
    assert not hold.knows(0.0)
    hold.know({"brake": -1.0, "retarder": 0.0}, 5.0)
    assert hold.knows(5.0) and not hold.knows(5.1)
    hold.shift(0.2)
    assert hold.knows(5.1)
    assert not hold.is_hard({"brake": -1.5, "retarder": -100.0}, {})
    assert hold.is_hard({}, {"brake": -1.6})
    hold.begin({"brake": -0.5, "retarder": -10.0}, {"brake": -0.7, "retarder": -5.0})
    assert hold.demands == {"brake": -1.0, "retarder": -10.0}
    hold.begin({"brake": -2.0})
    assert hold.demands == {"brake": -2.0, "retarder": 0.0}
    assert hold.rise("brake", -1.0) == hold.demands["brake"] == -2.0
    assert hold.rise("brake", -3.0) == hold.rise("brake", math.nan) == -3.0
    hold.hold({"brake": -1.0, "retarder": -7.0})
    assert hold.demands == {"brake": -1.5, "retarder": -7.0}
    hold.hold({"brake": -2.0})
    assert hold.demands == {"brake": -2.0, "retarder": 0.0}
