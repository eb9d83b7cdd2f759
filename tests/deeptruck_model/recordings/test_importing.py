"""A table becomes a bag: channels, clocks, units, pieces."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from csv_tables import EVERYTHING, SPEED, everything, write_csv
from pyarrow import parquet

from deeptruck_core.signals import CHANNELS, FAULTS, TruckInterface
from deeptruck_model.recordings import import_table, read
from deeptruck_model.recordings.consistency import sensors


@pytest.mark.parametrize("kind", ["csv", "parquet"])
def test_every_channel_of_the_contract(tmp_path: Path, kind: str) -> None:
    columns = everything()
    if kind == "csv":
        table = write_csv(tmp_path / "drive.csv", columns)
    else:
        table = tmp_path / "drive.parquet"
        parquet.write_table(pa.table(columns), table)
    import_table(table, EVERYTHING, tmp_path / "bag")
    (recording,) = read(tmp_path / "bag")
    assert recording.interface == TruckInterface("drive", engine_unit="percent", brake_unit="bar")
    expected = {
        "speed": columns["v"] / 3.6,
        "acceleration": columns["a"],
        "engine_command": columns["E_cmd"],
        "brake_command": columns["B_cmd"],
        "grade": columns["grade"] / 100,
        "fuel_rate": columns["fuel"] / 0.8,
        "gear": columns["gear"],
        "engine_speed": columns["rpm"] * np.pi / 30,
        "engine_torque": columns["T_e"],
        "elevation": columns["h"],
        "gap": columns["gap"],
        "leader_speed": columns["v_lead"],
        "ambient_temperature": columns["T"],
    }
    assert set(recording.channels) == set(expected)
    for name, values in expected.items():
        np.testing.assert_allclose(recording.channels[name], values, rtol=1e-12, err_msg=name)
    doubts = [doubt.says for doubt in sensors.doubts([recording])]  # of numbers drawn by chance
    assert recording.notes == (f"imported from the table {table.name}", *doubts)


def test_speed_alone_is_enough(tmp_path: Path) -> None:
    table = write_csv(tmp_path / "drive.csv", {"v": np.arange(20.0)})
    import_table(table, {"time": {"rate_hz": 2.0}, "channels": SPEED}, tmp_path / "bag")
    (recording,) = read(tmp_path / "bag")
    assert recording.dt == 0.5
    np.testing.assert_array_equal(recording.channels["acceleration"], 2.0)
    assert recording.interface == TruckInterface("drive", brake_unit=None, grade=False, fuel=False)
    assert recording.notes == ("imported from the table drive.csv", "acceleration derived from speed")


def test_a_table_keeps_its_own_rate(tmp_path: Path) -> None:
    table = write_csv(tmp_path / "drive.csv", {"t": np.arange(1000) * 10, "v": np.linspace(0, 10, 1000)})
    import_table(table, {"time": {"column": "t", "unit": "ms"}, "channels": SPEED}, tmp_path / "bag")
    (fast,) = read(tmp_path / "bag", rate_hz=100.0)
    np.testing.assert_array_equal(fast.channels["speed"], np.linspace(0, 10, 1000))
    assert read(tmp_path / "bag")[0].dt == 0.1


def test_jumps_cut(tmp_path: Path) -> None:
    speed = [5, 5.5, 6, 6.5, 12, 12, 12, 12, 12, 12]
    height = [10, 10, 10, 10, 10, 10, 10, 20, 20, 20]
    table = write_csv(tmp_path / "drive.csv", {"v": speed, "h": height})
    columns = {
        "time": {"rate_hz": 1.0},
        "split_at": {"speed_step": 2.5, "elevation_step": 4.0},
        "channels": {**SPEED, "elevation": {"column": "h", "unit": "m"}},
    }
    import_table(table, columns, tmp_path / "bag")
    pieces = read(tmp_path / "bag")
    assert [r.channels["speed"].tolist() for r in pieces] == [[5, 5.5, 6, 6.5], [12, 12, 12], [12, 12, 12]]
    assert [set(r.channels["elevation"]) for r in pieces] == [{10}, {10}, {20}]


def test_every_channel_can_be_imported() -> None:
    """The contract names them all but position, brake switch, specific force and faults, which are ours."""
    ours = {"latitude", "longitude", "brake_switch", "specific_force", *FAULTS}
    assert set(EVERYTHING["channels"]) | ours == set(CHANNELS)
