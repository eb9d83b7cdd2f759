"""Compare stage: one task per truck. Whole drives are held out, and the mismatch tool's result is kept."""

from __future__ import annotations

import itertools
import json
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from urllib.parse import quote

import numpy as np

from deeptruck_core.errors import InputError
from deeptruck_core.reading import sha256
from deeptruck_model.fleet.extract import MEASURED, load
from deeptruck_model.fleet.plan import week
from deeptruck_model.fleet.storage import Place, StorageError, code, key

VERDICTS, DONE, PREVIOUS = "verdicts", "compared.json", "previous.json"
VERDICT = "verdict.json"
EVERY = 3  # one drive in so many is held out, the second first
LEAST_DRIVES = 2  # one to fit and one to hold out


@dataclass(frozen=True)
class Comparison:
    """A truck to be compared; plain values, because it is sent to another process. `drives` are entries of
    the index, `hours` the maximum used of them (None: all), `units` those of speeds on the page."""

    truck: str
    drives: tuple[Mapping[str, Any], ...]
    simulator: str
    hours: float | None
    target: Place
    seed: int = 0
    units: str = "m/s"

    @property
    def key(self) -> str:
        """Equal for comparisons with the same result."""
        content = [(d["name"], d["sha256"]) for d in self.drives]
        shown = [self.units] if self.units != "m/s" else []
        return key(self.truck, content, simulator_key(self.simulator), self.hours, self.seed, code(), *shown)

    @property
    def folder(self) -> str:
        """Folder of this truck's result."""
        return folder(self.truck)


def folder(truck: str) -> str:
    """Folder of a truck's result."""
    return f"{VERDICTS}/truck={quote(truck, safe='')}"


@cache
def simulator_key(text: str) -> str:
    """Key of a simulator: hash of its directory or files, else its name."""
    path = Path(text.partition(":")[2] if text.startswith("truck:") else text)
    files = sorted(p for p in path.rglob("*") if p.is_file()) if path.is_dir() else []
    files += [path] if path.is_file() else []
    return key(text, [(p.name, sha256(p)) for p in files])


def chosen(drives: Sequence[Mapping[str, Any]], hours: float | None) -> list[Mapping[str, Any]]:
    """Drives of at most `hours` in total, or one more, spread over time: every second drive by date, then
    every second of the rest. Returned in the order of their dates."""
    ordered = sorted(drives, key=lambda d: (d["date"], d["name"]))
    if hours is None:
        return ordered
    kept: list[int] = []
    total, left = 0.0, list(range(len(ordered)))
    while left and total < hours:
        for k in left[:: max(1, min(2, len(left) - 1))]:
            if total < hours:
                kept.append(k)
                total += ordered[k]["hours"]
        left = [k for k in left if k not in kept]
    return [ordered[k] for k in sorted(kept)]


def compare(job: Comparison) -> dict[str, Any]:
    """Compare one truck with its simulator; write the result's folder, then its receipt, and return the
    receipt.

    The receipt of a truck that cannot be compared states the reason; after a storage failure there is none.
    """
    begun, cpu = time.monotonic(), time.process_time()
    receipt: dict[str, Any] = {"truck": job.truck, "key": job.key}
    try:
        try:
            receipt |= _compared(job)
        except StorageError:
            raise
        except InputError as error:
            receipt["quarantined"] = str(error)
        receipt |= {
            "seconds": round(time.monotonic() - begun, 3),
            "cpu_seconds": round(time.process_time() - cpu, 3),
        }
        job.target.write_json(f"{job.folder}/{DONE}", receipt)
    except StorageError as error:
        return receipt | {"failed": str(error)}
    return receipt


def lost(job: Comparison, why: str) -> dict[str, Any]:
    """The receipt of a truck whose process was killed in every attempt."""
    receipt = {"truck": job.truck, "key": job.key, "quarantined": why}
    job.target.write_json(f"{job.folder}/{DONE}", receipt)
    return receipt


def _compared(job: Comparison) -> dict[str, Any]:
    from deeptruck_model import simulators
    from deeptruck_model.fleet.slopes import COLUMNS, SLOPES, slopes, written
    from deeptruck_model.mismatch import find_mismatch
    from deeptruck_model.mismatch.find import evidence_by_name
    from deeptruck_model.mismatch.folders import apply_command
    from deeptruck_model.mismatch.output import fill

    drives = chosen(job.drives, job.hours)
    if len(drives) < LEAST_DRIVES:
        raise InputError(f"{len(drives)} usable drive: a truck needs {LEAST_DRIVES}, one of them held out")
    truck = simulators.load(job.simulator)
    out = [k % EVERY == 1 for k in range(len(drives))]
    read = [load(job.target, str(d["parquet"])) for d in drives]
    fit, held = (
        list(itertools.chain.from_iterable(r for r, o in zip(read, out, strict=True) if o is which))
        for which in (False, True)
    )
    found = find_mismatch(truck, fit, held, seed=job.seed)
    evidence = evidence_by_name(truck, fit, held, seed=job.seed)
    _replace_earlier(job)
    with TemporaryDirectory(prefix="deeptruck-fleet-") as temporary:
        draft = Path(temporary) / "found"
        draft.mkdir()
        fill(draft, found, apply_command(Path(job.folder)), job.units)
        files = {
            p.relative_to(draft).as_posix(): p.read_bytes() for p in sorted(draft.rglob("*")) if p.is_file()
        }
    no_slopes: dict[str, str] = {}
    try:
        if found.evidence is None:
            raise InputError("nothing could be compared")
        files[SLOPES] = written(COLUMNS, slopes(found.evidence, found.prepared))
    except InputError as why:
        no_slopes = {"no_slopes": str(why)}
    for name, content in files.items():
        job.target.write(f"{job.folder}/{name}", content)
    return {
        "files": list(files),
        "simulator": job.simulator,
        "hours_fitted": round(sum(d["hours"] for d, o in zip(drives, out, strict=True) if not o), 4),
        "hours_held_out": round(sum(d["hours"] for d, o in zip(drives, out, strict=True) if o), 4),
        "nats_fitted": _rounded(evidence[0]),
        "nats_held_out": _rounded(evidence[1]),
        "weeks": _by_week(found, drives),
        **no_slopes,
    }


def _replace_earlier(job: Comparison) -> None:
    """Keep verdict and receipt of this truck's earlier result as PREVIOUS, and remove the result: first its
    receipt, then the files that the receipt names. If interrupted, the kept files are still there when this
    is repeated."""
    path, verdict = f"{job.folder}/{DONE}", f"{job.folder}/{VERDICT}"
    if not job.target.exists(path):
        return
    receipt = job.target.read_json(path)
    if "quarantined" not in receipt and job.target.exists(verdict):
        kept = {n: v for n, v in receipt.items() if n not in MEASURED}
        job.target.write_json(f"{job.folder}/{PREVIOUS}", kept | {VERDICT: job.target.read_json(verdict)})
    job.target.delete(path)
    for name in receipt.get("files", ()):
        job.target.delete(f"{job.folder}/{name}")


def _rounded(nats: Mapping[str, float]) -> dict[str, float]:
    return {name: round(value, 3) for name, value in sorted(nats.items())}


def _by_week(found: Any, drives: Sequence[Mapping[str, Any]]) -> dict[str, float]:
    """Rms of the residual (m/s^2) over the compared rows of each dated week."""
    e = found.evidence
    if e is None:
        return {}
    dates = {d["name"]: d["date"] for d in drives}
    squares: dict[str, list[float]] = {}
    for s in e.drives:
        of = week(str(dates.get(s.name.partition("#")[0], "")))
        rows = slice(s.start, s.stop)
        if of is not None:
            squares.setdefault(of, []).extend((e.residual[rows][e.valid[rows]] ** 2).tolist())
    return {of: round(float(np.sqrt(np.mean(x))), 5) for of, x in sorted(squares.items()) if x}


def receipts(target: Place) -> list[dict[str, Any]]:
    """Receipts of all trucks, by name. Raises InputError if none was compared."""
    paths = [f.path for f in target.list(VERDICTS) if f.path.endswith(f"/{DONE}")]
    found = [target.read_json(path) for path in sorted(paths)]
    if all("quarantined" in r for r in found):
        raise InputError(f"{target.name} has no truck that was compared; run 'deeptruck-model fleet compare'")
    return found


def is_done(job: Comparison) -> dict[str, Any] | None:
    """The receipt of a truck that has already been compared, else None."""
    path = f"{job.folder}/{DONE}"
    if not job.target.exists(path):
        return None
    try:
        receipt = json.loads(job.target.read(path))
    except ValueError:
        return None
    return receipt if isinstance(receipt, dict) and receipt.get("key") == job.key else None
