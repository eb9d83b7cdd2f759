"""A table of recordings is what they hold, and other programs read it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pyarrow import csv, parquet

from deeptruck_core.errors import InputError
from deeptruck_model import trucks
from deeptruck_model.recordings import Recording, import_table, read, write_table
from deeptruck_model.trucks import driving_cycles

TRUCK = trucks.load("trucksim")


@pytest.fixture(scope="module")
def drives() -> list[Recording]:
    first, second = (driving_cycles.drive(TRUCK, seconds=20.0 + 5 * k, seed=k) for k in range(2))
    holed = second.channels["speed"].copy()
    holed[10:13] = np.nan
    gap = {"gap": np.full(len(second), 30.0)}
    return [first, replace(second, name="second", channels=second.channels | {"speed": holed} | gap)]


@pytest.mark.parametrize("ending", [".csv", ".parquet"])
def test_a_row_is_a_sample_and_what_is_not_valid_is_empty(
    drives: list[Recording], tmp_path: Path, ending: str
) -> None:
    path = write_table(tmp_path / f"drives{ending}", drives)
    table = csv.read_csv(path) if ending == ".csv" else parquet.read_table(path)
    first, second = drives
    assert table.column_names[:4] == ["recording", "time", "speed", "acceleration"]
    assert table.num_rows == len(first) + len(second)
    assert table["speed"].null_count == 3 and table["gap"].null_count == len(first)
    of_second = table.filter(table["recording"].to_numpy(zero_copy_only=False) == "second")
    assert np.allclose(of_second["time"].to_numpy(), second.time)
    told = of_second["speed"].to_numpy()
    assert np.allclose(told, second.channels["speed"], equal_nan=True)


def test_parquet_says_the_units(drives: list[Recording], tmp_path: Path) -> None:
    schema = parquet.read_schema(write_table(tmp_path / "drives.parquet", drives))
    units = {field.name: field.metadata[b"unit"].decode() for field in schema if field.metadata}
    assert units["time"] == "s" and units["acceleration"] == "m/s^2" and units["gap"] == "m"
    assert units["engine_command"] == TRUCK.interface.engine_unit


def test_a_table_can_be_imported_again(drives: list[Recording], tmp_path: Path) -> None:
    table = write_table(tmp_path / "drive.csv", drives[:1])
    (tmp_path / "columns.yaml").write_text(
        "time: {column: time, unit: s}\nchannels:\n  speed: {column: speed, unit: m/s}\n"
        "  acceleration: {column: acceleration, unit: m/s^2}\n"
    )
    import_table(table, tmp_path / "columns.yaml", tmp_path / "bag")
    (again,) = read(tmp_path / "bag")
    assert np.allclose(again.channels["speed"], drives[0].channels["speed"], atol=1e-6)


def test_no_table_of_another_kind_and_none_over_another(drives: list[Recording], tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"must end on \.csv or \.parquet"):
        write_table(tmp_path / "drives.xlsx", drives)
    with pytest.raises(InputError, match="no recording"):
        write_table(tmp_path / "drives.csv", [])
    path = write_table(tmp_path / "drives.csv", drives)
    before = path.read_bytes()
    with pytest.raises(InputError, match="exists"):
        write_table(path, drives[:1])
    assert path.read_bytes() == before
