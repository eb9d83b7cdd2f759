"""The manifest of a simulator directory, and the entry points by which simulators are found."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from deeptruck_core import reading
from deeptruck_core.errors import InputError
from deeptruck_core.imports.entry_points import registered
from deeptruck_model.outside.reference import FMU_FORM, FORM

MANIFEST = (
    "simulator.json"  # {"kind": "physics|deep|corrected", "schema": 1, "interface": {...}, "dt": 0.1, ...}
)
KINDS = "deeptruck.simulators"  # entry points: kinds of simulator directories, and who loads each
SCHEMES = "deeptruck.simulator_schemes"  # by what stands before a colon: a function of what stands behind it
WEIGHTS = "model.safetensors"  # of a deep truck


def by_scheme(text: str) -> bool:
    """Whether a simulator is named by a scheme before a colon, and not by a directory."""
    scheme, _, rest = text.partition(":")
    return bool(rest) and scheme in registered(SCHEMES)


def manifest(path: Path) -> dict[str, Any]:
    """The manifest of a simulator directory. Raises InputError if it is missing, damaged or unknown."""
    if not path.exists():
        raise InputError(
            f"{path} does not exist; give a simulator directory, truck:NAME as truck:trucksim, "
            f"{FORM} or {FMU_FORM}"
        )
    if path.suffix == ".py":
        raise InputError(f"{path} is a Python file; give it as python:{path.stem}:FACTORY from its folder")
    if not (path / MANIFEST).exists():
        raise InputError(
            f"{path} is not a simulator directory: it has no {MANIFEST}; 'deeptruck-model train' makes one"
        )
    data = reading.json_object(path / MANIFEST, reading.SAVE_AGAIN)
    kinds = registered(KINDS)
    if data.get("kind") not in kinds:
        raise InputError(f"{path / MANIFEST} has no known kind; installed are {', '.join(kinds) or 'none'}")
    return data
