"""The mapping of an FMU: which of its variables is which signal, in which unit."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from deeptruck_core.arrays import Array
from deeptruck_core.errors import InputError
from deeptruck_core.reading import near
from deeptruck_core.schema import NAME, TEXT, check, keys, mapping, number
from deeptruck_core.signals import BRAKE_UNITS, CHANNELS, ENGINE_UNITS, TruckInterface
from deeptruck_model.recordings.units import Conversion, conversion
from deeptruck_model.trucks.parameters import PARAMETERS
from deeptruck_model.trucks.state import INSIDE

DT = 0.1  # s
SHOWN = 6  # variables of a kind that are listed
INPUTS = ("engine_command", "brake_command", "grade")
OUTPUTS = ("fuel_rate", *(name for name in INSIDE if name not in ("speed", "fuel_rate")))  # besides the speed
TO_WRITE = (
    "{inputs: {engine_command: {variable: NAME, unit: percent}}, "
    "outputs: {speed: {variable: NAME, unit: m/s}}, start: {speed: {variable: NAME, unit: m/s}}}"
)
_FACTOR = {
    **number(-1e300, 1e300),
    "not": {"const": 0},
    "errorMessage": "give what the FMU has for one of ours",
}
_LINK = {"anyOf": [keys({"variable": TEXT}, {"unit": NAME, "factor": _FACTOR}), TEXT]}
_STEP = {"type": "number", "exclusiveMinimum": 0, "maximum": 60, "errorMessage": "give s"}


def _links(needed: Iterable[str], optional: Iterable[str] = ()) -> dict[str, Any]:
    return keys(dict.fromkeys(needed, _LINK), dict.fromkeys(optional, _LINK))


MAPPING = keys(
    {
        "inputs": _links(INPUTS[:1], INPUTS[1:]),
        "outputs": _links(["speed"], OUTPUTS),
        "start": _links(["speed"], ["acceleration"]),
    },
    {
        "measured": _links(["speed", "active"], ["acceleration"]),
        "parameters": _links([], PARAMETERS),
        "set": mapping({"type": ["number", "boolean"]}),
        "name": NAME,
        "dt": _STEP,
        "step": _STEP,
    },
)


@dataclass(frozen=True)
class Link:
    """A signal, and the variable (of FMPy's description) that carries it."""

    name: str
    variable: Any
    conversion: Conversion  # from the FMU's number to ours

    def ours(self, x: Any) -> Array:
        """Numbers of the FMU in our unit."""
        return self.conversion(np.asarray(x, np.float64))

    def theirs(self, x: Any) -> Array:
        """Numbers in our unit as the FMU has them."""
        c = self.conversion
        return np.arctan(x) / c.factor if c.angle else (np.asarray(x, np.float64) - c.offset) / c.factor


@dataclass(frozen=True)
class Names:
    """The links of an FMU by our names. `substeps` of its steps make our step of `dt` s, `settings` are other
    start values, `values` its parameters in SI."""

    interface: TruckInterface
    dt: float
    substeps: int
    inputs: Sequence[Link]  # as the columns of u and w
    outputs: Sequence[Link]  # speed first
    start: Mapping[str, Link]
    measured: Mapping[str, Link]  # empty: it takes no recorded speed while it runs
    parameters: Mapping[str, Link]
    settings: Sequence[tuple[Any, float]]
    values: Mapping[str, float]


def read(described: Any, given: Mapping[Any, Any] | None) -> Names:
    """The links that the mapping `given` has for an FMU that FMPy described.

    Raises InputError without a mapping, with what to write, and for one that does not fit.
    """
    variables = {v.name: v for v in described.modelVariables if v.type not in ("String", "Binary", "Clock")}
    if not given:
        held = "; ".join(_listed(variables, kind) for kind in ("input", "output", "parameter"))
        raise InputError(f"an FMU needs a mapping, fmu:MODEL.fmu:MAPPING.yaml, with {TO_WRITE}; {held}")
    check(given, MAPPING, "the mapping")
    inputs, outputs, start, measured, parameters = (
        {name: _link(variables, part, name, line) for name, line in given.get(part, {}).items()}
        for part in ("inputs", "outputs", "start", "measured", "parameters")
    )
    settings = [(_variable(variables, str(n), "set"), float(x)) for n, x in given.get("set", {}).items()]
    units = {name: link.conversion.unit for name, link in inputs.items()}
    interface = TruckInterface(
        str(given.get("name", described.modelName)),
        engine_unit=units["engine_command"],
        brake_unit=units.get("brake_command"),
        grade="grade" in units,
        fuel="fuel_rate" in outputs,
    )
    dt = float(given.get("dt", DT))
    step = float(given.get("step", dt))
    if step > dt * (1 + 1e-9) or abs(dt / step - round(dt / step)) > 1e-6:
        raise InputError(f"dt of {dt:g} s is no whole number of the FMU's steps of {step:g} s; change dt")
    values, own = {}, {v.name: x for v, x in settings}
    for name, link in parameters.items():
        begins = own.get(link.variable.name, link.variable.start)
        if begins is None:
            raise InputError(f"parameters: {name} ({link.variable.name}) has no start value; leave it out")
        values[name] = float(link.ours(float(begins)))
    return Names(
        interface, dt, round(dt / step), [inputs[name] for name in INPUTS if name in inputs],
        [outputs.pop("speed"), *outputs.values()], start, measured, parameters, settings, values,
    )  # fmt: skip


def _listed(variables: Mapping[str, Any], kind: str) -> str:
    names = [name for name, v in variables.items() if v.causality == kind]
    more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
    return f"its {kind}s are {', '.join(names[:SHOWN]) or 'none'}{more}"


def _variable(variables: Mapping[str, Any], name: str, where: str) -> Any:
    if name not in variables:
        raise InputError(
            f"{where} of the mapping: the FMU has no variable '{name}'; {near(name, list(variables))}"
        )
    return variables[name]


def _link(variables: Mapping[str, Any], part: str, name: str, line: Any) -> Link:
    """A line of the mapping. Raises InputError for a variable that cannot be that signal, or its unit."""
    given: Mapping[str, Any] = {"variable": line} if isinstance(line, str) else line
    where = f"{part}: {name}"
    variable = _variable(variables, given["variable"], where)
    if variable.dimensions:
        raise InputError(f"{where} is {variable.name}, an array; only single numbers are taken")
    runs = variable.causality in ("input", "parameter") and variable.variability not in ("constant", "fixed")
    if part in ("inputs", "measured") and not runs:
        kind = f"{variable.variability} {variable.causality}"
        raise InputError(f"{where} is {variable.name}, a {kind}, which cannot be set while the FMU runs")
    c = _conversion(part, name, variable, given.get("unit"))
    return Link(name, variable, replace(c, factor=c.factor / given.get("factor", 1.0)))


def _conversion(part: str, name: str, variable: Any, unit: Any) -> Conversion:
    """From the FMU's unit to ours; a unit in the mapping overrides the FMU's."""
    where = f"{part}: {name} ({variable.name})"
    declared = variable.unit or (variable.declaredType.unit if variable.declaredType is not None else None)
    said = declared if unit is None else str(unit)
    plain = None if said is None else _spelled(said)
    if name == "active":
        return Conversion("1", 1.0)
    if part == "parameters" or name not in CHANNELS:
        ours = PARAMETERS[name].unit if name in PARAMETERS else "N" if name.endswith("_force") else "1"
        if plain is not None and ours != "1" and _spelled(ours) != plain:
            raise InputError(f"{where} is in {said}, ours is in {ours}; give 'unit: {ours}' and a factor")
        return Conversion(ours, 1.0)
    if plain is None and name in INPUTS[:2]:
        known = ENGINE_UNITS if name == INPUTS[0] else BRAKE_UNITS
        raise InputError(f"{where} has no unit; give the mapping 'unit:' with one of {', '.join(known)}")
    try:
        return conversion(name, plain)
    except InputError as error:
        raise InputError(f"{where}: {error}, by 'unit:' in the mapping") from None


def _spelled(unit: str) -> str:
    """A unit in Modelica's and FMI's spelling (N.m, m2, m.s-2), in our spelling."""
    text = unit.strip().replace("m.s-1", "m/s").replace("m.s-2", "m/s^2").replace("s-2", "s^2")
    text = text.replace("m2", "m^2").replace("m3", "m^3").replace(".", " ")
    return "1" if text == "-" else text
