"""The table of scenes is whole, and the judge of the road sees what it is to see."""

from __future__ import annotations

import math
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from deeptruck_cacc.safety.track import Tracker
from truck_bridge import vehicles

sys.path.insert(0, str(Path(__file__).parent))  # the runs are scripts, and stand beside each other
import fault_road
from fault_table import BUS, SCENES, possible


@pytest.fixture(autouse=True)
def for_good(monkeypatch):
    """Faults last to the end."""
    monkeypatch.setattr(fault_road, "LASTS", (math.inf,))


@pytest.mark.parametrize("name", vehicles.NAMES)
def test_every_signal_of_every_vehicle_is_in_the_table(name):
    vehicle = vehicles.load(name)
    assert {signal.name for heard in vehicle.table.heard for signal in heard.signals} <= set(BUS)
    assert len(possible(vehicle)) > 200


@pytest.mark.parametrize(
    "scene",
    [
        "nothing",
        "speed drift",
        "engine_speed freeze",
        "radar future",
        "radar late",
        "a stranger demands",
        "the driver brakes unseen",
    ],
)
def test_no_scene_breaks_what_must_hold(scene):
    assert SCENES[scene]
    assert fault_road.play(20, scene).broken == ()


def test_a_speed_that_jumps_up_is_refused_before_the_truck_brakes_for_it(monkeypatch):
    scene = "both speeds scale"
    monkeypatch.setitem(SCENES, scene, SCENES[scene]._replace(sizes=(1.19,)))
    assert fault_road.play(21, scene).braked > -0.5
    sound, free = vehicles.load("freightliner"), {"fastest": math.inf, "rises": math.inf}
    heard = [replace(h, signals=tuple(replace(s, **free) for s in h.signals)) for h in sound.table.heard]
    believing = replace(sound, table=replace(sound.table, heard=tuple(heard)))
    monkeypatch.setattr(fault_road, "load", lambda name: believing)
    assert "braked without cause" in fault_road.play(21, scene).broken


def test_the_judge_sees_a_truck_that_brakes_for_a_ghost(monkeypatch):
    plain = Tracker.__init__
    monkeypatch.setattr(Tracker, "__init__", lambda self, dt: plain(self, dt, nearer_s=0.0))
    assert "braked without cause" in fault_road.play(20, "radar ghost").broken


def test_the_judge_sees_a_bridge_that_believes_what_is_not_sent(monkeypatch):
    from truck_bridge.safety import hearing

    monkeypatch.setattr(hearing.Hearing, "stale", lambda self, now: [])
    assert "control was kept" in fault_road.play(20, "brake_pedal silent").broken
