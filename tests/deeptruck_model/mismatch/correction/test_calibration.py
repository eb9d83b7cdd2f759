"""A truck of the pool becomes the recorded one, and says which parameters the drives do not identify."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from deeptruck_core.errors import InputError
from deeptruck_model import simulators, trucks
from deeptruck_model.mismatch.correction.calibration import Calibration, calibrate
from deeptruck_model.recordings import Recording, write_bag
from deeptruck_model.trucks import driving_cycles

POOL = trucks.load("trucksim")
TRUE = {"mass": 25_000.0, "drag_area": 6.6, "brake_gain": 0.9}


LIGHT_ENGINE = {"engine_inertia": 1.0, "boost_lag": 0.0, "driveline_efficiency": 0.9}  # what is not fitted


def drives(count: int = 3, seconds: float = 200.0, true: Mapping[str, float] = TRUE) -> list[Recording]:
    out = []
    for k in range(count):
        r = driving_cycles.drive(POOL.with_parameters(true), seconds=seconds, seed=k, name=f"drive{k}")
        noise = np.random.default_rng(k).normal(0.0, [[0.02], [0.05]], (2, len(r)))
        speed = np.maximum(r.channels["speed"] + noise[0], 0.0)
        measured = {"speed": speed, "acceleration": r.channels["acceleration"] + noise[1]}
        out.append(replace(r, channels=r.channels | measured))
    return out


@pytest.fixture(scope="module")
def found() -> Calibration:
    recorded = drives()
    return calibrate(POOL, recorded[:2], recorded[2:])


def test_what_differs_is_found_and_drives_held_out_recordings_better(found: Calibration) -> None:
    fitted = {p.name: p for p in found.parameters}
    assert fitted["mass"].value == pytest.approx(TRUE["mass"], rel=0.08) and fitted["mass"].given == 20_000.0
    for name, value in TRUE.items():
        interval = fitted[name].ci95
        assert interval is not None and interval[0] < value < interval[1]
        assert found.truck.parameters()[name] == fitted[name].value
    assert found.before is not None and found.after is not None
    assert found.after.speed < 0.2 * found.before.speed and found.validated
    assert found.held_out == ("drive2",)


def test_forces_that_all_go_with_the_mass_are_identified_together(found: Calibration) -> None:
    """All of them larger by one factor leave nearly the same accelerations."""
    assert ("mass", "torque_gain") in found.alike and not found.mass_held


def test_a_mass_that_physics_the_truck_lacks_would_move_stays_as_given() -> None:
    """An engine that is easier to turn looks like a heavier truck with stronger engine and brakes."""
    recorded = drives(true=LIGHT_ENGINE)
    kept = calibrate(POOL, recorded[:2], recorded[2:])
    assert kept.mass_held and kept.truck.parameters()["mass"] == POOL.parameters()["mass"]
    assert not any("mass" in pair for pair in kept.alike)
    assert {p.name: p.ci95 for p in kept.parameters}["mass"] is None


def test_what_a_drive_does_not_tell_stays_as_given() -> None:
    """At a creep air hardly resists."""
    recorded = creeping(3)
    fitted = {p.name: p for p in calibrate(POOL, recorded[:2], recorded[2:]).parameters}
    assert fitted["drag_area"].ci95 is None and fitted["drag_area"].value == POOL.parameters()["drag_area"]


def creeping(count: int) -> list[Recording]:
    profile = [driving_cycles.drive(POOL, seconds=200.0, seed=k, name=f"slow{k}") for k in range(count)]
    out = []
    for r in profile:
        u = np.stack([300.0 + 100.0 * np.sin(np.arange(len(r)) / 30.0), np.zeros(len(r))], axis=1)
        run = simulators.free_run(POOL, u[None], r.w[None], np.array([[0.0, 2.0, 0.0]]))
        named = dict(zip(r.interface.u, u.T, strict=True)) | dict(zip(r.interface.y, run.y[0].T, strict=True))
        others = {n: x for n, x in r.channels.items() if n not in ("gear", "engine_speed")}  # of the profile
        out.append(replace(r, channels=others | named))
    return out


def test_drives_of_seconds_are_refused() -> None:
    with pytest.raises(InputError, match="the truck cannot be fitted to these recordings"):
        calibrate(POOL, [r.piece(0, 60) for r in drives(1)])


def test_the_command_prints_what_it_found_and_saves_a_truck(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, script: Callable[..., tuple[int, str, str]]
) -> None:
    for r in drives():
        write_bag(tmp_path / r.name, [r], interface=r.interface)
    monkeypatch.chdir(tmp_path)

    fit = ("calibrate-truck", "truck:trucksim", "--recordings", "drive0", "drive1", "--held-out")
    given = (*fit, "drive2", "--out", "mine")
    code, says, _ = script(*given)
    assert code == 0
    assert (
        "drag_area" in says and "(lbf, mph)" in says and "speed error of free runs of 20 s on drive2" in says
    )
    assert simulators.load("mine").parameters()["mass"] == pytest.approx(TRUE["mass"], rel=0.08)
    code, _, error = script(*given)
    assert code == 2 and "add --overwrite" in error

    empty = driving_cycles.drive(
        POOL, seconds=200.0, seed=7, name="empty"
    )  # as given: the fit makes it worse
    write_bag(tmp_path / "empty", [empty], interface=empty.interface)
    worse = (*fit, "empty", "--out", "worse")
    code, says, error = script(*worse)
    assert code == 2 and "larger" in error and "--keep" in error
    assert "drag_area" in says and not Path("worse").exists()
    assert script(*worse, "--keep")[0] == 0 and Path("worse").is_dir()
