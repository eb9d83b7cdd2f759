"""Bags as people have them: one drive, written by every recorder, read alike; and bags that are refused, by
the word that must be in the line, with the cure in it followed.
"""

from __future__ import annotations

import re
import shutil
import sqlite3
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from foreign_bags import (
    ROS1,
    TWIST,
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
from rosbags.rosbag2 import Writer as Writer2

from deeptruck_core.errors import InputError
from deeptruck_core.signals import TruckInterface
from deeptruck_model.recordings import Recording, import_table, read, repair, suggest, write_bag

Make = Callable[[Path], Path]
SQLITE, MCAP = StoragePlugin.SQLITE3, StoragePlugin.MCAP
TOPICS = {"speed": {"topic": "/truck/twist", "field": "twist.linear.x"}}
OF_ROS1 = {"speed": {"topic": "/speed", "field": "twist.linear.x"}}
OF_REPORT = {"speed": {"topic": "/report", "field": "speed"}}
DRIVE = drive_messages()
MINE = TruckInterface("mine", "N m", "percent")
STRING = [("/truck/twist", TYPES.types["std_msgs/msg/String"]("x"), k * S) for k in range(1, 31)]


def written(messages: list[Message] = DRIVE, **options: Any) -> Make:
    """A folder by rosbags."""
    return lambda folder: bag_of(folder / "bag", sorted(messages, key=lambda m: m[2]), **options)


def mcap(odd: tuple[str, str, str] | None = None, **options: Any) -> Make:
    """A lone file by MCAP's own library."""
    return lambda folder: mcap_of(folder / "bag.mcap", DRIVE, odd, **options)


def restamped(stamp: Callable[[int], int]) -> list[Message]:
    """The drive under other stamps, from those of its log."""
    return [(t, twist(m.twist.linear.x, stamp(ns)), ns) for t, m, ns in DRIVE]


def ros1(folder: Path) -> Path:
    return ros1_of(
        folder / "drive.bag",
        [("/speed", twist(0.1 * k, ns, ROS1, seq=k), ns) for k, (_, _, ns) in enumerate(DRIVE)],
    )


def index_of(content: bytes | bytearray) -> tuple[int, int]:
    """Where a ROS 1 bag says where its index is, and where it is."""
    field = content.index(b"index_pos=") + 10
    return field, int.from_bytes(content[field : field + 8], "little")


def holed(hole: bytes) -> Make:
    """A ROS 1 bag with unused bytes before its index."""

    def made(folder: Path) -> Path:
        file = ros1(folder)
        content = bytearray(file.read_bytes())
        field, at = index_of(content)
        content[field : field + 8] = (at + len(hole)).to_bytes(8, "little")
        file.write_bytes(content[:at] + hole + content[at:])
        return file

    return made


def split(*names: str) -> Make:
    """A recording in parts, without metadata."""

    def made(folder: Path) -> Path:
        (folder / "bag").mkdir()
        for name, part in zip(names, (DRIVE[:150], DRIVE[150:]), strict=True):
            mcap_of(folder / "bag" / f"{name}.mcap", part)
        return folder / "bag"

    return made


def ours(folder: Path) -> Path:
    """A folder that is called as a bag of ROS 1."""
    drive = Recording("a", 0.1, {"speed": 0.1 * np.arange(300)}, MINE)
    return write_bag(folder / "drive.bag", [drive], interface=MINE)


def killed(folder: Path) -> Path:
    """A recorder that was killed leaves its last messages in the -wal file."""
    bag = bag_of(folder / "bag", DRIVE[:200], storage=SQLITE)
    (file,) = bag.glob("*.db3")
    live = sqlite3.connect(file)
    live.execute("PRAGMA journal_mode=WAL")
    for _, message, ns in DRIVE[200:]:
        row = (ns, bytes(TYPES.serialize_cdr(message, TWIST)))
        live.execute("INSERT INTO messages (topic_id, timestamp, data) VALUES(1, ?, ?)", row)
    live.commit()
    copied = Path(shutil.copytree(bag, folder / "killed"))
    live.close()
    assert any(file.name.endswith("-wal") for file in copied.iterdir())
    return copied


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
METADATA: dict[str, Callable[[Path, dict[str, Any]], object]] = {
    "below its folder": _behind("{}"),
    "absolute": _behind("/data"),
    "below another": _below,
    "no identifier": lambda _, information: information.update(storage_identifier=""),
    "another identifier": lambda _, information: information.update(storage_identifier="my_plugin"),
    "wrong counts": lambda _, i: i["topics_with_message_count"][0].update(message_count=7),
    "null": lambda _, information: information.update(NONE),
}


def stating(change: Callable[[Path, dict[str, Any]], object], storage: StoragePlugin) -> Make:
    """A bag with other metadata."""

    def made(folder: Path) -> Path:
        bag = bag_of(folder / "bag", DRIVE, storage=storage)
        data = yaml.safe_load((bag / "metadata.yaml").read_text())
        change(bag, data["rosbag2_bagfile_information"])
        (bag / "metadata.yaml").write_text(yaml.safe_dump(data))
        return bag

    return made


def bare(storage: StoragePlugin = MCAP) -> Make:
    """A bag without metadata."""

    def made(folder: Path) -> Path:
        bag = bag_of(folder / "bag", DRIVE, storage=storage)
        (bag / "metadata.yaml").unlink()
        return bag

    return made


late = np.random.default_rng(0).uniform(0, 0.5, 300)
UNREADABLE = {
    "service event": (
        "my/srv/Arm_Event",
        "ros2msg",
        "=" * 80 + "\nSRV: my/srv/Arm\nint64 a\n---\nint64 sum\n",
    ),
    "json": ("chat", "jsonschema", "{}"),
    "protobuf": ("foxglove.Log", "protobuf", "\n"),
    "idl union": ("my/msg/U", "ros2idl", "module my { module msg { union U switch(long) {}; }; };"),
    "a nested type that is missing": ("my/msg/Outer", "ros2msg", "my/Inner inner\n"),
    "no schema": ("", "", ""),
    "binary": ("my/msg/B", "ros2msg", "\0\1\2"),
}
BAGS: dict[str, Make] = {
    **{f"{storage.name} {mode.name if mode else ''}": written(storage=storage, compression=mode)
       for storage, mode in (
           (MCAP, None), (MCAP, CompressionMode.MESSAGE), (MCAP, CompressionMode.FILE),
               (MCAP, CompressionMode.STORAGE),
           (SQLITE, None), (SQLITE, CompressionMode.MESSAGE))},
    "lz4": mcap(compression=CompressionType.LZ4),
    "zstd in chunks": mcap(compression=CompressionType.ZSTD, chunk_size=1000),
    "no chunks": mcap(use_chunking=False),
    "chunks indexed alone": mcap(index_types=IndexType.CHUNK),
    "no statistics": mcap(use_statistics=False, repeat_channels=True),
    **{f"no channels in the summary {kept}": mcap(chunk_size=2048, repeat_channels=False, **kept)
       for kept in ({}, {"use_statistics": False}, {"repeat_schemas": False})},
    **{f"beside {kind}{' in chunks' * chunked}": mcap(UNREADABLE[kind], use_chunking=chunked)
       for kind in UNREADABLE for chunked in (True, False)},
    **{f"metadata: {change}, {storage.name}": stating(METADATA[change], storage)
       for change in METADATA for storage in (MCAP, SQLITE)},
    "ours, called .bag": ours,
    "ROS 1": ros1,
    **{f"ROS 1 with a hole of {len(hole)}": holed(hole)
       for hole in (b"\0" * 49, b"\xff" * 100, b"\0" * 4096, b"\x07" * 3, b"op=\x05" * 9)},
    "in parts": split("drive_0", "drive_1"),
    "a database without metadata": bare(SQLITE),
    "a journal": killed,
    "log times that are late": written(
        [(t, m, ns + int(x * S)) for (t, m, ns), x in zip(DRIVE, late, strict=True)]),
    "simulated from zero, fast": written([(t, twist(m.twist.linear.x, k * S // 10),
        1_700_000_000 * S + k * S // 50)
                                          for k, (t, m, _) in enumerate(DRIVE)]),
    "a clock that was never set": written(restamped(lambda ns: 0)),
    "a message twice": written([*DRIVE, DRIVE[99]]),
    **{f"two types of one topic, {storage.name}": written([*STRING, *DRIVE],
        storage=storage) for storage in (MCAP, SQLITE)},
    **{f"logged at {log_ns}, {storage.name}": written([*DRIVE, (*DRIVE[-1][:2], log_ns)], storage=storage)
       for log_ns in (2**63 - 5, 2**62) for storage in (MCAP, SQLITE)},
}  # fmt: skip
SAID = {  # what an account has of some of them
    "beside": "cannot be read on /odd",
    "log times": "put back in order",
    "a message twice": "with a repeated stamp",
    "logged at": "on /truck/twist logged before 1970 or after 2116",
}


@pytest.mark.parametrize("name", BAGS)
def test_every_bag_of_a_drive_is_read_alike(tmp_path: Path, name: str) -> None:
    bag = BAGS[name](tmp_path)
    before = {one: one.read_bytes() for one in (bag.iterdir() if bag.is_dir() else ()) if one.is_file()}
    (recording,) = read(bag, topic_map=OF_ROS1 if "ROS 1" in name else TOPICS)
    np.testing.assert_allclose(recording.channels["speed"], 0.1 * np.arange(300), atol=1e-12)
    account = recording.account
    assert account is not None and account.balanced
    for begin, words in SAID.items():
        if name.startswith(begin):
            assert any(words in line for line in account.lines()), list(account.lines())
    assert all(one.read_bytes() == content for one, content in before.items())


def users(folder: Path) -> Path:
    """Other names and units, a message without a header, a vector by index."""
    messages: list[Message] = []
    layout = TYPES.types["std_msgs/msg/MultiArrayLayout"]([], 0)
    for k, (_, _, ns) in enumerate(DRIVE):
        array = TYPES.types["std_msgs/msg/Float64MultiArray"](layout, np.array([5.0, 2.0, 0.5 * k]))
        messages += [("/v", twist(0.36 * k, ns), ns), ("/pedal", number(0.001 * k), ns), ("/can", array, ns)]
    return bag_of(folder / "bag", messages)


def test_topics_of_users(tmp_path: Path) -> None:
    bag, topics = users(tmp_path), tmp_path / "topics.yaml"
    topics.write_text(
        "speed: {topic: /v, field: twist.linear.x, unit: km/h}\n"
        "engine_command: {topic: /pedal, field: data, unit: ratio}\n"
        "ambient_temperature: {topic: /can, field: 'data[1]', scale: 2, offset: 1}\n"
    )
    (recording,) = read(bag, topic_map=topics)
    np.testing.assert_allclose(recording.channels["speed"], 0.1 * np.arange(300))
    np.testing.assert_allclose(recording.channels["engine_command"], 0.1 * np.arange(300))
    np.testing.assert_array_equal(recording.channels["ambient_temperature"], 5.0)
    expected = TruckInterface("bag", engine_unit="percent", brake_unit=None, grade=False, fuel=False)
    assert recording.interface == expected
    import_table(bag, topics, tmp_path / "ours")
    (again,) = read(tmp_path / "ours")
    assert again.interface == expected
    np.testing.assert_array_equal(again.channels["speed"], recording.channels["speed"])


def test_the_argument_and_the_map_overrule_the_bags_interface(
    tmp_path: Path, drive: Recording, interface: TruckInterface
) -> None:
    bag = write_bag(tmp_path / "bag", [drive], interface=interface)
    assert read(bag, interface=MINE)[0].interface == MINE
    command = {"topic": "/truck/command", "field": "position[name=engine_command]", "unit": "Nm"}
    assert read(bag, topic_map={**TOPICS, "engine_command": command})[0].interface.engine_unit == "N m"


def test_no_target_is_invalid(tmp_path: Path) -> None:
    make = TYPES.types["sensor_msgs/msg/Range"]
    gaps = [np.inf if 100 <= k < 200 else 40.0 for k in range(300)]
    ranges = [("/radar/range", make(stamped(ns), 1, 0.1, 0.0, 250.0, gap, 0.0), ns)
              for gap, (_, _, ns) in zip(gaps, DRIVE, strict=True)]  # fmt: skip
    (recording,) = read(written([*DRIVE, *ranges])(tmp_path))
    np.testing.assert_array_equal(np.isnan(recording.channels["gap"]), np.isinf(gaps))


def humble(folder: Path) -> Path:
    """As Humble writes it: the types are named, and nothing says what is in them."""
    reports = [("/report", number(m.twist.linear.x), ns) for _, m, ns in DRIVE]
    bag = bag_of(folder / "bag", reports, storage=SQLITE)
    (file,) = bag.glob("*.db3")
    with sqlite3.connect(file) as database:
        database.execute("UPDATE topics SET type = 'my_msgs/msg/Report'")
        database.execute("DELETE FROM message_definitions")
    text = (bag / "metadata.yaml").read_text().replace("std_msgs/msg/Float64", "my_msgs/msg/Report")
    (bag / "metadata.yaml").write_text(text)
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
    bag = humble(tmp_path)
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    field = "inner.speed" if "nner" in "".join(files.values()) else "speed"
    given = [tmp_path / name for name in files]
    (recording,) = read(bag, topic_map={"speed": {"topic": "/report", "field": field}}, msg=given)
    np.testing.assert_allclose(recording.channels["speed"], 0.1 * np.arange(300))
    assert suggest(bag, given).survey.topics[0].fields[0].path == field


def joints(folder: Path) -> Path:
    make, none = TYPES.types["sensor_msgs/msg/JointState"], np.zeros(0)
    commands = [("/truck/command", make(stamped(ns), ["engine_command"], np.array([50.0]), none, none), ns)
                for _, _, ns in DRIVE]  # fmt: skip
    return written([*DRIVE, *commands])(folder)


def empty(*others: str) -> Make:
    """A bag without a message on its topic, and with one on others."""

    def made(folder: Path) -> Path:
        with Writer2(folder / "bag", version=9, storage_plugin=MCAP) as writer:
            writer.add_connection("/truck/twist", TWIST, typestore=TYPES)
            for topic in others:
                connection = writer.add_connection(topic, "std_msgs/msg/Float64", typestore=TYPES)
                writer.write(connection, 1, TYPES.serialize_cdr(number(1.0), "std_msgs/msg/Float64"))
        return folder / "bag"

    return made


def set_back(folder: Path) -> Path:
    messages = restamped(lambda ns: ns - 100 * S * (ns > 21 * S) + 200 * S)
    return written([(t, m, ns + 200 * S) for t, m, ns in messages])(folder)


def indexed(where: Callable[[int], int]) -> Make:
    """A ROS 1 bag that ends where its index was."""

    def made(folder: Path) -> Path:
        file = ros1(folder)
        content = bytearray(file.read_bytes())
        field, at = index_of(content)
        content[field : field + 8] = where(at).to_bytes(8, "little")
        file.write_bytes(content[:at])
        return file

    return made


def overlong(broken: str) -> Make:
    """A record of a ROS 1 bag that says that it is longer than the file; its summary is whole."""

    def made(folder: Path) -> Path:
        file = ros1(folder)
        content = bytearray(file.read_bytes())

        def behind(at: int) -> int:
            """Where a part of a record ends whose length stands here."""
            return at + 4 + int.from_bytes(content[at : at + 4], "little")

        chunk = behind(behind(len(b"#ROSBAG V2.0\n")))
        length = behind(chunk) if broken == "chunk" else behind(behind(behind(chunk)))
        content[length : length + 4] = len(content).to_bytes(4, "little")
        file.write_bytes(content)
        return file

    return made


def msg(text: str | None) -> Make:
    """A bag without definitions, and a .msg file beside it."""

    def made(folder: Path) -> Path:
        if text is not None:
            (folder / "Report.msg").write_text(text)
        return humble(folder)

    return made


def nowhere(folder: Path) -> Path:
    return folder / "bag"


def field(topic: str, path: str, **more: Any) -> dict[str, Any]:
    return {"speed": {"topic": topic, "field": path, **more}}


ANOTHER_VERSION = r"does not fit its definition .*a \.msg file is of another version"
REFUSED: dict[str, tuple[Make, Any, str]] = {  # the bag, its topic map, the word that must be in the line
    "time going back": (set_back, None, r"time goes back by \S+ s on /truck/twist"),
    "no such topic": (written(drive_messages("/other")), None,
        "no topic /truck/twist for 'speed' .topics there: /other"),
    "no such field": (written(), field("/truck/twist", "twist.speed"), "has no field 'twist.speed'"),
    "no other topic": (written(), {**TOPICS, "gap": {"topic": "/no", "field": "data"}},
        "no topic /no for 'gap'"),
    "no bag": (nowhere, None, "does not exist"),
    "no map": (written(), Path("nowhere.yaml"), "cannot be read"),
    "two bags": (split("a", "b"), TOPICS, "holds 2 bags"),
    "no unit of a command": (joints, None, "in which unit its engine_command is"),
    "no message": (empty(), None, "is empty, it holds no message; record while .* 'ros2 bag record -a'"),
    "no speed": (empty("/brake"), None, "no speed on /truck/twist, only other messages; .*'ros2 topic hz'"),
    "a topic that nobody can read": (mcap(UNREADABLE["json"]),
        {**TOPICS, "grade": {"topic": "/odd", "field": "data"}},
                                     r"/odd .*mapped for 'grade', cannot be read.*--msg"),
    "no definition": (msg(None), OF_REPORT,
        r"does not carry the definition of this type; .*'--msg FILE.msg'"),
    **{f"a definition of another version {k}": (msg(text), OF_REPORT, ANOTHER_VERSION) for k,
        text in enumerate((
        "float32 speed\n", "uint8 speed\n", "float64 speed\nfloat64 other\n", "uint8[] speed\n",
        "builtin_interfaces/Time stamp\nfloat64 speed\n"))},
    **{f"no definition in {text!r}": (msg(text), OF_REPORT, r"Report\.msg is no message definition")
       for text in ("float64\n", "}{")},
    "no .msg file": (msg(None), OF_REPORT, r"Nowhere\.msg cannot be read: it does not exist"),
    **{f"no index of ROS 1, {name}": (indexed(where), OF_ROS1, r"no index.*'rosbag reindex'")
       for name, where in (("never written", lambda at: 0), ("at the end", lambda at: at),
           ("behind it", lambda at: at + 99))},
    **{f"a {broken} that is too long": (overlong(broken), OF_ROS1,
        "the content of a record is longer than the file")
       for broken in ("chunk", "index")},
    "a map without a speed": (written(), {"gap": {"topic": "/g", "field": "data"}},
        "'speed' is missing; a recording needs"),
    "a map of another channel": (written(), {"velocity": {"topic": "/g", "field": "data"}},
        "topic map: unknown key 'velocity'.*under 'extra'"),
    "a map without a field": (written(), {"speed": {"topic": "/g"}}, "needs topic and field"),
    "a map of a topic alone": (written(), {"speed": "/g"}, "needs topic and field"),
    "a unit of another channel": (written(), field("/g", "x", unit="rpm"),
        "'rpm' does not fit; use one of: m/s"),
    "a misspelt key": (written(), field("/g", "x", factor=2), "speed: unknown key 'factor'"),
    "a scale in words": (written(), field("/g", "x", scale="two"), "scale: 'two' is not of type 'number'"),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_refused(tmp_path: Path, name: str) -> None:
    make, topics, says = REFUSED[name]
    bag = make(tmp_path)
    files = [*tmp_path.glob("*.msg")] or ([tmp_path / "Nowhere.msg"] if "Nowhere" in says else [])
    topics = tmp_path / topics if isinstance(topics, Path) else topics
    with pytest.raises(InputError, match=says) as refused:
        read(bag, topic_map=topics, msg=files)
    assert "\n" not in str(refused.value)


ANEW = r"copy it anew from where it was recorded"
REPAIR = r"'deeptruck-model repair ([^\s']+)'"


def damaged(spoil: Callable[[bytes], bytes]) -> Make:
    def made(folder: Path) -> Path:
        bag = bag_of(folder / "bag", DRIVE)
        (file,) = bag.glob("*.mcap")
        file.write_bytes(spoil(file.read_bytes()))
        return bag

    return made


def lost(folder: Path) -> Path:
    bag = bag_of(folder / "bag", DRIVE)
    next(bag.glob("*.mcap")).rename(folder / "elsewhere.mcap")
    return bag


def misdescribed(text: str) -> Make:
    def made(folder: Path) -> Path:
        bag = bag_of(folder / "bag", DRIVE)
        (bag / "metadata.yaml").write_text(text)
        return bag

    return made


DAMAGED: dict[str, tuple[Make, str]] = {
    "nothing left": (damaged(lambda data: b""), ANEW),
    "a table": (damaged(lambda data: b"time,speed\n1,2\n" * 100), ANEW),
    "the head alone": (damaged(lambda data: data[:12]), REPAIR),
    "half": (damaged(lambda data: data[: len(data) // 2]), REPAIR),
    "all but the end": (damaged(lambda data: data[:-60]), REPAIR),
    "a record's length": (damaged(lambda data: data[:9] + struct.pack("<Q", 2**40) + data[17:]), REPAIR),
    "zeros at the end": (damaged(lambda data: data[:-8] + bytes(8)), REPAIR),
    "zeros in the middle": (damaged(lambda data: data[: (k := len(data) // 2)] + bytes(64) + data[k + 64 :]),
        ""),
    "more behind the end": (damaged(lambda data: data + data[-200:]), REPAIR),
    "a file is lost": (lost, rf"it has lost \S+\); {ANEW}"),
    "metadata cut off": (misdescribed("a: [1"), "remove it and mend the bag with 'deeptruck-model repair'"),
    # more levels than a recursive parser in C survives
    "metadata of many levels": (misdescribed("- " * 100_000),
        "remove it and mend the bag with 'deeptruck-model repair'"),
    "no metadata": (bare(), f"not a finished bag.*mend it with {REPAIR}"),
}  # fmt: skip


@pytest.mark.parametrize("name", DAMAGED)
def test_a_cure_that_is_followed_gives_what_was_driven(tmp_path: Path, name: str) -> None:
    make, says = DAMAGED[name]
    bag = make(tmp_path)
    refused = _refused(bag)
    if refused:
        with pytest.raises(InputError):
            import_table(bag, TOPICS, tmp_path / "out")
        assert not (tmp_path / "out").exists()
    assert re.search(says or f"{ANEW}|{REPAIR}", refused) or not (says or refused), refused
    if (named := re.search(REPAIR, refused)) is None:
        return
    try:
        assert repair(Path(named[1])) is not None
    except InputError as error:
        assert re.search("beyond repair|cannot|record anew", str(error))
        return
    again = _refused(bag)
    assert not again or "holds no message" in again


def _refused(bag: Path) -> str:
    """Why the bag is refused, in one line; else '' and its speeds are a beginning of those driven."""
    try:
        (recording,) = read(bag)
    except InputError as error:
        assert "\n" not in str(error)
        return str(error)
    speed = recording.channels["speed"]
    np.testing.assert_allclose(speed, 0.1 * np.arange(len(speed)), atol=1e-6)
    return ""
