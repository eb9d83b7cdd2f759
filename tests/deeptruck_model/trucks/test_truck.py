"""Loading, parameters, saving and refusal."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from deeptruck_core.errors import InputError
from deeptruck_model import simulators, trucks
from deeptruck_model.simulators import Simulator
from deeptruck_model.trucks.accelerometer import Accelerometer


def test_load_through_simulators_with_nested_and_flat_overrides(tmp_path: Path) -> None:
    file = tmp_path / "heavy.yaml"
    file.write_text(
        "mass: 32000\nbrakes: {brake_fade: 0}\ninterface: {grade: false}\nengine: {boost_lag: 0}\n"
    )
    truck = simulators.load(f"truck:trucksim:{file}")
    assert isinstance(truck, Simulator)
    assert truck.parameters()["mass"] == 32000.0
    assert truck.parameters()["brake_fade"] == truck.parameters()["boost_lag"] == 0.0
    assert truck.interface.w == ()


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("mas: 20000", "did you mean mass"),
        ("engine: {bost_lag: 1}", "did you mean boost_lag"),
        ("mass: heavy", "must be a number in kg"),
        ("mass: -5", "1000 to 250000"),
        ("torque_gain: 4", "is 4, not 0 to 3"),
        ("torque_gain: all", "must be a number, not 'all'"),
        ("mass: .nan", "1000 to 250000"),
        ("mass: [1", "is not valid YAML"),
        ("- mass", "must hold 'key: value' pairs"),
        ("ratios: [1, 2]", "falling"),
        ("full_load: {speed: [100, 50], torque: [1, 2]}", "rising"),
        ("interface: {engine_unit: g/s}", "N m"),
        ("governed_speed: 400", "must be below"),
    ],
)
def test_bad_overrides_are_one_clear_line(tmp_path: Path, text: str, says: str) -> None:
    file = tmp_path / "bad.yaml"
    file.write_text(text)
    with pytest.raises(InputError, match=says) as refusal:
        trucks.load("trucksim", str(file))
    assert "\n" not in str(refusal.value)


def test_what_a_truck_cannot_take_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="did you mean trucksim"):
        trucks.load("truksim")
    with pytest.raises(InputError, match="did you mean drag_area"):
        trucks.load("volvo").with_parameters({"dragarea": 5.0})
    with pytest.raises(InputError, match="cannot be read"):
        trucks.load("volvo", "/nowhere/at/all.yaml")
    truck = trucks.load("freightliner")
    with pytest.raises(InputError, match="w has shape"):
        truck.step(truck.reset(np.zeros((2, 3))), np.zeros((2, 2)), np.zeros((2, 1)))
    with pytest.raises(InputError, match="u has shape"):
        truck.step(truck.reset(np.zeros((2, 3))), np.zeros((2, 1)), np.zeros((2, 0)))
    truck.save(tmp_path)
    manifest = json.loads((tmp_path / "simulator.json").read_text())
    del manifest["truck"]["body"]["mass"]
    (tmp_path / "simulator.json").write_text(json.dumps(manifest))
    with pytest.raises(InputError, match="lacks mass"):
        simulators.load(tmp_path)


@pytest.mark.parametrize("column", [0, 1])
def test_nan_is_refused_not_driven(column: int) -> None:
    truck = trucks.load("volvo")
    state = truck.reset(np.array([[0.0, 20.0], [0.0, 20.0]]))
    u = np.array([[10.0, 0.0], [10.0, 0.0]])
    u[1, column] = np.nan
    with pytest.raises(InputError, match="row 1"):
        truck.step(state, u, np.zeros((2, 1)))
    with pytest.raises(InputError, match="row 0"):
        truck.step(state, np.zeros((2, 2)), np.array([[np.inf], [0.0]]))
    with pytest.raises(InputError, match="finite"):
        truck.reset(np.array([[0.0, np.nan]]))


def test_saved_truck_drives_alike(tmp_path: Path) -> None:
    truck = trucks.load("volvo", dt=0.2).with_parameters({"mass": 21000.0, "brake_gain": 0.8})
    truck.save(tmp_path / "sim")
    again = simulators.load(tmp_path / "sim")
    assert again.dt == 0.2
    assert again.interface == truck.interface
    assert again.parameters() == truck.parameters()
    u = np.tile([60.0, 0.0], (1, 100, 1))
    y = [t.rollout(u, np.zeros((1, 100, 1)), np.array([[0.0, 9.0, 1.0]])).y for t in (truck, again)]
    np.testing.assert_array_equal(y[0], y[1])
    assert {p.name for p in (tmp_path / "sim").iterdir()} == {"simulator.json", ".deeptruck.json"}


def test_a_longer_step_agrees_with_the_short_one() -> None:
    short, long = trucks.load("trucksim"), trucks.load("trucksim", dt=1.0)
    u, w = np.tile([900.0, 0.0], (1, 301, 1)), np.zeros((1, 301, 1))
    y0 = np.array([[0.0, 12.0, 4.0]])
    fine = short.rollout(u, w, y0).y[0, ::10]
    coarse = long.rollout(u[:, :31], w[:, :31], y0).y[0]
    np.testing.assert_allclose(coarse[:, 1], fine[:, 1], atol=1e-9)


@pytest.mark.parametrize("name", ["trucksim", "volvo"])
def test_downhill_no_gear_is_kept_that_turns_faster_than_the_engine_can(name: str) -> None:
    truck, rng = trucks.load(name), np.random.default_rng(0)
    u = np.zeros((64, 1200, 2))
    u[:, :, 0] = np.repeat(rng.uniform(0.0, 300.0 if name == "trucksim" else 20.0, (64, 24)), 50, axis=1)
    w = np.broadcast_to(-rng.uniform(0.03, 0.06, (64, 1, 1)), (64, 1200, 1)).copy()
    run = truck.rollout(u, w, np.stack([np.zeros(64), rng.uniform(1.0, 6.0, 64), np.zeros(64)], axis=1))
    p, gear = truck.parameters(), run.inside["gear"].astype(int)
    ratios = np.array(truck.specification.ratios)
    turning = ratios[gear - 1] * p["final_drive"] * run.y[:, :, 1] / p["wheel_radius"]
    over = (turning > 1.05 * p["governed_speed"]) & (gear < len(ratios))
    assert over.sum(axis=1).max() < 50  # 5 s


# The accelerometer of a simulated truck reads the derivative of speed and the slope of the road


def test_it_feels_slope_and_pitch_beside_its_bias() -> None:
    means = {}
    for a, slope in ((0.0, 0.0), (0.0, 0.05), (1.0, 0.0)):
        one = Accelerometer(seed=3)
        means[a, slope] = np.mean([one.reads(a, slope) for _ in range(20_000)])
    level = means[0.0, 0.0]
    assert abs(level) < 4 * Accelerometer.BIAS
    np.testing.assert_allclose(means[0.0, 0.05] - level, 9.80665 * 0.05 / np.hypot(1.0, 0.05), atol=1e-9)
    np.testing.assert_allclose(means[1.0, 0.0] - level, 1.0 + Accelerometer.PITCH, atol=1e-9)


# The snippets of docs/trucks.md run as they stand


DOC = Path(__file__).parents[3] / "docs" / "trucks.md"


def test_snippets_run() -> None:
    scope: dict[str, Any] = {}
    blocks = re.findall(r"```python\n(.*?)```", DOC.read_text(), re.DOTALL)
    assert len(blocks) == 3
    for block in blocks:
        exec(block, scope)
    assert len(scope["recording"]) == 4 * 36000
    assert scope["field"].channels["speed"].mean() > 20.0
