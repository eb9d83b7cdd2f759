from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from counted_bags import KIND, contents, fill, payload
from mcap.reader import make_reader
from rosbags.typesys import Stores, get_typestore

from deeptruck_core.errors import InputError
from deeptruck_model.recordings import CrashSafeWriter, repair

TYPES = get_typestore(Stores.ROS2_JAZZY)


WRITER = """
import sys, time
from deeptruck_model.recordings import CrashSafeWriter
writer = CrashSafeWriter(sys.argv[1], custom_data={"deeptruck.interface": "{}"})
sent, begin = 0, None
while True:
    for topic in ("/a", "/b", "/c"):
        writer.write(topic, "std_msgs/msg/Float64", b"\\0\\1\\0\\0" + sent.to_bytes(8, "little"), 1 + sent)
    sent, begin = sent + 1, begin or time.monotonic()
    print(sent, time.monotonic() - begin, flush=True)
    time.sleep(0.001)
"""


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


@pytest.mark.parametrize("moment", [0.05, 0.9, 1.5, 2.3])
def test_after_kill_9_all_but_the_last_second_is_there(tmp_path: Path, killed: Any, moment: float) -> None:
    bag = tmp_path / "bag"
    process = killed(bag)
    lines = [process.stdout.readline()]
    while float(lines[-1].split()[1]) < moment:  # by the writer's own clock, whatever else computes here
        lines.append(process.stdout.readline())
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    lines += process.stdout.readlines()
    assert not (bag / "metadata.yaml").exists()
    try:
        said = repair(bag)
    except InputError as error:
        assert moment < 1 and "no message can be kept" in str(error)
        return
    assert said is not None and "was not finished: kept" in said
    sent = [(int(count), float(at)) for count, at in (line.split() for line in lines if line.endswith("\n"))]
    safe = max((count for count, at in sent if at < sent[-1][1] - 1.0), default=0)
    found = contents(bag)
    for topic in ("/a", "/b", "/c"):
        kept = found.get(topic, [])
        assert kept == list(range(len(kept))) and safe <= len(kept) <= sent[-1][0] + 1
    assert safe > 0 or moment < 1
    assert repair(bag) is None


def test_a_chunk_ends_when_it_is_due_and_not_before(tmp_path: Path) -> None:
    for seconds, chunks in ((3600.0, 1), (0.0, 50)):
        with CrashSafeWriter(tmp_path / f"{seconds:g}", flush_s=seconds) as writer:
            for number in range(50):
                fill(writer, [number], ("/a",))
                writer.flush_if_due()
        with next((tmp_path / f"{seconds:g}").glob("*.mcap")).open("rb") as stream:
            summary = make_reader(stream).get_summary()
        assert summary is not None and len(summary.chunk_indexes) == chunks


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
    for size in sorted({1, 5, 8, 20, len(data) - 1, *chosen}):
        bag = tmp_path / "cut"
        bag.mkdir(exist_ok=True)
        (bag / "cut_0.mcap").write_bytes(data[:size])
        (bag / "metadata.yaml").unlink(missing_ok=True)
        try:
            assert repair(bag) is not None
        except InputError as error:  # before the first chunk
            assert not kept or kept[-1] == 0
            assert f"its {size:,} bytes: no message can be kept" in str(error)
            assert [p.name for p in bag.iterdir()] == ["cut_0.mcap"]
            assert (bag / "cut_0.mcap").read_bytes() == data[:size]
            kept.append(0)
            continue
        found = contents(bag)
        kept.append(len(found.get("/a", [])))
        assert found.get("/a", []) == found.get("/b", []) == list(range(kept[-1]))
        assert found.get("/late", []) == list(range(20, max(20, kept[-1])))
        with (bag / "cut_0.mcap").open("rb") as stream:  # the second reader, by its index
            assert sum(1 for _ in make_reader(stream).iter_messages()) == sum(map(len, found.values()))
        assert repair(bag) is None
    assert kept == sorted(kept) and set(kept) == {0, 10, 20, 30, 40, 50}


def test_what_cannot_be_repaired(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="does not exist"):
        repair(tmp_path / "nowhere")
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match="holds no MCAP file"):
        repair(tmp_path / "empty")
    (tmp_path / "empty" / "a_0.mcap").touch()
    for path in (tmp_path / "empty", tmp_path / "empty" / "a_0.mcap"):
        with pytest.raises(InputError, match=r"a_0\.mcap is empty, so there is nothing to repair"):
            repair(path)
    assert [p.stat().st_size for p in (tmp_path / "empty").iterdir()] == [0]
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
from deeptruck_core.errors import InputError
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
