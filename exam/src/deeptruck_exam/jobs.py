"""Runs many cases, a few at a time, each in its own process; an interrupted run can be resumed."""

from __future__ import annotations

import os
import sys
import traceback
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any, TypeVar

from deeptruck_core.errors import InputError
from deeptruck_core.terminal import interrupts
from deeptruck_core.terminal.progress import bar
from deeptruck_exam.cases.plan import MINUTES

A_CASE = "about a minute each with a physics truck, longer with a learned one; a stopped run goes on"
KILLED = "a process was killed; is there memory for {} at once? Give fewer --jobs: a stopped run goes on"
Work = TypeVar("Work")


@dataclass(frozen=True)
class Job:
    """One case to examine."""

    level: str
    seed: int
    simulator: str = "physics"
    minutes: float = MINUTES

    @property
    def folder(self) -> str:
        return f"{self.simulator}-{self.level}-{self.seed}"


def run_jobs(out: Path, wanted: Sequence[Job], *, jobs: int = 1) -> list[dict[str, Any]]:
    """Scores in the order of `wanted`. A case whose creation or scoring fails is reported with its traceback
    under 'broken' and made again on the next run; other cases continue."""
    out.mkdir(parents=True, exist_ok=True)
    print(f"{len(wanted)} cases, {A_CASE}", file=sys.stderr)
    found = dict(in_parallel(partial(_examine, out), wanted, jobs, "cases"))
    return [found[job] for job in wanted]


def in_parallel(
    do: Callable[[Work], Any], each: Sequence[Work], jobs: int, label: str
) -> Iterator[tuple[Work, Any]]:
    """For each, what `do` returns, in the order in which they end in `jobs` processes; progress on stderr.
    Raises InputError if a process is killed."""
    pool = ProcessPoolExecutor(
        jobs, get_context("spawn"), initializer=interrupts.end_with_parent, initargs=(os.getpid(),)
    )
    with bar(label, every_s=0.0) as show:
        try:
            with interrupts.held_back():  # the pool starts its processes here, which this one ends
                running = {pool.submit(do, one): one for one in each}
            for done, future in enumerate(as_completed(running), 1):
                yield running[future], future.result()
                show(done, len(each), "")
        except BrokenProcessPool:
            raise InputError(KILLED.format(jobs)) from None
        finally:
            pool.shutdown(cancel_futures=True)


def _examine(out: Path, job: Job) -> dict[str, Any]:
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    from deeptruck_exam.run import examine

    try:
        return examine(out / job.folder, job.level, job.seed, None, job.simulator, job.minutes)
    except Exception:
        return {
            "level": job.level,
            "seed": job.seed,
            "simulator": job.simulator,
            "broken": traceback.format_exc(),
        }
