"""Runs the jobs of a fleet, each as a process of its own, here or on Ray; finished results are kept."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

from deeptruck_core import files
from deeptruck_core.errors import InputError
from deeptruck_core.terminal.progress import bar
from deeptruck_model.fleet import page
from deeptruck_model.fleet.jobs import Job
from deeptruck_model.results import DEEP_TRUCK, FLEET

RECORD, PAGE = "fleet.json", "fleet.html"
RETRIES = 3  # of a job whose worker was killed
REACH_S = 5.0
COMMAND = """
from deeptruck_core.terminal import interrupts
interrupts.end_with_parent({})
from deeptruck_model.cli import main
main()
"""


@dataclass(frozen=True)
class Outcome:
    """What a job printed, why it failed, if it did, and how long it took."""

    says: list[str]
    failed: str
    seconds: float


def run(jobs: Sequence[Job], out: Path, *, workers: int = 1, ray: str | None = None) -> list[tuple[Job, str]]:
    """Do the jobs that have no finished result of the same words, `workers` at a time or by all cores of the
    Ray cluster at the address `ray`; writes fleet.json and fleet.html into `out` and returns the jobs that
    failed, with the reason.

    On a cluster, the present folder, and all paths in the jobs, must be the same on every node. Raises
    InputError if `out` holds something else, and if Ray or its cluster cannot be used.
    """
    with FLEET.in_place(out):
        done = _record(out)
        to_do = [job for job in jobs if not _is_done(job, done)]
        outcomes = _on_ray(to_do, ray) if ray and to_do else _here(to_do, workers)
        failed = list[tuple[Job, str]]()
        with bar(jobs[0].words[0], every_s=0.0) as show:
            show(len(jobs) - len(to_do), len(jobs), "")
            for number, (job, outcome) in enumerate(outcomes, len(jobs) - len(to_do) + 1):
                failed += [(job, outcome.failed)] if outcome.failed else []
                done[job.name] = {"words": _words(job), **asdict(outcome)}
                files.write(out / RECORD, (json.dumps(done, indent=1, sort_keys=True) + "\n").encode())
                show(number, len(jobs), f"{len(failed)} failed" if failed else "")
        files.write(out / PAGE, page.page(done, out).encode())
    return failed


def _record(out: Path) -> dict[str, Any]:
    """The jobs of fleet.json whose result is still there, and those that failed."""
    try:
        jobs = json.loads((out / RECORD).read_text())
        return {n: job for n, job in jobs.items() if job["failed"] or files.is_finished(out / n)}
    except FileNotFoundError:
        return {}
    except (OSError, ValueError, TypeError, KeyError, AttributeError):
        raise InputError(f"{out / RECORD} is damaged; restore it, or choose another --out") from None


def _is_done(job: Job, done: Mapping[str, Any]) -> bool:
    known = done.get(job.name)
    return known is not None and not known["failed"] and known["words"] == _words(job)


def _words(job: Job) -> list[str]:
    """The words by which a result is the same; --overwrite makes no other."""
    return [word for word in job.words if word != "--overwrite"]


def do(job: Job, folder: Path, deeptruck: str) -> Outcome:
    """Do a job in a process of its own, which ends with this one; `folder` and version are the caller's."""
    if (ours := version("deeptruck")) != deeptruck:
        return Outcome([], f"a worker has deeptruck {ours}, not {deeptruck}; install one version", 0.0)
    goes_on = ["--resume"] if job.words[0] == "train" and DEEP_TRUCK.begun(job.out) else []
    begun = time.monotonic()
    done = subprocess.run(
        [sys.executable, "-c", COMMAND.format(os.getpid()), *job.line, *goes_on],
        cwd=folder,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        env={"OMP_NUM_THREADS": "1", **os.environ},
        check=False,
    )
    says, errors = ([x for x in text.splitlines() if x.strip()] for text in (done.stdout, done.stderr))
    failed = ""
    if done.returncode < 0:
        name = signal.Signals(-done.returncode).name
        failed = f"killed by {name}; is there memory for all that run side by side?"
    elif done.returncode:
        failed = (errors or [f"ended with {done.returncode}"])[-1].removeprefix("deeptruck-model: ")
    return Outcome(says, failed, round(time.monotonic() - begun, 1))


def _here(jobs: Sequence[Job], workers: int) -> Iterator[tuple[Job, Outcome]]:
    pool = ThreadPoolExecutor(workers)
    try:
        running = {pool.submit(do, job, Path.cwd(), version("deeptruck")): job for job in jobs}
        for future in as_completed(running):
            yield running[future], future.result()
    finally:
        pool.shutdown(cancel_futures=True)


def _on_ray(jobs: Sequence[Job], address: str) -> Iterator[tuple[Job, Outcome]]:
    with _cluster(address) as ray:
        remote = ray.remote(max_retries=RETRIES)(do)
        running = {remote.remote(job, Path.cwd(), version("deeptruck")): job for job in jobs}
        while running:
            (done,), _ = ray.wait(list(running))
            try:
                outcome = ray.get(done)
            except ray.exceptions.RayError as error:
                outcome = Outcome([], f"its worker was lost: {' '.join(str(error).split())[:200]}", 0.0)
            yield running.pop(done), outcome


@contextmanager
def _cluster(address: str) -> Iterator[Any]:
    """Connect Ray for the block; 'local' starts one on the loopback address of this machine."""
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")  # nothing is reported to anybody
    settings: dict[str, Any] = {"address": address}
    if address == "local":
        os.environ.setdefault("RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER", "0")  # all ports on the loopback address
        settings |= {"include_dashboard": False, "_node_ip_address": "127.0.0.1"}
    else:
        _reach(address)
    try:
        import ray
    except ModuleNotFoundError:
        raise InputError("Ray is not installed: pip install 'deeptruck[ray]', or leave --ray out") from None
    try:
        ray.init(log_to_driver=False, **settings)
    except Exception as error:  # Ray raises no narrower one where it does not start in time
        raise InputError(f"Ray at {address} cannot be used: {' '.join(str(error).split())[:300]}") from None
    try:
        yield ray
    finally:
        ray.shutdown()


def _reach(address: str) -> None:
    """Raises InputError if nothing answers at an address; Ray itself would retry for ever."""
    host, colon, port = address.rpartition("://")[2].rstrip("/").rpartition(":")
    if not colon:  # 'auto' and the like: no address
        return
    try:
        socket.create_connection((host.strip("[]"), int(port)), timeout=REACH_S).close()
    except (OSError, ValueError, OverflowError) as error:
        raise InputError(
            f"no Ray cluster answers at {address} ({error}); correct --ray, or leave it out to work here"
        ) from None
