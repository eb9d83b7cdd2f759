"""Bags as recorders leave them: odd metadata, definitions that nobody can read, journals, holes, no end."""

from __future__ import annotations

import shutil
import sqlite3
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from foreign_bags import ROS1, TWIST, TYPES, S, bag_of, drive_messages, mcap_of, number, ros1_of
from rosbags.rosbag2 import StoragePlugin

from deeptruck_core.errors import InputError
from deeptruck_model.recordings import import_table, read, suggest

TOPICS = {"speed": {"topic": "/truck/twist", "field": "twist.linear.x"}}


def check(bag: Path, **options: Any) -> None:
    (recording,) = read(bag, topic_map=TOPICS, **options)
    np.testing.assert_allclose(recording.channels["speed"], 0.1 * np.arange(300))
    assert recording.account is not None and recording.account.balanced


OF_ROS1 = [("/speed", number(0.1 * k, ROS1), S + k * S // 10) for k in range(300)]
UNREADABLE = {
    "service event": (
        "my/srv/Arm_Event",
        "ros2msg",
        "=" * 80 + "\nSRV: my/srv/Arm\nint64 a\n---\nint64 sum\n",
    ),
    "json": ("chat", "jsonschema", "{}"),
    "protobuf": ("foxglove.Log", "protobuf", "\n"),
    "idl union": ("my/msg/U", "ros2idl", "module my { module msg { union U switch(long) {}; }; };"),
    "nested type that is missing": ("my/msg/Outer", "ros2msg", "my/Inner inner\n"),
    "no schema": ("", "", ""),
    "binary": ("my/msg/B", "ros2msg", "\0\1\2"),
}


@pytest.mark.parametrize("kind", UNREADABLE)
@pytest.mark.parametrize("chunked", [True, False])
def test_a_definition_that_nobody_can_read_concerns_its_topic_alone(
    tmp_path: Path, kind: str, chunked: bool
) -> None:
    file = mcap_of(tmp_path / "bag.mcap", drive_messages(), UNREADABLE[kind], use_chunking=chunked)
    check(file)
    account = read(file, topic_map=TOPICS)[0].account
    assert account is not None and any("cannot be read on /odd" in line for line in account.remarks)
    assert next(topic for topic in suggest(file).survey.topics if topic.name == "/odd").why
    with pytest.raises(InputError, match=r"/odd .*mapped for 'grade', cannot be read.*--msg") as refused:
        read(file, topic_map={**TOPICS, "grade": {"topic": "/odd", "field": "data"}})
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(("names", "says"), [(("drive_0", "drive_1"), ""), (("a", "b"), "holds 2 bags")])
def test_parts_of_a_split_recording_are_read_without_metadata(
    tmp_path: Path, names: tuple[str, str], says: str
) -> None:
    """Files NAME_0, NAME_1 are one recording; of others each is a bag."""
    messages = list(drive_messages())
    half = len(messages) // 2
    for name, part in zip(names, (messages[:half], messages[half:]), strict=True):
        mcap_of(tmp_path / f"{name}.mcap", part)
    if says:
        with pytest.raises(InputError, match=says):
            read(tmp_path, topic_map=TOPICS)
    else:
        (recording,) = read(tmp_path, topic_map=TOPICS)
        assert len(recording) * recording.dt > 0.9 * (messages[-1][2] - messages[0][2]) / S


def _below(bag: Path, information: dict[str, Any]) -> None:
    (bag / "part").mkdir()
    for name in information["relative_file_paths"]:
        shutil.move(bag / name, bag / "part" / name)
    _behind("part")(bag, information)


def _behind(folder: str) -> Callable[[Path, dict[str, Any]], None]:
    """Each file stands below a folder, `{}` being that of the bag."""

    def change(bag: Path, information: dict[str, Any]) -> None:
        names = information["relative_file_paths"]
        information["relative_file_paths"] = [f"{folder.format(bag.name)}/{name}" for name in names]

    return change


NONE = {"compression_mode": None, "compression_format": None, "custom_data": None}
CHANGES: dict[str, Callable[[Path, dict[str, Any]], object]] = {
    "below its folder": _behind("{}"),
    "absolute": _behind("/data"),
    "below another": _below,
    "no identifier": lambda _, information: information.update(storage_identifier=""),
    "another identifier": lambda _, information: information.update(storage_identifier="my_plugin"),
    "wrong counts": lambda _, i: i["topics_with_message_count"][0].update(message_count=7),
    "null": lambda _, information: information.update(NONE),
}


@pytest.mark.parametrize("storage", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
@pytest.mark.parametrize("change", CHANGES)
def test_metadata_as_recorders_write_them(tmp_path: Path, storage: StoragePlugin, change: str) -> None:
    bag = bag_of(tmp_path / "bag", drive_messages(), storage=storage)
    data = yaml.safe_load((bag / "metadata.yaml").read_text())
    CHANGES[change](bag, data["rosbag2_bagfile_information"])
    (bag / "metadata.yaml").write_text(yaml.safe_dump(data))
    check(bag)


def test_a_database_without_metadata(tmp_path: Path) -> None:
    bag = bag_of(tmp_path / "bag", drive_messages(), storage=StoragePlugin.SQLITE3)
    (bag / "metadata.yaml").unlink()
    check(bag)
    assert len(import_table(bag, TOPICS, tmp_path / "out").recordings[0]) == 300


def test_what_is_in_a_journal_counts(tmp_path: Path) -> None:
    """A recorder that was killed leaves its last messages in the -wal file; nothing is written there."""
    bag = bag_of(tmp_path / "bag", drive_messages()[:200], storage=StoragePlugin.SQLITE3)
    (file,) = bag.glob("*.db3")
    live = sqlite3.connect(file)
    live.execute("PRAGMA journal_mode=WAL")
    for _, message, ns in drive_messages()[200:]:
        row = (ns, bytes(TYPES.serialize_cdr(message, TWIST)))
        live.execute("INSERT INTO messages (topic_id, timestamp, data) VALUES(1, ?, ?)", row)
    live.commit()
    killed = Path(shutil.copytree(bag, tmp_path / "killed"))
    live.close()
    before = {one.name: one.read_bytes() for one in killed.iterdir()}
    assert any(name.endswith("-wal") for name in before)
    check(killed)
    assert {one.name: one.read_bytes() for one in killed.iterdir()} == before


@pytest.mark.parametrize("hole", [b"\0" * 49, b"\xff" * 100, b"\0" * 4096, b"\x07" * 3, b"op=\x05" * 9])
def test_unused_bytes_before_the_index_of_a_ros1_bag(tmp_path: Path, hole: bytes) -> None:
    file = ros1_of(tmp_path / "drive.bag", OF_ROS1)
    content = bytearray(file.read_bytes())
    field = content.index(b"index_pos=") + 10
    at = int.from_bytes(content[field : field + 8], "little")
    content[field : field + 8] = (at + len(hole)).to_bytes(8, "little")
    file.write_bytes(content[:at] + hole + content[at:])
    (recording,) = read(file, topic_map={"speed": {"topic": "/speed", "field": "data"}})
    np.testing.assert_allclose(recording.channels["speed"], 0.1 * np.arange(300))
    for says in (0, at, at + len(hole)):  # none was written, or the file ends before it
        content[field : field + 8] = says.to_bytes(8, "little")
        file.write_bytes(content[:at])
        with pytest.raises(InputError, match=r"no index.*'rosbag reindex'"):
            read(file, topic_map={"speed": {"topic": "/speed", "field": "data"}})


@pytest.mark.parametrize("broken", ["chunk", "index"])
def test_a_record_of_a_ros1_bag_that_is_longer_than_the_file_is_refused(tmp_path: Path, broken: str) -> None:
    """Both are found by the summary at the end alone, which is whole."""
    file = ros1_of(tmp_path / "drive.bag", OF_ROS1)
    content = bytearray(file.read_bytes())

    def behind(at: int) -> int:
        """Where a part of a record ends whose length stands here."""
        return at + 4 + int.from_bytes(content[at : at + 4], "little")

    start = len(b"#ROSBAG V2.0\n")
    chunk = behind(behind(start))
    length = behind(chunk) if broken == "chunk" else behind(behind(behind(chunk)))
    content[length : length + 4] = len(content).to_bytes(4, "little")
    file.write_bytes(content)
    with pytest.raises(InputError, match="the content of a record is longer than the file"):
        read(file, topic_map={"speed": {"topic": "/speed", "field": "data"}})


@pytest.mark.parametrize("kept", [{}, {"use_statistics": False}, {"repeat_schemas": False}])
def test_a_summary_that_does_not_repeat_its_channels(tmp_path: Path, kept: dict[str, Any]) -> None:
    check(mcap_of(tmp_path / "bag.mcap", drive_messages(), chunk_size=2048, repeat_channels=False, **kept))


def test_an_unfinished_bag_is_called_so_by_import_too(tmp_path: Path) -> None:
    bag = bag_of(tmp_path / "bag", drive_messages())
    (bag / "metadata.yaml").unlink()
    for act in (lambda: import_table(bag, TOPICS, tmp_path / "out"), lambda: read(bag, topic_map=TOPICS)):
        with pytest.raises(InputError, match=f"not a finished bag.*'deeptruck-model repair {bag}'"):
            act()
    (file,) = bag.glob("*.mcap")
    file.write_bytes(file.read_bytes()[:-60])
    with pytest.raises(InputError, match=f"its end is missing.*'deeptruck-model repair {file}'"):
        import_table(file, TOPICS, tmp_path / "out")


def a_database_without_definitions(folder: Path) -> Path:
    """As Humble writes it: the types are named, and nothing says what is in them."""
    bag = bag_of(
        folder / "bag",
        [("/report", number(0.1 * k), S + k * S // 10) for k in range(300)],
        storage=StoragePlugin.SQLITE3,
    )
    (file,) = bag.glob("*.db3")
    with sqlite3.connect(file) as database:
        database.execute("UPDATE topics SET type = 'my_msgs/msg/Report'")
        database.execute("DELETE FROM message_definitions")
    (bag / "metadata.yaml").write_text(
        (bag / "metadata.yaml").read_text().replace("std_msgs/msg/Float64", "my_msgs/msg/Report")
    )
    return bag


@pytest.mark.parametrize(
    "files",
    [
        {"Report.msg": "float64 speed\n"},
        {"my_msgs/msg/Report.msg": "# a comment\nfloat64 speed  # m/s\n"},
        {"Report.msg": "Inner inner\n", "Inner.msg": "float64 speed\n"},
        {"my_msgs/msg/Report.msg": "other_msgs/Inner inner\n", "other_msgs/msg/Inner.msg": "float64 speed\n"},
        {"Inner.msg": "float64 speed\n", "Report.msg": "Inner inner\n", "Unused.msg": "int8 x\n"},
    ],
)
def test_definitions_from_msg_files(tmp_path: Path, files: dict[str, str]) -> None:
    bag = a_database_without_definitions(tmp_path)
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    field = "inner.speed" if "nner" in "".join(files.values()) else "speed"
    topics = {"speed": {"topic": "/report", "field": field}}
    with pytest.raises(InputError, match=r"does not carry the definition of this type; .*'--msg FILE.msg'"):
        read(bag, topic_map=topics)
    (recording,) = read(bag, topic_map=topics, msg=[tmp_path / name for name in files])
    np.testing.assert_allclose(recording.channels["speed"], 0.1 * np.arange(300))
    assert suggest(bag, [tmp_path / name for name in files]).survey.topics[0].fields[0].path == field


@pytest.mark.parametrize(
    "text",
    [
        "float32 speed\n",
        "uint8 speed\n",
        "float64 speed\nfloat64 other\n",
        "uint8[] speed\n",
        "builtin_interfaces/Time stamp\nfloat64 speed\n",
    ],
)
def test_a_msg_file_of_another_version_is_refused_where_its_size_is_wrong(tmp_path: Path, text: str) -> None:
    """Not read as numbers that nobody sent."""
    bag = a_database_without_definitions(tmp_path)
    file = tmp_path / "Report.msg"
    file.write_text(text)
    with pytest.raises(InputError, match=r"does not fit its definition .*a \.msg file is of another version"):
        read(bag, topic_map={"speed": {"topic": "/report", "field": "speed"}}, msg=[file])


def test_a_msg_file_that_is_none(tmp_path: Path) -> None:
    bag = a_database_without_definitions(tmp_path)
    file = tmp_path / "Report.msg"
    for text in ("float64\n", "}{"):
        file.write_text(text)
        with pytest.raises(InputError, match=r"Report\.msg is no message definition"):
            read(bag, topic_map={"speed": {"topic": "/report", "field": "speed"}}, msg=[file])
    with pytest.raises(InputError, match=r"Nowhere\.msg cannot be read: it does not exist"):
        read(bag, topic_map={"speed": {"topic": "/report", "field": "speed"}}, msg=[tmp_path / "Nowhere.msg"])


@pytest.mark.parametrize("log_ns", [2**63 - 5, 2**62])
@pytest.mark.parametrize("storage", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
def test_a_message_logged_at_a_time_that_no_clock_shows_is_set_aside(
    tmp_path: Path, storage: StoragePlugin, log_ns: int
) -> None:
    """Near 2**63 ns, as a log time that was never set."""
    messages = drive_messages()
    topic, message, _ = messages[-1]
    bag = bag_of(tmp_path / "bag", [*messages, (topic, message, log_ns)], storage=storage)
    (recording,) = read(bag)
    assert recording.account is not None and recording.account.balanced
    aside = recording.account.total.aside
    assert aside[f"on {topic} logged before 1970 or after 2116"].count == 1
