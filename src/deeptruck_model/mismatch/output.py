"""Files of a result: verdict.json, profiles.csv, report.html and the corrected simulator."""

from __future__ import annotations

import csv
import json
import shutil
from pathlib import Path

import numpy as np

from deeptruck_core.constants import GRAVITY
from deeptruck_core.errors import InputError
from deeptruck_core.signals import shown
from deeptruck_model import calls, simulators
from deeptruck_model.mismatch.folders import (
    APPLIED,
    CORRECTED,
    PROFILE,
    REFITTED,
    applicable,
    apply_command,
    read_verdict,
)
from deeptruck_model.mismatch.report import lines, page
from deeptruck_model.mismatch.report.found import Mismatch
from deeptruck_model.mismatch.verdict.result import Verdict
from deeptruck_model.results import FOUND


def summary(mismatch: Mismatch | Verdict, units: str = "m/s") -> list[str]:
    """The sentences of a result, or of a verdict that was read, with speeds in `units`."""
    if not isinstance(mismatch, Mismatch | Verdict):
        asked = "what find_mismatch or mismatch.read returns"
        raise InputError(f"summary takes {asked}, not {calls.shown(mismatch)}")
    verdict = mismatch if isinstance(mismatch, Verdict) else mismatch.result
    return [shown(line, units) for line in lines.lines(verdict)]


def read(folder: str | Path) -> Verdict:
    """The verdict in a folder that `write`, or 'deeptruck-model mismatch', wrote, without the forces along
    the drives. Raises InputError if there is none, or it is damaged."""
    folder = calls.path(folder, "the folder")
    verdict = read_verdict(folder)
    try:
        return Verdict.read(verdict)
    except (KeyError, TypeError, ValueError, AttributeError, IndexError) as error:
        raise InputError(
            f"{folder / 'verdict.json'} is damaged ({error!r}); run 'deeptruck-model mismatch' again"
        ) from None


def write(mismatch: Mismatch, out: str | Path, *, overwrite: bool = False) -> None:
    """Write the folder `out`, completely or not at all. Raises InputError as `files.Result.check` does, and
    on a full disk."""
    if not isinstance(mismatch, Mismatch):
        raise InputError(f"write takes what find_mismatch returns and a folder, not {calls.shown(mismatch)}")
    out = calls.path(out, "out")
    with FOUND.replacing(out, overwrite=overwrite) as draft:
        fill(draft, mismatch, apply_command(out))


def fill(draft: Path, mismatch: Mismatch, command: str, units: str = "m/s") -> None:
    """Write the files of a result into the folder `draft`; `command` is the one that applies the correction,
    `units` are those of speeds in sentences and on the page. Raises OSError."""
    (draft / "verdict.json").write_text(json.dumps(mismatch.verdict_in(units), indent=1))
    _write_profiles(mismatch, draft / "profiles.csv")
    for name, truck in ((CORRECTED, mismatch.corrected), (REFITTED, mismatch.refitted)):
        if truck is not None:
            truck.save(draft / name)
    page.write(mismatch, draft / "report.html", command, units)


def _write_profiles(mismatch: Mismatch, path: Path) -> None:
    """Write the force of each finding along time and distance, one row per second, in the unit of forces; a
    slope as rise over run. Writes no file if nothing could be compared."""
    e = mismatch.evidence
    if e is None:
        return
    every = max(1, round(1.0 / e.dt))
    with path.open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(["recording", "time_s", "distance_m", "name", "value"])
        for f in mismatch.findings:
            if f.force is None:
                continue
            scale = -1.0 / GRAVITY if f.effect == PROFILE else e.unit.scale
            force = e.newtons(f.force) / e.mass * scale
            known = np.isfinite(force) & (force != 0.0)
            for s in e.drives:
                for k in range(s.start, s.stop - every + 1, every):
                    if known[k : k + every].any():
                        value = float(force[k : k + every].mean())
                        at = (f"{e['time'][k]:.2f}", f"{e['distance'][k]:.1f}")
                        rows.writerow([s.name, *at, f.effect, f"{value:.6g}"])


def apply(directory: str | Path, out: str | Path, *, refit: bool = False, overwrite: bool = False) -> None:
    """Copy to `out` the simulator with the least error on held-out recordings, or with `refit` the one with
    refitted parameters only. Raises InputError if it is not better than the simulator as given, and as
    `files.Result.check` does."""
    if isinstance(directory, Mismatch):
        raise InputError("apply takes a folder; write the mismatch first: mismatch.write(found, FOLDER)")
    directory, out = calls.path(directory, "the folder"), calls.path(out, "out")
    APPLIED.check(out, overwrite=overwrite)
    truck = applicable(directory, refit=refit)
    try:
        simulators.load(truck)  # one that has lost a file is not copied
    except InputError as error:
        what = str(error).rsplit(";", 1)[0]
        raise InputError(f"{what}; run 'deeptruck-model mismatch' again") from None
    with APPLIED.replacing(out, overwrite=overwrite) as draft:
        shutil.copytree(truck, draft, dirs_exist_ok=True)
