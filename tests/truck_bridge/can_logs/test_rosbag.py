"""Raw frames in a rosbag: written and read back, by others' readers too, and what a kill leaves."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time

import can
import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.rosbag2 import StoragePlugin, Writer

from truck_bridge import can_logs
from truck_bridge.can_logs import rosbag
from truck_bridge.errors import InputError

FRAME = bytes.fromhex("219B9BDD2F000F9B")
EEC1 = 0x0CF00400


@pytest.fixture
def log(tmp_path):
    path = tmp_path / "drive.log"
    lines = [f"({1.6e9 + k / 100:.6f}) can0 0CF00400#219B9BDD2F000F{k:02X}\n" for k in range(100)]
    path.write_text("".join(lines))
    return path


def test_a_reader_that_knows_nothing_of_us_reads_it(log, tmp_path):
    bag = tmp_path / "drive.mcap"
    can_logs.convert(log, bag)
    with bag.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        found = [message for *_, message in reader.iter_decoded_messages()]
    assert [message.id for message in found] == [EEC1] * 100
    assert bytes(found[7].data) == FRAME[:7] + b"\x07"
    assert found[7].header.stamp.nanosec == pytest.approx(70_000_000, abs=1000)


def bag_of(path, topic, type_name, messages, store):
    with Writer(path, version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        connection = writer.add_connection(topic, type_name, typestore=store)
        for stamp, message in messages:
            writer.write(connection, stamp, store.serialize_cdr(message, type_name))


def frame_message(store, stamp, **fields):
    types = store.types
    time_, header = types["builtin_interfaces/msg/Time"], types["std_msgs/msg/Header"]
    whole = {"id": EEC1, "is_rtr": False, "is_extended": True, "is_error": False, "dlc": 8, **fields}
    data = np.frombuffer(FRAME, dtype=np.uint8)
    return types[rosbag.TYPE](
        header=header(stamp=time_(sec=stamp, nanosec=0), frame_id=""), data=data, **whole
    )


def test_a_folder_of_another_recorder_is_read_on_any_topic(tmp_path):
    store = rosbag._types()
    several = [
        (5 * 10**9, frame_message(store, 0)),  # not stamped: when the recorder had it
        (7 * 10**9, frame_message(store, 6)),
        (8 * 10**9, frame_message(store, 8, is_extended=False, id=0x123)),
        (8 * 10**9, frame_message(store, 8, is_rtr=True)),
        (8 * 10**9, frame_message(store, 8, is_error=True)),
    ]
    bag_of(tmp_path / "bag", "/can0/frames", rosbag.TYPE, several, store)
    frames = list(can_logs.read(tmp_path / "bag"))
    assert [(frame.time, frame.can_id, frame.data) for frame in frames] == [
        (5.0, EEC1, FRAME),
        (6.0, EEC1, FRAME),
    ]


def test_a_bag_without_raw_frames_says_what_it_holds(tmp_path):
    store = rosbag._types()
    clock = store.types["std_msgs/msg/Bool"](data=True)
    bag_of(tmp_path / "bag", "/on", "std_msgs/msg/Bool", [(1, clock)], store)
    with pytest.raises(InputError, match=r"holds no can_msgs/msg/Frame.*std_msgs/msg/Bool"):
        list(can_logs.read(tmp_path / "bag"))


@pytest.mark.parametrize(
    ("name", "content", "says"),
    [
        ("a.mcap", b"", "was not finished, and holds no topic"),
        ("a.mcap", b"\x89MCAP0\r\n", "was not finished, and holds no topic"),
        ("a.mcap", b"rubbish" * 100, "cannot be read|not finished"),
        ("a.db3", b"rubbish" * 100, "cannot be read"),
        ("a.bag", b"rubbish" * 100, "cannot be read"),
    ],
)
def test_damage_is_one_line(tmp_path, name, content, says):
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(InputError, match=says) as error:
        list(can_logs.read(path))
    assert "\n" not in str(error.value)


def test_a_folder_that_is_no_bag_is_one_line(tmp_path):
    with pytest.raises(InputError, match=r"a folder without a rosbag"):
        list(can_logs.read(tmp_path))


@pytest.mark.parametrize("name", ["drive.mcap", "drive.log", "drive.asc"])
def test_a_recorder_that_was_killed_leaves_what_it_had(tmp_path, name):
    path, channel = tmp_path / name, f"{os.getpid()}-killed"
    argv = [sys.executable, "-c", "from truck_bridge.cli import main; main()", "record", str(path)]
    process = subprocess.Popen([*argv, "--interface", "loopback", "--channel", channel])
    sent = 0
    with can.Bus(interface="loopback", channel=channel) as bus:
        deadline = time.monotonic() + 120
        while (sent < 300 or not path.exists()) and time.monotonic() < deadline:
            bus.send(can.Message(arbitration_id=EEC1, data=FRAME, is_extended_id=True))
            time.sleep(0.005)
            sent += path.exists()
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    frames = list(can_logs.read(path))
    assert sent - 1.0 / 0.005 < len(frames) <= sent + 1
    assert {frame.data for frame in frames} == {FRAME}
