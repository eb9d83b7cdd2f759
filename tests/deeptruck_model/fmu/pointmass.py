"""A truck in C as an FMU of FMI 2 or 3, compiled against FMPy's headers, independent of our code.

`recorded` drives the same physics in numpy, with one brake in six that releases late: the effect that the FMU
lacks.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import zipfile
from pathlib import Path

import numpy as np
import pytest

from deeptruck_core.signals import TruckInterface
from deeptruck_model.recordings import Recording
from deeptruck_model.trucks import driving_cycles

SOURCE = Path(__file__).with_name("pointmass.c")
VARIABLES = {  # causality, variability, start
    "torque": ("input", "continuous", "0"),
    "pedal": ("input", "continuous", "0"),
    "slope": ("input", "continuous", "0"),
    "v": ("output", "continuous", None),
    "m": ("parameter", "fixed", "20000"),
    "cda": ("parameter", "fixed", "6"),
    "c_r": ("parameter", "fixed", "0.006"),
    "v_start": ("parameter", "fixed", "0"),
    "brake": ("parameter", "fixed", "120000"),
}
MAPPING = """\
name: pointmass
inputs:
  engine_command: {variable: torque, unit: N m}
  brake_command: {variable: pedal, unit: percent}
  grade: {variable: slope, unit: '1'}
outputs: {speed: {variable: v, unit: m/s}}
parameters:
  mass: {variable: m, low: 10000, high: 40000}
  drag_area: {variable: cda, low: 2, high: 12}
  rolling_resistance: {variable: c_r, low: 0.002, high: 0.02}
start: {speed: {variable: v_start, unit: m/s}}
"""
INTERFACE = TruckInterface("pointmass", engine_unit="N m", brake_unit="percent", grade=True, fuel=False)
BODY = {"mass": 20000.0, "drag_area": 6.0, "rolling_resistance": 0.006}
MOST_TORQUE, FULL_BRAKE, GEAR = 1500.0, 120000.0, 20.0  # N m, N, N at the road for 1 N m
STICKING_SHARE, LETS_GO_S = 1 / 6, 20.0


def built(folder: Path, fmi: int, *, silent: bool = False) -> Path:
    """pointmass.fmu for FMI 2 or 3; skips the test if there is no compiler. `silent`: the speed is an output
    from the first step on only."""
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        pytest.skip("no C compiler here")
    import fmpy

    headers = Path(fmpy.__file__).parent / "c-code"
    library, rest = folder / "pointmass.so", folder / "rest.c"
    rest.write_text(_refusing(headers / f"fmi{fmi}Functions.h"))
    options = ["-shared", "-fPIC", "-O2", "-w", f"-DFMI={fmi}", f"-DSILENT={silent:d}", f"-I{headers}"]
    subprocess.run([compiler, *options, str(SOURCE), str(rest), "-o", str(library)], check=True)
    platform = fmpy.platform if fmi == 2 else fmpy.platform_tuple
    file = folder / "pointmass.fmu"
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("modelDescription.xml", _description(fmi))
        archive.write(library, f"binaries/{platform}/pointmass{fmpy.sharedLibraryExtension}")
    (folder / "map.yaml").write_text(MAPPING)
    return file


def _refusing(header: Path) -> str:
    """C functions of the standard that the truck does not support; they return an error."""
    names = re.findall(r"Export\s+\w+TYPE\s+(fmi\d\w+);", header.read_text())
    own = SOURCE.read_text()
    return "\n".join(f"int {name}(void) {{ return 3; }}" for name in names if f" {name}(" not in own)


def _description(fmi: int) -> str:
    lines = []
    for i, (name, (causality, variability, start)) in enumerate(VARIABLES.items()):
        said = f'name="{name}" valueReference="{i}" causality="{causality}" variability="{variability}"'
        begins = "" if start is None else f' start="{start}"'
        two = f"<ScalarVariable {said}><Real{begins}/></ScalarVariable>"
        lines.append(two if fmi == 2 else f"<Float64 {said}{begins}/>")
    if fmi == 3:
        lines.append(
            '<Float64 name="time" valueReference="99" causality="independent" variability="continuous"/>'
        )
    token = "guid" if fmi == 2 else "instantiationToken"
    slave = '<CoSimulation modelIdentifier="pointmass" canHandleVariableCommunicationStepSize="true"/>'
    known = '<Unknown index="4"/>'
    outputs = f"<Outputs>{known}</Outputs><InitialUnknowns>{known}</InitialUnknowns>"
    if fmi == 3:
        outputs = '<Output valueReference="3"/><InitialUnknown valueReference="3"/>'
    variables = f"<ModelVariables>{''.join(lines)}</ModelVariables>"
    about = f'fmiVersion="{fmi}.0" modelName="pointmass" {token}="pointmass"'
    return (
        f'<?xml version="1.0" encoding="UTF-8"?><fmiModelDescription {about}>{slave}{variables}'
        f"<ModelStructure>{outputs}</ModelStructure></fmiModelDescription>"
    )


def recorded(name: str, seconds: float, seed: int, sticking: float = STICKING_SHARE) -> Recording:
    """A drive of the point mass with a driver, one brake that releases late, and sensor noise."""
    rng = np.random.default_rng(seed)
    targets = driving_cycles.speed_profile(seconds, seed=rng)
    road = driving_cycles.road_grade(float(targets.sum()) * 0.12 + 2000.0, seed=rng)
    v, held, at, rows = float(targets[0]), 0.0, 0.0, []
    a = 0.0
    for target in targets:
        grade = float(road[int(at / 10.0)])
        wanted = BODY["mass"] * (0.8 * (target - v) + 9.81 * (0.006 + grade)) + 3.6 * v * v
        torque = float(np.clip(wanted / GEAR, 0.0, MOST_TORQUE))
        pedal = float(np.clip(-100.0 * wanted / FULL_BRAKE, 0.0, 100.0))
        rows.append((torque, pedal, grade, a, v))
        before = v
        for _ in range(10):
            pressed = sticking * FULL_BRAKE * pedal / 100.0
            held = max(pressed, held * (1.0 - 0.01 / LETS_GO_S))
            force = GEAR * torque - FULL_BRAKE * pedal / 100.0 - (held - pressed) * (v > 0.5)
            force -= 3.6 * v * v + 9.81 * BODY["mass"] * (BODY["rolling_resistance"] + grade)
            v = max(v + 0.01 * force / BODY["mass"], 0.0)
        a, at = (v - before) / 0.1, at + 0.1 * v
    columns = dict(
        zip(
            ("engine_command", "brake_command", "grade", "acceleration", "speed"),
            np.array(rows).T,
            strict=True,
        )
    )
    for channel, sd in (("speed", 0.03), ("acceleration", 0.05), ("grade", 0.001)):
        columns[channel] = columns[channel] + rng.normal(0.0, sd, len(targets))
    return Recording(name=name, dt=0.1, channels=columns, interface=INTERFACE, notes=())
