"""Every kind of table that people have: one drive, written in many ways, and what is read of it.

A row is what stands in the file, what it means (COLUMNS, or what `suggest` proposes), and what is read.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
import yaml
from csv_tables import COLUMNS, SPEED, drive, speed, with_channels, write_csv
from pyarrow import parquet
from scipy.io import savemat

from deeptruck_core.arrays import Array
from deeptruck_model.recordings import Recording, import_table, read, suggest_columns
from deeptruck_model.recordings.consistency.impossible import DROPPED, FROZEN, LINE, SPIKES, STANDS

Rows = dict[str, Any]
D = drive()
T, V, A = D["t"], D["v"], D["a"]
LONG = drive(1200)
K = np.arange(600)
NORTH, EAST = (np.round(V / 3.6 * along(0.6 + T / 100), 4) for along in (np.cos, np.sin))
PEDAL = np.round(np.where(D["gas"] > 0, D["gas"], -D["brake"]) / 100, 4)
TIME = {"time_s": T}
PEDALS = {"throttle (%)": D["gas"], "brake (%)": D["brake"]}
PRESSED = D["brake"] > 0
BEGIN = datetime(2026, 5, 4, 9, 58, 30)
COPIED = "that repeat earlier rows"


@dataclass(frozen=True)
class Table:
    """Columns, or what writes the file, and what they mean: None for what is proposed, which has the keys of
    `proposes` in its lines. `reads` are values by channel, as a function of time or sample by sample; `aside`
    counts by reason; `pieces` the samples of each; `says` and `unsaid` words of notes and remarks."""

    rows: Rows | str | Callable[[Path], Path]
    meaning: Rows | None = field(default_factory=lambda: COLUMNS)
    proposes: dict[str, Rows] = field(default_factory=dict)
    reads: dict[str, Any] = field(default_factory=dict)
    aside: dict[str, int] = field(default_factory=dict)
    pieces: tuple[int, ...] = (600,)
    says: tuple[str, ...] = ()
    unsaid: tuple[str, ...] = ()

    def write(self, folder: Path) -> Path:
        """The file."""
        if isinstance(self.rows, str):
            (folder / "drive.csv").write_text(self.rows)
            return folder / "drive.csv"
        return (
            write_csv(folder / "drive.csv", self.rows) if isinstance(self.rows, dict) else self.rows(folder)
        )


def of(channel: str, column: Any, unit: str | None = None, **more: Any) -> Rows:
    """COLUMNS with a line of a channel."""
    return with_channels(**{channel: {"column": column, **({"unit": unit} if unit else {}), **more}})


def lines(head: str, row: str, **columns: Any) -> str:
    """A text of a header and rows of a format."""
    cells = (dict(zip(columns, values, strict=True)) for values in zip(*columns.values(), strict=True))
    return head + "".join(f"{row.format(**cell)}\n" for cell in cells)


def clock(cell: Callable[[int], str], **more: Any) -> Rows:
    """The drive under another clock."""
    return {**D, "t": [cell(k) for k in K], **more}


def at_each(step: int, values: Any) -> list[Any]:
    """Cells that are blank between every `step` rows."""
    return [x if k % step == 0 else "" for k, x in enumerate(values)]


def changed(rows: Rows, **values: Any) -> Rows:
    """The rows with values of columns changed where (mask, value) says so."""
    return {**rows, **{name: np.where(where, value, rows[name]) for name, (where, value) in values.items()}}


def among(*rows: int, count: int = 1200) -> Array:
    return np.isin(np.arange(count), rows)


def two_trucks(stagger: float = 0.5) -> Rows:
    """Rows of two in turn; the other is faster."""
    t, odd = 0.5 * np.arange(200), np.arange(200) % 2 == 1
    v = np.where(odd, 90 + 5 * np.sin(t / 9), 3.6 * speed(t)).round(2)
    names = np.where(odd, "T-202", "T-101")
    return {"t": np.where(odd, t - 0.5 + stagger, t), "Vehicle": names, "v": v, "Speed (km/h)": v}


OF_V = {"time": COLUMNS["time"], "channels": {"speed": {"column": "v", "unit": "km/h"}}}


def stray() -> Rows:
    """A stamp far off, two that are swapped, and one that comes twice."""
    t, v = T.copy(), V.copy()
    t[300], t[500] = 4000.0, t[499]
    for x in (t, v):
        x[[100, 101]] = x[[101, 100]]
    return {**D, "t": t, "v": v}


def unmarked(form: str, step_s: float) -> Rows:
    stamps = [(BEGIN + timedelta(seconds=k * step_s)).strftime(form) for k in range(1200)]
    return {"UTC time": stamps, "Speed (km/h)": (3.6 * speed(step_s * np.arange(1200))).round(2)}


def held() -> Rows:
    """A speed that is renewed every 9 to 12 rows."""
    k = np.arange(1200)
    renewed = np.cumsum(np.random.default_rng(0).integers(9, 13, 200))
    at = np.maximum(np.searchsorted(renewed, k, side="right") - 1, 0)
    v = np.round(3.6 * speed(0.1 * np.r_[0, renewed][at + (renewed[0] <= k)]), 2)
    return {"t": LONG["t"], "v": v, "gas": 0 * k, "brake": 0 * k}


def exported() -> Rows:
    """Signals sent at 1 Hz, and none from 20 to 40 s, on a clock of 10 Hz by straight lines."""
    sent = np.r_[np.arange(0.0, 21.0), np.arange(40.0, 60.0)]
    signals = {"v": 3.6 * speed(sent), "gas": sent % 7 * 9, "gear": np.round(sent % 8)}
    return {"t": T, "brake": 0 * T} | {n: np.interp(T, sent, x).round(5) for n, x in signals.items()}


HOLE = (LONG["t"] > 50) & (LONG["t"] <= 80)


def unfilled() -> Rows:
    """Zero for two minutes while positions move on, and a stop at which they stand."""
    t = np.arange(600.0)
    stopped = np.where((t > 400) & (t < 450), 0.0, speed(t))
    rows = {"t": t, "v": 3.6 * np.where((t >= 100) & (t < 220), 0.0, stopped), "gas": 0 * t, "brake": 0 * t}
    return rows | {"lat": np.round(48.0 + np.cumsum(stopped) / 111_200, 7), "lon": 0 * t + 11.5}


PLACES = {c: {"column": c[:3], "unit": "deg"} for c in ("latitude", "longitude")}


def another_zero(step_s: float, by_m: float, noise_m: float) -> Rows:
    """A road that climbs by 0.02, whose height is counted from another zero from the 500th row on."""
    k, t = np.arange(1200), step_s * np.arange(1200)
    v = speed(t)
    h = (
        300
        + 0.02 * np.cumsum(v) * step_s
        + np.random.default_rng(0).normal(0, noise_m, 1200)
        + by_m * (k >= 500)
    )
    return {"t": t.round(3), "v": (3.6 * v).round(2), "gas": 0 * t, "brake": 0 * t, "h": h.round(1)}


def frozen_height() -> Rows:
    h = 300 + np.round(0.002 * np.cumsum(LONG["v"] / 3.6), 2)
    h[300:420] = h[300]
    return {**LONG, "h": h}


def held_fuel() -> Rows:
    """One stands for 8 s while the engine changes, another while it idles; for 20 s there is none."""
    k, n = np.arange(1200), 60 * LONG["v"] / 3.6
    fuel = 5 + 0.004 * n + np.random.default_rng(0).normal(0, 0.2, 1200).round(3)
    fuel = np.where((k >= 300) & (k < 380), fuel[300], np.where(k < 200, 0.0, fuel))
    fuel[600:700], n[600:700] = 0.256, 600.0
    return {**LONG, "f": fuel.round(4), "n": n.round(1)}


def signal(step: int, values: Array) -> Rows:
    return {"time": T[::step], "signals": {"values": values[::step]}, "blockName": "m"}


def simulink(folder: Path) -> Path:
    rows = {"tout": T, "speed_kmh": signal(5, V), "brake_pedal": signal(1, D["brake"])}
    savemat(folder / "d.mat", rows)
    return folder / "d.mat"


def groups(folder: Path) -> Path:
    """Structures two deep, each with a time of its own."""
    fast = np.arange(0, 60, 0.02)
    j1939 = {"ccvs": {"time": T, "speed_kmh": V}, "eec2": {"time": T[::2], "accelPedal_pct": D["gas"][::2]}}
    savemat(folder / "d.mat", {"run": {"j1939": j1939, "imu": {"time": fast, "ax": np.interp(fast, T, A)}}})
    return folder / "d.mat"


def parts(folder: Path) -> Path:
    (folder / "drive").mkdir()
    for k in range(3):
        part = {name: D[name][200 * k : 200 * k + 200] for name in ("t", "v", "gas", "brake")}
        parquet.write_table(pa.table(part), folder / "drive" / f"part-{k}.parquet")
    return folder / "drive"


def savetxt(delimiter: str) -> Callable[[Path], Path]:
    def made(folder: Path) -> Path:
        header = delimiter.join(("time_s", "speed_kmh"))
        np.savetxt(folder / "d.txt", np.column_stack([T, V]), delimiter=delimiter, header=header, fmt="%.2f")
        return folder / "d.txt"

    return made


def preamble(*above: str) -> str:
    columns = {"timestamp_s": T, "speed_kmh": V, "throttle_pct": D["gas"], "sats": 0 * K + 9}
    head = "\n".join([*above, *[""] * 20, ",".join(columns)]) + "\n"
    return lines(head, ",".join(f"{{{name}}}" for name in columns), **columns)


def each(row: str, *, by_name: bool, head: str) -> str:
    """One value a row."""
    series = (("VehicleSpeed", V, "kmh"), ("AccelPedal", D["gas"], "pct"))
    rows = [row.format(t=T[k], name=n, raw=k % 7, value=x[k], unit=u) for n, x, u in series for k in K]
    return head + "\n".join(rows if by_name else [line for k in K for line in rows[k::600]]) + "\n"


INFLUX = "#group,false,false,true,false,true\n#datatype,string,long,dateTime:RFC3339,double,string\n"
INFLUX += "#default,mean,,,,\n,result,table,_time,_value,_field\n"
FCD = "timestep_time;vehicle_angle;vehicle_id;vehicle_lane;vehicle_speed;vehicle_x;vehicle_y\n"
FCD_ROW = "{t};90.00;truck;lane_0;{v:.2f};{x:.2f};-1.60"
FRENCH = {
    "Temps (s)": T, "Vitesse (km/h)": V, "Régime moteur (tr/min)": 20 * V,
    "Pédale accélérateur (%)": D["gas"], "Pédale de frein (%)": D["brake"], "Pente (%)": 0 * V + 2,
}  # fmt: skip
VECTO = {
    "time [s]": T, "v_act [km/h]": V, "v_targ [km/h]": 0 * V + 80, "grad [%]": 0 * V + 2,
    "n_eng_avg [1/min]": 15 * V, "T_eng_fcmap [Nm]": 20 * V, "Tq_full [Nm]": 0 * V + 2100,
    "FC-Map [g/h]": 300 * V,
}  # fmt: skip
GERMAN = (
    "Datei;vom 1. Mai\nnoch eine Zeile\nZeit [s]; Tempo [km/h] ;Temp [°C]\n"
    "0,0;36,0;20,5\n0,1; 36,0 ;n/a\n0,2;;20,5\n0,3;36,0;20,5\n0,4;36"
)
FUEL = {"rate_hz": 1.0}, {"v": np.full(9, 5.0), "fuel": np.arange(9.0)}


def column(name: Any, **keys: Any) -> Rows:
    return {"column": name, **keys}


# fmt: off
TABLES = {
    # vehicles, trips and clocks
    "two vehicles": Table(two_trucks(), None, reads={"speed": speed}, pieces=(100,),
                          aside={"of others than 'T-101'": 100}),
    "two vehicles of one stamp": Table(two_trucks(0.0), None, pieces=(100,),
        aside={"of others than 'T-101'": 100}),
    "the other vehicle": Table(two_trucks(), {**OF_V, "only": {"Vehicle": "T-202"}}, pieces=(100,),
                               reads={"speed": lambda t: (90 + 5 * np.sin((t + 0.5) / 9)) / 3.6},
                               aside={"of others than 'T-202'": 100}),
    "gear letters": Table({**D, "Gear": np.where(K // 7 % 2, "D", "N")}),
    "the end of summer time": Table(
        clock(lambda k: f"2026-10-25 02:{59 if k < 300 else 0:02d}:{30 * (k < 300) + k % 300 / 10:06.3f}"),
        {**COLUMNS, "time": column("t", unit="iso")}, reads={"speed": V / 3.6}, pieces=(300, 300),
        says=("by 3599.9 s in line 302 (the end of summer time)",)),
    "a clock set back": Table(
        clock(lambda k: f"2026-05-04T09:15:{10 + k / 10 if k < 200 else k / 10 - 17:06.3f}"),
        {**COLUMNS, "time": column("t", unit="iso")}, reads={"speed": V / 3.6}, pieces=(200, 400),
        says=("by 26.9 s in line 202",)),
    "trips from zero": Table({**D, "t": T % 20, "Trip": K // 200 + 1}, reads={"speed": V / 3.6},
                             pieces=(200, 200, 200)),
    "stray, swapped and doubled stamps": Table(
        stray(), reads={"speed": (speed, 0.11), "acceleration": None},
            says=("1 rows put back in the order of their times",),
        aside={"stamped far off their neighbours": 1, "with a repeated time": 1}),
    **{f"a clock without marks, {form}": Table(
        unmarked(form, step), None, proposes={"time": column("UTC time", format=form)}, pieces=(1200,))
       for form, step in (("%H%M%S.%f", 0.1), ("%Y%m%d%H%M%S.%f", 0.1), ("%H%M%S", 1.0))},
    "a clock in ms": Table({**D, "t": (1000 * T).round()}, {**COLUMNS, "time": column("t", unit="ms")}),
    # cells
    "units behind the numbers": Table(
        {n: [f"{x}{u}" for x in D[n]] for n, u in
         {"t": "", "v": " kilometer_per_hour", "gas": " percent", "brake": " %", "a": "m/s^2"}.items()},
        reads={"engine_command": lambda t: np.interp(t, T, D["gas"])}),
    "units behind the numbers, proposed": Table(
        {"t": T, "v": [f"{x} kilometer_per_hour" for x in V]}, None,
            proposes={"speed": column("v", unit="km/h")}),
    "a unit that changes in the cells": Table(
        {**D, "v": [f"{x} km/h" if k < 300 else f"{x / 1.609344:.4f} mph" for k, x in enumerate(V)]}),
    "a unit of another quantity": Table(
        {"gas [%]" if n == "gas" else n: x for n, x in D.items()}, of("engine_command", "gas [%]", "N m"),
        says=("engine_command is taken in N m, but 'gas [%]' states %",)),
    "a unit of its quantity": Table(
        {"gas [%]" if n == "gas" else n: x for n, x in D.items()}, of("engine_command", "gas [%]", "percent"),
        unsaid=("but 'gas [%]' states",)),
    **{f"words for states, {words[0]}": Table(
        {**D, "switch": np.where(PRESSED, *words), "gear": np.where(T < 5, "N", "D")},
        with_channels(brake_switch=column("switch"), gear=column("gear")),
        reads={"brake_switch": PRESSED * 1.0, "gear": lambda t: 0 * t}, aside={"no number": 550})
       for words in (("True", "False"), ("ON", "OFF"))},
    "words for states, proposed": Table(
        {**D, "Speed (km/h)": V, "brakePressed": PRESSED}, None,
            proposes={"brake_switch": column("brakePressed")}),
    "blanks as separators": Table(
        lines("Time [s]    Speed [km/h]  Throttle [%]\n", "  {t:6.1f}    {v:7.2f} {g:5.1f}", t=T, v=V,
            g=D["gas"]),
        None),
    "a narrow preamble": Table(preamble("a,b", "", "1,2,3,4,5,6,7"), None, proposes={"skip_rows": {"": 23}}),
    "a preamble of the table's width": Table(
        preamble("started,driver,route,place,best,mean", "laps", "5.1,5.2,5.3"), None,
            proposes={"skip_rows": {"": 23}}),
    "savetxt": Table(savetxt(","), None),
    "savetxt with blanks": Table(savetxt(" "), None),
    "as people have them": Table(
        lambda folder: _latin(folder / "drive.csv", GERMAN),
        {"time": column("Zeit [s]", unit="s"), "delimiter": ";", "encoding": "latin-1", "skip_rows": 2,
            "decimal": ",",
         "channels": {"speed": column("Tempo [km/h]", unit="km/h"),
                      "ambient_temperature": column("Temp [°C]", unit="degC", offset=-0.5)}},
        reads={"speed": lambda t: 0 * t + 10, "ambient_temperature": lambda t: 0 * t + 20}, pieces=(4,),
        says=("ambient_temperature: 1 of 4 samples no number, first 'n/a' in line 5",
              "1 with more or fewer cells than the header, first line 8")),
    "parts of a table": Table(parts),
    # rows
    **{f"rows written again, {how}": Table(
        {n: again(D[n]) for n in ("t", "v", "gas", "brake")}, aside={COPIED: count})
       for how, again, count in (
           ("all", lambda x: np.tile(x, 2), 600), ("each", lambda x: np.repeat(x, 2), 600),
           ("some", lambda x: np.concatenate([x[:400], x[200:]]), 200))},
    "a traffic simulator's rows, of a time alone too": Table(
        FCD + "".join(f"{t:.2f};;;;;;\n" for t in np.arange(-5, 0, 0.1))
        + lines("", FCD_ROW, t=T, v=V / 3.6, x=np.cumsum(V / 3.6) * 0.1),
        None, proposes={"speed": column("vehicle_speed", unit="m/s")},
            aside={"with a time and nothing else": 50}),
    "rows of one time that fill other columns": Table(
        "time_s,speed_kmh,throttle_pct\n" + "".join(f"{t},{v},\n{t},,{g}\n" for t, v,
            g in zip(T, V, D["gas"], strict=True)),
        None, reads={"engine_command": D["gas"]}),
    "one value a row": Table(
        each("{t},{name},{raw},{value},{unit}", by_name=False,
            head="Time [s],Name,Raw Value,Physical Value,Unit\n"), None,
        says=("1200 rows with one value each made 600 of 2 columns",)),
    "one value a row, InfluxDB": Table(
        each(",,0,2026-05-04T08:00:{t:04.1f}Z,{value},{name}_{unit}", by_name=True, head=INFLUX), None,
        says=("1200 rows with one value each made 600 of 2 columns",)),
    "names of vehicles": Table({**TIME, "name": ["lorry"] * 600, "value": K, "Speed (km/h)": V}, None),
    "one channel each": Table(
        {"t": K / 100, "v": at_each(4, K / 40), "rpm": ["", "", *at_each(4, K[2:] / 2)]},
        {"time": column("t", unit="s"), "channels": {**SPEED, "engine_speed": column("rpm", unit="rad/s")}},
        reads={"speed": lambda t: 2.5 * t, "engine_speed": lambda t: 50 * t, "acceleration": None},
            pieces=(150,)),
    # structures of Matlab
    "structures with a time of their own": Table(
        simulink, None, proposes={"time": column("time", unit="s"),
            "speed": column("speed_kmh.signals.values")}, pieces=(120,)),
    "groups with a time of their own": Table(
        groups, None, proposes={"engine_command": column("run.j1939.eec2.accelPedal_pct")},
        reads={"engine_command": lambda t: np.repeat(D["gas"][::2], 2)}),
    # headers and units
    "French": Table(FRENCH, None, proposes={
        "time": column("Temps (s)", unit="s"), "speed": column("Vitesse (km/h)"),
            "grade": column("Pente (%)"),
        "engine_command": column("Pédale accélérateur (%)"), "brake_command": column("Pédale de frein (%)"),
        "engine_speed": column("Régime moteur (tr/min)")}),
    "Turkish": Table({"Zaman (s)": T, "Hız (km/h)": V, "Gaz (%)": D["gas"]}, None,
        proposes={"speed": column("Hız (km/h)")}),
    "VECTO": Table(VECTO, None, proposes={
        "speed": column("v_act [km/h]"), "grade": column("grad [%]"),
            "engine_speed": column("n_eng_avg [1/min]"),
        "engine_torque": column("T_eng_fcmap [Nm]"), "fuel_rate": column("FC-Map [g/h]")}),
    "components": Table({**TIME, "vel_n_m_s": NORTH, "vel_e_m_s": EAST, **PEDALS}, None,
                        proposes={"speed": column(["vel_n_m_s", "vel_e_m_s"])}),
    "components by letters": Table({**TIME, "Vn [m/s]": NORTH, "Ve [m/s]": EAST, "Vd [m/s]": 0 * V}, None,
                                   proposes={"speed": column(["Vn [m/s]", "Ve [m/s]"])}),
    "one pedal": Table({**TIME, "kmph_meas": V, "acceleration_break": PEDAL}, None, proposes={
        "speed": column("kmph_meas"), "engine_command": column("acceleration_break", part="positive"),
        "brake_command": column("acceleration_break", part="negative")}),
    "days": Table({"Time (days)": [f"{t / 86400:.10f}" for t in T], "Speed (km/h)": V}, None),
    "microseconds": Table({"Time (us)": [1777881600_000000 + round(1e6 * t) for t in T],
        "speed_ms": (V / 3.6).round(5)},
                          None, proposes={"speed": column("speed_ms", unit="m/s")}),
    "Gs": Table({**TIME, "Speed (mph)": (V / 1.609344).round(5), "Accel X (Gs)": (A / 9.80665).round(5)},
        None,
                proposes={"acceleration": column("Accel X (Gs)", unit="g")}),
    "CarMaker": Table({**TIME, "Car.v": (V / 3.6).round(5), "Car.ax": A, "Car.Road.GCS.Elev": 300 + T}, None,
                      proposes={"elevation": column("Car.Road.GCS.Elev", unit="m")}),
    "a table of ours": Table({"recording": ["a"] * 600, "time": T, "speed": (V / 3.6).round(5),
        "grade": 0 * T + 0.02}, None,
                             proposes={"grade": column("grade", unit="ratio")}),
    "scale, density and one column twice": Table(
        FUEL[1], {"time": FUEL[0], "channels": {
            **SPEED, "engine_command": column("fuel", unit="g/s", scale=0.5),
                "fuel_rate": column("fuel", unit="g/s", density=832)}},
        reads={"speed": lambda t: 0 * t + 5, "engine_command": 0.5 * FUEL[1]["fuel"],
            "fuel_rate": FUEL[1]["fuel"] / 0.832},
        pieces=(9,)),
    "a density not given": Table(
        FUEL[1], {"time": FUEL[0], "channels": {**SPEED, "fuel_rate": column("fuel", unit="g/s")}},
        reads={"speed": lambda t: 0 * t + 5, "fuel_rate": FUEL[1]["fuel"] / 0.832}, pieces=(9,),
            says=("0.832 g/cm^3",)),
    # sensors that are slow, held, frozen, far off, or not there
    "a sensor that failed, slow ones": Table(
        {**D, "T": [15.0] * 180 + [""] * 420, "h": at_each(5, 0 * T + 120), "f": at_each(2, 0 * T + 1)},
        with_channels(fuel_rate=column("f", unit="g/s"), ambient_temperature=column("T", unit="degC"),
            elevation=column("h", unit="m")),
        reads={"elevation": lambda t: 0 * t + 120, "ambient_temperature": lambda t: 0 * t + 15},
        says=("ambient_temperature is invalid in 420 rows of 600",
            "elevation taken as sampled in the 120 rows of 600 that have it")),
    "held at an irregular step": Table(held(), reads={"speed": None}, pieces=(114,),
        says=("samples held between the samples that renew it",)),
    "coarse": Table({**D, "v": V.round()}, reads={"speed": V.round() / 3.6, "acceleration": None},
        unsaid=("that renew it",)),
    "straight lines of an exporter": Table(
        exported(), with_channels(gear=column("gear")), pieces=(21, 20),
        reads={"gear": lambda t: np.round(t.round() % 8)},
            says=("speed: 559 of 600 samples on a straight line between the samples that renew it",)),
    "one straight line of an exporter": Table(
        {**LONG, "v": np.interp(LONG["t"], LONG["t"][~HOLE], LONG["v"][~HOLE]).round(2)},
        pieces=(501, 399), aside={LINE: 300}),
    "zero while positions move on": Table(
        unfilled(), with_channels(**PLACES),
            reads={"speed": lambda t: np.where((t > 400) & (t < 450), 0.0, speed(t)), "acceleration": None},
        pieces=(100, 380), aside={"zero while positions move on": 120}),
    "spikes": Table(changed(LONG, v=(among(150, 400, 401, 700, 950), LONG["v"] + 110)), pieces=(1200,),
        aside={SPIKES: 5},
                    says=(f"5 of 1200 samples {SPIKES}",)),
    "a jump that stays": Table(changed(LONG, v=(np.arange(1200) >= 600, LONG["v"] + 40)), pieces=(1200,),
        reads={"speed": None},
                               aside={"jumps faster than any truck": 1}),
    **{f"speed drops to {code:g}": Table(
        changed(D, v=((K % 200 >= 180) & (180 + count > K % 200), code)), pieces=pieces,
            aside={DROPPED: 3 * count})
       for code, count, pieces in ((-1.0, 20, (180, 180, 180)), (0.0, 6, (600,)))},
    "a speed that stands still and jumps": Table(
        changed(LONG, v=((np.arange(1200) > 300) & (np.arange(1200) < 420), LONG["v"][300])),
            pieces=(301, 780), aside={FROZEN: 119}),
    "a height that stands still and jumps": Table(
        frozen_height(), of("elevation", "h", "m"), pieces=(1200,), aside={FROZEN: 119}),
    **{f"a height from another zero, {by:+g} m": Table(
        another_zero(step, by, noise), of("elevation", "h", "m"), pieces=(1200,),
        reads={"grade": (lambda t: 0 * t + 0.02, 0.01)},
            says=(f"elevation changes its zero by {by:+.0f}",))
       for step, by, noise in ((0.1, -42.0, 0.0), (1.0, 12.0, 0.3), (0.1, 6.0, 0.0))},
    "a fuel rate that is held while the engine changes, zero and an idle that are not": Table(
        held_fuel(), with_channels(fuel_rate=column("f", unit="g/s"), engine_speed=column("n", unit="rpm")),
        pieces=(1200,), reads={"fuel_rate": None}, aside={STANDS: 79}),
    "codes for not available": Table(
        changed(D, gas=((K >= 200) & (K < 260), 102), brake=((K >= 200) & (K < 260), 102)),
        reads={"engine_command": lambda t: np.interp(t, T, D["gas"])},
        aside={"of a code for 'not available'": 60, "outside -0.5..100.5 percent": 60}),
    "a tilted accelerometer": Table({**D, "a": A + 0.5}, of("acceleration", "a", "m/s^2"),
        reads={"acceleration": (lambda t: np.interp(t, T, A), 0.51)},
                                    says=("correct it by 'offset'",)),
    "a tilted accelerometer, corrected": Table(
        {**D, "a": A + 0.5}, of("acceleration", "a", "m/s^2", offset=-0.5), reads={"acceleration": A},
            unsaid=("offset", "tilted")),
}
# fmt: on


def _latin(path: Path, text: str) -> Path:
    path.write_text(text, encoding="latin-1")
    return path


def joined(recordings: list[Recording], channel: str) -> Array:
    return np.concatenate([r.channels.get(channel, np.full(len(r), np.nan)) for r in recordings])


@pytest.mark.parametrize("name", TABLES)
def test_what_is_read(tmp_path: Path, name: str) -> None:
    table = TABLES[name]
    path, meaning = table.write(tmp_path), table.meaning
    if meaning is None:
        meaning = yaml.safe_load(suggest_columns(path).text())
    for key, keys in table.proposes.items():
        entry = meaning["channels"][key] if key in meaning["channels"] else meaning[key]
        assert keys.items() <= entry.items() if isinstance(entry, dict) else entry == keys[""]
    recordings = import_table(path, meaning, tmp_path / "bag").recordings
    assert tuple(map(len, recordings)) == table.pieces
    time = np.concatenate([r.time for r in recordings])
    for channel, wanted in {"speed": speed, "acceleration": (lambda t: 0 * t, 1.5), **table.reads}.items():
        if wanted is None:
            continue
        wanted, off = wanted if isinstance(wanted, tuple) else (wanted, 0.02)
        values = joined(recordings, channel)
        expected = wanted(time) if callable(wanted) else wanted
        known = np.isfinite(values)
        assert known.any(), channel
        np.testing.assert_allclose(values[known], expected[known], atol=off, rtol=1e-3, err_msg=channel)
    account = recordings[0].account
    assert account is not None and account.balanced
    tallies = (account.total, *account.channels.values())
    for reason, count in table.aside.items():
        counted = [entry.count for tally in tallies for said, entry in tally.aside.items() if reason in said]
        assert sum(counted) == count, (reason, list(account.lines()))
    said = [*account.remarks, *(note for r in recordings for note in r.notes)]
    for words in table.says:
        assert any(words in line for line in said), said
    for words in table.unsaid:
        assert not any(words in line for line in said), said
    again = read(tmp_path / "bag", rate_hz=1.0 / recordings[0].dt)
    np.testing.assert_allclose(joined(again, "speed"), joined(recordings, "speed"), rtol=1e-12)
    assert set(said) <= {*account.remarks, *(note for r in again for note in r.notes)}
