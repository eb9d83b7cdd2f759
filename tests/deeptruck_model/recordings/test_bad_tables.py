"""What cannot be imported: one line, and nothing is left behind."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from csv_tables import SPEED, write_csv

from deeptruck_core.errors import InputError
from deeptruck_model.recordings import import_table


def of_speed(**keys: Any) -> dict[str, Any]:
    """Columns with other keys of speed."""
    return {"channels": {"speed": {"column": "v", "unit": "m/s", **keys}}}


V = "v\n1\n2\n"
RATE = {"rate_hz": 1}
BAD: list[tuple[str, dict[str, Any], str]] = [  # a table, what its columns have but for RATE and SPEED
    (V, {"time": None}, "'time' is missing"),
    (V, {"time": {"rate_hz": 0}}, "time.rate_hz: 0 is less"),
    (V, {"channels": None}, "'channels' is missing"),
    (V, {"channels": {"gap": {"column": "v", "unit": "m"}}}, "at least 'speed"),
    (V, {"channels": {**SPEED, "mass": {"column": "v"}}}, "unknown key 'mass'.* under 'extra'"),
    ("w\n1\n2\n", {}, "no column 'v'; there is: w"),
    (V, {"time": {"column": "t"}}, "no column 't'"),
    (V, of_speed(unit="rpm"), "does not fit"),
    (V, {"channels": {"speed": {"column": "v"}}}, "speed: 'unit' is missing.* as in {column: v, unit"),
    (V, {"channels": {"speed": {"unit": "m/s"}}}, "channels.speed: 'column' is missing"),
    (V, of_speed(late_s=True), "late_s: True is not of type 'number'"),
    (V, of_speed(late_s=None), "late_s: is empty"),
    (V, of_speed(late_s=float("nan")), "late_s: nan is not of type 'number'"),
    (V, of_speed(late_s=10.5), "late_s: 10.5 is greater than the maximum of 10"),
    (V, of_speed(late=1.0), "speed: unknown key 'late'; did you mean late_s"),
    (V, {"seperator": ";"}, "unknown key 'seperator'"),
    (V, {"time": {"colum": "t"}}, "time: unknown key 'colum'"),
    (V, {"delimiter": ";;"}, "one character"),
    (V, {"skip_rows": -1}, "skip_rows"),
    (V, {"split_at": {"elevation_step": 4}}, "no column is named"),
    (V, {"split_at": {"speed_step": 0}}, "speed_step: 0 is less"),
    ("t,v\n0,1\n1,2\n", {"time": {"column": "t", "unit": "weeks"}}, "time.unit: 'weeks' is not one of"),
    ("t,v\n0,1\n,2\n1,3\n", {"time": {"column": "t"}}, "1 rows have no time in 't', first line 3"),
    ("v\nx\ny\nz\nx\n", {}, "column 'v' holds no numbers"),
    ("v\n1\n", {}, "has one row"),
    ("v\n", {}, "is empty"),
    ("", {}, "cannot be read|is empty"),
    ("Dear reader\nthis, then, is prose\nand, as such, no table\n", {},
     "its header has 1 cell, and none of the 2 rows below has as many; set 'delimiter'"),
    ("v\n100\n200\n", {}, "is its unit right"),
    ("v;µ\n1;2\n", {"encoding": "klingon"}, "cannot be read"),
]  # fmt: skip


@pytest.mark.parametrize(("text", "columns", "match"), BAD, ids=[match for _, _, match in BAD])
def test_bad_input_is_one_line_and_leaves_nothing(
    tmp_path: Path, text: str, columns: dict[str, Any], match: str
) -> None:
    (tmp_path / "drive.csv").write_text(text)
    with pytest.raises(InputError, match=match) as caught:
        given = {"time": RATE, "channels": SPEED, **columns}
        meaning = {key: value for key, value in given.items() if value is not None}
        import_table(tmp_path / "drive.csv", meaning, tmp_path / "bag")
    assert "\n" not in str(caught.value)
    assert [p.name for p in tmp_path.iterdir()] == ["drive.csv"]


def test_files_that_are_not_there(tmp_path: Path) -> None:
    columns = {"time": RATE, "channels": SPEED}
    for name in ("drive.csv", "drive.parquet", "drive.log"):
        with pytest.raises(InputError, match="does not exist"):
            import_table(tmp_path / name, columns, tmp_path / "bag")
    table = write_csv(tmp_path / "drive.csv", {"v": [1, 2, 3]})
    with pytest.raises(InputError, match=r"columns.yaml cannot be read"):
        import_table(table, tmp_path / "columns.yaml", tmp_path / "bag")
    (tmp_path / "bag").mkdir()
    (tmp_path / "bag" / "mine").touch()
    with pytest.raises(InputError, match="holds mine"):
        import_table(table, columns, tmp_path / "bag")


def test_a_bag_is_not_imported_by_columns(tmp_path: Path) -> None:
    """Neither as a table nor, where its suffix is that of a CAN log, as such; it needs a topic map."""
    bag = write_csv(tmp_path / "drive.csv", {"v": np.full(50, 5.0)})
    meaning = {"time": {"rate_hz": 10}, "channels": SPEED}
    import_table(bag, meaning, tmp_path / "bag")
    (file,) = (tmp_path / "bag").glob("*.mcap")
    for source, says in (
        (tmp_path / "bag", "is no table: a bag is converted by a topic map"),
        (file, "describe a table .* a bag is"),
    ):
        with pytest.raises(InputError, match=says) as error:
            import_table(source, meaning, tmp_path / "out")
        assert "\n" not in str(error.value) and not (tmp_path / "out").exists()
