"""One place decides which frame carries a signal, for the controller and for the safety core."""

from __future__ import annotations

import math
from importlib import resources

import can
import pytest
from bridge_world import in_units

from truck_bridge import vehicles
from truck_bridge.received_signals import ReceivedSignals


def send(w, message, values, source):
    layout = w.vehicle.codec[message]
    data = layout.encode(values)
    w.ear.send(can.Message(arbitration_id=layout.can_id(source), data=data, is_extended_id=True))


@pytest.mark.parametrize("source", [0x03, 0x0B, 0x0F])
def test_a_speed_by_another_of_the_truck_s_addresses_is_not_taken_and_refuses_control(world, source):
    w = world("trucksim")
    w.bridge.arm(w.now)
    for _ in range(20):
        send(w, "CCVS1", {"WheelBasedVehicleSpeed": 36.0}, source)
        w.run(0.05, engine=in_units("trucksim", 30))
        assert math.isnan(w.signals.get("speed", math.nan)) or w.signals["speed"] > 14.0
    what = f"speed from a second sender (0x{source:02X})"
    assert what in w.bridge.engage(w.now, person=True, lead_vehicle=True)
    w.run(1.1, engine=in_units("trucksim", 30))
    assert w.bridge.engage(w.now, person=True, lead_vehicle=True) == ()
    send(w, "CCVS1", {"WheelBasedVehicleSpeed": 36.0}, source)
    w.run(0.02, engine=in_units("trucksim", 30))
    assert w.bridge.status.reason == what
    assert w.signals["speed"] > 14.0


def test_demands_under_our_address_in_standby_are_said_at_once(world):
    w = world("trucksim")
    w.bridge.arm(w.now)
    w.run(1.0, engine=in_units("trucksim", 30))
    engine = w.vehicle.transmitted["engine"]
    w.ear.send(
        can.Message(arbitration_id=engine.axis.can_id, data=engine.frame(60.0, 0), is_extended_id=True)
    )
    w.run(0.005, engine=in_units("trucksim", 30))
    assert w.bridge.status.warning
    why = w.bridge.engage(w.now, person=True, lead_vehicle=True)
    assert why == ("another node uses our address",)


@pytest.mark.parametrize(("pitch", "grade"), [(89.9, math.nan), (-27.0, math.nan), (2.0, 0.0349)])
def test_a_pitch_that_no_road_has_is_no_grade(pitch, grade):
    vehicle = vehicles.load("trucksim")
    signals, layout = ReceivedSignals(vehicle), vehicle.codec["VDS"]
    signals.hear(layout.can_id(0x0B), layout.encode({"Pitch": pitch}), 1.0)
    assert signals.at(1.0)["grade"] == pytest.approx(grade, abs=1e-4, nan_ok=True)


def test_a_second_speed_that_the_file_names_is_no_second_sender(tmp_path):
    text = (resources.files("truck_bridge.vehicles") / "trucksim.yaml").read_text()
    entry = "{message: CCVS1, from: retarder, period: 0.1, timeout: 0.3, signals: {third_speed: %s}}"
    named = f"  retarder_speed: {entry % 'WheelBasedVehicleSpeed'}\n"
    path = tmp_path / "truck.yaml"
    path.write_text(text.replace("  EBC1: {from", named + "  EBC1: {from"))
    vehicle = vehicles.load(path)
    signals, layout = ReceivedSignals(vehicle), vehicle.codec["CCVS1"]
    for source, speed in ((0x0F, 36.0), (0x00, 54.0), (0x0F, 36.0)):
        signals.hear(layout.can_id(source), layout.encode({"WheelBasedVehicleSpeed": speed}), 1.0)
    assert signals.at(1.0)["speed"] == pytest.approx(15.0)


@pytest.mark.parametrize(
    ("source", "mode"), [("ours", 2), ("transmission", 6), ("brake", 8), ("retarder", 10)]
)
def test_the_emulated_engine_says_on_whose_behalf_it_makes_torque(world, source, mode):
    w = world("trucksim")
    address = {"ours": w.vehicle.address, **w.vehicle.addresses}[source]
    layout = w.vehicle.codec["EEC1"]

    def said():
        frames = [bytes(m.data) for _, m in w.received if m.arbitration_id & 0x03FFFFFF == 0xF00400]
        values = layout.decode(frames[-1]).values
        return values["EngineTorqueMode"], values["EngineControllingAddress"]

    w.run(0.1)
    assert said() == (0, 0x00)
    message = w.vehicle.transmitted["engine"]
    can_id = message.axis.can_id & ~0xFF | address
    for count in range(4):
        data = message.layout.encode({**message.active, message.demand: 60.0})
        data = vehicles.vehicle.checksums.sign(message.axis.check, can_id, data, count)
        w.ear.send(can.Message(arbitration_id=can_id, data=data, is_extended_id=True))
        w.run(0.02)
    assert said() == (mode, address)
