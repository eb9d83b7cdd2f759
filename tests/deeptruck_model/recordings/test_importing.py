"""A table becomes a bag: channels, clocks, units, pieces."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from csv_tables import EVERYTHING, SPEED, everything, write_csv
from foreign_bags import bag_of, drive_messages
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


def test_a_bag_with_other_topics(tmp_path: Path) -> None:
    topics = {"speed": {"topic": "/truck/twist", "field": "twist.linear.x"}}
    bag = bag_of(tmp_path / "theirs", drive_messages())
    (mapped,) = import_table(bag, topics, tmp_path / "bag").recordings
    (recording,) = read(tmp_path / "bag")
    assert recording.interface == mapped.interface
    np.testing.assert_array_equal(recording.channels["speed"], mapped.channels["speed"])


def test_a_sensor_that_failed_is_no_slow_one(tmp_path: Path) -> None:
    """Temperature stands in the first 30 of 100 rows, elevation in each fifth, fuel in every other."""
    cells = {
        "v": [20.0] * 100,
        "T": [15.0] * 30 + [""] * 70,
        "h": [120.0, "", "", "", ""] * 20,
        "f": [1.0, ""] * 50,
    }
    columns = {
        **SPEED,
        "fuel_rate": {"column": "f", "unit": "g/s"},
        "ambient_temperature": {"column": "T", "unit": "degC"},
        "elevation": {"column": "h", "unit": "m"},
    }
    import_table(
        write_csv(tmp_path / "d.csv", cells),
        {"time": {"rate_hz": 10.0}, "channels": columns},
        tmp_path / "bag",
    )
    (recording,) = read(tmp_path / "bag")
    known = np.isfinite(recording.channels["ambient_temperature"])
    assert (
        known[:30].all() and not known[31:].any() and np.isfinite(recording.channels["elevation"][:96]).all()
    )
    assert "ambient_temperature is invalid in 70 rows of 100" in recording.notes
    assert "elevation taken as sampled in the 20 rows of 100 that have it" in recording.notes
    assert np.isfinite(recording.channels["fuel_rate"][:99]).all()


def test_a_table_keeps_its_own_rate(tmp_path: Path) -> None:
    table = write_csv(tmp_path / "drive.csv", {"t": np.arange(1000) * 10, "v": np.linspace(0, 10, 1000)})
    import_table(table, {"time": {"column": "t", "unit": "ms"}, "channels": SPEED}, tmp_path / "bag")
    (fast,) = read(tmp_path / "bag", rate_hz=100.0)
    np.testing.assert_array_equal(fast.channels["speed"], np.linspace(0, 10, 1000))
    assert read(tmp_path / "bag")[0].dt == 0.1


def test_files_as_people_have_them(tmp_path: Path) -> None:
    """Lines before the header, semicolons, latin-1, decimal commas, blanks, strange cells, a cut-off row."""
    table = tmp_path / "drive.csv"
    table.write_text(
        "Datei;vom 1. Mai\nnoch eine Zeile\nZeit [s]; Tempo [km/h] ;Temp [°C]\n"
        "0,0;36,0;20,5\n0,1; 36,0 ;n/a\n0,2;;20,5\n0,3;36,0;20,5\n0,4;36",
        encoding="latin-1",
    )
    columns = {
        "time": {"column": "Zeit [s]", "unit": "s"},
        "delimiter": ";",
        "encoding": "latin-1",
        "skip_rows": 2,
        "decimal": ",",
        "channels": {
            "speed": {"column": "Tempo [km/h]", "unit": "km/h"},
            "ambient_temperature": {"column": "Temp [°C]", "unit": "degC", "offset": -0.5},
        },
    }
    (recording,) = import_table(table, columns, tmp_path / "bag").recordings
    np.testing.assert_allclose(recording.channels["speed"], [10, 10, np.nan, 10])
    np.testing.assert_allclose(recording.channels["ambient_temperature"], [20, np.nan, 20, 20])
    assert "ambient_temperature: 1 of 4 samples no number, first 'n/a' in line 5" in recording.notes
    assert "1 with more or fewer cells than the header, first line 8" in recording.notes


def test_one_column_for_two_channels_with_scale(tmp_path: Path) -> None:
    table = write_csv(tmp_path / "drive.csv", {"v": np.full(9, 5.0), "fuel": np.arange(9.0)})
    channels = {
        **SPEED,
        "engine_command": {"column": "fuel", "unit": "g/s", "scale": 0.5},
        "fuel_rate": {"column": "fuel", "unit": "g/s", "density": 832},
    }
    (recording,) = import_table(
        table, {"time": {"rate_hz": 1}, "channels": channels}, tmp_path / "bag"
    ).recordings
    np.testing.assert_allclose(recording.channels["engine_command"], 0.5 * np.arange(9))
    np.testing.assert_allclose(recording.channels["fuel_rate"], np.arange(9) / 0.832)
    assert recording.interface.engine_unit == "g/s" and recording.interface.fuel


def test_rows_that_hold_one_channel_each(tmp_path: Path) -> None:
    """As logs of a bus are exported: every row has a time and one of the channels."""
    rows = [f"{k / 100},{k / 40 if k % 4 == 0 else ''},{k / 2 if k % 4 == 2 else ''}" for k in range(800)]
    (tmp_path / "drive.csv").write_text("t,v,rpm\n" + "\n".join(rows))
    channels = {**SPEED, "engine_speed": {"column": "rpm", "unit": "rad/s"}}
    columns = {"time": {"column": "t", "unit": "s"}, "channels": channels}
    (recording,) = import_table(tmp_path / "drive.csv", columns, tmp_path / "bag").recordings
    assert recording.dt == 0.04
    np.testing.assert_allclose(recording.channels["speed"], 0.1 * np.arange(200))
    np.testing.assert_allclose(recording.channels["engine_speed"][1:], 2.0 * np.arange(1, 200), rtol=1e-9)


def test_a_density_not_given_is_diesels_and_noted(tmp_path: Path) -> None:
    table = write_csv(tmp_path / "drive.csv", {"v": np.full(9, 5.0), "fuel": np.ones(9)})
    channels = {**SPEED, "fuel_rate": {"column": "fuel", "unit": "g/s"}}
    (recording,) = import_table(
        table, {"time": {"rate_hz": 1}, "channels": channels}, tmp_path / "bag"
    ).recordings
    assert recording.channels["fuel_rate"][0] == pytest.approx(1 / 0.832)
    assert any("0.832 g/cm^3" in note for note in recording.notes)


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
