from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from foreign_bags import (
    ROS1,
    TYPES,
    Message,
    S,
    bag_of,
    drive_messages,
    mcap_of,
    number,
    ros1_of,
    stamped,
    twist,
)
from mcap.writer import CompressionType, IndexType
from rosbags.rosbag2 import CompressionMode, StoragePlugin

from deeptruck_core.signals import TruckInterface
from deeptruck_model.recordings import Recording, read, write_bag


def check(recordings: list[Recording], count: int = 300) -> None:
    (recording,) = recordings
    np.testing.assert_array_equal(recording.channels["speed"], 0.1 * np.arange(count))


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"storage": StoragePlugin.SQLITE3},
        {"storage": StoragePlugin.SQLITE3, "compression": CompressionMode.MESSAGE},
        {"compression": CompressionMode.MESSAGE},
        {"compression": CompressionMode.FILE},
        {"compression": CompressionMode.STORAGE},
    ],
    ids=lambda o: "-".join(str(v).rpartition(".")[2] for v in o.values()) or "MCAP",
)
def test_bags_as_others_write_them(tmp_path: Path, options: dict[str, Any]) -> None:
    check(read(bag_of(tmp_path / "bag", drive_messages(), **options)))


@pytest.mark.parametrize(
    "options",
    [
        {"compression": CompressionType.LZ4},
        {"compression": CompressionType.ZSTD, "chunk_size": 1000},
        {"use_chunking": False},
        {"index_types": IndexType.CHUNK},
        {"use_statistics": False, "repeat_channels": True},
    ],
    ids=str,
)
def test_mcap_files_of_every_kind(tmp_path: Path, options: dict[str, Any]) -> None:
    check(read(mcap_of(tmp_path / "drive.mcap", drive_messages(), **options)))


def test_a_folder_called_as_a_ros1_bag(tmp_path: Path) -> None:
    interface = TruckInterface("mine", "N m", "percent")
    drive = Recording("a", 0.1, {"speed": 0.1 * np.arange(300)}, interface)
    check(read(write_bag(tmp_path / "drive.bag", [drive], interface=interface)))


def test_a_ros1_bag(tmp_path: Path) -> None:
    times = [S + k * S // 10 for k in range(300)]
    messages = [("/speed", twist(0.1 * k, ns, ROS1, seq=k), ns) for k, ns in enumerate(times)]
    ros1_of(tmp_path / "drive.bag", messages)
    check(read(tmp_path / "drive.bag", topic_map={"speed": {"topic": "/speed", "field": "twist.linear.x"}}))


def test_users_topics(tmp_path: Path) -> None:
    """Other names and units, a message without a header, a vector by index; from a YAML file."""
    messages: list[Message] = []
    for k in range(300):
        ns = S + k * S // 10
        array = TYPES.types["std_msgs/msg/Float64MultiArray"](
            TYPES.types["std_msgs/msg/MultiArrayLayout"]([], 0), np.array([5.0, 2.0, 0.5 * k])
        )
        messages += [("/v", twist(0.36 * k, ns), ns), ("/pedal", number(0.001 * k), ns), ("/can", array, ns)]
    bag = bag_of(tmp_path / "bag", messages)
    topics = tmp_path / "topics.yaml"
    topics.write_text(
        "speed: {topic: /v, field: twist.linear.x, unit: km/h}\n"
        "engine_command: {topic: /pedal, field: data, unit: ratio}\n"
        "ambient_temperature: {topic: /can, field: 'data[1]', scale: 2, offset: 1}\n"
    )
    (recording,) = read(bag, topic_map=topics)
    k = np.arange(300)
    np.testing.assert_allclose(recording.channels["speed"], 0.1 * k)
    np.testing.assert_allclose(recording.channels["engine_command"], 0.1 * k)
    np.testing.assert_array_equal(recording.channels["ambient_temperature"], 5.0)
    expected = TruckInterface("bag", engine_unit="percent", brake_unit=None, grade=False, fuel=False)
    assert recording.interface == expected


def test_the_argument_and_the_map_overrule_the_bags_interface(
    tmp_path: Path, drive: Recording, interface: TruckInterface
) -> None:
    bag = write_bag(tmp_path / "bag", [drive], interface=interface)
    other = TruckInterface("mine", engine_unit="N m", brake_unit="percent")
    assert read(bag, interface=other)[0].interface == other
    topics = {
        "speed": {"topic": "/truck/twist", "field": "twist.linear.x"},
        "engine_command": {"topic": "/truck/command", "field": "position[name=engine_command]", "unit": "Nm"},
    }
    assert read(bag, topic_map=topics)[0].interface.engine_unit == "N m"


def test_stamps_count_not_the_time_of_arrival(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    late = [(t, m, ns + int(rng.uniform(0, 0.5) * S)) for t, m, ns in drive_messages()]
    (recording,) = read(bag_of(tmp_path / "bag", sorted(late, key=lambda m: m[2])))
    np.testing.assert_array_equal(recording.channels["speed"], 0.1 * np.arange(300))
    assert any("put back in order" in note for note in recording.notes)


def test_a_simulated_clock_may_start_at_zero(tmp_path: Path) -> None:
    wall = 1_700_000_000 * S
    messages = [("/truck/twist", twist(0.1 * k, k * S // 10), wall + k * S // 50) for k in range(300)]
    (recording,) = read(bag_of(tmp_path / "bag", messages))
    np.testing.assert_array_equal(recording.channels["speed"], 0.1 * np.arange(300))


def test_a_clock_that_was_never_set_is_replaced_by_log_time(tmp_path: Path) -> None:
    check(
        read(bag_of(tmp_path / "bag", [(t, twist(m.twist.linear.x, 0), ns) for t, m, ns in drive_messages()]))
    )


def test_a_stamp_that_comes_again_counts_once(tmp_path: Path) -> None:
    messages = drive_messages()
    (recording,) = read(bag_of(tmp_path / "bag", [*messages[:100], *messages[99:]]))
    assert len(recording) == 300
    assert any("repeated stamp" in note for note in recording.notes)


def test_no_target_is_invalid(tmp_path: Path) -> None:
    make = TYPES.types["sensor_msgs/msg/Range"]
    gaps = [np.inf if 100 <= k < 200 else 40.0 for k in range(300)]
    ranges = [
        ("/radar/range", make(stamped(ns), 1, 0.1, 0.0, 250.0, gaps[k], 0.0), ns)
        for k, (_, _, ns) in enumerate(drive_messages())
    ]
    (recording,) = read(bag_of(tmp_path / "bag", sorted([*drive_messages(), *ranges], key=lambda m: m[2])))
    np.testing.assert_array_equal(np.isnan(recording.channels["gap"]), np.isinf(gaps))


@pytest.mark.parametrize("storage", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
def test_a_topic_with_two_types_is_the_one_with_most_messages(tmp_path: Path, storage: StoragePlugin) -> None:
    text = [("/truck/twist", TYPES.types["std_msgs/msg/String"]("x"), k * S) for k in range(1, 31)]
    messages = sorted([*text, *drive_messages()], key=lambda m: m[2])
    check(read(bag_of(tmp_path / "bag", messages, storage=storage)))
