"""The promise of the core, clause by clause, for every vehicle."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import pytest

from truck_bridge.safety import State

AXES = ("engine", "retarder", "brake")
FULL = {"engine": 60.0, "retarder": 0.0}


def strongest(bench, name):
    """The demand of an axis that is furthest from rest, at the bench's speed of 15 m/s."""
    limits = bench.axis(name).limits
    return min(limits.low) if max(limits.high) == 0 else max(limits.high)


# "No frame leaves unless it is on the vehicle's list ..."


@pytest.mark.parametrize("state", list(State))
def test_a_frame_that_is_not_on_the_list_never_leaves(bench, state):
    bench.engage()
    bench.safety.state = state
    listed = {axis.can_id for axis in bench.table.axes} | set(bench.table.always)
    for can_id in (0x0CF00400, 0x18FEF100, 0x0C000003, bench.axis("engine").can_id ^ 1 << 26, 0, 0x1FFFFFFF):
        assert can_id not in listed
        assert not bench.safety.tx_hook(can_id, bytes(8), bench.now + 0.02)


def test_nothing_leaves_before_arming_not_even_an_address_claim(bench):
    for can_id in (*bench.table.always, bench.axis("engine").can_id):
        assert not bench.safety.tx_hook(can_id, bench.frame("engine", math.nan), bench.now)
    assert bench.safety.refusals["silent"] == 3


def test_armed_only_the_claim_leaves(bench):
    bench.arm()
    assert all(bench.safety.tx_hook(can_id, bytes(8), bench.now) for can_id in bench.table.always)
    for name in AXES:
        assert bench.safety.plan(bench.axis(name), bench.now) is None
        for demand in (0.0, math.nan):
            assert not bench.send(name, bench.frame(name, demand))
    assert bench.safety.refusals["controls not allowed"] == 6


def test_the_claim_leaves_without_a_link_and_demands_do_not(bench):
    bench.engage()
    bench.safety.link(False)
    assert bench.safety.tx_hook(bench.table.always[0], bytes(8), bench.now)
    bench.now += 0.02
    assert not bench.send("engine", bench.frame("engine", 0.0))
    assert bench.safety.refusals["no link"] == 1


# "... well formed ..."


@pytest.mark.parametrize("name", AXES)
def test_every_bit_of_a_commanding_frame_is_fixed_except_the_demand(bench, name):
    axis = bench.engage(engine=20.0).axis(name)
    bench.run(0.2)
    bench.turn(name)
    demand = bench.axis(name).rest
    start = bench.demand("engine") if name == "engine" else demand
    good = bench.frame(name, start)
    payload = int.from_bytes(good[:7], "little")
    for bit in range(56):
        if axis.demand.start <= bit < axis.demand.start + axis.demand.bits:
            continue
        word = (payload ^ 1 << bit).to_bytes(7, "little")
        count = good[7] & 0xF
        data = word + bytes([signed(axis, word, count)])
        assert not bench.send(name, data), bit
    assert set(bench.safety.refusals) == {"form"}
    assert bench.send(name, good)


def signed(axis, payload, counter):
    """Byte 8 as the maker wants it; restated in conftest.nibbles."""
    if axis.check == "none":
        return 0xFF
    total = sum(payload) + counter + sum(axis.can_id.to_bytes(4, "little"))
    if axis.check == "tsc1":
        return counter | ((((total >> 6) & 3) + (total >> 3) + total) & 7) << 4
    return counter | (((total >> 4) + total) & 15) << 4


@pytest.mark.parametrize("size", [0, 1, 7, 9, 64])
def test_eight_bytes_or_nothing(bench, size):
    bench.engage()
    data = (bench.frame("engine", 0.0) + bytes(64))[:size]
    assert not bench.send("engine", data)
    assert bench.safety.refusals["length"] == 1


@pytest.mark.parametrize("name", AXES)
def test_byte_8_has_one_right_value(bench, name):
    bench.signals["engine_percent"] = 0.0
    bench.engage()
    axis, good = bench.axis(name), bench.frame(name, math.nan)
    for wrong in set(range(256)) - {good[7]}:
        valid_later = (
            axis.check != "none" and signed(axis, good[:7], wrong & 0xF) == wrong and bench.counters == {}
        )
        in_range = wrong & 0xF < {"none": 0, "tsc1": 8, "xbr": 16}[axis.check]
        if not (valid_later and in_range):  # before the first frame any counter may start
            assert not bench.send(name, good[:7] + bytes([wrong])), wrong
    assert set(bench.safety.refusals) <= {"checksum", "counter"}
    assert bench.send(name, good)


@pytest.mark.parametrize("name", AXES)
def test_the_counter_goes_on_by_one_and_rolls_over(bench, name):
    bench.signals["engine_percent"] = 0.0
    bench.engage()
    axis = bench.axis(name)
    modulo = {"none": 1, "tsc1": 8, "xbr": 16}[axis.check]
    for step in range(2 * modulo + 1):
        if modulo > 1 and step:
            for jump in range(modulo):
                if jump != step % modulo:
                    assert not bench.send(name, bench.frame(name, math.nan, counter=jump))
        assert bench.send(name, bench.frame(name, math.nan))
        bench.turn(name)


@pytest.mark.parametrize("name", AXES)
def test_two_frames_are_at_least_half_a_period_apart(bench, name):
    bench.signals["engine_percent"] = 0.0
    bench.engage()
    half = bench.axis(name).period_s / 2
    assert bench.send(name, bench.frame(name, math.nan))
    start = bench.now
    bench.now = start + half - 1e-6
    assert not bench.send(name, bench.frame(name, math.nan))
    assert bench.safety.refusals["too early"] == 1
    bench.now = start + half + 1e-6
    assert bench.send(name, bench.frame(name, math.nan))


def test_a_demand_that_is_error_or_not_available_is_no_demand(bench):
    bench.engage()
    field = bench.axis("engine").demand
    for raw in (field.last + 1, 0xFE, 0xFF):
        assert not bench.send("engine", bench.raw_frame("engine", raw))
    assert bench.safety.refusals["form"] == 3


# "... and a person has engaged control on fresh, plausible signals."


def test_engagement_needs_a_person(bench):
    bench.arm()
    (why,) = bench.safety.engage(bench.now, person=False, lead_vehicle=True)
    assert "person" in why
    assert bench.safety.state is State.STANDBY
    assert bench.safety.refusals["engagement"] == 1


def test_engagement_needs_a_vehicle_ahead(bench):
    bench.arm()
    assert bench.safety.engage(bench.now, person=True, lead_vehicle=False) == ("no vehicle ahead",)


def test_engagement_needs_standby(bench):
    assert "not in standby but silent" in bench.safety.engage(bench.now, True, True)
    bench.engage()
    assert "not in standby but engaged" in bench.safety.engage(bench.now, True, True)


def test_engagement_needs_a_link(bench):
    bench.arm()
    bench.safety.link(False)
    assert bench.safety.engage(bench.now, True, True) == ("no bus or no address",)
    bench.safety.link(True)
    assert bench.safety.engage(bench.now, True, True) == ()


@pytest.mark.parametrize(("age", "granted"), [(0.149, True), (0.151, False)])
def test_engagement_needs_a_fresh_command(bench, age, granted):
    bench.arm()
    bench.now += age
    bench.hear()
    bench.safety.tick(bench.now)
    assert bench.safety.engage(bench.now, True, True) == (() if granted else ("no fresh command",))


def test_engagement_needs_a_sane_command(bench):
    bench.arm()
    assert not bench.safety.command({"engine": math.nan}, False, bench.now)
    assert bench.safety.engage(bench.now, True, True) == ("no fresh command",)


def test_engagement_needs_every_message(bench):
    bench.arm()
    for heard in bench.table.heard:
        later = type(bench)(bench.table, type(bench.safety)(bench.table))
        later.silent = {heard.name}
        later.arm()
        assert f"{heard.name} not fresh" in later.safety.engage(later.now, True, True)


def test_engagement_is_refused_while_the_driver_acts_or_the_truck_forbids(bench):
    for kind, pairs in (("driver", bench.table.override), ("truck", bench.table.forbidden)):
        for name, level in pairs:
            later = type(bench)(bench.table, type(bench.safety)(bench.table))
            later.signals[name] = level
            later.arm()
            assert f"{kind}: {name}" in later.safety.engage(later.now, True, True)


@pytest.mark.parametrize(("speed", "granted"), [(0.0, True), (None, True), (1.01, False)])
def test_engagement_has_a_speed_range(bench, speed, granted):
    top = bench.table.engage_speed[1]
    bench.signals["speed"] = top * (1.0 if speed is None else speed)
    bench.signals["driveline"] = 0.0
    bench.arm()
    why = bench.safety.engage(bench.now, True, True)
    assert why == (() if granted else (f"speed outside 0..{top:g} m/s",))


def test_engagement_is_refused_on_implausible_signals(bench):
    bench.signals["second_speed"] = 15.0 + 2.1
    bench.arm()
    assert bench.safety.engage(bench.now, True, True) == ("implausible: two wheel speeds",)


# "When the driver acts ... control is handed back within one cycle ..."


def test_the_driver_takes_over_within_one_cycle_by_every_signal(bench):
    for name, threshold in bench.table.override:
        driven = type(bench)(bench.table, type(bench.safety)(bench.table))
        driven.engage(engine=50.0).run(1.0)
        heard = next(h for h in driven.table.heard if any(s.name == name for s in h.signals))
        scale = next(s.field.scale for s in heard.signals if s.name == name)
        driven.signals[name] = threshold - scale
        driven.hear(heard.name)
        assert driven.safety.state is State.ENGAGED
        driven.signals[name] = threshold
        driven.hear(heard.name)
        assert driven.safety.state is State.RELEASING
        acted = driven.now
        driven.left.clear()
        driven.run(0.4)
        first = next(time for time, axis, _ in driven.left if axis == "engine")
        assert first - acted <= 0.020 + 1e-9
        assert all(math.isnan(demand) for _, _, demand in driven.left)
        assert driven.safety.reason == f"driver: {name}"


def test_a_takeover_latches_until_a_person_engages_again(bench):
    bench.engage(engine=50.0).run(1.0)
    bench.signals["brake_pedal"] = 40.0
    bench.run_until(State.STANDBY)
    bench.signals["brake_pedal"] = 0.0
    bench.run(2.0)
    assert bench.safety.state is State.STANDBY
    assert "Take over" in bench.safety.warning
    assert bench.safety.engage(bench.now, True, True) == ()
    assert bench.safety.warning == bench.safety.reason == ""


def test_the_driver_takes_over_in_a_graded_release_too(bench):
    bench.engage(engine=50.0).run(1.0)
    bench.safety.fade(bench.now, "test")
    bench.signals["brake_pedal"] = 40.0
    bench.hear()
    assert bench.safety.state is State.RELEASING


def test_a_release_is_four_frames_on_every_axis_and_then_silence(bench):
    bench.engage(engine=50.0).run(1.0)
    bench.left.clear()
    bench.safety.release(bench.now)
    bench.run(0.5)
    assert bench.safety.state is State.STANDBY
    for name in AXES:
        demands = [demand for _, axis, demand in bench.left if axis == name]
        assert len(demands) == 4
        assert all(map(math.isnan, demands))
    assert bench.safety.losses == {"released": 1}


def test_in_a_release_no_demand_leaves_and_no_fifth_frame(bench):
    bench.engage().run(0.3)
    bench.safety.release(bench.now)
    bench.now += 0.1
    assert not bench.send("engine", bench.frame("engine", 0.0))
    assert bench.safety.refusals["not watched"] == 0
    for _ in range(4):
        assert bench.send("engine", bench.frame("engine", math.nan))
        bench.now += 0.02
        bench.safety.tick(bench.now)
    assert not bench.send("engine", bench.frame("engine", math.nan))
    assert bench.safety.refusals == {"controls not allowed": 1, "silence": 1}


# "... or anything control depends on is lost ... or faded without a step ..."


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
    seconds = bench.run_until(State.FADING, within=1.0)
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
    bench.engage(brake=strongest(bench, "brake") / 2).run(2.0)
    bench.commanding = False
    fades_without_a_step(bench, "brake")


def test_a_controller_that_does_not_know_it_is_engaged_is_lost(bench):
    bench.engage(engine=60.0)
    bench.engaged_bit = False
    assert 0.14 < fades_without_a_step(bench, "engine") < 0.2
    assert bench.safety.losses == {"controller not engaged": 1}


@pytest.mark.parametrize("number", range(8))
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
    bench.signals["second_speed"] = 17.1
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


def test_a_stranger_that_commands_the_truck_fades_and_friends_do_not(bench):
    bench.engage(engine=60.0).run(1.0)
    axis = bench.axis("engine")
    for friend in bench.table.friends:
        bench.safety.rx_hook(axis.can_id & ~0xFF | friend, bench.frame("engine", 50.0), bench.now)
    assert bench.safety.state is State.ENGAGED
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


def test_an_impostor_before_our_first_frame_is_harmless_and_noticed_after(bench):
    bench.arm()
    bench.safety.rx_hook(bench.axis("engine").can_id, bytes(8), bench.now)
    assert bench.safety.losses == {}
    assert bench.safety.engage(bench.now, True, True) == ()
    bench.safety.rx_hook(bench.axis("engine").can_id, bytes(8), bench.now)
    assert bench.safety.losses == {"another node uses our address": 1}


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
