"""The bridge and the ECU emulator in lock-step over a virtual bus."""

from __future__ import annotations

import math
from importlib import resources
from pathlib import Path

import can
import numpy as np
import pytest
from bridge_world import RESEARCH, SIGNED, STEP, braking, in_units, pressed

from deeptruck_model import simulators
from truck_bridge import vehicles
from truck_bridge.bus_connection import RETRY_S
from truck_bridge.j1939.address_claim import name as j1939_name
from truck_bridge.received_signals import ReceivedSignals

CLOSED_LOOP_S = 20
OTHERS = [name for name in (*vehicles.NAMES, SIGNED) if name != "trucksim"]


def test_silent_until_armed_then_only_the_claim(world, name):
    w = world(name).run(1.0, engine=in_units(name, 30))
    assert w.ours_on_the_bus() == []
    w.bridge.arm(w.now)
    w.run(1.0, engine=in_units(name, 30))
    assert {m.arbitration_id for _, m in w.ours_on_the_bus()} == {0x18EEFF00 | w.vehicle.address}
    assert w.bridge.status.state == "standby"
    assert w.bridge.status.address_claimed


def test_frames_that_waited_for_the_bridge_to_be_armed_are_not_taken_for_a_flood(world, name):
    """A controller that takes long to load lets them wait: 12 s of them would come at once."""
    w = world(name)
    for _ in range(round(12.0 / STEP)):
        w.now += STEP
        w.truck.step(w.now)
    w.bridge.arm(w.now)
    w.run(0.5, engine=in_units(name, 30))
    assert w.bridge.engage(w.now, person=True, lead_vehicle=True) == ()
    w.run(0.4, engine=in_units(name, 30))
    assert w.bridge.engaged and not any("too often" in reason for reason in w.bridge.status.refusals)


def test_the_signals_are_the_truck_s(world, name):
    w = world(name, grade=0.02 if name != "freightliner" else 0.0).engage(in_units(name, 40))
    w.run(3.0, engine=in_units(name, 40))
    inside = w.truck._seen
    assert w.signals["speed"] == pytest.approx(w.truck.speed, abs=0.1)
    assert w.signals["acceleration"] == pytest.approx(w.truck.acceleration, abs=0.05)
    assert w.signals["engine_speed"] == pytest.approx(inside["engine_speed"][0], abs=0.5)
    assert w.signals["engine_torque"] == pytest.approx(inside["engine_torque"][0], abs=40)
    assert w.signals["gear"] == inside["gear"][0]
    assert w.signals["fuel_rate"] == pytest.approx(inside["fuel_rate"][0], rel=0.02)
    if name == "freightliner":
        assert "grade" not in w.signals
    else:
        assert w.signals["grade"] == pytest.approx(0.02, abs=2e-4)


def test_the_driver_s_demands_are_heard(world, name):
    w = world(name)
    w.bridge.arm(w.now)
    w.truck.driver.accelerator, w.truck.driver.brake_pedal = 30.0, 12.0
    w.run(1.0)
    demands = ("driver_demand_torque", "accelerator_pedal", "brake_pedal")
    assert [w.signals[demand] for demand in demands] == pytest.approx([30.0, 30.0, 12.0], abs=0.5)


def test_commands_reach_the_truck(world, name):
    w = world(name).engage(in_units(name, 30))
    w.run(3.0, engine=in_units(name, 30))
    assert w.truck.command[0] == pytest.approx(in_units(name, 30), rel=0.02)
    w.run(3.0, engine=in_units(name, -20))
    assert w.truck.command[0] == pytest.approx(in_units(name, -20), rel=0.05)
    w.run(2.0, engine=0.0, brake=braking(name, 1.5))
    assert w.truck.command[0] == 0.0
    assert w.truck.command[1] == pytest.approx(braking(name, 1.5), rel=0.01)
    assert w.truck.acceleration == pytest.approx(-1.5, abs=0.7)


def test_the_driver_gets_the_truck_back_within_a_cycle(world, name):
    w = world(name).engage(in_units(name, 50))
    w.run(2.0, engine=in_units(name, 50))
    w.truck.driver.brake_pedal = 40.0
    w.received.clear()
    w.run(1.0, engine=in_units(name, 50))
    told = next(t for t, m in w.received if pressed(w, m))
    demands = w.demands("engine")
    assert all(math.isnan(d) for t, d in demands if t > told)
    release = [t for t, d in demands if t >= told]
    assert len(release) == 4
    assert release[0] - told <= 0.020 + 1e-9
    assert w.bridge.status.warning and w.truck.command[0] == 0.0


def test_when_the_bridge_vanishes_the_truck_lets_go_by_itself(world, name):
    w = world(name).engage(in_units(name, 50))
    w.run(2.0, engine=in_units(name, 50))
    w.bridge.poll = lambda now: {}  # kill -9
    w.run(0.11)
    before = w.truck.command[0]
    w.run(0.8)
    assert before > 0.0
    assert w.truck.command[0] == 0.0


def test_no_load_sends_nothing_and_shows_everything(world):
    w = world("volvo", no_load=True).engage(30.0)
    w.run(2.0, engine=30.0)
    assert w.ours_on_the_bus() == []
    would = w.bridge.status.would_send
    assert w.vehicle.transmitted["engine"].layout.decode(would[0x0C00002A]).values["RequestedTorque"] == 30.0
    assert w.bridge.status.state == "engaged"
    assert w.bridge.status.frames_sent == 0


@pytest.mark.parametrize(
    "name",
    [
        "trucksim",
        *(pytest.param(name, marks=pytest.mark.long, id=Path(name).stem) for name in OTHERS),
    ],
)
def test_the_closed_loop_is_that_of_the_truck_itself(world, name):
    """The same speed controller against the physics truck directly and through bridge and emulator."""

    def control(speed, target, integral):
        error = target - speed
        integral = min(max(integral + 0.1 * error, -20.0), 40.0)
        wanted = 12.0 * error + 1.5 * integral
        return max(wanted, 0.0), max(-wanted, 0.0), integral

    def command(wanted, braked):
        return in_units(name, min(wanted, 100.0)), braking(name, min(0.08 * braked, 3.0))

    targets = [15.0 + 2.0 * math.sin(0.15 * k / 10) for k in range(10 * CLOSED_LOOP_S)]
    truck = simulators.load(vehicles.load(name).truck)
    y = np.array([[0.0, 15.0, 0.0]])[:, : len(truck.interface.y)]
    state, direct, integral = truck.reset(y), [], 5.0
    for target in targets:
        wanted, braked, integral = control(float(y[0, 1]), target, integral)
        u = np.array([command(wanted, braked)])
        state, y = truck.step(state, u, np.zeros((1, len(truck.interface.w))))
        direct.append(target - float(y[0, 1]))

    w, over_can, integral = world(name).engage(in_units(name, 5)), [], 5.0
    w.run(2.0, engine=in_units(name, 12))  # past the handing over
    for target in targets:
        wanted, braked, integral = control(w.signals["speed"], target, integral)
        w.run(0.1, *command(wanted, braked))
        over_can.append(target - w.truck.speed)
    rms = [float(np.sqrt(np.mean(np.square(errors[50:])))) for errors in (direct, over_can)]
    assert w.bridge.status.engaged
    assert w.bridge.status.refusals == {}
    assert rms[1] == pytest.approx(rms[0], rel=0.1, abs=0.02)


def test_what_stands_against_engaging_is_told_without_asking(world, name):
    w = world(name)
    w.bridge.arm(w.now)
    seen = w.bridge.obstacles(w.now, lead_vehicle=False)
    assert "no fresh command" in seen and "no vehicle ahead" in seen
    assert any(reason.endswith("not fresh") for reason in seen)
    refused = dict(w.bridge.status.refusals)
    w.run(1.0, engine=in_units(name, 30))
    assert w.bridge.obstacles(w.now, lead_vehicle=True) == ()
    w.truck.driver.brake_pedal = 40.0
    w.run(0.5, engine=in_units(name, 30))
    told = w.bridge.obstacles(w.now, lead_vehicle=True)
    assert told
    assert dict(w.bridge.status.refusals) == refused and w.bridge.status.state == "standby"
    assert w.bridge.engage(w.now, person=True, lead_vehicle=True) == told  # what an attempt would be told


# On a bus that lies, falls silent or goes away, and by a clock that goes back


def test_an_address_lost_is_silence_and_stays_so(world):
    w = world("trucksim").engage(500.0)
    w.run(1.0, engine=500.0)
    w.ear.send(can.Message(arbitration_id=0x18EEFF2A, data=j1939_name(0)))
    w.received.clear()
    w.run(2.0, engine=500.0)
    assert [m.arbitration_id for _, m in w.received if m.arbitration_id & 0xFF == 0xFE] == [0x18EEFFFE]
    assert w.ours_on_the_bus() == []
    assert w.bridge.status.losses == {"link lost": 1}
    assert "no bus or no address" in w.bridge.engage(w.now, person=True, lead_vehicle=True)


def test_a_signed_message_bent_on_its_way_is_refused_whatever_the_bit(world):
    w = world(SIGNED).engage(500.0)
    w.run(2.0, engine=500.0)
    said = [bytes(m.data) for _, m in w.received if m.arbitration_id & 0x03FFFFFF == 0xFEBF0B]
    assert [data[7] & 15 for data in said] == [k % 16 for k in range(len(said))]
    assert w.bridge.status.refusals == {}
    bent = int.from_bytes(said[-1], "little")
    for bit in range(64):
        data = (bent ^ 1 << bit).to_bytes(8, "little")
        w.bridge.safety.rx_hook(0x18FEBF0B, data, w.now)
    assert w.bridge.status.refusals["EBC2 checksum"] == 64


def test_two_controllers_that_send_the_same_message_do_not_silence_each_other(world):
    w = world(RESEARCH).run(0.5)
    ccvs1 = {m.arbitration_id & 0xFF for _, m in w.received if m.arbitration_id & 0x03FFFF00 == 0xFEF100}
    assert ccvs1 == {0x00, 0x31}
    silent_on_speed = w.vehicle.codec["CCVS1"].encode({"BrakeSwitch": 0.0})
    w.trucks.send(can.Message(arbitration_id=0x18FEF131, data=silent_on_speed))
    w.signals = w.bridge.poll(w.now)
    assert w.signals["speed"] == pytest.approx(15.0, abs=0.5)
    w.trucks.send(can.Message(arbitration_id=0x18FEF100, data=silent_on_speed))
    assert math.isnan(w.bridge.poll(w.now)["speed"])


@pytest.mark.parametrize("jump", [-30.0, -0.05])
def test_a_clock_that_goes_back_is_answered_with_release_frames_in_time(world, name, jump):
    w = world(name).engage(in_units(name, 50))
    w.run(2.0, engine=in_units(name, 50))
    w.received.clear()
    since, true = w.now, w.bridge.poll
    w.bridge.poll = lambda now: true(now + jump)
    w.run(0.5)
    assert [at - since <= 0.09 for at, d in w.demands("engine") if math.isnan(d)] == [True] * 4
    assert not [d for _, d in w.demands("engine") if not math.isnan(d)]
    assert w.bridge.status.losses == {"clock went back": 1}
    assert w.bridge.status.address_claimed
    assert w.signals["speed"] == pytest.approx(w.truck.speed, abs=0.5)  # received anew


def test_a_lost_bus_is_reopened_silently(world):
    w = world("trucksim")
    spare = w.open()
    w.bridge._connection.reopen = lambda: spare
    w.engage(500.0)
    w.ours.shutdown()
    w.run(2.5, engine=500.0)
    assert w.bridge.status.state == "standby"
    assert w.bridge.status.address_claimed
    assert w.bridge.status.losses == {"link lost": 1}
    assert w.bridge.engage(w.now, person=True, lead_vehicle=True) == ()
    w.run(0.5, engine=500.0)
    assert w.bridge.status.engaged
    spare.shutdown()


def test_a_bus_that_stays_away_is_tried_again_and_again(world):
    w = world("trucksim")
    tries = []

    def reopen():
        tries.append(w.now)
        raise can.CanInitializationError("still gone")

    w.bridge._connection.reopen = reopen
    w.engage(500.0)
    w.ours.shutdown()
    w.run(4.5 * RETRY_S, engine=500.0)
    assert len(tries) == 4
    assert not w.bridge.status.address_claimed


# One place decides which frame carries a signal, for the controller and for the safety core


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
