"""FMUs of ours and of nobody's drive as what is in them: free, forced, in batches, from any state."""

from __future__ import annotations

import shutil
import zipfile
from pathlib import Path

import numpy as np
import pointmass
import pytest
import yaml
from fmpy import simulate_fmu
from fmpy.validation import validate_fmu

from deeptruck_core.errors import InputError
from deeptruck_model import simulator_facts, simulators, trucks
from deeptruck_model import simulator_facts as facts
from deeptruck_model.fmu import export
from deeptruck_model.fmu.truck import FEWEST
from deeptruck_model.mismatch import CorrectedTruck
from deeptruck_model.simulators import Array, protocol_check
from deeptruck_model.trucks import driving_cycles

FMI = pytest.mark.parametrize("fmi", [2, 3])


def drive(seconds: float) -> tuple[Array, Array, Array]:
    truck = trucks.load("trucksim")
    c = driving_cycles.drive(truck, seconds=seconds, seed=1).channels
    i = truck.interface
    return tuple(np.stack([c[name] for name in names], -1)[None] for names in (i.u, i.w, i.y))  # type: ignore[return-value]


@pytest.mark.parametrize("forced", [False, True])
def test_a_run_is_that_of_the_truck_in_it(own: str, forced: bool) -> None:
    u, w, y = drive(60.0)
    ours, its = (
        simulators.forced_run(s, u, w, y) if forced else simulators.free_run(s, u, w, y[:, 0])
        for s in map(simulators.load, ("truck:trucksim", own))
    )
    np.testing.assert_allclose(its.y, ours.y, atol=1e-9)
    for name in ("gear", "traction_force", "mass"):
        np.testing.assert_allclose(its.inside[name], ours.inside[name], atol=1e-9)


def test_it_keeps_the_protocol(own: str) -> None:
    assert not protocol_check.missing(protocol_check.examine(simulators.load(own)))


@FMI
def test_an_fmu_in_c_drives_as_fmpy_drives_it(tmp_path: Path, fmi: int) -> None:
    """It refuses a step from another time than its own, has no state to keep, and takes no recorded speed."""
    file = pointmass.built(tmp_path, fmi)
    assert validate_fmu(str(file)) == []
    truck = simulators.load(f"fmu:{file}:{tmp_path / 'map.yaml'}")
    assert truck.parameters() == {"mass": 20000.0, "drag_area": 6.0}
    rng = np.random.default_rng(1)
    u = np.stack([rng.uniform(0, 1500, 60), 30.0 * (rng.random(60) > 0.8)], -1)
    w = rng.normal(0.0, 0.01, (60, 1))
    rows = [(0.1 * k, *u[k], *w[k]) for k in range(60)]
    given = np.array(rows, [("time", float), ("torque", float), ("pedal", float), ("slope", float)])
    told = simulate_fmu(
        str(file), start_values={"v_start": 15.0, "m": 25000.0}, input=given, output=["v"], stop_time=5.9,
        step_size=0.1, output_interval=0.1, fmi_type="CoSimulation",
    )  # fmt: skip
    heavy = truck.with_parameters({"mass": 25000.0})
    for _ in range(2):  # a second run starts at time 0 again
        y = simulators.free_run(heavy, u[None], w[None], np.array([[0.0, 15.0]])).y
        np.testing.assert_allclose(y[0, 1:, 1], told["v"][1:60], atol=1e-9)
    assert not protocol_check.missing(protocol_check.examine(truck))


@FMI
def test_without_an_input_for_it_a_recorded_speed_is_a_new_start(tmp_path: Path, fmi: int) -> None:
    truck = simulators.load(f"fmu:{pointmass.built(tmp_path, fmi)}:{tmp_path / 'map.yaml'}")
    state = truck.force(truck.reset(np.array([[0.0, 15.0]] * 2)), np.array([[0.0, 18.0], [np.nan, np.nan]]))
    speeds = truck.step(state, np.zeros((2, 2)), np.zeros((2, 1)))[1][:, 1]
    np.testing.assert_allclose(speeds, [18.0, 15.0], atol=0.1)


def test_it_is_loaded_again_by_its_path_and_hash(own: str, own_fmu: Path, tmp_path: Path) -> None:
    copy = tmp_path / "copy.fmu"
    shutil.copy(own_fmu, copy)
    truck = simulators.load(own.replace(str(own_fmu), str(copy)))
    truck.with_parameters({"mass": 22000.0}).save(tmp_path / "kept")
    assert simulators.load(tmp_path / "kept").parameters()["mass"] == 22000.0
    CorrectedTruck(truck, [], {"mass": -0.1}, None, True).save(tmp_path / "corrected")
    light = truck.with_parameters({"mass": 18000.0})
    u, w, y = drive(5.0)
    runs = [simulators.free_run(s, u, w, y[:, 0]).y for s in (simulators.load(tmp_path / "corrected"), light)]
    np.testing.assert_allclose(runs[0], runs[1], atol=1e-9)
    copy.write_bytes(copy.read_bytes() + b" ")
    with pytest.raises(InputError, match=r"copy.fmu of SHA-256 \w{12} is \w{12} now"):
        simulator_facts.simulator(str(tmp_path / "kept"))


def test_a_start_at_another_speed_is_refused(own: str, tmp_path: Path) -> None:
    file = tmp_path / "own.yaml"
    file.write_text(
        file.read_text().replace("speed: initial_speed", "speed: {variable: initial_speed, unit: km/h}")
    )
    truck = simulators.load(own)
    with pytest.raises(
        InputError, match=r"is at 7\S* m/s one step after it was to start at 20; .*initial_speed"
    ):
        truck.step(truck.reset(np.array([[0.0, 20.0, 0.0]])), np.zeros((1, 2)), np.zeros((1, 1)))


def test_files_that_are_no_fmu_or_run_elsewhere(own: str, own_fmu: Path, tmp_path: Path) -> None:
    text, empty, other = (tmp_path / f"{name}.fmu" for name in ("text", "empty", "other"))
    text.write_text("no zip")
    zipfile.ZipFile(empty, "w").close()
    for file, says in (
        (text, "it is no FMU, or damaged"),
        (empty, "it is no FMU, or damaged"),
        (tmp_path / "none.fmu", "it does not exist"),
    ):
        with pytest.raises(InputError, match=says):
            simulator_facts.simulator(f"fmu:{file}")
    with zipfile.ZipFile(own_fmu) as source, zipfile.ZipFile(other, "w") as target:
        for name in source.namelist():
            if "linux" not in name:
                target.writestr(name, source.read(name))
    elsewhere = simulators.load(own.replace(str(own_fmu), str(other)))
    with pytest.raises(InputError, match="it cannot be loaded"):
        elsewhere.reset(np.array([[0.0, 20.0, 0.0]]))


# A truck of ours as an FMU


def test_fmpy_finds_it_valid(own_fmu: Path) -> None:
    assert validate_fmu(str(own_fmu)) == []


def test_fmpy_drives_it_as_our_own_step_does(own_fmu: Path) -> None:
    truck = trucks.load("trucksim")
    drive = driving_cycles.drive(truck, seconds=180.0, seed=3)
    names = [*truck.interface.u, *truck.interface.w]
    given = [drive.channels[name] for name in names]
    speed = float(drive.channels["speed"][0])
    rows = [(0.1 * k, *(float(x[k]) for x in given)) for k in range(len(drive))]
    signals = np.array(rows, [("time", float), *((name, float) for name in names)])
    told = simulate_fmu(
        str(own_fmu), start_values={"initial_speed": speed}, input=signals, output=["speed", "fuel_rate"],
        stop_time=0.1 * (len(drive) - 1), step_size=0.1, output_interval=0.1, fmi_type="CoSimulation",
    )  # fmt: skip
    state, y = truck.reset(np.array([[0.0, speed, 0.0]])), np.zeros((len(drive), 3))
    for k in range(len(drive) - 1):
        state, y[k + 1] = truck.step(
            state, *(np.array([[x[k] for x in part]]) for part in (given[:2], given[2:]))
        )
    assert np.abs(told["speed"][1:] - y[1:, 1]).max() < 1e-6
    assert np.abs(told["fuel_rate"][1:] - y[1:, 2]).max() < 1e-6 and y[:, 1].max() > 10.0


def test_a_simulator_of_somebody_elses_is_not_exported(shuttle: Path, own: str) -> None:
    simulators.load(own).save(Path("kept"))
    for text in (own, f"python:{shuttle.stem}:make", "kept"):
        with pytest.raises(InputError, match="is, or corrects, a simulator that others wrote"):
            export.export(text, Path("never.fmu"))
    assert not Path("never.fmu").exists()


def test_old_states_are_gone_on_from_in_more_rows_than_instances(own: str) -> None:
    truck, rows = simulators.load(own), 2 * FEWEST
    u, w, y = drive(4.0)
    u, w, y0 = np.repeat(u, rows, 0), np.repeat(w, rows, 0), np.repeat(y[:, 0], rows, 0)
    y0[:, 1] += np.arange(rows)
    state, kept, seen = truck.reset(y0), [], []
    for k in range(20):
        kept.append(state)
        state, now = truck.step(state, u[:, k], w[:, k])
        seen.append(now)
    for k in (19, 3, 11):
        np.testing.assert_array_equal(truck.step(kept[k], u[:, k], w[:, k])[1], seen[k])


@FMI
def test_several_of_its_steps_make_one_of_ours(tmp_path: Path, fmi: int) -> None:
    file, mapping = pointmass.built(tmp_path, fmi), tmp_path / "map.yaml"
    u, w, y0 = np.tile([600.0, 0.0], (1, 30, 1)), np.zeros((1, 30, 1)), np.array([[0.0, 12.0]])
    whole = simulators.free_run(simulators.load(f"fmu:{file}:{mapping}"), u, w, y0).y
    mapping.write_text(f"{pointmass.MAPPING}step: 0.02\n")
    parts = simulators.free_run(simulators.load(f"fmu:{file}:{mapping}"), u, w, y0).y
    np.testing.assert_allclose(parts, whole, atol=1e-9)


# A mapping gives units and signals; what does not fit is one line, before anything runs


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
