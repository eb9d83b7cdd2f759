"""What holds around the promise: silent, armed, engaged and back; a fade that cannot arrive; rest."""

from __future__ import annotations

import math
from dataclasses import replace

from truck_bridge.safety import State


def test_disarming_is_silent_at_once(bench):
    bench.engage().run(0.5)
    bench.safety.disarm()
    assert bench.safety.state is State.SILENT
    assert bench.safety.losses == {"disarmed": 1}
    assert bench.safety.warning == ""
    bench.left.clear()
    bench.run(0.5)
    assert bench.left == []
    bench.safety.disarm()
    assert bench.safety.losses == {"disarmed": 1}


def test_arming_twice_changes_nothing_and_arming_anew_forgets(bench):
    bench.engage().run(0.5)
    bench.safety.arm(bench.now)
    assert bench.safety.state is State.ENGAGED
    bench.safety.disarm()
    bench.safety.arm(bench.now)
    assert bench.safety.state is State.STANDBY
    assert "CCVS1 not fresh" in bench.safety.obstacles(bench.now, True)


def test_releasing_or_fading_without_control_does_nothing(bench):
    bench.arm()
    bench.safety.release(bench.now)
    bench.safety.fade(bench.now, "x")
    assert bench.safety.state is State.STANDBY
    assert bench.safety.losses == {}
    bench.signals["brake_pedal"] = 40.0
    bench.hear()
    assert bench.safety.losses == {}


def test_a_fade_that_does_not_arrive_is_released(bench):
    bench.engage(engine=60.0).run(1.0)
    bench.safety.fade(bench.now, "test")
    start = bench.now
    while bench.safety.state is State.FADING:
        bench.now += 0.02
        bench.safety.tick(bench.now)
        assert bench.now - start < 5.0
    assert 4.0 < bench.now - start < 4.05
    assert bench.safety.state is State.RELEASING


def test_silent_hears_nothing(bench):
    bench.hear()
    bench.now += 0.01
    assert "CCVS1 not fresh" in bench.safety.obstacles(bench.now, True)


def test_an_impostor_before_our_first_frame_is_named_at_once_and_forbids_control_for_a_second(bench):
    twin = "another node uses our address"
    bench.arm()
    bench.safety.rx_hook(bench.axis("engine").can_id, bytes(8), bench.now)
    assert (bench.safety.losses, bench.safety.refusals) == ({}, {twin: 1})
    assert bench.safety.warning == f"Do not engage: {twin}"
    assert bench.safety.engage(bench.now, True, True) == (twin,)
    heard_at = bench.now
    bench.wait(0.995)
    assert bench.safety.engage(heard_at + 1.0, True, True) == (twin,)
    assert bench.safety.engage(heard_at + 1.005, True, True) == ()
    assert bench.safety.warning == ""
    bench.safety.rx_hook(bench.axis("engine").can_id, bytes(8), bench.now)
    assert bench.safety.losses == {twin: 1}
    assert bench.safety.warning == f"Take over: control was handed back ({twin})"
    bench.safety.rx_hook(bench.axis("engine").can_id, bytes(8), bench.now)
    assert bench.safety.warning == f"Take over: control was handed back ({twin})"  # releasing


def test_a_new_core_has_nothing_to_say(bench):
    assert (bench.safety.reason, bench.safety.warning) == ("", "")
    assert not bench.safety.controls_allowed


def test_a_command_is_sane_within_the_widest_of_the_envelope(bench):
    axis = bench.axis("engine")
    limits = replace(axis.limits, low=(-40.0, -20.0, 0.0), high=(30.0, 60.0, 50.0), speed=(0.0, 20.0, 40.0))
    table = replace(bench.table, axes=(replace(axis, limits=limits),))
    for demand, sane in ((-40.0, True), (-40.5, False), (60.0, True), (60.5, False)):
        safety = type(bench.safety)(table)
        assert safety.command({"engine": demand}, False, bench.now) == sane


def test_less_than_half_a_bit_is_rest(bench):
    bench.engage().run(3.0)
    axis = bench.axis("brake")
    side = 1 if max(axis.limits.high) > 0 else -1
    for bits, idle in ((0.44, True), (0.56, False)):
        bench.demands = {"brake": side * bits * axis.demand.scale}
        bench.run(0.5)
        assert math.isnan(bench.safety.plan(axis, bench.now)) == idle
