"""The examination on real logs: here on tables of a made-up truck, as real ones are not in the project."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from deeptruck_exam.real.fleets import CHOSEN_ON, REPORTED, Fleet, Row, examine_real, page
from deeptruck_model import trucks
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


def test_the_page_counts_false_alarms_of_each_part() -> None:
    quiet = replace(ROW, part=CHOSEN_ON, said=(), sizes=(), verdict="nothing_missing", validated=False)
    quiet = replace(quiet, budget={"slow": 0.7, "left_over": 0.3})
    text = "\n".join(page([ROW, replace(ROW, validated=False), quiet]))
    assert "| headwind | 0.1 m/s^2 | yes | 1.00 | 0.50 |  |" in text and "| slow 70, left_over 30 |" in text


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
