"""Tables that are refused: the word that must be in the line, and the cure in it, which is followed as it
stands and gives what was driven.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from csv_tables import COLUMNS, SPEED, drive, speed, with_channels, write_csv

from deeptruck_core.errors import InputError
from deeptruck_model.recordings import import_table, suggest_columns
from deeptruck_model.recordings.tables.table_file import read_curve

Rows = dict[str, Any]
Cure = Callable[[Rows, str], Rows]
D = drive()
T, V, K = D["t"], D["v"], np.arange(600)
LONG = drive(1500)
ODD = K % 2 == 1
NOISE = np.random.default_rng(0).normal(0, 1, 6000)
HOUR = drive(6000)
ROAD = 0.03 * np.sin(2 * np.pi * HOUR["t"] / 90)


@dataclass(frozen=True)
class Refused:
    """What stands in the file, what it is said to mean, and what the refusal says: its first group is what
    `cure` makes other columns of; `curve` where a leader is refused in place of a drive."""

    rows: Rows | str
    meaning: Rows
    says: str
    cure: Cure | None = None
    encoding: str = "utf-8"

    def write(self, folder: Path) -> Path:
        """The file."""
        path = folder / "drive.csv"
        if isinstance(self.rows, str):
            path.write_text(self.rows, encoding=self.encoding)
        else:
            write_csv(path, self.rows, encoding=self.encoding)
        return path


def key(name: str, more: Rows | None = None) -> Cure:
    """A key of COLUMNS gets the value that the message has, as YAML."""
    return lambda meaning, said: {**meaning, name: more or yaml.safe_load(said)}


def keys(meaning: Rows, said: str) -> Rows:
    """COLUMNS get the line that the message has."""
    return {**meaning, **yaml.safe_load(said)}


def line(channel: str, form: str = "{}") -> Cure:
    """A channel gets the keys that the message has, as YAML."""

    def cured(meaning: Rows, said: str) -> Rows:
        entry = {**meaning["channels"][channel], **yaml.safe_load("{" + form.format(said) + "}")}
        return {**meaning, "channels": {**meaning["channels"], channel: entry}}

    return cured


def without(channel: str) -> Cure:
    """The channel named is left out."""
    return lambda meaning, said: {
        **meaning,
        "channels": {c: entry for c, entry in meaning["channels"].items() if c != channel},
    }


def of(channel: str, column: Any, unit: str, **more: Any) -> Rows:
    return with_channels(**{channel: {"column": column, "unit": unit, **more}})


def clock(cell: Callable[[int], str]) -> Rows:
    return {**D, "t": [cell(k) for k in K]}


def timed(unit: str) -> Rows:
    return {**COLUMNS, "time": {"column": "t", "unit": unit}}


def height(slope: Any) -> Any:
    rise = np.cumsum(np.sin(np.arctan(slope)) * speed(HOUR["t"])) * 0.1
    return np.round(300 + rise + 0.3 * NOISE, 1)


def undotted(v: float) -> str:
    return f"{v:.2f}".rstrip("0").rstrip(".").replace(".", "")


def sloped(grade: Any, slope: Any, unit: str) -> tuple[Rows, Rows]:
    """A drive with a grade that is none, and the height of a road."""
    rows = {**HOUR, "g": np.round(grade, 3), "h": height(slope)}
    channels = {"grade": {"column": "g", "unit": unit}, "elevation": {"column": "h", "unit": "m"}}
    return rows, with_channels(**channels)


def other_sender(every: int) -> Rows:
    late = np.round(3.6 * 1.01 * speed(T - 0.8), 3)
    return {**D, "v": np.where(K % every == 1, late, V)}


def two_rates() -> Rows:
    """Rows of a sender at 10 Hz, and of another one at 2.7 Hz, in the order of their times."""
    t = np.r_[T, np.arange(0.05, 60.0, 0.37)].round(3)
    v = np.r_[V, np.round(3.6 * 1.01 * speed(t[600:] - 0.8), 2)]
    order = np.argsort(t, kind="stable")
    return {"t": t[order], "v": v[order], "gas": 0 * t, "brake": 0 * t}


ONE_PEDAL = {
    "engine_command": {"column": "a", "unit": "ratio"},
    "brake_command": {"column": "a", "unit": "ratio", "scale": -1},
}
PLACED = {**LONG, "lat": 50 + np.cumsum(speed(LONG["t"])) * 0.1 / 111_195.0, "lon": np.full(1500, 8.0)}
PLACES = {"latitude": {"column": "lat", "unit": "deg"}, "longitude": {"column": "lon", "unit": "deg"}}
TWO = {**D, "car": np.where(ODD, "a", "b")}
TRUCKS = {
    **D,
    "t": 0.5 * K,
    "v": np.where(ODD, 95.0, 3.6 * speed(0.5 * K)),
    "Vehicle": np.where(ODD, "T-2", "T-1"),
}
SHUFFLED = {name: x[np.random.default_rng(0).permutation(600)] for name, x in D.items()}
COMPONENTS = {**D, "vx": V / 3.6 * np.cos(0.6), "vy": V / 3.6 * np.sin(0.6)}
RATE, ALONE = {"rate_hz": 1}, "v\n1\n2\n"


def bad(text: str = ALONE, **columns: Any) -> tuple[str, Rows]:
    """A text, and COLUMNS of its speed with keys changed, or left out by None."""
    given = {"time": RATE, "channels": SPEED, **columns}
    return text, {name: value for name, value in given.items() if value is not None}


def of_speed(**more: Any) -> tuple[str, Rows]:
    return bad(channels={"speed": {"column": "v", "unit": "m/s", **more}})


def of_cells(cells: list[Any], **time: Any) -> tuple[Rows, Rows]:
    """Times as they are written, and what they are said to be."""
    rows = {"t": cells, "v": np.full(len(cells), 5.0)}
    return rows, {"time": {"column": "t", **time}, "channels": SPEED}


# fmt: off
REFUSED = {
    # with a cure that is followed
    "dates": Refused(clock(lambda k: f"04.05.2026 09:58:{k // 10:02d}.{k % 10}"), COLUMNS,
        r"set time: (\{.*?\})", key("time")),
    "iso dates": Refused(clock(lambda k: f"2026-05-04 09:58:{k // 10:02d}.{k % 10}"), COLUMNS,
        r"set time: (\{.*?\})", key("time")),
    "whole seconds": Refused({**D, "t": np.floor(T)}, COLUMNS, r"set time: (\{.*?\})", key("time")),
    "one stamp": Refused({**D, "t": np.full(600, 7)}, COLUMNS, r"set time: (\{rate_hz: )\.\.\.",
        key("time", {"rate_hz": 10})),
    "a clock whose seconds lag": Refused(
        clock(lambda k: f"08:00:{max(k - 4, 0) // 10:02d}.{k % 10}"), timed("iso"),
            r"seconds and their fractions.*set time: (\{rate_hz: 10\})", key("time")),
    "a clock whose seconds lag now and then": Refused(
        clock(lambda k: f"08:00:{(k - 10 * (k % 100 < 4 <= k)) // 10:02d}.{k % 10}"), timed("iso"),
            r"seconds and their fractions.*set time: (\{rate_hz: 10\})", key("time")),
    "a clock without marks": Refused(
        clock(lambda k: f"{95830 + k // 10 + 40 * (k >= 300):06d}.{k % 10}"), COLUMNS,
            r"set time: (\{column: t, format: .*?\})", key("time")),
    "encoding": Refused({**D, "Höhe": V}, COLUMNS, r"set 'encoding' \(([\w-]+)", key("encoding"),
        encoding="latin-1"),
    "unit in cells": Refused({**D, "v": [f"{v} km/h" for v in V]}, of("speed", "v", "m/s"),
        r"give it (unit: \S+)$", line("speed")),
    "unit by range": Refused(D, of("speed", "v", "m/s"), r"'(unit: km/h)'", line("speed")),
    "mm/s, by places": Refused({**PLACED, "v": 1000 * speed(LONG["t"])},
        with_channels(speed={"column": "v", "unit": "m/s"}, **PLACES),
                               r"times what latitude and longitude give.* (mm/s)\?",
                                   line("speed", "unit: {}")),
    "mph for km/h, by places": Refused(PLACED, with_channels(speed={"column": "v", "unit": "mph"}, **PLACES),
                                       r"as (km/h) read as mph: give it its unit",
                                           line("speed", "unit: {}")),
    "accelerometer backwards": Refused({**D, "a": -D["a"]}, of("acceleration", "a", "m/s^2"),
        r"'(scale: -1)'", line("acceleration")),
    "accelerometer in g": Refused({**D, "a": D["a"] / 9.80665}, of("acceleration", "a", "m/s^2"),
        r"'(scale: [\d.]+)'", line("acceleration")),
    "accelerometer that stands": Refused({**D, "a": 0 * T}, of("acceleration", "a", "m/s^2"),
        r"(leave acceleration out)", without("acceleration")),
    "brake with a sign": Refused({**D, "brake": -D["brake"]}, COLUMNS, r"'(scale: -1)'",
        line("brake_command")),
    "torque without its offset": Refused({**D, "gas": D["gas"] + 125}, COLUMNS, r"'(offset: -125)'",
        line("engine_command")),
    "one component": Refused(COMPONENTS, of("speed", "vx", "m/s"), r"'(column: \[vx, vy\])'", line("speed")),
    "misspelt column": Refused(D, of("speed", "V", "km/h"), r"there is: t, (v),",
        line("speed", "column: {}")),
    "unit that does not fit": Refused(D, of("speed", "v", "kmph/s"), r"use one of: m/s, \S+, (km/h)",
        line("speed", "unit: {}")),
    "another vehicle": Refused(TWO, {**COLUMNS, "only": {"car": "c"}}, r"there is: (\w)", lambda m,
        said: {**m, "only": {"car": said}}),
    "two vehicles": Refused(TRUCKS, COLUMNS,
        r"'Vehicle' has 2 values \(T-1, T-2\), whose rows are interleaved: take one by (only: .*)", keys),
    "the pitch of the body": Refused(*sloped(-0.6 * HOUR["a"] + 0.02 * NOISE, 0.02 + 0 * ROAD, "deg"),
        r"pitch of the (body)", without("grade")),
    "the pitch of a phone": Refused(*sloped(0.8 * HOUR["a"] + 5.0 + 0.05 * NOISE, ROAD, "deg"),
        r"pitch of the (body)", without("grade")),
    "another road's slope": Refused(*sloped(3 * np.sin(2 * np.pi * HOUR["t"] / 47), ROAD, "percent"),
        r"does not follow what (height)", without("grade")),
    # without one
    "two vehicles that nothing names": Refused({**D, "v": np.where(ODD, 95.0, V)}, COLUMNS,
        "as where two senders"),
    **{f"every {every}. row another sender": Refused(other_sender(every), COLUMNS,
        f"every {every}. sample") for every in (2, 4, 5, 9)},
    "a sender of another rate": Refused(two_rates(), COLUMNS, r"at \d+ of 747 samples and back"),
    "no order": Refused(SHUFFLED, COLUMNS, "they are in no order; export them in the order of their time"),
    "one pedal": Refused({**D, "a": np.where(D["gas"] > 0, D["gas"], -D["brake"]) / 100},
        with_channels(**ONE_PEDAL),
                         "drives above zero and brakes below: give engine_command 'part: positive'"),
    "minutes": Refused(clock(lambda k: f"2026-08-05 {8 + k // 60:02d}:{k % 60:02d}:00"), timed("iso"),
        "rows are 60 s apart, which is too coarse"),
    **{f"lost points, scale {scale:g}": Refused({**D, "v": [undotted(v) for v in V]},
        of("speed", "v", "km/h", scale=scale), "ten times their neighbours")
       for scale in (1.0, 0.01)},
    # COLUMNS, and texts that are no table
    "no time": Refused(*bad(time=None), "'time' is missing"),
    "no rate": Refused(*bad(time={"rate_hz": 0}), "time.rate_hz: 0 is less"),
    "no channels": Refused(*bad(channels=None), "'channels' is missing"),
    "no speed": Refused(*bad(channels={"gap": {"column": "v", "unit": "m"}}), "at least 'speed"),
    "a channel of no name": Refused(*bad(channels={**SPEED, "mass": {"column": "v"}}),
        "unknown key 'mass'.* under 'extra'"),
    "no such column": Refused(*bad("w\n1\n2\n"), "no column 'v'; there is: w"),
    "no such clock": Refused(*bad(time={"column": "t"}), "no column 't'"),
    "no unit of speed": Refused(*of_speed(unit="rpm"), "does not fit"),
    "no unit": Refused(*bad(channels={"speed": {"column": "v"}}),
        "speed: 'unit' is missing.* as in {column: v, unit"),
    "no column": Refused(*bad(channels={"speed": {"unit": "m/s"}}), "channels.speed: 'column' is missing"),
    "late by a word": Refused(*of_speed(late_s=True), "late_s: True is not of type 'number'"),
    "late by nothing": Refused(*of_speed(late_s=None), "late_s: is empty"),
    "late by NaN": Refused(*of_speed(late_s=float("nan")), "late_s: nan is not of type 'number'"),
    "later than a drive": Refused(*of_speed(late_s=10.5), "late_s: 10.5 is greater than the maximum of 10"),
    "a misspelt key": Refused(*of_speed(late=1.0), "speed: unknown key 'late'; did you mean late_s"),
    "another misspelt key": Refused(*bad(seperator=";"), "unknown key 'seperator'"),
    "a misspelt key of time": Refused(*bad(time={"colum": "t"}), "time: unknown key 'colum'"),
    "two delimiters": Refused(*bad(delimiter=";;"), "one character"),
    "rows to skip": Refused(*bad(skip_rows=-1), "skip_rows"),
    "a step of no channel": Refused(*bad(split_at={"elevation_step": 4}), "no column is named"),
    "no step": Refused(*bad(split_at={"speed_step": 0}), "speed_step: 0 is less"),
    "no unit of time": Refused(*bad("t,v\n0,1\n1,2\n", time={"column": "t", "unit": "weeks"}),
        "time.unit: 'weeks' is not one of.*other dates need a format"),
    "rows without a time": Refused(*bad("t,v\n0,1\n,2\n1,3\n", time={"column": "t"}),
        "1 rows have no time in 't', first line 3"),
    "no numbers": Refused(*bad("v\nx\ny\nz\nx\n"), "column 'v' holds no numbers"),
    "one row": Refused(*bad("v\n1\n"), "has one row"),
    "no row": Refused(*bad("v\n"), "is empty"),
    "nothing": Refused(*bad(""), "cannot be read|is empty"),
    "prose": Refused(*bad("Dear reader\nthis, then, is prose\nand, as such, no table\n"),
                     "its header has 1 cell, and none of the 2 rows below has as many; set 'delimiter'"),
    "no truck's speed": Refused(*bad("v\n100\n200\n"), "is its unit right"),
    "a header that is too short": Refused(*bad("t,v\n0,1,5\n1,1,6\n2,1,7\n"),
        "has 2 cells, and none of the 3 rows below"),
    "a mark of thousands": Refused(*bad("t,v,km\n0,1,9.5\n1,1,1,000.5\n2,1,1,001.5\n3,1,1,002.5\n"),
        "must be quoted"),
    "a title": Refused(*bad("log\nt,v\n0,1\n1,2\n"), "'skip_rows'"),
    "words for times": Refused(*bad("t,v\n0,1\n?,2\n?,3\n3,4\n", time={"column": "t"}),
        "2 rows have no time in 't', first line 3 with '\\?'"),
    # times
    "seconds as dates": Refused(*of_cells(["1700000000", "1700000001"], unit="iso"),
        "unit: s or unit: ms or"),
    "months in Spanish": Refused(*of_cells(["05-ago.-2026"] * 2, unit="iso"),
        "'05-ago.-2026' in line 2; set time: .* format:"),
    "days or months": Refused(*of_cells(["01/02/2026 10:00", "01/02/2026 10:01"], unit="iso"),
        '"%d/%m/%Y %H:%M" or .* "%m/%d/%Y %H:%M"'),
    "another format": Refused(*of_cells(["2026-01-01 10:00"] * 2, format="%d.%m.%Y"), "unit: iso}"),
    "blank times": Refused(*of_cells(["", ""], unit="iso"), "'t' has no time"),
    "rounded nanoseconds": Refused(*of_cells(["1.70000E+18"] * 9, unit="ns"), "first 9 rows"),
    "dates of whole seconds": Refused(
        *of_cells([f"2026-08-05 10:00:{k // 10:02d}" for k in range(45)], unit="iso"),
        r"drop doubled rows, .* set time: {rate_hz: [\d.]+}"),
    "dates of whole minutes": Refused(
        *of_cells([f"05.08.2026 10:{k // 60:02d}" for k in range(300)], format="%d.%m.%Y %H:%M"),
        "rate_hz: 1}"),
    "each second twice": Refused(*of_cells([k // 2 for k in range(40)], unit="s"), "rate_hz: 2}"),
    "a unit and a format": Refused(*of_cells([0, 1], unit="s", format="%H"), "instead of the unit"),
    "no format": Refused(*of_cells([0, 1], format="%Q"), "'%Q'"),
    "a unit of two columns": Refused(*bad(time={"column": ["a", "b"], "unit": "s"}),
        "a date and a time of day"),
    # channels of a user's own
    "extra, a channel": Refused(*bad(extra={"gear": "g"}), "'gear' does not fit"),
    "extra, a blank": Refused(*bad(extra={"oil temperature": "T"}), "letters, digits and _"),
    "extra, a unit": Refused(*bad(extra={"oil": {"column": "T", "unit": "degC"}}), "unknown key 'unit'"),
    "extra, a list": Refused(*bad(extra=["oil"]), "extra: .'oil'. is not of type 'object'"),
    "a driver of no kind": Refused(*bad(driven_by="me"), "driven_by: 'me' is not one of"),
    "no encoding": Refused(*bad("v;µ\n1;2\n", encoding="klingon"), "cannot be read"),
}
# fmt: on


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_refused_and_its_cure(tmp_path: Path, name: str) -> None:
    row = REFUSED[name]
    path = row.write(tmp_path)
    with pytest.raises(InputError) as refused:
        import_table(path, row.meaning, tmp_path / "refused")
    said = re.search(row.says, str(refused.value))
    assert said is not None and "\n" not in str(refused.value), refused.value
    assert [p.name for p in tmp_path.iterdir()] == [path.name]
    if row.cure is None:
        assert "lost" not in name or "scale" not in str(refused.value)
        return
    recordings = import_table(path, row.cure(row.meaning, said[1]), tmp_path / "bag").recordings
    (r,) = recordings
    assert len(r) > (250 if "only" in row.cure(row.meaning, said[1]) else 590)
    assert np.abs(r.channels["speed"] - speed(r.time - r.start_s)).max() < 0.3
    assert np.nanmax(np.abs(r.channels["acceleration"])) < 1.5
    if "grade" in row.meaning["channels"]:  # and the grade is that of the heights
        slope = ROAD if "phone" in name or "another" in name else 0.02 + 0 * ROAD
        assert np.abs(r.channels["grade"] - slope).mean() < 0.005


LISTED = "".join(f"Channel : {name}\nID : 1\n" for name in ("Speed", "Throttle", "Brake"))
NO_TABLES = {
    "": "drive.csv is empty",
    "It was a dark night.\n": "is no table: none of its first 1000 lines has two cells of numbers",
    "0.0,1.0\n0.1,1.1\n0.2,1.2\n": "has no header: add a line with the columns' names",
    "0,100\n10D,54\n10C,900\n" * 9: r"a code and a value in each row \(0, 10D, 10C\)",
    "a\0b": "is no text table but binary",
    f"Log : 1.1\n{LISTED}" + "".join(f"14:15:{s:06.3f},{v},30,0\n" for s, v in zip(T[:50], V, strict=False)):
        "in line 8: Time,Speed,Throttle,Brake",
}  # fmt: skip


@pytest.mark.parametrize("text", NO_TABLES, ids=[*NO_TABLES.values()])
def test_what_suggest_refuses(tmp_path: Path, text: str) -> None:
    (tmp_path / "drive.csv").write_text(text)
    with pytest.raises(InputError, match=NO_TABLES[text]):
        suggest_columns(tmp_path / "drive.csv")


def test_a_leader_of_two_vehicles_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="column 'Vehicle' has 2 values"):
        read_curve(write_csv(tmp_path / "leader.csv", TRUCKS), over="t", of="v")


def test_a_leader_of_which_the_speed_drops_out(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    v = np.where((T >= 20) & (T < 21), 0.0, V / 3.6)
    path = write_csv(tmp_path / "leader.csv", {"time": T, "speed": np.round(v, 3)})
    t, bridged = read_curve(path, "time", "speed")
    assert len(t) == 590 and bridged.min() > 7.0
    assert "10 that jump to a number for no value and back, bridged" in capsys.readouterr().err


def test_files_that_are_not_there_and_folders_that_are_another_s(tmp_path: Path) -> None:
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
