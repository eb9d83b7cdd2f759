"""Maps the variables of an FMU to our signals: by equal names, or by a mapping file."""

from __future__ import annotations

import difflib
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deeptruck_core.errors import InputError
from deeptruck_core.signals import BRAKE_UNITS, CHANNELS, ENGINE_UNITS, TruckInterface
from deeptruck_model.fmu.description import Description, Variable
from deeptruck_model.recordings.units import Conversion, conversion
from deeptruck_model.trucks.parameters import PARAMETERS
from deeptruck_model.trucks.state import INSIDE

Array = NDArray[np.float64]

COMMANDS = ("engine_command", "brake_command")
INPUTS = (*COMMANDS, "grade")
OUTPUTS = tuple(dict.fromkeys(("speed", "fuel_rate", *INSIDE)))
START = ("speed", "acceleration")
MEASURED = ("speed", "acceleration", "active")
SECTIONS = ("inputs", "outputs", "parameters", "start", "measured", "set")
FIELDS = (*SECTIONS, "name", "dt", "step", "restart_beyond")
OF_LINK = ("variable", "unit", "factor", "low", "high")
OWN_NAMES = {  # where the FMU's name is not just ours
    "start": {name: f"initial_{name}" for name in START},
    "measured": {"speed": "measured_speed", "acceleration": "measured_acceleration", "active": "measured"},
}
DT, LONGEST = 0.1, 60.0  # s
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
    _known(mapping, FIELDS, "the mapping")
    found = {section: _links(d, section, _section(mapping, section)) for section in SECTIONS[:-1]}
    _check_needed(d, found)
    inputs = tuple(found["inputs"][name] for name in INPUTS if name in found["inputs"])
    interface = _interface(str(mapping.get("name", d.name)), found)
    outputs = [found["outputs"].pop("speed"), *found["outputs"].values()]
    dt = _positive(mapping.get("dt", max(DT, d.step or 0.0)), "dt")
    step = _positive(mapping.get("step", min(d.step or dt, dt)), "step")
    if abs(dt / step - round(dt / step)) > 1e-6 or step > dt * (1 + 1e-9):
        raise InputError(f"dt of {dt:g} s is no whole number of the FMU's steps of {step:g} s; change dt")
    beyond = _number(mapping.get("restart_beyond", 0.0), "restart_beyond", 0.0)
    settings = [
        (_variable(d, str(n), "set"), _number(x, f"set: {n}")) for n, x in _section(mapping, "set").items()
    ]
    measured = found["measured"] if {"speed", "active"} <= found["measured"].keys() else {}
    return VariableMap(
        interface, dt, step, inputs, tuple(outputs), found["parameters"], found["start"], measured,
        tuple(settings), beyond,
    )  # fmt: skip


def _section(mapping: Mapping[Any, Any], section: str) -> Mapping[Any, Any]:
    given = mapping.get(section) or {}
    if not isinstance(given, Mapping):
        raise InputError(f"{section} of the mapping holds no 'name: variable' lines; write them")
    return given


def _known(given: Mapping[Any, Any], known: Sequence[str], where: str) -> None:
    for name in given:
        if name not in known:
            near = difflib.get_close_matches(str(name), known, n=1)
            hint = f"did you mean {near[0]}?" if near else f"known: {', '.join(known)}"
            raise InputError(f"{where} has an unknown field '{name}'; {hint}")


def _links(d: Description, section: str, given: Mapping[Any, Any]) -> dict[str, Link]:
    """The links of one section: lines of the mapping first, then variables of equal name."""
    names = {
        "inputs": INPUTS, "outputs": OUTPUTS, "parameters": tuple(PARAMETERS), "start": START,
        "measured": MEASURED,
    }[section]  # fmt: skip
    _known(given, names, f"{section} of the mapping")
    found = {}
    for name in names:
        if name in given:
            if given[name] is not None:
                found[name] = _mapped_link(d, section, name, given[name])
        elif (own := d.variables.get(OWN_NAMES.get(section, {}).get(name, name))) and _fits(own, section):
            found[name] = _link(section, name, own, None, None)
    return found


def _fits(own: Variable, section: str) -> bool:
    """Whether a variable of our name also has the right kind, because a name alone may mean anything."""
    kinds = {"inputs": "input", "measured": "input", "outputs": "output", "parameters": "parameter"}
    return own.causality == kinds.get(section, own.causality)


def _mapped_link(d: Description, section: str, name: str, line: Any) -> Link:
    mapping = {"variable": line} if isinstance(line, str) else line
    where = f"{section}: {name}"
    if not isinstance(mapping, Mapping) or not isinstance(mapping.get("variable"), str):
        raise InputError(f"{where} of the mapping names no variable of the FMU; write '{name}: VARIABLE'")
    _known(mapping, OF_LINK, where)
    variable = _variable(d, mapping["variable"], where)
    _check_kind(section, where, variable)
    factor = _number(mapping["factor"], f"factor of {where}") if "factor" in mapping else None
    link = _link(section, name, variable, mapping.get("unit"), factor)
    low, high = (_number(mapping[k], f"{k} of {where}") if k in mapping else None for k in ("low", "high"))
    return replace(link, low=link.low if low is None else low, high=link.high if high is None else high)


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
    if factor == 0.0:
        raise InputError(f"factor of {section}: {name} is 0; give what the FMU has for one of ours")
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


def _number(value: Any, what: str, low: float = -math.inf) -> float:
    if isinstance(value, bool) and what.startswith("set"):
        return float(value)
    if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value < math.inf:
        raise InputError(f"{what} of the mapping is {str(value)[:40]}; give a number")
    return float(value)


def _positive(value: Any, what: str) -> float:
    number = _number(value, what)
    if not 0.0 < number <= LONGEST:
        raise InputError(f"{what} of the mapping is {number:g} s; give s, above 0 and at most {LONGEST:g}")
    return number
