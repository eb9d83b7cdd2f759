"""A fault that the vehicle file names refuses engagement with its reason, and makes the bridge hand back."""

from __future__ import annotations

import math
from importlib import resources
from itertools import pairwise

import can
import pytest
import yaml

RED = bytes.fromhex("10FF000000000000")
CLEAR = bytes.fromhex("00FF00000000FFFF")
DERATED = bytes.fromhex("04FF21061F016E001001")  # amber lamp, SPN 1569 FMI 31 and SPN 110 FMI 16: two frames
AMBER = bytes.fromhex("04FF6E001001FFFF")


def frames(data, source=0, pgn=0xFECA):
    if len(data) <= 8:
        return [(0x18000000 | pgn << 8 | source, data)]
    count = -(-len(data) // 7)
    head = bytes([32, len(data), 0, count, 0xFF, *pgn.to_bytes(3, "little")])
    parts = [bytes([k + 1]) + data[7 * k : 7 * k + 7].ljust(7, b"\xff") for k in range(count)]
    return [(0x1CECFF00 | source, head), *((0x1CEBFF00 | source, part) for part in parts)]


def tell(w, data, source=0, step=0.05):
    """A controller says a DM1, frame by frame, while everything goes on."""
    for can_id, content in frames(data, source):
        w.trucks.send(can.Message(arbitration_id=can_id, data=content, is_extended_id=True))
        w.run(step, engine=500.0)


def vehicle_file(tmp_path, faults, base="trucksim"):
    data = yaml.safe_load((resources.files("truck_bridge.vehicles") / f"{base}.yaml").read_text())
    path = tmp_path / "mine.yaml"
    path.write_text(yaml.safe_dump({**data, "faults": faults}))
    return str(path)


def asked(w):
    return w.bridge.engage(w.now, person=True, lead_vehicle=True)


def ready(w):
    w.bridge.arm(w.now)
    return w.run(1.0, engine=500.0)


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (RED, "fault: red_stop_lamp (engine)"),
        (DERATED, "fault: SPN 1569 FMI 31 (engine)"),  # received in three frames
        (bytes.fromhex("00FF00C43F81FFFF"), "fault: SPN 115712 FMI 31 (old layout: may be 1569 or"),
    ],
    ids=["lamp", "several frames", "old layout"],
)
def test_a_blocking_fault_refuses_engagement_with_its_reason(world, data, reason):
    w = ready(world("trucksim"))
    tell(w, data)
    (said,) = asked(w)
    assert said.startswith(reason)
    assert w.bridge.status.state == "standby" and w.bridge.status.refusals == {"engagement": 1}
    w.run(4.5, engine=500.0)
    assert asked(w)
    w.run(0.6, engine=500.0)
    assert asked(w) == ()  # five seconds after it was said last


@pytest.mark.parametrize("data", [CLEAR, AMBER], ids=["none", "amber"])
def test_a_fault_that_the_file_does_not_name_blocks_nothing(world, data):
    w = ready(world("trucksim"))
    tell(w, data)
    assert asked(w) == ()
    tell(w, data)
    assert w.bridge.status.engaged
    assert len(w.bridge.status.faults) == (0 if data == CLEAR else 2)
    assert w.signals["fault_count"] == (0.0 if data == CLEAR else 1.0)


@pytest.mark.parametrize("source", [0x00, 0x03, 0x3D], ids=["engine", "transmission", "unnamed"])
def test_while_engaged_it_ends_control_in_order(world, source):
    """A fade to rest, then four release frames on every axis, a warning, and no way back by itself."""
    w = world("trucksim").engage(975.0)
    w.run(3.0, engine=975.0)
    w.received.clear()
    tell(w, DERATED, source, step=0.005)
    status = w.bridge.status
    assert status.state == "fading" and status.reason.startswith("fault: SPN 1569 FMI 31")
    assert status.warning
    w.run(3.0, engine=975.0)
    demands = [demand for _, demand in w.demands("engine")]
    held = [demand for demand in demands if not math.isnan(demand)]
    steps = [a - b for a, b in pairwise(held)]
    assert held[-1] < 3.0 and max(steps) <= 100 * 0.02 + 1.0  # fade of the file, a bit of the wire
    assert len(demands) - len(held) == 4
    assert w.bridge.status.state == "standby" and sum(w.bridge.status.losses.values()) == 1
    assert w.bridge.status.refusals == {}


@pytest.mark.parametrize(
    ("faults", "blocked"),
    [
        ({"codes": [{"spn": 110, "fmi": 16}]}, True),
        ({"codes": [{"spn": 110, "fmi": 0}]}, False),
        ({"codes": [{"spn": 110}]}, True),
        ({"lamps": ["protect_lamp"], "codes": [{"spn": 16}]}, False),
        ({"lamps": ["amber_warning_lamp"]}, True),
    ],
)
def test_the_vehicle_file_says_which(world, tmp_path, faults, blocked):
    w = ready(world(vehicle_file(tmp_path, faults)))
    tell(w, AMBER)
    assert bool(asked(w)) == blocked


def test_a_clock_that_goes_back_forgets_no_fault_into_control(world, tmp_path):
    """Nothing received has an age any more: a file that wants the bus to be listened to first waits again."""
    w = ready(world(vehicle_file(tmp_path, {"lamps": ["red_stop_lamp"], "listen": 2})))
    w.run(2.0, engine=500.0)
    w.now -= 1.0
    w.truck.step(w.now)
    w.bridge.poll(w.now)
    assert "faults: listened for less than 2 s" in asked(w)
    w.run(2.1, engine=500.0)
    assert asked(w) == ()


def test_a_blocking_fault_is_found_in_a_flood_of_others(world):
    w = ready(world("trucksim"))
    for n in range(1, 151):
        code = (5000 + n).to_bytes(2, "little") + b"\x01\x01"
        for can_id, data in frames(b"\x00\xff" + code + b"\xff\xff"):
            w.trucks.send(can.Message(arbitration_id=can_id, data=data, is_extended_id=True))
    w.run(0.05, engine=500.0)
    tell(w, RED)
    assert "fault: red_stop_lamp (engine)" in asked(w)
