"""A truck as data: scalars, gear ratios, full-load curve and interface; the pool and overrides as YAML."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deeptruck_core import reading
from deeptruck_core.errors import InputError
from deeptruck_core.reading import near
from deeptruck_core.signals import TruckInterface
from deeptruck_model.trucks.coast_down import KEY, REPLACES, CoastDown
from deeptruck_model.trucks.parameters import GEARS, PARAMETERS, PARTS, PEDAL, RECORD, TABLE, check_values

OVERRIDES = "give a YAML file of parameters such as 'mass: 25000'"
STRUCTURE = ("name", "interface", "ratios", "full_load")
PEDAL_CURVE = "pedal"  # may be left out: the engine command is then a torque
RECORDED_GEAR = "?gear=recorded"


@dataclass(frozen=True)
class Specification:
    """All data of a truck. `full_load` is (engine speeds rad/s, flywheel torques N m); `pedal`, if the engine
    command is a pedal, is (pedal %, share of the available torque)."""

    name: str
    interface: TruckInterface
    values: Mapping[str, float]
    ratios: tuple[float, ...]
    full_load: tuple[tuple[float, ...], tuple[float, ...]]
    pedal: tuple[tuple[float, ...], tuple[float, ...]] | None = None

    def __post_init__(self) -> None:
        missing = [name for name in PARAMETERS if name not in self.values]
        if missing:
            raise InputError(f"truck '{self.name}' lacks {', '.join(missing)}")
        _check_structure(self)

    def record(self) -> NDArray[Any]:
        """The parameters as the compiled parts read them, (1,) of RECORD."""
        record = np.zeros(1, RECORD)
        for name, value in self.values.items():
            record[name] = value
        percent = self.interface.engine_unit == "percent"
        record["command_scale"] = self.values["reference_torque"] / 100.0 if percent else 1.0
        by_deceleration = self.interface.brake_unit == "m/s^2"
        record["by_deceleration"] = by_deceleration
        record["brake_scale"] = 1.0 if by_deceleration else 0.01
        if self.pedal is not None:
            record["by_pedal"] = 1.0
            record["pedal"] = np.interp(np.linspace(0.0, 100.0, PEDAL), *self.pedal)
        record["gears"] = len(self.ratios)
        record["ratios"][0, : len(self.ratios)] = self.ratios
        speeds = np.linspace(0.0, self.values["high_idle_speed"], TABLE)
        record["table_step"] = speeds[1]
        record["full_load"] = np.interp(speeds, *self.full_load)
        return record

    def with_values(self, values: Mapping[str, Any]) -> Specification:
        """The same truck with some scalars replaced. Raises InputError for a wrong name or value."""
        return replace(self, values={**self.values, **check_values(values)})

    def to_dict(self) -> dict[str, Any]:
        """Plain data for YAML and JSON; specification_from_dict is its inverse."""
        plain: dict[str, Any] = {"name": self.name, "interface": self.interface.to_dict()}
        for part in PARTS:
            plain[part] = {n: self.values[n] for n, p in PARAMETERS.items() if p.part == part}
        plain["transmission"]["ratios"] = list(self.ratios)
        speeds, torques = self.full_load
        plain["engine"]["full_load"] = {"speed": list(speeds), "torque": list(torques)}
        if self.pedal is not None:
            plain["engine"][PEDAL_CURVE] = {"command": list(self.pedal[0]), "share": list(self.pedal[1])}
        return plain


def _check_structure(truck: Specification) -> None:
    speeds, torques = truck.full_load
    if not 1 <= len(truck.ratios) <= GEARS or any(
        b >= a for a, b in zip(truck.ratios, truck.ratios[1:], strict=False)
    ):
        raise InputError(f"'ratios' of truck '{truck.name}' must be 1 to {GEARS} falling numbers")
    if len(speeds) != len(torques) or len(speeds) < 2 or np.any(np.diff(speeds) <= 0.0):
        raise InputError(
            f"'full_load' of truck '{truck.name}' needs as many torques as rising speeds (rad/s)"
        )
    if truck.pedal is not None:
        pedal, share = truck.pedal
        if (
            truck.interface.engine_unit != "percent"
            or len(pedal) != len(share)
            or len(pedal) < 2
            or np.any(np.diff(pedal) <= 0.0)
            or np.any(np.diff(share) < 0.0)
            or min(share) < 0.0
            or max(share) > 1.0
        ):
            raise InputError(
                f"'pedal' of truck '{truck.name}' needs an engine command in percent, rising 'command' (%), "
                "and as many 'share' of the torque there is, 0 to 1, that do not fall"
            )
    if truck.interface.engine_unit not in ("N m", "percent") or truck.interface.brake_unit not in (
        "percent",
        "m/s^2",
    ):
        raise InputError(
            "a physics truck takes its engine command in 'N m' or 'percent' and its brake command in"
            f" 'percent' or 'm/s^2', not '{truck.interface.engine_unit}' and '{truck.interface.brake_unit}'"
        )
    for low, high in (("governed_speed", "high_idle_speed"), ("engine_brake_speed", "governed_speed")):
        if truck.values[low] >= truck.values[high]:
            raise InputError(f"'{low}' must be below '{high}' in truck '{truck.name}'")


def flatten(data: Mapping[str, Any], source: str) -> dict[str, Any]:
    """Parameters and structure by their own names, nested under their part or not.

    Raises InputError for an unknown key, with the name that was probably meant.
    """
    flat: dict[str, Any] = {}
    for key, value in data.items():
        if key in PARTS and isinstance(value, Mapping):
            flat.update(flatten(value, source))
        elif key in PARAMETERS or key in STRUCTURE or key == PEDAL_CURVE:
            flat[key] = value
        else:
            hint = near(str(key), [*PARAMETERS, *PARTS, *STRUCTURE, PEDAL_CURVE])
            raise InputError(f"{source}: a physics truck has no '{key}'; {hint}")
    return flat


def _numbers(value: Any, name: str, source: str) -> tuple[float, ...]:
    try:
        numbers = tuple(float(v) for v in value)
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"{source}: '{name}' must be a list of numbers, not {value!r}") from None
    if not np.all(np.isfinite(numbers)):
        raise InputError(f"{source}: '{name}' holds a value that is not a number")
    return numbers


def _structure(flat: Mapping[str, Any], source: str) -> dict[str, Any]:
    made: dict[str, Any] = {}
    if "name" in flat:
        made["name"] = str(flat["name"])
    if "interface" in flat:
        made["interface"] = flat["interface"]
    if "ratios" in flat:
        made["ratios"] = _numbers(flat["ratios"], "ratios", source)
    if "full_load" in flat:
        curve = flat["full_load"]
        if not isinstance(curve, Mapping) or set(curve) != {"speed", "torque"}:
            raise InputError(f"{source}: 'full_load' needs the lists 'speed' (rad/s) and 'torque' (N m)")
        made["full_load"] = tuple(_numbers(curve[k], f"full_load: {k}", source) for k in ("speed", "torque"))
    if flat.get(PEDAL_CURVE) is not None:
        curve = flat[PEDAL_CURVE]
        if not isinstance(curve, Mapping) or set(curve) != {"command", "share"}:
            raise InputError(f"{source}: 'pedal' needs the lists 'command' (%) and 'share' (0 to 1)")
        made["pedal"] = tuple(_numbers(curve[k], f"pedal: {k}", source) for k in ("command", "share"))
    return made


def override(truck: Specification, data: Mapping[str, Any], source: str) -> Specification:
    """The truck with the given scalars, curves or interface entries replaced. Errors name the source."""
    with reading.of(source):
        return _overridden(truck, data, source)


def _overridden(truck: Specification, data: Mapping[str, Any], source: str) -> Specification:
    flat = flatten({key: value for key, value in data.items() if key != KEY}, source)
    changes = _structure(flat, source)
    if "interface" in changes:
        if not isinstance(changes["interface"], Mapping):
            raise InputError(f"{source}: 'interface' must be a table such as {{grade: true}}")
        changes["interface"] = TruckInterface.from_dict({**truck.interface.to_dict(), **changes["interface"]})
    values = {**truck.values, **check_values({k: v for k, v in flat.items() if k in PARAMETERS})}
    if KEY in data:
        if twice := [name for name in REPLACES if name in flat]:
            raise InputError(f"{source}: '{KEY}' says what '{twice[0]}' says; leave one of them out")
        values |= check_values(CoastDown.read(data[KEY], source).parameters(values))
    return replace(truck, **changes, values=values)


def specification_from_dict(data: Mapping[str, Any], source: str) -> Specification:
    """Inverse of Specification.to_dict. Raises InputError for unknown, missing or impossible entries."""
    with reading.of(source):
        return _specified(data, source)


def _specified(data: Mapping[str, Any], source: str) -> Specification:
    flat = flatten(data, source)
    missing = [key for key in STRUCTURE if key not in flat]
    if missing:
        raise InputError(f"{source}: lacks {', '.join(missing)}")
    made = _structure(flat, source)
    if not isinstance(flat["interface"], Mapping):
        raise InputError(f"{source}: 'interface' must be a table such as {{grade: true}}")
    interface = TruckInterface.from_dict({"name": made["name"], **flat["interface"]})
    values = check_values({k: v for k, v in flat.items() if k in PARAMETERS})
    return Specification(
        made["name"], interface, values, made["ratios"], made["full_load"], made.get("pedal")
    )


def read_yaml(path: Path) -> Mapping[str, Any]:
    """A YAML table; empty for an empty file. Raises InputError if it is missing, damaged or no table."""
    if not reading.text(path, OVERRIDES).strip():
        return {}
    return reading.yaml_mapping(path, OVERRIDES)


def pool() -> tuple[str, ...]:
    """Names of the reference trucks."""
    folder = resources.files("deeptruck_model.trucks") / "pool"
    return tuple(
        sorted(entry.name.removesuffix(".yaml") for entry in folder.iterdir() if entry.name.endswith(".yaml"))
    )


def from_pool(name: str) -> Specification:
    """A reference truck by name. Raises InputError for a name that is not in the pool."""
    if name not in pool():
        raise InputError(f"there is no truck '{name}'; {near(name, list(pool()))}")
    return specification_from_dict(reading.package_yaml(__package__, f"pool/{name}.yaml"), f"truck '{name}'")


def named(text: str) -> Specification:
    """The truck named by `truck:TEXT`: NAME, NAME:overrides.yaml or the truck file FILE.yaml, each followed
    by RECORDED_GEAR if the truck is to follow the recorded gear. Raises InputError for another text."""
    name, mark, option = text.partition("?")
    if mark and mark + option != RECORDED_GEAR:
        raise InputError(f"'{mark}{option}' is no option of a truck; the one there is: {RECORDED_GEAR}")
    if name.endswith((".yaml", ".yml")) and ":" not in name:
        truck = from_file(Path(name))
    else:
        name, _, overrides = name.partition(":")
        truck = from_pool(name)
        truck = override(truck, read_yaml(Path(overrides)), overrides) if overrides else truck
    return replace(truck, interface=replace(truck.interface, gear=True)) if mark else truck


def from_file(path: Path) -> Specification:
    """A truck from a truck file, as 'deeptruck-model new' writes it. Raises InputError for any other file."""
    return specification_from_dict(reading.yaml_mapping(path, "'deeptruck-model new' makes one"), str(path))
