"""The promise: "... or anything control depends on is lost, control is ... faded without a step"."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest

from truck_bridge.safety import State

AXES = ("engine", "retarder", "brake")


def strongest(bench, name):
    """The demand of an axis that is furthest from rest, at the bench's speed of 15 m/s."""
    limits = bench.axis(name).limits
    return min(limits.low) if max(limits.high) == 0 else max(limits.high)


def falls(bench, name, since):
    """Demands of an axis on the wire since a time, absolute, a release counting as rest."""
    rest = bench.axis(name).rest
    return [
        0.0 if math.isnan(d) else abs(d - rest) for t, axis, d in bench.left if axis == name and t >= since
    ]


def fades_without_a_step(bench, cause):
    """Let the cause happen while demands are high; return the seconds until the fade began."""
    name = "brake" if cause == "brake" else "engine"
    start = bench.now
    bench.left.clear()
    seconds = bench.run_until(State.FADING, within=1.5)
    bench.run_until(State.RELEASING)
    demands = falls(bench, name, start)
    axis = bench.axis(name)
    largest = axis.limits.fade * axis.period_s + 1.01 * axis.demand.scale
    falling = [a - b for a, b in pairwise(demands)]
    assert max(falling) <= largest
    assert min(demands) <= axis.demand.scale
    assert bench.safety.warning
    bench.run_until(State.STANDBY)
    return seconds


def test_losing_the_controller_fades_within_200_ms(bench):
    bench.engage(engine=60.0).run(1.0)
    bench.commanding = False
    assert 0.14 < fades_without_a_step(bench, "engine") < 0.2
    assert bench.safety.losses == {"controller lost": 1}


def test_losing_the_controller_while_braking_fades_the_brake(bench):
    bench.engage(brake=bench.axis("brake").holds_beyond / 2).run(2.0)
    bench.commanding = False
    fades_without_a_step(bench, "brake")


def test_a_controller_that_does_not_know_it_is_engaged_is_lost(bench):
    bench.engage(engine=60.0)
    bench.engaged_bit = False
    assert 0.14 < fades_without_a_step(bench, "engine") < 0.2
    assert bench.safety.losses == {"controller not engaged": 1}


@pytest.mark.parametrize("number", range(11))
def test_losing_any_message_fades(bench, number):
    if number >= len(bench.table.heard):
        return
    heard = bench.table.heard[number]
    bench.engage(engine=60.0).run(1.0)
    bench.silent = {heard.name}
    seconds = fades_without_a_step(bench, "engine")
    assert heard.timeout_s - heard.period_s - 0.011 <= seconds <= heard.timeout_s + 0.021
    assert bench.safety.losses == {f"{heard.name} stale": 1}


def test_a_command_that_is_no_number_fades_and_is_counted(bench):
    bench.engage(engine=60.0).run(1.0)
    bench.demands = {"engine": math.nan}
    fades_without_a_step(bench, "engine")
    assert bench.safety.losses == {"command refused": 1}
    assert bench.safety.refusals["command not a number"] > 0


def test_a_missing_command_fades(bench):
    bench.engage(engine=60.0).run(1.0)
    assert not bench.safety.command({"engine": 10.0}, True, bench.now)
    assert bench.safety.state is State.FADING


@pytest.mark.parametrize("name", AXES)
def test_a_command_outside_the_envelope_fades_and_is_counted(bench, name):
    limits = bench.axis(name).limits
    for edge, beyond in ((min(limits.low), -1e-6), (max(limits.high), 1e-6)):
        later = type(bench)(bench.table, type(bench.safety)(bench.table))
        later.engage().run(0.3)
        later.demands = {name: edge}
        assert later.command()
        later.demands = {name: edge + beyond}
        assert not later.command()
        assert later.safety.state is State.FADING
        assert later.safety.refusals == {"command outside envelope": 1}


def test_every_forbidding_signal_fades(bench):
    for name, value in bench.table.forbidden:
        later = type(bench)(bench.table, type(bench.safety)(bench.table))
        later.engage(engine=60.0).run(1.0)
        later.signals[name] = value
        fades_without_a_step(later, "engine")
        assert later.safety.losses == {f"truck: {name}": 1}


def test_two_wheel_speeds_that_differ_fade_after_half_a_second(bench):
    bench.engage(engine=60.0).run(1.0)
    bench.signals["second_speed"] = 12.9
    assert 0.4 < fades_without_a_step(bench, "engine") < 0.7
    assert bench.safety.losses == {"implausible: two wheel speeds": 1}


def test_wheel_and_engine_speed_that_differ_fade_after_half_a_second(bench):
    bench.signals["lockup"] = 1.0
    bench.engage(engine=60.0).run(1.0)
    bench.signals["engine_speed"] = bench.value("engine_speed") * 1.3
    assert 0.4 < fades_without_a_step(bench, "engine") < 0.7
    assert bench.safety.losses == {"implausible: wheel and engine speed": 1}


def test_a_second_sender_of_a_message_fades(bench):
    bench.engage(engine=60.0).run(1.5)
    bench.left.clear()
    heard = bench.table.heard[0]

    def spoof():
        bench.safety.rx_hook(heard.key | 3 << 26, bench.said(heard), bench.now)
        return bench.safety.state is not State.ENGAGED

    bench.run(1.2, spoof)
    assert bench.safety.losses == {f"{heard.name} too often": 1}
    assert bench.safety.state is State.FADING


def heard(bench, name):
    return next(one for one in bench.table.heard if name in {signal.name for signal in one.signals})


@pytest.mark.parametrize("name", ["speed", "second_speed", "engine_speed", "gear_ratio", "driveline"])
def test_a_second_sender_of_a_signal_refuses_engagement_and_ends_control(bench, name):
    """By another of the truck's own addresses, before and after engaging."""
    message, what = heard(bench, name), f"{name} from a second sender (0x21)"
    frame = (message.key & ~0xFF | 0x21 | 3 << 26), bench.said(message)
    bench.arm()
    bench.safety.rx_hook(*frame, bench.now)
    assert what in bench.safety.engage(bench.now, True, True)
    later = type(bench)(bench.table, type(bench.safety)(bench.table)).engage(engine=60.0).run(1.0)
    later.safety.rx_hook(*frame, later.now)
    assert later.safety.state is State.FADING
    assert what in later.safety.refusals


def test_both_wheel_speeds_that_fall_to_zero_fade(bench):
    bench.signals["lockup"] = 1.0
    bench.engage(engine=60.0).run(1.0)
    bench.signals |= {"speed": 0.0, "engine_speed": bench.value("engine_speed")}
    assert fades_without_a_step(bench, "engine") < 0.35
    assert bench.safety.refusals["speed jumps"] > 0


def test_an_engine_speed_that_stands_still_fades(bench):
    bench.engage(engine=60.0).run(1.0)
    bench.frozen.add("engine_speed")
    assert 0.5 < fades_without_a_step(bench, "engine") < 0.65
    assert bench.safety.losses == {"EEC1 stale": 1}


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("engine_obeys", 3, "engine_obeys is 3"),
        ("engine_mode", 6, "engine_mode is 6"),
        ("retarder_obeys", 3, "retarder_obeys is 3"),
        ("engine_percent", 91, "engine_percent beyond our demand"),
        ("retarder_percent", -31, "retarder_percent beyond our demand"),
    ],
)
def test_what_our_demand_does_not_explain_fades_after_a_second(bench, name, value, said):
    bench.engage(engine=60.0).run(2.5)
    bench.signals[name] = value
    assert 0.95 < fades_without_a_step(bench, "engine") < 1.15
    assert bench.safety.losses == {f"implausible: {said}": 1}


def test_during_a_gear_change_others_may_be_obeyed(bench):
    bench.engage(engine=60.0).run(2.5)
    bench.signals |= {"shifting": 1.0, "engine_obeys": 3.0}
    assert bench.run(3.9).safety.state is State.ENGAGED
    bench.run(0.2)
    assert bench.safety.losses == {"implausible: engine_obeys is 3": 1}


def test_a_stranger_that_commands_the_truck_fades(bench):
    bench.engage(engine=60.0).run(1.0)
    axis = bench.axis("engine")
    bench.safety.rx_hook((axis.can_id & ~0xFF | 0x77) ^ 1 << 27, bench.frame("engine", 50.0), bench.now)
    assert bench.safety.losses == {"another node commands the truck": 1}
    assert bench.safety.state is State.FADING


def test_another_node_with_our_address_releases_and_an_echo_does_not(bench):
    bench.engage(engine=60.0).run(1.0)
    axis = bench.axis("engine")
    echo = bench.safety._motions[axis.can_id].data
    bench.safety.rx_hook(axis.can_id, echo, bench.now)
    bench.safety.rx_hook(bench.table.always[0], bytes(8), bench.now)
    assert bench.safety.state is State.ENGAGED
    bench.safety.rx_hook(axis.can_id, bench.frame("engine", 5.0), bench.now)
    assert bench.safety.state is State.RELEASING
    other = type(bench)(bench.table, type(bench.safety)(bench.table)).engage()
    other.safety.rx_hook(0x18FEF100 | bench.table.address, bytes(8), other.now)
    assert other.safety.losses == {"another node uses our address": 1}


def test_a_lost_link_ends_control_at_once_and_its_return_changes_nothing(bench):
    bench.engage(engine=60.0).run(1.0)
    bench.safety.link(False)
    assert bench.safety.state is State.STANDBY
    assert not bench.safety.linked
    bench.safety.link(True)
    bench.run(1.0)
    assert bench.safety.state is State.STANDBY
    assert bench.safety.losses == {"link lost": 1}
    bench.safety.link(False)
    assert bench.safety.losses == {"link lost": 1}


def test_a_link_lost_in_a_release_ends_the_release(bench):
    bench.engage().run(0.5)
    bench.safety.release(bench.now)
    bench.safety.link(False)
    bench.safety.tick(bench.now)
    assert bench.safety.state is State.STANDBY


@pytest.mark.parametrize(("pause", "state"), [(0.099, State.ENGAGED), (0.101, State.RELEASING)])
def test_a_pause_longer_than_the_truck_waits_releases(bench, pause, state):
    bench.engage(engine=60.0).run(0.5)
    bench.now += pause
    bench.command()
    bench.hear()
    bench.safety.tick(bench.now)
    assert bench.safety.state is state


def test_a_clock_that_goes_back_releases_and_forgets(bench):
    bench.engage(engine=60.0).run(1.0)
    bench.now -= 50.0
    bench.left.clear()
    bench.due.clear()
    bench.safety.tick(bench.now)
    assert bench.safety.losses == {"clock went back": 1}
    assert "CCVS1 not fresh" in bench.safety.obstacles(bench.now, True)
    assert "no fresh command" in bench.safety.obstacles(bench.now, True)
    bench.run_until(State.STANDBY, within=0.3)
    assert bench.left


def test_no_demand_leaves_a_core_that_nobody_ticks(bench):
    bench.engage().run(0.5)
    bench.now += 0.101
    assert not bench.send("engine", bench.frame("engine", 20.0))
    bench.now -= 0.2
    assert not bench.send("engine", bench.frame("engine", 20.0))
    assert bench.safety.refusals == {"not watched": 2}
