"""`deeptruck-model new`, as it is typed."""

from __future__ import annotations

import os
import pty
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest
import yaml

from deeptruck_model import trucks
from deeptruck_model.recordings import write_bag
from deeptruck_model.recordings.tables.columns import load_columns
from deeptruck_model.trucks import driving_cycles

SHEET = {
    "mass_kg": 20000,
    "gear_ratios": [12.69, 9.29, 6.75, 4.90, 3.62, 2.59, 1.90, 1.38, 1.00, 0.74],
    "axle_ratio": 3.7,
    "tyres": 0.5,
    "rated_torque_nm": 1750,
    "frontal_area_m2": 10.5,
    "full_braking_m_s2": 6,
}
COMMAND = (sys.executable, "-c", "from deeptruck_model.cli import main; main()", "new")


@pytest.fixture
def new(
    script: Callable[..., tuple[int, str, str]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Callable[..., tuple[int, str, str]]:
    """The command in `tmp_path`, without a terminal: (exit code, output, errors)."""
    monkeypatch.chdir(tmp_path)
    return partial(script, "new")


@pytest.fixture
def here(tmp_path: Path) -> Path:
    (tmp_path / "sheet.yaml").write_text(yaml.safe_dump(SHEET))
    truck = trucks.load("trucksim")
    write_bag(
        tmp_path / "bag", [driving_cycles.drive(truck, seconds=300.0, seed=3)], interface=truck.interface
    )
    return tmp_path


def test_a_sheet_that_the_drive_confirms_becomes_a_truck(here: Path, new) -> None:
    code, _, error = new("mine.yaml", "--from", "sheet.yaml", "--recordings", "bag")
    assert code == 0, error
    assert yaml.safe_load((here / "mine.yaml").read_text())["transmission"]["final_drive"] == 3.7


def test_a_truck_of_drives_without_slope_takes_none(here: Path, new) -> None:
    truck = trucks.load("trucksim")
    drive = driving_cycles.drive(truck, seconds=100.0, seed=3)
    level = replace(drive, channels={n: x for n, x in drive.channels.items() if n != "grade"})
    write_bag(here / "level", [level], interface=replace(truck.interface, grade=False))
    code, _, error = new("mine.yaml", "--from", "sheet.yaml", "--recordings", "level")
    assert code == 0, error
    assert yaml.safe_load((here / "mine.yaml").read_text())["interface"]["grade"] is False


def test_a_sheet_that_the_drive_contradicts_is_refused(here: Path, new) -> None:
    (here / "sheet.yaml").write_text(yaml.safe_dump({**SHEET, "axle_ratio": 4.6}))
    code, _, error = new("mine.yaml", "--from", "sheet.yaml", "--recordings", "bag")
    assert code == 2 and error.count("\n") == 1 and "check axle ratio" in error
    assert not (here / "mine.yaml").exists()


@pytest.mark.parametrize("unit", ["bar"])
def test_brakes_that_a_physics_truck_cannot_take_are_refused_with_the_line_to_write(
    here: Path, new, unit: str | None
) -> None:
    truck = trucks.load("trucksim")
    drive = driving_cycles.drive(truck, seconds=60.0, seed=3)
    channels = {name: v for name, v in drive.channels.items() if unit or name != "brake_command"}
    interface = replace(truck.interface, brake_unit=unit)
    write_bag(here / "other", [replace(drive, channels=channels)], interface=interface)
    code, _, error = new("mine.yaml", "--from", "sheet.yaml", "--recordings", "other")
    assert code == 2 and error.count("\n") == 1 and "brake_command" in error
    line = error.split("'brake_command: ")[1].partition("'")[0]
    meant = {"column": "p", "unit": "percent", "scale": 12.5} if unit else None
    columns = {
        "time": {"column": "t"},
        "channels": {
            "speed": {"column": "v", "unit": "m/s"},
            "brake_switch": {"column": "on"},
            "brake_command": yaml.safe_load(line.replace("...", "p")),
        },
    }
    assert meant is None or columns["channels"]["brake_command"] == meant
    assert load_columns(columns).channels["brake_command"].convert.unit == ("percent" if unit else "m/s^2")
    assert not (here / "mine.yaml").exists()


def test_without_a_terminal_it_says_what_to_give(new) -> None:
    code, _, error = new("mine.yaml")
    assert (code, error.count("\n")) == (2, 1) and "--from FILE.yaml" in error
    code, _, error = new("mine", "--from", "sheet.yaml")
    assert code == 2 and "must end in .yaml" in error


def test_the_wizard_asks_again_after_a_wrong_answer(tmp_path: Path) -> None:
    ours, theirs = pty.openpty()
    answers = "heavy\n24000\n2.85\n315/80R22.5\n"
    answers += "14.8 11.7 9 7.1 5.6 4.4 3.4 2.6 2 1.6 1.27 1\n2300\n\n\n\n\nn\n"
    with subprocess.Popen(
        (*COMMAND, "mine.yaml"), cwd=tmp_path, stdin=theirs, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    ) as process:
        os.write(ours, answers.encode())
        _, error = process.communicate(timeout=120)
    os.close(ours)
    os.close(theirs)
    assert process.returncode == 0, error
    assert b"'mass_kg' must be a number in kg, not 'heavy'" in error
    assert yaml.safe_load((tmp_path / "mine.yaml").read_text())["body"]["mass"] == 24000.0
