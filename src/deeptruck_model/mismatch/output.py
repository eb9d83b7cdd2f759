"""What a run leaves behind: verdict, profiles, pictures and the corrected simulator, all or nothing."""

from __future__ import annotations

import csv
import json
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from deeptruck_model import simulators
from deeptruck_model.constants import GRAVITY
from deeptruck_model.errors import InputError
from deeptruck_model.mismatch.folders import APPLIED, check_applicable, read_verdict
from deeptruck_model.mismatch.posterior.causes import Cause
from deeptruck_model.mismatch.report import headline
from deeptruck_model.mismatch.report.what_now import Asked
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.result import Mismatch, Verdict
from deeptruck_model.results import FOUND

if TYPE_CHECKING:
    from deeptruck_model.mismatch.report.figures import Picture

Array = NDArray[np.float64]

ROAD_M = 10.0  # along the road, of a row of road.csv


def summary(mismatch: Mismatch) -> list[str]:
    """What the terminal and the page begin with: what is missing, how sure that is, what correcting it is
    worth."""
    return headline.sentences(headline.of(mismatch.result))


def figures(mismatch: Mismatch) -> dict[str, Picture]:
    """The page's figures by name, as PNG with a caption; a notebook shows one that ends a cell."""
    from deeptruck_model.mismatch.report import figures as drawn

    return drawn.draw(mismatch)


def read(folder: str | Path) -> Verdict:
    """The verdict that `write`, or 'deeptruck-model mismatch', wrote into a folder; where each finding acts
    is left out. Raises InputError where there is none, or it is damaged."""
    folder = Path(folder)
    verdict = read_verdict(folder)
    try:
        return Verdict.read(verdict)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise InputError(
            f"{folder / 'verdict.json'} is damaged ({error!r}); run 'deeptruck-model mismatch' again"
        ) from None


def write(mismatch: Mismatch, out: str | Path, *, overwrite: bool = False) -> None:
    """Write verdict.json, profiles.csv, road.csv, figures, report.html and simulator/ as the folder `out`,
    whole or not at all. Raises InputError as `files.Result.check` does, and on a full disk.
    """
    if not isinstance(mismatch, Mismatch):
        raise InputError(f"write takes what find_mismatch returns, and then a folder; not {mismatch!r:.60}")
    out = Path(out)
    with FOUND.replacing(out, overwrite=overwrite) as draft:
        fill(draft, mismatch, Asked(out))


def fill(draft: Path, mismatch: Mismatch, asked: Asked) -> None:
    """Write the files of a result into the folder `draft`, which becomes `asked.out`. Raises OSError."""
    from deeptruck_model.mismatch.report import page

    (draft / "verdict.json").write_text(json.dumps(mismatch.verdict, indent=1))
    if mismatch.evidence is not None:
        _write_profiles(mismatch, draft / "profiles.csv")
        _write_road(mismatch, draft / "road.csv")
    if mismatch.corrected is not None:
        mismatch.corrected.save(draft / "simulator")
    page.write(mismatch, draft, asked)


def _write_profiles(m: Mismatch, path: Path) -> None:
    """The force of each finding along time and distance, one row a second, as specific force and as slope."""
    e = m.evidence
    assert e is not None
    every = max(1, round(1.0 / e.dt))
    with path.open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(["recording", "time_s", "distance_m", "name", "value"])
        for f in m.result.findings:
            if f.cause is None:
                continue
            force = _as_told(e, f.cause)
            for s in e.stretches:
                for k in range(s.start, s.stop - every + 1, every):
                    value = float(force[k : k + every].mean())
                    if f.cause.needed is not None and value == 0.0:
                        continue  # a slow force that is not known there
                    rows.writerow(
                        [
                            s.name,
                            f"{e['time'][k]:.2f}",
                            f"{e['distance'][k]:.1f}",
                            f.cause.effect,
                            f"{value:.6g}",
                        ]
                    )


def _as_told(e: Evidence, cause: Cause) -> Array:
    """The force of a cause (n,): as slope where it is one, else in the unit in which forces are told."""
    force = e.newtons(cause.force) / e.mass
    return force * (-1.0 / GRAVITY if cause.effect == "road_grade" else e.unit.scale)


def _write_road(m: Mismatch, path: Path) -> None:
    """What belongs to places, one row for every ROAD_M along the road, with the position where it is known;
    no file where nothing does."""
    causes = [f.cause for f in m.result.findings if f.cause is not None]
    again = [c for c in causes if c.term is not None and c.term.variant.comes_again]
    if m.evidence is None or not again:
        return
    with path.open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(["place_m", "latitude", "longitude", "name", "value"])
        for cause in again:
            rows.writerows(_along_the_road(m.evidence, cause))


def _along_the_road(e: Evidence, cause: Cause) -> Iterator[tuple[str, ...]]:
    """Place, position, name and force as it is told, of every ROAD_M that was driven."""
    value, unknown = _as_told(e, cause), np.full(len(e), np.nan)
    position = [e.signals.get(name, unknown) for name in ("latitude", "longitude")]
    bins = np.floor(e["place"] / ROAD_M)
    for k in np.unique(bins[e["place"] >= 0.0]):
        here = bins == k
        latitude, longitude = (f"{_middle(x[here]):.7f}" for x in position)
        yield (
            f"{_middle(e['place'][here]):.1f}",
            latitude,
            longitude,
            cause.effect,
            f"{_middle(value[here]):.6g}",
        )


def _middle(x: Array) -> float:
    """The median of what is known; NaN where nothing is."""
    x = x[np.isfinite(x)]
    return float(np.median(x)) if len(x) else float("nan")


def apply(directory: str | Path, out: str | Path, *, overwrite: bool = False) -> None:
    """Copy the corrected simulator of a run to `out`. Raises InputError without a passed validation, and as
    `files.Result.check` does.
    """
    if isinstance(directory, Mismatch):
        raise InputError("apply takes a folder; write the mismatch first: mismatch.write(found, FOLDER)")
    directory, out = Path(directory), Path(out)
    APPLIED.check(out, overwrite=overwrite)
    check_applicable(directory)
    _check_corrected(directory)
    with APPLIED.replacing(out, overwrite=overwrite) as draft:
        shutil.copytree(directory / "simulator", draft, dirs_exist_ok=True)


def _check_corrected(directory: Path) -> None:
    """Raises InputError for a simulator that lost a file: no use elsewhere, and no training mends it."""
    try:
        simulators.load(directory / "simulator")
    except InputError as error:
        what = str(error).rsplit(";", 1)[0]
        raise InputError(f"{what}; run 'deeptruck-model mismatch --out {directory}' again") from None
