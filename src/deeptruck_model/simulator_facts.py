"""Facts about a simulator from its manifest or name, before anything heavy is imported."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from deeptruck_core.errors import InputError
from deeptruck_core.imports.entry_points import registered
from deeptruck_core.signals import TruckInterface
from deeptruck_model.manifest import MANIFEST, SCHEMES, WEIGHTS, by_scheme, manifest
from deeptruck_model.outside import saved
from deeptruck_model.outside.reference import is_outside
from deeptruck_model.outside.truck import KIND, look
from deeptruck_model.trucks.specification import named


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
