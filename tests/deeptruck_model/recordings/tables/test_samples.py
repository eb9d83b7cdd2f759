"""What a column means, by its numbers, its unit and the other columns: one drive, written in many ways."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
import yaml
from csv_tables import COLUMNS, drive, speed, with_channels, write_csv
from pyarrow import parquet
from scipy.io import savemat

from deeptruck_core.arrays import Array
from deeptruck_core.errors import InputError
from deeptruck_core.signals import TruckInterface
from deeptruck_model.recordings import import_table, suggest_columns
from deeptruck_model.recordings.resample import Series, uniform
from deeptruck_model.recordings.tables.table_file import read_curve

D = drive()
T, V, A = D["t"], D["v"], D["a"]
PEDAL = np.round(np.where(D["gas"] > 0, D["gas"], -D["brake"]) / 100, 4)
NORTH, EAST = np.round(V / 3.6 * np.cos(0.6 + T / 100), 4), np.round(V / 3.6 * np.sin(0.6 + T / 100), 4)
TIME = {"time_s": T}
PEDALS = {"throttle (%)": D["gas"], "brake (%)": D["brake"]}
VECTO = {
    "time [s]": T, "v_act [km/h]": V, "v_targ [km/h]": 0 * V + 80, "grad [%]": 0 * V + 2,
    "n_eng_avg [1/min]": 15 * V, "T_eng_fcmap [Nm]": 20 * V, "Tq_full [Nm]": 0 * V + 2100,
    "FC-Map [g/h]": 300 * V,
}  # fmt: skip
FRENCH = {
    "Temps (s)": T, "Vitesse (km/h)": V, "Régime moteur (tr/min)": 20 * V,
    "Pédale accélérateur (%)": D["gas"],    "Pédale de frein (%)": D["brake"], "Pente (%)": 0 * V + 2,
}  # fmt: skip
TURKISH = {"Zaman (s)": T, "Hız (km/h)": V, "Gaz (%)": D["gas"]}


def read(yaml_text: str) -> dict[str, Any]:
    found: dict[str, Any] = yaml.safe_load(yaml_text)
    return found


@pytest.mark.parametrize(
    ("columns", "proposed"),
    [
        (FRENCH, {"speed": "Vitesse (km/h)", "engine_command": "Pédale accélérateur (%)",
                  "grade": "Pente (%)", "brake_command": "Pédale de frein (%)",
                  "engine_speed": "Régime moteur (tr/min)"}),
        (TURKISH, {"speed": "Hız (km/h)"}),
        (VECTO, {"speed": "v_act [km/h]", "grade": "grad [%]", "engine_speed": "n_eng_avg [1/min]",
                 "engine_torque": "T_eng_fcmap [Nm]", "fuel_rate": "FC-Map [g/h]"}),
        ({**TIME, "vel_n_m_s": NORTH, "vel_e_m_s": EAST, **PEDALS}, {"speed": ["vel_n_m_s", "vel_e_m_s"]}),
        ({**TIME, "Vn [m/s]": NORTH, "Ve [m/s]": EAST, "Vd [m/s]": 0 * V},
         {"speed": ["Vn [m/s]", "Ve [m/s]"]}),
        ({**TIME, "kmph_meas": V, "acceleration_break": PEDAL},
         {"speed": "kmph_meas", "engine_command": ("acceleration_break", {"part": "positive"}),
          "brake_command": ("acceleration_break", {"part": "negative"})}),
    ],
    ids=["French", "Turkish", "VECTO", "components", "letters", "one pedal"],
)  # fmt: skip
def test_what_is_proposed(columns: dict[str, Any], proposed: dict[str, Any], tmp_path: Path) -> None:
    found = suggest_columns(write_csv(tmp_path / "drive.csv", columns))
    meaning = read(found.text())
    assert meaning["time"] == {"column": next(iter(columns)), "unit": "s"}
    for channel, column in proposed.items():
        name, keys = column if isinstance(column, tuple) else (column, {})
        entry = meaning["channels"][channel]
        assert entry["column"] == name and keys.items() <= entry.items()
    r = import_table(found.table.path, meaning, tmp_path / "bag").recordings[0]
    assert len(r) == 600 and r.channels["speed"] == pytest.approx(speed(T), abs=0.01)


def test_the_names_of_vehicles_are_no_channels(tmp_path: Path) -> None:
    """A column called 'name' has signals only if some of its cells are those of a channel."""
    columns = {**TIME, "name": ["lorry"] * 600, "value": np.arange(600), "Speed (km/h)": V}
    assert suggest_columns(write_csv(tmp_path / "drive.csv", columns)).pivot is None


Rows = dict[str, Any]


def twice(columns: Rows) -> Rows:
    return {name: np.tile(values, 2) for name, values in columns.items()}


def each_twice(columns: Rows) -> Rows:
    return {name: np.repeat(values, 2) for name, values in columns.items()}


def overlapping(columns: Rows) -> Rows:
    return {name: np.concatenate([values[:400], values[200:]]) for name, values in columns.items()}


@pytest.mark.parametrize(("again", "count"), [(twice, 600), (each_twice, 600), (overlapping, 200)])
def test_rows_that_are_written_again_are_set_aside(
    again: Callable[[Rows], Rows], count: int, tmp_path: Path
) -> None:
    rows = {name: D[name] for name in ("t", "v", "gas", "brake")}
    (r,) = import_table(write_csv(tmp_path / "drive.csv", again(rows)), COLUMNS, tmp_path / "bag").recordings
    assert r.account is not None and r.account.total.aside["that repeat earlier rows"].count == count
    assert len(r) == 600 and r.channels["speed"] == pytest.approx(speed(T), abs=0.01)


def test_a_value_held_for_a_varying_number_of_rows_is_read_where_it_is_renewed(tmp_path: Path) -> None:
    t = np.round(0.1 * np.arange(1200), 1)
    renewed = np.cumsum(np.random.default_rng(0).integers(9, 13, 200))
    at = np.maximum(np.searchsorted(renewed, np.arange(1200), side="right") - 1, 0)
    v = np.round(3.6 * speed(0.1 * np.r_[0, renewed][at + (renewed[0] <= np.arange(1200))]), 2)
    rows = {"t": t, "v": v, "gas": 0 * t, "brake": 0 * t}
    (r,) = import_table(write_csv(tmp_path / "drive.csv", rows), COLUMNS, tmp_path / "bag").recordings
    assert any("speed is renewed every" in note for note in r.notes)
    assert 0.9 < r.dt < 1.2 and np.nanmax(np.abs(r.channels["acceleration"])) < 1.5
    coarse = {"t": T, "v": np.round(V), "gas": D["gas"], "brake": D["brake"]}
    (r,) = import_table(write_csv(tmp_path / "coarse.csv", coarse), COLUMNS, tmp_path / "coarse").recordings
    assert r.dt == 0.1  # a sensor that reads whole km/h is not held


def test_straight_lines_of_an_exporter_are_read_where_they_meet(tmp_path: Path) -> None:
    """Signals sent at 1 Hz, and none from 20 to 40 s, on a clock of 10 Hz."""
    sent = np.r_[np.arange(0.0, 21.0), np.arange(40.0, 60.0)]
    rows = {"t": T, "v": np.round(np.interp(T, sent, 3.6 * speed(sent)), 5)}
    rows |= {"gas": np.round(np.interp(T, sent, sent % 7 * 9), 5), "brake": 0 * T}
    rows["gear"] = np.round(np.interp(T, sent, np.round(sent % 8)), 5)
    meaning = with_channels(gear={"column": "gear"})
    pieces = import_table(write_csv(tmp_path / "drive.csv", rows), meaning, tmp_path / "bag").recordings
    assert [(round(r.start_s), len(r), r.dt) for r in pieces] == [(0, 21, 1.0), (40, 20, 1.0)]
    for r in pieces:
        assert r.channels["speed"] == pytest.approx(speed(r.time), abs=0.01)
        assert not (r.channels["gear"] % 1.0).any()


def test_zero_while_positions_move_on_is_no_speed(tmp_path: Path) -> None:
    t = np.arange(600.0)
    v = speed(t)
    lat = 48.0 + np.cumsum(v) / 111_200
    stopped = np.where((t > 400) & (t < 450), 0.0, v)  # and one stop at which they stand
    rows = {"t": t, "v": np.where((t >= 100) & (t < 220), 0.0, stopped), "gas": 0 * t, "brake": 0 * t}
    rows |= {"lat": np.round(48.0 + np.cumsum(stopped) / 111_200, 7), "lon": 0 * t + 11.5}
    rows["v"] *= 3.6
    assert lat[-1] > rows["lat"][-1]
    places = {n: {"column": n[:3], "unit": "deg"} for n in ("latitude", "longitude")}
    found = import_table(write_csv(tmp_path / "drive.csv", rows), with_channels(**places), tmp_path / "bag")
    account = found.recordings[0].account
    assert account.channels["speed"].aside["zero while positions move on"].count == 120
    assert [round(r.start_s) for r in found.recordings] == [0, 220]


@pytest.mark.parametrize("spacing", [1.013, 0.25])
def test_samples_in_bursts_have_the_rate_of_the_bursts(spacing: float) -> None:
    time = np.concatenate([k * spacing + 0.011 * np.arange(3) for k in range(60)])
    one = Series(time, speed(time))
    state = Series(time, np.round(time) % 2)
    (r,) = uniform({"speed": one, "brake_switch": state}, name="card", interface=TruckInterface("t"))
    assert len(r) * r.dt == pytest.approx(60 * spacing, rel=0.02) and not np.isnan(r.channels["speed"]).any()
    assert r.channels["speed"] == pytest.approx(speed(r.dt * np.arange(len(r)) + 0.011), abs=0.05)
    assert {*np.unique(r.channels["brake_switch"])} <= {0.0, 1.0}


def test_structures_with_a_time_of_their_own(tmp_path: Path) -> None:
    def signal(step: int, values: Array) -> dict[str, Any]:
        return {"time": T[::step], "signals": {"values": values[::step]}, "blockName": "m"}

    savemat(tmp_path / "d.mat", {"tout": T, "speed_kmh": signal(5, V), "brake_pedal": signal(1, D["brake"])})
    found = suggest_columns(tmp_path / "d.mat")
    meaning = read(found.text())
    assert meaning["time"] == {"column": "time", "unit": "s"}
    assert meaning["channels"]["speed"]["column"] == "speed_kmh.signals.values"
    (r,) = import_table(tmp_path / "d.mat", meaning, tmp_path / "bag").recordings
    assert r.dt == 0.5 and r.channels["speed"] == pytest.approx(speed(T[::5]), abs=0.01)


def test_groups_of_structures_with_a_time_of_their_own(tmp_path: Path) -> None:
    def group(step: int, **signals: Array) -> dict[str, Any]:
        return {"time": T[::step]} | {name: values[::step] for name, values in signals.items()}

    fast = np.arange(0, 60, 0.02)
    run = {
        "j1939": {"ccvs": group(1, speed_kmh=V), "eec2": group(2, accelPedal_pct=D["gas"])},
        "imu": {"time": fast, "ax": np.interp(fast, T, A)},
    }
    savemat(tmp_path / "run.mat", {"run": run})
    meaning = read(suggest_columns(tmp_path / "run.mat").text())
    assert meaning["channels"]["engine_command"]["column"] == "run.j1939.eec2.accelPedal_pct"
    (r,) = import_table(tmp_path / "run.mat", meaning, tmp_path / "bag").recordings
    assert r.dt == 0.1 and r.channels["speed"] == pytest.approx(speed(T), abs=0.01)
    assert np.isfinite(r.channels["acceleration"]).all()
    assert r.channels["engine_command"][:-2:2] == pytest.approx(D["gas"][:-2:2])


def test_rows_of_a_time_alone_and_the_places_of_a_traffic_simulator(tmp_path: Path) -> None:
    x = np.cumsum(V / 3.6) * 0.1
    rows = [f"{t};{90.0};truck;lane_0;{v / 3.6:.2f};{p:.2f};-1.60" for t, v, p in zip(T, V, x, strict=True)]
    empty = [f"{t:.2f};;;;;;" for t in np.arange(-5, 0, 0.1)]
    head = "timestep_time;vehicle_angle;vehicle_id;vehicle_lane;vehicle_speed;vehicle_x;vehicle_y"
    (tmp_path / "fcd.csv").write_text("\n".join([head, *empty, *rows]) + "\n")
    found = suggest_columns(tmp_path / "fcd.csv")
    meaning = {**read(found.text()), "channels": {"speed": {"column": "vehicle_speed", "unit": "m/s"}}}
    assert found.key is None
    (r,) = import_table(tmp_path / "fcd.csv", meaning, tmp_path / "bag").recordings
    assert r.account is not None and r.account.total.aside["with a time and nothing else"].count == 50
    assert r.channels["speed"] == pytest.approx(V / 3.6, abs=0.01)


def test_rows_of_one_time_that_fill_other_columns_are_one(tmp_path: Path) -> None:
    rows = [row for t, v, g in zip(T, V, D["gas"], strict=True) for row in (f"{t},{v},", f"{t},,{g}")]
    (tmp_path / "d.csv").write_text("time_s,speed_kmh,throttle_pct\n" + "\n".join(rows) + "\n")
    meaning = read(suggest_columns(tmp_path / "d.csv").text())
    (r,) = import_table(tmp_path / "d.csv", meaning, tmp_path / "bag").recordings
    assert r.channels["speed"] == pytest.approx(speed(T), abs=0.01)
    assert r.channels["engine_command"] == pytest.approx(D["gas"])


INFLUX = "#group,false,false,true,false,true\n#datatype,string,long,dateTime:RFC3339,double,string\n"
INFLUX += "#default,mean,,,,\n,result,table,_time,_value,_field\n"


@pytest.mark.parametrize(
    ("head", "row", "by_name"),
    [
        ("Time [s],Name,Raw Value,Physical Value,Unit\n", "{t},{name},{raw},{value},{unit}", False),
        (INFLUX, ",,0,2026-05-04T08:00:{t:04.1f}Z,{value},{name}_{unit}", True),
    ],
    ids=["raw and physical", "InfluxDB"],
)
def test_one_value_a_row(head: str, row: str, by_name: bool, tmp_path: Path) -> None:
    series = (("VehicleSpeed", V, "kmh"), ("AccelPedal", D["gas"], "pct"))
    rows = [
        row.format(t=T[k], name=name, raw=k % 7, value=x[k], unit=unit)
        for name, x, unit in series for k in range(600)
    ]  # fmt: skip
    rows = rows if by_name else [line for k in range(600) for line in rows[k::600]]
    (tmp_path / "d.csv").write_text(head + "\n".join(rows) + "\n")
    meaning = read(suggest_columns(tmp_path / "d.csv").text())
    (r,) = import_table(tmp_path / "d.csv", meaning, tmp_path / "bag").recordings
    assert r.channels["speed"] == pytest.approx(speed(T), abs=0.01)
    assert r.account is not None and r.account.balanced
    assert "1200 rows with one value each made 600 of 2 columns" in r.account.remarks


@pytest.mark.parametrize(
    ("columns", "channel", "entry"),
    [
        ({"Time (days)": [f"{t / 86400:.10f}" for t in T], "Speed (km/h)": V}, "speed", {"unit": "km/h"}),
        ({"Time (us)": [1777881600_000000 + round(1e6 * t) for t in T], "speed_ms": V / 3.6}, "speed",
         {"unit": "m/s"}),
        ({**TIME, "Speed (mph)": V / 1.609344, "Accel X (Gs)": A / 9.80665}, "acceleration", {"unit": "g"}),
        ({**TIME, "Car.v": V / 3.6, "Car.ax": A, "Car.Road.GCS.Elev": 300 + T}, "elevation", {"unit": "m"}),
        ({"recording": ["a"] * 600, "time": T, "speed": V / 3.6, "grade": 0 * T + 0.02}, "grade",
         {"unit": "ratio"}),
    ],
    ids=["days", "microseconds", "Gs", "CarMaker", "ours"],
)  # fmt: skip
def test_units_of_clocks_and_channels(
    columns: dict[str, Any], channel: str, entry: dict[str, Any], tmp_path: Path
) -> None:
    columns = {name: np.round(x, 5) if isinstance(x, np.ndarray) else x for name, x in columns.items()}
    meaning = read(suggest_columns(write_csv(tmp_path / "d.csv", columns)).text())
    assert entry.items() <= meaning["channels"][channel].items()
    (r,) = import_table(tmp_path / "d.csv", meaning, tmp_path / "bag").recordings
    assert r.channels["speed"] == pytest.approx(speed(T), abs=0.01)


def test_a_table_in_parts(tmp_path: Path) -> None:
    (tmp_path / "drive").mkdir()
    for k in range(3):
        part = {name: D[name][200 * k : 200 * k + 200] for name in ("t", "v", "gas", "brake")}
        parquet.write_table(pa.table(part), tmp_path / "drive" / f"part-{k}.parquet")
    (r,) = import_table(tmp_path / "drive", COLUMNS, tmp_path / "bag").recordings
    assert r.channels["speed"] == pytest.approx(speed(T), abs=0.01)


@pytest.mark.parametrize("delimiter", [",", " "])
def test_the_header_of_savetxt(delimiter: str, tmp_path: Path) -> None:
    rows = np.column_stack([T, V])
    header = delimiter.join(("time_s", "speed_kmh"))
    np.savetxt(tmp_path / "d.txt", rows, delimiter=delimiter, header=header, fmt="%.2f")
    assert suggest_columns(tmp_path / "d.txt").table.columns.keys() == {"time_s", "speed_kmh"}


def test_a_leader_of_which_the_speed_drops_out(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    v = np.where((T >= 20) & (T < 21), 0.0, V / 3.6)
    path = write_csv(tmp_path / "leader.csv", {"time": T, "speed": np.round(v, 3)})
    t, bridged = read_curve(path, "time", "speed")
    assert len(t) == 590 and bridged.min() > 7.0
    assert "10 that jump to a number for no value and back, bridged" in capsys.readouterr().err


RAW = {"t": T, "v": V, "gas": np.round(D["gas"] + 125), "brake": D["brake"]}
LISTED = "".join(f"Channel : {name}\nID : 1\n" for name in ("Speed", "Throttle", "Brake"))


@pytest.mark.parametrize(
    ("rows", "channels", "says"),
    [
        (RAW, {}, "percent torque of J1939 without its offset. Give it 'offset: -125'"),
        ({**D, "gas": PEDAL, "north": NORTH},
         {"brake_command": {"column": "gas", "unit": "ratio", "scale": -1},
          "engine_command": {"column": "gas", "unit": "ratio"}},
         "'gas' drives above zero and brakes below: give engine_command 'part: positive'"),
        ({**D, "vx": NORTH, "vy": EAST}, {"speed": {"column": "vx", "unit": "m/s"}},
         r"'vx' is given for speed, but 'vy' moves too .* by 'column: \[vx, vy\]'"),
        ({**D, "t": [f"2026-08-05 {8 + k // 60:02d}:{k % 60:02d}:00" for k in range(600)]}, {},
         "rows are 60 s apart, which is too coarse"),
    ],
    ids=["torque without offset", "one pedal", "a component", "minutes"],
)  # fmt: skip
def test_what_is_refused_says_the_key(
    rows: dict[str, Any], channels: dict[str, Any], says: str, tmp_path: Path
) -> None:
    meaning = with_channels(**channels)
    meaning["time"] = {"column": "t", "unit": "iso"} if isinstance(rows["t"], list) else meaning["time"]
    with pytest.raises(InputError, match=says):
        import_table(write_csv(tmp_path / "drive.csv", rows), meaning, tmp_path / "bag")


def test_names_listed_above_rows_without_a_header(tmp_path: Path) -> None:
    rows = "".join(f"14:15:{s:06.3f},{v},30,0\n" for s, v in zip(T[:50], V, strict=False))
    (tmp_path / "log.csv").write_text(f"Log : 1.1\n{LISTED}{rows}")
    with pytest.raises(InputError, match="in line 8: Time,Speed,Throttle,Brake"):
        suggest_columns(tmp_path / "log.csv")
