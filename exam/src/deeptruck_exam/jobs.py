"""Runs many cases, a few at a time, each in its own process; an interrupted run can be resumed."""

from __future__ import annotations

import os
import sys
import traceback
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from deeptruck_core.terminal.progress import bar
from deeptruck_exam.cases.plan import MINUTES
from deeptruck_model import sweeps

A_CASE = "about a minute each with a physics truck, longer with a learned one; a stopped run goes on"
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
    """What `do` returns for each, and for which, as they end in `jobs` processes; progress on stderr."""
    with bar(label, every_s=0.0) as show:
        for done, found in enumerate(sweeps.run(partial(_with, do), each, workers=jobs), 1):
            yield found
            show(done, len(each), "")


def _with(do: Callable[[Work], Any], one: Work) -> tuple[Work, Any]:
    return one, do(one)


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
