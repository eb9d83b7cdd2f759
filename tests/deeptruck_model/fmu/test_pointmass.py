"""An FMU with nothing of ours inside, for FMI 2 and 3: valid, fit for use, and its hidden brake is named."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from fmpy import simulate_fmu
from fmpy.validation import validate_fmu

from deeptruck_model import simulators
from deeptruck_model.mismatch import find_mismatch
from deeptruck_model.recordings import Recording
from deeptruck_model.simulators import protocol_check

sys.path.append(str(Path(__file__).parent))
import pointmass

FMI = pytest.mark.parametrize("fmi", [2, 3])


def free_error(simulator: simulators.Simulator, drive: Recording) -> float:
    """RMSE of the speed in free runs of 60 s, m/s."""
    n, starts = 600, range(0, len(drive) - 600, 600)
    u, w, y = (np.stack([part[k : k + n] for k in starts]) for part in (drive.u, drive.w, drive.y))
    run = simulators.free_run(simulator, u, w, y[:, 0]).y
    return float(np.sqrt(np.mean((run - y)[:, 1:, 1] ** 2)))


@FMI
def test_it_is_valid_fit_for_use_and_cannot_keep_its_state(tmp_path: Path, fmi: int) -> None:
    file = pointmass.built(tmp_path, fmi)
    assert validate_fmu(str(file)) == []
    rows = protocol_check.examine(simulators.load(f"fmu:{file}:{tmp_path / 'map.yaml'}"))
    assert not protocol_check.missing(rows)
    about = {row.about: row.says for row in rows}
    assert about["old states"] == "step and force leave the state usable that they are given"
    assert about["parameters"] == "3: mass, drag_area, rolling_resistance"


@FMI
def test_it_drives_as_fmpy_drives_it_and_goes_back_without_its_state(tmp_path: Path, fmi: int) -> None:
    file = pointmass.built(tmp_path, fmi)
    truck = simulators.load(f"fmu:{file}:{tmp_path / 'map.yaml'}")
    rng = np.random.default_rng(1)
    u = np.stack([rng.uniform(0, 1500, 60), 30.0 * (rng.random(60) > 0.8)], -1)
    w = rng.normal(0.0, 0.01, (60, 1))
    rows = [(0.1 * k, *u[k], *w[k]) for k in range(60)]
    given = np.array(rows, [("time", float), ("torque", float), ("pedal", float), ("slope", float)])
    told = simulate_fmu(
        str(file), start_values={"v_start": 15.0}, input=given, output=["v"], stop_time=5.9,
        step_size=0.1, output_interval=0.1, fmi_type="CoSimulation",
    )  # fmt: skip
    y0 = np.array([[0.0, 15.0]])
    whole = simulators.free_run(truck, u[None], w[None], y0).y
    np.testing.assert_allclose(whole[0, 1:, 1], told["v"][1:60], atol=1e-9)
    state, kept = truck.reset(y0), []
    for k in range(40):
        kept.append(state)
        state, _ = truck.step(state, u[None, k], w[None, k])
    for k in (31, 4):
        np.testing.assert_array_equal(truck.step(kept[k], u[None, k], w[None, k])[1], whole[:, k + 1])


@FMI
def test_several_of_its_steps_make_one_of_ours(tmp_path: Path, fmi: int) -> None:
    """The point mass refuses a step from another time than its own, and computes in steps of 0.01 s."""
    file, mapping = pointmass.built(tmp_path, fmi), tmp_path / "map.yaml"
    u, w, y0 = np.tile([600.0, 0.0], (1, 30, 1)), np.zeros((1, 30, 1)), np.array([[0.0, 12.0]])
    whole = simulators.free_run(simulators.load(f"fmu:{file}:{mapping}"), u, w, y0).y
    mapping.write_text(f"{pointmass.MAPPING}step: 0.02\n")
    parts = simulators.load(f"fmu:{file}:{mapping}")
    for _ in range(2):  # a second run starts at time 0 again
        np.testing.assert_allclose(simulators.free_run(parts, u, w, y0).y, whole, atol=1e-9)


@FMI
def test_without_the_brake_the_drives_are_the_fmus_own(tmp_path: Path, fmi: int) -> None:
    """The recordings and the FMU are two programs of one physics: what else differs is the hidden brake."""
    truck = simulators.load(f"fmu:{pointmass.built(tmp_path, fmi)}:{tmp_path / 'map.yaml'}")
    same, sticks = (free_error(truck, pointmass.recorded("a", 180.0, 3, share)) for share in (0.0, 1 / 6))
    assert same < 0.3 < sticks


@pytest.mark.hours
@pytest.mark.timeout(3000)
@FMI
def test_a_brake_that_lets_go_late_is_named(tmp_path: Path, fmi: int) -> None:
    truck = simulators.load(f"fmu:{pointmass.built(tmp_path, fmi)}:{tmp_path / 'map.yaml'}")
    *fitted, unseen = (pointmass.recorded(name, 150.0, 10 + k) for k, name in enumerate("abcd"))
    found = find_mismatch(truck, fitted, [unseen])
    assert [f.effect for f in found.findings] == ["dragging_brake"]


@FMI
def test_one_whose_speed_is_valid_from_the_first_step_on_drives_as_one_that_has_it_at_once(
    tmp_path: Path, fmi: int
) -> None:
    trucks = []
    for silent in (False, True):
        folder = tmp_path / f"{silent}"
        folder.mkdir()
        file = pointmass.built(folder, fmi, silent=silent)
        trucks.append(simulators.load(f"fmu:{file}:{folder / 'map.yaml'}"))
    u, w = np.tile([600.0, 0.0], (2, 40, 1)), np.zeros((2, 40, 1))
    y0 = np.array([[0.0, 15.0], [0.0, 3.0]])
    recorded = np.stack([np.zeros((2, 40)), y0[:, 1:] + 0.01 * np.arange(40)], axis=-1)
    for run in (
        lambda t: simulators.free_run(t, u, w, y0),
        lambda t: simulators.forced_run(t, u, w, recorded),
    ):
        at_once, later = (run(t).y for t in trucks)
        np.testing.assert_array_equal(later, at_once)
    state, y = trucks[1].step(trucks[1].reset(y0), u[:, 0], w[:, 0])
    np.testing.assert_array_equal(y, trucks[0].step(trucks[0].reset(y0), u[:, 0], w[:, 0])[1])
    del state
