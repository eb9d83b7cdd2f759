"""Runs of real processes: a ROS domain for each test, and the end of everything that it started."""

from __future__ import annotations

import contextlib
import fcntl
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest

from deeptruck_core.errors import InputError
from deeptruck_nodes import environment

sys.path.append(str(Path(__file__).parent))  # page_browser.py stands beside the tests
SCRIPTS = Path(__file__).parents[2] / "ros2_ws"
LOCKSTEP = (
    "--simulator", "truck:trucksim", "--policy", "baseline:acc", "--leader", "sine", "--road", "sine",
    "--seed", 1, "--lockstep", "--duration", 10,
)  # fmt: skip


@contextlib.contextmanager
def reserved_domain() -> Iterator[int]:
    """A ROS domain that no other test on this machine uses."""
    with contextlib.ExitStack() as stack:
        for number in range(101, 0, -1):
            path = Path(tempfile.gettempdir()) / f"deeptruck-test-domain-{number}.lock"
            file = stack.enter_context(path.open("w"))
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                continue
            yield number
            assert free(number), f"processes of this test still use ROS domain {number}"
            return
        raise RuntimeError("all ROS domains are taken")


@pytest.fixture
def domain() -> Iterator[int]:
    """A ROS domain that no other test on this machine uses."""
    with reserved_domain() as number:
        yield number


def free(domain: int, within: float = 60.0) -> bool:
    """Whether the last process of every run in a domain ends in time, even if its supervisor was killed."""
    until = time.monotonic() + within
    while time.monotonic() < until:
        with contextlib.suppress(InputError):
            environment.DomainLock(domain).release()
            return True
        time.sleep(0.05)
    return False


class Started:
    """A started script: its output, its nodes, and their process ids."""

    def __init__(self, process: subprocess.Popen[str], runs: Path) -> None:
        self.process, self.runs = process, runs

    def wait_until_ready(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            if line.startswith("ready after"):
                return
        raise AssertionError(f"never ready: {self.finish()}")

    def finish(self, timeout: float = 240) -> tuple[int, str, str]:
        """(exit code, output, errors) of the script."""
        out, err = self.process.communicate(timeout=timeout)
        return self.process.returncode, out, err

    @property
    def children(self) -> dict[str, int]:
        """Process ids by node name."""
        listed = subprocess.run(
            ["ps", "--ppid", str(self.process.pid), "-o", "pid=,args="],
            capture_output=True, text=True, check=False,
        )  # fmt: skip
        found = {}
        for line in listed.stdout.splitlines():
            pid, _, arguments = line.strip().partition(" ")
            module = arguments.partition(" -m ")[2].split(" ")[0]
            if module:
                found[module.rpartition(".")[2]] = int(pid)
        return found

    @property
    def logs(self) -> Path:
        (folder,) = self.runs.iterdir()
        return folder


def gone(pid: int, within: float = 60.0) -> bool:
    """Whether a process ends in time; a zombie has ended."""
    until = time.monotonic() + within
    while time.monotonic() < until:
        try:
            state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
        except (FileNotFoundError, ProcessLookupError):
            return True
        if state == "Z" and len(list(Path(f"/proc/{pid}/task").iterdir())) == 1:  # its threads have ended too
            return True
        time.sleep(0.02)
    return False


def until(holds: Callable[[], object], within: float = 120.0) -> None:
    """Wait for a condition that takes longer on a busy machine."""
    latest = time.monotonic() + within
    while not holds():
        assert time.monotonic() < latest, "it never happened"
        time.sleep(0.02)


def begun(domain: int, folder: Path, runs: str, words: Sequence[object], **options: Any) -> Started:
    """A script that runs in a folder, and writes its logs to `runs` in it."""
    environment = {**os.environ, "ROS_DOMAIN_ID": str(domain), "OMP_NUM_THREADS": "1"}
    script, *arguments = map(str, words)
    process = subprocess.Popen(
        [sys.executable, str(SCRIPTS / script), *arguments, "--runs", str(folder / runs)],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment, cwd=folder, **options,
    )  # fmt: skip
    return Started(process, folder / runs)


@pytest.fixture(scope="session")
def lockstep() -> tuple[object, ...]:
    """The arguments of the run of `lockstep_bag`."""
    return LOCKSTEP


@pytest.fixture(scope="session")
def lockstep_bag(once: Callable[[str, Callable[[Path], object]], Path]) -> Path:
    """The bag of a run that is made once for all workers; tests that change it copy it."""

    def make(folder: Path) -> None:
        shutil.rmtree(folder, ignore_errors=True)  # of a worker in which it failed
        folder.mkdir()
        with reserved_domain() as number:
            words = ("start_simulation.py", *LOCKSTEP, "--record", folder / "bag")
            code, out, errors = begun(number, folder, "runs", words).finish()
        assert (code, errors) == (0, ""), errors
        assert out.splitlines()[-1] == f"ended: truck_sim has finished; recorded in {folder / 'bag'}"

    return once("lockstep", make) / "bag"


@pytest.fixture
def eventually() -> Callable[..., None]:
    return until


@pytest.fixture
def all_gone() -> Callable[[dict[str, int]], bool]:
    return lambda pids: all(gone(pid) for pid in pids.values())


@pytest.fixture
def start(domain: int, tmp_path: Path) -> Iterator[Callable[..., Started]]:
    """Start one of the scripts with arguments; processes left at the end of the test are killed by
    their id."""
    started: list[Started] = []

    def _start(
        script: str, *arguments: object, runs: str = "runs", limit: Callable[[], None] | None = None
    ) -> Started:
        started.append(begun(domain, tmp_path, runs, (script, *arguments), preexec_fn=limit))
        return started[-1]

    yield _start
    for run in started:
        children = run.children
        for pid in [run.process.pid, *children.values()] if run.process.poll() is None else []:
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        run.process.communicate()
