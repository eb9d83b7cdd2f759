"""The promise: "... and a person has engaged control on fresh, plausible signals."; for every vehicle."""

from __future__ import annotations

import math

import pytest

from truck_bridge.safety import State


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
    acts = [(act.name, act.least) for act in bench.table.override]
    for kind, pairs in (("driver", acts), ("truck", bench.table.forbidden)):
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


@pytest.mark.parametrize(
    ("gap", "needs", "refused"),
    [(10.0, 24.0, True), (24.0, 24.0, False), (23.9, 24.0, True), (30.0, 24.0, False)],
)
def test_engagement_is_refused_nearer_than_the_shield_needs(bench, gap, needs, refused):
    bench.arm()
    bench.safety.command({axis.name: 0.0 for axis in bench.table.axes}, False, bench.now, (gap, needs))
    why = bench.safety.engage(bench.now, True, True)
    assert why == ((f"too near the vehicle ahead: {gap:.0f} m, needs 24 m",) if refused else ())


def test_without_a_gap_nobody_is_too_near(bench):
    bench.arm()
    bench.safety.command({axis.name: 0.0 for axis in bench.table.axes}, False, bench.now, (math.nan, 24.0))
    assert bench.safety.engage(bench.now, True, True) == ()
