"""A folder that refers to an outside simulator: its source, and the hashes of its files.

The base of a corrected simulator is such a folder. A correction is valid for one simulator only, so a
simulator whose files have changed is refused until a user accepts it.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from deeptruck_core import files, reading
from deeptruck_core.errors import InputError
from deeptruck_core.signals import TruckInterface
from deeptruck_model.outside.reference import PYTHON, Reference, is_outside, refer
from deeptruck_model.outside.truck import KIND, MANIFEST, SCHEMA, OutsideTruck, adopted

MAKE_AGAIN = "run 'deeptruck-model mismatch' again"


def check(path: Path, manifest: Mapping[str, Any]) -> Reference:
    """The reference in the folder `path` to a simulator outside it, with the files' present SHA-256; no code
    of the simulator is run.

    Raises InputError where the folder is damaged, or where the module or the arguments are missing or have
    changed.
    """
    reference = _reference(path, manifest)
    for what, file in (("module", reference.module_file), ("arguments", reference.arguments)):
        was, is_ = manifest.get(f"{what}_sha256"), getattr(reference, f"{what}_sha256")
        if was != is_:
            name = what if file is None else file.name
            raise InputError(
                f"{name} of SHA-256 {str(was)[:12]} is {str(is_)[:12]} now: accept it with "
                f"'deeptruck-model check-simulator {reading.typed(path)} --accept', or {MAKE_AGAIN}"
            )
    return reference


def _reference(path: Path, manifest: Mapping[str, Any]) -> Reference:
    if manifest.get("schema") != SCHEMA:
        raise InputError(f"{path} was saved by another version; {MAKE_AGAIN}")
    text = manifest.get("simulator")
    file, at = manifest.get("module_file"), manifest.get("arguments_file")
    if text is None and "object" in manifest:
        raise InputError(
            f"{path} stands for an object of {reading.plain(str(manifest['object']))}, which cannot be made "
            f"again; write a factory for it and name it as {PYTHON}MODULE:FACTORY"
        )
    if not isinstance(text, str) or not is_outside(text) or not isinstance(at, str | None):
        raise InputError(f"{path / MANIFEST} is damaged (it names no simulator); {MAKE_AGAIN}")
    try:
        return refer(text, *(None if x is None else Path(str(x)) for x in (file, at)))
    except InputError as error:
        what = "module" if text.startswith(PYTHON) else "file"
        raise InputError(f"{path}: {error} (its {what} was {reading.plain(str(file))})") from None


def load_directory(path: Path, manifest: dict[str, Any]) -> OutsideTruck:
    """The simulator to which a folder of kind 'outside' refers. Raises InputError as `check` does."""
    truck = adopted(check(path, manifest))
    try:
        values = {str(name): float(value) for name, value in manifest.get("parameters", {}).items()}
        dt, interface = float(manifest["dt"]), TruckInterface.from_dict(manifest["interface"])
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise InputError(
            f"{path / MANIFEST} is damaged ({reading.plain(repr(error))}); {MAKE_AGAIN}"
        ) from None
    if (interface, dt) != (truck.interface, truck.dt):
        raise InputError(f"{path}: {manifest['simulator']} has another interface or dt now; {MAKE_AGAIN}")
    return truck.with_parameters(values)


def stands_for(path: Path) -> Path | None:
    """The folder of kind 'outside': `path`, or the base of a corrected simulator; None if neither is one."""
    while (path / MANIFEST).is_file():
        kind = reading.json_object(path / MANIFEST, MAKE_AGAIN).get("kind")
        if kind == KIND:
            return path
        path = path / "base"
    return None


def as_it_is(path: Path) -> OutsideTruck:
    """The simulator to which the folder `path` refers, changed or not. Raises InputError if it is missing."""
    return adopted(_reference(path, reading.json_object(path / MANIFEST, MAKE_AGAIN)))


def accept(path: Path) -> None:
    """Accept the present files of the simulator to which the folder `path` refers.

    Raises InputError if they are not found.
    """
    manifest = reading.json_object(path / MANIFEST, MAKE_AGAIN)
    content = manifest | _reference(path, manifest).to_dict()
    files.write(path / MANIFEST, json.dumps(content, indent=1).encode())
