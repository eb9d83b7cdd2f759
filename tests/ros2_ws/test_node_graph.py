"""The whole graph over Fast DDS: real processes, real kills."""

from __future__ import annotations

import os
import resource
import shutil
import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from deeptruck_model import recordings, simulators
from deeptruck_model.recordings.bag_source import BagSource
from deeptruck_nodes import environment
from deeptruck_nodes.messages import SECOND
from deeptruck_nodes.recorder import header_stamp
from deeptruck_nodes.topics import RECORDED

RECORDED_BYTES = 50_000  # by which every topic has been recorded
TRUCK = ("--simulator", "truck:trucksim", "--policy", "baseline:acc")


def content(bag: Path) -> list[tuple[str, int, bytes]]:
    with BagSource(bag) as source:
        return sorted(source.messages(set(source.topics)))


def test_lockstep_repeats_itself_to_the_byte(
    start: Callable[..., Any], lockstep: tuple[object, ...], lockstep_bag: Path, tmp_path: Path
) -> None:
    """The second time with a page, which changes none."""
    run = start("start_simulation.py", *lockstep, "--record", tmp_path / "bag", "--page")
    code, out, errors = run.finish()
    assert (code, errors) == (0, "") and "page: http://127.0.0.1:" in out
    assert out.splitlines()[-1] == f"ended: truck_sim has finished; recorded in {tmp_path / 'bag'}"
    messages = content(tmp_path / "bag")
    assert messages == content(lockstep_bag)
    with (tmp_path / "bag" / "bag_0.mcap").open("rb") as file:  # Foxglove's reader
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        assert sum(1 for _ in reader.iter_decoded_messages()) == len(messages)
        summary = reader.get_summary()
        assert summary is not None and len(summary.chunk_indexes) < len(messages) / 10
    (recording,) = recordings.read(tmp_path / "bag")
    assert len(recording) == 101 and recording.interface.name == "trucksim"
    own = {"speed", "acceleration", "engine_command", "brake_command", "grade", "gear"}
    assert own | {"gap", "leader_speed"} <= recording.channels.keys()
    assert np.isfinite(recording.u).all() and np.isfinite(recording.y[1:]).all()
    assert np.nanstd(np.diff(recording.channels["gap"])) > 0.05  # there is noise that could have differed
    # v(k+1) = v(k) + a(k+1) dt is what the rest of the project builds on
    speed, acceleration = recording.channels["speed"], recording.channels["acceleration"]
    assert np.diff(speed) == pytest.approx(0.1 * acceleration[1:], abs=1e-9)


def test_real_time_run_second_run_and_ctrl_c(
    start: Callable[..., Any],
    all_gone: Callable[..., bool],
    eventually: Callable[..., None],
    tmp_path: Path,
) -> None:
    run = start("start_simulation.py", *TRUCK, "--record", tmp_path / "bag", "--rate", 50)
    run.wait_until_ready()
    second = start("start_simulation.py", *TRUCK, runs="second")
    code, _, errors = second.finish()
    assert code == 2 and "another run is using ROS domain" in errors and errors.count("\n") == 1
    children = run.children
    assert set(children) == {"recorder", "leader", "controller", "truck_sim"}
    addresses = {address for pid in children.values() for address in udp_addresses(pid)}
    assert addresses == {"127.0.0.1"}
    eventually(lambda: (tmp_path / "bag" / "bag_0.mcap").stat().st_size > RECORDED_BYTES)
    assert not any(shared_by(pid) for pid in children.values())  # so that none is left behind
    run.process.send_signal(signal.SIGINT)
    code, out, errors = run.finish()
    assert (code, errors) == (0, "") and "stopping" in out
    assert out.splitlines()[-1] == f"ended: you asked it to; recorded in {tmp_path / 'bag'}"
    assert all_gone(children)
    with BagSource(tmp_path / "bag") as bag:
        assert set(bag.topics) == set(RECORDED)
        stamps = np.array([header_stamp(data) for _, _, data in bag.messages({"/truck/twist"})])
    assert np.all(np.diff(stamps) == SECOND // 50)  # nothing missing


def shared_by(pid: int) -> list[str]:
    """Shared memory of Fast DDS that a process has. What lies in /dev/shm may be another test's."""
    lines = Path(f"/proc/{pid}/maps").read_text().splitlines()
    return [line for line in lines if "/dev/shm/fastrtps" in line]


def udp_addresses(pid: int) -> set[str]:
    """Local addresses of a process's UDP sockets."""
    inodes = set()
    for descriptor in Path(f"/proc/{pid}/fd").iterdir():
        target = str(descriptor.readlink())
        if target.startswith("socket:["):
            inodes.add(target[8:-1])
    found = set()
    for line in Path(f"/proc/{pid}/net/udp").read_text().splitlines()[1:]:
        fields = line.split()
        if fields[9] in inodes:
            number = bytes.fromhex(fields[1].partition(":")[0])[::-1]
            found.add(".".join(map(str, number)))
    return found


def test_a_dead_node_ends_the_run_with_its_last_words(
    start: Callable[..., Any], all_gone: Callable[..., bool], tmp_path: Path
) -> None:
    run = start("start_simulation.py", *TRUCK, "--record", tmp_path / "bag")
    run.wait_until_ready()
    children = run.children
    os.kill(children["controller"], signal.SIGKILL)
    code, out, errors = run.finish()
    assert code == 1 and errors.startswith("controller ended (killed by SIGKILL)")
    assert out.splitlines()[-1] == f"ended: controller failed; recorded in {tmp_path / 'bag'}"
    assert all_gone(children)
    assert content(tmp_path / "bag")  # the recorder still ended in order


@pytest.mark.parametrize("line", ["logs in", "ready after"])  # while nodes start, and while they drive
def test_a_killed_supervisor_leaves_nobody_behind_and_the_domain_free(
    start: Callable[..., Any], all_gone: Callable[..., bool], domain: int, line: str
) -> None:
    run = start("start_simulation.py", *TRUCK)
    assert any(said.startswith(line) for said in run.process.stdout)
    children = run.children
    run.process.kill()
    run.process.wait()  # it holds the lock until it has ended
    assert all_gone(children)
    environment.DomainLock(domain).release()


def files_of(bag: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in bag.iterdir()}


@pytest.fixture
def hangs_up() -> Iterator[None]:
    """SIGHUP ends what is started here, though the tests may run under nohup, which has it ignored."""
    before = signal.signal(signal.SIGHUP, signal.SIG_DFL)
    yield
    signal.signal(signal.SIGHUP, before)


@pytest.mark.usefixtures("hangs_up")
@pytest.mark.parametrize("number", [signal.SIGHUP, signal.SIGKILL])
def test_an_older_bag_stands_until_the_new_one_is_whole(
    start: Callable[..., Any],
    eventually: Callable[..., None],
    lockstep_bag: Path,
    tmp_path: Path,
    number: signal.Signals,
) -> None:
    bag = shutil.copytree(lockstep_bag, tmp_path / "bag")
    record = ("--record", bag, "--lockstep", "--duration")
    for _ in range(5):  # where the machine stalls, all are ready before the signal: a whole new bag
        before = files_of(bag)
        run = start("start_simulation.py", *TRUCK, *record, 600, "--overwrite", runs="again")
        if number == signal.SIGKILL:
            run.wait_until_ready()
            eventually(lambda: list(tmp_path.glob("bag.old")) and list(bag.glob("bag_0.mcap")))
        else:
            assert any(line.startswith("logs in") for line in run.process.stdout)  # nobody is ready yet
        run.process.send_signal(number)
        code, out, _ = run.finish()
        if "ready after" not in out:
            break
    if number == signal.SIGKILL:
        assert files_of(tmp_path / "bag.old") == before and list(bag.glob("bag_0.mcap"))
    else:
        assert files_of(bag) == before
        assert code == 0 and out.splitlines()[-1].endswith("nothing was recorded")
        assert not list(tmp_path.glob(".bag*"))


def test_of_a_killed_recorder_all_that_was_written_is_kept_and_replay_repairs_and_plays_it(
    start: Callable[..., Any], eventually: Callable[..., None], tmp_path: Path
) -> None:
    run = start("start_simulation.py", *TRUCK, "--record", tmp_path / "bag")
    run.wait_until_ready()
    growing, before = tmp_path / "bag" / "bag_0.mcap", tmp_path / "before.mcap"
    # test_crash_safe has how often it writes
    eventually(lambda: growing.exists() and growing.stat().st_size > RECORDED_BYTES)
    shutil.copy(growing, before)
    os.kill(run.children["recorder"], signal.SIGKILL)
    code, _, errors = run.finish()
    assert code == 1 and errors.startswith("recorder ended (killed by SIGKILL)")
    again = start(
        "replay_recording.py", tmp_path / "bag", "--speed", 5, "--record", tmp_path / "copy", runs="replay"
    )
    code, out, errors = again.finish()
    assert (code, errors) == (0, "") and "was not finished: kept" in out
    kept = content(tmp_path / "bag")
    recordings.repair(before)
    assert len(written := content(before)) > 100 and not {*written} - {*kept}
    own = [(topic, data) for topic, _, data in kept if topic != "/diagnostics"]
    assert sorted(own) == sorted((t, d) for t, _, d in content(tmp_path / "copy") if t != "/diagnostics")


def test_a_full_disk_ends_the_run_in_one_line(
    start: Callable[..., Any], all_gone: Callable[..., bool], tmp_path: Path
) -> None:
    limit = 200_000  # bytes a file may have: the recorder meets it after some seconds of simulation

    def small_disk() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

    arguments = ("--record", tmp_path / "bag", "--lockstep", "--duration", 600)
    run = start("start_simulation.py", *TRUCK, *arguments, limit=small_disk)
    run.wait_until_ready()
    children = run.children
    code, _, errors = run.finish()
    assert code == 2 and "recorder ended (exit code 2): cannot write" in errors and "Traceback" not in errors
    assert all_gone(children)


# The node graph drives a simulator that somebody else wrote, and its bag is that truck's recording


def test_the_graph_drives_it_as_it_drives_itself(
    start: Callable[..., Any], shuttle: Path, tmp_path: Path
) -> None:
    text = f"python:{shuttle.stem}:make"
    arguments = ("--lockstep", "--duration", 6, "--leader", "sine", "--road", "sine")
    run = start(
        "start_simulation.py", "--simulator", text, "--policy", "baseline:acc", *arguments, "--record", "bag"
    )
    code, _, errors = run.finish()
    assert (code, errors) == (0, "")
    (drive,) = recordings.read(tmp_path / "bag")
    assert drive.interface.name == "shuttle" and len(drive) == 61
    again = simulators.free_run(simulators.load(text), drive.u[None], drive.w[None], drive.y[None, 0])
    np.testing.assert_allclose(again.y[0, 1:, 1], drive.y[1:, 1], atol=1e-3)
