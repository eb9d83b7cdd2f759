"""Many training runs side by side: a grid of settings and seeds, in processes of this machine or on Ray."""

from __future__ import annotations

import json
import os
import socket
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from itertools import product
from multiprocessing import get_context, parent_process
from threading import Thread
from typing import Any, TypeVar, get_args, get_type_hints

from deeptruck_model import interrupts
from deeptruck_model.errors import InputError

Settings = dict[str, Any]
Job = TypeVar("Job")
Result = TypeVar("Result")
ENGINES = ("processes", "ray")
NO_OTHER_NAMES: Mapping[str, str] = {}
REACH_S = 5.0
RETRIES = 3  # of a job whose process was killed; more often than that, it is the job that kills it
KILLED = f"a worker was killed {RETRIES + 1} times; is there memory for all that run side by side?"


def run(
    work: Callable[[Job], Result], jobs: Sequence[Job], *, workers: int = 1, engine: str = "processes"
) -> Iterator[Result]:
    """`work` of every job, as they get done, on `workers` at a time; one worker is this process.

    A job whose process is killed is started again, so `work` has to go on where it was stopped, and to
    return at once what was finished. With engine 'ray' the workers are those of the cluster that RAY_ADDRESS
    names, and `workers` counts only without one: then Ray is started on this machine, on its loopback
    address. Raises what `work` raises; InputError without Ray where it is asked for.
    """
    if engine not in ENGINES:
        raise InputError(f"there is no engine '{engine}'; known: {', '.join(ENGINES)}")
    if engine == "ray":
        return _on_ray(work, jobs, workers)
    return iter(map(work, jobs)) if workers == 1 else _in_processes(work, jobs, workers)


def _in_processes(work: Callable[[Job], Result], jobs: Sequence[Job], workers: int) -> Iterator[Result]:
    left = dict(enumerate(jobs))
    for _ in range(RETRIES + 1):
        pool = ProcessPoolExecutor(workers, get_context("spawn"), initializer=end_with_parent)
        with interrupts.held_back():  # the pool starts its processes here, which this one ends
            running = {pool.submit(work, job): key for key, job in left.items()}
        try:
            for done in as_completed(running):
                yield done.result()
                del left[running[done]]
        except BrokenProcessPool:  # with one process the pool loses all; finished jobs are no longer left
            continue
        finally:
            pool.shutdown(cancel_futures=True)
        return
    raise InputError(KILLED)


def end_with_parent() -> None:
    """In a worker: end where the parent was killed, which could then tell nobody; else it trains on alone."""
    parent = parent_process()
    if parent is not None:
        Thread(target=_end_behind, args=(parent.join,), daemon=True).start()


def _end_behind(wait: Callable[[], object]) -> None:
    wait()
    os._exit(1)


def _on_ray(work: Callable[[Job], Result], jobs: Sequence[Job], workers: int) -> Iterator[Result]:
    with _cluster(workers) as ray:
        remote = ray.remote(max_retries=RETRIES)(work)
        running = [remote.remote(job) for job in jobs]
        while running:
            done, running = ray.wait(running)
            try:
                yield ray.get(done[0])
            except ray.exceptions.RayTaskError as error:
                raise error.cause from None
            except ray.exceptions.WorkerCrashedError:
                raise InputError(KILLED) from None


@contextmanager
def _cluster(workers: int) -> Iterator[Any]:
    """Ray, connected; what is started here ends here."""
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")  # nothing is reported to anybody
    alone = not os.environ.get("RAY_ADDRESS")
    if alone:  # Ray's switch for 'this machine only': every port on the loopback address
        os.environ.setdefault("RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER", "0")
    else:
        _reach(os.environ["RAY_ADDRESS"])
    try:
        import ray
    except ModuleNotFoundError:
        raise InputError("Ray is not installed: pip install 'deeptruck[ray]', or leave it out") from None
    if ray.is_initialized():
        yield ray
        return
    local = {"num_cpus": workers, "include_dashboard": False, "_node_ip_address": "127.0.0.1"}
    ray.init(log_to_driver=False, **(local if alone else {}))
    try:
        yield ray
    finally:
        ray.shutdown()


def _reach(address: str) -> None:
    """Raises InputError where nobody answers at RAY_ADDRESS; Ray itself would go on trying for ever."""
    host, colon, port = address.rpartition("://")[2].rstrip("/").rpartition(":")
    if not colon:  # 'auto' and the like: no address
        return
    try:
        socket.create_connection((host.strip("[]"), int(port)), timeout=REACH_S).close()
    except (OSError, ValueError, OverflowError) as error:
        raise InputError(
            f"no Ray cluster answers at RAY_ADDRESS={address} ({error}); start it there, or correct "
            "RAY_ADDRESS, or unset it to train on this machine"
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
    """Every choice of one value for each setting. `called` gives the fields of the dataclass `config` that
    have another name for users. Raises InputError for what `config` has not."""
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
    """What a setting may be, in words."""
    if get_args(hint):
        return f"it is one of {', '.join(map(str, filter(None, get_args(hint))))}"
    words = {int: "a whole number", float: "a number", bool: "true or false"}
    return f"it is {words.get(hint, 'text')}"


def name(settings: Settings) -> str:
    """A folder's name for a choice of settings."""
    return ",".join(f"{key}={value}" for key, value in settings.items()) or "default"
