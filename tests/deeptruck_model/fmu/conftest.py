"""An FMU of our own physics truck, and its mapping."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from deeptruck_model.fmu import export

sys.path.append(str(Path(__file__).parent))  # pointmass.py stands beside the tests
MAPPING = """
name: trucksim
inputs: {engine_command: engine_command, brake_command: brake_command, grade: grade}
outputs:
  {speed: speed, fuel_rate: fuel_rate, gear: gear, engine_speed: engine_speed, traction_force: traction_force,
   brake_force: brake_force, drag_force: drag_force, rolling_force: rolling_force}
start: {speed: initial_speed, acceleration: initial_acceleration}
measured: {speed: measured_speed, acceleration: measured_acceleration, active: measured}
parameters: {mass: mass, drag_area: drag_area}
"""


@pytest.fixture(scope="session")
def own_fmu(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """`truck:trucksim` as an FMU."""
    out = tmp_path_factory.mktemp("fmu") / "own.fmu"
    export.export("truck:trucksim", out)
    return out


@pytest.fixture
def own(own_fmu: Path, tmp_path: Path) -> str:
    """The same as a simulator's text, with a mapping of its own in own.yaml."""
    (tmp_path / "own.yaml").write_text(MAPPING)
    return f"fmu:{own_fmu}:{tmp_path / 'own.yaml'}"
