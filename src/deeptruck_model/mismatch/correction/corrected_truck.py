"""The corrected simulator: the old one, its parameters as refitted, and the named forces beside it."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deeptruck_model import reading
from deeptruck_model.errors import InputError
from deeptruck_model.mismatch.data.prepared import heard
from deeptruck_model.mismatch.expression import Rerun, Stream
from deeptruck_model.mismatch.mechanisms import KNOWN, Variant, build, saved
from deeptruck_model.mismatch.mechanisms.carriers import CARRIERS
from deeptruck_model.mismatch.residual import effective_mass
from deeptruck_model.mismatch.residual.command_path import CommandPath
from deeptruck_model.mismatch.residual.components import SENSITIVITY, Shares
from deeptruck_model.mismatch.residual.evidence import overall_ratio, turns
from deeptruck_model.outside.truck import keep
from deeptruck_model.signals import ACCELERATION, SPEED, TruckInterface
from deeptruck_model.simulators import MANIFEST, Run, Simulator
from deeptruck_model.simulators import load as load_simulator

Array = NDArray[np.float64]

EXOGENOUS = ("gap", "leader_speed", "ambient_temperature", "elevation", "gear", "engine_speed")

# 1: forces gave force per mass of acceleration; 2: a force that changed did nothing while brakes held.
# 3: forces were of the size they had about other parameters. Coefficients of all three mean something else.
# 4: terms were settings by name, and not variants.
SCHEMA = 5


@dataclass(frozen=True)
class Term:
    """A variant of a mechanism of the library, and its coefficients."""

    effect: str
    variant: Variant
    coefficients: tuple[float, ...]


@dataclass
class State:
    """State of a corrected truck: the base truck's, the mechanisms' memory, and where the drive stands."""

    base: Any
    memory: tuple[list[Any], list[Any]]  # of what brakes make up for, of the mechanisms
    path: Any
    speed: Array
    distance: Array
    elapsed: float
    row: int


class CorrectedTruck:
    """A Simulator that adds named forces to another one.

    `moved` are relative changes of parameters; those the base truck has are set in it, the others act as
    forces. `carried` are factors of its own forces in those of the terms, see `carried.factors`; none is one.
    Channels the protocol does not carry (gap, ambient temperature, elevation) come from `along`, and
    count as absent without it.
    """

    def __init__(
        self,
        base: Simulator,
        terms: Sequence[Term],
        moved: Mapping[str, float],
        shares: Shares | None,
        validated: bool,
        gears: Sequence[float] = (),
        carried: Mapping[str, float] | None = None,
    ) -> None:
        self._carried = dict(carried or {})
        own = base.parameters()
        inner = {name: own[name] * (1 + change) for name, change in moved.items() if name in own}
        self.original, self.terms, self.moved = base, tuple(terms), dict(moved)
        self.base = base.with_parameters(inner) if inner else base
        self.shares, self.validated, self.gears = shares, validated, tuple(gears)
        self._exogenous: dict[str, Array] = {}
        weighted = [(SENSITIVITY[name], change) for name, change in moved.items() if name not in own]
        paths = []
        for term in self.terms:
            for column, b in zip(build(KNOWN[term.effect], term.variant), term.coefficients, strict=True):
                if isinstance(column.expression, Rerun):
                    paths.append((column.expression.path, column.expression.amount, b))
                elif b != 0.0:
                    weighted.append((column.expression, b))
        self._path = CommandPath(paths, base.interface.u, base.dt)
        self._stream = Stream([expression for expression, _ in weighted])
        asked = frozenset[str]().union(*(expression.signals() for expression, _ in weighted))
        self._asks = asked | {"engine_speed" for _ in asked & {"ratio", "lever"}}  # it is read from that
        self._weights = [b for _, b in weighted]
        self._radius = own.get("wheel_radius")
        self._holds = effective_mass.holds(base)
        self._held = Stream([effective_mass.held(self._holds)])

    @property
    def adds(self) -> bool:
        """Whether it is more than the truck beneath with other parameters."""
        return bool(self.terms or self._weights)

    def asks_beyond(self) -> tuple[str, ...]:
        """Signals that its terms are made of and that the protocol does not tell, such as a gap."""
        inside = self.base.inside(self.base.reset(np.zeros((1, len(self.interface.y)))))
        told = {*self.interface.u, *self.interface.w, *inside}
        return tuple(name for name in EXOGENOUS if name in self._asks and name not in told)

    @property
    def interface(self) -> TruckInterface:
        return self.base.interface

    @property
    def driven(self) -> Any:
        """What the truck beneath has learned from, where it is a learned one."""
        return getattr(self.original, "driven", None)

    @property
    def dt(self) -> float:
        return self.base.dt

    def _like(
        self, *, moved: dict[str, float] | None = None, validated: bool | None = None
    ) -> CorrectedTruck:
        """The same with other changes of parameters, or marked as validated or not."""
        return CorrectedTruck(
            self.original,
            self.terms,
            self.moved if moved is None else moved,
            self.shares,
            self.validated if validated is None else validated,
            self.gears,
            self._carried,
        )

    def marked(self, validated: bool) -> CorrectedTruck:
        """The same, marked as validated on held-out recordings or not."""
        return self._like(validated=validated)

    def along(self, exogenous: Mapping[str, Array]) -> CorrectedTruck:
        """The same truck on a drive whose other channels (batch, T) are known."""
        other = self._like()
        other._exogenous = dict(exogenous)
        return other

    def reset(self, y0: Array) -> State:
        batch = len(y0)
        return State(
            self.base.reset(y0),
            (self._held.begin(batch), self._stream.begin(batch)),
            self._path.begin(),
            y0[:, SPEED].copy(),
            np.zeros(batch),
            0.0,
            0,
        )

    def step(self, state: State, u: Array, w: Array) -> tuple[State, Array]:
        commands, path = self._path.step(state.path, u)
        inner, y = self.base.step(state.base, commands, w)
        now = self._now(inner, y, u, w, state)
        (left,), braked = self._held.step(state.memory[0], now, self.dt)
        now["effective_mass_gain"] = now["effective_mass_gain"] * left
        now |= effective_mass.holding(self._holds, now, left)
        if "engine" in now:
            now["sensitivity:mass"] = now["effective_mass_gain"] * (
                now["brake"] + now["drag"] - now["engine"]
            )
        values, memory = self._stream.step(state.memory[1], now, self.dt)
        extra = sum((b * v for b, v in zip(self._weights, values, strict=True)), start=np.zeros(len(y)))
        y = y.copy()
        speed = np.maximum(state.speed + (y[:, ACCELERATION] + extra) * self.dt, 0.0)
        held = (y[:, SPEED] <= 0.0) & (extra <= 0.0)  # a force against motion does not push a standing truck
        speed = np.where(held, 0.0, speed)
        y[:, ACCELERATION], y[:, SPEED] = (speed - state.speed) / self.dt, speed
        after = State(
            self._feed(inner, y),
            (braked, memory),
            path,
            speed,
            state.distance + speed * self.dt,
            state.elapsed + self.dt,
            state.row + 1,
        )
        return after, y

    def force(self, state: State, y: Array) -> State:
        return replace(state, base=self._feed(state.base, y), speed=y[:, SPEED].copy())

    def _feed(self, inner: Any, y: Array) -> Any:
        """The base truck's state, told y (batch, n_y); as along the recordings its forces were fitted to."""
        return self.base.force(inner, heard(self.base, y))

    def inside(self, state: State) -> dict[str, Array]:
        return self.base.inside(state.base)

    def parameters(self) -> dict[str, float]:
        return self.base.parameters()

    def with_parameters(self, values: Mapping[str, float]) -> CorrectedTruck:
        own = self.original.parameters()
        moved = self.moved | {k: v / own[k] - 1 for k, v in values.items() if own.get(k)}
        if set(values) - set(own):
            raise InputError(f"this simulator has no parameter {', '.join(sorted(set(values) - set(own)))}")
        return self._like(moved=moved)

    def rollout(self, u: Array, w: Array, y0: Array, recorded: Array | None) -> Run:
        """Free or forced run; see simulators.free_run. Faster than stepping only where nothing was added."""
        plain = getattr(self.base, "rollout", None)
        if plain is not None and not self.adds:
            run: Run = plain(u, w, y0, recorded)
            return run
        state = self.reset(y0)
        responses, insides = [y0], [self.inside(state)]
        for k in range(u.shape[1] - 1):
            state, y = self.step(state, u[:, k], w[:, k])
            responses.append(y)
            insides.append(self.inside(state))
            if recorded is not None:
                state = self.force(state, recorded[:, k + 1])
        return Run(
            np.stack(responses, axis=1),
            {name: np.stack([i[name] for i in insides], axis=1) for name in insides[0]},
        )

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
                    "variant": saved.to_json(t.variant),
                    "coefficients": list(t.coefficients),
                }
                for t in self.terms
            ],
            "shares": self.shares.to_dict() if self.shares else None,
            "validated": self.validated,
            "gears": list(self.gears),
            "carried": self._carried,
        }
        (path / MANIFEST).write_text(json.dumps(manifest, indent=1))

    def _now(self, inner: Any, y: Array, u: Array, w: Array, state: State) -> dict[str, Array]:
        """The signals of this step, by the names mechanisms use."""
        speed = y[:, SPEED]
        now: dict[str, Array] = {
            "speed": speed,
            "simulated": y[:, ACCELERATION],
            "distance": state.distance,
            "elapsed": np.full(len(y), state.elapsed),
        }
        now |= {name: u[:, i] for i, name in enumerate(self.interface.u)}
        now |= {name: w[:, i] for i, name in enumerate(self.interface.w)}
        inside = self.base.inside(inner)
        if "traction_force" in inside:
            mass = inside["mass"]
            now |= {"engine": inside["traction_force"] / mass, "brake": np.abs(inside["brake_force"]) / mass}
            now |= {
                "drag": np.abs(inside["drag_force"]) / mass,
                "rolling": np.abs(inside["rolling_force"]) / mass,
            }
            now |= {name: now[name] * factor for name, factor in self._carried.items()}
            now |= {name: inside[name] for name in ("gear", "engine_speed")}
        elif self.shares is not None:
            now |= self.shares.now(speed, u)
        if "engine_speed" in now:
            now["ratio"] = turns(now["engine_speed"], speed)
        for name, x in self._exogenous.items():
            # the simulator's own gear goes with the speed it drives at, the recorded one does not
            now.setdefault(name, x[:, min(state.row, x.shape[1] - 1)])
        if "ratio" in now:
            in_gear = inside["ratio"] / self._radius if self._radius and "ratio" in inside else None
            now["lever"] = overall_ratio(now["ratio"], self.gears, in_gear)
        turning = effective_mass.free(inside)
        now["effective_mass_gain"] = np.ones(len(y)) if turning is None else turning
        return now


def load_directory(path: Path, manifest: dict[str, Any]) -> CorrectedTruck:
    """A corrected truck from its directory. Raises InputError where this library cannot read it."""
    if manifest.get("schema") != SCHEMA:
        raise InputError(
            f"{path} was corrected by another version, whose terms are kept in another form;"
            " run the mismatch tool again"
        )
    try:
        unknown = [t["effect"] for t in manifest["terms"] if t["effect"] not in KNOWN]
        if unknown:
            raise InputError(f"{path} has terms this version does not know: {', '.join(unknown)}")
        terms = [
            Term(t["effect"], saved.variant_of(t["variant"]), tuple(t["coefficients"]))
            for t in manifest["terms"]
        ]
        shares = Shares.from_dict(manifest["shares"]) if manifest.get("shares") else None
        base = load_simulator(path / "base")
        gears = tuple(float(gear) for gear in manifest.get("gears", ()))
        moved, carried = (
            {str(name): float(value) for name, value in manifest.get(key, {}).items()}
            for key in ("parameters", "carried")
        )
        _check_numbers(terms, gears, moved, carried)
        return CorrectedTruck(base, terms, moved, shares, bool(manifest["validated"]), gears, carried)
    except InputError:
        raise
    except (KeyError, TypeError, ValueError, AttributeError, ArithmeticError, IndexError) as error:
        said = reading.plain(repr(error))
        raise InputError(f"{path / MANIFEST} is damaged ({said}); run the mismatch tool again") from None


def _check_numbers(
    terms: Sequence[Term], gears: Sequence[float], moved: Mapping[str, float], carried: Mapping[str, float]
) -> None:
    """Raises ValueError for numbers and names that no correction has."""
    numbers = [*gears, *moved.values(), *carried.values(), *(b for t in terms for b in t.coefficients)]
    if not all(isinstance(x, int | float) and math.isfinite(x) for x in numbers):
        raise ValueError("it holds a value that is no number")
    if not set(carried) <= set(CARRIERS):
        raise ValueError(f"it carries {', '.join(carried)}")
