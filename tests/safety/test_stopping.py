"""The promise: "... braking for a hazard goes on to a standstill", whatever was lost."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest

from truck_bridge import vehicles
from truck_bridge.safety import Safety, State
from truck_bridge.safety.ending import BrakeHold

HOLDS_BEYOND = {"trucksim": 29.0, "freightliner": 16.0, "volvo": -1.5}  # gives 1.5 m/s^2; restated
HARD = 1.6  # times that, a demand that only a hazard asks for
BRAKES_M_S2 = 3.0
CYCLE = 0.005  # of the bench


def hard(bench, share=HARD):
    """A bench at 15 m/s, whose signals may jump, that brakes by a share of what only a hazard asks for."""
    bench = bench.that_may_jump()
    bench.signals["speed"] = 15.0
    bench.engage(engine=20.0).run(1.0)
    bench.demands = {"brake": share * bench.axis("brake").holds_beyond}
    slows(bench, 1.5)
    assert bench.safety.state is State.ENGAGED
    bench.left.clear()
    return bench


def slows(bench, seconds):
    """Let the truck brake for so long; the other signals follow its speed."""
    for _ in range(round(seconds / 0.1)):
        bench.signals["speed"] = max(bench.signals["speed"] - 0.1 * BRAKES_M_S2, 0.0)
        bench.run(0.1)


def brake_demands(bench):
    """Absolute, a release counting as none."""
    return [0.0 if math.isnan(d) else abs(d) for _, axis, d in bench.left if axis == "brake"]


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
    bench = hard(bench)
    before = abs(bench.demand("brake")) if bench.left else 0.0
    CAUSES[cause](bench)
    assert bench.run_until(State.STOPPING, 1.5) < 1.1
    assert bench.safety.reason == cause
    assert bench.safety.warning == f"Take over: braking to a standstill ({cause})"
    slows(bench, 6.0)
    bench.run(5.0)
    assert bench.safety.state is State.STOPPING
    demands, quantum = brake_demands(bench), bench.axis("brake").demand.scale
    assert min(demands) >= max(before, HARD * abs(bench.axis("brake").holds_beyond)) - 1.01 * quantum
    assert all(after >= before - 1.01 * quantum for before, after in pairwise(demands))
    assert bench.demand("engine") == 0.0
    assert bench.safety.losses == {cause: 1}


@pytest.mark.parametrize("later", [False, True])
def test_what_the_controller_asked_for_before_it_was_lost_goes_on(bench, later):
    """However little; also where it asks for it while demands fade."""
    axis, engaged = bench.axis("brake"), bench.engage(engine=20.0).run(1.0)
    asked = {"brake": 0.7 * axis.holds_beyond, "engine": 50.0}
    engaged.goes_on = {} if later else asked
    engaged.command()
    engaged.safety.fade(engaged.now, "test")
    assert engaged.safety.state is (State.FADING if later else State.STOPPING)
    engaged.goes_on = asked
    engaged.run(0.1)
    engaged.commanding = False
    engaged.run(2.0)
    assert engaged.safety.state is State.STOPPING
    assert engaged.demand("brake") == pytest.approx(asked["brake"], rel=0.02)
    assert engaged.demand("engine") == 0.0
    most = max((*axis.limits.low, *axis.limits.high), key=abs)
    fullest = bench.that_may_jump().engage(engine=20.0).run(1.0)
    fullest.goes_on = {"brake": most}
    fullest.command()
    fullest.safety.fade(fullest.now, "test")
    assert fullest.safety.state is State.STOPPING
    outside = 2.0 * abs(most)
    for useless in (-asked["brake"], math.copysign(outside, asked["brake"]), math.nan, 0.0):
        rolling = bench.that_may_jump()
        rolling.goes_on = {"brake": useless}
        rolling.engage(engine=20.0).run(1.0)
        rolling.safety.fade(rolling.now, "test")
        assert rolling.safety.state is State.FADING


@pytest.mark.parametrize(("bits", "state"), [(0, State.FADING), (1, State.STOPPING)])
def test_only_braking_beyond_the_stated_demand_goes_on(bench, bits, state):
    axis = bench.axis("brake")
    sign = math.copysign(1.0, axis.holds_beyond)
    bench.engage().run(3.0)
    bench.demands = {"brake": axis.holds_beyond + bits * sign * 1e-6}
    bench.command()
    bench.safety.fade(bench.now, "test")
    assert bench.safety.state is state


def test_a_brake_that_was_asked_for_and_has_not_come_yet_counts(bench):
    bench.engage(engine=20.0).run(1.0)
    bench.demands = {"brake": HARD * bench.axis("brake").holds_beyond}
    bench.command()
    bench.commanding = False
    bench.left.clear()
    bench.run_until(State.STOPPING)
    bench.run(1.0)
    asked = HARD * bench.axis("brake").holds_beyond
    assert bench.demand("brake") == pytest.approx(asked, rel=0.01)


def test_a_demand_that_was_falling_falls_no_more(bench):
    bench = hard(bench, 2.0)
    bench.demands = {"brake": 0.0}
    bench.run(0.06)
    falling = brake_demands(bench)
    assert falling[0] > falling[-1]
    bench.safety.fade(bench.now, "test")
    assert bench.safety.state is State.STOPPING
    bench.left.clear()
    bench.run(1.0)
    held = brake_demands(bench)
    assert held[0] - held[-1] <= 1.01 * bench.axis("brake").demand.scale


def test_a_fresh_valid_command_raises_the_brake_and_never_lowers_it(bench):
    bench = hard(bench)
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
    assert min(brake_demands(bench)) >= abs(gentle) - 2 * quantum
    assert bench.demand("engine") == 0.0
    bench.demands = {"brake": HARD * axis.holds_beyond}
    bench.run_until(State.STOPPING, 0.02)
    assert bench.safety.warning == "Take over: braking to a standstill (EBC1 stale)"
    bench.run(1.0)
    assert bench.demand("brake") == pytest.approx(HARD * axis.holds_beyond, rel=0.01)
    assert bench.safety.losses == {"EBC1 stale": 1}


def test_rolling_out_ends_after_its_longest_time_or_with_the_controller(bench):
    longest = bench.table.timing.fade_longest
    for alive in (True, False):
        rolling = hard(bench, 0.6)
        rolling.safety.fade(rolling.now, "test")
        rolling.commanding = alive
        seconds = rolling.run_until(State.RELEASING)
        assert longest <= seconds < longest + 0.05 if alive else seconds < 1.0
        rolling.run_until(State.STANDBY)


def test_rolling_out_the_controller_brakes_more_within_its_limits(bench):
    rolling = hard(bench, 0.3)
    rolling.safety.fade(rolling.now, "test")
    axis = rolling.axis("brake")
    sign, rate = math.copysign(1.0, axis.holds_beyond), axis.limits.rate * axis.period_s
    rolling.turn("brake")
    held = rolling.safety._motions[axis.can_id].value
    assert not rolling.send("brake", rolling.frame("brake", held + 1.5 * sign * rate))
    assert rolling.safety.refusals["rate"] == 1


def test_the_retarder_is_held_too(bench):
    bench.engage(retarder=-40.0).run(2.0)
    bench.demands = {"brake": HARD * bench.axis("brake").holds_beyond, "retarder": -40.0}
    bench.run(1.0)
    bench.commanding = False
    bench.run(3.0)
    assert bench.safety.state is State.STOPPING
    assert bench.demand("retarder") == pytest.approx(-40.0, abs=1.0)


def test_only_the_driver_or_a_person_ends_it_and_at_once(bench):
    for name, threshold in (*bench.table.override, ("", 0.0)):
        stopping = hard(bench)
        stopping.safety.fade(stopping.now, "test")
        stopping.run(3.0)
        assert f"not in standby but {State.STOPPING.value}" in stopping.safety.engage(
            stopping.now, True, True
        )
        stopping.left.clear()
        if name:
            stopping.signals[name] = threshold
            stopping.hear()
        else:
            stopping.safety.release(stopping.now, "released by service")
        assert stopping.safety.state is State.RELEASING
        acted = stopping.now
        stopping.run_until(State.STANDBY)
        first = next(time for time, axis, _ in stopping.left if axis == "brake")
        assert first - acted <= 0.020 + 1e-9
        assert all(math.isnan(demand) for _, _, demand in stopping.left)
        assert stopping.safety.reason == (f"driver: {name}" if name else "released by service")


def test_without_a_link_or_with_a_twin_it_ends_as_ever(bench):
    stopping = hard(bench)
    stopping.safety.fade(stopping.now, "test")
    stopping.safety.link(False)
    assert stopping.safety.state is State.STANDBY
    stopping = hard(bench)
    stopping.safety.fade(stopping.now, "test")
    stopping.safety.rx_hook(0x18FEF100 | stopping.table.address, bytes(8), stopping.now)
    assert stopping.safety.state is State.RELEASING


def test_a_pause_goes_on_braking_and_lets_go_otherwise(bench):
    for share, state in ((HARD, State.STOPPING), (0.5, State.RELEASING)):
        paused = hard(bench, share)
        for _ in range(2):  # and no second pause ends it
            paused.now += 0.15
            paused.due.clear()
            paused.cycle()
            assert paused.safety.state is state
            paused.run(0.05)
        assert paused.safety.losses == {"stalled": 1}


def test_without_a_speed_it_rolls_out_in_the_end(bench):
    bench = hard(bench)
    bench.silent = {"CCVS1"}
    bench.run_until(State.STOPPING)
    blind = bench.table.timing.blind
    assert blind - 0.4 < bench.run_until(State.FADING, 25.0) <= blind + CYCLE
    bench.run_until(State.STANDBY, 5.0)
    stands = hard(bench)
    stands.safety.fade(stands.now, "test")
    stands.run(blind + 1.0)
    assert stands.safety.state is State.STOPPING


def test_a_frame_that_brakes_less_or_drives_does_not_leave(bench):
    bench = hard(bench)
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


def standing(bench):
    """A bench that stands behind a standing leader, engaged, with a little brake."""
    bench = bench.that_may_jump()
    bench.signals |= {"speed": 0.0, "driveline": 0.0}
    bench.engage(brake=0.3 * bench.axis("brake").holds_beyond)
    bench.run(1.0)
    return bench


def test_a_truck_that_stood_for_3_s_drives_off_only_for_a_person(bench):
    bench = standing(bench)
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
    demands, axis = brake_demands(bench), bench.axis("brake")
    assert demands[0] > 0.8 * abs(beyond)  # let off without a step
    assert max(a - b for a, b in pairwise(demands)) <= axis.limits.rate * axis.period_s
    assert bench.demand("engine") > 40.0
    assert bench.safety.state is State.ENGAGED
    assert bench.safety.warning == ""


def test_moving_off_in_time_asks_nobody(bench):
    bench = standing(bench)
    bench.run(1.9)
    bench.signals["speed"] = 0.11
    bench.run(0.3)
    bench.signals["speed"] = 0.0
    bench.run(2.8)
    assert bench.safety.state is State.ENGAGED


def test_a_truck_that_may_drive_off_asks_nobody(bench, vehicle):
    table = vehicles.load(vehicle).driving_off().table
    driving = standing(type(bench)(table, Safety(table)))
    driving.run(5.0)
    assert driving.safety.state is State.ENGAGED


def test_a_held_truck_stays_held_whatever_is_lost_until_the_driver_acts(bench):
    for cause in CAUSES.values():
        held = standing(bench)
        held.run_until(State.HOLDING)
        cause(held)
        held.run(2.0)
        assert held.safety.state is State.HOLDING
    held = standing(bench)
    held.run_until(State.HOLDING)
    held.signals["accelerator"] = 30.0
    held.run_until(State.STANDBY)
    assert held.safety.reason == "driver: accelerator"


def test_a_held_truck_gets_no_weaker_brake(bench):
    held = standing(bench)
    held.run_until(State.HOLDING)
    held.run(1.0)
    held.turn("brake")
    assert not held.send("brake", held.frame("brake", 0.5 * held.demand("brake")))
    assert held.safety.refusals["falls"] == 1


def test_a_hold_takes_the_strongest_of_each_axis():
    hold = BrakeHold({"brake": -1.5, "retarder": math.inf})
    assert not hold.begin({"brake": -1.5, "retarder": -100.0}, {})
    assert hold.begin({"brake": -1.0, "retarder": -10.0}, {"brake": -2.0, "retarder": -5.0})
    assert hold.demands == {"brake": -2.0, "retarder": -10.0}
    assert hold.rise("brake", -1.0) == hold.demands["brake"] == -2.0
    assert hold.rise("brake", -3.0) == hold.rise("brake", math.nan) == -3.0
    assert hold.begin({"brake": -0.5}, asked={"brake": -0.7, "retarder": 0.0})
    assert hold.demands == {"brake": -0.7, "retarder": 0.0}
    assert not hold.begin({"brake": -0.5}, asked={"brake": 0.0})
    hold.hold({"brake": -1.0, "retarder": -7.0})
    assert hold.demands == {"brake": -1.5, "retarder": -7.0}
    hold.hold({"brake": -2.0})
    assert hold.demands == {"brake": -2.0, "retarder": 0.0}
