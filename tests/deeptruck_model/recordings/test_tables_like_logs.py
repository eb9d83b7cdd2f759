"""Tables with several things in them: vehicles, trips, clocks without marks, units and words in cells."""

from __future__ import annotations

import re
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from csv_tables import COLUMNS, drive, speed, with_channels, write_csv

from deeptruck_core.errors import InputError
from deeptruck_model.recordings import import_table, suggest_columns
from deeptruck_model.recordings.tables.table_file import read_curve, read_table


def speeds(recordings: Any) -> Any:
    return np.concatenate([r.channels["speed"] for r in recordings])


def proposed(path: Path, folder: Path) -> Any:
    """The recordings that the proposal for a table gives."""
    columns = folder / "proposed.yaml"
    columns.write_text(suggest_columns(path).text())
    return import_table(path, columns, folder / "proposed").recordings


def two_trucks(folder: Path, stagger: float) -> Path:
    t = 0.5 * np.arange(200)
    v = np.where(np.arange(200) % 2, 90 + 5 * np.sin(t / 9), 3.6 * speed(t))
    stamps = np.where(np.arange(200) % 2, t - 0.5 + stagger, t)
    names = np.where(np.arange(200) % 2, "T-202", "T-101")
    return write_csv(
        folder / "trucks.csv", {"t": stamps, "Vehicle": names, "v": v, "Speed (km/h)": np.round(v, 2)}
    )


@pytest.mark.parametrize("stagger", [0.5, 0.0], ids=["in turn", "same stamps"])
def test_two_vehicles_are_told_and_one_is_chosen(tmp_path: Path, stagger: float) -> None:
    path = two_trucks(tmp_path, stagger)
    meaning: dict[str, Any] = {
        "time": COLUMNS["time"],
        "channels": {"speed": {"column": "v", "unit": "km/h"}},
    }
    with pytest.raises(
        InputError, match=r"'Vehicle' has 2 values \(T-101, T-202\), whose rows are inter"
    ) as error:
        import_table(path, meaning, tmp_path / "bag")
    key = yaml.safe_load(re.search(r"take one by (only: .*)", str(error.value))[1])  # type: ignore[index]
    done = import_table(path, {**meaning, **key}, tmp_path / "one")
    assert speeds(done.recordings).max() < 23.0
    other = import_table(path, {**meaning, "only": {"Vehicle": "T-202"}}, tmp_path / "other")
    assert speeds(other.recordings).min() > 23.0
    account = other.recordings[0].account
    assert account is not None and account.balanced and account.total.left_out == 100
    assert speeds(proposed(path, tmp_path)).max() < 23.0


def test_two_vehicles_without_a_column_that_names_them(tmp_path: Path) -> None:
    columns = drive()
    columns["v"][1::2] = 95.0
    with pytest.raises(InputError, match="as where two senders"):
        import_table(write_csv(tmp_path / "t.csv", columns), COLUMNS, tmp_path / "bag")


def test_a_leader_of_two_vehicles_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="column 'Vehicle' has 2 values"):
        read_curve(two_trucks(tmp_path, 0.5), over="t", of="v")


def test_a_switch_or_gear_letter_is_no_vehicle(tmp_path: Path) -> None:
    columns = {**drive(), "Gear": np.where(np.arange(600) // 7 % 2, "D", "N")}
    assert (
        len(import_table(write_csv(tmp_path / "t.csv", columns), COLUMNS, tmp_path / "bag").recordings) == 1
    )


@pytest.mark.parametrize(
    ("stamps", "pieces", "said"),
    [
        (lambda k: f"2026-10-25 02:{59 if k < 300 else 0:02d}:{30 * (k < 300) + k % 300 / 10:06.3f}",
         [300, 300], "by 3599.9 s in line 302 (the end of summer time)"),
        (lambda k: f"2026-05-04T09:15:{10 + k / 10 if k < 200 else k / 10 - 17:06.3f}"
         if k < 500 else f"2026-05-04T09:15:{k / 10 - 17:06.3f}", [200, 400], "by 26.9 s in line 202"),
    ],
    ids=["autumn", "set back"],
)  # fmt: skip
def test_a_clock_that_goes_back_begins_a_piece(
    tmp_path: Path, stamps: Any, pieces: list[int], said: str
) -> None:
    columns = {**drive(), "t": [stamps(k) for k in range(600)]}
    meaning = {**COLUMNS, "time": {"column": "t", "unit": "iso"}}
    done = import_table(write_csv(tmp_path / "t.csv", columns), meaning, tmp_path / "bag")
    assert [len(r) for r in done.recordings] == pieces
    np.testing.assert_allclose(speeds(done.recordings), columns["v"] / 3.6, rtol=1e-9)
    account = done.recordings[0].account
    assert account is not None and account.balanced and any(said in line for line in account.remarks)


def test_trips_that_begin_again_at_zero(tmp_path: Path) -> None:
    columns = {**drive(), "Trip": np.arange(600) // 200 + 1}
    columns["t"] = columns["t"] % 20
    done = import_table(write_csv(tmp_path / "t.csv", columns), COLUMNS, tmp_path / "bag")
    assert [len(r) for r in done.recordings] == [200, 200, 200]


def test_rows_in_no_order_are_refused_and_sorting_them_helps(tmp_path: Path) -> None:
    columns = drive()
    order = np.random.default_rng(0).permutation(600)
    shuffled = {name: values[order] for name, values in columns.items()}
    meaning = {**COLUMNS, "channels": {"engine_command": COLUMNS["channels"]["engine_command"],
                                       "speed": COLUMNS["channels"]["speed"]}}  # fmt: skip
    with pytest.raises(InputError, match="they are in no order; export them in the order of their time"):
        import_table(write_csv(tmp_path / "a.csv", shuffled), meaning, tmp_path / "a")
    assert (
        len(import_table(write_csv(tmp_path / "b.csv", columns), meaning, tmp_path / "b").recordings[0])
        == 600
    )


def test_a_few_stray_swapped_and_doubled_stamps_are_counted(tmp_path: Path) -> None:
    columns = drive()
    columns["t"][300] = 4000.0
    columns["t"][100], columns["t"][101] = columns["t"][101], columns["t"][100]
    columns["t"][500] = columns["t"][499]
    columns["v"][100], columns["v"][101] = columns["v"][101], columns["v"][100]
    (r,) = import_table(write_csv(tmp_path / "t.csv", columns), COLUMNS, tmp_path / "bag").recordings
    assert r.account is not None and r.account.balanced
    reasons = {reason: entry.count for reason, entry in r.account.total.aside.items()}
    assert reasons == {"stamped far off their neighbours": 1, "with a repeated time": 1}
    assert any("1 rows put back in the order of their times" in line for line in r.account.remarks)
    off = np.abs(r.channels["speed"] - speed(r.time))
    assert off.max() < 0.11 and (off > 0.02).sum() <= 2  # where the last of two samples counts


@pytest.mark.parametrize(
    ("form", "key"),
    [("%H%M%S.%f", "%H%M%S.%f"), ("%Y%m%d%H%M%S.%f", "%Y%m%d%H%M%S.%f"), ("%H%M%S", "%H%M%S")],
)
def test_clocks_without_marks(tmp_path: Path, form: str, key: str) -> None:
    from datetime import datetime, timedelta

    step = 0.1 if "%f" in form else 1.0
    begin = datetime(2026, 5, 4, 9, 58, 30)
    columns = drive(1200)
    columns["t"] = [(begin + timedelta(seconds=k * step)).strftime(form) for k in range(1200)]
    path = write_csv(tmp_path / "t.csv", {"UTC time": columns.pop("t"), **columns})
    by_hand = {**COLUMNS, "time": {"column": "UTC time", "unit": "s"}}
    with pytest.raises(InputError, match=re.escape(f'format: "{key}"')):
        import_table(path, by_hand, tmp_path / "bag")
    by_hand["time"] = {"column": "UTC time", "format": key}
    assert [len(r) for r in import_table(path, by_hand, tmp_path / "bag").recordings] == [1200]
    assert (clock := suggest_columns(path).clock) and clock.format == key


def test_units_behind_the_numbers(tmp_path: Path) -> None:
    columns = drive()
    units = {"t": "", "v": " kilometer_per_hour", "gas": " percent", "brake": " %", "a": "m/s^2"}
    path = write_csv(
        tmp_path / "t.csv", {n: [f"{x}{units[n]}" for x in values] for n, values in columns.items()}
    )
    done = import_table(path, COLUMNS, tmp_path / "bag")
    np.testing.assert_allclose(speeds(done.recordings), columns["v"] / 3.6, rtol=1e-9)
    wrong = with_channels(speed={"column": "v", "unit": "mph"})
    with pytest.raises(InputError, match=r"cells of 'v' are in km/h.*give it unit: km/h"):
        import_table(path, wrong, tmp_path / "wrong")
    assert "speed: {column: v, unit: km/h}" in suggest_columns(path).text()


def test_a_unit_of_another_quantity_than_the_header_states_is_remarked(tmp_path: Path) -> None:
    columns = drive()
    path = write_csv(tmp_path / "t.csv", {"gas [%]" if n == "gas" else n: x for n, x in columns.items()})
    for unit, remarked in (("N m", True), ("percent", False)):
        meaning = with_channels(engine_command={"column": "gas [%]", "unit": unit})
        account = import_table(path, meaning, tmp_path / unit[:1]).recordings[0].account
        assert account is not None
        said = "engine_command is taken in N m, but 'gas [%]' states %"
        assert any(said in line for line in account.remarks) is remarked


def test_words_for_states(tmp_path: Path) -> None:
    columns = drive()
    pressed = columns["brake"] > 0
    columns |= {"brakePressed": pressed, "Brake switch": np.where(pressed, "ON", "OFF")}
    columns["gear"] = np.where(columns["t"] < 5, "N", "D")
    path = write_csv(tmp_path / "t.csv", columns)
    for switch in ("brakePressed", "Brake switch"):
        meaning = with_channels(brake_switch={"column": switch}, gear={"column": "gear"})
        (r,) = import_table(path, meaning, tmp_path / switch).recordings
        np.testing.assert_array_equal(r.channels["brake_switch"], pressed)
        (aside,) = r.account.channels["gear"].aside.items()
        assert aside[0] == "no number" and aside[1].count == 550 and "'D'" in aside[1].first
        assert (r.channels["gear"][:50] == 0).all()
    names = {one.field.path for one in suggest_columns(path).candidates["brake_switch"]}
    assert names == {"brakePressed", "Brake switch"}


def test_blanks_as_separators(tmp_path: Path) -> None:
    columns = drive(60)
    rows = [
        f"  {t:6.1f}    {v:7.2f} {gas:5.1f}"
        for t, v, gas in zip(columns["t"], columns["v"], columns["gas"], strict=True)
    ]
    path = tmp_path / "t.txt"
    path.write_text("\n".join(["Time [s]    Speed [km/h]  Throttle [%]", *rows]) + "\n")
    np.testing.assert_allclose(speeds(proposed(path, tmp_path)), columns["v"] / 3.6, rtol=1e-9)


@pytest.mark.parametrize(
    "above", [["a,b", "", "1,2,3,4,5,6,7"], ["started,driver,route,place,best,mean", "laps", "5.1,5.2,5.3"]]
)
def test_a_preamble_of_any_width(tmp_path: Path, above: list[str]) -> None:
    columns = drive()
    path = write_csv(
        tmp_path / "t.csv",
        {
            "timestamp_s": columns["t"],
            "speed_kmh": columns["v"],
            "throttle_pct": columns["gas"],
            "sats": np.full(600, 9),
        },
    )
    path.write_text("\n".join([*above, *[""] * 20, path.read_text()]))
    found = suggest_columns(path)
    assert found.form.skip_rows == len(above) + 20
    np.testing.assert_allclose(speeds(proposed(path, tmp_path)), columns["v"] / 3.6, rtol=1e-9)


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
