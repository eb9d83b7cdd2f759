"""Jobs of test_sweeps.py, in a module that other processes can import."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path

from deeptruck_core.errors import InputError

VICTIM, HALF = "seed-1", 10  # updates after which the victim waits to be killed


def train(job) -> str:
    """`sweep.train_one` that lists its process; the first process of the victim stops after half of its
    updates."""
    from deeptruck_model.deep import (
        resume,
        sweep,  # seconds that the other jobs need not wait
    )

    folder = Path(job.folder)
    processes = noted(folder)
    processes.parent.mkdir(parents=True, exist_ok=True)
    first = not processes.exists()
    with processes.open("a") as file:
        file.write(f"{os.getpid()}\n")
    if first and folder.name == VICTIM:
        resume.save = _waiting(resume.save, folder.with_suffix(".waits"))
    return sweep.train_one(job)


def noted(folder: Path) -> Path:
    """The file that lists the processes of a job."""
    return folder.with_suffix(".pids")


def refuse(job: int) -> int:
    """Raises InputError for job 1."""
    if job == 1:
        raise InputError("job 1 cannot be done")
    return job


def die_once(folder: str) -> tuple[str, int]:
    """The job's name and the number of its starts; the victim's first process is killed."""
    place = Path(folder)
    (place / str(os.getpid())).touch()
    begun = len(list(place.iterdir()))
    if begun == 1 and place.name == VICTIM:
        os.kill(os.getpid(), signal.SIGKILL)
    return place.name, begun


def die(job: int) -> None:
    """Kills its process, whatever the job."""
    os.kill(os.getpid(), signal.SIGKILL)


def die_of_zero(job: int) -> int:
    """Kills its process for job 0."""
    if job == 0:
        os.kill(os.getpid(), signal.SIGKILL)
    return job


def _waiting(save, sign: Path):
    def saving(*state) -> None:
        save(*state)
        if state[-1] >= HALF:
            sign.touch()
            time.sleep(600)

    return saving
