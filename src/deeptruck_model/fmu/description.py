"""The description of a .fmu file, read before any of its code runs, and reasons why it cannot be used."""

from __future__ import annotations

import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from deeptruck_core import reading
from deeptruck_core.errors import InputError

MISSING = "FMUs need FMPy; install it with \"pip install 'deeptruck[fmu]'\""
DESCRIPTION = "modelDescription.xml"
EXPORT_AGAIN = "export it again as FMI 2 or 3 for co-simulation"


@dataclass(frozen=True)
class Variable:
    """A variable of the FMU; `unit`, `start`, `low` and `high` are None if not stated.

    `held`: constant while the FMU runs. `calculated`: its start value follows from other variables.
    """

    name: str
    reference: int
    type: str  # Real, Float64, Boolean ...
    causality: str
    unit: str | None
    start: float | None
    low: float | None
    high: float | None
    held: bool = False
    calculated: bool = False
    array: bool = False


@dataclass(frozen=True)
class Description:
    """The description in the FMU. `step` is its only permitted communication step (s), None for any."""

    file: Path
    name: str
    version: int  # 2 or 3, of FMI
    identifier: str
    token: str
    keeps_state: bool
    only_once: bool
    step: float | None
    variables: Mapping[str, Variable]


def described(file: Path) -> Description:
    """The description of an FMU. Raises InputError for any other file, or an FMU that cannot run here."""
    reading.check_file(file, "give the path of an FMU")
    if not zipfile.is_zipfile(file):
        raise InputError(f"it is no zip archive, so no FMU; {EXPORT_AGAIN}")
    try:
        from fmpy import platform, platform_tuple, read_model_description, sharedLibraryExtension
    except ImportError:
        raise InputError(MISSING) from None
    try:
        with zipfile.ZipFile(file) as archive:
            entries = set(archive.namelist())
        if DESCRIPTION not in entries:
            raise InputError(f"it holds no {DESCRIPTION}, so it is no FMU; {EXPORT_AGAIN}")
        parsed = read_model_description(str(file), validate=False)
    except InputError:
        raise
    except Exception as error:  # whatever a damaged archive or description makes a library raise
        said = reading.plain(str(error)) or type(error).__name__
        raise InputError(f"it is damaged ({said}); {EXPORT_AGAIN}") from None
    version = int(str(parsed.fmiVersion)[0])
    if version not in (2, 3) or parsed.coSimulation is None:
        kind = f"FMI {parsed.fmiVersion}" + ("" if parsed.coSimulation else ", without co-simulation")
        raise InputError(f"it is {kind}; {EXPORT_AGAIN}")
    folder = f"binaries/{platform if version == 2 else platform_tuple}/"
    if f"{folder}{parsed.coSimulation.modelIdentifier}{sharedLibraryExtension}" not in entries:
        there = sorted({name.split("/")[1] for name in entries if name.startswith("binaries/") and name[9:]})
        held = ", ".join(there) or "no platform"
        raise InputError(f"it runs on {held} and not on {folder[9:-1]}; export it for that platform too")
    return _description(file, version, parsed)


def _description(file: Path, version: int, parsed: Any) -> Description:
    slave = parsed.coSimulation
    fixed = None if slave.canHandleVariableCommunicationStepSize else parsed.defaultExperiment
    step = _number(fixed.stepSize) if fixed is not None else None
    return Description(
        file,
        str(parsed.modelName),
        version,
        str(slave.modelIdentifier),
        str(parsed.guid),
        bool(slave.canGetAndSetFMUstate),
        bool(slave.canBeInstantiatedOnlyOncePerProcess),
        step,
        {v.name: _variable(v) for v in parsed.modelVariables if v.type not in ("String", "Binary", "Clock")},
    )


def _variable(v: Any) -> Variable:
    unit = v.unit if v.unit is not None or v.declaredType is None else v.declaredType.unit
    start, low, high = (_number(x) for x in (v.start, v.min, v.max))
    return Variable(
        v.name,
        int(v.valueReference),
        v.type,
        v.causality or "local",
        unit or None,
        start,
        low,
        high,
        held=v.variability in ("constant", "fixed"),
        calculated=v.initial == "calculated",
        array=bool(v.dimensions),
    )


def _number(value: Any) -> float | None:
    if value is None or isinstance(value, bool):
        return None
    try:
        return float(value)
    except (TypeError, ValueError):
        return None
