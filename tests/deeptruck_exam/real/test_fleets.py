"""The examination on real logs: here on tables of a made-up truck, as real ones are not in the project."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from deeptruck_core.signals import TruckInterface
from deeptruck_exam.real.fleets import REPORTED, Fleet, Row, examine_real
from deeptruck_exam.real.withheld import (
    compare_profile,
    read_profiles,
    withhold,
)
from deeptruck_model import trucks
from deeptruck_model.recordings import Recording
from deeptruck_model.trucks import driving_cycles

LAYOUT = """name: made_up
time: {column: t, unit: s}
channels:
  speed: {column: v, unit: m/s}
  engine_command: {column: e, unit: N m}
  brake_command: {column: b, unit: percent}
"""
ROW = Row(
    "car", "a, b", REPORTED, "", "brake", "missing_physics", ("headwind",), ("0.1 m/s^2",), True, 1.0, 0.5
)


def test_a_validated_name_where_nothing_was_withheld_is_a_false_alarm() -> None:
    assert ROW.false_alarm
    for silent in (replace(ROW, validated=False), replace(ROW, said=()), replace(ROW, withheld="grade")):
        assert not silent.false_alarm


def test_a_pair_is_answered_where_the_budget_leaves_little_and_no_false_name_is_accepted() -> None:
    little, much = {"slow": 0.65, "left_over": 0.35}, {"slow": 0.6, "left_over": 0.4}
    quiet = replace(ROW, said=(), validated=False)
    assert replace(quiet, budget=little).answered and not replace(quiet, budget=much).answered
    assert not quiet.answered and not replace(ROW, budget=little).answered


@pytest.mark.long
def test_every_drive_is_fitted_once_and_a_second_run_does_nothing_again(tmp_path: Path) -> None:
    data = tmp_path / "data"
    data.mkdir()
    (data / "layout.yaml").write_text(LAYOUT)
    truck = trucks.load("trucksim")
    for k in range(3):
        r = driving_cycles.drive(truck, seconds=310.0, seed=k)
        columns = [r.time, *(r.channels[c] for c in ("speed", "engine_command", "brake_command"))]
        np.savetxt(data / f"{k}.csv", np.stack(columns, 1), delimiter=",", header="t,v,e,b", comments="")
    fleet = Fleet("fleet", str(data / "layout.yaml"), ("0.csv",), ("1.csv", "2.csv"), REPORTED, "load")
    rows = examine_real(data, tmp_path / "out", fleets=(fleet,), sources=(), updates=30)
    assert [r.drives for r in rows] == ["drive_0, drive_1", "drive_1, drive_0"]
    assert all(not r.verdict.startswith("failed") and r.speed_error for r in rows)
    kept = json.loads((tmp_path / "out" / "real.json").read_text())
    assert [tuple(r["said"]) for r in kept] == [r.said for r in rows]
    found = tmp_path / "out" / "fleet" / "drive_0-drive_1" / "found" / "verdict.json"
    before = found.stat().st_mtime_ns
    assert examine_real(data, tmp_path / "out", fleets=(fleet,), sources=(), updates=30) == rows
    assert found.stat().st_mtime_ns == before


# A recovered profile against the withheld one, on a made-up road


GRAVITY = 9.81


@pytest.fixture
def drive():
    n = 1200
    grade = 0.03 * np.sin(np.arange(n) / 90.0)
    channels = {
        "speed": np.full(n, 20.0),
        "acceleration": -GRAVITY * grade,
        "engine_command": np.zeros(n),
        "grade": grade,
        "elevation": np.cumsum(grade) * 20.0,
    }
    return Recording("fit#1", 1.0, channels, TruckInterface("x", brake_unit=None, fuel=False), start_s=500.0)


def profile(tmp_path, drive, gain, since_bag):
    lines = ["recording,time_s,distance_m,name,value"]
    for k in range(0, len(drive), 5):
        time = k + (drive.start_s if since_bag else 0.0)
        value = gain * drive.channels["grade"][k] + 0.01
        lines.append(f"fit#1,{time},{20.0 * k},road_grade,{value}")
        lines.append(f"fit#1,{time},{20.0 * k},wind,99.0")
    (tmp_path / "profiles.csv").write_text("\n".join(lines) + "\n")
    return read_profiles(tmp_path / "profiles.csv")


@pytest.mark.parametrize("since_bag", [True, False])
def test_a_scaled_copy_correlates_fully_and_shows_its_slope(tmp_path, drive, since_bag):
    found = compare_profile(profile(tmp_path, drive, 0.7, since_bag), [drive])
    assert found.windows == len(drive) // 21
    assert found.correlation == pytest.approx(1.0, abs=0.01)
    assert found.slope == pytest.approx(0.7, abs=0.02)


def test_what_is_withheld_is_gone(drive):
    blind = withhold(drive)
    assert set(blind.channels) == {"speed", "acceleration", "engine_command"}
    assert not blind.interface.grade and blind.w.shape == (len(drive), 0)
