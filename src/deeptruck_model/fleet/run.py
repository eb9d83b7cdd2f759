"""Runs the stages in order: finished work is skipped, the rest is done by processes or by Ray."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from deeptruck_core.errors import InputError
from deeptruck_core.terminal.progress import bar
from deeptruck_model import checks, sweeps
from deeptruck_model.checks.compatibility import Taken
from deeptruck_model.fleet import compare as comparing
from deeptruck_model.fleet import extract as extracting
from deeptruck_model.fleet import plan
from deeptruck_model.fleet.compare import Comparison
from deeptruck_model.fleet.extract import INDEX, RECEIPTS, Extraction, Reading
from deeptruck_model.fleet.plan import Drive, Truck
from deeptruck_model.fleet.storage import Place, StorageError, code

PROBES = 3  # files of a class that are read first: where none can be used, nothing else is read
ENGINES = {"local": "processes", "ray": "ray"}


@dataclass(frozen=True)
class Workers:
    """`count` worker processes on this machine, or of the Ray cluster at `address`."""

    engine: str = "local"
    count: int = 1
    address: str | None = None

    @contextmanager
    def ready(self) -> Iterator[None]:
        """Connect Ray once for all stages within the block. Raises InputError for workers that cannot be
        reached, or that have another version of this package."""
        if self.engine != "ray":
            yield
            return
        with sweeps.cluster(self.count, self.address):
            for found in self.run(lambda _: code(), [None]):
                if found != code():
                    raise InputError(
                        f"the Ray workers have deeptruck {found}, this machine {code()}; install one version"
                    )
            yield

    def run(
        self,
        work: Callable[[Any], Any],
        jobs: Sequence[Any],
        lost: Callable[[Any, str], Any] | None = None,
    ) -> Iterator[Any]:
        """Results in the order of completion; see `sweeps.run`."""
        return sweeps.run(
            work, jobs, workers=self.count, engine=ENGINES[self.engine], lost=lost, address=self.address
        )


@dataclass(frozen=True)
class Fleet:
    """The drives of a source, the trucks, each class's simulator, and how its files are read."""

    source: Place
    target: Place
    drives: Sequence[Drive]
    trucks: Mapping[str, Truck]
    simulators: Mapping[str, str]
    readings: Mapping[str, Reading]

    @staticmethod
    def of(
        source: Place,
        target: Place,
        layout: str,
        simulator: str,
        *,
        trucks: Path | None = None,
        topic_map: Path | None = None,
        columns: Path | None = None,
    ) -> Fleet:
        """The fleet from command-line arguments. Raises InputError for arguments that do not fit together,
        before a file is read."""
        if topic_map is not None and columns is not None:
            raise InputError("give --topic-map for bags or --columns for tables, not both")
        table = plan.trucks(trucks)
        drives = plan.drives(source, layout)
        kinds = sorted({_kind(table, d.truck) for d in drives})
        by_class = plan.simulators(simulator, kinds)
        mapped = plan.mapping(topic_map, columns=False)
        meaning = plan.mapping(columns, columns=True)
        readings = {}
        for kind, text in by_class.items():
            facts = checks.simulator(text)
            taken = Taken(f"the simulator {facts.name}", facts.interface, facts.dt)
            readings[kind] = Reading(mapped, meaning, taken)
        return Fleet(source, target, drives, table, by_class, readings)

    def jobs(self) -> list[Extraction]:
        """One extraction per file."""
        return [
            Extraction(d, self.readings[_kind(self.trucks, d.truck)], self.source, self.target)
            for d in self.drives
        ]


def _kind(trucks: Mapping[str, Truck], name: str) -> str:
    return trucks.get(name, Truck(name)).kind


def extract(fleet: Fleet, workers: Workers) -> dict[str, Any]:
    """Read files not read so far; writes and returns the index. Raises InputError if none of the first files
    of a class can be used, before others are read."""
    jobs = fleet.jobs()
    there = {f.path for f in fleet.target.list(RECEIPTS)}
    to_do = [job for job in jobs if job.receipt not in there]
    receipts = [fleet.target.read_json(job.receipt) for job in jobs if job.receipt in there]
    if not receipts:
        to_do, probed = _probed(to_do)
        receipts += probed
    failed: list[dict[str, Any]] = []
    for one in _shown("extract", workers.run(extracting.extract, to_do, extracting.lost), len(to_do)):
        (failed if "failed" in one else receipts).append(one)
    index = extracting.index(receipts, failed)
    index["simulators"] = dict(fleet.simulators)
    index["classes"] = {truck: _kind(fleet.trucks, truck) for truck in index["trucks"]}
    fleet.target.write_json(INDEX, index)
    return index


def _probed(jobs: Sequence[Extraction]) -> tuple[list[Extraction], list[dict[str, Any]]]:
    """The first files of each class, read in this process, and the remaining files."""
    by_simulator: dict[str, list[Extraction]] = {}
    for job in jobs:
        by_simulator.setdefault(job.reading.key, []).append(job)
    done, receipts = set(), []
    for own in by_simulator.values():
        for n, job in enumerate(own[:: max(1, len(own) // PROBES)][:PROBES], 1):
            receipt = extracting.extract(job)
            if "failed" in receipt:
                raise StorageError(receipt["failed"])
            done.add(job.receipt)
            receipts.append(receipt)
            if "quarantined" not in receipt:
                break
            if n == min(PROBES, len(own)):
                raise InputError(
                    f"the first {n} files that were read cannot be used: {receipt['quarantined']}"
                )
    return [job for job in jobs if job.receipt not in done], receipts


def compare(
    target: Place, workers: Workers, hours: float | None = None, units: str = "m/s"
) -> list[dict[str, Any]]:
    """Compare each truck that has no receipt yet with the simulator of its class, on at most `hours` of its
    drives (None: all); its page states speeds in `units`. Returns the receipts of all trucks.

    Raises InputError if nothing was extracted.
    """
    if not target.exists(INDEX):
        raise InputError(f"{target.name} has no {INDEX}; run 'deeptruck-model fleet extract' first")
    index = target.read_json(INDEX)
    if not index["trucks"]:
        raise InputError(f"{target.name}: none of {index['total']['files']} files could be used; see {INDEX}")
    jobs = [
        Comparison(
            truck, tuple(drives), index["simulators"][index["classes"][truck]], hours, target, units=units
        )
        for truck, drives in index["trucks"].items()
    ]
    known = [comparing.is_done(job) for job in jobs]
    receipts = [r for r in known if r is not None]
    to_do = [job for job, receipt in zip(jobs, known, strict=True) if receipt is None]
    receipts += _shown("compare", workers.run(comparing.compare, to_do, comparing.lost), len(to_do))
    return receipts


def _shown(label: str, results: Iterator[dict[str, Any]], total: int) -> Iterator[dict[str, Any]]:
    """The same results, with a progress bar: count, rate, remaining time, and failures."""
    begun, out, read = time.monotonic(), 0, 0
    with bar(label) as show:
        for done, one in enumerate(results, 1):
            out += "quarantined" in one or "failed" in one
            read += one.get("bytes", 0)
            passed = max(time.monotonic() - begun, 1e-3)
            speed = 60.0 * done / passed
            rate = f"{speed:.0f} a minute" if speed >= 1.0 else "under 1 a minute"
            rate += f", {read / passed / 1e6:.1f} MB/s" if read else ""
            show(done, total, f"{rate}, {out} left out")
            yield one
