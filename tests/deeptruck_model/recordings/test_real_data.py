"""The importer on real logs, where they are at hand (docs/recordings.md says where a user gets them)."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from deeptruck_model.recordings import Recording, import_table, read
from deeptruck_model.recordings.grade import with_slope

ROOT = Path(__file__).parents[3]
DATA = Path(os.environ.get("DEEPTRUCK_REAL_DATA", ROOT.parent / "shared" / "data"))
COLUMNS = ROOT / "layouts" / "columns"


def imported(file: str, columns: str, tmp_path: Path) -> list[Recording]:
    if not (DATA / file).exists():
        pytest.skip(f"{DATA / file} is not here")
    import_table(DATA / file, COLUMNS / columns, tmp_path / "bag")
    return read(tmp_path / "bag")


def test_the_heavy_truck_of_wang_and_rakha(tmp_path: Path) -> None:
    recordings = imported("vt_heavy_truck/veh002_all.csv", "veh002.yaml", tmp_path)
    assert sum(len(r) for r in recordings) > 20_800 and recordings[0].dt == 1.0
    speed = np.concatenate([r.channels["speed"] for r in recordings])
    assert (speed > 0.5).sum() / 60 == pytest.approx(290, abs=10)  # minutes moving
    elevation = np.concatenate([r.channels["elevation"] for r in recordings])
    assert np.isnan(elevation).mean() < 0.06  # where it stands still and then jumps
    assert np.nanmin(elevation) == pytest.approx(-48, abs=10)
    assert np.nanmax(elevation) == pytest.approx(811, abs=1)
    for recording in recordings:
        assert np.abs(np.diff(recording.channels["speed"])).max() <= 2.5
        assert not (np.abs(np.diff(recording.channels["elevation"])) > 4.0).any()
        command, fuel = recording.channels["engine_command"], recording.channels["fuel_rate"]
        np.testing.assert_allclose(fuel[1:], command[:-1] / 0.832, rtol=1e-12)  # what is burnt next
        assert np.isnan(command[-1])
    grade = np.concatenate([r.channels["grade"] for r in recordings])
    assert np.nanmax(np.abs(grade)) < 0.1
    assert recordings[0].interface.engine_unit == "g/s" and recordings[0].interface.brake_unit is None


def test_its_grade_explains_its_acceleration(tmp_path: Path) -> None:
    """a = c1 fuel/v + c2 rpm/v + c3 v^2 + c4 fits far better with c5 grade than without."""
    recordings = imported("vt_heavy_truck/veh002_all.csv", "veh002.yaml", tmp_path)
    names = ("speed", "acceleration", "fuel_rate", "engine_speed", "grade")
    speed, acceleration, fuel, rpm, grade = np.concatenate([r.columns(names) for r in recordings]).T
    use = (speed > 6) & (fuel > 0.6) & ~np.isnan(grade)
    speed, acceleration, fuel, rpm, grade = (x[use] for x in (speed, acceleration, fuel, rpm, grade))
    terms = np.stack([fuel / speed, rpm / speed, speed**2, np.ones_like(speed), grade], axis=1)
    half = len(terms) // 2

    def explained(columns: int) -> float:
        solution = np.linalg.lstsq(terms[:half, :columns], acceleration[:half], rcond=None)[0]
        error = acceleration[half:] - terms[half:, :columns] @ solution
        return float(1 - error.var() / acceleration[half:].var())

    assert explained(5) > explained(4) + 0.15


def test_the_electric_car_in_the_hills(tmp_path: Path) -> None:
    (recording,) = imported("bmw_i3/TripA11.csv", "bmw_i3.yaml", tmp_path)
    assert recording.dt == 0.1 and len(recording) == 14_245
    assert recording.channels["elevation"].max() == 642
    assert "specific_force" in recording.channels
    (by_height,) = with_slope([recording], "elevation")
    drift = np.cumsum(by_height.channels["grade"] * recording.channels["speed"] * 0.1)
    climbed = recording.channels["elevation"] - recording.channels["elevation"][0]
    assert np.abs(drift - climbed).max() < 5.0  # the grade integrates back to the elevation


def test_the_string_of_cars(tmp_path: Path) -> None:
    (recording,) = imported("fhwa_pav/data_example.csv", "fhwa_pav.yaml", tmp_path)
    assert len(recording) * recording.dt / 60 == pytest.approx(33, abs=0.5)
    opening = recording.channels["leader_speed"] - recording.channels["speed"]
    moving = np.corrcoef(np.diff(recording.channels["gap"][::10]), opening[:-1:10][: len(opening[::10]) - 1])[
        0, 1
    ]
    assert moving > 0.5  # the gap opens when the leader is faster


def test_cars_under_acc(tmp_path: Path) -> None:
    (recording,) = imported("openacc/short_setting_dynamic_part1.csv", "openacc.yaml", tmp_path)
    assert recording.dt == 0.1
    assert 46 < np.nanmin(recording.channels["latitude"]) < 47
    assert {"gap", "leader_speed", "grade"} <= set(recording.channels)
