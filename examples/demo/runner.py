"""Runs the steps of the demo, two at a time."""

from __future__ import annotations

import os
import signal
import subprocess
import time
from collections.abc import Sequence
from pathlib import Path

from examples.demo.steps import Step

POLL_S = 0.1
WORKERS = 2
FAREWELL_S = 20.0  # an interrupted node graph ends in order


class StepError(Exception):
    """A step failed; one line."""


def run(out: Path, steps: Sequence[Step]) -> dict[str, float]:
    """Run all steps, each after those it needs; returns the seconds that each took, by name.

    Raises StepError at the first that fails; whatever happens, no step is left running.
    """
    (out / "logs").mkdir(parents=True, exist_ok=True)
    waiting, took = list(steps), dict[str, float]()
    running: dict[str, tuple[subprocess.Popen[bytes], float]] = {}
    try:
        while waiting or running:
            ready = [step for step in waiting if took.keys() >= set(step.needs)]
            for step in ready[: WORKERS - len(running)]:
                waiting.remove(step)
                print(f"{step.name}: {step.title}", flush=True)
                running[step.name] = _start(step, _log(out, step.name), len(waiting)), time.monotonic()
            for name, (process, begun) in list(running.items()):
                if process.poll() is not None:
                    del running[name]
                    took[name] = time.monotonic() - begun
                    _check(name, process.returncode, _log(out, name))
                    print(f"{name}: done in {took[name]:.0f} s, {len(took)} of {len(steps)}", flush=True)
            time.sleep(POLL_S)
    finally:
        for process, _ in running.values():
            _end(process)
    return took


def _log(out: Path, name: str) -> Path:
    return out / "logs" / f"{name}.log"


def _start(step: Step, log: Path, number: int) -> subprocess.Popen[bytes]:
    """Start a step with one thread and a ROS domain of its own, as two may run node graphs at a time."""
    domain = (int(os.environ.get("ROS_DOMAIN_ID") or 0) + number) % 102
    own = {"OMP_NUM_THREADS": "1", "MPLBACKEND": "Agg", "PYTHONUNBUFFERED": "1", "ROS_DOMAIN_ID": str(domain)}
    gives_way = () if step.real_time else ("nice", "-n", "10")
    with log.open("wb") as output:
        return subprocess.Popen(
            (*gives_way, *step.command, "--overwrite"), env={**os.environ, **own},
            stdin=subprocess.DEVNULL, stdout=output, stderr=subprocess.STDOUT,
            start_new_session=True,  # Ctrl-C reaches the demo alone, which passes it on
        )  # fmt: skip


def _check(name: str, code: int, log: Path) -> None:
    if code:
        said = [line for line in log.read_text(errors="replace").splitlines() if line.strip()]
        why = said[-1].strip() if said else "it said nothing"
        raise StepError(f"step '{name}' failed (exit code {code}): {why}; more in {os.path.relpath(log)}")


def _end(process: subprocess.Popen[bytes]) -> None:
    process.send_signal(signal.SIGINT)
    try:
        process.wait(FAREWELL_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
