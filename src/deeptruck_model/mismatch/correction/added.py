"""Adds forces and changes of the command path to a truck, step by step, for one correction or a batch of
several.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from deeptruck_core.arrays import Array
from deeptruck_core.signals import ACCELERATION, SPEED
from deeptruck_model.mismatch.prepare.prepared import fed_back
from deeptruck_model.mismatch.residual import effective_mass
from deeptruck_model.mismatch.residual.commands import CommandPath
from deeptruck_model.mismatch.residual.components import Shares
from deeptruck_model.mismatch.residual.evidence import overall_ratio, turns
from deeptruck_model.mismatch.residual.expression import Expression, Stream
from deeptruck_model.simulators import Simulator

Size = float | Array
"""Of all rows of a batch, or of each (batch,)."""


@dataclass(frozen=True)
class Added:
    """Additions to a truck: expressions with their sizes, m/s^2; and command paths by name, amount and share
    (`CommandPath`)."""

    forces: tuple[tuple[Expression, Size], ...] = ()
    paths: tuple[tuple[str, float, Size], ...] = ()

    @staticmethod
    def side_by_side(each: Sequence[Added], rows: Sequence[int]) -> Added:
        """Several corrections in one batch, each for its number of rows."""

        def only(k: int, size: Size) -> Array:
            return np.repeat([size if j == k else 0.0 for j in range(len(each))], rows)

        return Added(
            tuple((x, only(k, b)) for k, a in enumerate(each) for x, b in a.forces),
            tuple((path, amount, only(k, b)) for k, a in enumerate(each) for path, amount, b in a.paths),
        )

    def signals(self) -> frozenset[str]:
        """Names of all signals in the expressions."""
        asked = frozenset[str]().union(*(x.signals() for x, _ in self.forces))
        return asked | {"engine_speed" for _ in asked & {"ratio", "overall_ratio"}}  # it is read from that


@dataclass
class State:
    """State of a truck with added forces: the truck's state, the expressions' memory, and the position in the
    drive."""

    base: Any
    memory: tuple[list[Any], list[Any]]  # of what brakes compensate, of the mechanisms
    path: Any
    speed: Array
    distance: Array
    elapsed: float
    row: int


class TruckWithForces:
    """A base truck with additions. Channels that the protocol does not carry (gap, ambient temperature,
    elevation) come from `exogenous`, (batch, T) each, and count as not recorded without it. `holds`: whether
    the brakes hold a deceleration (`effective_mass.holds`)."""

    def __init__(
        self,
        base: Simulator,
        added: Added,
        holds: bool,
        shares: Shares | None = None,
        gears: Sequence[float] = (),
        exogenous: Mapping[str, Array] | None = None,
    ) -> None:
        self.base, self._added, self._shares, self._gears = base, added, shares, tuple(gears)
        self._exogenous = dict(exogenous or {})
        self._path = CommandPath(added.paths, base.interface.u, base.dt)
        self._stream, self._sizes = _streamed(added.forces)
        self._radius = base.parameters().get("wheel_radius")
        self._holds = holds
        self._held = Stream([effective_mass.held(self._holds)])

    def along(self, exogenous: Mapping[str, Array]) -> TruckWithForces:
        """The same truck on drives whose other channels (batch, T) are known."""
        return TruckWithForces(self.base, self._added, self._holds, self._shares, self._gears, exogenous)

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
        """One step, as `Simulator.step`."""
        commands, path = self._path.step(state.path, u)
        inner, y = self.base.step(state.base, commands, w)
        now = self._now(inner, y, u, w, state)
        (left,), braked = self._held.step(state.memory[0], now, self.base.dt)
        now["effective_mass_gain"] = now["effective_mass_gain"] * left
        now |= effective_mass.holding(self._holds, now, left)
        if "engine" in now:
            by_mass = self.base.interface.brake_unit != effective_mass.HELD_UNIT  # else a force per mass
            now["sensitivity:mass"] = now["effective_mass_gain"] * (
                by_mass * now["brake"] + now["drag"] - now["engine"]
            )
        values, memory = self._stream.step(state.memory[1], now, self.base.dt)
        extra = sum((b * v for b, v in zip(self._sizes, values, strict=True)), start=np.zeros(len(y)))
        y = self._pushed(y, extra, state.speed)
        after = State(
            self._feed(inner, y),
            (braked, memory),
            path,
            y[:, SPEED].copy(),  # whoever drives it may write into what he is given
            state.distance + y[:, SPEED] * self.base.dt,
            state.elapsed + self.base.dt,
            state.row + 1,
        )
        return after, y

    def _pushed(self, y: Array, extra: Array, before: Array) -> Array:
        """The response with `extra` acceleration, (batch,); a resisting force does not move a
        standing truck."""
        y, dt = y.copy(), self.base.dt
        speed = np.maximum(before + (y[:, ACCELERATION] + extra) * dt, 0.0)
        speed = np.where((y[:, SPEED] <= 0.0) & (extra <= 0.0), 0.0, speed)
        y[:, ACCELERATION], y[:, SPEED] = (speed - before) / dt, speed
        return y

    def force(self, state: State, y: Array) -> State:
        measured = y[:, SPEED]
        speed = np.where(np.isnan(measured), state.speed, measured)  # NaN: its own goes on
        return replace(state, base=self._feed(state.base, y), speed=speed)

    def _feed(self, inner: Any, y: Array) -> Any:
        """The base truck's state after feedback of y (batch, n_y), as in the fit of its forces."""
        return self.base.force(inner, fed_back(self.base, y))

    def inside(self, state: State) -> dict[str, Array]:
        return self.base.inside(state.base)

    def _now(self, inner: Any, y: Array, u: Array, w: Array, state: State) -> dict[str, Array]:
        """The signals of this step, by the names that mechanisms use."""
        speed, inside = y[:, SPEED], self.base.inside(inner)
        now: dict[str, Array] = {
            "speed": speed,
            "simulated": y[:, ACCELERATION],
            "distance": state.distance,
            "elapsed": np.full(len(y), state.elapsed),
        }
        now |= {name: u[:, i] for i, name in enumerate(self.base.interface.u)}
        now |= {name: w[:, i] for i, name in enumerate(self.base.interface.w)}
        now |= self._own_forces(inside, speed, u)
        if "engine_speed" in now:
            now["ratio"] = turns(now["engine_speed"], speed)
        for name, x in self._exogenous.items():
            # the simulator's own gear goes with the speed it drives at, the recorded one does not
            now.setdefault(name, x[:, min(state.row, x.shape[1] - 1)])
        if "ratio" in now:
            in_gear = inside["ratio"] / self._radius if self._radius and "ratio" in inside else None
            now["overall_ratio"] = overall_ratio(now["ratio"], self._gears, in_gear)
        turning = effective_mass.free(inside)
        now["effective_mass_gain"] = np.ones(len(y)) if turning is None else turning
        return now

    def _own_forces(self, inside: Mapping[str, Array], speed: Array, u: Array) -> dict[str, Array]:
        """The truck's own forces per mass, reported by it or computed from shares."""
        if "traction_force" not in inside:
            return dict(self._shares.now(speed, u)) if self._shares is not None else {}
        mass = inside["mass"]
        own = {
            "engine": inside["traction_force"] / mass,
            "brake": np.abs(inside["brake_force"]) / mass,
            "drag": np.abs(inside["drag_force"]) / mass,
            "rolling": np.abs(inside["rolling_force"]) / mass,
        }
        return own | {name: inside[name] for name in ("gear", "engine_speed") if name in inside}


def _streamed(forces: Iterable[tuple[Expression, Size]]) -> tuple[Stream, list[Size]]:
    """The Stream of the distinct expressions, and the size of each."""
    forces = list(forces)
    places = Stream([x for x, _ in forces]).outputs
    sizes: dict[int, Size] = {}
    first: dict[int, Expression] = {}
    for place, (x, b) in zip(places, forces, strict=True):
        sizes[place] = sizes[place] + b if place in sizes else b
        first.setdefault(place, x)
    return Stream(list(first.values())), list(sizes.values())
