"""Result folders of `deeptruck-model`: the kind of each."""

from __future__ import annotations

from pathlib import Path

from deeptruck_core import files
from deeptruck_core.errors import InputError
from deeptruck_core.files import Result

DEEP_TRUCK = Result("a deep truck", resumes_from=("resume.safetensors", "simulator.json"))
CALIBRATED = Result("a calibrated deep truck")
PHYSICS_TRUCK = Result("a physics truck")
FLEET = Result("the results of a fleet")
EVALUATION = Result("an evaluation")
COVERAGE = Result("a coverage")
BAG = Result("an imported bag")
WRITTEN_BAG = Result("a written bag")  # by a program that calls `write_bag`
FOUND = Result("a mismatch result")


def apart(out: Path, *inputs: Path, elsewhere: str = files.ELSEWHERE) -> None:
    """Raises InputError if `out` is one of the inputs or lies inside one."""
    place = out.resolve()
    for given in inputs:
        if place == given.resolve() or given.resolve() in place.parents:
            raise InputError(f"{out} is {given} or inside it, which is read here; {elsewhere}")
