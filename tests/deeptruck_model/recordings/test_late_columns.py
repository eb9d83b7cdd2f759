"""Columns stamped late or early are put back, and nothing comes from another piece."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from csv_tables import SPEED, write_csv

from deeptruck_model.recordings import Recording, import_table, read

LATE = ("engine_command", "elevation")


def late(tmp_path: Path, table: dict[str, Any], late_s: float, **meaning: Any) -> list[Recording]:
    """A table with `fuel` as command and as rate, and `h`; the command and `h` are late. Through a bag."""
    channels = {
        **SPEED,
        "engine_command": {"column": "fuel", "unit": "g/s", "late_s": late_s},
        "fuel_rate": {"column": "fuel", "unit": "g/s", "density": 1.0},
        "elevation": {"column": "h", "unit": "m", "late_s": late_s},
    }
    columns = {"time": {"rate_hz": 1.0}, "grade_window_m": 50, "channels": channels, **meaning}
    import_table(write_csv(tmp_path / "drive.csv", table), columns, tmp_path / "bag")
    return read(tmp_path / "bag")


def driven(count: int = 12) -> dict[str, Any]:
    rng = np.random.default_rng(1)
    return {"v": np.full(count, 9.0), "fuel": rng.uniform(1, 5, count), "h": rng.uniform(0, 3, count)}


@pytest.mark.parametrize("late_s", [0.0, 1.0, 3.0, -1.0, -2.0])
def test_a_late_column_is_put_back_by_whole_rows(tmp_path: Path, late_s: float) -> None:
    table, rows = driven(), round(late_s)
    (recording,) = late(tmp_path, table, late_s)
    source = np.arange(12) + rows
    there = (source >= 0) & (source < 12)
    for channel, column in (("engine_command", "fuel"), ("elevation", "h")):
        expected = np.where(there, table[column][source % 12], np.nan)
        np.testing.assert_allclose(recording.channels[channel], expected, err_msg=channel)
    np.testing.assert_allclose(recording.channels["fuel_rate"], table["fuel"])
    np.testing.assert_array_equal(recording.channels["speed"], table["v"])
    said = [note for note in recording.notes if "is stamped" in note]
    assert said == [f"{c} is stamped {late_s:g} s late and was put back" for c in LATE if late_s]
    lost = [note for note in recording.notes if "outside their piece once put back by late_s" in note]
    assert lost == [
        f"{c}: {rows} of 12 samples outside their piece once put back by late_s" for c in LATE if rows > 0
    ]


def test_half_a_row_is_held_or_interpolated_as_ever(tmp_path: Path) -> None:
    table = driven()
    (recording,) = late(tmp_path, table, 0.5)
    for channel, column in (("engine_command", "fuel"), ("elevation", "h")):
        values = recording.channels[channel]
        np.testing.assert_allclose(values[1:-1], ((table[column][:-1] + table[column][1:]) / 2)[1:])
        assert np.isnan(values[[0, -1]]).all()


@pytest.mark.parametrize("late_s", [1.0, 0.5, -0.5, -1.0])
@pytest.mark.parametrize("clock", [False, True])
def test_nothing_late_comes_from_another_piece(tmp_path: Path, late_s: float, clock: bool) -> None:
    """Neither where the table is cut at a jump nor where its clock has a gap."""
    table = driven()
    jump = np.arange(12) >= 6
    table["fuel"] = np.where(jump, 7.0, 2.0)
    table["h"] = np.where(jump, 50.0, 10.0)
    meaning: dict[str, Any] = {"split_at": {"elevation_step": 4.0}}
    if clock:
        table["t"] = np.arange(12.0) + 5.0 * jump
        meaning = {"time": {"column": "t", "unit": "s"}}
    pieces = late(tmp_path, table, late_s, **meaning)
    assert [len(p) for p in pieces] == [6, 6]
    ends = {1.0: [-1], 0.5: [0, -1], -0.5: [0], -1.0: [0]}[late_s]
    for piece, fuel, height in zip(pieces, (2.0, 7.0), (10.0, 50.0), strict=True):
        for channel, value in (("engine_command", fuel), ("elevation", height)):
            values = piece.channels[channel]
            assert np.isnan(values[ends]).all(), (channel, values)
            assert set(values[1:-1]) == {value}, (channel, values)


def test_a_late_speed_moves_the_clock(tmp_path: Path) -> None:
    table = {"v": np.arange(3.0, 15.0), "T": np.arange(12.0)}
    channels = {
        "speed": {"column": "v", "unit": "m/s", "late_s": 2.0},
        "ambient_temperature": {"column": "T", "unit": "degC"},
    }
    columns = {"time": {"rate_hz": 1.0}, "channels": channels}
    import_table(write_csv(tmp_path / "drive.csv", table), columns, tmp_path / "bag")
    (recording,) = read(tmp_path / "bag")
    np.testing.assert_allclose(recording.channels["speed"], np.arange(5.0, 15.0))
    np.testing.assert_allclose(recording.channels["ambient_temperature"], np.arange(10.0))


@pytest.mark.parametrize("late_s", [1.0, 0.5, -0.5, -1.0])
def test_a_late_speed_stays_in_its_piece(tmp_path: Path, late_s: float) -> None:
    table = {"v": [5.0] * 6 + [20.0] * 6, "h": [5.0] * 6 + [20.0] * 6}
    channels = {
        "speed": {"column": "v", "unit": "m/s", "late_s": late_s},
        "elevation": {"column": "h", "unit": "m"},
    }
    columns = {"time": {"rate_hz": 1.0}, "split_at": {"speed_step": 2.5}, "channels": channels}
    import_table(write_csv(tmp_path / "drive.csv", table), columns, tmp_path / "bag")
    pieces = read(tmp_path / "bag")
    assert [len(p) for p in pieces] == [5, 5]
    for piece, value in zip(pieces, (5.0, 20.0), strict=True):
        assert set(piece.channels["speed"]) == {value}
        height = piece.channels["elevation"]
        assert set(height[~np.isnan(height)]) == {value}


def test_a_late_column_that_most_rows_leave_blank(tmp_path: Path) -> None:
    table = {"v": np.full(40, 9.0), "T": [k if k % 4 == 0 else "" for k in range(40)]}
    channels = {**SPEED, "ambient_temperature": {"column": "T", "unit": "degC", "late_s": 1.0}}
    columns = {"time": {"rate_hz": 1.0}, "channels": channels}
    (recording,) = import_table(
        write_csv(tmp_path / "drive.csv", table), columns, tmp_path / "bag"
    ).recordings
    np.testing.assert_allclose(recording.channels["ambient_temperature"][3:36], np.arange(4, 37))
    assert np.isnan(recording.channels["ambient_temperature"][36:]).all()
