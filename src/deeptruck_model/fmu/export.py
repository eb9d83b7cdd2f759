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
from deeptruck_model.manifest import MANIFEST, manifest
from deeptruck_model.outside.truck import KIND

SCRIPT, FOLDER = "deeptruck_slave.py", "simulator"


def export(simulator: str, out: Path) -> None:
    """Write the FMU `out`, completely or not at all.

    Raises InputError for a simulator that others wrote, which no FMU can hold, and as `load` and
    `files.new_file` do; ModuleNotFoundError without PythonFMU3.
    """
    from pythonfmu3 import FmuBuilder

    with files.new_file(out) as draft, tempfile.TemporaryDirectory() as place:
        work = Path(place)
        simulators.load(simulator).save(work / FOLDER)
        if any(manifest(path.parent)["kind"] == KIND for path in work.rglob(MANIFEST)):
            raise InputError(
                f"{simulator} is, or corrects, a simulator that others wrote, which no FMU of ours can hold; "
                "export a physics, deep or corrected truck of our own"
            )
        shutil.copy(Path(__file__).with_name("slave.py"), work / SCRIPT)
        built = FmuBuilder.build_FMU(
            work / SCRIPT,
            dest=work / "built",
            project_files=[work / FOLDER],
            canHandleVariableCommunicationStepSize=True,
        )
        shutil.copyfile(built, draft)
