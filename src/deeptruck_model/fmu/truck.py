"""Wraps an FMU as an object that `outside` accepts as a simulator: batches, forced runs, parameters."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from deeptruck_core.arrays import Array
from deeptruck_core.errors import InputError
from deeptruck_core.signals import ACCELERATION, FUEL, SPEED, TruckInterface
from deeptruck_model.fmu.description import Description, Variable, described
from deeptruck_model.fmu.drives import Drive, Instances
from deeptruck_model.fmu.instance import Instance, Unpacked
from deeptruck_model.fmu.variables import VariableMap, variable_map
from deeptruck_model.simulators import Run

STARTS_NEAR = 0.01  # m/s between the speed that it is to start at and that it has then
COASTS = 1.0  # m/s^2, by which no truck on a level road slows with its pedals released
TRIED = 20.0  # m/s, at which an FMU is asked whether its outputs are valid after a step


@dataclass(frozen=True)
class Row:
    """A truck of the batch: its drive and position, its present speed, and its last outputs.

    `measured` is a recorded speed and acceleration that replace its own at the next step.
    """

    drive: Drive
    length: int
    speed: float
    acceleration: float
    out: tuple[float, ...]
    measured: tuple[float, float] | None = None


State = tuple[Row, ...]


class FmuTruck:
    """A batch of trucks, each an instance of one FMU. `values` are changed parameters, in SI."""

    def __init__(self, instances: Instances, names: VariableMap, values: Mapping[str, float]) -> None:
        self._instances, self._map, self._values = instances, names, dict(values)
        self._speed, self._seen = names.outputs[0], names.outputs[1:]
        self._changed: dict[str, float] = {}
        self._silent_at_start = False  # its outputs are valid from the first step on

    @property
    def interface(self) -> TruckInterface:
        return self._map.interface

    @property
    def dt(self) -> float:
        return self._map.dt

    @property
    def command_range(self) -> dict[str, tuple[float, float]]:
        """The range of commands declared by the FMU, in the interface's units."""
        out = {}
        for link in self._map.inputs[: len(self.interface.u)]:
            low, high = link.variable.low, link.variable.high
            if low is not None and high is not None:
                out[link.name] = (float(link.ours(np.array(low))), float(link.ours(np.array(high))))
        return out

    def reset(self, y0: Array) -> State:
        """A state at y0 (batch, n_y); the FMU is started again. Raises InputError if it starts at another
        response."""
        self._instances.room_for(len(y0))
        return tuple(self._begun(y) for y in np.asarray(y0, np.float64))

    def step(self, state: State, u: Array, w: Array) -> tuple[State, Array]:
        """One step under u (batch, n_u) and w (batch, n_w)."""
        inputs = self._inputs(np.asarray(u, np.float64), np.asarray(w, np.float64))
        after = tuple(self._stepped(row, x) for row, x in zip(state, inputs, strict=True))
        return after, self._responses(after)

    def force(self, state: State, y: Array) -> State:
        """The state at a recorded y (batch, n_y). If the FMU has no input for it, it is started again
        there."""
        return tuple(self._forced(row, measured) for row, measured in zip(state, y, strict=True))

    def inside(self, state: State) -> dict[str, Array]:
        """The signals in the map besides the response, and the mass if it has forces."""
        return self._insides(np.array([row.out for row in state]))

    def parameters(self) -> dict[str, float]:
        """The parameters in the map, in SI."""
        return dict(self._values)

    def with_parameters(self, values: Mapping[str, float]) -> FmuTruck:
        """The same FMU with other values. Raises InputError for a value outside the range in the map."""
        for name, value in values.items():
            link = self._map.parameters[name]
            if not link.low <= value <= link.high:
                said = f"{link.low:g} to {link.high:g}"
                raise InputError(f"parameter {name} is {value:g}, which is not in its range of {said}")
        other = FmuTruck(self._instances, self._map, {**self._values, **values})
        other._changed = {**self._changed, **values}
        other._silent_at_start = self._silent_at_start
        return other

    def rollout(self, u: Array, w: Array, y0: Array, recorded: Array | None) -> Run:
        """A free run, or one forced along `recorded`, with a single instance for each row."""
        inputs = self._inputs(np.asarray(u, np.float64), np.asarray(w, np.float64))
        y = np.empty((*u.shape[:2], len(self.interface.y)))
        y[:, 0] = y0
        out = np.empty((*u.shape[:2], len(self._map.outputs)))
        for i, row in enumerate(inputs):
            past = None if recorded is None else recorded[i]
            out[i], before = self._driven(row, y0[i], past)
            speed = self._speed.ours(out[i, 1:, 0])
            y[i, 1:, SPEED], y[i, 1:, ACCELERATION] = speed, (speed - before) / self.dt
        if self.interface.fuel:
            y[:, 1:, FUEL] = self._fuel(out[:, 1:])
        return Run(y, self._insides(out))

    def _driven(self, inputs: Array, y0: Array, recorded: Array | None) -> tuple[Array, Array]:
        """Outputs of the FMU along one row (T, outputs), and the speed (T-1,) at the start of each step."""
        instance = self._instances.alone()
        steps, dt, speed_of = inputs.tolist(), self.dt, self._scalar
        speed, acceleration = float(y0[SPEED]), _number(y0[ACCELERATION])
        out = [self._started(instance, speed, acceleration)]
        none = [0.0] * len(self._map.measured)
        before, row = [], none
        for k in range(len(steps) - 1):
            before.append(speed)
            out.append(instance.step([*steps[k], *row]))
            now = speed_of(out[-1][0])
            self._check(now, (k + 1) * dt)
            speed, acceleration = now, (now - speed) / dt
            if recorded is None:
                continue
            measured = recorded[k + 1]
            speed, acceleration, new = self._takes(speed, acceleration, measured)
            row = self._measured(speed, acceleration) if new and self._map.measured else none
            if new and not self._map.measured and k + 2 < len(steps):
                self._started(instance, speed, acceleration)
        return np.array(out), np.array(before)

    def _takes(self, speed: float, acceleration: float, measured: Array) -> tuple[float, float, bool]:
        """Speed and acceleration from which to continue, and whether they are new to the FMU."""
        to, at = float(measured[SPEED]), float(measured[ACCELERATION])
        if math.isnan(to) and math.isnan(at):
            return speed, acceleration, False
        to, at = speed if math.isnan(to) else to, acceleration if math.isnan(at) else at
        if not self._map.measured and abs(to - speed) <= self._map.restart_beyond:
            return speed, acceleration, False
        return to, at, True

    def _begun(self, y0: Array) -> Row:
        speed, acceleration = float(y0[SPEED]), _number(y0[ACCELERATION])
        drive = Drive(self._begin(speed, acceleration))
        out = self._instances.begin(drive)
        if self._starts_elsewhere(speed, out):
            out = self._instances.begin(drive)
        return Row(drive, 0, speed, acceleration, tuple(out))

    def _stepped(self, row: Row, inputs: Array) -> Row:
        measured = [0.0] * len(self._map.measured) if row.measured is None else self._measured(*row.measured)
        drive, out = self._instances.step(row.drive, row.length, [*inputs.tolist(), *measured])
        speed = self._scalar(out[0])
        self._check(speed, (row.length + 1) * self.dt)
        return Row(drive, row.length + 1, speed, (speed - row.speed) / self.dt, tuple(out))

    def _forced(self, row: Row, measured: Array) -> Row:
        speed, acceleration, new = self._takes(row.speed, row.acceleration, measured)
        if not new:
            return row
        if self._map.measured:
            return replace(row, speed=speed, acceleration=acceleration, measured=(speed, acceleration))
        return Row(Drive(self._begin(speed, acceleration)), 0, speed, acceleration, row.out)

    def _started(self, instance: Instance, speed: float, acceleration: float) -> list[float]:
        out = instance.start(self._begin(speed, acceleration))
        if self._starts_elsewhere(speed, out):
            out = instance.start(self._begin(speed, acceleration))
        return out

    def _begin(self, speed: float, acceleration: float) -> list[tuple[Variable, float]]:
        """Start values of the FMU's variables, in its units."""
        if not math.isfinite(speed):
            raise InputError("the speed to start at is no number; give recordings that have it")
        given = {"speed": speed, "acceleration": acceleration}
        links = [(link, given[name]) for name, link in self._map.start.items()]
        links += [(self._map.parameters[name], value) for name, value in self._changed.items()]
        return [
            *self._map.settings,
            *((link.variable, float(link.theirs(np.array(x)))) for link, x in links),
        ]

    def _starts_elsewhere(self, speed: float, out: Sequence[float]) -> bool:
        """Whether the initial outputs `out` have another speed although a test instance, whose outputs are
        valid only after a step, has the right one. Raises InputError if its speed is wrong too."""
        has = self._scalar(out[0])
        if self._silent_at_start or abs(has - speed) <= STARTS_NEAR:
            return False
        released = self._inputs(*(np.zeros(len(x)) for x in (self.interface.u, self.interface.w)))
        instance = self._instances.alone()
        begun = self._scalar(instance.start(self._begin(TRIED, 0.0))[0])
        after = self._scalar(instance.step([*released.tolist(), *[0.0] * len(self._map.measured)])[0])
        near = STARTS_NEAR + COASTS * self.dt
        self._silent_at_start = abs(after - TRIED) <= near < abs(begun - TRIED)
        if not self._silent_at_start:
            raise InputError(
                f"the FMU starts at {has:.4g} m/s where it was to start at {speed:.4g}; look at "
                f"'start: speed' ({self._map.start['speed'].variable.name}) and its unit"
            )
        return True

    def _check(self, speed: float, at: float) -> None:
        if not math.isfinite(speed):
            raise InputError(
                f"its speed is {speed} after {at:.4g} s: it diverged; give the mapping a smaller 'step', or "
                "look at the units of its inputs"
            )

    def _inputs(self, u: Array, w: Array) -> Array:
        """Commands and grade (..., inputs) in the FMU's units."""
        columns = [*np.moveaxis(u, -1, 0), *np.moveaxis(w, -1, 0)]
        if len(columns) != len(self._map.inputs):
            raise InputError(f"u and w have {len(columns)} columns, the FMU takes {len(self._map.inputs)}")
        if not all(np.isfinite(x).all() for x in columns):
            raise InputError("a command or grade is not a finite number")
        return np.stack([link.theirs(x) for link, x in zip(self._map.inputs, columns, strict=True)], axis=-1)

    def _measured(self, speed: float, acceleration: float) -> list[float]:
        given = {"speed": speed, "acceleration": acceleration, "active": 1.0}
        return [float(link.theirs(np.array(given[name]))) for name, link in self._map.measured.items()]

    def _scalar(self, speed: float) -> float:
        c = self._speed.conversion
        return c.factor * speed + c.offset

    def _responses(self, rows: Sequence[Row]) -> Array:
        y = np.empty((len(rows), len(self.interface.y)))
        y[:, ACCELERATION] = [row.acceleration for row in rows]
        y[:, SPEED] = [row.speed for row in rows]
        if self.interface.fuel:
            y[:, FUEL] = self._fuel(np.array([row.out for row in rows]))
        return y

    def _fuel(self, out: Array) -> Array:
        at = next(i for i, link in enumerate(self._map.outputs) if link.name == "fuel_rate")
        return self._map.outputs[at].ours(out[..., at])

    def _insides(self, out: Array) -> dict[str, Array]:
        seen = {link.name: link.ours(out[..., i]) for i, link in enumerate(self._seen, 1)}
        if "traction_force" in seen and "mass" in self._values:
            seen.setdefault("mass", np.full(out.shape[:-1], self._values["mass"]))
        return seen


def _number(x: float) -> float:
    return float(x) if math.isfinite(x) else 0.0


def make(file: Path, mapping: Mapping[Any, Any] | None) -> FmuTruck:
    """The simulator in a .fmu file; variables are mapped by a mapping file, or by their names.

    Raises InputError for a file that is no FMU or cannot run here, and for a map that lacks a required
    signal.
    """
    d = described(file)
    names = variable_map(d, mapping or {})
    return FmuTruck(_instances(d, names), names, _values(names))


def _values(names: VariableMap) -> dict[str, float]:
    """Start values of the parameters, in SI."""
    out = {}
    for name, link in names.parameters.items():
        if link.variable.start is None:
            raise InputError(f"parameters: {name} ({link.variable.name}) has no start value; leave it out")
        own = {v.name: x for v, x in names.settings}.get(link.variable.name, link.variable.start)
        out[name] = float(link.ours(np.array(own)))
    return out


def _instances(d: Description, names: VariableMap) -> Instances:
    unpacked: list[Unpacked] = []
    inputs = [link.variable for link in (*names.inputs, *names.measured.values())]
    outputs = [link.variable for link in names.outputs]
    substeps = round(names.dt / names.step)

    def new() -> Instance:
        if not unpacked:
            unpacked.append(Unpacked(d))
        return Instance(unpacked[0], inputs, outputs, names.dt / substeps, substeps)

    return Instances(new, d.keeps_state, d.only_once)
