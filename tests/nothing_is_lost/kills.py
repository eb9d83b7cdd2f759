"""Kill -9 and Ctrl-C at random moments: what is left is whole, and a second start gives what one gives.

    python tests/nothing_is_lost/kills.py [--runs 200] [--only train] [--seed 0]

Each command runs undisturbed for its result and its length; then it is ended at moments drawn over that
length, a third of them in its last tenth, where results are written, and started again. Judged are the bytes
of the result, the place, processes and shared memory.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import uuid
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path

import yaml

from deeptruck_model import trucks
from deeptruck_model.recordings import write_bag
from deeptruck_model.trucks import driving_cycles

ROOT = Path(__file__).parents[2]
MARK = "DEEPTRUCK_KILLS"  # in the environment of every process that a run starts
FAREWELL_S, LIMIT_S = 60.0, 600.0
LATE = 0.9  # part of the work behind which results are written; a third of the runs is ended there
SHARED = Path("/dev/shm")
OF_THE_MACHINE = "lttng-ust-wait"  # one for all processes that trace, whoever was first
# By name: command line in a folder with the bags `a` and `b`, files in `out` whose bytes are compared, and
# what is added to start again.
COMMANDS = {
    "train": ("deeptruck-model train a --budget 40 --out out", "model.safetensors", "--resume"),
    "mismatch": (
        "deeptruck-model mismatch --simulator truck:trucksim --recordings a b --out out",
        "verdict.json", "--overwrite",
    ),
    "cacc train": (
        "deeptruck-cacc train --simulator truck:trucksim --scene paper --seeds 1 --iterations 4 --out out",
        "policy.safetensors", "--overwrite",
    ),
    "record": (
        "start_simulation.py --simulator truck:trucksim --policy baseline:cacc --leader sine:speed=18 "
        "--lockstep --duration 4 --record out",
        "metadata.yaml", "--overwrite",
    ),
}  # fmt: skip


class Bench:
    """A folder with two short drives, and one command that is run in it undisturbed first."""

    def __init__(self, name: str, folder: Path) -> None:
        line, self.pattern, self.again = COMMANDS[name]
        self.words, self.folder, self.out = line.split(), folder, folder / "out"
        self.started: list[subprocess.Popen[bytes]] = []
        truck = trucks.load("trucksim").with_parameters({"mass": 30e3})
        for seed, bag in enumerate("ab"):
            drive = driving_cycles.drive(truck, seconds=120.0, seed=seed, name=bag)
            write_bag(folder / bag, [drive], interface=truck.interface)
        wanted = []
        for _ in range(
            3
        ):  # the first fills the caches: code that is compiled may round otherwise than loaded
            done, self.length_s = self.start(), 0.0
            while done.poll() is None:
                self.length_s = max(self.length_s, _computed_s(done.pid))
                time.sleep(0.02)
            if done.returncode:
                raise SystemExit(f"{name} fails undisturbed: {self.says()}")
            wanted.append(self.result())
            self.clear()
        self.wanted = wanted[1]
        if not wanted[1] or wanted[2] != wanted[1]:
            raise SystemExit(f"{name} gives another result each time: nothing can be compared")

    def disturb(self, number: signal.Signals, part: float) -> list[str]:
        """End a run at a part of its work, look at what is left, start again: what is wrong, if anything.

        The part is one of its computing, not of the clock's time, which depends on what else is running.
        """
        mark, shared = uuid.uuid4().hex, set[Path]()
        run = self.start(mark=mark)
        while run.poll() is None and _computed_s(run.pid) < part * self.length_s:
            shared |= _shared(mark)
            time.sleep(0.01)
        with suppress(ProcessLookupError):  # Ctrl-C reaches all of them, kill -9 only whom it names
            os.killpg(run.pid, number) if number == signal.SIGINT else os.kill(run.pid, number)
        run.wait(FAREWELL_S)
        wrong = [*_left_over(mark, shared), *self.half_written(), *self.go_on()]
        self.clear()
        return wrong

    def start(self, *more: str, mark: str = "") -> subprocess.Popen[bytes]:
        script = ROOT / "ros2_ws" / self.words[0]
        program = [sys.executable, str(script)] if script.exists() else [_program(self.words[0])]
        with (self.folder / "says.txt").open("w") as says:
            run = subprocess.Popen(
                [*program, *self.words[1:], *more],
                cwd=self.folder, stdout=subprocess.DEVNULL, stderr=says, start_new_session=True,
                env={**os.environ, MARK: mark, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
            )  # fmt: skip
        with suppress(OSError):  # a new session is scheduled as a group of its own: give it our priority
            Path(f"/proc/{run.pid}/autogroup").write_text(str(os.nice(0)))
        self.started.append(run)
        return run

    def says(self) -> str:
        return " ".join((self.folder / "says.txt").read_text().split())

    def half_written(self) -> Iterator[str]:
        """A folder under its final name is empty, or holds the whole result; a bag may be repaired."""
        if self.pattern != "metadata.yaml":
            if self.out.exists() and any(self.out.iterdir()) and self.result() != self.wanted:
                yield f"half a result under its final name: {sorted(p.name for p in self.out.iterdir())}"
        elif any(path.stat().st_size for path in self.out.glob("*.mcap")):
            repair = [_program("deeptruck-model"), "repair", "out"]
            done = subprocess.run(repair, cwd=self.folder, capture_output=True, text=True, check=False)
            if done.returncode:
                yield done.stderr
            for path in (*self.out.glob("*.cut"), *self.out.glob("*.before")):
                path.unlink()

    def go_on(self) -> Iterator[str]:
        run = self.start(self.again)
        run.wait(LIMIT_S)
        if run.returncode:
            yield f"cannot be started again: {self.says()}"
        elif self.result() != self.wanted:
            yield "started again, it gives something else"

    def result(self) -> dict[str, str]:
        """The compared files by name: bytes; of a bag, its messages by topic."""
        paths = sorted(self.out.glob(self.pattern))
        return {
            path.name: _counts(path) if path.suffix == ".yaml" else path.read_bytes().hex() for path in paths
        }

    def clear(self) -> None:
        for path in self.folder.iterdir():
            if path.name not in ("a", "b"):
                shutil.rmtree(path) if path.is_dir() else path.unlink()


def _program(name: str) -> str:
    return str(Path(sys.executable).with_name(name))


def _counts(path: Path) -> str:
    found = yaml.safe_load(path.read_text())["rosbag2_bagfile_information"]["topics_with_message_count"]
    return json.dumps({t["topic_metadata"]["name"]: t["message_count"] for t in found}, sort_keys=True)


def _left_over(mark: str, shared: set[Path]) -> Iterator[str]:
    """Processes of the run, and shared memory that they had open and nobody has now."""
    end = time.monotonic() + FAREWELL_S
    while (left := list(_marked(mark))) and time.monotonic() < end:
        shared |= _shared(mark)
        time.sleep(0.2)
    for process in left:
        yield f"process left: {(process / 'cmdline').read_bytes().replace(bytes(1), b' ').decode()}"
        os.kill(int(process.name), signal.SIGKILL)
    others = {entry for process in _processes() for entry in _opened(process)}
    yield from (f"shared memory left: {entry}" for entry in sorted(shared - others) if entry.exists())


def _processes() -> Iterator[Path]:
    return Path("/proc").glob("[0-9]*")


def _marked(mark: str) -> Iterator[Path]:
    """Processes that carry the mark."""
    for process in _processes():
        with suppress(OSError):  # it has ended, or is another user's
            if f"{MARK}={mark}".encode() in (process / "environ").read_bytes():
                yield process


def _computed_s(session: int) -> float:
    """Seconds that the processes of a session have computed, on all cores; those that ended count too."""
    total = 0
    for process in _processes():
        with suppress(OSError):
            after_name = (process / "stat").read_text().rpartition(")")[2].split()
            total += sum(map(int, after_name[11:15])) if int(after_name[3]) == session else 0
    return total / os.sysconf("SC_CLK_TCK")


def _shared(mark: str) -> set[Path]:
    """Shared memory that the marked processes have open."""
    return {entry for process in _marked(mark) for entry in _opened(process)}


def _opened(process: Path) -> set[Path]:
    """Entries of shared memory that a process has mapped, or has open as a file."""
    found: set[Path] = set()
    with suppress(OSError):  # it has ended, or is another user's
        lines = (process / "maps").read_text().splitlines()
        found |= {Path(line.split(maxsplit=5)[5]) for line in lines if f"{SHARED}/" in line}
        found |= {link.readlink() for link in (process / "fd").iterdir()}
    return {e for e in found if e.parent == SHARED and not e.name.startswith(OF_THE_MACHINE)}


def disturbed(names: Sequence[str], runs: int, seed: int) -> Iterator[tuple[str, list[str]]]:
    """What was done, and what was wrong with it, of `runs` disturbed runs, shared among the commands."""
    draw = random.Random(seed)
    signal.signal(signal.SIGINT, signal.default_int_handler)  # which a job in the background has ignored
    for index, name in enumerate(names):
        with tempfile.TemporaryDirectory() as folder:
            bench = None
            try:
                bench = Bench(name, Path(folder))
                for _ in range(index, runs, len(names)):
                    number = draw.choice((signal.SIGKILL, signal.SIGINT))
                    part = draw.uniform(LATE if draw.random() < 1 / 3 else 0.0, 1.0)
                    yield f"{name}, {number.name} at {part:.3f}", bench.disturb(number, part)
            finally:
                for run in bench.started if bench else ():
                    run.kill()  # where the bench itself is interrupted
                    run.wait()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--only", action="append", choices=list(COMMANDS))
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # what it has started ends with it
    bad = 0
    for number, (what, wrong) in enumerate(
        disturbed(given.only or list(COMMANDS), given.runs, given.seed), 1
    ):
        bad += bool(wrong)
        print(f"{number}: {what}: {'; '.join(wrong) or 'well'}", flush=True)
    print(f"{given.runs} runs, {bad} with something wrong")
    raise SystemExit(bool(bad))


if __name__ == "__main__":
    main()
