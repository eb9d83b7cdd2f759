"""The simulator protocol, and loading of physics trucks, deep trucks and corrected trucks.

Time indices follow the paper: y(k+1) is produced from u(k), w(k) and the state after y(k). The acceleration
of y(k+1) is the mean over the step, so v(k+1) = v(k) + a(k+1) dt holds to rounding.
"""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any, Protocol, cast, runtime_checkable

from deeptruck_core import reading
from deeptruck_core.arrays import Array
from deeptruck_core.errors import InputError
from deeptruck_core.imports.entry_points import registered
from deeptruck_core.signals import TruckInterface
from deeptruck_model import calls
from deeptruck_model.manifest import KINDS, SCHEMES
from deeptruck_model.manifest import manifest as read_manifest


class MinimalSimulator(Protocol):
    """The required members of a batched truck; `completed` adds the rest.

    Shapes: u (batch, len(interface.u)), w (batch, len(interface.w)), y (batch, len(interface.y)). The state
    is opaque; `step` returns a new one and does not change the old one.
    """

    @property
    def interface(self) -> TruckInterface: ...
    @property
    def dt(self) -> float: ...

    def reset(self, y0: Array) -> Any:
        """State at the observable initial condition y0 (batch, n_y), with the default internal state."""
        ...

    def step(self, state: Any, u: Array, w: Array) -> tuple[Any, Array]:
        """One step of dt: the next state and y (batch, n_y)."""
        ...


@runtime_checkable
class Simulator(MinimalSimulator, Protocol):
    """A batched truck with all members that the tools here use."""

    def force(self, state: Any, y: Array) -> Any:
        """The same internal state with the fed-back response replaced by a recorded y (the training form).

        Where y is NaN the simulator keeps its own response.
        """
        ...

    def inside(self, state: Any) -> dict[str, Array]:
        """Internal signals, each (batch,): gear, engine_speed ...; {} for a deep truck."""
        ...

    def parameters(self) -> dict[str, float]:
        """Tunable parameters by name, SI: mass, drag_area, ...; {} if there are none."""
        ...

    def with_parameters(self, values: Mapping[str, float]) -> Simulator:
        """The same truck with some parameters replaced. Raises InputError for a name it does not have."""
        ...

    def save(self, path: Path) -> None:
        """Write a simulator directory that `load` reads."""
        ...


def completed(simulator: MinimalSimulator | str | Path) -> Simulator:
    """A simulator with all members of `Simulator`; a complete one is returned as it is, a name is loaded.

    Without `force` it is reset at each recorded response, which loses gear and pressures. Raises InputError
    for an object that is no simulator, with what it lacks, and as `load` does.
    """
    if isinstance(simulator, str | Path):
        return load(simulator)
    if isinstance(simulator, type):
        raise InputError(f"{simulator.__name__} is a class; give a simulator that it makes")
    if inspect.isroutine(simulator) or isinstance(simulator, partial):
        name = getattr(simulator, "__name__", "it")
        raise InputError(f"{name} is a function; give the simulator that it returns: {name}()")
    if isinstance(simulator, Simulator):
        return simulator
    from deeptruck_model.outside.truck import adapted

    return cast(Simulator, adapted(simulator))


def load(path: str | Path) -> Simulator:
    """Load a simulator: a simulator directory, `truck:NAME[:overrides.yaml]` or `truck:FILE.yaml` for a
    physics truck, `python:MODULE:FACTORY[:arguments.yaml]` for an object made by a user's function, or
    `fmu:MODEL.fmu[:mapping.yaml]` for an FMU.

    Loaders of directories and of schemes before a colon are registered by entry points of installed packages:
    `manifest.KINDS` and SCHEMES. This module knows none of them.

    Raises InputError if there is no such truck, the directory has no manifest, or a file is damaged.
    """
    calls.path(path, "a simulator")
    scheme, _, rest = str(path).partition(":")
    schemes = registered(SCHEMES)
    if rest and scheme in schemes:
        return cast(Simulator, schemes[scheme].load()(rest))
    manifest = read_manifest(Path(path))
    with reading.of(path):
        return cast(Simulator, registered(KINDS)[manifest["kind"]].load()(Path(path), manifest))
