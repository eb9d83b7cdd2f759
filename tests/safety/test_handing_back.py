"""The promise: "When the driver acts ... control is handed back within one cycle ... and stays so"."""

from __future__ import annotations

import math

from truck_bridge.safety import State

AXES = ("engine", "retarder", "brake")


def test_the_driver_takes_over_within_one_cycle_by_every_signal(bench):
    for name, threshold in ((act.name, act.least) for act in bench.table.override):
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
