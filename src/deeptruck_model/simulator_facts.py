"""Facts about a simulator from its manifest or name, before anything heavy is imported."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from deeptruck_core import reading
from deeptruck_core.errors import InputError
from deeptruck_core.imports.entry_points import registered
from deeptruck_core.signals import TruckInterface
from deeptruck_model.outside import saved
from deeptruck_model.outside.reference import FMU_FORM, FORM, is_outside
from deeptruck_model.outside.truck import KIND, look

MANIFEST = (
    "simulator.json"  # {"kind": "physics|deep|corrected", "schema": 1, "interface": {...}, "dt": 0.1, ...}
)
KINDS = "deeptruck.simulators"  # entry points: kinds of simulator directories, and who loads each
SCHEMES = "deeptruck.simulator_schemes"  # by what stands before a colon: a function of what stands behind it
WEIGHTS = "model.safetensors"  # of a deep truck


@dataclass(frozen=True)
class SimulatorFacts:
    """Facts about a simulator: `kind` is an entry point of KINDS, `dt` its step in s."""

    name: str
    kind: str
    interface: TruckInterface
    dt: float


def simulator(text: str) -> SimulatorFacts:
    """Facts about a simulator that simulators.load can load; an outside one is made to find them.

    Raises InputError for a missing truck or override, a factory that makes no simulator, or a directory that
    is no simulator.
    """
    if text.startswith("truck:"):
        from deeptruck_model.trucks.specification import named

        return SimulatorFacts(text, "physics", named(text.removeprefix("truck:")).interface, 0.1)
    if is_outside(text):
        return SimulatorFacts(text, KIND, *look(text))
    if by_scheme(text):  # of another package, which alone knows what it is
        scheme, _, rest = text.partition(":")
        other = registered(SCHEMES)[scheme].load()(rest)
        return SimulatorFacts(text, scheme, other.interface, other.dt)
    path = Path(text)
    data = manifest(path)
    _check_beneath(path, data)
    if data["kind"] == "deep" and not (path / WEIGHTS).is_file():
        raise InputError(f"{path} has lost {WEIGHTS}; restore that file, or train again")
    try:
        return SimulatorFacts(
            text, data["kind"], TruckInterface.from_dict(data["interface"]), float(data.get("dt", 0.1))
        )
    except (KeyError, TypeError, ValueError) as error:
        says = str(error) if isinstance(error, InputError) else repr(error)
        raise InputError(
            f"{path / MANIFEST} is damaged ({says}); train or save the simulator again"
        ) from None


def _check_beneath(path: Path, data: dict[str, Any]) -> None:
    """Raises InputError if the base of a corrected simulator is lost, or is an outside simulator that
    changed."""
    if data["kind"] == "corrected":
        _check_beneath(path / "base", manifest(path / "base"))
    elif data["kind"] == KIND:
        saved.check(path, data)


def by_scheme(text: str) -> bool:
    """Whether a simulator is named by a scheme before a colon, and not by a directory."""
    scheme, _, rest = text.partition(":")
    return bool(rest) and scheme in registered(SCHEMES)


def manifest(path: Path) -> dict[str, Any]:
    """The manifest of a simulator directory. Raises InputError if it is missing, damaged or unknown."""
    if not path.exists():
        from deeptruck_model.trucks.specification import pool

        known = ", ".join(f"truck:{name}" for name in pool())
        raise InputError(f"{path} does not exist; give a simulator directory, {known}, {FORM} or {FMU_FORM}")
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
