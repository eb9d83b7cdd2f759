"""The corrected simulator: the given one with refitted parameters and the named forces."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from deeptruck_core import reading
from deeptruck_core.arrays import Array
from deeptruck_core.errors import InputError
from deeptruck_core.json_data import from_json, to_json
from deeptruck_core.signals import FELT, TruckInterface
from deeptruck_model.mismatch.correction.added import Added, State, TruckWithForces
from deeptruck_model.mismatch.mechanisms import LIBRARY, Variant, build, saved
from deeptruck_model.mismatch.mechanisms.families import joined
from deeptruck_model.mismatch.mechanisms.own import EXTRA
from deeptruck_model.mismatch.residual import effective_mass
from deeptruck_model.mismatch.residual.components import Shares, force_of
from deeptruck_model.mismatch.residual.expression import Expression, Rerun
from deeptruck_model.outside.truck import keep
from deeptruck_model.simulators import MANIFEST, Run, Simulator, run
from deeptruck_model.simulators import load as load_simulator
from deeptruck_model.simulators.running import stepped

EXOGENOUS = (
    "gap",
    "leader_speed",
    "ambient_temperature",
    "elevation",
    "gear",
    "engine_speed",
    "place",
    FELT,
)

# 1: forces gave force per mass of acceleration; 2: a force that changed did nothing while brakes held.
# 3: forces were of the size they had about other parameters. Coefficients of all three mean something else.
# 4: terms were settings by name, and not variants. 5: a term could be confined to a regime.
# 6: a variant was a class of its own, and not a form of its mechanism. 7: forces were of the size they had
# about other parameters, with factors on them.
SCHEMA = 8


@dataclass(frozen=True)
class Term:
    """Variants of a mechanism that are added together, and their coefficients."""

    effect: str
    variants: tuple[Variant, ...]
    coefficients: tuple[float, ...]


class CorrectedTruck:
    """A Simulator that adds named forces to another one.

    `moved` are relative changes of parameters; those that the base truck has are set in it, the others act as
    forces.
    Channels that the protocol does not carry (gap, ambient temperature, elevation) come from `along`, and
    count as not recorded without it.
    """

    def __init__(
        self,
        base: Simulator,
        terms: Sequence[Term],
        moved: Mapping[str, float],
        shares: Shares | None,
        validated: bool,
        gears: Sequence[float] = (),
    ) -> None:
        own = base.parameters()
        self.inner = {name: own[name] * (1 + change) for name, change in moved.items() if name in own}
        self.original, self.terms, self.moved = base, tuple(terms), dict(moved)
        self.base = base.with_parameters(self.inner) if self.inner else base
        self.shares, self.validated, self.gears = shares, validated, tuple(gears)
        added = [(force_of(n, base.interface.brake_unit), x) for n, x in moved.items() if n not in own]
        self.added = _added(self.terms, added)
        self._exogenous: dict[str, Array] = {}

    @property
    def adds(self) -> bool:
        """Whether it adds forces or command paths to the base truck, apart from changed parameters."""
        return bool(self.terms or self.added.forces)

    @cached_property
    def _with_forces(self) -> TruckWithForces:
        holds = effective_mass.holds(self.base)
        return TruckWithForces(self.base, self.added, holds, self.shares, self.gears, self._exogenous)

    def needs_beyond(self) -> tuple[str, ...]:
        """Signals in its terms that the protocol does not carry, such as a gap."""
        inside = self.base.inside(self.base.reset(np.zeros((1, len(self.interface.y)))))
        known, asked = {*self.interface.u, *self.interface.w, *inside}, self.added.signals()
        beyond = (*EXOGENOUS, *sorted(name for name in asked if name.startswith(EXTRA)))
        return tuple(name for name in beyond if name in asked and name not in known)

    @property
    def interface(self) -> TruckInterface:
        return self.base.interface

    @property
    def driven(self) -> Any:
        """The training domain of the base truck, if it is a learned one."""
        return getattr(self.original, "driven", None)

    @property
    def dt(self) -> float:
        return self.base.dt

    def _like(
        self, *, moved: dict[str, float] | None = None, validated: bool | None = None
    ) -> CorrectedTruck:
        """The same truck with other parameter changes or another validation mark."""
        return CorrectedTruck(
            self.original,
            self.terms,
            self.moved if moved is None else moved,
            self.shares,
            self.validated if validated is None else validated,
            self.gears,
        )

    def marked(self, validated: bool) -> CorrectedTruck:
        """The same truck, marked as validated on held-out recordings or not."""
        return self._like(validated=validated)

    def along(self, exogenous: Mapping[str, Array]) -> CorrectedTruck:
        """The same truck on a drive whose other channels (batch, T) are known."""
        other = self._like()
        other._exogenous = dict(exogenous)
        return other

    def reset(self, y0: Array) -> State:
        return self._with_forces.reset(y0)

    def step(self, state: State, u: Array, w: Array) -> tuple[State, Array]:
        return self._with_forces.step(state, u, w)

    def force(self, state: State, y: Array) -> State:
        return self._with_forces.force(state, y)

    def inside(self, state: State) -> dict[str, Array]:
        return self._with_forces.inside(state)

    def parameters(self) -> dict[str, float]:
        return self.base.parameters()

    def with_parameters(self, values: Mapping[str, float]) -> CorrectedTruck:
        own = self.original.parameters()
        moved = self.moved | {k: v / own[k] - 1 for k, v in values.items() if own.get(k)}
        if set(values) - set(own):
            raise InputError(f"this simulator has no parameter {', '.join(sorted(set(values) - set(own)))}")
        return self._like(moved=moved)

    def rollout(self, u: Array, w: Array, y0: Array, recorded: Array | None) -> Run:
        """Free or forced run; see simulators.free_run. Faster than stepping only if nothing was added."""
        return stepped(self, u, w, y0, recorded) if self.adds else run(self.base, u, w, y0, recorded)

    def save(self, path: Path) -> None:
        """Write the directory: base/ and the manifest with terms, parameter changes and validation."""
        path.mkdir(parents=True, exist_ok=True)
        keep(self.original, path / "base")
        manifest = {
            "schema": SCHEMA,
            "kind": "corrected",
            "interface": self.interface.to_dict(),
            "dt": self.dt,
            "parameters": self.moved,
            "terms": [
                {
                    "effect": t.effect,
                    "variants": [saved.to_json(v) for v in t.variants],
                    "coefficients": list(t.coefficients),
                }
                for t in self.terms
            ],
            "shares": to_json(self.shares),
            "validated": self.validated,
            "gears": list(self.gears),
            "mechanisms": {
                t.effect: LIBRARY.files[t.effect]
                for t in self.terms
                if t.effect in LIBRARY.own.keys() & LIBRARY.files.keys()
            },
        }
        (path / MANIFEST).write_text(json.dumps(manifest, indent=1))


def _added(terms: Sequence[Term], forces_of_moved: Sequence[tuple[Expression, float]]) -> Added:
    """The columns of the terms, and the forces of changed parameters that the base truck lacks."""
    forces = list(forces_of_moved)
    paths = []
    for term in terms:
        for column, b in zip(build(LIBRARY[term.effect], term.variants), term.coefficients, strict=True):
            if isinstance(column.expression, Rerun):
                paths.append((column.expression.path, column.expression.amount, b))
            elif b != 0.0:
                forces.append((column.expression, b))
    return Added(tuple(forces), tuple(paths))


def load_directory(path: Path, manifest: dict[str, Any]) -> CorrectedTruck:
    """A corrected truck from its directory. Raises InputError if this library cannot read it."""
    if manifest.get("schema") != SCHEMA:
        raise InputError(
            f"{path} was corrected by another version, whose terms are kept in another form;"
            " run the mismatch tool again"
        )
    try:
        for own in manifest.get("mechanisms", {}).values():
            joined(LIBRARY.read(Path(own["file"]), own["sha256"]))
        unknown = [t["effect"] for t in manifest["terms"] if t["effect"] not in LIBRARY]
        if unknown:
            raise InputError(
                f"{path} has terms this version does not know: {', '.join(unknown)}; mechanisms of your "
                "own are found again if they were given by a file"
            )
        terms = [
            Term(
                t["effect"],
                tuple(saved.variant_of(LIBRARY[t["effect"]], v) for v in t["variants"]),
                tuple(t["coefficients"]),
            )
            for t in manifest["terms"]
        ]
        shares = from_json(Shares, manifest["shares"]) if manifest.get("shares") else None
        base = load_simulator(path / "base")
        gears = tuple(float(gear) for gear in manifest.get("gears", ()))
        moved = {str(name): float(value) for name, value in manifest.get("parameters", {}).items()}
        _check_numbers(terms, gears, moved)
        return CorrectedTruck(base, terms, moved, shares, bool(manifest["validated"]), gears)
    except InputError:
        raise
    except (KeyError, TypeError, ValueError, AttributeError, ArithmeticError, IndexError) as error:
        said = reading.plain(repr(error))
        raise InputError(f"{path / MANIFEST} is damaged ({said}); run the mismatch tool again") from None


def _check_numbers(terms: Sequence[Term], gears: Sequence[float], moved: Mapping[str, float]) -> None:
    """Raises ValueError for numbers that a correction cannot have."""
    numbers = [*gears, *moved.values(), *(b for t in terms for b in t.coefficients)]
    if not all(isinstance(x, int | float) and math.isfinite(x) for x in numbers):
        raise ValueError("it holds a value that is no number")
