"""Runs many cases, a few at a time, each in its own process; an interrupted run can be resumed."""

from __future__ import annotations

import multiprocessing
import os
import signal
import traceback
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from deeptruck_exam.cases.plan import MINUTES
from deeptruck_model.sweeps import end_with_parent

A_CASE = "about a minute each with a physics truck, longer with a learned one; a stopped run goes on"


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
    results: dict[int, dict[str, Any]] = {}
    bar = Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        console=Console(stderr=True),
    )
    context = multiprocessing.get_context("spawn")  # threads of numba and BLAS do not survive a fork
    # no max_tasks_per_child: with it the executor of Python 3.11 and 3.12 can wait for ever
    pool = ProcessPoolExecutor(max_workers=jobs, mp_context=context, initializer=end_with_the_run)
    with bar, pool:
        bar.console.print(f"{len(wanted)} cases, {A_CASE}")
        task = bar.add_task("cases", total=len(wanted))
        waiting = {pool.submit(_examine, out, job): k for k, job in enumerate(wanted)}
        for future in as_completed(waiting):
            results[waiting[future]] = future.result()
            bar.update(task, advance=1, description=wanted[waiting[future]].folder)
            if not bar.console.is_terminal:  # a bar there is shown at its end alone
                bar.console.print(f"{len(results)} of {len(wanted)}: {wanted[waiting[future]].folder}")
    return [results[k] for k in range(len(wanted))]


def in_parallel(do: Callable[..., None], each: Sequence[tuple[Any, ...]], jobs: int) -> None:
    """Call `do` with each of these arguments in `jobs` processes; prints a line on stderr for each that is
    done."""
    with ProcessPoolExecutor(jobs, multiprocessing.get_context("spawn"), end_with_the_run) as pool:
        waiting = [pool.submit(do, *arguments) for arguments in each]
        for k, done in enumerate(as_completed(waiting), 1):
            done.result()
            Console(stderr=True).print(f"{k} of {len(waiting)}")


def end_with_the_run() -> None:
    """End the process silently if the run is interrupted or killed."""
    end_with_parent()
    signal.signal(signal.SIGINT, lambda *_: os._exit(130))


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
