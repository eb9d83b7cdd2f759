"""What a run leaves behind: verdict.json, profiles.csv, report.html and the corrected simulator."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np

from deeptruck_model.constants import GRAVITY
from deeptruck_model.mismatch_flow.report import page
from deeptruck_model.mismatch_flow.result import Result
from deeptruck_model.results import FOUND


def write(found: Result, out: Path, *, overwrite: bool = False) -> None:
    """Write the folder `out`, whole or not at all. Raises InputError as `files.Result.check` does."""
    with FOUND.replacing(out, overwrite=overwrite) as draft:
        fill(draft, found, out)


def fill(draft: Path, found: Result, out: Path) -> None:
    """Write the files of a result into the folder `draft`, which becomes `out`. Raises OSError."""
    (draft / "verdict.json").write_text(json.dumps(found.verdict, indent=1))
    write_profiles(found, draft / "profiles.csv")
    if found.corrected is not None:
        found.corrected.save(draft / "simulator")
    page.write(found, draft / "report.html", f"deeptruck-model apply {out} --out {out.name}_simulator")


def write_profiles(found: Result, path: Path) -> None:
    """The force of each finding along time and distance, one row a second: in the unit of forces, of a slope
    as rise over run. No file where nothing could be compared."""
    e = found.evidence
    if e is None:
        return
    every = max(1, round(1.0 / e.dt))
    with path.open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(["recording", "time_s", "distance_m", "name", "value"])
        for f in found.findings:
            if f.force is None:
                continue
            force = (
                e.newtons(f.force) / e.mass * (-1.0 / GRAVITY if f.effect == "road_grade" else e.unit.scale)
            )
            known = np.isfinite(force) & (force != 0.0)
            for s in e.stretches:
                for k in range(s.start, s.stop - every + 1, every):
                    if known[k : k + every].any():
                        rows.writerow(
                            [
                                s.name,
                                f"{e['time'][k]:.2f}",
                                f"{e['distance'][k]:.1f}",
                                f.effect,
                                f"{float(force[k : k + every].mean()):.6g}",
                            ]
                        )
