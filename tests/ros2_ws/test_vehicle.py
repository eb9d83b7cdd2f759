"""The controller that drives the simulator drives a bus: bridge, emulator, leader, recorder."""

from __future__ import annotations

import contextlib
import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import can
import numpy as np
import pytest
from rclpy.lifecycle import TransitionCallbackReturn
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from deeptruck_model import recordings
from deeptruck_nodes import can_bridge
from deeptruck_nodes.can_bridge import CanBridge
from truck_bridge.bus import open_bus

TSC1, ADDRESS_CLAIM = 0x0000, 0xEE00
BRIDGE = 0x2A
WHO_IS_THERE = can.Message(arbitration_id=0x18EAFFF9, data=[0x00, 0xEE, 0x00], is_extended_id=True)


def sent_by_bridge(bus: can.BusABC, seconds: float) -> list[int]:
    """PGNs of what the bridge sends in that time."""
    until, pgns = time.monotonic() + seconds, []
    while (left := until - time.monotonic()) > 0:
        frame = bus.recv(left)
        if frame is not None and frame.arbitration_id & 0xFF == BRIDGE:
            pgns.append(frame.arbitration_id >> 8 & 0x3FF00)
    return pgns


def test_closed_loop_over_can(start: Callable[..., Any], domain: int, tmp_path: Path) -> None:
    channel = f"test-{domain}"
    truck = ("--vehicle", "trucksim", "--emulator", "--engage", "--channel", channel)
    run = start("start_vehicle.py", *truck, "--policy", "baseline:acc", "--record", tmp_path / "bag")
    run.wait_until_ready()
    bus = open_bus("loopback", channel)
    try:
        engaged = time.monotonic() + 120.0  # a first start on a machine compiles the truck
        sent: list[int] = []
        while sent.count(TSC1) < 20 and time.monotonic() < engaged:
            sent += sent_by_bridge(bus, 0.5)
        assert sent.count(TSC1) >= 20
        time.sleep(5.0)  # something to record
        run.process.send_signal(signal.SIGINT)
        code, said, errors = run.finish()
        assert (code, errors) == (0, "")
        assert "can_bridge: engaged\n" in said  # to whoever sits before it
        assert re.search(r"can_bridge: in control [1-9]\d* s of \d+ s", said) and "lost: stopped" not in said
        while bus.recv(0.0) is not None:  # what was sent before it ended
            pass
        assert sent_by_bridge(bus, 0.3) == []
    finally:
        bus.shutdown()
    counted = diagnosed(tmp_path / "bag")
    assert int(counted["refused: engagement"]) > 0  # asked before anything of the truck was received
    pieces = recordings.read(tmp_path / "bag")
    speed = pieces[0].channels["speed"]
    assert pieces[0].interface.name == "trucksim" and np.nanmax(np.abs(speed - 20)) < 2


def diagnosed(bag: Path) -> dict[str, str]:
    """What the bridge published last in /diagnostics."""
    last: dict[str, str] = {}
    with AnyReader([bag], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
        chosen = [connection for connection in reader.connections if connection.topic == "/diagnostics"]
        for connection, _, data in reader.messages(chosen):
            for status in reader.deserialize(data, connection.msgtype).status:  # type: ignore[attr-defined]
                if status.hardware_id == "can_bridge":
                    last = {value.key: value.value for value in status.values}
    return last


def torque_demands(bus: can.BusABC, seconds: float) -> list[bool]:
    """TSC1 frames of the bridge to the engine in that time: whether they demand anything."""
    until, found = time.monotonic() + seconds, []
    while (left := until - time.monotonic()) > 0:
        frame = bus.recv(left)
        if frame is not None and frame.arbitration_id == 0x0C000000 | BRIDGE:
            found.append(frame.data[0] & 3 != 0)
    return found


def test_a_controller_that_never_hears_that_it_drives_drives_no_further(domain: int, tmp_path: Path) -> None:
    channel = f"test-{domain}"
    environment = {**os.environ, "ROS_DOMAIN_ID": str(domain), "ROS_LOG_DIR": str(tmp_path)}
    ros = ["--ros-args", "-p", f"channel:={channel}", "-p", "engage:=true"]
    truck = ["-m", "truck_bridge.emulator", "--vehicle", "trucksim", "--speed", "20", "--channel", channel]
    deaf = str(Path(__file__).with_name("deaf_controller.py"))
    bus = open_bus("loopback", channel)
    processes = []
    try:
        for argv in (truck, ["-m", "deeptruck_nodes.can_bridge", *ros], [deaf, "90"]):
            command = [sys.executable, *argv]
            processes.append(subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL))
        latest = time.monotonic() + 120.0  # a first start on a machine compiles the truck
        driven: list[bool] = []
        while not (any(driven) and driven[-4:] == [False] * 4) and time.monotonic() < latest:
            driven += torque_demands(bus, 0.5)
        driven += torque_demands(bus, 3.0)
    finally:
        for process in processes:
            process.terminate()  # killed, it would leave its shared memory behind
        for process in processes:
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(60)
            process.kill()
            process.wait()
        bus.shutdown()
    assert 0 < sum(driven) < 75  # 0.15 s and the fade are 1.5 s at most, of a frame each 20 ms
    assert driven[-4:] == [False] * 4


def test_the_bridge_is_silent_until_a_person_engages(domain: int, tmp_path: Path) -> None:
    channel = f"test-{domain}"
    argv = [sys.executable, "-m", "deeptruck_nodes.can_bridge", "--ros-args", "-p", f"channel:={channel}"]
    environment = {**os.environ, "ROS_DOMAIN_ID": str(domain), "ROS_LOG_DIR": str(tmp_path)}
    bus = open_bus("loopback", channel)
    process = subprocess.Popen(argv, env=environment, stderr=subprocess.PIPE, text=True)
    try:
        received, until = [], time.monotonic() + 120.0  # a first start on a machine takes its time
        while ADDRESS_CLAIM not in received and time.monotonic() < until:
            received += sent_by_bridge(bus, 0.5)
        received += sent_by_bridge(bus, 2.0)
        assert set(received) == {ADDRESS_CLAIM}
        bus.send(WHO_IS_THERE)
        answered, until = [], time.monotonic() + 60.0
        while not answered and time.monotonic() < until:
            answered = sent_by_bridge(bus, 0.5)
        assert answered == [ADDRESS_CLAIM]  # active, it answers
        script = Path(__file__).with_name("deactivate_bridge.py")
        subprocess.run([sys.executable, script], env=environment, timeout=120, check=True)
        bus.send(WHO_IS_THERE)
        assert sent_by_bridge(bus, 0.5) == [] and process.poll() is None
        process.send_signal(signal.SIGTERM)
        assert process.wait(60) == 0
    finally:
        process.kill()
        process.communicate()
        bus.shutdown()


def test_a_bridge_that_brakes_for_long_stays_active_until_the_truck_stands(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(can_bridge, "ENDS_WITHIN", 0.01)
    stands = threading.Event()
    brakes = threading.Thread(target=stands.wait, daemon=True)
    brakes.start()
    bridge = SimpleNamespace(_stop=threading.Event(), _thread=brakes)
    assert CanBridge.on_deactivate(bridge, None) is TransitionCallbackReturn.FAILURE
    assert bridge._thread is brakes and "stays active" in capsys.readouterr().out
    stands.set()
    brakes.join()
    assert CanBridge.on_deactivate(bridge, None) is TransitionCallbackReturn.SUCCESS
    assert bridge._thread is None
