"""The ECU emulator as a process of its own, and what it refuses."""

from __future__ import annotations

import math
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import can
import numpy as np
import pytest
from bridge_world import SIGNED, World

from deeptruck_model import simulators
from truck_bridge import vehicles
from truck_bridge.bridge import Bridge
from truck_bridge.emulator.ecus import EcuEmulator
from truck_bridge.emulator.receiver import Actuator, Receiver
from truck_bridge.errors import InputError

POSITION = "VP: {from: engine, period: 5.0, timeout: 20.0, signals: {latitude: Latitude}}"


def test_the_emulator_says_what_it_cannot_speak(tmp_path):
    text = Path(SIGNED).read_text().replace("receive:", "receive:\n  " + POSITION)
    path = tmp_path / "mine.yaml"
    path.write_text(text.replace("signed_truck.dbc", str(Path(SIGNED).with_suffix(".dbc"))))
    with pytest.raises(InputError, match="does not speak VP"):
        EcuEmulator(vehicles.load(path), None)


@pytest.mark.parametrize(
    ("fault", "least", "most"),
    [({}, 2.0, 3.5), ({"gain": 0.0}, 0.0, 0.6), ({"gain": 0.5}, 0.9, 1.9), ({"lost": 1.0}, 0.0, 0.6)],
)
def test_a_brake_decelerates_by_what_its_actuator_gives(fault, least, most):
    world = World("volvo").engage(0.0)
    for key, value in fault.items():
        setattr(world.truck.actuators["brake"], key, value)
    before = world.run(1.0, 0.0, 2.5).truck.speed
    after = world.run(1.0, 0.0, 2.5).truck.speed
    world.close()
    assert least < before - after < most
    assert math.isnan(world.truck.demand("brake")) == ("lost" in fault)


def test_an_emulator_ends_in_order_when_its_terminal_is_closed():
    channel = f"{os.getpid()}-closed"
    command = [sys.executable, "-m", "truck_bridge.emulator", "--vehicle", "volvo", "--channel", channel]
    heeding = {"preexec_fn": lambda: signal.signal(signal.SIGHUP, signal.SIG_DFL)}  # as in no background job
    with (
        can.Bus(interface="loopback", channel=channel) as witness,
        subprocess.Popen(command, stdout=subprocess.DEVNULL, **heeding) as process,
    ):
        assert witness.recv(60) is not None
        process.send_signal(signal.SIGHUP)
        assert process.wait(60) == 0


def test_real_processes_drive_and_the_driver_takes_over():
    """Emulator in a process of its own, the bridge's thread here, a third bus as witness; in real time."""
    channel = f"{os.getpid()}-real"
    command = [sys.executable, "-m", "truck_bridge.emulator", "--vehicle", "volvo", "--channel", channel]
    command += ["--speed", "15", "--driver", "engaged+1:brake_pedal=40"]
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
            deadline = time.monotonic() + 120  # for a failure alone: the driver acts after engagement
            while time.monotonic() < deadline and not driven:
                now = time.monotonic()
                bridge.command(40.0, 0.0, now, engaged=bridge.engaged)
                engaged = engaged or bridge.engage(now, person=True, lead_vehicle=True) == ()
                driven = engaged and "driver" in bridge.status.reason
                time.sleep(0.02)
        finally:
            stop.set()
            thread.join(60)
            process.terminate()
            assert process.wait(60) == 0, process.stderr.read()
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
        (["--vehicle", "volvo", "--driver", "soon"], "SECONDS:KEY=VALUE"),
        (["--vehicle", "volvo", "--driver", "5:brake_pedal=400"], "values 0 to 100"),
        (["--vehicle", "volvo", "--driver", "1:horn=1"], "keys are brake_pedal, accelerator, cancel"),
        ([], "Missing option '--vehicle'"),
        (["--vehicle", "volvo", "--speed", "fast"], "'--speed': Input should be a valid number"),
        (["--vehicle", "volvo", "--interface", "socketcan", "--channel", "none9"], "cannot open CAN"),
    ],
)
def test_the_emulator_refuses_bad_input_in_one_line(arguments, says, monkeypatch, capsys):
    from truck_bridge.emulator import cli

    monkeypatch.setattr(sys, "argv", ["emulator", *arguments])
    with pytest.raises(SystemExit) as done:
        cli.main()
    assert done.value.code == 2
    err = capsys.readouterr().err
    assert says in err
    assert err.count("\n") == 1


# The emulated controllers stand around a simulator that tells no wheels and no gears


def test_the_emulator_drives_it_and_what_it_does_not_tell_is_not_available(shuttle: Path) -> None:
    truck = simulators.load(f"python:{shuttle.stem}:make")
    with (
        can.Bus(interface="virtual", channel=shuttle.stem) as bus,
        can.Bus(interface="virtual", channel=shuttle.stem) as other,
    ):
        emulator = EcuEmulator(vehicles.load("trucksim"), bus, truck=truck, speed=15.0)
        emulator.driver.accelerator = 50.0
        for now in np.arange(0.0, 1.0, 0.01):
            emulator.step(float(now))
        assert 14.5 < emulator.speed != 15.0 and math.isnan(emulator.parameters["wheel_radius"])
        assert emulator.parameters["mass"] == 20000.0
        assert other.recv(0) is not None


# A controller's side of TSC1: hysteresis, priority, time-out, stuck senders


ENGINE = vehicles.load("trucksim").transmitted["engine"]
ID = ENGINE.axis.can_id


@pytest.fixture
def receiver():
    return Receiver(ENGINE)


def bad(frame):
    return frame[:7] + bytes([frame[7] ^ 0x10])


def test_a_demand_holds_for_its_time_out_and_then_returns_without_a_step(receiver):
    receiver.hear(ID ^ 0x0F00, ENGINE.frame(60.0, 0), 1.0)  # for another node
    assert math.isnan(receiver.demand(1.0)) and receiver.controlling == 0xFF
    receiver.hear(ID, ENGINE.frame(60.0, 0), 1.0)
    assert receiver.demand(1.0) == 60.0
    assert receiver.controlling == ID & 0xFF
    assert receiver.demand(1.09) == 60.0
    falling = [receiver.demand(1.19 + 0.1 * k) for k in range(4)]
    assert falling[:2] == pytest.approx([40.0, 20.0])
    assert math.isnan(falling[-1])
    assert receiver.controlling == 0xFF


def test_a_wrong_checksum_and_a_stuck_counter_are_not_obeyed(receiver):
    receiver.hear(ID, bad(ENGINE.frame(60.0, 0)), 1.0)
    assert math.isnan(receiver.demand(1.0))
    receiver.hear(ID, ENGINE.frame(60.0, 1), 1.02)
    receiver.hear(ID, ENGINE.frame(90.0, 1), 1.04)
    assert receiver.demand(1.04) == 60.0


def test_the_higher_priority_wins_and_then_the_later(receiver):
    strong = dict(ENGINE.active, OverrideControlModePriority=0, RequestedTorque=10.0)
    from truck_bridge.j1939 import checksums

    other = ID & ~0xFF | 0x03
    receiver.hear(other, checksums.sign("tsc1", other, ENGINE.layout.encode(strong), 0), 1.0)
    receiver.hear(ID, ENGINE.frame(60.0, 0), 1.01)
    assert receiver.demand(1.01) == 10.0
    assert receiver.controlling == 0x03


@pytest.mark.parametrize(
    ("full", "fault", "demands", "given"),
    [
        (90.0, {}, [10.0, 20.0, math.nan], [10.0, 20.0, 0.0]),
        (90.0, {"gain": 0.5}, [10.0, 20.0], [5.0, 10.0]),
        (-5.0, {"gain": 0.0}, [-2.0, math.nan], [0.0, 0.0]),
        (90.0, {"late_s": 0.2}, [1.0, 2.0, 3.0, 4.0, 5.0], [1.0, 1.0, 1.0, 2.0, 3.0]),
        (90.0, {"drags": 0.3}, [0.0, 20.0, 40.0], [27.0, 27.0, 40.0]),
        (-90.0, {"drags": 0.3}, [0.0, -20.0, -40.0], [-27.0, -27.0, -40.0]),
    ],
)
def test_what_an_actuator_gives_at_each_step_of_0_1_s(full, fault, demands, given):
    actuator, found = Actuator(full, **fault), []
    for step, demand in enumerate(demands):
        actuator.act(demand, 0.1 * step)
        found.append(actuator.given)
    assert found == pytest.approx(given)
    actuator.stuck = 1.0
    actuator.act(80.0, 9.0)
    assert actuator.given == found[-1]


def test_mode_0_hands_back_at_once(receiver):
    receiver.hear(ID, ENGINE.frame(60.0, 0), 1.0)
    receiver.demand(1.0)
    receiver.hear(ID, ENGINE.frame(math.nan, 1), 1.02)
    assert math.isnan(receiver.demand(1.02))
