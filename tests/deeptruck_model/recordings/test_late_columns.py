"""Columns stamped late or early are put back, and nothing comes from another piece."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from csv_tables import SPEED, write_csv

from deeptruck_core.arrays import Array
from deeptruck_model.recordings import Recording, import_table, read

RATE = {"rate_hz": 1.0}
JUMPED = np.arange(12) >= 6
CUTS: dict[str, dict[str, Any]] = {  # how the table falls into two pieces
    "one piece": {"time": RATE},
    "a jump": {"time": RATE, "split_at": {"elevation_step": 4.0}},
    "a gap": {"time": {"column": "t", "unit": "s"}},
}


def late(folder: Path, table: dict[str, Any], channels: dict[str, Any], **meaning: Any) -> list[Recording]:
    """The pieces of a table, through a bag."""
    columns = {"grade_window_m": 50, "channels": {**SPEED, **channels}, **meaning}
    import_table(write_csv(folder / "drive.csv", table), columns, folder / "bag")
    return read(folder / "bag")


def put_back(x: Array, late_s: float) -> Array:
    """Samples of a piece at 1 Hz as they are once put back: between two it is the mean, as of a ramp or a
    command that is held; what was measured before the piece or after it is not known."""
    at = np.arange(len(x)) + late_s
    low, high = np.floor(at).astype(int), np.ceil(at).astype(int)
    there = (low >= max(late_s, 0.0)) & (high < len(x))
    return np.where(there, (x[np.clip(low, 0, len(x) - 1)] + x[np.clip(high, 0, len(x) - 1)]) / 2, np.nan)


@pytest.mark.parametrize("late_s", [0.0, 0.5, 1.0, 3.0, -0.5, -1.0, -2.0])
@pytest.mark.parametrize("cut", CUTS)
def test_a_late_column_is_put_back_within_its_piece(tmp_path: Path, late_s: float, cut: str) -> None:
    rng = np.random.default_rng(1)
    table = {"v": np.full(12, 9.0), "fuel": rng.uniform(1, 5, 12), "h": rng.uniform(0, 3, 12)}
    table |= {"h": table["h"] + 50.0 * JUMPED * (cut == "a jump"), "t": np.arange(12.0) + 5.0 * JUMPED}
    channels = {
        "engine_command": {"column": "fuel", "unit": "g/s", "late_s": late_s},
        "fuel_rate": {"column": "fuel", "unit": "g/s", "density": 1.0},
        "elevation": {"column": "h", "unit": "m", "late_s": late_s},
    }
    pieces = late(tmp_path, table, channels, **CUTS[cut])
    assert [len(piece) for piece in pieces] == ([12] if cut == "one piece" else [6, 6])
    begin = 0
    for piece in pieces:
        rows = slice(begin, begin := begin + len(piece))
        for channel, column in (("engine_command", "fuel"), ("elevation", "h")):
            expected = put_back(table[column][rows], late_s)
            np.testing.assert_allclose(piece.channels[channel], expected, err_msg=channel)
        np.testing.assert_allclose(piece.channels["fuel_rate"], table["fuel"][rows])
        said = [note for note in piece.notes if f"is stamped {late_s:g} s late and was put back" in note]
        assert len(said) == 2 * (late_s != 0.0)
        lost = [note for note in piece.notes if "outside their piece once put back by late_s" in note]
        assert len(lost) == 2 * (late_s > 0.0 or (cut == "a jump" and late_s <= -1.0))


@pytest.mark.parametrize("late_s", [2.0, 1.0, 0.5, -0.5, -1.0])
def test_a_late_speed_moves_the_clock_and_stays_in_its_piece(tmp_path: Path, late_s: float) -> None:
    table = {"v": np.where(JUMPED, 20.0, 5.0), "h": np.where(JUMPED, 20.0, 5.0), "T": np.arange(12.0)}
    channels = {
        "speed": {"column": "v", "unit": "m/s", "late_s": late_s},
        "elevation": {"column": "h", "unit": "m"},
        "ambient_temperature": {"column": "T", "unit": "degC"},
    }
    pieces = late(tmp_path, table, channels, time=RATE, split_at={"speed_step": 2.5})
    assert [len(piece) for piece in pieces] == [6 - int(np.ceil(abs(late_s)))] * 2
    for piece, value in zip(pieces, (5.0, 20.0), strict=True):
        assert set(piece.channels["speed"]) == {value}
        height = piece.channels["elevation"]
        assert set(height[~np.isnan(height)]) == {value}
        if late_s > 0.0 and late_s == int(late_s):
            begin = 6.0 * (value == 20.0)
            np.testing.assert_allclose(piece.channels["ambient_temperature"], begin + np.arange(len(piece)))


def test_a_late_column_that_most_rows_leave_blank(tmp_path: Path) -> None:
    table = {"v": np.full(40, 9.0), "T": [k if k % 4 == 0 else "" for k in range(40)]}
    channels = {"ambient_temperature": {"column": "T", "unit": "degC", "late_s": 1.0}}
    (recording,) = late(tmp_path, table, channels, time=RATE)
    np.testing.assert_allclose(recording.channels["ambient_temperature"][3:36], np.arange(4, 37))
    assert np.isnan(recording.channels["ambient_temperature"][36:]).all()
