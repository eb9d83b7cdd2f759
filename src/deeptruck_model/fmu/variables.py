"""Maps the variables of an FMU to our signals: by equal names, or by a mapping file."""

from __future__ import annotations

import difflib
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from deeptruck_core.arrays import Array
from deeptruck_core.errors import InputError
from deeptruck_core.schema import NAME, TEXT, check, keys, mapping, number
from deeptruck_core.signals import BRAKE_UNITS, CHANNELS, ENGINE_UNITS, TruckInterface
from deeptruck_model.fmu.description import Description, Variable
from deeptruck_model.recordings.units import Conversion, conversion
from deeptruck_model.trucks.parameters import PARAMETERS
from deeptruck_model.trucks.state import INSIDE

COMMANDS = ("engine_command", "brake_command")
INPUTS = (*COMMANDS, "grade")
OUTPUTS = tuple(dict.fromkeys(("speed", "fuel_rate", *INSIDE)))
START = ("speed", "acceleration")
MEASURED = ("speed", "acceleration", "active")
SECTIONS = {
    "inputs": INPUTS,
    "outputs": OUTPUTS,
    "parameters": tuple(PARAMETERS),
    "start": START,
    "measured": MEASURED,
}
OWN_NAMES = {  # where the FMU's name is not just ours
    "start": {name: f"initial_{name}" for name in START},
    "measured": {"speed": "measured_speed", "acceleration": "measured_acceleration", "active": "measured"},
}
KINDS = {"inputs": "input", "measured": "input", "outputs": "output", "parameters": "parameter"}
DT = 0.1  # s
_NUMBER = number(-1e300, 1e300)
_STEP = {"type": "number", "exclusiveMinimum": 0, "maximum": 60, "errorMessage": "give s"}
_FACTOR = {**_NUMBER, "not": {"const": 0}, "errorMessage": "give what the FMU has for one of ours"}
_LINK = {
    "anyOf": [
        keys({"variable": TEXT}, {"unit": NAME, "factor": _FACTOR, "low": _NUMBER, "high": _NUMBER}),
        {"type": ["string", "null"]},  # null: not this one, whatever the FMU's names are
    ]
}
MAPPING = keys(
    {},
    {
        **{
            section: {**keys({}, dict.fromkeys(names, _LINK)), "type": ["object", "null"]}
            for section, names in SECTIONS.items()
        },
        "set": {**mapping({"type": ["number", "boolean"]}), "type": ["object", "null"]},
        "name": NAME,
        "dt": _STEP,
        "step": _STEP,
        "restart_beyond": number(0, 1e300),
    },
)
SHOWN = 6  # names of inputs, and of outputs, in one line


@dataclass(frozen=True)
class Link:
    """A signal and the variable that carries it. `low` to `high` is the permitted range, in our unit."""

    name: str
    variable: Variable
    conversion: Conversion  # from the FMU's number to ours
    low: float = -math.inf
    high: float = math.inf

    def ours(self, x: Array) -> Array:
        """Convert values in the FMU's unit to the canonical unit."""
        return self.conversion(x)

    def theirs(self, x: Array) -> Array:
        """Convert values from the canonical unit to the FMU's."""
        c = self.conversion
        return np.arctan(x) / c.factor if c.angle else (x - c.offset) / c.factor


@dataclass(frozen=True)
class VariableMap:
    """All mapped variables of an FMU; links by our name."""

    interface: TruckInterface
    dt: float  # s, of our steps
    step: float  # s, of the FMU's; a whole number of them makes dt
    inputs: tuple[Link, ...]  # as the columns of u and w
    outputs: tuple[Link, ...]  # speed first
    parameters: Mapping[str, Link]
    start: Mapping[str, Link]
    measured: Mapping[str, Link]  # empty: no response can be given to it while it runs
    settings: tuple[tuple[Variable, float], ...]
    restart_beyond: float  # m/s


def variable_map(d: Description, mapping: Mapping[Any, Any]) -> VariableMap:
    """The map of an FMU, from the mapping file `mapping`, then from equal names.

    Raises InputError for an unknown field or variable, and for a missing required signal.
    """
    check(mapping, MAPPING, "the mapping")
    found = {section: _links(d, section, mapping.get(section) or {}) for section in SECTIONS}
    _check_needed(d, found)
    inputs = tuple(found["inputs"][name] for name in INPUTS if name in found["inputs"])
    interface = _interface(str(mapping.get("name", d.name)), found)
    outputs = [found["outputs"].pop("speed"), *found["outputs"].values()]
    dt = float(mapping.get("dt", max(DT, d.step or 0.0)))
    step = float(mapping.get("step", min(d.step or dt, dt)))
    if abs(dt / step - round(dt / step)) > 1e-6 or step > dt * (1 + 1e-9):
        raise InputError(f"dt of {dt:g} s is no whole number of the FMU's steps of {step:g} s; change dt")
    beyond = float(mapping.get("restart_beyond", 0.0))
    settings = [(_variable(d, str(n), "set"), float(x)) for n, x in (mapping.get("set") or {}).items()]
    measured = found["measured"] if {"speed", "active"} <= found["measured"].keys() else {}
    return VariableMap(
        interface, dt, step, inputs, tuple(outputs), found["parameters"], found["start"], measured,
        tuple(settings), beyond,
    )  # fmt: skip


def _links(d: Description, section: str, given: Mapping[Any, Any]) -> dict[str, Link]:
    """The links of one section: lines of the mapping first, then variables of equal name."""
    found = {}
    for name in SECTIONS[section]:
        if name in given:
            if given[name] is not None:
                found[name] = _mapped_link(d, section, name, given[name])
        elif (
            (own := d.variables.get(OWN_NAMES.get(section, {}).get(name, name)))
            and own.causality == KINDS.get(section, own.causality)  # a name alone may mean anything
        ):
            found[name] = _link(section, name, own, None, None)
    return found


def _mapped_link(d: Description, section: str, name: str, line: Any) -> Link:
    mapping: Mapping[str, Any] = {"variable": line} if isinstance(line, str) else line
    variable = _variable(d, mapping["variable"], f"{section}: {name}")
    _check_kind(section, f"{section}: {name}", variable)
    link = _link(section, name, variable, mapping.get("unit"), mapping.get("factor"))
    return replace(link, low=mapping.get("low", link.low), high=mapping.get("high", link.high))


def _check_kind(section: str, where: str, variable: Variable) -> None:
    """Check that an input can be set at every step, that a start value can be set, and that each is one
    number."""
    said = f"{where} is {variable.name}, which is"
    given = section in ("inputs", "measured")
    if given and variable.causality not in ("input", "parameter"):
        raise InputError(f"{said} a {variable.causality} and no input of the FMU")
    if given and variable.held:
        raise InputError(f"{said} a {variable.causality} that holds while it runs; name an input")
    if section == "start" and variable.calculated:
        raise InputError(f"{said} calculated; name the variable from whose start value it follows")
    if variable.array:
        raise InputError(f"{said} an array; only single numbers are taken: export its elements by themselves")


def _variable(d: Description, name: str, where: str) -> Variable:
    if name not in d.variables:
        near = difflib.get_close_matches(name, list(d.variables), n=3)
        hint = f"did you mean {' or '.join(near)}?" if near else _holds(d)
        raise InputError(f"{where} of the mapping: the FMU has no variable '{name}'; {hint}")
    return d.variables[name]


def _link(section: str, name: str, variable: Variable, unit: Any, factor: float | None) -> Link:
    c = _conversion(section, name, variable, unit)
    if factor is not None:
        c = replace(c, factor=c.factor / factor)
    link = Link(name, variable, c)
    if section != "parameters" or (variable.low is None and variable.high is None):
        return link
    low, high = (
        math.nan if x is None else float(link.ours(np.array(x))) for x in (variable.low, variable.high)
    )
    bounds = sorted((-math.inf if math.isnan(low) else low, math.inf if math.isnan(high) else high))
    return replace(link, low=bounds[0], high=bounds[1])


def _conversion(section: str, name: str, variable: Variable, unit: Any) -> Conversion:
    """From the FMU's unit to ours; a unit in the mapping overrides the FMU's."""
    said = variable.unit if unit is None else str(unit)
    plain = None if said is None else _spelled(said)
    where = f"{section}: {name} ({variable.name})"
    if section == "parameters" or name not in CHANNELS:
        ours = PARAMETERS[name].unit if name in PARAMETERS else ("N" if name.endswith("_force") else "1")
        if plain is not None and ours != "1" and _spelled(ours) != plain:
            raise InputError(f"{where} is in {said}, ours is in {ours}; give 'unit: {ours}' and a factor")
        return Conversion(ours, 1.0)
    if section == "measured" and name == "active":
        return Conversion("1", 1.0)
    if plain is None and name in COMMANDS:
        known = ENGINE_UNITS if name == COMMANDS[0] else BRAKE_UNITS
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


def _check_needed(d: Description, found: Mapping[str, Mapping[str, Link]]) -> None:
    lacking = [
        f"{section}: {name}"
        for section, name in (("inputs", "engine_command"), ("outputs", "speed"), ("start", "speed"))
        if name not in found[section]
    ]
    if lacking:
        raise InputError(f"it has no variable that is known as {', '.join(lacking)}; {_holds(d)}; {_cure(d)}")


def _cure(d: Description) -> str:
    if any(v.causality == "input" for v in d.variables.values()):
        return "name them in a mapping, fmu:MODEL.fmu:MAPPING.yaml (docs/simulators.md)"
    return "no command can reach it: export it with the engine's command as an input"


def _holds(d: Description) -> str:
    """Inputs and outputs of the FMU as text, so that a user can write a mapping without another tool."""
    said = []
    for kind in ("input", "output"):
        names = [v.name for v in d.variables.values() if v.causality == kind]
        more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
        said.append(f"its {kind}s are {', '.join(names[:SHOWN])}{more}" if names else f"it has no {kind}s")
    return ", ".join(said)


def _interface(name: str, found: Mapping[str, Mapping[str, Link]]) -> TruckInterface:
    inputs = found["inputs"]
    brake = inputs.get("brake_command")
    return TruckInterface(
        name,
        engine_unit=inputs["engine_command"].conversion.unit,
        brake_unit=None if brake is None else brake.conversion.unit,
        grade="grade" in inputs,
        fuel="fuel_rate" in found["outputs"],
    )
