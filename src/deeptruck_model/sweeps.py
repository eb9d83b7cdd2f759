"""Runs many trainings in parallel: a grid of settings and seeds, in processes of this machine or on Ray."""

from __future__ import annotations

import json
import os
import socket
from collections import deque
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from itertools import product
from multiprocessing import get_context, parent_process
from threading import Thread
from typing import Any, TypeVar, get_args, get_type_hints

from deeptruck_core.errors import InputError
from deeptruck_core.terminal import interrupts

Settings = dict[str, Any]
Job = TypeVar("Job")
Result = TypeVar("Result")
ENGINES = ("processes", "ray")
NO_OTHER_NAMES: Mapping[str, str] = {}
REACH_S = 5.0
IN_FLIGHT = 4  # jobs a worker that are submitted at a time: the next is there when one is done
RETRIES = 3  # of a job whose process was killed; more often than that, it is the job that kills it
KILLED = f"a worker was killed {RETRIES + 1} times; is there memory for all that run side by side?"


def run(
    work: Callable[[Job], Result],
    jobs: Sequence[Job],
    *,
    workers: int = 1,
    engine: str = "processes",
    lost: Callable[[Job, str], Result] | None = None,
    address: str | None = None,
) -> Iterator[Result]:
    """Results of `work` for every job, in the order of completion, with `workers` at a time; one worker is
    this process.

    A job whose process is killed is started again, so `work` must resume where it was stopped, and return at
    once what was finished. A job that kills its process each time has the result of `lost`, called here with
    the reason, or without `lost` the run ends. At most IN_FLIGHT jobs per worker are submitted at a time.
    With engine 'ray' the workers are those of the cluster at `address` or RAY_ADDRESS, and `workers` counts
    only without a cluster: Ray is then started on this machine, on its loopback address. Raises what `work`
    raises; InputError if Ray is selected and missing, if no cluster answers, and for a cluster of another
    Python or Ray.
    """
    if engine not in ENGINES:
        raise InputError(f"there is no engine '{engine}'; known: {', '.join(ENGINES)}")
    if engine == "ray":
        return _on_ray(work, jobs, workers, lost or _ends, address)
    return iter(map(work, jobs)) if workers == 1 else _in_processes(work, jobs, workers, lost or _ends)


def _ends(job: object, why: str) -> Any:
    raise InputError(why)


def _in_processes(
    work: Callable[[Job], Result], jobs: Sequence[Job], workers: int, lost: Callable[[Job, str], Result]
) -> Iterator[Result]:
    """Run jobs in a process pool. If one process dies, the pool loses all; the jobs that were running are
    then tried one at a time, to find the one that kills its process, before the others continue."""
    left = dict(enumerate(jobs))
    while left:
        ran = yield from _until_one_is_killed(work, left, workers)
        for key in ran:
            for _ in range(RETRIES):
                yield from _until_one_is_killed(work, alone := {key: left[key]}, 1)
                if not alone:
                    break
            else:
                yield lost(left[key], KILLED)
            del left[key]


def _until_one_is_killed(
    work: Callable[[Job], Result], left: dict[int, Job], workers: int
) -> Generator[Result, None, list[int]]:
    """Results of jobs, which are removed from `left`; returns the jobs that were running when a process was
    killed."""
    waiting = deque(left)
    running: dict[Future[Result], int] = {}
    pool = ProcessPoolExecutor(workers, get_context("spawn"), initializer=end_with_parent)
    try:
        while waiting or running:
            with interrupts.held_back():  # the pool starts its processes here, which this one ends
                while waiting and len(running) < IN_FLIGHT * workers:
                    running[pool.submit(work, left[waiting[0]])] = waiting[0]
                    waiting.popleft()
            for done in wait(running, return_when=FIRST_COMPLETED).done:
                yield done.result()
                del left[running.pop(done)]
    except BrokenProcessPool:
        return list(running.values())
    finally:
        pool.shutdown(cancel_futures=True)
    return []


def end_with_parent() -> None:
    """In a worker: end when the parent is killed; otherwise the worker would continue alone."""
    parent = parent_process()
    if parent is not None:
        Thread(target=_end_behind, args=(parent.join,), daemon=True).start()


def _end_behind(wait: Callable[[], object]) -> None:
    wait()
    os._exit(1)


def _on_ray(
    work: Callable[[Job], Result],
    jobs: Sequence[Job],
    workers: int,
    lost: Callable[[Job, str], Result],
    address: str | None,
) -> Iterator[Result]:
    with cluster(workers, address) as ray:
        remote = ray.remote(max_retries=RETRIES)(work)
        most = IN_FLIGHT * max(1, int(ray.cluster_resources().get("CPU", workers)))
        waiting, running = deque(jobs), dict[Any, Job]()
        while waiting or running:
            while waiting and len(running) < most:
                running[remote.remote(waiting[0])] = waiting[0]
                waiting.popleft()
            done, _ = ray.wait(list(running))
            job = running.pop(done[0])
            try:
                yield ray.get(done[0])
            except ray.exceptions.RayTaskError as error:
                raise error.cause from None
            except (ray.exceptions.WorkerCrashedError, ray.exceptions.OutOfMemoryError):
                yield lost(job, KILLED)


@contextmanager
def cluster(workers: int, address: str | None = None) -> Iterator[Any]:
    """Connects Ray for the block; what is started here is ended here."""
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")  # nothing is reported to anybody
    address = address or os.environ.get("RAY_ADDRESS")
    if not address:  # Ray's switch for 'this machine only': every port on the loopback address
        os.environ.setdefault("RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER", "0")
    else:
        _reach(address)
    try:
        import ray
    except ModuleNotFoundError:
        raise InputError("Ray is not installed: pip install 'deeptruck[ray]', or leave it out") from None
    if ray.is_initialized():
        yield ray
        return
    local = {"num_cpus": workers, "include_dashboard": False, "_node_ip_address": "127.0.0.1"}
    try:
        ray.init(log_to_driver=False, **({"address": address} if address else local))
    except Exception as error:  # Ray raises no narrower one where it does not start in time
        where = f"the Ray cluster at {address} cannot be used" if address else "Ray did not start here"
        raise InputError(f"{where}: {' '.join(str(error).split())[:300]}") from None
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
            f"no Ray cluster answers at {address} ({error}); start it there, or correct "
            "RAY_ADDRESS, or leave it out to work on this machine"
        ) from None


def read_grid(options: Sequence[str]) -> dict[str, list[Any]]:
    """A grid from options such as 'learning_rate=0.003,0.006'; values as in JSON, else text."""
    grid: dict[str, list[Any]] = {}
    for option in options:
        name, equals, values = option.partition("=")
        if not equals or not values:
            raise InputError(f"'{option}' is no setting; write it as learning_rate=0.003,0.006")
        known = grid.setdefault(name, [])  # given twice, all values count
        for value in map(_value, values.split(",")):
            if value not in known:
                known.append(value)
    return grid


def _value(text: str) -> Any:
    try:
        return json.loads(text)
    except json.JSONDecodeError:
        return text


def combinations(
    grid: Mapping[str, Sequence[Any]], config: type, whose: str, called: Mapping[str, str] = NO_OTHER_NAMES
) -> Iterator[Settings]:
    """Every combination of one value per setting. `called` maps fields of the dataclass `config` to the names
    that users see. Raises InputError for a setting that `config` lacks."""
    hints = {called.get(field, field): hint for field, hint in get_type_hints(config).items()}
    for name, values in grid.items():
        if name not in hints:
            raise InputError(f"{whose} has no setting '{name}'; known: {', '.join(hints)}")
        for value in values:
            if not _fits(value, hints[name]):
                raise InputError(f"{whose} cannot have {name}={value}; {_allowed(hints[name])}")
    for values in product(*grid.values()):
        yield dict(zip(grid, values, strict=True))


def _fits(value: Any, hint: Any) -> bool:
    if get_args(hint):
        return value in get_args(hint)
    return type(value) is hint or (hint is float and type(value) is int)


def _allowed(hint: Any) -> str:
    """The permitted values of a setting, in words."""
    if get_args(hint):
        return f"it is one of {', '.join(map(str, filter(None, get_args(hint))))}"
    words = {int: "a whole number", float: "a number", bool: "true or false"}
    return f"it is {words.get(hint, 'text')}"


def name(settings: Settings) -> str:
    """Folder name for a combination of settings."""
    return ",".join(f"{key}={value}" for key, value in settings.items()) or "default"
