"""A truck in C as an FMU of FMI 2 or 3, compiled against FMPy's headers, independent of our code."""

from __future__ import annotations

import re
import shutil
import subprocess
import zipfile
from pathlib import Path

import pytest

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
  mass: m
  drag_area: {variable: cda, factor: 1}
start: {speed: {variable: v_start, unit: m/s}}
"""


def built(folder: Path, fmi: int) -> Path:
    """pointmass.fmu for FMI 2 or 3, with map.yaml beside it; skips the test if there is no compiler."""
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        pytest.skip("no C compiler here")
    import fmpy

    headers = Path(fmpy.__file__).parent / "c-code"
    library, rest = folder / "pointmass.so", folder / "rest.c"
    rest.write_text(_refusing(headers / f"fmi{fmi}Functions.h"))
    options = ["-shared", "-fPIC", "-O2", "-w", f"-DFMI={fmi}", f"-I{headers}"]
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
