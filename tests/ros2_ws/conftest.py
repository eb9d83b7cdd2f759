"""Runs of real processes: a ROS domain for each test, and the end of everything that it started."""

from __future__ import annotations

import contextlib
import fcntl
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from deeptruck_model.errors import InputError
from deeptruck_nodes import environment

sys.path.append(str(Path(__file__).parent))  # page_browser.py stands beside the tests
SCRIPTS = Path(__file__).parents[2] / "ros2_ws"


@pytest.fixture
def domain() -> Iterator[int]:
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
        environment = {**os.environ, "ROS_DOMAIN_ID": str(domain), "OMP_NUM_THREADS": "1"}
        process = subprocess.Popen(
            [sys.executable, str(SCRIPTS / script), *map(str, arguments), "--runs", str(tmp_path / runs)],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment, cwd=tmp_path,
            preexec_fn=limit,  # noqa: PLW1509 (there is one thread)
        )  # fmt: skip
        started.append(Started(process, tmp_path / runs))
        return started[-1]

    yield _start
    for run in started:
        children = run.children
        for pid in [run.process.pid, *children.values()] if run.process.poll() is None else []:
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        run.process.communicate()
