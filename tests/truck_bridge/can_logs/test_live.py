"""Recording and converting: nothing half-written, nothing overwritten, one line for what cannot be."""

from __future__ import annotations

import os
import resource
import signal
import subprocess
import sys
import threading
import time
from importlib.util import find_spec

import can
import pytest
from mcap.writer import Writer

from deeptruck_core import files
from truck_bridge import can_logs
from truck_bridge.can_logs.live import WRITABLE
from truck_bridge.errors import InputError

LINE = "({:.6f}) can0 0CF00400#219B9BDD2F000F9B\n"
HERE = [suffix for suffix in WRITABLE if suffix != ".mf4" or find_spec("asammdf")]  # an extra


@pytest.fixture
def log(tmp_path):
    path = tmp_path / "drive.log"
    path.write_text("".join(LINE.format(k / 100) for k in range(1, 51)))
    return path


@pytest.fixture
def loud():
    """A channel on which somebody speaks all the time."""
    channel, stop = f"{os.getpid()}-loud", threading.Event()

    def speak():
        with can.Bus(interface="loopback", channel=channel) as bus:
            while not stop.wait(0.002):
                bus.send(can.Message(arbitration_id=0x0CF00400, data=bytes(8), is_extended_id=True))

    thread = threading.Thread(target=speak)
    thread.start()
    yield channel
    stop.set()
    thread.join()


def held(path):
    """Whether frames have reached the file: more than the head of an MCAP file."""
    return path.exists() and path.stat().st_size > 5000


@pytest.mark.parametrize("suffix", HERE)
def test_convert_keeps_every_frame_and_its_distance_in_time(log, tmp_path, suffix):
    out = tmp_path / f"out{suffix}"
    assert can_logs.convert(log, out).total.used == 50
    before, after = list(can_logs.read(log)), list(can_logs.read(out))
    assert [(f.can_id, f.data, f.bus) for f in before] == [(f.can_id, f.data, f.bus) for f in after]
    for a, b in zip(before, after, strict=True):
        assert b.time - after[0].time == pytest.approx(a.time - before[0].time, abs=2e-3)


def test_a_damaged_log_leaves_nothing_behind(log, tmp_path):
    log.write_text("rubbish\n" * 5)
    with pytest.raises(InputError, match="5 lines that are no frame, first in line 1"):
        can_logs.convert(log, tmp_path / "out.mcap")
    assert [path.name for path in tmp_path.iterdir()] == ["drive.log"]


def test_a_silent_bus_leaves_no_log(tmp_path):
    with pytest.raises(InputError, match="nothing was received"):
        can_logs.record(tmp_path / "drive.log", "loopback", f"{os.getpid()}-silent", 0.1)
    assert not [*tmp_path.iterdir()]


@pytest.mark.parametrize("suffix", HERE)
def test_record_writes_every_kind(loud, tmp_path, suffix):
    path = tmp_path / f"drive{suffix}"
    count = can_logs.record(path, "loopback", loud, 2.0)
    assert count > 0
    assert len(list(can_logs.read(path))) == count


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("drive.log", "exists already"),
        ("a.xyz", "ends in .log"),
        ("drive.log/a.log", "drive.log is no folder; choose another name"),
        ("a", "ends in"),
    ],
)
def test_what_cannot_be_written_is_said_before_the_bus_is_opened(log, tmp_path, name, says):
    before = log.read_bytes()
    for write in (
        lambda path: can_logs.record(path, "socketcan", "none9"),
        lambda path: can_logs.convert(log, path),
    ):
        with pytest.raises(InputError, match=says) as error:
            write(tmp_path / name)
        assert "\n" not in str(error.value)
    assert log.read_bytes() == before


@pytest.mark.parametrize(
    "suffix", [pytest.param(s, marks=() if s in (".log", ".mcap") else pytest.mark.long) for s in HERE]
)
def test_a_full_disk_ends_a_recording_in_one_line(loud, tmp_path, suffix):
    """A limit on the size of files stands for the disk: the write fails in the same place."""
    argv = [sys.executable, "-c", "from truck_bridge.cli import main; main()", "record", f"drive{suffix}"]
    run = subprocess.run(
        [*argv, "--interface", "loopback", "--channel", loud, "--duration", "20"],
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (4000, 4000)),
        env={**os.environ, "PYTHONDONTWRITEBYTECODE": "1"},
        cwd=tmp_path, timeout=240, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert (run.returncode, run.stderr.count("\n")) == (2, 1), run.stderr
    assert "cannot write drive" in run.stderr


def test_nothing_new_is_put_into_a_finished_result(log, tmp_path):
    with files.Result("a recorded bag").replacing(tmp_path / "bag") as draft:
        (draft / "metadata.yaml").touch()
    for write in (
        lambda path: can_logs.convert(log, path / "x.mcap"),
        lambda path: can_logs.record(path / "x.log", "loopback", "none"),
    ):
        with pytest.raises(InputError, match="a recorded bag; choose another name"):
            write(tmp_path / "bag")


@pytest.mark.parametrize(
    ("number", "name"),
    [(signal.SIGINT, "drive.log"), (signal.SIGTERM, "drive.mcap"), (signal.SIGHUP, "drive.mcap")],
)
def test_an_end_by_signal_keeps_the_recording(loud, tmp_path, name, number):
    argv = [sys.executable, "-c", "from truck_bridge.cli import main; main()", "record", name]
    # a shell's background job ignores SIGINT, and so would what it starts
    heeding = {"preexec_fn": lambda: signal.signal(number, signal.SIG_DFL)}
    process = subprocess.Popen(
        [*argv, "--interface", "loopback", "--channel", loud],
        cwd=tmp_path, stdout=subprocess.PIPE, text=True, **heeding,
    )  # fmt: skip
    deadline = time.monotonic() + 120
    while not held(tmp_path / name) and time.monotonic() < deadline:
        time.sleep(0.02)
    process.send_signal(number)
    out, _ = process.communicate(timeout=120)
    assert process.returncode == 0
    assert int(out.split()[0]) == len(list(can_logs.read(tmp_path / name))) > 0


@pytest.mark.parametrize("number", [pytest.param(signal.SIGINT, marks=pytest.mark.long), signal.SIGTERM])
def test_a_signal_amid_a_write_cuts_no_record(loud, tmp_path, monkeypatch, number):
    """It came just as the file was flushed, half a second after the start, and nothing could be read."""
    flush = Writer.flush

    def interrupted(writer):
        signal.raise_signal(number)
        flush(writer)

    monkeypatch.setattr(Writer, "flush", interrupted)
    before = signal.getsignal(number)
    count = can_logs.record(tmp_path / "drive.mcap", "loopback", loud, 20.0)
    assert len(list(can_logs.read(tmp_path / "drive.mcap"))) == count > 20
    assert signal.getsignal(number) is before
