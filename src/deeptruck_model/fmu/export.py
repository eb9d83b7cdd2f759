"""Exports a simulator of this package as an FMU for co-simulation, FMI 3: `deeptruck-model export --fmu`.

PythonFMU3 wraps `slave.py` with its own library. The FMU therefore needs a Python with deeptruck on the
machine that runs it.
"""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path

from deeptruck_core import files
from deeptruck_core.errors import InputError
from deeptruck_model import simulators
from deeptruck_model.checks import MANIFEST, manifest
from deeptruck_model.fmu import slave_file
from deeptruck_model.outside.reference import is_outside
from deeptruck_model.outside.truck import KIND

SCRIPT, FOLDER = "deeptruck_slave.py", "simulator"
MISSING = "exporting an FMU needs PythonFMU3; install it with \"pip install 'deeptruck[fmu]'\""


def check(simulator: str) -> None:
    """Raises InputError if PythonFMU3 is missing, or `simulator` is not of this package."""
    try:
        import pythonfmu3  # noqa: F401
    except ImportError:
        raise InputError(MISSING) from None
    if is_outside(simulator):
        raise InputError(
            f"{simulator} is somebody else's, which no FMU of ours can hold; give a truck of our own"
        )
    path = Path(simulator)
    while (path / MANIFEST).is_file():
        if manifest(path)["kind"] == KIND:
            raise InputError(
                f"{simulator} stands for a simulator of somebody else's, which no FMU of ours can hold; "
                "export a physics, deep or corrected truck of our own"
            )
        path = path / "base"


def export(simulator: str, out: Path) -> None:
    """Write the FMU `out`, completely or not at all. Raises InputError as `check`, `load` and
    `files.new_file` do."""
    check(simulator)
    from pythonfmu3 import FmuBuilder

    with files.new_file(out) as draft, tempfile.TemporaryDirectory() as place:
        work = Path(place)
        simulators.load(simulator).save(work / FOLDER)
        shutil.copy(slave_file(), work / SCRIPT)
        built = FmuBuilder.build_FMU(
            work / SCRIPT,
            dest=work / "built",
            project_files=[work / FOLDER],
            canGetAndSetFMUState=True,
            canHandleVariableCommunicationStepSize=True,
        )
        shutil.copyfile(built, draft)
