"""The script of an exported FMU; the export copies it there, together with the simulator's directory.

PythonFMU3 creates an object of the class in this file for each instance of the FMU, and again at a reset. The
Python that runs the FMU must have deeptruck installed; the FMU contains no other file of this package.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
from pythonfmu3 import Boolean, DefaultExperiment, Float64, Fmi3Causality, Fmi3Slave, Fmi3Variability, Unit

from deeptruck_core.signals import ACCELERATION, CHANNELS, SPEED
from deeptruck_model import simulators

FOLDER = "simulator"  # in the FMU's resources
NEAR = 1e-9  # s, in which two times are one
RESPONSE = {"speed": "m/s", "acceleration": "m/s^2"}
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
    "m": {"m": 1},
    "s": {"s": 1},
}


@cache
def loaded(resources: str) -> simulators.Simulator:
    """The simulator in an FMU, read once for all its instances."""
    return simulators.load(Path(resources) / FOLDER)


class Truck(Fmi3Slave):
    """One truck. While `measured` is set, the measured response replaces the simulated one at every step."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self.truck = loaded(str(Path(self.resources)))
        i = self.truck.interface
        self.modelName = "".join(c if c.isalnum() else "_" for c in f"deeptruck_{i.name}")
        self.description = f"The truck {i.name}, longitudinal, stepped by {self.truck.dt:g} s"
        self.default_experiment = DefaultExperiment(0.0, 10.0, self.truck.dt)
        self.clock, self.measured = 0.0, False
        self.y: np.ndarray[Any, Any] = np.zeros((1, len(i.y)))
        self.state = self.truck.reset(self.y)
        self.values: dict[str, float] = {}  # of inputs and parameters
        self._variable("time", "s", Fmi3Causality.independent, lambda: self.clock)
        for name in (*i.u, *i.w):
            self._given(name, "1" if name == "grade" else i.unit(name), Fmi3Causality.input)
        self.register_variable(
            Boolean("measured", causality=Fmi3Causality.input, variability=Fmi3Variability.discrete)
        )
        for name, its in RESPONSE.items():
            self._given(f"measured_{name}", its, Fmi3Causality.input)
            self._given(f"initial_{name}", its, Fmi3Causality.parameter)
        for name, value in self.truck.parameters().items():
            self._given(name, None, Fmi3Causality.parameter, value)
        for column, name in enumerate(i.y):
            self._variable(name, CHANNELS[name].unit, Fmi3Causality.output, partial(self._response, column))
        for name in self.truck.inside(self.state):
            if name not in {*i.y, *self.values}:
                unit = "N" if name.endswith("_force") else CHANNELS[name].unit if name in CHANNELS else None
                self._variable(name, unit, Fmi3Causality.output, partial(self._inside, name))

    def _given(self, name: str, unit: str | None, causality: Fmi3Causality, value: float = 0.0) -> None:
        """Declare an input or a parameter."""
        self.values[name] = value
        self._variable(
            name, unit, causality, lambda: self.values[name], lambda given: self.values.update({name: given})
        )

    def _variable(
        self,
        name: str,
        unit: str | None,
        causality: Fmi3Causality,
        getter: Callable[[], float],
        setter: Callable[[float], None] | None = None,
    ) -> None:
        fixed = causality is Fmi3Causality.parameter
        if unit in UNITS:
            self.register_units([Unit(unit, **UNITS[unit])])
        variable = Float64(
            name,
            unit=unit if unit in UNITS else None,
            causality=causality,
            variability=Fmi3Variability.fixed if fixed else Fmi3Variability.continuous,
            getter=getter,
            setter=setter,
        )
        self.register_variable(variable, nested=False)

    def _response(self, column: int) -> float:
        return float(self.y[0, column])

    def _inside(self, name: str) -> float:
        return float(self.truck.inside(self.state)[name][0])

    def setup_experiment(self, start_time: float) -> None:
        """Set the start time."""
        self.clock = start_time

    def exit_initialization_mode(self) -> None:
        """Create the truck with the given parameters, at the given speed."""
        own = self.truck.parameters()
        changed = {name: self.values[name] for name in own if self.values[name] != own[name]}
        self.truck = self.truck.with_parameters(changed)
        self.y = self._full("initial", 0.0)
        self.state = self.truck.reset(self.y)

    def do_step(self, current_time: float, step_size: float) -> bool:
        """As many steps of the truck's dt as end by the given time; commands are held in between."""
        i = self.truck.interface
        while self.clock + self.truck.dt <= current_time + step_size + NEAR:
            if self.measured:
                self.state = self.truck.force(self.state, self._full("measured", np.nan))
            u, w = (np.array([[self.values[name] for name in names]]).reshape(1, -1) for names in (i.u, i.w))
            self.state, self.y = self.truck.step(self.state, u, w)
            self.clock += self.truck.dt
        return True

    def _full(self, which: str, other: float) -> np.ndarray[Any, Any]:
        """The measured or initial response (1, n_y), `other` where it is not given."""
        y = np.full((1, len(self.truck.interface.y)), other)
        y[0, ACCELERATION] = self.values[f"{which}_acceleration"]
        y[0, SPEED] = self.values[f"{which}_speed"]
        return y
