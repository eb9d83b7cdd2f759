"""Runs the steps, two at a time; what is done is kept unless something before it changed."""

from __future__ import annotations

import contextlib
import json
import os
import re
import subprocess
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from deeptruck_core import files
from examples.demo.steps import Step

POLL_S = 0.2
ESCAPES = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]")
BACKGROUND, AHEAD = 10, -10  # niceness
FAREWELL_S = 20.0  # an interrupted node graph ends in order


class StepError(Exception):
    """A step failed; one line."""


@dataclass
class Progress:
    """Where a step stands, for whoever shows it."""

    step: Step
    state: str = "waiting"  # waiting, running, done, kept, failed
    begun: float = 0.0
    seconds: float = 0.0
    says: str = ""


@dataclass
class Runner:
    """The demo's folder and how far it is. `show` is called whenever something moved."""

    out: Path
    steps: Sequence[Step]
    show: Callable[[Sequence[Progress]], None]
    workers: int = 2
    progress: dict[str, Progress] = field(init=False)
    _stop: bool = field(default=False, init=False)

    def __post_init__(self) -> None:
        self.progress = {step.name: Progress(step) for step in self.steps}

    def run(self) -> None:
        """All steps. Raises StepError at the first that fails, after ending those still running."""
        (self.out / "logs").mkdir(parents=True, exist_ok=True)
        running: dict[Future[None], str] = {}
        with ThreadPoolExecutor(self.workers) as pool:
            try:
                while running or self._unfinished():
                    for step in self._ready():
                        if len(running) < self.workers:
                            self.progress[step.name].state = "running"
                            running[pool.submit(self._do, step)] = step.name
                    finished, _ = wait(running, timeout=POLL_S, return_when=FIRST_COMPLETED)
                    for future in finished:
                        del running[future]
                        future.result()
                    self.show(list(self.progress.values()))
            finally:
                self._stop = True

    def forget(self, names: Sequence[str]) -> None:
        """Do these steps again."""
        for name in names:
            if mark := self._mark(name):
                self._write_mark(name, {**mark, "command": None, "done": None})

    def _unfinished(self) -> bool:
        return any(p.state in ("waiting", "running") for p in self.progress.values())

    def _ready(self) -> Iterator[Step]:
        for p in self.progress.values():
            before = (self.progress[need].state for need in p.step.needs)
            if p.state == "waiting" and all(state in ("done", "kept") for state in before):
                yield p.step

    def _do(self, step: Step) -> None:
        p = self.progress[step.name]
        identity = {"command": step.command, "after": [self._mark(need)["done"] for need in step.needs]}
        before = self._mark(step.name)
        same = {key: before.get(key) for key in identity} == json.loads(json.dumps(identity))
        if same and before.get("done") and (self.out / step.makes).exists():
            p.state, p.seconds = "kept", before["seconds"]
            return
        p.begun = time.monotonic()
        self._write_mark(step.name, {**identity, "done": None, "seconds": 0.0})
        self._execute(step, p, "--resume" if same and step.resumable else "--overwrite")
        if step.doubts is not None and step.doubts():
            self._execute(step, p, "--overwrite")
        p.seconds = time.monotonic() - p.begun
        self._write_mark(step.name, {**identity, "done": time.time(), "seconds": p.seconds})
        p.state = "done"  # last: a step that waits for this one reads the mark

    def _write_mark(self, name: str, content: dict[str, Any]) -> None:
        files.write(self.out / "logs" / f"{name}.json", json.dumps(content).encode())

    def _mark(self, name: str) -> dict[str, Any]:
        try:
            found: dict[str, Any] = json.loads((self.out / "logs" / f"{name}.json").read_text())
        except (OSError, json.JSONDecodeError):
            return {}
        return found

    def _execute(self, step: Step, p: Progress, how: str) -> None:
        """Run the command; `how` it treats what stands at its place. The rule on writing is the command's."""
        log = self.out / "logs" / f"{step.name}.log"
        raw = log.with_suffix(".raw")
        with raw.open("wb") as output:
            process = subprocess.Popen(
                (*step.command, how),
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                env=self._environment(step),
                start_new_session=True,  # Ctrl-C reaches the demo alone, which passes it on
            )
        with contextlib.suppress(PermissionError):  # only root may go ahead of others
            os.setpriority(os.PRIO_PROCESS, process.pid, AHEAD if step.real_time else BACKGROUND)
        while process.poll() is None:
            p.says = last_line(raw)
            if self._stop:
                _end(process)
            time.sleep(POLL_S)
        files.write(log, ("\n".join(_plain(raw.read_bytes())) + "\n").encode())
        raw.unlink()
        if self._stop:
            p.state = "waiting"
            raise StepError("interrupted")
        if process.returncode:
            p.state = "failed"
            raise StepError(
                f"step '{step.name}' failed (exit code {process.returncode}): {last_line(log)}; "
                f"all it said is in {os.path.relpath(log)}; run again to go on from here"
            )

    def _environment(self, step: Step) -> dict[str, str]:
        """One thread a step, and a ROS domain for each: two may run node graphs at the same time."""
        first = int(os.environ.get("ROS_DOMAIN_ID") or 0)
        domain = (first + list(self.progress).index(step.name)) % 102
        quiet = {"OMP_NUM_THREADS": "1", "MPLBACKEND": "Agg", "COLUMNS": "120", "TTY_COMPATIBLE": "1"}
        return {**os.environ, **quiet, "ROS_DOMAIN_ID": str(domain), "PYTHONUNBUFFERED": "1"}


def _end(process: subprocess.Popen[bytes]) -> None:
    process.send_signal(2)
    try:
        process.wait(FAREWELL_S)
    except subprocess.TimeoutExpired:
        process.kill()


def last_line(log: Path) -> str:
    """The last line of a log that says something, as a terminal shows it; '' where there is none."""
    with log.open("rb") as file:
        file.seek(max(0, log.stat().st_size - 4000))
        lines = _plain(file.read())
    return lines[-1] if lines else ""


def _plain(output: bytes) -> list[str]:
    """Lines as they stand at the end: no colours, of a progress bar its last state, and paths from here."""
    text = ESCAPES.sub("", output.decode(errors="replace")).replace(f"{Path.cwd()}/", "")
    lines = [line.rstrip("\r").rpartition("\r")[2].rstrip() for line in text.split("\n")]
    return [line for line in lines if line.strip()]
