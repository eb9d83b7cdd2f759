"""Tables as people have them: which rows are samples, and that the account of all others is right."""

from __future__ import annotations

import gzip
import math
import time
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet

from deeptruck_core.errors import InputError
from deeptruck_core.json_data import to_json
from deeptruck_model.recordings import import_table
from deeptruck_model.recordings.tables.column import floats
from deeptruck_model.recordings.tables.csv_text import BLANK, RAGGED, UNCLOSED, Format
from deeptruck_model.recordings.tables.table import ABOVE, SHOWN
from deeptruck_model.recordings.tables.table_file import read_curve, read_table

COLUMNS = {"time": {"column": "t", "unit": "s"}, "channels": {"speed": {"column": "v", "unit": "m/s"}}}
NO_TIME = "without a time in 't'"
ROWS = [f"{k / 10:.1f},{10 + k % 3}" for k in range(30)]


def account(tmp_path: Path, lines: list[str]) -> dict[str, tuple[int, str]]:
    """What an import sets aside, by reason; all else is used."""
    table = tmp_path / "drive.csv"
    table.write_text("\n".join(lines) + "\n")
    found = import_table(table, COLUMNS, tmp_path / "bag").recordings[0].account
    assert found is not None and found.balanced
    return {reason: (entry.count, entry.first) for reason, entry in found.total.aside.items()}


@pytest.mark.parametrize(
    ("lines", "aside"),
    [
        (["t,v", "s,m/s", *ROWS], {ABOVE: (1, "line 2")}),
        (["t,v", "[s],[m/s]", "float,float", *ROWS], {ABOVE: (2, "line 2")}),
        (["t,v", *ROWS, "Total,310", "Mean:,11.0"], {NO_TIME: (2, "line 32")}),
        (
            ["n,t,v", *(f"{k},{row}" for k, row in enumerate(ROWS)), "Mittelwert,1.5,11"],
            {"outside the pieces": (1, "line 32")},
        ),
        (["t,v", *ROWS[:9], "t,v", *ROWS[9:]], {NO_TIME: (1, "line 11")}),
        (["t,v", *ROWS[:9], ",", "", *ROWS[9:]], {BLANK: (1, "line 11")}),
        (["t,v", *ROWS[:9], "", *ROWS[9:], "t,v"], {NO_TIME: (1, "line 33")}),
        (["t,v", *ROWS[:9], "0.9", "MARK 001", *ROWS[10:]], {RAGGED: (2, "line 11")}),
        (["t,v", *ROWS[:9], "?,11", *ROWS[10:]], {NO_TIME: (1, "line 11")}),
        (["t,v", *ROWS[:9], ',"11', *ROWS[10:20], '2.0,12"', *ROWS[21:]], {UNCLOSED: (2, "line 11")}),
        (["t,v", *ROWS[:9], '0.9,11,"a', 'b"', *ROWS[10:]], {UNCLOSED: (2, "line 11")}),
        (
            ["t,v", *ROWS[:9], '0"9,"11', '1.0,12","9,"', *ROWS[11:]],
            {UNCLOSED: (1, "line 12"), NO_TIME: (1, "line 11")},
        ),
        (["t,v,", *ROWS], {}),
        (["t,v", *(f"{row},," for row in ROWS)], {}),
        (["t,v", *(row + "," * (k % 3) for k, row in enumerate(ROWS))], {}),
        (["t,v", *(row + "," * (k % 4 > 0) for k, row in enumerate(ROWS))], {}),
        (["t,v,", *(f"{row}," for row in ROWS), "9,9,9"], {"outside the pieces": (1, "line 32")}),
        (["sep=;", "t;v", *(row.replace(",", ";") for row in ROWS)], {}),
        (["t\tv", *(row.replace(",", "\t") for row in ROWS)], {}),
    ],
)
def test_rows_that_are_no_samples(
    tmp_path: Path, lines: list[str], aside: dict[str, tuple[int, str]]
) -> None:
    found = account(tmp_path, lines)
    assert {reason.partition(",")[0]: entry for reason, entry in found.items()} == aside


def test_units_above_a_table_without_a_clock(tmp_path: Path) -> None:
    (tmp_path / "d.csv").write_text("v,gear\nkm/h,1\n" + "36,3\n" * 20)
    columns = {"time": {"rate_hz": 10}, "channels": {"speed": {"column": "v", "unit": "km/h"}}}
    (recording,) = import_table(tmp_path / "d.csv", columns, tmp_path / "bag").recordings
    assert recording.account is not None and recording.account.total.aside[ABOVE].count == 1
    np.testing.assert_allclose(recording.channels["speed"], np.full(20, 10.0))


@pytest.mark.parametrize(
    ("columns", "there"),
    [
        (["t", "v", "grade"], "t, v, grade"),
        ([*(f"{k}" for k in range(SHOWN)), "grade"], f"grade, and {SHOWN} more"),
    ],
)
def test_few_columns_are_all_named_and_of_many_the_nearest(
    tmp_path: Path, columns: list[str], there: str
) -> None:
    (tmp_path / "d.csv").write_text(",".join(columns) + "\n" + ",".join("0" for _ in columns) + "\n")
    with pytest.raises(InputError, match=rf"has no column 'grades'; there is: {there}$"):
        read_table(tmp_path / "d.csv")["grades"]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("t;v\n0;10\n1;10,5\n2;11\n", [10.0, 10.5, 11.0]),
        ("t;v\n0;1,500\n1;2,500\n", [1.5, 2.5]),
        ('t,v\n0,"1,500"\n1,"0,750"\n', [1.5, 0.75]),
        ("t;v\n0;10,5 km/h\n1;11,5 km/h\n", [10.5, 11.5]),
    ],
)
def test_the_decimal_mark_is_found(tmp_path: Path, text: str, expected: list[float]) -> None:
    (tmp_path / "drive.csv").write_text(text)
    assert read_table(tmp_path / "drive.csv")["v"].values.tolist() == expected


def test_each_cell_is_read_in_its_own_unit(tmp_path: Path) -> None:
    cells = ["54.0 km/h", "10 m/s", "33.554 mph", "1 furlong", "", "55.0 km/h"]
    (tmp_path / "d.csv").write_text("t,v\n" + "".join(f"{k},{cell}\n" for k, cell in enumerate(cells)))
    column = read_table(tmp_path / "d.csv")["v"]
    assert column.unit == "km/h"
    assert column.values == pytest.approx([54.0, 36.0, 54.0, math.nan, math.nan, 55.0], nan_ok=True, abs=1e-3)
    assert column.unreadable.tolist() == [False, False, False, True, False, False]


def test_a_column_of_a_name_that_comes_twice_is_said(tmp_path: Path) -> None:
    (tmp_path / "drive.csv").write_text("t,v,v\n" + "".join(f"{row},5\n" for row in ROWS))
    found = import_table(tmp_path / "drive.csv", COLUMNS, tmp_path / "bag").recordings[0].account
    assert found is not None and found.remarks == ["several columns are named 'v': the first is used"]


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "latin-1"])
def test_byte_order_marks_and_encodings(tmp_path: Path, encoding: str) -> None:
    (tmp_path / "d.csv").write_bytes("t,v °\n0,1\n1,2\n".encode(encoding))
    given_encoding = "latin-1" if encoding == "latin-1" else "utf-8"
    assert read_table(tmp_path / "d.csv", Format(encoding=given_encoding)).numbers(
        "v °", "speed"
    ).tolist() == [1, 2]


def test_a_compressed_table(tmp_path: Path) -> None:
    (tmp_path / "d.csv.gz").write_bytes(gzip.compress(b"t,v\n0,1\n1,2\n"))
    assert read_table(tmp_path / "d.csv.gz").numbers("v", "speed").tolist() == [1, 2]


def test_types_of_parquet(tmp_path: Path) -> None:
    words = pa.array(["1.5", "x", None])
    columns = {
        "large": words.cast(pa.large_string()),
        "coded": words.dictionary_encode(),
        "price": pa.array(["1.5", None, "2"]).cast(pa.decimal128(9, 2)),
        "count": pa.array([1, 2**40, None], pa.uint64()),
        "on": [True, False, None],
    }
    parquet.write_table(pa.table(columns), tmp_path / "d.parquet")
    table = read_table(tmp_path / "d.parquet")
    found = {name: table.numbers(name, name).tolist() for name in columns}
    expected = {
        "large": [1.5, np.nan, np.nan],
        "coded": [1.5, np.nan, np.nan],
        "price": [1.5, np.nan, 2],
        "count": [1, 2**40, np.nan],
        "on": [1, 0, np.nan],
    }
    for name, values in expected.items():
        np.testing.assert_array_equal(found[name], values, err_msg=name)
    assert to_json(table.account.channels["coded"]) == {
        "read": 2, "used": 1, "set_aside": {"no number": {"count": 1, "first": "'x' in row 2"}},
    }  # fmt: skip


def test_what_a_curve_leaves_out_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "road.csv").write_text("distance,grade\nm,1\n0,0\n100,0.02\n")
    assert [column.tolist() for column in read_curve(tmp_path / "road.csv", "distance", "grade")] == [
        [0, 100],
        [0, 0.02],
    ]
    assert "road.csv: 3 rows read, 2 used, 1 set aside" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("cells", "expected"),
    [
        (["1.580", "46,8", "1.580,5", "980"], [1580.0, 46.8, 1580.5, 980.0]),
        (["1.580", "1.618"], [1580.0, 1618.0]),
        (["1.580.000,5", "-1.000"], [1580000.5, -1000.0]),
        (["48.137154", "48.2"], [48.137154, 48.2]),  # a column with points of its own, as coordinates are
        (["0.125", "1.580"], [0.125, 1.58]),
        (["1.5", "2,5"], [math.nan, 2.5]),  # no number, and counted as such
    ],
)
def test_points_beside_a_decimal_comma_mark_thousands(cells: list[str], expected: list[float]) -> None:
    values, unreadable = floats(pa.chunked_array([pa.array(cells)]), ",")
    assert values.tolist() == pytest.approx(expected, nan_ok=True)
    assert unreadable.tolist() == [math.isnan(value) for value in expected]


@pytest.mark.parametrize(
    ("cells", "others", "expected"),
    [
        (["1,300", "980", "12,500.5"], ["0.1", "2.5", "3.0"], [1300.0, 980.0, 12500.5]),
        (["1,300", "0,980", "2,5"], ["0.1", "2.5", "3.0"], [math.nan] * 3),
        (["7,081", "12,345", "9,100"], ["1", "2", "3"], [math.nan] * 3),  # no point shows what the comma is
    ],
)
def test_commas_mark_thousands_where_another_column_has_points(
    tmp_path: Path, cells: list[str], others: list[str], expected: list[float]
) -> None:
    rows = "".join(f'{other},"{cell}"\n' for other, cell in zip(others, cells, strict=True))
    (tmp_path / "t.csv").write_text("t,n\n" + rows)
    column = read_table(tmp_path / "t.csv")["n"]
    values, unreadable = column.values, column.unreadable
    assert values.tolist() == pytest.approx(expected, nan_ok=True)
    assert unreadable.tolist() == [math.isnan(value) for value in expected]


def test_reading_is_linear_in_rows_whatever_the_header(tmp_path: Path) -> None:
    seconds = []
    for count in (2000, 20000):
        rows = "\n".join(["a,b,c", "", *(f"{k},1,2,3" for k in range(count))])
        (path := tmp_path / f"{count}.csv").write_text(rows)
        begin = time.process_time()
        with pytest.raises(InputError, match="is no table as it is read"):
            read_table(path)
        seconds.append(time.process_time() - begin)
    assert seconds[1] < 40 * max(seconds[0], 0.02)  # ten times the rows; a hundred by the square
