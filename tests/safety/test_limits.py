"""Limits of value, rate and jerk, restated from each vehicle's requirement and dense at their boundaries."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest

from truck_bridge.safety import Axis, State, Timing

# Brakes: 5 m/s^2 at every speed. UN R131 asks an emergency braking system for 4 m/s^2 and more and sets no
# upper limit; what is no emergency is held to less by the guard before the core.
# axis: unit a bit; (speed, highest demand away from rest) points; unit/s; unit/s in a fade; unit/s^2; period
REQUIREMENTS = {
    "trucksim": {
        "engine": (1.0, ((0, 80), (5, 100), (40, 100)), 300, 100, 6000, 0.02),
        "retarder": (1.0, ((0, -100), (40, -100)), 200, 100, 4000, 0.05),
        "brake": (0.0025, ((5, 90), (20, 90)), 300, 60, 6000, 0.02),
    },
    "freightliner": {
        "engine": (1.0, ((0, 80), (5, 100), (30, 100)), 300, 100, 6000, 0.02),
        "retarder": (1.0, ((0, -100), (30, -100)), 200, 100, 4000, 0.05),
        "brake": (0.0025, ((5, 80), (20, 80)), 300, 60, 6000, 0.02),
    },
    "volvo": {
        "engine": (1.0, ((0, 80), (5, 100), (40, 100)), 300, 100, 6000, 0.02),
        "retarder": (1.0, ((0, -100), (40, -100)), 200, 100, 4000, 0.05),
        "brake": (1 / 2048, ((5, -5), (20, -5)), 10, 3, 100, 0.02),
    },
}
AXES = ("engine", "retarder", "brake")


def furthest(points, speed):
    """The requirement's envelope at a speed."""
    if speed <= points[0][0]:
        return points[0][1]
    for (x0, y0), (x1, y1) in pairwise(points):
        if speed <= x1:
            return y0 + (y1 - y0) * (speed - x0) / (x1 - x0)
    return points[-1][1]


def nearest_raw(axis, demand):
    return round((demand - axis.demand.offset) / axis.demand.scale)


@pytest.mark.parametrize("name", AXES)
def test_the_table_is_the_requirement(bench, vehicle, name):
    quantum, _points, rate, fade, jerk, period = REQUIREMENTS[vehicle][name]
    axis = bench.axis(name)
    assert axis.demand.scale == quantum
    assert (axis.limits.rate, axis.limits.fade, axis.limits.jerk) == (rate, fade, jerk)
    assert axis.period_s == period
    assert axis.rest == 0.0


@pytest.mark.parametrize("name", AXES)
@pytest.mark.parametrize("speed", [0.0, 2.5, 4.99, 5.0, 5.01, 12.5, 19.99, 20.0, 20.01, 30.0])
def test_value_one_bit_inside_leaves_and_one_bit_outside_does_not(bench, vehicle, name, speed):
    _, points, *_ = REQUIREMENTS[vehicle][name]
    bench.signals |= {"speed": speed, "driveline": 0.0, "engine_percent": 0.0}
    bench.engage().run(2.1)
    axis, motion = bench.axis(name), bench.safety._motions[bench.axis(name).can_id]
    said = bench.axis(name)
    measured = bench.safety.hearing.value("speed")
    edge = furthest(points, measured)
    away = 1 if edge > 0 else -1
    raw = nearest_raw(said, edge)
    outward = [raw + away * k for k in (2, 3, 10)]
    inward = [raw - away * k for k in (0, 1, 2)]
    for number, bits in enumerate((*outward, *inward)):
        bench.turn(name)
        motion.value = motion.exact = edge  # as if the demand had arrived there in order
        motion.slew = 0.0
        allowed = 0 <= bits <= axis.demand.last and bench.send(name, bench.raw_frame(name, bits))
        assert allowed == (number >= len(outward)), bits
    assert set(bench.safety.refusals) <= {"value", "form"}


@pytest.mark.parametrize("name", AXES)
def test_nothing_leaves_on_the_other_side_of_rest(bench, vehicle, name):
    bench.signals["engine_percent"] = 0.0
    bench.engage().run(3.0)
    away = 1 if REQUIREMENTS[vehicle][name][1][0][1] > 0 else -1
    rest = nearest_raw(bench.axis(name), 0.0)
    for bits in (rest - away * 2, rest - away * 3):
        bench.turn(name)
        assert bits < 0 or not bench.send(name, bench.raw_frame(name, bits))
    bench.turn(name)
    assert bench.send(name, bench.raw_frame(name, rest))


@pytest.mark.parametrize("name", AXES)
@pytest.mark.parametrize("young", [True, False])
def test_rate_one_bit_above_is_refused(bench, vehicle, name, young):
    quantum, points, rate, _, _, period = REQUIREMENTS[vehicle][name]
    bench.signals["engine_percent"] = 0.0
    bench.engage().run(1.0 if young else 3.0)
    axis, motion = bench.axis(name), bench.safety._motions[bench.axis(name).can_id]
    step = rate * (0.5 if young else 1.0) * period
    middle = furthest(points, 15.0) / 2
    for direction in (1, -1):
        for bits, allowed in ((2, False), (1, True), (0, True)):
            bench.turn(name)
            base = axis.demand.offset + axis.demand.scale * nearest_raw(axis, middle)
            motion.value = motion.exact = base
            motion.slew = direction * step / period  # already moving that fast: only the rate can object
            raw = nearest_raw(axis, base) + direction * (math.floor(step / quantum + 1e-9) + bits)
            bench.safety.refusals.clear()
            assert bench.send(name, bench.raw_frame(name, raw)) == allowed, (direction, bits)
            assert bench.safety.refusals == ({} if allowed else {"rate": 1})


@pytest.mark.parametrize("name", AXES)
def test_jerk_one_bit_above_is_refused(bench, vehicle, name):
    """Turning round from half its rate, where the step that jerk allows is well inside the rate."""
    quantum, points, rate, _, jerk, period = REQUIREMENTS[vehicle][name]
    bench.signals["engine_percent"] = 0.0
    bench.engage().run(3.0)
    axis, motion = bench.axis(name), bench.safety._motions[bench.axis(name).can_id]
    bend = (jerk * period - rate / 2) * period
    middle = nearest_raw(axis, furthest(points, 15.0) / 2)
    for direction in (1, -1):
        for bits, allowed in ((2, False), (1, True)):
            bench.turn(name)
            motion.value = motion.exact = axis.demand.offset + axis.demand.scale * middle
            motion.slew = -direction * rate / 2
            raw = middle + direction * (math.floor(bend / quantum + 1e-9) + bits)
            bench.safety.refusals.clear()
            assert bench.send(name, bench.raw_frame(name, raw)) == allowed, (direction, bits)
            assert bench.safety.refusals == ({} if allowed else {"jerk": 1})


@pytest.mark.parametrize("name", AXES)
def test_at_the_edge_of_the_envelope_jerk_gives_way(bench, vehicle, name):
    _quantum, points, rate, _, _, _period = REQUIREMENTS[vehicle][name]
    bench.signals["engine_percent"] = 0.0
    bench.engage().run(3.0)
    axis, motion = bench.axis(name), bench.safety._motions[bench.axis(name).can_id]
    edge = furthest(points, bench.safety.hearing.value("speed"))
    bench.turn(name)
    motion.value = motion.exact = edge
    motion.slew = (1 if edge > 0 else -1) * rate  # racing outwards, and now stopped by the envelope
    assert bench.send(name, bench.raw_frame(name, nearest_raw(axis, edge)))


@pytest.mark.parametrize("name", AXES)
def test_a_fade_is_refused_away_from_rest_and_faster_than_its_rate(bench, vehicle, name):
    quantum, points, _, fade, _, period = REQUIREMENTS[vehicle][name]
    bench.signals["engine_percent"] = 0.0
    bench.engage().run(3.0)
    axis, motion = bench.axis(name), bench.safety._motions[bench.axis(name).can_id]
    away = 1 if furthest(points, 15.0) > 0 else -1
    middle = nearest_raw(axis, furthest(points, 15.0) / 2)
    bench.safety.fade(bench.now, "test")
    step = math.floor(fade * period / quantum + 1e-9)
    for bits, allowed in ((2 * away, False), (0, True), (-away * step, True), (-away * (step + 2), False)):
        motion.value = motion.exact = axis.demand.offset + axis.demand.scale * middle
        bench.turn(name)
        assert bench.safety.state is State.FADING
        assert bench.send(name, bench.raw_frame(name, middle + bits)) == allowed, bits
    assert bench.safety.refusals == {"rate": 2}


@pytest.mark.parametrize("name", AXES)
def test_handing_back_while_demanding_is_a_step(bench, vehicle, name):
    quantum, points, rate, _, _, period = REQUIREMENTS[vehicle][name]
    bench.signals["engine_percent"] = 0.0
    bench.engage().run(3.0)
    axis, motion = bench.axis(name), bench.safety._motions[bench.axis(name).can_id]
    away = 1 if furthest(points, 15.0) > 0 else -1
    nearly = rate * period
    for distance, allowed in ((nearly + 1.02 * quantum, False), (nearly + 0.98 * quantum, True)):
        bench.turn(name)
        motion.value = motion.exact = away * distance
        assert bench.send(name, bench.frame(name, math.nan)) == allowed
    assert bench.safety.refusals == {"step": 1}
    assert axis.rest == motion.value == 0.0


def test_the_engine_starts_from_the_torque_it_gives(bench):
    bench.signals["engine_percent"] = 37.0
    bench.engage(engine=37.0)
    bench.run(0.03)
    assert bench.demand("engine") == pytest.approx(37.0)


def test_the_start_is_inside_the_envelope(bench, vehicle):
    bench.signals |= {"engine_percent": 100.0, "speed": 0.0, "driveline": 0.0}
    bench.engage(engine=100.0).run(0.03)
    assert bench.demand("engine") == pytest.approx(80.0)


@pytest.mark.parametrize("name", AXES)
def test_a_demand_arrives_and_stays_without_overshoot(bench, vehicle, name):
    quantum, points, rate, _, _, _period = REQUIREMENTS[vehicle][name]
    bench.signals["engine_percent"] = 0.0
    target = 0.6 * furthest(points, 15.0)
    bench.engage(**{name: target})
    del bench.signals["engine_percent"]  # it follows
    bench.run(4.0)
    demands = [demand for _, axis, demand in bench.left if axis == name and not math.isnan(demand)]
    assert demands[-1] == pytest.approx(target, abs=1e-6)
    assert max(map(abs, demands)) <= abs(target) + quantum + 0.02 * abs(target)
    time = next(t for t, axis, d in bench.left if axis == name and abs(d) >= 0.98 * abs(target))
    ideal = abs(target) / (0.5 * rate)  # engaged two seconds ago at most: half the rate
    assert time - 100.0 < ideal + 0.35


def test_steps_below_one_bit_are_not_swallowed(bench, vehicle):
    """Half a percent a cycle must add up although the wire counts whole percents."""
    slow = 12.0  # %/s: a quarter of a bit in each frame
    bench.signals["engine_percent"] = 0.0
    bench.engage(engine=0.0).run(3.0)
    for _ in range(400):
        bench.demands["engine"] = min(bench.demands["engine"] + slow * 0.005, 24.0)
        bench.cycle()
    assert bench.demand("engine") == pytest.approx(24.0, abs=1.0)


def test_the_envelope_follows_the_speed_no_faster_than_a_truck(bench, vehicle):
    """A jump of the measured speed must not make the demand jump."""
    bench = bench.that_may_jump()
    bench.signals |= {"speed": 5.0, "driveline": 0.0, "engine_percent": 0.0}
    _, points, _rate, *_ = REQUIREMENTS[vehicle]["brake"]
    bench.needs = {"brake": points[0][1]}
    bench.engage(brake=points[0][1]).run(4.0)
    assert bench.demand("brake") == pytest.approx(points[0][1])
    bench.signals["speed"] = 25.0
    bench.left.clear()
    bench.run(0.3)
    demands = [demand for _, axis, demand in bench.left if axis == "brake"]
    slope = abs(points[1][1] - points[0][1]) / 15.0 * 12.0
    assert max(abs(a - b) for a, b in pairwise(demands)) <= slope * 0.02 + 1e-9
    bench.run(3.0)
    assert bench.demand("brake") == pytest.approx(points[1][1])
    assert bench.safety.refusals == {}


def test_an_axis_idle_at_rest_sends_the_release_frame(bench):
    bench.signals["engine_percent"] = 0.0
    bench.engage().run(1.0)
    for name in AXES:
        demands = [demand for _, axis, demand in bench.left if axis == name]
        assert demands
        assert all(math.isnan(d) == bench.axis(name).idle_at_rest for d in demands)
    assert [bench.axis(name).idle_at_rest for name in AXES] == [False, True, True]


def test_after_a_gap_a_demand_moves_by_two_periods_at_most(bench, vehicle):
    _quantum, _, rate, *_, period = REQUIREMENTS[vehicle]["engine"]
    bench.signals["engine_percent"] = 0.0
    bench.engage(engine=20.0).run(3.0)
    motion = bench.safety._motions[bench.axis("engine").can_id]
    bench.wait(0.095)
    motion.slew = rate
    limit = 20 + rate * 2 * period
    assert not bench.send("engine", bench.raw_frame("engine", nearest_raw(bench.axis("engine"), limit + 2)))
    assert bench.send("engine", bench.raw_frame("engine", nearest_raw(bench.axis("engine"), limit)))


def test_the_times_and_tolerances_are_the_requirement(bench):
    table = bench.table
    assert table.timing == Timing(
        controller_timeout=0.15,
        stall=0.1,
        handover=2.0,
        handover_scale=0.5,
        fade_longest=4.0,
        persist=0.5,
        unexplained=1.0,
        gear_change=3.0,
        releases=4,
    )
    line = table.driveline
    assert (table.speed_gap_m_s, line.tolerance, line.above_m_s, line.slack_m_s) == (2.0, 0.04, 3.0, 0.5)
    signals = {signal.name: signal for heard in table.heard for signal in heard.signals}
    assert {name for name, signal in signals.items() if signal.fastest == 12.0} == {"speed", "second_speed"}
    assert {name for name, signal in signals.items() if signal.rises == 4.0} == {"speed", "second_speed"}
    assert {name for name, signal in signals.items() if signal.still_s == 0.5} == {"engine_speed"}
    assert {one.signal: one.explained for one in table.obeyed} == {
        "engine_obeys": (0x00, 0x2A),
        "engine_mode": (0, 1, 2, 4, 8, 9, 14),
        "retarder_obeys": (0x0F, 0x2A),
    }
    assert {(one.axis, one.signal, one.beyond, one.above_m_s) for one in table.followed} == {
        ("engine", "engine_percent", 30.0, 3.0),
        ("retarder", "retarder_percent", -30.0, 3.0),
    }
    assert table.needs_lead


def test_an_axis_says_its_rest_unless_told_otherwise(bench):
    axis = bench.axis("engine")
    plain = Axis(
        axis.name, axis.can_id, axis.period_s, axis.demand, axis.active, axis.release, "none", axis.limits
    )
    assert (plain.rest, plain.idle_at_rest, plain.start_from) == (0.0, False, "")
