"""The folder of a proof, in which `prove` continues from run to run. Standard library only."""

from __future__ import annotations

import shutil
from pathlib import Path

from deeptruck_core.errors import InputError
from deeptruck_core.files import Result
from deeptruck_model.results import apart

CASE = Result("an examined case", "choose another folder")
PROOF = Result("a proof")
PLANT = Result("a proof on another's truck")
REAL = Result("an examination of real logs")
_OF_A_CASE = {"case.json", "simulator.yaml", "truth", "recordings", "found"}  # and drafts


def clear(folder: Path, *inside: str) -> None:
    """Remove what there is of an unfinished case, or these subfolders of a finished one.

    Raises InputError for a folder that is not an examined case, or, naming it, for something else in it; then
    nothing is removed.
    """
    CASE.check(folder, overwrite=True)
    if CASE.marked(folder):
        if foreign := [p for p in folder.iterdir() if p.name not in _OF_A_CASE and p.name[0] != "."]:
            raise InputError(f"{folder} holds {foreign[0].name}, which is no part of {CASE.what}; move it")
        for place in [folder / name for name in inside] if inside else [folder]:
            shutil.rmtree(place, ignore_errors=True)


def check(out: Path) -> None:
    """Whether a proof can be continued in `out`: a new folder, or one with its marker.

    Raises InputError as `Result.check` does.
    """
    PROOF.check(out, overwrite=True)  # nothing is replaced: what is scored there is kept


def check_plant(plant: str, out: Path) -> None:
    """Raises InputError for an unknown plant, or if a proof on it cannot be done in `out` (see `check`)."""
    if plant != "fastsim":
        raise InputError(f"--plant: there is no '{plant}'; choose fastsim")
    PLANT.check(out, overwrite=True)  # what is scored there is kept


def check_real(data: Path, out: Path) -> None:
    """Raises InputError if there is no folder of real logs, or their examination cannot be done in `out` (see
    `check`)."""
    if not data.is_dir():
        raise InputError(f"--real: there is no folder {data}; docs/recordings.md says where logs are from")
    apart(out, data)
    REAL.check(out, overwrite=True)  # what is judged there is kept
