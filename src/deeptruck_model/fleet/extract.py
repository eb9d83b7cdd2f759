"""Extract stage: one task per file. Its recordings become one Parquet file, and its account is kept.

A receipt is written for each file. Its name depends on the file's path, size and modification time, on how
the file is read, and on the version of the code that reads it; a restart processes the files without a
receipt. A receipt holds the SHA-256 of the content.
"""

from __future__ import annotations

import json
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
import pyarrow as pa
from pyarrow import parquet

from deeptruck_core.account import Account
from deeptruck_core.errors import InputError
from deeptruck_core.json_data import to_json
from deeptruck_core.signals import TruckInterface
from deeptruck_model.checks.compatibility import Taken
from deeptruck_model.fleet.plan import Drive
from deeptruck_model.fleet.storage import Place, StorageError, code, key
from deeptruck_model.recordings.recording import Recording
from deeptruck_model.recordings.tables.table_writer import as_table

RECEIPTS, RECORDINGS, INDEX = "receipts", "recordings", "recordings.json"
ROOMS = ("recordings/", "signals", "checks/", "fleet/extract")
META = b"deeptruck.recordings"
MEASURED = ("seconds", "cpu_seconds")  # of a receipt: unlike in every run


@dataclass(frozen=True)
class Reading:
    """How files are read: a topic map or COLUMNS, as data, and the channels that the simulator of the class
    takes."""

    topic_map: Mapping[str, Any] | None
    columns: Mapping[str, Any] | None
    taken: Taken

    @property
    def key(self) -> str:
        """Key that is equal for readings that give the same rows."""
        interface = self.taken.interface.to_dict()
        return key(self.topic_map, self.columns, interface, self.taken.dt, code(*ROOMS))


@dataclass(frozen=True)
class Extraction:
    """A file to be extracted; plain values, because it is sent to another process."""

    drive: Drive
    reading: Reading
    source: Place
    target: Place

    @property
    def receipt(self) -> str:
        """Path of its receipt."""
        file = self.drive.file
        return f"{RECEIPTS}/{key(file.path)}-{key(file.size, file.changed_ns, self.reading.key)}.json"


def extract(job: Extraction) -> dict[str, Any]:
    """Read one file, write its recordings and its receipt, and return the receipt.

    A file that cannot be used is quarantined: its receipt states the reason. After a storage failure no
    receipt is written, and `failed` says so.
    """
    begun, cpu = time.monotonic(), time.process_time()
    drive, file = job.drive, job.drive.file
    receipt: dict[str, Any] = {
        "path": file.path,
        "truck": drive.truck,
        "date": drive.date,
        "bytes": file.size,
    }
    try:
        with job.source.copied(file.path) as (copy, digest):
            receipt["sha256"] = digest
            try:
                recordings = [
                    replace(r, name=f"{drive.name}{''.join(r.name.partition('#')[1:])}")
                    for r in _read(copy, job.reading)
                ]
                _check(recordings, job.reading.taken, file.path)
                receipt |= _kept(recordings, job.target, _place(drive, digest))
            except StorageError:
                raise
            except InputError as error:
                receipt["quarantined"] = str(error).replace(str(copy), file.path)
        receipt |= {
            "seconds": round(time.monotonic() - begun, 3),
            "cpu_seconds": round(time.process_time() - cpu, 3),
        }
        job.target.write_json(job.receipt, receipt)
    except StorageError as error:
        return receipt | {"failed": str(error)}
    return receipt


def lost(job: Extraction, why: str) -> dict[str, Any]:
    """The receipt of a file whose reader was killed in every attempt: the file is quarantined."""
    drive, file = job.drive, job.drive.file
    receipt = {"path": file.path, "truck": drive.truck, "date": drive.date, "bytes": file.size}
    receipt |= {"quarantined": why, "sha256": None}
    job.target.write_json(job.receipt, receipt)
    return receipt


def index(receipts: Sequence[Mapping[str, Any]], failed: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """The result of all files: each truck's recordings, the sum of the accounts, and what was omitted.

    It does not depend on the order or the number of runs. Of two files with equal content the second is
    omitted.
    """
    by_truck: dict[str, list[dict[str, Any]]] = {}
    quarantined, seen = {}, dict[str, str]()
    total = {"files": 0, "bytes": 0, "hours": 0.0}
    accounts: list[Mapping[str, Any]] = []
    for one in sorted(receipts, key=lambda r: str(r["path"])):
        total["files"] += 1
        total["bytes"] += one["bytes"]
        if why := one.get("quarantined"):
            quarantined[one["path"]] = why
        elif first := seen.get(one["sha256"]):
            quarantined[one["path"]] = f"the same content as {first}"
        else:
            seen[one["sha256"]] = one["path"]
            total["hours"] += one["hours"]
            accounts += one["accounts"]
            entry = {n: one[n] for n in ("name", "date", "parquet", "sha256", "hours")}
            by_truck.setdefault(one["truck"], []).append(entry)
    return {
        "total": total | {"hours": round(total["hours"], 4)},
        "account": summed(accounts),
        "quarantined": quarantined,
        "failed": {one["path"]: one["failed"] for one in failed},
        "trucks": {truck: by_truck[truck] for truck in sorted(by_truck)},
    }


def summed(accounts: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Accounts of many files summed for each kind of item: read, used, and omitted by reason."""
    out: dict[str, Any] = {}
    for account in accounts:
        entry = out.setdefault(
            account["items"], {"read": 0, "used": 0, "set_aside": {}, "samples_set_aside": {}}
        )
        entry["read"] += account["read"]
        entry["used"] += account["used"]
        _add(entry["set_aside"], account["set_aside"])
        for name, tally in account["channels"].items():
            _add(entry["samples_set_aside"].setdefault(name, {}), tally["set_aside"])
    for entry in out.values():
        entry["samples_set_aside"] = {n: t for n, t in entry["samples_set_aside"].items() if t}
    return out


def _add(sums: dict[str, int], aside: Mapping[str, Any]) -> None:
    for reason, entry in aside.items():
        sums[reason] = sums.get(reason, 0) + entry["count"]


def load(place: Place, path: str) -> list[Recording]:
    """The recordings in a Parquet file that `extract` wrote. Raises InputError if it is damaged."""
    try:
        table = parquet.read_table(pa.BufferReader(place.read(path)))
        pieces = json.loads(table.schema.metadata[META])
    except (pa.ArrowException, KeyError, TypeError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{place.name}/{path} is damaged; remove its receipt, and extract again") from None
    out, at = [], 0
    for piece in pieces:
        rows = table.slice(at, piece.pop("rows"))
        at += rows.num_rows
        channels = {n: rows[n].to_numpy().astype(np.float64) for n in piece.pop("channels")}
        interface = TruckInterface.from_dict(piece.pop("interface"))
        out.append(
            Recording(channels=channels, interface=interface, notes=tuple(piece.pop("notes")), **piece)
        )
    return out


def _read(copy: Path, reading: Reading) -> list[Recording]:
    from deeptruck_model.recordings import import_table, read

    rate = 1.0 / reading.taken.dt
    if reading.columns is None:
        return read(copy, topic_map=reading.topic_map, rate_hz=rate)
    imported = import_table(copy, reading.columns, copy.with_name(f"{copy.stem}.imported"))
    account = imported.recordings[0].account
    return [replace(r, account=account) for r in read(imported.bag, rate_hz=rate)]


def _check(recordings: Sequence[Recording], taken: Taken, path: str) -> None:
    """Raises InputError for a recording that lacks an input of the class's simulator or has other units."""
    if not recordings:
        raise InputError(f"{path} holds no driving")
    from deeptruck_model.recordings.several import check_fit

    check_fit(recordings, taken, path)


def _place(drive: Drive, digest: str) -> str:
    stem = quote(drive.name.partition("/")[2], safe="")
    folder = f"{RECORDINGS}/truck={quote(drive.truck, safe='')}/date={quote(drive.date, safe='')}"
    return f"{folder}/{stem}-{digest[:12]}.parquet"


def _kept(recordings: Sequence[Recording], target: Place, path: str) -> dict[str, Any]:
    """Write the recordings; returns their entries for the receipt."""
    pieces = [
        {
            "name": r.name,
            "dt": r.dt,
            "start_s": r.start_s,
            "rows": len(r),
            "channels": list(r.channels),
            "interface": r.interface.to_dict(),
            "notes": list(r.notes),
            "obeyed": r.obeyed,
        }
        for r in recordings
    ]
    table = as_table(recordings)
    table = table.replace_schema_metadata({META: json.dumps(pieces)})
    sink = pa.BufferOutputStream()
    parquet.write_table(table, sink, compression="zstd")
    content = sink.getvalue().to_pybytes()
    target.write(path, content)
    accounts: dict[int, Account] = {id(r.account): r.account for r in recordings if r.account is not None}
    return {
        "name": recordings[0].name.partition("#")[0],
        "parquet": path,
        "parquet_bytes": len(content),
        "hours": round(sum(len(r) * r.dt for r in recordings) / 3600.0, 6),
        "accounts": [  # without the path of the local copy
            {n: account[n] for n in ("items", "read", "used", "set_aside", "channels")}
            for account in map(to_json, accounts.values())
        ],
    }
