"""The promise: "No frame leaves unless it is on the vehicle's list, well formed ..."; for every vehicle.

And within the limits: test_limits.py.
"""

from __future__ import annotations

import math

import pytest

from truck_bridge.safety import State

AXES = ("engine", "retarder", "brake")


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
    assert bench.safety.refusals["silent"] == 4


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
