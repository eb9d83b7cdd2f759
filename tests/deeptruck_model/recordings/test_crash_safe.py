from __future__ import annotations

import os
import random
import signal
import struct
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from mcap.opcode import Opcode
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from deeptruck_model.errors import InputError
from deeptruck_model.files import Result
from deeptruck_model.recordings import CrashSafeWriter, reindex, repair

TYPES = get_typestore(Stores.ROS2_JAZZY)
KIND = "std_msgs/msg/Float64"

WRITER = """
import sys, time
from deeptruck_model.recordings import CrashSafeWriter
writer = CrashSafeWriter(sys.argv[1], custom_data={"deeptruck.interface": "{}"})
sent, begin = 0, time.monotonic()
while True:
    for topic in ("/a", "/b", "/c"):
        writer.write(topic, "std_msgs/msg/Float64", b"\\0\\1\\0\\0" + sent.to_bytes(8, "little"), 1 + sent)
    sent += 1
    print(sent, time.monotonic() - begin, flush=True)
    time.sleep(0.001)
"""


def contents(bag: Path) -> dict[str, list[int]]:
    """What a bag holds by topic, read by rosbags; the metadata must agree."""
    found: dict[str, list[int]] = {}
    with AnyReader([bag]) as reader:
        for connection, _, raw in reader.messages():
            found.setdefault(connection.topic, []).append(int.from_bytes(bytes(raw[4:12]), "little"))
        assert reader.message_count == sum(map(len, found.values()))
    return found


def payload(number: int) -> bytes:
    return b"\0\1\0\0" + number.to_bytes(8, "little")


def fill(writer: CrashSafeWriter, numbers: range, topics: tuple[str, ...] = ("/a", "/b")) -> None:
    for number in numbers:
        for topic in topics:
            writer.write(topic, KIND, payload(number), 1 + number)


def test_a_closed_bag_is_whole(tmp_path: Path) -> None:
    with CrashSafeWriter(tmp_path / "bag", custom_data={"deeptruck.x": "1"}) as writer:
        fill(writer, range(1000))
    writer.close()  # a second time does nothing
    assert contents(tmp_path / "bag") == {"/a": list(range(1000)), "/b": list(range(1000))}
    assert repair(tmp_path / "bag") is None


@pytest.fixture(scope="module")
def killed() -> Iterator[Any]:
    """Starts writers, to be killed by the test."""
    running: list[subprocess.Popen[str]] = []

    def start(bag: Path) -> subprocess.Popen[str]:
        environment = {**os.environ, "OMP_NUM_THREADS": "1"}
        process = subprocess.Popen(
            [sys.executable, "-c", WRITER, str(bag)], stdout=subprocess.PIPE, text=True, env=environment
        )
        running.append(process)
        return process

    yield start
    for process in running:
        process.kill()
        process.wait()


@pytest.mark.parametrize("moment", [0.05, 0.9, 1.1, 2.3])
def test_after_kill_9_all_but_the_last_second_is_there(tmp_path: Path, killed: Any, moment: float) -> None:
    bag = tmp_path / "bag"
    process = killed(bag)
    assert process.stdout is not None
    lines = [process.stdout.readline()]
    begin = time.monotonic()
    while time.monotonic() - begin < moment:
        lines.append(process.stdout.readline())
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    lines += process.stdout.readlines()
    assert not (bag / "metadata.yaml").exists()
    said = repair(bag)
    assert said is not None and "was not finished: kept" in said
    sent = [(int(count), float(at)) for count, at in (line.split() for line in lines if line.endswith("\n"))]
    safe = max((count for count, at in sent if at < sent[-1][1] - 1.0), default=0)
    found = contents(bag)
    for topic in ("/a", "/b", "/c") if safe else ():
        assert found[topic] == list(range(len(found[topic])))
        assert len(found[topic]) >= safe
    assert moment < 2 or safe > 0
    assert repair(bag) is None


def test_cut_off_anywhere(tmp_path: Path) -> None:
    """Whatever byte the file ends at, a whole bag with the first messages of every topic results."""
    with CrashSafeWriter(tmp_path / "bag", custom_data={"deeptruck.x": "1"}) as writer:
        for begin in range(0, 50, 10):
            fill(writer, range(begin, begin + 10), ("/a", "/b", "/late") if begin >= 20 else ("/a", "/b"))
            writer.flush()
    (file,) = (tmp_path / "bag").glob("*.mcap")
    data = file.read_bytes()
    kept = []
    chosen = random.Random(0).sample(range(len(data)), 120)
    for size in sorted({0, 5, 8, 20, len(data) - 1, *chosen}):
        bag = tmp_path / "cut"
        bag.mkdir(exist_ok=True)
        (bag / "cut_0.mcap").write_bytes(data[:size])
        (bag / "metadata.yaml").unlink(missing_ok=True)
        assert repair(bag) is not None
        found = contents(bag)
        kept.append(len(found.get("/a", [])))
        assert found.get("/a", []) == found.get("/b", []) == list(range(kept[-1]))
        assert found.get("/late", []) == list(range(20, max(20, kept[-1])))
        with (bag / "cut_0.mcap").open("rb") as stream:  # the second reader, by its index
            assert sum(1 for _ in make_reader(stream).iter_messages()) == sum(map(len, found.values()))
        assert repair(bag) is None
    assert kept == sorted(kept) and set(kept) == {0, 10, 20, 30, 40, 50}


def test_a_bag_without_description_loses_nothing(tmp_path: Path) -> None:
    with CrashSafeWriter(tmp_path / "bag") as writer:
        fill(writer, range(100))
    before = contents(tmp_path / "bag")
    (tmp_path / "bag" / "metadata.yaml").unlink()
    said = repair(tmp_path / "bag")
    assert said is not None and "nothing was lost" in said
    assert contents(tmp_path / "bag") == before


def test_custom_data_survives(tmp_path: Path) -> None:
    writer = CrashSafeWriter(tmp_path / "bag", custom_data={"deeptruck.x": "[1]"})
    fill(writer, range(10))
    writer.flush()
    repair(tmp_path / "bag")
    with AnyReader([tmp_path / "bag"]) as reader:
        assert reader.readers[0].storage.metadata.custom == {"deeptruck.x": "[1]"}  # type: ignore[union-attr]


def test_what_cannot_be_repaired(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="does not exist"):
        repair(tmp_path / "nowhere")
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match="holds no MCAP file"):
        repair(tmp_path / "empty")
    (tmp_path / "text.mcap").write_text("no bag at all, and longer than a header")
    with pytest.raises(InputError, match="is not an MCAP file"):
        repair(tmp_path / "text.mcap")


def test_what_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="exists already"):
        CrashSafeWriter(tmp_path / "file")
    with pytest.raises(InputError, match="cannot write"):
        CrashSafeWriter(tmp_path / "file" / "bag")
    with CrashSafeWriter(tmp_path / "bag") as writer:
        with pytest.raises(InputError, match="no_msgs/msg/Such"):
            writer.write("/a", "no_msgs/msg/Such", payload(0), 1)
        writer.write("/a", KIND, payload(0), 1)
        with pytest.raises(InputError, match="does not belong there"):
            writer.write("/a", "std_msgs/msg/String", payload(0), 1)
    assert contents(tmp_path / "bag") == {"/a": [0]}


FULL = """
import resource, signal, sys
from deeptruck_model.errors import InputError
from deeptruck_model.recordings import CrashSafeWriter
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (300_000, 300_000))
try:
    with CrashSafeWriter(sys.argv[1]) as writer:
        for number in range(20_000):
            cdr = b"\\0\\1\\0\\0" + number.to_bytes(8, "little")
            writer.write("/a", "std_msgs/msg/Float64", cdr, 1 + number)
            if number % 100 == 99:
                writer.flush()
except InputError as error:
    print(error)
"""


def test_a_full_disk_is_one_line_and_what_was_written_stays(tmp_path: Path) -> None:
    """A limit on the size of files stands in for the end of the disk."""
    command = [sys.executable, "-c", FULL, str(tmp_path / "bag")]
    done = subprocess.run(command, check=False, capture_output=True, text=True, timeout=60)
    assert done.stderr == "" and done.returncode == 0
    assert "cannot write" in done.stdout and "repair" in done.stdout and done.stdout.count("\n") == 1
    assert repair(tmp_path / "bag") is not None
    found = contents(tmp_path / "bag")["/a"]
    assert found == list(range(len(found))) and len(found) > 3000


def torn_bag(path: Path) -> tuple[Path, bytes]:
    """A bag whose last chunk is torn, with what belongs to the user beside it; the file's bytes."""
    with CrashSafeWriter(path, custom_data={"deeptruck.x": "1"}) as writer:
        fill(writer, range(50))
        writer.flush()
        fill(writer, range(50, 100))
    (file,) = path.glob("*.mcap")
    data = file.read_bytes()
    chunk = data.rindex(payload(99))
    file.write_bytes(data[: chunk + 4])
    (path / "notes.txt").write_text("mine")
    return file, data[: chunk + 4]


def test_a_repair_keeps_what_it_cuts_off_and_touches_nothing_else(tmp_path: Path) -> None:
    file, data = torn_bag(tmp_path / "bag")
    (tmp_path / "bag" / ".metadata.yaml.tmp").write_text("mine")
    old = (tmp_path / "bag" / "metadata.yaml").read_bytes()
    said = repair(tmp_path / "bag")
    assert said is not None and "the torn end is in bag_0.mcap.cut" in said
    torn = (tmp_path / "bag" / "bag_0.mcap.cut").read_bytes()
    assert torn and data.endswith(torn) and payload(60) in torn
    assert file.read_bytes().startswith(data[: -len(torn)])
    assert (tmp_path / "bag" / "metadata.yaml.before").read_bytes() == old
    assert (tmp_path / "bag" / "notes.txt").read_text() == "mine"
    assert (tmp_path / "bag" / ".metadata.yaml.tmp").read_text() == "mine"
    names = (
        ".metadata.yaml.tmp",
        "bag_0.mcap",
        "bag_0.mcap.cut",
        "metadata.yaml",
        "metadata.yaml.before",
        "notes.txt",
    )
    assert sorted(p.name for p in (tmp_path / "bag").iterdir()) == list(names)
    assert contents(tmp_path / "bag") == {"/a": list(range(50)), "/b": list(range(50))}


@pytest.mark.parametrize("step", ["_finish", "_kept", "_describe"])
@pytest.mark.parametrize("error", [KeyboardInterrupt(), OSError(28, "No space left on device")])
def test_a_repair_that_ends_anywhere_loses_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, step: str, error: BaseException
) -> None:
    _, data = torn_bag(tmp_path / "bag")

    def fails(*_: object) -> None:
        raise error

    with monkeypatch.context() as patch:
        patch.setattr(reindex, step, fails)
        with pytest.raises((KeyboardInterrupt, InputError)):
            repair(tmp_path / "bag")
    kept = b"".join(p.read_bytes() for p in sorted((tmp_path / "bag").glob("*.mcap*")))
    assert payload(60) in kept and payload(10) in kept and len(kept) >= len(data)
    assert repair(tmp_path / "bag") is not None
    assert contents(tmp_path / "bag") == {"/a": list(range(50)), "/b": list(range(50))}
    assert (tmp_path / "bag" / "notes.txt").read_text() == "mine"
    assert payload(60) in (tmp_path / "bag" / "bag_0.mcap.cut").read_bytes()


def test_a_link_is_not_turned_into_a_file(tmp_path: Path) -> None:
    _, data = torn_bag(tmp_path / "elsewhere")
    (tmp_path / "bag").mkdir()
    link, target = tmp_path / "bag" / "bag_0.mcap", tmp_path / "target.mcap"
    target.write_bytes(data)
    link.symlink_to(target)
    with pytest.raises(
        InputError, match=r"bag_0\.mcap is a symbolic link.* repair what it points to, .*target"
    ):
        repair(tmp_path / "bag")
    assert link.is_symlink() and target.read_bytes() == data
    assert [p.name for p in link.parent.iterdir()] == ["bag_0.mcap"]


def test_a_repaired_bag_is_still_its_recorders(tmp_path: Path) -> None:
    bag = tmp_path / "bag"
    kind = Result("a bag of this test")
    with kind.replacing(bag) as draft, CrashSafeWriter(draft, file_stem="bag", into=True) as writer:
        fill(writer, range(50))
    file = bag / "bag_0.mcap"
    file.write_bytes(file.read_bytes()[:-200])
    with pytest.raises(InputError, match=r"bag_0\.mcap, which has changed since"):
        kind.check(bag, overwrite=True)
    (bag / "metadata.yaml").unlink()
    assert repair(bag)
    for kept in bag.glob("*.cut"):
        kept.unlink()
    assert kind.check(bag, overwrite=True)


def test_a_bag_that_is_still_written_is_not_repaired(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file, data = torn_bag(tmp_path / "bag")
    finish = reindex._finish

    def meanwhile(*given: Any) -> None:
        finish(*given)
        with file.open("ab") as stream:
            stream.write(b"more")

    monkeypatch.setattr(reindex, "_finish", meanwhile)
    with pytest.raises(InputError, match="is still being written"):
        repair(tmp_path / "bag")
    assert file.read_bytes() == data + b"more"


def records(data: bytes) -> list[tuple[int, int, int]]:
    """(opcode, place, length of the content) of the records of an unfinished file."""
    found, at = [], 8
    while at < len(data):
        opcode, length = struct.unpack_from("<BQ", data, at)
        found.append((opcode, at, length))
        at += 9 + length
    return found


@pytest.mark.parametrize(
    ("record", "byte", "becomes"),
    [
        (Opcode.CHUNK, 0, Opcode.FOOTER),
        (Opcode.CHUNK, 0, Opcode.MESSAGE_INDEX),
        (Opcode.CHUNK, 9 + 39, 1),  # of the length of what is in it
        (Opcode.CHUNK, 9 + 200, 255),
        (Opcode.MESSAGE_INDEX, 0, Opcode.DATA_END),
        (Opcode.MESSAGE_INDEX, 8, 1),  # of its length
        (Opcode.MESSAGE_INDEX, 9, 77),  # of its channel
        (Opcode.MESSAGE_INDEX, 9 + 14, 255),  # of where a message is
        (Opcode.METADATA, 9 + 5, 255),
    ],
)
def test_a_flipped_byte_loses_nothing(tmp_path: Path, record: int, byte: int, becomes: int) -> None:
    """Each message is in the mended bag, or in what is kept beside it; what is mended can be read."""
    writer = CrashSafeWriter(tmp_path / "bag", custom_data={"deeptruck.x": "1"})
    for begin in range(0, 50, 10):
        fill(writer, range(begin, begin + 10))
        writer.flush()
    data = bytearray(writer.file.read_bytes())
    places = [at for opcode, at, _ in records(bytes(data)) if opcode == record]
    data[places[len(places) // 2] + byte] = becomes
    writer.file.write_bytes(data)
    assert repair(tmp_path / "bag") is not None
    kept = b"".join(path.read_bytes() for path in (tmp_path / "bag").glob("*.mcap*"))
    assert all(kept.count(payload(count)) >= 1 for count in range(50))
    with writer.file.open("rb") as stream:
        by_index = sum(1 for _ in make_reader(stream, validate_crcs=True).iter_messages())
    assert by_index == sum(map(len, contents(tmp_path / "bag").values()))
