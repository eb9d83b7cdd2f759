"""The tables of scenes are whole, and the judge of the road sees what it is to see."""

from __future__ import annotations

import math
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from deeptruck_cacc.safety.guard import Guard
from deeptruck_nodes.leaders import Constant
from truck_bridge import vehicles
from truck_bridge.safety import Safety

sys.path.insert(0, str(Path(__file__).parent))  # the runs are scripts, and stand beside each other
import fault_road
import fault_table
from fault_chain import Chain, Object
from fault_table import BUS, FAULTS, TRAFFIC, possible


@pytest.fixture(autouse=True)
def for_good(monkeypatch):
    """Faults last to the end."""
    monkeypatch.setattr(fault_table, "LASTS", (math.inf,))


@pytest.mark.parametrize("name", vehicles.NAMES)
def test_every_signal_of_every_vehicle_is_in_the_table(name):
    vehicle = vehicles.load(name)
    assert {signal.name for heard in vehicle.table.heard for signal in heard.signals} <= set(BUS)
    assert len(possible(vehicle)) > 200


@pytest.mark.parametrize(
    "fault",
    [
        "nothing", "speed drift", "radar late",
        *(pytest.param(name, marks=pytest.mark.long) for name in (
            "engine_speed freeze", "radar future", "a stranger demands", "the driver brakes unseen"
        )),
    ],
)  # fmt: skip
def test_no_fault_breaks_what_must_hold(fault):
    assert fault_road.play(20, fault, traffic="steady").broken == ()


OTHERS = [name for name, one in FAULTS.items() if one.machine in ("wire", "node", "once", "person")]
FIRST = [
    next(name for name in OTHERS if FAULTS[name].machine == at) for at in ("wire", "node", "once", "person")
]


@pytest.mark.parametrize(
    "fault", [*FIRST, *(pytest.param(name, marks=pytest.mark.long) for name in OTHERS if name not in FIRST)]
)
def test_no_wire_node_or_person_breaks_what_must_hold(fault):
    verdict = fault_road.play(20, fault, traffic="steady", length=3.0)
    assert verdict.broken == ()


@pytest.mark.parametrize("fault", ["brake pedal", "controller gone", "cancel"])
def test_the_judge_sees_a_bridge_without_a_core(fault, monkeypatch):
    monkeypatch.setattr(Safety, "_end", lambda self, reason, now, otherwise: None)
    monkeypatch.setattr(Safety, "_let_go", lambda self, reason: None)
    assert fault_road.play(20, fault, traffic="steady", length=3.0).broken


def test_the_judge_sees_a_step(monkeypatch):
    monkeypatch.setattr(
        Safety, "plan", lambda self, axis, now: 60.0 * (int(now * 5) % 2) * (axis.name == "engine")
    )
    monkeypatch.setattr(Safety, "tx_hook", lambda self, can_id, data, now: True)
    broken = " ".join(fault_road.play(20, "nothing", traffic="steady", length=3.0).broken)
    assert "stepped" in broken and "before engagement" in broken


def test_a_run_repeats_by_its_seed_and_draws_traffic_and_faults():
    first, again = (fault_road.play(20, length=2.0) for _ in range(2))
    assert repr(first) == repr(again)
    assert first.traffic in TRAFFIC and {drawn.name for drawn in first.faults} <= FAULTS.keys()


def test_two_faults_act_at_once_each_in_its_time():
    verdict = fault_road.play(20, "gap spike", "brake gain", traffic="steady")
    assert [drawn.name for drawn in verdict.faults] == ["gap spike", "brake gain"]
    assert verdict.broken == ()


def _always(monkeypatch, brake):
    """The controller asks for this brake command, and for no engine, whatever is ahead."""
    plain = Guard.act

    def act(self, observation):
        return tuple(
            0.0 * command + ask for command, ask in zip(plain(self, observation), (0.0, brake), strict=True)
        )

    monkeypatch.setattr(Guard, "act", act)


def test_a_hit_is_broken_only_where_full_braking_does_better(monkeypatch):
    monkeypatch.setattr(fault_road, "GRADES", (0.0,))
    _always(monkeypatch, 0.0)
    monkeypatch.setattr(Guard, "brakes_failed", np.zeros(1, bool))  # which would hand back at once
    bare = fault_road.play(20, "nothing", traffic="cut-out onto a standing vehicle")
    assert bare.hit > bare.fully + 1.0 and "hit" in bare.broken


def test_full_braking_is_that_of_the_faulty_brake():
    standing = [Object(Constant(15.0), leaves=0.5), Object(Constant(0.0), 45.0, 0.5)]
    chain = Chain(
        vehicles.load("trucksim"), np.random.default_rng(0), standing, "baseline:acc", lambda s: 0.0
    )
    while chain.now < 0.6:
        chain.step()
    sound, lost = chain.braking_fully(), chain.braking_fully(lambda now: {"gain": float(now < 1.0)})
    chain.close()
    assert sound.hit_speed == 0.0 < sound.least_gap < 25.0
    assert lost.hit_speed > 10.0


def test_a_truck_that_brakes_without_cause_is_seen(monkeypatch):
    _always(monkeypatch, 40.0)
    assert "braked without cause" in fault_road.play(20, "nothing", traffic="steady").broken


def test_a_speed_that_jumps_up_is_refused_before_the_truck_brakes_for_it(monkeypatch):
    fault = "both speeds scale"
    monkeypatch.setitem(FAULTS, fault, FAULTS[fault]._replace(sizes=(1.19,)))
    assert fault_road.play(21, fault, traffic="steady").braked > -0.5
    sound, free = vehicles.load("freightliner"), {"fastest": math.inf, "rises": math.inf}
    heard = [replace(h, signals=tuple(replace(s, **free) for s in h.signals)) for h in sound.table.heard]
    believing = replace(sound, table=replace(sound.table, heard=tuple(heard)))
    monkeypatch.setattr(fault_road, "load", lambda name: believing)
    assert "braked without cause" in fault_road.play(21, fault, traffic="steady").broken


def test_the_judge_sees_a_bridge_that_accepts_what_is_not_sent(monkeypatch):
    from truck_bridge.safety import hearing

    monkeypatch.setattr(hearing.Hearing, "stale", lambda self, now: [])
    assert "control was kept" in fault_road.play(20, "brake_pedal silent", traffic="steady").broken
