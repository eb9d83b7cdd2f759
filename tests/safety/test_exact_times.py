"""Time limits at exactly their value, with times a computer holds exactly (64ths of a second)."""

from __future__ import annotations

from dataclasses import replace

import pytest

from truck_bridge.safety import Safety, State, Timing

TIMING = Timing(controller_timeout=0.125, stall=0.125, handover=2.0, fade_longest=1.0, persist=0.5)
TICK = 1 / 64


@pytest.fixture
def vehicle():
    return "trucksim"


@pytest.fixture
def timed(bench):
    bench.table = replace(bench.table, timing=TIMING)
    bench.safety = Safety(bench.table)
    bench.now = 64.0
    return bench


def engaged(bench):
    bench.safety.arm(bench.now)
    bench.hear()
    bench.safety.tick(bench.now)
    bench.command()
    assert bench.safety.engage(bench.now, True, True) == ()
    return bench


def pass_time(bench, seconds, commanding=True):
    for _ in range(round(seconds * 64)):
        bench.now += TICK
        if round(bench.now * 64) % 4 == 0:
            bench.hear()
        if commanding:
            bench.command()
        bench.safety.tick(bench.now)


@pytest.mark.parametrize(("more", "granted"), [(0.0, True), (TICK, False)])
def test_a_command_is_fresh_up_to_its_time_out(timed, more, granted):
    timed.safety.arm(timed.now)
    timed.command()
    timed.now += 0.125 + more
    timed.hear()
    timed.safety.tick(timed.now)
    assert (timed.safety.engage(timed.now, True, True) == ()) == granted


@pytest.mark.parametrize(("more", "state"), [(0.0, State.ENGAGED), (TICK, State.FADING)])
def test_the_controller_is_lost_after_its_time_out(timed, more, state):
    engaged(timed)
    pass_time(timed, 0.125 + more, commanding=False)
    assert timed.safety.state is state


@pytest.mark.parametrize(("more", "state"), [(0.0, State.ENGAGED), (TICK, State.RELEASING)])
def test_a_stall_is_longer_than_its_limit(timed, more, state):
    engaged(timed)
    timed.now += 0.125 + more
    timed.hear()
    timed.command()
    timed.safety.tick(timed.now)
    assert timed.safety.state is state


def test_no_time_at_all_is_no_stall_and_no_clock_gone_back(timed):
    engaged(timed)
    timed.safety.tick(timed.now)
    assert timed.safety.state is State.ENGAGED


@pytest.mark.parametrize(("more", "state"), [(0.0, State.ENGAGED), (TICK, State.FADING)])
def test_a_controller_has_its_time_out_to_learn_that_it_is_engaged(timed, more, state):
    engaged(timed)
    timed.engaged_bit = False
    timed.now += 0.125 + more
    timed.command()
    assert timed.safety.state is state


@pytest.mark.parametrize(("more", "state"), [(0.0, State.FADING), (TICK, State.RELEASING)])
def test_a_fade_has_its_longest_time(timed, more, state):
    timed.signals["engine_percent"] = 50.0
    engaged(timed)
    timed.safety.fade(timed.now, "test")
    pass_time(timed, 1.0 + more)
    assert timed.safety.state is state


@pytest.mark.parametrize(("at", "share"), [(2.0 - TICK, 0.5), (2.0, 1.0)])
def test_handing_over_ends_at_its_time(timed, at, share):
    engaged(timed)
    axis = timed.axis("engine")
    assert timed.safety._rate(axis, timed.now + at) == share * axis.limits.rate


@pytest.mark.parametrize(("more", "asked"), [(0.0, True), (TICK, False)])
def test_a_core_is_watched_up_to_the_stall_limit(timed, more, asked):
    engaged(timed)
    timed.now += 0.125 + more
    assert timed.send("retarder", timed.frame("retarder", float("nan"))) == asked


@pytest.mark.parametrize(("more", "state"), [(-TICK, State.ENGAGED), (0.0, State.FADING)])
def test_doubt_lasts_its_time(timed, more, state):
    timed = timed.that_may_jump()
    engaged(timed)
    timed.signals["second_speed"] = 18.0
    timed.hear("EBC2")
    timed.safety.tick(timed.now)
    pass_time(timed, 0.5 + more)
    assert timed.safety.state is state
