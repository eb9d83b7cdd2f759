"""The promise: "... braking that a known hazard needs goes on", whatever was lost, and at a standstill."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest

from truck_bridge import vehicles
from truck_bridge.safety import Safety, State

HOLDS_BEYOND = {"trucksim": 29.0, "freightliner": 16.0, "volvo": -1.5}  # gives 1.5 m/s^2; restated
HARD = 1.6  # times that, a demand that only a hazard asks for
CYCLE = 0.005  # of the bench


CAUSES = {
    "controller lost": lambda b: setattr(b, "commanding", False),
    "command refused": lambda b: b.demands.update(engine=math.nan),
    "controller not engaged": lambda b: setattr(b, "engaged_bit", False),
    "EBC1 stale": lambda b: b.silent.add("EBC1"),
    "CCVS1 stale": lambda b: b.silent.add("CCVS1"),
    "truck: abs_active": lambda b: b.signals.update(abs_active=1.0),
    "implausible: two wheel speeds": lambda b: b.signals.update(second_speed=3.0),
    "another node commands the truck": lambda b: b.safety.rx_hook(
        (b.axis("engine").can_id & ~0xFF | 0x77) ^ 1 << 27, b.frame("engine", 50.0), b.now
    ),
    "fault: SPN 110": lambda b: b.safety.fade(b.now, "fault: SPN 110"),
}


def test_what_only_a_hazard_asks_for_is_stated_for_every_vehicle(bench, vehicle):
    assert bench.axis("brake").holds_beyond == HOLDS_BEYOND[vehicle]
    assert math.isinf(bench.axis("retarder").holds_beyond)


@pytest.mark.parametrize("cause", CAUSES)
def test_whatever_is_lost_the_brake_never_falls_to_a_standstill_and_there(bench, cause):
    bench = bench.hard()
    before = abs(bench.demand("brake")) if bench.left else 0.0
    CAUSES[cause](bench)
    assert bench.run_until(State.STOPPING, 1.5) < 1.1
    assert bench.safety.reason == cause
    assert bench.safety.warning == f"Take over: braking to a standstill ({cause})"
    bench.slows(6.0)
    bench.run(5.0)
    assert bench.safety.state is State.STOPPING
    demands, quantum = bench.brake_demands(), bench.axis("brake").demand.scale
    assert min(demands) >= max(before, HARD * abs(bench.axis("brake").holds_beyond)) - 1.01 * quantum
    assert all(after >= before - 1.01 * quantum for before, after in pairwise(demands))
    assert bench.demand("engine") == 0.0
    assert bench.safety.losses == {cause: 1}


@pytest.mark.parametrize("later", [False, True])
def test_what_the_hazard_needs_goes_on_however_little_it_is(bench, later):
    """Also where the controller names it only while demands fade; what it names of the engine counts not."""
    axis, engaged = bench.axis("brake"), bench.engage(engine=20.0).run(1.0)
    needs = {"brake": 0.7 * axis.holds_beyond, "engine": 50.0}
    engaged.needs = {} if later else needs
    engaged.command()
    engaged.safety.fade(engaged.now, "test")
    assert engaged.safety.state is (State.FADING if later else State.STOPPING)
    engaged.needs = needs
    engaged.run(0.1)
    engaged.commanding = False
    engaged.run(2.0)
    assert engaged.safety.state is State.STOPPING
    assert engaged.demand("brake") == pytest.approx(needs["brake"], rel=0.02)
    assert engaged.demand("engine") == 0.0


def test_a_hazard_needs_a_demand_of_the_envelope(bench):
    most = max((*bench.axis("brake").limits.low, *bench.axis("brake").limits.high), key=abs)
    beyond = math.copysign(1e-6, most)
    useless = (-0.1 * most, most + beyond, math.nan, 0.0)
    for need, state in [(most, State.STOPPING), *((need, State.FADING) for need in useless)]:
        rolling = bench.that_may_jump()
        rolling.needs = {"brake": need}
        rolling.engage(engine=20.0).run(1.0)
        rolling.safety.fade(rolling.now, "test")
        assert rolling.safety.state is state


def test_hard_braking_for_no_hazard_that_is_known_fades(bench):
    braking = bench.that_may_jump().engage(brake=HARD * bench.axis("brake").holds_beyond).run(1.0)
    braking.safety.fade(braking.now, "test")
    assert braking.safety.state is State.FADING


def test_a_brake_that_was_asked_for_and_has_not_come_yet_counts(bench):
    bench.engage(engine=20.0).run(1.0)
    bench.demands = {"brake": HARD * bench.axis("brake").holds_beyond}
    bench.needs = {"brake": 0.5 * bench.axis("brake").holds_beyond}
    bench.command()
    bench.commanding = False
    bench.left.clear()
    bench.run_until(State.STOPPING)
    bench.run(1.0)
    asked = HARD * bench.axis("brake").holds_beyond
    assert bench.demand("brake") == pytest.approx(asked, rel=0.01)


def test_a_demand_that_was_falling_falls_no_more(bench):
    bench = bench.hard(2.0)
    bench.demands = {"brake": 0.0}
    bench.run(0.06)
    falling = bench.brake_demands()
    assert falling[0] > falling[-1]
    bench.safety.fade(bench.now, "test")
    assert bench.safety.state is State.STOPPING
    bench.left.clear()
    bench.run(1.0)
    held = bench.brake_demands()
    assert held[0] - held[-1] <= 1.01 * bench.axis("brake").demand.scale


def test_a_fresh_valid_command_raises_the_brake_and_never_lowers_it(bench):
    bench = bench.hard()
    bench.safety.fade(bench.now, "test")
    beyond = bench.axis("brake").holds_beyond
    for asked, held in ((1.8, 1.8), (0.0, 1.8), (math.nan, 1.8), (2.0, 2.0), (1.0, 2.0)):
        bench.demands = {"brake": asked * beyond, "engine": 80.0}
        bench.run(0.5)
        assert bench.demand("brake") == pytest.approx(held * beyond, rel=0.01)
        assert bench.demand("engine") == 0.0
    bench.command()
    bench.safety._demands["brake"] = 2.2 * beyond
    bench.commanding = False
    bench.wait(bench.table.timing.controller_timeout + 0.01)
    bench.due.clear()
    bench.run(0.5)
    assert bench.demand("brake") == pytest.approx(2.0 * beyond, rel=0.01)


def test_rolling_out_a_controller_that_is_alive_brakes_on(bench):
    """And for a hazard to a standstill; what it demands of the engine counts no more."""
    axis = bench.axis("brake")
    gentle, quantum = 0.6 * axis.holds_beyond, axis.demand.scale
    bench.engage(brake=gentle).run(2.0)
    bench.safety.fade(bench.now, "EBC1 stale")
    bench.demands |= {"engine": 60.0}
    bench.left.clear()
    bench.run(1.5)
    assert bench.safety.state is State.FADING
    assert min(bench.brake_demands()) >= abs(gentle) - 2 * quantum
    assert bench.demand("engine") == 0.0
    bench.demands = bench.needs = {"brake": HARD * axis.holds_beyond}
    bench.run_until(State.STOPPING, 0.02)
    assert bench.safety.warning == "Take over: braking to a standstill (EBC1 stale)"
    bench.run(1.0)
    assert bench.demand("brake") == pytest.approx(HARD * axis.holds_beyond, rel=0.01)
    assert bench.safety.losses == {"EBC1 stale": 1}


def test_rolling_out_ends_after_its_longest_time_or_with_the_controller(bench):
    longest = bench.table.timing.fade_longest
    for alive in (True, False):
        rolling = bench.hard(0.6)
        rolling.safety.fade(rolling.now, "test")
        rolling.commanding = alive
        seconds = rolling.run_until(State.RELEASING)
        assert longest <= seconds < longest + 0.05 if alive else seconds < 1.0
        rolling.run_until(State.STANDBY)


def test_rolling_out_the_controller_brakes_more_within_its_limits(bench):
    rolling = bench.hard(0.3)
    rolling.safety.fade(rolling.now, "test")
    axis = rolling.axis("brake")
    sign, rate = math.copysign(1.0, axis.holds_beyond), axis.limits.rate * axis.period_s
    rolling.turn("brake")
    held = rolling.safety._motions[axis.can_id].value
    assert not rolling.send("brake", rolling.frame("brake", held + 1.5 * sign * rate))
    assert rolling.safety.refusals["rate"] == 1


def test_the_retarder_is_held_too(bench):
    bench.engage(retarder=-40.0).run(2.0)
    bench.demands = bench.needs = {"brake": HARD * bench.axis("brake").holds_beyond, "retarder": -40.0}
    bench.run(1.0)
    bench.commanding = False
    bench.run(3.0)
    assert bench.safety.state is State.STOPPING
    assert bench.demand("retarder") == pytest.approx(-40.0, abs=1.0)


def test_a_pause_goes_on_braking_and_lets_go_otherwise(bench):
    for share, state in ((HARD, State.STOPPING), (0.5, State.RELEASING)):
        paused = bench.hard(share)
        for _ in range(2):  # and no second pause ends it
            paused.now += 0.15
            paused.due.clear()
            paused.cycle()
            assert paused.safety.state is state
            paused.run(0.05)
        assert paused.safety.losses == {"stalled": 1}


def test_a_frame_that_brakes_less_or_drives_does_not_leave(bench):
    bench = bench.hard()
    bench.safety.fade(bench.now, "test")
    bench.run(0.5)
    axis, held = bench.axis("brake"), bench.demand("brake")
    sign, scale = math.copysign(1.0, held), axis.demand.scale
    too_fast = held + 3 * sign * axis.limits.rate * axis.period_s
    for demand, reason in ((held - 2 * sign * scale, "falls"), (math.nan, "falls"), (too_fast, "rate")):
        bench.turn("brake")
        assert not bench.send("brake", bench.frame("brake", demand))
        assert bench.safety.refusals.pop(reason) == 1
    bench.turn("brake")
    assert bench.send("brake", bench.frame("brake", held))
    bench.turn("engine")
    assert not bench.send("engine", bench.frame("engine", 20.0))


def test_a_truck_that_stood_for_3_s_drives_off_only_for_a_person(bench):
    bench = bench.standing()
    assert 1.9 < bench.run_until(State.HOLDING) <= 2.0 + CYCLE
    bench.demands = {"engine": 60.0}  # the leader drives off
    bench.run(10.0)
    assert bench.safety.state is State.HOLDING
    assert not bench.safety.losses
    assert bench.safety.warning == "Standing: engage to drive off, or take over"
    assert bench.demand("engine") == 0.0
    beyond = bench.axis("brake").holds_beyond
    assert bench.demand("brake") == pytest.approx(beyond, rel=0.03)
    bench.left.clear()
    assert bench.safety.engage(bench.now, True, True) == ()
    bench.run(1.0)
    demands, axis = bench.brake_demands(), bench.axis("brake")
    assert demands[0] > 0.8 * abs(beyond)  # let off without a step
    assert max(a - b for a, b in pairwise(demands)) <= axis.limits.rate * axis.period_s
    assert bench.demand("engine") > 40.0
    assert bench.safety.state is State.ENGAGED
    assert bench.safety.warning == ""


def test_moving_off_in_time_asks_nobody(bench):
    bench = bench.standing()
    bench.run(1.9)
    bench.signals["speed"] = 0.11
    bench.run(0.3)
    bench.signals["speed"] = 0.0
    bench.run(2.8)
    assert bench.safety.state is State.ENGAGED


def test_a_truck_that_may_drive_off_asks_nobody(bench, vehicle):
    table = vehicles.load(vehicle).driving_off().table
    driving = type(bench)(table, Safety(table)).standing()
    driving.run(5.0)
    assert driving.safety.state is State.ENGAGED


def test_a_held_truck_stays_held_whatever_is_lost_until_the_driver_acts(bench):
    for cause in CAUSES.values():
        held = bench.standing()
        held.run_until(State.HOLDING)
        cause(held)
        held.run(2.0)
        assert held.safety.state is State.HOLDING
    held = bench.standing()
    held.run_until(State.HOLDING)
    held.signals["accelerator"] = 30.0
    held.run_until(State.STANDBY)
    assert held.safety.reason == "driver: accelerator"


def test_a_held_truck_gets_no_weaker_brake(bench):
    held = bench.standing()
    held.run_until(State.HOLDING)
    held.run(1.0)
    held.turn("brake")
    assert not held.send("brake", held.frame("brake", 0.5 * held.demand("brake")))
    assert held.safety.refusals["falls"] == 1
