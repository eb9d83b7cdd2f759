from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet

from deeptruck_model.errors import InputError
from deeptruck_model.recordings import Recording, import_table, importing, read
from deeptruck_model.signals import CHANNELS, TruckInterface

DATA = Path(os.environ.get("DEEPTRUCK_REAL_DATA", Path(__file__).parents[4] / "shared" / "data"))
SPEED = {"speed": {"column": "v", "unit": "m/s"}}
EVERYTHING = {
    "time": {"column": "t", "unit": "s"},
    "channels": {
        "speed": {"column": "v", "unit": "km/h"},
        "acceleration": {"column": "a", "unit": "m/s^2"},
        "engine_command": {"column": "E_cmd", "unit": "percent"},
        "brake_command": {"column": "B_cmd", "unit": "bar"},
        "grade": {"column": "grade", "unit": "percent"},
        "fuel_rate": {"column": "fuel", "unit": "g/s", "density": 0.8},
        "gear": {"column": "gear"},
        "engine_speed": {"column": "rpm", "unit": "rpm"},
        "engine_torque": {"column": "T_e", "unit": "N m"},
        "elevation": {"column": "h", "unit": "m"},
        "gap": {"column": "gap", "unit": "m"},
        "leader_speed": {"column": "v_lead", "unit": "m/s"},
        "ambient_temperature": {"column": "T", "unit": "degC"},
    },
}


def write_csv(path: Path, columns: dict[str, Any], delimiter: str = ",", encoding: str = "utf-8") -> Path:
    rows = [
        delimiter.join(columns),
        *(delimiter.join(map(str, row)) for row in zip(*columns.values(), strict=True)),
    ]
    path.write_text("\n".join(rows) + "\n", encoding=encoding)
    return path


def everything(count: int = 400) -> dict[str, np.ndarray[Any, Any]]:
    rng = np.random.default_rng(0)
    columns = {"t": np.round(5 + 0.1 * np.arange(count), 3), "v": 36 + rng.uniform(0, 9, count)}
    for name in ("a", "E_cmd", "B_cmd", "grade", "fuel", "T_e", "h", "v_lead", "T"):
        columns[name] = rng.uniform(0.1, 1.0, count)
    columns |= {"gear": rng.integers(1, 12, count), "rpm": rng.uniform(600, 2000, count)}
    return columns | {"gap": np.round(rng.uniform(5, 50, count) * 8) / 8}


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
    assert recording.notes == ()


def test_speed_alone_is_enough(tmp_path: Path) -> None:
    table = write_csv(tmp_path / "drive.csv", {"v": np.arange(20.0)})
    import_table(table, {"time": {"rate_hz": 2.0}, "channels": SPEED}, tmp_path / "bag")
    (recording,) = read(tmp_path / "bag")
    assert recording.dt == 0.5
    np.testing.assert_array_equal(recording.channels["acceleration"], 2.0)
    assert recording.interface == TruckInterface("drive", brake_unit=None, grade=False, fuel=False)
    assert recording.notes == ("acceleration derived from speed",)


def test_a_table_keeps_its_own_rate(tmp_path: Path) -> None:
    table = write_csv(tmp_path / "drive.csv", {"t": np.arange(1000) * 10, "v": np.linspace(0, 10, 1000)})
    import_table(table, {"time": {"column": "t", "unit": "ms"}, "channels": SPEED}, tmp_path / "bag")
    (fast,) = read(tmp_path / "bag", rate_hz=100.0)
    np.testing.assert_array_equal(fast.channels["speed"], np.linspace(0, 10, 1000))
    assert read(tmp_path / "bag")[0].dt == 0.1


@pytest.mark.parametrize(
    ("unit", "cells"),
    [
        ("s", ["0.5", "1.5", "2.5", "3.5"]),
        ("ms", ["500", "1500", "2500", "3500"]),
        ("us", ["0", "1e6", "2e6", "3e6"]),
        ("ns", ["0", "1000000000", "2000000000", "3000000000"]),
        ("min", [f"{k / 60:.15f}" for k in range(4)]),
        ("iso", [f"2026-03-29 00:59:{57 + k}" for k in range(3)] + ["2026-03-29 01:00:00"]),
        ("datetime", [f"2026-03-29T00:59:0{k}+02:00" for k in range(4)]),
    ],
)
def test_clocks(tmp_path: Path, unit: str, cells: list[str]) -> None:
    table = write_csv(tmp_path / "drive.csv", {"t": cells, "v": [1, 2, 3, 4]})
    done = import_table(table, {"time": {"column": "t", "unit": unit}, "channels": SPEED}, tmp_path / "bag")
    (recording,) = done.recordings
    assert recording.dt == 1.0
    np.testing.assert_allclose(recording.channels["speed"], [1, 2, 3, 4], atol=1e-9)


def test_a_parquet_clock_of_timestamps(tmp_path: Path) -> None:
    stamps = np.datetime64("2026-01-01T00:00:00", "ms") + np.arange(50) * 100
    parquet.write_table(pa.table({"t": stamps, "v": np.arange(50.0)}), tmp_path / "drive.parquet")
    columns = {"time": {"column": "t", "unit": "datetime"}, "channels": SPEED}
    (recording,) = import_table(tmp_path / "drive.parquet", columns, tmp_path / "bag").recordings
    assert recording.dt == 0.1 and len(recording) == 50


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
    assert "1 non-numeric cells of ambient_temperature ('Temp [°C]') made invalid" in recording.notes
    assert "1 rows with more or fewer cells than the header left out" in recording.notes


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
    said = [note for note in recording.notes if "late" in note]
    assert said == [f"{c} is stamped {late_s:g} s late and was put back" for c in LATE if late_s]


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


def hilly() -> dict[str, np.ndarray[Any, Any]]:
    return {"v": np.full(600, 20.0), "h": 100 + 0.02 * 20.0 * np.arange(600), "T": np.arange(600) / 30}


HILLY = {
    "time": {"rate_hz": 1.0},
    "channels": {
        **SPEED,
        "elevation": {"column": "h", "unit": "m"},
        "ambient_temperature": {"column": "T", "unit": "degC"},
    },
}


def test_grade_comes_from_elevation_where_it_is_not_given(tmp_path: Path) -> None:
    import_table(write_csv(tmp_path / "drive.csv", hilly()), HILLY, tmp_path / "bag")
    (recording,) = read(tmp_path / "bag")
    np.testing.assert_allclose(recording.channels["grade"], 0.02, atol=1e-9)
    assert recording.interface.grade
    assert any("grade derived from elevation" in note for note in recording.notes)


def test_what_is_concealed_is_only_in_the_sealed_file(tmp_path: Path) -> None:
    table = write_csv(tmp_path / "drive.csv", hilly())
    done = import_table(table, {**HILLY, "conceal": ["elevation"]}, tmp_path / "bag")
    (recording,) = read(tmp_path / "bag")
    assert set(recording.channels) == {"speed", "acceleration", "ambient_temperature"}
    assert not recording.interface.grade
    assert b"elevation" not in b"".join(p.read_bytes() for p in (tmp_path / "bag").iterdir())
    assert done.sealed == tmp_path / "bag.sealed.csv"
    assert done.sha256 == hashlib.sha256(done.sealed.read_bytes()).hexdigest()
    sealed = np.genfromtxt(done.sealed, delimiter=",", skip_header=1)
    np.testing.assert_allclose(sealed[:, 0], recording.time)
    np.testing.assert_allclose(sealed[:, 1], hilly()["h"])


def test_sealed_times_are_the_bags(tmp_path: Path) -> None:
    columns = hilly()
    columns["v"][300:] = 10.0
    table = write_csv(tmp_path / "drive.csv", columns)
    meaning = {**HILLY, "split_at": {"speed_step": 2.5}, "conceal": ["elevation"]}
    done = import_table(table, meaning, tmp_path / "bag")
    time = np.concatenate([r.time for r in read(tmp_path / "bag")])
    assert done.sealed is not None
    np.testing.assert_allclose(np.genfromtxt(done.sealed, delimiter=",", skip_header=1)[:, 0], time)


BAD: list[tuple[str, dict[str, Any], str]] = [
    ("v\n1\n2\n", {"channels": SPEED}, "needs 'time"),
    ("v\n1\n2\n", {"time": {"rate_hz": 0}, "channels": SPEED}, "rate_hz of 'time' must be positive"),
    ("v\n1\n2\n", {"time": {"rate_hz": 1}}, "needs 'channels' with at least 'speed"),
    (
        "v\n1\n2\n",
        {"time": {"rate_hz": 1}, "channels": {"gap": {"column": "v", "unit": "m"}}},
        "at least 'speed",
    ),
    (
        "v\n1\n2\n",
        {"time": {"rate_hz": 1}, "channels": {**SPEED, "mass": {"column": "v"}}},
        "unknown channel 'mass'",
    ),
    ("w\n1\n2\n", {"time": {"rate_hz": 1}, "channels": SPEED}, "no column 'v'; there is: w"),
    ("v\n1\n2\n", {"time": {"column": "t"}, "channels": SPEED}, "no column 't'"),
    (
        "v\n1\n2\n",
        {"time": {"rate_hz": 1}, "channels": {"speed": {"column": "v", "unit": "rpm"}}},
        "does not fit",
    ),
    ("v\n1\n2\n", {"time": {"rate_hz": 1}, "channels": {"speed": {"column": "v"}}}, "'speed' needs a unit"),
    ("v\n1\n2\n", {"time": {"rate_hz": 1}, "channels": {"speed": {"unit": "m/s"}}}, "'speed' needs a column"),
    *(
        (
            "v\n1\n2\n",
            {"time": {"rate_hz": 1}, "channels": {"speed": {"column": "v", "unit": "m/s", key: value}}},
            match,
        )
        for key, value, match in (
            ("late_s", "1 s", "late_s of 'speed' must be a number, not '1 s'"),
            ("late_s", True, "late_s of 'speed' must be a number, not True"),
            ("late_s", None, "late_s of 'speed' must be a number, not None"),
            ("late_s", float("nan"), "late_s of 'speed' must be at most 10 s either way, not nan"),
            ("late_s", float("-inf"), "late_s of 'speed' must be at most 10 s either way, not -inf"),
            ("late_s", 10.5, "late_s of 'speed' must be at most 10 s either way, not 10.5"),
            ("late", 1.0, "channel 'speed' has unknown keys: late; known: column, density, late_s"),
        )
    ),
    ("v\n1\n2\n", {"time": {"rate_hz": 1}, "channels": SPEED, "seperator": ";"}, "unknown keys: seperator"),
    ("v\n1\n2\n", {"time": {"rate_hz": 1}, "channels": SPEED, "delimiter": ";;"}, "one character"),
    ("v\n1\n2\n", {"time": {"rate_hz": 1}, "channels": SPEED, "skip_rows": -1}, "skip_rows"),
    ("v\n1\n2\n", {"time": {"rate_hz": 1}, "channels": SPEED, "conceal": ["gap"]}, "conceal names 'gap'"),
    (
        "v\n1\n2\n",
        {"time": {"rate_hz": 1}, "channels": SPEED, "conceal": ["speed"]},
        "speed cannot be concealed",
    ),
    (
        "v\n1\n2\n",
        {"time": {"rate_hz": 1}, "channels": SPEED, "split_at": {"elevation_step": 4}},
        "no column is named",
    ),
    (
        "v\n1\n2\n",
        {"time": {"rate_hz": 1}, "channels": SPEED, "split_at": {"speed_step": 0}},
        "must be positive",
    ),
    (
        "t,v\n0,1\n1,2\n",
        {"time": {"column": "t", "unit": "days"}, "channels": SPEED},
        "unit 'days' of 'time'",
    ),
    ("t,v\n0,1\n2,2\n1,3\n", {"time": {"column": "t"}, "channels": SPEED}, "time goes back by 1 s in line 4"),
    ("t,v\n0,1\n1,2\n1,3\n", {"time": {"column": "t"}, "channels": SPEED}, "time comes twice in line 4"),
    (
        "t,v\n0,1\n,2\n1,3\n",
        {"time": {"column": "t"}, "channels": SPEED},
        "1 rows have no time in 't', first line 3",
    ),
    ("v\nx\ny\n", {"time": {"rate_hz": 1}, "channels": SPEED}, "column 'v' holds no numbers"),
    ("v\n1\n", {"time": {"rate_hz": 1}, "channels": SPEED}, "has one row"),
    ("v\n", {"time": {"rate_hz": 1}, "channels": SPEED}, "is empty"),
    ("", {"time": {"rate_hz": 1}, "channels": SPEED}, "cannot be read|is empty"),
    ("v\n100\n200\n", {"time": {"rate_hz": 1}, "channels": SPEED}, "is its unit right"),
    ("v;µ\n1;2\n", {"time": {"rate_hz": 1}, "channels": SPEED, "encoding": "klingon"}, "cannot be read"),
]


@pytest.mark.parametrize(("text", "columns", "match"), BAD, ids=[match for _, _, match in BAD])
def test_bad_input_is_one_line_and_leaves_nothing(
    tmp_path: Path, text: str, columns: dict[str, Any], match: str
) -> None:
    (tmp_path / "drive.csv").write_text(text)
    with pytest.raises(InputError, match=match) as caught:
        import_table(tmp_path / "drive.csv", columns, tmp_path / "bag")
    assert "\n" not in str(caught.value)
    assert [p.name for p in tmp_path.iterdir()] == ["drive.csv"]


def test_a_wrong_encoding_says_so(tmp_path: Path) -> None:
    table = write_csv(tmp_path / "drive.csv", {"v °": [1, 2]}, encoding="latin-1")
    with pytest.raises(InputError, match="is not in utf-8; set 'encoding'"):
        import_table(table, {"time": {"rate_hz": 1}, "channels": SPEED}, tmp_path / "bag")


def test_files_that_are_not_there(tmp_path: Path) -> None:
    columns = {"time": {"rate_hz": 1}, "channels": SPEED}
    for name in ("drive.csv", "drive.parquet", "drive.log"):
        with pytest.raises(InputError, match="does not exist"):
            import_table(tmp_path / name, columns, tmp_path / "bag")
    table = write_csv(tmp_path / "drive.csv", {"v": [1, 2, 3]})
    with pytest.raises(InputError, match=r"columns.yaml cannot be read"):
        import_table(table, tmp_path / "columns.yaml", tmp_path / "bag")
    (tmp_path / "bag").mkdir()
    with pytest.raises(InputError, match="exists already"):
        import_table(table, columns, tmp_path / "bag")


def test_a_failed_bag_takes_its_sealed_file_along(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*_: object, **__: object) -> None:
        raise InputError("disk full")

    monkeypatch.setattr(importing, "write_bag", fails)
    table = write_csv(tmp_path / "drive.csv", hilly())
    with pytest.raises(InputError, match="disk full"):
        import_table(table, {**HILLY, "conceal": ["elevation"]}, tmp_path / "bag")
    assert [p.name for p in tmp_path.iterdir()] == ["drive.csv"]


Importer = Callable[[Path, dict[str, Any]], Any]


def test_can_logs_go_to_the_installed_importer(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Channels of a bus come at rates of their own and become one clock."""
    seen: list[Any] = []

    def importer(log: Path, columns: dict[str, Any]) -> Any:
        seen.append((log, columns))
        fast, slow = 100.0 + np.arange(500) / 50, 100.003 + np.arange(100) / 10
        channels = {"speed": (slow, slow - 100), "engine_torque": (fast, 10 * (fast - 100))}
        return channels, TruckInterface("csu", brake_unit=None, grade=False, fuel=False).to_dict()

    monkeypatch.setattr(importing, "_can_importer", lambda: importer)
    log = tmp_path / "normal.log"
    log.touch()
    import_table(log, {"vehicle": "any", "name": "csu"}, tmp_path / "bag")
    assert seen == [(log, {"vehicle": "any", "name": "csu"})]
    (recording,) = read(tmp_path / "bag")
    assert recording.dt == 0.1 and recording.interface.name == "csu"
    torque, speed = recording.channels["engine_torque"], recording.channels["speed"]
    valid = ~np.isnan(torque)
    assert valid.sum() >= 99
    np.testing.assert_allclose(torque[valid], 10 * speed[valid], atol=1e-9)


def test_a_bag_is_not_imported(tmp_path: Path) -> None:
    """Neither as a table nor, where its suffix is that of a CAN log, with the columns of one."""
    bag = write_csv(tmp_path / "drive.csv", {"v": np.full(50, 5.0)})
    meaning = {"time": {"rate_hz": 10}, "channels": SPEED}
    import_table(bag, meaning, tmp_path / "bag")
    (file,) = (tmp_path / "bag").glob("*.mcap")
    for source, says in (
        (tmp_path / "bag", "is no table: a bag is not"),
        (file, "describe a table .* a bag is"),
    ):
        with pytest.raises(InputError, match=says) as error:
            import_table(source, meaning, tmp_path / "out")
        assert "\n" not in str(error.value) and not (tmp_path / "out").exists()


def test_an_importers_complaint_is_the_users_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def importer(log: Path, columns: dict[str, Any]) -> Any:
        raise ValueError("no vehicle speed")

    monkeypatch.setattr(importing, "_can_importer", lambda: importer)
    (tmp_path / "normal.log").touch()
    with pytest.raises(InputError, match="no vehicle speed"):
        import_table(tmp_path / "normal.log", {}, tmp_path / "bag")


def test_the_installed_importer_reads_a_real_bus(tmp_path: Path) -> None:
    log = DATA / "j1939_csu" / "normal.log"
    if not log.exists():
        pytest.skip(f"{log} is not here")
    import_table(log, {"name": "csu"}, tmp_path / "bag")
    (recording,) = read(tmp_path / "bag")
    assert recording.channels["speed"].min() > 6.3 and recording.channels["speed"].max() < 15.3
    assert {"engine_speed", "gear"} <= set(recording.channels)


def test_every_channel_can_be_imported() -> None:
    """The contract names them all but latitude and longitude, which are ours."""
    assert set(EVERYTHING["channels"]) | {"latitude", "longitude"} == set(CHANNELS)
