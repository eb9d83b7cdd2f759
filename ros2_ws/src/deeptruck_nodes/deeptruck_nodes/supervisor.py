"""Starts the processes of a run together, watches them, and always ends them in order."""

from __future__ import annotations

import contextlib
import ctypes
import os
import signal
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from deeptruck_nodes.environment import DOMAIN, ENDED
from deeptruck_nodes.lifeline import VARIABLE, LifelineHolder

POLL = 0.05  # s
READY_WITHIN = 120.0  # s; a first start compiles the physics truck
PATIENCE = ((signal.SIGINT, 6.0), (signal.SIGTERM, 2.0), (signal.SIGKILL, 2.0))  # s for each
EARLY_PATIENCE = ((signal.SIGTERM, 8.0), (signal.SIGKILL, 2.0))  # during imports SIGINT prints a traceback
SPECTATOR_PATIENCE = ((signal.SIGINT, 1.0), (signal.SIGKILL, 2.0))
SPECTATOR_NICE = 10  # a tenth of the weight of a node where both want a core
_PR_SET_PDEATHSIG = 1


@dataclass(frozen=True)
class Program:
    """One process of a run. A program with `ends_run` ends the run when it exits with 0; any other exit is a
    failure.

    The output of a program with `speaks` goes to the terminal as well as to its log. A `spectator` only
    observes: no process waits for it, it has a lower priority, and the run goes on without it.
    """

    name: str
    argv: Sequence[str]
    ends_run: bool = False
    says_ready: bool = True  # through its lifeline; otherwise it counts as ready at once
    speaks: bool = False
    spectator: bool = False
    priority: int = 0  # SCHED_FIFO, from when the run goes, where the user may have it; 0: none
    environment: Mapping[str, str] = field(default_factory=dict)  # beside that of the run
    descriptors: tuple[int, ...] = ()  # to inherit


@dataclass
class _Child:
    program: Program
    process: subprocess.Popen[bytes]
    log: Path
    lifeline: LifelineHolder = field(default_factory=LifelineHolder)
    repeated: int = 0  # bytes of the log that went to the terminal
    lost: bool = False  # a spectator that died, which was said

    def repeat(self) -> None:
        """Copy new complete lines of the log to the terminal."""
        if not self.program.speaks or self.log.stat().st_size == self.repeated:
            return
        with self.log.open("rb") as log:
            log.seek(self.repeated)
            new = log.read()
        lines = new[: new.rfind(b"\n") + 1]
        self.repeated += len(lines)
        for line in lines.decode(errors="replace").splitlines():
            print(f"{self.program.name}: {line}", flush=True)

    def is_ready(self) -> bool:
        return self.program.spectator or not self.program.says_ready or self.lifeline.poll()

    def how_it_ended(self, code: int) -> str:
        how = f"killed by {signal.Signals(-code).name}" if code < 0 else f"exit code {code}"
        return f"{self.program.name} ended ({how}): {self.last_words()}"

    def last_words(self) -> str:
        lines = [line for line in self.log.read_text(errors="replace").splitlines() if line.strip()]
        return lines[-1].strip() if lines else "it said nothing"


class Supervisor:
    """Runs `programs`, started in this order and ended in the reverse order."""

    def __init__(
        self, folder: Path, programs: Sequence[Program], environment: Mapping[str, str], lock: int
    ) -> None:
        self._folder, self._programs = folder, programs
        self._environment, self._lock = dict(environment), lock
        self._children: list[_Child] = []
        self._asked = 0  # how often the end was requested
        self._going = False
        self.why = "it never began"
        """why the run ended, in a few words"""

    def run(self, duration: float = 0.0) -> int:
        """Run until a program ends the run, `duration` s (0: no limit) have passed, or a signal requests the
        end.

        Returns the exit code: 0 after a regular end, 2 if a program refused its input, else 1.
        """
        before = {number: signal.signal(number, self._on_signal) for number in _ends()}
        try:  # from its first word on a run ends as one that was asked to
            domain = self._environment[DOMAIN]
            print(f"logs in {os.path.relpath(self._folder)}, ROS domain {domain}", flush=True)
            for program in self._programs:
                self._children.append(self._start(program))
            code = self._until_ready()
            return self._watch(duration) if code is None else code
        finally:
            self._end()
            for number, handler in before.items():
                signal.signal(number, handler)

    def _on_signal(self, number: int, frame: object) -> None:
        self._asked += 1

    def _start(self, program: Program) -> _Child:
        log, lifeline = self._folder / f"{program.name}.log", LifelineHolder()
        with log.open("wb") as output:
            process = subprocess.Popen(
                program.argv,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                env={**self._environment, **program.environment, VARIABLE: str(lifeline.child)},
                pass_fds=(lifeline.child, self._lock, *program.descriptors),
                start_new_session=True,  # Ctrl-C reaches the supervisor alone, which then keeps the order
                preexec_fn=partial(_begin, os.getpid(), program.spectator),  # noqa: PLW1509 (there is one thread)
            )
        lifeline.handed_over()
        return _Child(program, process, log, lifeline)

    def _until_ready(self) -> int | None:
        """None when every process is ready and was started, else the run's exit code."""
        begun = time.monotonic()
        while waiting := [child for child in self._children if not child.is_ready()]:
            code = self._verdict()
            if code is not None:
                return code
            if time.monotonic() - begun > READY_WITHIN:
                names = ", ".join(child.program.name for child in waiting)
                self.why = "not everything got ready"
                return _complain(f"not ready after {READY_WITHIN:g} s: {names}; see {self._folder}")
            time.sleep(POLL)
        if (code := self._verdict()) is not None:  # asked to end as the last got ready: an older bag stands
            return code
        print(
            f"ready after {time.monotonic() - begun:.1f} s: {', '.join(p.name for p in self._programs)}",
            flush=True,
        )
        self._going = True
        for child in self._children:
            _hurry(child.process.pid, child.program.priority)
            child.lifeline.go()
        return None

    def _watch(self, duration: float) -> int:
        begun = time.monotonic()
        while (code := self._verdict()) is None:
            for child in self._children:
                child.repeat()
            if duration and time.monotonic() - begun >= duration:
                self.why = f"{duration:g} s have passed"
                return 0
            time.sleep(POLL)
        return code

    def _verdict(self) -> int | None:
        """The exit code of the run if it is over, else None."""
        if self._asked:
            print("stopping", flush=True)
            self.why = "you asked it to"
            return 0
        for child in self._children:
            code = child.process.poll()
            if code is None or child.lost:
                continue
            if child.program.spectator:
                child.lost = True
                _complain(f"{child.how_it_ended(code)}; the run goes on without it")
                continue
            if code == 0 and child.program.ends_run:
                self.why = f"{child.program.name} has finished"
                return 0
            self.why = f"{child.program.name} failed"
            if code != 2:
                return _complain(child.how_it_ended(code))
            child.repeated = child.log.stat().st_size  # its one line is in the complaint
            return _complain(child.how_it_ended(code), code)
        return None

    def _end(self) -> None:
        with contextlib.suppress(OSError):  # a full disk
            (self._folder / ENDED).write_text(f"{self.why}\n")
        usual = PATIENCE if self._going else EARLY_PATIENCE
        for child in reversed(self._children):
            for number, patience in SPECTATOR_PATIENCE if child.program.spectator else usual:
                if self._ended(child, number, patience):
                    break
            child.repeat()
            child.lifeline.close()

    def _ended(self, child: _Child, number: signal.Signals, patience: float) -> bool:
        if child.process.poll() is not None:
            return True
        asked = self._asked
        child.process.send_signal(number)
        until = time.monotonic() + patience
        while time.monotonic() < until and self._asked <= max(asked, 1):  # a second Ctrl-C is impatience
            if child.process.poll() is not None:
                return True
            time.sleep(0.01)
        return child.process.poll() is not None


def _ends() -> list[signal.Signals]:
    """The signals that end a run; SIGHUP does not where it is ignored, as under nohup."""
    hangs_up = signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN
    return [signal.SIGINT, signal.SIGTERM, *([signal.SIGHUP] if hangs_up else [])]


def _begin(parent: int, spectator: bool) -> None:
    """Runs in the child: the kernel ends it if the supervisor is killed. A spectator gets a lower
    priority."""
    if spectator:
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
        os.nice(SPECTATOR_NICE)
    _LIBC.prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
    if os.getppid() != parent:  # killed before the kernel was asked
        os._exit(1)


def _hurry(pid: int, priority: int) -> None:
    """Give all threads of a process a real-time priority, if the user may; 0 changes nothing."""
    if priority:
        with contextlib.suppress(OSError):  # no right, or the process has ended
            for thread in Path(f"/proc/{pid}/task").iterdir():
                os.sched_setscheduler(int(thread.name), os.SCHED_FIFO, os.sched_param(priority))


_LIBC = ctypes.CDLL(None)


def node(name: str, parameters: Path, *, ends_run: bool = False, speaks: bool = False) -> Program:
    """The program of one of our nodes, with a parameter file."""
    argv = (sys.executable, "-m", f"deeptruck_nodes.{name}", "--ros-args", "--params-file", str(parameters))
    return Program(name, argv, ends_run, speaks=speaks)


def _complain(text: str, code: int = 1) -> int:
    print(text, file=sys.stderr, flush=True)
    return code
