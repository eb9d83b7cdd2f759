"""Kill -9 and Ctrl-C at random moments: what is left is whole, and a second start gives what one gives.

    python tests/nothing_is_lost/kills.py [--runs 200] [--only train] [--seed 0]

Each command runs twice undisturbed, for its result and its length; then it is ended at moments drawn over
that length, a third of them in its last tenth, where results are written, and started again. Judged are the
bytes of the result, the place, processes and shared memory.
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
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
PROGRAMS = Path(sys.executable).parent
SAYS = "says.txt"
MARK = "DEEPTRUCK_KILLS"  # in the environment of every process that a run starts
FAREWELL_S = 60.0
LATE = 0.9  # part of the work behind which results are written
LATE_SHARE = 1 / 3  # of the runs is ended in that last part
TICKS = os.sysconf("SC_CLK_TCK")
LIMIT_S = 600.0
SHARED = Path("/dev/shm")
OF_THE_MACHINE = "lttng-ust-wait"  # one for all processes that trace, whoever was first


@dataclass(frozen=True)
class Command:
    """What is run in a folder with the bags `a` and `b`; `result` are the files whose bytes are compared."""

    name: str
    words: tuple[str, ...]
    result: str  # a pattern in `out`
    again: tuple[str, ...]  # what is added to go on


COMMANDS = tuple(
    Command(name, tuple(line.split()), result, (again,))
    for name, line, result, again in (
        ("train", "deeptruck-model train a --budget 40 --out out", "model.safetensors", "--resume"),
        (
            "mismatch",
            "deeptruck-model mismatch --simulator truck:trucksim --recordings a b --out out",
            "verdict.json",
            "--overwrite",
        ),
        (
            "cacc train",
            "deeptruck-cacc train --simulator truck:trucksim --scene paper --seeds 1 --iterations 4 "
            "--out out",
            "policy.safetensors",
            "--overwrite",
        ),
        (
            "record",
            "start_simulation.py --simulator truck:trucksim --policy baseline:cacc --leader sine:speed=18 "
            "--lockstep --duration 4 --record out",
            "metadata.yaml",
            "--overwrite",
        ),
    )
)


@dataclass(frozen=True)
class Disturbed:
    """One run that was ended: by which signal, at which part of its work, and what was wrong, if anything."""

    command: str
    number: signal.Signals
    part: float
    ended_before: bool
    wrong: tuple[str, ...]

    def __str__(self) -> str:
        end = ", after its end" if self.ended_before else ""
        return (
            f"{self.command}, {self.number.name} at {self.part:.3f}{end}: {'; '.join(self.wrong) or 'well'}"
        )


class Bench:
    """A folder with two short drives, and one command that is run in it undisturbed first."""

    def __init__(self, command: Command, folder: Path) -> None:
        self.command, self.folder, self.out = command, folder, folder / "out"
        self.started: list[subprocess.Popen[bytes]] = []
        _write_drives(folder)

    def undisturbed(self) -> None:
        """The result that is wanted, and how much computing it takes. The first run fills the caches: code
        that is compiled anew may round otherwise than code that is loaded."""
        wanted = []
        for _ in range(3):
            done, self.length_s = self._start(), 0.0
            while done.poll() is None:
                self.length_s = max(self.length_s, _computed_s(done.pid))
                time.sleep(0.02)
            if done.returncode:
                raise SystemExit(f"{self.command.name} fails undisturbed: {self._says()}")
            wanted.append(self._result())
            self._clear()
        self.wanted = wanted[1]
        if not wanted[1] or wanted[2] != wanted[1]:
            raise SystemExit(f"{self.command.name} gives another result each time: nothing can be compared")

    def disturb(self, number: signal.Signals, part: float) -> Disturbed:
        """End a run at a part of its work, look at what is left, start again and compare.

        The part is one of its computing, not of the clock's time, which depends on what else is running.
        """
        mark, shared = uuid.uuid4().hex, set[Path]()
        run = self._start(mark=mark)
        while run.poll() is None and _computed_s(run.pid) < part * self.length_s:
            shared |= _shared(mark)
            time.sleep(0.01)
        ended_before = run.poll() is not None
        with suppress(ProcessLookupError):  # Ctrl-C reaches all of them, kill -9 only whom it names
            os.killpg(run.pid, number) if number == signal.SIGINT else os.kill(run.pid, number)
        run.wait(FAREWELL_S)
        wrong = [*self._left_over(mark, shared), *self._half_written()]
        wrong += self._go_on()
        self._clear()
        return Disturbed(self.command.name, number, part, ended_before, tuple(wrong))

    def _start(self, *more: str, mark: str = "") -> subprocess.Popen[bytes]:
        program, *words = self.command.words
        script = ROOT / "ros2_ws" / program
        start = [sys.executable, str(script)] if script.exists() else [str(PROGRAMS / program)]
        with (self.folder / SAYS).open("w") as says:
            run = subprocess.Popen(
                [*start, *words, *more],
                cwd=self.folder,
                stdout=subprocess.DEVNULL,
                stderr=says,
                start_new_session=True,
                env={**os.environ, MARK: mark, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
            )
        _as_low(run.pid)
        self.started.append(run)
        return run

    def _says(self) -> str:
        return " ".join((self.folder / SAYS).read_text().split())

    def end(self) -> None:
        """End what still runs, where the bench itself is interrupted."""
        for run in self.started:
            if run.poll() is None:
                run.kill()
                run.wait()

    def _left_over(self, mark: str, shared: set[Path]) -> Iterator[str]:
        """Processes of the run, and shared memory that they had open and nobody has now.

        What others made meanwhile is not the run's: graphs of other tests come and go beside it.
        """
        end = time.monotonic() + FAREWELL_S
        while (left := list(_marked(mark))) and time.monotonic() < end:
            shared |= _shared(mark)
            time.sleep(0.2)
        for process, says in left:
            yield f"process left: {says}"
            os.kill(process, signal.SIGKILL)
        others = {entry for process in _processes() for entry in _opened(process)}
        for entry in sorted(shared - others):
            if entry.exists():
                yield f"shared memory left: {entry}"

    def _half_written(self) -> Iterator[str]:
        """A folder under its final name is empty, or holds the whole result."""
        if self.command.name == "record" or not self.out.exists() or not any(self.out.iterdir()):
            return
        if self._result() != self.wanted:
            yield f"half a result under its final name: {sorted(p.name for p in self.out.iterdir())}"

    def _go_on(self) -> Iterator[str]:
        if self.command.name == "record" and (left := self._repaired()):
            yield left
        run = self._start(*self.command.again)
        run.wait(LIMIT_S)
        if run.returncode:
            yield f"cannot be started again: {self._says()}"
        elif self._result() != self.wanted:
            yield "started again, it gives something else"

    def _repaired(self) -> str:
        """What hinders the bag that a killed recorder left from being repaired; '' where nothing does."""
        if not any(path.stat().st_size for path in self.out.glob("*.mcap")):
            return ""
        script = PROGRAMS / "deeptruck-model"
        done = subprocess.run(
            [script, "repair", "out"], cwd=self.folder, capture_output=True, text=True, check=False
        )
        left = done.stderr if done.returncode else ""
        for name in ("*.cut", "*.before"):
            for path in self.out.glob(name):
                path.unlink()
        return left

    def _result(self) -> dict[str, str]:
        """The compared files by name: bytes; of a bag, its messages by topic."""
        found = {}
        for path in sorted(self.out.glob(self.command.result)):
            found[path.relative_to(self.out).as_posix()] = _content(path)
        return found

    def _clear(self) -> None:
        for path in self.folder.iterdir():
            if path.name not in ("a", "b"):
                shutil.rmtree(path) if path.is_dir() else path.unlink()


def _content(path: Path) -> str:
    if path.name == "metadata.yaml":
        import yaml

        found = yaml.safe_load(path.read_text())["rosbag2_bagfile_information"]
        topics = found["topics_with_message_count"]
        return json.dumps({t["topic_metadata"]["name"]: t["message_count"] for t in topics}, sort_keys=True)
    return path.read_bytes().hex()


def _write_drives(folder: Path) -> None:
    from deeptruck_model import trucks
    from deeptruck_model.recordings import write_bag
    from deeptruck_model.trucks import driving_cycles

    truck = trucks.load("trucksim").with_parameters({"mass": 30e3})
    for seed, name in enumerate("ab"):
        drive = driving_cycles.drive(truck, seconds=120.0, seed=seed, name=name)
        write_bag(folder / name, [drive], interface=truck.interface)


def _processes() -> Iterator[Path]:
    return Path("/proc").glob("[0-9]*")


def _marked(mark: str) -> Iterator[tuple[int, str]]:
    """Processes that carry the mark: number and command line."""
    for path in _processes():
        try:
            if f"{MARK}={mark}".encode() in (path / "environ").read_bytes():
                yield int(path.name), (path / "cmdline").read_bytes().replace(b"\0", b" ").decode()
        except OSError:  # it has ended, or is another user's
            continue


def _as_low(session: int) -> None:
    """A new session is scheduled as a group of its own: give it our priority, where the system has such."""
    with suppress(OSError):
        Path(f"/proc/{session}/autogroup").write_text(str(os.nice(0)))


def _computed_s(session: int) -> float:
    """Seconds that the processes of a session have computed, on all cores; those that ended count too."""
    total = 0
    for path in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            after_name = path.read_text().rpartition(")")[2].split()
            if int(after_name[3]) == session:
                total += sum(map(int, after_name[11:15]))
    return total / TICKS


def _shared(mark: str) -> set[Path]:
    """Shared memory that the marked processes have open."""
    return {entry for number, _ in _marked(mark) for entry in _opened(Path(f"/proc/{number}"))}


def _opened(process: Path) -> set[Path]:
    """Entries of shared memory that a process has mapped, or has open as a file."""
    found: set[Path] = set()
    with suppress(OSError):  # it has ended, or is another user's
        lines = (process / "maps").read_text().splitlines()
        found |= {Path(line.split(maxsplit=5)[5]) for line in lines if f"{SHARED}/" in line}
        found |= {link.readlink() for link in (process / "fd").iterdir()}
    return {e for e in found if e.parent == SHARED and not e.name.startswith(OF_THE_MACHINE)}


def disturbed(names: Sequence[str], runs: int, seed: int) -> Iterator[Disturbed]:
    """`runs` disturbed runs, shared among the commands."""
    draw = random.Random(seed)
    chosen = [command for command in COMMANDS if command.name in names]
    for index, command in enumerate(chosen):
        with tempfile.TemporaryDirectory() as folder:
            bench = Bench(command, Path(folder))
            try:
                bench.undisturbed()
                for _ in range(index, runs, len(chosen)):
                    number = draw.choice((signal.SIGKILL, signal.SIGINT))
                    late = draw.random() < LATE_SHARE
                    yield bench.disturb(number, draw.uniform(LATE if late else 0.0, 1.0))
            finally:
                bench.end()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    names = [command.name for command in COMMANDS]
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--only", action="append", choices=names)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # what it has started ends with it
    found = []
    for one in disturbed(given.only or names, given.runs, given.seed):
        found.append(one)
        print(f"{len(found)}: {one}", flush=True)
    bad = sum(bool(one.wrong) for one in found)
    print(f"{len(found)} runs, {bad} with something wrong")
    raise SystemExit(bool(bad))


if __name__ == "__main__":
    main()
