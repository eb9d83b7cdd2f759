"""The script of an exported FMU; the export copies it there, together with the simulator's directory.

PythonFMU3 creates an object of the class in this file for each instance of the FMU, and again at a reset. The
Python that runs the FMU must have deeptruck installed; the FMU contains no other file of this package.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
from pythonfmu3 import Boolean, DefaultExperiment, Float64, Fmi3Causality, Fmi3Slave, Fmi3Variability, Unit

from deeptruck_core.signals import ACCELERATION, CHANNELS, SPEED
from deeptruck_model import simulators

FOLDER = "simulator"  # in the FMU's resources
NEAR = 1e-9  # s, in which two times are one
UNITS: dict[str, dict[str, float]] = {  # as FMI has them: exponents of the SI base units, and a factor
    "m/s": {"m": 1, "s": -1},
    "m/s^2": {"m": 1, "s": -2},
    "1": {},
    "percent": {"factor": 0.01},
    "N m": {"kg": 1, "m": 2, "s": -2},
    "N": {"kg": 1, "m": 1, "s": -2},
    "bar": {"kg": 1, "m": -1, "s": -2, "factor": 1e5},
    "g/s": {"kg": 1, "s": -1, "factor": 1e-3},
    "cm^3/s": {"m": 3, "s": -1, "factor": 1e-6},
    "rad/s": {"rad": 1, "s": -1},
    "kg": {"kg": 1},
    "m^2": {"m": 2},
    "m": {"m": 1},
    "s": {"s": 1},
}
RATIO = "1"  # a grade, as rise over run
FORCES_END = "_force"


@cache
def loaded(resources: str) -> simulators.Simulator:
    """The simulator in an FMU, read once for all its instances."""
    return simulators.load(Path(resources) / FOLDER)


class Truck(Fmi3Slave):
    """One truck. While `measured` is set, the measured response replaces the simulated one at every step."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        original = loaded(str(Path(self.resources)))
        self.truck, self.parameters = original, dict(original.parameters())
        i = original.interface
        self.modelName = "".join(c if c.isalnum() else "_" for c in f"deeptruck_{i.name}")
        self.description = f"The truck {i.name}, longitudinal, stepped by {original.dt:g} s"
        self.default_experiment = DefaultExperiment(0.0, 10.0, original.dt)
        self.start = {"initial_speed": 0.0, "initial_acceleration": 0.0}
        self.given = dict.fromkeys((*i.u, *i.w, "measured_speed", "measured_acceleration"), 0.0)
        self.measured = False
        self.state = original.reset(np.zeros((1, len(i.y))))
        self.y: np.ndarray[Any, Any] = np.zeros((1, len(i.y)))
        self.seen: Mapping[str, Any] | None = None
        self.clock = 0.0
        self._declare()

    def _declare(self) -> None:
        i = self.truck.interface
        self._add(
            "time", "s", Fmi3Causality.independent, Fmi3Variability.continuous, lambda: self.clock, None
        )
        for name in (*i.u, *i.w):
            self._number(name, RATIO if name == "grade" else i.unit(name), self.given, Fmi3Causality.input)
        for name, unit in (("measured_speed", "m/s"), ("measured_acceleration", "m/s^2")):
            self._number(name, unit, self.given, Fmi3Causality.input)
        self.register_variable(
            Boolean("measured", causality=Fmi3Causality.input, variability=Fmi3Variability.discrete)
        )
        for name, unit in (("initial_speed", "m/s"), ("initial_acceleration", "m/s^2")):
            self._number(name, unit, self.start, Fmi3Causality.parameter)
        for name in self.parameters:
            self._number(name, None, self.parameters, Fmi3Causality.parameter)
        for column, name in enumerate(i.y):
            self._output(name, CHANNELS[name].unit, partial(self._response, column))
        for name in self.truck.inside(self.state):
            if name not in {*i.y, *self.parameters}:
                self._output(name, _unit(name), partial(self._seen_now, name))

    def _number(self, name: str, unit: str | None, kept: dict[str, float], causality: Fmi3Causality) -> None:
        fixed = Fmi3Variability.fixed if causality is Fmi3Causality.parameter else Fmi3Variability.continuous

        def take(value: float) -> None:
            kept[name] = value

        self._add(name, unit, causality, fixed, lambda: kept[name], take)

    def _output(self, name: str, unit: str | None, getter: Callable[[], float]) -> None:
        self._add(name, unit, Fmi3Causality.output, Fmi3Variability.continuous, getter, None)

    def _add(
        self,
        name: str,
        unit: str | None,
        causality: Fmi3Causality,
        variability: Fmi3Variability,
        getter: Callable[[], float],
        setter: Callable[[float], None] | None,
    ) -> None:
        if unit in UNITS:
            self.register_units([Unit(unit, **UNITS[unit])])
        self.register_variable(
            Float64(
                name,
                unit=unit if unit in UNITS else None,
                causality=causality,
                variability=variability,
                getter=getter,
                setter=setter,
            ),
            nested=False,
        )

    def _response(self, column: int) -> float:
        return float(self.y[0, column])

    def _seen_now(self, name: str) -> float:
        if self.seen is None:
            self.seen = self.truck.inside(self.state)
        return float(self.seen[name][0])

    def setup_experiment(self, start_time: float) -> None:
        """Set the start time."""
        self.clock = start_time

    def exit_initialization_mode(self) -> None:
        """Create the truck with the given parameters, at the given speed."""
        own = self.truck.parameters()
        changed = {name: value for name, value in self.parameters.items() if value != own[name]}
        self.truck = self.truck.with_parameters(changed)
        y = np.zeros((1, len(self.truck.interface.y)))
        y[0, ACCELERATION], y[0, SPEED] = self.start["initial_acceleration"], self.start["initial_speed"]
        self.state, self.y, self.seen = self.truck.reset(y), y, None

    def do_step(self, current_time: float, step_size: float) -> bool:
        """As many steps of the truck's dt as end by the given time; commands are held in between."""
        while self.clock + self.truck.dt <= current_time + step_size + NEAR:
            self._step()
            self.clock += self.truck.dt
        return True

    def _step(self) -> None:
        i = self.truck.interface
        if self.measured:
            measured = np.full((1, len(i.y)), np.nan)
            measured[0, ACCELERATION] = self.given["measured_acceleration"]
            measured[0, SPEED] = self.given["measured_speed"]
            self.state = self.truck.force(self.state, measured)
        u = np.array([[self.given[name] for name in i.u]])
        w = np.array([[self.given[name] for name in i.w]]).reshape(1, len(i.w))
        self.state, self.y = self.truck.step(self.state, u, w)
        self.seen = None

    def _get_fmu_state(self) -> dict[str, Any]:
        kept = (self.truck, self.state, self.y, self.clock, self.measured)
        return {"kept": (*kept, dict(self.given), dict(self.start), dict(self.parameters))}

    def _set_fmu_state(self, state: dict[str, Any]) -> None:
        self.truck, self.state, self.y, self.clock, self.measured, given, start, own = state["kept"]
        self.seen = None
        for kept, values in ((self.given, given), (self.start, start), (self.parameters, own)):
            kept.update(values)


def _unit(name: str) -> str | None:
    if name.endswith(FORCES_END):
        return "N"
    if name in CHANNELS:
        return CHANNELS[name].unit
    return None
