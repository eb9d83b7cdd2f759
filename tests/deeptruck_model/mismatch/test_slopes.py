"""The slope that was recovered becomes the grade of its recordings, and of no others."""

from __future__ import annotations

import csv
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from deeptruck_core.errors import InputError
from deeptruck_model import trucks
from deeptruck_model.mismatch.slopes import Roads, with_road
from deeptruck_model.recordings import Recording, read, write_bag
from deeptruck_model.trucks import driving_cycles

TRUCK = trucks.load("freightliner")  # has no grade sensor


@pytest.fixture(scope="module")
def drives() -> list[Recording]:
    return [driving_cycles.drive(TRUCK, seconds=60.0, seed=k, name=f"drive{k}") for k in range(2)]


def found(folder: Path, rows: list[tuple[object, ...]]) -> Path:
    folder.mkdir()
    with (folder / "profiles.csv").open("w", newline="") as file:
        out = csv.writer(file)
        out.writerow(["recording", "time_s", "distance_m", "name", "value"])
        out.writerows(rows)
    return folder


def hill(name: str, seconds: range) -> list[tuple[object, ...]]:
    return [(name, float(t), 0.0, "road_grade", 0.001 * t) for t in seconds]


def test_the_slope_is_the_grade_at_its_time_and_interpolated_between(
    drives: list[Recording], tmp_path: Path
) -> None:
    rows = [*hill("drive0", range(20)), *hill("drive0", range(40, 60)), ("drive0", 1.0, 0.0, "headwind", 9.0)]
    (made,), left_out = with_road(Roads.read(found(tmp_path / "found", rows)), drives)
    assert left_out == ["drive1"] and made.name == "drive0" and made.interface.grade
    time = made.dt * np.arange(len(made))
    where = (time < 19.0) | ((time > 40.0) & (time < 59.0))
    np.testing.assert_allclose(made.channels["grade"][where], 0.001 * time[where], atol=5e-4)
    between = made.channels["grade"][(time > 20.0) & (time < 40.0)]
    assert (np.diff(between) >= 0.0).all() and 0.018 < between[0] < between[-1] < 0.041
    assert "grade" not in drives[0].channels


def test_the_name_of_the_truck_makes_no_other_truck(drives: list[Recording], tmp_path: Path) -> None:
    """Bags with topics of the user's own have no truck stored, and are called as the bag is."""
    named = [replace(drive, interface=replace(drive.interface, name=drive.name)) for drive in drives]
    roads = Roads.read(found(tmp_path / "found", [*hill("drive0", range(60)), *hill("drive1", range(60))]))
    assert len(with_road(roads, named)[0]) == 2


def test_what_holds_no_slope_is_refused(drives: list[Recording], tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no readable verdict"):
        Roads.read(tmp_path)
    (tmp_path / "verdict.json").write_text('{"verdict": "undetermined", "fit": {}}')
    with pytest.raises(InputError, match="its verdict is 'undetermined'"):  # not: run mismatch first
        Roads.read(tmp_path)
    with pytest.raises(InputError, match="no road_grade was found"):
        Roads.read(found(tmp_path / "wind", [("drive0", 0.0, 0.0, "headwind", 5.0)]))
    roads = Roads.read(found(tmp_path / "short", hill("drive0", range(5))))
    with pytest.raises(InputError, match="no slope was found for these recordings"):
        with_road(roads, drives)
    graded = Recording("drive0", 0.1, drives[0].channels | {"grade": np.zeros(600)}, TRUCK.interface)
    with pytest.raises(InputError, match="grade of its own"):
        with_road(roads, [graded])
    with pytest.raises(InputError, match="drives of one truck"):
        with_road(roads, [drives[0], replace(drives[1], interface=trucks.load("volvo").interface)])
    with pytest.raises(InputError, match="two recordings are called 'drive0'"):
        Roads.read(found(tmp_path / "alike", [*hill("drive0", range(20)), *hill("drive0", range(20))]))


def call(*arguments: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", "from deeptruck_model.cli import main; main()", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=120.0, check=False)


def test_the_command_writes_bags_that_hold_it(drives: list[Recording], tmp_path: Path) -> None:
    write_bag(tmp_path / "bag", drives[:1], interface=TRUCK.interface)
    name = read(tmp_path / "bag")[0].name
    folder = found(tmp_path / "found", hill(name, range(60)))
    command = ["road", folder, tmp_path / "bag", "--out", tmp_path / "out"]
    done = call(*command)
    assert done.returncode == 0 and "1 recording with a grade" in done.stdout
    (again,) = read(tmp_path / "out")
    assert again.interface.grade and again.channels["grade"][-20] == pytest.approx(0.058, abs=2e-3)
    again_at_once = call(*command)
    assert again_at_once.returncode == 2
    assert "holds a bag with a recovered slope already" in again_at_once.stderr
