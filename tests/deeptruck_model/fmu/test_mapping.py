"""A mapping gives units and signals; what does not fit is one line, before anything runs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml

from deeptruck_core.errors import InputError
from deeptruck_model import simulator_facts as facts
from deeptruck_model import simulators


def test_units_and_factors(own: str, tmp_path: Path) -> None:
    file = tmp_path / "own.yaml"
    plain = simulators.load(own)
    file.write_text(
        file.read_text()
        .replace("engine_speed: engine_speed", "engine_speed: {variable: engine_speed, unit: rpm}")
        .replace("drag_area: drag_area", "drag_area: {variable: drag_area, factor: 2}")
        + "set: {mass: 24000}\n"
    )
    truck, y0 = simulators.load(own), np.array([[0.0, 18.0, 0.0]])
    turning, right = (s.inside(s.reset(y0))["engine_speed"][0] for s in (truck, plain))
    assert turning == pytest.approx(right * np.pi / 30)
    assert truck.parameters() == {"mass": 24000.0, "drag_area": plain.parameters()["drag_area"] / 2}


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"engine": "x"}, "the mapping: unknown key 'engine'"),
        ({"start": None}, "the mapping: start: is empty"),
        ({"inputs": {"engine_comand": "x"}}, "did you mean engine_command"),
        ({"inputs": {"engine_command": "throttle"}}, "has no variable 'throttle'"),
        ({"inputs": {"engine_command": {"variable": "engine_command", "scale": 2}}}, "unknown key 'scale'"),
        ({"outputs": {"speed": {"variable": "speed", "unit": "furlong"}}}, "unit 'furlong' does not fit"),
        ({"inputs": {"engine_command": "speed"}}, "is speed, a continuous output, which cannot be set"),
        ({"inputs": {"engine_command": "mass"}}, "is mass, a fixed parameter, which cannot be set"),
        ({"inputs": {"grade": "grade"}}, "inputs: 'engine_command' is missing"),
        ({"dt": 0.1, "step": 0.03}, "is no whole number of the FMU's steps"),
        ({"dt": -1}, "dt: -1 is less than .* give s"),
        ({"parameters": {"mass": {"variable": "mass", "unit": "lb"}}}, "is in lb, ours is in kg"),
        ({"set": {"mass": "heavy"}}, "set.mass: 'heavy' is not of type 'number'"),
        (["a"], "must hold 'key: value' pairs"),
    ],
)  # fmt: skip
def test_what_does_not_fit(own: str, tmp_path: Path, given: object, says: str) -> None:
    file = tmp_path / "own.yaml"
    whole = yaml.safe_load(file.read_text())
    file.write_text(yaml.safe_dump({**whole, **given} if isinstance(given, dict) else given))
    with pytest.raises(InputError, match=says) as caught:
        facts.simulator(own)
    assert "\n" not in str(caught.value)
