"""The bridge and the ECU emulator: in lock-step over a virtual bus, and as real processes over loopback."""

from __future__ import annotations

import math
import os
import subprocess
import sys
import threading
import time
from pathlib import Path

import can
import numpy as np
import pytest

from deeptruck_model import simulators
from truck_bridge import vehicles
from truck_bridge.bridge import Bridge
from truck_bridge.ecu_emulator import EcuEmulator
from truck_bridge.errors import InputError
from truck_bridge.j1939.address_claim import name as j1939_name

STEP = 0.005
SIGNED = str(Path(__file__).with_name("signed_truck.yaml"))  # counts and signs two of its messages
RESEARCH = str(Path(__file__).with_name("research_truck.yaml"))
POSITION = "VP: {from: engine, period: 5.0, timeout: 20.0, signals: {latitude: Latitude}}"


class World:
    def __init__(self, name, speed=15.0, grade=0.0, **options):
        self.vehicle = vehicles.load(name)
        self.channel = object()  # a virtual channel of its own
        self.ours, self.trucks, self.ear = (self.open() for _ in range(3))
        self.bridge = Bridge(self.vehicle, self.ours, **options)
        self.truck = EcuEmulator(self.vehicle, self.trucks, speed=speed, grade=lambda distance: grade)
        self.now = 0.0
        self.signals = {}
        self.heard = []

    def open(self):
        return can.Bus(interface="virtual", channel=self.channel)

    def close(self):
        for bus in (self.ours, self.trucks, self.ear):
            bus.shutdown()

    def run(self, seconds, engine=None, brake=0.0):
        for _ in range(round(seconds / STEP)):
            self.now += STEP
            self.truck.step(self.now)
            if engine is not None and round(self.now / STEP) % 4 == 0:
                self.bridge.command(engine, brake, self.now, engaged=self.bridge.engaged)
            self.signals = self.bridge.poll(self.now)
            while (message := self.ear.recv(0)) is not None:
                self.heard.append((self.now, message))
        return self

    def engage(self, engine, brake=0.0):
        self.bridge.arm(self.now)
        self.run(1.0, engine, brake)
        assert self.bridge.engage(self.now, person=True, lead_vehicle=True) == ()
        return self

    def ours_on_the_bus(self):
        return [(t, m) for t, m in self.heard if m.arbitration_id & 0xFF == self.vehicle.address]

    def demands(self, axis):
        message = self.vehicle.transmitted[axis]
        return [
            (t, message.layout.decode(bytes(m.data)).values[message.demand])
            for t, m in self.ours_on_the_bus()
            if m.arbitration_id == message.axis.can_id
        ]


@pytest.fixture
def world(request):
    made = []

    def make(name, **options):
        made.append(World(name, **options))
        return made[-1]

    yield make
    for one in made:
        one.close()


@pytest.fixture(params=[*vehicles.NAMES, SIGNED], ids=[*vehicles.NAMES, "signed_truck"])
def name(request):
    return request.param


def in_units(name, percent):
    return percent * (19.5 if vehicles.load(name).interface["engine_unit"] == "N m" else 1.0)


def braking(name, deceleration):
    return deceleration * (1.0 if vehicles.load(name).interface["brake_unit"] == "m/s^2" else 12.0)


def test_silent_until_armed_then_only_the_claim(world, name):
    w = world(name).run(1.0, engine=in_units(name, 30))
    assert w.ours_on_the_bus() == []
    w.bridge.arm(w.now)
    w.run(1.0, engine=in_units(name, 30))
    assert {m.arbitration_id for _, m in w.ours_on_the_bus()} == {0x18EEFF00 | w.vehicle.address}
    assert w.bridge.status.state == "standby"
    assert w.bridge.status.address_claimed


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
    w.heard.clear()
    w.run(1.0, engine=in_units(name, 50))
    told = next(t for t, m in w.heard if pressed(w, m))
    demands = w.demands("engine")
    assert all(math.isnan(d) for t, d in demands if t > told)
    release = [t for t, d in demands if t >= told]
    assert len(release) == 4
    assert release[0] - told <= 0.020 + 1e-9
    assert w.bridge.status.warning.startswith("Take over")
    assert w.truck.command[0] == 0.0


def pressed(w, message):
    if message.arbitration_id & 0x03FFFFFF not in (0xFEF100, 0xF0010B):  # CCVS1, EBC1
        return False
    decoded = w.vehicle.codec.decode(message.arbitration_id, bytes(message.data))
    return decoded.values.get("BrakePedalPosition", 0.0) > 3 or decoded.values.get("BrakeSwitch", 0.0) == 1


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


def test_an_address_lost_is_silence_and_stays_so(world):
    w = world("trucksim").engage(500.0)
    w.run(1.0, engine=500.0)
    w.ear.send(can.Message(arbitration_id=0x18EEFF2A, data=j1939_name(0)))
    w.heard.clear()
    w.run(2.0, engine=500.0)
    assert [m.arbitration_id for _, m in w.heard if m.arbitration_id & 0xFF == 0xFE] == [0x18EEFFFE]
    assert w.ours_on_the_bus() == []
    assert w.bridge.status.losses == {"link lost": 1}
    assert "no bus or no address" in w.bridge.engage(w.now, person=True, lead_vehicle=True)


def test_a_signed_message_bent_on_its_way_is_refused_whatever_the_bit(world):
    w = world(SIGNED).engage(500.0)
    w.run(2.0, engine=500.0)
    said = [bytes(m.data) for _, m in w.heard if m.arbitration_id & 0x03FFFFFF == 0xFEBF0B]
    assert [data[7] & 15 for data in said] == [k % 16 for k in range(len(said))]
    assert w.bridge.status.refusals == {}
    bent = int.from_bytes(said[-1], "little")
    for bit in range(64):
        data = (bent ^ 1 << bit).to_bytes(8, "little")
        w.bridge.safety.rx_hook(0x18FEBF0B, data, w.now)
    assert w.bridge.status.refusals["EBC2 checksum"] == 64


def test_two_controllers_that_send_the_same_message_do_not_silence_each_other(world):
    w = world(RESEARCH).run(0.5)
    ccvs1 = {m.arbitration_id & 0xFF for _, m in w.heard if m.arbitration_id & 0x03FFFF00 == 0xFEF100}
    assert ccvs1 == {0x00, 0x31}
    silent_on_speed = w.vehicle.codec["CCVS1"].encode({"BrakeSwitch": 0.0})
    w.trucks.send(can.Message(arbitration_id=0x18FEF131, data=silent_on_speed))
    w.signals = w.bridge.poll(w.now)
    assert w.signals["speed"] == pytest.approx(15.0, abs=0.5)
    w.trucks.send(can.Message(arbitration_id=0x18FEF100, data=silent_on_speed))
    assert math.isnan(w.bridge.poll(w.now)["speed"])


def test_the_emulator_says_what_it_cannot_speak(tmp_path):
    text = Path(SIGNED).read_text().replace("receive:", "receive:\n  " + POSITION)
    path = tmp_path / "mine.yaml"
    path.write_text(text.replace("signed_truck.dbc", str(Path(SIGNED).with_suffix(".dbc"))))
    with pytest.raises(InputError, match="does not speak VP"):
        EcuEmulator(vehicles.load(path), None)


@pytest.mark.parametrize("jump", [-30.0, -0.05])
def test_a_clock_that_goes_back_is_answered_with_release_frames_in_time(world, name, jump):
    w = world(name).engage(in_units(name, 50))
    w.run(2.0, engine=in_units(name, 50))
    w.heard.clear()
    since, true = w.now, w.bridge.poll
    w.bridge.poll = lambda now: true(now + jump)
    w.run(0.5)
    assert [at - since <= 0.09 for at, d in w.demands("engine") if math.isnan(d)] == [True] * 4
    assert not [d for _, d in w.demands("engine") if not math.isnan(d)]
    assert w.bridge.status.losses == {"clock went back": 1}
    assert w.bridge.status.address_claimed
    assert w.signals["speed"] == pytest.approx(w.truck.speed, abs=0.5)  # heard anew


def test_no_signal_survives_a_clock_that_goes_back(world):
    w = world("trucksim").run(1.0)
    assert w.signals["speed"] == pytest.approx(15.0, abs=0.5)
    assert w.bridge.poll(w.now - 30.0) == {}


def test_a_lost_bus_is_reopened_silently(world):
    w = world("trucksim")
    spare = w.open()
    w.bridge._link.reopen = lambda: spare
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

    w.bridge._link.reopen = reopen
    w.engage(500.0)
    w.ours.shutdown()
    w.run(4.5, engine=500.0)
    assert len(tries) == 4
    assert not w.bridge.status.address_claimed


def test_the_closed_loop_is_that_of_the_truck_itself(world, name):
    """The same speed controller against the physics truck directly and through bridge and emulator."""

    def control(speed, target, integral):
        error = target - speed
        integral = min(max(integral + 0.1 * error, -20.0), 40.0)
        wanted = 12.0 * error + 1.5 * integral
        return max(wanted, 0.0), max(-wanted, 0.0), integral

    def command(wanted, braked):
        return in_units(name, min(wanted, 100.0)), braking(name, min(0.08 * braked, 3.0))

    targets = [15.0 + 2.0 * math.sin(0.15 * k / 10) for k in range(400)]
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


def test_real_processes_drive_and_the_driver_takes_over():
    """Emulator in a process of its own, the bridge's thread here, a third bus as witness; in real time."""
    channel = f"{os.getpid()}-real"
    command = [sys.executable, "-m", "truck_bridge.ecu_emulator", "--vehicle", "volvo", "--channel", channel]
    command += ["--speed", "15", "--driver", "3:brake_pedal=40", "--duration", "60"]
    vehicle = vehicles.load("volvo")
    witness, ours = (can.Bus(interface="loopback", channel=channel) for _ in range(2))
    bridge, stop, signals = Bridge(vehicle, ours), threading.Event(), {}
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as process:
        thread = threading.Thread(target=bridge.run, args=(stop, lambda s, now: signals.update(s)))
        try:
            assert witness.recv(60) is not None  # the truck speaks
            bridge.arm(time.monotonic())
            thread.start()
            engaged = driven = False
            deadline = time.monotonic() + 30
            while time.monotonic() < deadline and not driven:
                now = time.monotonic()
                bridge.command(40.0, 0.0, now, engaged=bridge.engaged)
                engaged = engaged or bridge.engage(now, person=True, lead_vehicle=True) == ()
                driven = engaged and "driver" in bridge.status.reason
                time.sleep(0.02)
        finally:
            stop.set()
            thread.join(10)
            process.terminate()
            assert process.wait(10) == 0, process.stderr.read()
    assert driven
    assert signals["speed"] > 1.0
    frames = []
    while (message := witness.recv(0)) is not None:
        frames.append(message)
    engine = [m for m in frames if m.arbitration_id == 0x0C00002A]
    assert [m.data[0] & 3 for m in engine][-4:] == [0] * 4
    assert any(m.data[0] & 3 == 2 for m in engine)
    assert not thread.is_alive()
    for bus in (witness, ours):
        bus.shutdown()


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--vehicle", "tram"], "no vehicle 'tram'"),
        (["--vehicle", "volvo", "--grade", "hill.csv"], "No such file"),
        (["--vehicle", "volvo", "--driver", "soon"], "SECONDS:KEY=VALUE"),
        ([], "the following arguments are required: --vehicle"),
        (["--vehicle", "volvo", "--speed", "fast"], "invalid float value: 'fast'"),
        (["--vehicle", "volvo", "--speed", "nan"], "--speed must be a number from 0 to 50"),
        (["--vehicle", "volvo", "--speed", "-3"], "--speed must be a number from 0 to 50"),
        (["--vehicle", "volvo", "--grade", "nan"], "--grade nan must be a number from -0.5 to 0.5"),
        (["--vehicle", "volvo", "--duration", "-1"], "--duration must be a number from 0"),
        (["--vehicle", "volvo", "--truck", "truck:bus"], "bus"),
        (["--vehicle", "volvo", "--interface", "socketcan", "--channel", "none9"], "cannot open CAN"),
    ],
)
def test_the_emulator_refuses_bad_input_in_one_line(arguments, says, monkeypatch, capsys):
    from truck_bridge import emulator_cli

    monkeypatch.setattr(sys, "argv", ["ecu_emulator", *arguments])
    with pytest.raises(SystemExit) as done:
        emulator_cli.main()
    assert done.value.code == 2
    err = capsys.readouterr().err
    assert says in err
    assert err.count("\n") == 1
