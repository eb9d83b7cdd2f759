"""What a run leaves behind: verdict, profiles, pictures and the corrected simulator, all or nothing."""

from __future__ import annotations

import csv
import json
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from deeptruck_model import files, simulators
from deeptruck_model.errors import InputError

if TYPE_CHECKING:
    from deeptruck_model.mismatch.tool import Mismatch


def check(out: Path) -> bool:
    """Whether `out` holds a result of this tool, which would be replaced. Raises InputError where nothing can
    be written there; called before long computing."""
    if out.exists() and not out.is_dir():
        raise InputError(f"{out} is a file; choose another --out")
    if out.exists() and any(out.iterdir()) and not (out / "verdict.json").exists():
        raise InputError(f"{out} exists and holds other files; choose an empty or new --out")
    files.check_folder(out.parent)
    return (out / "verdict.json").exists()


@contextmanager
def reserved(out: Path) -> Iterator[bool]:
    """Hold `out` for one run, and tell whether an older result there is replaced; nothing is left of it where
    the run fails. Raises InputError where nothing can be written there, or another run is about to."""
    replaced, new = check(out), not out.exists()
    out.mkdir(parents=True, exist_ok=True)
    try:
        with files.writing(out):
            yield replaced
    finally:
        if new:
            with suppress(OSError):  # it holds what was written
                out.rmdir()


def write(mismatch: Mismatch, out: Path) -> None:
    """Write verdict.json, profiles.csv, figures, report.html and simulator/ under `out`, all or nothing."""
    from deeptruck_model.mismatch import report

    out.parent.mkdir(parents=True, exist_ok=True)
    try:
        temporary = Path(tempfile.mkdtemp(prefix=f".{out.name}-", dir=out.parent))
    except OSError as error:
        raise InputError(f"cannot write to {out.parent}: {error.strerror}; {files.advice(error)}") from None
    try:
        (temporary / "verdict.json").write_text(json.dumps(plain(mismatch.verdict), indent=1))
        if mismatch.evidence is not None:
            _write_profiles(mismatch, temporary / "profiles.csv")
        if mismatch.corrected is not None:
            mismatch.corrected.save(temporary / "simulator")
        report.write(mismatch, temporary)
        _replace(temporary, out)
    except OSError as error:
        raise InputError(f"cannot write to {out}: {error.strerror}; {files.advice(error)}") from None
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def _replace(temporary: Path, out: Path) -> None:
    """Put the new results where older ones of this tool stood; anything else there stays and is an error."""
    check(out)
    if out.exists():
        shutil.rmtree(out)
    temporary.chmod(0o755)
    temporary.rename(out)


def _write_profiles(m: Mismatch, path: Path) -> None:
    """The force of each finding along time and distance, one row a second, as specific force and as slope."""
    e = m.evidence
    assert e is not None
    every = max(1, round(1.0 / e.dt))
    with path.open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(["recording", "time_s", "distance_m", "name", "value"])
        for f in m.findings:
            if f.cause is None:
                continue
            force = e.newtons(f.cause.force)
            force /= -9.80665 * e.mass if f.cause.effect == "road_grade" else 1.0
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


def plain(x: Any) -> Any:
    """JSON data without NaN, infinities and numpy types."""
    if isinstance(x, dict):
        return {str(k): plain(v) for k, v in x.items()}
    if isinstance(x, (list, tuple)):
        return [plain(v) for v in x]
    if isinstance(x, (bool, np.bool_)):
        return bool(x)
    if isinstance(x, (int, np.integer)):
        return int(x)
    if isinstance(x, (float, np.floating)):
        return float(x) if np.isfinite(x) else None
    return x


def apply(directory: Path, out: Path) -> None:
    """Copy the corrected simulator of a run to `out`. Raises InputError without a passed validation."""
    verdict = _verdict(directory)
    if verdict.get("verdict") in ("nothing_missing", "undetermined"):
        raise InputError(f"in {directory} nothing was found that could be applied")
    if not verdict["fit"].get("validated"):
        raise InputError(
            f"{directory} has no passed validation (held-out error did not improve), so it is not applied; "
            "record more"
        )
    if out.exists():
        raise InputError(f"{out} exists already; choose a new --out")
    _check_corrected(directory)
    if out.parent.exists() and not out.parent.is_dir():
        raise InputError(f"{out.parent} is a file; choose another --out")
    with files.together(out) as draft:
        shutil.copytree(directory / "simulator", draft, dirs_exist_ok=True)


def _verdict(directory: Path) -> dict[str, Any]:
    try:
        verdict = json.loads((directory / "verdict.json").read_text())
    except (OSError, ValueError):
        raise InputError(
            f"{directory} holds no readable verdict.json; "
            "give the folder that 'deeptruck-model mismatch' wrote"
        ) from None
    if not isinstance(verdict, dict) or not isinstance(verdict.get("fit"), dict):
        raise InputError(
            f"{directory / 'verdict.json'} is damaged; run 'deeptruck-model mismatch --out {directory}' again"
        )
    return verdict


def _check_corrected(directory: Path) -> None:
    """Raises InputError for a simulator that lost a file: no use elsewhere, and no training mends it."""
    try:
        simulators.load(directory / "simulator")
    except InputError as error:
        what = str(error).rsplit(";", 1)[0]
        raise InputError(f"{what}; run 'deeptruck-model mismatch --out {directory}' again") from None
