"""The physics truck behind the Simulator protocol."""

from __future__ import annotations

import copy
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deeptruck_core import reading
from deeptruck_core.arrays import Array
from deeptruck_core.errors import InputError
from deeptruck_core.signals import TruckInterface
from deeptruck_model import calls
from deeptruck_model.results import PHYSICS_TRUCK
from deeptruck_model.simulators import MANIFEST, Run
from deeptruck_model.trucks import kernel
from deeptruck_model.trucks.forces import CommandFilter, Force, View, total_force
from deeptruck_model.trucks.parameters import check_value
from deeptruck_model.trucks.specification import (
    Specification,
    from_pool,
    named,
    override,
    read_yaml,
    specification_from_dict,
)
from deeptruck_model.trucks.state import INSIDE, STATE

SUBSTEP = 0.01  # s, the inner step
DT = (1e-3, 60.0)  # s, steps that a manifest may have


@dataclass(frozen=True)
class TruckState:
    """Complete state of trucks: `records` (batch,) of STATE, and copies of the forces' and filters'
    states."""

    records: NDArray[Any]
    forces: tuple[Force, ...] = ()
    filters: tuple[CommandFilter, ...] = ()

    def copy(self) -> TruckState:
        """An independent copy."""
        if not self.forces and not self.filters:
            return TruckState(self.records.copy())
        return TruckState(self.records.copy(), copy.deepcopy(self.forces), copy.deepcopy(self.filters))


class PhysicsTruck:
    """A batched truck with engine, gearbox, brakes and road load; internal steps at 100 Hz, external steps of
    `dt` seconds.

    `forces` and `command_filters` come from outside the package (see forces.py and docs/trucks.md).
    """

    def __init__(
        self,
        specification: Specification,
        *,
        forces: Sequence[Force] = (),
        command_filters: Sequence[CommandFilter] = (),
        dt: float = 0.1,
    ) -> None:
        if not 0.0 < calls.number(dt, "dt", "s") <= 60.0:
            raise InputError(f"dt is {dt:g} s; it must be above 0 and at most 60")
        self.specification = specification
        self.forces, self.command_filters = tuple(forces), tuple(command_filters)
        self._dt = dt
        self.substeps = max(1, round(dt / SUBSTEP))
        self.substep = dt / self.substeps
        self.record = specification.record()

    @property
    def interface(self) -> TruckInterface:
        return self.specification.interface

    @property
    def dt(self) -> float:
        return self._dt

    def reset(self, y0: Array) -> TruckState:
        """Settled state at acceleration and speed y0 (batch, n_y >= 2). Raises InputError for NaN."""
        y0 = np.ascontiguousarray(y0, np.float64)
        if y0.ndim != 2 or y0.shape[1] < 2 or not np.all(np.isfinite(y0[:, :2])):
            raise InputError("the initial response y0 must be finite numbers (batch, 2 or 3)")
        self._check_batch(len(y0))
        records = np.zeros(len(y0), STATE)
        kernel.reset(records, self.record, y0)
        if y0.shape[1] > 2:
            records["fuel_rate"] = y0[:, 2]
        state = TruckState(records, copy.deepcopy(self.forces), copy.deepcopy(self.command_filters))
        for force in state.forces:
            force.reset(len(y0))
        for command_filter in state.filters:
            command_filter.reset(len(y0))
        return state

    def step(self, state: TruckState, u: Array, w: Array) -> tuple[TruckState, Array]:
        """One step of dt; u (batch, 2), w (batch, 1), or (batch, 0) without a grade sensor."""
        u = np.ascontiguousarray(u, np.float64)
        grade, asked = self._conditions(w, (len(state.records),))
        if u.shape != (len(state.records), 2):
            raise InputError(f"u has shape {u.shape}, expected {(len(state.records), 2)}")
        state = state.copy()
        if asked.size:
            state.records["asked_gear"] = asked
        y = np.empty((len(u), len(self.interface.y)))
        self.advance(state, u, grade, y)
        return state, y

    def force(self, state: TruckState, y: Array) -> TruckState:
        """The same internal state with a recorded acceleration and speed."""
        state = state.copy()
        kernel.force(state.records, self.record, np.ascontiguousarray(y, np.float64))
        return state

    def inside(self, state: TruckState) -> dict[str, Array]:
        """The signals of state.INSIDE, each (batch,)."""
        return {name: state.records[name].copy() for name in INSIDE}

    def parameters(self) -> dict[str, float]:
        """Every scalar by name; parameters.PARAMETERS has units, ranges and meanings."""
        return dict(self.specification.values)

    def with_parameters(self, values: Mapping[str, float]) -> PhysicsTruck:
        """The same truck with some scalars replaced. Raises InputError for a wrong name or value."""
        if not isinstance(values, Mapping):
            raise InputError(
                f"parameters are given by name, such as {{'mass': 28000.0}}, not as {calls.shown(values)}"
            )
        return self._with(self.specification.with_values(values))

    def with_batch_parameters(self, values: Mapping[str, Array]) -> PhysicsTruck:
        """The same truck with scalars that differ along the batch: each value (batch,), as in a fleet."""
        sizes = {np.shape(v) for v in values.values()}
        if len(sizes) != 1 or len(next(iter(sizes))) != 1:
            raise InputError("batch parameters must all be one-dimensional and of one length")
        truck = self._with(self.specification)
        truck.record = np.repeat(self.specification.record(), next(iter(sizes))[0])
        for name, column in values.items():
            truck.record[name] = [check_value(name, float(v)) for v in column]
            if name == "reference_torque" and self.interface.engine_unit == "percent":
                truck.record["command_scale"] = truck.record[name] / 100.0
        return truck

    def with_forces(
        self, forces: Sequence[Force], command_filters: Sequence[CommandFilter] = ()
    ) -> PhysicsTruck:
        """The same truck with these forces and command filters instead of its own."""
        return PhysicsTruck(self.specification, forces=forces, command_filters=command_filters, dt=self._dt)

    def with_grade_input(self) -> PhysicsTruck:
        """The same truck with the grade in w; for callers that know the grade of a truck without a grade
        sensor."""
        return self._with(replace(self.specification, interface=replace(self.interface, grade=True)))

    def with_recorded_gear(self) -> PhysicsTruck:
        """The same truck with the recorded gear in w, so that it shifts when the recorded truck did.

        Where that gear is NaN or below 0.5, the truck selects the gear.
        """
        return self._with(replace(self.specification, interface=replace(self.interface, gear=True)))

    def with_dt(self, dt: float) -> PhysicsTruck:
        """The same truck with external steps of dt seconds."""
        return PhysicsTruck(
            self.specification, forces=self.forces, command_filters=self.command_filters, dt=dt
        )

    def rollout(
        self, u: Array, w: Array, y0: Array, recorded: Array | None = None, *, inside: bool = True
    ) -> Run:
        """A whole run: simulators.free_run (recorded None) or forced_run; `inside=False` saves the memory of
        internal signals."""
        u = np.ascontiguousarray(u, np.float64)
        if u.ndim != 3 or u.shape[2] != 2:
            raise InputError(f"u has shape {u.shape}, expected (batch, T, 2)")
        grade, asked = self._conditions(w, u.shape[:2])
        state = self.reset(y0)
        y = np.empty((*u.shape[:2], len(self.interface.y)))
        y[:, 0] = y0[:, : y.shape[2]]
        raw = state.records.view(np.float64).reshape(len(u), -1)
        seen = np.empty((len(u), u.shape[1] if inside else 0, len(INSIDE)))
        if inside:
            seen[:, 0] = raw[:, : len(INSIDE)]
        past = np.zeros((len(u), 0, 2)) if recorded is None else np.ascontiguousarray(recorded, np.float64)
        if self.forces or self.command_filters:
            self._roll_with_forces(state, u, grade, asked, past, y, raw, seen)
        else:
            row = kernel.rollout(
                state.records, raw, self.record, u, grade, asked, past, self.substeps, self.substep, y, seen
            )
            _refuse(row)
        return Run(y, {name: seen[:, :, j] for j, name in enumerate(INSIDE)} if inside else {})

    def save(self, path: Path, *, overwrite: bool = False) -> None:
        """Write a simulator directory; an older one of a physics truck is replaced only with `overwrite`.

        Raises InputError as `files.Result.check` does, and for a truck with forces, because code cannot be
        saved.
        """
        if self.forces or self.command_filters or len(self.record) > 1:
            raise InputError("a truck with forces, command filters or batch parameters cannot be saved")
        manifest = {
            "kind": "physics",
            "schema": 1,
            "interface": self.interface.to_dict(),
            "dt": self._dt,
            "truck": self.specification.to_dict(),
        }
        with PHYSICS_TRUCK.replacing(path, overwrite=overwrite) as draft:
            (draft / MANIFEST).write_text(json.dumps(manifest, indent=1))

    def _with(self, specification: Specification) -> PhysicsTruck:
        return PhysicsTruck(
            specification, forces=self.forces, command_filters=self.command_filters, dt=self._dt
        )

    def _check_batch(self, batch: int) -> None:
        if len(self.record) not in (1, batch):
            raise InputError(f"the truck has parameters for {len(self.record)} rows, the batch has {batch}")

    def _conditions(self, w: Array, shape: tuple[int, ...]) -> tuple[Array, Array]:
        """Grade, and the recorded gear (of no column where the truck chooses), both of `shape`."""
        expected = (*shape, len(self.interface.w))
        if np.shape(w) != expected:
            raise InputError(
                f"w has shape {np.shape(w)}, expected {expected}: {', '.join(self.interface.w) or 'nothing'}"
            )
        columns = {
            name: np.ascontiguousarray(np.asarray(w, np.float64)[..., i])
            for i, name in enumerate(self.interface.w)
        }
        return columns.get("grade", np.zeros(shape)), columns.get("gear", np.zeros((*shape[:-1], 0)))

    def advance(self, state: TruckState, u: Array, grade: Array, y: Array) -> None:
        """One step in place, for loops that do not share the state; y (batch, n_y) is filled."""
        if not state.forces and not state.filters:
            _refuse(kernel.step(state.records, self.record, u, grade, self.substeps, self.substep, y))
            return
        before = state.records["speed"].copy()
        fuel = np.zeros(len(u))
        view = View(state.records, u, grade)
        for _ in range(self.substeps):
            for command_filter in state.filters:
                view.u = command_filter.filter(u if view.u is u else view.u, view.time, self.substep)
            _refuse(kernel.first_half(state.records, self.record, view.u, grade, self.substep, fuel))
            external = total_force(state.forces, view, self.substep)
            _refuse(kernel.second_half(state.records, self.record, external, self.substep), "a force")
            view.time += self.substep
            view.u = u
        state.records["fuel_rate"] = fuel / self.substeps
        y[:, 0] = (state.records["speed"] - before) / self._dt
        y[:, 1] = state.records["speed"]
        if y.shape[1] > 2:
            y[:, 2] = state.records["fuel_rate"]

    def _roll_with_forces(
        self,
        state: TruckState,
        u: Array,
        grade: Array,
        asked: Array,
        past: Array,
        y: Array,
        raw: Array,
        seen: Array,
    ) -> None:
        for k in range(u.shape[1] - 1):
            if asked.shape[1]:
                state.records["asked_gear"] = asked[:, k]
            self.advance(state, np.ascontiguousarray(u[:, k]), np.ascontiguousarray(grade[:, k]), y[:, k + 1])
            if seen.shape[1]:
                seen[:, k + 1] = raw[:, : len(INSIDE)]
            if past.shape[1]:
                kernel.force(state.records, self.record, np.ascontiguousarray(past[:, k + 1]))


def _refuse(row: int, what: str = "a command or grade") -> None:
    if row >= 0:
        raise InputError(f"{what} is not a finite number in row {row} of the batch")


def load(name: str, overrides: str | None = None, *, dt: float = 0.1) -> PhysicsTruck:
    """A reference truck, with parameters replaced from a YAML file if one is given. Raises InputError."""
    calls.path(name, "a truck")
    specification = from_pool(name)
    if overrides is not None:
        specification = override(specification, read_yaml(Path(overrides)), overrides)
    return PhysicsTruck(specification, dt=dt)


def load_text(text: str) -> PhysicsTruck:
    """The truck that `specification.named` finds by a text."""
    return PhysicsTruck(named(text))


def load_directory(path: Path, manifest: Mapping[str, Any]) -> PhysicsTruck:
    """The truck in a simulator directory of kind 'physics'."""
    source = str(path / MANIFEST)
    if not isinstance(manifest.get("truck"), Mapping):
        raise InputError(f"{source} has no truck; save the simulator again")
    dt = reading.number(manifest.get("dt", 0.1), "dt", source, *DT)
    return PhysicsTruck(specification_from_dict(manifest["truck"], source), dt=dt)
