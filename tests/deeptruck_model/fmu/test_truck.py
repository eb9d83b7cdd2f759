"""An FMU drives as the truck in it: free, forced, in batches, from any state; it is kept by its hash."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from deeptruck_cacc.environments.adapters import CaccGymEnv
from deeptruck_core.errors import InputError
from deeptruck_model import checks, simulators, trucks
from deeptruck_model.mismatch import CorrectedTruck
from deeptruck_model.simulators import Array, protocol_check
from deeptruck_model.trucks import driving_cycles

NO_FORCING = "measured: {speed: null, acceleration: null, active: null}\n"


def drive(seconds: float) -> tuple[Array, Array, Array]:
    truck = trucks.load("trucksim")
    c = driving_cycles.drive(truck, seconds=seconds, seed=1).channels
    i = truck.interface
    return tuple(np.stack([c[name] for name in names], -1)[None] for names in (i.u, i.w, i.y))  # type: ignore[return-value]


@pytest.mark.parametrize("forced", [False, True])
def test_a_run_is_that_of_the_truck_in_it(own: Path, forced: bool) -> None:
    u, w, y = drive(120.0)
    ours, its = (
        simulators.load(text).rollout(u, w, y[:, 0], y if forced else None)  # type: ignore[attr-defined]
        for text in ("truck:trucksim", f"fmu:{own}")
    )
    np.testing.assert_allclose(its.y, ours.y, atol=1e-9)
    for name in ("gear", "traction_force", "mass"):
        np.testing.assert_allclose(its.inside[name], ours.inside[name], atol=1e-9)


def test_steps_are_the_run_and_old_states_are_gone_on_from(own: Path) -> None:
    u, w, y = drive(15.0)
    truck = simulators.load(f"fmu:{own}")
    whole = simulators.free_run(truck, u, w, y[:, 0]).y
    state, kept = truck.reset(y[:, 0]), []
    for k in range(120):
        kept.append(state)
        state, now = truck.step(state, u[:, k], w[:, k])
        np.testing.assert_array_equal(now, whole[:, k + 1])
    for k in (110, 3, 64):  # from a kept state of the FMU, from its start, and between
        np.testing.assert_array_equal(truck.step(kept[k], u[:, k], w[:, k])[1], whole[:, k + 1])


def test_it_keeps_the_protocol(own: Path) -> None:
    assert not protocol_check.missing(protocol_check.examine(simulators.load(f"fmu:{own}")))


def test_without_an_input_for_it_a_recorded_speed_is_a_new_start(own: Path, tmp_path: Path) -> None:
    file = tmp_path / "map.yaml"
    file.write_text(NO_FORCING + "restart_beyond: 0.5\n")
    truck = simulators.load(f"fmu:{own}:{file}")
    state = truck.reset(np.array([[0.0, 15.0, 0.0]]))
    near, far = (truck.force(state, np.array([[0.0, v, 0.0]])) for v in (15.3, 18.0))
    speeds = [truck.step(s, np.zeros((1, 2)), np.zeros((1, 1)))[1][0, 1] for s in (state, near, far)]
    assert speeds[0] == speeds[1] and abs(speeds[2] - 18.0) < 0.1


def test_a_map_gives_units_and_ranges(own: Path, tmp_path: Path) -> None:
    file = tmp_path / "map.yaml"
    file.write_text(
        "outputs: {engine_speed: {variable: engine_speed, unit: rpm}}\n"
        + "parameters: {mass: {variable: mass, low: 15000, high: 25000}}\n"
    )
    truck, plain = simulators.load(f"fmu:{own}:{file}"), simulators.load(f"fmu:{own}")
    y0 = np.array([[0.0, 18.0, 0.0]])
    turning, right = (s.inside(s.reset(y0))["engine_speed"][0] for s in (truck, plain))
    assert turning == pytest.approx(right * np.pi / 30)
    assert truck.with_parameters({"mass": 24000.0}).parameters()["mass"] == 24000.0
    with pytest.raises(InputError, match="mass is 26000, which is not in its range of 15000 to 25000"):
        truck.with_parameters({"mass": 26000.0})


def test_it_is_loaded_again_by_its_path_and_hash(own: Path, tmp_path: Path) -> None:
    copy = tmp_path / "copy.fmu"
    shutil.copy(own, copy)
    simulators.load(f"fmu:{copy}").with_parameters({"mass": 22000.0}).save(tmp_path / "kept")
    assert simulators.load(tmp_path / "kept").parameters()["mass"] == 22000.0
    copy.write_bytes(copy.read_bytes() + b" ")
    with pytest.raises(InputError, match=r"copy.fmu of SHA-256 \w{12} is \w{12} now"):
        checks.simulator(str(tmp_path / "kept"))


def test_the_environment_drives_it(own: Path) -> None:
    env = CaccGymEnv(f"fmu:{own}")
    env.reset(seed=1)
    observation, reward, *_ = env.step(np.array([0.2, -1.0], np.float32))
    assert np.isfinite(observation).all() and np.isfinite(float(reward))


# A correction of an FMU with a wrong mass is kept with its reference, loads again, and drives better


def test_the_corrected_fmu_loads_again_and_is_better(heavy: Path, tmp_path: Path) -> None:
    truck = trucks.load("trucksim")
    c = driving_cycles.drive(truck, seconds=60.0, seed=1).channels
    i = truck.interface
    u, w, y = (np.stack([c[name] for name in names], -1)[None] for names in (i.u, i.w, i.y))
    base = simulators.load(f"fmu:{heavy}")
    assert base.parameters()["mass"] == 24000.0
    CorrectedTruck(base, [], {"mass": -1 / 6}, None, True).save(tmp_path / "better")
    again = simulators.load(tmp_path / "better")
    before, after = (
        np.abs(simulators.free_run(s, u, w, y[:, 0]).y[:, :, 1] - y[:, :, 1]).max() for s in (base, again)
    )
    assert after < 1e-6 < 0.1 < before
